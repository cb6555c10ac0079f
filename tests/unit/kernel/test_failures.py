"""Every failed run says what ran out, when and where."""

from __future__ import annotations

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import THERMOSTAT, Net


def lump(load: tuple[int, list[float]] | None = None, capacitance: float = 100.0, conductance: float = 1.0) -> Net:
    net = Net()
    cold, node = net.node(50.0, 300.0), net.node(capacitance, 300.0)
    net.link(k.LINEAR, node, net.boundary(offset=net.coef(300.0)), net.coef(conductance))
    net.link(k.LINEAR, cold, node, net.coef(0.1))
    if load:
        net.load(load[0], node, *(net.coef(v) for v in load[1]))
    return net


def test_max_steps() -> None:
    r = lump((k.SIGNAL, [10.0])).run([0, 50, 1000], max_steps=5)
    assert r.status == k.MAX_STEPS
    assert r.steps + r.rejected == 5
    assert 0 < r.time < 1000
    assert r.node in (0, 1)
    assert np.isnan(r.traces[r.filled :]).all()
    assert np.isfinite(r.traces[: r.filled]).all()


def test_linear_run_away() -> None:
    """More power per kelvin than the boundary takes: exponential growth, without limit."""
    r = lump((k.POLY, [10.0, 0.5, 0.0, 300.0])).run([0, 1e5])
    assert r.status == k.RUN_AWAY
    assert r.node == 1
    assert 0 < r.time < 1e5


def test_run_away_in_finite_time() -> None:
    r = lump((k.EXP, [10.0, 0.5, 300.0])).run([0, 1e5])
    assert r.status == k.RUN_AWAY
    assert r.node == 1


def test_below_absolute_zero() -> None:
    r = lump((k.SIGNAL, [-1e4])).run([0, 1e5])
    assert r.status == k.RUN_AWAY
    assert r.node == 1


def test_massless_node_below_absolute_zero_is_the_one_named() -> None:
    """It stands there from the start, and moves less from then on than the nodes that it cools."""
    net = lump()
    cooled = net.node(None, 300.0)
    net.link(k.LINEAR, cooled, 1, net.coef(0.1))
    net.load(k.SIGNAL, cooled, net.coef(-40.0))
    r = net.run([0, 1e3])
    assert r.status == k.RUN_AWAY
    assert r.node == cooled
    assert r.time == 0.0


def test_massless_node_without_conductance() -> None:
    net = lump()
    net.node(None, 300.0)
    r = net.run([0, 10])
    assert r.status == k.SINGULAR_NODE
    assert r.node == 2
    assert r.time == 0.0
    assert np.isnan(r.traces).all()


def test_massless_island() -> None:
    net = lump()
    a, b = net.node(None, 300.0), net.node(None, 300.0)
    net.link(k.LINEAR, a, b, net.coef(1.0))
    r = net.run([0, 10])
    assert r.status == k.SINGULAR_NODE
    assert r.node in (a, b)


@pytest.mark.parametrize("capacitance", [0.0, -5.0, np.nan, np.inf])
def test_bad_capacitance(capacitance: float) -> None:
    r = lump(capacitance=capacitance).run([0, 10])
    assert (r.status, r.node) == (k.BAD_INPUT, 1)


@pytest.mark.parametrize("conductance", [np.nan, np.inf])
def test_bad_coefficient(conductance: float) -> None:
    assert lump(conductance=conductance).run([0, 10]).status == k.BAD_INPUT


def test_bad_temperatures() -> None:
    r = lump().run([0, 10], start=[300.0, -1.0])
    assert (r.status, r.node) == (k.BAD_INPUT, 1)
    net = lump()
    net.link(k.LINEAR, 0, net.boundary(offset=net.coef(-3.0)), net.coef(1.0))
    r = net.run([0, 10])
    assert (r.status, r.node) == (k.BAD_INPUT, 3)


def test_overflowing_power_is_not_silent() -> None:
    r = lump((k.EXP, [1.0, 10.0, 200.0])).run([0, 10])
    assert r.status == k.NON_FINITE
    assert r.node == 1


def test_step_underflow() -> None:
    """A sink that opens over a hair's breadth, far narrower than any step could follow."""
    net = lump((k.SIGNAL, [10.0]))
    edge = net.table([300.0, 302.0, 302.0 + 1e-13, 400.0], [0.0, 0.0, 1e30, 1e30], [0.0, 0.0, 0.0, 0.0])
    net.load(k.TABLE, 1, net.coef(-1.0), table=edge)
    r = net.run([0, 1000])
    assert r.status in (k.STEP_UNDERFLOW, k.NEWTON_FAILED)
    assert r.node == 1
    assert r.traces[0, 1] == 300.0
    assert r.final_temperatures[1] == pytest.approx(302.0, abs=1e-6)


def test_thresholds_in_the_wrong_order() -> None:
    """Thresholds in the wrong order are refused at the start."""
    r = lump((THERMOSTAT, [10.0, 305.0, 302.0])).run([0, 1000])
    assert (r.status, r.node) == (k.BAD_INPUT, 1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda n: n.conductors.append((k.LINEAR, 0, 7, [0, -1, -1, -1], -1)), "conductor 2: no such node"),
        (lambda n: n.conductors.append((99, 0, 1, [0, -1, -1, -1], -1)), "conductor 2: no such kind"),
        (lambda n: n.conductors.append((k.LINEAR, 1, 1, [0, -1, -1, -1], -1)), "conductor 2: both ends are one node"),
        (lambda n: n.conductors.append((k.LINEAR, 0, 1, [99, -1, -1, -1], -1)), "conductor 2: no such coefficient"),
        (lambda n: n.conductors.append((k.TABLE_MEAN, 0, 1, [0, -1, -1, -1], -1)), "conductor 2: no such table"),
        (lambda n: n.loads.append((k.SIGNAL, -1, [0, -1, -1, -1], 0, -1)), "load 0: a load needs an unknown node"),
        (lambda n: n.inputs.append((k.SAMPLED_LINEAR, np.array([0.0, 0.0]), np.array([1.0, 1.0]))), "times must increase"),
        (lambda n: n.inputs.append((k.SINE, np.array([0.0, 0.0]), np.array([]))), "SINE takes"),
        (lambda n: n.tables.append((np.array([1.0, 0.0]), np.zeros(2), np.zeros(2))), "knots must increase"),
        (lambda n: n.coefs.append((1.0, 4, {})), "coef_input: no such input, coefficient 5"),
    ],
)
def test_wrong_arrays_are_refused(change: object, message: str) -> None:
    net = lump()
    change(net)  # type: ignore[operator]
    with pytest.raises(ValueError, match=message):
        net.problem()


def test_wrong_calls_are_refused() -> None:
    net = lump()
    for options, message in (
        ({"start": [300.0]}, "T0"),
        ({"coef": np.ones(2)}, "coef"),
        ({"t_end": -1.0}, "t_end"),
        ({"atol": 0.0}, "tolerances"),
    ):
        with pytest.raises(ValueError, match=message):
            net.run([0, 10], **options)
    with pytest.raises(ValueError, match="output_times"):
        net.run([0, 10, 5], t_end=10.0)
