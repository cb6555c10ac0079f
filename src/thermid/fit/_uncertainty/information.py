"""Information: what readings and priors hold about the unknowns of a fit, and the consider covariance of what it held fixed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from thermid.base.errors import SolverError
from thermid.base.linear_algebra import RANK_TOLERANCE, covariance, scaled
from thermid.base.units import Array, Bools
from thermid.fit._minimisation import Fit, finite
from thermid.fit._problem.gather import build_problem, problem_of
from thermid.fit._problem.request import Request, form, known_before
from thermid.fit._problem.residuals import Problem, Unknown
from thermid.model.tree import ParameterSet
from thermid.simulation.runs import Options
from thermid.values.store import Normal, Source, State, rooted

EXACT = Options(error=2e-8, inputs=1e-3)
"""Tight enough that a direction without information shows as such and not as the integrator's error.

How closely a noisy input is followed does not matter for that, and following it to 1e-7 K can take the integrator millions of steps.
"""


@dataclass(frozen=True, eq=False)
class Information:
    """Rows of weighted derivatives in the fitted form of the unknowns: rows' rows is the information matrix.

    Prior rows R'R are parted exactly, R triangular with parameters first: `nuisance` alone is what priors state of the other unknowns,
    whatever the parameters are.

    Parameters
    ----------
    unknowns : tuple of Unknown
    at : array (unknowns,)                  Values where the derivatives were taken, in the fitted form.
    data : array (rows, unknowns)           Of the readings.
    nuisance : array (rows, unknowns)       Of the priors of constant errors and of local values, joint ones too: zero for parameters.
    given : array (rows, unknowns)          Of the priors of parameters, own and inherited, beside those of the others.
    """

    unknowns: tuple[Unknown, ...]
    at: Array
    data: Array
    nuisance: Array
    given: Array

    @classmethod
    def of_problem(cls, problem: Problem, fitted: Array, spread: float = 1.0, exact: bool = True) -> Information:
        """Return the information that a problem holds at `fitted` (unknowns,), by default from the integration of `EXACT`.

        Readings scatter `spread` times as much as their noise says.
        """
        tight = replace(problem, options=EXACT) if exact else problem
        rows = problem.prior_rows(fitted)[1]
        first = [k for k, u in enumerate(problem.unknowns) if u.kind == "parameter" and rows[:, k].any()]
        order = [*first, *(k for k in range(rows.shape[1]) if k not in first)]
        # R of QR with parameters first: below their rows it holds the marginal information of the others, also of a joint prior
        upper = np.asarray(np.linalg.qr(rows[:, order], mode="r"))[:, np.argsort(order)]
        return cls(problem.unknowns, fitted, tight.compressed(fitted).slopes / spread, upper[len(first) :], upper[: len(first)])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return tuple(u.name for u in self.unknowns)

    @property
    def parameters(self) -> tuple[int, ...]:
        """Positions of the parameters."""
        return tuple(k for k, u in enumerate(self.unknowns) if u.kind == "parameter")

    @property
    def values(self) -> Array:
        """Values (unknowns,). [SI]"""
        return np.array([u.to_value(float(x)) for u, x in zip(self.unknowns, self.at, strict=True)])

    @property
    def slopes(self) -> Array:
        """Derivatives (unknowns,) of the values with respect to their fitted form."""
        return np.array([u.slope(float(x)) for u, x in zip(self.unknowns, self.at, strict=True)])

    @property
    def sizes(self) -> Array:
        """What a relative change (unknowns,) is taken of, in the fitted form: 1 for a logarithm, the value or a typical change else."""
        return np.array([1.0 if u.log else abs(float(x)) or u.scale for u, x in zip(self.unknowns, self.at, strict=True)])

    @property
    def rows(self) -> Array:
        """All rows: readings and priors."""
        return np.concatenate([self.data, self.nuisance, self.given])

    @property
    def alone(self) -> Array:
        """Relative error (unknowns,) that each would have with all others known. [-]"""
        length = np.linalg.norm(self.rows, axis=0)
        return np.asarray(np.divide(1.0, length * self.sizes, out=np.full(length.size, np.inf), where=length > 0))

    def prior_row(self, k: int, relative: float) -> Array:
        """Return the row (1, unknowns) of a prior on one unknown, its standard deviation relative to its value."""
        row = np.zeros((1, len(self.unknowns)))
        row[0, k] = 1.0 / (relative * self.sizes[k])
        return row

    def covariance(self, held: Sequence[int] = (), more: Array | None = None) -> Array:
        """Return the covariance (unknowns, unknowns), fitted form, unknowns in positions `held` known; infinite where nothing is known.

        `more` are further rows (rows, unknowns), such as of `prior_row`.
        """
        rows = self.rows if more is None else np.concatenate([self.rows, more])
        free = [k for k in range(len(self.unknowns)) if k not in held]
        out = np.zeros((len(self.unknowns),) * 2)
        out[np.ix_(free, free)] = covariance(rows[:, free])
        return out

    def errors(self, held: Sequence[int] = (), more: Array | None = None) -> Array:
        """Return the relative standard error (unknowns,). [-]"""
        return np.asarray(np.sqrt(np.diag(self.covariance(held, more))) / self.sizes)

    def rank(self) -> int:
        """How many independent facts about the parameters the readings hold, what constant errors may do taken off."""
        rows = np.concatenate([self.data, self.nuisance])
        others = [k for k in range(rows.shape[1]) if k not in self.parameters]
        return rank(rows[:, list(self.parameters)], rows[:, others])

    def elsewhere(self, problem: Problem, spread: float = 1.0) -> Information | None:
        """Return the information with every parameter shifted, by 0.1 to 0.3 of its size, each by another part, away from the nearer bound.

        `spread` as of `Information.of_problem`; other unknowns stay. At most half the way to the bound; None where the model cannot be run.

        What binds parameters by law binds them there too; an accident of the first values does not.
        """
        # no two shifts alike, or a sum would look like a product
        shift = (0.1 + 0.2 * (0.618034 * np.arange(len(self.unknowns)) % 1.0)) * self.sizes
        moved = self.at.copy()
        for k in self.parameters:
            low, high = self.unknowns[k].fitted_bounds()
            room = high - self.at[k] > self.at[k] - low
            step = min(shift[k], 0.5 * max(high - self.at[k], self.at[k] - low))
            moved[k] += step if room else -step
        try:
            return Information.of_problem(problem, moved, spread)
        except SolverError:
            return None


@dataclass(frozen=True, eq=False)
class Opened:
    """The residuals of a fit with some of its fixed values among the unknowns.

    Parameters
    ----------
    problem : Problem           Its unknowns are those of the fit, in their order, and then the opened ones.
    fitted : array (unknowns,)  Where the fit ended, in the fitted form; what it took as fixed stands where it stood.
    own : int                   How many unknowns the fit itself had.
    """

    problem: Problem
    fitted: Array
    own: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the opened values, in the order of their columns."""
        return tuple(u.name for u in self.problem.unknowns[self.own :])


def opened_at(
    request: Request,
    problem: Problem,
    fitted: Array,
    groups: Sequence[Sequence[str]],
    *,
    instruments: bool = False,
    values_before: Mapping[str, float] | None = None,
) -> Opened:
    """Return the residuals of a fit with some of its fixed values opened, at the values at which it ended.

    Parameters
    ----------
    request : Request       What the fit was asked.
    problem : Problem       Its residuals, with the noise that was used.
    fitted : array          Where it ended, in the fitted form.
    groups : sequence       The fixed values, each as the paths where it acts; the first one names it. What is an unknown of the fit, or is
                            derived from others in its model, is left out: see `Opened.names`. A path with another value does not act.
    instruments : bool      Whether constant errors of instruments that the fit took as fixed are opened too.
    values_before : dict    Name -> value [SI] of what is opened, where it is not the one in the model.
    """
    experiments = problem.experiments
    if instruments:
        request = replace(request, held_bias={}, held_errors=None)
        experiments = build_problem(request).experiments
    position = {u.name: k for k, u in enumerate(problem.unknowns)}
    acting = {p for u in problem.unknowns if u.kind == "parameter" for p in (u.name, *u.also)}
    parameters = experiments[0].network.flat.parameters
    free = [[p for p in group if p not in acting] for group in groups]
    chosen = [_alike(parameters, rest) for rest, group in zip(free, groups, strict=True) if rest[:1] == list(group[:1])]
    wider = problem_of(request, experiments, [group for group in chosen if group])
    of = {u.name: u for u in wider.unknowns}
    unknowns = [*(of[name] for name in position), *(u for u in wider.unknowns if u.name not in position)]
    more = [u.to_fitted((values_before or {}).get(u.name, u.start)) for u in unknowns[len(position) :]]
    problem_opened = Problem(wider.experiments, tuple(unknowns), problem.noise, problem.options, wider.fixed_bias, problem.coupled)
    return Opened(problem_opened, np.concatenate([fitted, more]), len(position))


def _alike(parameters: ParameterSet, group: Sequence[str]) -> tuple[str, ...]:
    """Return those paths of a group that state one number here, that of its first path to 1e-9.

    None where the first one is derived from others, or is not in these parameters.
    """
    table = parameters.table
    here = [p for p in group if p in table and table[p].parameter.is_literal]
    if here[:1] != list(group[:1]):
        return ()
    values = parameters.evaluate({}, here)
    return tuple(p for p in here if math.isclose(values[p], values[here[0]], rel_tol=1e-9))


def opened_jacobian(at: Opened, loss: str = "linear", loss_scale: float = 1.0) -> tuple[Array, Array]:
    """Return the derivatives of the weighted residuals with respect to the fit's own unknowns and to the opened values.

    Both have the same rows, in as few as hold the same information (`Fit.jacobian`); the weights of a robust loss are in them. With A and B
    the two, an error dq of the opened values moves the fit by ``-C A'B dq``, C the covariance that its weights stand for.
    """
    jacobian = Fit.ended(at.problem, at.fitted, loss, loss_scale).jacobian
    return jacobian[:, : at.own], jacobian[:, at.own :]


STANDARD = Normal()


@dataclass(frozen=True, eq=False)
class Responses:
    """What the errors of a fit come from.

    Parameters
    ----------
    rows : array (unknowns, sources)    Responses to what was known before, in the fitted form.
    sources : tuple of Source           What they respond to.
    noise : array (unknowns, unknowns)  Covariance by the noise of the readings, and by what is known of single records.
    unlimited : array (unknowns,)       Which unknowns the data say nothing of.
    uncut : array (unknowns,)           Variances as they were without bounds; empty where nothing was cut.
    """

    rows: Array
    sources: tuple[Source, ...]
    noise: Array
    unlimited: Bools
    uncut: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def total(self) -> Array:
        """The covariance (unknowns, unknowns), fitted form: rows rows' + noise, what was fixed counted as consider covariance.

        Infinite variances stand alone, with covariances of zero.
        """
        out = self.rows @ self.rows.T + self.noise
        out[self.unlimited, :] = out[:, self.unlimited] = 0.0
        out[self.unlimited, self.unlimited] = np.inf
        return np.asarray(out)

    def between(self, unknowns: Sequence[Unknown], fitted: Array) -> Responses:
        """Return the responses with the variance of every parameter cut to what its bounds leave, and `uncut` set to the variances before.

        The responses and noise of an unknown j lose C_jk / C_kk (1 - sqrt(v / C_kk)) of those of the parameter k that is cut from C_kk to
        v by `square_between`, so what goes together with it follows. C is the covariance at that time.

        The one of which most is cut off comes first, whatever the order of the unknowns.
        """

        def share(k: int, variance: float) -> float:
            """Return what the bounds of an unknown leave of a variance of it. [-]"""
            return square_between(unknowns[k], float(fitted[k]), variance) / variance

        variances = np.diag(self.total)
        bounded = [k for k, u in enumerate(unknowns) if u.kind == "parameter" and not self.unlimited[k] and variances[k] > 0.0]
        out = replace(self, uncut=variances)
        for k in sorted(bounded, key=lambda k: share(k, float(variances[k]))):
            column = out.total[:, k]
            inside = column[k] * share(k, float(column[k]))
            if inside < column[k]:
                moved = np.eye(len(unknowns))
                moved[:, k] -= np.where(self.unlimited, 0.0, column) / column[k] * (1.0 - math.sqrt(inside / column[k]))
                out = replace(out, rows=moved @ out.rows, noise=moved @ out.noise @ moved.T)
        return out

    def with_noise(self, positions: list[int], key: str, words: str) -> tuple[Array, tuple[Source, ...]]:
        """Return the rows of some unknowns with columns for their noise, named by the key of the stage and a number."""
        noise_columns, sources = rooted(self.noise[np.ix_(positions, positions)], key, words)
        return np.concatenate([self.rows[positions], noise_columns], axis=1), (*self.sources, *sources)


def responses(
    request: Request,
    problem: Problem,
    minimum: Fit,
    level: float,
    random: Array,
    weights: Array,
    ranges: Sequence[tuple[Source, Array]] = (),
) -> Responses:
    """Return what the errors of a fit come from.

    With A and B the derivatives of the weighted residuals with respect to what was looked for and what was fixed, P the covariance of the
    priors and ``C = (A'A / level + P^-1)^-1``, an error of the priors moves the result by ``C P^-1`` times itself, one of what was fixed
    by ``-C A'B / level`` (consider covariance: Tapley, Schutz, Born, Statistical Orbit Determination, 2004, ch. 6).

    Parameters
    ----------
    level : float       Variance of residuals that do not wander, in squares of the noise.
    random : array      Covariance by the scatter of the residuals; see `covariances`.
    weights : array     C.
    ranges : sequence   Sources of fixed values that are known within a stated range, and all that the unknowns (unknowns,) answer to each.
    """
    unknowns = problem.unknowns
    unlimited = ~np.isfinite(np.diag(weights))
    gain, noise = finite(weights), finite(random)
    before = known_before(request, unknowns)
    table = _Table()
    if before.at.size:
        root = before.root
        elsewhere = ~np.isin([s.name for s in before.sources], [source.name for source, _ in ranges])
        table.add(before.sources, gain[:, before.at] @ (root.T @ root) @ (before.rows * elsewhere))
    below = set(before.at.tolist())
    for k, u in enumerate(unknowns):
        if u.prior is None or (k in below and u.kind != "parameter"):
            continue
        prior_column = gain[:, [k]] / u.prior.sd
        if u.kind == "local":
            noise = noise + prior_column @ prior_column.T
        else:
            table.add((_stated(request, u),), prior_column)
    held = _fixed(request, unknowns)
    if held and unknowns:
        _consider(table, request, problem, minimum, held, gain / level)
    for source, column in ranges:
        if column.any():
            table.add((source,), column[:, None])
    rows = np.array(list(table.columns.values())).reshape(len(table.columns), len(unknowns)).T
    return Responses(rows, tuple(table.sources.values()), noise, unlimited).between(unknowns, minimum.fitted)


EVEN_FROM = 100.0
"""Standard deviation in ranges from which a normal law is even over the range, to 1e-5. [-]"""


def square_between(u: Unknown, fitted: float, variance: float) -> float:
    """Return the mean square by which an unknown may lie from where it was found, given that it lies between its bounds; fitted form.

    Of the normal distribution about it with a variance, what lies beyond a bound is cut off: at a bound a third of the square of the range
    is the most. The moments are those of `thermid.values.store.Normal`.
    """
    low, high = (float(end) - fitted for end in u.fitted_bounds())
    if not (0.0 < variance < math.inf and 0.0 < high - low < math.inf):
        return variance
    law = Normal(0.0, min(math.sqrt(variance), EVEN_FROM * (high - low)))
    share = law.below(high) - law.below(low)
    return min(variance, law.moments(low, high)[1] / share) if share > 0.0 else variance


@dataclass
class _Table:
    """Columns of responses by the name of their source; what answers to one source twice is added."""

    sources: dict[str, Source] = field(default_factory=dict)
    columns: dict[str, Array] = field(default_factory=dict)

    def add(self, sources: Sequence[Source], rows: Array) -> None:
        """Add responses (unknowns, sources) to the columns of their sources."""
        for source, column in zip(sources, rows.T, strict=True):
            self.sources[source.name] = source
            self.columns[source.name] = self.columns.get(source.name, 0.0) + column


def _stated(request: Request, u: Unknown) -> Source:
    """Return the source that the stated prior of an unknown is; that of an instrument is one and the same in every stage."""
    if u.kind == "parameter":
        words = f"prior of {u.name}, stated in {request.name or request.model.title}"
        return Source(f"{request.fit_key[:16]}:prior of {u.name}", "stated", STANDARD, words)
    return Source(f"accuracy: {u.name}", "instrument", STANDARD, f"stated accuracy, {u.name}")


def covering(unknowns: tuple[Unknown, ...] | list[Unknown]) -> set[str]:
    """Return every path and instrument that a fit looks for, instances that share a value among them."""
    return {n for u in unknowns if u.kind != "local" for n in (u.name, *u.also)}


def _fixed(request: Request, unknowns: tuple[Unknown, ...]) -> list[State]:
    """Return the states of values that are known with an error and are no unknowns of the fit."""
    here, store = covering(unknowns), request.store
    return [
        s
        for s in store.states.values()
        if s.known and store.rows([s.path]).any() and (set(s.acts) - here if s.kind == "parameter" else s.path not in here)
    ]


def _consider(table: _Table, request: Request, problem: Problem, minimum: Fit, fixed: list[State], gain: Array) -> None:
    """Add the responses to the errors of what was fixed; an instrument of which nothing is known counts with its accuracy.

    A fixed value that is off by d moves the unknowns by -G J'K d (Schmidt's consider filter), J the derivatives of the weighted residuals
    by the unknowns, K those by what was fixed, and `gain` G (unknowns, unknowns) the inverse of the information, all in the fitted form.
    """
    here = covering(problem.unknowns)
    groups = {s.path: tuple(p for p in s.acts if p not in here) for s in fixed if s.kind == "parameter"}
    named = {group[0]: request.store[path] for path, group in groups.items()} | {s.path: s for s in fixed if s.kind != "parameter"}
    instruments = bool(request.held_bias) or request.held_errors is not None
    opened = opened_at(request, problem, minimum.fitted, list(groups.values()), instruments=instruments)
    own_jacobian, other = opened_jacobian(opened, request.loss, request.loss_scale)
    moves = -gain @ own_jacobian.T @ other
    for k, u in enumerate(opened.problem.unknowns[opened.own :]):
        if u.name in named:
            row = request.store.rows([named[u.name].path])[0] * form(named[u.name], u)
            table.add(request.store.sources, np.outer(moves[:, k], row))
        elif u.prior is not None:
            table.add((_stated(request, u),), moves[:, [k]] * u.prior.sd)


def rank(rows: Array, beside: Array | None = None) -> int:
    """Return the rank [-] of rows (rows, unknowns) to `RANK_TOLERANCE`, each column at unit length.

    `beside` (rows, others) are the columns of unknowns that are open too: what they can compensate is taken off.
    """
    part = scaled(rows)[0][: len(rows)]
    largest = float(np.linalg.norm(part, 2)) if part.size else 0.0
    if beside is not None and beside.shape[1]:
        basis, s, _ = np.linalg.svd(scaled(beside)[0][: len(rows)], full_matrices=False)
        basis = basis[:, s > RANK_TOLERANCE * max(s[0], 1e-300)]
        part = part - basis @ (basis.T @ part)
    return int((np.linalg.svd(part, compute_uv=False) > RANK_TOLERANCE * largest).sum())
