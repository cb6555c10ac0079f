"""The equations of a model.

In: a `Model`, the state of each gas, and which nodes are prescribed. Out: a `Network`: rows of conductors, loads and nodes with their
numbers (W, J and K), massless nodes eliminated, matrices and modes; the same network serves many values.
"""
