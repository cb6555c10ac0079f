"""`deliver`: a model as others get it: decks, values, a reduced deck, scenarios, and what must come out, checked from the folder itself."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.files import FileKinds, folder_replacing, read_bytes, read_json
from thermid.model.tree import Model, load_model, save_model
from thermid.prediction.reduction import Reduction, assumed, reduce
from thermid.simulation.runs import Scenario, Solution, digest, load_scenario, network_for, simulate
from thermid.values.store import FittedValues

MAX_DIFFERENCE = 1e-6
"""Difference up to which a repeated run is the same. [K]"""
CHECK_TIMES = 5
"""Times at which temperatures are written down, equally spaced, the end among them."""


def deliver(
    model: Model,
    scenarios: Sequence[str | os.PathLike[str]],
    to: str | os.PathLike[str],
    *,
    values: Sequence[FittedValues] = (),
    nodes: int | None = None,
    within: str | float | None = None,
    at: str = "",
) -> Path:
    """Write a delivery folder and return its ``checks.json``.

    The folder holds ``full/`` (the model with its submodels, values laid in), ``values/``, ``scenarios/`` and, with `nodes` or `within`,
    ``reduced/``; ``checks.json`` the hashes, temperatures and deviations. All is run again from the folder before this returns.

    Parameters
    ----------
    model : Model                   With all its values laid over it.
    scenarios : sequence of path    Scenario files.
    to : path                       The folder, new or empty.
    values : sequence               Fitted values, for the record.
    nodes, within, at               Size or accuracy of the reduced model, and the submodel that is reduced; as in `reduce`.

    Raises
    ------
    DeckError       When the folder holds something, two files have one name, or its runs do not give the same temperatures again.
    ScenarioError   As in `reduce`.
    """
    target = Path(to)
    if target.exists() and any(target.iterdir()):
        raise DeckError(
            f"the folder '{target.name}' is not empty. A delivery is written once. Give a new folder.", code="output.over-another-file"
        )
    names, stages = [Path(s).name for s in scenarios], [v.stage for v in values]
    for what, names_of in (("scenario files are named", names), ("files of values are of stage", stages)):
        if twice := [n for n in dict.fromkeys(names_of) if names_of.count(n) > 1]:
            raise DeckError(
                f"two {what} '{twice[0]}', but a delivery needs different names. Rename one, or leave it out.",
                model.title,
                code="name.taken",
            )
    loaded = dict(zip(names, map(load_scenario, scenarios), strict=True))
    if not loaded:
        raise DeckError("a delivery needs a scenario, to state the expected result.", model.title, code="value.incomplete")
    small = reduce(model, list(loaded.values()), nodes=nodes, within=within, at=at) if nodes or within is not None else None
    record = _checks_content(model, loaded, small, at)
    with folder_replacing(target) as folder:
        for name in ("full", "scenarios", *(["values"] if values else []), *(["reduced"] if small is not None else [])):
            (folder / name).mkdir()
        for path in map(Path, scenarios):
            FileKinds.COPY.save_bytes(folder / "scenarios" / path.name, read_bytes(path))
        for v in values:
            v.save(folder / "values" / f"{v.stage}.values.toml")
        save_model(model, folder / "full" / "model.toml")
        if small is not None:
            save_model(small.inside, folder / "reduced" / "model.toml")
        record["files"] = {str(p.relative_to(folder)): _hash(p) for p in sorted(folder.rglob("*.toml"))}
        FileKinds.DELIVERY.save_text(folder / "checks.json", json.dumps(record, indent=1))
    check_delivery(target)
    return target / "checks.json"


def check_delivery(folder: str | os.PathLike[str]) -> dict[str, float]:
    """Return scenario -> largest difference between the delivered temperatures and those of a run of the delivered model. [K]

    Raises
    ------
    DeckError   When a file has changed since it was written, or a difference exceeds `MAX_DIFFERENCE`.
    """
    base = Path(folder)
    if not (base / "checks.json").is_file():
        raise DeckError(f"'{base.name}' is not a delivery: it has no checks.json with files and runs.", code="file.another-kind")
    record = read_json(base / "checks.json", "thermid.qualify._plan_schema.ChecksFile")
    files, runs, watched = record.files, record.runs, record.reference_points
    for name, sha256 in files.items():
        if not (base / name).is_file() or _hash(base / name) != sha256:
            raise DeckError(f"'{name}' is not the file that was delivered.", base.name, code="delivery.differs")
    model = load_model(base / "full" / "model.toml")
    out = {}
    for name, want in runs.items():
        run = simulate(model, load_scenario(base / "scenarios" / name))
        off = {p: np.abs(run[p].at(np.array(want.times)) - np.array(want.temperatures[p])).max() for p in watched}
        worst = max(off, key=lambda p: off[p])
        if not off[worst] <= MAX_DIFFERENCE:
            raise DeckError(f"'{worst}' is {off[worst]:.3g} K from its expected value in {name}.", base.name, code="delivery.differs")
        out[name] = float(off[worst])
    return out


def _checks_content(model: Model, scenarios: Mapping[str, Scenario], small: Reduction | None, at: str) -> dict[str, Any]:
    """Return the content of ``checks.json`` without the hashes of the files."""
    from datetime import UTC, datetime
    from importlib.metadata import version

    runs = {name: simulate(model, s) for name, s in scenarios.items()}
    first = next(iter(runs.values()))
    watched = _reference_points(model, next(iter(scenarios.values())))
    taken = assumed(model)
    content: dict[str, Any] = {
        "schema": 1,
        "title": model.title,
        "watermark": f"demonstration, {len(taken)} assumed parameters" if taken else "",
        "model": {"identity": model.identity(), "nodes": len(first.nodes), "assumed": list(taken)},
        "reference_points": watched,
        "written": {
            "by": f"thermid {version('thermid')}",
            "numpy": version("numpy"),
            "python": platform.python_version(),
            "machine": platform.machine(),
            "at": datetime.now(UTC).isoformat(timespec="seconds"),
        },
        "runs": {name: _expected_of_run(scenarios[name], run, watched) for name, run in runs.items()},
    }
    if small is not None:
        keys = {"scenario": "scenario", "node": "node", "largest_K": "largest", "time_s": "time", "final_K": "final"}
        content["reduced"] = {
            "part": at or model.title,
            "identity": small.model.identity(),
            "masses": list(small.masses),
            "nodes": list(small.nodes),
            "deviations": [{key: getattr(d, name) for key, name in keys.items()} for d in small.deviations],
            "largest_K": {n: d.largest for n, d in small.by_node().items()},
            "remarks": list(small.remarks),
        }
    return content


def _reference_points(model: Model, scenario: Scenario) -> list[str]:
    """Return the paths of the reference points, or of every node where none is marked."""
    network = network_for(model, scenario)
    return [n.path for n in network.flat.nodes if n.reference_point] or list(network.nodes)


def _expected_of_run(scenario: Scenario, run: Solution, watched: Sequence[str]) -> dict[str, Any]:
    """Return what a run must give again: temperatures at `CHECK_TIMES` equal times [degC], the highest ones, and the heat balance [J]."""
    times = np.linspace(0.0, scenario.seconds, CHECK_TIMES)
    balance = run.heat_balance()
    heat = {"loads_J": balance.loads, "boundaries_J": balance.boundaries, "stored_J": balance.stored, "residual": balance.relative}
    return {
        "title": scenario.title,
        "identity": digest(scenario),
        "times_s": times.tolist(),
        "temperatures_C": {p: run[p].at(times).tolist() for p in watched},
        "highest_C": {p: run[p].highest for p in watched},
        "heat_balance": heat,
    }


def _hash(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
