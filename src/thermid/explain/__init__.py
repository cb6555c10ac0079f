"""Why a model misses its readings, and whether what was fitted is physical.

In: a `Calibration`. Out: tests of its residuals and elements that would answer them (`criticise`), the balance of watts in a stretch,
values beside correlations and ranges (`plausibility`).
May import: `fit` and the rooms below a fit.
"""
