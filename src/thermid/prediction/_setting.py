"""`Setting`: a budget made ready for runs of one scenario - by derivatives, or member by member - in one way of carrying heat.

What an element departs by is to first order heat that loads of zero size put into nodes. Answers are straight in that; they bend with
values, powers and temperatures, of which members are drawn.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from operator import itemgetter
from time import process_time
from typing import Any

import numpy as np

from thermid.base.errors import SolverError
from thermid.base.units import Array, Bools
from thermid.fit.error_model import DepartureHeat, course_of, deviations_of_run, with_heats, with_laws
from thermid.model.tree import Model
from thermid.prediction._budget import EXPECTED_OF, Assumed, Budget, Target, assumed_values, combined, open_ranges
from thermid.prediction._known import Rows
from thermid.simulation.runs import Engine, Ensemble, MemberTurnings, Scenario, Simulator, Solution, Wiring, Workers, in_tasks, prepare
from thermid.values.store import Normal, Shifted, Source, deviated

MAX_EFFECT_LEFT = 0.3
"""Part of the effect of an assumed value alone that is left with the fit solved again, below which the fit has taken it back. [-]"""
PROBE_MEMBERS = 32
"""Members that tell whether derivatives do, in pairs of opposite numbers, and whether anything switches."""
VALUE_FORMS = ("add", "log", "factor")
"""Forms of targets that are values."""


@dataclass(frozen=True, eq=False)
class Linear:
    """Temperatures of one run with best values, and their derivatives with respect to the sources.

    Parameters
    ----------
    run : Solution
    settled : dict          Node -> temperature with the inputs of the end kept for good [K]; empty where nothing settles.
    columns : dict          Node -> derivatives (times and the settled state, sources), the last NaN where nothing settles. [K per unit]
    """

    run: Solution
    settled: Mapping[str, float]
    columns: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Drawn:
    """Temperatures of members.

    Parameters
    ----------
    kelvin : dict           Node -> temperatures (times, members). [K]
    turnings : dict         Node -> turning points between samples; a node is missing where members were not followed.
    runs : Ensemble         Behind them; None where nothing but a constant differs.
    """

    kelvin: Mapping[str, Array]
    turnings: Mapping[str, MemberTurnings]
    runs: Ensemble | None


def prepared(budget: Budget, *, scenario: Scenario | None = None, times: Any = None, options: Any = None) -> Simulator:
    """Return the simulator of a budget in its scenario, or in a variant of it: the same for all ways of carrying heat."""
    return prepare(budget.model, budget.scenario if scenario is None else scenario, budget.names, times=times, options=options)


@dataclass(frozen=True, eq=False)
class Setting:
    """A budget of one way of carrying heat, made ready for runs of one scenario.

    Parameters
    ----------
    budget : Budget
    ready : Simulator       With everything free that a value, a power or a temperature among the targets acts on.
    carriers : dict         Target -> free names that carry it; none for nodes, and for departures that do not act here.
    at : dict               Free name -> where the derivatives of its fit were taken, where that is not the value of the model. [SI]
    full : Simulator        The same with departures as loads of zero size.
    sizes : dict            Target of a departure -> what a unit of it is. [-], [K]
    far : dict              Departure of this run -> the part of its variance that it has for lying beyond the runs of the fit. [-]
    """

    budget: Budget
    ready: Simulator
    carriers: Mapping[Target, tuple[str, ...]]
    at: Mapping[str, float]
    full: Simulator
    sizes: Mapping[Target, float] = field(default_factory=dict)
    far: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of_budget(cls, budget: Budget, ready: Simulator) -> Setting:
        """Return a budget of one way made ready for a scenario, by what `prepared` gives of it."""
        conditions = ready.wiring.scenario
        carriers = {t: tuple(dict.fromkeys(map(ready.canonical, (t.name, *t.also)))) for t in budget.targets if t.form in VALUE_FORMS}
        if not budget.ways:
            return cls(budget, ready, carriers, {}, ready)
        (way,) = budget.ways
        plain = ready.wiring.network
        laws = {p: law for kept_way in way.kept for p, law in kept_way.laws_in(plain).items()}
        network = with_laws(plain, laws)
        wiring = Wiring(network, conditions, ready.free)
        ready = replace(ready, wiring=wiring, engine=Engine(wiring))
        values_of_way = {ready.canonical(n): x for n, x in way.at.items()}
        at = {n: x + (ready.nominal[n] if n in network.boundaries else 0.0) for n, x in values_of_way.items() if n in ready.free}
        x = ready.vector(ready.with_units(at)) if ready.free else None
        try:
            rest = ready.settled(ready.with_units(at))[0]
        except SolverError:
            rest = None
        if not any(any(kept_way.sizes.values()) for kept_way in way.kept):
            return cls(budget, ready, carriers, at, ready)
        course = course_of(wiring, ready.engine, x, ready.options, rest)
        wanted = {t.name: t for t in budget.targets if t.form == "heat"}
        heats: dict[str, DepartureHeat] = {}
        sizes: dict[Target, float] = {}
        far: dict[str, float] = {}
        for kept_way in way.kept:
            beyond = kept_way.departures.beyond(network, course)
            alone = kept_way.departures.of_run(network, course, begun=True)
            for c, h in (*kept_way.departures.shared(network, course, kept_way.way, laws), *alone):
                if h.name in wanted and h.name not in heats:
                    heats[h.name] = h
                    run_part, far_part = deviations_of_run(c, kept_way.sizes, beyond) if any(h is x for _, x in alone) else (1.0, 0.0)
                    sizes[wanted[h.name]] = float(np.hypot(run_part, far_part))
                    far[h.name] = (far_part / max(sizes[wanted[h.name]], 1e-300)) ** 2
        scales = {n: (h.scale,) if h.into else () for n, h in heats.items()}
        carriers |= {wanted[n]: names for n, names in scales.items()}
        wide = Wiring(*with_heats(network, conditions, heats.values()), (*ready.free, *(s for names in scales.values() for s in names)))
        return cls(budget, ready, carriers, at, replace(ready, wiring=wide, engine=Engine(wide)), sizes, far)

    @cached_property
    def switches(self) -> bool:
        """Whether temperatures switch anything, in the run with the best values or in one of `PROBE_MEMBERS`.

        What such a run is at an instant follows its switching times: the derivative grows from cycle to cycle, while members stay where the
        hysteresis holds them.
        """
        if not self.ready.wiring.network.switches:
            return False
        sources = self.budget.drawn(self.budget.numbers(1, 0, PROBE_MEMBERS))
        values = self._values_in_runs(sources)
        members = ({n: float(x[k]) for n, x in values.items()} for k in range(PROBE_MEMBERS if values else 0))
        return bool(self._run._run.answer.switched) or any(self.full.run(self.full.with_units(x))._run.answer.switched for x in members)

    @property
    def _derivative_point(self) -> dict[str, Any]:
        """Free name -> value [SI] where the derivatives are taken: departures at zero, others where the fit took its own."""
        still = {n: 0.0 for t, names in self.carriers.items() if t.form == "heat" for n in names}
        return still | self.full.with_units(self.at)

    @cached_property
    def _run(self) -> Solution:
        """The run where the derivatives are taken."""
        return self.full.run(self._derivative_point, sensitivities=True)

    def linear(self, nodes: Sequence[str] | None = None) -> Linear:
        """Return one run with its derivatives (times and the settled state, sources) of nodes, all by default. [K per unit of a source]"""
        run = self._run
        chosen = list(
            dict.fromkeys(run[n].path for n in (nodes if nodes is not None else [k for k in run.nodes if k not in self.ready.without_gas]))
        )
        try:
            settled, moves = self.full.settled(self._derivative_point)
        except SolverError:
            settled, moves = {}, {}
        chain = self._chain()
        columns = {}
        for n in chosen:
            size = (self.ready.times.size, len(self.full.free))
            slopes = run.slopes(n) if self.full.free else np.zeros(size)
            rest = moves.get(n, np.full(size[1], np.nan)) if size[1] else np.zeros(0)
            columns[n] = np.vstack([slopes, rest[None, :]]) @ chain + self._added_after_run(n)[None, :]
        return Linear(run, settled, columns)

    def secants(self, linear: Linear) -> Linear:
        """Return it with (T(+s) - T(-s)) / (2 s) for derivatives, s a standard deviation of each source, where anything switches.

        Columns are (times + 1, sources) [K per unit of the source], the last row not a number: where it settles has no such difference. At
        an instant members differ by their switching times, so by the hysteresis at most.
        """
        if not self.switches:
            return linear
        sizes = np.where(self.budget.sizes > 0.0, self.budget.sizes, 1.0)
        up, down = (self.temperatures(sign * np.diag(sizes), list(linear.columns), extremes=False).kelvin for sign in (1.0, -1.0))
        settled = np.full((1, sizes.size), np.nan)
        return replace(linear, columns={n: np.vstack([(up[n] - down[n]) / (2.0 * sizes), settled]) for n in up})

    def cancelled(self, linear: Linear) -> Bools:
        """Return which sources (sources,) are values whose effect the values of a fit take back, solved again for each, in this scenario.

        None where anything switches: there no straight line holds.
        Both effects are large and of opposite sign, and fitted values are known to follow along a straight line only: what members differ
        from the straight model by is then the error of that line. Such a source leaves less than `MAX_EFFECT_LEFT` of its effect alone.
        """
        budget = self.budget
        is_own_source = np.array([[s.name in (t.name, *t.also) for s in budget.sources] for t in budget.targets], dtype=bool)
        is_own_source = is_own_source.reshape(len(budget.targets), len(budget.sources))
        many: Bools = is_own_source.any(axis=0) & (np.where(is_own_source, 0.0, budget.gain) != 0.0).any(axis=0) & (not self.switches)
        if not many.any() or not self.full.free:
            return many
        chain = self._chain(np.where(is_own_source, budget.gain, 0.0))
        alone, remaining = np.zeros(many.size), np.zeros(many.size)
        for n, columns in linear.columns.items():
            alone += np.sum((linear.run.slopes(n) @ chain) ** 2, axis=0)
            remaining += np.sum(columns[:-1] ** 2, axis=0)
        many &= remaining < MAX_EFFECT_LEFT**2 * alone
        return many

    def _chain(self, gain: Array | None = None, forms: Sequence[str] = (*VALUE_FORMS, "heat")) -> Array:
        """Return the derivative of each free name by each source (free, sources), through targets of some `forms`. [SI per unit]

        `gain` (targets, sources) takes the place of the budget's. Logarithms and factors are taken to first order: dv = v d(ln v).
        """
        place = {name: k for k, name in enumerate(self.full.free)}
        out = np.zeros((len(place), len(self.budget.sources)))
        for t, row in zip(self.budget.targets, self.budget.gain if gain is None else gain, strict=True):
            for name in self.carriers.get(t, ()) if t.form in forms else ():
                factor = self._deviation_base(name) if t.form in ("log", "factor") else self.sizes.get(t, 1.0)
                out[place[name]] += factor * row
        return out

    def _deviation_base(self, name: str) -> float:
        """Return the value of a free name about which it deviates: where the fit took its derivatives, else that of the model. [SI]"""
        return self.at.get(name, self.ready.nominal[name])

    @cached_property
    def _expected(self) -> Bools:
        """Which sources (sources,) move values and departures to where a fit expects them: along the lines that it was conditioned on.

        Its readings say nothing of another way there. None where anything switches.
        """
        return np.array([s.name.startswith(EXPECTED_OF) and not self.switches for s in self.budget.sources], dtype=bool)

    @property
    def _straight(self) -> Array:
        """Derivative of each free name by each source (free, sources), of what members are straight in: departures, what is expected."""
        return np.where(self._expected, self._chain(), self._chain(forms=("heat",)))

    def _added_after_run(self, node: str) -> Array:
        """Return the change of a node's temperature after the run per unit of each source (sources,). [K]"""
        rows = [row for t, row in zip(self.budget.targets, self.budget.gain, strict=True) if t.form == "node" and t.name == node]
        return np.sum(rows, axis=0) if rows else np.zeros(len(self.budget.sources))

    def values(self, sources: Array) -> dict[str, Array]:
        """Return free name -> value of every member (members,), at values (sources, members) of the sources. [SI]

        No value passes what physics allows, see `deviated`. A stated law keeps to that by itself.
        """
        moved = combined(self.budget.gain, sources)
        stated = np.array([isinstance(s.law, Shifted) for s in self.budget.sources], dtype=bool)
        out: dict[str, Array] = {}
        # what is added first, then the logarithm, then factors: a conductance without its gas stays above zero
        for form in VALUE_FORMS:
            for t, row, gain in zip(self.budget.targets, moved, self.budget.gain, strict=True):
                for name in self.carriers.get(t, ()) if t.form == form else ():
                    base = out.get(name, np.full(row.shape, self._deviation_base(name)))
                    if form == "log":
                        out[name] = deviated(base, base * np.expm1(row), (-np.inf, self.ready.domain(name)[1]))
                    elif form == "add" and not stated[gain != 0.0].all():
                        out[name] = deviated(base, row, self.ready.domain(name))
                    else:
                        out[name] = base * (1.0 + row) if form == "factor" else base + row
        return out

    def member_values(self, sources: Array) -> dict[str, Array]:
        """Return name -> what every member has of it (members,): values, shifts of temperatures, and sources that are no values. [SI]"""
        out = {}
        boundaries = self.ready.wiring.network.boundaries
        for name, values in self.values(sources).items():
            shift = name.startswith("initial.") or name in boundaries
            out[name] = values - self.ready.nominal[name] if shift else values
        named = dict(zip(self.budget.sources, sources, strict=True))
        out |= {s.name: row for s, row in named.items() if s.kind in ("misfit", "variant")}
        # of a departure how much heat it moves at the mean operating point
        alone = self._departures(sources)
        of = {t: t.name.rpartition(" of ")[2] if " of " in t.name else t.name for t in alone}
        return out | {
            e: np.sum([self.sizes[t] * row for t, row in alone.items() if of[t] == e], axis=0) for e in dict.fromkeys(of.values())
        }

    def _bent(self, sources: Array) -> dict[str, Array]:
        """Return free name -> value of every member (members,), before what is expected moves its run along a straight line. [SI]"""
        return self.values(np.where(self._expected[:, None], 0.0, sources))

    def _values_in_runs(self, sources: Array) -> dict[str, Array]:
        """Return free name -> value of every member (members,), departures among them as sizes of the loads of `full`. [SI]"""
        return self.values(sources) | {n: self.sizes[t] * x for t, x in self._departures(sources).items() for n in self.carriers[t]}

    def _departures(self, sources: Array) -> dict[Target, Array]:
        """Return target of a departure -> how many of its units every member has (members,), of those that act here. [-]"""
        moved = combined(self.budget.gain, sources)
        return {t: row for t, row in zip(self.budget.targets, moved, strict=True) if t.form == "heat" and t in self.sizes}

    def temperatures(
        self, sources: Array, nodes: Sequence[str], threads: int = 1, extremes: bool = True, executor: Workers = None
    ) -> Drawn:
        """Return the temperatures of nodes at values (sources, members) of the sources, and the runs behind them.

        Without `extremes` members are not followed between the stored times, which costs less. Departures are added to the run by its
        derivatives; where anything switches, their heat is put into the run of every member, so that it moves switching times alone.
        """
        ready = self.full if self.switches else self.ready
        ready = ready if extremes else replace(ready, options=replace(ready.options, extremes=False))
        values, members = self._values_in_runs(sources) if self.switches else self._bent(sources), sources.shape[1]
        many: Ensemble | None = None
        temperatures: dict[str, Array] = {}
        turnings: dict[str, MemberTurnings] = {}
        if values:
            many = ready.ensemble(ready.with_units(values), nodes=list(nodes), threads=threads, executor=executor)
            lost = len(many.failed) == members
            for n in nodes:
                temperatures[n] = np.full((self.ready.times.size, members), np.nan) if lost else many.temperatures(n)
                turnings_of_node = None if lost else many.turnings(n)
                if turnings_of_node is not None:
                    turnings[n] = turnings_of_node
        else:
            run = ready.run()
            for n in nodes:
                trace = run[n]
                temperatures[n] = np.repeat(trace.kelvin[:, None], members, axis=1)
                if trace.turnings is not None:
                    turnings[n] = MemberTurnings.alike(trace.turnings, np.zeros(members))
        after = {n: combined(self._added_after_run(n)[None, :], sources) for n in nodes}
        if (self.sizes or self._expected.any()) and not self.switches:
            after |= {n: combined(self._run.slopes(n) @ self._straight, sources) + after[n] for n in nodes}
        kelvin = {n: traces + after[n] for n, traces in temperatures.items()}
        return Drawn(kelvin, {n: t.shifted(ready.times, after[n]) for n, t in turnings.items()}, many)

    def rest(self, sources: Array, nodes: Sequence[str], executor: Workers) -> dict[str, Array]:
        """Return where nodes settle (members,) at values (sources, members) of the sources, with the inputs of the end held. [K]

        `executor` says who settles them.

        Raises
        ------
        SolverError   When a member settles nowhere.
        """
        values, moved = self._bent(sources), self._straight @ sources
        moves = self.full.settled(self._derivative_point)[1] if self.sizes or self._expected.any() else {}
        members = [self.ready.with_units({n: v[k] for n, v in values.items()}) for k in range(sources.shape[1])]
        settle = partial(self.ready.settled, sensitivities=False)
        begun, settled = process_time(), [settle(members[0])[0]]
        tasks = [(f"member {k}", (member,)) for k, member in enumerate(members[1:], 1)]
        ahead = (process_time() - begun) * len(tasks)
        others = in_tasks(settle, tasks, executor, ahead) if executor is not None else enumerate(map(settle, members[1:]))
        settled += [rest for _, (rest, _) in sorted(others, key=itemgetter(0))]
        after = {n: combined(self._added_after_run(n)[None, :], sources)[0] + (moves[n] @ moved if n in moves else 0.0) for n in nodes}
        return {n: np.array([member[n] for member in settled]) + after[n] for n in nodes}


def assumed_effects(
    model: Model, scenario: Scenario, elsewhere: Collection[str], nodes: Sequence[str], times: Any
) -> list[tuple[Assumed, float, dict[str, float]]]:
    """Return assumed values without a stated range, each with its relative standard deviation and node -> largest effect of that [K].

    By derivatives over the run; where anything switches that of the highest and of the lowest temperature, since at an instant runs differ
    by their switching times.

    Parameters
    ----------
    elsewhere : set         Values that count otherwise, such as fitted ones.
    times : array (times,)  When temperatures are compared, as in `simulate`. [s]
    """
    ranged = {p for r in open_ranges(model, scenario, elsewhere) for p in (r.path, *r.also)}
    loose = assumed_values(model, scenario, {*elsewhere, *ranged})
    if not loose:
        return []
    names = tuple(a.path for a in loose)
    sources = tuple(Source(path, "stated", Normal(), f"{path} as assumed") for path in names)
    rows = Rows(names, (False,) * len(names), {}, sources, ("as assumed",) * len(names), np.diag([a.size for a in loose]))
    budget = Budget.of_rows(rows, model, scenario)
    setting = Setting.of_budget(budget, prepared(budget, times=times))
    linear = setting.linear(nodes)
    effects = {n: np.abs(column[:-1]).max(axis=0) for n, column in linear.columns.items()}
    if setting.switches:
        members = setting.temperatures(np.eye(len(loose)), nodes, extremes=False).kelvin
        effects = {
            n: np.max([np.abs(end(traces, axis=0) - end(linear.run[n].kelvin)) for end in (np.max, np.min)], axis=0)
            for n, traces in members.items()
        }
    return [(a, a.size / abs(setting.ready.nominal[a.path]), {n: float(e[k]) for n, e in effects.items()}) for k, a in enumerate(loose)]
