"""`energy_balance`: what goes in, what leaves and what is stored in a measured stretch, and the watts that are left."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.errors import DeckError, RecordError
from thermid.base.results import Result
from thermid.base.units import ICE_POINT, Array, Kelvin, short, value_of
from thermid.fit.calibration import Calibration, Experiment, attached, role_and_target
from thermid.inference._explain.thresholds import BALANCE_STEP
from thermid.measure.records import Record, SteadyPoint, SteadyValue
from thermid.model.tree import Constant, FlatControl, Model
from thermid.simulation.runs import Engine, Scenario, Wiring, steady


@dataclass(frozen=True, eq=False)
class EnergyBalance(Result):
    """Where the heat of a measured case goes, by the conductances of a model.

    Parameters
    ----------
    title : str                     Model and stretch.
    loads : dict                    Load -> power. [W]
    boundaries : dict               Conductor -> heat that it takes to a boundary. [W]
    stored : dict                   Measured node -> heat that it takes up. [W]
    unexplained : dict              Measured node -> what is left of its balance (positive: more comes in than the model lets out), and its
                                    standard error from temperatures, drift and power, and of a fit from its values. [W]
    total, error : float            The same over the whole model. [W]
    temperatures : dict             Node -> temperature, calculated where it was not measured. [K]
    calculated : tuple of str       Nodes that were not measured.
    """

    title: str
    loads: Mapping[str, float]
    boundaries: Mapping[str, float]
    stored: Mapping[str, float]
    unexplained: Mapping[str, tuple[float, float]]
    total: float
    error: float
    temperatures: Mapping[str, float]
    calculated: tuple[str, ...]

    @property
    def closes(self) -> bool:
        """Whether what is left lies within twice its error."""
        return abs(self.total) <= 2.0 * self.error

    def __str__(self) -> str:
        """The balance as text."""
        lines = [f"{self.title}: heat balance"]
        lines += [f"  in      {name:<28} {watts:+9.4f} W" for name, watts in self.loads.items()]
        lines += [f"  out     {name:<28} {-watts:+9.4f} W" for name, watts in self.boundaries.items()]
        lines += [f"  stored  {name:<28} {-watts:+9.4f} W" for name, watts in self.stored.items()]
        put_in = sum(self.loads.values())
        share = f", {short(100 * abs(self.total / put_in))} % of the power" if put_in else ""
        lines.append(f"  unexplained {self.total:+.4f} +- {short(self.error)} W{share}")
        if not self.closes:
            where = max(self.unexplained, key=lambda n: abs(self.unexplained[n][0]) / max(self.unexplained[n][1], 1e-12))
            way = (
                "leaves by a path that the model lacks (a mount, a lead, radiation), or the power is too high in the log"
                if self.total > 0
                else "comes from a source that the model lacks, or the conductances of the model are too large"
            )
            lines.append(f"  More than its error: heat {way}. Largest at '{where}'.")
        if self.calculated:
            lines.append(f"  not measured, calculated as settled: {', '.join(self.calculated)}")
        return "\n".join(lines)


def energy_balance(
    model: Model | Calibration,
    record: Record,
    start: str | float = "start",
    end: str | float = "end",
    *,
    scenario: Scenario | None = None,
    limit: str | float = "1 [K/h]",
) -> EnergyBalance:
    """Heat balance of a measured stretch: loads, heat to the boundaries, storage, and what is left unexplained.

    Parameters
    ----------
    model : Model or Calibration    Whose conductances and capacitances count; of a fit, those that it found.
    record : Record                 The log.
    start, end : str or float       The stretch, as in `Record.trim`.
    scenario : Scenario             What the log does not say.
    limit : str or float            Drift above which a temperature is not settled. [K/s]

    Raises
    ------
    RecordError   When a channel is not settled, or bound to nothing.

    Notes
    -----
    The errors of a fit's values count with their covariance, those that stages below found among them; of a model they count as exact.

    For each measured node, power in, less heat to its neighbours at the measured temperatures, less capacitance times drift. Nodes that
    were not measured are calculated from those that were.
    """
    of = model.model if isinstance(model, Calibration) else model
    point = record.steady(start, end, limit=limit)
    case = _Case(of, point, scenario)
    values = _by_values(model, case, lambda moved: _Case(moved, point, scenario)) if isinstance(model, Calibration) else None
    x = case.given
    here = case.parts(x)
    slopes = np.array([(case.parts(x + d).left - here.left) / d.sum() for d in np.diag(case.steps)])
    causes = slopes * case.errors[:, None]
    causes = causes if values is None else np.concatenate([causes, values])
    errors = np.sqrt(np.sum(causes**2, axis=0))
    total = float(np.linalg.norm(causes.sum(axis=1)))
    unexplained = {n: (float(w), float(e)) for n, w, e in zip(case.nodes, here.left, errors, strict=True)}
    title = f"{of.title}, {point.name}"
    return EnergyBalance(title, here.loads, here.out, here.stored, unexplained, float(here.left.sum()), total, here.at, case.calculated)


def _by_values(fit: Calibration, case: _Case, moved: Callable[[Model], _Case]) -> Array:
    """Return the change (sources, nodes) of each node's balance by one standard deviation of each source of errors. [W]

    R'D, with the differences D (values, nodes) over `BALANCE_STEP` of each fitted value, and R R' the covariance of the values; `moved`
    makes the case of another model.
    """
    states = [s for s in fit.store.states.values() if s.kind == "parameter" and s.known]
    here, out = case.parts(case.given).left, []
    for s in states:
        size = BALANCE_STEP * (abs(s.value) or 1.0)
        there = moved(case.of.with_values({p: f"{s.value + size!r} [{s.unit}]" for p in s.acts}))
        out.append((there.parts(case.given).left - here) / (BALANCE_STEP if s.log else size))
    return fit.store.rows([s.path for s in states]).T @ np.array(out).reshape(len(states), here.size)


@dataclass(frozen=True, eq=False)
class _Parts:
    """Terms of a balance: `left` (nodes,) unexplained, loads, heat out of boundaries, stored [W]; and temperatures `at` nodes [K]."""

    left: Array
    loads: dict[str, float]
    out: dict[str, float]
    stored: dict[str, float]
    at: dict[str, float]


def _mean_of_sensors(values: list[float], errors: list[float]) -> tuple[float, float]:
    """Return the mean [K] of the readings of one node, weighted by 1 / error^2, and its standard error [K], widened where they disagree."""
    # weighted mean, its error widened by the root of chi^2 / (n - 1) where that is above 1 (Birge's ratio)
    weights = np.maximum(np.array(errors), 1e-12) ** -2.0
    mean, size = float(weights @ values / weights.sum()), float(weights.sum() ** -0.5)
    apart = float(weights @ (np.array(values) - mean) ** 2) / max(len(values) - 1, 1)
    return mean, size * max(1.0, apart**0.5)


class _Case:
    """A settled stretch bound to a model, with its inputs as one vector, so that each can be moved by itself.

    Inputs (`slots`): temperature of a node or boundary [K], power of a load [W], rate of a node with a capacitance [K/s]; `given` are their
    values, `errors` their standard errors, `steps` the differences by which derivatives are taken, each (inputs,).
    """

    def __init__(self, model: Model, point: SteadyPoint[Record], scenario: Scenario | None) -> None:
        """Bind the steady point to the model, sensors at their nodes."""
        self.of = model
        # sensors read their nodes themselves once nothing changes: no lag, no heat capacity; leads stay
        parts = {c: c.part for c in point.record.channels.values() if c.part is not None}
        record = point.record.with_channels(
            *(replace(c, part=replace(part, lag=0.0, lag_accuracy=0.0, capacitance=0.0)) for c, part in parts.items())
        )
        self.model = attached(model, record)[0]
        experiment = Experiment.bind(model, record, scenario)
        network, self.base = experiment.network, experiment.scenario
        self.prescribed: list[str] = []
        self.slots: list[tuple[str, str]] = []
        values, errors = list[float](), list[float]()
        rates = list[tuple[str, float, float]]()
        read: dict[tuple[str, str], list[SteadyValue]] = {}
        for name, v in point.values.items():
            role, path = role_and_target(point.source, point.source.channel(name), network)
            if role != "command":
                read.setdefault((role, path), []).append(v)
        for (role, path), several in read.items():
            self.slots.append((role, path))
            value, error = _mean_of_sensors([v.value for v in several], [float(np.hypot(v.error, v.accuracy or 0.0)) for v in several])
            values.append(value)
            errors.append(error)
            if role == "node":
                rates.append((path, *_mean_of_sensors([v.rate for v in several], [v.rate_error for v in several])))
        self.nodes = tuple(p for role, p in self.slots if role == "node" and network.numbers().capacitances.get(p) is not None)
        if not self.nodes:
            raise RecordError(
                "no channel measures a node with a capacitance, so no balance is possible. Bind one with node = '...'.",
                point.name,
                code="record.does-not-apply",
            )
        for path, rate, error in rates:
            if path in self.nodes:
                self.slots.append(("rate", path))
                values.append(rate)
                errors.append(error)
        self.given, self.errors = np.array(values), np.array(errors)
        self.steps = np.array([1e-6 if role == "rate" else 1e-3 for role, _ in self.slots])
        self.calculated = tuple(n for n in network.nodes if n not in self.nodes)
        self.network = network

    def parts(self, x: Array) -> _Parts:
        """Return the balance at values `x` (inputs,), in SI: residual = loads - heat to neighbours - C dT/dt of each measured node. [W]

        Heat flows count positive out of the node. Nodes that were not measured stand where they settle with the measured ones held.
        """
        by = {slot: float(value) for slot, value in zip(self.slots, x, strict=True)}
        boundaries = {p: Constant(v) for (role, p), v in by.items() if role == "boundary"}
        loads = {p: Constant(v) for (role, p), v in by.items() if role == "load"}
        scenario = self.base.with_(boundaries=boundaries, loads=loads)
        measured = {n: by["node", n] for n in self.nodes}
        at = dict(measured)
        if self.calculated:
            driven = replace(scenario, prescribed={n: Constant(v) for n, v in measured.items()}, initial={}, start=Kelvin(ICE_POINT + 20.0))
            at |= {n: t for n, t in steady(self.model, driven).items() if n in self.calculated}
        wiring = Wiring(self.network, replace(scenario, initial={}, start=Kelvin(ICE_POINT + 20.0)))
        engine, a, zero = Engine(wiring), wiring.assemble(), np.zeros(1)
        at |= {b: float(wiring.boundary(b, zero, a.offsets)[0]) for b in self.network.boundaries}
        what = "an energy balance at one instant"
        refuse_controllers(self.network.flat.controls, self.network.controls, what)
        if cools := [n for n, store in self.network.stores.items() if store.melt is not None]:
            raise DeckError(
                f"{what} cannot know whether '{cools[0]}', which supercools, has crystals. Simulate, and read the run's balance.",
                code="model.element-not-supported",
            )
        temperatures = {n: np.array([t]) for n, t in at.items()}
        flows = wiring.conductor_flows(a.numbers, temperatures, zero, wiring.shares(a.numbers, temperatures.__getitem__, zero))
        columns = np.array([[*a.reduced.states(at), *(at[b] for b in self.network.boundaries)]], dtype=float)
        powers = {name: float(p[0]) for name, p in engine.powers(a, columns, zero).items()}
        rows = {row.name: row for row in a.numbers.conductors}
        into = {row.name: row.node for row in a.numbers.loads}
        stores = self.network.stores
        share = {n: float(stores[n].share(at[n])) if n in stores else 1.0 for n in self.nodes}
        capacity = {n: share[n] * value_of(a.numbers.capacitances[n] or 0.0) for n in self.nodes}
        stored = {n: capacity[n] * by["rate", n] for n in self.nodes}
        residuals = []
        for n in self.nodes:
            out = sum(float(f[0]) * ((rows[name].ends[0] == n) - (rows[name].ends[1] == n)) for name, f in flows.items())
            residuals.append(sum(p for name, p in powers.items() if into[name] == n) - out - stored[n])
        leaving = {}
        for name, f in flows.items():
            first, second = (end in self.network.boundaries for end in rows[name].ends)
            if first != second:
                leaving[name] = float(f[0]) * (1.0 if second else -1.0)
        return _Parts(np.array(residuals), powers, leaving, stored, at)


def refuse_controllers(controls: Mapping[str, FlatControl], named: Sequence[str], what: str) -> None:
    """Refuse controls with a history (thermostats, modes, PID, sampled ones) for what has none, such as an export.

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
