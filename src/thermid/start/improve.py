"""What a search of structures proves becomes the next structure of a campaign: decks and campaign written beside the old ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from thermid.campaign.file import read_campaign
from thermid.campaign.stages import run_stages
from thermid.errors import DeckError, IdentificationError, nearest
from thermid.explain.candidates import Fitted, MissingElement, changes_of
from thermid.explain.structures import StructureSearch, adopted, search_structure
from thermid.files import may_write, read_text, unsealed, write_text
from thermid.fit.calibrate import fit
from thermid.fit.calibration import Calibration
from thermid.fit.problem.request import LocalSpec, Request
from thermid.measure.amounts import short
from thermid.model.deck.save import save_model
from thermid.simulation.solver.problem import refuse_unseen
from thermid.start.templates import TEMPLATE

NEXT = "next"
"""Folder of the new decks, and what the new campaign's name ends in."""


@dataclass(frozen=True, eq=False)
class Improved:
    """A stage before and after.

    Parameters
    ----------
    search : StructureSearch
    before, after : Calibration     The stage as it is, and with what is proposed; the same where nothing is.
    files : tuple of Path           What was written; empty where nothing is proposed.
    """

    search: StructureSearch
    before: Calibration
    after: Calibration
    files: tuple[Path, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return sensor, RMSE before and after [K], median over records, and independent samples per record."""
        return [{"sensor": s, "before_K": _rmse(self.before, s), "after_K": _rmse(self.after, s)} for s in self.before.sensors]

    def __str__(self) -> str:
        """Return the proposal, both fits side by side, and the files."""
        lines = [str(self.search)]
        if self.files:
            lines += [f"  {'RMSE [K]':<16}{'before':>10}{'after':>10}"]
            lines += [f"  {r['sensor']:<16}{short(r['before_K'], 3):>10}{short(r['after_K'], 3):>10}" for r in self.rows()]
            lines.append(f"  {'free values':<16}{len(self.before.fitted):>10}{len(self.after.fitted):>10}")
            lines += [f"wrote {file}" for file in self.files]
        return "\n".join(lines)


def _rmse(found: Calibration, sensor: str) -> float:
    return float(np.median([table[sensor].rmse for table in found.statistics.values() if sensor in table]))


def improve(path: Path, stage: str = "", seconds: float = 60.0, data: Path | None = None) -> Improved:
    """Search for the next structure of a stage and write it beside the campaign.

    Parameters
    ----------
    path : Path         The campaign.
    stage : str         One of its stages; the last by default.
    seconds : float     Time for the search. [s]
    data : Path         Folder of logs outside the project.

    Raises
    ------
    DeckError               When there is no such stage, or it fits nothing.
    OutputError             When a file is there that thermid did not write.
    """
    names = [s.name for s in read_campaign(path, data).content.stages]
    name = stage or names[-1]
    if name not in names:
        raise DeckError(f"no stage '{name}'.{nearest(name, names)}", path.name)
    before = run_stages(path, data=data, cache=path.parent / "results").stages[name]
    if before.request is None or not before.request.records:
        raise DeckError(
            f"stage '{name}' has values tuned by hand and fits nothing, so structures cannot be compared. Give a stage that fits records.",
            path.name,
        )
    asked = before.request
    refuse_unseen(asked.model, "a search for another structure")
    found = search_structure(asked, changes=_writable, seconds=seconds)
    if found.proposed is found.start:
        return Improved(found, before, before, ())
    new = adopted(found.proposed)
    try:
        after = fit(new)
    except IdentificationError as error:
        raise IdentificationError(
            f"the proposed structure ({found.proposed.name}) is refused by a full fit: {error.message}", name
        ) from None
    return Improved(found, before, after, tuple(_written(path, name, asked, new)))


def _writable(seen: Fitted) -> Sequence[MissingElement]:
    """Return the changes that a deck and a campaign can say: all but those of the logs."""
    return [c for c in changes_of(seen) if not c.name.startswith("commands that act")]


def _written(path: Path, stage: str, before: Request, after: Request) -> list[Path]:
    """Write the deck of the new structure and the campaign that takes it."""
    folder, campaign = path.parent / NEXT, path.with_name(f"{path.stem}_{NEXT}.toml")
    document = tomlkit.parse(unsealed(read_text(path)))
    table = next(t for t in document["stages"] if t["name"] == stage)
    deck = folder / Path(str(table["model"])).name
    table["model"] = f"{NEXT}/{deck.name}"
    table["free"] = list(after.free)
    moved = {
        c.name: {"node": str(c.target)}
        for one, other in zip(before.records, after.records, strict=True)
        for c in other.channels.values()
        if c.role == "node" and c.target != one[c.name].target
    }
    if moved:
        table["bind"] = tomlkit.item({**dict(table.get("bind", {})), **moved})
    scenario, old = after.scenarios.get("*"), before.scenarios.get("*")
    if scenario is not None and old is not None and scenario.initial != old.initial:
        own = dict(table.get("scenario", {}))
        own["initial"] = {n: str(c) for n, c in scenario.initial.items() if isinstance(c, str)}
        table["scenario"] = tomlkit.item(own)
    local = {n: _local(s) for n, s in after.local.items() if n not in before.local}
    if local:
        table["local"] = tomlkit.item({**dict(table.get("local", {})), **local})
    kind = TEMPLATE.of(campaign.stem)
    may_write(campaign, kind)
    folder.mkdir(exist_ok=True)
    model = replace(after.model, title=f"{after.model.title} {NEXT}")
    save_model(model, deck)
    write_text(campaign, tomlkit.dumps(document), kind)
    return [deck, campaign]


def _local(spec: LocalSpec) -> dict[str, str]:
    return {"start": spec.start, **({"sd": f"{spec.sd:.3g} [K]"} if np.isfinite(spec.sd) else {})}
