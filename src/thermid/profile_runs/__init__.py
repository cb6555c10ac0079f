"""Test profiles and ascents run on a model.

In: a model and a `ThermalProfile`, or the run of an ascent. Out: a `ProfileRun`: phases with their durations, each dwell beginning when the
unit is stable, and what a reader must know of it; dew points where it is asked for; the limits of an ascent, checked.
May import: `sourced`, `profiles` and the rooms below a fit.
"""
