"""Thermostats: switching instants, sensitivities through them, energies across them."""

from __future__ import annotations

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import THERMOSTAT, Net

TIGHT = {"rtol": 1e-10, "atol": 1e-10}


def heated(massless_sensor: bool = False) -> Net:
    net = Net()
    a, b = net.node(500.0, 290.0, p4=30.0), net.node(200.0, 290.0)
    room = net.boundary(offset=net.coef(285.0, p5=1.0))
    net.link(k.LINEAR, a, room, net.coef(1.0, p0=1.0))
    net.link(k.POWER, b, room, net.coef(0.3), net.coef(0.25))
    sensor = b
    if massless_sensor:
        sensor = net.node(None, 290.0)
        net.link(k.LINEAR, a, sensor, net.coef(1.5, p6=1.0))
        net.link(k.LINEAR, sensor, b, net.coef(1.7))
    else:
        net.link(k.LINEAR, a, b, net.coef(0.8, p6=1.0))
    net.load(THERMOSTAT, a, net.coef(40.0, p1=1.0), net.coef(295.0, p2=1.0), net.coef(299.0, p3=1.0), sensor=sensor)
    return net


def test_one_node_closed_form() -> None:
    """Saw-tooth between the thresholds: rise and fall times of a first-order lag."""
    net = Net()
    node = net.node(100.0, 290.0)
    net.link(k.LINEAR, node, net.boundary(offset=net.coef(290.0)), net.coef(2.0))
    net.load(THERMOSTAT, node, net.coef(40.0), net.coef(300.0), net.coef(302.0))
    r = net.run(np.linspace(0, 300, 61))
    tau, top = 50.0, 310.0
    first = tau * np.log((top - 290) / (top - 302))
    fall, rise = tau * np.log(12 / 10), tau * np.log((top - 300) / (top - 302))
    expected = first + np.cumsum([0.0, *([fall, rise] * 20)])
    expected = expected[expected < 300]
    np.testing.assert_allclose(r.event_times, expected, atol=1e-5)
    np.testing.assert_array_equal(r.event_states, np.arange(len(expected)) % 2)
    assert r.traces.max() <= 302 + 1e-6
    assert r.on[0] == r.event_states[-1]


@pytest.mark.parametrize("massless_sensor", [False, True])
def test_against_fine_steps(massless_sensor: bool) -> None:
    """Independent reference: classical Runge-Kutta, 0.02 s, switched where the sensor crosses within a step."""
    net = heated(massless_sensor)
    horizon = 1000.0
    r = net.run(np.linspace(0, horizon, 21), **TIGHT)
    sensor, c = net.loads[0][3], net.capacities()[:2]

    def rate(y: np.ndarray, on: bool) -> np.ndarray:
        every = np.append(y, (1.5 * y[0] + 1.7 * y[1]) / 3.2) if massless_sensor else y
        return net.net_heat(0.0, every, on=[on])[:2] / c

    def watched(y: np.ndarray) -> float:
        return float((1.5 * y[0] + 1.7 * y[1]) / 3.2) if massless_sensor else float(y[sensor])

    def step(y: np.ndarray, h: float, on: bool) -> np.ndarray:
        k1 = rate(y, on)
        k2 = rate(y + h / 2 * k1, on)
        k3 = rate(y + h / 2 * k2, on)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(y + h * k3, on))

    y, on, t, h, events = np.array([290.0, 290.0]), True, 0.0, 0.5, []
    while t < horizon - 1e-9:
        new = step(y, h, on)
        if (watched(new) >= 299.0) if on else (watched(new) <= 295.0):
            low, high = 0.0, h
            for _ in range(50):
                middle = (low + high) / 2
                crossed = (watched(step(y, middle, on)) >= 299.0) if on else (watched(step(y, middle, on)) <= 295.0)
                low, high = (low, middle) if crossed else (middle, high)
            y, t, on = step(y, high, on), t + high, not on
            events.append(t)
            rest = h - high
            y, t = step(y, rest, on), t + rest
        else:
            y, t = new, t + h
    np.testing.assert_allclose(r.event_times, events, atol=2e-6)
    np.testing.assert_allclose(r.traces[-1, :2], y, atol=1e-6)


@pytest.mark.parametrize("massless_sensor", [False, True])
def test_sensitivities_jump_at_switching(massless_sensor: bool) -> None:
    net = heated(massless_sensor)
    times = np.linspace(0, 3000, 31)
    r = net.run(times, sens=True, rtol=1e-9, atol=1e-9)
    assert len(r.event_times) >= 6
    for p in range(net.parameters):
        step = 1e-5 * np.eye(net.parameters)[p]
        up, down = net.run(times, coef=net.shifted(step), **TIGHT), net.run(times, coef=net.shifted(-step), **TIGHT)
        difference = (up.traces - down.traces) / 2e-5
        assert np.abs(difference - r.sensitivities[:, :, p]).max() < 1e-5 * max(np.abs(difference).max(), 10.0)


def test_energy_across_switching() -> None:
    net = heated()
    r = net.run([0.0, 3000.0])
    stored = net.capacities() @ (r.final_temperatures - 290.0)
    assert r.load_energy.sum() - r.boundary_energy.sum() == pytest.approx(stored, abs=1e-8 * r.load_energy.sum())
    on_time = np.sum(np.diff([0.0, *r.event_times, 3000.0])[::2])  # on from the start
    assert r.load_energy[0] == pytest.approx(40.0 * on_time, rel=1e-10)


def test_given_initial_state() -> None:
    net = heated()
    for given, power in ((1, True), (0, False)):
        r = net.run([0.0, 5.0], start=[297.0, 297.0], on=np.array([given], np.int32))
        assert bool(r.load_energy[0] > 0) is power
    assert net.run([0.0, 5.0], start=[297.0, 297.0]).load_energy[0] == 0.0


def test_two_thermostats_at_one_instant() -> None:
    net = Net()
    node = net.node(100.0, 290.0)
    net.link(k.LINEAR, node, net.boundary(offset=net.coef(290.0)), net.coef(2.0))
    for _ in range(2):
        net.load(THERMOSTAT, node, net.coef(20.0), net.coef(300.0), net.coef(302.0))
    r = net.run(np.linspace(0, 300, 61))
    single = Net()
    node = single.node(100.0, 290.0)
    single.link(k.LINEAR, node, single.boundary(offset=single.coef(290.0)), single.coef(2.0))
    single.load(THERMOSTAT, node, single.coef(40.0), single.coef(300.0), single.coef(302.0))
    expected = single.run(np.linspace(0, 300, 61))
    assert r.status == k.OK
    np.testing.assert_allclose(r.event_times[::2], expected.event_times, atol=1e-6)
    np.testing.assert_allclose(r.traces, expected.traces, atol=1e-5)


def test_sensor_on_a_measured_boundary() -> None:
    """An outdoor sensor, sampled coarsely: switching where the straight lines cross the thresholds."""
    t, v = np.array([0.0, 100.0, 200.0, 300.0]), np.array([290.0, 300.0, 285.0, 300.0])
    net = Net()
    node = net.node(100.0, 290.0)
    air = net.boundary(gain=net.coef(1.0, net.input(k.SAMPLED_LINEAR, t, v)))
    net.link(k.LINEAR, node, air, net.coef(0.1))
    net.load(THERMOSTAT, node, net.coef(5.0), net.coef(288.0), net.coef(296.0), sensor=air)
    r = net.run([0.0, 300.0])
    np.testing.assert_allclose(r.event_times, [180.0, 200 + 1100 / 15], atol=1e-6)
    assert r.load_energy[0] == pytest.approx(5.0 * (20 + 1100 / 15), rel=1e-8)


def massless_beside(watts: float, other: float = 0.0) -> Net:
    """A massless node 1 K/W above a heavy one, with a thermostat of its own (300 to 310 K) and a heater by the heavy one's sensor."""
    net = Net()
    heavy, light = net.node(1e6, 290.0), net.node(None, 290.0)
    net.link(k.LINEAR, light, heavy, net.coef(1.0))
    net.load(THERMOSTAT, light, net.coef(other), net.coef(300.0), net.coef(301.0), sensor=heavy)
    net.load(THERMOSTAT, light, net.coef(watts), net.coef(300.0), net.coef(310.0))
    return net


def test_the_first_output_of_a_massless_node_is_what_its_thermostats_leave() -> None:
    """Without heat both thermostats would be on; the other's 40 W alone hold this one's sensor above its upper threshold."""
    net = massless_beside(20.0, 40.0)
    r = net.run([0.0, 0.0, 1e-9, 1e-3])
    assert r.status == k.OK
    np.testing.assert_allclose(r.traces, [[290.0, 330.0]] * 4, atol=1e-6)
    assert r.event_times.size == 0
    np.testing.assert_array_equal(r.on, [1, 0])
    given = net.run([0.0, 1.0], on=np.array([1, 1], np.int32))  # what the caller says holds until it switches
    np.testing.assert_allclose(given.traces, [[290.0, 350.0], [290.0, 330.0]], atol=1e-3)
    np.testing.assert_allclose(given.event_times, [0.0], atol=1e-8)


def test_a_thermostat_that_a_massless_node_can_neither_have_on_nor_off() -> None:
    """20 W lift its sensor over the whole hysteresis at once: it would switch without end, which is said at the start."""
    r = massless_beside(20.0 + 1e-6).run([0.0, 1.0])
    assert (r.status, r.time, r.node) == (k.CHATTER, 0.0, 1)
    assert massless_beside(15.0).run([0.0, 1.0]).status == k.OK
