"""Models made of models: fewer masses in a part, a unit on its host.

In: a model with the scenarios that matter, or a unit and its host. Out: a `Reduction`: a deck that stands in the part's place and how far
it is off; a macro model, every value of the host with its source.
"""
