"""The hooks of the site, which lie beside the package and not in it."""

from __future__ import annotations

import sys

from .pages import ROOT

sys.path.append(str(ROOT / "scripts"))

from docs_hooks import PICTURES, commands, rooms, turned, virtual_pages
from formulas import mathml

__all__ = ["PICTURES", "commands", "mathml", "rooms", "turned", "virtual_pages"]
