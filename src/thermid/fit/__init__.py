"""The values of a model that logs ask for.

In: a model, records, and what is free. Out: a `Calibration`: values with their errors, how every sensor is met, and what a reader
must know; or a refusal that says why. The packages inside are its floors: what is compared, its minimum, the errors of the end,
second clocks; here stand `calibrate` and its result.
May import: `fit.problem`, `fit.minimisation`, `fit.uncertainty`, `fit.second_clocks` and the rooms below a fit.
"""
