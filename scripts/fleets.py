"""How right fleets are: coverage of means, spreads and correlations, odd units, the next unit; kept seeds.

``python scripts/fleets.py linear --fleets 400`` draws fleets whose units are summarised already (linear and Gaussian: what follows the
last linearisation is exactly what is tested); ``network`` simulates a case with a board, fits and judges it. Every unit of a weak fleet
has, with a chance of 60 %, a log that is a hundredth as long and sees half as many directions.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np

from thermid.base.linear_algebra import HALF_WIDTH_95, Array
from thermid.inference._fleet.intervals import interval_of_mean, odd_units
from thermid.inference._fleet.population import Population, Summaries

VALUES = 6
TRUE_SPREADS = np.array([0.10, 0.05, 0.20, 0.10, 0.30, 0.08])
TRUE_MEANS = np.array([0.2, -0.1, 0.4, 0.0, 1.0, -0.5])
TRUE_CORRELATIONS = np.array([0.6, -0.4, 0.3, 0.0, 0.5, 0.2])
"""Loadings of a common factor: correlations are products of two, so both signs and zeros are among them."""
FEWEST_UNITS = 3
"""Units per number of Omega from which correlations are estimated, as in a fleet."""


def omega() -> Array:
    """Return the true covariance (values, values)."""
    together = np.outer(TRUE_CORRELATIONS, TRUE_CORRELATIONS)
    np.fill_diagonal(together, 1.0)
    return np.asarray(together * np.outer(TRUE_SPREADS, TRUE_SPREADS))


def summaries(rng: np.random.Generator, units: int, weak: float, moved: float = 0.0) -> tuple[Summaries, Array]:
    """Return what the units of a fleet say, and their values; the first one is ``moved`` spreads in one value."""
    values = rng.multivariate_normal(TRUE_MEANS, omega(), units)
    if moved:
        k = int(rng.integers(VALUES))
        values[0, k] = TRUE_MEANS[k] + moved * TRUE_SPREADS[k]
    # a log of 40 effective readings tells a value to a third of its spread, with correlated errors
    slopes = rng.normal(size=(units, 40, VALUES)) / (0.33 * TRUE_SPREADS) / np.sqrt(40.0)
    slopes[..., 1] += 0.7 * slopes[..., 0] * TRUE_SPREADS[0] / TRUE_SPREADS[1]
    short = rng.random(units) < weak
    short[0] &= not moved
    slopes[short] *= 0.1
    slopes[short, VALUES // 2 :, :] = 0.0
    information = np.einsum("nki,nkj->nij", slopes, slopes)
    score = np.einsum("nij,nj->ni", information, values) + np.einsum("nki,nk->ni", slopes, rng.normal(size=slopes.shape[:2]))
    return Summaries(information, score, np.repeat(np.eye(VALUES)[None], units, axis=0)), values


def fitted(said: Summaries) -> Population:
    """Return the population as a fleet fits it."""
    count = len(said.score)
    full = count >= FEWEST_UNITS * VALUES * (VALUES + 1) // 2
    return Population.fitted(said, np.ones((VALUES, VALUES), dtype=bool) if full else np.eye(VALUES, dtype=bool))


def covered(population: Population) -> Iterator[tuple[str, bool]]:
    """Yield the name of each number of a population, and whether its interval holds the truth (a profile below its threshold there)."""
    true, goal = omega(), HALF_WIDTH_95**2
    for k in range(VALUES):
        low, high, _ = interval_of_mean(population, np.eye(VALUES)[k])
        yield f"mean {k}", low <= TRUE_MEANS[k] <= high
        yield f"spread {k}", population.rise((k,), float(TRUE_SPREADS[k]))[0] <= goal
    for j, k in zip(*np.tril_indices(VALUES, -1), strict=True):
        if population.together[j, k]:
            yield f"correlation {j} {k}", population.rise((int(j), int(k)), float(true[j, k] / TRUE_SPREADS[j] / TRUE_SPREADS[k]))[0] <= goal


def coverage(fleets: int, units: int, weak: float, seed: int) -> None:
    """Print the coverage by kind and the range over parameters."""
    hits: dict[str, list[bool]] = {}
    begun = time.process_time()
    for k in range(fleets):
        said, _ = summaries(np.random.default_rng((seed, k)), units, weak)
        for name, inside in covered(fitted(said)):
            hits.setdefault(name, []).append(inside)
    print(f"{fleets} fleets of {units} units, {100 * weak:.0f} % weak; {time.process_time() - begun:.0f} s of processor time")
    for kind in dict.fromkeys(n.split()[0] for n in hits):
        shares = [100.0 * float(np.mean(v)) for n, v in hits.items() if n.split()[0] == kind]
        print(f"  {kind:<12} {np.mean(shares):5.1f} %   each {min(shares):.1f} to {max(shares):.1f} %", flush=True)


def oddness(fleets: int, units: int, seed: int) -> None:
    """Print how often an odd unit is named, and any of a clean fleet."""
    for moved in (6.0, 4.0, 0.0):
        hit, other = 0, 0
        for k in range(fleets):
            said, _ = summaries(np.random.default_rng((seed, int(moved), k)), units, 0.0, moved)
            found = {o.unit for o in odd_units(fitted(said))}
            hit += 0 in found and moved > 0.0
            other += bool(found - {0} if moved else found)
        print(f"  unit at {moved:g} spreads: named {100 * hit / fleets:.1f} %, another {100 * other / fleets:.1f} %", flush=True)


def next_unit(fleets: int, units: int, weak: float, seed: int) -> None:
    """Print the RMS error of the 201st unit's values, its log short, with the fleet as prior and with the true population as prior."""
    squares = np.zeros((4, VALUES))
    for k in range(fleets):
        said, values = summaries(np.random.default_rng((seed, k)), units + 1, weak)
        _, pushed = summaries(np.random.default_rng((seed, k, 1)), 1, 1.0)
        del pushed
        population = fitted(said.without([units]))
        information, score = said.information[units] * 0.02, said.score[units] * 0.0
        slopes = np.linalg.cholesky(information + 1e-12 * np.eye(VALUES))
        score = information @ values[units] + slopes @ np.random.default_rng((seed, k, 2)).normal(size=VALUES)
        both = population.omega + population.at.spread
        for n, (middle, wide) in enumerate(
            (
                (population.at.beta, both),
                (TRUE_MEANS, omega()),
                (population.at.beta, np.diag(np.diag(both))),
                (population.at.beta, np.diag(np.full(VALUES, 1e6))),
            )
        ):
            precision = np.linalg.inv(wide)
            found = np.linalg.solve(information + precision, score + precision @ middle)
            squares[n] += ((found - values[units]) / TRUE_SPREADS) ** 2
    rms = np.sqrt(squares.mean(axis=1) / fleets)
    print(f"  unit {units + 1} with a fiftieth of a log, error in spreads: fleet {rms[0]:.3f}, oracle {rms[1]:.3f}", end="")
    print(f" (+{100 * (rms[0] / rms[1] - 1):.1f} %), fleet without correlations {rms[2]:.3f}, alone {rms[3]:.2f}", flush=True)


def linear(fleets: int) -> None:
    """Print all figures of fleets that are summarised already."""
    coverage(fleets, 200, 0.0, 1)
    coverage(fleets, 200, 0.6, 2)
    coverage(fleets, 12, 0.0, 3)
    coverage(fleets, 12, 0.6, 4)
    oddness(fleets, 200, 5)
    next_unit(fleets, 200, 0.6, 6)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=("linear", "network"))
    parser.add_argument("--fleets", type=int, default=400)
    given = parser.parse_args()
    linear(given.fleets)
