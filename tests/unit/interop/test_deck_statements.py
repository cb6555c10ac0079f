"""Statements of decks that decide a number: control constants, branches, inactive nodes, models inside models, registers anywhere."""

from __future__ import annotations

from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from thermid.interop._decks.esatan import read_esatan
from thermid.interop._decks.network_file import NetworkFile
from thermid.interop._decks.sinda import read_sinda
from thermid.interop._fmu.archive import check_archive
from thermid.model.tree import ParameterSet

CONTROL = """HEADER CONTROL DATA, GLOBAL
      ABSZRO = -273.15
      SIGMA = 5.67E-8
      UID = SI
      TIMEND = 3600.
"""
NETWORK = """HEADER NODE DATA, M
      1, 20., 100.
      -2, 20., 0.
HEADER CONDUCTOR DATA, M
      1, 1, 2, 0.5
"""
REGISTERS = """HEADER REGISTER DATA
      HOURS = 2.0
      SB = 5.67E-8
"""
COURSE = """HEADER ARRAY DATA, M
      1 = 0.,1., 3600.,3.
HEADER VARIABLES 1, M
"""


def _sinda(folder: Path, text: str) -> NetworkFile:
    (folder / "case.inp").write_text(text, encoding="latin-1")
    return read_sinda(folder / "case.inp")


def _esatan(folder: Path, text: str) -> NetworkFile:
    (folder / "top.d").write_text(text, encoding="latin-1")
    return read_esatan(folder / "top.d")


def _dropped(network: NetworkFile) -> list[str]:
    """What no reader took over, as the remarks quote it."""
    return [remark.what.split(": ", 1)[1].strip("'") for remark in network.remarks if remark.dropped]


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("HOURS*3600.", 7200.0), ("2. * 3600.", 7200.0), ("3.6D3", 3600.0), ("2.*3600., OUTPUT = 60.", 7200.0), ("60. OUTPUT = 9.", 60.0)],
)
def test_a_control_constant_is_arithmetic_of_registers(tmp_path: Path, text: str, seconds: float) -> None:
    network = _sinda(tmp_path, CONTROL.replace("3600.", text) + NETWORK + REGISTERS)
    assert (network.duration, network.remarks) == (seconds, ())


def test_a_constant_of_radiation_is_arithmetic_too(tmp_path: Path) -> None:
    plain = _sinda(tmp_path, CONTROL + NETWORK + "      -3, 1, 2, 0.01\n")
    network = _sinda(tmp_path, REGISTERS + CONTROL.replace("5.67E-8", "SB*1.0") + NETWORK + "      -3, 1, 2, 0.01\n")
    assert (network.conductors[1].table, network.remarks) == (plain.conductors[1].table, ())


@pytest.mark.parametrize("line", ["NODEPAIR 5", "TIMEO = SOON", "TIMEND = 5. SECONDS"])
def test_a_line_of_control_data_that_is_not_read_is_named(tmp_path: Path, line: str) -> None:
    network = _sinda(tmp_path, CONTROL.replace("      UID", f"      {line}\n      UID") + NETWORK)
    assert _dropped(network) == [line]


@pytest.mark.parametrize(
    ("logic", "named"),
    [
        ("IF (NSOL .GT. 1) THEN|CALL D1DEG1(TIMEM, A1, QX)|Q1 = Q1 + QX|ELSE|CALL D1DEG1(TIMEM, A1, QY)|Q1 = Q1 + QY*0.5|ENDIF", "QY"),
        ("CALL D1DEG1(TIMEM, A1, QX)|IF (NSOL .GT. 1) THEN|Q1=Q1+QX|ELSE|Q1=Q1+QX*0.5|ENDIF", "QX*0.5"),
    ],
)
def test_a_course_of_the_steady_branch_is_no_load_of_the_transient(tmp_path: Path, logic: str, named: str) -> None:
    rows = "".join(f"      {row}\n" for row in logic.split("|"))
    network = _sinda(tmp_path, CONTROL + NETWORK + COURSE + rows)
    assert [(load.name, load.power) for load in network.loads] == [("M_Q1", 2.0)]
    (what,) = _dropped(network)
    assert named in what


STEADY_FIRST = "HEADER OPERATION DATA\n      BUILD ALL\n      CALL STEADY\n      CALL TRANSIENT\n"
ALONE = "      IF (NSOL .GT. 1) THEN\n      CALL D1DEG1(TIMEM, A1, QX)\n      Q1 = Q1 + QX\n      {}ENDIF\n"


@pytest.mark.parametrize(("also", "watts"), [("", 0.0), ("ELSE\n      Q1 = Q1 + 1.5\n      ", 2.0)])
def test_a_course_of_the_transient_alone_is_none_of_the_steady_start(tmp_path: Path, also: str, watts: float) -> None:
    """In both branches the steady state takes the mean of the course, 2 W; the number beside it is the tool's mean over its own steps."""
    network = _sinda(tmp_path, CONTROL + STEADY_FIRST + NETWORK + COURSE + ALONE.format(also))
    assert network.remarks == ()
    run = td.simulate(network.model(), network.scenario())["M.T1"].celsius
    behind = 2.0 / 3600.0 * 200.0  # a ramp is followed after the time constant
    assert (run[0], run[-1]) == pytest.approx((20.0 + watts / 0.5, 20.0 + (3.0 - behind) / 0.5), abs=1e-5)


def test_a_start_that_takes_a_course_of_the_transient_alone_says_so(tmp_path: Path) -> None:
    """One that repeats has no first moment at which it could be nothing."""
    rows = ALONE.format("").replace("D1DEG1(TIMEM, A1, QX)", "D11CYL(3600., TIMEM, A1, QX)")
    (remark,) = _sinda(tmp_path, CONTROL + STEADY_FIRST + NETWORK + COURSE + rows).remarks
    assert not remark.dropped


def test_the_power_of_a_course_is_its_mean_over_time(tmp_path: Path) -> None:
    rows = "HEADER ARRAY DATA, M\n      1 = 0.,0., 90.,0., 100.,10.\nHEADER SOURCE DATA, M\n      SIT 1, A1, 2.\n"
    assert _sinda(tmp_path, CONTROL + NETWORK + rows).loads[0].power == pytest.approx(1.0)


def test_heat_rates_of_the_steady_branch_are_named(tmp_path: Path) -> None:
    rows = "      IF (NSOL .GT. 1) THEN\n      ELSE\n      CALL LOADQ_SUN_1\n      ENDIF\n"
    assert "LOADQ" in _dropped(_sinda(tmp_path, CONTROL + NETWORK + COURSE + rows))[0]


def test_a_register_stands_for_any_number_of_a_row(tmp_path: Path) -> None:
    cal = "CAL 6, 1, 2, 3.0, 4.0, HOURS"  # of five cells the last may be a factor or a divisor
    rows = (
        NETWORK.replace("1, 20.,", "1, HOURS*10.,")
        + f"      CAL 5, 1, 2, 3.0, 4.0, HOURS/2.\n      {cal}\n      SIV 7, 1, 2, A1, HOURS\n"
        + "HEADER ARRAY DATA, M\n      1 = 0., 1., 100., HOURS\nHEADER NODE DATA, M\n      SIV 3, HOURS, A1, HOURS\n"
        + "HEADER SOURCE DATA, M\n      SIT 1, A1, HOURS\n"
    )
    network = _sinda(tmp_path, REGISTERS + CONTROL + rows)
    assert _dropped(network) == [cal]
    assert [(node.name, node.celsius) for node in network.nodes] == [("T1", 20.0), ("T2", 20.0), ("T3", 2.0)]
    model = network.model()
    values = ParameterSet(model).evaluate({"hours": 3.0})
    assert (values["M_G5.conductance"], values["M_G7.scale"]) == (pytest.approx(8.0), 3.0)
    assert (values["M.T3.mass"], values["M_Q1.power"]) == (3.0, 3.0)
    assert network.case()["commands"]["M_Q1"]["values"] == [1.0, 2.0]


@pytest.mark.parametrize("row", ["SIV 3, 20., A1, HOURS", "FAC HOURS\n      SIV 3, 20., A1", "SIM 3, 1, 1, 20., A1, HOURS"])
def test_a_register_that_multiplies_a_capacitance_over_temperature_is_fitted_and_written_back(tmp_path: Path, row: str) -> None:
    rows = f"{NETWORK}      3, 2, 3, 0.1\nHEADER NODE DATA, M\n      {row}\nHEADER ARRAY DATA, M\n      1 = 0., 1., 100., 2.\n"
    network = _sinda(tmp_path, REGISTERS + CONTROL + rows)
    fitted = network.model().with_values({"hours": "3."})
    (text,) = network.written_back(fitted).values()
    again = ParameterSet(_sinda(tmp_path, text).model()).evaluate({})
    assert again == pytest.approx(ParameterSet(fitted).evaluate({}))
    assert again["M.T3.mass"] == 3.0


def test_two_arrays_are_two(tmp_path: Path) -> None:
    rows = f"{NETWORK}HEADER NODE DATA, M\n      DIV 3, 20., A1, 2.\nHEADER ARRAY DATA, M\n      1 = 0., 1., 100., 2.\n"
    with raises_code("import.not-understood"):
        _sinda(tmp_path, CONTROL + rows)


@pytest.mark.parametrize("row", ["NODE DATA, M\n      DIV 3, 20., A1, HOURS, A1, 2.", "SOURCE DATA, M\n      SIV 1, A1, HOURS"])
def test_a_table_that_takes_in_a_register_says_that_it_does_not_follow_it(tmp_path: Path, row: str) -> None:
    rows = f"{NETWORK}      3, 2, 1, 0.1\nHEADER {row}\nHEADER ARRAY DATA, M\n      1 = 0., 1., 100., 2.\n"
    (remark,) = _sinda(tmp_path, REGISTERS + CONTROL + rows).remarks
    assert (remark.dropped, "follow" in remark.what) == (False, True)


MODELS = """$MODEL TOP
$MODEL SUB
$NODES
D1 = 'a', T = 20.0, C = 10.0;
X2 = 'x', T = 20.0, C = 10.0;
$CONDUCTORS
GL(1, 2) = 1.0;
$ENDMODEL SUB
$NODES
B1 = 'b', T = 20.0;
D3 = 'c', T = 20.0, C = 5.0;
$CONDUCTORS
GL(1, SUB:1) = 2.0;
GL(3, SUB:2) = 2.0;
GL(3, SUB:1) = 2.0;
$ARRAYS
$REAL
PAIRS(2, 2) = 0.0, 1.0, 100.0, 3.0;
$INITIAL
  {initial}
$VARIABLES1
  {variables}
$EXECUTION
  TIMEND = 100.0;
$ENDMODEL TOP
"""


def _models(folder: Path, variables: str = "", initial: str = "") -> NetworkFile:
    return _esatan(folder, MODELS.format(variables=variables, initial=initial))


def test_an_inactive_node_of_an_inner_model_has_no_conductors_and_no_loads(tmp_path: Path) -> None:
    network = _models(tmp_path, "QI:SUB:2 = 4.0\n  QR:SUB:2 = INTRP1(TIMEM, PAIRS, 1)")
    assert [c.name for c in network.conductors] == ["TOP_GL_T1_SUB_T1", "TOP_GL_T3_SUB_T1"]
    assert (network.loads, network.remarks, network.duration) == ((), (), 100.0)
    assert network.model()


def test_a_temperature_that_logic_holds_at_each_step_is_no_start(tmp_path: Path) -> None:
    network = _models(tmp_path, "T3 = 55.0", "T3 = 40.0;")
    assert _dropped(network) == ["T3 = 55.0"]
    assert next(node.celsius for node in network.nodes if node.name == "T3") == 40.0


def test_logic_before_the_run_gives_no_course(tmp_path: Path) -> None:
    network = _models(tmp_path, "", "T1 = INTRP1(TIMEM, PAIRS, 1)\n  QI3 = INTRP1(TIMEM, PAIRS, 1)")
    assert (network.courses, network.loads, len(_dropped(network))) == ({}, (), 1)


def test_a_semicolon_ends_a_statement_of_logic(tmp_path: Path) -> None:
    network = _models(tmp_path, "QI3 = 5.0;\n  QS3 = INTRP1(TIMEM, PAIRS, 1) ;")
    assert [(load.name, load.power) for load in network.loads] == [("TOP_QI_T3", "5.0 [W]"), ("TOP_QS_T3", "1.0 [W]")]
    assert network.remarks == ()
    (back,) = network.written_back(network.model().with_values({"TOP_QI_T3.power": "6 [W]"})).values()
    assert "QI3 = 6; #" in back


TWINS = """$MODEL A
$MODEL B_C
$NODES
D1 = 'a', T = 20.0, C = 10.0;
$ENDMODEL B_C
$MODEL B
$MODEL C
$NODES
D1 = 'z', T = 20.0, C = 30.0;
$ENDMODEL C
$ENDMODEL B
$NODES
B1 = 'b', T = 20.0;
$CONDUCTORS
GL(1, B_C:1) = 2.0;
$CONDUCTORS
GL(1, B:C:1) = 3.0;
GL(1, B:C:1) = 4.0;
GL(1, B_C:1) = 5.0;
$VARIABLES1
QI:B:C:1 = 7.0
$ENDMODEL A
"""


def test_models_of_one_name_when_written_together_stay_two(tmp_path: Path) -> None:
    network = _esatan(tmp_path, TWINS)
    assert network.remarks == ()
    masses = {(node.submodel, node.name): node.capacitance for node in network.nodes}
    assert [(masses[c.ends[1]], c.table["conductance"]) for c in network.conductors] == [
        ("10.0 [J/K]", "2.0 [W/K]"), ("30.0 [J/K]", "3.0 [W/K]"), ("30.0 [J/K]", "4.0 [W/K]"), ("10.0 [J/K]", "5.0 [W/K]"),
    ]  # fmt: skip
    assert [masses[load.into] for load in network.loads] == ["30.0 [J/K]"]
    assert len(network.model().conductors) == 4


def test_codes_fit_the_cause(tmp_path: Path) -> None:
    (tmp_path / "note.fmu").write_text("no archive", encoding="latin-1")
    with raises_code("file.another-kind"):
        check_archive(tmp_path / "note.fmu")
    with raises_code("model.self-reference"):
        _sinda(tmp_path, CONTROL + NETWORK + "INSERT 'case.inp'\n")
    with raises_code("import.not-understood"):
        _sinda(tmp_path, CONTROL + NETWORK.replace("0.5", "2.5+4"))
    with raises_code("import.not-understood"):
        _sinda(tmp_path, CONTROL + NETWORK + "HEADER SOURCE DATA, M\n      SIT 1, A7, 1.0\n")
    with raises_code("value.contradicts"):
        read_sinda(tmp_path / "case.inp", "BTU h ft F")
