"""The one score of causes beside brute force: dense normal densities of all readings, integrated over normal priors."""

from __future__ import annotations

import numpy as np
import pytest

from thermid.fit.calibration import Binned, build_problem, evidences, starting_point
from thermid.inference._explain.thresholds import SIZES, SizedValue
from thermid.inference._explain.weighing import CauseScore, noise_of, shares, weighed_at, weighed_in_noise
from unit.fit.bench import HTC, MASS, box, log

GRID_TIMES, RATIOS = 9, 16
BARE = {"surfaces/skin/effective_htc": "6 [W/(m^2 K)]", "nodes/case/mass": "1.5 [kg]"}


def likeliest(mean: np.ndarray, slopes: np.ndarray, times: np.ndarray, prior: np.ndarray, pull: np.ndarray) -> float:
    """Return the largest log-density of readings over the sizes and times of what wanders, a constant off; dense matrices throughout."""
    best = -np.inf
    spread = np.linalg.inv(prior)
    centre = -slopes @ (spread @ pull)  # residuals fall by the slopes where the unknowns are moved to the middle of their prior
    for time in np.geomspace(np.median(np.diff(times)), times[-1] - times[0], GRID_TIMES):
        for ratio in np.geomspace(0.05, 1e4, RATIOS):
            noise = np.eye(times.size) + ratio * np.exp(-np.abs(times[:, None] - times) / time)
            whole = noise + slopes @ spread @ slopes.T
            z = mean - centre
            best = max(best, -0.5 * float(z @ np.linalg.solve(whole, z)) - 0.5 * float(np.linalg.slogdet(whole)[1]))
    return best


@pytest.mark.parametrize("wander", [0.0, 3.0])
def test_evidence_is_that_of_dense_normal_distributions(wander: float) -> None:
    problem = build_problem(_asked())
    at = starting_point(problem.unknowns)
    (b,) = Binned.of_problem(problem, at).values()
    assert (b.count == 1.0).all()
    rng = np.random.default_rng(2)
    slow = wander * np.linalg.cholesky(np.exp(-np.abs(b.times[:, None] - b.times) / 3000.0) + 1e-9 * np.eye(b.times.size))
    b = type(b)(rng.standard_normal(b.times.size) + slow @ rng.standard_normal(b.times.size), b.count, b.times, b.slopes, 0.0, 0, 1.0)
    prior, pull = np.diag([4.0, 9.0, 1.0]), np.array([0.5, -1.0, 0.0])
    found = evidences([b], prior[None], pull[None])[0].max() - 0.5 * float(pull @ np.linalg.solve(prior, pull))
    # unknowns without a prior count as known to 1e-9 of what white noise gives; here that is 2e-4 of the priors
    assert found == pytest.approx(likeliest(b.mean, -b.slopes, b.times, prior, -pull), abs=1e-3)


def _asked():  # type: ignore[no-untyped-def]
    from thermid.fit.calibration import Request

    return Request(box(BARE), (log(box(BARE), {}, {"T": "case"}, samples=81),), (HTC, MASS))


def test_a_prior_about_nothing_is_the_density_of_the_value_itself() -> None:
    """Of a value that is fitted as its logarithm the density carries the Jacobian."""
    size = SizedValue(0.0, 2.0)
    value = 0.7
    row, slope = size.row(value, True)
    density = -0.5 * row**2 + np.log(slope)
    assert density == pytest.approx(-0.5 * (value / 2.0) ** 2 - np.log(2.0) + np.log(value))
    assert size.row(value, False) == pytest.approx((value / 2.0, 1.0 / 2.0))


def test_wider_priors_cost_what_they_spread_over() -> None:
    """What readings say nothing of costs nothing at any width; what they decide costs the logarithm of the width."""
    problem = build_problem(_asked())
    at = starting_point(problem.unknowns)
    halved, plain, doubled = (weighed_at(problem, at, {HTC: SizedValue(6.0, width)}).best for width in (0.5, 1.0, 2.0))
    assert plain - doubled == pytest.approx(np.log(2.0), abs=0.02)
    assert halved - plain == pytest.approx(np.log(2.0), abs=0.02)


def test_causes_share_what_is_likely_by_their_evidence() -> None:
    assert shares([CauseScore(np.ones(1)), CauseScore(np.zeros(1))]) == pytest.approx(np.array([np.e, 1.0]) / (1.0 + np.e))


def test_models_are_compared_under_the_noise_of_the_likelier_one() -> None:
    """What a worse model leaves is not taken for noise: noise that wanders would explain it as well, to 1 unit."""
    bad, good = CauseScore(np.array([-100.0, -9.0])), CauseScore(np.array([-2.0, -8.0]))
    assert noise_of([bad, good]) == 0
    assert shares([bad, good])[1] == pytest.approx(1.0)


@pytest.mark.parametrize("name", [n for n, s in SIZES.items() if s.middle and np.isfinite(s.high)])
def test_what_is_possible_is_the_middle_of_a_prior(name: str) -> None:
    """The ends of what hardware can have lie two standard deviations from the middle."""
    size = SIZES[name]
    assert np.log(size.high / size.middle) / size.spread == pytest.approx(2.0, abs=0.1)
    assert np.log(size.middle / size.low) / size.spread == pytest.approx(2.0, abs=0.1)


def test_a_score_in_one_noise_rests_on_runs_and_not_on_what_a_linearisation_promises() -> None:
    """From values that are far off to the likeliest ones, where a step promises nothing more; the score there counts no promise."""
    problem = build_problem(_asked())
    at = starting_point(problem.unknowns) + np.array([0.8, -0.5, *(0.0 for _ in problem.unknowns[2:])])
    score, end = weighed_in_noise(problem, at, {HTC: SizedValue(6.0, 1.0)}, 3)
    there = weighed_at(problem, end, {HTC: SizedValue(6.0, 1.0)})
    assert np.abs(end - at).max() > 0.3
    assert there.logs[3] - 0.5 < score.logs[3] <= there.logs[3]
    again, settled = weighed_in_noise(problem, end, {HTC: SizedValue(6.0, 1.0)}, 3)
    assert settled == pytest.approx(end)
    assert again.logs[3] == pytest.approx(score.logs[3])
