"""Pure functions of heat transfer: SI in, SI out; each cites its source and repeats a number from it.

conduction, contact, convection, radiation   conductances [W/K] and the coefficients they are made of
plates                                       correlations of free convection
htc                                          a measured coefficient beside its theory; whether one node is enough
air, materials, constants                    properties, with the source of each value

Everything called a conductance is plain arithmetic (but for the logarithm of a cylinder and the tanh of a finite fin), so it also takes
arrays and numbers that carry derivatives.

May import: `base`.
"""
