"""Settled stretches of a test's log: which they are, and what the readings say of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from thermid.errors import RecordError
from thermid.measure import Record
from thermid.measure.stability import rule_of
from thermid.qualify.trial import Trial
from thermid.steadiness.stabilisation import Stability, stability

__all__ = ["dwells", "settled_by", "unsettled"]

LONG = 3600.0
"""Stays of at least so long end settled. [s]"""


def settled_by(
    trial: Trial, record: Record, windows: Sequence[tuple[float, float]], sensors: Sequence[str]
) -> tuple[tuple[Stability, ...], tuple[str, ...]]:
    """Return what the readings say about every settled stretch by the test's rule, and where they say nothing."""
    out: list[Stability] = []
    unsure: dict[str, list[str]] = {}
    for begin, end in windows if sensors else ():
        try:
            found = stability(record, trial.test.stable, sensors, since=begin, at=end, run=trial.foresight.solution, unit=trial.known.at)
        except RecordError as error:
            unsure.setdefault(f"that it is settled cannot be told: {error}", []).append(_span(begin, end))
            continue
        out.append(found)
        if found.verdict == "cannot tell":
            unsure.setdefault(f"the readings cannot tell whether '{found.rule.name}' holds at {found.slowest}", []).append(
                _span(begin, end)
            )
    more = {why: f" and {len(spans) - 1} more" if len(spans) > 1 else "" for why, spans in unsure.items()}
    return tuple(out), tuple(f"{spans[0]}{more[why]}: {why}" for why, spans in unsure.items())


def unsettled(settled: Sequence[Stability]) -> Iterator[str]:
    """Yield the stretches that count as settled and are not."""
    for s in settled:
        worst = s.channels[s.slowest]
        if s.verdict == "not stable" and s.decides and s.stored is not None:
            yield f"{_span(worst.start, worst.end)} counts as settled and is not: {s.stored} by '{s.rule.name}' [{s.rule.mark}]"
        elif s.verdict == "not stable" and s.decides:
            yield (
                f"{_span(worst.start, worst.end)} counts as settled and is not: {s.slowest} drifts by {3600.0 * worst.rate:+.2f} K/h, "
                f"the rule is '{s.rule.name}' [{s.rule.mark}]"
            )


def _span(begin: float, end: float) -> str:
    return f"the stretch {begin / 3600.0:.4g} .. {end / 3600.0:.4g} h"


def dwells(trial: Trial, nodes: Sequence[str], end: float) -> list[tuple[float, float]]:
    """Return the last part of every long stay of a course in which its unit is expected to be settled; a log must have followed it.

    Stays that nothing waited for, such as those of humidity tests, may begin and end while the unit still drifts: those are left out.
    """
    rule, run = rule_of(trial.test.stable), trial.foresight.solution
    stays = [p for p in trial.course.phases if p.kind == "stay" and p.duration >= LONG] if trial.course is not None else []
    out = []
    for p in (p for p in stays if p.end <= end):
        window = (p.end - max(0.25 * p.duration, 0.5 * LONG), p.end)
        moved = (run[n].at(window) for n in nodes)
        drift = max(abs(float(end - begin)) for begin, end in moved) / (window[1] - window[0])
        if rule.stored or drift <= rule.rate:
            out.append(window)
    return out
