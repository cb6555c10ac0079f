"""Linear-Gaussian core of the model of error, on arrays alone: derivatives and readings in, posterior, evidence and bands out.

Legend, as in Rasmussen and Williams, Gaussian Processes for Machine Learning (MIT Press 2006), ch. 2 and Särkkä, Bayesian Filtering and
Smoothing (Cambridge 2013), ch. 4:

    y = H z + w + e     readings less what the model says (m,), unknowns z (q,), their responses H (m, q)
    z ~ N(mu, L L')     prior of the unknowns
    w                   Ornstein-Uhlenbeck: cov(w(t), w(t')) = s^2 exp(-|t - t'| / tau)
    e ~ N(0, sigma^2)   white
    S_k                 variance of the k-th innovation

Unknowns of one run alone are integrated out run by run. With the rows of a run ``[A_s A_o]`` for shared and own unknowns in units of their
priors, ``M_o = I + A_o'A_o``, what the run says of the shared ones is ``A_s'(I + A_o A_o')^-1 A_s = A_s'A_s - A_s'A_o M_o^-1 A_o'A_s``
(Woodbury), and its ``ln det`` grows by ``ln |M_o|``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from thermid.base.units import Array, Indices


@dataclass(frozen=True)
class Wander:
    """An Ornstein-Uhlenbeck process.

    Parameters
    ----------
    size : float    Its standard deviation. [K]
    time : float    Its time constant. [s]
    """

    size: float
    time: float

    def covariance(self, times: Array) -> Array:
        """Return the covariance (times, times) of its values. [K^2]"""
        return np.asarray(self.size**2 * np.exp(-np.abs(times[:, None] - times) / self.time))


def innovations(times: Sequence[Array], columns: Array, noise: Sequence[Array], wanders: Sequence[Wander], out: Array) -> Array:
    """Write columns made white, and return the logarithms (wanders,) of the determinants of what they were divided by.

    Readings with an Ornstein-Uhlenbeck process and white noise are passed through the Kalman filter of the process; innovation k over
    ``sqrt(S_k)`` is white and of variance one. What is done to the readings is done to the columns of H. Several sensors with as many
    readings each are passed side by side.

    Parameters
    ----------
    times : sequence of array (m,)      Of each sensor, increasing. [s]
    columns : array (m, sensors, k)     [K]
    noise : sequence of array (m,)      Of each sensor, standard deviation of the white noise. [K]
    wanders : sequence      Processes that are tried, of every sensor its own.
    out : array (wanders, m, sensors, k)    Where the white columns go.
    """
    sensors = [[x.astype(float).tobytes() for x in pair] for pair in zip(times, noise, strict=True)]
    filters = [[_filter_of(*of, w) for of in sensors] for w in wanders]
    memory, scales, gains = (np.array([[f[k] for f in several] for several in filters]).transpose(2, 0, 1)[..., None] for k in range(3))
    state, apart = np.zeros_like(out[:, 0]), np.empty_like(out[:, 0])
    for k, row in enumerate(columns):  # in place: new memory costs as much as the sums
        state *= memory[k]
        np.subtract(row, state, out=apart)
        np.divide(apart, scales[k], out=out[:, k])
        apart *= gains[k]
        state += apart
    return np.array([sum(f[3] for f in several) for several in filters])


@lru_cache(maxsize=128)
def _filter_of(times: bytes, noise: bytes, wander: Wander) -> tuple[Array, Array, Array, float]:
    """Return the memory [-], the scales [K] and the gains [-] (m,) of the Kalman filter of a process and white noise, and ln det.

    exp(-dt / time) of the memory, scale^2 = prior variance + noise^2 of each reading, gain = prior variance / scale^2. It is the same for
    every sensor and step of a search.

    Parameters
    ----------
    times : bytes       Instants (m,) as float64. [s]
    noise : bytes       White standard deviations (m,) as float64. [K]
    wander : Wander     Size [K] and time [s] of the process.
    """
    instants, white = np.frombuffer(times), np.frombuffer(noise)
    memory = np.exp(-np.diff(instants, prepend=instants[0]) / wander.time)
    if wander.size == 0.0:
        return memory, white, np.zeros(white.size), 2.0 * float(np.log(white).sum())
    variance, totals, gains = wander.size**2, [], []
    for memory_of_step, white_variance in zip(memory.tolist(), (white**2).tolist(), strict=True):
        variance = memory_of_step**2 * variance + wander.size**2 * (1.0 - memory_of_step**2)
        totals.append(variance + white_variance)
        gains.append(variance / totals[-1])
        variance = variance * white_variance / totals[-1]
    return memory, np.array([t**0.5 for t in totals]), np.array(gains), float(sum(np.log(totals).tolist()))


@dataclass(frozen=True, eq=False)
class NormalMixture:
    """A mixture of normal answers (times,): what is averaged over sizes, and over what carries the heat.

    Parameters
    ----------
    weights : array (members,)          Sum one.
    means : array (members, times)      [K]
    variances : array (members, times)  [K^2]
    """

    weights: Array
    means: Array
    variances: Array

    @property
    def mean(self) -> Array:
        """Mean (times,). [K]"""
        return np.asarray(self.weights @ self.means)

    @property
    def variance(self) -> Array:
        """Variance (times,): of the members, and of their means. [K^2]"""
        return np.asarray(self.weights @ (self.variances + (self.means - self.mean) ** 2))

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return the ends (times,) of the central interval of probability `level`, by halving. [K]

        Where sum_k w_k Phi((x - m_k) / s_k) = (1 -+ level) / 2, of weights w, means m and standard deviations s.
        """
        from scipy.special import ndtr, ndtri

        spread = np.sqrt(self.variances)
        ends = []
        for probability in (0.5 - 0.5 * level, 0.5 + 0.5 * level):
            wide = ndtri(probability) * spread
            low, high = (self.means + wide).min(axis=0), (self.means + wide).max(axis=0)
            for _ in range(INTERVAL_HALVINGS):
                middle = 0.5 * (low + high)
                below = self.weights @ ndtr((middle - self.means) / np.where(spread > 0.0, spread, np.inf)) < probability
                low, high = np.where(below, middle, low), np.where(below, high, middle)
            ends.append(0.5 * (low + high))
        return ends[0], ends[1]


INTERVAL_HALVINGS = 20
"""Halvings of what the members span: to a millionth of it."""


def weights_of(log_evidence: Sequence[float] | Array) -> Array:
    """Return the probabilities (members,) exp(log) / sum exp(log) of members that are as likely before, by ln of their evidence. [-]"""
    logs = np.asarray(log_evidence, dtype=float)
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


def log_sum(logs: Sequence[float] | Array) -> float:
    """Return ln sum exp(logs) [-], computed about the largest."""
    most = float(np.max(logs))
    return most + float(np.log(np.sum(np.exp(np.asarray(logs) - most))))


def step_to_mode(log_evidence: Sequence[float], means: Sequence[Array], roots: Sequence[Array]) -> tuple[float, Array, Array]:
    """Return the cost of a point under a mixture of normal posteriors, the step towards its mode, and standard errors there.

    Legend: member l of evidence Z_l and posterior N(m_l, S_l), as seen from the point. The cost is ``-ln sum_l Z_l N(0; m_l, S_l)``, but
    for constants; the step is that of expectation and maximisation, ``H^-1 sum_l r_l S_l^-1 m_l`` with shares r_l of that sum and
    ``H = sum_l r_l S_l^-1`` (Dempster, Laird and Rubin, J. R. Stat. Soc. B 39 (1977) 1).

    Parameters
    ----------
    log_evidence : sequence of float    ln Z_l.
    means : sequence of array (s,)      m_l.
    roots : sequence of array (s, q)    ``R R' = S``.
    """
    inverses = [np.linalg.inv(root @ root.T) for root in roots]
    pulls = [inverse @ mean for inverse, mean in zip(inverses, means, strict=True)]
    pairs = zip(log_evidence, means, inverses, pulls, strict=True)
    logs = np.array([log - 0.5 * float(mean @ pull - np.linalg.slogdet(inverse)[1]) for log, mean, inverse, pull in pairs])
    shares = weights_of(logs)
    spread = np.linalg.inv(np.tensordot(shares, np.array(inverses), axes=1))
    return -log_sum(logs), np.asarray(spread @ (shares @ np.array(pulls))), np.sqrt(np.diag(spread))


def even_points(count: int, dimensions: int, first: int = 1) -> Array:
    """Return points (count, dimensions) evenly over a standard normal distribution, from the place `first` of an endless sequence.

    Points of an additive recurrence whose steps are powers of the root of ``x^(d + 1) = x + 1`` (Niederreiter, Random Number Generation and
    Quasi-Monte Carlo Methods, SIAM 1992, chapter 3): as even as those of Sobol, at the cost of a sum.
    """
    from scipy.special import ndtri

    root = 1.0
    for _ in range(ROOT_STEPS):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    return np.asarray(ndtri((0.5 + np.arange(first, first + count)[:, None] * root ** -np.arange(1.0, dimensions + 1)) % 1.0))


ROOT_STEPS = 60
"""Steps in which the root of a recurrence is found to the last digit."""


def sampled(log_likelihood: Callable[[Array], Array], count: int, dimensions: int, rounds: int) -> tuple[Array, Array]:
    """Return points x (count, dimensions) under a standard normal prior p, and ln of their weights L p / q: a likelihood in evaluations.

    `log_likelihood` is ln L (points,) at points (points, dimensions), q the mixture of what laid the points. Adaptive importance sampling:
    each round lays its points by a normal distribution that has means and deviations of the points before, under weights flattened until
    as many points as dimensions count, and all rounds together are weighed as one mixture (Cornuet, Marin, Mira and Robert, Scand. J.
    Stat. 39 (2012) 798). The sum of the weights over `count` estimates the integral. Deviations alone: so few points show no correlations,
    and those of their scatter narrow what the next round covers.
    """
    sizes = [len(x) for x in np.array_split(np.arange(count), rounds)]
    laws: list[tuple[Array, Array]] = [(np.zeros(dimensions), np.ones(dimensions))]
    points, targets, logs = np.empty((0, dimensions)), np.empty(0), np.empty(0)
    for k, size in enumerate(sizes):
        new = laws[k][0] + laws[k][1] * even_points(size, dimensions, len(points) + 1)
        points = np.concatenate([points, new])
        targets = np.concatenate([targets, log_likelihood(new) + _log_normal(new, *laws[0])])
        logs = targets - np.logaddexp.reduce(
            [np.log(n / len(points)) + _log_normal(points, *law) for n, law in zip(sizes, laws, strict=False)], axis=0
        )
        weights = _flattened(logs, min(float(dimensions), 0.5 * len(points)))
        mean = weights @ points
        laws.append((mean, np.sqrt(weights @ (points - mean) ** 2 + LEAST_SPREAD**2)))
    return points, logs


LEAST_SPREAD = 0.1
"""Least standard deviation of the points of a round, in those of the prior."""


def _flattened(logs: Array, enough: float) -> Array:
    """Return the weights (points,) of exp(part * logs), summing to one, with the largest part up to 1 whose 1 / sum w^2 > `enough`."""
    low, high = 0.0, 1.0
    for _ in range(INTERVAL_HALVINGS):
        part = 0.5 * (low + high)
        low, high = (part, high) if 1.0 / float(np.sum(weights_of(part * logs) ** 2)) > enough else (low, part)
    return weights_of(low * logs)


def _log_normal(points: Array, mean: Array, spread: Array) -> Array:
    """Return ln of an independent normal density (n,) at points (n, coordinates), up to a constant; `mean`, `spread` (coordinates,)."""
    return np.asarray(-0.5 * np.sum(((points - mean) / spread) ** 2, axis=1) - np.log(spread).sum())


def squared_exponential(first: Array, second: Array, lengths: Array) -> Array:
    """Return k(x, x') (n, m) of points (n, d) and (m, d): ``exp(-|(x - x') / l|^2 / 2)``, l the `lengths` (d,). [-]"""
    apart = (first[:, None, :] - second[None, :, :]) / lengths
    return np.asarray(np.exp(-0.5 * np.sum(apart**2, axis=2)))


def pivots(points: Array, lengths: Array, tolerance: float, most: int) -> Array:
    """Return the points (r, d) that a pivoted Cholesky factor of k takes until `tolerance` [-] of the largest variance is left.

    `most` of them at most. k is `squared_exponential` with `lengths` (d,) between points (points, d). Each step takes the point of largest
    variance v and subtracts c c', c = k(., point) less what the columns before say of it, over sqrt(v).

    Source: Harbrecht, Peters and Schneider, Appl. Numer. Math. 62 (2012) 428.
    """
    diagonal = np.ones(len(points))
    columns: list[Array] = []
    chosen: list[int] = []
    while len(chosen) < min(most, len(points)) and diagonal.max() > tolerance:
        k = int(diagonal.argmax())
        column = squared_exponential(points, points[[k]], lengths)[:, 0]
        column = (column - sum((c * c[k] for c in columns), np.zeros(len(points)))) / np.sqrt(diagonal[k])
        columns.append(column)
        chosen.append(k)
        diagonal = np.maximum(diagonal - column**2, 0.0)
    return points[chosen]


def features(points: Array, at: Array, lengths: Array) -> Array:
    """Return the features Phi (n, r) of points (n, d) at pivots `at` (r, d), their coefficients independent and N(0, 1). [-]

    ``Phi Phi'`` is k between pivots: Phi = k(x, at) L'^-1, L L' = k(at, at).
    """
    inner = squared_exponential(at, at, lengths) + 1e-10 * np.eye(len(at))
    lower = np.linalg.cholesky(inner)
    return np.asarray(np.linalg.solve(lower, squared_exponential(points, at, lengths).T).T)


@dataclass(frozen=True, eq=False)
class RunRows:
    """What a run says of shared unknowns and of its own: products of its white rows.

    Parameters
    ----------
    gram : array (s + o + 1, s + o + 1)     ``[H y]'[H y]``, shared unknowns first, then those of the run, then the readings.
    shared : int                            s.
    log_det : float                         Of the covariance by which the rows were made white.
    count : int                             Readings.
    """

    gram: Array
    shared: int
    log_det: float
    count: int

    @classmethod
    def of_rows(cls, rows: Array, shared: int, log_det: float) -> RunRows:
        """Return the products of white rows (m, s + o + 1), the readings last."""
        return cls(np.asarray(rows.T @ rows), shared, log_det, len(rows))

    @property
    def shared_places(self) -> list[int]:
        """Places of the shared unknowns and of the readings."""
        return [*range(self.shared), self.gram.shape[0] - 1]

    def of_own(self, sizes: Array) -> tuple[Array, Array]:
        """Return what integrating the run's own unknowns out takes off the products of the others, and ln |M_o|, for members of sizes.

        Parameters
        ----------
        sizes : array (members, o)  Standard deviations of the run's own unknowns.

        Returns
        -------
        taken : array (members, s + 1, s + 1)
        grown : array (members,)
        """
        own_columns = slice(self.shared, self.gram.shape[0] - 1)
        inner = np.eye(sizes.shape[1]) + sizes[:, :, None] * self.gram[own_columns, own_columns] * sizes[:, None, :]
        lower: Array = np.linalg.cholesky(inner).astype(float, copy=False)
        across = forward_substitution(lower, sizes[:, :, None] * self.gram[own_columns][:, self.shared_places])
        return np.swapaxes(across, 1, 2) @ across, 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)


@dataclass(frozen=True, eq=False)
class Members:
    """Posteriors of shared unknowns at sets of sizes.

    Parameters
    ----------
    log_evidence : array (members,)
    square : array (members,)           ``y' S^-1 y`` of the readings over a reading, S their covariance before they were read; one is
                                        what it is where the model of error is right. [-]
    centre : array (s,)                 Mean of the prior.
    sizes : array (members, s)          Standard deviations D of the prior.
    lower : array (members, s, s)       ``L L' = I + D A D``, A the information of the readings.
    half : array (members, s)           ``L^-1 D b``, b what the readings say against the centre.
    """

    log_evidence: Array
    square: Array
    centre: Array
    sizes: Array
    lower: Array
    half: Array

    @classmethod
    def joined(cls, parts: Sequence[Members]) -> Members:
        """Return all members of several about one centre."""
        each = ("log_evidence", "square", "sizes", "lower", "half")
        return cls(centre=parts[0].centre, **{name: np.concatenate([getattr(p, name) for p in parts]) for name in each})

    def at(self, places: Indices) -> Members:
        """Return the members at some places."""
        return Members(
            self.log_evidence[places], self.square[places], self.centre, *(x[places] for x in (self.sizes, self.lower, self.half))
        )

    @cached_property
    def root(self) -> Array:
        """Roots (members, s, s) of the covariances C, ``R R' = C``: ``D L'^-1``, D the sizes and L the factor of the scaled information."""
        return np.asarray(
            self.sizes[:, :, None]
            * np.swapaxes(forward_substitution(self.lower, np.broadcast_to(np.eye(self.centre.size), self.lower.shape)), 1, 2)
        )

    @property
    def mean(self) -> Array:
        """Means (members, s)."""
        return np.asarray(self.centre + self.sizes * back_substitution(self.lower, self.half))

    def mixed(self, weights: Array) -> tuple[Array, Array]:
        """Return mean (s,) and covariance (s, s) of all members together, with weights (members,) that sum one.

        Of each member ``D (L L')^-1 D`` (LAPACK's dpotri), a third of the work of a root and its product; and what the means differ by.
        """
        from scipy.linalg.lapack import dpotri

        covariance = np.zeros(self.lower.shape[1:])
        for weight, lower, size in zip(weights.tolist(), self.lower, self.sizes, strict=True):
            inverse, _ = dpotri(lower.T, lower=0)  # the transpose lies in LAPACK's order; what is below the diagonal is not set
            scaled = weight**0.5 * size
            covariance += inverse * (scaled[:, None] * scaled)
        means = self.mean
        mean = weights @ means
        apart = means - mean
        return np.asarray(mean), np.asarray(np.triu(covariance) + np.triu(covariance, 1).T + (weights[:, None] * apart).T @ apart)


def members_of(runs: Sequence[RunRows], centre: Array, sizes: Array, own_sizes: Sequence[Array]) -> Members:
    """Return the posteriors of the shared unknowns at members of sizes.

    Parameters
    ----------
    centre : array (s,)                     Mean of their prior.
    sizes : array (members, s)              Standard deviations of their prior.
    own_sizes : sequence of array (members, o)  The same of the unknowns of each run.
    """
    count, s = sizes.shape
    products, log_det, readings = np.zeros((s + 1, s + 1)), np.zeros(count), 0
    taken: Array | None = None
    for run, sizes_of_run in zip(runs, own_sizes, strict=True):
        products += run.gram[np.ix_(run.shared_places, run.shared_places)]
        readings += run.count
        log_det += run.log_det
        if sizes_of_run.shape[1]:
            of_run, grown = run.of_own(sizes_of_run)
            taken = of_run if taken is None else np.add(taken, of_run, out=of_run)
            log_det += grown
    # in place from here: new memory for every member costs more than the sums
    total = np.tile(products, (count, 1, 1)) if taken is None else np.subtract(products, taken, out=taken)
    inner, cross, square = total[:, :s, :s], total[:, :s, s], total[:, s, s]
    moved = inner @ centre
    square = square - (2.0 * cross - moved) @ centre
    cross = cross - moved
    inner *= sizes[:, :, None]
    inner *= sizes[:, None, :]
    inner[:, range(s), range(s)] += 1.0
    lower: Array = np.linalg.cholesky(inner).astype(float, copy=False)
    half = forward_substitution(lower, (sizes * cross)[:, :, None])[:, :, 0]
    log_det += 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
    square = square - np.sum(half**2, axis=1)
    evidence = -0.5 * (square + log_det + readings * np.log(2.0 * np.pi))
    return Members(evidence, square / max(readings, 1), centre, sizes, lower, half)


def forward_substitution(lower: Array, right: Array) -> Array:
    """Return ``L^-1 B`` (members, n, k) of `lower` triangular L (members, n, n) and `right` B (members, n, k).

    `numpy.linalg.solve` would factorise each L again.
    """
    from scipy.linalg.lapack import dtrtrs

    out = np.empty(right.shape)
    for k in range(len(right)):
        out[k], _ = dtrtrs(lower[k].T, right[k], lower=0, trans=1)  # the transpose lies in LAPACK's order
    return out


def back_substitution(lower: Array, right: Array) -> Array:
    """Return ``L'^-1 b`` (members, n) of lower triangular L (members, n, n) and b (members, n)."""
    from scipy.linalg.lapack import dtrtrs

    return np.stack([dtrtrs(one.T, b, lower=0)[0] for one, b in zip(lower, right, strict=True)])
