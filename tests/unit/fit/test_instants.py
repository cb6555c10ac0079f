"""When inputs change between their samples: found by a fit, on synthetic truths of a simulator of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import thermid as td
from thermid.fit._calibration import FIRST
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.inference.criticism import mistakes_of
from thermid.simulation.runs import Engine, Jump, Options, Wiring, compile_network

Course = Callable[[NDArray[np.float64]], NDArray[np.float64]]
AIR = td.Scenario("s", {"air": "20 [degC]"}, start="20 [degC]")
TRUTH = {"case.capacitance": 320.0, "out.conductance": 0.5}
BOX = td.model_from_dict(
    {
        "title": "Box",
        "needs": ["air"],
        "parameters": {"speed": "0 [1/s]", "k": "0.03 [W s/K]"},
        "nodes": {"case": {"capacitance": "300 [J/K]"}},
        "conductors": {
            "out": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.4 [W/K]"},
            "blown": {"kind": "conduction", "between": ["case", "air"], "conductance": "k * speed"},
        },
        "loads": {n: {"into": "case", "power": "0 [W]"} for n in ("heat", "more")},
    }
)


def steps(instants: list[float], values: list[float]) -> Course:
    """Return a course of time [s] that has each value from its instant on, the first one before."""
    return lambda t: np.array(values)[np.searchsorted(instants, t, side="right")]


def made(end: float, every: float, seed: int = 1, noise: float = 0.03, **inputs: tuple[Course, float]) -> td.Record:
    """Return a log of a box of 320 J/K and .5 W/K (+ .024 W s/K of fan speed) with inputs sampled every so many seconds.

    The truth is exact over steps of a quarter of a second, at the middles of which its power and conductance are taken.
    """
    middles, rise = (np.arange(round(4.0 * end)) + 0.5) / 4.0, [0.0]
    watts = sum(course(middles) for n, (course, _) in inputs.items() if n != "speed")
    conductance = 0.5 + 0.024 * inputs["speed"][0](middles) if "speed" in inputs else np.full(middles.size, 0.5)
    for settled, decay in zip(watts / conductance, np.exp(-0.25 * conductance / 320.0), strict=True):
        rise.append(settled + (rise[-1] - settled) * decay)
    times = np.arange(0.0, end + 1.0, every)
    read = 293.15 + np.interp(times, np.arange(len(rise)) / 4.0, rise) + np.random.default_rng(seed).normal(0.0, noise, times.size)
    sensor = td.Channel.from_array("T", read, unit="K", role="node", target="case", noise=noise)
    record = td.Record.from_arrays("bench", times, {"T": sensor})
    for name, (course, step) in inputs.items():
        rows = np.arange(0.0, end + 1.0, step)
        kind = {"quantity": "frequency", "unit": "1/s", "role": "schedule"} if name == "speed" else {"quantity": "power", "role": "load"}
        channel = td.Channel.from_array(name, course(rows + 1e-6), target=name, prompt=False, **kind)
        record = record.joined(td.Record.from_arrays(f"sheet of {name}", rows, {name: channel}), 0.0)
    return record


SHEET = steps([871.0, 3390.0, 5911.0], [0.0, 16.0, 6.4, 0.0])
METER = steps([131.0, 1007.0, 1909.0, 2650.0], [0.0, 16.0, 6.4, 12.0, 0.0])
SPEED = steps([1755.0, 3390.0], [0.0, 25.0, 10.0])
HEATER = np.cumsum(np.random.default_rng(1).uniform(35.0, 85.0, 100))


@pytest.mark.parametrize(
    ("log", "error"),
    [
        (lambda: made(8100.0, 20.0, heat=(SHEET, 200.0)), 0.0006),
        (lambda: made(3600.0, 5.0, heat=(METER, 60.0)), 0.0006),
        (lambda: made(3600.0, 30.0, heat=(METER, 30.0)), 0.002),
        (lambda: made(3600.0, 10.0, heat=(steps([*HEATER], [12.0 * (k % 2) for k in range(101)]), 30.0)), 0.03),
        (lambda: made(8100.0, 20.0, heat=(SHEET, 200.0), more=(lambda t: 0.6 * SHEET(t), 200.0)), 0.0006),
        (
            lambda: made(
                7200.0, 10.0, heat=(steps([331.0], [0.0, 20.0]), 120.0), speed=(steps([1755.0, 3390.0], [0.0, 25.0, 10.0]), 120.0)
            ),
            0.002,
        ),
    ],
    ids=["by hand", "wattmeter", "one clock", "60 changes an hour", "two together", "fan"],
)
def test_changes_between_samples_are_found(log: Callable[[], td.Record], error: float) -> None:
    """Held from the samples that show them, or spread over the intervals before, they put values 0.1 to 60 % off, or errors at 20 %."""
    record = log()
    truth = TRUTH | ({"k": 0.024} if "speed" in record.channels else {})
    found = td.calibrate(BOX, record, list(truth), scenario=AIR)
    for name, value in truth.items():
        assert abs(found[name].value - value) < 3.0 * found[name].error < 3.0 * error * value
    assert not any(w.startswith(FIRST) for w in found.warnings)


def test_a_slow_ramp_is_told_from_a_step() -> None:
    """A power that was turned up over ten minutes, written every five: steps fit badly, errors say so, and lines are named first."""
    ramp = lambda t: np.interp(t, [0.0, 600.0, 1200.0, 3000.0, 3600.0, 8100.0], [0.0, 0.0, 16.0, 16.0, 6.0, 6.0])  # noqa: E731
    record = made(8100.0, 20.0, heat=(ramp, 300.0))
    found = td.calibrate(BOX, record, list(TRUTH), scenario=AIR)
    assert all(abs(found[n].value - value) < 3.0 * found[n].error for n, value in TRUTH.items())
    assert any(w.startswith(FIRST) and "'heat'" in w for w in found.warnings)
    lines = td.calibrate(BOX, record.with_channels(replace(record["heat"], interpolation="linear")), list(TRUTH), scenario=AIR)
    assert all(abs(lines[n].value - value) < 3.0 * lines[n].error < 0.003 * value for n, value in TRUTH.items())
    assert not any("'heat'" in w for w in lines.warnings)


def test_of_a_power_with_a_row_at_every_change_nothing_is_looked_for() -> None:
    record = made(3600.0, 20.0, heat=(steps([120.0, 1020.0, 1920.0], [0.0, 16.0, 6.4, 0.0]), 20.0))
    prompt, unsaid = (record.with_channels(replace(record["heat"], prompt=p)) for p in (True, None))
    found = [td.calibrate(BOX, r, list(TRUTH), scenario=AIR) for r in (prompt, unsaid)]
    assert found[0].fitted == found[1].fitted
    assert not any("switch" in name for name in found[0].fitted)


def test_questions_about_a_fit_know_when_inputs_changed() -> None:
    """A fleet and a filter refused such a log, and likely mistakes were not looked for."""
    units = {f"unit {k}": made(4000.0, 40.0, seed=k, heat=(steps([871.0, 2790.0], [0.0, 16.0, 0.0]), 200.0)) for k in range(3)}
    first = units["unit 0"]
    fit = td.calibrate(BOX, first, list(TRUTH), scenario=AIR)
    assert mistakes_of(fit).named == ()
    milli = first.with_channels(replace(first["heat"], values=1e-3 * first["heat"].values))
    assert "heat" in str(td.inference.mistakes_of(td.calibrate(BOX, milli, list(TRUTH), scenario=AIR)).first)
    # a person at Python's prompt reads where to ask; of a good fit there is nothing to ask
    path, value = "case.capacitance", TRUTH["case.capacitance"]
    held = td.calibrate(BOX, first, list(TRUTH), scenario=AIR, priors={path: (f"{1.5 * value} [J/K]", "1 [%]")})
    assert [f.own.fair for f in (held, fit)] == [False, True]
    assert [any("td.inference.mistakes_of" in w for w in f.warnings) for f in (held, fit)] == [True, False]
    filtered = td.inference.estimate(BOX, first, list(TRUTH), process_noise={"case": "free"}, scenario=AIR)
    fleet = td.inference.fleet(BOX, units, list(TRUTH), scenario=AIR)
    for name, value in TRUTH.items():
        assert abs(filtered.process.values[name].value - value) < 3.0 * filtered.process.values[name].error
        assert all(abs(found[name][0] - value) < 3.0 * found[name][1] for found in fleet.units.values())


def test_what_a_later_jump_does_is_the_kernels_own_derivative() -> None:
    """Two powers, one into a massless node that radiates, and a scheduled conductance: differences of runs agree to microkelvins."""
    network = compile_network(
        td.model_from_dict(
            {
                "title": "Box",
                "needs": ["air"],
                "parameters": {"g": "0.3 [W/K]"},
                "nodes": {"case": {"capacitance": "300 [J/K]"}, "skin": {}, "lid": {"capacitance": "50 [J/K]"}},
                "conductors": {
                    "a": {"kind": "conduction", "between": ["case", "skin"], "conductance": "2 [W/K]"},
                    "b": {"kind": "conduction", "between": ["case", "lid"], "conductance": "0.5 [W/K]"},
                    "f": {"kind": "conduction", "between": ["skin", "air"], "conductance": "g"},
                    "r": {"kind": "radiation", "between": ["skin", "air"], "area": "0.05 [m^2]", "emissivity": 0.9},
                },
                "loads": {"heat": {"into": "case", "power": "10 [W]"}, "hot": {"into": "skin", "power": "1 [W]"}},
            }
        )
    )
    rows = {"heat": ([0, 101, 500], [0, 20, 0]), "hot": ([0, 134, 700], [0, 5, 1]), "g": ([0, 302], [0.3, 1.2])}
    units = {"heat": "W", "hot": "W", "g": "W/K"}
    tables = {
        n: {"times": [f"{t} [s]" for t in at], "values": [f"{v} [{units[n]}]" for v in of], "hold": True, "after": "hold"}
        for n, (at, of) in rows.items()
    }
    loads, schedule = {n: tables[n] for n in ("heat", "hot")}, {"g": tables["g"]}
    scenario = td.Scenario("s", {"air": "20 [degC]"}, loads, start="20 [degC]", duration="1000 [s]", schedule=schedule)
    jumps = {f"later {n}": (Jump("schedule" if n == "g" else "loads", n, 1, 2.0),) for n in rows}
    engine, times = Engine(Wiring(network, scenario, list(jumps), jumps=jumps)), np.arange(0.0, 1001.0, 7.0)

    def run(x: NDArray[np.float64], gradients: bool) -> td.Any:
        """Return the answer with jumps later by twice some seconds."""
        numbers = engine.wiring.assemble(x, gradients)
        return engine.integrate(numbers, times, ["case", "lid"], 1000.0, Options(method="integrator"), gradients)

    slopes = run(np.zeros(3), True).sensitivities
    for k, late in enumerate(0.25 * np.eye(3)):
        difference = (run(late, False).temperatures - run(-late, False).temperatures) / 0.5
        assert np.abs(difference - slopes[:, :, k]).max() < 5e-6
        assert np.abs(slopes[:, :, k]).max() > 0.01


def test_energy_of_changes_without_an_instant_is_an_error_of_the_mean() -> None:
    """Of 400 changes of 12 W in 30 s the 200 largest have an instant; the others leave (200 / 12)^(1/2) 360 J of 72 kJ."""
    on = lambda t: 12.0 * (np.floor(t / 30.0) % 2)  # noqa: E731
    (experiment,) = build_problem(Request(BOX, (made(12000.0, 30.0, heat=(on, 30.0)),), ("out.conductance",), {"*": AIR})).experiments
    assert experiment.means == pytest.approx({"scale.heat": np.sqrt(199.0 / 12.0) * 360.0 / 72000.0}, rel=0.01)
