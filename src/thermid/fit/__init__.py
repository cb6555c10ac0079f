"""The values of a model that fit its logs, with the errors of the data.

In: a model, records, and what is free. Out: a `Calibration`: values with their errors, how every sensor is met, and what a reader must
know; or a refusal with its reason. Inside: `_problem`, what is compared; `_minimisation`, one descent; `_search`, further starts;
`_uncertainty`, errors of the end; `_power`, unmeasured powers; `_estimation`, process noise.
May import: `base`, `measure`, `model`, `physics`, `simulation`, `values`.
"""
