"""Public decks that nobody here wrote, read under THERMID_PUBLIC: every statement is taken over or named, and orbits come out as printed.

The statements are counted by a tokenizer of this file's own, which shares nothing with the readers.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from public_files import public_file
from thermid.interop._decks.esatan import read_esatan
from thermid.interop._decks.network_file import DeckRemark, NetworkFile
from thermid.interop._decks.results import agreement, sinda_print
from thermid.interop._decks.sinda import read_sinda

DAVIS = "Space-and-Satellite-Systems-UC-Davis/Structure-Thermal-Desktop"
MLI = "nodoka716/MLI_test"
TUTORIALS = f"{DAVIS}/Reference Files and Tutorials"
METHANE, LOX, SUNLIT = "CH4_Vap_9ft_Dia/Rev_C1_wo_solar_wo_earth", "LOX_Liq_12ft_Dia/Rev_A", "LOX_Liq_12ft_Dia/Rev_D3_w_solar_w_earth"
AIR_LAUNCH = "afcarl/Air-Launch-Vehicle-Thermal-Analysis-and-Trade-Study/SINDA"
DECKS = {
    "bpar907/APSS-2-Thermal-TXRX/case0.inp": "33a04d26c2a1971b04cc73dfd1bdf172ec3093f4d416d32e7d7d81e0f0c04882",
    "oresat/oresat-thermal/OreSat0.5/case0.inp": "a3da591c1faa2fa42dc75a171538365961a29af7db3c3d6727e284f5500a6cb2",
    "oresat/oresat-thermal/OreSat Main v12/Hot Case/HotCase.inp": "035bab0885b112410e823de7df2648beb30e7824430477afee834f0fb5584dca",
    f"{MLI}/Insulation/case1.inp": "2fa05856116de6e672f69c20012d123c9d14a60867ea435bd322a00e48cb93f5",
    f"{MLI}/Insulation/case2.inp": "f77bb05b95d837ad1717cfe0557169bcd608e44530fd09f154cddea2e58a2cd5",
    f"{MLI}/Opticalprop/case1.inp": "13bb2ecd40c12c340ba1090cf01589813854a87357db84954a8e2c39b59d935f",
    f"{MLI}/Panel/case1.inp": "34133176c24a5cdb6a052891763819bd2e40b654b38efaa6e4218e650a570828",
    f"{DAVIS}/OLD_Working CubseSAT Model/case1.inp": "9fdf3379cbd9bcc77226efa34694678c121df2a06589f66fdd8a55df7b0fcdad",
    f"{TUTORIALS}/CRTech Tutorials/2. ModelBrowser_63/case1.inp": "506f656527270d03a4cfc39a5f6e56e5364e906361896e835d3f7c324da4da02",
    f"{TUTORIALS}/Workshops/Ryan/case0.inp": "275b2087b35803bceee07eb63a4944c5e4b9adfd9b93f03d454f2ad0a6062764",
    f"{TUTORIALS}/Workshops/Selene/case0.inp": "a49a988c14cee281c972055fcbb57578f09f091dfd81fcb4b918172080f0bb7e",
    f"{DAVIS}/Working CubeSat Model/case5.inp": "261c2cf44ecffe26cf9545bba7b13e0575058e0a35cbd3d09a1a7a95b004d919",
    f"{DAVIS}/Working CubeSat Model/case8.inp": "7200892ab6ea639588ea871f821ee721c94b214de72d06e913996e70d3e368f2",
    "mlauryn/EsatanOpt/Radiator/radiator.d": "e784683c76b0daefbf6fcf7335faef5ead285ad40de79987dbb4f0bd7ba7ceeb",
    f"{AIR_LAUNCH}/{LOX}/AL_PLP_a.sin": "ebcc8e799d940d14a8140345eaa1a6edcb74549edebe233cdbbc9ce8008adcd3",
    f"{AIR_LAUNCH}/{SUNLIT}/AL_PLP_d3.sin": "e9cc71a8b9ab122d691850d523e6e5074005136975a5f1103bdfce87b8bbb130",
    f"{AIR_LAUNCH}/{METHANE}/AL_PLP_c1.sin": "678dce6a1c30d7bf160b7e647bb94c98d4d100454d707c867338b7bbaba12b32",
}
"""SHA-256 of a deck with the files that it inserts."""


def _public(name: str) -> Path:
    file = public_file(name)
    assert hashlib.sha256(b"".join(f.read_bytes() for f in _files(file) if f.is_file())).hexdigest() == DECKS[name]
    return file


ROW = re.compile(r"\s*(?:(?:SI[VMT]|SP[VM]|DI[VMT]|DP[VM]|BI[VM]|CAL|GEN|PI[VM]|DT[VM]|LST|T[SV]PS)\s+)?-?\d+\s*,", re.I)
SOURCE = re.compile(r"\s*(\w+)\.Q(\d+)\s*=", re.I)
ESATAN = {"NODES": re.compile(r"\s*[DBX]\d+\s*="), "CONDUCTORS": re.compile(r"\s*G[LRFV]\s*\(")}


def _read(deck: Path) -> NetworkFile:
    if deck.suffix == ".d":
        return read_esatan(deck)
    return read_sinda(deck, "BTU in F s" if deck.suffix == ".sin" else "")


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


def _rows_of(remark: DeckRemark) -> range:
    """Return the lines that a remark names: its own, or those of the statements that it quotes together."""
    run = re.search(r"\(lines (\d+) to (\d+)\)", remark.what)
    return range(int(run[1]), int(run[2]) + 1) if run else range(remark.where.line, remark.where.line + 1)


def _shares(deck: Path, network: NetworkFile) -> tuple[int, int, list[str]]:
    """Return how many statements there are, how many of them were taken over, and the places of those that are nowhere."""
    every = list(_statements(deck))
    read = {(os.path.basename(x.where.file), x.where.line) for x in (*network.nodes, *network.conductors, *network.loads)}
    named = {(os.path.basename(r.where.file), k) for r in network.remarks if r.dropped for k in _rows_of(r)}
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


@pytest.mark.parametrize(
    ("name", "off"),
    [(f"{MLI}/Insulation/case2.inp", 0.025), (f"{MLI}/Opticalprop/case1.inp", 0.025), (f"{MLI}/Panel/case1.inp", 0.025)],
)
def test_orbits_of_an_author_whose_decks_nobody_here_had_seen(name: str, off: float) -> None:
    """Steady states within what SINDA's own balance leaves open; transients but for the shadow's edge, as with the other decks."""
    deck = _public(name)
    agreed = agreement(_read(deck), sinda_print(deck.with_suffix(".out")))
    steady, all_off = np.isnan(agreed.times), np.abs(agreed.off)
    assert all_off[steady].max() < off
    assert np.median(all_off[~steady]) < 0.04
    assert np.quantile(all_off[~steady], 0.9) < 0.35


def test_a_heater_that_sinda_did_not_bring_to_its_end() -> None:
    """SINDA moves a heater by a twentieth in each loop and ended after 53: with the powers that it prints, its temperatures come out."""
    deck = _public(f"{MLI}/Insulation/case1.inp")
    printed = deck.with_suffix(".out")
    watts = dict(zip(("T1501", "T1509"), re.findall(r"LOOPCT = +\d+ +([\d.]+) +W", printed.read_text("latin-1")), strict=True))
    network, prints = _read(deck), sinda_print(printed)[:2]
    assert np.abs(agreement(network, prints).off).max() > 0.6  # the heaters that their law asks for: .1 W apart
    as_printed = [replace(load, more={}, power=float(watts[load.into[1]])) if load.more else load for load in network.loads]
    agreed = agreement(replace(network, loads=tuple(as_printed)), prints)
    assert np.abs(agreed.off).max() < 0.0055  # the print has two digits
