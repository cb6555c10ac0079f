"""Synthetic tests watched as they run: wrong stops, what they save, hidden masses, planted faults; `scripts/watch_table.py` counts more."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import beta

from recovery.watch_cases import (
    Outcome,
    alarmed,
    drawn,
    hiding,
    named,
    not_measured,
    off_as_assumed,
    off_by_a_tenth,
    quiet,
    stop_of,
    told_alike,
    watched,
)

CASES, HIDDEN, FAULTS, QUIET, OFF = 1000, 200, 40, 40, 20
LOOKS = (300.0, 600.0, 1200.0)


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_a_stop_is_right_and_saves_three_tenths(seed: int) -> None:
    found = watched(drawn(seed))
    assert found.stopped
    assert not found.wrong
    assert found.alarms == ()
    assert found.saving > 0.3


def test_a_hidden_slow_mass_is_declined() -> None:
    case = drawn(1)
    assert not watched(hiding(case, watched(case).at)).wrong


@pytest.mark.parametrize("seed", [3])
def test_a_planted_fault_is_named(seed: int) -> None:
    assert named(seed)


def test_the_band_of_a_node_without_a_sensor_holds_what_the_readings_leave_open() -> None:
    """Decks as far off as is assumed: without the errors of the fitted values the half-width was .026 K for errors of .4 K, none inside."""
    errors, halves = np.array([not_measured(off_as_assumed(seed), 2400.0) for seed in range(6)]).T
    assert np.count_nonzero(np.abs(errors) <= halves) >= 5
    assert 1.0 <= float(np.sqrt(np.mean(halves**2) / np.mean(errors**2))) <= 4.0


@pytest.mark.campaign
def test_bands_of_a_node_without_a_sensor() -> None:
    errors, halves = np.array([not_measured(off_as_assumed(seed), t) for seed in range(40) for t in (1200.0, 4800.0)]).T
    inside = int(np.count_nonzero(np.abs(errors) <= halves))
    print(f"{inside} of {errors.size} inside, RMS {np.sqrt(np.mean(errors**2)):.3f} K, median half {np.median(halves):.3f} K")
    assert beta.ppf(0.975, inside + 1, errors.size - inside) >= 0.95


def test_what_is_named_does_not_depend_on_how_often_one_looks() -> None:
    """Looks ten minutes apart named none of three faults that looks a minute apart name."""
    _same_at_all_looks(2, LOOKS[1:2])


def _same_at_all_looks(seed: int, looks: tuple[float, ...]) -> None:
    at_once = alarmed(seed, 60.0)
    assert all(told_alike(alarmed(seed, every), at_once, every) for every in looks)


@pytest.mark.parametrize("seed", [3])
def test_a_stop_is_advised_when_the_rule_is_met_though_the_deck_is_off(seed: int) -> None:
    found = stop_of(off_by_a_tenth(seed))
    assert found.at is not None
    assert found.at <= found.rule + 60.0
    assert not found.wrong


@pytest.fixture(scope="module")
def thousand() -> list[Outcome]:
    """What was done with a thousand tests."""
    return [watched(drawn(seed)) for seed in range(CASES)]


@pytest.mark.campaign
def test_stops_of_a_thousand_tests(thousand: list[Outcome]) -> None:
    stopped = [o for o in thousand if o.stopped]
    wrong = sum(o.wrong for o in stopped)
    assert wrong <= 0.01 * len(stopped)
    assert beta.ppf(0.95, wrong + 1, len(stopped) - wrong) <= 0.02
    assert np.median([o.saving for o in stopped]) >= 0.3
    assert sum(not o.stopped for o in thousand) <= 0.3 * len(thousand)


@pytest.mark.campaign
def test_hidden_masses() -> None:
    cases = [drawn(seed) for seed in range(HIDDEN)]
    assert np.mean([not watched(hiding(case, watched(case).at)).wrong for case in cases]) >= 0.95


@pytest.mark.campaign
def test_forty_planted_faults() -> None:
    assert sum(named(seed) for seed in range(FAULTS)) >= 36


@pytest.mark.campaign
def test_forty_planted_faults_at_all_looks() -> None:
    for seed in range(FAULTS):
        _same_at_all_looks(seed, LOOKS)


@pytest.mark.campaign
@pytest.mark.parametrize("every", [60.0, *LOOKS])
def test_false_alarms_of_240_hours(every: float) -> None:
    assert sum(any(look.alarms for look in quiet(seed, 6.0, every)) for seed in range(QUIET)) <= 1


@pytest.mark.campaign
def test_twenty_decks_off_by_a_tenth() -> None:
    found = [stop_of(off_by_a_tenth(seed)) for seed in range(OFF)]
    assert all(stop.at is not None and stop.at <= stop.rule + 60.0 for stop in found)
    assert sum(stop.wrong for stop in found) == 0
