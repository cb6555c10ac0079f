"""Responses of runs to everything that is not known: those of a fit, at its readings, and that of a question, at its times."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.units import Array
from thermid.fit._error_model.courses import ElementCourse, OperatingPoint
from thermid.fit._error_model.elements import (
    WITH_ENTRIES,
    DepartureHeat,
    ElementLaw,
    PathLaw,
    Way,
    class_of,
    conductors_of,
    entering_heat,
    gradient,
    lagged,
    moved_heat,
    places,
    room_heats,
)
from thermid.fit._error_model.gaussian import RunRows, Wander, features, innovations, pivots
from thermid.fit._error_model.sizes import (
    ALL_COLUMNS,
    COLUMNS,
    CONDUCTORS,
    EVERY,
    GRADIENT,
    HEATED,
    LATE_SHARE,
    LATE_TIME,
    LEFT_OVER,
    LENGTHS,
    NODES,
    READINGS,
    ROOM_TIME,
)
from thermid.fit._problem.residuals import Influence, Problem, Unknown
from thermid.model.tree import FlatConductor, TableSignal
from thermid.simulation.runs import Network


@dataclass(frozen=True)
class UnknownColumn:
    """An unknown beside the values of a fit.

    Parameters
    ----------
    name : str      ``exponent skin``
    group : str     Which size its prior's standard deviation is a multiple of; empty for none.
    size : float    That multiple, or the standard deviation itself.
    source : str    What a reader is told that it belongs to.
    mean : float    Of its prior; those of laws have theirs in their laws.
    """

    name: str
    group: str
    size: float
    source: str
    mean: float = 0.0


@dataclass(frozen=True, eq=False)
class Smooth:
    """The smooth departure of a conductor: where it was found, and the features of its random function.

    Parameters
    ----------
    at : OperatingPoint     Where it was found.
    kind : str              Its class.
    pivots : array (r, 2)   Of ln(difference) and level, from where it was found.
    centre : array (r,)     Mean of the features over the runs of the fit, weighted by heat: a value of the fit is the one there. Where
                            conductors share the value it is that times the part of their heat that this one carries.
    thinned : tuple (r,)    Whether its gas was another there than air on the ground.
    outside : float         What of its variance lies outside of the features over these runs, weighted by heat. [-]
    """

    at: OperatingPoint
    kind: str
    pivots: Array
    centre: Array
    thinned: tuple[bool, ...]
    outside: float = 0.0

    @classmethod
    def of_conductor(
        cls,
        c: FlatConductor,
        at: OperatingPoint,
        kind: str,
        several: Sequence[tuple[ElementCourse, bool]],
        columns: int = COLUMNS,
        part: float = 1.0,
        around: Sequence[int] = (-1, 0, 1),
    ) -> Smooth:
        """Return the smooth departure of a conductor from its law over the runs of a fit, given with whether their gas is thinned.

        Pivots are chosen where the conductor carries more than `HEATED` of its largest heat, at most `columns` in each gas; centre and
        what lies outside are means over all runs, weighted by heat. `part` of the heat of the conductors that share its value is its own.
        Features are laid so many of their lengths `around` the runs.
        """
        runs = [(r, thin) for r, thin in several if c.path in r.flows]
        most = max(float(np.abs(r.flows[c.path]).max()) for r, _ in runs)
        aside = np.array(LENGTHS)
        pivots_of_gas: list[Array] = []
        gases: list[bool] = []
        for gas in dict.fromkeys(thin for _, thin in runs):
            places_of_runs = [places(r, c, at)[np.abs(r.flows[c.path]) > HEATED * most][::EVERY] for r, thin in runs if thin == gas]
            every = np.concatenate(places_of_runs)
            if every.size:
                wide = np.concatenate([every + aside * (i, j) for i in around for j in around])
                pivots_of_gas.append(pivots(wide, np.array(LENGTHS), LEFT_OVER, columns))
                gases += [gas] * len(pivots_of_gas[-1])
        bare = cls(at, kind, np.concatenate(pivots_of_gas), np.zeros(len(gases)), tuple(gases))
        heat = np.concatenate([np.abs(r.flows[c.path]) for r, _ in runs])
        phi = np.concatenate([bare._features(c, r, thin) for r, thin in runs])
        outside = float(heat @ _variance_outside(phi) / max(heat.sum(), 1e-300))
        return replace(bare, centre=part * (heat @ phi) / heat.sum(), outside=outside)

    def _features(self, c: FlatConductor, course: ElementCourse, thinned: bool) -> Array:
        """Return the features along a run (times, r); those of another gas are zero."""
        has_same_gas = np.array(self.thinned) == thinned
        out = np.zeros((course.flows[c.path].size, has_same_gas.size))
        if has_same_gas.any():
            out[:, has_same_gas] = features(places(course, c, self.at), self.pivots[has_same_gas], np.array(LENGTHS))
        return out

    def along(self, c: FlatConductor, course: ElementCourse, thinned: bool) -> tuple[Array, float]:
        """Return the centred features along a run (times, r), and how much more of the variance than in the fit lies outside of them. [-]

        What lies outside in the runs of the fit is what so few features leave of them, and their readings have told it. In a gas of which
        no run is, what the gas carries departs anew: nothing of what was found in the other says how. What is radiated departs by its
        finish, which is an unknown of its own.
        """
        phi = self._features(c, course, thinned)
        flow = course.flows[c.path]
        carried = 1.0 - course.radiated.get(c.path, 0.0) / np.where(flow == 0.0, np.inf, flow) if thinned not in self.thinned else 1.0
        rest = float(np.abs(flow) @ (_variance_outside(phi) * carried**2) / max(np.abs(flow).sum(), 1e-300))
        return phi - self.centre, max(rest - self.outside, 0.0) / max(1.0 - self.outside, 1e-300)


def _variance_outside(phi: Array) -> Array:
    """Return the share 1 - sum phi^2 (times,) of the variance that lies outside of features phi (times, r), 0 to 1. [-]"""
    return np.asarray(np.clip(1.0 - np.sum(phi**2, axis=1), 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class Departures:
    """What may depart of a model, as a fit's runs show it.

    Parameters
    ----------
    smooth : dict           Conductor -> its smooth departure.
    hidden : tuple          Time constants of hidden masses. [s]
    nodes : tuple of str    Whose masses depart.
    aside : int             Elements that carry or store too little heat to be followed.
    """

    smooth: Mapping[str, Smooth]
    hidden: tuple[float, ...]
    nodes: tuple[str, ...] = ()
    aside: int = 0

    @property
    def of_runs_alone(self) -> Departures:
        """Those by which one run differs from the next: no element departs from its law in what all runs share."""
        smooth = {p: replace(s, pivots=s.pivots[:0], centre=s.centre[:0], thinned=()) for p, s in self.smooth.items()}
        return replace(self, smooth=smooth, hidden=())

    def shared(
        self, network: Network, course: ElementCourse, way: Way, laws: Mapping[str, ElementLaw]
    ) -> list[tuple[UnknownColumn, DepartureHeat]]:
        """Return the departures that all runs share, each with the heats that it adds in one run: of laws, conductors and hidden masses."""
        out: list[tuple[UnknownColumn, DepartureHeat]] = []
        for path, c in conductors_of(network, course).items():
            smooth_departure = self.smooth.get(path)
            if smooth_departure is None and not isinstance(laws.get(path), PathLaw):
                continue
            heat = course.flows[path]

            def add(name: str, group: str, size: float, watts: Array, c: FlatConductor = c) -> None:
                """Add a departure: its size, and the heat [W] that it moves along the conductor."""
                title = f"{name} of {c.path}"
                out.append((UnknownColumn(title, group, size, c.path), moved_heat(title, network, c.ends, course.times, watts)))

            if path in laws:
                for kind, watts in laws[path].heats(course, c).items():
                    if (path, kind) in way.sizes:
                        add(kind, *way.sizes[path, kind], watts)
            if smooth_departure is not None:
                phi, _ = smooth_departure.along(c, course, thinned(network, c))
                for k, column in enumerate(phi.T):
                    add(f"departure {k}", smooth_departure.kind, 1.0, heat * column)
        heated = {node for node, _ in course.powers.values()} if way.name.endswith(WITH_ENTRIES) else ()
        for node in (n for n in self.nodes if n in course.stores):
            # a mass of the size C of the node's own takes up C (T - T_h) / tau, as if that course of heat were late
            whole = course.stores[node][1] * course.kelvin[node]
            late = [(UnknownColumn(f"mass ({time:.3g} s) of {node}", "hidden", 1.0, node), whole / time, time) for time in self.hidden]
            for time in (LATE_TIME * time for time in self.hidden if node in heated):
                column = UnknownColumn(f"late heat ({time:.3g} s) of {node}", "", LATE_SHARE, node, LATE_SHARE)
                late.append((column, entering_heat(network, course, node), time))
            for column, watts, time in late:
                more = lagged(watts, course.times, time) - watts
                more[-1] *= not course.settled
                out.append((column, DepartureHeat(column.name, ((node, TableSignal(course.times, more, False)),))))
        for node in way.spots:
            name = f"gradient of {node}"
            out.append((UnknownColumn(name, "", GRADIENT, node), gradient(name, network, course, node)))
        return out

    def of_run(self, network: Network, course: ElementCourse, begun: bool = False) -> list[tuple[UnknownColumn, DepartureHeat]]:
        """Return the departures that belong to one run alone, each with its heats: of conductors, heat stores, powers and boundaries."""
        out: list[tuple[UnknownColumn, DepartureHeat]] = []
        for path, c in ((p, c) for p, c in conductors_of(network, course).items() if p in self.smooth):
            name = f"{path} in this run"
            out.append((UnknownColumn(name, "run", 1.0, path), moved_heat(name, network, c.ends, course.times, course.flows[path])))
        for node, (through, _) in ((n, s) for n, s in course.stores.items() if n in self.nodes):
            name = f"{node} in this run"  # what jumps in the heat that it takes up are powers: given as they are, or the value would differ
            powers = ((node, power.scaled(-1.0)) for at, power in course.powers.values() if at == node)
            taken = DepartureHeat(name, ((node, TableSignal(course.times, -through, False)), *powers))
            out.append((UnknownColumn(name, "run", 1.0, node), taken))
        for load, (node, power) in course.powers.items() if self.nodes else ():
            name = f"{load} in this run"
            out.append((UnknownColumn(name, "run", 0.5, load), DepartureHeat(name, ((node, power),))))
        for boundary in course.follows:
            if course.follows[boundary]:
                group = "room" if np.ptp(course.kelvin[boundary]) > 0.0 else "unlogged"
                heats = room_heats(network, course, boundary, ROOM_TIME, begun)
                out += [(UnknownColumn(h.name, group, 1.0, boundary), h) for h in heats]
        return out

    def beyond(self, network: Network, course: ElementCourse) -> dict[str, tuple[str, float]]:
        """Return conductor -> its class, and what of its variance lies further off than its features reach. [-]"""
        every = conductors_of(network, course)
        return {p: (s.kind, s.along(every[p], course, thinned(network, every[p]))[1]) for p, s in self.smooth.items() if p in every}


def thinned(network: Network, c: FlatConductor) -> bool:
    """Return whether the gas of a conductor is another than air on the ground."""
    return bool(c.gas) and network.media.changed(c.gas)


def departures_of(
    networks: Sequence[Network],
    courses: Sequence[ElementCourse],
    points: Mapping[str, OperatingPoint],
    hidden: tuple[float, ...],
    fitted: Collection[str] = (),
    around: Sequence[int] = (-1, 0, 1),
) -> Departures:
    """Return what may depart of a model by the runs of a fit: the `CONDUCTORS` with most heat [W], the `NODES` with most stored heat [J].

    Parameters
    ----------
    points : dict       Path -> where an element was over the runs: difference and level. [K]
    hidden : tuple      Times of slow parts that the model may lack. [s]
    fitted : collection Paths of the fitted values; elements that share one depart by their part of its heat.
    """
    network = networks[0]
    every: dict[str, FlatConductor] = {}
    for course in courses:
        every |= conductors_of(network, course)
    heat = {p: sum(float(np.abs(r.flows[p]).mean()) for r in courses if p in r.flows) for p in every if p in points}
    several = {p: every[p] for p in sorted(heat, key=lambda p: -heat[p])[:CONDUCTORS]}
    several = {p: c for p, c in every.items() if p in several}
    stored = {n: sum(r.stores[n][1] * float(np.ptp(r.kelvin[n])) for r in courses if n in r.stores) for r in courses for n in r.stores}
    nodes = tuple(sorted(stored, key=lambda n: -stored[n])[:NODES])
    columns = min(COLUMNS, ALL_COLUMNS // max(len(several), 1))
    values = {p: {network.flat.parameters.literal_behind(f) for f in every[p].fields.values()} & {*fitted} for p in heat}
    smooth = {}
    for p, c in several.items():
        part = heat[p] / (heat[p] + sum(h for q, h in heat.items() if q != p and values[p] & values[q]))
        runs = [(course, thinned(n, c)) for n, course in zip(networks, courses, strict=True)]
        smooth[p] = Smooth.of_conductor(c, points[p], class_of(c, network), runs, columns, part, around)
    return Departures(smooth, hidden, nodes, len(heat) - len(several) + len(stored) - len(nodes))


def widened(problem: Problem, i: int, network: Network, scenario: Any, heats: Sequence[DepartureHeat]) -> Problem:
    """Return the problem of experiment i alone, with the amount of each heat as one unknown more."""
    experiment = replace(problem.experiments[i], network=network, scenario=scenario)
    unknowns_of_run = [
        replace(u, targets=tuple(replace(t, experiment=0) for t in u.targets if t.experiment == i)) for u in problem.unknowns
    ]
    more = [Unknown(h.name, "pattern", (Influence(0, h.scale),) if h.into else (), 0.0) for h in heats]
    return replace(problem, experiments=(experiment,), unknowns=(*unknowns_of_run, *more), coupled=())


@dataclass(frozen=True, eq=False)
class SensorRows:
    """A sensor of a run: residuals and their derivatives.

    Parameters
    ----------
    times, residuals, noise : array (m,)    [s], [K], [K]
    rows : array (m, unknowns)              What a unit of each unknown adds to a reading. [K]
    """

    times: Array
    residuals: Array
    noise: Array
    rows: Array

    def averaged(self) -> SensorRows:
        """Return means over `READINGS` equal stretches: residuals [K], rows, noise of a mean [K]; itself where it has fewer."""
        size = self.times.size
        if size <= READINGS:
            return self
        edges = np.linspace(0, size, READINGS + 1).astype(int)
        count = np.diff(edges)

        def mean(x: Array) -> Array:
            """Return the mean of a course over each stretch of times (stretches,)."""
            return np.asarray(np.add.reduceat(x, edges[:-1], axis=0) / (count if x.ndim == 1 else count[:, None]))

        return SensorRows(mean(self.times), mean(self.residuals), np.sqrt(mean(self.noise**2) / count), mean(self.rows))

    def taken(self, columns: Sequence[int]) -> SensorRows:
        """Return the derivatives of the unknowns in `columns` only, in that order."""
        return replace(self, rows=self.rows[:, list(columns)])


def run_rows(traces: Sequence[SensorRows], wanders: Sequence[Wander], shared: int) -> list[RunRows]:
    """Return a run's whitened rows [-] for each noise process of `wanders`; the first `shared` unknowns are those of all runs.

    Whitened are rows (times, unknowns) and residuals (times,) of each trace, by its noise and the process; its ln det is kept with them.
    """
    parts, logs = [], np.zeros(len(wanders))
    for size in dict.fromkeys(t.times.size for t in traces):
        alike = [t for t in traces if t.times.size == size]
        columns = np.stack([np.column_stack([t.rows, t.residuals]) for t in alike], axis=1)
        white = np.empty((len(wanders), *columns.shape))
        logs += innovations([t.times for t in alike], columns, [t.noise for t in alike], wanders, white)
        parts.append(white.reshape(len(wanders), -1, columns.shape[-1]))
    every = np.concatenate(parts, axis=1) if len(parts) > 1 else parts[0]
    return [RunRows.of_rows(rows, shared, float(log)) for rows, log in zip(every, logs, strict=True)]
