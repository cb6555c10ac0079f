"""A stated 95 % interval holds the truth in 95 % of cases: truths, sensors' and meters' errors drawn as the stated priors say."""

from __future__ import annotations

import numpy as np
import pytest

from recovery.cases import CASES, Outcome, outcome

pytestmark = pytest.mark.recovery

LEVEL, SIGMAS, SEED = 0.95, 3.5, 20260801


def check(found: Outcome) -> None:
    """Coverage within the scatter of a binomial, and the mean square of the scores within that of a chi-square."""
    draws = found.scores.shape[0]
    print(f"seed {SEED}: {found}")
    wide = SIGMAS * np.sqrt(LEVEL * (1 - LEVEL) / draws)
    for path, share in found.coverage.items():
        assert abs(share - LEVEL) <= wide, f"{path}: {share:.3f}"
    squares = np.mean(found.scores**2, axis=0)
    assert np.all(np.abs(squares - 1.0) <= SIGMAS * np.sqrt(2.0 / draws)), squares


@pytest.mark.parametrize("case", CASES)
def test_coverage(case: str) -> None:
    check(outcome(CASES[case](), 50, SEED))


@pytest.mark.campaign
@pytest.mark.parametrize("case", CASES)
def test_coverage_in_a_thousand_cases(case: str) -> None:
    check(outcome(CASES[case](), 1000, SEED + 1))


def test_the_check_can_fail() -> None:
    rng = np.random.default_rng(3)
    honest = rng.standard_normal((50, 2))
    check(Outcome(("x", "y"), honest))
    with pytest.raises(AssertionError):
        check(Outcome(("x", "y"), 2.0 * honest))  # errors half as large as they should be
    with pytest.raises(AssertionError):
        check(Outcome(("x", "y"), 0.3 * honest))  # errors three times too large


def test_an_error_that_leaves_the_sensor_out_would_not_do() -> None:
    # the random error of the same fits: without the constant error of the sensor the interval nearly never holds the truth
    from recovery.cases import Z95, draw, one_htc
    from thermid.identify.calibrate import calibrate

    bench, rng, inside = one_htc(), np.random.default_rng(SEED), 0
    for _ in range(20):
        truth, records = draw(bench, rng)
        ((path, value),) = truth.items()
        found = calibrate(bench.model, records, [path])[path]
        inside += abs(found.value - value) <= Z95 * found.error_random
    assert inside <= 8
