"""A model against what it must meet: a record as it stands, stated criteria, its own last version.

In: a model or a `Calibration`, a record that no fit has seen, criteria. Out: a `Verdict`, a comparison, a difference; and how often a
held-out record was looked at.
May import: `fit` and the rooms below a fit.
"""
