"""Laws of the user: tables that meet their function, refusals in words, decks that keep them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.model._laws.law import MIN_POINT_DISTANCE
from thermid.model._laws.stores import Curve, hermite

BOTH = ("-80 [K]", "80 [K]")
WARM = ("-40 [degC]", "120 [degC]")


def hot_plate(table: Any, load: Any = None, **conductor: Any) -> td.Model:
    """A plate whose only path is a table; heated by 5 W or by a table."""
    heater = {"power": "5 [W]"} if load is None else {"table": load}
    return td.model_from_dict(
        {
            "title": "hot plate",
            "needs": ["room"],
            "nodes": {"plate": {"capacitance": "100 [J/K]"}},
            "conductors": {"skin": {"kind": "table", "between": ["plate", "room"], "table": table, **conductor}},
            "loads": {"heater": {"into": "plate", **heater}},
        }
    )


def scenario(hours: float = 2.0) -> td.Scenario:
    return td.Scenario("room", boundaries={"room": "20 [degC]"}, duration=hours * 3600.0)


def errors(found: Curve, function: Callable[[float], float], away_from: float | None = None) -> tuple[float, float]:
    """Largest relative errors of value and slope at random places, values below a thousandth of the largest counted as that."""
    at = np.random.default_rng(4).uniform(found.x[0], found.x[-1], 4000)
    if away_from is not None:
        at = at[np.abs(at - away_from) > 2 * MIN_POINT_DISTANCE]
    want = np.array([function(x) for x in at])
    slope = np.array([(function(x + 1e-5) - function(x - 1e-5)) / 2e-5 for x in at])
    y, d = hermite(found.x, found.y, found.slopes, at)
    floor = 1e-3 * np.abs(want).max()
    return (
        float((np.abs(y - want) / np.maximum(np.abs(want), floor)).max()),
        float((np.abs(d - slope) / np.maximum(np.abs(slope), 1e-3 * np.abs(slope).max())).max()),
    )


def test_an_interval_is_halved_by_its_error_in_the_middle() -> None:
    """There the error of a cubic between its ends is largest, a sixteenth of this fourth power: 8 % above that a tenth to one side."""
    found = td.model.law(lambda x: 1.0 + ((x - 300.0) / 0.05) ** 4 * 1e-3, between=("300 [K]", "300.05 [K]"), tolerance=6e-5)
    assert found.x.size == 3


@pytest.mark.parametrize(
    ("function", "over", "between"),
    [
        (lambda d: 0.3 * (d * d + 1e-4) ** 0.125, "difference", BOTH),
        (lambda d: 0.02 + 0.5 * math.exp(-(((d - 25.0) / 6.0) ** 2)), "difference", BOTH),
        (lambda t: math.exp(-3000.0 / t), "temperature", WARM),
        (lambda t: 1.0 + 5.0 * math.exp(-(((t - 311.11) / 0.3) ** 2)), "temperature", WARM),
        (lambda t: math.tanh((t - 300.0) / 0.05), "temperature", WARM),
        (lambda t: 2.0 - 0.003 * t, "temperature", WARM),
    ],
    ids=["natural convection", "bell", "exponential", "narrow peak", "steep", "straight"],
)
def test_the_table_meets_the_function_and_its_slope(function: Callable[[float], float], over: Any, between: tuple[str, str]) -> None:
    value, slope = errors(td.model.law(function, over=over, between=between), function)
    assert value < 2e-7
    assert slope < 1e-3


def test_a_tolerance_is_kept_and_costs_points() -> None:
    sizes = []
    for tolerance in (1e-4, 1e-6, 1e-9):
        found = td.model.law(lambda t: np.exp(-3000.0 / t), between=WARM, tolerance=tolerance)
        assert errors(found, lambda t: math.exp(-3000.0 / t))[0] < 2 * tolerance
        sizes.append(found.x.size)
    assert sizes[0] < sizes[1] < sizes[2] < 1000


@pytest.mark.parametrize("kink", [300.0, 301.2345])
def test_a_kink_is_rounded_within_a_millikelvin(kink: float) -> None:
    found = td.model.law(lambda t: np.maximum(0.0, t - kink), between=WARM)
    assert found.x.size < 60
    assert np.abs(found.x - kink).min() <= MIN_POINT_DISTANCE
    assert errors(found, lambda t: max(0.0, t - kink), away_from=kink)[0] < 2e-7


def test_a_cusp_at_zero_difference_has_a_point_there() -> None:
    found = td.model.law(lambda d: 0.3 * np.abs(d) ** 0.33, over="difference", between=BOTH)
    assert 0.0 in found.x
    assert errors(found, lambda d: 0.3 * abs(d) ** 0.33, away_from=0.0)[0] < 1e-5  # the slope has no bound towards the cusp


def test_arrays_and_single_numbers_give_the_same_table() -> None:
    one = td.model.law(lambda t: max(1.0, math.sqrt(t)) if t > 0 else 1.0, between=WARM)
    other = td.model.law(lambda t: np.maximum(1.0, np.sqrt(t)), between=WARM)
    assert one == other
    assert hash(one) == hash(other)
    assert td.model.law(lambda t: 0.7, between=WARM).y.tolist() == [0.7, 0.7]


@pytest.mark.parametrize(
    ("function", "between", "code", "match"),
    [
        (lambda t: 1.0 if t > 300.25 else 2.0, WARM, "model.law-refused", r"300\.25.*2.*1"),
        (lambda t: 1.0 / (t - 273.15), ("-273.15 [degC]", "0 [degC]"), "model.law-refused", r"273\.15"),
        (lambda t: np.sqrt(t - 250.0), WARM, "model.law-refused", r"233\.15"),
        (lambda t: math.sqrt(t - 250.0), WARM, "model.law-refused", r"233\.15"),
        (lambda t: np.sin(1000.0 * t), WARM, "model.law-refused", "20000"),
        (lambda t: np.zeros(3), WARM, "value.shape", ""),
        (lambda t: {}["a"], WARM, "model.law-refused", "'a'"),
        (lambda t: t, ("120 [degC]", "-40 [degC]"), "value.outside-range", ""),
        (lambda t: t, ("-5 [K]", "300 [K]"), "value.outside-range", "-5.*300"),
        (lambda t: t, ("-40 [W]", "120 [degC]"), "unit.wrong-dimension", ""),
    ],
)
def test_what_is_no_law_is_refused_in_words(function: Any, between: Any, code: str, match: str) -> None:
    with raises_code(code, match=match):
        td.model.law(function, between=between)


def test_wrong_options_are_refused() -> None:
    with raises_code("name.unknown", match="'diference'.* 'difference'"):
        td.model.law(lambda t: t, over="diference", between=WARM)  # type: ignore[arg-type]
    with raises_code("value.outside-range", match="0"):
        td.model.law(lambda t: t, between=WARM, tolerance=0.0)


def test_a_negative_conductance_is_refused_where_it_stands_and_a_negative_power_is_not() -> None:
    with raises_code("model.negative-conductance", match=r"conductors\.skin.*233\.15"):
        hot_plate(td.model.law(lambda t: (t - 273.15) * 0.1, between=WARM))
    model = hot_plate(td.model.law(lambda t: 0.1, between=WARM), load=td.model.law(lambda t: 0.1 * (293.15 - t), between=WARM))
    assert td.steady(model, scenario())["plate"] == pytest.approx(293.15, abs=1e-7)


def test_a_law_equals_the_built_in_one() -> None:
    """Natural convection of kind `convection`, and the same with its smoothing as a function."""
    law = td.model.law(lambda d: 0.3 * (d * d + 1e-4) ** 0.125, over="difference", between=BOTH)
    deck = {
        "title": "hot plate",
        "needs": ["room"],
        "nodes": {"plate": {"capacitance": "100 [J/K]"}},
        "surfaces": {
            "skin": {"of": "plate", "to": "room", "area": "0.1 [m^2]", "htc": {"coefficient": "3 [W/(m^2 K)]", "exponent": 0.25}},
        },
        "loads": {"heater": {"into": "plate", "power": "5 [W]"}},
    }
    options = td.Options(error=8e-9)
    one = td.simulate(td.model_from_dict(deck), scenario(), options=options)
    other = td.simulate(hot_plate(law), scenario(), options=options)
    assert np.abs(one.temperatures - other.temperatures).max() < 2e-6
    assert np.abs(one.heat_flows["skin"] - other.heat_flows["skin"]).max() < 2e-6


def test_the_scale_of_a_law_can_be_freed() -> None:
    law = td.model.law(lambda d: 0.3 * (d * d + 1e-4) ** 0.125, over="difference", between=BOTH)
    sim = td.prepare(hot_plate(law, scale=1.2), scenario(), ["skin.scale"], options=td.Options(error=8e-10))
    slope = sim.run(sensitivities=True).sensitivity("plate", "skin.scale")
    high, low = (sim.run({"skin.scale": 1.2 + step})["plate"].kelvin for step in (1e-4, -1e-4))
    assert np.abs((high - low) / 2e-4 - slope).max() < 1e-4 * np.abs(slope).max()


def test_a_run_that_leaves_the_range_says_so() -> None:
    law = td.model.law(lambda d: 0.05 + 0.001 * np.abs(d), over="difference", between=("-20 [K]", "20 [K]"))
    run = td.simulate(hot_plate(law), scenario(10.0))
    (warning,) = run.warnings
    assert all(part in warning for part in ("'skin'", "law, -20 to 20 K"))
    assert run["plate"].final == pytest.approx(20.0 + 5.0 / 0.07, abs=1e-3)  # constant beyond
    wide = td.model.law(lambda d: 0.05 + 0.001 * np.abs(d), over="difference", between=("-90 [K]", "90 [K]"))
    assert td.simulate(hot_plate(wide), scenario(10.0)).warnings == ()
    heater = td.model.law(lambda t: 0.05 * (400.0 - t), between=("0 [degC]", "40 [degC]"))
    assert [w[:8] for w in td.simulate(hot_plate(wide, load=heater), scenario()).warnings] == ["'heater'"]


def test_a_deck_keeps_a_law(tmp_path: Path) -> None:
    table = td.model.law(lambda d: 0.3 * np.abs(d) ** 0.33, over="difference", between=BOTH)
    model = hot_plate(table, load=td.model.law(lambda t: np.exp((t - 300.0) / 50.0), between=WARM))
    td.save_model(model, tmp_path / "plate.toml")
    again = td.load_model(tmp_path / "plate.toml")
    assert again.identity() == model.identity()
    assert again.conductors["skin"].curve == table
    one, other = (td.simulate(m, scenario()).temperatures for m in (model, again))
    assert np.array_equal(one, other)
    td.save_model(again, tmp_path / "plate.toml", like=tmp_path / "plate.toml")
    assert td.load_model(tmp_path / "plate.toml").identity() == model.identity()


def test_points_with_and_without_slopes() -> None:
    points: list[list[str]] = [["-50 [K]", "0.1 [W/K]"], ["0 [K]", "0.1 [W/K]"], ["50 [K]", "0.2 [W/K]"]]
    sloped = [[*p, s] for p, s in zip(points, ("0 [W/K^2]", "0 [W/K^2]", "0.002 [W/K^2]"), strict=True)]
    plain, with_slopes = (hot_plate({"over": "difference", "points": p}).conductors["skin"].curve for p in (points, sloped))
    assert plain is not None
    assert plain.d is None
    assert with_slopes is not None
    assert with_slopes.d is not None
    assert with_slopes.d.tolist() == [0.0, 0.0, 0.002]
    assert plain != with_slopes
    with raises_code("model.law-refused"):
        hot_plate({"over": "difference", "points": [*points[:2], sloped[2]]})
    with pytest.raises(td.ThermidError, match=r"W/K\^2"):
        hot_plate({"over": "difference", "points": [[*p, "1 [W/K]"] for p in points]})
    with raises_code("model.law-refused"):
        hot_plate({"over": "difference", "points": [["-50 [K]", "inf [W/K]"], ["50 [K]", "0.2 [W/K]"]]})


def test_a_law_runs_at_the_speed_of_a_built_in_one() -> None:
    """A chain of ten plates that lose heat by natural convection; the ratio is about 1.3, and 1.6 around a difference of zero."""
    names = [f"n{k}" for k in range(10)]
    base: dict[str, Any] = {
        "title": "chain",
        "needs": ["room"],
        "nodes": {n: {"capacitance": "100 [J/K]"} for n in names},
        "conductors": {f"l{a}": {"kind": "conduction", "between": [a, b], "conductance": "2 [W/K]"} for a, b in pairwise(names)},
        "loads": {"heater": {"into": "n0", "power": "20 [W]"}},
    }
    htc = {"coefficient": "3 [W/(m^2 K)]", "exponent": 0.25}
    ends: dict[str, Any] = {n: {"between": [n, "room"]} for n in names}
    law = td.model.law(lambda d: 0.3 * (d * d + 1e-4) ** 0.125, over="difference", between=BOTH)
    built_in = {f"{n}_skin": {"kind": "convection", "area": "0.1 [m^2]", "htc": htc, **e} for n, e in ends.items()}
    tabled = {f"{n}_skin": {"kind": "table", "table": law, **e} for n, e in ends.items()}
    noise = np.random.default_rng(2).normal(293.15, 0.05, 3601)
    room = td.Scenario("room", boundaries={"room": (np.arange(3601.0), td.quantity(noise, unit="K"))}, start="303.15 [K]", duration=3600.0)
    sims = [td.prepare(td.model_from_dict(base | {"conductors": base["conductors"] | more}), room) for more in (built_in, tabled)]
    best = [np.inf, np.inf]
    for _ in range(30):
        for k, sim in enumerate(sims):
            begin = time.process_time()
            sim.run()
            best[k] = min(best[k], time.process_time() - begin)
    assert best[1] < 1.5 * best[0]
