"""How right fleets are: coverage of means, spreads and correlations, odd units, the next unit; kept seeds.

``python scripts/fleets.py linear --fleets 400`` draws fleets whose units are summarised already (linear and Gaussian: what follows the
last linearisation is exactly what is tested); ``network`` simulates a case with a board, fits and judges it. Every unit of a weak fleet
has, with a chance of 60 %, a log that is a hundredth as long and sees half as many directions.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import NormalDist

import numpy as np

from thermid.base.units import HALF_WIDTH_95, Array
from thermid.inference._fleet.population import FALSE_ALARMS, PopulationFit, Summaries, interval_of_mean, odd_units

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


def summaries(
    rng: np.random.Generator, units: int, weak: float, moved: float = 0.0, error: float = 0.33, added: bool = False
) -> tuple[Summaries, Array]:
    """Return what the units of a fleet say, and their values.

    One value of the first unit is ``moved`` spreads from the mean, or from where it was drawn. A whole log tells a value to about ``error``
    of its spread, with correlated errors.
    """
    values = rng.multivariate_normal(TRUE_MEANS, omega(), units)
    if moved:
        k = int(rng.integers(VALUES))
        values[0, k] = moved * TRUE_SPREADS[k] + (values[0, k] if added else TRUE_MEANS[k])
    slopes = rng.normal(size=(units, 40, VALUES)) / (error * TRUE_SPREADS) / np.sqrt(40.0)
    slopes[..., 1] += 0.7 * slopes[..., 0] * TRUE_SPREADS[0] / TRUE_SPREADS[1]
    short = rng.random(units) < weak
    short[0] &= not moved
    slopes[short] *= 0.1
    slopes[short, VALUES // 2 :, :] = 0.0
    information = np.einsum("nki,nkj->nij", slopes, slopes)
    score = np.einsum("nij,nj->ni", information, values) + np.einsum("nki,nk->ni", slopes, rng.normal(size=slopes.shape[:2]))
    return Summaries(information, score, np.repeat(np.eye(VALUES)[None], units, axis=0)), values


def fitted(said: Summaries) -> PopulationFit:
    """Return the population as a fleet fits it."""
    count = len(said.score)
    full = count >= FEWEST_UNITS * VALUES * (VALUES + 1) // 2
    return PopulationFit.fitted(said, np.ones((VALUES, VALUES), dtype=bool) if full else np.eye(VALUES, dtype=bool))


def covered(population: PopulationFit) -> Iterator[tuple[str, bool]]:
    """Yield the name of each number of a population, and whether its interval holds the truth (a profile below its threshold there)."""
    true, goal = omega(), HALF_WIDTH_95**2
    for k in range(VALUES):
        low, high, _ = interval_of_mean(population, np.eye(VALUES)[k])
        yield f"mean {k}", low <= TRUE_MEANS[k] <= high
        yield f"spread {k}", population.rise((k,), float(TRUE_SPREADS[k]))[0] <= goal
    for j, k in np.argwhere(np.tril(population.together, -1)).tolist():
        if population.together[j, k]:
            yield (
                f"correlation {j} {k}",
                population.rise((int(j), int(k)), float(true[j, k] / TRUE_SPREADS[j] / TRUE_SPREADS[k]))[0] <= goal,
            )


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


def named_by_oracle(fleets: int, units: int, seed: int, error: float, moved: float, added: bool) -> float:
    """Return how often one that knows the population names the odd unit, at as many false alarms as a fleet has."""
    limit, hits = NormalDist().inv_cdf(1.0 - FALSE_ALARMS / (2.0 * units * VALUES)), 0
    for k in range(fleets):
        said, _ = summaries(np.random.default_rng((seed, int(moved), k)), units, 0.0, moved, error, added)
        weights = np.linalg.inv(omega() + np.linalg.inv(said.information[0]))
        push = weights @ (np.linalg.solve(said.information[0], said.score[0]) - TRUE_MEANS)
        hits += bool(np.abs(push / np.sqrt(np.diag(weights))).max() > limit)
    return hits / fleets


def oddness(fleets: int, units: int, seed: int) -> None:
    """Print how often an odd unit is named, and any of a clean fleet."""
    for error, moved, added in [(e, m, a) for e in (0.33, 0.1) for m, a in ((6.0, False), (4.0, False), (4.0, True), (0.0, False))]:
        hit, other = 0, 0
        for k in range(fleets if moved else 3 * fleets):
            summed, _ = summaries(np.random.default_rng((seed, int(moved), k)), units, 0.0, moved, error, added)
            odd = {o.unit for o in odd_units(fitted(summed))}
            hit += 0 in odd and moved > 0.0
            other += bool(odd - {0} if moved else odd)
        where = f"unit at {moved:g}{' more than drawn' if added else ''}: named {100 * hit / fleets:.1f} %, another" if moved else "clean:"
        if moved:
            where = f"(an oracle {100 * named_by_oracle(fleets, units, seed, error, moved, added):.1f} %) {where}"
        print(f"  logs to {error:g} of a spread, {where} {100 * other / (fleets if moved else 3 * fleets):.1f} %", flush=True)


def next_unit(fleets: int, units: int, weak: float, seed: int) -> None:
    """Print the RMS error of the next unit's values from a fiftieth of a log, with the fleet and with the true population as prior."""
    kinds = ("fleet", "oracle", "fleet without correlations", "no prior")
    squares = np.zeros((len(kinds), VALUES))
    for k in range(fleets):
        rng = np.random.default_rng((seed, k))
        said, values = summaries(rng, units + 1, weak)
        population = fitted(said.without([units]))
        information = 0.02 * said.information[units]
        sizes, vectors = np.linalg.eigh(information)
        noise = (vectors * np.sqrt(np.maximum(sizes, 0.0))) @ rng.normal(size=VALUES)
        score = information @ values[units] + noise
        both = population.omega + population.at.spread
        priors = (population.at.beta, both), (TRUE_MEANS, omega()), (population.at.beta, np.diag(np.diag(both)))
        for n, (middle, wide) in enumerate((*priors, (TRUE_MEANS, np.diag(1e4 * TRUE_SPREADS**2)))):
            precision = np.linalg.inv(wide)
            found = np.linalg.solve(information + precision, score + precision @ middle)
            squares[n] += ((found - values[units]) / TRUE_SPREADS) ** 2
    rms = np.sqrt(squares.mean(axis=1) / fleets)
    said_so = ", ".join(f"{kind} {size:.3f} ({100 * (size / rms[1] - 1):+.1f} %)" for kind, size in zip(kinds, rms, strict=True))
    print(f"  unit {units + 1}, error in spreads, beside the oracle: {said_so}", flush=True)


def linear(fleets: int) -> None:
    """Print all figures of fleets that are summarised already."""
    coverage(fleets, 200, 0.0, 1)
    coverage(fleets, 200, 0.6, 2)
    coverage(fleets, 12, 0.0, 3)
    coverage(fleets, 12, 0.6, 4)
    oddness(fleets, 200, 5)
    next_unit(fleets, 200, 0.0, 6)
    next_unit(fleets, 200, 0.6, 7)


def network(fleets: int, units: int, weak: float, seed: int) -> None:
    """Print the coverage of fleets of simulated boxes, whose weak logs are four minutes of two hours."""
    sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
    import thermid as td
    from fleet_of_boxes import FREE, MEANS, MODEL, SPREADS, boxes

    goal, hits, sizes, begun = HALF_WIDTH_95**2, dict[str, list[bool]](), list[list[float]](), time.process_time()
    for k in range(fleets):
        logs, _ = boxes(units, 1000 * seed + k, weak)
        fleet = td.inference.fleet(MODEL, logs, FREE)
        sizes.append([fleet.values[path].spread / SPREADS[path] for path in FREE])
        for n, path in enumerate(FREE):
            value = fleet.values[path]
            hits.setdefault(f"mean {path}", []).append(value.low <= MEANS[path] <= value.high)
            hits.setdefault(f"spread {path}", []).append(fleet.population.rise((n,), SPREADS[path])[0] <= goal)
        hits.setdefault("correlation", []).append(fleet.population.rise((0, 1), 0.0)[0] <= goal)
    spent = time.process_time() - begun
    print(f"{fleets} simulated fleets of {units} boxes, {100 * weak:.0f} % of logs four minutes; {spent:.0f} s of processor time")
    print("  " + ", ".join(f"{name} {100 * float(np.mean(v)):.1f} %" for name, v in hits.items()), flush=True)
    print(f"  spreads over true ones, mean: {np.round(np.mean(sizes, axis=0), 3).tolist()}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=("linear", "network"))
    parser.add_argument("--fleets", type=int, default=400)
    chosen = parser.parse_args()
    if chosen.kind == "linear":
        linear(chosen.fleets)
    else:
        network(chosen.fleets, 30, 0.6, 1)
        network(chosen.fleets, 12, 0.0, 2)
