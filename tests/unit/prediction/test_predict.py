"""A prediction and its bands: derivatives, draws, shares, what stages below left open, and refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, IdentificationError, NameNotFoundError, ScenarioError
from thermid.fit.calibration import Calibration, Request, calibrate, fit
from thermid.prediction._budget import Spread
from thermid.prediction._predict import Prediction, _mixed, between_ways, predict
from thermid.simulation.runs import Scenario, simulate
from unit.fit.bench import HTC, MASS, box, log, pair

HOT = Scenario("hot", boundaries={"air": "40 [degC]"}, start="24 [degC]", duration="3 [h]")


def plain(*given: Any, **more: Any) -> Prediction:
    """A prediction without what constant coefficients leave out; test_discrepancy.py has that."""
    return predict(*given, without=("structural", "misfit"), **more)


@pytest.fixture(scope="module")
def found() -> Calibration:
    data = log(box(), {HTC: "5 [W/(m^2 K)]", MASS: "1.7 [kg]"}, {"T": "case"}, seed=2, accuracy=0.3)
    return calibrate(box(), data, [HTC, MASS])


def test_it_is_the_simulation_with_the_error_of_the_covariance(found: Calibration) -> None:
    told = plain(found, HOT, times=[3600.0, 10800.0])
    run = simulate(found.model, HOT, times=[3600.0, 10800.0])
    assert told["case"].kelvin == pytest.approx(run["case"].kelvin, abs=1e-4)
    # by differences: the logarithms of both values, one standard error along each direction of their covariance
    paths = list(found.values.parameters)
    covariance = found.values.bare().covariance
    slopes = []
    for p in paths:
        up = found.model.with_values({p: f"{float(found[p].in_unit * np.exp(1e-3))!r} [{found[p].unit}]"})
        slopes.append((simulate(up, HOT, times=[3600.0, 10800.0])["case"].kelvin - run["case"].kelvin) / 1e-3)
    by_hand = np.sqrt(np.einsum("pt,pq,qt->t", slopes, covariance, slopes))
    assert told["case"].error == pytest.approx(by_hand, rel=2e-3)
    low, high = told["case"].interval(0.95)
    assert (high - low) / 2 == pytest.approx(1.959964 * by_hand, rel=2e-3)
    assert told["air"].error.max() == 0.0


def test_rounding_is_no_error(found: Calibration) -> None:
    """A boundary at 45 degC, averaged over ways of carrying heat, was '45.00 +- 5.7e-14 degC'."""
    air = plain(found, HOT)["air"]
    ulp = np.full(air.times.size, np.spacing(318.15) ** 2)
    assert " +- 0 degC" in str(replace(air, parts={"averaged": ulp}).final)
    apart = [replace(air.final, celsius=air.final.celsius + x) for x in (0.0, float(np.sqrt(ulp[0])))]
    assert " +- 0 degC" in str(_mixed(apart, np.array([0.5, 0.5])))


def test_what_is_settled_is_the_steady_state(found: Calibration) -> None:
    told = plain(found, HOT)
    steady = td.steady(found.model, HOT)
    assert told.settled["case"].celsius == pytest.approx(steady["case"] - 273.15, abs=1e-6)
    # at the end only the coefficient counts: rise / (h A)
    share = found[HTC].error / found[HTC].value
    assert told.settled["case"].error == pytest.approx((steady["case"] - 313.15) * share, rel=1e-4)


def test_what_else_is_not_known_is_added_and_named(found: Calibration) -> None:
    told = plain(found, HOT, spread={"air": "0.5 [K]", "scale.heat": "2 [%]"})
    alone = plain(found, HOT)
    final = told.settled["case"]
    rise = final.celsius - 40.0
    assert final.error**2 == pytest.approx(alone.settled["case"].error ** 2 + 0.5**2 + (0.02 * rise) ** 2, rel=1e-3)
    assert sum(final.shares.values()) == pytest.approx(1.0)
    assert {c for c, share in final.shares.items() if share} == {"fit", "stated"}
    assert told["air"].final.error == pytest.approx(0.5)
    text = str(told)
    for word in ("95 % ", "   95 %: ", f"{final.celsius:.2f}", " stated"):
        assert word in text


def test_correlated_and_log_normal_spreads(found: Calibration) -> None:
    names = ("scale.heat", "skin.area")
    alike = Spread("stated", names, 0.02**2 * np.array([[1.0, 1.0], [1.0, 1.0]]), (True, True))
    opposed = Spread("stated", names, 0.02**2 * np.array([[1.0, -1.0], [-1.0, 1.0]]), (True, True))
    # power and area by the same factor leave the steady temperature where it is
    without = plain(found, HOT).settled["case"].error
    assert plain(found, HOT, spread=alike).settled["case"].error == pytest.approx(without, rel=1e-3)
    final = plain(found, HOT, spread=opposed).settled["case"]
    assert final.error**2 == pytest.approx(without**2 + (0.04 * (final.celsius - 40.0)) ** 2, rel=1e-3)


@pytest.mark.parametrize(
    ("spread", "sd"),
    [({"sd": "0.4 [K]"}, 0.4), ("0.4 [K]", 0.4), ({"low": "39 [degC]", "high": "41 [degC]"}, 2 / np.sqrt(12))],
)
def test_forms_of_a_stated_spread(found: Calibration, spread: object, sd: float) -> None:
    assert plain(found, HOT, spread={"air": spread})["air"].final.error == pytest.approx(sd, rel=0.03)


def test_draws_agree_with_derivatives_where_the_model_is_straight(found: Calibration) -> None:
    spread = {"scale.heat": {"log_sd": 0.02}, "air": "0.5 [K]"}
    by_slopes = plain(found, HOT, spread=spread)["case"].final
    drawn = plain(found, HOT, spread=spread, draws=2000, seed=3)["case"].final
    assert drawn.error == pytest.approx(by_slopes.error, rel=0.05)
    assert (drawn.low, drawn.high) == pytest.approx((by_slopes.low, by_slopes.high), abs=0.1 * by_slopes.error * 2)


def test_draws_are_not_symmetric_where_it_bends(found: Calibration) -> None:
    drawn = plain(found, HOT.with_(duration="30 [h]"), spread={"skin.area": {"log_sd": 0.4}}, draws=1000)["case"].final
    assert drawn.high - drawn.celsius > 1.4 * (drawn.celsius - drawn.low)


def test_values_held_from_a_stage_below_are_not_exact(found: Calibration) -> None:
    from thermid.values.store import graft

    whole = pair(second=box({"title": "Cool", "parameters/power/value": "1 [W]"}))
    store, _ = graft(whole, [("a", found.store)])
    model = store.laid_over(whole)
    data = log(model, {}, {"A": "a.case", "B": "b.case"}, boundary="room", noise=0.05)
    above = fit(Request(model, (data,), ("stack.contact_conductance",), name="pair", store=store))
    scenario = Scenario("s", boundaries={"room": "24 [degC]"}, start="24 [degC]", duration="3 [h]")
    told = plain(above, scenario)
    bare = plain(fit(Request(model, (data,), ("stack.contact_conductance",), name="pair")), scenario)
    assert told["a.case"].final.error > 1.5 * bare["a.case"].final.error


def test_some_nodes_and_aliases(found: Calibration) -> None:
    told = plain(found, HOT, nodes=["case"])
    assert list(told.bands) == ["case"]
    with raises_code("name.unknown", NameNotFoundError, match="'cas'.*'case'"):
        told["cas"]


def test_what_is_spread_twice_or_wrongly_is_refused(found: Calibration) -> None:
    with raises_code("value.excludes-another", IdentificationError, match="'skin.effective_htc'"):
        plain(found, HOT, spread={HTC: "1 [W/(m^2 K)]"})
    with raises_code("name.unknown", ScenarioError, match=r"\{log_sd\}"):
        plain(found, HOT, spread={"air": {"width": "1 [K]"}})
    with raises_code("value.without-effect", ScenarioError):
        plain(found, HOT, spread={"air": "2 [%]"})
    with raises_code("value.without-effect", IdentificationError):
        plain(found, HOT.with_(loads={"heat": "5 [W]"}), spread={"heat.power": "0.5 [W]"})
    with raises_code("name.unknown", NameNotFoundError, match="'heat'.*'scale.heat'"):
        plain(found, HOT, spread={"heat": "2 [%]"})
    with raises_code("name.unknown", NameNotFoundError, match="'aire'.*'air'"):
        plain(found, HOT, spread={"aire": "1 [K]"})
    with raises_code("value.outside-range", DeckError, match="-3"):
        td.predict(found, HOT, draws=-3)
    with raises_code("value.outside-range", ScenarioError, match="'air': its low end"):
        plain(found, HOT, spread={"air": {"low": "41 [degC]", "high": "39 [degC]"}})
    with raises_code("value.outside-range", ScenarioError, match="'air': a standard deviation"):
        plain(found, HOT, spread={"air": "-1 [K]"})
    with raises_code("value.shape", IdentificationError, match="2.*2.*2"):
        Spread("stated", ("a", "b"), np.eye(3))
    with raises_code("value.shape", IdentificationError):
        Spread("stated", ("a", "b"), np.array([[1.0, 2.0], [2.0, 1.0]]))
    with raises_code("fit.not-determined", IdentificationError, match="'a'"):
        Spread("stated", ("a",), np.array([[np.inf]]))


def test_it_can_be_written_down(found: Calibration, tmp_path: Path) -> None:
    told = plain(found, HOT, times=[0.0, 3600.0, 10800.0])
    content = json.loads(json.dumps(told.to_dict([3600.0])))
    assert content["nodes"]["case"]["final"]["C"] == told["case"].final.celsius
    assert content["nodes"]["case"]["at"][0]["error_K"] == told["case"].at(3600.0).error
    told.to_csv(tmp_path / "p.csv")
    header, *rows = (tmp_path / "p.csv").read_text().splitlines()
    assert header.startswith('"time_s",case [degC],case low [degC],case high [degC]')
    assert len(rows) == 3


def test_ways_that_say_the_same_temperature_differ_by_nothing() -> None:
    """A boundary that no way moves: rounding of the mean of equal temperatures is no variance."""
    weights, centres = np.array([0.01, 0.06, 0.01, 0.92]), np.full((4, 2), 313.15)
    assert (weights @ (centres - weights @ centres) ** 2 > 0.0).all()  # so much rounding there is
    parts = between_ways(weights, centres, [(False,), (False,), (False,), (True,)])
    assert [v.tolist() for v in parts.values()] == [[0.0, 0.0], [0.0, 0.0]]
