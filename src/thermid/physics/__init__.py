"""Pure functions of heat transfer: SI in, SI out; each cites its source and repeats a number from it.

conduction, contact, convection, radiation   conductances [W/K] and the coefficients they are made of
plates, biot                                 correlations of free convection; whether one node is enough
htc                                          a measured coefficient beside its theory
air, materials, constants                    properties, with the source of each value
lumped, decay, two_nodes                     closed forms: the oracles of the tests, and the hand calculations of a report

Everything called a conductance is plain arithmetic (but for the logarithm of a cylinder and the tanh of a finite fin), so it also takes
arrays and numbers that carry derivatives.
"""
