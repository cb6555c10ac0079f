"""Unknown power: the history of a load from the temperatures that it made, with its uncertainty and its resolution in time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError, NameNotFoundError, nearest
from thermid.fit.problem.gather import build_problem
from thermid.fit.problem.request import Request, priors_of
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import Influence, Unknown
from thermid.linear_algebra import Array
from thermid.measure import Record
from thermid.model.laws.signal import Constant, TableSignal, literal
from thermid.model.parts.elements import HeatLoad
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.power.history import PowerHistory, watts, with_load
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.transient import simulate
from thermid.units import unit

PRIORS = ("auto", "walk", "integrated walk")
KNOTS = 120
WIDE = 30.0
"""The history is held to zero by this many times the power that the deck gives (1 W at least), so that every prior is a proper one."""
ROUNDS = 12


@takes_objects
def power_history(
    model: Model,
    record: Record,
    load: str,
    *,
    scenario: Scenario | None = None,
    known: Sequence[tuple[str, str, str]] = (),
    accuracy: str = "0.1 [%]",
    free: Sequence[str] = (),
    priors: Mapping[str, tuple[str, str] | str] | None = None,
    every: str = "",
    prior: str = "auto",
) -> PowerHistory:
    """Input estimation: the history of a load's power from a log of temperatures.

    The power is piecewise linear over even knots. Its prior is a random walk, or the integral of one, whose strength has the largest
    marginal likelihood (Wahba, Ann. Stat. 13 (1985) 1378; MacKay, Neural Comp. 4 (1992) 415). With the kernel's derivatives a step is exact
    where the network is linear, and one of Gauss and Newton where it is not.

    Parameters
    ----------
    model : Model           What the hardware is.
    record : Record         Temperatures, and boundaries and powers of other loads.
    load : str              The load whose power is unknown; what its deck says of it is not used.
    scenario : Scenario     What the log does not say.
    known : sequence        (from, to, power) of stretches in which the power was known, texts with units, times from the first sample.
    accuracy : str          Standard deviation of these powers: a text in W, or relative in %.
    free : sequence of str  Parameters fitted with the history; stretches of known power are what they are known by.
    priors : dict           Path -> (mean, standard deviation), as in `calibrate`.
    every : str             Spacing of the knots; a 120th of the log, or its sampling where that is coarser, by default.
    prior : str             ``walk`` (for powers that jump), ``integrated walk`` (for smooth ones), or ``auto``: the likelier.

    Raises
    ------
    IdentificationError     When there is no such prior, a stretch lies outside the log, or parameters are free without any known power.
    NameNotFoundError       When there is no such load.
    """
    if prior not in PRIORS:
        raise IdentificationError(f"there is no prior '{prior}'; there are {', '.join(PRIORS)}.", "power_history")
    where = f"power of {load}"
    path, model = _plain(model, load)
    if free and not known and not priors:
        raise IdentificationError(
            "without a stretch of known power only ratios to the power can be found, so no parameter can be free. Give 'known' or a prior.",
            where,
        )
    if any(len(stretch) != 3 or isinstance(stretch, str) for stretch in known):
        raise IdentificationError("'known' is a list of stretches (from, to, power), such as [('0 [h]', '1 [h]', '5 [W]')].", where)
    logged = next((n for n, c in record.channels.items() if c.role in ("load", "auto") and (c.target or n) in (load, path)), "")
    if logged:
        raise IdentificationError(f"channel '{logged}' of '{record.name}' already gives this power. Leave it out.", where)
    knots, pins = _knots(record, every, known, accuracy, where)
    nominal = compile_network(model).flat.parameters.evaluate({}).get(f"{path}.power", 0.0)
    base = WIDE * max(abs(float(nominal)), 1.0)
    asked, basis = _asked(model, record, path, scenario, free, priors, knots)
    problem = build_problem(asked)
    hats = tuple(Unknown(n, "power", (Influence(0, f"scale.{n}"),), 0.0, unit="W") for n in basis)
    problem = replace(problem, unknowns=(*problem.unknowns, *hats), noise=dict(problem.noise))
    found = solved(problem, knots, pins, base, PRIORS[1:] if prior == "auto" else (prior,))
    return _history(asked, problem, path, knots, pins, found)


def _plain(model: Model, load: str) -> tuple[str, Model]:
    """Return the load's path, and the model in which it is a plain power."""
    path = model.canonical(load)
    loads = {found.path: found for found in compile_network(model).flat.loads}
    if path not in loads:
        raise NameNotFoundError(f"no load '{load}' in {model.title}.{nearest(load, loads)}", model.title)
    given = model.at(path)
    assert isinstance(given, HeatLoad)
    fields = {k: v for k, v in given.fields.items() if k == "power"}
    plain = replace(given, fields=fields, sensor="", curve=None) if fields else watts(given.into, power="1 [W]")
    return path, with_load(model, path, plain)


def _knots(record: Record, every: str, known: Sequence[tuple[str, str, str]], accuracy: str, where: str) -> tuple[Array, Pins]:
    """Return the times of the knots from the first sample [s], two close together where a stretch of known power begins or ends."""
    end = float(record.times[-1] - record.times[0])
    step = literal(every, "s", where) if every else max(end / KNOTS, float(np.median(np.diff(record.times))))
    if not 0 < step <= end / 4:
        raise IdentificationError(f"knots every {step:g} s do not fit into a log of {end:g} s; give four intervals or more.", where)
    stretches = [(literal(a, "s", where), literal(b, "s", where), literal(p, "W", where)) for a, b, p in known]
    for first, last, _ in stretches:
        if not -1e-9 <= first < last <= end * (1 + 1e-9):
            raise IdentificationError(f"the power was known from {first:g} to {last:g} s, which is no part of a log of {end:g} s.", where)
    cuts = np.unique(np.clip([0.0, end, *(t for a, b, _ in stretches for t in (a, b))], 0.0, end))
    parts: list[Array] = []
    at: list[int] = []
    power: list[float] = []
    for left, right in pairwise(cuts.tolist()):
        part = np.linspace(left, right, max(2, round((right - left) / step) + 1))
        part[0] += 1e-3 * step if parts else 0.0  # a jump
        said = [p for a, b, p in stretches if a <= 0.5 * (left + right) <= b]
        if said:
            at += range(sum(map(len, parts)), sum(map(len, parts)) + part.size)
            power += [said[-1]] * part.size
        parts.append(part)
    relative = accuracy.rstrip(" ]").endswith(("%", "[%"))
    sizes = np.abs(power) if relative else np.ones(len(power))
    sd = literal(accuracy, "1" if relative else "W", where) * np.maximum(sizes, 1e-3 * max([1.0, *np.abs(power)]))
    return np.concatenate(parts), Pins(np.array(at, dtype=np.int64), np.array(power), sd, np.cumsum([0, *map(len, parts)]))


def _asked(
    model: Model,
    record: Record,
    path: str,
    scenario: Scenario | None,
    free: Sequence[str],
    priors: Mapping[str, tuple[str, str] | str] | None,
    knots: Array,
) -> tuple[Request, list[str]]:
    """Return the request in which each knot is a load of its own, and the names of these."""
    given = model.at(path)
    assert isinstance(given, HeatLoad)
    base = scenario or Scenario(record.name)
    loads, names = dict(base.loads), []
    for k in range(knots.size):
        name = f"{path}_at_{k}"
        model = with_load(model, name, watts(given.into, power="1 [W]"))
        around = np.unique(np.clip([0, k - 1, k, k + 1, knots.size - 1], 0, knots.size - 1))
        loads[name] = TableSignal(knots[around], np.eye(knots.size)[k, around])
        names.append(name)
    loads[path] = Constant(0.0)
    known = priors_of(model, priors or {}, f"power of {path}")
    return Request(model, (record,), tuple(free), {"*": base.with_(loads=loads)}, priors=known, name=f"power of {path}"), names


def _history(asked: Request, problem: Problem, path: str, knots: Array, pins: Pins, found: Solved) -> PowerHistory:
    """Return what a user sees of the end."""
    count = knots.size
    first = found.x.size - count
    power, covariance = found.x[first:], found.covariance[first:, first:]
    kernel = (found.covariance @ found.seen)[first:, first:]
    open_ = np.setdiff1d(np.arange(count), pins.at)
    width = float(np.median([_half_width(kernel[k], k) for k in open_])) * float(np.median(np.diff(knots)))
    values = {
        u.name: (_shown(u, float(x)), u.slope(float(x)) * float(np.sqrt(v)) / float(unit(u.unit).factor), u.unit)
        for u, x, v in zip(problem.unknowns[:first], found.x, np.diag(found.covariance), strict=False)
    }
    flat = compile_network(asked.model).flat
    node = next(found.node for found in flat.loads if found.path == path)
    blocks = tuple(problem.blocks(found.x))
    texts = {
        u.name: f"{u.to_value(float(x))!r} [{u.unit}]"
        for u, x in zip(problem.unknowns[:first], found.x, strict=False)
        if u.kind == "parameter"
    }
    bare = _without(asked.model, path, count).with_values({k: v for k, v in texts.items()}, f"power of {path}")
    starts = {u.name.partition("initial.")[2]: float(x) for u, x in zip(problem.unknowns, found.x, strict=True) if ": initial." in u.name}
    given = problem.experiments[0].bare
    loads = {k: v for k, v in given.loads.items() if not k.startswith(f"{path}_at_")}
    loads = {**loads, path: TableSignal(knots, power, False)}
    scenario = replace(given, loads=loads, initial={**given.initial, **starts})
    run = simulate(bare, scenario, times=knots)
    known = np.zeros(count, dtype=bool)
    known[pins.at] = True
    notes = () if found.converged else (f"the history did not settle within {ROUNDS} rounds; free fewer parameters.",)
    return PowerHistory(
        path, node, knots, power, covariance, run[node].kelvin, known, width, found.prior, values, blocks, bare, scenario, notes
    )


def _text(unknown: Unknown, fitted: float) -> str:
    """Return a fitted value as a deck writes it."""
    return f"{_shown(unknown, fitted)!r} [{unknown.unit}]"


def _shown(unknown: Unknown, fitted: float) -> float:
    """Return a fitted value in its unit."""
    of = unit(unknown.unit)
    return (unknown.to_value(fitted) - float(of.offset)) / float(of.factor)


def _half_width(row: Array, at: int) -> float:
    """Return the full width at half maximum of a smoothing kernel about its knot, in knots."""
    half, out = 0.5 * row[at], 0.0
    for side in (row[at:], row[at::-1]):
        below = np.flatnonzero(side < half)
        last = int(below[0]) if below.size else side.size
        out += last - 1 + ((side[last - 1] - half) / (side[last - 1] - side[last]) if below.size else 0.0)
    return float(out)


def _without(model: Model, path: str, count: int) -> Model:
    """Return the model without the loads of the knots."""
    part, _, name = path.rpartition(".")
    inner = model.submodel(part) if part else model
    kept = {n: v for n, v in inner.loads.items() if not n.startswith(f"{name}_at_")}
    changed = replace(inner, loads=kept)
    return model.with_part(part, changed) if part else changed


@dataclass(frozen=True, eq=False)
class Pins:
    """Knots whose power is known: positions, powers [W], standard deviations [W]; and where the sections between jumps begin and end."""

    at: NDArray[np.int64]
    power: Array
    sd: Array
    sections: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Solved:
    """The end: values of all unknowns, their covariance, what the data see of them, and the prior that was taken."""

    x: Array
    covariance: Array
    seen: Array
    prior: str
    converged: bool


def solved(problem: Problem, knots: Array, pins: Pins, base: float, priors: Sequence[str]) -> Solved:
    """Return the unknowns of a problem whose last are the powers at the knots."""
    count = knots.size
    x = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    low, high = (np.array(b) for b in zip(*(u.fitted_bounds() for u in problem.unknowns), strict=True))
    size, first = x.size, x.size - count
    pinned = np.zeros((pins.at.size, size))
    pinned[np.arange(pins.at.size), first + pins.at] = 1.0 / pins.sd
    stated = all(o.noise is not None for o in problem.observations())
    theta = [k for k, u in enumerate(problem.unknowns) if u.kind == "parameter"]
    force = np.zeros(size)
    for _ in range(ROUNDS):
        found = problem.compressed(x)
        rows, slopes = problem.prior_rows(x)
        # linearised: |A z - g|^2 of the data, of the priors of all other unknowns, and of the stretches of known power
        sides = [(found.slopes, found.slopes @ x - found.rows), (slopes, slopes @ x - rows), (pinned, pins.power / pins.sd)]
        level = 1.0
        for _ in range(1 if stated else 4):
            scaled = [(a / np.sqrt(level), g / np.sqrt(level)) if k == 0 else (a, g) for k, (a, g) in enumerate(sides)]
            best = max((_likeliest(scaled, force, knots, pins, base, p) for p in priors), key=lambda f: f[0])
            _, taken, z, h = best
            if not stated:
                left = sides[0][0] @ z - sides[0][1]
                data = scaled[0][0].T @ scaled[0][0]
                worth = float(np.trace(np.linalg.solve(h, data)))
                level = float(left @ left) / max(problem.samples - worth, 1.0)
        z = np.clip(z, low, high)
        force = _margin(problem, x, found.slopes / np.sqrt(level), h, theta, level)
        step, x = z - x, z
        sd = np.sqrt(np.diag(np.linalg.inv(h)))
        if (np.abs(step) < 0.01 * sd + 1e-9 * np.abs(x)).all():
            break
    else:
        return Solved(x, np.asarray(np.linalg.inv(h)), np.asarray(scaled[0][0].T @ scaled[0][0]), taken, False)
    return Solved(x, np.asarray(np.linalg.inv(h)), np.asarray(scaled[0][0].T @ scaled[0][0]), taken, True)


def _margin(problem: Problem, x: Array, slopes: Array, h: Array, theta: Sequence[int], level: float) -> Array:
    """Return what the logarithm of the margin over the history adds to the derivatives (unknowns,) of the parameters.

    The mode of history and parameters together is not that of the parameters alone: a smaller capacitance makes a smoother history, which
    its prior likes, though the readings then say more of it. The margin holds the one against the other: ``-1/2 d log|H| / d parameter``,
    H the information on all else.
    """
    out = np.zeros(x.size)
    others = np.setdiff1d(np.arange(x.size), theta)
    inverse = np.linalg.inv(h[np.ix_(others, others)])
    here = slopes[:, others].T @ slopes[:, others]
    for k in theta:
        moved = x.copy()
        moved[k] += 1e-3 * problem.unknowns[k].scale
        there = problem.compressed(moved).slopes[:, others]
        out[k] = -0.5 * float(np.sum(inverse * (there.T @ there / level - here))) / (moved[k] - x[k])
    return out


def _likeliest(
    sides: Sequence[tuple[Array, Array]], force: Array, knots: Array, pins: Pins, base: float, prior: str
) -> tuple[float, str, Array, Array]:
    """Return the largest logarithm of the marginal likelihood over a prior's strength, its name, the unknowns, and their information."""
    size, count = sides[0][0].shape[1], knots.size
    first = size - count
    data = sum((a.T @ a for a, _ in sides), np.zeros((size, size)))
    right = sum((a.T @ g for a, g in sides), force.copy())
    square = float(sum(g @ g for _, g in sides))
    rough = _roughness(knots, pins, 1 if prior == "walk" else 2)
    held = np.eye(count) / base**2
    scale = float(np.trace(sides[0][0][:, first:].T @ sides[0][0][:, first:])) / max(float(np.trace(rough)), 1e-300)

    def at(strength: float) -> tuple[float, Array, Array]:
        smooth = scale * 10.0**strength * rough + held
        h = data.copy()
        h[first:, first:] += smooth
        z = np.linalg.solve(h, right)
        logs = np.linalg.slogdet(smooth)[1] - np.linalg.slogdet(h)[1] - (square - float(right @ z))
        return 0.5 * float(logs), np.asarray(z), np.asarray(h)

    grid = np.arange(-8.0, 8.01, 0.5)
    found = [(at(s)[0], s) for s in grid]
    _, middle = max(found)
    _, strength = max((at(s)[0], s) for s in middle + np.arange(-0.5, 0.51, 0.05))
    value, z, h = at(strength)
    return value, prior, z, np.asarray(h)


def _roughness(knots: Array, pins: Pins, order: int) -> Array:
    """Return D'D of differences between knots, of the first or second order; none reach across a jump."""
    out = np.zeros((knots.size, knots.size))
    for first, last in pairwise(pins.sections.tolist()):
        if last - first > order:
            rows = np.diff(np.eye(last - first), n=order, axis=0) / float(np.diff(knots[first:last]).mean()) ** (order - 0.5)
            out[first:last, first:last] = rows.T @ rows
    return out
