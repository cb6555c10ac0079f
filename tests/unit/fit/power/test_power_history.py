"""What is refused before a history is looked for."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError
from thermid.fit._power.history import Pins, _likeliest
from thermid.model.tree import TableSignal
from unit.fit.bench import HTC, MASS, box, log, metered


def test_a_power_that_is_logged_is_not_looked_for() -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=21)
    with raises_code("value.without-effect", IdentificationError):
        td.inference.power_history(box(), metered(data, "heat", 5.0), "heat")


@pytest.mark.parametrize("known", [("0 [h]", "1 [h]", "5 [W]"), [("0 [h]", "5 [W]")]])
def test_a_stretch_has_three_parts(known: Any) -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=21)
    with raises_code("value.wrong-kind", IdentificationError, match="'known'"):
        td.inference.power_history(box(), data, "heat", known=known)


def rising(every: str = "") -> td.inference.PowerHistory:
    """A power that rises within minutes, from a box whose deck is right."""
    times = np.linspace(0.0, 18000.0, 301)
    power = 2.0 + 3.0 / (1.0 + np.exp(-(times - 6000.0) / 300.0))
    data = log(box(), {}, {"T": "case"}, loads={"heat": TableSignal(times, power)}, noise=0.03, seed=4)
    return td.inference.power_history(box(), data, "heat", every=every)


def test_knots_lie_as_close_as_by_default_or_closer() -> None:
    """Knots every 30 min leave residuals that wander, and bands of knots every 15 min held 86 % of the means over as long."""
    found, fine = rising("30 [min]"), rising()
    assert np.array_equal(found.power, fine.power)
    assert fine.warnings == ()


def test_unknowns_that_nothing_determines_are_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    data = log(box(), {}, {"T": "case"}, noise=0.05, seed=4)

    def singular(*_: Any, **__: Any) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("thermid.fit._power.history.solved", singular)
    with raises_code("fit.not-determined", IdentificationError, match=r".case\.mass."):
        td.inference.power_history(box(), data, "heat", free=[MASS], known=[("0 [s]", "1 [h]", "4 [W]")])


@pytest.mark.parametrize("at", ["24 [degC]", "30 [degC]"])
def test_a_period_of_six_time_constants_tells_the_values_of_the_box(at: str) -> None:
    """At the start nothing is heated, and a conductance between two equal temperatures changes nothing: no reason to refuse the period."""
    steady = {"loads/heat/power": "1 [W]"}
    air = td.Scenario("bench", boundaries={"air": at}, start=at, duration="9 [h]")
    times = np.linspace(0.0, 32400.0, 181)
    truth = TableSignal(times, np.where(times < 24300.0, 4.0, 5.0), hold=True)
    run = td.simulate(box().with_values({MASS: "1.35 [kg]", HTC: "5 [W/(m^2 K)]"}), air.with_(loads={"heat": truth}), times=times)
    seen = run["case"].kelvin + 0.03 * np.random.default_rng(6).standard_normal(times.size)
    record = td.Record.from_arrays(
        "bench", times, {"T": td.Channel.from_array("T", seen, unit="K", role="node", target="case", noise=0.03)}
    )
    known = [("0 [s]", "24300 [s]", "4 [W]")]
    found = td.inference.power_history(box(steady), record, "heat", scenario=air, known=known, free=[MASS, HTC], every="15 [min]")
    for path, truth_of in ((MASS, 1.35), (HTC, 5.0)):
        value, error, _ = found.values[path]
        assert abs(value - truth_of) < 3.0 * error < 0.1 * truth_of, path


def _exact(matrix: Any, right: Any) -> tuple[float, list[Fraction]]:
    """Return ln of the determinant and the solution of a positive definite system, by elimination in fractions."""
    rows, logs = [[*row, r] for row, r in zip(matrix, right, strict=True)], 0.0
    for k, pivot in enumerate(rows):
        logs += math.log(pivot[k].numerator) - math.log(pivot[k].denominator)
        for j, row in enumerate(rows):
            if j != k and row[k]:
                factor = row[k] / pivot[k]
                rows[j] = [a - factor * b for a, b in zip(row, pivot, strict=True)]
    return logs, [row[-1] / row[k] for k, row in enumerate(rows)]


@pytest.mark.parametrize(("prior", "order"), [("walk", 1), ("integrated walk", 2)])
@pytest.mark.parametrize("strength", [-6.0, 3.0, 12.0])
def test_the_evidence_keeps_its_digits_over_all_strengths(prior: str, order: int, strength: float) -> None:
    """Against fractions: a stiff prior must not turn rounding errors into evidence (6 units of it, once, at a strength of 1e12)."""
    rng, count, base = np.random.default_rng(3), 7, 40.0
    knots = 256.0 * np.arange(count)  # a power of two to the power of 1/2 and 3/2: exact in floating point
    rows, far = (np.asarray(m, dtype=np.float64) for m in (rng.normal(size=(30, count + 1)), 1e2 * rng.normal(size=30)))
    pins = Pins(np.empty(0, int), np.empty(0), np.empty(0), np.array([0, count]))
    value, _, z, covariance, _ = _likeliest([(rows, far)], np.zeros(count + 1), knots, pins, base, prior, np.array([strength]))

    exact = np.vectorize(Fraction, otypes=[object])
    a, g = exact(rows), exact(far)
    rough = (lambda d: d.T @ d)(exact(np.diff(np.eye(count), n=order, axis=0) / 256.0 ** (order - 0.5)))
    scale = np.trace((a.T @ a)[1:, 1:]) / np.trace(rough) * Fraction(10.0**strength)
    smooth = scale * rough + exact(np.eye(count)) / Fraction(base) ** 2
    whole, right = a.T @ a, a.T @ g
    whole[1:, 1:] += smooth
    own, (logs, solved) = _exact(smooth, exact(np.zeros(count)))[0], _exact(whole, right)
    square = float(g @ g - right @ np.array(solved))
    assert value == pytest.approx(0.5 * (own - logs - square), rel=1e-9)
    assert z == pytest.approx([float(x) for x in solved], rel=1e-7, abs=1e-7)
    assert covariance == pytest.approx(covariance.T)
