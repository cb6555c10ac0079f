"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.model.elements import Standing as Standing, law as law
from thermid.model.identity import Identity as Identity, Replacement as Replacement
from thermid.model.tree import identities as identities, ledger as ledger
