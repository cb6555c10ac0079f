"""What a log determines of the unknowns of a fit, and what its residuals show.

In: a model with a record, one planned, or a `Calibration`. Out: what is identifiable, profile likelihoods, parameter trade-offs,
posterior samples; candidates that would explain a misfit, energy balances, plausibility.
May import: `base`, `fit`, `measure`, `model`, `physics`, `simulation`, `values`.
"""
