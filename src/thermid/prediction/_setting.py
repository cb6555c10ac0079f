"""`Setting`: a budget made ready for runs of one scenario - by derivatives, or member by member - with its coefficient modes beside it.

A coefficient that differs by a part c of a mode from a constant is to first order the same as a pair of loads (see `coefficients`).
What the fit would have found for that part differs too: the gain of the budget holds both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from thermid.base.errors import SolverError
from thermid.base.linear_algebra import Array, Bools
from thermid.fit.discrepancy import (
    EXPECTED,
    CoefficientMode,
    ExpectedHeat,
    FlowHistory,
    OperatingPoint,
    conditions_of,
    constant_coefficients,
    courses,
    ending_settled,
    expected_heats,
    patterns_of,
    unsaid_paths,
    with_patterns,
)
from thermid.prediction._budget import Budget, Target, combined, listed
from thermid.simulation.runs import Ensemble, Simulator, Solution, prepare
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import Engine, MemberTurnings, Options, Wiring
from thermid.values.store import Shifted, deviated

GUESSED = 0.25
"""Shift, or half-width, by what nobody has stated, from which it is spoken of. [K]"""
TAKEN_BACK = 0.3
"""Part of the effect of an assumed value alone that is left with the fit solved again, below which the fit has taken it back. [-]"""
VALUES = ("add", "log", "factor")
"""Forms of targets that are values."""
PASSES = 3
"""Runs in which the patterns of coefficients are found: the first at constant coefficients, each further one where the last expects it."""


@dataclass(frozen=True, eq=False)
class Linear:
    """Temperatures of one run with best values, and what a unit of every source does.

    Parameters
    ----------
    run : Solution
    settled : dict          Node -> temperature with the inputs of the end kept for good [K]; empty where nothing settles.
    columns : dict          Node -> (times and the settled state, sources). [K]
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


@dataclass(frozen=True, eq=False)
class Setting:
    """A budget made ready.

    Parameters
    ----------
    budget : Budget
    ready : Simulator       With everything free that a target acts on; coefficient modes are pairs of loads of zero size.
    carriers : dict         Target -> free names that carry it; none for nodes, and for modes that do not act here.
    here : dict             Conductor -> its conditions in this scenario.
    plain : dict            Conductor -> its course in the run with best values, without modes.
    """

    budget: Budget
    ready: Simulator
    carriers: Mapping[Target, tuple[str, ...]]
    here: Mapping[str, OperatingPoint] = field(default_factory=dict)
    plain: Mapping[str, FlowHistory] = field(default_factory=dict)

    @classmethod
    def of(
        cls, budget: Budget, *, scenario: Scenario | None = None, every: str | float | None = None, times: Any = None, options: Any = None
    ) -> Setting:
        """Return a budget made ready for its scenario, or for a variant of it."""
        asked = budget.scenario if scenario is None else scenario
        chosen: Options | None = options

        def plain(of: Budget) -> Setting:
            ready = prepare(of.model, asked, of.names, every=every, times=times, options=chosen)
            own = {t: tuple(dict.fromkeys(map(ready.canonical, (t.name, *t.also)))) for t in of.targets if t.form in VALUES}
            return cls(of, ready, own)

        if not budget.modes:
            return plain(budget)
        base = made = plain(budget.whole or budget)
        for _ in range(PASSES):
            patterns, heats, found = made._patterns()
            # conditions and plain course are of the run with best values, as the conditions of a fit are
            here, first = (made.here, made.plain) if made.here else (conditions_of([found]), found)
            made = replace(base._with_patterns(patterns, heats, here), plain=first)
        if budget.whole is None:
            return made
        left = {(m.path, m.kind) for m in budget.modes}
        kept = [p for p in patterns if (p.path, p.kind) in left]
        return plain(budget)._with_patterns(kept, [h for h in heats if (h.path, EXPECTED) in left], here)

    def _with_patterns(
        self, patterns: Sequence[CoefficientMode], heats: Sequence[ExpectedHeat], here: Mapping[str, OperatingPoint]
    ) -> Setting:
        """Return it with the patterns of coefficient modes in a scenario, and the conditions of the coefficients there."""
        wiring = self.ready.wiring
        network, wide = with_patterns(wiring.network, wiring.scenario, [*patterns, *heats])
        every: list[CoefficientMode | ExpectedHeat] = [*patterns, *heats]
        acting = {(p.path, p.kind): tuple(f"scale.{n}" for n in p.names(network.boundaries)) for p in every}
        named = {m.name: acting.get((m.path, m.kind), ()) for m in self.budget.modes}
        carriers = {**self.carriers} | {t: named[t.name] for t in self.budget.targets if t.form == "mode"}
        made = Wiring(network, wide, (*self.ready.free, *(n for names in acting.values() for n in names)))
        return replace(self, ready=replace(self.ready, _wiring=made, _engine=Engine(made)), carriers=carriers, here=here)

    def _patterns(self) -> tuple[tuple[CoefficientMode, ...], tuple[ExpectedHeat, ...], dict[str, FlowHistory]]:
        """Return the patterns of the modes in the scenario, the heats that are expected, and the courses of the coefficients there.

        The run is that of the best values; once there are patterns, that of their means: temperatures that differ by what is expected.
        """
        ready, budget = self.ready, self.budget
        wiring = ready.wiring
        modes = {m.name for m in budget.modes}
        means = np.array([s.law.mean if s.name in modes else 0.0 for s in budget.sources])
        expected = {n: float(v[0]) for n, v in self.values(means[:, None]).items()} if self.here else {}
        times, found = courses(wiring, ready.engine, ready.vector(ready.with_units(expected)) if ready.free else None, ready.options)
        try:
            rest, _ = ready.settled(ready.with_units(expected))
            acting = {p: c.ends for p, c in constant_coefficients(wiring.network).items() if p in found}
            found = {p: ending_settled(found[p], rest[a], rest[b]) for p, (a, b) in acting.items()}
        except SolverError:
            pass  # nothing settles, so nobody asks for it
        values = wiring.network.numbers().values
        every = patterns_of(wiring.network, times, found, budget.conditions, values)
        wanted = {(m.path, m.kind) for m in budget.modes}
        kept = tuple(p for p in every if (p.path, p.kind) in wanted)
        heats = expected_heats(wiring.network, times, found, budget.conditions, values, self.plain or found, kept)
        return kept, tuple(h for h in heats if (h.path, EXPECTED) in wanted), found

    @property
    def still(self) -> dict[str, float]:
        """Free name -> zero, of the loads that stand for modes."""
        return {n: 0.0 for t, names in self.carriers.items() if t.form == "mode" for n in names}

    def linear(self, nodes: Sequence[str] | None = None) -> Linear:
        """Return one run with its derivatives carried to the sources; of all nodes where none are named."""
        run = self.ready.run(self.still, sensitivities=True)
        kept = list(dict.fromkeys(run[n].path for n in (nodes if nodes is not None else run.nodes)))
        try:
            settled, moves = self.ready.settled(self.still)
        except SolverError:
            settled, moves = {}, {}
        chain = self._chain()
        columns = {}
        for n in kept:
            size = (self.ready.times.size, len(self.ready.free))
            slopes = run.slopes(n) if self.ready.free else np.zeros(size)
            rest = moves.get(n, np.full(size[1], np.nan)) if size[1] else np.zeros(0)
            columns[n] = np.vstack([slopes, rest[None, :]]) @ chain + self._after(n)[None, :]
        return Linear(run, settled, columns)

    def guessed(self, linear: Linear) -> list[str]:
        """Return what nobody has stated of constant coefficients and matters, and which statement would narrow the bands."""
        unsaid = set(unsaid_paths(self.ready.wiring.network))
        found = (self._unsaid(linear, unsaid), self._unlit(linear, unsaid))
        return [words for words in found if words]

    def _unsaid(self, linear: Linear, unsaid: set[str]) -> str:
        """Return words on coefficients of which no deck states what carries the heat; empty where nothing hangs on it."""
        budget = self.budget
        modes = {m.name: m.path for m in budget.modes if m.path in unsaid}
        own = np.array([s.name in modes for s in budget.sources], dtype=bool)
        shift, worst = _most(linear, own * budget.means)
        if not own.any() or not worst:
            return ""
        at = linear.columns[worst][-2:-1]
        wide = 1.96 * float(np.sqrt(sum(v[0] for v in budget.parts(at).values())))
        narrow = 1.96 * float(np.sqrt(sum(v[0] for v in budget.parts(np.where(own, 0.0, at)).values())))
        if max(abs(shift), wide - narrow) < GUESSED:
            return ""
        return (
            f"no deck states what carries the heat of {listed(sorted(set(modes.values())))}: free air, or a fan, a cold plate or leads, "
            f"behind which a coefficient stays constant. Both are taken as equally likely, which shifts '{worst}' by {shift:+.2g} K, "
            f"others by less. State carried_by: with 'fan', 'cold plate' or 'leads' the band of '{worst}', +- {wide:.2g} K, becomes "
            f"+- {narrow:.2g} K about the run of the model; with 'free air' the shift doubles, and the band narrows too"
        )

    def _unlit(self, linear: Linear, unsaid: set[str]) -> str:
        """Return words on radiation that nobody has stated where the heat goes into free air; empty where nothing hangs on it."""
        bare = {p for p, c in constant_coefficients(self.ready.wiring.network).items() if not c.emissivity and p not in unsaid}
        modes = {m.name: m.path for m in self.budget.modes if m.kind == "level" and m.path in bare}
        shift, worst = _most(linear, np.array([s.law.mean if s.name in modes else 0.0 for s in self.budget.sources]))
        if abs(shift) < GUESSED:
            return ""
        return (
            f"'{worst}' is shifted by {shift:+.2g} K, others by less, because no emissivity is stated: any value from 0 to 0.95 "
            f"is taken as equally likely. For bare metal this shift is too large. Give the finish or the emissivity of "
            f"{listed(sorted(set(modes.values())))}."
        )

    def cancelled(self, linear: Linear) -> Bools:
        """Return which sources (sources,) are values whose effect the values of a fit take back, solved again for each, in this scenario.

        Both effects are large and of opposite sign, and fitted values are known to follow along a straight line only: what members differ
        from the straight model by is then the error of that line. Such a source leaves less than `TAKEN_BACK` of its effect alone.
        """
        budget = self.budget
        own = np.array([[s.name in (t.name, *t.also) for s in budget.sources] for t in budget.targets], dtype=bool)
        own = own.reshape(len(budget.targets), len(budget.sources))
        many: Bools = own.any(axis=0) & (np.where(own, 0.0, budget.gain) != 0.0).any(axis=0)
        if not many.any() or not self.ready.free:
            return many
        chain = self._chain(np.where(own, budget.gain, 0.0))
        alone, left = np.zeros(many.size), np.zeros(many.size)
        for n, columns in linear.columns.items():
            alone += np.sum((linear.run.slopes(n) @ chain) ** 2, axis=0)
            left += np.sum(columns[:-1] ** 2, axis=0)
        many &= left < TAKEN_BACK**2 * alone
        return many

    def _chain(self, gain: Array | None = None) -> Array:
        """Return what a unit of each source does to the free names (free, sources)."""
        place = {name: k for k, name in enumerate(self.ready.free)}
        out = np.zeros((len(place), len(self.budget.sources)))
        for t, row in zip(self.budget.targets, self.budget.gain if gain is None else gain, strict=True):
            for name in self.carriers.get(t, ()):
                factor = self.ready.nominal[name] if t.form in ("log", "factor") else 1.0
                out[place[name]] += factor * row
        return out

    def _after(self, node: str) -> Array:
        """Return what a unit of each source adds to a node after the run (sources,). [K]"""
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
        for form in ("add", "log", "factor", "mode"):
            for t, row, gain in zip(self.budget.targets, moved, self.budget.gain, strict=True):
                for name in self.carriers.get(t, ()) if t.form == form else ():
                    base = out.get(name, np.full(row.shape, 0.0 if form == "mode" else self.ready.nominal[name]))
                    if form == "log":
                        out[name] = deviated(base, base * np.expm1(row), (-np.inf, self.ready.domain(name)[1]))
                    elif form == "add" and not stated[gain != 0.0].all():
                        out[name] = deviated(base, row, self.ready.domain(name))
                    else:
                        out[name] = base * (1.0 + row) if form == "factor" else base + row
        return out

    def told(self, sources: Array) -> dict[str, Array]:
        """Return name -> what every member has of it (members,): values, shifts of temperatures, and sources that are no values. [SI]"""
        out = {}
        boundaries = self.ready.wiring.network.boundaries
        still = self.still
        for name, values in self.values(sources).items():
            if name not in still:
                shift = name.startswith("initial.") or name in boundaries
                out[name] = values - self.ready.nominal[name] if shift else values
        own = {s.name: row for s, row in zip(self.budget.sources, sources, strict=True) if s.kind in ("misfit", "variant")}
        sure = {m.name for m in self.budget.modes if m.kind == EXPECTED}
        acting = {t.name for t, names in self.carriers.items() if t.form == "mode" and names} - sure
        return out | own | {s.name: row for s, row in zip(self.budget.sources, sources, strict=True) if s.name in acting}

    def temperatures(self, sources: Array, nodes: Sequence[str], threads: int = 1, extremes: bool = True) -> Drawn:
        """Return the temperatures of nodes at values (sources, members) of the sources, and the runs behind them.

        Without `extremes` members are not followed between the stored times, which costs less.
        """
        ready = self.ready if extremes else replace(self.ready, options=replace(self.ready.options, extremes=False))
        values, members = self.values(sources), sources.shape[1]
        many: Ensemble | None = None
        found: dict[str, Array] = {}
        turnings: dict[str, MemberTurnings] = {}
        if values:
            many = ready.ensemble(ready.with_units(values), nodes=list(nodes), threads=threads)
            lost = len(many.failed) == members
            for n in nodes:
                found[n] = np.full((self.ready.times.size, members), np.nan) if lost else many.temperatures(n)
                own = None if lost else many.turnings(n)
                if own is not None:
                    turnings[n] = own
        else:
            run = ready.run()
            for n in nodes:
                trace = run[n]
                found[n] = np.repeat(trace.kelvin[:, None], members, axis=1)
                if trace.turnings is not None:
                    turnings[n] = MemberTurnings.alike(trace.turnings, np.zeros(members))
        after = {n: combined(self._after(n)[None, :], sources) for n in nodes}
        return Drawn({n: traces + after[n] for n, traces in found.items()}, {n: t.shifted(after[n][0]) for n, t in turnings.items()}, many)


def _most(linear: Linear, means: Array) -> tuple[float, str]:
    """Return the largest shift at the end by means (sources,) of some sources [K], and its node."""
    shifts = {n: float((c @ means)[-2]) for n, c in linear.columns.items()}
    worst = max(shifts, key=lambda n: abs(shifts[n]), default="")
    return shifts.get(worst, 0.0), worst
