"""Values of stages below against the logs of a level: by how much they moved, value by value and part by part, and what would be found."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from thermid.base.errors import ScenarioError, SolverError
from thermid.base.linear_algebra import RANK_TOLERANCE, square_root, symmetric_inverse
from thermid.base.units import Array, digits, from_si, short, some, unit
from thermid.fit._minimisation import Fit
from thermid.fit._problem.request import Request, form, known_before
from thermid.fit._problem.residuals import Problem, Unknown
from thermid.fit._uncertainty.information import Opened, covering, opened_at
from thermid.fit._uncertainty.noise import Binned, Weighed, weighed
from thermid.model.tree import Model
from thermid.values.store import FittedValue, FittedValues, State, Store

ALPHA, POWER = 0.05, 0.9
"""Chance of calling a value moved that did not, and of finding the shift that is stated as detectable."""
NEGLIGIBLE_INFORMATION = 1e-10
"""Information, in parts of what the value was known with or of white noise, that counts as none."""


@dataclass(frozen=True)
class Shift:
    """Difference between one value fitted to the data alone and its inherited value; in the fitted form (a logarithm where it has one).

    Parameters
    ----------
    size : float            Value by the data alone less that known; NaN where the data say nothing of it.
    error : float           Standard error of `size`.
    chance : float          Of a shift at least so large either way when nothing moved, over all values tested (Holm).
    detectable : float      Shift that is found with 90 % power.
    """

    size: float
    error: float
    chance: float
    detectable: float


@dataclass(frozen=True)
class Together:
    """Several values opened at once: chi-square, directions of which the data say anything, chance when nothing moved."""

    chi_square: float
    directions: int
    chance: float


@dataclass(frozen=True, eq=False)
class Test:
    """Information of the data about inherited values (known from another fit), all other free unknowns marginalised.

    Parameters
    ----------
    weights : array (models,)                       Probability of each noise model.
    information : array (models, known, known)      Of the known values, by the data alone.
    scores : array (models, known)                  Where they stand as known.
    root : array (known, columns)                   A root of the covariance with which they are known, with as few columns as it has.
    """

    weights: Array
    information: Array
    scores: Array
    root: Array

    @classmethod
    def of_unknowns(cls, data: Weighed, priors: Array, pulls: Array, inherited: Sequence[int], root: Array) -> Test:
        """Return the test of inherited values among the unknowns of a fit, all others marginalised by a Schur complement.

        I = A_kk - A_kr A_rr^-1 A_rk and b = b_k - A_kr A_rr^-1 b_r, k the inherited unknowns, r the rest, by each noise model.

        Parameters
        ----------
        data : Weighed                          Information and scores of all unknowns, the inherited ones at their inherited values.
        priors : array (unknowns, unknowns)     Information of the priors of the other unknowns, zero elsewhere.
        pulls : array (unknowns,)               Scores of these priors.
        inherited : sequence of int             Positions of the known values among the unknowns.
        root : array (known, sources)           Root of the covariance with which they are known.
        """
        at = list(inherited)
        rest = [k for k in range(priors.shape[0]) if k not in set(at)]
        whole, vector = data.information + priors, data.scores + pulls
        size = np.sqrt(np.maximum(np.diagonal(whole, axis1=1, axis2=2).max(axis=0), 1e-300))[rest]
        inner = whole[:, rest][:, :, rest] / np.outer(size, size) + 1e-12 * np.eye(len(rest))
        across = whole[:, rest][:, :, at] / size[:, None]
        solved = np.linalg.solve(inner, np.concatenate([across, (vector[:, rest] / size)[..., None]], axis=2))
        turned = np.swapaxes(across, 1, 2)
        # Schur complement: what is said of k with all r open is A_kk - A_kr A_rr^-1 A_rk, and of its score b_k - A_kr A_rr^-1 b_r
        information = whole[:, at][:, :, at] - turned @ solved[..., :-1]
        short = square_root(root @ root.T, drop=True)
        return cls(data.weights, information, vector[:, at] - (turned @ solved[..., -1:])[..., 0], short)


def _opened(a: Test, chosen: Sequence[int], loose: Sequence[int]) -> tuple[Array, Array, Array]:
    """Return scores T (models, opened), information I and covariance of T (models, opened, opened), of values opened together.

    `chosen` are their positions, those in `loose` are free besides; fitted form. The other values stand where they were known, with their
    covariance ``root root'``. The data alone put the opened values I^-1 T off. What the values were known with adds ``I root root' I``,
    less what the errors of the others, through the data, have in common with it.
    """
    others = [k for k in range(len(a.root)) if k not in {*chosen, *loose}]
    inside, sources = list(chosen), a.root.shape[1]
    known_with = np.zeros_like(a.root)
    known_with[others] = a.root[others]
    columns = np.concatenate([known_with, np.eye(len(a.root))[:, list(loose)]], axis=1)
    prior_information = np.diag([1.0] * sources + [0.0] * len(loose))
    # the others are root s, s standard normal: integrated out with the precision C'IC + 1; those in `loose` have none of their own
    inner = columns.T @ a.information @ columns + prior_information
    inner = inner + 1e-12 * np.eye(len(prior_information)) * np.trace(inner, axis1=1, axis2=2)[:, None, None]
    across = columns.T @ a.information[:, :, inside]
    pushed = (a.scores @ columns)[..., None]
    solved = np.linalg.solve(inner, np.concatenate([across, pushed], axis=2))
    turned = np.swapaxes(across, 1, 2)
    information = a.information[:, inside][:, :, inside] - turned @ solved[..., :-1]
    scores = a.scores[:, inside] - (turned @ solved[..., -1:])[..., 0]
    root_inside = a.root[inside]
    common = information @ root_inside @ solved[:, :sources, :-1]
    spread = information + information @ root_inside @ root_inside.T @ information + common + np.swapaxes(common, 1, 2)
    return scores, information, spread


def _shift_by_model(a: Test, k: int, loose: Sequence[int]) -> tuple[Array, Array]:
    """Return the shift I^-1 T (models,), fitted form, of the value in position k and its standard error; 0 and infinite if undetermined.

    Undetermined is less than `NEGLIGIBLE_INFORMATION` of its own information left, with the values in positions `loose` open.
    """
    scores, information, spread = _opened(a, [k], loose)
    information_of_value = information[:, 0, 0]
    is_determined = information_of_value > NEGLIGIBLE_INFORMATION * np.maximum(a.information[:, k, k], 1e-300)
    safe = np.where(is_determined, information_of_value, 1.0)
    return np.where(is_determined, scores[:, 0] / safe, 0.0), np.where(
        is_determined, np.sqrt(np.maximum(spread[:, 0, 0], 0.0)) / safe, np.inf
    )


def _chance(weights: Array, sizes: Array, errors: Array) -> float:
    """Return 2 min(P(d > 0), P(d < 0)) [-] of a shift d, a mixture of normal laws of `sizes` and `errors` (models,) by `weights`."""
    from scipy.special import ndtr

    above = float(weights @ ndtr(sizes / errors))
    return min(1.0, 2.0 * min(above, 1.0 - above))


def _quantile(weights: Array, errors: Array, chance: float) -> float:
    """Return the q [unit of the errors] with P(d > q) = `chance`, d a mixture of normal laws of mean 0; infinite for an infinite error.

    `weights` and `errors` (laws,); by bisection to the last bit.
    """
    from scipy.special import ndtr

    if not np.isfinite(errors[weights > 0]).all():
        return math.inf
    low, high = 0.0, 40.0 * float(errors.max())
    while low < (middle := 0.5 * (low + high)) < high:  # to the last bit
        low, high = (middle, high) if float(weights @ ndtr(-middle / errors)) > chance else (low, middle)
    return high


def _detectable_shift(weights: Array, errors: Array, tests: int) -> float:
    """Return the shift found with 90 % power at 5 % significance, two-sided, Bonferroni over `tests`; in the unit of `errors`."""
    return _quantile(weights, errors, 0.5 * ALPHA / max(tests, 1)) + _quantile(weights, errors, 1.0 - POWER)


def holm(chances: Sequence[float]) -> list[float]:
    """Return probabilities `chances` adjusted for their number, (n - rank) p made monotone (Holm, Scand. J. Statist. 6 (1979) 65). [-]

    `rank` counts from 0 for the least; 1 is the most, and NaN stays.
    """
    out, worst = [math.nan] * len(chances), 0.0
    order = sorted((k for k, p in enumerate(chances) if math.isfinite(p)), key=lambda k: chances[k])
    for rank, k in enumerate(order):
        worst = max(worst, min(1.0, (len(order) - rank) * chances[k]))
        out[k] = worst
    return out


def shifts(a: Test, positions: Sequence[int]) -> list[Shift]:
    """Return how far data move values that are known from elsewhere, one by one; `positions` are their positions in the test.

    Each value is opened alone, and the other known values stand as known, with their covariance. Once a value has moved it is opened too,
    and the rest is asked again: else what it did would be found in its neighbours.
    """
    remaining = list(positions)
    count, moved = len(remaining), list[int]()
    out: dict[int, Shift] = {}
    while remaining:
        candidates = {k: _shift_by_model(a, k, moved) for k in remaining}
        chances = {k: _chance(a.weights, *one) for k, one in candidates.items()}
        corrected = dict(zip(remaining, holm(list(chances.values())), strict=True))
        first = min(remaining, key=chances.__getitem__)
        leave = [first] if corrected[first] < ALPHA else remaining
        out |= {k: _shift(a.weights, *candidates[k], corrected[k], count) for k in leave}
        moved, remaining = [*moved, first], [k for k in remaining if k not in leave]
    return [out[k] for k in positions]


def _shift(weights: Array, sizes: Array, errors: Array, chance: float, tests: int) -> Shift:
    """Return a shift s = sum w_m s_m, fitted form, averaged over noise models by `weights` w (models,), from their `sizes` and `errors` e.

    Its error is the root of sum w_m (e_m^2 + (s_m - s)^2): the scatter between models is included. `chance` is the shift's probability
    without a change [-], `tests` how many are looked at. Open, not a number, where some model with weight leaves it open.
    """
    if not np.isfinite(errors[weights > 0]).all():
        return Shift(math.nan, math.inf, math.nan, math.inf)
    size = float(weights @ sizes)
    wide = np.sqrt(errors**2 + (sizes - size) ** 2)
    return Shift(size, float(np.sqrt(weights @ wide**2)), chance, _detectable_shift(weights, wide, tests))


def estimate(data: Weighed, priors: Array, pulls: Array, inherited: Sequence[int], root: Array, moved: Sequence[int]) -> Array:
    """Return the Gauss-Newton step (unknowns,) of all unknowns, averaged over the noise models; inherited values that `moved` are free.

    `moved` counts within `inherited`; the other inherited values keep their prior of covariance root root'. Fitted form. With the columns
    C = [root's rows, unit vectors of the free] the step is ``C (C'(sum w_m I_m + P) C + diag(1, 0))^-1 C'(sum w_m s_m + pulls)``, of
    information I_m, scores s_m and weights w_m of the noise models, and the precision P of priors.
    """
    held = np.zeros((priors.shape[0], root.shape[1]))
    unmoved = [k for k in range(len(inherited)) if k not in moved]
    held[[inherited[k] for k in unmoved]] = root[unmoved]
    free = [k for k in range(priors.shape[0]) if k not in set(inherited)] + [inherited[k] for k in moved]
    columns = np.concatenate([held, np.eye(priors.shape[0])[:, free]], axis=1)
    whole = np.einsum("m,mij->ij", data.weights, data.information) + priors
    inner = columns.T @ whole @ columns + np.diag([1.0] * root.shape[1] + [0.0] * len(free))
    return np.asarray(columns @ symmetric_inverse(inner) @ columns.T @ (data.weights @ data.scores + pulls))


def normal_shifts(sizes: Array, errors: Array) -> list[Shift]:
    """Return shifts (values,) with Holm-adjusted probabilities and detectable sizes, from their sizes and standard errors (values,)."""
    one = np.ones(1)
    is_finite = [math.isfinite(e) and e > 0 for e in errors]
    chances = holm(
        [_chance(one, np.array([d]), np.array([e])) if t else math.nan for d, e, t in zip(sizes, errors, is_finite, strict=True)]
    )
    rows = zip(sizes, errors, chances, is_finite, strict=True)
    return [
        Shift(float(d), float(e), p, _detectable_shift(one, np.array([e]), len(is_finite)))
        if t
        else Shift(math.nan, math.inf, math.nan, math.inf)
        for d, e, p, t in rows
    ]


def together(a: Test, groups: Sequence[Sequence[int]], moved: Sequence[int] = ()) -> list[Together]:
    """Return the chi-square test of each group of values opened at once; other values in `moved` are free besides."""
    return [_chi_square(a.weights, *_opened(a, group, [k for k in moved if k not in group])[::2]) for group in groups]


def normal_together(sizes: Array, covariance: Array) -> Together:
    """Return the chi-square test d' V^+ d of shifts d (values,) with covariance V (values, values)."""
    return _chi_square(np.ones(1), sizes[None], covariance[None])


def _chi_square(weights: Array, scores: Array, spread: Array) -> Together:
    """Return the chi-square test T' V^+ T of scores T (models, values) with covariances V (models, values, values).

    It is averaged over noise models by `weights` (models,); directions of V below `RANK_TOLERANCE` of its largest do not count. [-]
    """
    from scipy.special import chdtrc, chdtri  # chi-squared; scipy.stats would take half a second to load

    size = np.sqrt(np.maximum(np.diagonal(spread, axis1=1, axis2=2), 1e-300))
    sizes, vectors = np.linalg.eigh(spread / size[:, :, None] / size[:, None, :])
    is_nonzero = (sizes > RANK_TOLERANCE * sizes[:, -1:]) & (sizes > 0)
    # T' V^+ T over the directions of V that count; chi-squared with as many degrees of freedom, averaged over the noise models
    along = np.einsum("mgr,mg->mr", vectors, scores / size) ** 2
    square = np.sum(np.where(is_nonzero, along / np.where(is_nonzero, sizes, 1.0), 0.0), axis=1)
    directions = int(np.median(is_nonzero.sum(axis=1)))
    chance = float(weights @ chdtrc(is_nonzero.sum(axis=1), square))
    return Together(float(chdtri(directions, max(chance, 1e-300))), directions, chance)


MOVED, NOT_REJECTED, UNDECIDED = "moved", "not rejected", "this log cannot decide"
DETECTABLE_SHIFT_SHARE = 0.1
"""A value is called not rejected only where a shift by this part of it would be found."""
MAX_STATED_ERRORS = 3.0
"""And only where it lies within so many of the errors that were stated of it."""
NONSENSE = 10.0
"""Shift, in parts of the value, above which what the logs alone say is not worth printing."""


@dataclass(frozen=True)
class Move:
    """One inherited value against its fit to the logs of this level alone.

    Parameters
    ----------
    path : str              Its path in the model of the level above.
    part : str              The part that it belongs to; empty for the model itself.
    stage : str             The stage that found it below.
    below, alone : float    As that stage found it, and by the logs of this level without its prior (of a joint fit: there); NaN where that
                            lies outside of its bounds, or farther away than derivatives reach. [SI]
    here : float            As this level uses it: fitted, or `below` where it is fixed. [SI]
    unit : str              For people.
    deviations : float      The shift over its standard error, of the fitted form; NaN where the logs say nothing of it. [-]
    chance : float          Of a shift of this size when nothing moved, corrected for the number of values tested. [-]
    detectable : float      Shift that the test finds with 90 % power; infinite where the logs say nothing of it. [SI]
    below_error : float     Standard error that it had there. [SI]
    below_random : float    The random part of it, which sets the digits that are printed. [SI]
    """

    path: str
    part: str
    stage: str
    below: float
    alone: float
    here: float
    unit: str
    deviations: float
    chance: float
    detectable: float
    below_error: float = math.nan
    below_random: float = math.nan

    remedy: ClassVar[str] = "Check contacts, radiation and powers that the part has only in the assembly, and lags and clocks of its logs."

    @property
    def verdict(self) -> str:
        """Moved, not rejected, or this log cannot decide."""
        if self.chance < ALPHA and self.is_determined:
            return MOVED
        near = abs(self.alone - self.below) <= MAX_STATED_ERRORS * self.below_error
        return NOT_REJECTED if near and self.detectable_share <= DETECTABLE_SHIFT_SHARE else UNDECIDED

    @property
    def detectable_share(self) -> float:
        """The detectable shift in parts of the value as it is in its unit; infinite where that is zero. [-]"""
        size = abs(from_si(self.below, self.unit)) * float(unit(self.unit).factor)
        return self.detectable / size if size > 0 else math.inf

    @property
    def printed(self) -> str:
        """The value below with the digits that its own stage prints."""
        return digits(from_si(self.below, self.unit), self.below_random / float(unit(self.unit).factor))

    @property
    def power(self) -> str:
        """Which shift would be found with 90 % power, in words."""
        share = self.detectable_share
        if share <= NONSENSE:
            return f"a shift of {short(100 * share, 2)} % would be found with 90 % power"
        if self.detectable_share == math.inf and math.isfinite(self.detectable):
            amount = self.detectable / float(unit(self.unit).factor)
            return f"a shift of {short(amount, 2)} {'K' if unit(self.unit).offset else self.unit} would be found with 90 % power"
        return "this log does not determine the value"

    def __str__(self) -> str:
        """Return one line."""
        if not self.is_determined:
            return f"{self.path}  {self.printed} {self.unit}: {self.verdict}; {self.power}"
        far = f"{abs(self.deviations):.1f} standard errors"
        if math.isnan(self.alone):
            side = "up" if self.deviations > 0.0 else "down"
            where = "this log alone puts it outside its bounds, or so far off that it does not determine the value"
            return f"{self.path}  {self.printed} {self.unit}: {self.verdict}, {far} {side}; {where}"
        low, high = from_si(self.below, self.unit), from_si(self.alone, self.unit)
        change = 100 * (high / low - 1) if low else 0.0
        share = (f" ({change:+.0f} %)" if abs(change) >= 10 else f" ({change:+.2g} %)") if low else ""
        return f"{self.path}  {self.printed} -> {high:.4g} {self.unit}{share}: {self.verdict}, {far}; {self.power}"

    @property
    def is_determined(self) -> bool:
        """Whether the logs determine it: the shift that they would find with 90 % power is at most `NONSENSE` times the value."""
        return math.isfinite(self.deviations) and self.detectable_share <= NONSENSE


@dataclass(frozen=True)
class MovedGroup:
    """Several parameters together: a part, or all that was inherited.

    Parameters
    ----------
    name : str              What they are.
    paths : tuple of str    Their paths.
    chi_square : float      Squared distance, in standard errors, all correlations included. [-]
    directions : int        How many of their combinations this level says anything of.
    chance : float          Of such a distance when nothing moved, corrected for the number of parts. [-]
    fine : bool             Whether none of its values is rejected by a test that would find a shift of a tenth.
    """

    name: str
    paths: tuple[str, ...]
    chi_square: float
    directions: int
    chance: float
    fine: bool = False

    @property
    def verdict(self) -> str:
        """Moved, not rejected, or this log cannot decide."""
        return MOVED if self.chance < ALPHA else NOT_REJECTED if self.fine else UNDECIDED

    def __str__(self) -> str:
        """Return one line."""
        if not self.directions:
            return f"{self.name}: {self.verdict}"
        many = f"{self.directions} degree{'s' if self.directions > 1 else ''} of freedom"
        return f"{self.name}: {self.verdict}, chi-square {short(self.chi_square, 3)} for {many} (chance {short(self.chance)})"


@dataclass(frozen=True)
class Moves:
    """All that was inherited from stages below, tested against the logs of this level, value by value and part by part.

    Parameters
    ----------
    values : tuple of Move
    groups : tuple of MovedGroup
    by : str                    What the values are compared with, for people.
    """

    values: tuple[Move, ...] = ()
    groups: tuple[MovedGroup, ...] = ()
    by: str = "the logs of this stage alone"

    def __bool__(self) -> bool:
        """Whether anything was inherited."""
        return bool(self.values)

    def __getitem__(self, path: str) -> Move:
        """Return the move of a parameter."""
        return next(m for m in self.values if m.path == path)

    @property
    def moved(self) -> tuple[str, ...]:
        """Names of the parameters and groups that moved."""
        return tuple(m.path for m in self.values if m.verdict == MOVED) + tuple(g.name for g in self.groups if g.verdict == MOVED)

    def lines(self) -> Iterator[str]:
        """Yield it as text, a line each."""
        if self:
            yield f"  values of the stages below -> by {self.by}:"
            yield from (f"    {line}" for line in (*self.values, *self.groups))

    def contradictions(self) -> list[str]:
        """Return in words what the stages below found of each value that moved, and what these logs say, the furthest first."""
        far = sorted((m for m in self.values if m.verdict == MOVED), key=lambda m: -abs(m.deviations))
        return [
            f"{m.path}, {m.printed} {m.unit} from stage '{m.stage}', "
            + (f"would be {from_si(m.alone, m.unit):.4g} {m.unit} by this stage's logs" if math.isfinite(m.alone) else "is refuted")
            + f", {abs(m.deviations):.1f} standard errors away"
            for m in far
        ]

    def warnings(self) -> list[str]:
        """Return a remark where values moved, parts of which no single value did, or all of them together."""
        alone = {m.path: f"{m.path} ({m.deviations:+.1f} standard errors)" for m in self.values if m.verdict == MOVED}
        moved = [g for g in self.groups if g.verdict == MOVED and not alone.keys() & {*g.paths}]
        parts = [g for g in moved if g is not self.groups[-1]]  # the last one is all together
        far = [*alone.values(), *(f"{g.name} ({some(g.paths, 'values')}; chance {short(g.chance)})" for g in parts or moved)]
        if not far:
            return []
        return [
            f"significantly different from the stage below: {some(far, 'values')}. The parts behave differently in the assembly than "
            f"alone, or the stage below lacked physics. {Move.remedy}"
        ]


MAX_LOG_CHANGE = 1.5
"""Logarithm of the factor by which a value changes at most before derivatives are taken again."""
STRETCHES_PER_TRACE = 160
"""Stretches of a trace, whose errors count what happens within minutes."""


def part_of(model: Model, path: str) -> str:
    """Return the path of the deepest submodel that a parameter belongs to; empty for the model itself."""
    head, _, rest = path.partition(".")
    if not rest or head not in model.submodels:
        return ""
    inner = part_of(model.submodels[head].model, rest)
    return f"{head}.{inner}" if inner else head


@dataclass(frozen=True, eq=False)
class _Inherited:
    """Values that a fit's unknowns inherit from the stages below, those opened for the test among them.

    Parameters
    ----------
    at : tuple of int               Their positions among the unknowns; instruments that were found with them too.
    states : tuple of State         As their stages have them; None for an instrument.
    mean : array (at,)              Where their stages expect them, in the fitted form of the unknowns.
    root : array (at, sources)      Root of their covariance, in the fitted form of the unknowns.
    """

    at: tuple[int, ...]
    states: tuple[State | None, ...]
    mean: Array
    root: Array


def _fixed_values(request: Request, problem: Problem) -> dict[tuple[str, ...], State]:
    """Return inherited values that a fit keeps fixed: paths where a value acts -> its state.

    Left out are values without a known error, those that are unknowns of the fit, and those that have a prior. Paths of instances that
    share one part and one value are one key.
    """
    here, shared = covering(problem.unknowns), request.shared
    groups: dict[tuple[frozenset[str], float], tuple[State, list[str]]] = {}
    for s in request.store.parameters.values():
        acts = [p for p in s.acts if p not in here]
        if s.known and acts and s.path not in request.prior:
            one = frozenset(shared.get(acts[0], (acts[0],)))
            groups.setdefault((one, s.value), (s, []))[1].extend(acts)
    return {tuple(dict.fromkeys(acts)): s for s, acts in groups.values()}


def _inherited(request: Request, opened: Opened, fixed: Mapping[tuple[str, ...], State]) -> _Inherited:
    """Return mean (inherited,) and responses (inherited, sources), fitted form, of the inherited unknowns of a fit and of `fixed` values.

    Rows of fixed values, opened beside them, come last; zero by sources that a fit knows of copies alone.
    """
    unknowns, store = opened.problem.unknowns, request.store
    before = known_before(request, unknowns[: opened.own])
    moving = {q: store.states[p] for p in request.prior for q in store.states[p].acts}
    unknowns_before = [unknowns[k] for k in before.at]
    states = [next((moving[n] for n in (u.name, *u.also) if n in moving), None) if u.kind == "parameter" else None for u in unknowns_before]
    named = {group[0]: s for group, s in fixed.items()}
    at, rows = [int(k) for k in before.at], list(before.rows)
    for k, u in enumerate(unknowns[opened.own :], start=opened.own):
        state = named[u.name]
        row = store.rows([state.path])[0] * form(state, u)
        at.append(k)
        states.append(state)
        rows.append(np.concatenate([row, np.zeros(before.rows.shape[1] - row.size)]))
    mean = np.array([*before.mean, *(u.to_fitted(named[u.name].value) for u in unknowns[opened.own :])])
    return _Inherited(tuple(at), tuple(states), mean, np.array(rows).reshape(len(at), before.rows.shape[1]))


def moves_above(request: Request, problem: Problem, minimum: Fit, level: float = 1.0) -> Moves:
    """Return whether the logs of a fit contradict its inherited values, fixed or with priors: the move of each and its probability.

    Each value is opened without its prior in one step of Gauss and Newton from the end of the fit, by generalised least squares: traces
    are white noise plus an autocorrelated deviation, averaged over what their residuals allow (`weighed`). Unknowns of the fit that were
    not inherited stay free; the other inherited values count with their errors. Where a value moved, the step is taken again from where
    it led, since the model is not a straight line over so long a way. `level` is the variance of the noise of traces that are too short
    to show it, in squares of what was stated.
    """
    fixed = _fixed_values(request, problem)
    if not (fixed or request.prior):
        return Moves()
    opened = opened_at(request, problem, minimum.fitted, list(fixed))
    inherited = _inherited(request, opened, fixed)
    first, ahead = _test_moves(request, opened, inherited, opened.fitted, level)
    if MOVED not in [m.verdict for m in first.values]:
        return first
    try:
        return _test_moves(request, opened, inherited, ahead, level)[0]
    except (ScenarioError, SolverError):
        return first


def _test_moves(request: Request, opened: Opened, inherited: _Inherited, at: Array, level: float) -> tuple[Moves, Array]:
    """Return the moves of inherited values, and the unknowns (unknowns,) after one Gauss-Newton step (`estimate`) that frees the moved.

    Residuals are measured less what the model says, in units of the noise, at the start r(at) + J (start - at) with the derivatives J at
    `at` (unknowns,), fitted form. The step starts from the fitted values, for those that are inherited from where the stages below expect
    them, and is kept within the bounds, logarithms within `MAX_LOG_CHANGE`. `level` is that of `moves_above`.
    """
    unknowns = opened.problem.unknowns
    start = opened.fitted.copy()
    start[list(inherited.at)] = inherited.mean
    pieces = Binned.of_problem(opened.problem, at, request.loss, request.loss_scale, STRETCHES_PER_TRACE)
    here = [replace(b, mean=b.mean + b.slopes @ (start - at)) for b in pieces.values()]
    priors, pulls = _other_priors(opened.problem, start, inherited.at)
    data = weighed(here, priors, pulls, level)
    test = Test.of_unknowns(data, priors, pulls, inherited.at, inherited.root)
    state_of_position = {k: s for k, s in enumerate(inherited.states) if s is not None}
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in unknowns), strict=True))
    values = []
    for (k, state), s in zip(state_of_position.items(), shifts(test, list(state_of_position)), strict=True):
        u, there = unknowns[inherited.at[k]], inherited.at[k]
        end, used = float(start[there] + s.size), u.to_value(opened.fitted[there])
        # by this value alone, where derivatives taken at `at` hold
        reach = MAX_LOG_CHANGE if u.log else NONSENSE * max(abs(at[there]), u.scale)
        alone = u.to_value(end) if low[there] <= end <= high[there] and abs(end - at[there]) <= reach else math.nan
        below = (u.to_value(start[there]), float(np.linalg.norm(inherited.root[k])) * u.slope(start[there]), state.random)
        values.append(_move(u.name, part_of(request.model, u.name), state.origin.stage or state.origin.kind, below, alone, used, u, s))
    rows = {m.path: k for m, k in zip(values, state_of_position, strict=True)}
    far = [rows[m.path] for m in values if m.verdict == MOVED]
    groups = _groups(values, lambda several: together(test, [[rows[p] for p in g] for g in several], far))
    step = estimate(data, priors, pulls, inherited.at, inherited.root, far)
    inside = np.array([MAX_LOG_CHANGE if u.log else math.inf for u in unknowns])
    return Moves(tuple(values), groups), np.clip(start + np.clip(step, -inside, inside), low, high)


def _other_priors(problem: Problem, start: Array, inherited: Sequence[int]) -> tuple[Array, Array]:
    """Return information 1 / sd^2 (unknowns, unknowns), fitted form, and scores (mean - start) / sd^2 of priors that are not inherited."""
    info, pulls = np.zeros((start.size, start.size)), np.zeros(start.size)
    for k, u in enumerate(problem.unknowns):
        if u.prior is not None and k not in inherited:
            info[k, k] = u.prior.sd**-2
            pulls[k] = (u.prior.mean - start[k]) * u.prior.sd**-2
    return info, pulls


def _move(
    path: str, part: str, stage: str, below: tuple[float, float, float], alone: float, here: float, of: Unknown | FittedValue, s: Shift
) -> Move:
    """Return the move of a value; `below` is (value, error, random error) of the stage below [SI].

    The detectable shift d of a logarithm becomes |value| (exp(d) - 1).
    """
    value, error, random = below
    detectable = (abs(value) * math.expm1(min(s.detectable, 50.0)) if of.log else s.detectable) if math.isfinite(s.size) else math.inf
    far = s.size / s.error if s.error > 0 else math.nan
    return Move(path, part, stage, value, alone, here, of.unit, far, s.chance, detectable, error, random)


def moves_from(staged: Sequence[tuple[FittedValues, Mapping[str, str]]], joint_values: FittedValues, place: Callable[[str], str]) -> Moves:
    """Return how far a joint fit moved the values of the stages, with a Hausman test of each.

    Parameters
    ----------
    staged : sequence       Per stage its values, and path there -> path in the joint fit.
    joint_values : FittedValues  The joint fit's.
    place : callable        Path in the joint fit -> the part that it belongs to.

    The covariance of a shift is that of the stage less that of the joint fit, which holds the stage's data too (Hausman, as above). In
    directions where the joint fit knows little more than the stage (which took other values for exact, or met smaller residuals) the
    stage's own covariance is the measure.
    """
    order = list(joint_values)
    shift, spread = np.zeros(len(order)), np.zeros((len(order), len(order)))
    pairs = [(stage, stage[path], q) for stage, names in staged for path, q in names.items()]
    for stage, names in staged:
        stage_paths = list(stage)
        at, there = [stage_paths.index(p) for p in names], [order.index(q) for q in names.values()]
        below = stage.covariance[np.ix_(at, at)]
        spread[np.ix_(there, there)] = _covariance_difference(below, joint_values.covariance[np.ix_(there, there)])
    for _, before, q in pairs:
        here = joint_values[q]
        shift[order.index(q)] = math.log(here.value / before.value) if here.log else here.value - before.value
    rows = [order.index(q) for *_, q in pairs]
    values = []
    for (stage, before, q), s in zip(pairs, normal_shifts(shift[rows], np.sqrt(np.diag(spread))[rows]), strict=True):
        before_and_errors, here = (before.value, before.error, before.error_random), joint_values[q]
        values.append(_move(q, place(q), stage.stage, before_and_errors, here.value, here.value, here, s))

    places = {p: k for k, p in enumerate(order)}
    groups = _groups(
        values,
        lambda several: [normal_together(shift[at], spread[np.ix_(at, at)]) for at in ([places[p] for p in g] for g in several)],
    )
    return Moves(tuple(values), groups, "the joint fit")


def moved_instruments(before: Store, after: Store) -> MovedGroup:
    """Return a chi-square test whether the constant errors of instruments from two fits to different logs agree.

    Parameters
    ----------
    before, after : Store    What each fit knows; the second one knew nothing of the instruments but what is stated of them.

    The error of a change is that of the responses of both results to their sources of error, each of which counts once (Hausman, as above).
    """
    names = [p for p, s in after.states.items() if s.kind != "parameter" and s.known and p in before.states and before.states[p].known]
    places = {name: k for k, name in enumerate(dict.fromkeys(s.name for store in (before, after) for s in store.sources))}
    root = np.zeros((len(names), len(places)))
    for store, sign in ((after, 1.0), (before, -1.0)):
        root[:, [places[s.name] for s in store.sources]] += sign * store.rows(names)
    sizes = np.array([after[n].fitted - before[n].fitted for n in names])
    test = normal_together(sizes, root @ root.T) if names else Together(0.0, 0, math.nan)
    words = (f"{n} {size:+.2g}{'' if after[n].unit == '1' else f' {after[n].unit}'}" for n, size in zip(names, sizes, strict=True))
    return MovedGroup("instruments", tuple(words), test.chi_square, test.directions, test.chance)


def _covariance_difference(below: Array, here: Array) -> Array:
    """Return `below` - `here`, both covariances (values, values), fitted form; of directions with less than a tenth of it left, `below`.

    Directions are those of the shares of the variance below that stand here: eigenvectors of L^-1 here L'^-1, below = L L'.
    """
    root = np.linalg.cholesky(below)
    half = np.linalg.solve(root, here)
    # below = L L'; the eigenvalues of L^-1 here L^-T are the shares of the variance below that are left here
    sizes, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
    along = root @ vectors
    return np.asarray((along * np.where(sizes < 0.9, 1.0 - sizes, 1.0)) @ along.T)


def _groups(values: Sequence[Move], test: Callable[[Sequence[Sequence[str]]], list[Together]]) -> tuple[MovedGroup, ...]:
    """Return one group per part with several values, and one of all values; none for a part that has all of them.

    `test` takes the paths of each group and returns its chi-square, directions and probability. Values without a finite deviation are left
    out of it. Probabilities of the parts are adjusted for their number by Holm's method.
    """
    parts: dict[str, list[Move]] = {}
    for m in values:
        parts.setdefault(m.part, []).append(m)
    several = {part: moves for part, moves in parts.items() if 1 < len(moves) < len(values)}
    named = [(f"part '{part}'" if part else "the model's own", moves) for part, moves in several.items()]
    every = [*named, *([("all together", list(values))] if len(values) > 1 else [])]
    determined = [[m.path for m in moves if math.isfinite(m.deviations)] for _, moves in every]
    tests = iter(test([paths for paths in determined if paths]))
    tests_of_groups = [next(tests) if paths else Together(0.0, 0, math.nan) for paths in determined]
    chances = [*holm([t.chance for t in tests_of_groups[:-1]]), *(t.chance for t in tests_of_groups[-1:])]
    return tuple(
        MovedGroup(name, tuple(m.path for m in moves), t.chi_square, t.directions, p, all(m.verdict == NOT_REJECTED for m in moves))
        for (name, moves), t, p in zip(every, tests_of_groups, chances, strict=True)
    )
