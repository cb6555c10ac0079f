"""From the plain deck to a structure that criticism alone proposes, judged on runs that nothing has seen.

Run it as ``python examples/tclab/criticised.py --data DIR``. The search sees 16 of the training runs on a 30 s grid; the proposed structure
is fitted to all of them on the 15 s grid of `structures.py` and judged on its unseen runs, beside the structure of the campaign.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace
from typing import Any

import numpy as np
from candidates import candidates
from structures import HERE, LOOSE, SENSORS, TRAINING, UNSEEN, bound, request

import thermid as td
from thermid.campaign.stages import CampaignSource
from thermid.fit.calibration import LocalSpec, fit
from thermid.inference.criticism import FittedStructure, StructureSearch, search_structure

COARSE, FINE, JUDGED = 30.0, 15.0, 5.0
"""Grids of the search, of the fit and of the verdict. [s]"""


def some(names: list[str]) -> list[str]:
    """Return the runs that the search sees: steps up to 30, 70 and 100 %, steps down from 60 and 100 %, all of two hours."""
    levels = ("000_030", "000_070", "000_100", "060_000", "100_000")
    return [n for n in names if "Random" in n or any(level in n for level in levels)]


def searched(source: CampaignSource, evaluations: int) -> StructureSearch:
    """Return what a search from the plain deck proposes."""
    which = candidates()["plain"]
    names = some(source.pick([p for patterns in TRAINING.values() for p in patterns], "training"))
    return search_structure(request(source, which, [bound(source, n, which, COARSE) for n in names]), evaluations=evaluations)


def seated(record: td.Record, like: td.Record) -> td.Record:
    """Return a record whose sensors read the nodes that those of another read."""
    return record.with_channels(*(replace(record[c], target=like[c].target) for c in SENSORS))


def unseen(source: CampaignSource, one: FittedStructure) -> dict[str, Any]:
    """Return the RMSE on runs that nothing has seen, room fitted, median over them [K]; the structure is fitted to all training runs."""
    which = candidates()["plain"]
    like = one.request.records[0]
    names = source.pick([p for patterns in TRAINING.values() for p in patterns], "training")
    records = [seated(bound(source, n, which, FINE), like) for n in names]
    asked = one.full_request
    whole = request(source, which, records)
    base = asked.scenarios["*"]
    hidden = {n: table for n, table in asked.record_local.items()}
    local = {r.name: {**whole.record_local.get(r.name, {}), **_starts(r, asked, hidden)} for r in records}
    found = fit(replace(asked, records=tuple(records), scenarios={"*": base}, record_local=local, search="local"))
    last = [seated(bound(source, n, which, JUDGED), like) for n in source.pick(UNSEEN, "unseen")]
    room = {"room": {"start": "22.5 [degC]", "sd": "2 [K]"}}
    verdicts = [td.validate(found, r, LOOSE, scenario=base, local=room) for r in last]
    return {s: float(np.median([v.statistics[s].rmse for v in verdicts])) for s in SENSORS}


def _starts(record: td.Record, asked: Any, hidden: dict[str, Any]) -> dict[str, Any]:
    """Return the starts of hidden masses of a run that begins hot: between the first readings."""
    names = {n for table in hidden.values() for n in table if n.startswith("initial.")}
    first = [float(record[c].values[record[c].valid][0]) for c in SENSORS]
    if np.ptp(first) <= 3.0:
        return {}
    return {n: LocalSpec(f"{min(first)!r} [K]", max(0.5 * float(np.ptp(first)), 1.0)) for n in names}


def main() -> None:
    """Print the proposal and both errors."""
    parser = argparse.ArgumentParser(description="Propose a structure from the plain deck and judge it on unseen runs.")
    parser.add_argument("--data", default=os.environ.get("THERMID_DATA"), help="folder of the logs; THERMID_DATA does the same")
    parser.add_argument("--evaluations", type=int, default=8000, help="budget of the search")
    given = parser.parse_args()
    source = CampaignSource.read(HERE / "campaign.toml", given.data)
    begun, cpu = time.perf_counter(), time.process_time()
    found = searched(source, given.evaluations)
    print(f"{found}\nsearch: {time.perf_counter() - begun:.0f} s, {time.process_time() - cpu:.0f} s of processor time")
    own = unseen(source, found.proposed)
    print(
        "unseen runs, room fitted:", {s: round(x, 3) for s, x in own.items()}, "K; the campaign's structure: see structures.py --only board"
    )


if __name__ == "__main__":
    main()
