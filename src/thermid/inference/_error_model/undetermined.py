"""Values that no reading determines, and what a network can reach at all with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.fit.problem import Unknown
from thermid.inference._error_model.model import reach
from thermid.inference._error_model.sizes import DRAWN, OPEN, REACHED
from thermid.model.tree import Model
from thermid.simulation.runs import prepare
from thermid.simulation.scenarios import Scenario


def open_values(unknowns: Sequence[Unknown], deviations: Mapping[str, float]) -> list[str]:
    """Return the values of a fit whose posterior is nearly as wide as what was known before, the widest first.

    Parameters
    ----------
    deviations : dict   Value -> standard deviation that the readings leave it; fitted form.
    """
    left = {u.name: deviations[u.name] / _before(u)[1] for u in unknowns if u.kind == "parameter" and u.name in deviations}
    return sorted((n for n, part in left.items() if part > OPEN), key=lambda n: -left[n])


def _before(u: Unknown) -> tuple[float, float]:
    """Return mean and standard deviation of a value before any reading; fitted form."""
    if u.prior is not None:
        return u.prior.mean, u.prior.sd
    low, high = (float(x) for x in u.fitted_bounds())
    return (0.5 * (low + high) if np.isfinite(low + high) else u.to_fitted(u.start)), reach(u)


def reachable(
    model: Model, scenario: Scenario, unknowns: Sequence[Unknown], times: Array, nodes: Sequence[str]
) -> dict[str, tuple[Array, Array]]:
    """Return node -> temperatures (times,) below and above which 1 % of all values lead that some unknowns could have before. [K]"""
    rng, draws = np.random.default_rng(0), {}
    for u in unknowns:
        mean, sd = _before(u)
        low, high = u.fitted_bounds()
        drawn = np.clip(mean + sd * rng.standard_normal(DRAWN), low, high)
        draws |= {n: np.array([u.to_value(float(x)) for x in drawn]) for n in (u.name, *u.also)}
    ready = prepare(model, scenario, tuple(draws), times=times)
    many = ready.ensemble(ready.with_units(draws), nodes=list(nodes))
    ends = {n: np.nanquantile(many.temperatures(n), [REACHED, 1.0 - REACHED], axis=1) for n in nodes}
    return {n: (low, high) for n, (low, high) in ends.items()}
