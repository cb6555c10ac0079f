"""Fixed values opened at the end of a fit: their derivatives against differences, and what is left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thermid.fit._calibrate import fit
from thermid.fit._calibration import Calibration
from thermid.fit._problem.request import Request
from thermid.fit._uncertainty.information import opened_at, opened_jacobian
from unit.fit.bench import HTC, MASS, box, log, pair


def ended(found: Calibration) -> np.ndarray:
    assert found.problem is not None
    return np.array([found.fitted[u.name] for u in found.problem.unknowns])


@pytest.fixture(scope="module")
def found() -> Calibration:
    stack = pair()
    data = log(stack, {"a.power": "4.4 [W]"}, {"A": "a.case", "B": "b.case"}, boundary="room", accuracy=0.2, samples=61)
    return fit(Request(stack, (data,), ("a.power",)))


def test_columns_are_those_of_differences(found: Calibration) -> None:
    assert found.request is not None
    assert found.problem is not None
    at = opened_at(found.request, found.problem, ended(found), [(f"a.{MASS}", f"b.{MASS}"), (f"a.{HTC}", f"b.{HTC}")])
    assert at.names == (f"a.{MASS}", f"a.{HTC}")
    assert [u.name for u in at.problem.unknowns[: at.own]] == [u.name for u in found.problem.unknowns]
    slopes = at.problem.jacobian(at.fitted)
    for k in range(at.own - 1, at.fitted.size):
        step = np.zeros_like(at.fitted)
        step[k] = 1e-3
        sides = [at.problem.residuals(at.fitted + side * step) for side in (-1, 1)]
        assert slopes[:, k] == pytest.approx((sides[1] - sides[0]) / 2e-3, abs=2e-3 * np.abs(slopes[:, k]).max())
    own, fixed = opened_jacobian(at)
    both = np.column_stack([own, fixed])
    assert both.T @ both == pytest.approx(slopes.T @ slopes, rel=1e-6, abs=1e-6 * np.abs(slopes.T @ slopes).max())


def test_what_acts_as_an_unknown_or_has_another_value_stays_out() -> None:
    stack = pair().with_values({f"b.{MASS}": "1.2 [kg]"})
    data = log(stack, {}, {"A": "a.case"}, boundary="room", samples=31)
    found = fit(Request(stack, (data,), ("a.power",), fit_start=False))
    assert found.request is not None
    assert found.problem is not None
    at = opened_at(found.request, found.problem, ended(found), [("a.power", "b.power"), (f"a.{MASS}", f"b.{MASS}"), ("no.such",)])
    assert [(u.name, u.also) for u in at.problem.unknowns[at.own :]] == [(f"a.{MASS}", ())]


def test_constant_errors_of_instruments_open_at_what_they_were_taken_as() -> None:
    data = log(box(), {}, {"T": "case"}, accuracy=0.3, bias={"T": 0.2}, samples=61)
    request = Request(box(), (data,), ("power",), held_bias={"T": 0.2})
    found = fit(request)
    assert found.problem is not None
    at = opened_at(request, found.problem, ended(found), [], instruments=True, values_before={"sensor T": 0.2})
    assert at.names == ("sensor T",)
    assert at.problem.residuals(at.fitted) == pytest.approx(found.problem.residuals(ended(found)), abs=1e-9)
    loose = fit(replace(request, held_bias={}))
    assert loose.problem is not None
    there = np.array([at.fitted[[u.name for u in at.problem.unknowns].index(u.name)] for u in loose.problem.unknowns])
    assert loose.problem.residuals(there) == pytest.approx(at.problem.residuals(at.fitted), abs=1e-6)
