"""Synthetic houses with noise on the wall: 95 % intervals hold each truth as often as they say, and innovations are white."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from thermid.estimation.estimate import likelihood_of
from thermid.estimation.filtering import whiteness
from thermid.estimation.process import read_process
from thermid.fit.problem.gather import build_problem
from thermid.fit.problem.request import Request
from unit.estimation.house import VALUES, Truth, drawn, house

CASES, SAMPLES = 1000, 1000
SHARE = (0.931, 0.967)


def fitted(seed: int, samples: int) -> tuple[Any, bool]:
    """Return how many errors each value is off, values and both noises, and whether the innovations are white."""
    r = np.random.default_rng(10_000 + seed)
    values = {n: v * np.exp(0.3 * r.normal()) for n, (v, _) in VALUES.items()}
    truth = Truth(values, 1.5e-3 * np.exp(0.3 * r.normal()), 0.035 * np.exp(0.3 * r.normal()))
    case = drawn(truth, seed, samples)
    off = {n: v * np.exp(0.3 * r.normal()) for n, v in values.items()}
    problem = build_problem(Request(house(off), (case.record,), tuple(VALUES), {"*": case.scenario}, name="house", fit_start=False))
    noises = read_process({"wall": "free"}, problem.experiments[0].network, "house")
    likelihood = likelihood_of(problem, noises, {"wall": 0.1, "indoor": 0.1})
    maximum = likelihood.maximise(likelihood.start)
    assert maximum.converged
    known = np.log([*values.values(), truth.sigma_w, truth.sigma_v])
    innovations = likelihood.passing(0, [maximum.fitted]).run().innovations
    return (maximum.fitted - known) / maximum.errors(), whiteness("indoor", innovations.standard[:, 0]).white


def test_a_few_cases() -> None:
    """Six values of ten houses: their errors in units of what is said have a size of one, by the 99.9 % range of chi-square."""
    found = [fitted(seed, 300) for seed in range(2000, 2010)]
    apart = np.array([z for z, _ in found])
    assert 0.4 < float(np.mean(apart**2)) < 1.9
    assert sum(white for _, white in found) >= 9


@pytest.mark.campaign
def test_coverage_of_a_thousand_cases() -> None:
    found = [fitted(seed, SAMPLES) for seed in range(CASES)]
    inside = np.mean(np.abs([z for z, _ in found]) < 1.959964, axis=0)
    assert (inside > SHARE[0]).all(), inside
    assert (inside < SHARE[1]).all(), inside
    # of white innovations one in a hundred fails at one per cent: 99 % range of 1000
    assert np.mean([white for _, white in found]) > 0.981
