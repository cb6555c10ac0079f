"""The population of a fleet by restricted likelihood: means, spreads and correlations of what units say, each as a quadratic.

A unit says ``exp(h'd - d'H d / 2)`` of the values d of its parameters about a common reference, H its information, which may be singular:
a short log says little and counts for that. With ``d_i = X_i beta + b_i``, ``b_i ~ N(0, Omega)``, ``Omega = L L'`` and
``A_i = 1 + L'H_i L``, the integral over b_i needs no inverse of H or Omega:

    W_i = H_i - H_i L A_i^-1 L'H_i  (the inverse of H_i^-1 + Omega),   v_i = h_i - H_i L A_i^-1 L'h_i,   S = sum X_i'W_i X_i
    2 ln R = b'S^-1 b + sum h_i'L A_i^-1 L'h_i - sum ln|A_i| - ln|S|,   b = sum X_i'v_i

Restricted likelihood R: Patterson and Thompson, Biometrika 58 (1971) 545; Lindstrom and Bates, J. Am. Stat. Assoc. 83 (1988) 1014. It is
maximised over the entries of L, which may pass zero, by Fisher scoring; a profile holds one spread, or one correlation, and the entries
stay linear in what is free.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from thermid.base.linear_algebra import square_root, symmetric_inverse
from thermid.base.units import HALF_WIDTH_95, Array, Bools

EM_STEPS, SCORING_STEPS = 12, 60
"""Steps of expectation and maximisation that begin, and of scoring at most."""
GAIN_LEFT = 1e-7
"""Gain of ln R that a further step would promise, at which scoring ends."""


ZERO_SPREAD_RISE = 1e-3
"""Growth of 2 ln R from a spread to zero, up to which the spread is said to be zero."""
FITS_TO_AN_END, PROFILE_TOLERANCE = 10, 0.01
"""Fits on the way to one end, and how near its height must come, in standard errors."""
FALSE_ALARMS, ODD_TRIED = 0.05, 10
"""Probability of naming any unit of a fleet without odd ones; and how many units are left out in turn."""
LARGEST_ATANH = 5.0
"""Farthest correlation tried, as its inverse hyperbolic tangent."""


@dataclass(frozen=True, eq=False)
class Summaries:
    """What units say of their values, and how the means depend on what is known of them.

    Parameters
    ----------
    information : array (units, values, values)     H. [1 / fitted form^2]
    score : array (units, values)                   h, about the reference. [1 / fitted form]
    design : array (units, values, coefficients)    X.
    """

    information: Array
    score: Array
    design: Array

    def without(self, units: list[int]) -> Summaries:
        """Return it without some units."""
        others = np.setdiff1d(np.arange(len(self.score)), units)
        return Summaries(self.information[others], self.score[others], self.design[others])


def weigh(information: Array, score: Array, root: Array) -> tuple[Array, Array, Array, Array]:
    """Return the Cholesky factor C of ``A = 1 + L'H L``, ``C^-1 L'h``, W and v of every unit, in the symbols of this module.

    ``W = H - H L A^-1 L'H = (H^-1 + Omega)^-1`` and ``v = h - H L A^-1 L'h``: the information and the score of a unit about the
    reference once the spread between units is integrated out.

    Parameters
    ----------
    information : array (units, values, values)     H; it may be singular.
    score : array (units, values)                   h.
    root : array (values, values)                   L, with ``L L' = Omega``.
    """
    turned = information @ root
    lower: Array = np.asarray(np.linalg.cholesky(np.eye(root.shape[0]) + root.T @ turned), dtype=float)
    half = np.linalg.solve(lower, np.swapaxes(turned, 1, 2))
    along: Array = np.asarray(np.linalg.solve(lower, (score @ root)[..., None])[..., 0], dtype=float)
    weights, pushed = information - np.swapaxes(half, 1, 2) @ half, score - np.einsum("nji,nj->ni", half, along)
    return lower, along, np.asarray(weights), np.asarray(pushed)


@dataclass(frozen=True, eq=False)
class RestrictedLikelihood:
    """The restricted likelihood at some Omega = L L'.

    Parameters
    ----------
    log : float                         ln R.
    beta, spread : array                Coefficients (coefficients,), and S^-1.
    weights, pushes : array             W (units, values, values) and ``W_i (d_i - X_i beta)`` (units, values).
    carried : array                     W X (units, values, coefficients).
    slope : array (values, values)      Twice the derivative of ln R with respect to Omega.
    """

    log: float
    beta: Array
    spread: Array
    weights: Array
    pushes: Array
    carried: Array
    slope: Array

    @classmethod
    def at(cls, summaries: Summaries, root: Array) -> RestrictedLikelihood:
        """Return the restricted likelihood at Omega = L L', L the `root` (values, values), fitted form, with its slope by Omega.

        X (units, values, coefficients) is the design, W and v are those of `weigh`: beta = (X'WX)^-1 X'v, log likelihood = (v'X beta +
        |C^-1 L'h|^2 - ln det A - ln det X'WX) / 2.
        """
        x = summaries.design
        lower, along, weights, pushed = weigh(summaries.information, summaries.score, root)
        carried = weights @ x
        total = np.einsum("nij,nik->jk", x, carried)
        right = np.einsum("nij,ni->j", x, pushed)
        spread = symmetric_inverse(total)
        beta = spread @ right
        pushes = pushed - carried @ beta
        logs = 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum() + np.linalg.slogdet(total)[1]
        slope = pushes.T @ pushes - weights.sum(axis=0) + np.einsum("nij,jk,nlk->il", carried, spread, carried)
        return cls(0.5 * float(right @ beta + np.sum(along**2) - logs), beta, spread, weights, pushes, carried, slope)

    @property
    def outer(self) -> Array:
        """Sum of W x W (values^2, values^2): twice the expected information of Omega, the means taken as known."""
        size = self.weights.shape[1]
        flat = self.weights.reshape(-1, size * size)
        return np.asarray((flat.T @ flat).reshape((size,) * 4).transpose(0, 2, 1, 3).reshape(size * size, size * size))


@dataclass(frozen=True, eq=False)
class RootForm:
    """Root L of Omega as a linear function of free numbers t: ``L = base + sum t_m columns_m``, in an order of the values.

    Parameters
    ----------
    order : array (values,)                     Position of each row of L among the values.
    base : array (values, values)               What is fixed of L.
    columns : array (free, values, values)      Derivative of L with respect to each t_m.
    """

    order: Array
    base: Array
    columns: Array

    @classmethod
    def holding(cls, together: Bools, first: tuple[int, ...] = (), held: float | None = None) -> RootForm:
        """Return the form of L with one number fixed at `held`: the spread of one value in `first`, the correlation of two.

        `together` (values, values) says which values may be correlated; all, or none.
        """
        size = together.shape[0]
        order = np.array([*first, *(k for k in range(size) if k not in first)])
        base, columns = np.zeros((size, size)), []
        for i in range(size):
            for j in range(i + 1):
                if i != j and not together[order[i], order[j]]:
                    continue
                if held is not None and (i, j) == (0, 0) and len(first) == 1:
                    base[0, 0] = held
                    continue
                one = np.zeros((size, size))
                one[i, j] = 1.0
                if held is not None and len(first) == 2 and i == 1:
                    if j == 1:
                        continue
                    one[1, :2] = held, np.sqrt(1.0 - held**2)
                columns.append(one)
        return cls(order, base, np.array(columns).reshape(-1, size, size))

    def start(self, omega: Array) -> Array:
        """Return t (free,) whose L L' is near `omega` (values, values), fitted form.

        By least squares of ``base + sum t_k columns_k`` to the Cholesky factor L of `omega` in the order of this form.
        """
        size = omega.shape[0]
        there = omega[np.ix_(self.order, self.order)]
        lower = np.linalg.cholesky(there + 1e-12 * np.diag(np.diag(there)) + 1e-300 * np.eye(size))
        flat = self.columns.reshape(len(self.columns), size * size)
        return np.asarray(np.linalg.lstsq(flat.T, (lower - self.base).ravel(), rcond=None)[0])

    def root(self, t: Array) -> Array:
        """Return L (values, values) at t (free,), its rows in the order of the values."""
        out = np.zeros_like(self.base)
        out[self.order] = self.base + np.tensordot(t, self.columns, 1)
        return out

    @cached_property
    def placed(self) -> Array:
        """The columns with their rows in the order of the values (free, values, values)."""
        out = np.zeros_like(self.columns)
        out[:, self.order] = self.columns
        return out


@dataclass(frozen=True, eq=False)
class PopulationFit:
    """The population that is likeliest: coefficients of the means, and Omega.

    Parameters
    ----------
    summaries : Summaries
    together : array (values, values)   Which values may be correlated.
    omega : array (values, values)      Covariance of units about their means, in the fitted form.
    at : RestrictedLikelihood                          The restricted likelihood there.
    """

    summaries: Summaries
    together: Bools
    omega: Array
    at: RestrictedLikelihood = field(repr=False)

    @classmethod
    def fitted(cls, summaries: Summaries, together: Bools, near: Array | None = None) -> PopulationFit:
        """Return it; `near` is an Omega to begin at."""
        omega = _begun(summaries, together) if near is None else near
        omega, at = maximise(summaries, RootForm.holding(together), omega)
        return cls(summaries, together, omega, at)

    @property
    def sizes(self) -> Array:
        """Spreads (values,), in the fitted form."""
        return np.sqrt(np.diag(self.omega))

    def rise(self, first: tuple[int, ...], held: float, near: Array | None = None) -> tuple[float, Array]:
        """Return by how much 2 ln R falls where one spread, or the correlation of two values, is held; and Omega there."""
        omega, at = maximise(self.summaries, RootForm.holding(self.together, first, held), self.omega if near is None else near)
        return 2.0 * (self.at.log - at.log), omega

    def without(self, units: list[int]) -> PopulationFit:
        """Return the population without some units."""
        return PopulationFit.fitted(self.summaries.without(units), self.together, self.omega)

    @cached_property
    def _elements(self) -> Array:
        """The free entries of Omega as symmetric matrices (entries, values, values)."""
        out = []
        for i, j in zip(*np.tril_indices(len(self.omega)), strict=True):
            if self.together[i, j] or i == j:
                one = np.zeros_like(self.omega)
                one[i, j] = one[j, i] = 1.0
                out.append(one)
        return np.array(out)

    @cached_property
    def _moved(self) -> Array:
        """What each entry of Omega does to S (entries, coefficients, coefficients): minus its derivative."""
        return np.asarray(np.einsum("nia,eij,njb->eab", self.at.carried, self._elements, self.at.carried, optimize=True))

    @cached_property
    def of_omega(self) -> Array:
        """Covariance (entries, entries) of the entries of Omega, by the expected information of the restricted likelihood.

        tr(P D P D') / 2 with ``P = W - W X S^-1 X'W`` over all units, which are not independent in it.
        """
        at, basis = self.at, self._elements.reshape(len(self._elements), -1)
        size = len(self.omega)
        shared = np.einsum("nia,ab,njb->nij", at.carried, at.spread, at.carried, optimize=True).reshape(-1, size * size)
        cross = (at.weights.reshape(-1, size * size).T @ shared).reshape((size,) * 4).transpose(0, 2, 1, 3).reshape(size**2, size**2)
        kernel = at.outer - cross - cross.T
        between = np.einsum("ab,ebc,cd,fda->ef", at.spread, self._moved, at.spread, self._moved, optimize=True)
        return symmetric_inverse(0.5 * (basis @ kernel @ basis.T + between))

    def freedom_of_spread(self, k: int, variance: float | None = None) -> float:
        """Return the degrees of freedom 2 v^2 / var(Omega_kk) of a spread, v = Omega_kk, or of a `variance` v of which that is a part.

        Satterthwaite, Biometrics Bull. 2 (1946) 110.
        """
        row = self._elements[:, k, k]
        whole = float(self.omega[k, k]) if variance is None else variance
        return 2.0 * whole**2 / max(float(row @ self.of_omega @ row), 1e-300)

    def freedom_of_mean(self, c: Array) -> float:
        """Return the degrees of freedom 2 (c'Sc)^2 / Var(c'Sc) [-] of a combination c (coefficients,), S their covariance.

        Giesbrecht and Burns, Biometrics 41 (1985) 477.
        """
        along = self.at.spread @ c
        change = np.einsum("a,eab,b->e", along, self._moved, along)
        return float(2.0 * (c @ along) ** 2 / max(change @ self.of_omega @ change, 1e-300))


def _begun(summaries: Summaries, together: Bools) -> Array:
    """Return an Omega (values, values), fitted form, to begin at: how far units are apart, then steps of expectation and maximisation.

    A unit says score / information of each value; its weight is that information, at most the upper quartile. A step is ``Omega + Omega
    slope Omega / units`` (Laird and Ware, Biometrics 38 (1982) 963), within the correlations in `together`; it never lowers R (Dempster,
    Laird and Rubin, J. R. Stat. Soc. B 39 (1977) 1).
    """
    size = summaries.score.shape[1]
    diagonal = np.diagonal(summaries.information, axis1=1, axis2=2)
    apart = np.divide(summaries.score, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
    middle = np.sum(diagonal * apart, axis=0) / np.maximum(diagonal.sum(axis=0), 1e-300)
    weight = np.minimum(diagonal, np.quantile(diagonal, 0.75, axis=0))
    wide = np.sum(weight * (apart - middle) ** 2, axis=0) / np.maximum(weight.sum(axis=0), 1e-300)
    # no spread begins below 1e-4 of the largest, or of what the units' own readings leave: units that are one log have none
    least = np.maximum(wide.max(), 1.0 / np.maximum(weight.mean(axis=0), 1e-300))
    omega = np.diag(np.maximum(wide, 1e-8 * least)) * np.eye(size)
    for _ in range(EM_STEPS):
        step = omega @ RestrictedLikelihood.at(summaries, np.asarray(np.linalg.cholesky(omega))).slope @ omega / len(summaries.score)
        omega = omega + np.where(together | np.eye(size, dtype=bool), step, 0.0)
    return np.asarray(omega)


def maximise(summaries: Summaries, form: RootForm, omega: Array) -> tuple[Array, RestrictedLikelihood]:
    """Return the Omega (values, values) of largest restricted likelihood among those that `form` allows, and that likelihood.

    Fitted form. Fisher scoring over the free entries t of L, Omega = L L', from `omega` (values, values), damped as by Levenberg and
    Marquardt: (I + d diag(I)) s = g, with the gradient g and I_mn = sum of tr(W dOmega_m W dOmega_n) / 2 over units. d grows eightfold
    until a step gains, and falls as much after it; a step that gains less than `GAIN_LEFT` is the last.
    """
    t = form.start(omega)
    root = form.root(t)
    at, damping = RestrictedLikelihood.at(summaries, root), 1e-4
    size = root.shape[0]
    for _ in range(SCORING_STEPS):
        gradient = np.einsum("mij,ij->m", form.placed, at.slope @ root)
        turned = np.einsum("mik,jk->mij", form.placed, root)
        change = (turned + np.swapaxes(turned, 1, 2)).reshape(len(t), size * size)
        information = 0.5 * change @ at.outer @ change.T
        scale = np.diag(information) + 1e-12 * np.diag(information).max(initial=1e-300)
        while True:
            step = np.linalg.solve(information + np.diag(damping * scale), gradient)
            there = RestrictedLikelihood.at(summaries, form.root(t + step))
            if (np.isfinite(there.log) and there.log >= at.log) or damping > 1e8:
                break
            damping *= 8.0
        gain = there.log - at.log
        if not gain > 0.0:
            break
        t, at, damping = t + step, there, max(damping / 8.0, 1e-10)
        root = form.root(t)
        if 0.5 * float(gradient @ step) < GAIN_LEFT and gain < GAIN_LEFT:
            break
    return root @ root.T, at


class Interval(NamedTuple):
    """A 95 % interval in the fitted form, with its degrees of freedom."""

    low: float
    high: float
    freedom: float


class Odd(NamedTuple):
    """A unit that is apart from the others in one value.

    Parameters
    ----------
    unit, value : int       Positions.
    distance : float        Its deviation in standard deviations that it should have, the population fitted without it. [-]
    threshold : float       Which one unit of the whole fleet exceeds by chance in 5 % of fleets. [-]
    """

    unit: int
    value: int
    distance: float
    threshold: float


def student(freedom: float, share: float) -> float:
    """Return the quantile of Student's distribution."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, share))


def interval_of_mean(population: PopulationFit, c: Array, shared: float = 0.0) -> Interval:
    """Return the 95 % interval of a combination c (coefficients,), fitted form, by Student's distribution.

    `shared` is a variance that all units have in common, added with the factor of a normal law.
    """
    freedom = population.freedom_of_mean(c)
    half = math.hypot(student(freedom, 0.975) * math.sqrt(float(c @ population.at.spread @ c)), HALF_WIDTH_95 * math.sqrt(max(shared, 0.0)))
    middle = float(c @ population.at.beta)
    return Interval(middle - half, middle + half, freedom)


def interval_of_spread(population: PopulationFit, k: int) -> Interval:
    """Return the 95 % interval of the spread of value `k` by its profile, fitted form; from zero where zero is not rejected.

    Its ends are where -2 ln of the restricted likelihood, fitted anew for the others, has grown by `HALF_WIDTH_95`^2. They are looked for
    in the variance where it is next to nothing, else in the logarithm of the spread. [fitted form]
    """
    size, goal = float(population.sizes[k]), HALF_WIDTH_95**2
    to_zero = population.rise((k,), 0.0)[0]
    freedom = population.freedom_of_spread(k)
    if to_zero < ZERO_SPREAD_RISE:
        step = math.sqrt(2.0 * goal) / np.sqrt(max(float(np.sum(population.at.weights[:, k, k] ** 2)), 1e-300))
        high = _end(lambda x, near: population.rise((k,), math.sqrt(x), near), step, goal**0.5)
        return Interval(0.0, math.sqrt(high), freedom)
    step = HALF_WIDTH_95 / math.sqrt(2.0 * max(freedom, 1.0))
    high = _end(lambda x, near: population.rise((k,), size * math.exp(x), near), step, goal**0.5)
    if to_zero <= goal:
        return Interval(0.0, size * math.exp(high), freedom)
    low = _end(lambda x, near: population.rise((k,), size * math.exp(-x), near), step, goal**0.5)
    return Interval(size * math.exp(-low), size * math.exp(high), freedom)


def interval_of_correlation(population: PopulationFit, j: int, k: int) -> Interval:
    """Return the interval of a correlation by its profile; all of -1 to 1 where a spread is zero."""
    sizes, goal = population.sizes, HALF_WIDTH_95
    freedom = min(population.freedom_of_spread(j), population.freedom_of_spread(k))
    if not (sizes[[j, k]] > 0.0).all() or abs(ratio := float(population.omega[j, k] / (sizes[j] * sizes[k]))) >= 1.0 - 1e-9:
        return Interval(-1.0, 1.0, freedom)
    middle = math.atanh(math.copysign(ratio, population.omega[j, k]))
    step = goal / math.sqrt(max(freedom - 2.0, 1.0))
    ends = []
    for sign in (-1.0, 1.0):
        far = _end(_along(population, j, k, middle, sign), step, goal, LARGEST_ATANH - sign * middle)
        ends.append(math.tanh(middle + sign * far))
    return Interval(ends[0], ends[1], freedom)


def _along(population: PopulationFit, j: int, k: int, middle: float, sign: float) -> Callable[[float, Array | None], tuple[float, Array]]:
    """Return the rise by the distance x of the inverse hyperbolic tangent of the correlation of two values from `middle`."""
    return lambda x, near: population.rise((j, k), math.tanh(middle + sign * x), near)


def _end(rise: Callable[[float, Array | None], tuple[float, Array]], step: float, goal: float, most: float = 1e3) -> float:
    """Return the distance x, at most `most`, at which sqrt(rise(x)) reaches `goal`; `rise` also takes and returns an Omega to begin near.

    The first try is `step`; steps grow until they enclose the goal, then secants.
    """
    low, high, near = (0.0, 0.0), (math.inf, math.inf), None
    x = min(step, most)
    for _ in range(FITS_TO_AN_END):
        rose, near = rise(x, near)
        there = x, math.sqrt(max(rose, 0.0))
        if abs(there[1] - goal) < PROFILE_TOLERANCE:
            break
        low, high = (there, high) if there[1] < goal else (low, there)
        if x >= most and there[1] < goal:
            return most
        if math.isinf(high[0]):
            x = min(x * min(max(goal / max(there[1], 1e-9), 1.05), 2.5), most)
        else:
            part = (goal - low[1]) / (high[1] - low[1])
            x = low[0] + (high[0] - low[0]) * min(max(part, 0.05), 0.95)
    return x


def distances(population: PopulationFit) -> Array:
    """Return how far each unit is from its mean in each value (units, values), in standard deviations, the other values considered.

    The score of a shift of one value of one unit: ``W_i (d_i - X_i beta)`` over its standard deviation.
    """
    # standard deviations (units, values) of ``W_i (d_i - X_i beta)``
    at = population.at
    variance = np.diagonal(at.weights, axis1=1, axis2=2) - np.einsum("nia,ab,nib->ni", at.carried, at.spread, at.carried)
    errors: Array = np.sqrt(np.maximum(variance, 0.0))
    return np.divide(at.pushes, errors, out=np.zeros_like(errors), where=errors > 1e-9 * errors.max(axis=0))


def odd_units(population: PopulationFit) -> list[Odd]:
    """Return the units that do not belong to the population, the farthest first.

    The farthest unit is left out, the population fitted without it, and the unit compared with that, in turn up to a tenth of the fleet
    (generalised extreme Studentised deviate: Rosner, Technometrics 25 (1983) 165). The last that exceeds the threshold and all before it
    are odd. The threshold is Student's with the degrees of freedom of the difference, for units times values tries (Bonferroni).
    """
    summaries, (count, size) = population.summaries, population.summaries.score.shape
    left_out: list[int] = []
    tried: list[Odd] = []
    reduced = population
    while len(left_out) < min(ODD_TRIED, max(count // 10, 1)) and count - len(left_out) > 3:
        remaining = np.setdiff1d(np.arange(count), left_out)
        place = np.unravel_index(int(np.argmax(np.abs(distances(reduced)))), (remaining.size, size))
        unit, k = int(remaining[place[0]]), int(place[1])
        left_out.append(unit)
        reduced = population.without(left_out)
        _, _, weights, pushed = weigh(summaries.information[[unit]], summaries.score[[unit]], square_root(reduced.omega))
        carried = weights[0] @ summaries.design[unit]
        push = pushed[0] - carried @ reduced.at.beta
        wide = weights[0] + carried @ reduced.at.spread @ carried.T
        # the variance of the difference has the errors of the unit and of the mean too: where the spread vanishes, they are all of it
        variance = float(wide[k, k] / weights[0, k, k] ** 2)
        distance, all_freedom = float(push[k] / math.sqrt(wide[k, k])), max(reduced.freedom_of_spread(k, variance), 1.0)
        # the value is compared with its regression on the others: that costs freedom, and is the more wrong the farther they are (leverage)
        others = max(float(push @ symmetric_inverse(wide) @ push) - distance**2, 0.0) if reduced.together.all() else 0.0
        freedom = max(all_freedom - (reduced.together[k].sum() - 1.0), 1.0)
        threshold = -student(freedom, FALSE_ALARMS / (2.0 * remaining.size * size))
        shrunk = math.sqrt(freedom / all_freedom / (1.0 + others / all_freedom))
        tried.append(Odd(unit, k, shrunk * distance, threshold))
        if len(tried) > 1 and not any(abs(t.distance) > t.threshold for t in tried[-2:]):
            break
    last = max((n for n, t in enumerate(tried, 1) if abs(t.distance) > t.threshold), default=0)
    return sorted(tried[:last], key=lambda t: -abs(t.distance) / t.threshold)
