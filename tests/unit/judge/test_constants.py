"""Constants that decide a verdict of judge, each against its clause or formula: a tenth more or less is seen here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.errors import IdentificationError
from thermid.judge.correlation import correlate
from thermid.judge.criteria import CRITERIA, Deviation, Gate, judge
from thermid.judge.heaters import heater_duty
from thermid.judge.limits import Limits
from thermid.judge.margins import margins
from thermid.judge.overlay import Overlay
from thermid.prediction.foresight import foresee
from thermid.prediction.known import Known
from unit.qualify.things import soak, unit


def deviation(sensor: str, mean: float = 0.0, spread: float = 0.0, kind: str = "steady") -> Deviation:
    return Deviation("c", sensor, kind, 10, 300.0 + mean, 300.0, spread, mean, abs(mean), 0.3)


def gates(name: str, *found: Deviation, **more: Any) -> dict[str, Gate]:
    return {g.name: g for g in judge(replace(CRITERIA[name], **more), found, "here")}


class TestClauses:
    @pytest.mark.parametrize(("kelvin", "met"), [(1.95, True), (2.05, False)])
    def test_a_mean_of_two_kelvin(self, kelvin: float, met: bool) -> None:
        assert gates("ECSS", deviation("a", kelvin), deviation("b", kelvin))["mean"].met is met

    @pytest.mark.parametrize(("kelvin", "met"), [(2.95, True), (3.05, False)])
    def test_a_spread_of_three_kelvin(self, kelvin: float, met: bool) -> None:
        assert gates("ECSS", deviation("a", kelvin), deviation("b", -kelvin))["spread"].met is met

    @pytest.mark.parametrize(
        ("name", "kind", "limit"), [("ECSS", "steady", 5.0), ("MIL-HDBK-340", "steady", 3.0), ("MIL-HDBK-340, transient", "transient", 3.0)]
    )
    def test_every_sensor(self, name: str, kind: str, limit: float) -> None:
        """5 K by the practice for balance tests, 3 K by MIL-HDBK-340, 8.7.3."""
        for kelvin, met in ((limit - 0.05, True), (limit + 0.05, False)):
            assert gates(name, deviation("a", kelvin, kind=kind))["each"].met is met

    def test_the_spread_of_a_transient_counts_that_over_time(self) -> None:
        """Variances add: 1 K between sensors, 2 K over time in each."""
        found = gates("MIL-HDBK-340, transient", deviation("a", 1.0, 2.0, "transient"), deviation("b", -1.0, 2.0, "transient"), spread=3.0)
        assert found["spread"].found == pytest.approx(np.hypot(1.0, 2.0))
        steady = gates("ECSS", deviation("a", 1.0, 2.0), deviation("b", -1.0, 2.0))
        assert steady["spread"].found == pytest.approx(1.0)


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    times = np.arange(0.0, 6 * 3600.0, 120.0)
    run = td.simulate(unit().with_values({"out.conductance": "1.1 [W/K]"}), soak(25.0), times=times)
    rng = np.random.default_rng(4)
    made = {
        n: td.Channel.of(n, run[n].kelvin + 0.1 * rng.standard_normal(times.size), role="node", target=n, noise=0.1, accuracy=0.3)
        for n in ("proc", "ele", "plate")
    }
    return td.calibrate(unit(), td.Record.from_arrays("log", times, made), ["out.conductance"], scenario=soak(25.0))


def test_a_margin_of_another_level_has_that_quantile(fit: td.Calibration) -> None:
    """0.95 of a normal distribution lie within 1.96 standard deviations, 0.5 within 0.674; the instant is the tightest by the former."""
    seen = foresee(Known.of(fit), soak(55.0))
    limit = Limits("processor", "proc", (253.15, 343.15), loads=("cpu",))
    hot = margins({"hot": seen}, [limit])[1]
    at = int(np.argmax(seen.prediction["proc"].kelvin + 1.959964 * seen.prediction["proc"].error))
    assert hot.time == seen.prediction.times[at]
    half = replace(hot, policy=replace(hot.policy, level=0.5))
    assert half.uncertainty == pytest.approx(0.6744898 * hot.error)
    assert half.bought == pytest.approx(0.6744898 * (hot.before - hot.error))
    assert hot.error == pytest.approx(seen.prediction["proc"].error[at], rel=1e-6)


def test_a_heater_is_judged_by_the_second_half_of_its_run() -> None:
    """1 W in the first half, then 3 W of 4 W."""
    times = np.linspace(0.0, 6 * 3600.0, 361)
    solution = SimpleNamespace(times=times, load_powers={"cpu": np.where(times < 3 * 3600.0, 1.0, 3.0)}, title="run")
    told = heater_duty(SimpleNamespace(solution=solution, scenario=SimpleNamespace(title="run")), "cpu", 4.0)  # type: ignore[arg-type]
    assert told.window == (3 * 3600.0, 6 * 3600.0)
    assert told.duty == pytest.approx(0.75)


@pytest.mark.parametrize(("late", "covered"), [(1.95, True), (2.05, False)])
def test_readings_may_begin_two_intervals_after_a_settled_stretch(late: float, covered: bool) -> None:
    times = np.arange(0.0, 7200.1, 60.0)
    seen = [Overlay("hot", "T", "", times, np.full(times.size, 300.1), np.full(times.size, 300.0), 0.3)]
    settled = {"hot": [(-60.0 * late, 7200.0)]}
    if covered:
        assert correlate(seen, ["ECSS"], steady=settled).passed("ECSS")
    else:
        with pytest.raises(IdentificationError, match="has readings of 'T'"):
            correlate(seen, ["ECSS"], steady=settled)
