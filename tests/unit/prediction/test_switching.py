"""Runs that temperatures switch: what bounds a band there is the hysteresis, and no derivative at an instant."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.campaign._judge.predictions import CampaignPrediction
from thermid.campaign.stages import Limits
from thermid.fit.calibration import Calibration
from thermid.prediction import _predict
from thermid.prediction._predict import SWITCHING, Band, foresee
from thermid.prediction._records import predict_record
from thermid.prediction._setting import assumed_effects

ON, OFF = 5.0, 9.0
LATE = 2.5 * 3600.0
COLD = td.Scenario("cold", boundaries={"air": "-25 [degC]"}, start="20 [degC]", duration="4 [h]")
MEMBERS = 160


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_predict, "DRAWN_MEMBERS", (MEMBERS, MEMBERS))


def deck(cell: float, bat: float, frame: float, power: float, switch: tuple[float, float] | None, **more: Any) -> td.Model:
    """A battery behind a contact in a frame that radiates to cold walls, with a heater; conductance [W/K], capacitances [J/K]."""
    heater: dict[str, Any] = {"into": "bat", "power": f"{power!r} [W]"}
    if switch is not None:
        heater["thermostat"] = {"on_below": f"{switch[0]!r} [degC]", "off_above": f"{switch[1]!r} [degC]"}
    return td.model_from_dict(
        {
            "title": "heated battery",
            "needs": ["air"],
            "nodes": {"bat": {"capacitance": {"value": f"{bat!r} [J/K]", **more}}, "frame": {"capacitance": f"{frame!r} [J/K]"}},
            "conductors": {
                "cell": {"kind": "conduction", "between": ["bat", "frame"], "conductance": {"value": f"{cell!r} [W/K]", **more}},
                "skin": {"kind": "radiation", "between": ["frame", "air"], "area": "0.04 [m^2]", "emissivity": 0.88},
            },
            "loads": {"heater": heater},
        }
    )


@pytest.fixture(scope="module")
def found() -> Calibration:
    """The fit of contact and capacity to a warm run in which the heater's power is logged."""
    times = np.arange(0.0, 7200.0, 60.0)
    power = np.where(times < 600.0, 0.0, 3.0)
    course = {"times": ["0 [s]", "600 [s]"], "values": ["0 [W]", "3 [W]"], "hold": True, "after": "hold"}
    lab = td.Scenario("lab", boundaries={"air": "22 [degC]"}, start="air", duration="7140 [s]", loads={"heater": course})
    run = td.simulate(deck(0.24, 210.0, 340.0, 3.0, None), lab, times=times)
    noise = np.random.default_rng(1)
    channels = {
        n: td.Channel.from_array(
            n, run[n].celsius + noise.normal(0.0, 0.05, times.size), unit="degC", target=n, noise="0.05 [K]", accuracy="0.3 [K]"
        )
        for n in ("bat", "frame")
    }
    channels["air"] = td.Channel.from_array("air", td.celsius(np.full(times.size, 22.0)), role="boundary", target="air")
    channels["P"] = td.Channel.from_array("P", power, unit="W", role="load", target="heater", quantity="power", prompt=True)
    model = deck(0.25, 220.0, 340.0, 3.0, (ON, OFF), spread="20 [%]")
    return td.calibrate(model, td.Record.from_arrays("lab", times, channels), ["cell.conductance", "bat.capacitance"])


@pytest.fixture(scope="module")
def told(found: Calibration) -> td.Prediction:
    with pytest.MonkeyPatch.context() as few:
        few.setattr(_predict, "DRAWN_MEMBERS", (MEMBERS, MEMBERS))
        return td.predict(found, COLD)


class _Counting(ThreadPoolExecutor):
    """Threads that count the tasks that they are given."""

    tasks = 0

    def submit(self, *task: Any) -> Any:
        self.tasks += 1
        return super().submit(*task)


@pytest.mark.parametrize("scenario", [COLD, COLD.with_(boundaries={"air": "25 [degC]"})], ids=["switches", "settles"])
def test_members_have_the_same_bits_from_any_workers(found: Calibration, scenario: td.Scenario) -> None:
    plain = td.predict(found, scenario, draws=MEMBERS)
    with _Counting(2) as workers:
        shared = td.predict(found, scenario, draws=MEMBERS, executor=workers)
    assert workers.tasks > 8
    assert shared.settled == plain.settled
    for node, band in plain.bands.items():
        assert band.members is not None
        assert np.array_equal(shared[node].members, band.members)


def late_ends(band: Band) -> tuple[float, float]:
    """Lowest and highest end of a band once the heater holds the battery. [degC]"""
    low, high = (end[band.times > LATE] for end in band.interval())
    return float(low.min()), float(high.max())


def test_departures_move_switching_times_and_not_what_they_hold(found: Calibration, told: td.Prediction) -> None:
    """By derivatives the band of a battery that is held at 5 to 9 degC went from -2800 to 2600 degC, its middle to -110 degC."""
    low, high = late_ends(told["bat"])
    assert ON - 0.3 < low < ON + 1.0
    assert OFF - 0.5 < high < OFF + 0.1
    assert late_ends(told["frame"])[0] > -10.0
    assert sum(told["bat"].parts.values()) == pytest.approx(told["bat"].error ** 2)
    assert set(told["bat"].moved) == {SWITCHING}
    assert SWITCHING in told.centre
    runs = td.qualify.uncertain_runs(found.model, COLD, found, n=MEMBERS, nodes=["bat"])
    held = runs.node_temperatures("bat")[:, runs.times > LATE] - 273.15
    assert ON - 1.0 < held.min()
    assert held.max() < OFF + 0.1
    assert SWITCHING in runs.centre
    assert td.qualify.hold(runs, {"bat": {"lowest": "0 [degC]"}})["bat"].never == 1.0


def test_readings_of_a_record_have_the_band_of_members(found: Calibration) -> None:
    """By derivatives their band was +- 74 K, at most 2700, and its centre went down to -55 degC."""
    times = np.arange(0.0, COLD.seconds, 60.0)
    run = td.simulate(deck(0.24, 210.0, 340.0, 3.0, (ON, OFF)), COLD, times=times)
    noise = np.random.default_rng(3).normal(0.0, 0.05, times.size)
    channel = td.Channel.from_array("bat", run["bat"].celsius + noise, unit="degC", target="bat", noise="0.05 [K]", accuracy="0.3 [K]")
    band = predict_record(found, td.Record.from_arrays("cold", times, {"bat": channel}), scenario=COLD).bands["bat"]
    assert band.half_width()[times > LATE].max() < 0.5 * (OFF - ON) + 1.0
    assert ON < band.predicted[times > LATE].min() - 273.15 < band.predicted[times > LATE].max() - 273.15 < OFF
    assert band.inside() > 0.9


def test_margins_are_those_of_the_extremes_of_members(found: Calibration, told: td.Prediction) -> None:
    """At an instant hardly a member is just switched on, but every one is at some time."""
    (margin,) = (m for m in CampaignPrediction("cold", "sat", told, {"bat": (253.15, 303.15)}).margins if m.node == "bat")
    assert margin.expected[0] - 273.15 == pytest.approx(ON, abs=0.5)
    assert ON - 1.0 < margin.band[0] - 273.15 < ON + 0.1
    assert margin.band[1] - 273.15 == pytest.approx(20.0, abs=0.1)
    seen = foresee(td.design.Knowledge.of_source(found), COLD, nodes=["bat"])
    (cold, _) = td.qualify.margins({"cold": seen}, [Limits("bat", "bat", operating=("0 [degC]", "60 [degC]"))])
    assert cold.predicted - 273.15 == pytest.approx(ON, abs=0.5)
    assert 0.0 <= cold.uncertainty < 1.0
    assumed = assumed_effects(deck(0.25, 220.0, 340.0, 6.0, (ON, OFF), source="assumed"), COLD, (), ["bat"], None)
    assert len(assumed) == 2, "contact and capacity"
    assert max(effects["bat"] for *_, effects in assumed) < 1.0


def test_advice_on_a_switched_temperature_is_that_of_members() -> None:
    """By derivatives the battery was "now +- 24.9 K" at the end; figures of tests that switch say first what they leave out."""
    model, air = deck(0.25, 220.0, 340.0, 6.0, (ON, OFF)), {"air": "22 [degC]"}
    priors = {"cell.conductance": ("0.25 [W/K]", "0.0375 [W/K]"), "bat.capacitance": ("220 [J/K]", "33 [J/K]")}
    given: dict[str, Any] = {"sensors": {"bat": "0.1 [K]"}, "priors": priors}
    step = td.design.Action("warm, with a step", COLD.with_(boundaries=air, loads={"heater": "3 [W]"}))
    advice = td.design.next_test(model, td.design.Aim(COLD, "bat"), [step], **given)
    assert 0.0 < advice.best.error < advice.now < OFF - ON
    assert advice.not_counted == ""
    switched = td.design.next_test(model, "cell.conductance", [step, td.design.Action("cold", COLD)], **given)
    assert "'cold'" in str(switched).splitlines()[0]


def test_where_nothing_switches_derivatives_do(found: Calibration) -> None:
    assert td.predict(found, COLD.with_(boundaries={"air": "25 [degC]"}))["bat"].members is None


def test_random_decks_keep_their_truths_inside() -> None:
    """Twenty decks, five truths each, from the stated errors: 90 to 99 % inside a band within the hysteresis, and so are duty cycles."""
    draws, inside, duties = np.random.default_rng(5), [], []
    spread = {"cell.conductance": "15 [%]", "bat.capacitance": "15 [%]", "frame.capacitance": "10 [%]", "air": "1 [K]"}
    for _ in range(20):
        on, hysteresis, room = draws.uniform(-5.0, 8.0), draws.uniform(1.5, 6.0), draws.uniform(-45.0, -20.0)
        cell, bat, frame, power = (float(draws.uniform(*ends)) for ends in ((0.1, 0.3), (120.0, 300.0), (200.0, 500.0), (6.0, 9.0)))
        scenario = COLD.with_(boundaries={"air": f"{room} [degC]"})
        model = deck(cell, bat, frame, power, (on, on + hysteresis))
        told = td.predict(
            td.design.Knowledge(model), scenario, spread=spread, times=np.arange(0.0, COLD.seconds + 1.0, 600.0), nodes=["bat"]
        )
        band, (least, most) = told["bat"], told.duty_cycles["heater"].interval()
        assert told.to_dict()["duty_cycles"]["heater"]["high"] == most[0]
        assert str(told.duty_cycles["heater"]) in str(told)
        low, high = band.interval()
        assert band.half_width[band.times > LATE].max() < 0.5 * hysteresis + 0.1
        for _ in range(5):
            factors = 1.0 + draws.normal(0.0, [0.15, 0.15, 0.1])
            truth = deck(*(np.array([cell, bat, frame]) * factors).tolist(), power, (on, on + hysteresis))
            walls = scenario.with_(boundaries={"air": f"{room + draws.normal()} [degC]"})
            run = td.simulate(truth, walls, times=band.times)
            celsius, duty = run["bat"].celsius, run.duty_cycles["heater"]
            duties.append((np.array([duty.share, duty.last_share]) >= least) & (np.array([duty.share, duty.last_share]) <= most))
            inside.append(np.mean((celsius >= low - 1e-6) & (celsius <= high + 1e-6)))
    assert 0.9 <= np.mean(inside) <= 0.99
    assert (np.mean(duties, axis=0) >= 0.88).all()
    assert (np.mean(duties, axis=0) <= 0.99).all()
