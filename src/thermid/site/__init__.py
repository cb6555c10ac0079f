"""Site and moisture: a place on the ground, an ascent, an orbit; sun, sky, weather, wind; vapour and water in a box. Optional.

In: latitude, weather, trajectories, the tables of a scenario file that name them; a model with a scenario, walls, openings, purge gas.
Out: a `Site`, a `Scenario` of the pad or of an ascent, radiation on surfaces; a `Moisture`: dew points, water on the walls, when and how
much. The core never imports it: what it adds stands behind the points of `thermid.extensions`.
May import: `physics`, `model`, `network`, `measure`, `simulation`, `sourced` and the foundation.
"""
