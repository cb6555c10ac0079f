"""Before any test, `next_test` says of a prediction what `predict` says: of values fixed by a level below too, in air and without gas."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import thermid as td
from thermid.fit.calibration import Calibration, Request, fit
from thermid.fit.error_model import BandCause
from thermid.prediction._budget import AVERAGED
from unit.fit.bench import box, log, pair

BLACK = {"surfaces/skin/emissivity": {"value": "0.85", "min": 0.7, "max": 0.95}}
JOINT, HTC, WATTS = "stack.contact_conductance", "a.skin.effective_htc", "b.power"
EVERY = (HTC, WATTS, JOINT)
BENCH = td.Scenario("bench", boundaries={"room": "24 [degC]"}, start="24 [degC]", duration="3 [h]")
AGAIN = [td.design.Action("again", BENCH)]
FAR = td.Scenario("far", boundaries={"room": "40 [degC]"}, loads={"a.heat": "6 [W]"}, duration="20 [h]")
BESIDES = {BandCause.STRUCTURE, BandCause.RUN, BandCause.UNEXPLAINED, AVERAGED}


@dataclass(frozen=True, eq=False)
class Levels:
    """Three stages with the same sensors: what one found is fixed in the next."""

    model: td.Model
    one: Calibration
    three: Calibration


def record(model: td.Model, seed: int, start: str = "24 [degC]", samples: int = 61, swing: float = 0.5) -> td.Record:
    """A log of three hours by two sensors that are wrong by a tenth of a kelvin."""
    data = log(
        model, {}, {"A": "a.case", "B": "b.case"}, name=f"log {seed}", boundary="room", noise=0.05, accuracy=0.2,
        bias={"A": 0.1, "B": -0.1}, samples=samples, hours=3.0, seed=seed, start=start, swing=swing,
    )  # fmt: skip
    # less scatter than stated, so that no error is widened
    return data.with_channels(*(replace(data[s], noise=0.065) for s in "AB"))


@pytest.fixture(scope="module")
def levels() -> Levels:
    model = pair(first=box(BLACK), second=box({**BLACK, "parameters/power/value": "2 [W]", "title": "Cool"}))
    logs = [record(model, k, start) for k, start in ((1, "24 [degC]"), (2, "30 [degC]"), (3, "36 [degC]"))]
    one = fit(Request(model, (logs[0],), (HTC,), name="one"))
    two = fit(Request(one.store.laid_over(model), (logs[1],), (WATTS,), store=one.store, name="two"))
    loose = {JOINT: ("", "50 [%]")}
    return Levels(model, one, fit(Request(two.store.laid_over(model), (logs[2],), (JOINT,), store=two.store, priors=loose, name="three")))


@pytest.mark.parametrize("scenario", [FAR, FAR.vacuum()], ids=["air", "no gas"])
@pytest.mark.parametrize("node", ["a.case", pytest.param("b.case", marks=pytest.mark.campaign)])
def test_before_a_test_it_says_what_predict_says(levels: Levels, scenario: td.Scenario, node: str) -> None:
    found = levels.three
    assert set(found.values.parameters) == {JOINT}  # what is fixed is not among what this level fitted
    parts = td.predict(found, scenario)[node].parts
    advice = td.design.next_test(found, td.design.Aim(scenario, node), AGAIN)
    own = [v[-1] for cause, v in parts.items() if cause not in BESIDES]
    assert advice.now == pytest.approx(np.sqrt(sum(own)), rel=1e-6)
    assert set(advice.beside) == {*parts} & BESIDES
    error = np.sqrt(sum(v[-1] for v in parts.values()))
    assert np.linalg.norm([advice.now, *advice.beside.values()]) == pytest.approx(error, rel=1e-6)


@pytest.mark.parametrize("path", EVERY)
def test_what_it_promises_of_any_level_is_what_a_fit_of_the_test_finds(levels: Levels, path: str) -> None:
    """The sensors are those of all levels: what these share with the values counts once."""
    found = levels.three
    advice = td.design.next_test(found, path, AGAIN)
    assert advice.now == pytest.approx(found.store.error(path), rel=1e-9)
    laid = found.store.laid_over(levels.model)
    done = fit(Request(laid, (record(laid, 4, samples=181, swing=0.0),), EVERY, {"*": BENCH}, store=found.store, prior=EVERY, name="four"))
    assert advice.best.error == pytest.approx(done[path].error, rel=0.02)


def test_a_value_without_a_finite_error_is_open_until_a_test_shows_it(levels: Levels) -> None:
    found = levels.one
    store = found.store
    lost = {p: replace(s, known=False) if p == HTC else s for p, s in store.states.items()}
    root = store.root.copy()
    root[list(store.states).index(HTC)] = 0.0
    blind = replace(found, store=replace(store, states=lost, root=root))
    advice = td.design.next_test(blind, HTC, AGAIN)
    assert advice.now == np.inf
    assert 0 < advice.best.error < found[HTC].error


def test_a_logged_speed_is_no_sensor() -> None:
    """Every test "cannot be made: no node 'amps'", so a fit with a fan or a cooler had no advice."""
    skin = {"kind": "conduction", "between": ["case", "room"], "conductance": "speed * blown"}
    model = td.model_from_dict(
        {
            "title": "fan",
            "needs": ["room"],
            "parameters": {"speed": "1", "blown": {"value": "0.5 [W/K]", "min": 0.1, "max": 2}},
            "nodes": {"case": {"capacitance": "100 [J/K]"}},
            "conductors": {"skin": skin},
            "loads": {"heat": {"into": "case", "power": "5 [W]"}},
        }
    )
    times = np.arange(0.0, 3600.0, 60.0)
    speed = td.Channel.from_array("rpm", 1.0 + (times > 1800.0), quantity="command", unit="1", role="schedule", target="speed")
    scenario = td.Scenario("bench", {"room": "20 [degC]"}, start="room", duration="1 [h]", schedule={"speed": (times, speed.values)})
    seen = td.simulate(model, scenario, times=times)["case"].kelvin + 0.05 * np.random.default_rng(1).standard_normal(times.size)
    case = td.Channel.from_array("T", seen, unit="K", role="node", target="case", noise=0.05, accuracy=0.2)
    found = td.calibrate(
        model, td.Record.from_arrays("log", times, {"T": case, "rpm": speed}), ["blown"], scenario=scenario.with_(schedule={})
    )
    advice = td.design.next_test(found, "blown", [td.design.Action("again", scenario)])
    assert [o.refused for o in advice.options] == [""]
