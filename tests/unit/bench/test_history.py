"""Readings kept in a bounded space: the latest as they came, older ones as means."""

from __future__ import annotations

import numpy as np

from thermid.bench.logger import History


def test_a_day_stays_small_and_true() -> None:
    made = History()
    for t in range(86_400):
        made.add(float(t), 20.0 + 1e-4 * t)
    times, values = made.arrays()
    assert times.size < 2500
    assert times[0] < 600.0
    assert (np.diff(times) > 0).all()
    np.testing.assert_allclose(values, 20.0 + 1e-4 * times, atol=1e-9)
    np.testing.assert_array_equal(np.diff(times[-900:]), 1.0)  # the latest are as they came


def test_means_weigh_every_reading_alike() -> None:
    rng = np.random.default_rng(5)
    made, given = History(), rng.normal(20.0, 1.0, 50_000)
    for t, value in enumerate(given):
        made.add(float(t), float(value))
    early = made._early
    stood_for = int(early[2].sum())
    assert stood_for + len(made._late) == given.size
    np.testing.assert_allclose(early[1] @ early[2] / stood_for, given[:stood_for].mean(), atol=1e-9)


def test_a_change_of_conditions_begins_anew() -> None:
    made = History()
    for t in range(5000):
        made.add(float(t), 20.0)
    made.clear()
    assert made.arrays()[0].size == 0
    made.add(5000.0, 21.0)
    assert made.arrays()[1].tolist() == [21.0]
