"""Steady points in a fit, and the heat balance of a measured case."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError
from unit.fit.bench import HTC, MASS, box, log, metered, pair

TRUE = {HTC: "5 [W/(m^2 K)]"}
JOINT = "stack.contact_conductance"


def bench(seed: int = 1, hours: float = 6.0) -> td.Record:
    data = log(box(), TRUE, {"T": "case"}, samples=361, hours=hours, noise=0.05, accuracy=0.3, swing=0.0, seed=seed)
    return metered(data, "heat", 4.0, accuracy=0.05)


class TestPoint:
    def test_alone_gives_the_coefficient_and_its_error(self) -> None:
        point = bench().steady("5 [h]", "end", tau=5400.0)
        fit = td.calibrate(box(), point.record, [HTC], scenario=td.Scenario("s", start="steady"))
        assert point["ROOM"].error == 0.0  # a room that never moved was set: the rounding of its mean is no error
        rise = point["T"].value - point["ROOM"].value
        assert fit[HTC].value == pytest.approx(4.0 / (0.05 * rise), rel=1e-6)
        error = np.hypot(np.hypot(point["T"].error, 0.3) / rise, 0.05 / 4.0)
        assert fit[HTC].error / fit[HTC].value == pytest.approx(error, rel=0.01)

    def test_beside_a_transient(self) -> None:
        early, point = bench().trim("start", "1 [h]"), bench().steady("5 [h]", "end", tau=5400.0).record
        alone = td.calibrate(box(), early, [HTC, MASS])
        both = td.calibrate(box(), [early, point], [HTC, MASS], scenario={point.name: td.Scenario("s", start="steady")})
        # an hour of a slow box leaves its loss open, one settled point does not
        assert both[HTC].error_random < 0.4 * alone[HTC].error_random
        assert abs(both[HTC].value - 5.0) < 3 * both[HTC].error
        assert both.chi_square < 1.5 * both.freedom


class TestBalance:
    def test_closes_with_the_right_model(self) -> None:
        found = td.inference.energy_balance(box().with_values(TRUE), bench(), "5 [h]", "end")
        assert found.closes
        assert found.loads == {"heat": 4.0}
        assert sum(found.loads.values()) - sum(found.boundaries.values()) - sum(found.stored.values()) == pytest.approx(found.total)
        # G times the sensor's 0.3 K, and the meter's 0.05 W; the drift is a small part
        assert found.error == pytest.approx(np.hypot(0.25 * 0.3, 0.05), rel=0.35)

    def test_a_mount_that_the_model_lacks_is_missed_in_watts(self) -> None:
        held = td.inference.energy_balance(box({"surfaces/skin/effective_htc": "3.5 [W/(m^2 K)]"}), bench(hours=10), "9 [h]", "end")
        assert not held.closes
        assert held.total == pytest.approx(4.0 * (1 - 3.5 / 5.0), abs=2 * held.error)
        assert held.total > 0.0
        over = td.inference.energy_balance(box({"surfaces/skin/effective_htc": "8 [W/(m^2 K)]"}), bench(hours=10), "9 [h]", "end")
        assert over.total < 0.0
        assert str(held).splitlines()[-1] != str(over).splitlines()[-1], "what leaves unseen, or comes from what the model lacks"

    def test_of_a_fit_and_of_a_node_that_was_not_measured(self) -> None:
        model = pair(second=box({"parameters/power/value": "1 [W]", "title": "Cool"}))
        data = log(model, {JOINT: "100 [W/(m^2 K)]"}, {"A": "a.case", "B": "b.case"}, boundary="room", hours=8, samples=481, swing=0.0)
        fit = td.calibrate(model, data, [JOINT])
        found = td.inference.energy_balance(fit, data, "7 [h]", "end")
        assert found.calculated == ("mid",)
        assert set(found.unexplained) == {"a.case", "b.case"}
        assert found.closes
        assert re.search(r"\n  [^\n]*: mid\b", str(found))
        crossing = 0.5 * 100 * 20e-4 * (found.temperatures["a.case"] - found.temperatures["b.case"])
        assert found.boundaries["a.skin"] + crossing == pytest.approx(4.0 - found.stored["a.case"], abs=0.1)

    def test_a_case_that_is_not_settled(self) -> None:
        with raises_code("record.not-steady", RecordError):
            td.inference.energy_balance(box(), bench(), "1 [h]", "2 [h]")


class TestNoise:
    def test_the_errors_of_a_mean_power_and_a_mean_ambient_reach_the_fit(self) -> None:
        """A noisy meter and a noisy room: their means are not exact, whatever the readings on the box."""
        rng, data = np.random.default_rng(7), bench()
        still = data.with_channels(replace(data["T"], accuracy=None), replace(data["METER"], accuracy=None, prompt=True))
        watts = replace(still["METER"], values=still["METER"].values + 0.5 * rng.standard_normal(361))
        noisy = still.with_channels(watts)
        quiet, loud = (r.steady("5 [h]", "end", tau=5400.0) for r in (still, noisy))
        fits = [td.calibrate(box(), p.record, [HTC], scenario=td.Scenario("s", start="steady")) for p in (quiet, loud)]
        plain, more = (f[HTC].error / f[HTC].value for f in fits)
        assert more == pytest.approx(np.hypot(plain, loud["METER"].error / 4.0), rel=0.1)
        assert more > 2.0 * plain
        assert any("error of the mean of heat" in v.name for v in fits[1].local)
        assert not fits[1].clocks

    def test_a_balance_counts_the_errors_of_a_fit(self) -> None:
        data = bench(hours=10)
        fit = td.calibrate(box(), bench(seed=2, hours=2.0), [HTC, MASS])
        alone = td.inference.energy_balance(fit.model, data, "9 [h]", "end")
        found = td.inference.energy_balance(fit, data, "9 [h]", "end")
        assert found.total == pytest.approx(alone.total, abs=1e-6)
        rise = data.steady("9 [h]", "end")["T"].value - data.steady("9 [h]", "end")["ROOM"].value
        assert found.error == pytest.approx(np.hypot(alone.error, 0.05 * rise * fit[HTC].error), rel=0.05)
