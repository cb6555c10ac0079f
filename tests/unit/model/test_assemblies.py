"""Elements of several nodes: two-resistor packages, Foster and Cauer ladders, thermoelectric coolers; joints of screws and spreading."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import j0, j1, jn_zeros

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError, code_of
from thermid.model._deck.assemblies import cauer_of_foster
from thermid.model._deck.modelfile import save_model
from thermid.physics.conduction import spreading_resistance

ROOM = td.Scenario("room", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="20 [s]")


def deck(**more: Any) -> td.Model:
    board = {"kind": "conduction", "between": ["board", "air"], "conductance": "0.2 [W/K]"}
    base = {"title": "x", "needs": ["air"], "nodes": {"board": {"capacitance": "20 [J/K]"}}, "conductors": {"out": board}}
    return td.model_from_dict(base | more)


# packages ----------------------------------------------------------------------------------------------------------------------------

TOP = {"to": "air", "area": "2 [cm^2]", "htc": "10 [W/(m^2 K)]", "emissivity": 0}
U1: dict[str, Any] = {"board": "board", "theta_JB": "12 [K/W]", "theta_JC": "4 [K/W]", "power": "1.5 [W]", "top": TOP}


def package(**change: Any) -> td.Model:
    return deck(packages={"u1": {k: v for k, v in (U1 | change).items() if v is not None}})


def test_a_package_is_its_two_resistances_by_hand() -> None:
    up, down = 1 / (4 + 1 / (10 * 2e-4)), 1 / (12 + 5)
    settled = td.steady(package(), ROOM)
    rise = 1.5 / (up + down)
    assert settled["u1.junction"] - 293.15 == pytest.approx(rise, rel=1e-9)
    assert settled["board"] - 293.15 == pytest.approx(rise * down * 5, rel=1e-9)
    assert settled["u1.case"] - 293.15 == pytest.approx(rise * (1 - 4 * up), rel=1e-9)
    assert td.simulate(package(), ROOM).heat_balance().relative < 1e-9


def test_a_package_under_a_lid() -> None:
    model = package(lid="air", top={"resistance": "3 [K/W]"})
    assert td.steady(model, ROOM)["u1.junction"] - 293.15 == pytest.approx(1.5 / (1 / 7 + 1 / 17), rel=1e-9)


def test_psi_is_a_reading_and_no_resistance() -> None:
    for change, data in (
        ({"theta_JC": None, "psi_JT": "0.5 [K/W]"}, "psi_JT is not"),
        ({"theta_JB": None, "psi_JB": "6 [K/W]"}, "psi_JB is not"),
    ):
        with pytest.raises(DeckError) as caught:
            package(**change)
        assert code_of(str(caught.value)) == "value.contradicts"
        assert data in str(caught.value)
        assert "packages.u1.psi" in str(caught.value)
    beside = package(psi_JT="0.5 [K/W]")
    assert td.steady(beside, ROOM)["u1.junction"] == td.steady(package(), ROOM)["u1.junction"]
    assert not [f for f in beside.check() if f.code == "model.unused"]


@pytest.mark.parametrize(
    ("change", "code", "match"),
    [
        ({"top": None}, "value.incomplete", "theta_JC"),
        ({"theta_JC": None}, "value.incomplete", "theta_JC"),
        ({"theta_JC": None, "theta_JB": None, "top": None}, "value.incomplete", "theta_JB, theta_JC"),
        ({"lid": "air", "top": None}, "value.incomplete", r"packages\.u1\.lid: .* top = \{ resistance = "),
        ({"theta_JB": "12 [W/K]"}, "unit.wrong-dimension", r"^x, .*\[K/W\]"),
        ({"theta_JB": "12 [K/W"}, "expression.unit-misplaced", r"packages\.u1\.theta_JB"),
        ({"board": "bord"}, "name.unknown", "'bord'.* 'board'"),
        ({"theta_jb": "12 [K/W]"}, "file.unknown-key", "'theta_jb' .*'theta_JB'"),
        ({"top": TOP | {"aria": "1 [cm^2]"}}, "file.unknown-key", "'aria' .*'area'"),
    ],
)
def test_what_a_package_cannot_be(change: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        td.steady(package(**change), ROOM)


def test_the_worst_case_of_two_resistors_is_two_deviations() -> None:
    """Both at 30 % raise the junction over the same board and case by 30 %."""
    model = package()
    nominal = td.steady(model, ROOM)
    worst = td.steady(model.with_values({"u1.deviation_JC": 0.3, "u1.deviation_JB": 0.3}), ROOM)
    over = [(s["u1.junction"] - s["board"]) / ((s["board"] - 293.15) / 5) for s in (nominal, worst)]
    assert over[1] / over[0] == pytest.approx(1.3, rel=1e-9)
    given = model.at("u1.deviation_JC")
    assert (given.minimum, given.maximum, given.source) == (-0.3, 0.3, "published")
    with raises_code("value.outside-range", DeckError, match=r"0\.3"):
        td.steady(model.with_values({"u1.deviation_JC": 0.4}), ROOM)


def test_instances_of_one_package_share_its_values_and_not_their_power() -> None:
    twins = deck(packages={"u1": U1 | {"package": "QFN48"}, "u2": U1 | {"package": "QFN48", "power": "0.5 [W]"}, "u3": U1})
    known = td.model.identities(twins)
    assert known["u1.deviation_JC"].paths == ("u1.deviation_JC", "u2.deviation_JC")
    assert known["u1.theta_JB"].paths == ("u1.theta_JB", "u2.theta_JB")
    assert known["u1.heat.power"].paths == ("u1.heat.power",)
    assert known["u3.deviation_JC"].paths == ("u3.deviation_JC",)


def test_values_of_a_package_take_names_of_the_deck() -> None:
    named = deck(
        parameters={"r": "4 [K/W]", "a": "2 [cm^2]"},
        packages={"u1": U1 | {"theta_JC": "r", "top": TOP | {"area": "a"}, "power": "3*0.5 [W]", "theta_JB": "3*r"}},
    )
    assert td.steady(named, ROOM)["u1.junction"] == pytest.approx(td.steady(package(), ROOM)["u1.junction"], abs=1e-9)
    assert not [f for f in named.check() if f.code == "model.value-overridden"]


def test_derivatives_of_a_package_are_those_of_differences() -> None:
    model = package(capacitance="0.5 [J/K]", case_capacitance="0.2 [J/K]")
    free = ("u1.theta_JC", "u1.theta_JB", "u1.deviation_JC", "u1.capacitance", "u1.heat.power")
    ready = td.prepare(model, ROOM, free, every=1.0, options=td.Options(error=8e-9))
    run = ready.run(sensitivities=True)
    for name in free:
        step = 1e-4 * max(ready.nominal[name], 0.1)
        high, low = (ready.run({name: ready.nominal[name] + s * step}) for s in (1.0, -1.0))
        quotient = (high["u1.junction"].kelvin - low["u1.junction"].kelvin) / (2 * step)
        assert run.sensitivity("u1.junction", name) == pytest.approx(quotient, abs=2e-4 * np.abs(quotient).max()), name


def test_assemblies_are_saved_and_read_again(tmp_path: Path) -> None:
    model = deck(packages={"u1": U1}, ladders={"q": LADDER}, coolers={"tec": TEC})
    save_model(model, tmp_path / "x.toml")
    assert td.load_model(tmp_path / "x.toml") == model


# ladders -----------------------------------------------------------------------------------------------------------------------------

FOSTER = [(0.05, 1e-3), (0.3, 2e-2), (0.9, 0.4), (0.25, 3.0)]
"""Resistance [K/W] and time [s] of a power transistor; synthetic."""
LADDER: dict[str, Any] = {"to": "air", "foster": [[f"{r} [K/W]", f"{t} [s]"] for r, t in FOSTER], "power": "4 [W]"}


def test_a_foster_ladder_keeps_its_step_response() -> None:
    times = np.array([0.0, 0.5e-3, 5e-3, 0.05, 0.5, 2.0, 20.0])
    run = td.simulate(deck(ladders={"q": LADDER}), ROOM, times=times, options=td.Options(error=8e-9))
    rise = 4 * sum(r * (1 - np.exp(-times / t)) for r, t in FOSTER)
    assert run["q.junction"].kelvin - 293.15 == pytest.approx(rise, abs=1e-6)
    assert run.heat_balance().relative < 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_random_foster_ladders_as_cauer(seed: int) -> None:
    """Impedances at random frequencies, from both forms."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 9))
    rungs = [(float(r), float(t / r)) for r, t in zip(rng.uniform(0.01, 2, count), 10.0 ** rng.uniform(-5, 2, count), strict=True)]
    ladder = cauer_of_foster(rungs)
    for s in 1j * 10.0 ** rng.uniform(-3, 6, 20):
        z = 0j
        for r, c in reversed(ladder):
            z = 1 / (s * c + 1 / (r + z))
        assert z == pytest.approx(sum(r / (1 + s * r * c) for r, c in rungs), rel=1e-9)
    assert sum(r for r, _ in ladder) == pytest.approx(sum(r for r, _ in rungs), rel=1e-12)


def test_equal_times_are_one_rung_and_a_cauer_ladder_is_as_written() -> None:
    assert cauer_of_foster([(1.0, 2.0), (2.0, 1.0)]) == [(3.0, pytest.approx(2 / 3))]
    model = deck(ladders={"q": {"to": "board", "cauer": [["0.5 [K/W]", "0.1 [J/K]"], ["1 [K/W]", "2 [J/K]"]], "power": "2 [W]"}})
    settled = td.steady(model, ROOM)
    assert settled["q.junction"] - settled["q.n2"] == pytest.approx(1.0)
    assert settled["q.junction"] - settled["board"] == pytest.approx(3.0)


def test_a_ladder_from_a_file(decks: Callable[..., td.Model], tmp_path: Path) -> None:
    lines = "\n".join(f"{r}, {t * 1e3}" for r, t in FOSTER)
    (tmp_path / "zth.csv").write_text("# synthetic\nR [K/W], tau [ms]\n" + lines, encoding="utf-8")
    main = 'title = "x"\nneeds = ["air"]\n[ladders]\nq = { to = "air", foster = "zth.csv", power = "4 [W]" }\n'
    assert td.steady(decks(main=main), ROOM)["q.junction"] - 293.15 == pytest.approx(4 * 1.5)
    (tmp_path / "zth.csv").write_text("R [K/W], C [J/K], tau [ms]\n1,2,3", encoding="utf-8")
    with raises_code("value.wrong-kind", DeckError, match=r"zth\.csv:2"):
        decks(main=main)


@pytest.mark.parametrize(
    ("change", "code", "match"),
    [
        ({"cauer": [["1 [K/W]", "1 [J/K]"]]}, "value.incomplete", r"ladders\.q.*\[resistance, capacitance\].*\[resistance, time\]"),
        ({"foster": None}, "value.incomplete", r"ladders\.q.*\[resistance, capacitance\].*\[resistance, time\]"),
        ({"foster": [["1 [K/W]", "0 [s]"]]}, "value.outside-range", "'tau'.*0"),
        ({"foster": None, "cauer": [["1 [K/W]", "1 [s]"]]}, "unit.wrong-dimension", r"ladders\.q\.cauer"),
        ({"foster": "zth.csv"}, "value.wrong-kind", r"ladders\.q\.foster"),
    ],
)
def test_what_a_ladder_cannot_be(change: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        deck(ladders={"q": {k: v for k, v in (LADDER | change).items() if v is not None}})


# coolers -----------------------------------------------------------------------------------------------------------------------------

TEC: dict[str, Any] = {"cold": "board", "hot": "air", "V_max": "14.4 [V]", "I_max": "6.4 [A]", "dT_max": "66 [K]", "T_hot": "25 [degC]"} | {
    "current": "2 [A]"
}


def cooled(**change: Any) -> tuple[td.Model, td.Scenario]:
    """A cold plate with a heater, a cooler, and a heat sink that carries its heat away."""
    sink = {"kind": "conduction", "between": ["sink", "air"], "conductance": "4 [W/K]"}
    base = {"title": "x", "needs": ["air"], "conductors": {"fins": sink}, "coolers": {"tec": TEC | {"hot": "sink"} | change}}
    base |= {"nodes": {"board": {"capacitance": "20 [J/K]"}, "sink": {"capacitance": "200 [J/K]"}}}
    return td.model_from_dict(base | {"loads": {"heat": {"into": "board", "power": "3 [W]"}}}), ROOM


def constants(v: float = 14.4, i: float = 6.4, d: float = 66.0, t: float = 298.15) -> tuple[float, float, float]:
    return v / t, v * (t - d) / (i * t), v * i * (t - d) / (2 * t * d)


@pytest.mark.parametrize("named", [False, True])
def test_a_value_of_a_sheet_has_bounds_for_a_fit(named: bool) -> None:
    """It took a number alone, so that a fit of I_max went below zero."""
    sheet = {"value": "6.4 [A]", "min": "4 [A]", "max": "9 [A]"}
    base = {"title": "x", "needs": ["air"], "coolers": {"tec": TEC | {"hot": "board", "cold": "air", "I_max": "i_max" if named else sheet}}}
    base |= {"nodes": {"board": {"capacitance": "20 [J/K]"}}} | ({"parameters": {"i_max": sheet}} if named else {})
    model = td.model_from_dict(base)
    assert (model.at("i_max" if named else "tec.I_max").minimum, model.at("tec.T_hot").text) == (4.0, "25 [degC]")
    assert str(model.at("tec.V_max")) == "14.4 [V] (datasheet)"
    plain = td.model_from_dict(base | {"coolers": {"tec": TEC | {"hot": "board", "cold": "air", "I_max": "5 [A]"}}})
    path = "i_max" if named else "tec.I_max"
    assert td.steady(model.with_values({path: "5 [A]"}), ROOM)["board"] == pytest.approx(td.steady(plain, ROOM)["board"])


@pytest.mark.parametrize("amps", [0.5, 2.0, 4.0])
def test_a_cooler_meets_its_equations(amps: float) -> None:
    model, scenario = cooled(current=f"{amps} [A]")
    found = td.steady(model, scenario)
    cold, hot = found["board"], found["sink"]
    s, r, k = constants()
    assert s * amps * cold - 0.5 * amps**2 * r - k * (hot - cold) == pytest.approx(3.0, rel=1e-7)
    assert s * amps * hot + 0.5 * amps**2 * r - k * (hot - cold) == pytest.approx(4.0 * (hot - 293.15), rel=1e-7)


def test_at_dt_max_a_cooler_pumps_nothing_and_at_no_difference_its_q_max() -> None:
    """The three values of a data sheet, from its constants."""
    s, r, k = constants()
    cold = 298.15 - 66.0
    assert s * 6.4 * cold - 0.5 * 6.4**2 * r - k * 66.0 == pytest.approx(0.0, abs=1e-9)
    assert s * 66.0 + 6.4 * r == pytest.approx(14.4)
    assert s * 6.4 * 298.15 - 0.5 * 6.4**2 * r == pytest.approx(14.4 * 6.4 * (298.15 + 66.0) / (2 * 298.15))


def test_the_electrical_power_closes_the_balance() -> None:
    model, scenario = cooled()
    long = scenario.with_(duration="1 [h]")
    run = td.simulate(model, long)
    s, r, _ = constants()
    found = td.steady(model, long)
    electrical = s * 2.0 * (found["sink"] - found["board"]) + 4.0 * r
    assert run.heat_balance().relative < 1e-9
    assert 4.0 * (found["sink"] - 293.15) == pytest.approx(3.0 + electrical, rel=1e-9)
    loads = [n for n in run.load_powers if n.startswith("tec.")]
    assert sum(float(run.load_powers[n][-1]) for n in loads) == pytest.approx(electrical, rel=1e-3)


def test_the_other_column_of_a_data_sheet_lies_in_the_range() -> None:
    """TEC1-12706 (Hebei, from memory): at 25 degC 14.4 V, 6.4 A, 66 K, 50 W; of these alone its figures at 50 degC, 75 K and 57 W."""
    nodes = {"cold": {"capacitance": "10 [J/K]"}}
    tec = TEC | {"cold": "cold", "hot": "hot", "Q_max": "50 [W]", "current": "6.4 [A]"}
    loads = {"heat": {"into": "cold", "power": "0 [W]"}}
    model = td.model_from_dict({"title": "x", "needs": ["hot"], "nodes": nodes, "coolers": {"tec": tec}, "loads": loads})
    hot = td.Scenario("hot", boundaries={"hot": "50 [degC]"})
    size = model.at("tec.size")
    seebeck = model.value("tec.seebeck")
    assert float(seebeck) == pytest.approx(14.4 / 298.15, rel=0.02)
    assert repr(seebeck).endswith("[V/K]")
    assert (str(model.value("tec.V_max")), repr(model.at("tec.V_max")).count("14.4 [V]")) == ("14.4 [V]", 1)
    with pytest.raises(NameNotFoundError, match="V_mx"):
        model.value("tec.V_mx")
    assert 323.15 - td.steady(model, hot)["cold"] == pytest.approx(75.0, rel=0.03)
    most = []
    for share in (size.minimum, size.maximum):  # the heat at which nothing is cooled
        at = model.with_values({"tec.size": share})
        low, high = 20.0, 90.0
        for _ in range(40):
            middle = 0.5 * (low + high)
            cooler = td.steady(at.with_values({"heat.power": f"{middle} [W]"}), hot)["cold"] < 323.15
            low, high = (middle, high) if cooler else (low, middle)
        most.append(low)
    assert most[0] < 57.0 < most[1]
    assert most[0] == pytest.approx(57.0, rel=0.03)


def test_q_max_is_the_range_of_the_size() -> None:
    expected = 14.4 * 6.4 * (298.15 + 66.0) / (2 * 298.15)
    model, _ = cooled(Q_max="50 [W]")
    size = model.at("tec.size")
    assert (size.minimum, size.maximum) == (pytest.approx(50.0 / expected), 1.0)
    assert "Q_max 50 [W]" in size.basis
    with raises_code("value.contradicts", DeckError, match=r"tec\.Q_max.*Q_max.*56"):
        cooled(Q_max="5 [W]")
    with raises_code("value.outside-range", DeckError, match="dT_max.*T_hot"):
        cooled(dT_max="400 [K]")


def test_a_current_follows_a_schedule_and_its_derivative_is_that_of_differences() -> None:
    model, scenario = cooled()
    stepped = scenario.with_(
        duration="10 [min]", schedule={"tec.current": {"times": ["0 [s]", "300 [s]"], "values": ["0 [A]", "3 [A]"], "hold": True}}
    )
    run = td.simulate(model, stepped)
    assert run["board"].at(299.0) > 20.5
    assert run["board"].final < run["board"].at(299.0) - 5.0
    ready = td.prepare(model, scenario, ("tec.current",), options=td.Options(error=8e-9))
    slope = ready.run(sensitivities=True).sensitivity("board", "tec.current")
    high, low = (ready.run({"tec.current": 2.0 + s})["board"].kelvin for s in (1e-3, -1e-3))
    assert slope == pytest.approx((high - low) / 2e-3, abs=1e-4 * np.abs(slope).max())


# joints and spreading ----------------------------------------------------------------------------------------------------------------


def joint(kind: str, **fields: Any) -> td.Model:
    return deck(conductors={"c": {"kind": kind, "between": ["board", "air"]} | fields}, loads={"q": {"into": "board", "power": "5 [W]"}})


SCREWS: dict[str, Any] = {"count": 4, "torque": "1.2 [N m]", "diameter": "4 [mm]", "washer": "8 [mm]", "thickness": "2 [mm]"} | {
    "conductivity": "150 [W/(m K)]",
    "hardness": "1.1 [GPa]",
    "roughness": "2 [um]",
    "slope": 0.1,
}


def test_screws_by_their_torque() -> None:
    """Preload T / (0.2 d), pressed over the cone of 30 degrees below the washer."""
    outer = 4e-3 + 2e-3 * math.tan(math.pi / 6)
    zone = math.pi * (outer**2 - 2e-3**2)
    pressure = 1.2 / (0.2 * 4e-3) / zone
    each = zone * 1.25 * 150 * 0.1 / 2e-6 * (pressure / 1.1e9) ** 0.95
    rise = td.steady(joint("bolted", **SCREWS), ROOM)["board"] - 293.15
    assert rise == pytest.approx(5 / (4 * each), rel=1e-7)
    filled = joint("bolted", **SCREWS, area="30 [cm^2]", filler_conductivity="3 [W/(m K)]", filler_thickness="0.5 [mm]")
    both = 4 * each + 3 * (30e-4 - 4 * zone) / 0.5e-3
    assert td.steady(filled, ROOM)["board"] - 293.15 == pytest.approx(5 / both, rel=1e-7)
    tighter = joint("bolted", **SCREWS | {"torque": "2.4 [N m]"})
    assert td.steady(tighter, ROOM)["board"] - 293.15 == pytest.approx(rise / 2**0.95, rel=1e-7)


@pytest.mark.parametrize(
    ("fields", "code", "match"),
    [
        (SCREWS | {"washer": "1 [mm]", "thickness": "0.1 [mm]"}, "value.outside-range", r"conductors\.c"),
        (
            SCREWS | {"area": "1 [cm^2]", "filler_conductivity": "3 [W/(m K)]", "filler_thickness": "1 [mm]"},
            "value.contradicts",
            r"conductors\.c",
        ),
        (SCREWS | {"filler_conductivity": "3 [W/(m K)]"}, "value.incomplete", r"conductors\.c.*filler_conductivity.*filler_thickness"),
    ],
)
def test_joints_of_screws_that_cannot_be(fields: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, DeckError, match=match):
        td.steady(joint("bolted", **fields), ROOM)


def test_a_wedge_lock_loses_its_gas() -> None:
    model = joint("wedge_lock", count=2, length="10 [cm]", resistance_length="0.005 [m K/W]", vacuum_resistance_length="0.01 [m K/W]")
    air, none = (td.steady(model, s)["board"] - 293.15 for s in (ROOM, ROOM.vacuum()))
    assert (air, none) == (pytest.approx(5 / 40), pytest.approx(5 / 20))
    with raises_code("value.contradicts", DeckError):
        td.steady(
            joint("wedge_lock", count=2, length="10 [cm]", resistance_length="0.02 [m K/W]", vacuum_resistance_length="0.01 [m K/W]"), ROOM
        )


def series(k: float, source: float, plate: float, thickness: float, htc: float | None) -> float:
    """Mean spreading resistance of a disc on a round plate, by its Bessel series (Kennedy 1960; Yovanovich 2005, Eq. 56)."""
    roots = jn_zeros(1, 3000)
    a, b = math.sqrt(source / math.pi), math.sqrt(plate / math.pi)
    through = np.tanh(roots * thickness / b)
    if htc is not None:
        back = roots * k / (htc * b)
        through = (through + back) / (1 + back * through)
    return float(4 / (math.pi * k * b * (a / b) ** 2) * np.sum(j1(roots * a / b) ** 2 * through / (roots**3 * j0(roots) ** 2)))


@pytest.mark.parametrize("ratio", [0.1, 0.25, 0.5])
@pytest.mark.parametrize("depth", [0.1, 0.3, 1.0])
@pytest.mark.parametrize("biot", [0.01, 1.0, 10.0, None])
def test_spreading_is_within_ten_per_cent_of_the_series(ratio: float, depth: float, biot: float | None) -> None:
    b, k = 0.03, 100.0
    plate = math.pi * b * b
    htc = None if biot is None else biot * k / b
    found = spreading_resistance(k, ratio**2 * plate, plate, depth * b, htc)
    assert found == pytest.approx(series(k, ratio**2 * plate, plate, depth * b, htc), rel=0.1)


def test_spreading_outside_its_range_is_said() -> None:
    fields = {"conductivity": "100 [W/(m K)]", "source_area": "1 [cm^2]", "plate_area": "20 [cm^2]", "thickness": "4 [mm]"}
    assert not [f for f in joint("spreading", **fields).check() if f.code == "physics.outside-range"]
    assert [f for f in joint("spreading", **fields | {"thickness": "1 [mm]"}).check() if f.code == "physics.outside-range"]
    assert [f for f in joint("spreading", **fields | {"source_area": "6 [cm^2]"}).check() if f.code == "physics.outside-range"]
    with raises_code("value.outside-range", DeckError):
        td.steady(joint("spreading", **fields | {"source_area": "20 [cm^2]"}), ROOM)


@pytest.mark.parametrize(
    ("kind", "fields", "free"),
    [
        ("bolted", SCREWS, ("c.torque", "c.washer", "c.roughness")),
        ("wedge_lock", {"count": 2, "length": "10 [cm]", "resistance_length": "0.3 [m K/W]"}, ("c.resistance_length",)),
        (
            "spreading",
            {"conductivity": "0.5 [W/(m K)]", "source_area": "1 [cm^2]", "plate_area": "20 [cm^2]", "thickness": "4 [mm]"}
            | {"htc": "50 [W/(m^2 K)]"},
            ("c.conductivity", "c.source_area", "c.thickness", "c.htc"),
        ),
    ],
)
def test_derivatives_of_joints_are_those_of_differences(kind: str, fields: dict[str, Any], free: tuple[str, ...]) -> None:
    ready = td.prepare(joint(kind, **fields), ROOM, free, every=1.0, options=td.Options(error=8e-9))
    run = ready.run(sensitivities=True)
    for name in free:
        step = 1e-4 * ready.nominal[name]
        high, low = (ready.run({name: ready.nominal[name] + s * step})["board"].kelvin for s in (1.0, -1.0))
        quotient = (high - low) / (2 * step)
        assert run.sensitivity("board", name) == pytest.approx(quotient, abs=3e-4 * np.abs(quotient).max()), name
