"""Extension points: what optional parts add to the core, which knows the points and never the parts; and the grammars of files.

This table and the public names of `thermid/__init__.py` are all that names a part; a part is loaded when its point is first used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, Final

from thermid.errors import ThermidError

POINTS: Final = {
    "surroundings of a scenario file": ("thermid.site", "surroundings", "surrounded"),
    "humidity along a profile": ("thermid.site", "moisture", "humid"),
    "the log of a bench": ("thermid.acquire", "benchlog", "bench_cells"),
}
"""Point -> part, module, function."""


def extension(point: str, where: str) -> Callable[..., Any]:
    """Return the function behind a point.

    Raises
    ------
    ThermidError   When its part is not installed; `where` says what asked for it.
    """
    part, module, function = POINTS[point]
    try:
        loaded = import_module(f"{part}.{module}")
    except ModuleNotFoundError as error:
        if error.name != part:
            raise
        raise ThermidError(f"{point} needs the part {part}, which is not installed. Install the whole of thermid.", where) from None
    return getattr(loaded, function)  # type: ignore[no-any-return]


GRAMMARS: Final[Mapping[str, str]] = {
    "deck": "thermid.model.deck.schema.Deck",
    "scenario": "thermid.simulation.scenarios.schema.ScenarioFile",
    "campaign": "thermid.campaign.schema.CampaignFile",
    "study": "thermid.campaign.schema.StudyFile",
    "plan": "thermid.qualify.plan_schema.PlanFile",
    "lock": "thermid.qualify.plan_schema.LockFile",
    "limits": "thermid.judge.schema.LimitsFile",
    "hold": "thermid.monte_carlo.schema.HoldFile",
    "profile": "thermid.profiles.schema.ProfileFile",
    "values": "thermid.knowledge.schema.ValuesFile",
    "looks": "thermid.judge.schema.LooksFile",
    "delivery": "thermid.qualify.plan_schema.ChecksFile",
    "sensors": "thermid.acquire.schema.SensorMapFile",
    "programme": "thermid.acquire.schema.ProgrammeFile",
}
"""Kind of file -> its grammar, which is what reads it, in the room that reads it."""


def grammar_of(kind: str) -> Any:
    """Return the grammar of a kind of file, or of a table by its module and class; what reads grammars is loaded now and not before."""
    module, _, name = GRAMMARS.get(kind, kind).rpartition(".")
    return getattr(import_module(module), name)


def by_grammar(kind: str, content: Any, where: Callable[[str], str]) -> Any:
    """Return the content of a file as its grammar has it.

    Parameters
    ----------
    kind : str          As in `grammar_of`.
    content : dict      The file as read.
    where : callable    Key path -> its place, such as `toml_files.Places`.

    Raises
    ------
    ThermidError    When it does not follow the grammar: every fault with its place.
    """
    return grammar_of(kind).from_file(content, where)


def json_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file, for editors."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"thermid {kind}"}
    return head | {k: v for k, v in grammar_of(kind).model_json_schema(by_alias=True).items() if k != "title"}
