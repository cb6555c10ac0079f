"""Times at which a run is stored: intervals that divide the duration but for rounding, and those that do not."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from thermid.simulation._scenarios.scenario import Scenario
from thermid.simulation._simulator import output_times


@pytest.mark.parametrize(
    ("duration", "step"), [(0.3, 0.1), (10800.0, 10800.0 / 7), (3.0 * 1.1, 1.1), (7200.0, 7200.0 / 49), (1e6, 1e6 / 997)]
)
def test_an_interval_that_divides_the_duration_ends_with_it(duration: float, step: float) -> None:
    times = output_times(Scenario("s", duration=duration), step, None)
    assert times[-1] == duration
    assert (np.diff(times) > 0.5 * step).all()
    assert output_times(Scenario("s", duration=duration), None, times) is not None


@pytest.mark.parametrize("ulps", [-3, -2, -1, 0, 1, 2, 3])
def test_neighbours_of_a_duration_in_floating_point(ulps: int) -> None:
    end = 5400.0
    for _ in range(abs(ulps)):
        end = float(np.nextafter(end, np.inf if ulps > 0 else 0.0))
    times = output_times(Scenario("s", duration=end), 0.9, None)
    assert (times.size, times[-1]) == (6001, end)


def test_the_end_is_kept_beside_an_interval_that_does_not_divide_it() -> None:
    assert output_times(Scenario("s", duration=10.0), 4.0, None).tolist() == [0.0, 4.0, 8.0, 10.0]
    assert output_times(Scenario("s", duration=10.0), 40.0, None).tolist() == [0.0, 10.0]


def test_a_thermostat_saw_the_boundaries_of_the_start_until_the_first_output() -> None:
    """With times that begin late it switched on at 3016 s in place of 1025 s: 0.0 for 12.5 degC, without a word."""
    links = {"in": (["core", "skin"], "0.5 [W/K]"), "out": (["skin", "air"], "2 [W/K]")}
    stat = {"sensor": "skin", "on_below": "10 [degC]", "off_above": "15 [degC]"}
    deck = {
        "title": "late",
        "needs": ["air"],
        "nodes": {"core": {"capacitance": "50 [J/K]"}, "skin": {}},
        "conductors": {n: {"kind": "conduction", "between": e, "conductance": g} for n, (e, g) in links.items()},
        "loads": {"heater": {"into": "core", "power": "5 [W]", "thermostat": stat}},
    }
    air = {"times": ["0 [s]", "2000 [s]", "4000 [s]"], "values": ["20 [degC]", "0 [degC]", "0 [degC]"]}
    cooling = td.Scenario(boundaries={"air": air}, start="20 [degC]", duration="4000 [s]")
    for extremes in (True, False):
        options = td.Options(extremes=extremes)
        runs = [td.simulate(td.model_from_dict(deck), cooling, times=np.array(t), options=options) for t in ([0.0, 3e3], [3e3])]
        assert runs[0]["core"].final == pytest.approx(runs[1]["core"].final, abs=1e-6)
        first, second = (run.statistics["switchings"][0][0] for run in runs)
        assert first == pytest.approx(second, abs=1e-6)
        assert runs[1]["core"].final > 12.4
