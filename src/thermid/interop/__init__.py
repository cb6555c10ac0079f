"""Exchange with other tools. Optional.

In: decks of SINDA and ESATAN, an InitFcn script of Simulink, an FMU, or a model in a scenario. Out: a deck of the values; programs for
Octave, C, Modelica and SPICE, an FMU, the state equations as symbols. What a format cannot state is refused.
May import: `_kernel`, `base`, `model`, `simulation`.
"""
