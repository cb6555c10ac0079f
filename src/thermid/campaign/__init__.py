"""Fits in stages, from components to the whole, as a file describes them.

In: a campaign file: records, stages, what each inherits, verdicts. Out: a `Campaign`: a `Calibration` of every stage with the standing
that verdicts leave it, kept in a results folder under the hash of all that it depends on; a fit over all levels (`joint`); values
tuned by hand; what every value rests on (`credibility`).
May import: `fit`, `power`, `explain`, `judge`, `inference` and the rooms below a fit.
"""
