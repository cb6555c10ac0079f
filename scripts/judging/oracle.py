"""The oracle of the benches: the true law, the true distributions of everything drawn, the noise; no band can be expected to be better.

Everything drawn is a vector z of independent standard normal numbers: logarithms of values, offsets, the factor of the meter, the room's
wander in each run at knots (through the Cholesky factor of its covariance). Gauss-Newton to the maximum, then the covariance there; the
derivatives by differences, all benches and directions in one run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from . import benches as b

Array = np.ndarray
KNOT, STEPS, STRIDE, MOVE = 900.0, 6, 1.0, 1e-3
"""Between knots of the room's wander [s]; Gauss-Newton steps, how far each may go in every number, difference of a number. [-]"""
LEVEL = 1.959963984540054


@dataclass(frozen=True)
class _Numbers:
    """Name -> where its numbers stand among z, for values, instruments, and runs."""

    at: Mapping[str, slice]
    size: int


def _numbers(family: b.Family, runs: tuple[str, ...]) -> _Numbers:
    at: dict[str, slice] = {}
    size = 0

    def add(name: str, count: int) -> None:
        nonlocal size
        at[name] = slice(size, size + count)
        size += count

    for name in b.SPREADS:
        add(name, 1)
    if "emissivity" not in family.truth:
        add("emissivity", 1)
    add("offsets", 2)
    add("factor", 1)
    add("room offset", 1)
    for run in runs:
        if family.drift:
            add(f"{run}: wander", int(b.COURSES[run].seconds / KNOT) + 1)
        if family.by_run:
            add(f"{run}: by run", 2)
    return _Numbers(at, size)


def _wander(times: Array) -> Array:
    """Return what the numbers of a run's knots are at its times (times, knots), of unit variance. [-]"""
    knots = np.arange(0.0, times[-1] + 1.0, KNOT)
    factor = np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots) / b.MEMORY))
    hats = np.array([np.interp(times, knots, row) for row in np.eye(knots.size)]).T
    return np.asarray(hats @ factor)


def _run(made: b.Benches, name: str, numbers: _Numbers, z: Array) -> Array:
    """Return true temperatures (times, benches, members, 2) at numbers z (benches, members, size). [K]"""
    family, logs, at = made.family, made.runs[name], numbers.at
    count, members, _ = z.shape
    values = {n: b.MIDDLES[n] * family.factors.get(n, 1.0) * np.exp(sd * z[..., at[n]][..., 0]) for n, sd in b.SPREADS.items()}
    if "emissivity" in at:
        values["emissivity"] = np.clip(b.MIDDLES["emissivity"] + b.EMISSIVITY_SPREAD * z[..., at["emissivity"]][..., 0], 0.5, 1.0)
    constants = {n: made.values[n][0] for n in ("exponent", "growth", "hidden", "hidden capacitance")} | dict(family.truth)
    values |= {n: np.full((count, members), x) for n, x in constants.items()}
    if family.by_run:
        own = np.exp(family.by_run * z[..., at[f"{name}: by run"]])
        values["contact"], values["natural"] = values["contact"] * own[..., 0], values["natural"] * own[..., 1]
    room = logs.room[:, :, None] - b.ROOM_OFFSET * z[..., at["room offset"]][None, ..., 0]
    if family.drift:
        room = room + family.drift * np.einsum("tk,bmk->tbm", _wander(logs.times), z[..., at[f"{name}: wander"]])
    factor = (1.0 + b.FACTOR * z[..., at["factor"]][..., 0]) * family.meter.get(name, 1.0)
    power = logs.power[:, :, None] / factor
    flat = (logs.times.size, count * members)
    found = b.temperatures({n: x.reshape(-1) for n, x in values.items()}, power.reshape(flat), room.reshape(flat), b.COURSES[name].vacuum)
    return found.reshape(logs.times.size, count, members, 2)


def _linear(made: b.Benches, name: str, numbers: _Numbers, z: Array) -> tuple[Array, Array]:
    """Return temperatures (times, benches, 2) at z (benches, size) and their derivatives (times, benches, 2, size)."""
    moved = np.repeat(z[:, None, :], numbers.size + 1, axis=1)
    moved[:, 1:, :] += MOVE * np.eye(numbers.size)
    found = _run(made, name, numbers, moved)
    return found[:, :, 0], np.moveaxis(found[:, :, 1:] - found[:, :, :1], 2, 3) / MOVE


CHUNK = 25
"""Benches that are run at once."""


@lru_cache(maxsize=8)
def _posterior(made: b.Benches, first: int) -> tuple[_Numbers, Array, Array]:
    """Return the numbers, their most likely values (benches, size) and covariances (benches, size, size) of some of the benches."""
    part = _part(made, first)
    numbers = _numbers(part.family, b.FITTED)
    z = np.zeros((part.count, numbers.size))
    eye = np.eye(numbers.size)
    for _ in range(STEPS):
        know, pull = np.repeat(eye[None], part.count, axis=0), np.zeros_like(z)
        for name in b.FITTED:
            values, slopes = _linear(part, name, numbers, z)
            slopes = slopes[:: b.THIN].copy()
            slopes[..., numbers.at["offsets"]] += b.OFFSET * np.eye(2)
            read = values[:: b.THIN] + b.OFFSET * z[:, numbers.at["offsets"]]
            off = part.runs[name].readings - read + np.einsum("tbnk,bk->tbn", slopes, z)
            know = know + np.einsum("tbnk,tbnl->bkl", slopes, slopes) / b.NOISE**2
            pull = pull + np.einsum("tbnk,tbn->bk", slopes, off) / b.NOISE**2
        z = z + np.clip(np.linalg.solve(know, pull[..., None])[..., 0] - z, -STRIDE, STRIDE)
    return numbers, z, np.linalg.inv(know)


def _part(made: b.Benches, first: int) -> b.Benches:
    own = slice(first, first + CHUNK)
    runs = {n: b.Logs(r.times, r.power[:, own], r.room[:, own], r.truth[:, own], r.readings[:, own]) for n, r in made.runs.items()}
    return b.Benches(made.family, made.seed, {n: x[own] for n, x in made.values.items()}, runs)


@lru_cache(maxsize=8)
def oracle_bands(made: b.Benches, name: str) -> tuple[Array, Array]:
    """Return centre and half-width (times, benches, 2) of the truth of a run, of all benches. [K]"""
    out = []
    for first in range(0, made.count, CHUNK):
        part = _part(made, first)
        known, z, covariance = _posterior(made, first)
        numbers = _numbers(part.family, (*b.FITTED, name))
        own = numbers.size - known.size
        wide = np.concatenate([z, np.zeros((part.count, own))], axis=1)
        centre, slopes = _linear(part, name, numbers, wide)
        shared, fresh = slopes[..., : known.size], slopes[..., known.size :]
        variance = np.einsum("tbnk,bkl,tbnl->tbn", shared, covariance, shared) + np.sum(fresh**2, axis=-1)
        out.append((centre, LEVEL * np.sqrt(variance)))
    return np.concatenate([c for c, _ in out], axis=1), np.concatenate([h for _, h in out], axis=1)


@lru_cache(maxsize=8)
def reachable(made: b.Benches, name: str, draws: int = 200) -> tuple[Array, Array]:
    """Return the lowest and highest temperature (benches, 2) that 1 % and 99 % of the stated spreads let a run reach. [K]

    By the plain truth's law for decks of every structure, at the logged power and room; runs of families that bend it reach other places.
    """
    rng = np.random.default_rng(made.seed)
    plain = b.Benches(b.FAMILIES["right, drift 0"], made.seed, made.values, made.runs)
    numbers = _numbers(plain.family, ())
    z = rng.standard_normal((draws, numbers.size))
    one = made.runs[name]
    first = b.Logs(one.times, one.power[:, :1], one.room[:, :1], one.truth[:, :1], one.readings[:, :1])
    constants = {"exponent": 1.25, "growth": 0.01, "hidden": 0.0, "hidden capacitance": 150.0}
    values = {n: np.array([constants.get(n, 0.0)]) for n in made.values}
    only = b.Benches(plain.family, made.seed, values, {name: first})
    found = _run(only, name, numbers, z[None])[:, 0]
    low, high = np.quantile(found, 0.01, axis=1).min(axis=0), np.quantile(found, 0.99, axis=1).max(axis=0)
    ones = np.ones((made.count, 1))
    return ones * low, ones * high
