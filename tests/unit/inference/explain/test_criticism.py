"""What residuals say against a model: nothing where it is right, and the planted element where one is missing."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import of_code, raises_code
from thermid.base.errors import code_of
from thermid.inference._explain.candidates import MissingElement, missing_elements
from unit.fit.bench import HTC, MASS, box, log

pytestmark = pytest.mark.usefixtures("values_alone")

BARE = {"surfaces/skin/effective_htc": "6 [W/(m^2 K)]", "nodes/case/mass": "1.5 [kg]"}
INNER = {
    "nodes/inner": {"capacitance": "600 [J/K]"},
    "conductors/path": {"kind": "conduction", "between": ["inner", "case"], "conductance": "1.0 [W/K]"},
}
LAG = {
    "nodes/bulb": {"capacitance": "1 [J/K]"},
    "conductors/path": {"kind": "conduction", "between": ["bulb", "case"], "conductance": "0.006 [W/K]"},
}
SKIN = {"of": "case", "to": "air", "area": "0.05 [m^2]"}


def fitted(truth: td.Model, node: str = "case", **more: Any) -> td.Calibration:
    """A box of one node, fitted to a log of something else."""
    data = log(truth, {}, {"T": node}, **{"noise": 0.05, **more})
    data = data.with_channels(replace(data.channel("T"), target="case"))
    return td.calibrate(box(BARE), data, [HTC, MASS])


def test_noise_is_left_alone() -> None:
    found = td.inference.criticise(fitted(box(BARE)))
    assert found.traces[0].statistics.white
    assert (found.candidates, found.suggested) == ((), None)
    assert "1 of 1" in str(found)


@pytest.mark.parametrize(
    ("changes", "node", "loads", "code"),
    [
        pytest.param(INNER | {"loads/heat/into": "inner"}, "case", None, "inner-mass", marks=pytest.mark.campaign),
        (INNER | {"conductors/path/conductance": "0.6 [W/K]"}, "case", None, "second-mass"),
        (
            {"surfaces/skin": SKIN | {"htc": {"coefficient": "2.2 [W/(m^2 K)]", "exponent": "0.25"}}},
            "case",
            {"heat": 8.0},
            "natural-convection",
        ),
    ],
)
def test_what_was_left_out_is_suggested(changes: dict[str, Any], node: str, loads: Any, code: str) -> None:
    suggests(td.inference.criticise(fitted(box(changes), node, loads=loads)), code)


def suggests(found: td.inference.Criticism, code: str) -> None:
    best = found.suggested
    assert best is not None
    assert code_of(best.name) == f"element.{code}"
    assert re.search("'(case|heat)'", best.name)
    assert best.fit is not None
    assert best.rmse[1] == pytest.approx(0.05, rel=0.1)
    assert best.rmse[1] < 0.85 * best.rmse[0]
    assert f"Suggested: {best.name}" in str(found)


def test_a_few_bad_readings_are_seen_by_their_size() -> None:
    """At 181 readings the lag shows in the first few alone: too large for noise."""
    (trace,) = td.inference.criticise(fitted(box(LAG), "bulb", samples=181), elements=False).traces
    assert trace.loud
    assert all(part in str(trace) for part in ("RMSE 0.06 K", "0.05 K"))


def test_what_is_found_is_what_was_planted_and_an_impossible_value_is_said_and_not_suggested() -> None:
    found = td.inference.criticise(fitted(box(LAG), "bulb"))
    suggests(found, "lag")
    assert found.suggested is not None
    (tau,) = map(float, re.findall(r"([\d.]+) s ", found.suggested.found))
    assert tau == pytest.approx(1 / 0.006, rel=0.4)
    odd = next(c for c in found.candidates if code_of(c.name) == "element.inner-mass")
    assert not odd.possible
    assert len(str(odd)) > len(str(replace(odd, possible=True))), "and that is said of it"


def test_evidence_and_what_is_said_of_it_are_of_one_noise() -> None:
    """Beside a part that wanders by 0.25 K a lag was very strong evidence at "RMSE 0.25 -> 0.251 K", and nothing said why."""
    data = log(box(LAG), {}, {"T": "bulb"}, noise=0.02)
    seen, kept, rng = data.channel("T"), np.exp(-60.0 / 3600.0), np.random.default_rng(3)
    wander = np.zeros(seen.values.size)
    for k in range(1, wander.size):
        wander[k] = kept * wander[k - 1] + 0.25 * np.sqrt(1.0 - kept**2) * rng.standard_normal()
    data = data.with_channels(replace(seen, target="case", values=seen.values + wander))
    found = td.inference.criticise(td.calibrate(box(BARE), data, [HTC, MASS]))
    lag = next(c for c in found.candidates if code_of(c.name) == "element.lag")
    supported = [c for c in found.candidates if c.evidence > 2.0]
    assert lag in supported
    assert all(c.weighted[1] < c.weighted[0] for c in supported)
    assert found.wander > 1000.0


def test_nothing_speaks_for_an_element_that_the_log_cannot_tell() -> None:
    # at rest from the first reading a second mass does nothing, and the readings are as likely
    data = log(box(BARE), {}, {"T": "case"}, start="steady", swing=0.0, samples=101)
    fit = td.calibrate(box(BARE), data, [HTC], scenario=td.Scenario("s", start="steady"))
    found = td.inference.criticise(fit, elements=True)
    mass = next(c for c in found.candidates if code_of(c.name) == "element.second-mass")
    assert mass.evidence < 2.0
    assert found.suggested is None
    together = td.inference.criticise(fit, elements=True, executor=ThreadPoolExecutor(2))
    assert [(c.name, c.evidence, c.refused) for c in together.candidates] == [(c.name, c.evidence, c.refused) for c in found.candidates]


def test_a_fit_and_its_criticism_call_the_same_residuals_white() -> None:
    """`-v` said "residuals white: no (lag-1 0.13)" where `criticise` said "independent from reading to reading"."""
    for seed in range(12):
        fit = fitted(box(BARE), samples=181, seed=seed)
        (line,) = [x for x in str(fit).splitlines() if "residuals white:" in x]
        (trace,) = td.inference.criticise(fit, elements=False).traces
        assert ("white: yes" in line) == trace.statistics.white == (", autocorrelated" not in str(trace))


def test_picture(tmp_path: Path) -> None:
    found = td.inference.criticise(fitted(box(LAG), "bulb"), elements=False)
    assert td.reporting.picture(found, tmp_path / "c.png").stat().st_size > 20_000


def test_a_calibration_from_elsewhere() -> None:
    fit = fitted(box(BARE), samples=51)
    with raises_code("fit.needs-session"):
        td.inference.criticise(replace(fit, request=None))


def rooms(slope: float, count: int = 8) -> td.Calibration:
    """A box in rooms that no column logs, at powers of 1 to 12 W, whose truth loses less at high power by `slope` [W/K per W]."""
    rng, records = np.random.default_rng(8), []
    times = np.arange(0.0, 9000.0, 60.0)
    for k in range(count):
        watts = 1.0 + 11.0 * k / (count - 1)
        truth = box({**BARE, "loads/heat/power": f"{watts!r} [W]", "surfaces/skin/effective_htc": f"{6.0 - slope * watts!r} [W/(m^2 K)]"})
        air = 22.0 + 0.3 * rng.standard_normal()
        run = td.simulate(
            truth, td.Scenario("s", boundaries={"air": f"{air} [degC]"}, start=f"{air} [degC]", duration="9000 [s]"), times=times
        )
        channels = {
            "T": td.Channel.from_array(
                "T", run["case"].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target="case", noise=0.05
            ),
            "P": td.Channel.from_array("P", np.full(times.size, watts), quantity="power", role="load", target="heat"),
        }
        records.append(td.Record.from_arrays(f"r{k}", times, channels))
    return td.calibrate(box(BARE), records, [HTC, MASS], local={"air": {"start": "22 [degC]", "sd": "2 [K]"}}, search="local")


def test_an_ambient_that_runs_with_the_power_is_a_failed_check() -> None:
    found = td.inference.criticise(rooms(0.2), elements=False)
    assert len(found.checks) == 1
    assert all(part in found.checks[0] for part in ("'air' of 8", "'heat'"))
    assert "failed check" in str(found)


def test_ambients_that_only_scatter_pass() -> None:
    assert td.inference.criticise(rooms(0.0), elements=False).checks == ()
    assert td.inference.criticise(rooms(0.2, count=4), elements=False).checks == ()  # four records are too few to say so


def test_a_lag_that_is_fitted_does_not_end_it() -> None:
    """The search for unlogged heat ran the model without its sensor at values of the sensor: "no parameter 'sensor_T.lag'"."""
    times = np.arange(0.0, 10801.0, 60.0)
    nodes = {"case": {"capacitance": "600 [J/K]"}, "inner": {"capacitance": "500 [J/K]"}}
    skin = {"kind": "convection", "between": ["case", "room"], "area": "0.05 [m^2]", "htc": "8 [W/(m^2 K)]"}
    tie = {"kind": "conduction", "between": ["case", "inner"], "conductance": "0.4 [W/K]"}
    deck = {"title": "box", "needs": ["room"], "loads": {"q": {"into": "case", "power": "6 [W]"}}}
    truth = td.model_from_dict(deck | {"nodes": nodes, "conductors": {"skin": skin, "tie": tie}})
    model = td.model_from_dict(deck | {"nodes": {"case": nodes["case"]}, "conductors": {"skin": skin}})
    scenario = td.Scenario("bench", {"room": "22 [degC]"}, start="22 [degC]")
    kelvin = td.simulate(truth, scenario.with_(duration="3 [h]"), times=times)["case"].kelvin
    noisy = kelvin + 0.05 * np.random.default_rng(1).standard_normal(times.size)
    record = td.Record.from_arrays("log", times, {"T": td.Channel.from_array("T", noisy, unit="K", role="node", target="case", noise=0.05)})
    lagging = record.with_sensor("T", lag="60 [s]", lag_accuracy="30 [s]")
    fit = td.calibrate(model, lagging, ["case.capacitance", "skin.htc"], scenario=scenario)
    assert any("lag" in name for name in fit.fitted)
    assert td.inference.criticise(fit).candidates


class TestEndsOfContacts:
    """Eight masses on a frame, all read; the sensors of two lag by the record."""

    @staticmethod
    def elements() -> list[MissingElement]:
        parts = [f"m{k}" for k in range(8)]
        deck = {
            "title": "stack",
            "needs": ["air"],
            "nodes": {n: {"capacitance": "100 [J/K]"} for n in [*parts, "frame"]},
            "conductors": {f"{n}_foot": {"kind": "conduction", "between": [n, "frame"], "conductance": "0.2 [W/K]"} for n in parts}
            | {"skin": {"kind": "conduction", "between": ["frame", "air"], "conductance": "0.5 [W/K]"}},
            "loads": {"heat": {"into": "m0", "power": "3 [W]"}},
        }
        times = np.arange(0.0, 1200.0, 60.0)
        model, rng = td.model_from_dict(deck), np.random.default_rng(5)
        run = td.simulate(model, td.Scenario("s", boundaries={"air": "20 [degC]"}, start="air", duration="1200 [s]"), times=times)
        readings = {f"T_{n}": run[n].kelvin + rng.normal(0.0, 0.05, times.size) for n in [*parts, "frame"]}
        channels = {t: td.Channel.from_array(t, k, unit="K", role="node", target=t[2:], noise=0.05) for t, k in readings.items()}
        channels["air"] = td.Channel.from_array("air", np.full(times.size, 293.15), unit="K", role="boundary", target="air")
        record = td.Record.from_arrays("r", times, channels, synthetic=True)
        for sensor in ("T_m0", "T_m7"):
            record = record.with_sensor(sensor, lag="30 [s]", lag_accuracy="30 [s]")
        fit = td.calibrate(model, record, ["skin.conductance"])
        assert fit.request is not None
        return list(missing_elements(fit, fit.request))

    def test_are_parts_and_surroundings_and_no_sensors_and_all_pairs_are_looked_at(self) -> None:
        names = [e.name for e in self.elements()]
        contacts = of_code(names, "element.contact")
        assert not [n for n in contacts if ".tip" in n]
        # each two of eight parts, and each part with the air
        assert len(contacts) == len(set(contacts)) == 8 * 7 // 2 + 8
        assert any("'m6' and 'm7'" in words for words in contacts)
        # what the record says of a lag is fitted already
        lags = of_code(names, "element.lag")
        assert lags
        assert not [n for n in lags if "'m0'" in n or "'m7'" in n]
