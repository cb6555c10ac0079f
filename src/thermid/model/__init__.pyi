"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.model.tree import (
    Identity as Identity,
    Replacement as Replacement,
    Standing as Standing,
    identities as identities,
    law as law,
    ledger as ledger,
)
