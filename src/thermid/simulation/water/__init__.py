"""Water in a box: vapour, condensation, purge gas. Optional.

In: a model with a scenario, or a `Solution`; walls, openings, purge gas. Out: a `Moisture`: dew points, water on the walls, when and how
much.
May import: `physics`, `model`, `network`, `simulation` and the foundation.
"""
