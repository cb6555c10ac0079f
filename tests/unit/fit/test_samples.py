"""What a sample of a log is: an instant or an average, in a fit."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.fit._calibrate import calibrate
from thermid.fit._problem.experiment import signal_of
from thermid.inference.criticism import mistakes_of
from thermid.measure.readers import read_record
from thermid.measure.records import Channel, Record
from unit.fit.bench import HTC, MASS, box

STEP = 300.0


def averaged(samples: str) -> Record:
    """A room that swings by 8 K in half an hour, logged as averages of five minutes; the box read every minute."""
    swing = td.Scenario(
        "swing", boundaries={"air": {"mean": "20 [degC]", "amplitude": "8 [K]", "period": "30 [min]"}}, start="20 [degC]", duration="3 [h]"
    )
    times = np.arange(0.0, 3 * 3600.0 + 1.0, STEP)
    run = td.simulate(box().with_values({HTC: "6 [W/(m^2 K)]"}), swing, times=times)
    air = swing.boundaries["air"]
    means = np.array([air.mean_over(t - STEP, t) for t in times])
    made = [
        Channel.from_array("T", run["case"].kelvin, unit="K", target="case", role="node", noise=0.02),
        Channel.from_array("ROOM", means, unit="K", target="air", role="boundary", samples=samples),
    ]
    return Record(
        "swing", times, {c.name: c for c in made}, td.Record.from_arrays("swing", times, {"T": run["case"].kelvin}, unit="K").origin
    )


def test_averages_are_steps_to_their_stamps() -> None:
    record = averaged("average")
    drives = signal_of(record, record["ROOM"], "boundary", 0.0)
    values = record["ROOM"].values
    assert drives.at(np.array([1.0, STEP - 1.0, STEP + 1.0])) == pytest.approx([values[1], values[1], values[2]])
    assert drives.mean_over(0.0, 3 * 3600.0) == pytest.approx(np.mean(values[1:]))


@pytest.mark.parametrize(
    ("role", "target", "asked", "between"),
    [
        ("load", "electronics", {}, 2.0),
        ("load", "electronics", {"interpolation": "linear"}, 3.0),
        ("boundary", "air", {}, 23.0),
        ("boundary", "air", {"interpolation": "previous"}, 22.0),
    ],
)
def test_a_column_says_what_holds_between_its_samples(
    tmp_path: Path, role: str, target: str, asked: dict[str, str], between: float
) -> None:
    path = tmp_path / "log.csv"
    first = {"load": 2, "boundary": 22}[role]
    path.write_text(f"time_s,X,T\n0,{first},20\n60,{first + 2},20\n", "ascii")
    record = read_record(path, {"X": {role: target, **asked}, "T": {"node": "case"}})
    signal = signal_of(record, record["X"], role, 0.0)
    assert signal.at(30.0) - (273.15 if role == "boundary" else 0.0) == pytest.approx(between)


def test_a_fit_says_where_it_matters_that_samples_are_taken_as_instants() -> None:
    found = {s: calibrate(box(), averaged(s), [HTC], scenario=td.Scenario("s", start="20 [degC]")) for s in ("", "average", "instant")}
    assert any("'air'" in w for w in found[""].warnings)
    assert not any("'air'" in w for w in (*found["average"].warnings, *found["instant"].warnings))
    off = {s: abs(f.values[HTC].value - 6.0) for s, f in found.items()}
    assert off["average"] < 0.5 * off["instant"]


def test_channels_say_what_their_samples_are(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time_s,ROOM,T\n0,20,20\n60,21,20\n", "ascii")
    room = {"boundary": "air", "samples": "average"}
    assert read_record(path, {"ROOM": room, "T": {"node": "case"}})["ROOM"].samples == "average"
    for channels, code, match in (
        ({"ROOM": room | {"samples": "mean"}}, "name.unknown", "'instant' nor 'average'"),
        ({"T": {"node": "case", "samples": "average"}}, "record.does-not-apply", ""),
        ({"ROOM": {"boundary": "air", "interpolation": "cubic"}}, "name.unknown", "'linear' nor 'previous'"),
        ({"T": {"node": "case", "interpolation": "linear"}}, "record.does-not-apply", ""),
        ({"ROOM": room | {"interpolation": "linear"}}, "value.incomplete", ""),
    ):
        with raises_code(code, RecordError, match=match):
            read_record(path, channels)
    with pytest.raises(RecordError, match="'instant' or 'average'"):
        replace(averaged("average")["ROOM"], samples="mean")


def switched(seed: int, on_rows: bool, prompt: bool | None = False) -> Record:
    """A box of random values, read every 30 s; its power is switched three times, between samples or with them."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, 4 * 3600.0 + 1.0, 30.0)
    instants = np.array([600.0, 5400.0, 10800.0]) + (30.0 * rng.integers(0, 9, 3) if on_rows else rng.uniform(0.0, 300.0, 3))
    levels = [0.0, *rng.uniform(2.0, 5.0, 2), 0.0]
    truth = {
        "times": ["0 [s]", *(f"{t:.9g} [s]" for t in instants)],
        "values": [f"{v:.9g} [W]" for v in levels],
        "hold": True,
        "after": "hold",
    }
    test = td.Scenario("s", boundaries={"air": "20 [degC]"}, loads={"heat": truth}, start="20 [degC]", duration="4 [h]")
    run = td.simulate(box(), test, times=times)
    readings = run["case"].kelvin + rng.normal(0.0, 0.05, times.size)
    watts = np.array(levels)[np.searchsorted(instants, times + 1e-6, side="right")]
    made = [
        Channel.from_array("T", readings, unit="K", target="case", role="node", noise=0.05),
        Channel.from_array("ROOM", np.full(times.size, 293.15), unit="K", target="air", role="boundary", samples="instant"),
        replace(Channel.from_array("P", watts, quantity="power", role="load", target="heat"), prompt=prompt),
    ]
    return Record.from_arrays("s", times, {c.name: c for c in made})


def deviations(seeds: range, on_rows: bool, prompt: bool | None = False) -> tuple[np.ndarray, np.ndarray]:
    """Return how many errors the values lie from the truth (fits, values), and their errors over the truth."""
    fits = [calibrate(box(), switched(seed, on_rows, prompt), [HTC, MASS]) for seed in seeds]
    errors = np.array([[f[p].error for p in (HTC, MASS)] for f in fits])
    return (np.array([[f[p].value for p in (HTC, MASS)] for f in fits]) - [6.0, 1.5]) / errors, errors / [6.0, 1.5]


@pytest.mark.parametrize("on_rows", [False, True])
def test_errors_count_when_a_sampled_power_changed(on_rows: bool) -> None:
    """Held from the samples that show it, a power that was switched between them puts values several errors off; found, it does not."""
    z, errors = deviations(range(8), on_rows)
    assert np.sqrt(np.mean(z**2)) < 1.5
    held = np.sqrt(np.mean(deviations(range(8), on_rows, prompt=None)[0] ** 2))
    assert held < 1.5 if on_rows else held > 2.5
    exact = deviations(range(2), True, prompt=True)[1]
    assert (errors.mean(axis=0) < 4.0 * exact.mean(axis=0)).all()


@pytest.mark.campaign
@pytest.mark.parametrize("on_rows", [False, True])
def test_errors_of_many_tests_whose_power_was_sampled(on_rows: bool) -> None:
    z, _ = deviations(range(100, 160), on_rows)
    assert 0.8 <= np.sqrt(np.mean(z**2)) <= 1.3
    assert 0.9 <= np.mean(np.abs(z) < 1.96) <= 0.98


def switched_late(prompt: bool | None) -> Record:
    """A box whose power was switched 50 and 35 s before the sample of a minute that shows it first."""
    times = np.arange(0.0, 4 * 3600.0 + 1.0, 60.0)
    truth = {"times": ["0 [s]", "610 [s]", "7225 [s]"], "values": ["0 [W]", "4 [W]", "0 [W]"], "hold": True, "after": "hold"}
    test = td.Scenario("s", boundaries={"air": "20 [degC]"}, loads={"heat": truth}, start="20 [degC]", duration="4 [h]")
    run = td.simulate(box(), test, times=times)
    watts = np.where((times >= 610.0) & (times < 7225.0), 4.0, 0.0)
    made = [
        Channel.from_array(
            "T",
            run["case"].kelvin + np.random.default_rng(2).normal(0.0, 0.12, times.size),
            unit="K",
            target="case",
            role="node",
            noise=0.12,
        ),
        Channel.from_array("ROOM", np.full(times.size, 293.15), unit="K", target="air", role="boundary", samples="instant"),
        replace(Channel.from_array("P", watts, quantity="power", role="load", target="heat"), prompt=prompt),
    ]
    return Record.from_arrays("s", times, {c.name: c for c in made})


def test_a_fit_says_what_the_unknown_instants_of_switches_may_move() -> None:
    """A power is held from its sample on, but changed before it; where noise hides that, a value is off by more than its error."""
    found = calibrate(box(), switched_late(prompt=None), [HTC, MASS])
    (remark,) = [w for w in found.warnings if "'P' " in w]
    (stated,) = map(float, re.findall(rf"'{re.escape(HTC)}' [a-z ]*([\d.]+) ", remark))
    off = abs(found[HTC].value - 6.0) / found[HTC].error
    assert off > 2.5
    assert 0.5 * stated < off < 2.0 * stated
    assert not any("'P' " in w for w in calibrate(box(), switched_late(prompt=True), [HTC, MASS]).warnings)


def test_a_statement_of_no_effect_is_named() -> None:
    """Means over the interval before a sample hold the energy of a switch: nothing is unknown of its instant."""
    record = switched(0, on_rows=False)
    found = calibrate(box(), record.with_channels(replace(record["P"], samples="average")), [HTC, MASS])
    assert len([w for w in found.warnings if "prompt = false" in w and "'P'" in w]) == 1
    assert not [w for w in calibrate(box(), record, [HTC, MASS]).warnings if "prompt" in w]


@pytest.mark.parametrize("late", [0.0, 40.0])
def test_a_change_between_two_far_samples_is_found_at_its_instant(late: float) -> None:
    """Rows 100 s before and after each change, by hand, and a temperature every 20 s: a change spread over 200 s is half a kelvin off."""
    steps, watts, times = (900.0, 3420.0, 5940.0), (0.0, 16.0, 6.4, 0.0), np.arange(0.0, 8101.0, 20.0)
    heat = {"times": [f"{t:g} [s]" for t in (0.0, *steps)], "values": [f"{p} [W]" for p in watts], "hold": True, "after": "hold"}
    asked = td.Scenario("s", {"air": "23 [degC]"}, {"heat": heat}, start="23 [degC]", duration="8100 [s]")
    read = td.simulate(box(), asked, times=times)["case"].kelvin + np.random.default_rng(1).normal(0.0, 0.03, times.size)
    first = Record.from_arrays("bench", times, {"T": Channel.from_array("T", read, unit="K", role="node", target="case", noise=0.03)})
    rows = np.array([0.0, *(t + late + side for t in steps for side in (-100.0, 100.0)), 8100.0])
    values = np.array([*(p for k in range(4) for p in watts[k : k + 1] * 2)])
    meter = Channel.from_array("P", values, quantity="power", role="load", target="heat", prompt=False)
    joint = first.joined(Record.from_arrays("sheet", rows, {"P": meter}), 0.0)
    found = calibrate(box({"nodes/case/mass/value": "1.2 [kg]"}), joint, [HTC, MASS], scenario=asked.with_(loads={}))
    assert found[MASS].value == pytest.approx(1.5, abs=3.0 * found[MASS].error)
    assert found[MASS].error < 0.01
    assert mistakes_of(found).named == ()
