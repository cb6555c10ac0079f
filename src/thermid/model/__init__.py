"""What the hardware is, and nothing else: no equation is solved here.

In: decks, or elements made in Python. Out: a frozen `Model` or `Block`. Nothing stands here itself. The packages inside, each of which
knows only those before it: `laws`, quantities that change; `parts`, elements and their values; `tree`, a `Model` and what follows from
it; `deck`, its files; `blocks`, solids in equal cells.
May import: `physics` and the foundation.
"""
