"""A solid in equal cells, with exchange on its faces.

In: the size of a block, its material, cells, heaters, sinks and faces. Out: a frozen `Block`, which the simulation takes in place of a
model; the same as a `Model` where it is small.
"""
