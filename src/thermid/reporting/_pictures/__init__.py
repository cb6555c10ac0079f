"""Curves over time, as markup for a page or as files.

In: results with curves: readings beside a simulation, a profile, a hold time, a log as it was read. Out: figures (`Drawn`),
the picture of a result (`picture`), the look at a log (`look`).
"""
