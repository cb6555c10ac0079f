"""Decks of SINDA and ESATAN: what is read is the network, what is not is named with its line, fitted numbers go back into the same file."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from public_files import public_file
from thermid.base.errors import DeckError, ThermidError
from thermid.interop._decks.esatan import read_esatan
from thermid.interop._decks.network_file import NetworkFile
from thermid.interop._decks.results import Printed, agreement, balance, sinda_print
from thermid.interop._decks.sinda import read_sinda
from thermid.interop._decks.written import to_esatan, to_sinda
from thermid.model.tree import ParameterSet

SIGMA = 5.670374419e-8
SINDA = """HEADER OPTIONS
C    TDUNITS,   Temp       = C
HEADER CONTROL DATA, GLOBAL
    abszro = -273.15
    sigma  = 5.670374419e-08
    timend  = 3600.
    UID =    SI
HEADER REGISTER DATA
      COND = 0.25 $ of the strap
      HALF = COND/2
HEADER NODE DATA, BOX
      1,    20.,    150.      $ lid
      2,    20.,    -1.0      $ a node without mass
      GEN 10, 3, 5, 20., 40.
      SIV 30, 20., A7, 2.
HEADER NODE DATA, SPACE
      -1,   -270.,    0.
HEADER ARRAY DATA, BOX
      7 = 0., 100.,
          100., 200.
      1 =
          0., 600.
          1200.
      2 =
          0., 1., 0.
HEADER CONDUCTOR DATA, BOX
      1,    BOX.1,    BOX.2,    COND
      2,    2,    10,    2.*HALF
C Contact - Face Contactor-Board to wall[BOX][1]::A1
      3,    BOX.10,    SPACE.1,    0.05
      4,    BOX.15,    SPACE.1,    0.07
      GEN 5, 2, 1, BOX.10, 5, BOX.15, 5, 0.3D0
      7,    BOX.20,    BOX.30,    1.E-1
      -8,    BOX.1,    SPACE.1,    0.02
HEADER VARIABLES 0, BOX
C Heat Load-chips[BOX]::B2
      BOX.Q10 = BOX.Q10 + 2.5
      BOX.Q30 = BOX.Q30 + 0.5*2.
      IF( NSOL .GT. 1 ) THEN
C Heat Load-radio[BOX]::B3
          CALL DA11MC(1200.,TIMEM,A1,A2,1.,Q__TD)
          BOX.Q20 = BOX.Q20+ Q__TD *4.
      ELSE
C Heat Load-radio[BOX]::B3
          BOX.Q20 = BOX.Q20+0.5*4.
      ENDIF
"""
HEATER = """HEADER VARIABLES 1, BOX
C
C Heater[BOX]::343
C
      HY343 = 3.
      PO343 = 3.
      IF( NSOL .LE. 1 ) THEN
          T__TD =   1. * BOX.T1
          O__TD = 5. $ ON TEMP
          F__TD = 9. $ OFF TEMP
          BOX.Q1 = BOX.Q1 + PO343 * 1.
      ELSE
          T__TD =   1. * BOX.T1
          O__TD = 5. $ ON TEMP
          F__TD = 9. $ OFF TEMP
          IF( T__TD .LT. O__TD .OR.
     +       (HT343 .EQ. 1 .AND. T__TD .LT. F__TD ) ) THEN
              BOX.Q1 = BOX.Q1 + PO343 * 1.
          ENDIF
      ENDIF
"""
ESATAN = """$MODEL UNIT
$LOCALS
  $REAL
  k = 180.0D0; t = 0.003;   # W/(m K), m
  area = 0.2 * t;
$NODES
D1 = 'board', T = 25.0, C = 300.0, QI = 6.0;
D2 = 'foil', T = 25.0;
X7 = 'unused', T = 0.0;
B99 = 'wall', T = 10.0;
  $MODEL LID
  $NODES
  D1 = 'lid', T = 25.0,
     C = 120.0, EPS = 0.8;
  $CONDUCTORS
  $ENDMODEL LID
$CONDUCTORS
GL(1, 2) = area / 0.4 * k;
GL(2, 99) = 0.5;
GL(1, LID:1) = 0.2;
GR(LID:1, 99) = 0.01;
GL(1, 7) = 3.0;
$ARRAYS
$REAL
TIMES(3) = 0.0, 300.0, 600.0;
FLUX(3) = 0.0, 100.0, 0.0;
$VARIABLES1
  QA99 = 0.0
  QE2 = INTCYC(TIMEM, TIMES, FLUX, 1, 600.0, 0.0D0) * area
  CALL MYSUB(T1)
$EXECUTION
  TIMEND = 1200.0
  CALL SLCRNC
$ENDMODEL UNIT
"""


def read_network(path: Path) -> NetworkFile:
    text = path.read_text("latin-1")
    return read_esatan(path) if "$MODEL" in text else read_sinda(path, "" if re.search("(?i)abszro|TDUNITS", text) else "W m K")


def _write(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_bytes(text.encode("latin-1"))
    return folder / name


@pytest.fixture
def sinda(tmp_path: Path) -> Path:
    return _write(tmp_path, "case.inp", SINDA)


@pytest.fixture
def esatan(tmp_path: Path) -> Path:
    return _write(tmp_path, "unit.d", ESATAN)


def test_a_sinda_deck_is_the_network_that_it_says(sinda: Path) -> None:
    network = read_network(sinda)
    assert [f"{n.submodel}.{n.name}" for n in network.nodes if not n.held] == [f"BOX.T{k}" for k in (1, 2, 10, 15, 20, 30)]
    assert network.groups() == {"contact_board_to_wall_a1": 2}
    assert (network.duration, [r for r in network.remarks if r.dropped]) == (3600.0, [])
    settled = td.steady(network.model(), replace(network.scenario(), loads={}))
    t = {n: settled[f"BOX.T{n}"] for n in (1, 2, 10, 15, 20, 30)}
    space = 3.15
    lid = 0.02 * SIGMA * (t[1] ** 4 - space**4)
    assert 0.25 * (t[2] - t[1]) == pytest.approx(lid, rel=1e-9)  # conductor 1, through the register
    assert 0.25 * (t[10] - t[2]) == pytest.approx(lid, rel=1e-9)  # conductor 2, arithmetic of registers
    assert 0.3 * (t[20] - t[15]) == pytest.approx(2.0 + 1.0, rel=1e-9)  # GEN; the steady branch of the radio
    assert 0.1 * (t[30] - t[20]) == pytest.approx(1.0, rel=1e-9)
    assert lid + 0.05 * (t[10] - space) + 0.07 * (t[15] - space) == pytest.approx(2.5 + 1.0 + 2.0, rel=1e-9)


def test_courses_and_tables_of_a_sinda_deck_run(sinda: Path) -> None:
    network = read_network(sinda)
    case = network.scenario()
    (radio,) = case.loads.values()
    assert [radio.at(t) for t in (0.0, 300.0, 600.0, 1500.0)] == pytest.approx([0.0, 2.0, 4.0, 2.0])
    run = td.simulate(network.model(), case, every="60 [s]")
    (curve,) = (node.capacitance for node in network.nodes if node.name == "T30")
    assert isinstance(curve, dict)
    assert (curve["mass"], curve["specific_heat"]["points"]) == (
        "2.0 [kg]",
        [["0.0 [degC]", "100.0 [J/(kg K)]"], ["100.0 [degC]", "200.0 [J/(kg K)]"]],
    )
    assert run.heat_balance().relative < 1e-9


def test_a_heater_of_thermal_desktop_is_a_thermostat(tmp_path: Path) -> None:
    network = read_network(_write(tmp_path, "case.cc", SINDA + HEATER.replace("= 3.", "= 300.")))
    (heater,) = (load for load in network.loads if load.more)
    assert heater.more["thermostat"] == {"sensor": "BOX.T1", "on_below": "5.0 [degC]", "off_above": "9.0 [degC]"}
    assert [r for r in network.remarks if r.dropped] == []
    run = td.simulate(network.model(), replace(network.scenario(), duration=36_000.0), every="60 [s]")
    assert run["BOX.T1"].at(36_000.0) > 4.9


def test_one_way_conductors_are_streams(tmp_path: Path) -> None:
    """Air of 2 W/K enters at 20 degC, takes up 10 W and then 6 W: 25 and 28 degC. The minus stands at the end that the stream leaves."""
    text = """HEADER OPTIONS
C    TDUNITS,   Temp       = C
HEADER REGISTER DATA
      MCP = 2.
HEADER NODE DATA, AIR
  -1, 20., 0.
  2, 20., 5.
  3, 20., 5.
HEADER CONDUCTOR DATA, AIR
  1, -1, 2, MCP
  2, 3, -2, MCP
HEADER SOURCE DATA, AIR
  2, 10.
  3, 6.
"""
    network = read_network(_write(tmp_path, "stream.inp", text))
    assert [r for r in network.remarks if r.dropped] == []
    settled = td.steady(network.model(), network.scenario())
    assert [settled[f"AIR.T{k}"] - 273.15 for k in (2, 3)] == pytest.approx([25.0, 28.0], abs=1e-9)
    back = network.written_back(network.model().with_values({"mcp": 4.0}))
    assert next(iter(back.values())) == text.replace("MCP = 2.\n", "MCP = 4 $ fitted, was 2.\n")
    printed = Printed("STEADY", 0.0, {"AIR.T1": 20.0, "AIR.T2": 25.0, "AIR.T3": 28.0}, {f"AIR.T{k}": 0.005 for k in (1, 2, 3)})
    assert balance(network, printed).open() == {}
    off = balance(network, replace(printed, numbers={**printed.numbers, "AIR.T2": 26.0})).open()
    assert off == pytest.approx({"AIR.T2": 2.0, "AIR.T3": -2.0})


@pytest.mark.parametrize("row", ["-1, -1, 2, 0.5", "1, -1, -2, 2.", "SIV 1, -1, 2, A1, 1."])
def test_one_way_conductors_of_other_kinds_are_named(tmp_path: Path, row: str) -> None:
    nodes = "HEADER NODE DATA, AIR\n  -1, 293., 0.\n  2, 293., 5.\nHEADER ARRAY DATA, AIR\n 1 = 0., 1., 100., 2.\n"
    network = read_network(_write(tmp_path, "stream.inp", f"{nodes}HEADER CONDUCTOR DATA, AIR\n  {row}\n"))
    (remark,) = (r for r in network.remarks if r.dropped)
    assert "W/K" in str(remark)
    assert "stream.inp:7" in str(remark)


def test_streams_of_an_esatan_deck(tmp_path: Path) -> None:
    text = """$MODEL DUCT
$LOCALS
  $REAL
  mcp = 2.0;
$NODES
B1 = 'inlet', T = 20.0;
D2 = 'air', T = 20.0, C = 5.0, QI = 10.0;
$CONDUCTORS
GF(1,2) = mcp;
$EXECUTION
  TIMEND = 60.0
$ENDMODEL
"""
    network = read_network(_write(tmp_path, "duct.d", text))
    assert [r for r in network.remarks if r.dropped] == []
    assert td.steady(network.model(), network.scenario())["DUCT.T2"] - 273.15 == pytest.approx(25.0, abs=1e-9)


def test_english_units(tmp_path: Path) -> None:
    text = """HEADER OPTIONS
C    TDUNITS,   Energy     = BTU
C    TDUNITS,   Time       = hr
C    TDUNITS,   Temp       = F
HEADER NODE DATA, A
  1, 68., 10.
  -2, 32., 0.
HEADER CONDUCTOR DATA, A
  1, 1, 2, 2.
HEADER SOURCE DATA, A
  1, 100.
"""
    network = read_network(_write(tmp_path, "english.inp", text))
    settled = td.steady(network.model(), network.scenario())
    assert settled["A.T1"] - 273.15 == pytest.approx(50.0 * 5.0 / 9.0, abs=1e-9)  # 100 BTU/h over 2 BTU/(h F): 50 F above 32 F
    run = td.simulate(network.model(), replace(network.scenario(), loads={"A_Q1": "0 [W]"}, duration=36_000.0), every="1 [h]")
    assert run["A.T1"].at(18_000.0) == pytest.approx(20.0 * np.exp(-1.0), abs=1e-3)  # 10 BTU/F over 2 BTU/(h F): 5 h


def test_an_esatan_deck_is_the_network_that_it_says(esatan: Path) -> None:
    network = read_network(esatan)
    assert [n.path for n in network.nodes] == ["UNIT.T1", "UNIT.T2", "UNIT_T99", "UNIT_LID.T1"]
    lost, assumed = network.remarks
    assert (lost.dropped, assumed.dropped) == (True, False)
    assert str(lost).endswith(": 'CALL MYSUB(T1)'")
    assert re.search(r"STEFAN .* 5\.6686e-08 W/\(m\^2 K\^4\)", str(assumed))
    assert all(part in str(network) for part in ("INCOMPLETE: 1", "ESATAN"))
    model = network.model()
    settled = td.steady(model, network.scenario())
    board, foil, lid, wall = (settled[n] for n in ("UNIT.T1", "UNIT.T2", "UNIT_LID.T1", "UNIT_T99"))
    assert 0.27 * (board - foil) == pytest.approx(0.5 * (foil - wall), rel=1e-9)  # 0.2 * 0.003 / 0.4 * 180
    assert 0.2 * (board - lid) == pytest.approx(0.01 * 5.6686e-8 * (lid**4 - wall**4), rel=1e-9)
    assert 0.5 * (foil - wall) + 0.2 * (board - lid) == pytest.approx(6.0, rel=1e-9)
    assert td.steady(model.with_values({"k": 90.0}), network.scenario())["UNIT.T1"] > board + 1.0  # a local is a parameter
    course = network.scenario().commands["UNIT_QE_T2"]
    assert [course.at(t) for t in (0.0, 150.0, 300.0, 750.0)] == pytest.approx([0.0, 50.0, 100.0, 50.0])


def test_a_boundary_follows_its_array(esatan: Path) -> None:
    text = ESATAN.replace("  QA99 = 0.0\n", "  T99 = INTCYC(TIMEM, TIMES, FLUX, 1, 600.0, 0.0D0)\n")
    case = read_network(_write(esatan.parent, "swing.d", text)).scenario()
    assert [case.boundaries["UNIT_T99"].at(t) - 273.15 for t in (0.0, 150.0, 450.0)] == pytest.approx([0.0, 50.0, 50.0])


def test_what_is_saved_is_what_was_read(sinda: Path, esatan: Path, tmp_path: Path) -> None:
    for file in (sinda, esatan):
        network = read_network(file)
        model = network.model()
        (tmp_path / file.stem).mkdir()
        td.save_model(model, tmp_path / file.stem / "deck.toml")
        assert td.load_model(tmp_path / file.stem / "deck.toml") == model


def test_fitted_numbers_go_back_and_nothing_else_changes(sinda: Path) -> None:
    network = read_network(sinda)
    model = network.model().with_values({"contact_board_to_wall_a1": 2.0, "cond": 0.3})
    ((file, text),) = network.written_back(model).items()
    assert file == str(sinda)
    before, after = SINDA.splitlines(), text.splitlines()
    changed = {old.strip(): new.strip() for old, new in zip(before, after, strict=True) if old != new}
    assert changed == {
        "COND = 0.25 $ of the strap": "COND = 0.3 $ of the strap $ fitted, was 0.25",
        "3,    BOX.10,    SPACE.1,    0.05": "3,    BOX.10,    SPACE.1,    0.1 $ fitted, was 0.05",
        "4,    BOX.15,    SPACE.1,    0.07": "4,    BOX.15,    SPACE.1,    0.14 $ fitted, was 0.07",
    }
    again = read_network(_write(sinda.parent, "again.inp", text)).model()
    one, other = (td.steady(m, replace(network.scenario(), loads={})) for m in (model, again))
    assert max(abs(one[n] - other[n]) for n in one.keys()) < 1e-9
    assert network.written_back(network.model()) == {}


def test_esatan_numbers_go_back_with_line_ends_as_they_were(tmp_path: Path) -> None:
    file = _write(tmp_path, "unit.d", ESATAN.replace("\n", "\r\n"))
    network = read_network(file)
    ((_, text),) = network.written_back(network.model().with_values({"k": 150.0})).items()
    assert text == ESATAN.replace("\n", "\r\n").replace(
        "k = 180.0D0; t = 0.003;   # W/(m K), m", "k = 150; t = 0.003;   # W/(m K), m # fitted, was 180.0D0"
    )


def test_numbers_go_back_into_the_included_file_that_has_them(tmp_path: Path) -> None:
    """Registers in one include, contacts in another with line ends of Windows, a tab, a comment in Latin-1: bytes stay but for values."""
    registers = b"C 20 \xb0C\n      STRAP = 0.25\n      OTHER = 1.\n"
    contacts = b"C Contact - Face Contactor-Foot to wall[BOX][1]::A1\r\n"
    contacts += b"      3,\tBOX.1,    SPACE.1,    5.D-2\r\n      4,    BOX.2,    SPACE.1,    0.07\r\n"
    (tmp_path / "registers.inc").write_bytes(registers)
    (tmp_path / "contacts.inc").write_bytes(contacts)
    case = "HEADER REGISTER DATA\nINSERT registers.inc\nHEADER NODE DATA, BOX\n  1, 20., 5.\n  2, 20., 5.\n"
    case += "HEADER NODE DATA, SPACE\n  -1, 3., 0.\nHEADER CONDUCTOR DATA, BOX\n  1, 1, 2, STRAP\nINSERT contacts.inc\n"
    network = read_network(_write(tmp_path, "case.inp", case))
    (group,) = network.groups()
    back = network.written_back(network.model().with_values({"strap": 0.5, group: 3.0}))
    assert {Path(name).name: text.encode("latin-1") for name, text in back.items()} == {
        "registers.inc": registers.replace(b"STRAP = 0.25", b"STRAP = 0.5 $ fitted, was 0.25"),
        "contacts.inc": contacts.replace(b"5.D-2", b"0.15 $ fitted, was 5.D-2").replace(b"0.07", b"0.21 $ fitted, was 0.07"),
    }


def test_numbers_go_back_into_submodels_and_includes_of_esatan(tmp_path: Path) -> None:
    lid = "  $MODEL LID\n  $LOCALS\n    $REAL\n    bolt = 0.4;  # per bolt\n"
    lid += "  $NODES\n  D1 = 'lid', T = 25.0, C = 120.0;\n  $ENDMODEL LID\n"
    (tmp_path / "lid.inc").write_text(lid)
    text = "$MODEL UNIT\n$LOCALS\n  $REAL\n  bolt = 0.2;\n$NODES\nD1 = 'board', T = 25.0, C = 300.0;\n"
    text += "B9 = 'wall', T = 10.0;\n$INCLUDE 'lid.inc'\n"
    text += "$CONDUCTORS\nGL(1, LID:1) = 2 * bolt;\nGL(1, 9) = 0.5;\nGL(LID:1, 9) = 0.1;\n$ENDMODEL UNIT\n"
    network = read_network(_write(tmp_path, "unit.d", text))
    (own, inner) = (n for n in network.parameters if "bolt" in n)
    back = {Path(f).name: new for f, new in network.written_back(network.model().with_values({own: 0.3, inner: 0.6})).items()}
    assert back == {
        "unit.d": text.replace("bolt = 0.2;", "bolt = 0.3; # fitted, was 0.2"),
        "lid.inc": lid.replace("bolt = 0.4;  # per bolt", "bolt = 0.6;  # per bolt # fitted, was 0.4"),
    }


@pytest.mark.parametrize(("name", "text"), [("cut.inp", SINDA + HEATER), ("cut.d", ESATAN)])
def test_a_deck_cut_anywhere_is_read_or_refused_in_words(tmp_path: Path, name: str, text: str) -> None:
    refused = []
    for end in range(0, len(text), 23):
        try:
            read_network(_write(tmp_path, name, text[:end])).model()
        except ThermidError as error:
            refused.append(str(error))
    assert len(refused) > 10
    assert all(name in words for words in refused)


def test_the_balance_at_printed_temperatures(sinda: Path) -> None:
    network = read_network(sinda)
    settled = td.steady(network.model(), replace(network.scenario(), loads={}))
    rows = [f"   T {n.name[1:]:>7}= {settled[n.path] - 273.15:9.4f}    " for n in network.nodes if not n.held]
    out = _write(sinda.parent, "case.out", " SUBMODEL NAME = BOX\n" + "".join(rows) + "\n SUBMODEL NAME = SPACE\n   T       1= -270.00\n")
    printed = sinda_print(out)[-1]
    assert balance(network, printed).open() == {}
    off = replace(printed, numbers={**printed.numbers, "BOX.T30": printed.numbers["BOX.T30"] + 1.0})
    assert balance(network, off).open() == pytest.approx({"BOX.T20": -0.1, "BOX.T30": 0.1}, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "code", "match"),
    [
        ("HEADER NODE DATA, A\n  1, 20., x9\n", "import.not-understood", r"bad\.inp:2.*'x9'"),
        ("HEADER NODE DATA, A\n  1, 20.\n", "import.not-understood", r"bad\.inp:2.*'1, 20\.'"),
        (
            "HEADER NODE DATA, A\n  1, 20., 1.\nHEADER CONDUCTOR DATA, A\n 1, 1, 5, 2.\n",
            "import.not-understood",
            r"bad\.inp:4.*A_G1.*A\.T5",
        ),
        ("HEADER NODE DATA, A\n  1, 20., 1.\nINSERT bad.inp\n", "model.self-reference", r"bad\.inp.*bad\.inp"),
        ("HEADER NODE DATA, A\n  1, 20., 1.\nHEADER CONDUCTOR DATA, A\n 1, 1, 2.\n", "import.not-understood", r"bad\.inp:4.*'1, 1, 2\.'"),
        ("$MODEL A\n$NODES\nD1 = 'x', T = 0.0\n$ENDMODEL\n", "import.not-understood", r"bad\.inp:3.*'D1 = '.*', T = 0\.0'"),
        (
            "$MODEL A\n$NODES\nD1 = 'x', T = 0.0;\n",
            "import.not-understood",
            r"bad\.inp",
        ),
        ("$MODEL A\n$NODES\nD1 = 'x', T = 0.0, C = __import__('os').system('x');\n$ENDMODEL\n", "import.not-understood", r"bad\.inp:3"),
        ("$MODEL A\n$INCLUDE 'bad.inp'\n$ENDMODEL\n", "model.self-reference", r"bad\.inp:2.*bad\.inp.*bad\.inp"),
        ("deck of nobody\n", "file.another-kind", r"bad\.inp"),
        ("HEADER NODE DATA\0", "file.another-kind", r"bad\.inp"),
    ],
)
def test_bad_files_are_refused_with_file_and_line(tmp_path: Path, text: str, code: str, match: str) -> None:
    with raises_code(code, DeckError, match=match):
        read_network(_write(tmp_path, "bad.inp", text)).model()


def test_a_file_beyond_every_deck_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THERMID_CAPS", "deck=100")
    with raises_code("cap.exceeded", DeckError, match=r"big\.inp.*0.*'deck'.*100"):
        read_network(_write(tmp_path, "big.inp", SINDA))


def test_a_hundred_megabytes_are_refused_before_they_are_read(tmp_path: Path) -> None:
    with (tmp_path / "big.inp").open("wb") as file:
        file.write(SINDA.encode())
        file.truncate(100_000_000)  # sparse: it takes no room
    with raises_code("cap.exceeded", DeckError, match=r"big\.inp.*50"):
        read_sinda(tmp_path / "big.inp")


def test_logic_is_named_and_not_guessed(tmp_path: Path) -> None:
    text = SINDA + "HEADER VARIABLES 1, BOX\n      IF(T1 .GT. 5.) G1 = 3.\nHEADER FLOW DATA, LOOP\n      LU JUNC,1\nINSERT heat.hra\n"
    remarks = [str(r) for r in read_network(_write(tmp_path, "case.inp", text)).remarks]
    last = len(text.splitlines())
    wanted = [
        rf"{last}: INSERT heat\.hra: .*'heat\.hra'",
        rf"{last - 3}: .*: 'IF\(T1 \.GT\. 5\.\) G1 = 3\.'",
        rf"{last - 1}: FLUINT .*: 1 ",
    ]
    assert [bool(re.match(rf"case\.inp:{w}", r)) for w, r in zip(wanted, remarks, strict=True)] == [True] * 3


WRITERS = {"sinda": (to_sinda, "out.inp"), "esatan": (to_esatan, "out.d")}


@pytest.mark.parametrize("tool", WRITERS)
@pytest.mark.parametrize("source", ["sinda", "esatan"])
def test_what_is_written_reads_back_as_the_same_network(tool: str, source: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    first = read_network(request.getfixturevalue(source))
    model, case = first.model().with_values({"cond": 0.4} if source == "sinda" else {"k": 120.0}), first.scenario()
    if (source, tool) == ("sinda", "esatan"):  # which has no row for a table of specific heat
        text = SINDA.replace("SIV 30, 20., A7, 2.", "30, 20., 300.")
        model = read_network(_write(tmp_path, "plain.inp", text)).model().with_values({"cond": 0.4})
    write, name = WRITERS[tool]
    write(model, case, tmp_path / name)
    again = read_network(tmp_path / name)
    assert [str(r) for r in again.remarks if not r.mark] == []
    assert again.incomplete == model.incomplete
    one, other = (td.simulate(m, c, every="60 [s]") for m, c in ((model, case), (again.model(), again.scenario())))
    a, b = (sorted(run[n].kelvin[-1] for n in run.nodes) for run in (one, other))
    assert a == pytest.approx(b, abs=1e-5)  # two orders of the same rows, one tolerance of the integrator


@pytest.mark.parametrize("start", ["20 [degC]", "steady"])
def test_a_model_of_ones_own_is_written_and_read_back(tmp_path: Path, start: str) -> None:
    heat = {"points": [["-20 [degC]", "800 [J/(kg K)]"], ["30 [degC]", "900 [J/(kg K)]"], ["90 [degC]", "1300 [J/(kg K)]"]]}
    pad = {"points": [["0 [degC]", "0.1 [W/K]"], ["80 [degC]", "0.4 [W/K]"]]}
    deck = {
        "title": "two plates",
        "needs": ["room"],
        "nodes": {"hot": {"mass": "0.1 [kg]", "specific_heat": heat}, "foil": {}, "cold": {"capacitance": "50 [J/K]"}},
        "conductors": {
            "strap": {"kind": "conduction", "between": ["hot", "foil"], "conductance": "0.3 [W/K]"},
            "pad": {"kind": "table", "between": ["hot", "cold"], "table": pad},
            "foot": {"kind": "conduction", "between": ["foil", "room"], "conductance": "0.2 [W/K]"},
            "view": {"kind": "radiation", "between": ["cold", "room"], "emissivity": 0.8, "area": "200 [cm^2]"},
        },
        "loads": {"chip": {"into": "hot", "power": "5 [W]"}},
    }
    model = td.model_from_dict(deck)
    room = td.Scenario("room", boundaries={"room": "20 [degC]"}, start=start, duration="1 [h]")
    to_sinda(model, room, tmp_path / "plates.inp")
    again = read_network(tmp_path / "plates.inp")
    one, other = td.simulate(model, room, every="60 [s]"), td.simulate(again.model(), again.scenario(), every="60 [s]")
    for n, name in enumerate(("hot", "foil", "cold"), 1):
        assert one[name].kelvin == pytest.approx(other[f"MAIN.T{n}"].kelvin, abs=1e-6)
    with pytest.raises(DeckError, match=r"'hot' .* ESATAN"):
        to_esatan(model, room)
    with raises_code("output.not-expressible", DeckError, match="'pad'"):
        to_esatan(td.model_from_dict({**deck, "nodes": {**deck["nodes"], "hot": {"capacitance": "90 [J/K]"}}}), room)


@pytest.mark.parametrize(("write", "name"), WRITERS.values())
def test_what_carries_nothing_in_the_scenario_is_left_out_and_named(write: Callable[..., str], name: str, tmp_path: Path) -> None:
    coefficient = {"coefficient": "2 [W/(m^2 K)]", "exponent": 0.25}
    heater = {"into": "box", "power": "12 [W]", "thermostat": {"on_below": "18 [degC]", "off_above": "21 [degC]"}}
    deck = {
        "title": "box",
        "needs": ["room"],
        "nodes": {"box": {"capacitance": "500 [J/K]"}},
        "surfaces": {"skin": {"of": "box", "to": "room", "area": "0.05 [m^2]", "htc": coefficient, "emissivity": 0.8}},
        "loads": {"heater": heater, "chip": {"into": "box", "power": "5 [W]"}},
    }
    model = td.model_from_dict(deck)
    room = td.Scenario("room", boundaries={"room": "30 [degC]"}, loads={"heater": "0 [W]"}, start="30 [degC]", duration="2 [h]")
    with raises_code("output.not-expressible", DeckError, match="'skin'"):
        write(model, room)
    with raises_code("output.not-expressible", DeckError, match="'heater'"):
        write(model, replace(room.vacuum(), loads={}))
    text = write(model, room.vacuum(), tmp_path / name)
    ends = [line.rpartition(": ")[2] for line in text.splitlines()]
    assert [e for e in ends if e.startswith(("skin (", "heater"))] == ["skin (power law)", "heater"]
    again = read_network(tmp_path / name)
    one, other = td.simulate(model, room.vacuum(), every="600 [s]"), td.simulate(again.model(), again.scenario(), every="600 [s]")
    assert one["box"].kelvin == pytest.approx(next(iter(other[n] for n in other.nodes)).kelvin, abs=1e-6)


CARDS_OF_2008 = "afcarl/Air-Launch-Vehicle-Thermal-Analysis-and-Trade-Study/SINDA/LOX_Liq_12ft_Dia/Rev_A/AL_PLP_a.sin"
SHA = {
    "bpar907/APSS-2-Thermal-TXRX/case0.cc": "595976262a34c2c2bc118b143d8a87c12484fbae092f1fa545d7e175b9e62cc3",
    "oresat/oresat-thermal/OreSat0.5/case0.cc": "1c9075ed7f0441ac4720e3c1a647fa268120a0a51313df8e2bd4a29b0c56c85f",
    CARDS_OF_2008: "ebcc8e799d940d14a8140345eaa1a6edcb74549edebe233cdbbc9ce8008adcd3",
    "mlauryn/EsatanOpt/Radiator/radiator.d": "e784683c76b0daefbf6fcf7335faef5ead285ad40de79987dbb4f0bd7ba7ceeb",
}


def _public(name: str) -> Path:
    return public_file(name, SHA[name])


def test_a_deck_of_thermal_desktop_against_sindas_own_print() -> None:
    folder = _public("bpar907/APSS-2-Thermal-TXRX/case0.cc").parent
    network = read_network(folder / "case0.inp")
    assert (len(network.nodes), len(network.conductors)) == (127, 2520)
    prints = sinda_print(folder / "case0.out")
    assert np.abs(agreement(network, prints).off).max() < 0.0055  # the print has two digits
    assert balance(network, prints[-1]).open() == {}


def test_heat_rates_beside_a_deck_bring_it_to_its_print() -> None:
    folder = _public("oresat/oresat-thermal/OreSat0.5/case0.cc").parent
    network = read_network(folder / "case0.inp")
    assert (len(network.nodes), len(network.conductors)) == (659, 12_426)
    assert network.incomplete == ""
    prints = sinda_print(folder / "case0.out")
    assert np.abs(agreement(network, prints).off).max() < 0.0055
    assert balance(network, prints[-1]).open() == {}


def test_esatans_cycle_within_its_own_convergence() -> None:
    file = _public("mlauryn/EsatanOpt/Radiator/radiator.d")
    printed = {
        10: (7.01, 10.22),
        20: (1.46, 4.78),
        30: (2.98, 6.24),
        40: (0.46, 3.87),
        50: (2.98, 6.24),
        60: (0.46, 3.87),
        70: (-4.01, 0.35),
    }
    network = read_network(file)
    run = td.simulate(network.model(), replace(network.scenario(), start="periodic", initial={}), every="20 [s]")
    off = [
        abs(a - b)
        for n, pair in printed.items()
        for a, b in zip((run[f"RADIATOR.T{n}"].lowest, run[f"RADIATOR.T{n}"].highest), pair, strict=True)
    ]
    assert max(off) < 2 * 0.0556  # its last cycle still moved by 0.0556 K
    assert re.fullmatch(r"radiator", network.title)


ROWS = """HEADER NODE DATA, BOX
  1, 20., 5.
  2, 20., 5.D0
  GEN 3, 2, 1, 20., 7.
HEADER NODE DATA, SPACE
  -1, 3., 0.
  -2, 3., 0.
  -3, 3., 0.
HEADER ARRAY DATA, BOX
 1 = 0., 1., 100., 2.
HEADER CONDUCTOR DATA, BOX
C Contact - Face Contactor-Foot to wall[BOX][1]::A1
  GEN 3, 3, 1, BOX.1, 1, SPACE.1, 1, 5.D-2
  10, 1, 2, 2, 3, 0.7
  11, 3, 4, 0.4
  SIV 12, 1, 4, A1, 2.5
HEADER SOURCE DATA, BOX
  1, 6.
"""


@pytest.mark.parametrize(
    ("values", "row", "written"),
    [
        ({"contact_foot_to_wall_a1": 2.0}, "SPACE.1, 1, 5.D-2", "SPACE.1, 1, 0.1 $ fitted, was 5.D-2"),  # one number of three conductors
        ({"BOX_G11.conductance": "0.6 [W/K]"}, "4, 0.4", "4, 0.6 $ fitted, was 0.4"),
        ({"BOX_G10_1.conductance": "1.4 [W/K]", "BOX_G10_2.conductance": "1.4 [W/K]"}, "3, 0.7", "3, 1.4 $ fitted, was 0.7"),
        ({"BOX_G12.scale": 5.0}, "A1, 2.5", "A1, 5 $ fitted, was 2.5"),
        ({"BOX.T2.capacitance": "4 [J/K]"}, "5.D0", "4 $ fitted, was 5.D0"),
        ({"BOX_Q1.power": "9 [W]"}, "1, 6.", "1, 9 $ fitted, was 6."),
    ],
)
def test_every_changed_number_goes_back(tmp_path: Path, values: dict[str, float | str], row: str, written: str) -> None:
    network = read_network(_write(tmp_path, "rows.inp", ROWS))
    model = network.model().with_values(values)
    (text,) = network.written_back(model).values()
    assert text == ROWS.replace(row, written)
    assert network.not_written_back(model) == ()
    again = read_network(_write(tmp_path, "again.inp", text)).model()
    one, other = (td.steady(m, network.scenario()) for m in (model, again))
    assert max(abs(one[n] - other[n]) for n in one.keys()) < 1e-6


@pytest.mark.parametrize(
    ("path", "value"), [("BOX_G10_1.conductance", "1.25 [W/K]"), ("BOX_G4.conductance", "1.25 [W/K]"), ("BOX.T3.capacitance", "8 [J/K]")]
)
def test_one_number_of_several_values_is_not_written_for_one_of_them(tmp_path: Path, path: str, value: str) -> None:
    network = read_network(_write(tmp_path, "rows.inp", ROWS))
    model = network.model().with_values({path: value})
    assert network.written_back(model) == {}
    assert network.not_written_back(model) == (path,)


def test_a_deck_that_is_no_import_of_the_file_is_refused(tmp_path: Path, sinda: Path) -> None:
    network = read_network(_write(tmp_path, "rows.inp", ROWS))
    with raises_code("file.another-kind", DeckError, match="'contact_foot_to_wall_a1'"):
        network.written_back(read_network(sinda).model())


def test_a_row_without_a_field_is_refused_with_its_place(tmp_path: Path) -> None:
    for nodes, conductors in (("(|\n", ""), ("", "(|\n")):
        text = f"HEADER NODE DATA, MAIN\n10, 20.0, 100.0\n{nodes}HEADER CONDUCTOR DATA, MAIN\n{conductors}END OF DATA\n"
        (tmp_path / "net.cc").write_text(text, encoding="utf-8")
        with raises_code("import.not-understood", DeckError, match=r"'\(\|'"):
            read_sinda(tmp_path / "net.cc", "W m C")


RADK = """HEADER CONTROL DATA, GLOBAL
    abszro = 0.
HEADER NODE DATA, BOX
  1, 300., 5.
  2, 300., 5.
HEADER NODE DATA, SPACE
  -1, 3., 0.
HEADER CONDUCTOR DATA, BOX
  1, 1, 2, 0.4
  -2, 1, SPACE.1, 0.01
HEADER CONDUCTOR DATA, C0A0
  -1, BOX.1, SPACE.1, 0.02
  -2, BOX.2, SPACE.1, 0.03
HEADER SOURCE DATA, BOX
  1, 6.
"""


def test_a_block_of_radiation_has_one_factor(tmp_path: Path) -> None:
    network = read_network(_write(tmp_path, "radk.inp", RADK))
    assert network.groups() == {"radiation_c0a0": 2}
    model = network.model().with_values({"radiation_c0a0": 0.5})
    settled = td.steady(model, network.scenario())
    area = {"BOX.T1": 0.01 + 0.5 * 0.02, "BOX.T2": 0.5 * 0.03}
    assert sum(5.670374419e-8 * a * (settled[n] ** 4 - 3.0**4) for n, a in area.items()) == pytest.approx(6.0, rel=1e-9)
    (text,) = network.written_back(model).values()
    assert text == RADK.replace("0.02\n", "0.01 $ fitted, was 0.02\n").replace("0.03\n", "0.015 $ fitted, was 0.03\n")
    again = read_network(_write(tmp_path, "again.inp", text))
    assert td.steady(again.model(), again.scenario())["BOX.T1"] == pytest.approx(settled["BOX.T1"], rel=1e-12)


@pytest.mark.parametrize(
    ("stated", "asked"),
    [
        ("    sigma = 5.67e-8\n", r"\(ABSZRO\)"),
        ("    UID = ENG\n", r"\(ABSZRO\)"),
        ("    abszro = -459.67\n", r"\(UID\)"),
    ],
)
def test_units_that_nothing_states_are_asked_for(tmp_path: Path, stated: str, asked: str) -> None:
    file = _write(tmp_path, "silent.inp", RADK.replace("    abszro = 0.\n", stated))
    with pytest.raises(DeckError, match=asked) as refused:
        read_sinda(file)
    assert refused.value.code == "value.incomplete"
    assert read_sinda(file, "BTU h F").nodes[0].celsius == pytest.approx((300.0 - 32.0) * 5.0 / 9.0)


def test_a_unit_that_is_none_is_refused(sinda: Path) -> None:
    with pytest.raises(DeckError, match="FURLONG"):
        read_sinda(sinda, "W furlong C")


CARDS = """       BCD 3THERMAL LPCS
       BCD 9 A PLATE, BTU IN SEC DEG F
       END
       BCD 3NODE DATA
C  the plate
cc         1, 99., 5.
           1, 68., 0.01
       CAL 2, 68., 0.1, 0.2, 3.0, 1.0
           3, 68., -1.0
       SIV 4, 68., A7, 0.5
          -8, 32., 0.
       SIT -9, 0.0, A2, 0.0
       END
       BCD 3SOURCE DATA
           1, 0.002
       SIT 2, A1, 2.0
       END
       BCD 3CONDUCTOR DATA
       CAL 1, 1, 3, 2.0, 5.0, 1.E-4, 1.0
           2, 3, 2, K5
       CAL -3, 1, 8, 0.9, 3.3063E-15, 36.0, 1.0
           4, 2, 9, 0.0008
           6, 1, 4, 0.001
       CAL 5, 2, 9, 2.0, 5.0, 1.E-4, 3.0
       END
       BCD 3CONSTANTS DATA
           TIMEO = -100., TIMEND, 300.
           5, 0.002
       END
       BCD 3ARRAY DATA
           1
             -100.0,0.0,  0.0, 0.0
             0.0, 0.001, 300., 0.001
           END
           2,-100.0,32.0, 300., 72.0,END
           7
             0.0, 0.01, 200., 0.03
           END
       END
       BCD 3EXECUTION
           SNDUFR
       END
       BCD 3VARIABLES 1
M     IF( TIMEN .GE.    0.0 )  G(1) = 0.0
       END
       BCD 3VARIABLES 2
       END
       BCD 3END OF DATA
"""


def test_a_deck_of_cards_is_the_network_that_it_says(tmp_path: Path) -> None:
    file = _write(tmp_path, "plate.sin", CARDS)
    with pytest.raises(DeckError, match="ABSZRO"):
        read_sinda(file)
    network = read_sinda(file, "BTU s in F")
    assert [f"{n.name}{' held' * n.held}" for n in network.nodes] == ["T1", "T2", "T3", "T4", "T8 held", "T9 held"]
    (lost,) = (r for r in network.remarks if r.dropped)
    assert str(lost).endswith(": 'IF( TIMEN .GE. 0.0 ) G(1) = 0.0'")
    btu, degree = 1055.05585262, 5.0 / 9.0
    model, case = network.model(), network.scenario()
    values = ParameterSet(model).evaluate({})
    assert values["MAIN_G1.conductance"] == pytest.approx(1e-3 * btu / degree)
    assert values["MAIN_G5.conductance"] == pytest.approx(1e-3 / 3.0 * btu / degree)
    assert values["MAIN.T2.capacitance"] == pytest.approx(0.06 * btu / degree)
    assert values["MAIN_R3.area"] == pytest.approx(0.9 * 36.0 * 0.0254**2, rel=2e-3)  # by 1.714e-9, not 1.7123e-9
    assert (network.duration, case.boundaries["MAIN_T9"].at(200.0) - 273.15) == (400.0, pytest.approx(100.0 / 9.0))  # 52 F at 100 s
    (source,) = case.loads.values()
    assert [source.at(t) for t in (50.0, 99.9, 100.0, 300.0)] == pytest.approx([0.0, 0.0, 0.002 * btu, 0.002 * btu])
    back = network.written_back(model.with_values({"k5": 0.004, "MAIN_G1.conductance": 4e-3 * btu / degree}))
    assert next(iter(back.values())) == CARDS.replace("5, 0.002\n", "5, 0.004 $ fitted, was 0.002\n").replace(
        "3, 2.0, 5.0, 1.E-4, 1.0\n", "3, 8, 5.0, 1.E-4, 1.0 $ fitted, was 2.0\n"
    )


def test_a_listing_of_cards_is_read_as_the_cards(tmp_path: Path) -> None:
    page = "(C) COPYRIGHT 1982 SINDA/G VERSION\n  A PLATE\n\n"
    rows = [f" {row}\n" for row in CARDS.splitlines()]
    rows = [row + "\n NODAL ANALYSIS, DIFUS = 2\n\n" if row.strip() == "END" and k < 20 else row for k, row in enumerate(rows)]
    rows[39:39] = [page]
    listing = read_sinda(_write(tmp_path, "plate.sls", " (C) COPYRIGHT 1982 SINDA/G VERSION\n" + "".join(rows)), "BTU s in F")
    deck = read_sinda(_write(tmp_path, "plate.sin", CARDS), "BTU s in F")
    assert [(c.name, c.ends, dict(c.table).get("conductance")) for c in listing.conductors] == [
        (c.name, c.ends, dict(c.table).get("conductance")) for c in deck.conductors
    ]
    assert listing.case() == {**deck.case(), "title": listing.title}


def test_cards_of_sinda_g_against_its_own_print() -> None:
    """From 1000 s, when its steps of 1 s no longer matter, to 4000 s, when logic opens a conductor, which is named."""
    file = _public(CARDS_OF_2008)
    network = read_sinda(file, "BTU s in F")
    assert network.incomplete.startswith("1 ")
    compared = agreement(network, sinda_print(file.with_suffix(".sot")))
    calm = (compared.times > 1000.0) & (compared.times < 4000.0)
    assert calm.sum() == 1499
    assert np.sqrt(np.mean(compared.off[calm] ** 2)) < 0.002
    assert np.abs(compared.off[calm]).max() < 0.035


def test_an_array_of_a_radiation_conductor_is_its_emissivity_at_the_mean_temperature(tmp_path: Path) -> None:
    text = "HEADER CONTROL DATA, GLOBAL\n  abszro = -273.15\n  sigma = 5.670374419e-08\n  UID = SI\nHEADER NODE DATA, A\n  1, 20., 50.\n"
    text += "  -2, -200., 0.\nHEADER SOURCE DATA, A\n  1, 30.\nHEADER ARRAY DATA, A\n  3 = -100., 0.2, 100., 0.6\n"
    network = read_network(_write(tmp_path, "paint.inp", text + "HEADER CONDUCTOR DATA, A\n  SIV -1, 1, 2, A3, 0.15\n"))
    assert [r for r in network.remarks if r.dropped] == []
    hot, cold = td.steady(network.model(), network.scenario())["A.T1"], 73.15
    emissivity = 0.4 + 0.002 * (0.5 * (hot + cold) - 273.15)
    assert 0.15 * emissivity * 5.670374419e-08 * (hot**4 - cold**4) == pytest.approx(30.0, rel=1e-6)
    at = {"A.T1": hot - 273.15, "A.T2": -200.0}
    assert balance(network, Printed("STEADY", 0.0, at, dict.fromkeys(at, 0.005))).open() == {}
    back = network.written_back(network.model().with_values({"A_R1.area": 0.2}))
    assert "SIV -1, 1, 2, A3, 0.2" in next(iter(back.values()))


@pytest.mark.parametrize("more", ["", "  -1, 10., 0.\n  -2, 30., 0.\n"])
def test_a_transient_begins_at_the_temperatures_of_its_nodes(tmp_path: Path, more: str) -> None:
    text = f"HEADER CONTROL DATA, GLOBAL\n  abszro = -273.15\n  timend = 10.\nHEADER NODE DATA, A\n  3, 25., 5.\n  4, 40., 5.\n{more}"
    text += "HEADER CONDUCTOR DATA, A\n  1, 3, 4, 0.1\n" + ("  2, 3, 1, 0.1\n  3, 4, 2, 0.1\n" if more else "")
    network = read_network(_write(tmp_path, "free.inp", text))
    run = td.simulate(network.model(), network.scenario())
    assert [run[f"A.T{k}"].kelvin[0] - 273.15 for k in (3, 4)] == pytest.approx([25.0, 40.0])
