"""Steady points of a campaign: settled stretches of logs, fitted beside the transients of a stage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from thermid.errors import RecordError
from thermid.measure import Record
from thermid.simulation.scenarios.scenario import STEADY, Scenario

if TYPE_CHECKING:
    from thermid.campaign.file import CampaignSource
    from thermid.campaign.schema import StageTable


def steady_points(
    source: CampaignSource, stage: StageTable, records: tuple[Record, ...], scenario: Scenario, where: str
) -> tuple[tuple[Record, ...], dict[str, Scenario]]:
    """Return the steady points of a stage as records, and name -> scenario in which each starts settled.

    Parameters
    ----------
    source, stage   The campaign and its stage.
    records : tuple The stage's transients.
    scenario        What the stage says that its logs do not.
    where : str     For messages.

    Raises
    ------
    RecordError     When a stretch is not settled, or is fitted as part of a transient too.
    """
    points: dict[str, Record] = {}
    for name, table in stage.steady.items():
        place = f"{where}.steady.{name}"
        (one,) = source.pick([table.record], place)[:1]
        log = source.bound(one, stage)
        point = log.steady(table.start, table.end, tau=table.tau, limit=table.limit, name=name)
        _apart(point.start, point.end, log, records, place, name)
        points[name] = point.record
    return tuple(points.values()), _scenarios(points, scenario)


def _scenarios(points: Mapping[str, Record], scenario: Scenario) -> dict[str, Scenario]:
    return {name: scenario.with_(start=STEADY) for name in points}


def _apart(start: float, end: float, log: Record, records: tuple[Record, ...], where: str, name: str) -> None:
    """Refuse a stretch that a transient of the stage holds too: its readings would count twice."""
    for other in records:
        if other.origin.sha256 == log.origin.sha256 and other.times[0] < end and other.times[-1] > start:
            raise RecordError(
                f"steady point '{name}' is of {start:g} to {end:g} s of '{log.name}', and the stage fits it from {other.times[0]:g} to "
                f"{other.times[-1]:g} s: its readings would count twice. Trim the transient in `prepare`, or leave one of them out.",
                where,
            )
