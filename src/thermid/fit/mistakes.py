"""A fit that misses by far more than the noise: would exchanged sensors or another unit of the powers explain it?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations, islice
from typing import TYPE_CHECKING

from thermid.errors import ThermidError
from thermid.fit.contradicted import FIRST, TIMES
from thermid.knowledge.store import Store
from thermid.measure import Channel, Record
from thermid.measure.amounts import short

if TYPE_CHECKING:
    from thermid.fit.problem.request import Request
    from thermid.fit.problem.residuals import Problem

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
    for factor, unit in UNITS if powers else ():
        listed = ", ".join(f"'{p}'" for p in dict.fromkeys(powers))
        yield f"was {listed} logged in {unit}?", tuple(r.with_channels(*_scaled(r, factor)) for r in records)


def _exchanged(record: Record, a: str, b: str) -> Record:
    if a not in record.channels or b not in record.channels:
        return record
    one, other = record.channels[a], record.channels[b]
    read = [replace(one, values=other.values, valid=other.valid, masks=other.masks)]
    return record.with_channels(*read, replace(other, values=one.values, valid=one.valid, masks=one.masks))


def _scaled(record: Record, factor: float) -> list[Channel]:
    return [replace(c, values=factor * c.values) for c in record.channels.values() if c.quantity == "power"]
