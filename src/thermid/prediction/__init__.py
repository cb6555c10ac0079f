"""The uncertainty room: what a model leaves open in a scenario, by named source, and the questions that are asked of it.

In: a fit, a values file or stated spreads, and a scenario. Out: a `Prediction`: temperatures with a band, its sources, and what is not
counted; coefficients taken apart into radiation and convection (`split`).
May import: `explain`, `fit` and the rooms below a fit.
"""
