"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.model.laws.law import law as law
from thermid.model.parts.parameter import Standing as Standing
from thermid.model.tree.areas import ledger as ledger
from thermid.model.tree.identity import Identity as Identity
from thermid.model.tree.model import identities as identities
from thermid.model.tree.replacement import Replacement as Replacement
