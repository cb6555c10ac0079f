"""The equations of a model, and their solution in a scenario.

In: a `Model` and a `Scenario`. Out: a `Solution` with temperatures [K], heats [W] and extremes by name; a steady state; an ensemble of
members with other values. Inside: `_network`, the equations; `_scenarios`, what is done to the hardware; `_solver`, which hands both to
the kernel.
May import: `_kernel`, `base`, `measure`, `model`, `physics`, `values`.
"""
