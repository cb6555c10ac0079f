"""`fleet_in`: the fleet of a campaign file: one of its stages, asked of every unit by itself."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from thermid.base.errors import DeckError, NameNotFoundError, refuse_unknown
from thermid.campaign._file import CampaignSource, read_campaign
from thermid.campaign._stages import Notice, request_of, run_stages
from thermid.fit.problem import Request
from thermid.inference.fleets import Fleet, fleet_of
from thermid.simulation.runs import Workers


def fleet_in(
    campaign: str | os.PathLike[str],
    *,
    data: str | os.PathLike[str] | None = None,
    cache: str | os.PathLike[str] | None = None,
    notice: Notice | None = None,
    executor: Workers = None,
) -> Fleet:
    """Return the population of the units in the table ``[fleet]`` of a campaign.

    Parameters
    ----------
    campaign : path         The file; stages from which that of the fleet inherits are fitted first, for all units together.
    data, cache, notice     As in `run_stages`.
    executor                As in `ensemble`: who simulates the units.

    Raises
    ------
    DeckError               Without such a table.
    NameNotFoundError       When its stage is not in the campaign.
    IdentificationError     As `thermid.inference.fleet`.
    """
    source = read_campaign(campaign, data)
    source = replace(source, results=Path(cache)) if cache is not None else source
    table = source.content.fleet
    if table is None:
        raise DeckError("there is no table [fleet]. Write one with the units and their records.", source.path.name)
    stages = source.content.stages
    names = [s.name for s in stages]
    wanted = table.stage or names[-1]
    refuse_unknown([wanted], names, source.where("fleet.stage"), "no stage '{}'.", NameNotFoundError)
    k = names.index(wanted)
    below = source.content.model_copy(update={"stages": stages[:k], "joint": None, "verdicts": []})
    done = run_stages(replace(source, content=below), cache=cache, notice=notice, executor=executor).stages if stages[k].inherit else {}
    request = request_of(source, stages[k], k, done)
    records = {name: unit.records for name, unit in table.units.items()} or {r.name: [r.name] for r in request.records}
    requests = {name: _of_unit(source, request, name, patterns) for name, patterns in records.items()}
    _refuse_shared(source, requests)
    covariates = {name: unit.covariates for name, unit in table.units.items()}
    return fleet_of(requests, covariates, source.content.title, executor)


def _of_unit(source: CampaignSource, request: Request, name: str, patterns: list[str]) -> Request:
    """Return the request of a stage with the records of one unit."""
    where = source.where(f"fleet.units.{name}")
    points = {r.name: r for r in request.records}
    wanted = [n for p in patterns for n in ([p] if p in points else source.pick([p], where))]
    refuse_unknown(wanted, points, where, f"record '{{}}' is not one of stage '{request.name}'.", DeckError)
    kept = {"*", *wanted}
    return replace(
        request,
        name=name,
        records=tuple(points[n] for n in dict.fromkeys(wanted)),
        scenarios={n: s for n, s in request.scenarios.items() if n in kept},
        record_local={n: s for n, s in request.record_local.items() if n in kept},
    )


def _refuse_shared(source: CampaignSource, requests: dict[str, Request]) -> None:
    """Refuse a record that two units have.

    Raises
    ------
    DeckError   Names both.
    """
    of: dict[str, str] = {}
    for unit, request in requests.items():
        for record in request.records:
            if record.name in of:
                raise DeckError(f"record '{record.name}' is given to '{of[record.name]}' and to '{unit}'.", source.where("fleet.units"))
            of[record.name] = unit
