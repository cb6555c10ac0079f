"""A deck written back and read again is the fitted model in every number."""

from __future__ import annotations

import hashlib
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from by_code import raises_code
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


NUMBER = re.compile(r"(?<![\w.])\d+\.\d*(?:D[-+]?\d+)?")


def _layouts(kind: str, rng: np.random.Generator) -> str:
    """A deck of four numbers to fit, its blanks, line ends, comments and continuations drawn."""

    def gap(*more: str) -> str:
        return str(rng.choice(["", " ", "\t", "   ", *more]))

    def line_end() -> str:
        note = rng.choice(["", " ", "  $ 7.0, fitted" if kind == "inp" else " # 7.0; made"])
        return f"{note}\n"

    if kind == "d":
        # between two words a statement may go on in another line, after any comment
        def cut() -> str:
            return gap(line_end(), f"{line_end()}# between 3.0 {line_end()}{gap()}")

        rows = [
            f"D1{cut()}={cut()}'a',{cut()}T{cut()}={cut()}20.0,{cut()}C ={cut()}10.0{cut()}, QI{cut()}={cut()}5.0{cut()};",
            f"B2 = 'b',{cut()}T ={cut()}15.0;",
        ]
        glue = f";{gap()}" if rng.random() < 0.3 else f";{line_end()}"
        rows += ["$CONDUCTORS", f"GL({gap()}1,{gap()}2)={cut()}2.0D0{glue}GR(1,2){cut()}={cut()}0.01{cut()};"]
        text = "\n".join(["$MODEL TOP", "$NODES", *(row + line_end().rstrip("\n") for row in rows), "$ENDMODEL TOP", ""])
    else:

        def comma() -> str:
            more = [f",{gap()}&{line_end()}   ", f",{line_end()}+ ", f",{line_end()}C a comment, 9.0\n   &{gap()}"]
            return f"{gap()},{gap()}" if rng.random() < 0.6 else str(rng.choice(more))

        text = "".join(
            row + line_end()
            for row in (
                f"HEADER CONTROL DATA, GLOBAL\n{gap()} ABSZRO{gap()}={gap()}-273.15,{gap()}UID = SI",
                "HEADER NODE DATA, M",
                f"  {gap()}1{comma()}20.{comma()}10.0",
                f"  -2{comma()}15.{comma()}0.",
                "HEADER CONDUCTOR DATA, M",
                f"  {gap()}1{comma()}1{comma()}2{comma()}2.0D0",
                f"  -2{comma()}1{comma()}2{comma()}0.01",
                "HEADER SOURCE DATA, M",
                f"  1{comma()}5.0",
            )
        )
    return text.replace("\n", "\r\n") if rng.random() < 0.5 else text


@pytest.mark.parametrize("kind", ["inp", "d"])
@pytest.mark.parametrize("decks", [12, pytest.param(100, marks=pytest.mark.campaign)])
def test_a_fit_comes_back_in_decks_of_any_layout(tmp_path: Path, kind: str, decks: int) -> None:
    rng = np.random.default_rng(decks)
    for _ in range(decks):
        file, text = tmp_path / f"deck.{kind}", _layouts(kind, rng)
        file.write_bytes(text.encode("latin-1"))
        network = _read(file)
        assert (network.incomplete, len(network.conductors)) == ("", 2), f"{text}{network}"
        model = network.model()
        taken = [p for p, e in ParameterSet(model).table.items() if e.parameter.is_literal and not p.endswith("exchange_factor")]
        now = ParameterSet(model).evaluate({})
        fitted = model.with_values(
            {p: f"{float(now[p]) * rng.uniform(0.5, 2.0)!r} [{si_unit(ParameterSet(model).dimension(p))}]" for p in taken}
        )
        assert network.not_written_back(fitted) == (), text
        (back,) = network.written_back(fitted).values()
        file.write_bytes(back.encode("latin-1"))
        assert _numbers(_read(file).model(), set()) == pytest.approx(_numbers(fitted, set()), rel=1e-11), f"{text}\n->\n{back}"
        assert len(NUMBER.findall(re.sub("fitted, was.*", "", back))) == len(NUMBER.findall(text)), f"{text}\n->\n{back}"
        assert back.count("\r") == text.count("\r")


@pytest.mark.parametrize(("name", "text", "k"), [("deck.inp", SINDA, 0), ("deck.d", ESATAN, 1)])
def test_a_number_that_would_not_come_back_refuses_the_whole(tmp_path: Path, name: str, text: str, k: int) -> None:
    (tmp_path / name).write_text(text, encoding="latin-1")
    network = _read(tmp_path / name)
    element = network.conductors[k]
    where = replace(element.where, begin=element.where.begin - 1, end=element.where.end - 1)  # as a reader with a wrong place would say
    wrong = replace(network, conductors=tuple(replace(c, where=where) if c is element else c for c in network.conductors))
    field = f"{element.name}.conductance"
    with raises_code("output.edit-refused", match=re.escape(field)):
        wrong.written_back(network.model().with_values({field: "3 [W/K]"}))
