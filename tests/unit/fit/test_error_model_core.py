"""The linear-Gaussian core of the model of error, beside dense algebra, a filter written out, and sampling."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import multivariate_normal, norm

from thermid.fit._error_model.gaussian import (
    NormalMixture,
    RunRows,
    Wander,
    features,
    innovations,
    members_of,
    pivots,
    sampled,
    squared_exponential,
    step_to_mode,
    weights_of,
)

Array = NDArray[np.float64]
SHARED, OWN, READINGS = 4, 3, 40


def _run(seed: int) -> tuple[Array, Array, Array, Array]:
    """Times, rows of shared and own unknowns, readings, noise."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(20.0, 200.0, READINGS))
    return times, rng.normal(size=(READINGS, SHARED + OWN)), rng.normal(size=READINGS), rng.uniform(0.05, 0.3, READINGS)


def _dense(wander: Wander, times: Array, noise: Array) -> Array:
    return wander.covariance(times) + np.diag(noise**2)


def _white(times: Array, columns: Array, noise: Array, wanders: list[Wander]) -> tuple[Array, Array]:
    """White columns and log determinants of a sensor, which is passed beside another with other times and noise."""
    other, _, _, loud = _run(9)
    out, alone = np.empty((len(wanders), READINGS, 2, columns.shape[1])), np.empty((len(wanders), READINGS, 1, columns.shape[1]))
    logs = innovations([times, other], np.stack([columns, 2.0 * columns], axis=1), [noise, loud], wanders, out)
    return out[:, :, 0], logs - innovations([other], columns[:, None], [loud], wanders, alone)


@pytest.mark.parametrize("wander", [Wander(0.0, 1.0), Wander(0.3, 400.0), Wander(2.0, 60.0)])
def test_innovations_are_what_the_dense_covariance_makes_white(wander: Wander) -> None:
    times, rows, values, noise = _run(1)
    (white, _), (log_det, _) = _white(times, np.column_stack([rows, values]), noise, [wander, Wander(0.1, 100.0)])
    dense = _dense(wander, times, noise)
    whole = np.column_stack([rows, values])
    assert white.T @ white == pytest.approx(whole.T @ np.linalg.solve(dense, whole), rel=1e-8, abs=1e-8)
    assert log_det == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-10)


def test_posterior_and_evidence_are_those_of_dense_conditioning() -> None:
    """Two runs with shared unknowns and own ones each: one dense normal distribution of everything, conditioned on all readings."""
    wander, centre = Wander(0.3, 400.0), np.array([0.3, -0.2, 0.0, 0.1])
    sizes, own = np.array([[1.0, 0.5, 3.0, 0.2], [0.1, 2.0, 0.3, 0.7]]), np.array([[0.4, 0.1, 1.0], [0.2, 0.6, 0.05]])
    runs, dense_rows, covariances, every = [], [], [], []
    for seed in (1, 2):
        times, rows, values, noise = _run(seed)
        (white,), (log_det,) = _white(times, np.column_stack([rows, values]), noise, [wander])
        runs.append(RunRows.of_rows(white, SHARED, log_det))
        dense_rows.append(rows)
        covariances.append(_dense(wander, times, noise))
        every.append(values)
    found = members_of(runs, centre, sizes, [own, own])
    y = np.concatenate(every)
    for k in range(2):
        shared = np.concatenate([r[:, :SHARED] for r in dense_rows])
        prior = np.diag(sizes[k] ** 2)
        noise_of_all = np.zeros((y.size, y.size))
        for i, (rows, covariance) in enumerate(zip(dense_rows, covariances, strict=True)):
            at = slice(i * READINGS, (i + 1) * READINGS)
            alone = rows[:, SHARED:]
            noise_of_all[at, at] = covariance + alone @ np.diag(own[k] ** 2) @ alone.T
        marginal = shared @ prior @ shared.T + noise_of_all
        gain = prior @ shared.T @ np.linalg.inv(marginal)
        assert found.mean[k] == pytest.approx(centre + gain @ (y - shared @ centre), rel=1e-8, abs=1e-8)
        assert found.root[k] @ found.root[k].T == pytest.approx(prior - gain @ shared @ prior, rel=1e-8, abs=1e-8)
        assert found.log_evidence[k] == pytest.approx(multivariate_normal(shared @ centre, marginal).logpdf(y), rel=1e-8)
    weights = np.array([0.3, 0.7])
    mean, covariance = found.mixed(weights)
    assert mean == pytest.approx(weights @ found.mean)
    each = [root @ root.T + np.outer(m - mean, m - mean) for root, m in zip(found.root, found.mean, strict=True)]
    assert covariance == pytest.approx(np.tensordot(weights, each, axes=1), rel=1e-10)


def test_a_run_without_readings_says_nothing() -> None:
    empty = RunRows(np.zeros((SHARED + 1, SHARED + 1)), SHARED, 0.0, 0)
    sizes = np.array([[1.0, 2.0, 3.0, 4.0]])
    found = members_of([empty], np.ones(SHARED), sizes, [np.zeros((1, 0))])
    assert found.log_evidence[0] == 0.0
    assert found.mean[0] == pytest.approx(np.ones(SHARED))
    assert found.root[0] @ found.root[0].T == pytest.approx(np.diag(sizes[0] ** 2))


def test_features_have_the_covariance_of_the_smooth_function() -> None:
    rng = np.random.default_rng(3)
    points, lengths = rng.uniform(-1.0, 1.0, (60, 2)), np.array([0.7, 1.5])
    at = pivots(points, lengths, 1e-4, 60)
    phi = features(points, at, lengths)
    assert len(at) < 40
    assert np.abs(phi @ phi.T - squared_exponential(points, points, lengths)).max() < 2e-4


def test_far_from_all_pivots_features_vanish() -> None:
    at = np.zeros((1, 2))
    assert np.abs(features(np.full((1, 2), 20.0), at, np.ones(2))).max() < 1e-12


def test_interval_of_a_mixture_is_where_its_distribution_says() -> None:
    weights, means, sds = np.array([0.3, 0.7]), np.array([[0.0], [3.0]]), np.array([[1.0], [0.5]])
    low, high = NormalMixture(weights, means, sds**2).interval()
    for end, p in ((low[0], 0.025), (high[0], 0.975)):
        exact = brentq(lambda x, p=p: float(weights @ norm.cdf((x - means[:, 0]) / sds[:, 0])) - p, -9.0, 9.0)
        assert end == pytest.approx(exact, abs=1e-4)


def test_cost_of_a_point_is_the_density_of_the_mixture_and_steps_end_at_its_mode() -> None:
    rng = np.random.default_rng(5)
    weights, means = np.array([0.2, 0.5, 0.3]), rng.normal(size=(3, 2))
    roots = [np.tril(rng.normal(size=(2, 2))) + 2.0 * np.eye(2) for _ in weights]

    def density(x: Array) -> float:
        return float(sum(w * multivariate_normal(m, r @ r.T).pdf(x) for w, m, r in zip(weights, means, roots, strict=True)))

    def seen_from(x: Array) -> tuple[float, Array, Array]:
        return step_to_mode(list(np.log(weights) - 1e4), list(means - x), roots)

    at = np.array([3.0, -2.0])
    assert seen_from(at)[0] - seen_from(means[0])[0] == pytest.approx(np.log(density(means[0]) / density(at)), rel=1e-8)
    for _ in range(60):
        cost, step, spread = seen_from(at)
        assert seen_from(at + step)[0] <= cost + 1e-10
        at = at + step
    assert all(density(at) >= density(at + 0.01 * side * spread) for side in (*np.eye(2), *-np.eye(2)))


@pytest.mark.parametrize(("wide", "at"), [(3.0, 0.0), (0.7, 0.5), (0.3, 1.5)])
def test_sampling_finds_where_a_likelihood_is(wide: float, at: float) -> None:
    """Three of eight unknowns are told: posterior and evidence of normal distributions."""
    points, logs = sampled(lambda z: -0.5 * np.sum(((z[:, :3] - at) / wide) ** 2, axis=1), 256, 8, 8)
    variance = 1.0 / (1.0 + wide**-2)
    weights = weights_of(logs)
    mean, count = weights @ points, 1.0 / np.sum(weights**2)
    assert count > 40.0  # of the last 2 where all points are the prior's
    assert mean[:3] == pytest.approx(np.full(3, variance * at / wide**2), abs=3.0 * (variance / count) ** 0.5)
    assert mean[3:] == pytest.approx(np.zeros(5), abs=3.0 / count**0.5)
    exact = 3.0 * (0.5 * np.log(variance) - 0.5 * at**2 / (1.0 + wide**2))
    assert logs.max() + np.log(np.mean(np.exp(logs - logs.max()))) == pytest.approx(exact, abs=3.0 / count**0.5)


def test_weights_survive_large_logarithms() -> None:
    assert weights_of([-1e5, -1e5 + np.log(3.0)]) == pytest.approx([0.25, 0.75])


@pytest.mark.campaign
def test_widths_of_a_bent_case_are_those_of_sampling() -> None:
    """A box that cools by G d^(1 + n): ln G, n and an offset from noisy readings; a random walk of 400,000 steps beside straight lines.

    Asked: widths within 3 % near the data and 10 % at 1.5 times their level.
    """
    rng = np.random.default_rng(11)
    levels = np.linspace(0.4, 1.0, 30)
    prior = np.array([1.0, 0.04, 0.1])

    def answer(z: Array, power: Array) -> Array:
        """Return d / d0 of ``P = G d^(1 + n)``, n about 4/15, and an offset."""
        return np.asarray(10.0 * np.exp((np.log(power) - z[0]) / (1.0 + 4.0 / 15.0 + z[1])) + z[2])

    y = answer(np.array([0.1, 0.02, 0.05]), levels) + 0.1 * rng.normal(size=levels.size)

    def slopes(z: Array, power: Array) -> Array:
        return np.column_stack([(answer(z + e, power) - answer(z - e, power)) / 2e-6 for e in 1e-6 * np.eye(3)])

    z = np.zeros(3)
    for _ in range(8):
        rows = slopes(z, levels)
        white = np.column_stack([rows, y - answer(z, levels)]) / 0.1
        found = members_of([RunRows.of_rows(white, 3, 2.0 * levels.size * np.log(0.1))], -z, prior[None, :], [np.zeros((1, 0))])
        z = z + found.mean[0]
    asked = np.array([0.7, 1.5])
    straight = np.linalg.norm(slopes(z, asked) @ found.root[0], axis=1)

    def log_density(at: Array) -> float:
        return -0.5 * float(np.sum(((y - answer(at, levels)) / 0.1) ** 2) + np.sum((at / prior) ** 2))

    at, here, drawn = z.copy(), log_density(z), []
    for _ in range(400_000):
        to = at + 1.4 * found.root[0] @ rng.normal(size=3)
        there = log_density(to)
        if np.log(rng.uniform()) < there - here:
            at, here = to, there
        drawn.append(at)
    chain = np.array(drawn)[20_000:]
    blocks = chain.reshape(100, -1, 3).mean(axis=1)
    effective = 100.0 * chain.var(axis=0) / blocks.var(axis=0)
    assert effective.min() > 5000.0
    told = np.array([answer(one, asked) for one in chain[::10]])
    assert straight[0] == pytest.approx(told[:, 0].std(), rel=0.03)
    assert straight[1] == pytest.approx(told[:, 1].std(), rel=0.10)
