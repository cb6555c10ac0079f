"""Running a model in a scenario.

In: a `Model` and a `Scenario`. Out: a `Solution` with temperatures [K], heats [W] and extremes by name; a steady state; an ensemble of
members with other values. `scenarios` says what is done to the hardware, `solver` hands the network to the kernel.
May import: `model`, `network`, `physics`, `knowledge`, the kernel and the foundation; `simulation.scenarios` the readers of logs besides.
"""
