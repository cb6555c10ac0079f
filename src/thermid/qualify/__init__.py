"""From a calibrated model to a qualified box: test profiles, running tests, a plan fixed before any log is read, and the delivery.

In: a plan: tests, sensors, criteria, limits; the logs that came back; a growing log. Out: a `Plan` with its lock, a `Qualification`:
every test predicted, compared with limits and judged against its log; when a running test may stop; a delivery folder that was checked.
May import: `base`, `campaign`, `fit`, `inference`, `measure`, `model`, `prediction`, `simulation`, `values`.
"""
