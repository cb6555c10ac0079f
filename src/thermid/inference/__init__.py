"""What a log says of the unknowns of a fit, beyond its minimum and covariance.

In: a model with a record, one planned, or a `Calibration`. Out: what is identifiable and what would help (`identifiability`), the
profile of one parameter, the valley of two, posterior samples and evidence.
May import: `fit`, `design` and the rooms below a fit.
"""
