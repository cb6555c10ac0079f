"""A model run many times, all that is not known drawn anew each time.

In: a model in a scenario, what is known of its values, and how often, or a question in a file. Out: `UncertainRuns`: chunks kept in a
folder, the distributions of temperatures and what drives them; a `Hold`: how long limits are kept, with which probability.
"""
