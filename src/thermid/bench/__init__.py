"""Names for work at a bench: sensors, stability, forecasts. They stand in `measure`, `steadiness` and `reporting`.

In: names that are asked for. Out: what `thermid/__init__` lists under them.
"""
