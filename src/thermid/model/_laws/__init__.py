"""Quantities that change: in time, with temperature, with anything else.

In: texts with units, tables of points, formulas. Out: a `Signal` over time, a `Curve` over temperature, the law of a load or a
conductance, the specific heat of a store; each with its derivatives.
"""
