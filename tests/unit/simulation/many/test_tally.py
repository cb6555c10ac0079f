"""Counts of members: as exact as stated, and the same to the last bit in whatever order they come together."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from numpy.typing import NDArray

from thermid.simulation._many.tally import CountGrid, Tally

SHARES = (0.0, 0.01, 0.025, 0.3, 0.5, 0.975, 0.999, 1.0)
LAWS = ("normal", "two humps", "heavy tails", "sorted", "constant", "wide", "one pilot")


def drawn(law: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a pilot and values (rows, members) that it did not always foresee. [K]"""
    rng = np.random.default_rng(4)
    noise, rows = rng.standard_normal((3, 20_000)), np.array([[250.0], [300.123], [900.0]])
    values = {
        "normal": rows + [[0.02], [1.5], [80.0]] * noise,
        "two humps": rows + noise + 9.0 * (rng.random(noise.shape) < 0.3),
        "heavy tails": rows + rng.standard_cauchy(noise.shape).clip(-200.0, 1e5),
        "sorted": np.sort(rows + noise, axis=1),
        "constant": rows + 0.0 * noise,
        "wide": np.exp(rng.uniform(0.0, 13.8, noise.shape)),
        "one pilot": rows + noise,
    }[law]
    return values[:, : 1 if law == "one pilot" else 1000], values


def joined(parts: list[Tally]) -> Tally:
    whole = parts[0]
    for part in parts[1:]:
        whole = whole.joined(part)
    return whole


@pytest.mark.parametrize("law", LAWS)
def test_quantiles_and_moments_are_as_good_as_stated(law: str) -> None:
    pilot, values = drawn(law)
    grid = CountGrid.for_pilot(pilot)
    found, error = joined([Tally.of_values(grid, v) for v in np.array_split(values, 7, axis=1)]).quantiles(SHARES)
    exact = np.quantile(values, SHARES, axis=1)
    assert (np.abs(found - exact) <= error * (1.0 + 1e-9)).all()
    assert (error >= 2.0**-10).all()
    whole = Tally.of_values(grid, values)
    assert whole.mean == pytest.approx(values.mean(axis=1), rel=0.0, abs=2.0**-15)
    assert whole.sd == pytest.approx(values.std(axis=1, ddof=1), rel=1e-6, abs=2.0**-14)


@pytest.mark.parametrize("law", ["normal", "wide"])
def test_inside_the_pilots_range_a_bin_is_a_hundredth_of_the_spread(law: str) -> None:
    pilot, values = drawn(law)
    _, error = Tally.of_values(CountGrid.for_pilot(pilot), values).quantiles((0.025, 0.5, 0.9))
    assert (2.0 * error <= np.maximum(pilot.std(axis=1) / 100.0, 2.0**-9)).all()


def test_what_was_not_foreseen_is_counted_as_finely_as_it_is_far() -> None:
    pilot, values = drawn("heavy tails")
    found, error = Tally.of_values(CountGrid.for_pilot(pilot), values).quantiles((0.0, 0.999, 1.0))
    assert (error <= np.maximum(np.abs(found - np.median(values, axis=1)) / 100.0, 0.05)).all()
    late = drawn("sorted")
    found, error = Tally.of_values(CountGrid.for_pilot(late[0]), late[1]).quantiles((0.5, 0.99))
    assert (error <= 0.02).all()


@pytest.mark.parametrize("law", ["normal", "heavy tails", "sorted"])
def test_any_order_and_any_parts_give_the_same_bits(law: str) -> None:
    pilot, values = drawn(law)
    grid, rng, kept = CountGrid.for_pilot(pilot), np.random.default_rng(8), set()
    for _ in range(20):
        cuts = np.sort(rng.choice(np.arange(1, values.shape[1]), rng.integers(1, 12), replace=False))
        parts = [Tally.of_values(grid, v) for v in np.split(values, cuts, axis=1)]
        rng.shuffle(parts)  # type: ignore[arg-type]
        whole = joined(parts)
        kept.add(b"".join(x.tobytes() for x in (whole.counts, whole.sums, whole.keys, whole.beyond, *whole.quantiles(SHARES), whole.sd)))
    assert len(kept) == 1


def test_a_tally_travels_in_a_quarter_of_its_bytes() -> None:
    pilot, values = drawn("heavy tails")
    whole = Tally.of_values(CountGrid.for_pilot(pilot), values)
    sent = pickle.dumps(whole)
    again = pickle.loads(sent)
    assert len(sent) < 0.25 * whole.counts.nbytes + 4 * whole.keys.nbytes
    assert again.joined(whole).quantiles(SHARES)[0].tobytes() == whole.joined(again).quantiles(SHARES)[0].tobytes()
    assert np.array_equal(again.counts, whole.counts)


def test_a_table_of_many_rows_has_wider_bins_but_not_beyond_a_hundredth_of_the_range(monkeypatch: pytest.MonkeyPatch) -> None:
    from thermid.simulation._many import tally

    pilot, _ = drawn("normal")
    fine = CountGrid.for_pilot(pilot)
    monkeypatch.setattr(tally, "MOST_BINS", 600)
    coarse = CountGrid.for_pilot(pilot)
    assert coarse.bins.sum() < fine.bins.sum() / 2
    assert (np.ldexp(1.0, coarse.exponents) <= np.maximum(np.ptp(pilot, axis=1) / 100.0, 2.0**-9)).all()
