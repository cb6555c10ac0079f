"""Two logs on two clocks: the offset and the rate with which temperatures follow powers.

In: a model and two records, or a problem of which a record has a second clock. Out: an `Alignment`, or the start of a fit in the
valley of the right clock.
May import: `fit.problem`, `fit.least_squares`, `fit.uncertainty` and the rooms below a fit.
"""
