"""Every line of a deck is taken over or named with its line; what is missing travels. Decks of this file's own, in both languages."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError
from thermid.interop._decks.esatan import read_esatan
from thermid.interop._decks.network_file import NetworkFile
from thermid.interop._decks.results import Printed, balance
from thermid.interop._decks.sinda import read_sinda
from thermid.interop._decks.written import to_esatan, to_sinda
from thermid.interop.c99 import to_c
from thermid.interop.modelica import to_modelica
from thermid.interop.octave import to_octave
from thermid.interop.spice import to_spice
from thermid.model.tree import ParameterSet

CARDS = """BCD 3THERMAL LPCS
BCD 9 TWO PLATES
END
BCD 3NODE DATA
      1, 20., 100.
      2, 20., 50.
      -9, 10., 0.
END
BCD 3CONDUCTOR DATA
      1, 1,2, 0.5
      2, 2,9, 0.4
END
BCD 3SOURCE DATA
      1, 3.
END
BCD 3CONSTANTS DATA
      1, 600.
      2, 0.5
      ABSZRO = -273.15
      TIMEND = 1200.
END
BCD 3ARRAY DATA
      1, 0., 300., 600., END
      2, 0., 8., 0., END
      3, 0., 0., 300., 8., 600., 0., END
END
BCD 3EXECUTION
      CNFRWD
END
BCD 3VARIABLES 1
      {logic}
END
BCD 3VARIABLES 2
      {after}
END
BCD 3OUTPUT CALLS
      TPRINT
END
BCD 3END OF DATA
"""
HEADERS = """HEADER CONTROL DATA, GLOBAL
      UID = SI
      ABSZRO = -273.15
      TIMEND = 1200.
HEADER NODE DATA, A
      1, 20., 100.
      2, 20., 50.
      -9, 10., 0.
HEADER CONDUCTOR DATA, A
      1, 1, 2, 0.5
      2, 2, 9, 0.4
HEADER SOURCE DATA, A
      1, 3.
HEADER ARRAY DATA, A
      1 = 0., 300., 600.
      2 = 0., 8., 0.
      3 = 0., 0., 300., 8., 600., 0.
"""
ESATAN = """$MODEL SAT
$LOCALS
  $REAL
  STEFAN = 5.67E-8;
  watts = 2.0;
$NODES
D1 = 'plate', T = 20.0, C = 100.0, QI = 3.0;
D2 = 'foot', T = 20.0, C = 50.0;
B9 = 'room', T = 10.0;
$CONDUCTORS
GL(1, 2) = 0.5;
GL(2, 9) = 0.4;
$ARRAYS
$REAL
  PAIRS(2,3) = 0.0, 0.0, 300.0, 8.0, 600.0, 0.0;
$VARIABLES1
  {logic}
$VARIABLES2
  {after}
$EXECUTION
  {run}
  TIMEND = 1200.0
  CALL SLCRNC
$ENDMODEL SAT
"""


def _cards(folder: Path, logic: str = "CONTINUE", after: str = "CONTINUE", **others: str) -> NetworkFile:
    text = CARDS.format(logic=logic, after=after)
    for old, new in others.items():
        assert CHANGED[old] in text
        text = text.replace(CHANGED[old], new)
    return read_sinda(_file(folder, "plates.sin", text))


CHANGED = {
    "nodes": "      1, 20., 100.\n      2, 20., 50.\n",
    "sources": "      1, 3.\nEND",
    "rows": "      1, 1,2, 0.5\n",
    "run": "CNFRWD",
}


def _file(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="latin-1")
    return folder / name


def _headers(folder: Path, more: str = "", old: str = "", new: str = "") -> NetworkFile:
    assert old in HEADERS
    return read_sinda(_file(folder, "plates.inp", HEADERS.replace(old, new) + more))


def _esatan(folder: Path, logic: str = "", after: str = "", run: str = "", old: str = "", new: str = "") -> NetworkFile:
    assert old in ESATAN
    return read_esatan(_file(folder, "sat.d", ESATAN.replace(old, new).format(logic=logic, after=after, run=run)))


def _missing(network: NetworkFile) -> list[str]:
    return [str(remark) for remark in network.remarks if remark.dropped]


def _watts(network: NetworkFile, node: str, *times: float) -> list[float]:
    """Return the power into a node that the model in its case has at some times."""
    case, values = network.scenario(), ParameterSet(network.model()).evaluate({})
    out = []
    for time in times:
        power = 0.0
        for load in network.loads:
            if load.into[1] == node:
                course, command = case.loads.get(load.name), case.commands.get(load.name)
                power += (
                    course.at(time) if course is not None else float(values[f"{load.name}.power"]) * (command.at(time) if command else 1.0)
                )
        out.append(power)
    return out


@pytest.mark.parametrize(
    "call",
    [
        "CALL DA11MC(600.,TIMEM,A1,A2,0.5,Q1)",
        "CALL D11MCY(600.,TIMEM,A3,0.5,Q1)",
        "CALL DA11MC(K1,TIMEM,A1,A2,XK2,Q1)",
        "CALL D11CYL(600.,TIMEM,A3,TEST)\n      Q1 = 0.5*TEST",
        "D11MCY(600.,TIMEM,A3,0.5,Q1)",
    ],
)
def test_an_interpolation_goes_wherever_it_is_put(tmp_path: Path, call: str) -> None:
    """What is put into Q1 replaces the 3 W of SOURCE DATA, which the import says."""
    network = _cards(tmp_path, call)
    assert _missing(network) == []
    assert _watts(network, "T1", 0.0, 150.0, 300.0, 750.0) == pytest.approx([0.0, 2.0, 4.0, 2.0])
    assert any("MAIN.T1" in str(r) and re.search(r":3[12]: ", str(r)) for r in network.remarks)


def test_an_interpolation_added_stays_beside_the_source(tmp_path: Path) -> None:
    network = _cards(tmp_path, "CALL D1DEG1(TIMEM,A3,TEST)\n      Q1 = Q1 + TEST*K2")
    assert _missing(network) == []
    assert _watts(network, "T1", 0.0, 150.0) == pytest.approx([3.0, 5.0])
    slower = network.model().with_values({"k2": 0.25})
    ends = [td.simulate(m, network.scenario(), every="60 [s]")["MAIN.T1"].kelvin[-1] for m in (network.model(), slower)]
    assert ends[0] > ends[1] + 0.5  # a constant of the deck that scales a course is a parameter


def test_a_course_of_a_boundary_and_a_constant_one(tmp_path: Path) -> None:
    network = _cards(tmp_path, "CALL D1DEG1(TIMEM,A3,T9)")
    assert [network.scenario().boundaries["MAIN_T9"].at(t) - 273.15 for t in (0.0, 150.0, 900.0)] == pytest.approx([0.0, 4.0, 0.0])
    network = _headers(tmp_path, "HEADER VARIABLES 0, A\n      T9 = -5.\n      Q2 = 7.\n")
    assert (_missing(network), network.case()["boundaries"]) == ([], {"A_T9": "-5.0 [degC]"})
    assert _watts(network, "T2", 0.0) == [7.0]


@pytest.mark.parametrize(
    "logic",
    [
        "CALL D1DEG1(TIMEM,A3,C1)",
        "CALL D1DEG1(TIMEM,A3,UNUSED)",
        "CALL D1DEG1(TIMEM,A3,T1)",
        "CALL D1MDG1(T1,T2,A3,Q1)",
        "CALL D1DEG1(TIMEM,A3,TEST)\n      Q1 = Q1 + 1.0 + TEST",
        "Q1 = Q1 + 0.1*T2",
        "IF (T1 .GT. 5.0) Q1 = Q1 + 3.0",
        "IF (T1 .GT. 5.0) THEN\n      Q1 = Q1 + 3.0\n      ENDIF",
        "IF (T1 .GT. 5.0) GO TO 10\n      Q1 = Q1 + 3.0",
        "IF (NSOL .GT. 1) THEN\n      IF (T1 .GT. 5.) THEN\n      Q1 = Q1 + 3.0\n      ENDIF\n      ENDIF",
        "IF (NSOL .GT. 1) THEN\n      Q1 = Q1 + 3.0\n      ELSE\n      Q1 = Q1 + 1.\n      ENDIF",
        "IF (NSOL .GT. 1) THEN\n      ELSE IF (T1 .GT. 5.) THEN\n      Q1 = Q1 + 3.0\n      ENDIF",
        "G1 = 3.0",
        "T1 = T1 + 3.0",
    ],
)
def test_logic_that_no_reader_takes_is_named(tmp_path: Path, logic: str) -> None:
    network = _headers(tmp_path, f"HEADER VARIABLES 1, A\n      {logic}\n")
    assert network.incomplete
    first = HEADERS.count("\n") + 2
    assert any(f"plates.inp:{line}:" in row for row in _missing(network) for line in (first, first + 1))
    assert _watts(network, "T1", 0.0, 300.0) == [3.0, 3.0]


@pytest.mark.parametrize("block", ["VARIABLES 2, A", "OPERATION DATA", "OUTPUT CALLS, A", "SUBROUTINE"])
@pytest.mark.parametrize("logic", ["Q1 = Q1 + 5.0", "A.G1 = 3.0", "IF (T1 .LT. 5.) C1 = 7.", "CALL HEATIT(3.)"])
def test_logic_in_other_blocks_is_named(tmp_path: Path, block: str, logic: str) -> None:
    network = _headers(tmp_path, f"HEADER {block}\n      {logic}\n      CALL TPRINT('ALL')\n      MYTIME = MYTIME + 1.\n")
    (named,) = _missing(network)
    assert logic in named
    assert f"plates.inp:{HEADERS.count(chr(10)) + 2}" in named


@pytest.mark.parametrize("place", ["after", "run"])
@pytest.mark.parametrize("logic", ["G1 = 3.0", "Q1 = 5.", "INCLUDE extra.inc", "HEATIT(3)"])
def test_logic_in_other_cards_is_named(tmp_path: Path, place: str, logic: str) -> None:
    network = _cards(tmp_path, after=logic) if place == "after" else _cards(tmp_path, run=f"{logic}\n      CNFRWD")
    (named,) = _missing(network)
    assert logic in named


@pytest.mark.parametrize("place", ["after", "run"])
@pytest.mark.parametrize(
    "logic",
    [
        "GL(1,2) = 0.5",
        "QI2 = 50.0",
        "IF (T1.LT.5.0) QI1 = 5.0",
        "IF (T1 .LT. 5.0) THEN\n  QI2 = 3.0\n  END IF",
        "CALL MYSUB",
        "watts = 3.0",
    ],
)
def test_logic_in_other_blocks_of_esatan_is_named(tmp_path: Path, place: str, logic: str) -> None:
    network = _esatan(tmp_path, **{place: logic})
    (named,) = _missing(network)
    assert next(row for row in logic.split("\n") if "=" in row or "CALL" in row).strip() in named


def test_statements_of_esatan_outside_any_block_and_values_that_are_unknown_are_named(tmp_path: Path) -> None:
    network = _esatan(tmp_path, old="$MODEL SAT\n", new="$MODEL SAT\n  GL(1, 9) = 4.0;\n")
    assert "GL(1, 9) = 4.0" in _missing(network)[0]
    network = _esatan(tmp_path, old="T = 20.0, C = 50.0;", new="T = 20.0, C = 50.0, QX = 4.0;")
    assert "QX = 4.0" in _missing(network)[0]
    network = _esatan(tmp_path, logic="CALL STATST('N1', 'B')")
    assert "STATST" in _missing(network)[0]


def test_several_groups_on_a_card(tmp_path: Path) -> None:
    network = _cards(
        tmp_path,
        nodes="      1, 20., 100., 2, 20., 50.\n",
        sources="      1, 3., 2, 6.\nEND",
        rows="      1, 1,2, 0.5, 3, 1,9, 0.2\n",
    )
    apart = _cards(tmp_path, sources="      1, 3.\n      2, 6.\nEND", rows="      1, 1,2, 0.5\n      3, 1,9, 0.2\n")
    assert _missing(network) == _missing(apart) == []
    assert len(network.nodes) == 3
    one, other = (td.steady(n.model(), n.scenario()) for n in (network, apart))
    assert [one[f"MAIN.T{k}"] for k in (1, 2)] == pytest.approx([other[f"MAIN.T{k}"] for k in (1, 2)])
    back = network.written_back(network.model().with_values({"MAIN_G3.conductance": "0.3 [W/K]", "MAIN.T2.capacitance": "70 [J/K]"}))
    (text,) = back.values()
    assert "3, 1,9, 0.3 $" in text
    assert "2, 20., 70 $" in text


def test_the_rest_of_a_card_that_is_no_group_is_refused(tmp_path: Path) -> None:
    with raises_code("import.not-understood", DeckError, match=r"plates\.sin:5"):
        _cards(tmp_path, nodes="      1, 20., 100., 7\n      2, 20., 50.\n")


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("      2, 20., 50.\n", "      2, 20., 50.\n      2, 20., 77.\n", "node A.T2"),
        ("      2, 2, 9, 0.4\n", "      2, 2, 9, 0.4\n      2, 1, 9, 0.3\n", "conductor A.2"),
        ("      2 = 0., 8., 0.\n", "      2 = 0., 8., 0.\n      2 = 5., 5.\n", "array A.2"),
        ("HEADER NODE", "HEADER REGISTER DATA\n  X = 1.\n  X = 2.\nHEADER NODE", "X"),
    ],
)
def test_what_is_defined_twice_is_named_and_counted_once(tmp_path: Path, old: str, new: str, named: str) -> None:
    network = _headers(tmp_path, old=old, new=new)
    (row,) = _missing(network)
    assert f"{named} " in row
    assert row.count("plates.inp:") == 2  # both places
    assert len(network.nodes) == 3
    assert len(network.conductors) == 2
    once = _headers(tmp_path)
    assert td.steady(network.model(), network.scenario())["A.T1"] == td.steady(once.model(), once.scenario())["A.T1"]


def test_what_an_esatan_deck_defines_twice_is_named(tmp_path: Path) -> None:
    network = _esatan(tmp_path, old="$CONDUCTORS\n", new="D2 = 'again', T = 0.0, C = 1.0;\n$CONDUCTORS\n")
    assert "SAT.T2" in "".join(_missing(network))
    assert (len(network.nodes), network.nodes[1].capacitance) == (3, "50.0 [J/K]")
    lid = "$MODEL LID\n$NODES\nD1 = 'lid', T = 1.0, C = {};\n$CONDUCTORS\nGL(1, 1) = 0.0;\n$ENDMODEL LID\n"
    lid = lid.replace("GL(1, 1) = 0.0;\n", "")
    network = _esatan(tmp_path, old="$LOCALS\n", new=lid.format("5.0") + lid.format("7.0") + "$LOCALS\n")
    assert any("$MODEL SAT.LID" in row for row in _missing(network))
    assert [n.capacitance for n in network.nodes if n.submodel == "SAT_LID"] == ["5.0 [J/K]"]


def test_locals_of_siblings_are_their_own(tmp_path: Path) -> None:
    part = "$MODEL {0}\n$LOCALS\n  $REAL\n  cp = {1};\n$NODES\nD1 = 'x', T = 1.0, C = 2.0*cp;\n$ENDMODEL {0}\n"
    network = _esatan(tmp_path, old="$LOCALS\n", new=part.format("BAT", 900.0) + part.format("EPS", 500.0) + "$LOCALS\n")
    values = ParameterSet(network.model()).evaluate({})
    assert (values["SAT_BAT.T1.capacitance"], values["SAT_EPS.T1.capacitance"]) == pytest.approx((1800.0, 1000.0))
    back = network.written_back(network.model().with_values({network.nodes[-1].capacitance.split(")")[0].rpartition("*")[2]: 600.0}))
    assert "cp = 600;" in next(iter(back.values()))


@pytest.mark.parametrize("number", ["2.5+4", "2.0-1"])
def test_an_exponent_without_its_letter_is_asked_about(tmp_path: Path, number: str) -> None:
    """Fortran reads 2.5+4 as 25000, arithmetic as 6.5."""
    with raises_code("import.not-understood", DeckError, match=r"plates\.sin:5"):
        _cards(tmp_path, nodes=f"      1, 20., {number}\n      2, 20., 50.\n")
    with raises_code("import.not-understood", DeckError, match=r"plates\.inp:10"):
        _headers(tmp_path, old="1, 1, 2, 0.5", new=f"1, 1, 2, {number}")
    with pytest.raises(DeckError, match=r"sat\.d:11"):
        _esatan(tmp_path, old="GL(1, 2) = 0.5;", new=f"GL(1, 2) = {number};")
    sums = _headers(tmp_path, old="1, 1, 2, 0.5", new="1, 1, 2, 2.5 + 4")
    assert ParameterSet(sums.model()).evaluate({})["A_G1.conductance"] == 6.5


@pytest.mark.parametrize("place", ["control", "block", "run"])
def test_the_absolute_zero_of_an_esatan_deck(tmp_path: Path, place: str) -> None:
    block = "$CONTROL\n  TABS = 0.0;\n  NLOOP = 20;\n"
    before = {"control": f"$LOCALS\n{block}", "block": f"{block}$LOCALS\n", "run": "$LOCALS\n"}[place]
    changed = {"old": "$LOCALS\n", "new": before, "run": "TABS = 0.0" if place == "run" else ""}
    network = _esatan(tmp_path, **changed)
    assert _missing(network) == []
    assert [node.celsius for node in network.nodes] == pytest.approx([20.0 - 273.15, 20.0 - 273.15, 10.0 - 273.15])
    assert network.celsius({"SAT.T1": 293.15}) == pytest.approx({"SAT.T1": 20.0})


def test_the_stefan_boltzmann_constant_set_before_the_run(tmp_path: Path) -> None:
    network = _esatan(tmp_path, run="STEFAN = 6.0E-8", old="  STEFAN = 5.67E-8;\n", new="")
    network = _esatan(tmp_path, run="STEFAN = 5.67E-8", old="GL(2, 9) = 0.4;", new="GR(2, 9) = 0.4;")
    two = _esatan(tmp_path, run="STEFAN = 5.67E-7", old="GL(2, 9) = 0.4;", new="GR(2, 9) = 0.4;")
    area = [ParameterSet(n.model()).evaluate({})["SAT_GR_T2_T9.area"] for n in (network, two)]
    assert area[1] / area[0] == pytest.approx(10.0)


@pytest.mark.parametrize(("deck", "given"), [("ABSZRO = -459.67", "J s m C"), ("ABSZRO = -273.15", "W m K"), ("UID = ENG", "J s m C")])
def test_units_that_contradict_the_deck_are_refused(tmp_path: Path, deck: str, given: str) -> None:
    text = HEADERS.replace("UID = SI" if "UID" in deck else "ABSZRO = -273.15", deck)
    with pytest.raises(DeckError, match=r"contradict"):
        read_sinda(_file(tmp_path, "plates.inp", text), given)


def _first(network: NetworkFile, node: str) -> float:
    return float(td.simulate(network.model(), network.scenario(), every="60 [s]")[node].kelvin[0]) - 273.15


def test_a_transient_after_a_steady_state_begins_there(tmp_path: Path) -> None:
    """With 8 W at 300 s and none at the start, the steady state is that of the 3 W alone: 10 + 3/.4 + 3/.5."""
    arrays = "HEADER VARIABLES 1, A\n      CALL D1DEG1(TIMEM, A3, TEST)\n      Q1 = Q1 + TEST\n"
    run = "HEADER OPERATION DATA\n      BUILD ALL\n      CALL STEADY\n      TIMEO = 0.\n      CALL TRANSIENT\n"
    network = _headers(tmp_path, arrays + run)
    assert _missing(network) == []
    assert _first(network, "A.T1") == pytest.approx(10.0 + 3.0 / 0.4 + 3.0 / 0.5, abs=1e-6)
    network = _cards(tmp_path, "CALL D1DEG1(TIMEM,A3,TEST)\n      Q1 = Q1 + TEST", run="CINDSL\n      TIMEO = 0.0\n      CNFRWD")
    assert _missing(network) == []
    assert _first(network, "MAIN.T1") == pytest.approx(23.5, abs=1e-6)
    network = _esatan(tmp_path, logic="QE1 = INTRP1(TIMEM, PAIRS, 1)", run="CALL SOLVIT\n  TIMEO = 0.0")
    assert _missing(network) == []
    assert _first(network, "SAT.T1") == pytest.approx(23.5, abs=1e-6)
    assert _first(_esatan(tmp_path), "SAT.T1") == pytest.approx(20.0)


@pytest.mark.parametrize("order", [0, 2])
def test_an_interpolation_that_is_no_straight_line_is_named(tmp_path: Path, order: int) -> None:
    network = _esatan(tmp_path, logic=f"QE1 = INTRP1(TIMEM, PAIRS, {order})")
    assert f"PAIRS, {order})" in _missing(network)[0]


@pytest.mark.parametrize(
    "logic", ["QE1 = 0.5*INTCYC(TIMEM, PAIRS, 1, 600.0, 0.0)", "QE1 = INTCYC(TIMEM, PAIRS, 1, 600.0D0, 0.0D0) * 0.25 * watts"]
)
def test_a_cycle_of_pairs_with_factors_on_either_side(tmp_path: Path, logic: str) -> None:
    network = _esatan(tmp_path, logic=logic)
    assert _missing(network) == []
    assert _watts(network, "T1", 0.0, 150.0, 900.0) == pytest.approx([3.0, 5.0, 7.0])


def test_a_row_that_is_not_read_takes_the_rows_of_its_nodes_with_it(tmp_path: Path) -> None:
    network = _cards(tmp_path, nodes="      1, 20., 100.\n      BIV 2,1,1, 20., 50.\n")
    assert len(_missing(network)) == 3  # the node and two conductors
    assert all("MAIN.T2" in row or "BIV" in row for row in _missing(network))
    assert network.conductors == ()


@pytest.mark.parametrize("write", [to_sinda, to_esatan, to_c, to_octave, to_modelica, to_spice])
def test_a_written_file_says_what_is_missing_and_reading_it_says_so_again(tmp_path: Path, write: object) -> None:
    network = _headers(tmp_path, "HEADER VARIABLES 2, A\n      G1 = 3.0\n")
    text = write(network.model(), replace(network.scenario(), duration=600.0))  # type: ignore[operator]
    assert text.count(network.incomplete) == 1
    whole = write(_headers(tmp_path).model(), replace(network.scenario(), duration=600.0))  # type: ignore[operator]
    assert "INCOMPLETE" not in whole
    if write in (to_sinda, to_esatan):
        again = (read_sinda if write is to_sinda else read_esatan)(_file(tmp_path, "again.txt", text))
        assert network.incomplete in _missing(again)[0]
        assert again.model().incomplete


@pytest.mark.parametrize("write", [to_sinda, to_esatan])
def test_a_course_written_out_to_the_end_of_the_run_says_so(tmp_path: Path, write: object) -> None:
    network = _cards(tmp_path, "CALL D11MCY(600.,TIMEM,A3,0.5,Q1)")
    held = _cards(tmp_path, "CALL D1DEG1(TIMEM,A3,Q1)")
    written = [write(n.model(), n.scenario()) for n in (network, held)]  # type: ignore[operator]
    remarks = [[line for line in text.splitlines() if line.startswith(("C ", "#")) and "TIMEND = 1200" in line] for text in written]
    assert list(map(len, remarks)) == [1, 0]


def test_a_load_with_a_course_says_where_it_is(tmp_path: Path) -> None:
    network = _cards(tmp_path, "CALL D1DEG1(TIMEM,A3,Q1)")
    td.save_model(network.model(), tmp_path / "plates.toml")
    assert re.search(r'power = \{\s*value = [^}]*note = "[^"]+"', (tmp_path / "plates.toml").read_text())


def test_an_fmu_says_what_is_missing(tmp_path: Path) -> None:
    network = _headers(tmp_path, "HEADER VARIABLES 2, A\n      G1 = 3.0\n")
    exported = td.interop.to_fmu(network.model(), network.scenario(), tmp_path / "plates.fmu")
    assert network.incomplete in exported.notes[0]


def _same(one: NetworkFile, other: NetworkFile) -> None:
    """Two decks say the same: every value of both models, every start, every temperature of a short run."""
    a, b = (ParameterSet(n.model()).evaluate({}) for n in (one, other))
    assert {n: float(v) for n, v in a.items()} == pytest.approx({n: float(v) for n, v in b.items()}, rel=1e-12)
    assert {node.path: node.celsius for node in one.nodes} == {node.path: node.celsius for node in other.nodes}
    runs = [td.simulate(n.model(), replace(n.scenario(), duration=300.0)) for n in (one, other)]
    for node in one.nodes:
        assert runs[0][node.path].kelvin[-1] == pytest.approx(runs[1][node.path].kelvin[-1], abs=1e-9)


NODE, LINK = "      2, 20., 50.\n", "      1, 1, 2, 0.5\n"
TABLES = "      5 = -50., 1., 150., 3.\n      6 = 2., 0.001\n"
WRITTEN_OUT = [
    (NODE, "      FAC 2.5\n      2, 20., 20.\n      FAC 1.\n      -8, 5., 0.\n", f"{NODE}      -8, 5., 0.\n"),
    (NODE, "      FAC, 2.5\n      GEN 2, 2, 1, 20., 20.\n", f"{NODE}      3, 20., 50.\n"),
    (NODE, "      FAC 2.\n      SIV 2, 20., A5, 25.\n", "      SIV 2, 20., A5, 50.\n"),
    (NODE, "      SIM 2, 3, 2, 20., A5, 50.\n", "".join(f"      SIV {n}, 20., A5, 50.\n" for n in (2, 4, 6))),
    (NODE, "      SPM 2, 2, 1, 20., A6, 50.\n", "".join(f"      SPV {n}, 20., A6, 50.\n" for n in (2, 3))),
    (NODE, "      DIM 2, 2, 1, 20., A5, 50., A5, 5.\n", "".join(f"      DIV {n}, 20., A5, 50., A5, 5.\n" for n in (2, 3))),
    (NODE, f"{NODE}      GEN -6, 3, 1, 5., 0.\n", NODE + "".join(f"      -{n}, 5., 0.\n" for n in (6, 7, 8))),
    (NODE, "      2, 20., &\nC and more\n      50.\n", NODE),
    (LINK, "      FAC 0.25\n      1, 1, 2, 2.\n      FAC, 1.0\n", LINK),
    (
        LINK,
        "      FAC 0.25\n      -1, 1, 2, 0.02\n      SIV 3, 1, 2, A5, 2.\n      FAC 1.\n",
        "      -1, 1, 2, 0.005\n      SIV 3, 1, 2, A5, 0.5\n",
    ),
    (LINK, "      SIM 3, 2, 1, 1, 1, 2, 7, A5, 0.25\n", "      SIV 3, 1, 2, A5, 0.25\n      SIV 4, 2, 9, A5, 0.25\n"),
    (LINK, "      GEN 3, 2, 1, 1, 1, 2, 7, 3., 0.5, 2., 6.\n", "      3, 1, 2, 0.5\n      4, 2, 9, 0.5\n"),
    (LINK, "      CAL 1, 1, 2, 3., 0.5, 2., 6.\n", LINK),
    (LINK, "      1, 1, 2,\n     &   0.5 $ joined\n", LINK),
    ("      1, 3.\n", "      GEN 1, 2, 1, 3.\n", "      1, 3.\n      2, 3.\n"),
    ("      1, 3.\n", "      GEN 1, 2, 1, 3., &\n      2.\n", "      1, 6.\n      2, 6.\n"),
]


@pytest.mark.parametrize(("old", "short", "long"), WRITTEN_OUT)
def test_statements_that_stand_for_several_are_those(tmp_path: Path, old: str, short: str, long: str) -> None:
    (tmp_path / "long").mkdir()
    one, other = (_headers(folder, TABLES, old, new) for folder, new in ((tmp_path, short), (tmp_path / "long", long)))
    assert _missing(one) == _missing(other) == []
    assert len(one.nodes) == len(other.nodes)
    _same(one, other)


@pytest.mark.parametrize(
    ("old", "new", "value", "stands"),
    [
        ("      1, 1, 2, 0.5\n", "      FAC 0.25\n      1, 1, 2, 2.\n", {"A_G1.conductance": "0.75 [W/K]"}, "1, 1, 2, 3 $"),
        ("      1, 1, 2, 0.5\n", "      1, 1, 2,\n     &   0.5\n", {"A_G1.conductance": "0.75 [W/K]"}, "&   0.75"),
        ("      2, 20., 50.\n", "      FAC 2.\n      2, 20., 25.\n", {"A.T2.capacitance": "80 [J/K]"}, "2, 20., 40 $"),
    ],
)
def test_what_a_factor_multiplies_is_written_back_where_it_stands(
    tmp_path: Path, old: str, new: str, value: dict[str, str], stands: str
) -> None:
    network = _headers(tmp_path, old=old, new=new)
    (text,) = network.written_back(network.model().with_values(value)).values()
    assert stands in text
    again = read_sinda(_file(tmp_path, "again.inp", text))
    (name,) = value
    assert float(ParameterSet(again.model()).evaluate({})[name]) == pytest.approx(float(value[name].split(" ")[0]))


def test_a_source_over_temperature_is_one(tmp_path: Path) -> None:
    network = _headers(tmp_path, "      7 = 0., 4., 100., 0.\n", "      1, 3.\n", "      SIV 1, A7, 1.5\n")
    assert _missing(network) == []
    end = td.steady(network.model(), network.scenario())
    warm = end["A.T1"] - 273.15
    assert 1.5 * (4.0 - 0.04 * warm) == pytest.approx((warm - 10.0) / (1 / 0.5 + 1 / 0.4), abs=1e-6)
    numbers = {f"A.T{k}": end[path] - 273.15 for k, path in ((1, "A.T1"), (2, "A.T2"), (9, "A_T9"))}
    assert balance(network, Printed("STEADY", 0.0, numbers, dict.fromkeys(numbers, 1e-6), 0.0)).open() == {}


@pytest.mark.parametrize("row", ["CYC 1, A3, 600.", "GEN 1, 2, 1", "PER 1, A3, 2., 3.", "FAC 3."])
def test_a_source_of_another_kind_is_named(tmp_path: Path, row: str) -> None:
    network = _headers(tmp_path, old="      1, 3.\n", new=f"      {row}\n      1, 3.\n")
    assert any(
        f"plates.inp:{HEADERS[: HEADERS.index('      1, 3.')].count(chr(10)) + 1}:" in text and row in text for text in _missing(network)
    )
    assert _watts(network, "T1", 0.0) == [3.0]


LOOPED = """FOR KL1 = 1 TO 3 DO
  FOR KL2 = 10 TO 30 STEP 10 DO
    D(KL1 + KL2) = 'GO TO it', T = 20.0, C = 2.5*KL1;
  END DO
END DO
"""
ROWS = """FOR KL1 = 1 TO 3 DO
  GL(10 + KL1, KL1 + 20) = 0.25;
  GL(1, KL1 + 30) = 0.1*KL1;
END DO
"""


def test_loops_of_esatan_are_the_statements_that_they_make(tmp_path: Path) -> None:
    (tmp_path / "long").mkdir()
    nodes = "".join(f"D{k + m} = 'GO TO it', T = 20.0, C = 2.5*{k};\n" for k in (1, 2, 3) for m in (10, 20, 30))
    rows = "".join(f"GL({10 + k}, {20 + k}) = 0.25;\nGL(1, {30 + k}) = 0.1*{k};\n" for k in (1, 2, 3))
    last = ESATAN.index("$CONDUCTORS\n")
    decks = [
        ESATAN[:last] + more + ESATAN[last:].replace("GL(1, 2) = 0.5;\n", f"GL(1, 2) = 0.5;\n{links}")
        for more, links in ((LOOPED, ROWS), (nodes, rows))
    ]
    one, other = (
        read_esatan(_file(folder, "sat.d", deck.format(logic="", after="", run="")))
        for folder, deck in zip((tmp_path, tmp_path / "long"), decks, strict=True)
    )
    assert _missing(one) == _missing(other) == []
    assert len(one.nodes) == len(other.nodes) == 12
    _same(one, other)
    looped = one.model().with_values({f"SAT_GL_T{10 + k}_T{20 + k}.conductance": "0.5 [W/K]" for k in (1, 2, 3)})
    assert one.not_written_back(looped) == ()
    assert "KL1 + 20) = 0.5;" in "".join(one.written_back(looped).values())


@pytest.mark.parametrize("head", ["FOR KL1 = 1 TO UNKNOWN DO", "FOR KL1 = 1 TO 2.5 DO", "FOR KL1 = 9 TO 1 DO", "WHILE (TIMEN .LT. 5.0) DO"])
def test_a_loop_that_is_none_over_numbers_is_named_once_with_what_it_holds(tmp_path: Path, head: str) -> None:
    loop = f"{head}\n  GL(1, 9) = 4.0;\n  GL(2, 9) = 4.0;\nEND DO\n"
    network = _esatan(tmp_path, old="GL(2, 9) = 0.4;\n", new=f"{loop}GL(2, 9) = 0.4;\n")
    named = "".join(_missing(network))
    assert head in named
    assert named.count("= 4.0") == 2
    assert len(network.conductors) == 2


@pytest.mark.parametrize(
    ("old", "new"), [("      2, 20., 50.\n", "      GEN 3, 101, 1, 20., 1.\n"), ("      1, 3.\n", "      GEN 1, 1000000000, 1, 3.\n")]
)
def test_statements_that_repeat_without_end_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, old: str, new: str) -> None:
    monkeypatch.setenv("THERMID_CAPS", "repeats=100")
    with raises_code("cap.exceeded", DeckError):
        _headers(tmp_path, old=old, new=new + old)


def test_loops_inside_each_other_are_counted_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THERMID_CAPS", "repeats=100")
    loops = "".join(f"FOR K{n} = 1 TO 20 DO\n" for n in range(6)) + "GL(1, 9) = 1.0;\n" + 6 * "END DO\n"
    with raises_code("cap.exceeded", DeckError):
        _esatan(tmp_path, old="GL(2, 9) = 0.4;\n", new=f"{loops}GL(2, 9) = 0.4;\n")


INNER = (
    "$MODEL BAT\n$NODES\nD1 = 'cell', T = 20.0, C = 10.0, QI = 1.0;\nB2 = 'wall', T = 0.0;\n$CONDUCTORS\nGL(1, 2) = 1.0;\n$ENDMODEL BAT\n"
)


@pytest.mark.parametrize(
    ("logic", "watts"),
    [
        ("QI:BAT:1 = 5.0", [5.0, 5.0]),
        ("QR:BAT:1 = 2.0*watts", [5.0, 5.0]),  # beside the 1 W of QI
        ("QI:BAT:1 = INTRP1(TIMEM, PAIRS, 1)", [0.0, 8.0]),
        ("QR:BAT:1 = INTCYC(TIMEM, PAIRS, 1, 600.0, 0.0)", [1.0, 9.0]),
        ("QI:1 = 5.0", [1.0, 1.0]),
    ],
)
def test_powers_of_a_submodels_node(tmp_path: Path, logic: str, watts: list[float]) -> None:
    network = _esatan(tmp_path, logic=logic, old="$LOCALS\n", new=f"{INNER}$LOCALS\n")
    assert _missing(network) == []
    inside = replace(network, loads=tuple(load for load in network.loads if load.into[0] == "SAT_BAT"))
    assert _watts(inside, "T1", 0.0, 300.0) == pytest.approx(watts)


def test_a_temperature_of_a_submodels_boundary_and_a_power_of_no_node(tmp_path: Path) -> None:
    network = _esatan(tmp_path, logic="T:BAT:2 = 7.0", old="$LOCALS\n", new=f"{INNER}$LOCALS\n")
    assert network.case()["boundaries"]["SAT_BAT_T2"] == "7.0 [degC]"
    network = _esatan(tmp_path, logic="QI:BAT:77 = 5.0", old="$LOCALS\n", new=f"{INNER}$LOCALS\n")
    assert "QI:BAT:77 = 5.0" in _missing(network)[0]


@pytest.mark.parametrize(
    ("stated", "given"), [("C    TDUNITS,   Length     = m\n", "W in C"), ("C    TDUNITS,   Length     = mm\n", "W m C"), ("", "W ft C")]
)
def test_lengths_that_contradict_the_deck_are_refused(tmp_path: Path, stated: str, given: str) -> None:
    text = stated + (HEADERS.replace("      UID = SI\n", "      UID = SI\n" if not stated else ""))
    with pytest.raises(DeckError, match=r"contradict"):
        read_sinda(_file(tmp_path, "plates.inp", text), given)
    read_sinda(tmp_path / "plates.inp", f"W {'mm' if 'mm' in stated else 'm'} C")


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_an_fmu_hands_on_what_is_missing(tmp_path: Path, version: str) -> None:
    pytest.importorskip("fmpy")
    network = _headers(tmp_path, "HEADER VARIABLES 2, A\n      G1 = 3.0\n")
    td.interop.to_fmu(network.model(), network.scenario(), tmp_path / "plates.fmu", version=version)
    assert list(td.interop.fmu_model(tmp_path / "plates.fmu", trust=True).missing_parts()) == [network.incomplete]
