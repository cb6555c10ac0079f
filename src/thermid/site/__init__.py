"""A place on the ground, an ascent, an orbit: sun, sky, weather, wind and thin air as scenarios. Optional.

In: latitude, weather, trajectories, the tables of a scenario file that name them. Out: a `Site`, a `Scenario` of the pad or of an ascent,
radiation on surfaces. Of the core, only the reader of scenario files knows it.
May import: `physics`, `model`, `network`, `measure`, `simulation.scenarios` and the foundation.
"""
