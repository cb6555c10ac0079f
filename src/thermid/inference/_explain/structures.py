"""Search for a structure: of changes of a network those that promise most are refitted, and kept where the readings are likelier.

In: a `Request` with the structure to begin from. Out: a `StructureSearch`: every structure that was fitted, with how likely readings are
with it, the one that is proposed, those that the readings cannot separate from it, and the test that would.

What one evaluation with derivatives promises of a change says whether it is refitted, and no more. Refits have the one score of all causes
(`weighing`): the likelihood of the readings, all values integrated over the priors of the table.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from operator import itemgetter
from types import SimpleNamespace
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, ThermidError
from thermid.base.linear_algebra import one_thread
from thermid.base.units import Array, duration_text, from_si, short, unit, value_of
from thermid.fit.calibration import (
    MOST_EVALUATIONS,
    Binned,
    Fit,
    Prior,
    Problem,
    Request,
    Unknown,
    build_problem,
    minimise,
    starting_point,
    white_rows,
)
from thermid.inference._explain.candidates import Fitted, MissingElement
from thermid.inference._explain.thresholds import (
    ABOUT_START,
    ANY_VALUE,
    CHALLENGES,
    CHOSEN,
    EVALUATIONS,
    EVALUATIONS_OF_A_REFIT,
    FREE_STEP,
    IDLE_SHARE,
    MAX_LAID_TOGETHER,
    MAX_SEPARATING_READINGS,
    PROMISED_STEP,
    REFITS_OF_A_ROUND,
    SEARCH_DONE_STEP,
    TIE,
    WIDE_ERRORS,
    SizedValue,
)
from thermid.inference._explain.weighing import CauseScore, noise_of, seen_in_stretches, weighed_at, weighed_in_noise
from thermid.model.tree import Constant, Parameter, TableSignal
from thermid.simulation.runs import Scenario, Workers, in_tasks, simulate


@dataclass(frozen=True, eq=False)
class FittedStructure:
    """One structure that was fitted.

    Parameters
    ----------
    changes : tuple of MissingElement   What was changed, in order; empty for the structure at the beginning.
    request : Request
    problem : Problem
    end : Fit                           Where its fit ended.
    weighing : CauseScore                 How likely the readings are with it.
    nodes : int                         Masses of the model, sensors that lag among them.
    noise : int                         Column of the score in which its values are the likeliest; None where that is white noise.
    """

    changes: tuple[MissingElement, ...]
    request: Request
    problem: Problem
    end: Fit
    weighing: CauseScore
    nodes: int
    noise: int | None = None

    @property
    def name(self) -> str:
        """The changes in words."""
        return ", and ".join(c.name for c in self.changes) or "as it is"

    @property
    def masses(self) -> int:
        """Masses of the unit: thermometers of one kind, all of which lag, are none of it."""
        return self.nodes - sum(c.tips for c in self.changes)

    @property
    def fitted(self) -> Mapping[str, float]:
        """Unknown -> value in the fitted form."""
        return {u.name: float(x) for u, x in zip(self.problem.unknowns, self.end.fitted, strict=True)}

    @property
    def values(self) -> dict[str, float]:
        """Path -> value of every fitted parameter. [SI]"""
        pairs = zip(self.problem.unknowns, self.end.fitted, strict=True)
        return {u.name: u.to_value(float(x)) for u, x in pairs if u.kind == "parameter"}

    def judged(self) -> list[tuple[str, bool]]:
        """Return what each change found, in words, and whether that is physically possible."""
        errors = [*self.errors().values()] if self.noise is None else self.weighing.errors[self.noise]
        several = zip(self.problem.unknowns, self.end.fitted, errors, strict=True)
        values = {u.name: SimpleNamespace(value=u.to_value(float(x)), error=float(u.slope(float(x)) * error)) for u, x, error in several}
        return [c.judge(values) for c in self.changes]

    @property
    def impossible(self) -> str:
        """What changes found that hardware does not have, in words; empty where every value is possible."""
        return "; ".join(f"{c.name}: {words}" for c, (words, possible) in zip(self.changes, self.judged(), strict=True) if not possible)

    @property
    def possible(self) -> bool:
        """Whether every change has a value that hardware has."""
        return not self.impossible

    def errors(self, free: Sequence[str] | None = None) -> dict[str, float]:
        """Return name -> standard error of every unknown in its fitted form, the logarithm where it has one.

        The root of the diagonal of the pseudo-inverse of J'J, J the weighted residuals' derivatives with the rows of the priors. With
        `free`, all other parameters are fixed; starts, offsets and other unknowns stay free.
        """
        columns = [k for k, u in enumerate(self.problem.unknowns) if u.kind != "parameter" or free is None or u.name in free]
        rows = np.concatenate([self.end.jacobian, self.end.priors])[:, columns]
        scale = np.linalg.norm(rows, axis=0)
        scale[scale == 0.0] = 1.0
        inverse = np.linalg.pinv((rows / scale).T @ (rows / scale), hermitian=True)
        sizes = np.sqrt(np.maximum(np.diag(inverse), 0.0)) / scale
        unknowns = [self.problem.unknowns[k] for k in columns]
        return {u.name: float(s) for u, s in zip(unknowns, sizes, strict=True)}

    @property
    def rmse(self) -> float:
        """RMS of all residuals. [K]"""
        squares = [s.count * s.mean_square for _, _, s in self.end.sums]
        return float(np.sqrt(sum(squares) / max(sum(s.count for _, _, s in self.end.sums), 1.0)))

    def in_noise(self, noise: int) -> FittedStructure:
        """Return the structure at the values that are likeliest in one noise, a column of the score; see `weighed_in_noise`."""
        try:
            return fitted_structure(self.changes, self.request, self.fitted, noise=noise)
        except (ThermidError, np.linalg.LinAlgError):
            return self

    def promises(self, changes: Iterable[MissingElement], refused: list[tuple[str, str]], noise: int | None = None) -> list[PromisedChange]:
        """Return what one evaluation promises of each change from its best start, the most first; `refused` takes what cannot be run.

        It says which changes are worth a refit, and no more: where a step leads too far, nothing of it may come true. With `noise`, a
        column of the score, what is promised in that noise counts as well as in white noise, each beside the most of all.
        """
        at, every_change = np.asarray(self.end.fitted), list(changes)
        like = [] if noise is None else seen_in_stretches(self.problem, at, "linear", 1.0)
        systems, unchanged = _systems(self.problem, at, noise, like), np.zeros(at.size, dtype=bool)
        before = [_stepped(self.problem.unknowns, at, rows, matrix, unchanged)[0] for rows, matrix in systems]
        reduced = max(self.end.chi_square / max(self.problem.freedom, 1.0), 1e-12)
        out = [p for run in _laid_together(self, every_change) for p in self._promised(*run, IDLE_SHARE, noise, like)]
        done = [p.change for p in out]
        for change in (c for c in every_change if c not in done):
            why, several = "", list[PromisedChange]()
            for start in change.starts or ({},):
                try:
                    problem = build_problem(change.request)
                    small = {u.name for u in problem.unknowns if u.name not in self.fitted} if change.additive else ()
                    run = problem, starting_values(problem, self.fitted, start), [(change, small, start)], ()
                    several += self._promised(*run, 1.0, noise, like, before)
                except ThermidError as error:
                    why = error.message
            refused += [] if several else [(change.name, why)]
            out += several
        most = [max(max(gains), 1e-12) for gains in zip(*(p.gains for p in out), strict=True)]
        ranked = sorted(out, key=lambda p: -max(gain / top for gain, top in zip(p.gains, most, strict=True)))
        best = {id(p.change): p for p in reversed(ranked)}  # of several starts the best
        return [replace(p, gains=tuple(gain / reduced for gain in p.gains)) for p in ranked if best[id(p.change)] is p]

    def _promised(
        self,
        problem: Problem,
        at: Array,
        together: Sequence[tuple[MissingElement, Collection[str], Mapping[str, float]]],
        added: Collection[str],
        share: float,
        noise: int | None,
        like: Sequence[Binned],
        before: Sequence[float] = (),
    ) -> Iterator[PromisedChange]:
        """Yield what changes that lie over one problem promise, each alone; see `promises`.

        Parameters
        ----------
        at : array (unknowns,)  Where it is looked at.
        together : sequence     Changes, the unknowns that are small values of each, at a `share` of their starts, and its start. [SI]
        added : collection      Unknowns of all changes that lie over it together.
        before : sequence       Cost without a change, in each noise; what is left without those of `added` by default.
        """
        systems = _systems(problem, at, noise, like)

        def stepped(small: Collection[str]) -> list[tuple[float, dict[str, float]]]:
            """Return the cost after one step in each noise with the `small` unknowns of those that were added, and what they become."""
            taken = [j for j, u in enumerate(problem.unknowns) if u.name in small or u.name not in added]
            unknowns, new = [problem.unknowns[j] for j in taken], np.array([problem.unknowns[j].name in small for j in taken], dtype=bool)
            return [_stepped(unknowns, at[taken], rows, matrix[:, taken], new, share) for rows, matrix in systems]

        before = before or [cost for cost, _ in stepped(())]
        for change, small, start in together:
            after = stepped(small)
            gains = tuple(b - cost for b, (cost, _) in zip(before, after, strict=True))
            yield PromisedChange(change, {**start, **after[-1][1]}, gains)

    @property
    def full_request(self) -> Request:
        """Return the request of a structure with its model at the fitted values, for a full fit.

        A value that its readings hardly determine gets its bounds as a prior. The errors of a changed structure count what it may lack
        (`Request.structural_errors`): readings that asked for one change seldom rule out all others.
        """
        units = {u.name: u.unit for u in self.problem.unknowns}
        texts = {n: Parameter.exact(v, units[n]) for n, v in self.values.items()}
        model = self.request.model.with_values(texts, "structure search")
        wide: dict[str, tuple[str, str]] = {}  # means and standard deviations whose 95 % are the bounds
        for u in _undetermined(self) if self.changes else ():
            low, high = u.fitted_bounds()
            mean, sd = from_si(u.to_value(0.5 * (low + high)), u.unit), 0.25 * (high - low)
            sd_text = f"{100.0 * sd:.3g} [%]" if u.log else f"{sd / float(unit(u.unit).factor):.4g} [{u.unit}]"
            wide[u.name] = f"{mean:.4g} [{u.unit}]", sd_text
        judgements = tuple(
            f"in the proposed structure the readings hardly determine '{n}'. Its bounds stand as a prior: {mean} +- {sd}."
            for n, (mean, sd) in wide.items()
        )
        how = "local" if self.changes and self.request.search == "auto" else self.request.search  # it begins at the end of a descent
        return replace(
            self.request,
            model=model,
            priors={**self.request.priors, **wide},
            remarks=(*self.request.remarks, *judgements),
            search=how,
            structural_errors=bool(self.changes),
        )


@dataclass(frozen=True, eq=False)
class PromisedChange:
    """What one evaluation promises of a change.

    Parameters
    ----------
    change : MissingElement
    start : dict        Path -> value that the refit begins from. [SI]
    gains : tuple       Promised fall of the cost, in log-likelihood at the noise of the fit before: in white noise, and in another. [-]
    """

    change: MissingElement
    start: Mapping[str, float]
    gains: tuple[float, ...]

    @property
    def gain(self) -> float:
        """That in white noise. [-]"""
        return self.gains[0]


@dataclass(frozen=True, eq=False)
class StructureSearch:
    """What a search of structures found.

    Parameters
    ----------
    structures : tuple of FittedStructure     All that were fitted, in order; the first is the one at the beginning.
    proposed : FittedStructure                The simplest of those that the readings support equally well.
    refused : tuple of (str, str)       Changes that could not be fitted, and why.
    scored : int                        Changes that were scored.
    evaluations : int                   What it took: runs of every record with derivatives.
    complete : bool                     Whether it ended by itself, and not by its budget.
    """

    structures: tuple[FittedStructure, ...]
    proposed: FittedStructure
    refused: tuple[tuple[str, str], ...]
    scored: int
    evaluations: int
    complete: bool

    @property
    def start(self) -> FittedStructure:
        """The structure at the beginning."""
        return self.structures[0]

    def likelihood(self, one: FittedStructure) -> float:
        """Logarithm of the Bayes factor over the structure at the beginning. [-]"""
        return float((one.weighing.logs - self.start.weighing.logs)[_noise_of(self.structures)])

    @property
    def alike(self) -> tuple[FittedStructure, ...]:
        """Structures that the readings cannot separate from the proposed one: Bayes factors within `TIE` of it, or above."""
        least = self.likelihood(self.proposed) - TIE
        return tuple(s for s in self.structures if s is not self.proposed and s.possible and self.likelihood(s) >= least)

    @property
    def ties(self) -> tuple[FittedStructure, ...]:
        """The likeliest of each number of masses among those that are alike."""
        best: dict[int, FittedStructure] = {}
        for one in self.alike:
            if one.masses not in best or self.likelihood(one) > self.likelihood(best[one.masses]):
                best[one.masses] = one
        return tuple(best.values())

    @property
    def orders(self) -> tuple[int, ...]:
        """Numbers of masses that the readings support: that of the proposed structure first, then those that they cannot separate."""
        return tuple(dict.fromkeys([self.proposed.masses, *(t.masses for t in self.ties)]))

    def __str__(self) -> str:
        """Return the answer, what was tried, and what cannot be told, as text."""
        gain = self.likelihood(self.proposed)
        if self.proposed is self.start:
            lines = ["No change of the structure is supported by the readings."]
        else:
            lines = [f"Proposed: {self.proposed.name} (logarithm of the Bayes factor {gain:+.3g})."]
            lines.append(f"  RMSE {short(self.start.rmse, 3)} -> {short(self.proposed.rmse, 3)} K")
            for (text, possible), change in zip(self.proposed.judged(), self.proposed.changes, strict=True):
                lines.append(f"  {change.name}: {text}{'' if possible else ', which is not physically possible'}")
        for one in self.ties:
            if one.masses != self.proposed.masses:
                apart = self.likelihood(one) - gain
                lines.append(f"  Not separable from it: {one.name} ({one.masses} masses; logarithm of the Bayes factor {apart:+.2g}).")
                lines.append(f"    {telling_test(self.proposed, one)}")
        tried = {s.name: s for s in sorted(self.structures[1:], key=self.likelihood)}  # of one name the likeliest stands
        best = sorted(tried.values(), key=lambda s: -self.likelihood(s))
        reasons = [f", not physically possible: {s.impossible}" if s.impossible else "" for s in best[:8]]
        shown = [f"    {s.name}: {self.likelihood(s):+.3g}{why}" for s, why in zip(best, reasons, strict=False)]
        lines += ["  refitted, logarithm of the Bayes factor over the first structure:", *shown] if shown else []
        lines.append(f"  {self.scored} changes scored, {len(self.structures) - 1} refitted in {self.evaluations} evaluations")
        if not self.complete:
            lines.append("  The budget of evaluations ended the search, so more changes may be supported. Allow more: --evaluations.")
        return "\n".join(lines)


def search_structure(
    request: Request,
    *,
    changes: Callable[[Fitted], Sequence[MissingElement]] | None = None,
    rounds: int = 6,
    evaluations: int | EvaluationBudget = EVALUATIONS,
    begin: Mapping[str, float] | None = None,
    executor: Workers = None,
) -> StructureSearch:
    """Search for changes of structure that readings support.

    Parameters
    ----------
    request : Request       The fit with the structure to begin from.
    changes : callable      Changes of a fitted structure; those of the catalogue by default.
    rounds : int            Most changes, one after the other.
    evaluations : int       Budget after which no refit begins, and one that runs is given up; one that was begun goes on.
    begin : dict            Unknown -> value in the fitted form to begin from; the request's own starts by default.
    executor : see `Workers`    Who makes the refits of a round: the same structures from all.

    Raises
    ------
    IdentificationError, SolverError    When the structure at the beginning cannot be fitted.
    """
    with one_thread():
        catalogue = changes or (lambda structure: list(structure.changes()))
        budget = evaluations if isinstance(evaluations, EvaluationBudget) else EvaluationBudget(evaluations)
        return _Searching(request, catalogue, budget, executor).run(rounds, begin or {})


Try = tuple[tuple[MissingElement, ...], Request, Mapping[str, float]]
"""Changes, the request with them, and where new unknowns begin. [SI]"""


class EvaluationBudget:
    """Evaluations that a search may still take, and the least that one took. [s]

    Parameters
    ----------
    allowed : float         Runs of every record with derivatives.
    progress : callable     Called with how far it is, in words, and the share of the budget that is spent.
    """

    def __init__(self, allowed: float = math.inf, progress: Callable[[str, float], None] | None = None) -> None:
        """Begin with nothing spent."""
        self.allowed, self.spent, self.pace, self.progress = allowed, 0, math.inf, progress

    @property
    def over(self) -> bool:
        """Whether none is left."""
        return self.spent >= self.allowed

    def watch(self, stage: str) -> Callable[[int, float], None]:
        """Return what counts the evaluations of one fit, and gives it up when none is left."""
        before = self.spent

        def counted(count: int, rms: float) -> None:
            """Count the runs that were spent, report them, and end a search that has none left."""
            self.spent = before + count
            if self.progress is not None:
                self.progress(f"{self.spent} of at most {self.allowed:g} runs", self.spent / self.allowed)
            if self.over:
                raise IdentificationError("its fit takes more evaluations than the search has left.", stage, code="fit.model-fails")

        return counted


class _Searching:
    """State of one search: what was fitted, what was refused."""

    def __init__(
        self, request: Request, changes: Callable[[Fitted], Sequence[MissingElement]], budget: EvaluationBudget, executor: Workers
    ) -> None:
        """Begin with nothing fitted."""
        self.request, self.changes, self.budget, self.executor = request, changes, budget, executor
        self.done: list[FittedStructure] = []
        self.refused: list[tuple[str, str]] = []
        self.scored = 0

    def run(self, rounds: int, begin: Mapping[str, float]) -> StructureSearch:
        """Search from the request's own structure."""
        best = fitted_structure((), self.request, begin, budget=(first := EvaluationBudget()))
        self.budget.spent, self.budget.pace, self.rounds = self.budget.spent + best.end.evaluations, first.pace, rounds
        self.done.append(best)
        complete = False
        for _ in range(rounds):
            if self.budget.over:
                break
            better = self._round(best)
            if better is None:
                complete = not self.budget.over
                break
            best = better
        best = self._challenged(self._simplest(self._pruned(best)))
        # early rounds may have taken lags and laws that bend for a mass; where readings do not tell them from masses alone, they stay
        places = [k for k, change in enumerate(best.changes) if change.stands_in]
        plain = self._without(best, *places) if places and not self.budget.over else None
        other = self._challenged(plain, masses=True) if plain else best
        best = other if self.log(other) > self.log(best) + TIE * max(other.nodes - best.nodes, 1) else best
        # refit what a law that bends may stand for: a contact in its place, which of equals is the simpler one
        for place in [k for k, change in enumerate(best.changes) if change.bends]:
            plain = None if self.budget.over else self._without(best, place)
            scores = self._scores(plain) if plain else []
            self._refitted(plain or best, [s for s in scores if not s.change.nodes and not s.change.bends][:CHALLENGES])
        return StructureSearch(
            tuple(self.done),
            self._simplest(best),
            tuple(self.refused),
            self.scored,
            self.budget.spent,
            complete,
        )

    def _round(self, best: FittedStructure) -> FittedStructure | None:
        """Return the best structure one or two changes on; None where the readings support none."""
        scores = self._scores(best)
        chosen = [s for s in scores[:REFITS_OF_A_ROUND] if s.gain > 0.5]
        pairs = [_pair(a, b) for k, a in enumerate(scores[:3]) for b in scores[k + 1 : 3] if min(a.gain, b.gain) > TIE]
        refitted = self._refitted(best, chosen)
        single = max((self.log(m) for m in refitted if m.possible), default=-np.inf)
        # a pair is worth a refit where no single change is proved
        if single < self.log(best) + TIE:
            refitted += self._refitted(best, pairs)
        able = self._proved(refitted, best, len(scores))
        if not able:
            return None
        top = max(self.log(m) for m in able)
        return min((m for m in able if self.log(m) > top - TIE), key=self._rank)

    def _proved(self, candidates: Sequence[FittedStructure], best: FittedStructure, tried: int) -> list[FittedStructure]:
        """Return the structures with which readings are likelier than with the best by more than chance among those tried gives.

        The best of many that do nothing gains about the logarithm of their number, and every mass more that one change brings, such as a
        lag of each sensor, gains by chance as a change of its own would.
        """
        return [
            m
            for m in candidates
            if m.possible and self.log(m) - self.log(best) > math.log(max(tried, 1)) + TIE * max(m.nodes - best.nodes, 1)
        ]

    def _challenged(self, best: FittedStructure, masses: bool = False) -> FittedStructure:
        """Return the best after the likeliest structures of one mass more were refitted.

        So it is known whether the readings can tell them from the best. One of them takes its place where it is likelier by more than
        chance among these few gives: the rounds before ask for more, because they choose among all changes. Of `masses` no lag is one.
        """
        while not self.budget.over:
            scores = [s for s in self._scores(best) if s.change.nodes == 1 and not (masses and s.change.stands_in)][:CHALLENGES]
            able = self._proved(self._refitted(best, scores), best, len(scores))
            if not able:
                break
            best = max(able, key=lambda m: self.log(m))
        return best

    def _scores(self, best: FittedStructure) -> list[PromisedChange]:
        """Return what every change promises, the most first."""
        changes = self.changes(Fitted.of_problem(best.request, best.problem, best.end.fitted)) if not self.budget.over else ()
        scored = best.promises(changes, self.refused)
        count = sum(max(len(s.change.starts), 1) for s in scored)
        self.scored, self.budget.spent = self.scored + count, self.budget.spent + count
        return scored

    def _refitted(self, best: FittedStructure, scores: Sequence[PromisedChange]) -> list[FittedStructure]:
        """Return the structures that could be fitted, of those that promise most."""
        tries = [((*best.changes, score.change), score.change.request, score.start) for score in scores]
        outcomes = list(fitted_structures(tries, best.fitted, self.budget, self.executor, self.rounds))
        self.refused += [(score.change.name, why) for score, why in zip(scores, outcomes, strict=False) if isinstance(why, str)]
        structures = [one for one in outcomes if not isinstance(one, str)]
        self.done += structures
        return structures

    def _pruned(self, best: FittedStructure) -> FittedStructure:
        """Return the structure without changes that others have made superfluous."""
        while len(best.changes) > 1 and not self.budget.over:
            simpler = [self._without(best, k) for k in range(len(best.changes) - 1)]  # the last one was just proved
            fewer = [m for m in simpler if m and m.possible and self.log(m) > self.log(best) - TIE]
            if not fewer:
                return best
            best = max(fewer, key=lambda m: self.log(m))
        return best

    def _without(self, best: FittedStructure, *places: int) -> FittedStructure | None:
        """Return the structure without the changes at some places, refitted; None where that is not possible."""
        remaining = tuple(change for k, change in enumerate(best.changes) if k not in places)
        request = self.request
        for change in remaining:
            request = change.make(request)
        try:
            structure = fitted_structure(remaining, request, best.fitted, budget=self.budget)
        except (ThermidError, np.linalg.LinAlgError):
            return None
        self.done.append(structure)
        return structure

    def log(self, one: FittedStructure) -> float:
        """Return the logarithm of how likely readings are, under the noise of all."""
        return float(one.weighing.logs[_noise_of(self.done)])

    def _rank(self, one: FittedStructure) -> tuple[int, int, int, float]:
        """Return what the simplest of equals is least in: masses, laws that bend, values, then how unlikely readings are.

        A law that bends acts otherwise at other powers: where the readings do not ask for it, it predicts another test worse.
        """
        return one.nodes, sum(c.bends for c in one.changes), sum(len(c.sizes) + c.chosen for c in one.changes), -self.log(one)

    def _simplest(self, best: FittedStructure) -> FittedStructure:
        """Return the simplest of the structures with which readings are as likely as with the best."""
        likelihood = self.log(best)
        alike = [s for s in self.done if (s.possible or not s.changes) and self.log(s) > likelihood - TIE * max(best.nodes - s.nodes, 1)]
        return min(alike, key=self._rank) if alike else best


def _noise_of(structures: Sequence[FittedStructure]) -> int:
    """Return the column by which structures are compared: the likeliest noise of the one that leaves the least.

    That of the likeliest one would take a misfit of 0.5 K for noise that wanders, as long as no single change takes all of it away.
    """
    return noise_of([min(structures, key=lambda s: s.end.chi_square).weighing])


def _pair(a: PromisedChange, b: PromisedChange) -> PromisedChange:
    """Return two changes as one, whose promise is the sum of both."""
    return PromisedChange(a.change.beside(b.change), {**a.start, **b.start}, (a.gain + b.gain,))


def starting_values(problem: Problem, values_before: Mapping[str, float], start: Mapping[str, float]) -> Array:
    """Return where a refit begins (unknowns,), fitted form: at `start` [SI], else `values_before` (fitted form), else the deck."""
    at = starting_point(problem.unknowns)
    for k, u in enumerate(problem.unknowns):
        if u.name in start:
            at[k] = u.to_fitted(start[u.name])
        elif u.name in values_before:
            at[k] = values_before[u.name]
    return at


def linearised(problem: Problem, at: Array) -> tuple[Array, Array]:
    """Return residuals (rows,) and their derivatives (rows, unknowns), priors below the readings."""
    return _systems(problem, at, None, [])[0]


def _systems(problem: Problem, at: Array, noise: int | None, like: Sequence[Binned]) -> list[tuple[Array, Array]]:
    """Return residuals (rows,) and derivatives (rows, unknowns) at `at` (unknowns,), fitted form, priors below the readings. [-]

    In white noise, and in `noise`, a column of a score, where given. `like` are the traces of the structure before, by which white noise
    is as large as it is inside their stretches.
    """
    if noise is None:
        compressed = problem.compressed(at)
        readings = [(compressed.rows, compressed.slopes)]
    else:
        pieces = seen_in_stretches(problem, at, "linear", 1.0)
        readings = [white_rows(pieces, n, like) for n in (0, noise)]
    priors, slopes = problem.prior_rows(at)
    return [(np.concatenate([rows, priors]), np.concatenate([matrix, slopes])) for rows, matrix in readings]


def _stepped(
    unknowns: Sequence[Unknown], at: Array, rows: Array, matrix: Array, new: Array, share: float = 1.0
) -> tuple[float, dict[str, float]]:
    """Return the cost [-] after one Gauss-Newton step with |step / scale|^2 as prior, and the values [SI] that new elements grow to.

    Parameters
    ----------
    at : array (unknowns,)              Fitted form.
    rows : array (rows,)                Weighted residuals and priors there. [-]
    matrix : array (rows, unknowns)     Their derivatives.
    new : array (unknowns,)             Which are of a new element: they may only grow, by `FREE_STEP` times `PROMISED_STEP`.
    share : float                       Of where they begin, at which they stand now. [-]
    """
    scale = np.array([PROMISED_STEP if u.log else PROMISED_STEP * u.scale for u in unknowns]) * np.where(new, FREE_STEP / share, 1.0)
    for _ in range(2):
        wide = np.concatenate([matrix * scale, np.eye(scale.size)])
        step = np.linalg.lstsq(wide, np.concatenate([-rows, np.zeros(scale.size)]), rcond=None)[0]
        backward = new & (scale * step < -1.0)
        if not backward.any():
            break
        scale = np.where(backward, 0.0, scale)
    residuals = rows + matrix @ (scale * step)
    moved = zip(unknowns, at, new, scale * step, strict=True)
    larger = {
        u.name: u.to_value(float(x)) * float(np.clip(1.0 + s, 0.1 / share, 100.0 / share)) for u, x, grows, s in moved if grows and u.log
    }
    return 0.5 * float(residuals @ residuals + step @ step), larger


def _laid_together(
    structure: FittedStructure, changes: Iterable[MissingElement]
) -> Iterator[tuple[Problem, Array, list[tuple[MissingElement, Collection[str], Mapping[str, float]]], Collection[str]]]:
    """Yield problems over which small elements lie together, where they are looked at, which they are, and all unknowns that they add.

    Where they are looked at are the unknowns (unknowns,), fitted form; an element comes with its free names and their starts. They are so
    small that they do not act: a derivative says what each would do. Those that cannot be laid over it so are left out.
    """
    together: list[MissingElement] = []
    names: set[str] = set()
    for change in changes:
        if change.additive and not change.nodes and not change.chosen and not change.starts and names.isdisjoint(change.sizes):
            together.append(change)
            names |= {*change.sizes}
    for k in range(0, len(together), MAX_LAID_TOGETHER):
        group, request = together[k : k + MAX_LAID_TOGETHER], structure.request
        for change in group:
            request = change.make(request)
        with suppress(ThermidError):
            problem = build_problem(request)
            begun = {u.name: u.to_value(u.to_fitted(u.start)) * IDLE_SHARE for u in problem.unknowns if u.name in names}
            at = np.maximum(starting_values(problem, structure.fitted, begun), [u.fitted_bounds()[0] for u in problem.unknowns])
            yield problem, at, [(change, change.sizes, {}) for change in group], names


def fitted_structure(
    changes: tuple[MissingElement, ...],
    request: Request,
    values_before: Mapping[str, float],
    start: Mapping[str, float] | None = None,
    budget: EvaluationBudget | None = None,
    rounds: int = MOST_EVALUATIONS,
    noise: int | None = None,
) -> FittedStructure:
    """Fit one structure and weigh it.

    Parameters
    ----------
    changes : tuple     What was changed, for the result.
    request : Request   With the changes.
    values_before : dict  Unknown -> value in the fitted form, from a fit before.
    start : dict        Path -> value of new unknowns. [SI]
    budget : EvaluationBudget     What its evaluations are taken from; it is given up where none is left.
    rounds : int        Its rough and its fine descent end after so many evaluations each in any case; 0 leaves it where it begins.
    noise : int         Column of the score in whose noise its values are the likeliest; white noise by default.

    Raises
    ------
    IdentificationError     When its budget is used up, or it does not end.
    SolverError             When a record cannot be run.
    """
    sizes, chosen = _added(changes)
    problem = _with_loose_priors(build_problem(request), sizes)
    end, weighing = _ended(problem, request, sizes, chosen, values_before, start or {}, budget or EvaluationBudget(), rounds, noise)
    return _structure_at(changes, request, problem, end, weighing, noise)


def fitted_structures(
    tries: Sequence[Try],
    values_before: Mapping[str, float],
    budget: EvaluationBudget,
    executor: Workers,
    rounds: int = 1,
    noise: int | None = None,
) -> Iterator[FittedStructure | str]:
    """Yield structures as `fitted_structure` does, or why one could not be fitted, in order, until the budget is used up.

    Parameters
    ----------
    tries : sequence    Changes, the request with them, and where new unknowns begin.
    values_before, budget   As there; what is fitted in tasks counts in order, so that the same is given up.
    executor : see `Workers`
    rounds : int        How often as much may be asked for: processes of this machine begin where all of it is worth them.
    noise : int         As there.
    """
    if executor is None:
        for changes, request, start in tries:
            if budget.over:
                return
            try:
                yield fitted_structure(changes, request, values_before, start, budget, noise=noise)
            except (ThermidError, np.linalg.LinAlgError) as error:
                yield str(error)
        return
    allowed = budget.allowed - budget.spent
    added = [_added(changes) for changes, _, _ in tries]
    tasks = [
        (f"the refit of {changes[-1].name}", (request, *sizes_and_chosen, values_before, start, allowed, noise))
        for (changes, request, start), sizes_and_chosen in zip(tries, added, strict=True)
    ]
    ahead = EVALUATIONS_OF_A_REFIT * budget.pace * len(tasks) * rounds
    outcomes = sorted(in_tasks(_ended_in_task, tasks, executor, seconds=ahead), key=itemgetter(0))
    for (changes, request, _), (sizes, _), (_, (outcome, spent)) in zip(tries, added, outcomes, strict=True):
        if budget.over:
            return
        try:
            budget.watch(request.name)(spent, math.nan)
        except IdentificationError as error:
            budget.spent, outcome = int(budget.allowed), str(error)
        if isinstance(outcome, str):
            yield outcome
        else:
            yield _structure_at(changes, request, _with_loose_priors(build_problem(request), sizes), *outcome, noise)


def _added(changes: Sequence[MissingElement]) -> tuple[dict[str, SizedValue], float]:
    """Return path -> prior of what changes add, and by how much numbers that were chosen for them make readings less likely. [-]"""
    return {path: size for c in changes for path, size in c.sizes.items()}, CHOSEN * sum(c.chosen for c in changes)


def _ended_in_task(
    request: Request,
    sizes: Mapping[str, SizedValue],
    chosen: float,
    values_before: Mapping[str, float],
    start: Mapping[str, float],
    allowed: float,
    noise: int | None,
) -> tuple[tuple[Fit, CauseScore] | str, int]:
    """Return where a fit ended, or why it did not, and the evaluations that it took."""
    budget = EvaluationBudget(allowed)
    try:
        with one_thread():
            problem = _with_loose_priors(build_problem(request), sizes)
            return _ended(problem, request, sizes, chosen, values_before, start, budget, noise=noise), budget.spent
    except (ThermidError, np.linalg.LinAlgError) as error:
        return str(error), budget.spent


def _ended(
    problem: Problem,
    request: Request,
    sizes: Mapping[str, SizedValue],
    chosen: float,
    values_before: Mapping[str, float],
    start: Mapping[str, float],
    budget: EvaluationBudget,
    rounds: int = MOST_EVALUATIONS,
    noise: int | None = None,
) -> tuple[Fit, CauseScore]:
    """Return where a fit ended, and how likely readings are there.

    Parameters
    ----------
    sizes : dict            Name -> likely size of what an added element holds.
    chosen : float          Taken off the logarithm of the likelihood: that this structure was chosen among others. [-]
    values_before : dict    Name -> value, fitted form, where a fit before ended.
    start : dict            Name -> start of values that are new, SI.
    rounds : int            Most evaluations of the descent; none where 0.
    noise : int or None     Number of the noise model that is kept; searched for where None.
    """
    begun, at = time.process_time(), starting_values(problem, values_before, start)
    loss = request.loss, request.loss_scale
    if noise is not None or not rounds:
        score, at = weighed_in_noise(problem, at, sizes, noise, *loss) if noise is not None else (weighed_at(problem, at, sizes, *loss), at)
        return Fit.ended(problem, at, *loss), score.less(chosen)
    end = minimise(problem, *loss, at, budget.watch(request.name), SEARCH_DONE_STEP, rounds)
    budget.pace = min(budget.pace, (time.process_time() - begun) / max(end.evaluations, 1))
    if not np.isfinite(end.cost):
        raise IdentificationError("its fit does not end at a finite cost.", request.name, code="fit.model-fails")
    return end, weighed_at(problem, end.fitted, sizes, *loss).less(chosen)


def _structure_at(
    changes: tuple[MissingElement, ...], request: Request, problem: Problem, end: Fit, weighing: CauseScore, noise: int | None
) -> FittedStructure:
    """Return a fitted structure with the number of its masses."""
    numbers = problem.experiments[0].network.numbers()
    nodes = sum(c is not None and float(value_of(c)) > 0 for c in numbers.capacitances.values())
    return FittedStructure(changes, request, problem, end, weighing, nodes, noise)


def _with_loose_priors(problem: Problem, sizes: Mapping[str, SizedValue]) -> Problem:
    """Return a problem with a weak prior of every parameter, and with the noise that readings show where none is stated.

    Values that a change adds have their prior of the table. Positive parameters without a prior have one of a factor of exp(5); a start at
    a first reading has one about it, generous beside noise.
    """
    shown: dict[str, float] = {}
    for e in problem.experiments:
        for o in e.observations:
            shown[o.sensor] = max(shown.get(o.sensor, 1e-3), e.record.channels[o.sensor].noise_seen)
    problem = replace(problem, noise={**problem.noise, **shown})
    sigma = max((o.sigma(problem.noise) for o in problem.observations()), default=1.0)
    near = max(ABOUT_START * sigma, 1.0)

    def held(u: Unknown) -> Unknown:
        """Return an unknown with the prior of the size that an element of its kind has."""
        if u.name in sizes and sizes[u.name].middle:
            return replace(
                u, prior=Prior(u.to_fitted(sizes[u.name].middle), sizes[u.name].spread * (1.0 if u.log else abs(sizes[u.name].middle)))
            )
        if u.prior is None and u.kind == "parameter" and u.log:
            return replace(u, prior=Prior(u.to_fitted(u.start), ANY_VALUE))
        if u.prior is None and u.kind == "local" and ": initial." in u.name:
            return replace(u, prior=Prior(u.start, near))
        return u

    return replace(problem, unknowns=tuple(held(u) for u in problem.unknowns))


def telling_test(one: FittedStructure, other: FittedStructure) -> str:
    """Return in words which test would separate two structures: the one in which their fits differ most, in units (ln of the odds).

    Three tests are simulated with both fits, each from rest and with all logged powers together at their highest [W]: on for half of the
    log's duration and off for the other half; on and off in turns of a twentieth of it; on for twice the duration. Readings are those of
    the first record, as often as there. A difference below `TIE` decides nothing.
    """
    experiment = one.problem.experiments[0]
    record = experiment.record
    driven = [c for c in record.channels.values() if c.role in ("load", "command") and c.quantity == "power" and c.valid.any()]
    watts = {c.target or c.name: float(np.nanmax(c.values)) for c in driven}
    if not any(watts.values()):
        return "To decide, run a test with a known power; this log has none."
    span, step = record.duration, max(record.step, record.duration / MAX_SEPARATING_READINGS)
    tests: dict[str, tuple[float, Callable[[Array], Any]]] = {
        f"on at the highest power for {duration_text(0.5 * span)}, then off for as long": (span, lambda t: t < 0.5 * span),
        f"on and off in turns of {duration_text(0.05 * span)}, for {duration_text(span)}": (span, lambda t: (t // (0.05 * span)) % 2 < 1),
        f"on at the highest power for {duration_text(2.0 * span)}": (2.0 * span, lambda t: t >= 0.0),
    }
    gains = {}
    for words, (length, on) in tests.items():
        times = np.arange(0.0, length, step)
        loads = {name: TableSignal(times, np.where(on(times), top, 0.0), True) for name, top in watts.items()}
        try:
            gains[words] = _separation(one, other, times, loads)
        except ThermidError:
            continue
    if not gains:
        return "No test of the logged powers could be run with both."
    words = max(gains, key=gains.__getitem__)
    if gains[words] < TIE:
        return f"No test with these powers and sensors would decide: of those tried, '{words}' gives {short(gains[words], 2)} units."
    return f"To decide, test from rest, {words} (it separates them by about {short(gains[words], 2)} units; {TIE:g} decide)."


def _separation(one: FittedStructure, other: FittedStructure, times: Array, loads: Mapping[str, TableSignal]) -> float:
    """Return the log-likelihood by which a test separates two structures: sum ((T_1 - T_2) / noise)^2 / 2 over its readings. [-]

    `loads` are powers and commands at `times` (readings,) [s]; the test begins settled at the mean first reading.
    """
    readings = []
    for structure in (one, other):
        request = structure.full_request
        base = structure.problem.experiments[0]
        rest = float(np.mean([o.measured[0] for o in base.observations]))
        boundaries = {b: Constant(rest) for b in base.network.boundaries}
        grown = {c.target or c.name for c in base.record.channels.values() if c.role == "command"}
        inputs = {"commands": {n: w for n, w in loads.items() if n in grown}, "loads": {n: w for n, w in loads.items() if n not in grown}}
        length = f"{float(times[-1])!r} [s]"
        scenario = Scenario("test", boundaries=boundaries, start=f"{rest!r} [K]", duration=length).with_(**inputs)
        run = simulate(request.model, scenario, times=times)
        readings.append({o.sensor: run[o.node].kelvin / o.sigma(structure.problem.noise) for o in base.observations})
    return 0.5 * sum(float(np.sum((readings[0][s] - readings[1][s]) ** 2)) for s in readings[0])


def _undetermined(one: FittedStructure) -> list[Unknown]:
    """Return the parameters without a prior whose errors are a good part of their bounds; a full fit refuses some of them."""
    errors, out = one.errors(), []
    with_prior = {one.request.model.canonical(p) for p in one.request.priors}
    for u in one.problem.unknowns:
        low, high = u.fitted_bounds()
        bounded = np.isfinite(high - low) and (not u.log or u.low > 0.0)
        if u.kind == "parameter" and bounded and u.name not in with_prior and WIDE_ERRORS * errors[u.name] > high - low:
            out.append(u)
    return out
