"""`Model`, the tree of parts, and what follows from it: names, values, identities, surfaces, remarks.

In: elements and submodels. Out: a frozen `Model`; its table of values, which of them are one, its areas, itself laid flat for equations,
itself as a dictionary; a part replaced; its check.
"""
