"""The range of a finish in a band: where nothing else tells an emissivity, what its table says of it counts. Synthetic records."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.model.tree import FINISH_CORRELATION
from thermid.physics.finishes import FINISHES
from thermid.prediction._budget import STATED_RANGES, Budget, assumed_values, budget_of

MACHINED = "aluminium, machined"
LAW = {"coefficient": {"value": "1.5 [W/(m^2 K)]", "min": 0.5, "max": 4}, "exponent": 0.25}
BENCH = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]", duration="4 [h]")


def box(**skin: Any) -> td.Model:
    """A heated box with two faces: natural convection by a law, and whatever is known of their finish."""
    face = {"of": "case", "to": "air", "htc": LAW, **({"finish": MACHINED} | skin)}
    face = {k: v for k, v in face.items() if v is not None}
    return td.model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": "600 [J/K]"}},
            "surfaces": {"top": {"area": "0.02 [m^2]", **face}, "side": {"area": "0.03 [m^2]", **face}},
            "loads": {"heat": {"into": "case", "power": "2 [W]"}},
        }
    )


def budget(scenario: td.Scenario, model: td.Model | None = None, **more: Any) -> Budget:
    return budget_of(model or box(), scenario, **more)


@pytest.fixture(scope="module")
def fitted() -> td.Calibration:
    """A box that is brighter than its finish says at the middle, fitted in air to its convection and its mass."""
    hidden = box().with_values({"top.emissivity": 0.13, "side.emissivity": 0.13})
    times = np.linspace(0.0, 14400.0, 241)
    logs = []
    for seed, watts in enumerate((2.0, 5.0)):
        run = td.simulate(hidden, BENCH.with_(loads={"heat": f"{watts} [W]"}), times=times)
        kelvin = run["case"].kelvin + 0.05 * np.random.default_rng(seed).standard_normal(times.size)
        channel = td.Channel.from_array("T", kelvin, unit="K", role="node", target="case", noise=0.05)
        power = td.Channel.from_array("P", np.full(times.size, watts), unit="W", quantity="power", role="load", target="heat")
        logs.append(td.Record.from_arrays(f"run {seed}", times, {"T": channel, "P": power}, synthetic=True))
    scenario = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]")
    return td.calibrate(box(), logs, ["top.htc.coefficient", "case.capacitance"], scenario=scenario)


def test_the_range_of_its_finish_spreads_an_emissivity() -> None:
    """Its logarithm by what the table says, and two surfaces of one finish together."""
    found = budget(BENCH.vacuum())
    assert found.causes == (STATED_RANGES, STATED_RANGES)
    assert [t.name for t in found.targets] == ["top.emissivity", "side.emissivity"]
    f = FINISHES[MACHINED]
    low, high = (float(found.sources[0].law.at(np.array([share]))[0]) for share in (0.025, 0.975))
    assert (low, high) == pytest.approx((math.log(f.low / f.high) / 2, math.log(f.high / f.low) / 2), rel=0.01)
    assert found.alike[0, 1] == FINISH_CORRELATION


def test_in_vacuum_the_band_is_that_of_the_finish() -> None:
    told = td.predict(td.design.Knowledge(box()), BENCH.vacuum())
    ends = [
        td.simulate(box().with_values({n: e for n in ("top.emissivity", "side.emissivity")}), BENCH.vacuum())["case"].kelvin[-1]
        for e in (0.05, 0.15)
    ]
    both = math.sqrt(0.4**2 + 0.6**2 + 2 * FINISH_CORRELATION * 0.4 * 0.6)  # by area, of two that go together by half
    assert 2 * told["case"].half_width[-1] == pytest.approx((ends[0] - ends[1]) * both, rel=0.1)
    assert told["case"].final.shares == pytest.approx({STATED_RANGES: 1.0})
    assert not any("emissivity" in x.what for x in told.left_out)


def test_an_emissivity_that_is_given_has_no_finish() -> None:
    assert budget(BENCH.vacuum(), box(finish=None, emissivity=0.09)).causes == ()


def test_what_is_stated_wins() -> None:
    found = budget(BENCH.vacuum(), stated={"top.emissivity": "0.01"})
    assert dict(zip((t.name for t in found.targets), found.causes, strict=True)) == {
        "top.emissivity": "stated",
        "side.emissivity": STATED_RANGES,
    }


def test_laid_over_values_have_left_the_finish() -> None:
    model = box().with_values({"top.emissivity": 0.5})
    assert [t.name for t in budget(BENCH, model).targets] == ["side.emissivity"]


def test_where_an_effective_coefficient_holds_the_radiation_it_does_not_act() -> None:
    model = td.model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": "600 [J/K]"}},
            "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.02 [m^2]", "effective_htc": "6 [W/(m^2 K)]", "finish": MACHINED}},
            "loads": {"heat": {"into": "case", "power": "2 [W]"}},
        }
    )
    assert budget(BENCH, model).causes == ()
    assert budget(BENCH.vacuum(), model).causes == (STATED_RANGES,)


def test_the_size_of_an_assumption_is_that_of_its_finish() -> None:
    """Not a third of everything that physics allows."""
    sizes = {a.path: a for a in assumed_values(box(), BENCH, ())}
    assert sizes["top.emissivity"].size == pytest.approx((0.15 - 0.05) / 12**0.5)
    assert sizes["top.emissivity"].ranged


def test_a_fit_in_air_does_not_tell_it_and_vacuum_asks_it(fitted: td.Calibration) -> None:
    hidden = td.simulate(fitted.model.with_values({"top.emissivity": 0.13, "side.emissivity": 0.13}), BENCH.vacuum())["case"].kelvin
    told = td.predict(fitted, BENCH.vacuum())
    assert (np.abs(told["case"].kelvin - hidden) <= told["case"].half_width).mean() > 0.95
    assert told["case"].final.shares[STATED_RANGES] > 0.5
    assert not any("emissivity" in x.what for x in told.left_out)


def test_where_the_readings_pin_the_answer_the_fit_takes_it_back(fitted: td.Calibration) -> None:
    air = BENCH.with_(loads={"heat": "3 [W]"})
    wide, narrow = (td.predict(fitted, air, without=without)["case"].half_width.max() for without in ((), (STATED_RANGES,)))
    assert wide <= 1.1 * narrow


def test_a_fitted_emissivity_is_not_counted_twice(fitted: td.Calibration) -> None:
    problem = fitted.problem
    assert problem is not None
    logs = [e.record for e in problem.experiments]
    scenario = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]")
    free = td.calibrate(box(), logs, ["top.htc.coefficient", "top.emissivity", "case.capacitance"], scenario=scenario)
    found = budget_of(free, BENCH.vacuum())
    (source,) = (s for s, c in zip(found.sources, found.causes, strict=True) if c == STATED_RANGES)
    assert source.name == "side.emissivity"


def test_an_emissivity_behind_an_effective_coefficient_counts_in_air_where_another_surface_radiates_with_it() -> None:
    deck = {
        "title": "Box",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "600 [J/K]"}},
        "surfaces": {
            "a": {"of": "case", "to": "air", "area": "0.02 [m^2]", "effective_htc": "6 [W/(m^2 K)]", "finish": MACHINED},
            "b": {"of": "case", "to": "air", "area": "0.2 [m^2]", "htc": "1 [W/(m^2 K)]", "emissivity": "a.emissivity"},
        },
        "loads": {"heat": {"into": "case", "power": "2 [W]"}},
    }
    assert budget(BENCH, td.model_from_dict(deck)).causes == (STATED_RANGES,)
    del deck["surfaces"]["b"]["emissivity"]  # type: ignore[index]
    assert budget(BENCH, td.model_from_dict(deck)).causes == ()


def test_a_wide_logarithmic_spread_that_is_stated_is_drawn() -> None:
    """By its logarithm a straight line would miss the hot end by 4 K, and mean and width hardly."""
    skin = {"of": "case", "to": "air", "area": "0.05 [m^2]", "htc": "4 [W/(m^2 K)]"}
    parts = {"nodes": {"case": {"capacitance": "600 [J/K]"}}, "loads": {"heat": {"into": "case", "power": "4 [W]"}}}
    model = td.model_from_dict({"title": "Box", "needs": ["air"], "surfaces": {"skin": skin}, **parts})
    spread = {"skin.htc": {"mean": "4 [W/(m^2 K)]", "log_sd": "0.3"}}
    found = td.predict(td.design.Knowledge(model), BENCH.with_(duration="20 [h]"), spread=spread)
    assert any("were drawn" in text for text in found.warnings)
