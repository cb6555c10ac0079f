"""Search for a structure: changes of a network scored by one evaluation each, the best refitted, kept where held-out readings ask for them.

In: a `Request` with the structure to begin from. Out: a `StructureSearch`: every structure that was fitted, with its held-out likelihood,
the one that is proposed, those that the readings cannot separate from it, and the test that would.

A change is scored by the step of Gauss and Newton from its start: what one evaluation with derivatives promises. Refits are judged by
cross-validation: readings are held out in parts (records, or stretches of a single record), the parameters follow from all others by one
step of Gauss and Newton at the end of the fit, and a held-out part has its own starts and ambient fitted to it. All structures are weighed
by one noise per trace, that of the structure with the smallest residuals, widened by how long its residuals wander (Burnham and Anderson,
Model Selection and Multimodel Inference, 2nd ed., Springer 2002, section 2.5: QAIC).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.dual import value_of
from thermid.base.errors import IdentificationError, ThermidError
from thermid.base.linear_algebra import Array
from thermid.base.units import from_si, unit
from thermid.fit.calibration import Fit, minimise
from thermid.fit.problem import Prior, Problem, Request, Unknown, build_problem, loss_of, starting_point
from thermid.inference._explain.candidates import Fitted, MissingElement, changes_of
from thermid.measure.amounts import short
from thermid.measure.records import BoolArray
from thermid.model.laws import Constant, TableSignal
from thermid.model.parameters import exact
from thermid.simulation.runs import simulate
from thermid.simulation.scenarios import Scenario

TIE = 2.0
"""Difference of held-out log-likelihoods below which two structures cannot be separated. [-]"""
PARTS, STRETCHES = 10, 6
"""Parts in which readings are held out, in turn, and the stretches of a single record that make one part."""
PRIOR_STEP = 1.5
"""Standard deviation that a score allows each logarithm, so that one step is not believed farther than it can be. [-]"""
FREE_STEP = 20.0
"""The same for a value that begins small and whose effect is proportional to it, over `PRIOR_STEP`. [-]"""
SHOWN = 400
"""Most readings of a test that may separate two structures. [-]"""
CHALLENGES = 3
"""Structures of one mass more that are refitted at the end."""
STARTS = 5.0
"""Standard deviation of a start about its first reading, in noises; 1 K at least. [-]"""
LOOSE = 5.0
"""Standard deviation of the logarithm of a parameter of which nothing is known. [-]"""
NEAR = 0.5
"""How far a logarithm may move when a part of the readings is left out, as a standard deviation. [-]"""
WIDE = 8.0
"""So many standard errors are wider than the bounds of a value that the readings hardly determine; a full fit refuses it at two."""
EVALUATIONS = 8000
"""Most evaluations of a search: runs of every record with derivatives. A count, so that a busy machine finds what an idle one finds. [-]"""
DONE = 3e-3
"""A search of one structure ends at this part of a standard error. [-]"""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Squares of held-out residuals, by trace.

    Parameters
    ----------
    squares : dict      (record, sensor) -> sum of squares of held-out residuals, in units of the stated noise. [-]
    inside : dict       The same of the fit itself.
    counts : dict       (record, sensor) -> readings.
    memory : dict       (record, sensor) -> by how much correlation of the residuals widens a sum of squares, 1 for white ones. [-]
    """

    squares: Mapping[tuple[str, str], float]
    inside: Mapping[tuple[str, str], float]
    counts: Mapping[tuple[str, str], int]
    memory: Mapping[tuple[str, str], float]

    def likelihood(self, scale: Mapping[tuple[str, str], float]) -> float:
        """Return the held-out log-likelihood but for a constant; `scale` is the variance of each trace in units of its stated noise."""
        return -0.5 * sum(square / scale[trace] for trace, square in self.squares.items())


@dataclass(frozen=True, eq=False)
class FittedStructure:
    """One structure that was fitted.

    Parameters
    ----------
    changes : tuple of MissingElement   What was changed, in order; empty for the structure at the beginning.
    request : Request
    problem : Problem
    end : Fit                           Where its fit ended.
    held : HeldOut
    nodes : int                         Masses of the model, sensors that lag among them.
    """

    changes: tuple[MissingElement, ...]
    request: Request
    problem: Problem
    end: Fit
    held: HeldOut
    nodes: int

    @property
    def name(self) -> str:
        """The changes in words."""
        return ", and ".join(c.name for c in self.changes) or "as it is"

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
        errors, pairs = self.errors(), zip(self.problem.unknowns, self.end.fitted, strict=True)
        slopes = {u.name: u.slope(float(x)) for u, x in pairs if u.kind == "parameter"}
        found = {p: _Plain(v, float(slopes[p] * errors[p])) for p, v in self.values.items()}
        return [c.judge(found) for c in self.changes]

    @property
    def possible(self) -> bool:
        """Whether every change has a value that hardware has."""
        return all(possible for _, possible in self.judged())

    def errors(self, free: Sequence[str] | None = None) -> dict[str, float]:
        """Return path -> standard error of what was fitted, of its logarithm where it is one; with `free`, all other parameters fixed."""
        kept = [k for k, u in enumerate(self.problem.unknowns) if u.kind != "parameter" or free is None or u.name in free]
        rows = np.concatenate([self.end.jacobian, self.end.priors])[:, kept]
        scale = np.linalg.norm(rows, axis=0)
        scale[scale == 0.0] = 1.0
        inverse = np.linalg.pinv((rows / scale).T @ (rows / scale), hermitian=True)
        sizes = np.sqrt(np.maximum(np.diag(inverse), 0.0)) / scale
        unknowns = [self.problem.unknowns[k] for k in kept]
        return {u.name: float(s) for u, s in zip(unknowns, sizes, strict=True) if u.kind == "parameter"}

    @property
    def rmse(self) -> float:
        """RMS of all residuals. [K]"""
        squares = [s.count * s.mean_square for _, _, s in self.end.sums]
        return float(np.sqrt(sum(squares) / max(sum(s.count for _, _, s in self.end.sums), 1.0)))


@dataclass(frozen=True)
class _Plain:
    """A value with its error."""

    value: float
    error: float


@dataclass(frozen=True, eq=False)
class PromisedChange:
    """What one evaluation promises of a change.

    Parameters
    ----------
    change : MissingElement
    start : dict        Path -> value that the refit begins from. [SI]
    gain : float        Promised fall of the cost, in log-likelihood at the noise of the fit before. [-]
    """

    change: MissingElement
    start: Mapping[str, float]
    gain: float


@dataclass(frozen=True, eq=False)
class StructureSearch:
    """What a search of structures found.

    Parameters
    ----------
    structures : tuple of FittedStructure     All that were fitted, in order; the first is the one at the beginning.
    proposed : FittedStructure                The simplest of those that held-out readings support equally well.
    scale : dict                        (record, sensor) -> variance that all are weighed by, in units of the stated noise. [-]
    refused : tuple of (str, str)       Changes that could not be fitted, and why.
    scored : int                        Changes that were scored.
    evaluations : int                   What it took: runs of every record with derivatives.
    complete : bool                     Whether it ended by itself, and not by its budget.
    """

    structures: tuple[FittedStructure, ...]
    proposed: FittedStructure
    scale: Mapping[tuple[str, str], float]
    refused: tuple[tuple[str, str], ...]
    scored: int
    evaluations: int
    complete: bool

    @property
    def start(self) -> FittedStructure:
        """The structure at the beginning."""
        return self.structures[0]

    def likelihood(self, one: FittedStructure) -> float:
        """Held-out log-likelihood over that of the structure at the beginning. [-]"""
        return one.held.likelihood(self.scale) - self.start.held.likelihood(self.scale)

    @property
    def ties(self) -> tuple[FittedStructure, ...]:
        """Structures that the readings cannot separate from the proposed one: held-out log-likelihoods within two units of it, or above.

        Of those with as many masses the likeliest stands for all.
        """
        own = self.likelihood(self.proposed)
        best: dict[int, FittedStructure] = {}
        for one in self.structures:
            if one is self.proposed or not one.possible or self.likelihood(one) < own - TIE:
                continue
            if one.nodes not in best or self.likelihood(one) > self.likelihood(best[one.nodes]):
                best[one.nodes] = one
        return tuple(best.values())

    @property
    def orders(self) -> tuple[int, ...]:
        """Numbers of masses that the readings support: that of the proposed structure first, then those that they cannot separate."""
        return tuple(dict.fromkeys([self.proposed.nodes, *(t.nodes for t in self.ties)]))

    def __str__(self) -> str:
        """Return the answer, what was tried, and what cannot be told, as text."""
        gain = self.likelihood(self.proposed)
        if self.proposed is self.start:
            lines = ["No change of the structure is supported by the hold-out readings."]
        else:
            lines = [f"Proposed: {self.proposed.name} (log-likelihood of the hold-out readings {gain:+.3g})."]
            lines.append(f"  RMSE {short(self.start.rmse, 3)} -> {short(self.proposed.rmse, 3)} K")
            for (text, possible), change in zip(self.proposed.judged(), self.proposed.changes, strict=True):
                lines.append(f"  {change.name}: {text}{'' if possible else ', which is not physically possible'}")
        for one in self.ties:
            if one.nodes != self.proposed.nodes:
                apart = self.likelihood(one) - gain
                lines.append(
                    f"  Not separable from it: {one.name} ({one.nodes} masses; log-likelihood of the hold-out readings differs by "
                    f"{apart:+.2g})."
                )
                lines.append(f"    {telling_test(self.proposed, one)}")
        tried = {s.name: s for s in sorted(self.structures[1:], key=self.likelihood)}  # of one name the likeliest stands
        best = sorted(tried.values(), key=lambda s: -self.likelihood(s))
        shown = [f"    {s.name}: {self.likelihood(s):+.3g}{'' if s.possible else ', not physically possible'}" for s in best[:8]]
        lines += ["  refitted, log-likelihood of the hold-out readings relative to the first structure:", *shown] if shown else []
        lines.append(f"  {self.scored} changes scored, {len(self.structures) - 1} refitted in {self.evaluations} evaluations")
        if not self.complete:
            lines.append("  The budget of evaluations ended the search, so more changes may be supported. Allow more: --evaluations.")
        return "\n".join(lines)


def search_structure(
    request: Request,
    *,
    changes: Callable[[Fitted], Sequence[MissingElement]] | None = None,
    rounds: int = 6,
    width: int = 4,
    evaluations: int = EVALUATIONS,
    begin: Mapping[str, float] | None = None,
) -> StructureSearch:
    """Search for changes of structure that held-out readings support.

    Parameters
    ----------
    request : Request       The fit with the structure to begin from.
    changes : callable      Changes of a fitted structure; those of the catalogue by default.
    rounds : int            Most changes, one after the other.
    width : int             Refits of single changes in each round; pairs of the three with the best scores are refitted too.
    evaluations : int       Budget after which no refit begins, and one that runs is given up.
    begin : dict            Unknown -> value in the fitted form to begin from; the request's own starts by default.

    Raises
    ------
    IdentificationError, SolverError    When the structure at the beginning cannot be fitted.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        return _Searching(request, changes or (lambda seen: list(changes_of(seen))), width, EvaluationBudget(evaluations)).run(
            rounds, begin or {}
        )


class EvaluationBudget:
    """Evaluations that a search may still take."""

    def __init__(self, allowed: float = math.inf) -> None:
        self.allowed, self.spent = allowed, 0

    @property
    def over(self) -> bool:
        """Whether none is left."""
        return self.spent >= self.allowed

    def watch(self, stage: str) -> Callable[[int, float], None]:
        """Return what counts the evaluations of one fit, and gives it up when none is left."""
        before = self.spent

        def counted(count: int, rms: float) -> None:
            self.spent = before + count
            if self.over:
                raise IdentificationError("its fit takes more evaluations than the search has left.", stage)

        return counted


class _Searching:
    """State of one search: what was fitted, what was refused."""

    def __init__(
        self, request: Request, changes: Callable[[Fitted], Sequence[MissingElement]], width: int, budget: EvaluationBudget
    ) -> None:
        self.request, self.changes, self.width, self.budget = request, changes, width, budget
        self.done: list[FittedStructure] = []
        self.refused: list[tuple[str, str]] = []
        self.scored = 0

    def run(self, rounds: int, begin: Mapping[str, float]) -> StructureSearch:
        """Search from the request's own structure."""
        best = fitted_structure((), self.request, begin, budget=EvaluationBudget())
        self.budget.spent = best.end.evaluations
        self.done.append(best)
        complete = False
        for _ in range(rounds):
            if self.budget.over:
                break
            found = self._round(best)
            if found is None:
                complete = not self.budget.over
                break
            best = found
        best = self._challenged(self._simplest(self._pruned(best)))
        self._straighten(best)
        return StructureSearch(
            tuple(self.done),
            self._simplest(best),
            self._scale(),
            tuple(self.refused),
            self.scored,
            self.budget.spent,
            complete,
        )

    def _round(self, best: FittedStructure) -> FittedStructure | None:
        """Return the best structure one or two changes on; None where held-out readings support none."""
        scores = sorted(self._scores(best), key=lambda s: -s.gain)
        chosen = [s for s in scores[: self.width] if s.gain > 0.5]
        pairs = [_pair(a, b) for k, a in enumerate(scores[:3]) for b in scores[k + 1 : 3] if min(a.gain, b.gain) > TIE]
        made = [self._refitted(best, score) for score in chosen]
        scale = self._scale()
        single = max((m.held.likelihood(scale) for m in made if m is not None and m.possible), default=-np.inf)
        # a pair is worth a refit where no single change is proved
        if single < best.held.likelihood(scale) + TIE:
            made += [self._refitted(best, pair) for pair in pairs]
        scale = self._scale()
        able = self._proved(made, best, len(scores))
        if not able:
            return None
        top = max(m.held.likelihood(scale) for m in able)
        near = [m for m in able if m.held.likelihood(scale) > top - TIE]
        return min(near, key=lambda m: _rank(m, scale))

    def _proved(self, made: Sequence[FittedStructure | None], best: FittedStructure, tried: int) -> list[FittedStructure]:
        """Return the structures whose held-out readings are likelier than those of the best by more than chance among those tried gives.

        The best of many that do nothing gains about the logarithm of their number, and every mass more that one change brings, such as a
        lag of each sensor, gains by chance as a change of its own would.
        """
        scale = self._scale()
        own = best.held.likelihood(scale) + math.log(max(tried, 1))
        return [m for m in made if m and m.possible and m.held.likelihood(scale) > own + TIE * max(m.nodes - best.nodes, 1)]

    def _challenged(self, best: FittedStructure) -> FittedStructure:
        """Return the best after the likeliest structures of one mass more were refitted.

        So it is known whether the readings can tell them from the best. One of them takes its place where it is likelier by more than
        chance among these few gives: the rounds before ask for more, because they choose among all changes.
        """
        while not self.budget.over:
            scores = [s for s in sorted(self._scores(best), key=lambda s: -s.gain) if s.change.nodes == 1][:CHALLENGES]
            able = self._proved([self._refitted(best, score) for score in scores], best, len(scores))
            if not able:
                break
            scale = self._scale()
            best = max(able, key=lambda m: m.held.likelihood(scale))
        return best

    def _scores(self, best: FittedStructure) -> list[PromisedChange]:
        """Return the score of every change."""
        seen = Fitted.of_problem(best.request, best.problem, best.end.fitted)
        reduced = max(best.end.chi_square / max(best.problem.freedom, 1.0), 1e-12)
        known = best.fitted
        before = _promised(best.problem, best.end.fitted, known, False)
        out = []
        for change in self.changes(seen):
            if self.budget.over:
                break
            try:
                problem = build_problem(change.request)
            except ThermidError as error:
                self.refused.append((change.name, error.message))
                continue
            for start in change.starts or ({},):
                try:
                    after = _promised(problem, _from(problem, best, start), known, change.additive)
                except ThermidError:
                    continue
                self.scored += 1
                self.budget.spent += 1
                out.append(PromisedChange(change, start, (before - after) / reduced))
        best_of: dict[str, PromisedChange] = {}
        for score in out:
            rival = best_of.get(score.change.name)
            if rival is None or score.gain > rival.gain:
                best_of[score.change.name] = score
        return list(best_of.values())

    def _refitted(self, best: FittedStructure, score: PromisedChange) -> FittedStructure | None:
        if self.budget.over:
            return None
        try:
            made = fitted_structure((*best.changes, score.change), score.change.request, best.fitted, score.start, self.budget)
        except (ThermidError, np.linalg.LinAlgError) as error:
            self.refused.append((score.change.name, str(error)))
            return None
        self.done.append(made)
        return made

    def _pruned(self, best: FittedStructure) -> FittedStructure:
        """Return the structure without changes that others have made superfluous."""
        while len(best.changes) > 1 and not self.budget.over:
            scale = self._scale()
            made = [self._without(best, k) for k in range(len(best.changes) - 1)]  # the last one was just proved
            fewer = [m for m in made if m and m.possible and m.held.likelihood(scale) > best.held.likelihood(scale) - TIE]
            if not fewer:
                return best
            best = max(fewer, key=lambda m: m.held.likelihood(scale))
        return best

    def _without(self, best: FittedStructure, place: int) -> FittedStructure | None:
        """Return the structure without one of its changes, refitted; None where that is not possible."""
        kept = (*best.changes[:place], *best.changes[place + 1 :])
        request = self.request
        for change in kept:
            request = change.make(request)
        try:
            made = fitted_structure(kept, request, best.fitted, budget=self.budget)
        except (ThermidError, np.linalg.LinAlgError):
            return None
        self.done.append(made)
        return made

    def _straighten(self, best: FittedStructure) -> None:
        """Refit what a law that bends may stand for: a contact in its place, which of equals is the simpler one."""
        for place in [k for k, change in enumerate(best.changes) if change.bends]:
            plain = None if self.budget.over else self._without(best, place)
            scores = sorted(self._scores(plain), key=lambda s: -s.gain) if plain else []
            for score in [s for s in scores if not s.change.nodes and not s.change.bends][:CHALLENGES]:
                self._refitted(plain or best, score)

    def _scale(self) -> dict[tuple[str, str], float]:
        """Return the variance of each trace: that of the structure with the smallest residuals, widened by how long they wander."""
        richest = min(self.done, key=lambda s: sum(s.held.inside.values()))
        held = richest.held
        # no reading is trusted beyond what is stated of its noise
        return {t: max(held.inside[t] / max(held.counts[t], 1), 0.5) * held.memory[t] for t in held.inside}

    def _simplest(self, best: FittedStructure) -> FittedStructure:
        """Return the simplest of the structures whose held-out readings are as likely as those of the best."""
        scale = self._scale()
        own = best.held.likelihood(scale)
        alike = [
            s for s in self.done if (s.possible or not s.changes) and s.held.likelihood(scale) > own - TIE * max(best.nodes - s.nodes, 1)
        ]
        return min(alike, key=lambda s: _rank(s, scale)) if alike else best


def _rank(one: FittedStructure, scale: Mapping[tuple[str, str], float]) -> tuple[int, int, float]:
    """Return what the simplest of equals is least in: masses, laws that bend, then held-out likelihood with half a unit for each number.

    A law that bends acts otherwise at other powers: where the readings do not ask for it, it predicts another test worse.
    """
    count = len(one.problem.unknowns) + sum(c.chosen for c in one.changes)
    return one.nodes, sum(c.bends for c in one.changes), 0.5 * count - one.held.likelihood(scale)


def _pair(a: PromisedChange, b: PromisedChange) -> PromisedChange:
    return PromisedChange(a.change.beside(b.change), {**a.start, **b.start}, a.gain + b.gain)


def _from(problem: Problem, best: FittedStructure, start: Mapping[str, float]) -> Array:
    """Return where a refit begins: at the values of the fit before, new ones at their start."""
    at = starting_point(problem.unknowns)
    known = best.fitted
    for k, u in enumerate(problem.unknowns):
        if u.name in start:
            at[k] = u.to_fitted(start[u.name])
        elif u.name in known:
            at[k] = known[u.name]
    return at


def _promised(problem: Problem, at: Array, known: Mapping[str, float], additive: bool) -> float:
    """Return the cost that one step of Gauss and Newton promises, half a sum of squares whatever the loss.

    Parameters
    ----------
    known : dict        Unknowns of the fit before.
    additive : bool     Whether the others are small values whose effect is proportional to them; none of them may turn negative.
    """
    found = problem.compressed(at)
    priors, slopes = problem.prior_rows(at)
    rows, matrix = np.concatenate([found.rows, priors]), np.concatenate([found.slopes, slopes])
    new = np.array([additive and u.name not in known for u in problem.unknowns], dtype=bool)
    scale = np.array([PRIOR_STEP if u.log else PRIOR_STEP * u.scale for u in problem.unknowns]) * np.where(new, FREE_STEP, 1.0)
    for _ in range(2):
        wide = np.concatenate([matrix * scale, np.eye(scale.size)])
        step = np.linalg.lstsq(wide, np.concatenate([-rows, np.zeros(scale.size)]), rcond=None)[0]
        backward = new & (scale * step < -1.0)
        if not backward.any():
            break
        scale = np.where(backward, 0.0, scale)
    left = rows + matrix @ (scale * step)
    return 0.5 * float(left @ left + step @ step)


def fitted_structure(
    changes: tuple[MissingElement, ...],
    request: Request,
    known: Mapping[str, float],
    start: Mapping[str, float] | None = None,
    budget: EvaluationBudget | None = None,
) -> FittedStructure:
    """Fit one structure and hold out its readings in parts.

    Parameters
    ----------
    changes : tuple     What was changed, for the result.
    request : Request   With the changes.
    known : dict        Unknown -> value in the fitted form, from a fit before.
    start : dict        Path -> value of new unknowns. [SI]
    budget : EvaluationBudget     What its evaluations are taken from; it is given up where none is left.

    Raises
    ------
    IdentificationError     When its budget is used up, or it does not end.
    SolverError             When a record cannot be run.
    """
    problem = _loosely_held(build_problem(request))
    at = starting_point(problem.unknowns)
    for k, u in enumerate(problem.unknowns):
        if start and u.name in start:
            at[k] = u.to_fitted(start[u.name])
        elif u.name in known:
            at[k] = known[u.name]

    end = minimise(problem, request.loss, request.loss_scale, at, (budget or EvaluationBudget()).watch(request.name), DONE)
    if not np.isfinite(end.cost):
        raise IdentificationError("its fit does not end at a finite cost.", request.name)
    numbers = problem.experiments[0].network.numbers()
    nodes = sum(c is not None and float(value_of(c)) > 0 for c in numbers.capacitances.values())
    return FittedStructure(changes, request, problem, end, held_out(problem, end, request), nodes)


def _loosely_held(problem: Problem) -> Problem:
    """Return a problem in which nothing drifts off for nothing.

    Positive parameters without a prior have one of a factor of exp(5); a start at a first reading has one about it, generous beside noise.
    """
    sigma = max((o.sigma(problem.noise) for o in problem.observations()), default=1.0)
    near = max(STARTS * sigma, 1.0)

    def held(u: Unknown) -> Unknown:
        if u.prior is None and u.kind == "parameter" and u.log:
            return replace(u, prior=Prior(u.to_fitted(u.start), LOOSE))
        if u.prior is None and u.kind == "local" and ": initial." in u.name:
            return replace(u, prior=Prior(u.start, near))
        return u

    return replace(problem, unknowns=tuple(held(u) for u in problem.unknowns))


def held_out(problem: Problem, end: Fit, request: Request) -> HeldOut:
    """Cross-validate a fit by one step of Gauss and Newton for each part of the readings that is held out.

    The values of a single record (its start, its ambient) are fitted to all its readings.
    """
    blocks = problem.blocks(end.fitted)
    slopes = [s for i in range(len(problem.experiments)) for s in _slopes_of(problem, i, end.fitted)]
    weights = [np.sqrt(loss_of(b.weighted**2, request.loss, request.loss_scale)[1]) for b in blocks]
    rows = [w * b.weighted for w, b in zip(weights, blocks, strict=True)]
    slopes = [w[:, None] * s for w, s in zip(weights, slopes, strict=True)]
    priors = problem.prior_rows(end.fitted)[1]
    parts = _parts_of([b.record for b in blocks], [b.times for b in blocks])
    local = np.array([u.kind == "local" for u in problem.unknowns], dtype=bool)
    log = np.array([u.log for u in problem.unknowns], dtype=bool)
    whole = sum((s.T @ s for s in slopes), np.zeros((local.size, local.size)))
    squares = {(b.record, b.sensor): 0.0 for b in blocks}
    for part in parts:
        chosen = [(k, mask) for k, mask in part if mask.any()]
        own = [(rows[k][mask], slopes[k][mask]) for k, mask in chosen]
        shift = _without(own, whole, priors, (local, log))
        for (k, _), (r, s) in zip(chosen, own, strict=True):
            left = r + s @ shift
            squares[blocks[k].record, blocks[k].sensor] += float(left @ left)
    inside = {(b.record, b.sensor): float(r @ r) for b, r in zip(blocks, rows, strict=True)}
    counts = {(b.record, b.sensor): b.residuals.size for b in blocks}
    memory = {(b.record, b.sensor): _memory(r) for b, r in zip(blocks, rows, strict=True)}
    return HeldOut(squares, inside, counts, memory)


def _slopes_of(problem: Problem, i: int, fitted: Array) -> list[Array]:
    table = problem.slopes(i, fitted)
    return [table[o.index, k, :] for k, o in enumerate(problem.experiments[i].observations)]


def _without(own: Sequence[tuple[Array, Array]], whole: Array, priors: Array, kinds: tuple[BoolArray, BoolArray]) -> Array:
    """Return how all unknowns move (unknowns,) once a part of the readings is left out.

    Starts and other values of a single record are no part of the structure: they follow from all readings of their record, those held out
    among them, once the shared values have moved. A logarithm moves within `NEAR`, or one step would be believed where it cannot hold.

    Parameters
    ----------
    own : list              Residuals and derivatives of the readings that are left out.
    whole : array           J'J of all readings.
    priors : array          Derivatives of the priors.
    kinds : (array, array)  Which unknowns are those of single records, and which are logarithms.
    """
    local, log = kinds
    cross = sum((s.T @ s for _, s in own), np.zeros_like(whole))
    slope = sum((s.T @ r for r, s in own), np.zeros(whole.shape[0]))
    full = whole + priors.T @ priors
    size = np.sqrt(np.maximum(np.diag(full), 1e-300))
    held = np.where(local, 1.0, np.where(log, 1.0 / (NEAR * size) ** 2, 1e-6)) + 1e-9
    # normal equations without the part: (J'J + P'P - J_p'J_p) shift = J_p'r_p, in units where their diagonal is 1
    matrix = (full - cross) / np.outer(size, size) + np.diag(held)
    shift = np.where(local, 0.0, np.linalg.solve(matrix, slope / size) / size)
    if local.any():
        mine = full[np.ix_(local, local)] / np.outer(size[local], size[local]) + 1e-9 * np.eye(int(local.sum()))
        shift[local] = -np.linalg.solve(mine, (full[local] @ shift) / size[local]) / size[local]
    return np.asarray(shift)


def _parts_of(records: Sequence[str], times: Sequence[Array]) -> list[list[tuple[int, Array]]]:
    """Return what is held out in each turn, as (trace, mask): whole records in turn; of one or two records every tenth stretch."""
    names = list(dict.fromkeys(records))
    if len(names) >= 3:
        groups = [names[k :: min(PARTS, len(names))] for k in range(min(PARTS, len(names)))]
        return [[(k, np.ones(t.size, dtype=bool)) for k, t in enumerate(times) if records[k] in group] for group in groups]
    out = []
    for name in names:
        own = [k for k in range(len(times)) if records[k] == name]
        edges = np.quantile(np.concatenate([times[k] for k in own]), np.linspace(0.0, 1.0, PARTS * STRETCHES + 1))
        turn = {k: np.clip(np.searchsorted(edges, times[k], side="right") - 1, 0, PARTS * STRETCHES - 1) % PARTS for k in own}
        out += [[(k, turn[k] == part) for k in own] for part in range(PARTS)]
    return out


def _memory(residuals: Array) -> float:
    """Return by how much correlation widens the spread of a sum of residuals: 1 + 2 (sum of autocorrelations until they vanish)."""
    z = residuals - residuals.mean()
    power = float(z @ z)
    if z.size < 8 or power <= 0:
        return 1.0
    spectrum = np.abs(np.fft.rfft(z, 2 * z.size)) ** 2
    memory = np.fft.irfft(spectrum)[: z.size] / power
    end = int(np.argmax(memory < 2.0 / np.sqrt(z.size))) or z.size
    return float(max(1.0 + 2.0 * memory[1:end].sum(), 1.0))


def telling_test(one: FittedStructure, other: FittedStructure) -> str:
    """Return in words which test would separate two structures: the one in which their fits differ most, in noises of the readings.

    Tests from rest, with every logged power at its highest: on for half of the log and off for the other half; on and off in turns of a
    twentieth; on for twice the log. Readings are those of the first record, as often as there.
    """
    experiment = one.problem.experiments[0]
    record = experiment.record
    driven = [c for c in record.channels.values() if c.role in ("load", "command") and c.quantity == "power" and c.valid.any()]
    watts = {c.target or c.name: float(np.nanmax(c.values)) for c in driven}
    if not any(watts.values()):
        return "To decide, run a test with a known power; this log has none."
    span, step = record.duration, max(record.step, record.duration / SHOWN)
    tests: dict[str, tuple[float, Callable[[Array], Any]]] = {
        f"on at the highest power for {_hours(0.5 * span)}, then off for as long": (span, lambda t: t < 0.5 * span),
        f"on and off in turns of {_hours(0.05 * span)}, for {_hours(span)}": (span, lambda t: (t // (0.05 * span)) % 2 < 1),
        f"on at the highest power for {_hours(2.0 * span)}": (2.0 * span, lambda t: t >= 0.0),
    }
    gains = {}
    for words, (length, on) in tests.items():
        times = np.arange(0.0, length, step)
        loads = {name: TableSignal(times, np.where(on(times), top, 0.0), True) for name, top in watts.items()}
        try:
            gains[words] = _apart(one, other, times, loads)
        except ThermidError:
            continue
    if not gains:
        return "No test of the logged powers could be run with both."
    words = max(gains, key=gains.__getitem__)
    if gains[words] < TIE:
        return f"No test with these powers and sensors would decide: of those tried, '{words}' gives {short(gains[words], 2)} units."
    return f"To decide, test from rest, {words} (about {short(gains[words], 2)} units of log-likelihood)."


def _hours(seconds: float) -> str:
    return f"{short(seconds / 3600.0, 2)} h" if seconds >= 5400.0 else f"{short(seconds / 60.0, 2)} min"


def _apart(one: FittedStructure, other: FittedStructure, times: Array, loads: Mapping[str, TableSignal]) -> float:
    """Return half the squares of the difference of both at the sensors, in noises."""
    readings = []
    for each in (one, other):
        request = adopted(each)
        base = each.problem.experiments[0]
        rest = float(np.mean([o.measured[0] for o in base.observations]))
        boundaries = {b: Constant(rest) for b in base.network.boundaries}
        grown = {c.target or c.name for c in base.record.channels.values() if c.role == "command"}
        given = {"commands": {n: w for n, w in loads.items() if n in grown}, "loads": {n: w for n, w in loads.items() if n not in grown}}
        length = f"{float(times[-1])!r} [s]"
        scenario = Scenario("test", boundaries=boundaries, start=f"{rest!r} [K]", duration=length).with_(**given)
        run = simulate(request.model, scenario, times=times)
        readings.append({o.sensor: run[o.node].kelvin / o.sigma(each.problem.noise) for o in base.observations})
    return 0.5 * sum(float(np.sum((readings[0][s] - readings[1][s]) ** 2)) for s in readings[0])


def adopted(one: FittedStructure) -> Request:
    """Return the request of a structure with its model at the fitted values, for a full fit.

    A value that its readings hardly determine gets its bounds as a prior. The errors of a changed structure count what it may lack
    (`Request.doubts`): readings that asked for one change seldom rule out all others.
    """
    units = {u.name: u.unit for u in one.problem.unknowns}
    texts = {n: exact(v, units[n]) for n, v in one.values.items()}
    model = one.request.model.with_values(texts, "structure search")
    wide = {u.name: _bounds_as_prior(u) for u in _undetermined(one)} if one.changes else {}
    said = tuple(
        f"in the proposed structure the readings hardly determine '{n}'. Its bounds stand as a prior: {mean} +- {sd}."
        for n, (mean, sd) in wide.items()
    )
    how = "local" if one.changes and one.request.search == "auto" else one.request.search  # it begins at the end of a descent
    return replace(
        one.request,
        model=model,
        priors={**one.request.priors, **wide},
        remarks=(*one.request.remarks, *said),
        search=how,
        doubts=bool(one.changes),
    )


def _undetermined(one: FittedStructure) -> list[Unknown]:
    """Return the parameters without a prior whose errors are a good part of their bounds; a full fit refuses some of them."""
    errors, out = one.errors(), []
    known = {one.request.model.canonical(p) for p in one.request.priors}
    for u in one.problem.unknowns:
        low, high = u.fitted_bounds()
        bounded = np.isfinite(high - low) and (not u.log or u.low > 0.0)
        if u.kind == "parameter" and bounded and u.name not in known and WIDE * errors[u.name] > high - low:
            out.append(u)
    return out


def _bounds_as_prior(u: Unknown) -> tuple[str, str]:
    """Return mean and standard deviation of a prior, as texts, whose 95 % are the bounds of an unknown."""
    low, high = u.fitted_bounds()
    mean, sd = from_si(u.to_value(0.5 * (low + high)), u.unit), 0.25 * (high - low)
    own = f"{100.0 * sd:.3g} [%]" if u.log else f"{sd / float(unit(u.unit).factor):.4g} [{u.unit}]"
    return f"{mean:.4g} [{u.unit}]", own
