"""Which mistake would explain a bad fit, and courses of powers that no log gives; a good fit and a wrong model are not blamed on one."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.fit.calibration import LocalSpec, Request
from thermid.inference._explain.mistakes import Mistakes, _shifted, _units, find_mistakes
from thermid.model.tree import TableSignal

pytestmark = pytest.mark.usefixtures("values_alone")

PAIR = td.model_from_dict(
    {
        "title": "Pair",
        "needs": ["room"],
        "nodes": {n: {"capacitance": {"value": "700 [J/K]", "min": 100, "max": 5000}} for n in ("amp", "psu")},
        "conductors": {
            f"{a}_{b}": {"kind": "conduction", "between": [a, b], "conductance": {"value": "0.4 [W/K]", "min": 0.01, "max": 20}}
            for a, b in (("amp", "room"), ("psu", "room"), ("amp", "psu"))
        },
        "loads": {"heat": {"into": "amp", "power": "8 [W]"}},
    }
)
PATHS = tuple(f"{n}.capacitance" for n in ("amp", "psu")) + tuple(f"{c}.conductance" for c in ("amp_room", "psu_room", "amp_psu"))
TIMES = np.linspace(0.0, 18000.0, 181)


def asked(factor: float = 1.0, exchanged: bool = False, extra: float = 0.0, free: tuple[str, ...] = PATHS) -> Request:
    """Return a fit of the pair to a log of one that differs a little; its power times a factor, its sensors exchanged, heat at the psu."""
    power = np.where(TIMES < 9000.0, 8.0, 2.0)
    model = PAIR.with_values({"amp.capacitance": "900 [J/K]", "amp_psu.conductance": "0.6 [W/K]"})
    late = {"into": "psu", "power": "1 [W]"}
    deck = td.model_from_dict({"title": "x", "nodes": {"psu": {"capacitance": "1 [J/K]"}}, "loads": {"late": late}})
    model = replace(model, loads={**model.loads, "late": deck.loads["late"]})
    loads = {"heat": TableSignal(TIMES, power, hold=True), "late": TableSignal(TIMES, extra * (TIMES > 6000.0), hold=True)}
    run = td.simulate(model, td.Scenario("bench", {"room": "22 [degC]"}, start="22 [degC]", loads=loads, duration="5 [h]"), times=TIMES)
    rng = np.random.default_rng(1)
    nodes = ("psu", "amp") if exchanged else ("amp", "psu")
    channels = {
        f"T{k}": td.Channel.from_array(
            f"T{k}", run[n].kelvin + 0.05 * rng.standard_normal(TIMES.size), unit="K", role="node", target=t, noise=0.05
        )
        for k, (n, t) in enumerate(zip(nodes, ("amp", "psu"), strict=True))
    }
    watts = td.Channel.from_array("P", factor * power, quantity="power", role="load", target="heat")
    scenario = td.Scenario("bench", {"room": "22 [degC]"}, start="22 [degC]")
    return Request(PAIR, (td.Record.from_arrays("bench", TIMES, channels | {"P": watts}),), free, {"*": scenario}, name="pair")


@pytest.mark.parametrize(
    ("request_", "kind", "words"),
    [
        (asked(exchanged=True), "exchanged", "'T0' and 'T1' "),
        (asked(1000.0), "unit", "'P' .*mW .* W "),
        pytest.param(asked(0.001), "unit", "'P' .*kW .* W ", marks=pytest.mark.campaign),
    ],
)
def test_the_mistake_is_named_with_evidence_and_remedy(request_: Request, kind: str, words: str) -> None:
    found = find_mistakes(request_)
    assert found.first is not None
    assert (found.first.kind, found.bad) == (kind, True)
    (line, *_) = found.lines()
    assert re.match(f"likely mistake: {words}", line)
    assert line.endswith(found.first.remedy)
    assert found.to_dict()["named"][0]["kind"] == kind


@pytest.mark.parametrize(("on", "off", "named"), [(90.0, 157.0, "clock"), (20.0, 41.0, "")])
def test_a_load_is_not_blamed_for_changes_that_a_log_does_not_show(on: float, off: float, named: str) -> None:
    """An on/off heater of 20 W, read each half minute: of 90 s a load of 17 W was named, of 20 s, which fall between readings, 70 W."""
    fine, hot = np.arange(0.0, 10800.0), np.zeros((10800, 2))
    power = 20.0 * (((fine - 300.0) % (on + off) < on) & (fine > 300.0) & (fine < 9000.0))
    for k in range(1, fine.size):
        across = 2.0 * (hot[k - 1, 0] - hot[k - 1, 1])
        hot[k] = hot[k - 1] + np.array([(power[k - 1] - across) / 150.0, (across - 0.5 * hot[k - 1, 1]) / 400.0])
    sizes = {
        "plate.capacitance": "120 [J/K]",
        "box.capacitance": "300 [J/K]",
        "joint.conductance": "1.5 [W/K]",
        "loss.conductance": "0.4 [W/K]",
    }
    links = {"joint": ["plate", "box"], "loss": ["box", "air"]}
    deck = td.model_from_dict(
        {
            "title": "box",
            "needs": ["air"],
            "nodes": {n: {"capacitance": sizes[f"{n}.capacitance"]} for n in ("plate", "box")},
            "conductors": {
                n: {"kind": "conduction", "between": pair, "conductance": sizes[f"{n}.conductance"]} for n, pair in links.items()
            },
            "loads": {"heat": {"into": "plate", "power": "20 [W]"}},
        }
    )
    read = 295.15 + hot[::30] + np.random.default_rng(1).normal(0.0, 0.03, (360, 2))
    channels = {
        n: td.Channel.from_array(n, read[:, k], unit="K", role="node", target=n, noise=0.03) for k, n in enumerate(("plate", "box"))
    }
    channels["P"] = td.Channel.from_array("P", power[::30], quantity="power", role="load", target="heat")
    bench = {"*": td.Scenario("bench", {"air": "22 [degC]"}, start="22 [degC]")}
    found = find_mistakes(Request(deck, (td.Record.from_arrays("bench", fine[::30], channels),), tuple(sizes), bench))
    assert found.bad
    assert [m.kind for m in found.named] == [named] * bool(named)
    assert bool(found.failed) is not bool(named)


@pytest.mark.parametrize(
    ("name", "declared", "column", "wanted"),
    [
        ("P", "mW", "P", [("W", 1e3), ("kW", 1e6)]),
        ("P", "kW", "P", [("W", 1e-3), ("mW", 1e-6)]),
        ("P", "W", "", [("mW", 1e-3), ("kW", 1e3)]),
        ("T0", "degC", "T0", [("degF", 5 / 9)]),
        ("T0", "K", "T0", [("degC", 1.0)]),
    ],
)
def test_a_unit_is_advised_from_the_one_that_was_declared(name: str, declared: str, column: str, wanted: list[tuple[str, float]]) -> None:
    """Not from the SI unit: of W in a column declared mW the advice was kW, and after that mW."""
    request = asked()
    (record,) = request.records
    channel = replace(record[name], unit=declared, column=column)
    channel = replace(channel, values=channel.values - 273.15) if declared == "K" else channel  # a room at 22 K
    tried = [h for h in _units(replace(request, records=(record.with_channels(channel),))) if h.name == name]
    moves = [np.ptp(h.request.records[0][name].values) / np.ptp(channel.values) for h in tried]
    units = [rf"'{name}' .*\b{re.escape(text)} .*\b{re.escape(declared)}$" for text, _ in wanted]
    assert all(re.match(unit, h.words(0.0)) for h, unit in zip(tried, units, strict=True))
    assert moves == pytest.approx([factor for _, factor in wanted])
    for hypothesis, (text, _) in zip(tried, wanted, strict=True):
        assert (f'unit = "{text}"' in hypothesis.remedy(0.0)) is bool(column)
        assert column or "'P'" in hypothesis.remedy(0.0), "the columns from which it is computed"


def test_a_power_keeps_its_last_valid_value_where_readings_are_masked_at_every_shift_of_its_clock() -> None:
    """A run holds it there; joined by a straight line it would be a power that no run has."""
    times = np.arange(0.0, 60.0, 10.0)
    power = td.Channel.from_array("P", np.array([0.0, 0.0, 7.0, 7.0, 100.0, 100.0]), unit="W", quantity="power", role="load")
    bad = np.array([False, False, True, True, False, False])
    record = td.Record.from_arrays("log", times, {"P": power.masked(bad, "bad")})
    request = replace(asked(), records=(record,))
    for shift, wanted in ((0.0, [0.0, 0.0, 0.0, 0.0, 100.0, 100.0]), (10.0, [0.0, 0.0, 0.0, 100.0, 100.0, 100.0])):
        assert _shifted(request, ["P"], shift).records[0]["P"].values.tolist() == wanted


def test_a_clock_that_is_off_is_named_with_what_to_add_to_the_offset_that_its_log_has() -> None:
    request = asked()
    (record,) = request.records
    late = replace(record.channels["P"], values=np.where(TIMES < 9600.0, 8.0, 2.0))
    found = find_mistakes(replace(request, records=(record.with_channels(late),))).first
    assert found is not None
    assert found.kind == "clock"
    change = re.search(r" (-\d\S*) s,", found.remedy)
    assert change is not None
    assert float(change[1]) == pytest.approx(-600.0, abs=90.0)


def test_an_unlogged_power_is_named_with_its_size_and_instant() -> None:
    found = find_mistakes(asked(extra=1.5)).first
    assert found is not None
    assert (found.kind, found.name) == ("load", "psu")
    watts, since = found.words.split(" had ")[1].split(" W ")[0], found.words.split(" from ")[1].split(" min ")[0]
    assert float(watts) == pytest.approx(1.5, rel=0.15)
    assert float(since) == pytest.approx(100.0, abs=4.0)
    assert found.rms[1] < 0.25 * found.rms[0]


def test_a_good_fit_is_not_looked_at_and_a_wrong_model_is_not_blamed() -> None:
    assert find_mistakes(asked()) == Mistakes("pair")
    small = asked(free=("amp.capacitance",))
    assert [m.kind for m in find_mistakes(small).named if m.kind in ("unit", "exchanged", "per cent", "node")] == []


@pytest.mark.parametrize(
    ("path", "value"),
    [("amp_room.conductance", "1.2 [W/K]"), pytest.param("amp.capacitance", "4000 [J/K]", marks=pytest.mark.campaign)],
)
def test_a_wrong_value_that_the_fit_holds_is_named_and_neither_log_nor_fan_is_blamed(path: str, value: str) -> None:
    """Heat that no log gives, a fan or another unit would explain it nearly as well."""
    request = replace(asked(free=tuple(p for p in PATHS if p != path)), model=PAIR.with_values({path: value}))
    found = find_mistakes(request)
    assert found.first is not None
    assert {(m.kind, m.name) for m in found.named} == {("deck's value", path)}
    assert value in found.first.words


def test_what_cannot_be_run_names_nothing_and_says_why() -> None:
    bad = replace(asked(), local={"nowhere": LocalSpec("20 [degC]")})
    found = find_mistakes(bad)
    assert found.named == ()
    assert "'nowhere'" in found.failed


GYRO = """
title = "gyro"
needs = ["air"]
[nodes]
case = { mass = { value = "0.6 [kg]", min = 0.1, max = 3 }, specific_heat = "900 [J/(kg K)]" }
[surfaces]
skin = { of = "case", to = "air", area = "0.0365 [m^2]", effective_htc = { value = "6 [W/(m^2 K)]", min = 1, max = 20 } }
[loads]
heat = { into = "case", power = "2.74 [W]" }
"""
CAMPAIGN = """
title = "gyro"
[records.bench]
file = "gyro.csv"
time = "time_s"
[records.bench.channels]
T = { node = "case", noise = "0.06 [K]", accuracy = "0.1 [K]" }
T_AIR = { boundary = "air" }
[[stages]]
name = "gyro"
model = "gyro.toml"
records = ["bench"]
scenario = { start = "air" }
free = ["case.mass", "skin.effective_htc"]
"""
COURSE = '[stages.courses.start_up]\ninto = "case"\n'
SHAPES = {"step": lambda t: (t < 900.0) * 1.0, "ramp": lambda t: np.clip(1.0 - t / 900.0, 0.0, None), "decay": lambda t: np.exp(-t / 900.0)}


def gyro(folder: Path, shape: str, course: str = "") -> Path:
    """Write a synthetic gyro that takes 1.6 W more at first, by 900 s, read to a sixteenth of a degree; return its campaign."""
    times = np.arange(0.0, 5 * 3600.0, 10.0)
    (folder / "thermid.toml").write_text("")
    (folder / "gyro.toml").write_text(GYRO)
    model = td.load_model(folder / "gyro.toml").with_values({"case.mass": "0.743 [kg]", "skin.effective_htc": "5 [W/(m^2 K)]"})
    power = TableSignal(times, 2.74 + 1.6 * SHAPES[shape](times), hold=shape == "step")
    scenario = td.Scenario("hidden", {"air": "24 [degC]"}, start="air", loads={"heat": power}, duration=float(times[-1]))
    run = td.simulate(model, scenario, times=times)
    seen = np.round((run["case"].celsius + 0.05 * np.random.default_rng(3).standard_normal(times.size)) * 16.0) / 16.0
    rows = "\n".join(f"{t:.0f},{v:.4f},24.0" for t, v in zip(times, seen, strict=True))
    (folder / "gyro.csv").write_text(f"# SYNTHETIC\ntime_s,T [degC],T_AIR [degC]\n{rows}\n")
    (folder / "campaign.toml").write_text(CAMPAIGN + course)
    return folder / "campaign.toml"


@pytest.mark.parametrize("shape", ["step", pytest.param("ramp", marks=pytest.mark.campaign), "decay"])
def test_a_stage_recovers_a_start_up_transient_and_the_mass(tmp_path: Path, shape: str) -> None:
    fit = td.run_stages(gyro(tmp_path, shape, COURSE))["gyro"]
    assert fit["case.mass"].value == pytest.approx(0.743, rel=0.02)
    assert fit["start_up.power"].value == pytest.approx(1.6, rel=0.06)
    (said,) = [w for w in fit.warnings if "'start_up'" in w.partition(":")[0]]
    assert f": {shape}, " in said
    assert 14.5 < float(said.split(f": {shape}, ")[1].split(" min")[0]) < 15.5
    assert fit.reduced_chi_square < 1.5


@pytest.mark.parametrize("shape", ["step", pytest.param("ramp", marks=pytest.mark.campaign), "decay"])
def test_criticism_proposes_the_start_up_transient_with_its_shape(tmp_path: Path, shape: str) -> None:
    """A step of 1.6 W was called a fall from 2.37 W over 22 min, and the mass was 1.25 kg for 0.743 kg."""
    found = td.inference.criticise(td.run_stages(gyro(tmp_path, shape))["gyro"]).suggested
    assert found is not None
    assert "'case'" in found.name
    assert float(found.found.split()[0]) == pytest.approx(1.6, rel=0.06)  # in watts: one that falls begins higher
    assert float(found.found.split()[-2]) == pytest.approx(15.0, rel=0.04)  # in minutes
    assert found.fit is not None
    assert found.fit.values["case.mass"].value == pytest.approx(0.743, rel=0.02)


def test_a_decaying_power_is_told_from_a_second_mass_by_no_single_sensor(tmp_path: Path) -> None:
    """Both add one exponential to the same reading, so the suggestion names the other one too."""
    fit = td.run_stages(gyro(tmp_path, "decay"))["gyro"]
    assert abs(fit["case.mass"].value / 0.743 - 1.0) > 0.05
    said = str(td.inference.criticise(fit)).splitlines()[-1]
    assert "Suggested: " in said
    assert "'case'" in said
    assert "'case'" in said


def test_a_course_may_not_have_the_name_of_a_load(tmp_path: Path) -> None:
    with raises_code("name.taken", match="'heat'"):
        td.run_stages(gyro(tmp_path, "step", COURSE.replace("start_up", "heat")))


def test_a_search_that_cannot_begin_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of the first run ended without a word, as if a search had found nothing."""
    from thermid.base.errors import SolverError
    from thermid.inference._explain import mistakes

    def broken(*_: object, **__: object) -> None:
        raise SolverError("the run of 'bench' did not reach its end.")

    monkeypatch.setattr(mistakes.RoughFit, "solve", broken)
    found = find_mistakes(asked())
    assert found.failed == "the run of 'bench' did not reach its end."
    (line,) = found.lines()
    assert line.endswith(f": {found.failed}")
    assert found.to_dict()["failed"] == found.failed


def test_degrees_fahrenheit_are_no_way_out_of_a_misfit() -> None:
    """Readings over 1.8 leave residuals over 1.8: of a log whose model misfits, with a room of its own, this is no evidence."""
    lacking = td.model_from_dict(
        {
            "title": "body",
            "needs": ["room"],
            "nodes": {"body": {"capacitance": "500 [J/K]"}},
            "conductors": {"skin": {"kind": "conduction", "between": ["body", "room"], "conductance": "0.4 [W/K]"}},
            "loads": {"heat": {"into": "body", "power": "8 [W]"}},
        }
    )
    power = np.where((TIMES > 1800.0) & (TIMES < 9000.0), 8.0, 0.5)
    loads = {"heat": TableSignal(TIMES, power, hold=True)}
    truth = PAIR.with_values({"amp.capacitance": "150 [J/K]", "psu_room.conductance": "0.05 [W/K]"})
    run = td.simulate(truth, td.Scenario("b", {"room": "22 [degC]"}, start="22 [degC]", loads=loads, duration="5 [h]"), times=TIMES)
    noise = 0.05 * np.random.default_rng(3).standard_normal(TIMES.size)
    channel = td.Channel.from_array("T", run["amp"].kelvin + noise, unit="K", role="node", target="body", noise=0.05)
    watts = td.Channel.from_array("P", power, quantity="power", role="load", target="heat")
    record = td.Record.from_arrays("bench", TIMES, {"T": channel, "P": watts})
    free, room = ("body.capacitance", "skin.conductance"), {"room": LocalSpec("T", 0.5)}
    found = find_mistakes(Request(lacking, (record,), free, {"*": td.Scenario("b")}, room, name="body"))
    assert found.bad
    assert found.named == ()


def test_a_large_network_says_that_no_mistake_is_looked_for() -> None:
    nodes = [f"n{k}" for k in range(31)]
    ties = {f"t{k}": {"kind": "conduction", "between": [a, b], "conductance": "5 [W/K]"} for k, (a, b) in enumerate(pairwise(nodes))}
    skin = {"skin": {"kind": "conduction", "between": ["n0", "room"], "conductance": "0.4 [W/K]"}}
    chain = td.model_from_dict(
        {
            "title": "chain",
            "needs": ["room"],
            "nodes": {n: {"capacitance": "20 [J/K]"} for n in nodes},
            "conductors": ties | skin,
            "loads": {"heat": {"into": "n0", "power": "8 [W]"}},
        }
    )
    wrong = asked(1000.0)
    record = wrong.records[0]
    record = record.with_channels(replace(record.channels["T0"], target="n0"), replace(record.channels["T1"], target="n30"))
    found = find_mistakes(replace(wrong, model=chain, records=(record,), free=("skin.conductance",)))
    assert (found.bad, found.named, found.tried) == (True, (), 0)
    assert re.match("31 .* 30$", found.failed)
