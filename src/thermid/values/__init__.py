"""What is known of the values of a model: their state, their uncertainty by named source, and how far they may be trusted.

In: fitted values with covariances, values files, stated spreads. Out: a `Store`: states of values and instruments with their responses
to named sources, laid over a model, saved, cut and joined; values with errors as a view of it.
May import: `base`, `model`.
"""
