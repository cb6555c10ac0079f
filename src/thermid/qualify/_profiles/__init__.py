"""Profiles of environmental tests: what a standard, or a file like one, asks of a unit.

In: a name of the library here, or a file. Out: a `ThermalProfile`: its numbers with their clauses, its steps one after the other, its
checks, its text; and how many cycles of another range are worth those of a standard.
"""
