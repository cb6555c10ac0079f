"""Networks of some hundred nodes, whose factors are kept from step to step and whose steps go over switchings, against the same networks
without that, and against scipy."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from fuzz.contestants import NAMES, TIGHT
from fuzz.networks import Case, draw
from thermid import _kernel as k
from unit.kernel.reference import THERMOSTAT, Net

KEPT_FROM = 300
"""Nodes from which factors are kept: a repeated network has at least so many, the single one has fewer."""


def repeated(net: Net, times: int) -> Net:
    """Return so many copies of a network side by side, which share coefficients, boundaries, tables and inputs."""
    n = len(net.capacity)

    def moved(node: int, copy: int) -> int:
        return node + copy * n if node >= 0 else node

    links = [(kind, moved(a, c), moved(b, c), coef, table) for c in range(times) for kind, a, b, coef, table in net.conductors]
    loads = [(kind, moved(node, c), coef, moved(sensor, c), table) for c in range(times) for kind, node, coef, sensor, table in net.loads]
    return replace(net, capacity=net.capacity * times, start=net.start * times, conductors=links, loads=loads)


def slopes_of(net: Net, count: int) -> dict[str, object]:
    """Return derivatives with respect to every third coefficient that is not zero, at most `count`."""
    chosen = [j for j, c in enumerate(net.coefs) if c[0] != 0.0][::3][:count]
    indptr = np.searchsorted(chosen, np.arange(len(net.coefs) + 1)).astype(np.int32)
    return {"dcoef": (indptr, np.arange(len(chosen), dtype=np.int32), net.values[chosen], len(chosen))}


FINE = {"atol": 2e-8, "rtol": 2e-9, "input_atol": 1e-5}
"""What a run is told that shall err by 1e-5 K."""


def differs(case: Case, count: int = 5, nodes: int = KEPT_FROM) -> tuple[float, float] | None:
    """Return by how much copies, at least so many nodes, differ from the single network at tight tolerances; None where it fails.

    Temperatures, of runs with and without derivatives [K]; derivatives by their largest, or by 1e-6 K where that is more.
    """
    asked, n = slopes_of(case.net, count), len(case.net.capacity)
    one, wide = case.net.run(case.times, **asked, **case.options | TIGHT | {"max_steps": 1_000_000}), repeated(case.net, -(-nodes // n))
    many, plain = wide.run(case.times, **asked, **case.options | FINE), wide.run(case.times, **case.options | FINE)
    assert NAMES[one.status] == NAMES[many.status] == NAMES[plain.status]
    if one.status != k.OK:
        return None
    copies = np.concatenate([x.traces.reshape(len(case.times), -1, n) for x in (many, plain)], axis=1)
    slopes = many.sensitivities.reshape(len(case.times), -1, n, one.sensitivities.shape[2])
    size = np.maximum(np.abs(one.sensitivities).max(axis=(0, 1)), 1e-6)
    return float(np.abs(copies - one.traces[:, None]).max()), float((np.abs(slopes - one.sensitivities[:, None]) / size).max())


def plain(seed: int) -> Case | None:
    """Return a random network that copies can be made of: small, and not meant to be refused."""
    case = draw(seed)
    return None if case.broken or len(case.net.capacity) > 60 or not case.net.capacity or not case.benign else case


def largest_differences(seeds: Iterable[int]) -> tuple[int, float, float]:
    """Return how many networks ran, and the largest differences of all."""
    found = [differs(case) for seed in seeds if (case := plain(seed)) is not None]
    ran = [each for each in found if each is not None]
    return len(ran), max(t for t, _ in ran), max(s for _, s in ran)


def test_copies_of_random_networks_are_like_the_single_one() -> None:
    count, kelvin, slope = largest_differences(range(60))
    assert count >= 10
    assert kelvin < 1e-5
    assert slope < 1e-3


FAINT = (1072, 1138, 1281, 1314, 1655)
"""Seeds of networks one of whose derivatives is below 1e-4 K and off by at most 1.6e-7 K."""


@pytest.mark.campaign
@pytest.mark.parametrize("seed", FAINT)
@pytest.mark.xfail(strict=True, reason="a derivative too faint to be good to a thousandth of its largest")
def test_copies_with_a_faint_derivative(seed: int) -> None:
    assert largest_differences([seed])[2] < 1e-3


@pytest.mark.campaign
def test_copies_of_many_random_networks() -> None:
    count, kelvin, slope = largest_differences([s for s in range(1000, 1900) if s not in FAINT])
    assert count >= 200
    assert kelvin < 1e-5
    assert slope < 1e-3


HEATED = (50, 120)
"""Nodes with a thermostat."""


def mesh(seed: int, size: int = 306) -> Net:
    """Return a connected network: random links, radiation, massless nodes, a varying ambient, two thermostats."""
    rng, net = np.random.default_rng(seed), Net()
    air = net.input(k.SINE, [285.0, 6.0, 3000.0, 0.3])
    for i in range(size):
        capacity = 400.0 if i in HEATED else None if i % 9 == 4 else float(np.exp(rng.uniform(np.log(20.0), np.log(900.0))))
        net.node(capacity, float(rng.uniform(280.0, 320.0)))
    room = net.boundary(net.coef(1.0, u=air))
    strap, grey = net.coef(0.6, p0=0.6), net.coef(4e-9, p1=4e-9)
    for i in range(1, size):
        net.link(k.LINEAR, i, int(rng.integers(max(0, i - 12), i)), strap)
        net.link(k.LINEAR, i, int(rng.integers(0, i)), net.coef(float(rng.uniform(0.05, 1.5))))
        if i % 3 == 0:
            net.link(k.RADIATION, i, room, grey)
    power = net.coef(25.0, p2=25.0)
    for node in (0, 11, 30):
        net.load(k.SIGNAL, node, power)
    for node in HEATED:
        net.load(THERMOSTAT, node, net.coef(60.0), net.coef(302.0, p3=1.0), net.coef(312.0, p3=1.0), sensor=node)
    return net


TIMES = np.linspace(0.0, 1500.0, 31)
CLOSE = {"atol": 1e-8, "rtol": 1e-10}


def test_derivatives_over_switchings_are_those_of_the_temperatures() -> None:
    net, observed = mesh(1), np.arange(0, 306, 7, dtype=np.int32)
    run = net.run(TIMES, dcoef=net.derivatives, nodes=observed, **CLOSE)
    assert len(run.event_times) > 10
    for p in range(net.parameters):
        step = 1e-4 * (np.arange(net.parameters) == p)
        ends = [net.run(TIMES, coef=net.shifted(sign * step), nodes=observed, **CLOSE) for sign in (1.0, -1.0)]
        assert len(ends[0].event_times) == len(ends[1].event_times) == len(run.event_times)
        slope, central = run.sensitivities[..., p], (ends[0].traces - ends[1].traces) / 2e-4
        # at an output within a switching's shift, the difference sees the switch on one side only
        clear = np.abs(TIMES[:, None] - run.event_times).min(axis=1) > 2.0
        assert np.abs(slope - central)[clear].max() < 1e-3 * np.abs(slope).max()


def plate(side: int = 18) -> Net:
    """Return a square of equal nodes, one edge to the air, four heaters that keep their nodes between 303 and 305 K."""
    net = Net()
    for _ in range(side**2):
        net.node(10.0, 293.0, p1=1.0)
    air, strap, film = net.boundary(offset=net.coef(293.0)), net.coef(1.0), net.coef(0.1)
    for row in range(side):
        net.link(k.LINEAR, row, air, film)
        for i in range(row * side, row * side + side - 1):
            net.link(k.LINEAR, i, i + 1, strap)
        for i in range(row * side, row * side + side if row + 1 < side else 0):
            net.link(k.LINEAR, i, i + side, strap)
    power = net.coef(20.0, p0=20.0)
    for i in (40, 120, 200, 310):
        net.load(THERMOSTAT, i, power, net.coef(303.0), net.coef(305.0), sensor=i)
    return net


def test_steps_go_over_switchings_with_the_factors_at_hand() -> None:
    """A step that was cut to land on a switching took two trials more, and each its factors."""
    net, times = plate(), np.linspace(0.0, 150.0, 16)
    run, tight = net.run(times), net.run(times, **CLOSE)
    assert len(run.event_times) == len(tight.event_times) > 50
    assert run.factorisations <= 30
    assert run.rejected < 0.5 * len(run.event_times)
    assert np.abs(run.traces - tight.traces).max() < 1e-4
    assert np.abs(run.event_times - tight.event_times).max() < 1e-3
    stored = 10.0 * (run.final_temperatures - 293.0).sum()
    assert abs(stored - run.load_energy.sum() + run.boundary_energy.sum()) < 1e-12 * run.load_energy.sum()


def test_few_factorisations_serve_many_steps() -> None:
    net = mesh(2)
    run = net.run(TIMES, dcoef=net.derivatives)
    assert run.steps > 100
    assert run.factorisations < 2 * run.steps  # without keeping any: one at the start of each step and one at each of five stages


def test_heat_balance_holds_with_kept_factors() -> None:
    net = mesh(3)
    run = net.run(TIMES, dcoef=net.derivatives)
    capacity = np.array([0.0 if c < 0 else net.values[c] for c in net.capacity])
    stored = capacity @ (run.final_temperatures - np.asarray(net.start))
    supplied = run.load_energy.sum() - run.boundary_energy.sum()
    assert abs(stored - supplied) < 1e-9 * np.abs(run.load_energy).sum()


@pytest.mark.parametrize("seed", [7, 144])
def test_errors_of_many_switchings_do_not_add_up(seed: int) -> None:
    """529 and 111 switchings of one thermostat, whose cycle keeps every error of an instant: 6e-4 and 4e-4 K where 1e-5 was stated."""
    case, stated = draw(seed, "switching"), {"atol": 2.5e-6, "rtol": 0.0, "input_atol": 1e-5}
    tight = case.net.run(case.times, atol=1e-9, rtol=0.0, input_atol=1e-7)
    assert len(tight.event_times) > 100
    for net in (case.net, repeated(case.net, KEPT_FROM)):
        assert np.abs(net.run(case.times, **stated).traces - tight.traces).max() < 2e-5
