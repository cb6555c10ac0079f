"""What each gas does to a conductor, from one atmosphere to vacuum, constant or changing in time, and what it asks of a model.

Pressure, gravity, wind and kind belong to a named gas node: the ambient, a volume that is vented with a time constant, a sealed one.
First pressures and winds in time, then rows of gas at any pressure, then the state of every gas, then what a run must say of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from thermid.base.errors import CodedText, ScenarioError, quoted
from thermid.base.units import AMBIENT_DEFAULT, ATMOSPHERE, STANDARD_GRAVITY, Array, Memo, Number, value_of
from thermid.model.tree import (
    ACCOMMODATION,
    CARRIED_BY,
    Constant,
    Curve,
    Flat,
    FlatConductor,
    Law,
    MadeIn,
    Mixed,
    Signal,
    Sine,
    TableSignal,
    degrees,
    literal,
)
from thermid.physics.convection import duct_nusselt, fin_efficiency
from thermid.physics.correlations import forced_plate_nusselt, gap_nusselt_table, nusselt_table
from thermid.physics.gas import MolecularGas
from thermid.physics.plates import DISC_SHAPE_FACTOR
from thermid.physics.radiation import radiation_coefficient
from thermid.simulation._network.environment import GROUND, Environment
from thermid.simulation._network.irradiation import Irradiation, Sky
from thermid.simulation._network.rows import ANCHOR, ConductorRow

SAMPLES_PER_PRESSURE_STRETCH = 40
"""Samples put into each stretch of a pressure, equally spaced in its root. [-]"""


MARKS = ATMOSPHERE * (np.arange(1, 870) / 400.0) ** 3
"""Pressures at which one that changes is sampled, closer where it is low: the same ones wherever a run begins. [Pa]"""


def sampled_pressure(pressure: Signal, end: float) -> TableSignal:
    """Return a pressure up to `end` [s] as a table so fine that its root is straight between rows, to a thousandth of its change. [Pa]

    Rows are those of the signal and, between them, the instants at which it passes one of `MARKS`.
    """
    drawn = pressure.drawn(end)
    if isinstance(drawn, TableSignal) and drawn.held:
        return drawn
    at = drawn.knots(0.0, end)
    level = np.maximum(drawn.at(at), 0.0)
    if isinstance(drawn, Sine):
        return TableSignal(at, level)
    times, values = [at[:1]], [level[:1]]
    for (t0, t1), (p0, p1) in zip(_pairs(at), _pairs(level), strict=True):
        low, high = np.searchsorted(MARKS, [min(p0, p1), max(p0, p1)], side="right")
        part = MARKS[low:high] if p1 > p0 else MARKS[low:high][::-1]
        part = part[(part != p0) & (part != p1)]
        times += [t0 + (t1 - t0) * (part - p0) / (p1 - p0), np.array([t1])] if part.size else [np.array([t1])]
        values += [part, np.array([p1])] if part.size else [np.array([p1])]
    return TableSignal(np.concatenate(times), np.concatenate(values))


VACUUM_LIMIT = 1e-2
"""Pressure below which gas carries no heat worth counting between walls of equipment. [Pa]"""
INTERPOLATED_STREAMS = 12
"""Streams between which a wind that changes is interpolated, denser where it is light: within 2 % of a blend at its own speed. [-]"""


def equivalent_wind(wind: Signal, pressure: Signal, end: float) -> TableSignal:
    """Return the wind at one atmosphere with the same Reynolds number, w p / p0, up to `end` [s], as a table. [m/s]"""
    thin = Mixed(ReynoldsWind(), (wind, pressure))
    if thin.held:
        steps = thin.drawn(end)
        return steps if isinstance(steps, TableSignal) else TableSignal(np.zeros(1), steps.at(np.zeros(1)), hold=True)
    parts = [course.drawn(end) for course in (wind, pressure)]
    knots = np.unique(np.concatenate([course.knots(0.0, end) for course in parts]))
    points_per_interval = (
        1 if any(isinstance(course, Sine) for course in parts) else SAMPLES_PER_PRESSURE_STRETCH if knots.size < 2000 else 4
    )
    times = np.unique(np.concatenate([np.linspace(a, b, points_per_interval + 1) for a, b in _pairs(knots)])) if knots.size > 1 else knots
    return TableSignal(times, thin.at(times))


@dataclass(frozen=True)
class ReynoldsWind:
    """Speed of a wind at one atmosphere that has the Reynolds number of one at another pressure."""

    def __call__(self, wind: Array, pressure: Array) -> Array:
        """Return w p / p0 (times,) from wind w [m/s] and pressure p [Pa], never below zero. [m/s]"""
        return np.maximum(wind * pressure / ATMOSPHERE, 0.0)


def level_weights(course: TableSignal, levels: Array) -> list[TableSignal]:
    """Return the weight of each level in a wind over time, by linear interpolation over the root of the speed. [-]"""
    return [course.mapped(partial(_hat, np.sqrt(levels), hat)) for hat in np.eye(levels.size)]


def _hat(roots: Array, hat: Array, speed: Array) -> Array:
    """Return the values (levels,) `hat` over `roots` of speeds, interpolated at the root of a speed (times,) [m/s]."""
    return np.interp(np.sqrt(speed), roots, hat)


def _pairs(x: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[tuple[float, float]]:
    """Return the pairs of neighbours of an array: (x_0, x_1), (x_1, x_2), ..."""
    return list(zip(x[:-1].tolist(), x[1:].tolist(), strict=True))


def vented(inside: Signal, outside: Signal, time_constant: float, where: str) -> Signal:
    """Return the pressure over time of a volume that is vented to another one: tau dp/dt = p_outside - p, solved exactly. [Pa]

    Between two times of a table the outside is a straight line p0 + s t, for which p = p0 + s (t - tau) + c exp(-t / tau).

    Parameters
    ----------
    inside, outside : Signal    At the start, constant; and of the surroundings. [Pa]
    time_constant : float       [s]

    Raises
    ------
    ScenarioError   When the pressure at the start is no constant, or that outside swings without end.
    """
    if not isinstance(inside, Constant):
        raise ScenarioError("the pressure of a vented volume is its initial pressure. Give a constant.", where, code="value.without-effect")
    if isinstance(outside, Sine):
        raise ScenarioError("a volume cannot be vented to a periodic pressure. Give a table.", where, code="value.without-effect")
    tau = time_constant
    last = max(outside.extent, 1.0)
    # a stretch of constant slope has the exact solution below; fine steps keep straight lines between samples right to a thousandth
    tail = last + tau * np.concatenate((np.linspace(0.05, 3.0, 60), np.linspace(3.1, 25.0, 220)))
    outside_knots = outside.knots(0.0, last)
    knots = np.union1d(outside_knots[outside_knots >= 0.0], [0.0, last])
    fine = [np.linspace(a, b, max(2, min(400, int(np.ceil((b - a) / (0.05 * tau))) + 1))) for a, b in _pairs(knots)]
    times = np.unique(np.concatenate([*fine, knots, tail]))
    p, values = inside.value, [inside.value]
    for a, b in _pairs(times):
        start = float(outside.at(np.array([a]))[0])
        end = start if outside.held else float(outside.at(np.array([b]))[0])
        slope, h = (end - start) / (b - a), b - a
        settled = start - slope * tau  # of the particular solution at a
        p = settled + slope * h + (p - settled) * np.exp(-h / tau)
        values.append(float(p))
    return TableSignal(times, np.maximum(np.array(values), 0.0), after="hold")


POINTS = np.linspace(200.0, 450.0, 26)
"""Temperatures of the tables of properties, which are smooth; the fits were made over them. [K]"""


@dataclass(frozen=True)
class GasState:
    """A gas as the rows of a conductor see it: numbers where it is constant, inputs where it changes.

    Parameters
    ----------
    gas : MolecularGas
    pressure : float        [Pa]; 1 where it follows an input.
    natural : float         Strength of natural convection, (p/p0)^(1/2) (g/g0)^(1/4); 1 where it follows an input. [-]
    forced : float          Strength of a fan's, (p/p0)^0.65; 1 where it follows an input. [-]
    wind : float            [m/s]
    key : str               Name of the gas in the inputs; empty where all is constant.
    levels : tuple          Streams at one atmosphere between which a wind that changes in time is interpolated. [m/s]
    gust : str              Name of the inputs that say how much of each level there is.
    """

    gas: MolecularGas
    pressure: float
    natural: float
    wind: float = 0.0
    key: str = ""
    levels: tuple[float, ...] = ()
    gust: str = ""
    forced: float = 1.0

    def strength(self, c: FlatConductor) -> tuple[float, str, str]:
        """Return the strength of a coefficient that was fitted on the ground, and the inputs that it and its rest follow in time."""
        if c.words.get(CARRIED_BY) == "fan":
            return self.forced, self.named("forced"), self.named("not forced")
        return self.natural, self.named("natural"), self.named("rest")

    def named(self, what: str) -> str:
        """Return the name ``<what> <key>`` of an input of this gas, such as ``pressure room``; empty where the gas is constant."""
        return f"{what} {self.key}" if self.key else ""


@lru_cache(maxsize=64)
def conductivity_curve(gas: MolecularGas) -> Curve:
    """Return k(T) / k(300 K) of a gas as a table over temperature, with slopes. [-]"""
    return _over_temperature(lambda t: gas.k(t) / gas.k(ANCHOR))


@lru_cache(maxsize=64)
def _root_curve(gas: MolecularGas, windy: bool) -> Curve:
    """Return (beta / (nu alpha))^(1/4) of a gas over its value at 300 K as a table over temperature; `windy`: times k(T) / k(300 K). [-]"""

    def buoyancy(t: Any) -> Any:
        """Return (beta / (nu alpha))^(1/4) of the gas at a temperature, times its conductivity in wind."""
        at = gas.at(t)
        root = (at.expansion_at(t) / (at.kinematic_viscosity * at.thermal_diffusivity())) ** 0.25
        return root * (gas.k(t) if windy else 1.0)

    return _over_temperature(lambda t: buoyancy(t) / buoyancy(ANCHOR))


@lru_cache(maxsize=8)
def _one() -> Curve:
    """Return the table that is 1 at all temperatures. [-]"""
    return _over_temperature(lambda t: np.ones(np.shape(t)))


def _over_temperature(function: Any) -> Curve:
    """Return a function of temperature [K] as a table at `POINTS`, with slopes by central differences over 2 mK."""
    step = 1e-3
    slopes = (function(POINTS + step) - function(POINTS - step)) / (2.0 * step)
    return Curve("temperature", POINTS, np.asarray(function(POINTS), dtype=float), np.asarray(slopes, dtype=float))


def _plain(number: Number) -> float:
    """Return a number without derivatives; of many members the first, since a table is made once for all of them."""
    value: Any = value_of(number)
    return float(value.values[0] if hasattr(value, "values") else value)


def _rest(c: FlatConductor, continuum: Number, molecular: Number, state: GasState, signal: str = "") -> ConductorRow:
    """Return the conductor row of gas at rest, 1 / (1 / G + 1 / (G m p)).

    `continuum` is the conductance G of the continuum [W/K], `molecular` the ratio m of that of free molecules to it for each pascal [1/Pa].
    """
    law = Law("gas", (continuum, molecular * state.pressure))
    return ConductorRow(c.path, c.ends, law, conductivity_curve(state.gas), signal, state.named("pressure"))


def gap_rows(c: FlatConductor, law: Law, state: GasState) -> tuple[ConductorRow, ...]:
    """Return the rows of a gas gap between parallel plates: gas at rest at any pressure (Sherman), and free convection beside it.

    Only a gap with tilt and aspect convects: its second row is Nu - 1 times the conductance at rest, Ra by pressure and gravity. The law
    holds area [m^2], distance [m], accommodation and a factor on the convection [-].
    """
    area, distance, share, factor = law.coefficients
    gas = MolecularGas.named(c.words["gas"], c.where) if "gas" in c.words else state.gas
    inside = GasState(gas, state.pressure, state.natural, key=state.key)
    molecular = (share / (2.0 - share)) * gas.free_molecular_htc(ANCHOR, 1.0) * distance / gas.k(ANCHOR)
    still = _rest(c, area * gas.k(ANCHOR) / distance, molecular, inside)
    if "tilt" not in c.words:
        return (still,)
    fluid = gas.at(ANCHOR)
    x, y = gap_nusselt_table(degrees(c.words["tilt"]), literal(c.words["aspect"], "1"), float(fluid.prandtl))
    curve = Curve("difference", x, y, None, (conductivity_curve(gas), _root_curve(gas, False)), interpolation="smooth")
    buoyancy = STANDARD_GRAVITY * float(fluid.expansion_at(ANCHOR) / (fluid.kinematic_viscosity * fluid.thermal_diffusivity()))
    root = buoyancy**0.25 * distance**0.75 * inside.natural
    moving = Law("natural", (factor * area * gas.k(ANCHOR) / distance, root))
    return still, ConductorRow(c.path, c.ends, moving, curve, "", inside.named("natural"))


def correlation_rows(c: FlatConductor, law: Law, state: GasState) -> tuple[ConductorRow, ...]:
    """Return the rows of a surface with a correlation: gas at rest, and for each wind level what natural and forced convection add to it.

    The law holds area [m^2] and length [m]; Nusselt numbers are those of `nusselt_table`.
    """
    area, length = law.coefficients
    gas, fluid = state.gas, state.gas.at(ANCHOR)
    name, orientation = c.words.get("htc.correlation", ""), c.words.get("htc.orientation", "vertical")
    prandtl = float(fluid.prandtl)
    scale = gas.k(ANCHOR) / length * area
    buoyancy = STANDARD_GRAVITY * float(fluid.expansion_at(ANCHOR) / (fluid.kinematic_viscosity * fluid.thermal_diffusivity()))
    root = buoyancy**0.25 * length**0.75 * state.natural
    moving = []
    for k, speed in enumerate(state.levels or (state.wind * (state.pressure / ATMOSPHERE),)):
        # a stream at another pressure has the Reynolds number of one as much slower
        forced = float(forced_plate_nusselt(speed * _plain(length) / float(fluid.kinematic_viscosity), prandtl)) if speed > 0.0 else 0.0
        x, y, least = nusselt_table(name, orientation, prandtl, forced, c.where)
        film = (_one() if forced else conductivity_curve(gas), _root_curve(gas, forced > 0.0))
        curve = Curve("difference", x, y, None, film, interpolation="smooth")
        signal = f"{state.gust} {k}" if state.gust else ""
        moving.append(ConductorRow(c.path, c.ends, Law("natural", (scale, root)), curve, signal, state.named("natural")))
    molecular = ACCOMMODATION * gas.free_molecular_htc(ANCHOR, 1.0) * length / (gas.k(ANCHOR) * least)
    return _rest(c, scale * least, molecular, state), *moving


def duct_row(c: FlatConductor, law: Law, state: GasState) -> ConductorRow:
    """Return the row of a stream in ducts: h (base + eta fins), h = Nu k / D by `duct_nusselt`, fin efficiency eta; 0 without gas.

    The law holds base and fins [m^2], slope (m L over the root of the coefficient), hydraulic diameter and length [m], mass or volume flow
    over the section, the laminar Nusselt number, and whether the flow is by volume. The gas is at 300 K; a volume flow becomes a mass flow
    at 20 degC.

    Raises
    ------
    ScenarioError   When the pressure of the gas changes in time.
    """
    base, fins, slope, diameter, length, flux, developed, by_volume = law.coefficients
    if state.key:
        raise ScenarioError(
            f"the pressure of the gas in '{c.path}' changes, but the law of a duct is valid at constant pressure only. Give a "
            "constant pressure.",
            c.where,
            code="value.without-effect",
        )
    if state.pressure <= VACUUM_LIMIT or value_of(flux) == 0.0:
        return ConductorRow(c.path, c.ends, Law("linear", (0.0 * base,)))
    gas, fluid = state.gas, state.gas.at(ANCHOR)
    if value_of(by_volume):
        flux = flux * (state.pressure / (gas.constant * AMBIENT_DEFAULT))
    reynolds = flux * diameter / float(gas.mu(ANCHOR))
    nusselt = duct_nusselt(reynolds, float(fluid.prandtl), diameter / length, developed)
    htc = nusselt * float(gas.k(ANCHOR)) / diameter
    area = base + (fins * fin_efficiency(slope * htc**0.5) if value_of(fins) else 0.0)
    return ConductorRow(c.path, c.ends, Law("linear", (htc * area,)))


def rarefied_rows(c: FlatConductor, law: Law, area: Number, state: GasState) -> tuple[ConductorRow, ...]:
    """Return the rows of a coefficient that was fitted on the ground, for another pressure or gravity.

    With s = (p/p0)^(1/2) (g/g0)^(1/4), as laminar convection goes, or that of a fan, the conductance is s times what was fitted and (1 - s)
    times that of gas at rest, which is rarefied as the pressure falls.
    """
    first = law.coefficients[0]
    strength, moving, rest = state.strength(c)
    fitted = ConductorRow(c.path, c.ends, law.scaled(strength), c.curve, moving)
    if value_of(area) == 0.0:
        return (fitted,)
    gas = state.gas
    least = DISC_SHAPE_FACTOR * gas.k(ANCHOR) * area**0.5
    if law.form == "linear" and value_of(least) > value_of(first):
        least = first
    if value_of(least) == 0.0:
        return (fitted,)
    still = _rest(c, least, ACCOMMODATION * gas.free_molecular_htc(ANCHOR, 1.0) * area / least, state, rest)
    return fitted, replace(still, law=still.law.scaled(1.0 if state.key else 1.0 - strength))


SAME_STATE = 0.01
"""Difference of a pressure, a gravity or a wind below which a gas is as it was when a model was reduced. [-]"""
AIR_RANGE = (0.85 * ATMOSPHERE, 1.1 * ATMOSPHERE)
"""Pressures at which a coefficient fitted on the ground is used as it is. [Pa]"""
THIN = 0.01 * ATMOSPHERE
"""Pressure at which natural convection is a tenth of that on the ground, (p/p0)^(1/2): radiation is most of what a surface gives. [Pa]"""


@dataclass(frozen=True)
class Media:
    """What surrounds a model: the state of every gas node, and what falls on outer surfaces.

    Parameters
    ----------
    environments : dict     Gas node -> Environment; ``*`` stands for every gas not named; one atmosphere where none is given.
    as_printed : bool       Whether convection is set to zero as the source document does, radiation inside it included: a bound.
    irradiation : dict      Surface -> what falls on it; ``*`` for every surface outdoors.
    seconds : float         How long the run lasts that the signals of gases are drawn for. [s]
    memo : Memo             States of gases, and winds in time.
    """

    environments: Mapping[str, Environment] = field(default_factory=dict)
    as_printed: bool = False
    irradiation: Mapping[str, Irradiation | Sky] = field(default_factory=dict)
    seconds: float = 0.0
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def signals(self) -> dict[str, Signal]:
        """Return the inputs that multiply rows of gases that change in time, by name.

        ``pressure <gas>`` [Pa]; ``natural <gas>`` s and ``rest <gas>`` 1 - s, s as in `Environment.natural`, ``forced <gas>`` and ``not
        forced <gas>`` of a fan; ``wind <gas> k`` the weight of wind level k, and for a gas that only comes and goes ``gas <gas>`` and ``no
        gas <gas>``, 1 or 0.
        """
        out: dict[str, Signal] = {}
        for gas, environment in self.environments.items():
            p = self._pressure(gas, environment)
            if environment.wind.bounds[1] > 0.0 and not (isinstance(p, Constant) and isinstance(environment.wind, Constant)):
                out |= {f"wind {gas} {k}": w for k, w in enumerate(level_weights(*self._stream(gas, p, environment)))}
            if isinstance(p, Constant):
                continue
            if isinstance(p, TableSignal) and self._jumps(p):
                out[f"gas {gas}"] = p.mapped(_present)
                out[f"no gas {gas}"] = p.mapped(lambda level: 1.0 - _present(level))
            out[f"pressure {gas}"] = p
            for moving, rest, law in (("natural", "rest", environment.natural), ("forced", "not forced", environment.forced)):
                out[f"{moving} {gas}"] = strength = sampled_pressure(p, self.seconds).mapped(law)
                out[f"{rest} {gas}"] = strength.mapped(lambda share: 1.0 - share)
        return out

    def _pressure(self, gas: str, environment: Environment) -> Signal:
        """Return the pressure of a gas node over time; that of a vented volume is solved from the gas that it is vented to. [Pa]"""
        pressure: Signal = environment.pressure.drawn(self.seconds)
        if not environment.vented:
            return pressure
        if environment.vented == gas or self._environment(environment.vented).vented:
            raise ScenarioError(
                f"'{gas}' is vented to '{environment.vented}', which has no pressure of its own.", "environment", code="model.needs-gas-law"
            )
        outside = self._environment(environment.vented).pressure.drawn(self.seconds)
        return vented(pressure, outside, environment.time_constant, f"environment.{gas}")

    def pressure(self, gas: str) -> Signal:
        """Return the pressure of a gas node in time; gases that share one share the signal. [Pa]"""
        key = self._key(gas)
        return self.memo.value(("pressure", key), lambda: self._pressure(key, self._environment(key)))

    def gas(self, gas: str) -> str:
        """Return the kind of gas of a gas node, such as 'air'."""
        return self._environment(gas).gas

    def _key(self, gas: str) -> str:
        """Return the key of a gas node among the environments: its own, or ``*``."""
        return gas if gas in self.environments else "*"

    def _environment(self, gas: str) -> Environment:
        """Return the environment of a gas node: its own, that of ``*``, or the laboratory's."""
        return self.environments.get(self._key(gas), GROUND)

    def _jumps(self, p: Signal) -> bool:
        """Return whether a pressure takes by jumps no values but those of the ground and of vacuum."""
        in_air = (p.levels >= AIR_RANGE[0]) & (p.levels <= AIR_RANGE[1])
        return isinstance(p, TableSignal) and p.held and bool((in_air | (p.levels <= VACUUM_LIMIT)).all())

    def _state(self, gas: str) -> str:
        """Return the state of a gas node over the run: 'air' on the ground, 'vacuum', 'jumping' between the two, or 'thin' for any other.

        It is asked for every conductor of every evaluation, and computed once.
        """
        key = self._key(gas)
        return self.memo.value(("state", key), lambda: self._state_of(key))

    def _state_of(self, gas: str) -> str:
        """Return what `_state` keeps, from the bounds of the pressure and from gravity."""
        environment = self._environment(gas)
        p = self._pressure(gas, environment)
        lowest, highest = p.bounds
        if highest <= VACUUM_LIMIT:
            return "vacuum"
        if abs(environment.gravity - STANDARD_GRAVITY) > 0.01 * STANDARD_GRAVITY:
            return "thin"
        if lowest >= AIR_RANGE[0] and highest <= AIR_RANGE[1]:
            return "air"
        return "jumping" if self._jumps(p) else "thin"

    def _gas(self, gas: str, where: str) -> GasState:
        """Return a gas node as the rows of its conductors need it: constants, or names of inputs where pressure or wind change."""
        key, environment = self._key(gas), self._environment(gas)
        p = self._pressure(key, environment)
        kind = MolecularGas.named(environment.gas, where)
        steady, wind = isinstance(p, Constant), environment.wind
        base = GasState(kind, 1.0, 1.0, key=key)
        if isinstance(p, Constant):
            base = GasState(kind, p.value, float(environment.natural(p.value)), forced=float(environment.forced(p.value)))
        if wind.bounds[1] == 0.0:
            return base
        if steady and isinstance(wind, Constant):
            return replace(base, wind=wind.value)
        return replace(base, levels=tuple(self._stream(key, p, environment)[1].tolist()), gust=f"wind {key}")

    def _stream(self, key: str, pressure: Signal, environment: Environment) -> tuple[TableSignal, Array]:
        """Return `equivalent_wind` of a gas over time, and the levels between which it is interpolated. [m/s]"""

        def make() -> tuple[TableSignal, Array]:
            """Return the wind [m/s] that has the same effect at standard pressure, and the speeds [m/s] at which films are tabled."""
            course = equivalent_wind(environment.wind, pressure, self.seconds)
            return course, np.asarray((np.sqrt(course.bounds[1]) * np.linspace(0.0, 1.0, INTERPOLATED_STREAMS) ** 1.5) ** 2)

        return self.memo.value(("stream", key), make)

    def empty(self, gas: str) -> bool:
        """Return whether a gas node is in vacuum during the whole run."""
        return self._state(gas) == "vacuum"

    def made_in(self, gas: str) -> MadeIn:
        """Return the state of a gas node, to be kept with a model that is reduced there: lowest pressure, gravity, gas, highest wind."""
        environment = self._environment(gas)
        return MadeIn(self.lowest(gas), environment.gravity, environment.gas, environment.wind.bounds[1])

    def as_made(self, gas: str, made_in: MadeIn) -> bool:
        """Return whether a gas node, ``*`` for every one, stays during the run in the state in which a model was reduced, within 1 %."""
        keys = {"*", *self.environments} if gas == "*" else {self._key(gas)}
        return all(self._as_made(key, made_in) for key in keys)

    def _as_made(self, key: str, made_in: MadeIn) -> bool:
        """Return what `as_made` does, for one key of the environments."""
        environment = self._environment(key)
        lowest, highest = self._pressure(key, environment).bounds
        if made_in.pressure <= VACUUM_LIMIT:
            return highest <= VACUUM_LIMIT
        low, high = (
            AIR_RANGE
            if AIR_RANGE[0] <= made_in.pressure <= AIR_RANGE[1]
            else ((1.0 - SAME_STATE) * made_in.pressure, (1.0 + SAME_STATE) * made_in.pressure)
        )
        alike = abs(environment.gravity - made_in.gravity) <= SAME_STATE * STANDARD_GRAVITY and environment.gas == made_in.gas
        winds = np.array(environment.wind.bounds)
        return alike and bool(lowest >= low and highest <= high and (np.abs(winds - made_in.wind) <= SAME_STATE * made_in.wind).all())

    def lowest(self, gas: str) -> float:
        """Return the lowest pressure of a gas node during the run. [Pa]"""
        return self.pressure(gas).bounds[0]

    def changed(self, gas: str) -> bool:
        """Return whether a gas node is at any time anything but air on the ground."""
        return self._state(gas) != "air" or self._environment(gas).gas != "air"

    def buoyancy(self, c: FlatConductor, temperature: Array, times: Array) -> Array:
        """Return g beta / (nu alpha) (times,) of the gas in a gap; times a difference and the cube of a length it is Ra. [1/(K m^3)]

        `temperature` (times,) is the mean of the gas [K] at `times` (times,) [s].
        """
        environment = self._environment(c.gas)
        gas = MolecularGas.named(c.words.get("gas", environment.gas), c.where)
        at = gas.at(temperature, np.maximum(self.pressure(c.gas).at(times), 1e-30))
        return np.asarray(environment.gravity * at.expansion_at(temperature) / (at.kinematic_viscosity * at.thermal_diffusivity()))

    def remarks(self, conductors: Iterable[FlatConductor]) -> tuple[str, ...]:
        """Return remarks on coefficients that are fixed numbers: wind has no effect, and thin gas another one in a fan than in free air."""
        every, out = list(conductors), []  # type: list[FlatConductor], list[str]
        for gas in dict.fromkeys(c.gas for c in every):
            unsaid = [c.path for c in every if c.gas == gas and {"htc", "effective_htc"} & {*c.fields} and CARRIED_BY not in c.words]
            if unsaid and self._state(gas) == "thin" and self._environment(gas).gas == "air" and self.lowest(gas) > THIN:
                air, lowest = self._environment(gas), self.lowest(gas)
                out.append(
                    CodedText(
                        f"{quoted(unsaid)} was taken to convect as free air does: {float(air.natural(lowest)):.2g} of its coefficient on "
                        f"the ground is left at {lowest:.4g} Pa. With a fan it would be {float(air.forced(lowest)):.2g}, with a cold plate "
                        "all of it. State carried_by, or give a correlation",
                        "model.carrier-unstated",
                    )
                )
            if self._environment(gas).wind.bounds[1] > 0.0:
                fixed = [c.path for c in every if c.gas == gas and c.kind in ("convection", "effective") and "htc.length" not in c.fields]
                out += [
                    CodedText(
                        f"the wind in '{gas}' has no effect on {', '.join(repr(p) for p in fixed)}: its coefficient is a fixed value. "
                        f"Give htc = {{ length = ... }} to compute it from a correlation that includes wind",
                        "run.wind-without-effect",
                    )
                ] * bool(fixed)
        return tuple(out)

    def rows(self, c: FlatConductor, law: Law, fields: Mapping[str, Number], emissivity: Number | None) -> tuple[ConductorRow, ...]:
        """Return the kernel rows of one law of a conductor, in the state of its gas.

        `fields` are the conductor's values [SI], `emissivity` that of its surface or None.

        Raises
        ------
        ScenarioError   When an effective coefficient meets another pressure without an emissivity to keep, or another gas.
        """

        def row(law: Law, signal: str = "") -> tuple[ConductorRow]:
            """Return the row of the conductor under a law."""
            return (ConductorRow(c.path, c.ends, law, c.curve, signal),)

        if law.medium in ("solid", "radiation") or c.carried_by_solid:
            return row(law)
        state = self._state(c.gas)
        if law.medium == "left":
            # radiation inside an effective coefficient, to what its surface sees, for the share of gas that is gone
            at = self._gas(c.gas, c.where) if state not in ("air", "vacuum", "jumping") else None
            share, signal = float(state != "air"), f"no gas {self._key(c.gas)}" if state == "jumping" else ""
            if at is not None:
                strength, _, signal = at.strength(c)
                share = 1.0 if at.key else 1.0 - strength
            return (ConductorRow(c.path, c.ends, law.scaled(0.0 if self.as_printed else share), None, signal),)
        if law.medium == "fin":
            return self._fin(c, law, state)
        if law.medium in ("rest", "correlation", "duct"):
            at = self._gas(c.gas, c.where)
            if law.medium == "duct":
                return (duct_row(c, law, at),)
            if at.pressure == 0.0:
                return row(Law("linear", (0.0 * law.coefficients[0],)))
            return gap_rows(c, law, at) if law.medium == "rest" else correlation_rows(c, law, at)
        if state == "air" and self._environment(c.gas).gas == "air":
            return row(law)
        gone = row(law.scaled(0.0))
        if state == "vacuum" and (law.medium == "gas" or self.as_printed):
            return gone
        if self.as_printed and state == "jumping":
            return row(law, f"gas {self._key(c.gas)}")
        if state == "vacuum":
            return gone if c.sees else row(Law("radiation", self._radiation_without_gas(c, fields, emissivity)))
        return self._changed(c, law, fields, emissivity, state)

    def _changed(
        self, c: FlatConductor, law: Law, fields: Mapping[str, Number], emissivity: Number | None, state: str
    ) -> tuple[ConductorRow, ...]:
        """Return the rows of a coefficient that was fitted in air on the ground, where the gas is thin or comes and goes (`state`).

        With an effective coefficient the radiation that it contains stays where the gas is gone.
        """
        environment = self._environment(c.gas)
        if environment.gas != "air":
            raise ScenarioError(
                f"the coefficient of '{c.path}' applies to air and is not valid in {environment.gas}. Give a correlation, or a gap.",
                c.where,
                code="model.element-not-supported",
            )
        radiation: tuple[ConductorRow, ...] = ()
        without_gas = (
            self._radiation_without_gas(c, fields, emissivity) if law.medium == "mixed" and not (self.as_printed or c.sees) else ()
        )
        if state == "jumping":
            key = self._key(c.gas)
            present = ConductorRow(c.path, c.ends, law, c.curve, f"gas {key}")
            return (
                (present, ConductorRow(c.path, c.ends, Law("radiation", without_gas), None, f"no gas {key}")) if without_gas else (present,)
            )
        at = self._gas(c.gas, c.where)
        if without_gas:
            strength, _, rest = at.strength(c)
            share = 1.0 if at.key else 1.0 - strength
            radiation = (ConductorRow(c.path, c.ends, Law("radiation", (share * without_gas[0],)), None, rest),)
        return *rarefied_rows(c, law, fields["area"], at), *radiation

    def _fin(self, c: FlatConductor, law: Law, state: str) -> tuple[ConductorRow, ...]:
        """Return the rows of a lead's conductance [W/K]: in air G_air share, and G_rest (1 - share), what remains without gas.

        The share of gas is 1 in ``air`` and 0 in ``vacuum`` as `state`, one row each; where pressure jumps either by a signal, else a
        number or a signal. G_rest is radiation, or as printed the bare lead, which is also all that a lead without surroundings has.

        Raises
        ------
        ScenarioError   When its coefficient includes radiation of unknown size, or applies to air and the gas is another one.
        """
        air, bare, *radiating = law.coefficients

        def row(conductance: Number, signal: str = "") -> ConductorRow:
            """Return the row of the conductor under a law."""
            return ConductorRow(c.path, c.ends, Law("linear", (conductance,)), None, signal)

        if "to" not in c.words:
            return (row(bare),)
        if state == "air" and self._environment(c.gas).gas == "air":
            return (row(air),)
        if not (radiating or self.as_printed):
            raise self._unknown_share(c)
        remaining = bare if self.as_printed else radiating[0]
        if state == "vacuum":
            return (row(remaining),)
        if self._environment(c.gas).gas != "air":
            raise ScenarioError(
                f"the coefficient of '{c.path}' applies to air and is not valid in {self._environment(c.gas).gas}. Give a "
                f"correlation: htc = {{ length = ... }}.",
                c.where,
                code="model.element-not-supported",
            )
        if state == "jumping":
            key = self._key(c.gas)
            return row(air, f"gas {key}"), row(remaining, f"no gas {key}")
        at = self._gas(c.gas, c.where)
        share = (1.0, 1.0) if at.key else (at.natural, 1.0 - at.natural)
        return row(share[0] * air, at.named("natural")), row(share[1] * remaining, at.named("rest"))

    @staticmethod
    def _unknown_share(c: FlatConductor) -> ScenarioError:
        """Return the error that an effective coefficient meets vacuum and nothing says how much of it is radiation."""
        return ScenarioError(
            f"the coefficient of '{c.path}' is effective: it includes radiation, which remains in vacuum. Give the surface's "
            "emissivity or finish. Or use --as-printed: it sets the whole coefficient to zero, and the temperatures are then an "
            "upper bound.",
            c.where,
            code="model.needs-gas-law",
        )

    def _radiation_without_gas(self, c: FlatConductor, fields: Mapping[str, Number], emissivity: Number | None) -> tuple[Number, ...]:
        """Return the coefficient e sigma A [W/K^4] of the radiation that an effective coefficient leaves without gas, as a tuple of one."""
        if emissivity is None:
            raise self._unknown_share(c)
        return (radiation_coefficient(emissivity, fields["area"]),)


def _present(pressure: Array) -> Array:
    """Return 1 where there is gas at a pressure [Pa] and 0 where there is none (times,). [-]"""
    return np.asarray(pressure > VACUUM_LIMIT, dtype=float)


TRACE = 1e-9
"""Conductance that stays with gas that is gone, so that its node has a temperature, that of what is around it. [W/K]"""
SOLID = ("conduction", "contact", "table", "heat_pipe")
"""Kinds of conductors that gas has no part in."""


def check_gas_laws(media: Media, flat: Flat) -> None:
    """Refuse a run in whose gas, or without it, a surface or lead has no law, and a reduced model in another gas than its own.

    Raises
    ------
    ScenarioError   When a surface or lead has a convection alone and its gas is gone at any time; when a surface has radiation alone in a
                    gas; when a reduced model is not in the gas that it was made in.
    """
    thin = {} if media.as_printed else {path: gas for path, gas in flat.without_emissivity.items() if media.lowest(gas) <= VACUUM_LIMIT}
    if thin:
        has, them = ("have", "them") if len(thin) > 1 else ("has", "it")
        raise ScenarioError(
            f"{quoted(list(thin))} {has} htc but no emissivity. Without gas in {_gases(thin)} no heat would leave {them}. Give an "
            "emissivity or a finish, or emissivity = 0 if that is intended.",
            _where(flat, next(iter(thin))),
            code="model.needs-gas-law",
        )
    filled = {path: gas for path, gas in flat.without_convection.items() if not media.empty(gas)}
    if filled:
        has, they = ("have", "they") if len(filled) > 1 else ("has", "it")
        raise ScenarioError(
            f"{quoted(list(filled))} {has} an emissivity and no htc: in the gas of {_gases(filled)} {they} would have no convection. "
            f"Give htc as a value or from a correlation, htc = {{ length = ... }}, or htc = 0 if that is intended. For vacuum give "
            "environment, pressure = '0 [Pa]' (--vacuum).",
            _where(flat, next(iter(filled))),
            code="model.needs-gas-law",
        )
    for title, gas, state, where in flat.made_in:
        if not media.as_made(gas, state):
            of = "its gas" if gas == "*" else f"'{gas}'"
            raise ScenarioError(
                f"'{title}' was reduced with {of} in one state, {state}, and its conductances are valid there only. Reduce the full "
                "model again in the state of this run.",
                where,
                code="model.element-not-supported",
            )


def _gases(gases: Mapping[str, str]) -> str:
    """Return the gases of surfaces, path -> gas, as quoted text, each once."""
    return quoted(list(dict.fromkeys(gases.values())))


def _where(flat: Flat, path: str) -> str:
    """Return the place in a deck of a surface or of a lead."""
    face = flat.faces.get(path)
    return face.where if face else next(c.where for c in flat.conductors if c.path.startswith(path))


def conductors_with_trace(media: Media, flat: Flat) -> frozenset[str]:
    """Return the paths of conductors that keep the conductance `TRACE`: to inner gas that is gone at any time and that no load heats."""
    heated = {load.node for load in flat.loads}
    gone = {gas for gas in flat.gas_nodes - heated if media.lowest(gas) <= VACUUM_LIMIT}
    return frozenset(c.path for c in flat.conductors if c.kind in ("convection", "effective") and c.gas in gone and not c.carried_by_solid)


def gas_remarks(media: Media, flat: Flat, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return remarks on a run without gas at any time: paths that carry no heat then, paths that stay, radiation that is not modelled.

    Parameters
    ----------
    values : dict   Parameter path -> value. [SI]
    """
    gone = {c.gas for c in flat.conductors if c.gas and media.lowest(c.gas) <= VACUUM_LIMIT and not media.as_printed}
    # all that carries heat through gas: surfaces, gaps, and leads with a coefficient; those with an emissivity still radiate without
    leads = (c for c in flat.conductors if c.kind == "lead" and {"htc", "effective_htc"} & set(c.fields))
    through_gas = {c.path: c for c in flat.conductors if c.kind in ("convection", "effective", "gas") and not c.carried_by_solid}
    through_gas |= {c.path.removesuffix(".first").removesuffix(".second"): c for c in leads}
    fields = {path: flat.faces[path].fields if path in flat.faces else c.fields for path, c in through_gas.items()}
    stops = [p for p, c in through_gas.items() if c.gas in gone and not ((e := fields[p].get("emissivity")) and values[e] != 0.0)]
    around = gone & flat.convection_ends
    stays = [c.path for c in flat.conductors if c.kind in SOLID and around & set(c.ends)]
    end, stay = ("end", "stay") if len(stays) > 1 else ("ends", "stays")
    ends = dict.fromkeys(e for c in flat.conductors if c.path in stays for e in c.ends if e in around)
    lowest = {} if media.as_printed else {path: media.lowest(gas) for path, gas in flat.without_emissivity.items()}
    thin = [path for path, pressure in lowest.items() if VACUUM_LIMIT < pressure < THIN]
    whole = [c.path for c in flat.conductors if c.kind == "effective" and c.sees and not media.empty(c.gas)]
    remarks = (
        (stops, f"without gas no heat flows through {quoted(stops)}", "run.heat-stops-without-gas"),
        (
            stays,
            f"{quoted(stays)} {end} in {quoted(list(ends))} and {stay} without its gas. If this path leads through the gas, give it "
            "kind convection or gas",
            "run.path-stays-without-gas",
        ),
        (
            thin,
            f"{quoted(thin)} {'have' if len(thin) > 1 else 'has'} no emissivity, so its radiation is not modelled; in gas as thin as this "
            "it is most of the heat. Give an emissivity",
            "model.no-emissivity",
        ),
        (
            whole,
            f"the radiation in the effective coefficient of {quoted(whole)} goes to the gas node, not to the surfaces it sees; "
            "`td.inference.split` separates the two",
            "model.radiation-not-split",
        ),
    )
    return tuple(CodedText(text, code) for paths, text, code in remarks if paths)
