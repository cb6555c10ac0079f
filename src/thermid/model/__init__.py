"""What the hardware is, and nothing else: no equation is solved here.

In: decks, or elements made in Python. Out: a frozen `Model` or `Block`. The packages inside, each of which knows only those before it:
`_laws`, quantities that change; `_parts`, elements and their values; `_tree`, a `Model` and what follows from it; `_deck`, its files;
`_blocks`, solids in equal cells.
May import: `base`, `physics`.
"""
