"""Controls compiled: factors that follow temperatures, machines of modes, and the states of controllers, ready for the kernel.

A controller's state (an integral, a filtered reading, an output held between samples) is a node of the network that no user sees. It
stands as ZERO + SPAN times a share, in kelvins, so that steps, steady states and derivatives treat it as any other unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.units import Array, Number, value_of
from thermid.model.tree import COMPLEMENT, Curve, FlatControl, Melt, named_control
from thermid.simulation._network.rows import LoadRow

ZERO, SPAN = 300.0, 100.0
"""Where the state of a controller stands that is zero, and how far from there one of one. [K]"""
CLAMP, LOOKUP, OF_STATE = range(3)
"""Kinds of factors in the kernel: between two limits, a table, a value for each mode."""
FREE: Final = -1
"""No limit."""


PHASE: Final = "phase"
"""What the machine of a node that supercools is called, behind the node's name."""


def state_of(control: str, what: str) -> str:
    """Return the name of a state of a control, ``<control> <what>``, with `what` integral, reading, output or phase."""
    return f"{control} {what}"


@dataclass(frozen=True, eq=False)
class FactorForm:
    """How a control's factor follows temperatures; numbers are places among the coefficients of the control.

    CLAMP: min(max(constant + sum of weight times temperature, low), high); LOOKUP: a table at that sum; OF_STATE: a value for each mode.

    Parameters
    ----------
    kind : int              CLAMP, LOOKUP or OF_STATE.
    constant : int          Of what it reads; weights stand beside the nodes.
    nodes : tuple           (node or state, place of its weight).
    low, high : int         Of a clamp; FREE for none.
    curve : Curve or None   Of a look-up. [-]
    values : tuple of int   One for each mode.
    """

    kind: int
    constant: int = FREE
    nodes: tuple[tuple[str, int], ...] = ()
    low: int = FREE
    high: int = FREE
    curve: Curve | None = None
    values: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class GuardForm:
    """A transition from mode `before` to mode `after`: when the weighted sum of `nodes` passes `level`, or after a `delay`.

    `sign` is 1 for passing upwards and -1 for downwards; `level`, `delay` and weights are places among the coefficients.
    """

    before: int
    after: int
    nodes: tuple[tuple[str, int], ...] = ()
    level: int = FREE
    sign: float = 1.0
    delay: int = FREE


@dataclass(frozen=True, eq=False)
class StateForm:
    """A state of a controller: its start (a number in K, or a node whose temperature it takes), and for a sampled one its update."""

    name: str
    begins: Number | str
    factor: FactorForm | None = None


@dataclass(frozen=True, eq=False)
class ControlRow:
    """A control at values of parameters.

    Parameters
    ----------
    name : str              Its path.
    coefficients : tuple    Numbers that its factors and guards name by their places.
    share, rest : FactorForm    What it gives, and what is left of one.
    modes : tuple of str    Names of its modes, of a thermostat off and on; empty for one that has none.
    starts : int            The mode in which it begins.
    guards : tuple
    states : tuple          In the order in which they are sampled.
    sample : float          [s]; zero for one that never rests.
    rates : tuple           Heat into its states, as loads, where it never rests.
    """

    name: str
    coefficients: tuple[Number, ...]
    share: FactorForm
    rest: FactorForm
    modes: tuple[str, ...] = ()
    starts: int = 0
    guards: tuple[GuardForm, ...] = ()
    states: tuple[StateForm, ...] = ()
    sample: float = 0.0
    rates: tuple[LoadRow, ...] = ()

    @property
    def followed(self) -> tuple[str, ...]:
        """The nodes and states that its factors and guards read."""
        read = [self.share.nodes, *(g.nodes for g in self.guards), *(s.factor.nodes for s in self.states if s.factor is not None)]
        rates = [row.follows for row in self.rates if row.follows]
        return tuple(dict.fromkeys([*(node for nodes in read for node, _ in nodes), *rates]))

    def due(self, mode: int, at: Callable[[str], float], signal: Callable[[int], float] = lambda _: 1.0) -> int | None:
        """Return the mode that follows one in which it rests, at temperatures of nodes by name; None where none does.

        A mode that ends after a time does not rest.
        """

        def number(place: int) -> float:
            """Return the coefficient at a place times its signal."""
            return float(value_of(self.coefficients[place]) * signal(place))

        for guard in self.guards:
            if guard.before != mode:
                continue
            if guard.delay != FREE:
                return guard.after
            reading = sum(number(place) * at(node) for node, place in guard.nodes)
            if guard.sign * (reading - number(guard.level)) >= 0.0:
                return guard.after
        return None

    def factor_of(self, name: str) -> FactorForm:
        """Return the factor that a name stands for: the control's share, or for ``1 - name`` the rest of it."""
        return self.rest if name.startswith(COMPLEMENT) else self.share

    def read(self, form: FactorForm, at: Callable[[str], Array], modes: Array, signal: Callable[[int], Any] = lambda _: 1.0) -> Array:
        """Return a factor (times,), for its modes (times,) and the temperatures `at` of nodes by name [K]. [-]

        By its form: the value of the mode; else of z = c_0 + sum c_n T_n either a table's value or z cut to its low and high end.

        `signal`: place of a coefficient -> what it is multiplied by (times,).
        """

        def number(place: int, default: float) -> Any:
            """Return the coefficient at a place times its signal."""
            return default if place == FREE else value_of(self.coefficients[place]) * signal(place)

        if form.kind == OF_STATE:
            return np.select([modes == k for k in range(len(form.values))], [number(v, 0.0) + np.zeros(modes.shape) for v in form.values])
        z = number(form.constant, 0.0) + sum(number(place, 0.0) * at(node) for node, place in form.nodes)
        if form.kind == LOOKUP:
            assert form.curve is not None
            return form.curve.evaluate(np.asarray(z, dtype=float))
        return np.asarray(np.clip(z, number(form.low, -np.inf), number(form.high, np.inf)), dtype=float)


@dataclass
class _Maker:
    """Collects the coefficients of one control while its factors and guards are made."""

    name: str
    numbers: list[Number] = field(default_factory=list)

    def add(self, number: Number) -> int:
        """Add a coefficient and return its place."""
        self.numbers.append(number)
        return len(self.numbers) - 1

    def clamp(self, constant: Number, weights: Sequence[tuple[str, Number]], low: Number | None, high: Number | None) -> FactorForm:
        """Return the factor min(max(constant + sum(weight T_node), low), high); a bound of None does not act."""
        nodes = tuple((node, self.add(weight)) for node, weight in weights)
        low_, high_ = (FREE if bound is None else self.add(bound) for bound in (low, high))
        return FactorForm(CLAMP, self.add(constant), nodes, low_, high_)

    def both(
        self, constant: Number, weights: Sequence[tuple[str, Number]], low: Number | None, high: Number | None
    ) -> tuple[FactorForm, FactorForm]:
        """Return the factors u = `clamp` and 1 - u."""
        share = self.clamp(constant, weights, low, high)
        turned = [(node, -1.0 * weight) for node, weight in weights]
        rest = self.clamp(1.0 - constant, turned, None if high is None else 1.0 - high, None if low is None else 1.0 - low)
        return share, rest

    def switched(self) -> tuple[FactorForm, FactorForm]:
        """Return the factors of a control of two modes: 0 in the first and 1 in the second, and one less that."""
        none, one = self.add(0.0), self.add(1.0)
        return FactorForm(OF_STATE, values=(none, one)), FactorForm(OF_STATE, values=(one, none))

    def sampled(self, taken: FactorForm, sample: float, more: Sequence[StateForm] = ()) -> ControlRow:
        """Return a control whose output is a state that takes a factor at every sample [s] and holds it in between."""
        output = state_of(self.name, "output")
        share, rest = self.both(-ZERO / SPAN, [(output, 1.0 / SPAN)], None, None)
        states = (StateForm(output, ZERO, taken), *more)
        return ControlRow(self.name, tuple(self.numbers), share, rest, states=states, sample=sample)


def control_row(flat: FlatControl, values: Mapping[str, Any]) -> ControlRow:
    """Return a control at values of parameters (path -> value in SI), by the recipe of its kind.

    Raises
    ------
    DeckError   When a thermostat has no hysteresis, limits are exchanged, or a table has a negative share.
    """
    f = {name: values[path] for name, path in flat.fields.items()}
    return _RECIPES[flat.control.kind](flat, f, _Maker(flat.path))


def phase_row(name: str, held: str, melt: Melt) -> ControlRow:
    """Return the machine of a node that supercools: its share is that of the melt without crystals.

    Parameters
    ----------
    name : str      Of the machine.
    held : str      The node that holds its heat.
    melt : Melt     Its liquid branch.
    """
    make = _Maker(name)
    nodes = ((held, make.add(1.0)),)
    ways = (GuardForm(0, 1, nodes, make.add(melt.molten), 1.0), GuardForm(1, 0, nodes, make.add(melt.freezes), -1.0))
    share, rest = make.switched()
    return ControlRow(name, tuple(make.numbers), share, rest, ("crystals", "liquid"), int(melt.given.starts == "liquid"), ways)


def _refuse(flat: FlatControl, broken: bool, message: str) -> None:
    """Refuse a control that breaks a rule, with a message."""
    if broken:
        raise DeckError(message, flat.where, code="model.refused")


def _thermostat(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
    """Return a thermostat as a machine of the modes off and on, with a guard at each of its two temperatures."""
    heats = "thermostat.on_below" in f
    on, off = (f["thermostat.on_below"], f["thermostat.off_above"]) if heats else (f["thermostat.on_above"], f["thermostat.off_below"])
    endless = (
        f"'{flat.path}' switches on and off at the same temperature and would switch endlessly. Set the two temperatures some kelvin apart."
    )
    _refuse(flat, bool(value_of(on) == value_of(off)), endless)
    names = "on_below and off_above" if heats else "on_above and off_below"
    again = f"'{flat.path}' would switch on again wherever it switches off. Exchange {names}."
    _refuse(flat, bool(value_of(on) < value_of(off)) is not heats, again)
    nodes = tuple((node, make.add(weight)) for node, weight in flat.follows)
    ways = (
        GuardForm(0, 1, nodes, make.add(on), -1.0 if heats else 1.0),
        GuardForm(1, 0, nodes, make.add(off), 1.0 if heats else -1.0),
    )
    share, rest = make.switched()
    return ControlRow(flat.path, tuple(make.numbers), share, rest, ("off", "on"), 0, ways)


def _modes(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
    """Return a machine of modes: a share for each mode, and a guard for each transition."""
    shares = {name.partition(".")[2]: number for name, number in f.items() if name.startswith("modes.")}
    order = list(shares)
    guards = []
    for name in flat.control.transitions:
        way, nodes = flat.transition(name)
        level = f[f"transitions.{name}.{way.sense}"]
        before, after = order.index(way.before), order.index(way.after)
        if way.sense == "after":
            guards.append(GuardForm(before, after, delay=make.add(level)))
            continue
        read = tuple((node, make.add(weight)) for node, weight in nodes)
        guards.append(GuardForm(before, after, read, make.add(level), 1.0 if way.sense == "above" else -1.0))
    share, rest = (
        FactorForm(OF_STATE, values=tuple(make.add(number) for number in numbers))
        for numbers in (shares.values(), [1.0 - number for number in shares.values()])
    )
    return ControlRow(flat.path, tuple(make.numbers), share, rest, tuple(order), order.index(flat.control.starts), tuple(guards))


def _table(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
    """Return a control whose share is a table of what it follows, looked up at all times or at samples."""
    shape = flat.control.curve
    assert shape is not None
    _refuse(flat, bool((shape.y < 0.0).any()), f"the table of '{flat.path}' gives a share below zero. Give 0 or more.")
    nodes = tuple((node, make.add(weight)) for node, weight in flat.follows)
    if not flat.control.sample:
        share, rest = (FactorForm(LOOKUP, nodes=nodes, curve=curve) for curve in (shape, _mapped(shape, 1.0, -1.0)))
        return ControlRow(flat.path, tuple(make.numbers), share, rest)
    return make.sampled(FactorForm(LOOKUP, nodes=nodes, curve=_mapped(shape, ZERO, SPAN)), flat.control.sample)


def _mapped(shape: Curve, base: float, scale: float) -> Curve:
    """Return a table with the values base + scale y, and slopes scale d, of another one."""
    return replace(shape, y=base + scale * shape.y, d=None if shape.straight else scale * shape.slopes)


def _limits(flat: FlatControl, f: Mapping[str, Number], kind: str) -> tuple[Number, Number, Number]:
    """Return the band of a controller [K] and its lowest and highest output [-], 0 and 1 by default.

    Parameters
    ----------
    f : dict     Field of the control -> its number, such as "pid.band".
    kind : str   "proportional" or "pid".

    Raises
    ------
    DeckError   When the lowest output is not below the highest.
    """
    band, low, high = f[f"{kind}.band"], f.get(f"{kind}.lowest", 0.0), f.get(f"{kind}.highest", 1.0)
    text = f"'{flat.path}' has limits from {value_of(low):g} to {value_of(high):g}. Give lowest below highest."
    _refuse(flat, not value_of(low) < value_of(high), text)
    return band, low, high


def _proportional(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
    """Return a proportional control, u = (setpoint - T) / band between its limits, at all times or at samples."""
    band, low, high = _limits(flat, f, "proportional")
    constant = f["proportional.setpoint"] / band
    weights = [(node, -weight / band) for node, weight in flat.follows]
    if not flat.control.sample:
        share, rest = make.both(constant, weights, low, high)
        return ControlRow(flat.path, tuple(make.numbers), share, rest)
    return make.sampled(_state_clamp(make, constant, weights, low, high), flat.control.sample)


def _state_clamp(make: _Maker, constant: Number, weights: Sequence[tuple[str, Number]], low: Number, high: Number) -> FactorForm:
    """Return the clamp of a weighted sum as the value of a state in kelvins: ZERO + SPAN times the output."""
    return make.clamp(ZERO + SPAN * constant, [(node, SPAN * weight) for node, weight in weights], ZERO + SPAN * low, ZERO + SPAN * high)


def _pid(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
    """Return a PID controller in series form, its integral the output seen through a lag of the integral time.

    u = clip(e / band + x - T_d (T - d) / (T_f band)), dx/dt = (u - x) / T_i, dd/dt = (T - d) / T_f: at a limit the integral rests there
    (Åström and Hägglund, Advanced PID Control, ISA 2006, section 3.5, automatic reset). Sampled, the lags take a step of Euler's method
    each, the reading's an implicit one.
    """
    band, low, high = _limits(flat, f, "pid")
    integral, sample = f["pid.integral_time"], flat.control.sample
    x, reading, output = (state_of(flat.path, what) for what in ("integral", "reading", "output"))
    constant = f["pid.setpoint"] / band - ZERO / SPAN
    weights = [(node, -weight / band) for node, weight in flat.follows]
    derived = "pid.derivative_time" in f
    if derived:
        (node, _), *_ = flat.follows
        lag = f["pid.filter_time"] + sample
        part = f["pid.derivative_time"] / (lag * band)
        weights = [(node, weights[0][1] - part), (reading, part)]
    weights = [*weights, (x, 1.0 / SPAN)]
    begins = ZERO + SPAN * f.get("pid.begins", 0.0)
    if sample:
        text = (
            f"the integral time of '{flat.path}' is shorter than its sample time, so the loop would oscillate. Give a longer integral "
            "time or a shorter sample time."
        )
        _refuse(flat, not value_of(integral) >= sample, text)
        taken = _state_clamp(make, constant, weights, low, high)
        step = sample / integral
        states = [StateForm(x, begins, make.clamp(0.0, [(x, 1.0 - step), (output, step)], None, None))]
        if derived:
            share_ = sample / lag
            states.append(StateForm(reading, node, make.clamp(0.0, [(node, share_), (reading, 1.0 - share_)], None, None)))
        return make.sampled(taken, sample, states)
    share, rest = make.both(constant, weights, low, high)
    rates = [
        LoadRow(x, "signal", x, x, (SPAN / integral,), controls=(flat.path,)),
        _lag(x, x, ZERO, -1.0 / integral),
    ]
    states = [StateForm(x, begins)]
    if derived:
        rates += [_lag(reading, node, 0.0, 1.0 / f["pid.filter_time"]), _lag(reading, reading, 0.0, -1.0 / f["pid.filter_time"])]
        states.append(StateForm(reading, node))
    return ControlRow(flat.path, tuple(make.numbers), share, rest, states=tuple(states), rates=tuple(rates))


def _lag(state: str, follows: str, level: float, rate: Number) -> LoadRow:
    """Return the load row of the rate d state / dt = rate (T - level) [K/s], with T the temperature of what it follows [K]."""
    return LoadRow(state, "polynomial", state, state, (rate * SPAN, 1.0 / SPAN, 0.0, level + SPAN), follows=follows)


_RECIPES: Final = {"thermostat": _thermostat, "modes": _modes, "table": _table, "proportional": _proportional, "pid": _pid}


def control_names(controls: Sequence[str]) -> list[str]:
    """Return the names of controls without the ``1 - `` that takes the rest of one."""
    return [named_control(name)[0] for name in controls]
