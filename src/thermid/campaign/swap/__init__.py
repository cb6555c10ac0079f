"""A part is replaced: what that touches, which stages and tests are due again.

In: a `Campaign` and the new part. Out: a `RetunePlan` with what every sensor is predicted to show, and the campaign with only those
stages fitted anew that are due.
May import: `campaign`, `fit` and the rooms below a fit.
"""
