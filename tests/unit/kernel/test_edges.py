"""Energies, extremes, breaks and repeatability."""

from __future__ import annotations

import itertools
import signal

import numpy as np
import pytest

from fuzz import exact
from thermid import _kernel as k
from unit.kernel.reference import PROPORTIONAL, Net
from unit.kernel.test_noisy_input import ambient, bench
from unit.kernel.test_rows import menagerie


def balance(net: Net, r: k.Result, start: np.ndarray) -> tuple[float, float]:
    """Residual of loads + carried-in - boundaries - stored, and the largest of these. [J]."""
    flows = [i for i, row in enumerate(net.conductors) if row[0] == k.FLOW]
    stored = float(net.capacities() @ (r.final_temperatures - start))
    parts = (float(r.load_energy.sum()), float(r.conductor_energy[flows].sum()), float(r.boundary_energy.sum()), stored)
    return parts[0] + parts[1] - parts[2] - stored, max(map(abs, parts))


def test_energies_close_with_every_law() -> None:
    net = menagerie()
    r = net.run([0.0, 60.0])
    residual, scale = balance(net, r, np.array(net.start))
    assert abs(residual) < 1e-8 * scale


@pytest.mark.parametrize("nonlinear", [False, True])
def test_energies_close_on_a_noisy_input(nonlinear: bool) -> None:
    net = bench(nonlinear, ambient())
    r = net.run([0.0, 5400.0])
    residual, scale = balance(net, r, np.array(net.start))
    assert abs(residual) < 1e-8 * scale


def test_conductor_energies_agree_with_quadrature() -> None:
    net = menagerie()
    times = np.linspace(0.0, 60.0, 6001)
    r = net.run(times)
    every = np.array([net.all_temperatures(row, t) for row, t in zip(r.traces, times, strict=True)])
    flows = net.problem().flows(net.values, every, times)
    by_quadrature = 0.5 * (flows[1:] + flows[:-1]).sum(axis=0) * 0.01
    scale = np.abs(by_quadrature).max()
    np.testing.assert_allclose(r.conductor_energy, by_quadrature, atol=2e-4 * scale)  # the hold input jumps inside two intervals


def test_zero_conductances_are_harmless() -> None:
    net = Net()
    a, b, s = net.node(100.0, 310.0), net.node(50.0, 300.0), net.node(None, 300.0)
    air = net.boundary(offset=net.coef(290.0))
    for kind in (k.LINEAR, k.POWER, k.RADIATION, k.FLOW):
        net.link(kind, a, air, net.coef(0.0, p0=1.0), net.coef(0.25))
        net.link(kind, a, s, net.coef(0.0), net.coef(0.25))
    net.link(k.LINEAR, s, b, net.coef(1.0))
    r = net.run([0.0, 1e4], sens=True)
    assert r.status == k.OK
    np.testing.assert_allclose(r.traces[1], [310.0, 300.0, 300.0], atol=1e-12)
    assert np.isfinite(r.sensitivities).all()
    assert r.sensitivities[1, 0, 0] < 0  # a conductance that is zero now may still be wanted


def test_infinite_resistance_beside_a_finite_one() -> None:
    """A massless node cut off on one side follows the other."""
    net = Net()
    a, s, b = net.node(100.0, 310.0), net.node(None, 300.0), net.node(50.0, 290.0)
    net.link(k.LINEAR, a, s, net.coef(1.0 / np.inf))
    net.link(k.LINEAR, s, b, net.coef(2.0))
    r = net.run([0.0, 100.0])
    np.testing.assert_allclose(r.traces[-1], [310.0, 290.0, 290.0], atol=1e-12)


@pytest.mark.parametrize("huge", [1e9, 1e15])
def test_huge_capacity_is_a_boundary(huge: float) -> None:
    net = Net()
    a, b = net.node(100.0, 310.0), net.node(huge, 290.0)
    net.link(k.LINEAR, a, b, net.coef(1.0))
    times = np.linspace(0, 500, 11)
    r = net.run(times)
    np.testing.assert_allclose(r.traces[:, 0], 290 + 20 * np.exp(-times / 100), atol=1e-6 + 3e3 / huge)
    np.testing.assert_allclose(r.traces[:, 1], 290.0, atol=1e-6 + 3e3 / huge)


def test_stiff_chain() -> None:
    """Time constants from 1e-4 to 1e6 s in one chain, against the matrix exponential."""
    from scipy.linalg import expm

    capacity = np.array([1e-4, 1e-1, 1e2, 1e6])
    net = Net()
    nodes = [net.node(c, 300.0 + 10 * i) for i, c in enumerate(capacity)]
    for a, b in itertools.pairwise(nodes):
        net.link(k.LINEAR, a, b, net.coef(1.0))
    times = np.array([0.0, 1e-4, 0.02, 0.5, 30.0, 1e3, 1e5, 3e6])
    r = net.run(times)
    matrix = (np.diag([-1.0, -2, -2, -1]) + np.diag(np.ones(3), 1) + np.diag(np.ones(3), -1)) / capacity[:, None]
    balanced = np.sqrt(capacity)
    symmetric = balanced[:, None] * matrix / balanced
    for t, row in zip(times, r.traces, strict=True):
        exact = expm(symmetric * t) @ (balanced * np.array(net.start)) / balanced if t < 1e3 else None
        if exact is None:
            values, vectors = np.linalg.eigh((symmetric + symmetric.T) / 2)
            exact = vectors @ (np.exp(np.minimum(values, 0) * t) * (vectors.T @ (balanced * np.array(net.start)))) / balanced
        np.testing.assert_allclose(row, exact, rtol=0, atol=2e-5)


@pytest.mark.parametrize("given", [False, True])
def test_hold_input_with_breaks(given: bool) -> None:
    """Square-wave power: exact exponentials piece by piece; an extra break of the caller changes nothing."""
    edges, watts = np.arange(0.0, 600.0, 60.0), np.tile([10.0, 0.0], 5)
    net = Net()
    node = net.node(100.0, 290.0)
    net.link(k.LINEAR, node, net.boundary(offset=net.coef(290.0)), net.coef(2.0))
    net.load(k.SIGNAL, node, net.coef(1.0, net.input(k.SAMPLED_HOLD, edges, watts)))
    times = np.linspace(0, 600, 61)
    r = net.run(times, breaks=np.array([33.0, 77.0]) if given else None)
    t, exact = 290.0, [290.0]
    for i in range(60):
        end = 290 + watts[i // 6] / 2
        t = end + (t - end) * np.exp(-0.2)
        exact.append(t)
    np.testing.assert_allclose(r.traces[:, 0], exact, atol=1e-6)
    assert r.load_energy[0] == pytest.approx(10 * 300, rel=1e-12)


def test_massless_node_jumps_with_a_held_input() -> None:
    """Outputs are right-continuous: at the instant of a change the new value holds."""
    net = Net()
    a, s = net.node(100.0, 290.0), net.node(None, 290.0)
    air = net.boundary(gain=net.coef(1.0, net.input(k.SAMPLED_HOLD, [0.0, 50.0], [290.0, 300.0])))
    net.link(k.LINEAR, a, s, net.coef(1.0))
    net.link(k.LINEAR, s, air, net.coef(1.0))
    r = net.run([0.0, 50.0 - 1e-6, 50.0, 100.0], nodes=[a, s, air])
    np.testing.assert_allclose(r.traces[:3], [[290, 290, 290], [290, 290, 290], [290, 295, 300]], atol=1e-6)


def test_same_run_same_bits() -> None:
    net = menagerie()
    times = np.linspace(0, 60, 13)
    first, second = net.run(times, sens=True), net.run(times, sens=True)
    for name in ("traces", "sensitivities", "final_temperatures", "load_energy", "boundary_energy", "event_times"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_continuing_a_run() -> None:
    """Two halves from the state of the first equal the whole, sensitivities included."""
    net = menagerie()
    # A clamp's corner is not located as an event; sensitivities across it are as good as the step is short.
    net.loads = [row for row in net.loads if row[0] != PROPORTIONAL]
    # Nor are sensitivities under error control: at an atol of 1e-10 their error depends on where the steps fall, by up to 6e-5.
    exact = {"rtol": 0.0, "atol": 1e-11}
    whole = net.run([0.0, 25.0, 60.0], sens=True, **exact)
    half = net.run([0.0, 25.0], sens=True, **exact)
    rest = net.run([25.0, 60.0], start=half.final_temperatures, sens=True, dT0=half.final_sensitivities, on=half.on, **exact)
    np.testing.assert_allclose(rest.traces[-1], whole.traces[-1], atol=1e-7)
    np.testing.assert_allclose(rest.sensitivities[-1], whole.sensitivities[-1], atol=1e-5)


def test_numbering_of_nodes_does_not_matter() -> None:
    net, swapped = bench(True, ambient(5, 901)), bench(True, ambient(5, 901))
    new = np.random.default_rng(2).permutation(13)
    place = {int(old): i for i, old in enumerate(new)}
    swapped.capacity = [net.capacity[i] for i in new]
    swapped.start = [net.start[i] for i in new]
    swapped.conductors = [(r[0], place.get(r[1], r[1]), place.get(r[2], r[2]), r[3], r[4]) for r in net.conductors]
    swapped.loads = [(r[0], place[r[1]], r[2], place[r[3]], r[4]) for r in net.loads]
    times = np.arange(0.0, 901.0, 10)
    np.testing.assert_allclose(swapped.run(times).traces, net.run(times).traces[:, new], rtol=0, atol=1e-8)


def test_no_outputs_and_no_duration() -> None:
    net = menagerie()
    r = net.run([], t0=0.0, t_end=60.0)
    assert r.traces.shape == (0, 5)
    r = net.run([3.0, 3.0], sens=True)
    assert r.steps == 0
    np.testing.assert_array_equal(r.traces[0, :4], net.start[:4])
    assert abs(net.net_heat(3.0, r.traces[0])[4]) < 1e-8


def test_more_than_two_hundred_nodes() -> None:
    """A wire of 240 nodes: dense factors, still right; against its modes."""
    n = 240
    net = Net()
    nodes = [net.node(2.0, 300.0 + (30.0 if i < n // 2 else 0.0)) for i in range(n)]
    g = net.coef(5.0)
    for a, b in itertools.pairwise(nodes):
        net.link(k.LINEAR, a, b, g)
    r = net.run([0.0, 40.0])
    matrix = (np.diag(np.full(n, -2.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)) * 2.5
    matrix[0, 0] = matrix[-1, -1] = -2.5
    values, vectors = np.linalg.eigh(matrix)
    exact = vectors @ (np.exp(values * 40) * (vectors.T @ np.array(net.start)))
    np.testing.assert_allclose(r.traces[-1], exact, atol=1e-5)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no interval timer")
def test_interrupt_key() -> None:
    """A signal reaches its handler while the kernel runs."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    net = bench(True, ambient(6, 901))
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    try:
        with pytest.raises(KeyboardInterrupt):
            net.run([0.0, 900.0], max_step=1e-3, max_steps=500_000)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("capacitance", [1.0, 1e-2, 1e-4, 1e-6, 1e-9])
def test_a_fast_node_that_starts_apart_leaves_its_neighbour_alone(capacitance: float) -> None:
    """It settles long before the first output; its neighbour's slope until then must not be drawn through the first step."""
    net = Net()
    slow, fast = net.node(100.0, 300.0), net.node(capacitance, 320.0)
    net.link(k.LINEAR, slow, fast, net.coef(1.0))
    net.link(k.LINEAR, slow, net.boundary(offset=net.coef(300.0)), net.coef(0.02))
    times = np.linspace(0.0, 20_000.0, 2001)
    np.testing.assert_allclose(net.run(times).traces, exact.solve(net, times), rtol=0, atol=2e-6)


@pytest.mark.parametrize("tie", [1e3, 1e6, 1e8, 1e10])
@pytest.mark.parametrize("middle", [False, True])
def test_heavy_nodes_tied_together_that_start_apart(tie: float, middle: bool) -> None:
    """They meet at once; then both cool slowly, which neither of them would do by itself beside the other."""
    net = Net()
    a, b, air = net.node(500.0, 320.0), net.node(800.0, 290.0), net.boundary(offset=net.coef(293.0))
    ends = (a, net.node(None, 300.0), b) if middle else (a, b)
    for one, other in itertools.pairwise(ends):
        net.link(k.LINEAR, one, other, net.coef(tie))
    net.link(k.LINEAR, a, air, net.coef(0.3))
    net.link(k.LINEAR, b, air, net.coef(0.2))
    net.load(k.SIGNAL, a, net.coef(5.0))
    times = np.linspace(0.0, 10_000.0, 1001)
    off = np.abs(net.run(times).traces - exact.solve(net, times))
    assert off[-1].max() < 1e-4
    # the slope of an output between steps is a difference of heats, whose rounding a tie of 1e10 W/K shows
    assert off.max() < (3e-6 if tie < 1e10 else 2e-4)


@pytest.mark.parametrize("tie", [1e5, 1e8])
@pytest.mark.parametrize("tiny", [1e-3, 1e-9, 1e-12])
@pytest.mark.parametrize("heavy", [(500.0, 800.0), (1e6, 800.0), (1.0, 800.0), (500.0, 1e-3)])
def test_a_tiny_node_beside_heavy_ones_tied_together(heavy: tuple[float, float], tiny: float, tie: float) -> None:
    """The pair does not follow anybody, but the tiny node follows the pair, and a light one of the pair the other."""
    net = Net()
    a, b, c = net.node(heavy[0], 320.0), net.node(heavy[1], 290.0), net.node(tiny, 300.0)
    air = net.boundary(offset=net.coef(293.0))
    for one, other, conductance in ((a, b, tie), (a, air, 0.3), (b, c, 1.0), (c, air, 0.2)):
        net.link(k.LINEAR, one, other, net.coef(conductance))
    net.load(k.SIGNAL, a, net.coef(5.0))
    times = np.linspace(0.0, 10_000.0, 301)
    np.testing.assert_allclose(net.run(times).traces, exact.solve(net, times), rtol=0, atol=3e-6)


def test_neighbours_of_a_tiny_node_that_starts_off_balance() -> None:
    """It settles within 1e-9 s; from then on the heavy node sees two conductances in series, early in the first step as later."""
    net = Net()
    heavy, tiny, air = net.node(100.0, 310.0), net.node(1e-9, 400.0), net.boundary(offset=net.coef(290.0))
    near, far = 2.0, 3.0
    net.link(k.LINEAR, heavy, tiny, net.coef(near, p0=1.0))
    net.link(k.LINEAR, tiny, air, net.coef(far))
    times = np.array([0.1, 1.0, 7.0, 100.0])
    r = net.run(np.concatenate(([0.0], times)), nodes=[heavy], sens=True, rtol=0, atol=1e-7)
    series, decay = near * far / (near + far), 20.0 * np.exp(-near * far / (near + far) * times / 100.0)
    np.testing.assert_allclose(r.traces[1:, 0], 290.0 + decay, rtol=0, atol=1e-6)
    np.testing.assert_allclose(r.sensitivities[1:, 0, 0], -decay * times / 100.0 * (series / near) ** 2, rtol=0, atol=1e-6)
