"""An independent solution of networks with controls: integrated here from the dictionary of a deck alone, with scipy.

Nothing of thermid is used. Controllers are written as their equations in continuous time, samples as what happens at their instants.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from oracle import SIGMA, si

Array = NDArray[np.float64]


class Controlled:
    """A flat deck of nodes with capacitance, linear and radiating conductors, constant loads and controls, its boundaries constant."""

    def __init__(self, deck: dict[str, Any], boundaries: dict[str, float], start: float) -> None:
        self.deck, self.boundaries = deck, boundaries
        self.nodes = list(deck["nodes"])
        self.controls = deck["controls"]
        self.c = np.array([si(n["capacitance"]) for n in deck["nodes"].values()])
        self.mode = {name: c.get("starts", "off") for name, c in self.controls.items() if "modes" in c or "thermostat" in c}
        self.entered = dict.fromkeys(self.mode, 0.0)
        self.held: dict[str, float] = {}
        self.integral = {name: si(c["pid"].get("begins", 0.0)) for name, c in self.controls.items() if "pid" in c}
        self.lag = {name: start for name, c in self.controls.items() if "derivative_time" in c.get("pid", {})}
        self.free = [name for name in self.integral if "sample" not in self.controls[name]]
        self.lags = [name for name in self.lag if "sample" not in self.controls[name]]
        self.temperature = np.full(len(self.nodes), start)
        self.events: list[tuple[float, str]] = []

    def seen(self, follows: Any, t: Array) -> float:
        """Return what a control follows, at temperatures of nodes. [K]"""
        if isinstance(follows, str):
            follows = {follows: 1.0}
        if isinstance(follows, list):
            follows = {n: 1.0 / len(follows) for n in follows}
        return sum(w * (self.boundaries[n] if n in self.boundaries else t[self.nodes.index(n)]) for n, w in follows.items())

    def output(self, name: str, t: Array, x: dict[str, float], d: dict[str, float]) -> float:
        """Return what a table or controller gives without a sample time. [-]"""
        c = self.controls[name]
        at = self.seen(c["follows"], t)
        if "table" in c:
            px, py = ([si(p[k]) for p in c["table"]["points"]] for k in (0, 1))
            return float(np.interp(at, px, py))
        kind = "pid" if "pid" in c else "proportional"
        f = {k: si(v) for k, v in c[kind].items()}
        z = (f["setpoint"] - at) / f["band"]
        if kind == "pid":
            z += x[name]
            if name in d:
                z -= f["derivative_time"] * (at - d[name]) / ((f["filter_time"] + si(c.get("sample", 0.0))) * f["band"])
        return float(np.clip(z, f.get("lowest", 0.0), f.get("highest", 1.0)))

    def share(self, raw: str, t: Array, x: dict[str, float], d: dict[str, float]) -> float:
        rest, name = raw.startswith("1 - "), raw.removeprefix("1 - ")
        c = self.controls[name]
        if "thermostat" in c:
            found = float(self.mode[name] == "on")
        elif "modes" in c:
            found = si(c["modes"][self.mode[name]])
        else:
            found = self.held[name] if "sample" in c else self.output(name, t, x, d)
        return 1.0 - found if rest else found

    def product(self, element: dict[str, Any], t: Array, x: dict[str, float], d: dict[str, float]) -> float:
        names = element.get("control", [])
        return float(np.prod([self.share(n, t, x, d) for n in ([names] if isinstance(names, str) else names)]))

    def rates(self, _: float, y: Array) -> Array:
        n, m = len(self.nodes), len(self.free)
        t, x = y[:n], {**self.integral, **dict(zip(self.free, y[n : n + m], strict=True))}
        d = {**self.lag, **dict(zip(self.lags, y[n + m :], strict=True))}
        heat = np.zeros(n)
        for c in self.deck["conductors"].values():
            a, b = c["between"]
            ta, tb = (self.boundaries[e] if e in self.boundaries else t[self.nodes.index(e)] for e in (a, b))
            q = self.product(c, t, x, d)
            if c["kind"] == "radiation":
                q *= si(c["emissivity"]) * si(c["area"]) * SIGMA * (ta**4 - tb**4)
            elif c["kind"] == "flow":
                q *= si(c["mass_flow"]) * si(c["specific_heat"]) * (ta - tb)
            else:
                q *= si(c["conductance"]) * (ta - tb)
            if a in self.nodes and c["kind"] != "flow":
                heat[self.nodes.index(a)] -= q
            if b in self.nodes:
                heat[self.nodes.index(b)] += q
        for load in self.deck["loads"].values():
            heat[self.nodes.index(load["into"])] += si(load["power"]) * self.product(load, t, x, d)
        dx = [(self.output(k, t, x, d) - x[k]) / si(self.controls[k]["pid"]["integral_time"]) for k in self.free]
        dd = [(self.seen(self.controls[k]["follows"], t) - d[k]) / si(self.controls[k]["pid"]["filter_time"]) for k in self.lags]
        return np.concatenate([heat / self.c, dx, dd])

    def ways(self, name: str) -> list[tuple[str, str, float, Any, float]]:
        """Return from, to, sense (1 above, -1 below, 0 after a time), what is followed, level."""
        c = self.controls[name]
        if "thermostat" in c:
            f = c["thermostat"]
            if "on_below" in f:
                return [("off", "on", -1.0, c["follows"], si(f["on_below"])), ("on", "off", 1.0, c["follows"], si(f["off_above"]))]
            return [("off", "on", 1.0, c["follows"], si(f["on_above"])), ("on", "off", -1.0, c["follows"], si(f["off_below"]))]
        out = []
        for w in c["transitions"].values():
            sense = {"above": 1.0, "below": -1.0, "after": 0.0}[next(k for k in ("above", "below", "after") if k in w)]
            level = si(w.get("above", w.get("below", w.get("after"))))
            out.append((w["from"], w["to"], sense, w.get("follows", c.get("follows")), level))
        return out

    def gap(self, name: str, way: tuple[str, str, float, Any, float], time: float, t: Array) -> float:
        _, _, sense, follows, level = way
        return time - self.entered[name] - level if sense == 0.0 else sense * (self.seen(follows, t) - level)

    def settle(self, time: float, t: Array, changed: str = "") -> None:
        """Carry out the switchings that are due at once."""
        for _ in range(50):
            for name, mode in self.mode.items():
                due = [w for w in self.ways(name) if w[0] == mode and self.gap(name, w, time, t) >= (0.0 if w[2] else -1e-12)]
                if due:
                    self.mode[name], self.entered[name] = due[0][1], time
                    if time > 0.0:
                        self.events.append((time, name))
                    break
            else:
                return

    def sample(self, time: float) -> None:
        t = self.temperature
        for name, c in self.controls.items():
            if "sample" not in c:
                continue
            period = si(c["sample"])
            if abs(time / period - round(time / period)) > 1e-9:
                continue
            u = self.output(name, t, self.integral, self.lag)
            self.held[name] = u
            if "pid" in c:
                self.integral[name] += period / si(c["pid"]["integral_time"]) * (u - self.integral[name])
            if name in self.lag:
                at = self.seen(c["follows"], t)
                self.lag[name] += period / (period + si(c["pid"]["filter_time"])) * (at - self.lag[name])

    def run(self, times: Array) -> Array:
        """Return temperatures (times, nodes) of the nodes in the order of the deck. [K]"""
        n, m, end = len(self.nodes), len(self.free), float(times[-1])
        periods = {si(c["sample"]) for c in self.controls.values() if "sample" in c}
        stops = sorted({end, *(k * p for p in periods for k in range(1, int(end / p) + 1))})
        self.sample(0.0)
        self.settle(0.0, self.temperature)
        out, now = np.full((times.size, n), np.nan), 0.0
        out[times == 0.0] = self.temperature
        y = np.concatenate([self.temperature, [self.integral[k] for k in self.free], [self.lag[k] for k in self.lags]])
        while now < end:
            stop = next(s for s in stops if s > now + 1e-12)
            active = [(name, w) for name, mode in self.mode.items() for w in self.ways(name) if w[0] == mode]
            events = []
            for name, way in active:

                def crossing(time: float, state: Array, name: str = name, way: Any = way) -> float:
                    return self.gap(name, way, time, state[:n])

                crossing.terminal, crossing.direction = True, 1.0  # type: ignore[attr-defined]
                events.append(crossing)
            found = solve_ivp(
                self.rates, (now, stop), y, "DOP853", rtol=1e-10, atol=1e-9, events=events or None, dense_output=True, max_step=20.0
            )
            last = float(found.t[-1])
            inside = (times > now) & (times <= last)
            if inside.any():
                out[inside] = found.sol(times[inside])[:n].T
            y, now = found.y[:, -1].copy(), last
            self.temperature = y[:n]
            self.integral |= dict(zip(self.free, y[n : n + m], strict=True))
            self.lag |= dict(zip(self.lags, y[n + m :], strict=True))
            if found.status == 1:
                k = next(k for k, at in enumerate(found.t_events) if at.size)
                name, way = active[k]
                self.mode[name], self.entered[name] = way[1], now
                self.events.append((now, name))
            if abs(now - stop) < 1e-12:
                self.sample(now)
            self.settle(now, self.temperature)
        return out
