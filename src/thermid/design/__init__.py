"""The test to make next.

In: a model with what is known of it, and tests that could be made: scenarios with their sensors. Out: `Advice`: the tests ranked by
the error that each would leave of an aim.
May import: `fit`, `prediction` and the rooms below a fit.
"""
