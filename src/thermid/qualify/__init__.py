"""From a calibrated model to a qualified box: a plan fixed before any log is read, worked through to one verdict, and the delivery.

In: a plan: tests, sensors, criteria, limits; the logs that came back; or a model to hand on. Out: a `Plan` with its lock, a
`Qualification`: every test predicted, held against limits and judged against its log; a delivery folder that was checked.
May import: `sourced`, `profiles`, `profile_runs`, `steadiness`, `reduction`, `fit`, `judge`, `explain`, `prediction`, `campaign`,
`monte_carlo` and the rooms below a fit.
"""
