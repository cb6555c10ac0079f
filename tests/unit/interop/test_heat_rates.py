"""Heat absorbed along an orbit, from files beside a deck; arrays over temperature in a submodel of their own."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from public_files import public_file
from thermid.base.errors import DeckError
from thermid.interop._decks import results
from thermid.interop._decks.results import Agreement, agreement, balance, sinda_print
from thermid.interop._decks.sinda import read_sinda

ORBIT = 600.0
TIMES = (0.0, 200.0, 210.0, 400.0, 600.0)
RATES = {("PLATE", 1): (1.0, 5.0, 0.5, 0.5, 1.0), ("PLATE", 4): (2.0, 2.0, 3.0, 1.0, 2.0), ("FIN", 2): (0.0, 0.0, 6.0, 0.0, 0.0)}
MEANS = (2.5, 1.75, 2.0)
CASE = """HEADER OPERATION DATA
BUILD ALL
      CALL STEADY
{transient}
HEADER CONTROL DATA, GLOBAL
    abszro = -273.15
    sigma  = 5.670374419e-08
    timend  = 1500.
    dtimes  = 0.
    UID =    SI
HEADER NODE DATA, PLATE
      1,    20.,    50.
      4,    20.,    80.
HEADER NODE DATA, FIN
      2,    20.,    30.
HEADER NODE DATA, SPACE
      -1,   -270.,    0.
HEADER CONDUCTOR DATA, PLATE
      1,    PLATE.1,    PLATE.4,    0.4
      2,    PLATE.4,    FIN.2,    0.2
      -3,    PLATE.1,    SPACE.1,    0.01
      -4,    FIN.2,    SPACE.1,    0.02
INSERT C0A1.hra
INSERT C0A1.hrl
"""
CALL = """HEADER NODE DATA, C0A1
HEADER VARIABLES 0, C0A1
C  a call that SINDA interpolates with
F     CALL LOADQ_C0A1_1654263672
HEADER SUBROUTINE
F     RECURSIVE SUBROUTINE LOADQ_C0A1_1654263672
F     CALL LOAD_BINARY_SINGLET_ARRAYS('C0A1.hra_bin', DATA__TD)
F     CALL LOADQ('C0A1',1,2,
F    +    DATA__TD(1+3),
M    +    C0A1.A4)
F     END
"""
PLAIN_CALL = "HEADER VARIABLES 0, C0A1\n      CALL LOADQ('C0A1',1,2,A2,A3,A1,A5,A4)\n"


def _rows(key: int, numbers: tuple[float, ...], mark: str) -> str:
    words = [f"{each:.6e} " for each in numbers]
    lines = [",".join(words[k : k + 3]) for k in range(0, len(words), 3)]
    return f"{mark}     {key}= {lines[0]}\n" + "".join(f"{mark}       {line}\n" for line in lines[1:])


def _rates(mark: str, areas: str = "SPACE, 3", times: tuple[float, ...] = TIMES, lacking: int = 0, scale: str = "1.") -> str:
    """A file of heat rates: its arrays as comments, as newer versions write them, or as rows."""
    text = "HEADER ARRAY DATA, C0A1\nC     solar                        1354.000000 W/m^2\nC         0,    0.00,    1.8e-10\nPSTOP\n"
    text += "C Average values\n" + _rows(1, MEANS, mark)
    text += f"{mark}     2 = SPACE, 3\n{mark}    3 = {areas}\n    4 = {scale}\nC Time Array\n" + _rows(5, times, mark)
    if mark == "C":
        text += _rows(5, times, " ")
    for k, ((submodel, node), numbers) in enumerate(RATES.items()):
        text += f"C solar albedo planetshine - {submodel}.{node} Area = 0.0008\nC Errors:   3.1,  0.7\nC           3.1,  3.1\n"
        text += _rows(6 + k, numbers[: len(times)], mark) if 6 + k != lacking else ""
    return text + "PSTART\nHEADER CARRAY DATA, C0A1\n 2 =  FIN, 2\n 1 =  PLATE, 1, 4\n"


def _case(folder: Path, rates: str | None, call: str = CALL, transient: str = "      CALL TRANSIENT") -> Path:
    for name, text in (("C0A1.hra", rates), ("C0A1.hrl", call), ("case.inp", CASE.format(transient=transient))):
        if text is not None:
            (folder / name).write_text(text, encoding="latin-1")
    return folder / "case.inp"


def _heat(t: np.ndarray, numbers: tuple[float, ...]) -> np.ndarray:
    return np.interp(t % ORBIT, TIMES, numbers)


@pytest.mark.parametrize(("mark", "call"), [("C", CALL), (" ", PLAIN_CALL)])
def test_rates_follow_the_orbit_again_and_again(tmp_path: Path, mark: str, call: str) -> None:
    network = read_sinda(_case(tmp_path, _rates(mark), call))
    assert network.incomplete == ""
    run = td.simulate(network.model(), network.scenario(), every="5 [s]")
    heat = {node: run.load_powers[f"{owner}_c0a1_T{node}"] for owner, node in RATES}
    for (_, node), numbers in RATES.items():
        assert np.abs(np.asarray(heat[node]) - _heat(run.times, numbers)).max() < 1e-6


def test_the_run_begins_where_the_mean_rates_settle(tmp_path: Path) -> None:
    network = read_sinda(_case(tmp_path, _rates("C")))
    model, scenario = network.model(), network.scenario()
    run = td.simulate(model, scenario)
    settled = read_sinda(_case(tmp_path, _rates("C"), transient=""))
    calm = td.steady(settled.model(), settled.scenario())
    for path in ("PLATE.T1", "PLATE.T4", "FIN.T2"):
        held = td.steady(model, scenario, "mean")[path]
        assert run[path].kelvin[0] == pytest.approx(held, abs=1e-6)  # of the courses
        assert abs(calm[path] - held) > 0.01  # a steady deck takes the means of its own file
    left = 5.670374419e-8 * (0.01 * (calm["PLATE.T1"] ** 4 - 3.15**4) + 0.02 * (calm["FIN.T2"] ** 4 - 3.15**4))
    assert left == pytest.approx(sum(MEANS), rel=1e-9)


def test_times_that_do_not_begin_at_zero_are_held_beyond_their_ends(tmp_path: Path) -> None:
    later = (100.0, 200.0, 210.0, 400.0, 600.0)
    network = read_sinda(_case(tmp_path, _rates("C", times=later)))
    run = td.simulate(network.model(), network.scenario(), times=[0.0, 50.0, 150.0, 1400.0])
    assert run.load_powers["PLATE_c0a1_T1"] == pytest.approx([1.0, 1.0, 3.0, 1.0])


def test_fluxes_take_their_areas_and_the_scale(tmp_path: Path) -> None:
    network = read_sinda(_case(tmp_path, _rates(" ", areas="0.5, 2.0, 1.0", scale="3."), PLAIN_CALL, transient=""))
    powers = {load.name: load.power for load in network.loads}
    assert powers == pytest.approx({"PLATE_c0a1_T1": 2.5 * 1.5, "PLATE_c0a1_T4": 1.75 * 6.0, "FIN_c0a1_T2": 2.0 * 3.0})


def test_a_node_that_absorbs_nothing_has_no_array(tmp_path: Path) -> None:
    """The file numbers the arrays of the others without a gap; their comments name the nodes."""
    text = _rates("C").replace(_rows(1, MEANS, "C"), _rows(1, (0.0, *MEANS[1:]), "C"))
    begin = text.index("C solar albedo planetshine - PLATE.1")
    text = text[:begin] + text[text.index("C solar albedo planetshine - PLATE.4") :].replace("C     7=", "C     6=").replace(
        "C     8=", "C     7="
    )
    network = read_sinda(_case(tmp_path, text))
    assert network.incomplete == ""
    courses = {load.into: load.course for load in network.loads}
    assert courses.keys() == {("PLATE", "T4"), ("FIN", "T2")}
    for (owner, node), numbers in list(RATES.items())[1:]:
        course = courses[owner, f"T{node}"]
        assert course is not None
        assert course.numbers.tolist() == list(numbers)


def test_what_is_absent_is_counted_and_named(tmp_path: Path) -> None:
    lost = read_sinda(_case(tmp_path, None))
    (tmp_path / "C0A1.hra_bin").write_bytes(b"\0" * 80)
    assert lost.incomplete.startswith("2 ")
    assert "C0A1.hra" in str(lost)
    assert lost.loads == ()
    without = _rates("C", lacking=7).replace(_rows(1, MEANS, "C"), "")
    some = read_sinda(_case(tmp_path, without))
    assert some.incomplete.startswith("1 statement")
    assert "PLATE.T4" in str(some)
    assert [load.into for load in some.loads] == [("PLATE", "T1"), ("FIN", "T2")]


@pytest.mark.parametrize(
    ("old", "new"), [(" 1 =  PLATE, 1, 4", " 1 =  PLATE, 1, 4, 5"), ("4 = 1.", "4 = 1., 2."), (" 1 =  PLATE, 1, 4", " 1 =  1, 4, 7")]
)
def test_a_file_that_does_not_fit_is_refused(tmp_path: Path, old: str, new: str) -> None:
    with pytest.raises(DeckError, match=r"C0A1.hrl:4"):
        read_sinda(_case(tmp_path, _rates("C").replace(old, new)))


def _print(routine: str, time: float, numbers: dict[str, float]) -> str:
    text = ""
    for submodel in dict.fromkeys(name.split(".")[0] for name in numbers):
        cells = [f"   T {name.rpartition('T')[2]:>7}= {t:9.4f}" for name, t in numbers.items() if name.startswith(f"{submodel}.")]
        text += f"\n MODEL = SINDA          a case\n   {routine}\n\n\n  SUBMODEL NAME = {submodel}\n"
        text += f"         PROBLEM TIME                  TIMEN     =  {time:.1f}     VS. TIMEND=  1500.0\n{''.join(cells)}\n"
    return text


def _printed(network_path: Path, shift: float = 0.0) -> tuple[Path, Agreement]:
    network = read_sinda(network_path)
    model, scenario = network.model(), network.scenario()
    names = {f"{n.submodel}.{n.name}": n.path for n in network.nodes}
    calm = td.steady(model, scenario, "mean")
    text = _print("STEADY", 0.0, {name: 20.0 for name in names})
    text += _print("STEADY", 0.0, {name: calm[path] - 273.15 for name, path in names.items()})
    run = td.simulate(model, scenario, times=[300.0, 900.0, 1500.0])
    for k, t in enumerate((300.0, 900.0, 1500.0)):
        text += _print(
            "TRANSIENT", t, {n: run[p].kelvin[k] - 273.15 + (shift if (k, n) == (1, "FIN.T2") else 0.0) for n, p in names.items()}
        )
    out = network_path.with_suffix(".out")
    out.write_text(text, encoding="latin-1")
    return out, agreement(network, sinda_print(out))


def test_a_transient_print_is_judged_as_a_transient(tmp_path: Path) -> None:
    case = _case(tmp_path, _rates("C"))
    out, agreed = _printed(case)
    assert np.abs(agreed.off).max() < 2e-4
    assert np.isnan(agreed.times).tolist() == [True, False, False, False]
    assert {each.time_digit for each in sinda_print(out)} == {0.05}
    settled = [each for each in sinda_print(out) if each.settled]
    assert len(settled) == 2
    assert set(balance(read_sinda(case), settled[-1]).open()) == {"PLATE.T1", "PLATE.T4", "FIN.T2"}  # means of the courses, not of the file
    _, off = _printed(case, shift=0.5)
    assert off.rms == pytest.approx([0.0, 0.0, 0.25, 0.0], abs=1e-3)
    assert "FIN.T2 at 900 s" in str(off)
    assert off.absent == ()
    assert off.nodes == agreed.nodes
    out.write_text(re.sub("   T       4= .*", "", out.read_text(encoding="latin-1")), encoding="latin-1")
    assert agreement(read_sinda(case), sinda_print(out)).absent == ("PLATE.T4",)


def test_a_run_that_its_tool_broke_off_ends_at_its_last_print(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = _case(tmp_path, _rates("C"))
    out, _ = _printed(case)
    network = replace(read_sinda(case), duration=15_000.0)
    ends: list[float] = []

    def simulated(model: td.Model, scenario: td.Scenario, **options: object) -> object:
        ends.append(scenario.seconds)
        return td.simulate(model, scenario, **options)

    monkeypatch.setattr(results, "simulate", simulated)
    agreed = agreement(network, [each for each in sinda_print(out) if each.settled or each.time < 1000.0])
    assert ends == [900.0]
    assert np.abs(agreed.off).max() < 2e-4


def test_a_print_of_another_case_is_refused(tmp_path: Path) -> None:
    case = _case(tmp_path, _rates("C"))
    out, _ = _printed(case)
    out.write_text(out.read_text(encoding="latin-1").replace("NAME = ", "NAME = OTHER_"), encoding="latin-1")
    with raises_code("file.another-kind", DeckError):
        agreement(read_sinda(case), sinda_print(out))


TABLES = """HEADER CONTROL DATA, GLOBAL
    abszro = 0.
    UID =    SI
HEADER NODE DATA, ROD
      -1,    300.,    -1.0
      SIV 2,    250.,    TDPROPS.A1,    0.5
      DIV 3,    250.,    TDPROPS.A1,    0.5, A7, 2.
HEADER CONDUCTOR DATA, ROD
      SIV 1,    ROD.1,    ROD.2,    TDPROPS.A2,    0.003
      SIV 2,    2,    3,    A8
HEADER ARRAY DATA, ROD
      7 = 200., 10., 300., 20.
      8 = 200., 1., 300., 2.
HEADER ARRAY DATA, TDPROPS
      1 =
          200., 400.
          320., 640.
      2 =
          200., 100., 320., 160.
HEADER SOURCE DATA, ROD
      3, 5.
"""


def test_arrays_of_another_submodel_are_tables_over_temperature(tmp_path: Path) -> None:
    (tmp_path / "rod.inp").write_text(TABLES, encoding="latin-1")
    network = read_sinda(tmp_path / "rod.inp")
    settled = td.steady(network.model(), network.scenario())
    first = 0.003 * 0.25 * (settled["ROD.T2"] ** 2 - 300.0**2)  # k = T/2 at the mean of both ends
    assert first == pytest.approx(5.0, rel=1e-9)
    mean = 0.5 * (settled["ROD.T2"] + settled["ROD.T3"])
    assert (2.0 if mean > 300.0 else mean / 100.0 - 1.0) * (settled["ROD.T3"] - settled["ROD.T2"]) == pytest.approx(5.0, rel=1e-9)
    tables = {n.name: dict(n.capacitance) for n in network.nodes if not n.held and not isinstance(n.capacitance, str | float | None)}
    points = tables["T3"]["specific_heat"]["points"]
    assert [row[1] for row in points] == ["220.0 [J/(kg K)]", "340.0 [J/(kg K)]", "360.0 [J/(kg K)]"]


DAVIS = "Space-and-Satellite-Systems-UC-Davis/Structure-Thermal-Desktop"
TUTORIAL = f"{DAVIS}/Reference Files and Tutorials/CRTech Tutorials/2. ModelBrowser_63/case1.cc"
SHA = {
    f"{DAVIS}/OLD_Working CubseSAT Model/C1A0.hra": "78d474592827fe2319aabcf3d2183c33d733681c38de2a07ab590a2b9b5cd940",
    f"{DAVIS}/Reference Files and Tutorials/Workshops/Selene/C0A0.hra": "6a5a664a27721ffbc0316a4f304d534107b67dba00f75c8f042aa1e688fc8df0",
    TUTORIAL: "d624cb58e5cac7e3110c29fa978b10723512970796d890e6bf5d127324d7e185",
}


def _public(name: str) -> Path:
    return public_file(name, SHA[name])


def test_rates_of_three_files_of_which_each_leaves_nodes_out() -> None:
    folder = _public(f"{DAVIS}/Reference Files and Tutorials/Workshops/Selene/C0A0.hra").parent
    agreed = agreement(read_sinda(folder / "case0.inp"), sinda_print(folder / "case0.out"))
    assert len(agreed.nodes) == 150
    assert np.sqrt(np.mean(agreed.off**2)) < 0.01


def test_two_orbits_against_the_tools_own_print() -> None:
    folder = _public(f"{DAVIS}/OLD_Working CubseSAT Model/C1A0.hra").parent
    agreed = agreement(read_sinda(folder / "case1.inp"), sinda_print(folder / "case1.out"))
    steady = np.isnan(agreed.times)
    assert np.abs(agreed.off[steady]).max() < 1e-4
    # SINDA takes the heat of the middle of its step, up to 100 s long, also over the edge of the shadow: 24 s of sun are 1 K of a panel
    off = np.abs(agreed.off[~steady])
    assert np.median(off) < 0.1
    assert np.quantile(off, 0.95) < 0.5
    assert off.max() < 1.1


def test_the_tutorials_tables_against_the_tools_own_print() -> None:
    folder = _public(TUTORIAL).parent
    for case in ("case0", "case1"):
        agreed = agreement(read_sinda(folder / f"{case}.inp"), sinda_print(folder / f"{case}.out"))
        assert np.abs(agreed.off).max() < 0.0055  # the print has two digits


def _rows_of(folder: Path, case: str) -> tuple[int, int]:
    """Return the rows of nodes and of conductors of a case and of the files that it inserts, counted by a reader of this test's own."""
    inserted = re.findall(r"(?im)^\s*INSERT\s+(\S+)", (folder / f"{case}.inp").read_text("latin-1"))
    files = [folder / f"{case}.inp", *(folder / re.sub(r"\.k_in$", ".k", name) for name in inserted)]
    block, rows = "", {"NODE DATA": 0, "CONDUCTOR DATA": 0}
    for file in files:
        for line in file.read_text("latin-1").splitlines() if file.is_file() else []:
            if header := re.match(r"HEADER (\w+ \w+)", line):
                block = header[1]
            elif block in rows and re.match(r"\s*-?\d+\s*,", line.split("$")[0]):
                rows[block] += 1
    return rows["NODE DATA"], rows["CONDUCTOR DATA"]


RYAN, MODEL_OF_2024 = f"{DAVIS}/Reference Files and Tutorials/Workshops/Ryan", f"{DAVIS}/Working CubeSat Model"
SHA |= {
    f"{RYAN}/case0.cc": "6d566b1ed8494dcf57edc59faea33a3d6ec3137b755b12645fd717d0c480d4d2",
    f"{MODEL_OF_2024}/case5.cc": "df454f8620afa32ec4873551b76df5751914f231eba1fb6b365adc67b8e57c2f",
    f"{MODEL_OF_2024}/case8.cc": "ce4da22d2eb6fdf88208e877d94735eba93fe6769c6bfbb5866f451a2a646306",
}


@pytest.mark.parametrize(("deck", "median", "most"), [(f"{RYAN}/case0", 0.005, 0.013), (f"{MODEL_OF_2024}/case8", 0.013, 0.27)])
def test_decks_that_the_readers_authors_had_not_seen(deck: str, median: float, most: float) -> None:
    """Read by code that was there before they were: nothing dropped, and their steady states and orbits as SINDA prints them."""
    file = _public(f"{deck}.cc")
    network = read_sinda(file.with_suffix(".inp"))
    assert (len(network.nodes), len(network.conductors)) == _rows_of(file.parent, file.stem)
    assert network.incomplete == ""
    agreed = agreement(network, sinda_print(file.with_suffix(".out")))
    steady, off = np.isnan(agreed.times), np.abs(agreed.off)
    assert np.all(off[steady] < 1e-3)
    assert np.median(off[~steady]) < median
    assert np.quantile(off[~steady], 0.95) < most  # the heat of the middle of SINDA's step over the edge of the shadow, as above


def test_every_row_of_a_deck_of_seven_orbits_is_read() -> None:
    file = _public(f"{MODEL_OF_2024}/case5.cc")
    network = read_sinda(file.with_suffix(".inp"))
    assert (len(network.nodes), len(network.conductors)) == _rows_of(file.parent, file.stem) == (153, 8402)
    assert network.incomplete == ""
