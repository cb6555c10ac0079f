"""A deck written back and read again is the fitted model in every number."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest

from thermid.base.units import si_unit
from thermid.interop._decks.esatan import read_esatan
from thermid.interop._decks.network_file import NetworkFile
from thermid.interop._decks.sinda import read_sinda
from thermid.model.tree import Model, ParameterSet

SINDA = """HEADER CONTROL DATA, GLOBAL
    abszro = -459.67
    UID = ENG
HEADER REGISTER DATA
      STRAP = 0.31 $ Btu/h F
      HALF = STRAP/2
HEADER NODE DATA, BOX
      1,    70.,    0.91
      GEN 2, 3, 1, 70., 0.5*1.2D0
      SIV 7, 70., A1, 0.25
HEADER NODE DATA, WALL
      -1,   60.,    0.
HEADER ARRAY DATA, BOX
      1 = 0., 1., 200., 2.
HEADER CONDUCTOR DATA, BOX
C Contact - Face Contactor-Foot to wall[BOX][1]::A1
      1,    BOX.1,    WALL.1,    0.051
      2,    BOX.2,    WALL.1,    7.3D-2
      3,    1,    2,    STRAP
      4,    2,    3,    2.*HALF
      GEN 5, 2, 1, BOX.3, 1, BOX.4, 3, 0.11
      SIV 9, 1, 7, A1, 0.7
      -10,  BOX.4,    WALL.1,    0.02
HEADER SOURCE DATA, BOX
      2, 6.25
HEADER VARIABLES 0, BOX
      BOX.Q3 = BOX.Q3 + 1.75
"""
ESATAN = """$MODEL UNIT
$LOCALS
$REAL
  k = 180.0D0; t = 0.003;
  area = 0.2 * t;
$NODES
D1 = 'board', T = 25.0, C = 300.0, QI = 6.0;
D2 = 'lid', T = 25.0, C = 2.0 * 61.5;
B99 = 'wall', T = 10.0;
$CONDUCTORS
GL(1, 2) = area / 0.4 * k;
GL(2, 99) = 0.5;
GR(1, 99) = 0.0123;
GF(1, 2) = 0.7;
$ENDMODEL UNIT
"""


def _read(file: Path) -> NetworkFile:
    return read_esatan(file) if file.suffix == ".d" else read_sinda(file)


def _numbers(model: Model, without: set[str]) -> dict[str, float]:
    return {path: float(value) for path, value in ParameterSet(model).evaluate({}).items() if path not in without}


@pytest.mark.parametrize(("name", "text"), [("deck.inp", SINDA), ("deck.d", ESATAN)])
@pytest.mark.parametrize("seed", range(4))
def test_what_comes_back_equals_the_fit_in_every_number(tmp_path: Path, name: str, text: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    (tmp_path / name).write_text(text, encoding="latin-1")
    network = _read(tmp_path / name)
    model = network.model()
    table = ParameterSet(model)
    groups = set(network.groups())
    shared = {"BOX.T2.capacitance", "BOX.T3.capacitance", "BOX.T4.capacitance", "BOX_G5.conductance", "BOX_G6.conductance"}
    taken = [p for p, entry in table.table.items() if entry.parameter.is_literal and p not in shared and not p.endswith("specific_heat")]
    fixed = {p for p in taken if p.endswith((".exchange_factor", ".mass")) or p in groups}
    now = table.evaluate({})
    changed = {p: float(now[p]) * rng.uniform(0.5, 2.0) for p in taken if p not in fixed} | {g: rng.uniform(0.5, 2.0) for g in groups}
    fitted = model.with_values({p: f"{v!r} [{si_unit(table.dimension(p))}]" for p, v in changed.items()})
    assert network.not_written_back(fitted) == ()
    back = network.written_back(fitted)
    (tmp_path / "back").mkdir()
    (tmp_path / "back" / name).write_text(back[str(tmp_path / name)], encoding="latin-1")
    again = _read(tmp_path / "back" / name).model()
    wanted, found = _numbers(fitted, groups), _numbers(again, groups)
    assert found.keys() == wanted.keys()
    for path, value in wanted.items():
        assert found[path] == pytest.approx(value, rel=1e-11), path  # twelve digits are written


ORESAT = "oresat/oresat-thermal/OreSat0.5"
SHA = {
    "case0.cc": "1c9075ed7f0441ac4720e3c1a647fa268120a0a51313df8e2bd4a29b0c56c85f",
    "C0A0.k": "b9c563b3a52886a04a84e92ccc2a8b326988051b0db646508840453bc5679ad1",
    "C0A2.k": "7f63df2e38bd0c6bf007f562c49f522a65f548f9b0b2dd67a41157e4e4ada835",
}


def test_a_deck_of_12_426_conductors_comes_back_in_every_number(tmp_path: Path) -> None:
    folder = Path(os.environ.get("THERMID_PUBLIC", "/nowhere")) / ORESAT
    if not (folder / "case0.cc").is_file():
        pytest.skip(f"{ORESAT} is not under THERMID_PUBLIC")
    for name, digest in SHA.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    for file in folder.iterdir():
        if file.suffix in {".inp", ".cc", ".k", ".ar", ".hra", ".hrl"}:
            (tmp_path / file.name).write_bytes(file.read_bytes())
    network = read_sinda(tmp_path / "case0.inp")
    groups, rng = set(network.groups()), np.random.default_rng(1)
    factors = {group: float(rng.uniform(0.5, 2.0)) for group in sorted(groups)}
    fitted = network.model().with_values(
        factors | {name: float(e * rng.uniform(0.85, 1.1)) for name, (e, _) in network.emissivities.items()}
    )
    assert network.not_written_back(fitted) == ()
    for path, text in network.written_back(fitted).items():
        Path(path).write_text(text, encoding="latin-1")
    wanted, found = _numbers(fitted, groups), _numbers(read_sinda(tmp_path / "case0.inp").model(), groups)
    assert found.keys() == wanted.keys()
    assert [found[path] for path in wanted] == pytest.approx(list(wanted.values()), rel=1e-10)
