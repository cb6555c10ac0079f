"""Site and moisture: a place on the ground, an ascent, an orbit; sun, sky, weather, wind; vapour and water in a box. Optional.

In: latitude, weather, trajectories, tables of a scenario file that name them; a model in moist air. Out: a `Site`, a `Scenario` of the pad
or of an ascent; a `Moisture`: dew points, water on the walls, when and how much. The core never imports it: it announces what it adds
by entry points.
May import: `base`, `measure`, `model`, `physics`, `simulation`.
"""
