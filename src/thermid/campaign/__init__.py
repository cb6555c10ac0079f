"""Fits in stages, from components to the whole, as a file describes them, and verdicts on them.

In: a campaign file: records, stages, what each inherits, verdicts. Out: a `Campaign`: a `Calibration` of every stage with the standing
that verdicts leave it, kept in a results folder under the hash of all that it depends on; a fit over all levels; the plan of a replaced
part; the source of every value; a first project proposed from a log.
May import: `base`, `fit`, `inference`, `measure`, `model`, `physics`, `prediction`, `simulation`, `values`.
"""
