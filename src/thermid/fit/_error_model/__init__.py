"""The model of error: what is not known beside a fit, as Gaussian unknowns whose sizes are averaged over.

May import: `base`, `fit`, `model`, `physics`, `simulation`, `values`.
"""
