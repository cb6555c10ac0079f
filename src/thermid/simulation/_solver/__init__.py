"""The equations of a network in a scenario, solved by the kernel.

In: a compiled network, a `Scenario`, options. Out: the wiring of inputs, temperatures at the times asked for with their derivatives and
turning points, where a network settles; large networks as sparse arrays.
"""
