"""Errors of values between bounds: a value cannot lie further from its fit than its bounds. Synthetic records."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.fit._problem.residuals import Influence, Unknown
from thermid.fit._uncertainty.information import Responses, square_between


def unknown(low: float, high: float, log: bool = False) -> Unknown:
    return Unknown("c", "parameter", (Influence(0, "c"),), 896.0, low=low, high=high, log=log)


@pytest.mark.parametrize(
    ("at", "error", "found"),
    [
        (896.0, 1.0, 1.0),  # far from both bounds
        (860.0, 1.0, 1.0),  # at a bound the half that is left is as far from it as the whole
        (860.0, 1e6, 72.0 / math.sqrt(3.0)),  # nothing is known but the bounds
        (896.0, 1e6, 72.0 / math.sqrt(12.0)),
    ],
)
def test_a_normal_error_is_cut_at_the_bounds(at: float, error: float, found: float) -> None:
    assert math.sqrt(square_between(unknown(860.0, 932.0), at, error**2)) == pytest.approx(found, rel=1e-4)


def test_it_is_what_members_between_the_bounds_scatter_by() -> None:
    drawn = 880.0 + 60.0 * np.random.default_rng(5).standard_normal(400_000)
    inside = drawn[(drawn > 860.0) & (drawn < 932.0)]
    found = math.sqrt(square_between(unknown(860.0, 932.0), 880.0, 60.0**2))
    assert found == pytest.approx(np.sqrt(np.mean((inside - 880.0) ** 2)), rel=5e-3)


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    """A box of a stated metal whose readings wander more than its model can: its specific heat ends at a bound of its range."""

    def box(**more: Any) -> td.Model:
        htc = {"value": "6 [W/(m^2 K)]", "min": 1, "max": 30}
        heat = {"value": "896 [J/(kg K)]", "min": "860 [J/(kg K)]", "max": "932 [J/(kg K)]"}
        return td.model_from_dict(
            {
                "title": "Box",
                "needs": ["air"],
                "nodes": {"case": {"mass": "0.7 [kg]", "specific_heat": heat}},
                "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.05 [m^2]", "htc": htc}},
                "loads": {"heat": {"into": "case", "power": "4 [W]"}},
            }
        )

    times = np.linspace(0.0, 7200.0, 121)
    given = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]", duration="2 [h]")
    run = td.simulate(box().with_values({"case.mass": "0.6 [kg]"}), given, times=times)["case"].kelvin
    wander = 1.5 * np.sin(times / 900.0) + 0.05 * np.random.default_rng(2).standard_normal(times.size)
    channel = td.Channel.from_array("T", run + wander, unit="K", role="node", target="case", noise=0.05)
    log = td.Record.from_arrays("log", times, {"T": channel}, synthetic=True)
    return td.calibrate(box(), log, ["case.specific_heat", "skin.htc"], scenario=given.with_(duration="0 [s]"))


def test_no_error_of_a_fit_is_wider_than_its_bounds(fit: td.Calibration) -> None:
    found = fit["case.specific_heat"]
    assert found.value == pytest.approx(860.0, rel=1e-3)
    assert found.error <= 72.0 / math.sqrt(3.0)
    assert found.error_random <= found.error * (1 + 1e-9)
    assert np.linalg.eigvalsh(fit.values.covariance).min() > 0.0


def test_errors_of_two_values_that_go_together_do_not_depend_on_their_order() -> None:
    unknowns = [unknown(895.0, 900.0), unknown(880.0, 897.0)]
    noise, fitted = np.array([[400.0, 300.0], [300.0, 625.0]]), np.full(2, 896.0)

    def total(order: list[int]) -> np.ndarray:
        responses = Responses(np.zeros((2, 0)), (), noise[np.ix_(order, order)], np.zeros(2, dtype=bool))
        return responses.between([unknowns[k] for k in order], fitted).total[np.ix_(order, order)]

    assert np.diag(total([0, 1])).max() < 625.0
    np.testing.assert_allclose(total([1, 0]), total([0, 1]), rtol=1e-12)
