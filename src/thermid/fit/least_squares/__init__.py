"""Minima of a problem: bounded least squares, and searches beyond one valley.

In: a `Problem`. Out: where its cost is least, with the covariance of the unknowns by the noise of the readings and the priors.
May import: `fit.problem` and the rooms below a fit.
"""
