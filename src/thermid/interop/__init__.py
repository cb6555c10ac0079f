"""Exchange with other tools.

In: an InitFcn script of Simulink, or a model in a scenario. Out: a deck of the script's values; a program for Octave, a netlist for SPICE,
the state equations as symbols. What a format cannot say is refused in words.
May import: `model`, `network`, `physics`, `measure`, `simulation` and the foundation.
"""
