"""What the logs of each stage of a campaign can tell, or told."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from thermid.campaign.cache import recall
from thermid.campaign.file import placed, read_campaign
from thermid.campaign.staging import keyed, request_of
from thermid.errors import NameNotFoundError, ThermidError, nearest
from thermid.fit.calibrate import fit
from thermid.fit.calibration import Calibration
from thermid.inference.identifiability import Identifiability, identifiability, identifiability_of

__all__ = ["survey"]


def survey(
    campaign: str | os.PathLike[str],
    stage: str = "",
    *,
    after: bool = False,
    data: str | os.PathLike[str] | None = None,
    cache: str | os.PathLike[str] | None = None,
    notice: Callable[[str, int, float], None] | None = None,
) -> dict[str, Identifiability]:
    """Return stage -> what its logs can tell of what it frees, before its own fit, so that a stage that would be refused is explained too.

    Parameters
    ----------
    campaign : path         The campaign file.
    stage : str             One stage; all of them when empty. Stages below it are fitted, since it starts from what they found.
    after : bool            Look at the ends of the fits and not at their starts.
    data : path             A folder of logs outside the project.
    cache : path            A results folder; stages that it holds as they are now are not fitted again.
    notice : callable       Called while stages run.

    Raises
    ------
    NameNotFoundError   When there is no such stage.
    """
    folder = Path(cache) if cache is not None else None
    source = replace(read_campaign(campaign, data), results=folder)
    stages = source.content.stages
    names = [s.name for s in stages]
    if stage and stage not in names:
        raise NameNotFoundError(f"no stage '{stage}'.{nearest(stage, names)}", source.content.title)
    wanted = [stage] if stage else names
    below = {name: [n for i in s.inherit.values() for n in i.stages] for name, s in zip(names, stages, strict=True)}
    needed = set(wanted)
    for name in reversed(names):  # a stage inherits from earlier ones only
        needed |= set(below[name]) if name in needed else set()
    fits = {n for name in needed for n in below[name]} | (set(wanted) if after else set())
    done: dict[str, Calibration] = {}
    keys: dict[str, str] = {}
    out = {}
    for k, (name, table) in enumerate(zip(names, stages, strict=True)):
        if name not in needed:
            continue
        try:
            request, _ = keyed(request_of(source, table, k, done), table, keys)
            if name in wanted and not after and request.free:
                out[name] = identifiability_of(request)
            if name in fits:
                keys[name] = request.key
                told = None if notice is None else lambda count, rms, name=name: notice(name, count, rms)
                done[name] = fit(request, told, recall(folder, name, keys[name]))
            if name in wanted and after and done[name].values.parameters:
                out[name] = identifiability(done[name])
        except ThermidError as error:
            raise placed(error, source.where(f"stages.{k}")) from None
    return out
