"""Why a model misses its readings, and whether what was fitted is physical.

In: a `Calibration`, or readings beside a simulation. Out: tests of its residuals and elements that would answer them (`criticise`), which
group of parameters would explain deviations (`diagnose`), the balance of watts in a stretch, values beside correlations and ranges
(`plausibility`).
"""
