"""Clocks that a fit has to find: errors of clock and values beside those of a fit that knows the clock and every instant."""

from __future__ import annotations

import numpy as np
import pytest

from recovery.clock_cases import FREE, RANGE, drawn
from thermid.inference import criticise

pytestmark = [pytest.mark.recovery, pytest.mark.usefixtures("values_alone")]
PRIOR_SD = (RANGE[1] - RANGE[0]) / 12.0**0.5


def claims(seeds: range) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return deviations over errors (seeds, clock and values), errors of clocks [s], and errors of values over those of the oracle."""
    deviations, clocks, ratios = [], [], []
    for seed in seeds:
        case = drawn(seed)
        fit, oracle = case.fit(known=False), case.fit(known=True)
        (clock,) = fit.local
        off = [(fit[p].value - case.values[p]) / fit[p].error for p in FREE]
        deviations.append([(clock.value - case.offset) / clock.error, *off])
        clocks.append(clock.error)
        ratios.append([fit[p].error / oracle[p].error for p in FREE])
    return np.array(deviations), np.array(clocks), np.array(ratios)


def test_an_open_clock_is_known_better_than_before_the_readings_and_costs_the_values_little() -> None:
    """Unknown instants were added as variance beside the offset that they share: 61 s for a range of +-60 s, and values to 16 %."""
    deviations, clocks, ratios = claims(range(3))
    assert (clocks < 0.5 * PRIOR_SD).all()
    assert (clocks > 60.0 / (12.0 * 6) ** 0.5).all()  # at most five changes, each anywhere in 60 s
    assert np.median(ratios) < 4.0
    assert np.sqrt(np.mean(deviations**2)) < 1.6


def first_named(seed: int, error: float) -> str:
    """Return the cause that is named first where the clock of exact powers is stated wrongly by some seconds; empty for none."""
    best = criticise(drawn(seed).with_stated_clock(error), elements=True).suggested
    return best.name if best is not None else ""


def test_a_wrong_offset_of_a_joined_log_is_a_candidate() -> None:
    assert first_named(0, -38.0).startswith("a wrong offset")


@pytest.mark.campaign
def test_of_twenty_wrong_offsets_nineteen_are_named_first_and_none_of_twenty_right_ones() -> None:
    errors = [(-1.0) ** seed * float(np.random.default_rng(seed).uniform(5.0, 60.0)) for seed in range(20)]
    assert sum(first_named(seed, error).startswith("a wrong offset") for seed, error in enumerate(errors)) >= 18
    assert not any(first_named(seed, 0.0) for seed in range(20))


@pytest.mark.campaign
def test_intervals_of_clock_and_values_hold_the_truth_in_thirty_logs() -> None:
    deviations, clocks, ratios = claims(range(100, 130))
    inside = np.mean(np.abs(deviations) < 1.96, axis=0)
    print(inside, np.median(clocks), np.median(ratios, axis=0))
    assert (inside >= 0.95 - 2.576 * (0.95 * 0.05 / 30.0) ** 0.5).all()
    assert (clocks < 0.5 * PRIOR_SD).all()
