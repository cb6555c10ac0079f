"""Fans and pumps on the resistance of their systems: operating points, affinity laws, derivatives, and what is no fan."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import thermid as td
from by_code import raises_code

CURVE = [
    ["0 [m^3/h]", "82 [Pa]"],
    ["60 [m^3/h]", "70 [Pa]"],
    ["120 [m^3/h]", "52 [Pa]"],
    ["150 [m^3/h]", "20 [Pa]"],
    ["190 [m^3/h]", "0 [Pa]"],
]
"""Falling, and neither hollow nor bulging all along."""
FAN: dict[str, Any] = {"curve": CURVE, "resistance": "30000 [Pa s^2/m^6]"}


def values(**fan: Any) -> dict[str, float]:
    """Return the values of a fan `f`. [SI]"""
    return dict(values_of(model(**fan)))


def model(**fan: Any) -> td.Model:
    deck = {
        "title": "box",
        "needs": ["inlet"],
        "nodes": {"air": {"capacitance": "5 [J/K]", "stands_for": "air"}},
        "conductors": {
            "in": {"kind": "flow", "between": ["inlet", "air"], "fluid": "air", "volume_flow": "f.flow"},
            "out": {"kind": "flow", "between": ["air", "inlet"], "fluid": "air", "volume_flow": "f.flow"},
        },
        "loads": {"heat": {"into": "air", "power": "40 [W]"}},
        "fans": {"f": {k: v for k, v in (FAN | fan).items() if v is not None}},
    }
    return td.model_from_dict(deck)


def values_of(given: td.Model) -> Any:
    from thermid.simulation.runs import compile_network

    return {k.removeprefix("f."): v for k, v in compile_network(given).numbers().values.items() if k.startswith("f.")}


def expected(k: float, r: float = 0.0, s: float = 1.0, n: float = 1.0) -> float:
    x = np.array([float(v.split()[0]) / 3600.0 for v, _ in CURVE])
    y = np.array([float(p.split()[0]) for _, p in CURVE])

    def gap(flow: float) -> float:
        at = flow / (n * s)
        beyond = y[-1] + (y[-1] - y[-2]) / (x[-1] - x[-2]) * (at - x[-1])
        return s**2 * (float(np.interp(at, x, y)) if at <= x[-1] else beyond) - k * flow**2 - r * flow

    return float(brentq(gap, 0.0, n * s * x[-1], xtol=1e-15))


@pytest.mark.parametrize(("speed", "count"), [(1.0, 1.0), (0.6, 1.0), (1.0, 3.0), (0.35, 2.0)])
@pytest.mark.parametrize("resistance", [2e3, 3e4, 6e4, 2e5, 5e6])
def test_the_operating_point_lies_on_both_curves(resistance: float, speed: float, count: float) -> None:
    found = values(resistance=f"{resistance} [Pa s^2/m^6]", linear_resistance="150 [Pa s/m^3]", speed=speed, count=count)
    flow = expected(resistance, 150.0, speed, count)
    assert found["flow"] == pytest.approx(flow, rel=1e-10)
    assert found["pressure"] == pytest.approx(resistance * flow**2 + 150.0 * flow, rel=1e-10)


def test_a_point_of_the_system_gives_its_resistance() -> None:
    found = values(resistance=None, passes=["90 [m^3/h]", "40 [Pa]"])
    assert found["flow"] == pytest.approx(expected(40.0 / (90.0 / 3600.0) ** 2), rel=1e-12)


def test_the_air_of_a_box_follows_the_speed_of_its_fan() -> None:
    """Affinity: on a quadratic system the flow goes with the speed; the air rises by Q / (rho V c). Derivatives are differences."""
    scenario = td.Scenario(boundaries={"inlet": "20 [degC]"}, start="20 [degC]", duration="1 [h]")
    simulator = td.prepare(model(), scenario, ("f.speed", "f.resistance", "f.count"))
    full, half = (simulator.settled({"f.speed": s})[0]["air"] - 293.15 for s in (1.0, 0.5))
    assert half == pytest.approx(2.0 * full, rel=1e-9)
    slopes = simulator.settled()[1]["air"]
    for k, name in enumerate(simulator.free):
        step = 1e-5 * simulator.nominal[name]
        up, down = (simulator.settled({name: simulator.nominal[name] + s * step})[0]["air"] for s in (1.0, -1.0))
        assert slopes[k] == pytest.approx((up - down) / (2.0 * step), rel=1e-6)
    assert simulator.run().heat_balance().relative < 1e-9


def test_a_deck_with_a_fan_is_saved_and_read_again(tmp_path: Any) -> None:
    given = model()
    td.save_model(given, tmp_path / "box.toml")
    again = td.load_model(tmp_path / "box.toml")
    assert values_of(again)["flow"] == values_of(given)["flow"]


@pytest.mark.parametrize(
    ("change", "code", "match"),
    [
        ({"curve": [["0 [m^3/h]", "50 [Pa]"], ["60 [m^3/h]", "55 [Pa]"]]}, "value.outside-range", r"fans\.f\.curve.*3/s"),
        ({"curve": [["60 [m^3/h]", "50 [Pa]"], ["10 [m^3/h]", "15 [Pa]"]]}, "value.outside-range", r"fans\.f\.curve"),
        ({"passes": ["60 [m^3/h]", "50 [Pa]"]}, "value.incomplete", r"fans\.f.*\[flow, pressure\]"),
        ({"resistance": None}, "value.incomplete", r"fans\.f.*\[flow, pressure\]"),
    ],
)
def test_what_is_no_fan_is_refused(change: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        model(**change)
