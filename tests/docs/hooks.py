"""The hooks of the site, which lie beside the package and not in it."""

from __future__ import annotations

import sys

from .pages import ROOT

sys.path.append(str(ROOT / "scripts"))

import fold_decisions
import gallery
import notebooks
import studio_pictures
from docs_hooks import MADE, PICTURES, commands, rooms, turned, virtual_pages
from formulas import mathml

__all__ = [
    "MADE",
    "PICTURES",
    "commands",
    "fold_decisions",
    "gallery",
    "mathml",
    "notebooks",
    "rooms",
    "studio_pictures",
    "turned",
    "virtual_pages",
]
