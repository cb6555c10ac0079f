"""Random trouble: never a crash, never a silent wrong answer. `scripts/fuzz.py` runs as long as one likes."""

from __future__ import annotations

import numpy as np
import pytest

from fuzz import crooked, exact
from fuzz.contestants import CONTESTANTS, Outcome
from fuzz.judge import Verdicts, _fault, judge, truth
from fuzz.networks import FAMILIES, Case, draw
from thermid import _kernel as k
from unit.kernel.reference import THERMOSTAT, Net

QUICK, LONG = 2, 300


@pytest.mark.properties
@pytest.mark.parametrize("effort", ["quick", pytest.param("campaign", marks=pytest.mark.campaign)])
@pytest.mark.parametrize("family", FAMILIES)
def test_every_answer_is_right_or_says_what_failed(family: str, effort: str) -> None:
    place, verdicts = list(FAMILIES).index(family), Verdicts()
    begin, count = (0, QUICK) if effort == "quick" else (QUICK, LONG)
    for number in range(begin, begin + count):
        judge(number * len(FAMILIES) + place, verdicts)
    print(verdicts.table())
    assert verdicts.findings == []
    answered = sum(n for (_, _, how), n in verdicts.counts.items() if how.startswith("OK") and "nobody" not in how)
    assert answered >= count  # the oracles know enough of each family for this test to mean something


def chain() -> Net:
    net = Net()
    a, b = net.node(500.0, 320.0), net.node(800.0, 290.0)
    mid = net.node(None, 300.0)
    air = net.boundary(gain=net.coef(1.0, net.input(k.SAMPLED_LINEAR, [0.0, 400.0, 1000.0], [293.0, 303.0, 298.0])))
    net.link(k.LINEAR, a, mid, net.coef(0.8))
    net.link(k.LINEAR, mid, b, net.coef(1.2))
    net.link(k.LINEAR, mid, air, net.coef(0.3))
    net.link(k.LINEAR, b, air, net.coef(0.2))
    net.load(k.SIGNAL, a, net.coef(1.0, net.input(k.SAMPLED_HOLD, [0.0, 600.0], [5.0, 0.0])))
    return net


def test_the_oracles_agree_with_each_other() -> None:
    times = np.linspace(0.0, 1500.0, 31)
    assert np.abs(exact.solve(chain(), times) - crooked.solve(chain(), times)).max() < 1e-6


def test_the_oracle_switches_where_its_sensor_jumps_past_a_threshold() -> None:
    """Seed 158: a sensor without capacitance steps with its room past the threshold, so that no zero of the distance is crossed."""
    net, rooms, steps = Net(), [290.0, 279.0, 290.0, 279.0], [0.0, 100.0, 250.0, 400.0]
    heavy, sensor = net.node(500.0, 300.0), net.node(None, 300.0)
    room = net.boundary(gain=net.coef(1.0, net.input(k.SAMPLED_HOLD, steps, rooms)))
    net.link(k.LINEAR, heavy, room, net.coef(0.5))
    net.link(k.LINEAR, sensor, room, net.coef(0.5))
    net.load(THERMOSTAT, heavy, net.coef(2.0), net.coef(281.0), net.coef(283.0), sensor=sensor)
    times = np.linspace(0.0, 500.0, 51)
    warm = [300.0]
    for t in times[:-1]:  # every step of the room is a time of output
        balance = 279.0 + 2.0 / 0.5 if 100.0 <= t < 250.0 or t >= 400.0 else 290.0
        warm.append(balance + (warm[-1] - balance) * float(np.exp(-(times[1] - times[0]) * 0.5 / 500.0)))
    assert np.abs(crooked.solve(net, times)[:, 0] - warm).max() < 1e-5
    case = Case(0, "switching", net, times, {"max_steps": 20_000})
    assert not _fault(case, "kernel", CONTESTANTS["kernel"](case), "crooked", crooked.solve(net, times))


@pytest.mark.campaign
def test_a_massless_node_may_rest_in_any_stable_balance() -> None:
    """Seed 60022: a conductance that falls with temperature leaves 373.8 and 430.5 K, both stable; 416.6 K is a balance that is not."""
    case = draw(60022, "stiff")
    knows, real = truth(case)
    assert real is not None
    found = CONTESTANTS["kernel"](case)
    assert found.traces is not None
    assert abs(float(found.traces.reshape(real.shape)[2, 4]) - real[2, 4]) > 50.0
    assert not _fault(case, "kernel", found, knows, real)
    wrong = found.traces.reshape(real.shape).copy()
    wrong[2, 4] = 416.6
    assert "K off" in _fault(case, "kernel", Outcome("OK", wrong), knows, real)


def test_an_absurd_sample_costs_the_others_no_digits() -> None:
    """Seed 70258: -1e308 K after the end of the run once took the level of all samples with it; one way refused, another was 162 K off."""
    net = chain()
    for sample in (-1e308, 1e17):
        net.inputs[0] = (k.SAMPLED_LINEAR, np.array([-10.0, 0.0, 400.0, 1000.0, 1100.0]), np.array([sample, 293.0, 303.0, 298.0, -sample]))
        far = Case(0, "plain", net, np.linspace(0.0, 900.0, 7), {"max_steps": 20_000}, benign=True)
        real = exact.solve(net, far.times)
        for who in ("kernel", "tight", "sensitive", "lanes", "scalar"):
            assert not _fault(far, who, CONTESTANTS[who](far), "exact", real), (sample, who)


def test_an_ensemble_names_a_boundary_below_absolute_zero_as_a_run_does() -> None:
    net = Net()
    net.node(500.0, 300.0)
    net.boundary(gain=net.coef(1.0, net.input(k.SAMPLED_LINEAR, [0.0, 10.0], [-3.0, 293.0])))
    net.link(k.LINEAR, 0, -1, net.coef(1.0))
    cold = Case(0, "poisoned", net, np.linspace(0.0, 100.0, 3), {"max_steps": 20_000}, broken=True)
    for who in ("kernel", "lanes", "scalar"):
        found = CONTESTANTS[who](cold)
        assert (found.status, found.why) == ("BAD_INPUT", "at 0 s, node 1"), who


def test_the_judge_sees_wrong_answers() -> None:
    case = draw(list(FAMILIES).index("repeated"))
    knows, real = truth(case)
    assert real is not None
    right = CONTESTANTS["kernel"](case)
    assert not _fault(case, "kernel", right, knows, real)
    wrong = real + 0.02
    assert "0.02 K off" in _fault(case, "kernel", Outcome("OK", wrong), knows, real)
    wrong[-1] = np.nan
    assert "no numbers" in _fault(case, "kernel", Outcome("OK", wrong), knows, real)
    assert "gives up" in _fault(case, "kernel", Outcome("MAX_STEPS", None, "at 3 s"), knows, real)
    assert "massless" in _fault(case, "kernel", right, "undefined", None)
