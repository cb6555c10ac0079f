"""A network written down row by row, for the kernel and for an independent right-hand side in plain Python."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid import _kernel as k

THERMOSTAT, PROPORTIONAL = 100, 101
"""Loads of a constant power under a control, written as one row: power, on, off; gain, set point, power."""
SMOOTH2 = 1e-4
ROUND = 1e-3
ANCHOR = 300.0


@dataclass
class Net:
    """Rows of a network. Coefficients are `(value, input, {parameter: derivative})`; boundaries are numbered from -1 downward."""

    capacity: list[int] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    coefs: list[tuple[float, int, dict[int, float]]] = field(default_factory=list)
    boundaries: list[tuple[int, int]] = field(default_factory=list)
    conductors: list[tuple[int, int, int, list[int], int]] = field(default_factory=list)
    loads: list[tuple[int, int, list[int], int, int]] = field(default_factory=list)
    tables: list[tuple[Any, Any, Any]] = field(default_factory=list)
    inputs: list[tuple[int, Any, Any]] = field(default_factory=list)
    parameters: int = 0

    def coef(self, value: float, u: int = -1, **d: float) -> int:
        """Index of a new coefficient; `p3=2.0` is its derivative in parameter 3."""
        self.coefs.append((float(value), u, {int(key[1:]): float(v) for key, v in d.items()}))
        self.parameters = max([self.parameters, *(int(key[1:]) + 1 for key in d)])
        return len(self.coefs) - 1

    def node(self, capacitance: float | None, start: float = 300.0, **d: float) -> int:
        self.capacity.append(-1 if capacitance is None else self.coef(capacitance, **d))
        self.start.append(start)
        return len(self.capacity) - 1

    def boundary(self, gain: int = -1, offset: int = -1) -> int:
        self.boundaries.append((gain, offset))
        return -len(self.boundaries)

    def input(self, kind: int, a: Any, b: Any = ()) -> int:
        self.inputs.append((kind, np.atleast_1d(np.asarray(a, float)), np.asarray(b, float)))
        return len(self.inputs) - 1

    def table(self, x: Any, y: Any, d: Any) -> int:
        self.tables.append((np.asarray(x, float), np.asarray(y, float), np.asarray(d, float)))
        return len(self.tables) - 1

    def link(self, kind: int, a: int, b: int, *c: int, table: int = -1) -> None:
        self.conductors.append((kind, a, b, [*c, *[-1] * (4 - len(c))], table))

    def load(self, kind: int, node: int, *c: int, sensor: int | None = None, table: int = -1) -> None:
        self.loads.append((kind, node, [*c, *[-1] * (4 - len(c))], node if sensor is None else sensor, table))

    def at(self, node: int) -> int:
        return node if node >= 0 else len(self.capacity) - 1 - node

    @property
    def values(self) -> np.ndarray:
        return np.array([c[0] for c in self.coefs])

    @property
    def derivatives(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        indptr = np.cumsum([0, *(len(c[2]) for c in self.coefs)]).astype(np.int32)
        pairs = [(p, v) for c in self.coefs for p, v in c[2].items()]
        return indptr, np.array([p for p, _ in pairs], np.int32), np.array([v for _, v in pairs], float), self.parameters

    def shifted(self, step: np.ndarray) -> np.ndarray:
        """Coefficients after a step of the parameters (they are linear in them)."""
        return np.array([c[0] + sum(v * step[p] for p, v in c[2].items()) for c in self.coefs])

    def problem(self) -> k.Problem:
        def ints(values: Any) -> np.ndarray:
            return np.array(values, np.int32)

        def table(rows: Any) -> np.ndarray:
            return ints(rows).reshape(-1, 4)

        controls = [r for r in self.loads if r[0] >= THERMOSTAT]
        place = {id(r): j for j, r in enumerate(controls)}
        laws = [
            (k.SIGNAL, [r[2][0 if r[0] == THERMOSTAT else 2], -1, -1, -1], r[1]) if r[0] >= THERMOSTAT else (r[0], r[2], r[3])
            for r in self.loads
        ]
        settings = [[r[2][1], r[2][2], -1] if r[0] == THERMOSTAT else r[2][:3] for r in controls]
        return k.Problem(
            capacity=ints(self.capacity),
            coef_input=ints([c[1] for c in self.coefs]),
            boundary_gain=ints([b[0] for b in self.boundaries]),
            boundary_offset=ints([b[1] for b in self.boundaries]),
            conductor_kind=ints([c[0] for c in self.conductors]),
            conductor_a=ints([self.at(c[1]) for c in self.conductors]),
            conductor_b=ints([self.at(c[2]) for c in self.conductors]),
            conductor_coef=table([c[3] for c in self.conductors]),
            conductor_table=ints([c[4] for c in self.conductors]),
            load_kind=ints([r[0] for r in laws]),
            load_node=ints([r[1] for r in self.loads]),
            load_coef=table([r[1] for r in laws]),
            load_sensor=ints([self.at(r[2]) for r in laws]),
            load_table=ints([r[4] for r in self.loads]),
            load_control=ints([place.get(id(r), -1) for r in self.loads]),
            control_kind=ints([k.THERMOSTAT if r[0] == THERMOSTAT else k.PROPORTIONAL for r in controls]),
            control_sensor=ints([self.at(r[3]) for r in controls]),
            control_coef=ints(settings).reshape(-1, 3),
            tables=self.tables,
            inputs=self.inputs,
        )

    def run(self, times: Any, nodes: Any = None, coef: Any = None, start: Any = None, sens: bool = False, **options: Any) -> k.Result:
        times = np.asarray(times, float)
        nodes = np.arange(len(self.capacity)) if nodes is None else np.array([self.at(i) for i in nodes])
        if sens:
            options.setdefault("dcoef", self.derivatives)
        return self.problem().integrate(
            self.values if coef is None else coef,
            np.array(self.start if start is None else start, float),
            float(options.pop("t0") if "t0" in options else times[0]),
            float(options.pop("t_end") if "t_end" in options else times[-1]),
            times,
            nodes.astype(np.int32),
            **options,
        )

    # The independent right-hand side.
    def signal(self, i: int, t: float) -> float:
        kind, a, b = self.inputs[i]
        if kind == k.SAMPLED_LINEAR:
            return float(np.interp(t, a, b))
        if kind == k.SAMPLED_HOLD:
            return float(b[max(0, int(np.searchsorted(a, t, side="right")) - 1)])
        if kind == k.SINE:
            return float(a[0] + a[1] * math.sin(2 * math.pi * t / a[2] + a[3]))
        return float(a[0])

    def all_temperatures(self, temperatures: Any, t: float, coef: Any = None) -> np.ndarray:
        c = self.effective(t, coef)
        edge = [sum(c[j] for j in pair if j >= 0) for pair in self.boundaries]
        return np.array([*temperatures, *edge])

    def effective(self, t: float, coef: Any = None) -> list[float]:
        values = self.values if coef is None else coef
        return [v * (self.signal(c[1], t) if c[1] >= 0 else 1.0) for v, c in zip(values, self.coefs, strict=True)]

    def look_up(self, table: int, at: float) -> float:
        """Cubic Hermite value in Bernstein form, constant outside."""
        x, y, d = self.tables[table]
        if not x[0] < at < x[-1]:
            return float(y[0] if at <= x[0] else y[-1])
        i = bisect.bisect_right(x, at) - 1
        w = x[i + 1] - x[i]
        s = (at - x[i]) / w
        points = (y[i], y[i] + w * d[i] / 3, y[i + 1] - w * d[i + 1] / 3, y[i + 1])
        return float(sum(math.comb(3, j) * s**j * (1 - s) ** (3 - j) * v for j, v in enumerate(points)))

    def heat(self, row: tuple[int, int, int, list[int], int], temperatures: np.ndarray, c: list[float]) -> float:
        kind, a, b, slots, table = row
        ta, tb = temperatures[self.at(a)], temperatures[self.at(b)]
        d, g = ta - tb, c[slots[0]]
        if kind == k.POWER:
            return g * d * (d * d + SMOOTH2) ** (c[slots[1]] / 2)
        if kind == k.RADIATION:
            return g * (ta**4 - tb**4)
        if kind == k.TABLE_MEAN:
            return g * self.look_up(table, (ta + tb) / 2) * d
        if kind == k.TABLE_DIFF:
            return g * self.look_up(table, d) * d
        if kind == k.GAS:  # resistances of the gas as a continuum and of molecules that meet the walls alone, one behind the other
            mean = (ta + tb) / 2
            return g * d / (1 / self.look_up(table, mean) + math.sqrt(mean / ANCHOR) / c[slots[1]])
        if kind in (k.HINGE_MEAN, k.HINGE_DIFF):
            beyond = ((ta + tb) / 2 if kind == k.HINGE_MEAN else d) - c[slots[1]]
            return g * d * (max(beyond, 0.0) if abs(beyond) >= ROUND else (beyond + ROUND) ** 2 / (4 * ROUND))
        if kind == k.POTENTIAL:
            return g * (self.look_up(table, ta) - self.look_up(table + 1, tb))
        if kind == k.NATURAL:  # Nu over signed Ra^(1/4); conductivity and Ra^(1/4) for 1 K over film temperature
            mean, root = (ta + tb) / 2, d / (d * d + SMOOTH2) ** 0.375
            nusselt = self.look_up(table, c[slots[1]] * self.look_up(table + 2, mean) * root)
            return g * d * self.look_up(table + 1, mean) * nusselt
        if kind in (k.LINEAR, k.FLOW):
            return g * d
        name = next(name for name, law in k.CONDUCTOR_LAWS.items() if law[0] == kind)
        raise NotImplementedError(f"the reference has no formula of the law '{name}': add it to Net.heat of tests/unit/kernel/reference.py")

    def power(self, row: tuple[int, int, list[int], int, int], temperatures: np.ndarray, c: list[float], on: bool = False) -> float:
        kind, _, slots, sensor, table = row
        v = [c[j] if j >= 0 else 0.0 for j in slots]
        t = temperatures[self.at(sensor)]
        if kind == k.POLY:
            return v[0] * (1 + v[1] * (t - v[3]) + v[2] * (t - v[3]) ** 2)
        if kind == k.EXP:
            return v[0] * math.exp(v[1] * (t - v[2]))
        if kind == k.TABLE:
            return v[0] * self.look_up(table, t)
        if kind == THERMOSTAT:
            return v[0] if on else 0.0
        if kind == PROPORTIONAL:
            return min(max(v[0] * (v[1] - t), 0.0), v[2])
        return v[0]

    def net_heat(self, t: float, temperatures: Any, coef: Any = None, on: Any = ()) -> np.ndarray:
        """Net heat into each unknown node. [W]"""
        n = len(self.capacity)
        c = self.effective(t, coef)
        every = self.all_temperatures(temperatures, t, coef)
        f = np.zeros(len(every))
        for row in self.conductors:
            q = self.heat(row, every, c)
            f[self.at(row[2])] += q
            if row[0] != k.FLOW:
                f[self.at(row[1])] -= q
        for i, row in enumerate(self.loads):
            f[row[1]] += self.power(row, every, c, bool(on[i]) if len(on) else False)
        return f[:n]

    def capacities(self, coef: Any = None) -> np.ndarray:
        values = self.values if coef is None else coef
        return np.array([values[j] if j >= 0 else 0.0 for j in self.capacity])
