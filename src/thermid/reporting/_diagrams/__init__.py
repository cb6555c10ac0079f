"""A model as a picture.

In: a model, the submodels that are drawn as one mass, and the answer of a run whose heat flows are written beside the lines. Out: SVG text
that needs nothing from outside; the folding that the picture and the studio share.
"""
