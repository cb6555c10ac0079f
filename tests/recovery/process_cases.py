"""Synthetic houses with noise on the wall, fitted by the filter: how far values are off in their errors, whether innovations are white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from thermid.fit._estimation.estimate import likelihood_of
from thermid.fit._estimation.filtering import whiteness
from thermid.fit._estimation.process import read_process
from thermid.fit.calibration import Request, build_problem
from unit.fit.estimation.house import VALUES, Array, Truth, drawn, house

NAMES: Final = (*VALUES, "noise of wall", "reading noise of indoor")
SHARE: Final = (0.931, 0.967)
"""Between which the share of a thousand 95 % intervals that hold the truth lies with a probability of 99 %."""
INSIDE: Final = 1.959964


@dataclass(frozen=True, eq=False)
class Fitted:
    """What a fit of one log made of it.

    Parameters
    ----------
    off : array (6,)    Found less true, in the fitted (logarithmic) forms, over the standard error. [-]
    said : array (6,)   The standard errors. [-]
    white : bool        Whether neighbouring innovations are uncorrelated.
    converged : bool
    """

    off: Array
    said: Array
    white: bool
    converged: bool


def fitted(seed: int, samples: int) -> Fitted:
    """Return what a fit makes of a log of half-hourly samples; values, noises and the start of the search are drawn about the house's."""
    r = np.random.default_rng(10_000 + seed)
    values = {n: v * np.exp(0.3 * r.normal()) for n, (v, _) in VALUES.items()}
    truth = Truth(values, 1.5e-3 * np.exp(0.3 * r.normal()), 0.035 * np.exp(0.3 * r.normal()))
    case = drawn(truth, seed, samples)
    start = {n: v * np.exp(0.3 * r.normal()) for n, v in values.items()}
    problem = build_problem(Request(house(start), (case.record,), tuple(VALUES), {"*": case.scenario}, name="house", fit_start=False))
    noises = read_process({"wall": "free"}, problem.experiments[0].network, "house")
    likelihood = likelihood_of(problem, noises, {"wall": 0.1, "indoor": 0.1})
    maximum = likelihood.maximise(likelihood.start)
    known, said = np.log([*values.values(), truth.sigma_w, truth.sigma_v]), maximum.errors()
    innovations = likelihood.passing(0, [maximum.fitted]).run().innovations
    white = whiteness("indoor", innovations.standard[:, 0]).white
    return Fitted((maximum.fitted - known) / said, said, white, maximum.converged)


def shares(found: Sequence[Fitted]) -> dict[str, float]:
    """Return the share of the 95 % intervals that hold the truth, of each value. [-]"""
    inside = np.mean(np.abs([f.off for f in found]) < INSIDE, axis=0)
    return dict(zip(NAMES, map(float, inside), strict=True))


def rejected(found: Sequence[Fitted]) -> float:
    """Return the share of the logs whose innovations are not white by the criterion, at the 99 % level. [-]"""
    return float(np.mean([not f.white for f in found]))
