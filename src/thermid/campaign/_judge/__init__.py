"""Comparison of a model with its requirements: records, criteria, limits, an earlier version; and the one table of residual metrics.

In: a model or a `Calibration`, a record that no fit has seen, criteria, limits. Out: a `Verdict`, a `Correlation`, a comparison, a
difference; checks of temperatures against limits, the margins to them and those of heaters; how often a held-out record was looked at.
"""
