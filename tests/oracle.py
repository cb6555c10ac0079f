"""An independent solution of random models: flattened and integrated here, from the dictionaries alone, with scipy.

Nothing of thermid is used: names, the area ledger, laws, massless nodes and switching are written again from the design documents.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

SIGMA = 5.670374419e-8
SMOOTHING = 0.01
ATMOSPHERE = 101325.0
HELIUM = (0.15591, 0.6913, 0.0057, 8.31446261815324 / 0.004002602)
"""Conductivity at 300 K [W/(m K)] and two exponents, from 200 to 450 K; gas constant [J/(kg K)]. Its ratio of specific heats is 5/3."""
DECK_TABLES = ("nodes", "surfaces", "conductors", "joints", "loads")


def si(value: Any) -> float:
    """Return the number of a text in SI units, or of a number."""
    if isinstance(value, str):
        number, _, unit = value.partition(" [")
        return float(number) + (273.15 if unit == "degC]" else 0.0)
    return float(value)


def flatten(deck: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """Return a deck without submodels, and canonical node path -> its name there (``m0.n1`` becomes ``m0__n1``)."""
    flat: dict[str, Any] = {"title": deck["title"], "needs": list(deck["needs"])} | {table: {} for table in DECK_TABLES}
    names: dict[str, str] = {need: need for need in deck["needs"]}
    _flatten(deck, "", {need: need for need in deck["needs"]}, flat, names)
    return {k: v for k, v in flat.items() if v}, names


def _flatten(deck: dict[str, Any], prefix: str, bound: dict[str, str], flat: dict[str, Any], names: dict[str, str]) -> None:
    deck = _with_settings(deck)
    inner = {
        name: {need: _end(end, prefix, bound, {}) for need, end in sub["bind"].items()} for name, sub in deck.get("submodels", {}).items()
    }

    def end(raw: str) -> str:
        return _end(raw, prefix, bound, inner)

    for name, node in deck.get("nodes", {}).items():
        flat["nodes"][_plain(prefix + name)] = node
        names[prefix + name] = _plain(prefix + name)
    for name, s in deck.get("surfaces", {}).items():
        new = {**s, "of": end(s["of"]), "to": end(s["to"])}
        flat["surfaces"][_plain(prefix + name)] = new | ({"sees": end(s["sees"])} if "sees" in s else {})
    for name, c in deck.get("conductors", {}).items():
        ends = [end(e) for e in c["between"]]
        if ends[0] != ends[1]:  # two needs may be bound to one node: no heat flows
            flat["conductors"][_plain(prefix + name)] = {**c, "between": ends}
    for name, j in deck.get("joints", {}).items():
        new = {**j, "between": [_plain(prefix + e) for e in j["between"]]}
        if "gap" in j:
            new["gap"] = {**j["gap"], "to": end(j["gap"]["to"])}
        if "mid" in j:
            new["mid"] = _plain(prefix + j["mid"])
        flat["joints"][_plain(prefix + name)] = new
        names[prefix + j.get("mid", f"{name}.mid")] = new.get("mid", f"{_plain(prefix + name)}.mid")
    for name, q in deck.get("loads", {}).items():
        new = {**q, "into": end(q["into"])}
        for control in ("thermostat", "proportional"):
            if "sensor" in q.get(control, {}):
                new[control] = {**q[control], "sensor": end(q[control]["sensor"])}
        flat["loads"][_plain(prefix + name)] = new
    for name, sub in deck.get("submodels", {}).items():
        _flatten(sub["use"], f"{prefix}{name}.", inner[name], flat, names)


def _plain(path: str) -> str:
    return path.replace(".", "__")


def _end(raw: str, prefix: str, bound: dict[str, str], inner: dict[str, dict[str, str]]) -> str:
    """Return the flat name of a node named inside a model."""
    return bound.get(raw) or _plain(prefix + raw)


def _with_settings(deck: dict[str, Any]) -> dict[str, Any]:
    """Return the deck with its [set] written into its submodels."""
    if "set" not in deck:
        return deck
    subs = dict(deck["submodels"])
    for path, value in deck["set"].items():
        head, element, field = path.split(".")
        use = subs[head]["use"]
        changed = {**use, "nodes": {**use["nodes"], element: {**use["nodes"][element], field: value}}}
        subs[head] = {**subs[head], "use": changed}
    return {**deck, "submodels": subs}


Heat = Callable[[float, float, float], float]


class Signal:
    """A signal of a scenario; a held table takes the value that it has inside the stretch of time under way."""

    def __init__(self, given: Any) -> None:
        self.given = given
        table = isinstance(given, dict) and "times" in given
        self.times = [si(t) for t in given["times"]] if table else []
        self.values = [si(v) for v in given["values"]] if table else []

    @property
    def breaks(self) -> list[float]:
        return self.times

    def at(self, t: Any, middle: float) -> Any:
        """Return the value at a time, or at many."""
        if self.times:
            if self.given.get("hold"):
                return self.values[max(0, bisect_right(self.times, middle) - 1)]
            return np.interp(t, self.times, self.values)
        if isinstance(self.given, dict):
            angle = 2 * math.pi * t / si(self.given["period"]) + self.given.get("phase", 0.0)
            return si(self.given["mean"]) + si(self.given["amplitude"]) * np.sin(angle)
        return si(self.given)


def _curve(table: dict[str, Any]) -> Callable[[float], float]:
    """Straight lines through the points, or a monotone cubic where that is asked for; flat beyond both ends."""
    x, y = (np.array([si(p[k]) for p in table["points"]]) for k in (0, 1))
    if table.get("interpolation") != "smooth":
        return lambda at: float(np.interp(at, x, y))
    slopes = PchipInterpolator(x, y).derivative()(x)
    slopes[[0, -1]] = 0.0
    spline = CubicHermiteSpline(x, y, slopes)
    return lambda at: float(spline(min(max(at, x[0]), x[-1])))


class Oracle:
    """The equations of a flat deck in a scenario."""

    def __init__(self, deck: dict[str, Any], scenario: dict[str, Any]) -> None:
        self.deck = deck
        self.signals = {need: Signal(scenario["boundaries"][need]) for need in deck["needs"]}
        self.commands = {name: Signal(given) for name, given in scenario.get("commands", {}).items()}
        mids = {j.get("mid", f"{name}.mid"): {} for name, j in deck.get("joints", {}).items()}
        nodes = {**deck["nodes"], **mids}
        capacity = {n: self._capacity(fields) for n, fields in nodes.items()}
        self.massive = [n for n, c in capacity.items() if c > 0]
        self.massless = [n for n, c in capacity.items() if c == 0]
        self.c = np.array([capacity[n] for n in self.massive])
        self.names = [*self.massive, *self.massless, *deck["needs"]]
        self.index = {n: k for k, n in enumerate(self.names)}
        self.middle = 0.0
        self.on: dict[str, bool] = {}
        self.links: list[tuple[int, int, Callable[[float, float], float], bool]] = []
        self._conductors()
        self._surfaces()
        self.loads = [(name, q, self.index[q["into"]], self._power(name, q)) for name, q in deck.get("loads", {}).items()]
        self.guess = np.full(len(self.massless), si(scenario["start"]))
        self.start = np.array([si(scenario.get("initial", {}).get(n, scenario["start"])) for n in self.massive])

    @staticmethod
    def _capacity(fields: dict[str, Any]) -> float:
        if "capacitance" in fields:
            return si(fields["capacitance"])
        return si(fields["mass"]) * si(fields["specific_heat"]) if "mass" in fields else 0.0

    def _link(self, a: str, b: str, heat: Callable[[float, float], float], one_way: bool = False) -> None:
        if a != b:
            self.links.append((self.index[a], self.index[b], heat, one_way))

    @staticmethod
    def linear(g: float) -> Callable[[float, float], float]:
        return lambda a, b: g * (a - b)

    @staticmethod
    def natural(law: dict[str, Any], area: float) -> Callable[[float, float], float]:
        g, n = si(law["coefficient"]) * area, si(law["exponent"])
        return lambda a, b: g * (a - b) * ((a - b) ** 2 + SMOOTHING**2) ** (n / 2)

    @staticmethod
    def radiation(factor: float, area: float) -> Callable[[float, float], float]:
        return lambda a, b: factor * SIGMA * area * (a**4 - b**4)

    @staticmethod
    def gap(width: float, area: float, accommodation: float) -> Callable[[float, float], float]:
        """Return helium at rest at one atmosphere: the resistances of the continuum and of molecules that meet the walls alone add up."""
        k, first, second, gas = HELIUM
        share = accommodation / (2 - accommodation)

        def heat(a: float, b: float) -> float:
            mean = (a + b) / 2
            x = math.log(mean / 300)
            molecular = share * 4 * math.sqrt(gas / (8 * math.pi * mean)) * ATMOSPHERE
            return area * (a - b) / (width / (k * math.exp(x * (first + x * second))) + 1 / molecular)

        return heat

    def _conductors(self) -> None:
        for c in self.deck.get("conductors", {}).values():
            a, b = c["between"]
            self._link(a, b, self._law(c), c["kind"] == "flow")
        for name, j in self.deck.get("joints", {}).items():
            mid, area = j.get("mid", f"{name}.mid"), si(j["area"])
            per_area = si(j["contact_conductance"]) if "contact_conductance" in j else si(j["conductivity"]) / si(j["thickness"])
            for face in j["between"]:
                self._link(self.deck["surfaces"][face]["of"], mid, self.linear(per_area * area))
            if "gap" in j:
                self._link(mid, j["gap"]["to"], self.linear(si(j["gap"]["htc"]) * 2 * si(j["gap"]["area"])))

    def _law(self, c: dict[str, Any]) -> Callable[[float, float], float]:
        kind, area = c["kind"], si(c.get("area", 0.0))
        if kind == "conduction":
            if "resistance" in c:
                return self.linear(1 / si(c["resistance"]))
            return self.linear(si(c["conductance"]) if "conductance" in c else si(c["conductivity"]) * area / si(c["thickness"]))
        if kind == "contact":
            return self.linear(si(c["contact_conductance"]) * area)
        if kind == "effective":
            return self.linear(si(c["effective_htc"]) * area)
        if kind == "flow":
            return self.linear(si(c["mass_flow"]) * si(c["specific_heat"]))
        if kind == "convection":
            return self.natural(c["htc"], area) if isinstance(c["htc"], dict) else self.linear(si(c["htc"]) * area)
        if kind == "radiation":
            return self.radiation(si(c.get("emissivity", c.get("exchange_factor"))), area)
        if kind == "gas":
            return self.gap(si(c["gap"]), area, si(c["accommodation"]))
        shape, scale = _curve(c["table"]), si(c.get("scale", 1.0))
        if c["table"]["over"] == "difference":
            return lambda a, b: scale * shape(a - b) * (a - b)
        return lambda a, b: scale * shape((a + b) / 2) * (a - b)

    def _surfaces(self) -> None:
        for name, s in self.deck.get("surfaces", {}).items():
            area = si(s["area"])
            for j in self.deck.get("joints", {}).values():
                if name in j["between"]:
                    area -= si(j["area"]) + (si(j["gap"]["area"]) if "gap" in j else 0.0)
            if "htc" in s:
                self._link(
                    s["of"], s["to"], self.natural(s["htc"], area) if isinstance(s["htc"], dict) else self.linear(si(s["htc"]) * area)
                )
            if "effective_htc" in s:
                self._link(s["of"], s["to"], self.linear(si(s["effective_htc"]) * area))
            if "emissivity" in s:
                self._link(s["of"], s.get("sees", s["to"]), self.radiation(si(s["emissivity"]), area))

    def _power(self, name: str, q: dict[str, Any]) -> Callable[[float, np.ndarray], float]:
        """Return the power of a load by time and temperatures: (law x command + sine) x duty x control. [W]"""
        law, control = self._uncontrolled(name, q), self._control(name, q)
        amplitude, wave = (si(q["sine"][k]) for k in ("amplitude", "period")) if "sine" in q else (0.0, 1.0)
        period, duty = (si(q["periodic"][k]) for k in ("period", "duty")) if "periodic" in q else (1.0, 1.0)

        def power(t: float, every: np.ndarray) -> float:
            on = 1.0 if duty == 1.0 or (self.middle % period) < duty * period else 0.0
            return on * (law(t, every) + amplitude * math.sin(2 * math.pi * t / wave)) * control(every)

        return power

    def _uncontrolled(self, name: str, q: dict[str, Any]) -> Callable[[float, np.ndarray], float]:
        """Return what a load gives by its own temperature and its command. [W]"""
        node = self.index[q["into"]]
        if "table" in q:
            shape, scale = _curve(q["table"]), si(q.get("scale", 1.0))
            return lambda t, every: scale * shape(every[node])
        power = si(q["power"])
        if "exponential_coefficient" in q:
            a, zero = si(q["exponential_coefficient"]), si(q["reference_temperature"])
            return lambda t, every: power * math.exp(a * (every[node] - zero))
        if "temperature_coefficient" in q:
            a, b, zero = si(q["temperature_coefficient"]), si(q["quadratic_coefficient"]), si(q["reference_temperature"])
            return lambda t, every: power * (1 + a * (every[node] - zero) + b * (every[node] - zero) ** 2)
        if name in self.commands:
            return lambda t, every: power * self.commands[name].at(t, self.middle)
        return lambda t, every: power

    def _control(self, name: str, q: dict[str, Any]) -> Callable[[np.ndarray], float]:
        """Return the share of a load that its control lets through, from 0 to 1."""
        if "thermostat" in q:
            return lambda every: 1.0 if self.on[name] else 0.0
        if "proportional" not in q:
            return lambda every: 1.0
        given, sensor = q["proportional"], self.index[q["proportional"].get("sensor", q["into"])]
        band = si(given["band"]) if "band" in given else si(q["power"]) / si(given["gain"])
        wanted = si(given["setpoint"])
        return lambda every: min(max((wanted - every[sensor]) / band, 0.0), 1.0)

    def net_heat(self, t: float, every: np.ndarray) -> np.ndarray:
        """Return the heat into every node, boundaries included. [W]"""
        heat = np.zeros(len(self.names))
        for a, b, law, one_way in self.links:
            q = law(every[a], every[b])
            heat[b] += q
            if not one_way:
                heat[a] -= q
        for _, _, node, power in self.loads:
            heat[node] += power(t, every)
        return heat

    def everything(self, t: float, massive: np.ndarray) -> np.ndarray:
        """Return all temperatures; the massless ones by Newton's method with differences. [K]"""
        n, m = len(self.massive), len(self.massless)
        every = np.concatenate((massive, self.guess, [s.at(t, self.middle) for s in self.signals.values()]))
        for _ in range(50 if m else 0):
            zero = self.net_heat(t, every)[n : n + m]
            jacobian = np.empty((m, m))
            for k in range(m):
                moved = every.copy()
                moved[n + k] += 1e-4
                jacobian[:, k] = (self.net_heat(t, moved)[n : n + m] - zero) / 1e-4
            step = np.linalg.solve(jacobian, -zero)
            step *= min(1.0, 50.0 / max(np.abs(step).max(), 1e-300))
            every[n : n + m] += step
            if np.abs(step).max() < 1e-10:
                break
        self.guess = every[n : n + m].copy()
        return every

    def rate(self, t: float, massive: np.ndarray) -> np.ndarray:
        return self.net_heat(t, self.everything(t, massive))[: self.c.size] / self.c

    def breaks(self, end: float) -> list[float]:
        """Return the times at which an input has a kink or a jump. [s]"""
        out = {0.0, end}
        for given in (*self.signals.values(), *self.commands.values()):
            out |= {t for t in given.breaks if 0 < t < end}
        for _, q, _, _ in self.loads:
            if "periodic" in q:
                period, duty = si(q["periodic"]["period"]), si(q["periodic"]["duty"])
                out |= {t for k in range(int(end / period) + 1) for t in (k * period, (k + duty) * period) if 0 < t < end}
        return sorted(out)

    def temperatures(self, times: np.ndarray, rtol: float = 1e-10, atol: float = 1e-9) -> dict[str, np.ndarray]:
        """Return name -> temperature (times,) of every node, boundaries left out. [K]"""
        edges = self.breaks(float(times[-1]))
        out = np.empty((times.size, len(self.names)))
        state = self.start
        self.middle = edges[1] / 2
        self._decide(state)
        for a, b in pairwise(edges):
            self.middle = (a + b) / 2
            here = a
            while here < b:
                here, state = self._stretch(here, b, state, times, out, rtol, atol)
        return {n: out[:, k] for n, k in self.index.items() if n not in self.deck["needs"]}

    def extremes(self, end: float, rtol: float = 1e-10, atol: float = 1e-9) -> dict[str, tuple[float, float, float, float]]:
        """Return name -> lowest [K], when [s], highest [K] and when [s], of every node.

        The dense output is scanned at 1 ms for 10 s after each switching and at 1 s elsewhere.
        """
        edges, state = self.breaks(end), self.start
        out = {n: (math.inf, 0.0, -math.inf, 0.0) for n in (*self.massive, *self.massless)}
        self.middle = edges[1] / 2
        self._decide(state)
        for a, b in pairwise(edges):
            self.middle = (a + b) / 2
            here = a
            while here < b:
                start = here
                found, here, state = self._solved(start, b, state, rtol, atol)
                fine = np.concatenate((np.arange(start, min(start + 10.0, here), 1e-3), np.arange(start + 10.0, here, 1.0), [here]))
                massive = found.sol(fine)
                self._scan(out, self.massive, fine, massive)
                if self.massless:
                    self._scan(out, self.massless, fine, self._massless_along(fine, massive))
                self._switch(here, b, state)
        return out

    def _massless_along(self, times: np.ndarray, massive: np.ndarray) -> np.ndarray:
        """Return the temperatures of massless nodes without loads (massless, times), all times at once, by Newton's method. [K]"""
        n, m = len(self.massive), len(self.massless)
        assert not any(n <= node < n + m for _, _, node, _ in self.loads), "a massless node has a load"
        every = np.empty((len(self.names), times.size))
        every[:n], every[n : n + m] = massive, self.guess[:, None]
        for k, signal in enumerate(self.signals.values()):
            every[n + m + k] = signal.at(times, self.middle)
        own = [(a, b, law, one_way) for a, b, law, one_way in self.links if n <= a < n + m or n <= b < n + m]

        def heat() -> np.ndarray:
            total = np.zeros((len(self.names), times.size))
            for a, b, law, one_way in own:
                q = law(every[a], every[b])
                total[b] += q
                if not one_way:
                    total[a] -= q
            return total[n : n + m].copy()

        for _ in range(50):
            zero, jacobian = heat(), np.empty((times.size, m, m))
            for k in range(m):
                every[n + k] += 1e-4
                jacobian[:, :, k] = (heat() - zero).T / 1e-4
                every[n + k] -= 1e-4
            step = np.linalg.solve(jacobian, -zero.T[:, :, None])[:, :, 0].T
            every[n : n + m] += step
            if np.abs(step).max() < 1e-10:
                break
        return every[n : n + m]

    @staticmethod
    def _scan(out: dict[str, tuple[float, float, float, float]], names: list[str], times: np.ndarray, kelvin: np.ndarray) -> None:
        for name, row in zip(names, kelvin, strict=False):
            low, high = int(row.argmin()), int(row.argmax())
            lowest, low_time, highest, high_time = out[name]
            if row[low] < lowest:
                lowest, low_time = float(row[low]), float(times[low])
            if row[high] > highest:
                highest, high_time = float(row[high]), float(times[high])
            out[name] = (lowest, low_time, highest, high_time)

    def _thermostats(self) -> list[tuple[str, int, float, float]]:
        out = []
        for name, q, node, _ in self.loads:
            if "thermostat" in q:
                sensor = self.index[q["thermostat"]["sensor"]] if "sensor" in q["thermostat"] else node
                out.append((name, sensor, si(q["thermostat"]["on_below"]), si(q["thermostat"]["off_above"])))
        return out

    def _decide(self, state: np.ndarray) -> None:
        self.on = {name: False for name, *_ in self._thermostats()}
        every = self.everything(0.0, state)
        self.on = {name: bool(every[sensor] <= low) for name, sensor, low, _ in self._thermostats()}

    def _event(self, sensor: int, limit: float, direction: float) -> Any:
        """Return where a sensor crosses a limit, in the form that solve_ivp takes."""

        def crossing(t: float, massive: np.ndarray) -> float:
            return float(self.everything(t, massive)[sensor] - limit)

        crossing.terminal, crossing.direction = True, direction  # type: ignore[attr-defined]
        return crossing

    def _stretch(
        self, here: float, end: float, state: np.ndarray, times: np.ndarray, out: np.ndarray, rtol: float, atol: float
    ) -> tuple[float, np.ndarray]:
        """Integrate to the end or to the next switching, and write what falls in between."""
        found, stop, last = self._solved(here, end, state, rtol, atol)
        for k in np.flatnonzero((times >= here) & (times < stop if stop < end else times <= end)):
            out[k] = self.everything(times[k], found.sol(times[k]))
        self._switch(stop, end, last)
        return stop, last

    def _solved(self, here: float, end: float, state: np.ndarray, rtol: float, atol: float) -> tuple[Any, float, np.ndarray]:
        """Return the solution to the end or to the next switching, when that is, and the state there."""
        events = []
        for name, sensor, low, high in self._thermostats():
            limit = high if self.on[name] else low
            events.append(self._event(sensor, limit, 1.0 if self.on[name] else -1.0))
        method = "Radau" if events else "LSODA"
        found = solve_ivp(self.rate, (here, end), state, method, rtol=rtol, atol=atol, events=events or None, dense_output=True)
        assert found.success, found.message
        return found, float(found.t[-1]), found.y[:, -1]

    def _switch(self, stop: float, end: float, state: np.ndarray) -> None:
        """Switch the thermostats that are due where a stretch stopped before its end."""
        if self._thermostats() and stop < end:
            every = self.everything(stop, state)
            for name, sensor, low, high in self._thermostats():
                gap = every[sensor] - high if self.on[name] else low - every[sensor]
                if gap > -1e-8:  # several may switch at once
                    self.on[name] = not self.on[name]
