"""A hold question as a file: model, scenario, values, what is not known, limits."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from thermid.arguments import takes_objects
from thermid.campaign.hand import filed
from thermid.errors import DeckError, nearest
from thermid.knowledge.values import FittedValues
from thermid.model.deck.modelfile import load_model
from thermid.model.tree.model import Model
from thermid.monte_carlo.hold import Hold, check_members, hold, limits_of
from thermid.monte_carlo.uncertain import Progress, UncertainRuns, uncertain_runs
from thermid.reduction.macro import macro_model
from thermid.simulation.scenario_file import load_scenario
from thermid.simulation.scenarios.scenario import Scenario
from thermid.toml_files import Places, read_toml, refuse_another_kind, resolve_inside

KEYS: Mapping[str, tuple[type, ...]] = {
    "title": (str,),
    "model": (str,),
    "unit": (str,),
    "scenario": (str, list),
    "values": (str, list),
    "members": (int,),
    "seed": (int,),
    "every": (str,),
    "confidence": (float,),
    "limits": (dict,),
    "spread": (dict,),
}


@dataclass(frozen=True, eq=False)
class HoldQuestion:
    """How long a model keeps its limits in a scenario.

    Parameters
    ----------
    model : Model
    scenarios : tuple of Scenario   Several are draws of the weather.
    values : tuple                  What fits found and left open.
    unit : str                      The submodel that is the unit; empty for a model without a host.
    limits, spread : dict           As in `hold` and `uncertain_runs`.
    members, seed : int
    every : str                     Interval of the stored samples; empty for 121 of them.
    confidence : float              [-]
    remarks : tuple of str          What a reader must know first of the values.
    """

    model: Model
    scenarios: tuple[Scenario, ...]
    values: tuple[FittedValues, ...]
    unit: str
    limits: Mapping[str, Any]
    spread: Mapping[str, Any]
    members: int
    seed: int
    every: str
    confidence: float
    remarks: tuple[str, ...] = ()

    @takes_objects
    def run(
        self,
        *,
        n: int = 0,
        folder: str | os.PathLike[str] | None = None,
        workers: int = 1,
        cluster: str = "",
        progress: Progress | None = None,
    ) -> tuple[UncertainRuns, Hold]:
        """Return the runs, and how long the limits are kept in them; arguments as in `uncertain_runs`."""
        limits_of(self.limits, self.model.title)
        check_members(n or self.members, self.confidence, self.model.title)
        runs = uncertain_runs(
            self.model,
            self.scenarios,
            self.values,
            at=self.unit,
            spread=self.spread,
            n=n or self.members,
            seed=self.seed,
            nodes=list(self.limits),
            every=self.every or None,
            folder=folder,
            workers=workers,
            cluster=cluster,
            progress=progress,
        )
        runs = replace(runs, warnings=(*self.remarks, *runs.warnings))
        return runs, hold(runs, self.limits, confidence=self.confidence)


@takes_objects
def load_hold(path: str | os.PathLike[str]) -> HoldQuestion:
    """Return the hold question of a TOML file; files that it names are relative to it and stay inside the project.

    Where it names a `unit`, every value of the host around it must have a source; see `macro_model`.

    Raises
    ------
    DeckError   When a key is unknown, missing or of another kind, or there is no limit.
    """
    target = Path(path)
    data, lines = read_toml(target)
    refuse_another_kind(data, "a hold question, which names the deck under 'model'", target.name)
    where = Places(target.name, lines)
    for key, value in data.items():
        if key not in KEYS:
            raise DeckError(f"a hold question has no '{key}'.{nearest(key, KEYS)} It has {', '.join(KEYS)}.", where(key))
        if not isinstance(value, KEYS[key]) or isinstance(value, bool):
            raise DeckError(f"this is no {' or '.join(t.__name__ for t in KEYS[key])}: {value!r}.", where(key))
    for key in ("model", "scenario", "limits"):
        if not data.get(key):
            raise DeckError(f"a hold question needs '{key}'.", target.name)
    if data.get("members", 1) < 1:
        raise DeckError("a campaign of runs needs at least one member.", where("members"))

    def files(key: str) -> list[Path]:
        given = data.get(key, [])
        return [resolve_inside(target.parent, name, where(key)) for name in ([given] if isinstance(given, str) else given)]

    unit = data.get("unit", "")
    (deck,) = files("model")
    model = macro_model(deck, at=unit) if unit else load_model(deck)
    found = [filed(f, model, at=unit) for f in files("values")]
    return HoldQuestion(
        model,
        tuple(load_scenario(f) for f in files("scenario")),
        tuple(x.values for x in found),
        unit,
        data["limits"],
        data.get("spread", {}),
        data.get("members", 10_000),
        data.get("seed", 0),
        data.get("every", ""),
        data.get("confidence", 0.95),
        tuple(line for x in found for line in x.lines),
    )
