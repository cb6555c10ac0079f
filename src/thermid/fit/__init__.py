"""The values of a model that logs ask for.

In: a model, records, and what is free. Out: a `Calibration`: values with their errors, how every sensor is met, and what a reader
must know; or a refusal that says why. The floors: `problem` (what is compared), `minimisation` (one descent), `search` (further starts),
`uncertainty` (errors of the end), `second_clocks`, and above them `discrepancy` (what the model's structure leaves open), `calibration`
(the result) and `calibrate`.
May import: `fit.problem`, `fit.minimisation`, `fit.uncertainty`, `fit.search`, `fit.second_clocks` and the rooms below a fit.
"""
