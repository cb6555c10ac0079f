"""Random networks from a seed, by family of trouble."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid import _kernel as k
from unit.kernel.reference import PROPORTIONAL, THERMOSTAT, Net

SIGMA = 5.670374419e-8


@dataclass
class Case:
    """A network, when it is looked at, and how the kernel is asked.

    Parameters
    ----------
    seed : int          What made it.
    family : str        Which trouble it has.
    net : Net           The rows.
    times : array       Times of the outputs, the first one the start. [s]
    options : dict      What the integrator is told beyond its defaults.
    benign : bool       Whether the kernel has no excuse to give up.
    broken : bool       Whether something is wrong with the question, so that a refusal in words is an answer too.
    """

    seed: int
    family: str
    net: Net
    times: np.ndarray
    options: dict[str, Any] = field(default_factory=dict)
    benign: bool = False
    broken: bool = False


class Draw:
    """A network that grows row by row."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.net = rng, Net()

    def log(self, low: float, high: float) -> float:
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def pick(self, *choices: Any) -> Any:
        return choices[int(self.rng.integers(len(choices)))]

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def nodes(self, count: int, massless: float = 0.2, capacity: Callable[[], float] | None = None) -> None:
        for _ in range(count):
            value = capacity() if capacity else self.log(10.0, 3000.0)
            self.net.node(None if self.chance(massless) else value, float(self.rng.uniform(270.0, 330.0)))
        self.room()

    def room(self, kinds: tuple[str, ...] = ("constant", "constant", "linear", "hold", "sine")) -> None:
        """Add a boundary that is constant or follows an input."""
        kind, base = self.pick(*kinds), float(self.rng.uniform(270.0, 320.0))
        if kind == "constant":
            self.net.boundary(offset=self.net.coef(base))
            return
        if kind == "sine":
            u = self.net.input(k.SINE, [base, self.rng.uniform(0, 10), self.log(50.0, 5000.0), self.rng.uniform(0, 6)])
        else:
            count = int(self.rng.integers(1, 12))
            times = np.cumsum(self.rng.uniform(1.0, 300.0, count)) - 50.0
            u = self.net.input(k.SAMPLED_HOLD if kind == "hold" else k.SAMPLED_LINEAR, times, base + self.rng.normal(0, 5, count))
        self.net.boundary(gain=self.net.coef(1.0, u), offset=self.net.coef(0.0) if self.chance(0.3) else -1)

    def ends(self, extra: int = 2) -> list[tuple[int, int]]:
        """Pairs that join every node to the boundary, and some more."""
        n = len(self.net.capacity)
        out = [(i, int(self.rng.integers(-1, i)) if i else -1) for i in range(n)]
        for _ in range(int(self.rng.integers(extra + 1))):
            a, b = int(self.rng.integers(n)), int(self.rng.integers(-1, n))
            if a != b:
                out.append((a, b))
        return out

    def tree(self, kinds: tuple[int, ...] = (k.LINEAR,), conductance: Callable[[], float] | None = None) -> None:
        for a, b in self.ends():
            self.link(self.pick(*kinds), a, b, conductance() if conductance else self.log(0.02, 10.0))

    def link(self, kind: int, a: int, b: int, g: float) -> None:
        net = self.net
        if kind == k.POWER:
            net.link(kind, a, b, net.coef(g / 3), net.coef(self.pick(0.25, 0.25, 1 / 3, 0.1)))
        elif kind == k.RADIATION:
            net.link(kind, a, b, net.coef(SIGMA * min(g, 1.0)))
        elif kind == k.TABLE_MEAN:
            x = np.sort(self.rng.uniform(250, 400, 5))
            net.link(kind, a, b, net.coef(g), table=net.table(x, self.rng.uniform(0.2, 2, 5), np.zeros(5)))
        elif kind == k.TABLE_DIFF:
            x = np.array([-200.0, -20.0, 0.0, 20.0, 200.0])
            net.link(kind, a, b, net.coef(g), table=net.table(x, self.rng.uniform(0.2, 2, 5), np.zeros(5)))
        elif kind == k.GAS:
            net.link(kind, a, b, net.coef(g), net.coef(self.log(1e-3, 1e4), self.pressure()), table=self.over_film())
        elif kind == k.POTENTIAL:  # a conductivity that grows with temperature, integrated; the same for both ends
            x, slope = np.array([0.0, 250.0, 350.0, 600.0]), np.sort(self.rng.uniform(0.3, 2.0, 4))
            y = np.concatenate(([0.0], np.cumsum(np.diff(x) * (slope[1:] + slope[:-1]) / 2)))
            first = net.table(x, y, slope)
            net.table(x, y, slope)
            net.link(kind, a, b, net.coef(g), table=first)
        elif kind == k.NATURAL:
            rise, slope = self.rng.uniform(0.0, 4.0, 2), self.rng.uniform(0.0, 0.2, 3)
            nusselt = net.table([-40.0, -2.0, 2.0, 40.0], [1 + rise[0], 0.4, 0.4, 1 + rise[1]], [-slope[0], -slope[1], slope[1], slope[2]])
            self.over_film()
            self.over_film()
            net.link(kind, a, b, net.coef(g), net.coef(self.log(0.01, 10.0), self.pressure()), table=nusselt)
        else:
            net.link(kind, a, b, net.coef(g))

    def over_film(self) -> int:
        """Table of a property of a gas over its film temperature."""
        return self.net.table([200.0, 300.0, 400.0], self.rng.uniform(0.5, 2.0, 3), self.rng.uniform(-3e-3, 3e-3, 3))

    def pressure(self) -> int:
        """What a coefficient follows when the gas is pumped out or let in; most often nothing."""
        if self.chance(0.6):
            return -1
        times, parts = np.cumsum(self.rng.uniform(1.0, 2000.0, 4)), np.exp(self.rng.uniform(-8.0, 0.0, 4))
        return self.net.input(self.pick(k.SAMPLED_LINEAR, k.SAMPLED_HOLD), times, parts)

    def course(self) -> int:
        """What a power or a conductance follows, never below zero: switched, a pulse, a ramp to and fro, a wave."""
        kind, level = self.pick("switched", "switched", "pulse", "ramps", "wave"), float(self.rng.uniform(0.1, 1.0))
        if kind == "wave":
            return self.net.input(k.SINE, [1.0, level, self.log(50.0, 5000.0), self.rng.uniform(0, 6)])
        if kind == "pulse":
            begin = self.log(1.0, 3000.0)
            return self.net.input(k.SAMPLED_HOLD, [0.0, begin, begin + self.log(1e-3, 100.0)], [level, 1.0, 0.0])
        times = np.cumsum(self.rng.uniform(1.0, 600.0, int(self.rng.integers(2, 40)))) - 100.0
        switched = kind == "switched"
        values = self.rng.integers(0, 2, times.size) if switched else self.rng.uniform(0.0, 1.0, times.size)
        return self.net.input(k.SAMPLED_HOLD if switched else k.SAMPLED_LINEAR, times, values.astype(float))

    def heater(self, watts: float, node: int | None = None) -> None:
        n = len(self.net.capacity)
        self.net.load(k.SIGNAL, int(self.rng.integers(n)) if node is None else node, self.net.coef(watts))


def _span(d: Draw) -> np.ndarray:
    return np.linspace(0.0, d.log(10.0, 20_000.0), int(d.rng.integers(2, 30)))


def _on_jumps(d: Draw, times: np.ndarray) -> np.ndarray:
    """Some outputs exactly where inputs jump or bend: what has no capacitance shows the new value there."""
    knots = [t for _, a, b in d.net.inputs if len(b) for t in a if times[0] < t < times[-1]]
    return np.unique(np.concatenate((times, knots[:5]))) if d.chance(0.5) else times


CURVED = (k.LINEAR, k.POWER, k.RADIATION, k.TABLE_MEAN, k.TABLE_DIFF, k.GAS, k.NATURAL, k.POTENTIAL)


def plain(d: Draw) -> dict[str, Any]:
    """Ordinary sizes, every law, every input."""
    d.nodes(int(d.rng.integers(1, 8)))
    d.tree(CURVED)
    if d.chance(0.3):
        d.link(k.FLOW, 0, -1, d.log(0.02, 1.0))
    for _ in range(int(d.rng.integers(3))):
        d.heater(float(d.rng.uniform(-2, 10)))
    # Behind a gas that is pumped out a negative power takes more than there is: no temperature above 0 K balances it.
    return {"benign": all(d.net.coefs[row[2][0]][0] >= 0.0 for row in d.net.loads)}


def extreme(d: Draw) -> dict[str, Any]:
    """Linear, capacitances and conductances zero, tiny, huge or ordinary."""
    sizes = (0.0, 1e-12, 1e-6, 1e-3, 1.0, 100.0, 1e6, 1e12)
    d.nodes(int(d.rng.integers(1, 7)), 0.1, lambda: float(d.pick(*sizes, 100.0, 1000.0)))
    d.tree((k.LINEAR,), lambda: float(d.pick(*sizes, 0.1, 1.0, 10.0)))
    for _ in range(int(d.rng.integers(3))):
        d.heater(float(d.pick(0.0, 1e-12, 1.0, 5.0, 20.0)))
    return {}


def stiff(d: Draw) -> dict[str, Any]:
    """Every law, capacitances over eight decades, conductances over five."""
    d.nodes(int(d.rng.integers(2, 7)), 0.2, lambda: d.log(1e-4, 1e4))
    d.tree(CURVED, lambda: d.log(1e-3, 100.0))
    d.heater(float(d.rng.uniform(0, 10)))
    return {}


def runaway(d: Draw) -> dict[str, Any]:
    """A power that grows with temperature, beyond what leaves or not."""
    d.nodes(int(d.rng.integers(1, 5)), 0.1)
    d.tree((k.LINEAR, k.RADIATION))
    n, net = len(d.net.capacity), d.net
    node = int(d.rng.integers(n))
    if d.chance(0.5):
        net.load(k.EXP, node, net.coef(d.log(0.1, 20)), net.coef(d.log(1e-3, 0.3)), net.coef(300.0))
    else:
        net.load(k.POLY, node, net.coef(d.log(0.1, 20)), net.coef(d.log(1e-3, 0.5)), net.coef(d.pick(0.0, 1e-4, 0.1)), net.coef(300.0))
    return {}


def switching(d: Draw) -> dict[str, Any]:
    """Thermostats with wide, narrow and absurd hysteresis; proportional heaters."""
    d.nodes(int(d.rng.integers(1, 5)), 0.15)
    d.tree((k.LINEAR, k.POWER))
    n, net = len(d.net.capacity), d.net
    for _ in range(int(d.rng.integers(1, 3))):
        node, sensor, low = int(d.rng.integers(n)), int(d.rng.integers(n)), float(d.rng.uniform(280, 320))
        if d.chance(0.25):
            net.load(PROPORTIONAL, node, net.coef(d.log(0.1, 1e3)), net.coef(low), net.coef(d.log(1, 50)), sensor=sensor)
        else:
            width = float(d.pick(5.0, 1.0, 0.1, 1e-3, 1e-9, 0.0))
            net.load(THERMOSTAT, node, net.coef(d.log(1, 50)), net.coef(low), net.coef(low + width), sensor=sensor)
    return {}


def repeated(d: Draw) -> dict[str, Any]:
    """Equal parts, so equal eigenvalues."""
    n, c, g = int(d.rng.integers(2, 8)), d.log(1.0, 1000.0), d.log(0.01, 10.0)
    for _ in range(n):
        d.net.node(c, 300.0)
    d.room()
    for i in range(n):
        d.link(k.LINEAR, i, -1, g)
        if i and d.chance(0.5):
            d.link(k.LINEAR, i, i - 1, g)
    d.heater(d.log(0.1, 20.0))
    return {"benign": True}


def disconnected(d: Draw) -> dict[str, Any]:
    """Parts without a path to anything, massless ones among them."""
    d.nodes(int(d.rng.integers(2, 7)), 0.15)
    for a, b in d.ends():
        if d.chance(0.5):
            d.link(k.LINEAR, a, b, d.pick(0.0, 1.0, 0.1))
    if d.chance(0.6):
        d.heater(d.pick(0.0, 1.0, 10.0))
    return {}


def steep(d: Draw) -> dict[str, Any]:
    """Tables that change within a hundredth of a kelvin."""
    d.nodes(int(d.rng.integers(1, 4)), 0.15)
    d.tree()
    net, at, width = d.net, float(d.rng.uniform(290, 310)), d.pick(1.0, 0.1, 0.01, 1e-4)
    table = net.table([at, at + width], [float(d.rng.uniform(0, 2)), float(d.rng.uniform(0, 20))], [0.0, 0.0])
    if d.chance(0.5):
        net.load(k.TABLE, int(d.rng.integers(len(net.capacity))), net.coef(1.0), table=table)
    else:
        net.link(k.TABLE_MEAN, 0, -1, net.coef(1.0), table=table)
    d.heater(float(d.rng.uniform(0, 20)), 0)
    return {}


def poisoned(d: Draw) -> dict[str, Any]:
    """An ordinary network with one number that is none, infinite, negative or absurd."""
    plain(d)
    net, bad = d.net, float(d.pick(np.nan, np.inf, -np.inf, -1.0, 1e308, -1e308, 1e-308, 0.0))
    where = d.pick("coefficient", "coefficient", "coefficient", "start", "input", "table")
    if where == "start" or (where == "input" and not net.inputs) or (where == "table" and not net.tables):
        net.start[int(d.rng.integers(len(net.start)))] = bad
    elif where == "coefficient":
        j = int(d.rng.integers(len(net.coefs)))
        net.coefs[j] = (bad, *net.coefs[j][1:])
    elif where == "input":
        column = net.inputs[-1][int(d.rng.integers(1, 3))] if len(net.inputs[-1][2]) else net.inputs[-1][1]
        column[int(d.rng.integers(len(column)))] = bad
    else:
        column = net.tables[-1][int(d.rng.integers(3))]
        column[int(d.rng.integers(len(column)))] = bad
    return {"broken": True}


def nonsense(d: Draw) -> dict[str, Any]:
    """An ordinary network asked strange questions."""
    plain(d)
    span = _span(d)
    strange: dict[str, Any] = d.pick(
        {"times": np.array([0.0])},
        {"times": np.array([0.0, 0.0, 0.0])},
        {"times": np.repeat(span, 3)},
        {"times": span[::-1].copy()},
        {"times": np.array([0.0, np.nan, 10.0])},
        {"times": np.array([0.0, np.inf])},
        {"times": span + 1e9},
        {"times": np.array([0.0, 1e-300, 1e-12, 1.0])},
        {"times": np.array([0.0, 1e12])},
        {"options": {"max_steps": int(d.pick(0, 1, 2, -5))}},
        {"options": {"max_step": float(d.pick(np.nan, -1.0, 0.0, 1e-300, 1e-3, 1.0))}},
        {"options": {"atol": float(d.pick(np.nan, -1.0, 0.0, 1e-300, 1e-14, np.inf))}},
        {"options": {"rtol": float(d.pick(np.nan, -1.0, 0.0, 1.0, np.inf))}},
        {"options": {"input_atol": float(d.pick(np.nan, 0.0, 1e-300, np.inf))}},
        {"options": {"breaks": np.array(d.pick([np.nan], [5.0, 1.0, 1.0, -7.0, 1e9], [np.inf, 3.0], [0.0, 1e-320], []), float)}},
        {"options": {"t_end": float(d.pick(np.nan, -1.0, np.inf))}},
        {"options": {"t0": float(d.pick(np.nan, -np.inf, 1e300))}},
    )
    return {"broken": True, **strange}


def driven(d: Draw) -> dict[str, Any]:
    """Powers that step, pulse and ramp, and now and then a conductance that does."""
    d.nodes(int(d.rng.integers(2, 7)))
    d.tree((k.LINEAR, k.LINEAR, k.POWER, k.RADIATION) if d.chance(0.6) else (k.LINEAR,))
    net, n = d.net, len(d.net.capacity)
    for _ in range(int(d.rng.integers(1, 4))):
        net.load(k.SIGNAL, int(d.rng.integers(n)), net.coef(d.log(0.1, 30.0), d.course()))
    if d.chance(0.4):
        net.link(k.LINEAR, int(d.rng.integers(n)), -1, net.coef(d.log(0.05, 5.0), d.course()))
    return {"benign": True}


FAMILIES: dict[str, Callable[[Draw], dict[str, Any]]] = {
    f.__name__: f for f in (plain, extreme, stiff, runaway, switching, repeated, disconnected, steep, poisoned, nonsense, driven)
}


def draw(seed: int, family: str = "") -> Case:
    """Return the case of a seed; seeds go through the families in turn, unless one is named."""
    d = Draw(np.random.default_rng([20, seed]))
    family = family or list(FAMILIES)[seed % len(FAMILIES)]
    more = FAMILIES[family](d)
    times = more.pop("times") if "times" in more else _on_jumps(d, _span(d))
    options = {"max_steps": 20_000} | more.pop("options", {})
    return Case(seed, family, d.net, times, options, **more)
