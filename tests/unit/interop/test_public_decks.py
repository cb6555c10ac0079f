"""Public decks that nobody here wrote, read where they lie under THERMID_PUBLIC: every statement is taken over or named, and orbits come out as printed.

The statements are counted by a tokenizer of this file's own, which shares nothing with the readers.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from thermid.interop._decks.esatan import read_esatan
from thermid.interop._decks.network_file import NetworkFile
from thermid.interop._decks.results import agreement, sinda_print
from thermid.interop._decks.sinda import read_sinda

PUBLIC = Path(os.environ.get("THERMID_PUBLIC", "/nowhere"))
DAVIS = "Space-and-Satellite-Systems-UC-Davis/Structure-Thermal-Desktop"
MLI = "nodoka716/MLI_test"
AIR_LAUNCH = "afcarl/Air-Launch-Vehicle-Thermal-Analysis-and-Trade-Study/SINDA"
DECKS = {
    "bpar907/APSS-2-Thermal-TXRX/case0.inp": "",
}


def _public(name: str) -> Path:
    file = PUBLIC / name
    if not file.is_file():
        pytest.skip(f"{name} is not under THERMID_PUBLIC")
    assert hashlib.sha256(file.read_bytes()).hexdigest() == DECKS[name]
    return file


ROW = re.compile(r"\s*(?:(?:SI[VMT]|SP[VM]|DI[VMT]|DP[VM]|BI[VM]|CAL|GEN|PI[VM]|DT[VM]|LST|T[SV]PS)\s+)?-?\d+\s*,", re.I)
SOURCE = re.compile(r"\s*(\w+)\.Q(\d+)\s*=", re.I)
ESATAN = {"NODES": re.compile(r"\s*[DBX]\d+\s*="), "CONDUCTORS": re.compile(r"\s*G[LRFV]\s*\(")}


def _read(deck: Path) -> NetworkFile:
    if deck.suffix == ".d":
        return read_esatan(deck)
    return read_sinda(deck, "BTU in F s" if deck.suffix == ".sin" else "W m K")


def _files(deck: Path) -> list[Path]:
    """Return a deck and the text files that it inserts; of a binary one the text beside it."""
    inserted = re.findall(r"(?im)^\s*INSERT\s+(\S+)", deck.read_text("latin-1"))
    return [deck, *(deck.parent / re.sub(r"\.k_in$", ".k", name) for name in inserted)]


def _statements(deck: Path) -> Iterator[tuple[str, int, str]]:
    """Yield file, line and the node that a source heats ("" for rows of nodes and conductors)."""
    for file in _files(deck):
        block = ""
        for k, line in enumerate(file.read_text("latin-1").splitlines() if file.is_file() else [], 1):
            if header := re.match(r"\s*(?:HEADER|BCD\s+3)\s*(\w+\s+\w+)|\s*\$(NODES|CONDUCTORS|\w+)", line):
                block = re.sub(r"\s+", " ", header[1] or header[2]).upper()
                continue
            if re.match(r"[Cc*#](?![\w.]*=)", line):
                continue
            text = line.split("$")[0].split("#")[0]
            if (block in {"NODE DATA", "CONDUCTOR DATA"} and ROW.match(text)) or (block in ESATAN and ESATAN[block].match(text)):
                yield file.name, k, ""
            elif block.startswith("VARIABLES") and (source := SOURCE.match(text)):
                yield file.name, k, f"{source[1]}.T{source[2]}".upper()


def _shares(deck: Path, network: NetworkFile) -> tuple[int, int, list[str]]:
    """Return how many statements there are, how many of them were taken over, and the places of those that are nowhere."""
    every = list(_statements(deck))
    read = {(os.path.basename(x.where.file), x.where.line) for x in (*network.nodes, *network.conductors, *network.loads)}
    named = {(os.path.basename(r.where.file), r.where.line) for r in network.remarks if r.dropped}
    heated = {".".join(load.into).upper() for load in network.loads}
    taken = [(f, k) for f, k, node in every if (f, k) in read or node in heated]
    lost = [f"{f}:{k}" for f, k, node in every if (f, k) not in read and node not in heated and (f, k) not in named]
    return len(every), len(taken), lost


@pytest.mark.parametrize("name", DECKS)
def test_every_statement_is_taken_over_or_named(name: str) -> None:
    deck = _public(name)
    count, taken, lost = _shares(deck, _read(deck))
    assert count > 10
    assert lost == []
    assert taken >= 0.95 * count
