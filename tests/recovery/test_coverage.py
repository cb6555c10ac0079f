"""A stated 95 % interval holds the truth in 95 % of cases: truths, sensors' and meters' errors drawn as the stated priors say."""

from __future__ import annotations

import numpy as np
import pytest

from recovery.cases import CASES, Z95, Outcome, draw, log, one_htc_mass, outcome
from thermid.fit.calibration import calibrate

pytestmark = pytest.mark.recovery

LEVEL, SIGMAS, SEED, REPEATS = 0.95, 3.5, 20260801, 24


def check(found: Outcome, seed: int = SEED) -> None:
    """Coverage within the scatter of a binomial, and the mean square of the scores within that of a chi-square."""
    draws = found.scores.shape[0]
    print(f"seed {seed}: {found}")
    wide = SIGMAS * np.sqrt(LEVEL * (1 - LEVEL) / draws)
    for path, share in found.coverage.items():
        assert abs(share - LEVEL) <= wide, f"{path}: {share:.3f}"
    squares = np.mean(found.scores**2, axis=0)
    assert np.all(np.abs(squares - 1.0) <= SIGMAS * np.sqrt(2.0 / draws)), squares


@pytest.mark.parametrize("case", ["one_htc_mass", "stack_interfaces"])
def test_coverage(case: str) -> None:
    check(outcome(CASES[case](), 12 if case == "stack_interfaces" else 32, SEED))


@pytest.mark.campaign
@pytest.mark.parametrize("case", CASES)
def test_coverage_in_a_thousand_cases(case: str) -> None:
    check(outcome(CASES[case](), 1000, SEED + 1), SEED + 1)


def test_the_check_can_fail() -> None:
    rng = np.random.default_rng(3)
    honest = rng.standard_normal((50, 2))
    check(Outcome(("x", "y"), honest))
    with pytest.raises(AssertionError):
        check(Outcome(("x", "y"), 2.0 * honest))  # errors half as large as they should be
    with pytest.raises(AssertionError):
        check(Outcome(("x", "y"), 0.3 * honest))  # errors three times too large


def test_the_random_error_alone_would_not_do() -> None:
    # meters and sensors have errors that no repeat shows: within the random error the truth is hardly ever found
    bench, rng, inside = one_htc_mass(), np.random.default_rng(SEED), []
    for _ in range(20):
        truth, records = draw(bench, rng)
        found = calibrate(bench.model, records, list(truth))
        inside += [abs(found[p].value - value) <= Z95 * found[p].error_random for p, value in truth.items()]
    assert np.mean(inside) <= 0.5


def test_the_random_error_is_the_scatter_of_a_repeat() -> None:
    bench, values, errors = one_htc_mass(), [], []
    truth, _ = draw(bench, np.random.default_rng(SEED))
    hidden = bench.model.with_values({p: f"{v!r} [{bench.ranges[p][2]}]" for p, v in truth.items()})
    for seed in range(REPEATS):
        bias, gain = {"T": 0.2, "ROOM": -0.1}, {"heat": 1.008}
        record = log(bench, hidden, 0, bias, gain, np.random.default_rng(seed))
        found = calibrate(bench.model, record, list(truth))
        values.append([found[p].value for p in truth])
        errors.append([found[p].error_random for p in truth])
    ratio = np.std(values, axis=0, ddof=1) / np.mean(errors, axis=0)
    print(f"scatter of {REPEATS} repeats over the stated random error: {ratio.round(2).tolist()}")
    assert np.all(np.abs(ratio - 1.0) <= SIGMAS / np.sqrt(2 * (REPEATS - 1)))
