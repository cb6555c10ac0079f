"""What the page is told: plain objects for JSON, numbers in the units that a person reads."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from thermid.errors import DeckError
from thermid.knowledge.store import model_standing
from thermid.studio.courses import Shelf
from thermid.studio.curves import RunCurves, ThinnedCurve, Window
from thermid.studio.desk import Desk
from thermid.studio.project import Project

SINGLE = 1e6
"""Up to here four bytes tell times to a tenth of a second and temperatures to a millikelvin."""
GASES = ("air", "vacuum", "printed")


def project_object(project: Project, job: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is open, where its stages stand, and the state of the job that runs or ran last."""
    table = project.table()
    return {
        "title": project.title,
        "file": project.path.name,
        "kind": "deck" if project.source is None else "campaign",
        "note": "" if project.source is None else project.source.content.note,
        "stages": [asdict(project.states[name]) for name in project.stages],
        "decks": project.decks() if project.source is not None else (),
        "table": {"heads": [c.title for c in table.columns], "rows": [[[c.text, c.look] for c in row] for row in table.rows]},
        "job": job,
    }


def desk_object(desk: Desk) -> dict[str, Any]:
    """Return the sliders of a stage, its curves as they stand, and its parts."""
    return {
        "title": desk.title,
        "sliders": [asdict(s) for s in desk.sliders],
        "others": list(desk.others),
        "parts": desk.parts,
        "fitted": desk.calibration is not None,
        "measured": desk.problem is not None,
        "warnings": list(desk.calibration.warnings) if desk.calibration is not None else [],
        "standing": (desk.calibration.standing if desk.calibration is not None else model_standing(desk.model)).to_dict(desk.title),
        "synthetic": desk.problem is not None and any(e.record.origin.synthetic for e in desk.problem.experiments),
        **curves_object(desk, {}, "air"),
    }


def curves_object(desk: Desk, values: Mapping[str, float], gas: str, measured: bool = True, window: Window = None) -> dict[str, Any]:
    """Return the curves at values of the sliders, in air, in vacuum, or in vacuum as the source document prints it.

    Raises
    ------
    DeckError       When there is no such gas.
    ThermidError    When a run is refused or cannot be finished.
    """
    if gas not in GASES:
        raise DeckError(f"'{gas}' is none of {', '.join(GASES)}.", "studio")
    runs = desk.curves(values, window)
    without = desk.without_gas(values, as_printed=gas == "printed") if gas != "air" else {}
    return {"runs": [_run(r, without.get(r.name, ()), measured) for r in runs]}


def _run(run: RunCurves, without: tuple[ThinnedCurve, ...], measured: bool) -> dict[str, Any]:
    gone = {c.node: c for c in without}
    return {"name": run.name, "remarks": run.remarks, "curves": [_curve(c, gone.get(c.node), measured) for c in run.curves]}


def _curve(curve: ThinnedCurve, without: ThinnedCurve | None, measured: bool) -> dict[str, Any]:
    still = ("name", "node", "seen", "measured", "count") if measured else ()
    out = {k: getattr(curve, k) for k in (*still, "times", "simulated", "apart", "left", "rmse", "bias", "largest")}
    if without is not None:
        out |= {"gone_times": without.times, "gone": without.simulated}
    return out


def picture(desk: Desk, values: Mapping[str, float], asked: Mapping[str, Any]) -> dict[str, Any]:
    """Return the model as SVG at a time of one of its runs, submodels folded as asked."""
    folded = tuple(map(str, asked.get("folded", ())))
    unknown = [f for f in folded if f not in desk.parts]
    if unknown:
        raise DeckError(f"there is no part '{unknown[0]}' to fold.", desk.title)
    time, run = asked.get("time"), asked.get("run", 0)
    if not isinstance(run, int) or not (time is None or isinstance(time, int | float)):
        raise DeckError("a run is a whole number and a time a number.", "studio")
    return {"svg": desk.drawn(values, run, None if time is None else float(time), folded)}


def shelf_object(shelf: Shelf, desk: Desk) -> dict[str, Any]:
    """Return what can be run, and what the form of a profile asks for."""
    limits, source = shelf.limits(desk)
    return {
        "courses": [{"key": c.key, "title": c.title, "group": c.group, "kind": c.kind} for c in shelf.courses(desk).values()],
        "boundaries": desk.boundaries,
        "nodes": desk.nodes,
        "limits": [one.point for one in limits],
        "source": source,
        "fitted": desk.calibration is not None,
    }


def window_of(asked: Mapping[str, Any]) -> Window:
    """Return the stretch that a page shows, or None for all of it. [s]

    Raises
    ------
    DeckError   When it is no pair of times.
    """
    given = asked.get("window")
    if given is None:
        return None
    if not isinstance(given, list) or len(given) != 2 or not all(isinstance(v, int | float) for v in given) or not given[0] < given[1]:
        raise DeckError("a window is two times, the earlier first.", "studio")
    return float(given[0]), float(given[1])


def as_json(value: object) -> str:
    """Return a value as JSON that a script element cannot break out of; arrays as bytes, numbers that JSON lacks as null."""
    return json.dumps(_plain(value), allow_nan=False).replace("<", "\\u003c")


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        # text of many numbers takes longer to write and read than a simulation does
        single = value.size == 0 or not np.nanmax(np.abs(value), initial=0.0) > SINGLE
        return {"f4" if single else "f8": base64.b64encode(value.astype("<f4" if single else "<f8").tobytes()).decode()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
