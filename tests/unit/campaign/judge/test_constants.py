"""Constants that decide a verdict of judge, each against its clause or formula: a tenth more or less is seen here."""

from __future__ import annotations

import inspect
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError, ScenarioError
from thermid.campaign._judge.correlation import Overlay, correlate
from thermid.campaign._judge.limits import POLICIES, Limits, fixed_margin, heater_duty, margins
from thermid.campaign._judge.verdict import METRICS, Criteria, Residuals
from thermid.prediction.bands import Knowledge, foresee
from unit.qualify.things import soak, unit

TIMES = np.arange(0.0, 7200.1, 60.0)
SETTLED = {"hot": [(0.0, 7200.0)]}

_duty = inspect.unwrap(heater_duty)  # what it reads of a run, without asking for a whole one


def seen(*shifts: float, swing: float = 0.0) -> list[Overlay]:
    """Sensors that read so much more than is simulated, and swing about that."""
    wave = swing * np.where(np.arange(TIMES.size) % 2, 1.0, -1.0)
    return [Overlay("hot", f"T{k}", "", TIMES, 300.0 + shift + wave, np.full(TIMES.size, 300.0), 0.3) for k, shift in enumerate(shifts)]


class TestClauses:
    """2 K of the mean, 3 K of spread and 5 K of every sensor by the practice for balance tests; 3 K by MIL-HDBK-340, 8.7.3."""

    @pytest.mark.parametrize(
        ("name", "within", "beyond"),
        [
            ("ECSS", (1.95, 1.95), (2.05, 2.05)),
            ("ECSS", (2.95, -2.95), (3.05, -3.05)),
            ("ECSS", (4.9, 0.0, 0.0, 0.0), (5.1, 0.0, 0.0, 0.0)),
            ("MIL-HDBK-340", (2.95, 0.0), (3.05, 0.0)),
            ("MIL-HDBK-340, transient", (2.95, 0.0), (3.05, 0.0)),
        ],
    )
    def test_limits(self, name: str, within: tuple[float, ...], beyond: tuple[float, ...]) -> None:
        assert correlate(seen(*within), [name], steady=SETTLED).passed(name) is True
        assert correlate(seen(*beyond), [name], steady=SETTLED).passed(name) is False

    def test_the_spread_of_a_transient_counts_that_over_time(self) -> None:
        """Variances add: 1 K between sensors, 2 K over time in each. A settled case is judged by means, and those spread by 1 K."""
        sizes = {}
        for kind in ("steady", "transient"):
            criteria = Criteria("own", spread="3 [K]", kinds=(kind,))
            (gate,) = correlate(seen(1.0, -1.0, swing=2.0), [criteria], steady=SETTLED).gates
            sizes[kind] = gate.found
        assert sizes["transient"] == pytest.approx(np.hypot(1.0, 2.0), rel=1e-3)
        assert sizes["steady"] == pytest.approx(1.0, rel=0.02)


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    times = np.arange(0.0, 6 * 3600.0, 120.0)
    run = td.simulate(unit().with_values({"out.conductance": "1.1 [W/K]"}), soak(25.0), times=times)
    rng = np.random.default_rng(4)
    made = {
        n: td.Channel.from_array(
            n, run[n].kelvin + 0.1 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.1, accuracy=0.3
        )
        for n in ("proc", "ele", "plate")
    }
    return td.calibrate(unit(), td.Record.from_arrays("log", times, made), ["out.conductance"], scenario=soak(25.0))


@pytest.mark.parametrize("level", [0.5, 0.95, 0.997])
def test_a_margin_counts_to_the_end_of_the_band_of_its_level(fit: td.Calibration, level: float) -> None:
    """The prediction is a mixture: where a way in a hundred, in which elements depart, is ten times as wide as the others, no multiple of
    its 95 % interval is that of another level, and its ends need not lie as far from its centre.
    """
    run = foresee(Knowledge.of_source(fit), soak(55.0))
    limit = Limits("processor", "proc", td.quantity((253.15, 343.15), unit="K"), loads=("cpu",))
    hot = margins({"hot": run}, [limit], replace(POLICIES["SMC-S-016"], level=level))[1]
    high = run.prediction["proc"].interval(level)[1] + 273.15
    assert hot.time == run.prediction.times[int(np.argmax(high))]
    assert hot.predicted + hot.uncertainty == pytest.approx(float(high.max()), abs=1e-9)


def test_a_heater_is_judged_by_the_second_half_of_its_run() -> None:
    """1 W in the first half, then 3 W of 4 W."""
    times = np.linspace(0.0, 6 * 3600.0, 361)
    solution = SimpleNamespace(times=times, load_powers={"cpu": np.where(times < 3 * 3600.0, 1.0, 3.0)}, title="run")
    told = _duty(SimpleNamespace(solution=solution, scenario=SimpleNamespace(title="run")), "cpu", 4.0)
    assert told.window == (3 * 3600.0, 6 * 3600.0)
    assert told.duty == pytest.approx(0.75)


@pytest.mark.parametrize(("late", "covered"), [(1.95, True), (2.05, False)])
def test_readings_may_begin_two_intervals_after_a_settled_stretch(late: float, covered: bool) -> None:
    settled = {"hot": [(-60.0 * late, 7200.0)]}
    if covered:
        assert correlate(seen(0.1), ["ECSS"], steady=settled).passed("ECSS")
    else:
        with raises_code("record.nothing-there", IdentificationError, match="'T0'"):
            correlate(seen(0.1), ["ECSS"], steady=settled)


@pytest.mark.parametrize("step", range(10))
def test_the_fixed_margin_shrinks_by_a_kelvin_every_32_fahrenheit(step: int) -> None:
    """SMC-S-016, Table 4.4-2: 11 K down to -70 degC, and a kelvin less for every 17.9 K below."""
    edge = 273.15 - 70.0 - 17.9 * step
    assert fixed_margin(edge + 1.0, True).value == 11.0 - step
    assert fixed_margin(edge - 1.0, True).value == (10.0 - step if step < 9 else 1.0)


def test_a_model_that_no_balance_test_correlated_needs_17_kelvin() -> None:
    """SMC-S-016, 4.4.2.1: 11 K and the 6 K that a balance test is worth."""
    assert fixed_margin(300.0, False).value - fixed_margin(300.0, True).value == 6.0


def test_a_window_of_two_stored_times_is_enough_for_a_duty() -> None:
    solution = SimpleNamespace(times=np.array([0.0, 60.0, 120.0]), load_powers={"cpu": np.array([1.0, 2.0, 4.0])}, title="run")
    run: Any = SimpleNamespace(solution=solution, scenario=SimpleNamespace(title="run"))
    assert _duty(run, "cpu", 4.0, window=(50.0, 130.0)).duty == pytest.approx(0.75)
    with raises_code("record.too-short", ScenarioError):
        _duty(run, "cpu", 4.0, window=(70.0, 130.0))


def test_the_final_error_is_the_mean_over_the_last_twentieth() -> None:
    times = np.arange(0.0, 10001.0)
    for begins, expected in ((9480.0, 1.0), (9520.0, 481.0 / 501.0)):
        found = Residuals(times, np.where(times >= begins, 1.0, 0.0), np.full(times.size, 1.0 / times.size))
        assert METRICS["final"].of(found) == pytest.approx(expected)


def test_a_steady_period_is_read_in_any_unit_and_refused_where_it_is_none() -> None:
    (case, [(begin, end)]) = next(iter(SETTLED.items()))
    texts = {case: [(f"{begin / 60.0!r} [min]", f"{end / 60.0!r} [min]")]}
    assert correlate(seen(0.1), ["ECSS"], steady=texts).to_dict() == correlate(seen(0.1), ["ECSS"], steady=SETTLED).to_dict()
    with raises_code("value.wrong-kind"):
        correlate(seen(0.1), ["ECSS"], steady={case: [5.0]})
    with raises_code("value.not-an-amount"):
        correlate(seen(0.1), ["ECSS"], steady={case: [(None, 5.0)]})
