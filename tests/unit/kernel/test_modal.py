"""The modal solution against closed forms: equal parts, parts without a boundary, tiny capacitances, jumps, ramps, sines."""

from __future__ import annotations

import itertools
import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import Net
from unit.kernel.test_closed_forms import star
from unit.kernel.test_noisy_input import ambient, bench, independent


def modal(net: Net, times: object, nodes: list[int] | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Temperatures at times, at the end, and the heats of loads and boundaries."""
    at = np.asarray(times, float)
    index = np.arange(len(net.capacity)) if nodes is None else np.array([net.at(i) for i in nodes])
    found = k.modal(net.problem(), net.values, np.array(net.start, float), 0.0, float(at[-1]), at, index.astype(np.int32))
    assert found[0] == k.OK, found[:3]
    return found[4], found[5], found[6], found[7]


def test_noisy_samples_to_rounding() -> None:
    u = ambient(n=1801)
    times = np.arange(1801.0)
    net = bench(False, u)
    traces, final, *_ = modal(net, times)
    np.testing.assert_allclose(traces, independent(False, u), rtol=0, atol=1e-8)
    np.testing.assert_allclose(final, traces[-1], rtol=0, atol=1e-11)
    between = np.sort(np.concatenate((times[:-1] + 0.37, [1800.0])))
    finer, *_ = modal(net, np.unique(np.concatenate((times, between))))
    coarse, *_ = modal(net, between)
    np.testing.assert_allclose(coarse, finer[np.isin(np.unique(np.concatenate((times, between))), between)], rtol=0, atol=1e-10)


def test_held_samples_jump() -> None:
    u = ambient(n=601)
    got, *_ = modal(bench(False, u, k.SAMPLED_HOLD), np.arange(601.0), list(range(12)))
    np.testing.assert_allclose(got, independent(False, u, hold=True)[:, :12], rtol=0, atol=1e-8)


@pytest.mark.parametrize("tau", [1e-9, 1e-3, 0.3, 0.9999, 1.0001, 3.0, 1e2, 1e5, 1e9, 1e13])
def test_ramp_at_any_stiffness(tau: float) -> None:
    """T = s t - s tau (1 - exp(-t/tau)), and its integral, from 60 digits: no cancellation at either end."""
    capacitance, slope = 50.0, 0.25
    net = Net()
    node = net.node(capacitance, 300.0)
    g = capacitance / tau
    u = net.input(k.SAMPLED_LINEAR, [0.0, 8.0], [300.0, 300.0 + 8.0 * slope])
    net.link(k.LINEAR, node, net.boundary(gain=net.coef(1.0, u)), net.coef(g))
    times = [0.0, 0.125, 1.0, 2.5, 8.0]
    traces, _, _, into = modal(net, times)
    with localcontext() as context:
        context.prec = 60
        exact = [_ramp(Decimal(slope), Decimal(capacitance) / Decimal(g), Decimal(t)) for t in times]
    scale = max(float(exact[-1]), 1e-300)
    np.testing.assert_allclose(traces[:, 0] - 300.0, [float(x) for x in exact], rtol=0, atol=2e-13 + 1e-14 * scale)
    # what the boundary gave is what the node has taken up, but for the rounding of two integrals over 8 s that a huge g multiplies
    rounding = g * 8.0 * max(scale, 1e-3) * np.finfo(float).eps
    assert -into[0] == pytest.approx(capacitance * float(exact[-1]), rel=1e-12, abs=1e-12 + 8 * rounding)


def _ramp(slope: Decimal, tau: Decimal, t: Decimal) -> Decimal:
    return slope * t - slope * tau * (1 - (-t / tau).exp())


def test_equal_parts() -> None:
    """Eight equal parts about a hub: seven equal rates. Differences between parts decay with their own rate, whatever the hub does."""
    net = Net()
    hub = net.node(400.0, 300.0)
    c, link, loss = net.coef(150.0), net.coef(0.8), net.coef(0.2)
    air = net.boundary(offset=net.coef(290.0))
    parts = []
    for i in range(8):
        net.capacity.append(c)
        net.start.append(300.0 + i)
        parts.append(len(net.capacity) - 1)
        net.link(k.LINEAR, hub, parts[-1], link)
        net.link(k.LINEAR, parts[-1], air, loss)
    times = np.array([0.0, 30.0, 100.0, 700.0])
    traces, *_ = modal(net, times)
    for i, j in itertools.pairwise(parts):
        np.testing.assert_allclose(traces[:, j] - traces[:, i], np.exp(-times / 150.0), rtol=0, atol=1e-12)
    # hub and mean of the parts are two nodes
    pair = np.array([[-8 * 0.8 / 400, 8 * 0.8 / 400], [0.8 / 150, -1.0 / 150]])
    rates, shapes = np.linalg.eig(pair)
    rest = np.linalg.solve(pair, [0.0, -0.2 * 290.0 / 150.0])
    weights = np.linalg.solve(shapes, np.array([300.0, 303.5]) - rest)
    exact = rest + (np.exp(np.outer(times, rates)) * weights) @ shapes.T
    np.testing.assert_allclose(np.column_stack((traces[:, hub], traces[:, parts].mean(axis=1))), exact, rtol=0, atol=1e-11)


def test_parts_without_a_boundary() -> None:
    """Two islands: the mean of each rises by P t / C and nothing else; a part alone keeps its temperature to the last digit."""
    net = Net()
    a, b, c, alone = net.node(100.0, 290.0), net.node(3.0, 310.0), net.node(7e-6, 295.0), net.node(20.0, 321.5)
    net.link(k.LINEAR, a, b, net.coef(2.0))
    net.link(k.LINEAR, b, c, net.coef(1e3))
    net.load(k.SIGNAL, b, net.coef(0.5))
    times = np.array([0.0, 1e-9, 1.0, 1e3, 1e5])
    traces, _, heat, _ = modal(net, times)
    weights = np.array([100.0, 3.0, 7e-6])
    start = float(weights @ traces[0, :3])
    np.testing.assert_allclose(traces[:, :3] @ weights - start, 0.5 * times, rtol=1e-12, atol=1e-9)
    assert (traces[:, alone] == 321.5).all()
    assert heat[0] == pytest.approx(0.5e5, rel=1e-14)


@pytest.mark.parametrize("capacitance", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-21, 1e-30])
def test_tiny_capacitance_tends_to_none(capacitance: float) -> None:
    """Rates from 1e-4 to 1e30 in one matrix: the slow ones keep their digits."""
    times = [0.0, 600.0, 1800.0, 3600.0]
    exact, *_ = modal(star(), times)
    net = star()
    net.capacity[2] = net.coef(capacitance)
    np.testing.assert_allclose(modal(net, times)[0][1:], exact[1:], rtol=0, atol=1e-10 + 0.1 * capacitance)


def test_tiny_capacitance_at_its_own_pace() -> None:
    net = Net()
    heavy, light = net.node(1e12, 300.0), net.node(1e-12, 310.0)
    net.link(k.LINEAR, heavy, light, net.coef(1.0))
    times = np.array([0.0, 1e-13, 1e-12, 5e-12, 1e-9])
    np.testing.assert_allclose(modal(net, times)[0][:, 1] - 300.0, 10.0 * np.exp(-times / 1e-12), rtol=0, atol=1e-12)


def test_heated_massless_nodes_in_a_row() -> None:
    """A mass, two massless nodes with powers, air: heat splits by resistances; star to mesh against Ohm's law."""
    net = Net()
    mass, one, two = net.node(250.0, 300.0), net.node(None, 300.0), net.node(None, 300.0)
    air = net.boundary(offset=net.coef(290.0))
    for a, b, r in ((mass, one, 2.0), (one, two, 3.0), (two, air, 5.0)):
        net.link(k.LINEAR, a, b, net.coef(1 / r))
    net.load(k.SIGNAL, one, net.coef(1.5))
    net.load(k.SIGNAL, two, net.coef(0.5))
    times = np.array([0.0, 500.0, 4000.0])
    traces, final, *_ = modal(net, times)
    level = 290.0 + 1.5 * 8.0 + 0.5 * 5.0
    exact = level + (300.0 - level) * np.exp(-times / 2500.0)
    np.testing.assert_allclose(traces[:, mass], exact, rtol=0, atol=1e-11)
    flow = (exact - level) / 10.0  # out of the mass
    np.testing.assert_allclose(traces[:, one], exact - 2.0 * flow, rtol=0, atol=1e-11)
    np.testing.assert_allclose(traces[:, two], 290.0 + 5.0 * (flow + 2.0), rtol=0, atol=1e-11)
    np.testing.assert_allclose(final, traces[-1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("period", [0.5, 100.0, 1e5])
@pytest.mark.parametrize("bound", [True, False])
def test_sine(period: float, bound: bool) -> None:
    """C T' = -G T + P sin(w t + p), with and without a path to a boundary."""
    c, g, p, phase = 80.0, 0.4 if bound else 0.0, 6.0, 0.7
    net = Net()
    node = net.node(c, 300.0)
    net.link(k.LINEAR, node, net.boundary(offset=net.coef(300.0)), net.coef(g))
    net.load(k.SIGNAL, node, net.coef(p, net.input(k.SINE, [0.5, 2.0, period, phase])))
    t = np.linspace(0.0, 700.0, 41)
    rate, w = g / c, 2 * math.pi / period
    size = 2.0 * p / c / (rate**2 + w**2)
    swing = size * (rate * np.sin(w * t + phase) - w * np.cos(w * t + phase))
    mean = 0.5 * p / c * (-np.expm1(-rate * t) / rate if bound else t)
    traces, _, heat, _ = modal(net, t)
    np.testing.assert_allclose(traces[:, 0] - 300.0, mean + swing - swing[0] * np.exp(-rate * t), rtol=0, atol=1e-11 * (1 + size * w))
    gained = p * (0.5 * 700.0 - 2.0 / w * (math.cos(w * 700.0 + phase) - math.cos(phase)))
    assert heat[0] == pytest.approx(gained, rel=1e-12, abs=1e-10)


def test_boundaries_repeated_times_and_no_time_at_all() -> None:
    u = ambient(n=11)
    net = bench(False, u)
    traces, *_ = modal(net, [0.0, 0.5, 0.5, 3.0, 10.0], [-1, 0])
    np.testing.assert_allclose(traces[:, 0], np.interp([0.0, 0.5, 0.5, 3.0, 10.0], np.arange(11.0), u), rtol=0, atol=1e-12)
    assert (traces[1] == traces[2]).all()
    traces, final, heat, _ = modal(net, [0.0])
    assert traces[0, :12] == pytest.approx(net.start[:12], rel=1e-15)
    assert final == pytest.approx(traces[0], rel=1e-15)
    assert not heat.any()


@pytest.mark.parametrize("kind", [k.SAMPLED_LINEAR, k.SAMPLED_HOLD])
def test_the_short_way_for_a_log_read_at_its_own_times(kind: int) -> None:
    """Outputs that take from the input directly go the long way; both ways write the same, in gaps and beyond the log's end too."""
    u = ambient(n=400)
    net = bench(False, u, kind)
    knots = np.concatenate((np.arange(150.0), np.arange(170.0, 420.0)))
    net.inputs[0] = (kind, knots, u)
    times = np.concatenate((knots, [419.5, 430.0, 431.0, 432.0]))
    times = times[times != 77.0]
    for wanted in (times, times[::7], times[3:4], [0.0, 10.5, 200.0, 432.0]):
        short, final, heat, into = modal(net, wanted, list(range(12)))
        long, final_too, heat_too, into_too = modal(net, wanted, [*range(12), -1])
        np.testing.assert_allclose(short, long[:, :12], rtol=0, atol=1e-11)
        np.testing.assert_allclose((*final, *heat, *into), (*final_too, *heat_too, *into_too), rtol=1e-13)


def test_grids_that_differ_by_rounding_only() -> None:
    """Knots at 0.1 k and outputs by running sums: as if they were the same times."""
    knots = 0.1 * np.arange(3001)
    net = Net()
    node = net.node(40.0, 300.0)
    u = net.input(k.SAMPLED_LINEAR, knots, 300.0 + np.sin(knots))
    net.link(k.LINEAR, node, net.boundary(gain=net.coef(1.0, u)), net.coef(1.0))
    sums = np.minimum(np.cumsum(np.full(3001, 0.1)) - 0.1, knots[-1])
    assert (sums != knots).any()
    np.testing.assert_allclose(modal(net, sums)[0], modal(net, knots)[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "status", "node"),
    [
        (lambda net: net.coefs.__setitem__(net.capacity[1], (0.0, -1, {})), k.BAD_INPUT, 1),
        (lambda net: net.coefs.__setitem__(net.conductors[0][3][0], (-1.0, -1, {})), k.BAD_INPUT, 0),
        (lambda net: net.start.__setitem__(1, math.nan), k.BAD_INPUT, 1),
        (lambda net: net.load(k.SIGNAL, 1, net.coef(-1e6)), k.RUN_AWAY, 0),
        (lambda net: net.node(None), k.SINGULAR_NODE, 3),
        (lambda net: net.coefs.__setitem__(net.capacity[0], (1e-320, -1, {})), k.NON_FINITE, 0),
    ],
    ids=["capacitance", "conductance", "start", "below zero", "loose", "overflow"],
)
def test_failures_have_a_status(change: object, status: int, node: int) -> None:
    net = star()
    net.coefs[net.conductors[0][3][0]] = (1e8 if status == k.NON_FINITE else 0.5, -1, {})
    change(net)  # type: ignore[operator]
    found = k.modal(net.problem(), net.values, np.array(net.start), 0.0, 3600.0, np.array([0.0, 3600.0]), np.array([0, 1], np.int32))
    assert (found[0], found[1]) == (status, node)


def test_laws_that_are_not_linear_are_refused() -> None:
    net = star()
    net.link(k.RADIATION, 0, -1, net.coef(1e-9))
    with pytest.raises(ValueError, match="conductor is not linear"):
        modal(net, [0.0, 1.0])
    net = star()
    net.load(k.EXP, 0, net.coef(1.0), net.coef(0.01), net.coef(300.0))
    with pytest.raises(ValueError, match="load depends on temperature"):
        modal(net, [0.0, 1.0])
