"""Where the laws of a structure do not explain the readings, values expected by its model of error stand before the fitted ones."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.app.objects import answer, calibration_object
from thermid.fit._calibration import blame_of
from thermid.model.tree import TableSignal
from thermid.reporting._pages.tables import parameters

TRUE, HEAT = 900.0, "case.specific_heat"


def free_box(coefficient: dict[str, Any]) -> td.Model:
    """Return a box that free air cools."""
    heat = {"value": f"{TRUE} [J/(kg K)]", "spread": "0.1 [%]"}
    deck: dict[str, Any] = {
        "title": "Box in free air",
        "needs": ["air"],
        "nodes": {"case": {"mass": "1.5 [kg]", "specific_heat": heat}},
        "surfaces": {"skin": {"of": "case", "to": "air", "area": {"value": "0.05 [m^2]", "spread": "10 [%]"}, **coefficient}},
        "loads": {"heat": {"into": "case", "power": "1 [W]"}},
    }
    return td.model_from_dict(deck)


def bent(accuracy: float | None = None, priors: dict[str, str] | None = None) -> td.Calibration:
    """A constant coefficient fitted to readings of one that grows with dT^0.25."""
    times = np.linspace(0.0, 14400.0, 41)
    watts = np.where(times < 7200.0, 12.0, 3.0)
    given = td.Scenario("bench", {"air": "22 [degC]"}, start="22 [degC]", duration="4 [h]")
    truth = free_box({"htc": {"coefficient": "2 [W/(m^2 K)]", "exponent": 0.25}})
    run = td.simulate(truth, given.with_(commands={"heat": TableSignal(times, watts, True)}), times=times)
    reading = run["case"].kelvin + np.random.default_rng(5).normal(0.0, 0.03, 41)
    channels = {
        "T": td.Channel.from_array("T", reading, unit="K", role="node", target="case", noise=0.03, accuracy=accuracy),
        "air": td.Channel.from_array("air", np.full(41, 295.15), unit="K", role="boundary", target="air", accuracy=accuracy),
        "P": td.Channel.from_array("P", watts, quantity="power", role="load", target="heat", prompt=True),
    }
    deck = free_box({"htc": {"value": "5 [W/(m^2 K)]", "min": 1, "max": 30}, "carried_by": "free air"})
    record = td.Record.from_arrays("bench", times, channels, synthetic=True)
    return td.calibrate(deck, record, [HEAT, "skin.htc"], priors=priors)


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    """One whose specific heat is known well."""
    return bent(priors={HEAT: "range"})


def test_values_to_quote_are_those_that_the_model_of_error_expects(fit: td.Calibration) -> None:
    fitted, best = fit.values[HEAT], fit[HEAT]
    assert (best.value, best.error) == fit.expected[HEAT]
    assert abs(best.value - TRUE) < 2.0 * best.error < abs(fitted.value - TRUE)
    assert fit.estimates["skin.htc"].relative > 0.1  # what is fixed and known to 10 % counts
    line = next(x for x in str(fit).splitlines() if x.startswith(f"  {HEAT} "))
    assert abs(float(line.split()[1]) - best.value) < 0.1 * best.error
    assert "   (the curves have " in line
    shown = answer(fitted, {}, best)
    assert (shown["value"], shown["error"], shown["fitted"]) == (best.value, best.error, fitted.value)
    row = parameters(fit).rows[0]
    assert row[2].tip == repr(best.value)  # type: ignore[union-attr]
    said = calibration_object(fit)
    assert (said["values"][HEAT], said["errors_total"][HEAT]) == (best.value, best.error)
    assert said["fitted"][HEAT] == {"value": fitted.value, "error": fitted.error}
    (of_frame,) = [r for r in fit.to_frame().to_dict("records") if r["path"] == HEAT]
    assert (of_frame["value"], of_frame["error"], of_frame["fitted"]) == (best.value, best.error, fitted.value)
    for path, row_of in fit.covariance.items():
        assert row_of[path] == pytest.approx(fit[path].error ** 2, rel=1e-6)
    assert "as fitted" in repr(fit.values)
    assert "to quote" in repr(fit.estimates)
    plain = replace(fit, expected={})
    assert dict(plain.estimates) == dict(fit.values)
    assert "   fitted " not in str(plain)
    assert "fitted" not in answer(fitted, {}, fitted)


def test_a_fit_is_as_adequate_as_its_values_to_quote(fit: td.Calibration) -> None:
    """Its fitted specific heat is more than ten errors from its prior, and the remedy is said first."""
    assert fit.own.state == "credible"
    assert fit.verdict is None
    assert not fit.contradicted
    assert any("dT^0.2" in w and "= 0.25 } for 'skin'" in w for w in fit.warnings)
    assert not any(w.startswith("NOT CREDIBLE") for w in fit.warnings)
    for expected in ({}, fit.expected | {HEAT: (0.5 * TRUE, 1.0)}):
        far = replace(fit, expected=expected)
        assert [*far.contradicted] == [HEAT]
        assert far.blame == blame_of(fit.experiments)


def test_errors_of_instruments_are_those_that_the_model_of_error_expects() -> None:
    fit = bent(accuracy=0.1)
    names = ("sensor T", "air error")
    assert min(abs(fit.values[n].value) for n in names) > 1.0
    assert max(abs(fit[n].value) for n in names) < 0.3
    assert fit.own.state == "credible"
    assert "bias +2" not in str(fit)
