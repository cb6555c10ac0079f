"""Random networks of every kind of element, as decks, and the same equations written out here for scipy's Radau method at 1e-10.

Of thermid nothing is used for the truth but what falls on a face in orbit, and the conductance of a duct at rest; both have their own
oracles (tests/unit/site, tests/unit/simulation/network). ``python -m torture.elements NUMBER SEED`` in the folder tests prints one JSON object.
"""

# ruff: noqa: E501  # lines of equations

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import thermid as td
from thermid.base.errors import ThermidError

Array = NDArray[np.float64]
SIGMA: Final = 5.670374419e-8
ALLOWED: Final = 1e-3
"""Error that is silent where nothing is said. [K]"""
CLOSES: Final = 1e-9
"""Share of the heat by which a balance may be open."""
Heat = Callable[[float, Array, Array], None]
"""Adds heats [W] at a time [s] and temperatures [K] of all nodes and boundaries."""


class NoVerdictError(Exception):
    """The oracle is not sure of its own answer."""


class Network:
    """A deck that grows element by element, and its equations."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([22, seed])
        self.deck: dict[str, Any] = {"title": f"n{seed}", "needs": ["air", "space"], "nodes": {}, "conductors": {}, "loads": {}}
        self.scenario: dict[str, Any] = {"boundaries": {}, "irradiation": {}, "duration": 0.0}
        self.nodes: list[str] = []
        self.capacity: list[float] = []
        self.melts: dict[int, dict[str, float]] = {}
        self.heats: list[Heat] = []
        self.outside: dict[str, Callable[[float], float]] = {}
        self.mode: dict[str, bool] = {}
        """Thermostats that are on, and melts that are liquid below their melting point."""
        self.watched: list[tuple[str, int, float, float]] = []
        """Thermostats: name, node, on below, off above."""
        self.shares: dict[str, Callable[[Array, Array], float]] = {}
        """Controls: temperatures and integrals -> share."""
        self.integrals: list[tuple[str, Callable[[Array, Array], float]]] = []
        self.breaks: set[float] = set()
        self.kinds: set[str] = set()
        self.integral: Array = np.zeros(0)
        """What controllers have integrated, now. [-]"""
        self.start, self.middle = 290.0, 0.0
        """Temperature at the start [K], and the middle of the stretch under way, by which pulses are on or off. [s]"""
        self.steps: Array = np.zeros(0)
        """Knots of an orbit. [s]"""

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def one(self, *names: str) -> str:
        return str(self.rng.choice(names or self.nodes))

    def at(self, name: str) -> int:
        """Return the place of a node or boundary among all temperatures."""
        return self.nodes.index(name) if name in self.nodes else len(self.nodes) + [*self.outside].index(name)

    def flows(self, a: str, b: str, heat: Callable[[float, Array, float, float], float]) -> None:
        """Add an element that carries heat from a node to another: a function of time, temperatures and both ends."""

        def add(t: float, every: Array, q: Array, ends: list[int] = []) -> None:  # noqa: B006  # found once, when all nodes are known
            if not ends:
                ends.extend((self.at(a), self.at(b)))
            i, j = ends
            w = heat(t, every, every[i], every[j])
            q[i] -= w
            q[j] += w

        self.heats.append(add)

    def into(self, node: str, power: Callable[[float, Array], float]) -> None:
        """Add a load."""

        def add(t: float, every: Array, q: Array) -> None:
            q[self.at(node)] += power(t, every)

        self.heats.append(add)

    def share(self, name: str) -> Callable[[Array], float]:
        """Return the share that an element has by a control; one without."""
        return (lambda every: self.shares[name](every, self.integral)) if name else (lambda every: 1.0)


def linear(g: float) -> Callable[[float, Array, float, float], float]:
    """Return what a conductance carries."""
    return lambda t, every, a, b: g * (a - b)


def always(power: float) -> Callable[[float, Array], float]:
    """Return a power that is constant."""
    return lambda t, every: power


def _nodes(n: Network) -> None:
    for k in range(int(n.rng.integers(2, 5))):
        n.nodes.append(f"n{k}")
        n.capacity.append(float(np.exp(n.between(np.log(30.0), np.log(800.0)))))
        n.deck["nodes"][f"n{k}"] = {"capacitance": f"{n.capacity[-1]!r} [J/K]"}


def _outside(n: Network) -> None:
    level, kind = n.between(285.0, 305.0), n.rng.integers(3)
    duration = float(n.scenario["duration"])
    if kind == 0:
        n.scenario["boundaries"]["air"], n.outside["air"] = f"{level!r} [K]", lambda t: level
    elif kind == 1:
        size, period = n.between(1.0, 8.0), n.between(0.3, 2.0) * duration
        n.scenario["boundaries"]["air"] = {"mean": f"{level!r} [K]", "amplitude": f"{size!r} [K]", "period": f"{period!r} [s]"}
        n.outside["air"] = lambda t: level + size * np.sin(2.0 * np.pi * t / period)
    else:
        times = np.array([0.0, 0.3, 0.35, 0.7, 1.0]) * duration
        values = level + n.rng.normal(0.0, 6.0, 5)
        table = {"times": [f"{t!r} [s]" for t in times.tolist()], "values": [f"{v!r} [K]" for v in values.tolist()]}
        n.scenario["boundaries"]["air"], n.outside["air"] = table, lambda t: float(np.interp(t, times, values))
        n.breaks |= set(times[1:-1].tolist())
    n.scenario["boundaries"]["space"], n.outside["space"] = "3 [K]", lambda t: 3.0


def _tree(n: Network) -> None:
    """Conductors that join every node to the air: plain ones, films whose carrier is said, radiation, a joint without mass."""
    for k, name in enumerate(n.nodes):
        other = "air" if k == 0 else n.one(*n.nodes[:k], "air")
        g = n.between(0.1, 2.0)
        kind = n.one("conduction", "film", "radiation", "joint")
        n.kinds.add("carried_by" if kind == "film" else kind)
        if kind == "film":
            carrier = n.one("free air", "fan", "cold plate", "leads")
            row: dict[str, Any] = {"kind": "convection", "htc": f"{g * 40.0!r} [W/(m^2 K)]", "area": "0.025 [m^2]", "carried_by": carrier}
        elif kind == "radiation":
            row = {"kind": "radiation", "emissivity": 0.8, "area": "0.03 [m^2]"}
        else:
            row = {"kind": "conduction", "conductance": f"{g!r} [W/K]"}
        if kind == "joint":
            h = n.between(0.1, 2.0)
            n.deck["nodes"][f"j{k}"] = {}
            n.deck["conductors"][f"c{k}"] = row | {"between": [name, f"j{k}"]}
            n.deck["conductors"][f"d{k}"] = row | {"between": [f"j{k}", other], "conductance": f"{h!r} [W/K]"}
            n.flows(name, other, linear(g * h / (g + h)))
            continue
        n.deck["conductors"][f"c{k}"] = row | {"between": [name, other]}
        if kind == "radiation":
            n.flows(name, other, lambda t, every, a, b: 0.8 * 0.03 * SIGMA * (a**4 - b**4))
            n.deck["conductors"][f"e{k}"] = {"kind": "conduction", "between": [name, other], "conductance": f"{g!r} [W/K]"}
        n.flows(name, other, linear(g))


def _loads(n: Network) -> None:
    """Constant powers, pulses."""
    for k in range(int(n.rng.integers(1, 3))):
        node, power = n.one(), n.between(0.5, 8.0)
        row: dict[str, Any] = {"into": node, "power": f"{power!r} [W]"}
        if n.chance(0.3):
            n.kinds.add("pulses")
            period, duty = float(n.scenario["duration"]) / n.between(2.0, 6.0), n.between(0.2, 0.8)
            row["periodic"] = {"period": f"{period!r} [s]", "duty": duty}
            edges = [m * period + e for m in range(8) for e in (0.0, duty * period)]
            n.breaks |= {e for e in edges if 0.0 < e < n.scenario["duration"]}
            n.into(node, _pulses(n, power, period, duty))
        else:
            n.into(node, always(power))
        n.deck["loads"][f"q{k}"] = row


def _pulses(n: Network, power: float, period: float, duty: float) -> Callable[[float, Array], float]:
    return lambda t, every: power * float((n.middle % period) < duty * period)


def _thermostat(n: Network) -> None:
    node, sensor, low = n.one(), n.one(), n.between(292.0, 312.0)
    power, width = n.between(3.0, 25.0), n.between(0.5, 6.0)
    name = f"t{len(n.watched)}"
    n.watched.append((name, n.at(sensor), low, low + width))
    n.mode[name] = False
    row: dict[str, Any] = {"into": node, "power": f"{power!r} [W]"}
    limits = {"on_below": f"{low!r} [K]", "off_above": f"{low + width!r} [K]"}
    if n.chance(0.5):
        n.kinds.add("thermostat of a load")
        row["thermostat"] = limits | {"sensor": sensor}
    else:
        n.kinds.add("thermostat as a control")
        n.deck.setdefault("controls", {})[name] = {"follows": sensor, "thermostat": limits}
        row["control"] = name
    n.deck["loads"][f"heater_{name}"] = row
    n.into(node, lambda t, every: power * n.mode[name])


def _control(n: Network) -> None:
    """A valve by a table, a proportional or a PI controller on a heater."""
    controls, kind, node = n.deck.setdefault("controls", {}), n.one("table", "proportional", "pid"), n.one()
    name, at = f"v{len(controls)}", n.at(node)
    n.kinds.add(f"control by {kind}")
    if kind == "table":
        low, width = n.between(290.0, 305.0), n.between(4.0, 20.0)
        points = [[f"{low!r} [K]", "0.1"], [f"{low + width!r} [K]", "1"]]
        controls[name] = {"follows": node, "table": {"points": points}}
        n.shares[name] = lambda every, x: float(np.interp(every[at], [low, low + width], [0.1, 1.0]))
        g, share = n.between(0.2, 1.0), n.share(name)
        link = {"kind": "conduction", "between": [node, "air"], "conductance": f"{g!r} [W/K]"}
        n.deck["conductors"][f"valve_{name}"] = link | {"control": name}
        n.flows(node, "air", lambda t, every, a, b: share(every) * g * (a - b))
        return
    point, band, power = n.between(295.0, 315.0), n.between(2.0, 10.0), n.between(5.0, 20.0)
    row = {"setpoint": f"{point!r} [K]", "band": f"{band!r} [K]"}
    if kind == "pid":
        pace, slot = n.between(200.0, 900.0), len(n.integrals)
        controls[name] = {"follows": node, "pid": row | {"integral_time": f"{pace!r} [s]"}}

        def output(every: Array, x: Array) -> float:
            return float(np.clip((point - every[at]) / band + x[slot], 0.0, 1.0))

        n.integrals.append((name, lambda every, x: (output(every, x) - x[slot]) / pace))
        n.shares[name] = output
    else:
        controls[name] = {"follows": node, "proportional": row}
        n.shares[name] = lambda every, x: float(np.clip((point - every[at]) / band, 0.0, 1.0))
    share = n.share(name)
    n.deck["loads"][f"heater_{name}"] = {"into": node, "power": f"{power!r} [W]", "control": name}
    n.into(node, lambda t, every: power * share(every))


def _melt(n: Network) -> None:
    name, mass = f"wax{len(n.melts)}", n.between(0.01, 0.06)
    low, width = n.between(298.0, 308.0), n.between(0.5, 4.0)
    f = {
        "m": mass,
        "c": n.between(1500.0, 2500.0),
        "l": n.between(1500.0, 3000.0),
        "h": n.between(8e4, 2.5e5),
        "low": low,
        "high": low + width,
    }
    row = {
        "mass": f"{mass!r} [kg]",
        "specific_heat": f"{f['c']!r} [J/(kg K)]",
        "liquid_specific_heat": f"{f['l']!r} [J/(kg K)]",
        "latent_heat": f"{f['h']!r} [J/kg]",
        "melts_from": f"{low!r} [K]",
        "melts_to": f"{low + width!r} [K]",
    }
    n.kinds.add("latent heat")
    if n.chance(0.6):
        n.kinds.add("supercooling")
        f["cold"] = n.between(0.5, 8.0)
        row["supercooling"] = f"{f['cold']!r} [K]"
        n.mode[name] = False
    f["solid"] = mass * f["c"] * low
    f["molten"] = f["solid"] + mass * (f["h"] + 0.5 * (f["c"] + f["l"]) * width)
    other, g = n.one(), n.between(0.3, 2.0)
    n.deck["nodes"][name], n.melts[len(n.nodes)] = row, f
    n.nodes.append(name)
    n.capacity.append(1.0)
    n.deck["conductors"][f"to_{name}"] = {"kind": "conduction", "between": [other, name], "conductance": f"{g!r} [W/K]"}
    n.flows(other, name, lambda t, every, a, b: g * (a - b))


def _peltier(n: Network) -> None:
    if len(n.nodes) < 2:
        return
    cold, hot = (str(x) for x in n.rng.choice([x for x in n.nodes if x.startswith("n")], 2, replace=False))
    v, i, d, t = n.between(8.0, 15.0), n.between(3.0, 7.0), n.between(60.0, 70.0), 298.15
    current = n.between(0.1, 0.3) * i
    row = {"V_max": f"{v!r} [V]", "I_max": f"{i!r} [A]", "dT_max": f"{d!r} [K]", "T_hot": f"{t!r} [K]", "current": f"{current!r} [A]"}
    n.deck.setdefault("coolers", {})["tec"] = {"cold": cold, "hot": hot, **row}
    n.deck["conductors"]["fins"] = {"kind": "conduction", "between": [hot, "air"], "conductance": "3 [W/K]"}
    s, r, g = v / t, v * (t - d) / (i * t), v * i * (t - d) / (2.0 * t * d)
    n.kinds.add("Peltier")
    n.flows(hot, "air", lambda _, every, a, b: 3.0 * (a - b))
    n.flows(hot, cold, lambda _, every, a, b: g * (a - b))
    n.into(cold, lambda _, every: -s * current * every[n.at(cold)] + 0.5 * r * current**2)
    n.into(hot, lambda _, every: s * current * every[n.at(hot)] + 0.5 * r * current**2)


_DUCTS: dict[str, float] = {}


def _duct(fields: dict[str, Any]) -> float:
    """Return the conductance of a duct: what a watt raises its wall over its air, at rest. [W/K]"""
    key = json.dumps(fields)
    if key not in _DUCTS:
        deck = {
            "title": "duct",
            "needs": ["room"],
            "nodes": {"wall": {"capacitance": "10 [J/K]"}, "gas": {"capacitance": "1 [J/K]", "stands_for": "air"}},
            "conductors": {
                "in": {"kind": "flow", "between": ["room", "gas"], "fluid": "air", "volume_flow": fields["volume_flow"]},
                "duct": {"kind": "duct", "between": ["wall", "gas"], **fields},
            },
            "loads": {"q": {"into": "wall", "power": "1 [W]"}},
        }
        found = td.steady(td.model_from_dict(deck), td.Scenario(boundaries={"room": "300 [K]"}))
        _DUCTS[key] = 1.0 / (found["wall"] - found["gas"])
    return _DUCTS[key]


def _stream(n: Network) -> None:
    """Air through one or two volumes and out again, and a duct that gives it a wall's heat."""
    places = [f"s{k}" for k in range(int(n.rng.integers(1, 3)))]
    pace = n.between(0.5, 3.0)
    mass = {"mass_flow": f"{pace / 1006.0!r} [kg/s]", "specific_heat": "1006 [J/(kg K)]"}
    for place in places:
        n.nodes.append(place)
        n.capacity.append(n.between(2.0, 20.0))
        n.deck["nodes"][place] = {"capacitance": f"{n.capacity[-1]!r} [J/K]", "stands_for": "air"}
    n.kinds.add("stream")
    for k, (a, b) in enumerate(zip(["air", *places], [*places, "air"], strict=True)):
        n.deck["conductors"][f"f{k}"] = {"kind": "flow", "between": [a, b], **mass}

        def carried(_: float, every: Array, q: Array, a: str = a, b: str = b) -> None:
            q[n.at(b)] += pace * (every[n.at(a)] - every[n.at(b)])

        n.heats.append(carried)
    wall = n.one(*[x for x in n.nodes if x.startswith("n")])
    if n.chance(0.7):
        n.kinds.add("duct")
        sizes = {"width": "12 [mm]", "height": "60 [mm]", "length": "20 [cm]", "count": int(n.rng.integers(1, 4))}
        fields = sizes | {"volume_flow": f"{float(n.rng.choice([2.0, 12.0, 30.0]))} [m^3/h]"}
        n.deck["conductors"]["duct"] = {"kind": "duct", "between": [wall, places[0]], **fields}
        g = _duct(fields)
    else:
        g = n.between(0.3, 2.0)
        n.deck["conductors"]["fin"] = {"kind": "conduction", "between": [wall, places[0]], "conductance": f"{g!r} [W/K]"}
    n.flows(wall, places[0], lambda _, every, a, b: g * (a - b))


def _orbit(n: Network) -> None:
    """A face that sees space, in sun, albedo and infrared of an orbit."""
    node, area, dark, grey = (
        n.one(*[x for x in n.nodes if x.startswith("n")]),
        n.between(0.01, 0.05),
        n.between(0.2, 0.9),
        n.between(0.5, 0.9),
    )
    low = td.site.orbit_fluxes(
        f"{n.between(300.0, 800.0)!r} [km]", albedo=0.3, infrared="234 [W/m^2]", beta=n.between(0.0, 60.0), begin=n.between(0.0, 300.0)
    )
    fluxes = low.irradiation()[n.one("nadir", "zenith", "ram", "north")]
    sun, infrared = fluxes.sun(None), fluxes.infrared
    assert sun is not None
    assert infrared is not None
    row = {"of": node, "to": "space", "area": f"{area!r} [m^2]", "htc": 0, "emissivity": grey, "absorptance": dark}
    n.deck.setdefault("surfaces", {})["panel"] = row
    n.scenario["irradiation"]["panel"] = fluxes
    n.kinds.add("orbit")
    grid = np.unique(np.concatenate([s.knots(0.0, float(n.scenario["duration"])) for s in (sun, infrared)]))
    grid = np.unique(np.clip(np.append(grid, n.scenario["duration"]), 0.0, n.scenario["duration"]))
    absorbed = area * (dark * sun.at(grid) + grey * infrared.at(grid))
    n.flows(node, "space", lambda t, every, a, b: area * grey * SIGMA * (a**4 - b**4))
    n.into(node, lambda t, every: float(np.interp(t, grid, absorbed)))
    n.steps = grid


def _cavity(n: Network) -> None:
    """Three grey faces that see one another and the air through a window, with the sun on one of them, bounce after bounce."""
    faces = [x for x in n.nodes if x.startswith("n")][:3]
    if len(faces) < 3:
        return
    n.kinds.add("bounces of the sun")
    areas = np.array([0.01, 0.02, 0.015])
    seen = 0.01 * np.array([[0.0, 0.35, 0.25], [0.35, 0.2, 0.6], [0.25, 0.6, 0.1]])
    factors = seen / areas[:, None]
    grey, dark = n.rng.uniform(0.3, 0.95, 3), n.rng.uniform(0.2, 0.9, 3)
    for k, node in enumerate(faces):
        n.deck.setdefault("surfaces", {})[f"face{k}"] = {
            "of": node, "to": "air", "area": f"{float(areas[k])!r} [m^2]", "htc": "5 [W/(m^2 K)]", "emissivity": float(grey[k]), "absorptance": float(dark[k]),
        }  # fmt: skip
        n.flows(node, "air", linear(5.0 * areas[k]))
    box = {"faces": {f"face{k}": f"face{k}" for k in range(3)}, "view_factors": factors.tolist(), "rest": "air"}
    n.deck["enclosures"] = {"box": box}
    # radiosities: J = e sigma T^4 + (1 - e) (F J + window); what a face loses is A (J - H)
    rest = 1.0 - factors.sum(axis=1)
    solve = np.linalg.inv(np.eye(3) - (1.0 - grey)[:, None] * factors)

    def exchange(t: float, every: Array, q: Array) -> None:
        at = [n.at(x) for x in faces]
        room = SIGMA * every[n.at("air")] ** 4
        out = solve @ (grey * SIGMA * every[at] ** 4 + (1.0 - grey) * rest * room)
        lost = areas * (out - factors @ out - rest * room)
        q[at] -= lost

    n.heats.append(exchange)
    lit, strength = int(n.rng.integers(3)), n.between(100.0, 900.0)
    n.scenario["irradiation"][f"face{lit}"] = td.simulation.Irradiation(direct=f"{strength!r} [W/m^2]")
    falls, taken = np.zeros(3), np.zeros(3)
    falls[lit] = strength * areas[lit]
    for _ in range(400):
        taken += dark * falls
        falls = ((1.0 - dark) * falls) @ factors
    for k, node in enumerate(faces):
        n.into(node, always(float(taken[k])))


def network(seed: int) -> Network:
    """Return the network of a seed."""
    n = Network(seed)
    orbits = n.chance(0.15)
    n.scenario["duration"] = float(n.rng.choice([1200.0, 2400.0])) if orbits else float(n.rng.choice([1800.0, 5400.0, 14400.0]))
    _nodes(n)
    _outside(n)
    _tree(n)
    for share, make in ((0.35, _melt), (0.3, _stream), (0.3, _peltier)):
        if n.chance(share):
            make(n)
    _loads(n)
    for share, make in ((0.4, _thermostat), (0.15, _thermostat), (0.4, _control), (0.2, _control)):
        if n.chance(share):
            make(n)
    if orbits:
        _orbit(n)
    elif n.chance(0.25):
        _cavity(n)
    n.start = n.between(285.0, 296.0)
    return n


class Truth:
    """A network as scipy sees it: temperatures, the heat of melts, integrals of controllers."""

    def __init__(self, n: Network) -> None:
        self.n, self.size = n, len(n.nodes)
        self.capacity = np.array(n.capacity)
        self.y = np.concatenate([np.full(self.size, n.start), np.zeros(len(n.integrals))])
        for k, f in n.melts.items():
            self.y[k] = f["m"] * f["c"] * n.start
            if n.start >= f["low"]:
                raise NoVerdictError
        self.calls = 0

    def temperatures(self, t: float, y: Array) -> Array:
        """Return those of nodes and boundaries. [K]"""
        out = np.concatenate([y[: self.size], [course(t) for course in self.n.outside.values()]])
        for k, f in self.n.melts.items():
            heat = y[k]
            if self.n.mode.get(self.n.nodes[k]) or heat >= f["molten"]:
                out[k] = f["high"] + (heat - f["molten"]) / (f["m"] * f["l"])
            elif heat <= f["solid"]:
                out[k] = heat / (f["m"] * f["c"])
            else:
                out[k] = f["low"] + (f["high"] - f["low"]) * (heat - f["solid"]) / (f["molten"] - f["solid"])
        return out

    def rates(self, t: float, y: Array) -> Array:
        self.calls += 1
        if self.calls > 200_000:
            raise NoVerdictError
        n, every = self.n, self.temperatures(t, y)
        n.integral = y[self.size :]
        q = np.zeros(every.size)
        for add in n.heats:
            add(t, every, q)
        return np.concatenate([q[: self.size] / self.capacity, [rate(every, n.integral) for _, rate in n.integrals]])

    def events(self) -> list[tuple[str, Any]]:
        """Return what may switch from here: thermostats by temperature, melts by heat."""
        out: list[tuple[str, Any]] = []
        for name, at, low, high in self.n.watched:
            level, sense = (high, 1.0) if self.n.mode[name] else (low, -1.0)
            out.append((name, lambda t, y, at=at, level=level, sense=sense: sense * (self.temperatures(t, y)[at] - level)))
        for k, f in self.n.melts.items():
            name = self.n.nodes[k]
            if self.n.mode.get(name):
                out.append((name, lambda t, y, k=k, level=f["molten"] - f["m"] * f["l"] * f["cold"]: level - y[k]))
                continue
            for level in (f["solid"], f["molten"]):
                for sense in (1.0, -1.0):
                    what = f"{name} molten" if level == f["molten"] and sense > 0.0 else f"{name} knee"
                    out.append((what, lambda t, y, k=k, level=level, sense=sense: sense * (y[k] - level)))
        for _, crossing in out:
            crossing.terminal, crossing.direction = True, 1.0
        return out

    def run(self, times: Array, tolerance: float) -> Array:
        """Return temperatures (times, nodes). [K]"""
        n, end, now = self.n, float(times[-1]), 0.0
        every = self.temperatures(0.0, self.y)
        for name, at, low, _ in n.watched:
            n.mode[name] = bool(every[at] <= low)
        rows = np.full((times.size, self.size), np.nan)
        edges = sorted({end} | n.breaks)
        scale = np.full(self.y.size, tolerance * 100.0)
        for k, f in n.melts.items():
            scale[k] *= f["m"] * f["c"]
        scale[self.size :] = tolerance
        more: dict[str, Any] = {"max_step": float(np.median(np.diff(n.steps)) * 4.0)} if n.steps.size else {"max_step": 60.0}
        while now < end:
            stop = next(e for e in edges if e > now + 1e-9)
            n.middle = 0.5 * (now + stop)
            events = self.events()
            found = solve_ivp(
                self.rates,
                (now, stop),
                self.y,
                "Radau",
                rtol=tolerance,
                atol=scale,
                events=[e for _, e in events],
                dense_output=True,
                **more,
            )
            if not found.success or found.sol is None or found.t_events is None:
                raise NoVerdictError
            last = float(found.t[-1])
            for j in np.flatnonzero((times >= now) & ((times < last) | (last == end))):
                rows[j] = self.temperatures(float(times[j]), found.sol(times[j]))[: self.size]
            now, self.y = last, found.y[:, -1].copy()
            for (name, _), hits in zip(events, found.t_events, strict=True):
                if len(hits):
                    self.switch(name)
            if last >= stop - 1e-9 and stop < end:
                now = stop
        return rows

    def switch(self, name: str) -> None:
        """Carry out what has happened."""
        n = self.n
        node, _, what = name.partition(" ")
        if node in n.mode and node not in n.nodes:
            n.mode[node] = not n.mode[node]
            return
        k = n.nodes.index(node)
        f = n.melts[k]
        if what == "molten" and node in n.mode:
            n.mode[node] = True
        elif not what:
            n.mode[node] = False
        for level in (f["solid"], f["molten"]):  # an event must not happen again at once
            if abs(self.y[k] - level) < 1e-9 * level:
                self.y[k] = level * (1.0 + np.sign(self.rates(0.0 if not n.breaks else n.middle, self.y)[k]) * 1e-13)


WRONG: Final[dict[str, tuple[Callable[[Network], None], str]]] = {
    "a capacitance below zero": (lambda n: n.deck["nodes"]["n0"].update(capacitance="-5 [J/K]"), "above zero|negative|not be below|positive"),
    "an end that is not there": (lambda n: n.deck["conductors"]["c0"].update(between=["n0", "nowhere"]), "nowhere"),
    "an unknown control": (lambda n: n.deck["loads"]["q0"].update(control="nobody"), "nobody"),
    "a unit of another kind": (lambda n: n.deck["loads"]["q0"].update(power="5 [K]"), r"\[K\]|K"),
    "a boundary without a temperature": (lambda n: n.scenario["boundaries"].pop("air"), "air"),
    "a power beyond what leaves": (
        lambda n: n.deck["loads"].update(bad={"into": "n0", "power": "1 [W]", "exponential_coefficient": "0.5 [1/K]", "reference_temperature": "280 [K]"}),
        "rises without limit|without limit",
    ),
    "a load on no node": (lambda n: n.deck["loads"]["q0"].update(into="nothing"), "nothing"),
}  # fmt: skip


def judged(seed: int) -> tuple[str, str, set[str]]:
    """Return how a seed ended (right, refused, no verdict), what was wrong, and the kinds of elements in it."""
    n = network(seed)
    why = [*WRONG][seed // 10 % len(WRONG)] if seed % 10 == 9 else ""
    if why:
        WRONG[why][0](n)
    times = np.linspace(0.0, n.scenario["duration"], 41)
    try:
        given = {k: v for k, v in n.scenario.items() if v != {}}
        run = td.simulate(td.model_from_dict(n.deck), td.Scenario("x", start=td.quantity(n.start, unit="K"), **given), times=times)
    except ThermidError as error:
        if not why:
            return "refused", f"seed {seed}: refused without a reason: {error}", n.kinds
        return "refused", "" if re.search(WRONG[why][1], str(error)) else f"seed {seed}: {why}: {error}", n.kinds
    if why:
        return "right", f"seed {seed}: {why}: not refused", n.kinds
    found = np.column_stack([run[x].kelvin for x in n.nodes])
    balance = run.heat_balance().relative
    if not balance < CLOSES:
        return "wrong", f"seed {seed}: the balance is open by {balance:.2g}", n.kinds
    try:
        with np.errstate(all="ignore"):
            fine = Truth(network(seed)).run(times, 1e-8 if n.steps.size else 1e-10)
            off = np.abs(found - fine)
            if off.max() <= ALLOWED:
                return "right", "", n.kinds
            coarse = Truth(network(seed)).run(times, 1e-7)
    except (NoVerdictError, ValueError, FloatingPointError) as error:
        return "no verdict", "" if isinstance(error, NoVerdictError) else f"seed {seed}: the oracle: {error}", n.kinds
    if np.abs(fine - coarse).max() > 0.1 * off.max():
        return "no verdict", "", n.kinds
    j, i = np.unravel_index(int(np.argmax(off)), off.shape)
    return "wrong", f"seed {seed} ({', '.join(sorted(n.kinds))}): {off.max():.3g} K off at {times[j]:g} s, node {n.nodes[i]}", n.kinds


def campaign(number: int, first: int) -> dict[str, Any]:
    """Judge networks; return how they ended, in how many each kind of element was, and the findings."""
    counts: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    found = []
    for seed in range(first, first + number):
        how, wrong, of = judged(seed)
        counts[how] += 1
        kinds.update(of)
        found += [wrong] if wrong else []
    return {"counts": counts, "kinds": dict(kinds.most_common()), "findings": found}


if __name__ == "__main__":
    print(json.dumps(campaign(int(sys.argv[1]), int(sys.argv[2])), indent=1))
