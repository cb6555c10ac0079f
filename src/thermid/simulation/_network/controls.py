"""Controls compiled: factors that follow temperatures, machines of modes, and the states of controllers, ready for the kernel.

A controller's state (an integral, a filtered reading, an output held between samples) is a node of the network that no user sees. It
stands as ZERO + SPAN times a share, in kelvins, so that steps, steady states and derivatives treat it as any other unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from thermid.base.dual import Number, value_of
from thermid.base.errors import DeckError
from thermid.base.linear_algebra import Array
from thermid.model.elements import COMPLEMENT, Curve, Melt, evaluate, named_control, slopes
from thermid.model.tree import FlatControl
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
    """Return the name of a state of a control: its integral, reading or output."""
    return f"{control} {what}"


@dataclass(frozen=True, eq=False)
class FactorForm:
    """A factor: numbers by their place among the coefficients of its control.

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
    """A way from one mode to another: where what it reads passes a level (sign 1 upwards, -1 downwards), or after a delay."""

    before: int
    after: int
    nodes: tuple[tuple[str, int], ...] = ()
    level: int = FREE
    sign: float = 1.0
    delay: int = FREE


@dataclass(frozen=True, eq=False)
class StateForm:
    """A state of a controller: where it begins (of a node: with its temperature), and what it takes at every sample; none in between."""

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
        """Return what an element takes of it: its share, or the rest."""
        return self.rest if name.startswith(COMPLEMENT) else self.share

    def read(self, form: FactorForm, at: Callable[[str], Array], modes: Array, signal: Callable[[int], Any] = lambda _: 1.0) -> Array:
        """Return a factor (times,), for its modes (times,) and the temperatures of nodes by name. [-]

        `signal`: place of a coefficient -> what it is multiplied by (times,).
        """

        def number(place: int, default: float) -> Any:
            return default if place == FREE else value_of(self.coefficients[place]) * signal(place)

        if form.kind == OF_STATE:
            return np.select([modes == k for k in range(len(form.values))], [number(v, 0.0) + np.zeros(modes.shape) for v in form.values])
        z = number(form.constant, 0.0) + sum(number(place, 0.0) * at(node) for node, place in form.nodes)
        if form.kind == LOOKUP:
            assert form.curve is not None
            return evaluate(form.curve, np.asarray(z, dtype=float))
        return np.asarray(np.clip(z, number(form.low, -np.inf), number(form.high, np.inf)), dtype=float)


@dataclass
class _Maker:
    """Collects the numbers of one control."""

    name: str
    numbers: list[Number] = field(default_factory=list)

    def add(self, number: Number) -> int:
        self.numbers.append(number)
        return len(self.numbers) - 1

    def clamp(self, constant: Number, weights: Sequence[tuple[str, Number]], low: Number | None, high: Number | None) -> FactorForm:
        """Return a clamp of a weighted sum."""
        nodes = tuple((node, self.add(weight)) for node, weight in weights)
        low_, high_ = (FREE if bound is None else self.add(bound) for bound in (low, high))
        return FactorForm(CLAMP, self.add(constant), nodes, low_, high_)

    def both(
        self, constant: Number, weights: Sequence[tuple[str, Number]], low: Number | None, high: Number | None
    ) -> tuple[FactorForm, FactorForm]:
        """Return a clamp and what is left of one."""
        share = self.clamp(constant, weights, low, high)
        turned = [(node, -1.0 * weight) for node, weight in weights]
        rest = self.clamp(1.0 - constant, turned, None if high is None else 1.0 - high, None if low is None else 1.0 - low)
        return share, rest


def control_row(flat: FlatControl, values: Mapping[str, Any]) -> ControlRow:
    """Return a control at values of parameters.

    Raises
    ------
    DeckError   When a thermostat has no hysteresis, limits are exchanged, or a table has a negative share.
    """
    f = {name: values[path] for name, path in flat.fields.items()}
    make = _Maker(flat.path)
    return _RECIPES[flat.control.kind](flat, f, make)


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
    molten, freezes, none, one = (make.add(number) for number in (melt.molten, melt.freezes, 0.0, 1.0))
    ways = (GuardForm(0, 1, nodes, molten, 1.0), GuardForm(1, 0, nodes, freezes, -1.0))
    share, rest = FactorForm(OF_STATE, values=(none, one)), FactorForm(OF_STATE, values=(one, none))
    return ControlRow(name, tuple(make.numbers), share, rest, ("crystals", "liquid"), int(melt.given.starts == "liquid"), ways)


def _refuse(flat: FlatControl, message: str) -> None:
    raise DeckError(message, flat.where)


def _thermostat(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
    heats = "thermostat.on_below" in f
    on, off = (f["thermostat.on_below"], f["thermostat.off_above"]) if heats else (f["thermostat.on_above"], f["thermostat.off_below"])
    if value_of(on) == value_of(off):
        _refuse(
            flat,
            f"'{flat.path}' switches on and off at the same temperature and would switch endlessly. Set the two "
            "temperatures some kelvin apart.",
        )
    if (value_of(on) < value_of(off)) is not heats:
        names = ("on_below", "off_above") if heats else ("on_above", "off_below")
        _refuse(flat, f"'{flat.path}' would switch on again wherever it switches off. Exchange {names[0]} and {names[1]}.")
    nodes = tuple((node, make.add(weight)) for node, weight in flat.follows)
    ways = (
        GuardForm(0, 1, nodes, make.add(on), -1.0 if heats else 1.0),
        GuardForm(1, 0, nodes, make.add(off), 1.0 if heats else -1.0),
    )
    none, one = make.add(0.0), make.add(1.0)
    share, rest = FactorForm(OF_STATE, values=(none, one)), FactorForm(OF_STATE, values=(one, none))
    return ControlRow(flat.path, tuple(make.numbers), share, rest, ("off", "on"), 0, ways)


def _modes(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
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
    share = FactorForm(OF_STATE, values=tuple(make.add(number) for number in shares.values()))
    rest = FactorForm(OF_STATE, values=tuple(make.add(1.0 - number) for number in shares.values()))
    return ControlRow(flat.path, tuple(make.numbers), share, rest, tuple(order), order.index(flat.control.starts), tuple(guards))


def _table(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
    shape = flat.control.curve
    assert shape is not None
    if (shape.y < 0.0).any():
        _refuse(flat, f"the table of '{flat.path}' gives a share below zero. Give 0 or more.")
    nodes = tuple((node, make.add(weight)) for node, weight in flat.follows)
    if not flat.control.sample:
        share, rest = (FactorForm(LOOKUP, nodes=nodes, curve=curve) for curve in (shape, _mapped(shape, 1.0, -1.0)))
        return ControlRow(flat.path, tuple(make.numbers), share, rest)
    output = state_of(flat.path, "output")
    taken = FactorForm(LOOKUP, nodes=nodes, curve=_mapped(shape, ZERO, SPAN))
    share, rest = make.both(-ZERO / SPAN, [(output, 1.0 / SPAN)], None, None)
    return ControlRow(flat.path, tuple(make.numbers), share, rest, states=(StateForm(output, ZERO, taken),), sample=flat.control.sample)


def _mapped(shape: Curve, base: float, scale: float) -> Curve:
    """Return a table whose values are base + scale times those of another."""
    d = None if shape.straight else scale * slopes(shape)
    return replace(shape, y=base + scale * shape.y, d=d)


def _limits(flat: FlatControl, f: Mapping[str, Number], kind: str) -> tuple[Number, Number, Number]:
    """Return the band of a controller and the limits of its output."""
    band, low, high = f[f"{kind}.band"], f.get(f"{kind}.lowest", 0.0), f.get(f"{kind}.highest", 1.0)
    if not value_of(low) < value_of(high):
        _refuse(flat, f"'{flat.path}' has limits from {value_of(low):g} to {value_of(high):g}. Give lowest below highest.")
    return band, low, high


def _proportional(flat: FlatControl, f: Mapping[str, Number], make: _Maker) -> ControlRow:
    band, low, high = _limits(flat, f, "proportional")
    constant = f["proportional.setpoint"] / band
    weights = [(node, -weight / band) for node, weight in flat.follows]
    if not flat.control.sample:
        share, rest = make.both(constant, weights, low, high)
        return ControlRow(flat.path, tuple(make.numbers), share, rest)
    output = state_of(flat.path, "output")
    taken = _held(make, constant, weights, low, high)
    share, rest = make.both(-ZERO / SPAN, [(output, 1.0 / SPAN)], None, None)
    return ControlRow(flat.path, tuple(make.numbers), share, rest, states=(StateForm(output, ZERO, taken),), sample=flat.control.sample)


def _held(make: _Maker, constant: Number, weights: Sequence[tuple[str, Number]], low: Number, high: Number) -> FactorForm:
    """Return what an output takes at a sample: a clamp, as the state of a controller stands."""
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
        if not value_of(integral) >= sample:
            _refuse(
                flat,
                f"the integral time of '{flat.path}' is shorter than its sample time, so the loop would oscillate. Give a "
                "longer integral time or a shorter sample time.",
            )
        taken = _held(make, constant, weights, low, high)
        step = sample / integral
        states = [
            StateForm(output, ZERO, taken),
            StateForm(x, begins, make.clamp(0.0, [(x, 1.0 - step), (output, step)], None, None)),
        ]
        if derived:
            share_ = sample / lag
            states.append(StateForm(reading, node, make.clamp(0.0, [(node, share_), (reading, 1.0 - share_)], None, None)))
        share, rest = make.both(-ZERO / SPAN, [(output, 1.0 / SPAN)], None, None)
        return ControlRow(flat.path, tuple(make.numbers), share, rest, states=tuple(states), sample=sample)
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
    """Return rate (T - level) into a state, T that of what it follows."""
    return LoadRow(state, "polynomial", state, state, (rate * SPAN, 1.0 / SPAN, 0.0, level + SPAN), follows=follows)


_RECIPES: Final = {"thermostat": _thermostat, "modes": _modes, "table": _table, "proportional": _proportional, "pid": _pid}


def control_names(controls: Sequence[str]) -> list[str]:
    """Return the controls behind the names that an element gives."""
    return [named_control(name)[0] for name in controls]


def refuse_controllers(controls: Mapping[str, FlatControl], named: Sequence[str], what: str) -> None:
    """Refuse what cannot know the mode or state of a control.

    Parameters
    ----------
    controls : dict     Control path -> the control.
    named : sequence    Those that something follows.
    what : str          What is asked for.

    Raises
    ------
    DeckError
    """
    for name in named:
        if controls[name].has_history:
            raise DeckError(
                f"the state of the control '{name}' depends on its history, which {what} does not have. Use a table or a proportional "
                "control, or simulate.",
                code="model.element-not-supported",
            )


def refuse_controls(named: Sequence[str], what: str, cure: str) -> None:
    """Refuse what knows no controls of a deck.

    Raises
    ------
    DeckError
    """
    if named:
        raise DeckError(f"{what} does not support controls, and '{named[0]}' is in use. {cure}", code="model.element-not-supported")
