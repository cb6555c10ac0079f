"""Constants that decide whether a log covers its test, each against the figure that it stands for: a tenth more or less is seen here."""

from __future__ import annotations

from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest

import thermid as td
from thermid.campaign.stages import Overlay
from thermid.prediction.bands import Knowledge, foresee
from thermid.qualify._plan_schema import TestTable as Planned, ValidityTable
from thermid.qualify._programme import assumed_half_width
from thermid.qualify._trial import exchanged_sensors, extrapolations, levels_not_applied, settled_windows, uncovered_parts
from unit.qualify.things import soak, unit

HOUR = 3600.0


def overlay(times: np.ndarray, name: str = "T", measured: float = 300.0, simulated: float = 300.0) -> Overlay:
    return Overlay("hot", name, "", times, np.full(times.size, measured), np.full(times.size, simulated), 0.3)


def without(begin: float, end: float, step: float = 10.0) -> np.ndarray:
    """Times of ten hours without those between two instants."""
    times = np.arange(0.0, 10 * HOUR + 1.0, step)
    return times[(times <= begin) | (times >= end)]


class TestCoverage:
    @pytest.mark.parametrize(("share", "said"), [(0.0195, False), (0.0205, True)])
    def test_two_per_cent_of_a_test_may_be_missing(self, share: float, said: bool) -> None:
        times = without(HOUR, HOUR + share * 10 * HOUR)
        assert bool([*uncovered_parts([overlay(times)], 0.0, 10 * HOUR)]) is said

    @pytest.mark.parametrize(("share", "said"), [(0.097, False), (0.103, True)])
    def test_nine_tenths_of_a_settled_stretch_must_be_there(self, share: float, said: bool) -> None:
        times = without(HOUR, HOUR + share * HOUR)
        assert bool([*uncovered_parts([overlay(times)], 0.0, 10 * HOUR, [(0.5 * HOUR, 1.5 * HOUR)])]) is said

    @pytest.mark.parametrize(("pause", "said"), [(48.0, False), (52.0, True)])
    def test_a_pause_of_five_intervals_is_a_gap(self, pause: float, said: bool) -> None:
        """Every third of the readings follows a pause, so that pauses are a large part of the time."""
        times = np.cumsum(np.tile([10.0, 10.0, pause], 200))
        assert bool([*uncovered_parts([overlay(times)], float(times[0]), float(times[-1]))]) is said


class TestLevels:
    """A planned level of 70 degC for one hour of three, and what a log shows of it."""

    def told(self, kelvin: float, share: float) -> list[str]:
        times = np.arange(0.0, 3 * HOUR + 1.0, 10.0)
        planned = np.where((times > HOUR) & (times <= 2 * HOUR), 343.15, 293.15)
        shown = np.where((times > HOUR) & (times <= HOUR * (1.0 + share)), 343.15 + kelvin, 293.15)
        record = td.Record.from_arrays("log", times, {"AIR": td.Channel.from_array("AIR", shown, unit="K", role="boundary", target="air")})
        run = {"air": SimpleNamespace(times=times, kelvin=planned)}
        return [*levels_not_applied(record, run, {"AIR": "air"})]  # type: ignore[arg-type]

    @pytest.mark.parametrize(("kelvin", "said"), [(-2.9, False), (-3.1, True)])
    def test_within_three_kelvin(self, kelvin: float, said: bool) -> None:
        """SMC-S-016, 4.7: chamber temperatures to +-3 K."""
        assert bool(self.told(kelvin, 1.0)) is said

    @pytest.mark.parametrize(("share", "said"), [(0.92, False), (0.88, True)])
    def test_for_nine_tenths_of_its_time(self, share: float, said: bool) -> None:
        assert bool(self.told(0.0, share)) is said


class TestExchanged:
    def pair(self, own: float, other: float) -> list[Overlay]:
        """Two sensors that lie, RMS of both, `own` from the model and `other` with their columns changed over."""
        times = np.arange(10.0)
        # measured a, b; simulated 0 and d: own^2 = a^2 + (b - d)^2, other^2 = (a - d)^2 + b^2
        d = (own + other) / np.sqrt(2.0)
        a = own / np.sqrt(2.0)
        return [overlay(times, "A", 300.0 + a, 300.0), overlay(times, "B", 300.0 + d - a, 300.0 + d)]

    @pytest.mark.parametrize(("own", "other", "said"), [(1.05, 0.1, True), (0.95, 0.1, False), (3.0, 0.97, True), (3.0, 1.03, False)])
    def test_a_kelvin_off_and_three_times_nearer(self, own: float, other: float, said: bool) -> None:
        assert bool([*exchanged_sensors(self.pair(own, other))]) is said


class TestValidity:
    """Conditions of the calibration hold with what rounding needs: half a tenth of a kelvin, a thousandth of pressure and power."""

    def told(self, **validity: list[str]) -> str:
        run = foresee(Knowledge.of_source(unit()), soak(40.0))
        return "; ".join(extrapolations(Planned(name="hot", kind="other"), run, ValidityTable(**validity), ["proc"]))  # type: ignore[arg-type]

    @pytest.mark.parametrize(("beyond", "said"), [(0.047, False), (0.053, True)])
    def test_temperatures(self, beyond: float, said: bool) -> None:
        seen = foresee(Knowledge.of_source(unit()), soak(40.0)).prediction["proc"].celsius
        for low, high in ((seen.min() + beyond, 90.0), (-10.0, seen.max() - beyond)):
            assert ("; temperature" in self.told(temperature=[f"{low:.6f} [degC]", f"{high:.6f} [degC]"])) is said

    @pytest.mark.parametrize(("share", "said"), [(0.00095, False), (0.00105, True)])
    def test_power(self, share: float, said: bool) -> None:
        """9 W in all."""
        for low, high in ((9.0 + share * 12.0, 12.0), (0.0, 9.0 / (1.0 + share))):
            assert ("; power 9" in self.told(power=[f"{low!r} [W]", f"{high!r} [W]"])) is said

    @pytest.mark.parametrize(("share", "said"), [(0.00095, False), (0.00105, True)])
    def test_pressure(self, share: float, said: bool) -> None:
        for low, high in ((101325.0 / (1.0 - share), 2e5), (1e3, 101325.0 / (1.0 + share))):
            assert ("; pressure 1" in self.told(pressure=[f"{low!r} [Pa]", f"{high!r} [Pa]"])) is said


def test_assumed_values_add_up_to_their_95_per_cent() -> None:
    """Independent of one another: the root of the sum of squares, times 1.96."""
    one = SimpleNamespace(effect=0.3, point="p", run="r", fitted_around=False, path="a.b")
    other = SimpleNamespace(effect=0.4, point="p", run="r", fitted_around=False, path="c.d")
    assert assumed_half_width([one, other], "p", "r", ()) == pytest.approx(NormalDist().inv_cdf(0.975) * 0.5)  # type: ignore[list-item]


@pytest.mark.parametrize("hours", [1.0, 4.0])
def test_a_stay_is_settled_in_its_last_quarter_or_half_an_hour(hours: float) -> None:
    """The longer of the two, for stays of an hour and more."""
    stay = SimpleNamespace(kind="stay", duration=hours * HOUR, end=10 * HOUR)
    short = SimpleNamespace(kind="stay", duration=0.98 * HOUR, end=5 * HOUR)
    still = SimpleNamespace(at=lambda window: np.array([300.0, 300.0]))
    trial = SimpleNamespace(
        test=SimpleNamespace(stable="IEC 60068-5-2"),
        course=SimpleNamespace(phases=[short, stay]),
        foresight=SimpleNamespace(solution={"n": still}),
    )
    trial.test.stable = Planned(name="hot", kind="other").stable
    (window,) = settled_windows(trial, ["n"], 20 * HOUR)  # type: ignore[arg-type]
    assert window == (10 * HOUR - max(0.25 * hours, 0.5) * HOUR, 10 * HOUR)
