"""Refusals: when a fit is refused and in which words, and mistakes in the log that would explain a misfit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations, islice

import numpy as np

from thermid.errors import IdentificationError, ThermidError
from thermid.fit.calibration import FIRST, TIMES, Calibration
from thermid.fit.minimisation import Fit
from thermid.fit.problem.request import Request
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import starting_point
from thermid.fit.uncertainty.groups import SHARE, Group, listed, percent, structural_groups, together
from thermid.fit.uncertainty.information import Information, elsewhere
from thermid.knowledge.store import Store
from thermid.linear_algebra import Array, null_space, symmetric_inverse
from thermid.measure import Channel, Record
from thermid.measure.amounts import short
from thermid.units import NAMES, unit

FAR = 25.0
"""Weighted sum of squares per degree of freedom from which a mistake is looked for: residuals of five times the stated noise."""
GAIN = 0.1
"""Part of it that may be left for a mistake to be named."""
PAIRS = 10
STRANGE = 300.0
"""Ratio of the power of a log and that of the deck from which one of them is in another unit."""
FULL = 101.0
"""Largest number that a duty cycle in per cent reaches, with what rounding adds."""
UNITS = ((1e-3, "mW, where W were taken"), (1e3, "kW, where W were taken"))


def mistakes(request: Request, problem: Problem, misfit: float, again: Callable[[Request], float]) -> tuple[str, ...]:
    """Return remarks on mistakes that would explain a misfit.

    Parameters
    ----------
    request : Request       What was asked.
    problem : Problem       Its records, bound to the model.
    misfit : float          Weighted sum of squares per degree of freedom that the fit left. [-]
    again : callable        Returns that of another request.
    """
    if misfit < FAR:
        return ()
    out = []
    for words, records in _others(request.records):
        try:
            left = again(replace(request, records=records, store=Store(), prior=(), seen={}))
        except ThermidError:
            continue
        if left < GAIN * misfit:
            out.append((left, f"{words} The residuals would then fall from {misfit**0.5:.2g} to {left**0.5:.2g} times the noise."))
    return tuple(text for _, text in sorted(out)[:2])


def strange_powers(problem: Problem) -> tuple[str, ...]:
    """Return questions about logged powers that are far from the deck's: is their unit right?

    Far is 300 times, and five times where nobody said the unit of the column: a duty cycle in per cent then counts as watts.
    """
    out: dict[str, str] = {}
    for e in problem.experiments:
        values = e.network.flat.parameters.evaluate({})
        decks = {row.path: float(values[row.fields["power"]]) for row in e.network.flat.loads if "power" in row.fields}
        for c in (c for c in e.record.channels.values() if c.role == "load" and c.quantity == "power" and c.valid.any()):
            path = e.network.flat.names.model.canonical(c.target or "")
            logged, deck = float(abs(c.values[c.valid]).max()), decks.get(path, 0.0)
            if not (logged > 0 and deck > 0):
                continue
            gives = f"{FIRST}'{c.name}' gives '{path}' {short(logged, 3)} W, the deck has {short(deck, 3)} W: "
            if not 1.0 / STRANGE < logged / deck < STRANGE:
                out[c.name] = f'{gives}is its unit right? A column in mW has unit = "mW" in its table, or [mW] in its header.'
            elif c.assumed and logged / deck >= TIMES and logged <= FULL:
                out[c.name] = (
                    f"{gives}is it a duty cycle in per cent? Nothing says its unit, and watts were taken. Give full_scale = '... [W]', its "
                    'power at 100 %, or, if these are watts, unit = "W".'
                )
    return tuple(out.values())


def _others(records: tuple[Record, ...]) -> Iterator[tuple[str, tuple[Record, ...]]]:
    """Yield what may have been mistaken, as a question, and the records as they would then be."""
    channels = [c for r in records for c in r.channels.values()]
    nodes = dict.fromkeys(c.name for c in channels if c.quantity == "temperature" and c.role in ("auto", "node"))
    for a, b in islice(combinations(nodes, 2), PAIRS):
        yield f"are '{a}' and '{b}' exchanged?", tuple(_exchanged(r, a, b) for r in records)
    powers = [c.name for c in channels if c.quantity == "power"]
    named = ", ".join(f"'{p}'" for p in dict.fromkeys(powers))
    for factor, mistaken in UNITS if powers else ():
        yield f"was {named} logged in {mistaken}?", tuple(r.with_channels(*_scaled(r, factor)) for r in records)


def _exchanged(record: Record, a: str, b: str) -> Record:
    if a not in record.channels or b not in record.channels:
        return record
    one, other = record.channels[a], record.channels[b]
    read = [replace(one, values=other.values, valid=other.valid, masks=other.masks)]
    return record.with_channels(*read, replace(other, values=one.values, valid=one.valid, masks=one.masks))


def _scaled(record: Record, factor: float) -> list[Channel]:
    return [replace(c, values=factor * c.values) for c in record.channels.values() if c.quantity == "power"]


def refuse_before(request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> None:
    """Refuse a fit of unknowns that the records cannot tell apart.

    Raises
    ------
    IdentificationError   Names them, and what is known of them instead.
    """
    if not problem.unknowns:
        return
    info = Information.of(problem, starting_point(problem.unknowns))
    length = np.linalg.norm(info.rows, axis=0)
    blind = set(np.flatnonzero(length <= 1e-12 * length.max()).tolist())
    for direction in null_space(info.rows) * length:
        blind |= set(np.flatnonzero(np.abs(direction) > SHARE * np.abs(direction).max()).tolist())
    if blind:
        names = {info.names[k] for k in blind}
        groups = structural_groups(info, elsewhere(problem, info))
        group = next(g for g in groups if names & set(g.names))
        raise IdentificationError(_words(group, request, problem, fit), request.name or request.model.title)


def _words(group: Group, request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> str:
    """Return what cannot be told apart, what is known instead, and what to do."""
    if group.form == "unseen":
        return f"no reading depends on '{group.names[0]}'. Fix it, or add a record in which it acts."
    named = listed(group.names) if len(group.names) < 3 else ", ".join(f"'{n}'" for n in group.names)
    cure = "Free one of them, or add a record in which they act differently."
    how = group.pair
    if how in ("product", "ratio"):
        known = _known(group, request, problem, fit)
        return f"the data cannot tell {named} apart; they act only as a {how}{known}. {cure}"
    about = "; ".join(f"{c.text} to about {percent(c.relative)}{f' ({c.meaning})' if c.meaning else ''}" for c in group.known)
    known = f" Known: {about}." if about else ""
    if group.form in ("sum", "series"):
        return f"the data cannot tell {named} apart; {group.acting}.{known} {cure}"
    if group.form == "power law":
        moves = ", or ".join(together(move, len(group.names)) for move in group.moves)
        powers = [n for n in group.names if n.rpartition(".")[2] in ("power", "scale") or _is_power(n, problem)]
        advice = f" Without a measured power only ratios are known: fix '{powers[0]}' or give it a prior." if powers else ""
        return f"the data cannot tell {named} apart: {moves} changes no reading.{known}{advice} {cure}"
    return f"the data cannot tell {named} apart: a change of one is made up for by the others. {cure}"


def _is_power(name: str, problem: Problem) -> bool:
    return any(u.name == name and unit(u.unit).dimension == unit("W").dimension for u in problem.unknowns)


def _known(group: Group, request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> str:
    """Return the value of a product or ratio of two parameters, from a fit that frees one of them."""
    first, second = group.names
    fewer = tuple(n for n in request.free if request.model.canonical(n) != second)
    if len(fewer) != len(request.free) - 1:
        return ""
    try:
        found = fit(replace(request, free=fewer))
    except IdentificationError:
        return ""
    combination = f"{first}{'*' if group.pair == 'product' else '/'}{second}"
    other = next(u for u in problem.unknowns if u.name == second)
    value = found.values[first]
    factor = other.start if group.pair == "product" else 1.0 / other.start
    of = unit(value.unit).dimension
    dimension = tuple(a + b if group.pair == "product" else a - b for a, b in zip(of, unit(other.unit).dimension, strict=True))
    text = next((t for t in NAMES if unit(t).dimension == dimension), "SI")
    meaning = next((f", which sets {c.meaning}" for c in group.known if c.meaning), "")
    return f" (known: {combination} = {short(value.value * factor, 3)} +- {short(value.error * factor)} {text}{meaning})"


def refuse_after(request: Request, problem: Problem, found: Fit, total: Array) -> None:
    """Refuse a fit whose standard error is wider than the bounds it was given.

    Raises
    ------
    IdentificationError   Names the parameter, its error and its bounds.
    """
    for k, u in enumerate(problem.unknowns):
        if u.kind != "parameter":
            continue
        error = float(np.sqrt(total[k, k]))
        if not np.isfinite(error):
            raise IdentificationError(
                f"at the end of the fit no reading depends on '{u.name}'. Fix it.", request.name or request.model.title
            )
        low, high = u.fitted_bounds()
        if not u.log:
            width = high - low
        else:
            width = high - low if u.low > 0 else np.inf
        if np.isfinite(width) and 2 * error > width:
            scale = 1.0 / float(unit(u.unit).factor)
            value, spread = u.to_value(float(found.fitted[k])) * scale, error * u.slope(float(found.fitted[k])) * scale
            raise IdentificationError(
                f"'{u.name}' = {short(value, 3)} +- {short(spread)} {u.unit}: its standard error is wider than its bounds "
                f"{u.low * scale:.4g} .. {u.high * scale:.4g}, so the log says nothing new{_by_instruments(problem, total, k)}. Fix it, "
                "give it a prior, or add a record that moves it.",
                request.name or request.model.title,
            )


def _by_instruments(problem: Problem, total: Array, k: int) -> str:
    """Return which instruments' errors set most of the variance of an unknown; empty where none do."""
    at = [j for j, u in enumerate(problem.unknowns) if u.kind in ("sensor", "shared", "instrument")]
    if not at or not np.isfinite(total[np.ix_([k, *at], [k, *at])]).all():
        return ""
    across = total[at, k]
    if float(across @ symmetric_inverse(total[np.ix_(at, at)]) @ across) < 0.5 * total[k, k]:
        return ""
    share = across**2 / (np.diag(total)[at] * total[k, k])
    behind = [problem.unknowns[j] for j, s in zip(at, share, strict=True) if s > 0.1]
    if not behind:
        return ""
    names = listed([u.name.removeprefix("sensor ").removesuffix(" error") for u in behind])
    cure = " (if all began at one temperature, say so with `start`: it shows them)" if all(u.kind == "sensor" for u in behind) else ""
    return f"; most of that is the constant error of {names}{cure}"
