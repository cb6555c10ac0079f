"""Test profiles run on a model.

In: a model and a `ThermalProfile`. Out: a `ProfileRun`: phases with their durations, each dwell beginning when the unit is stable, and what
a reader must know of it; what humidity does where it is asked for, by the optional part of sites and moisture.
"""
