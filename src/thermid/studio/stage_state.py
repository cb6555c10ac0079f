"""`StageState`: where a stage of a campaign stands, and whether its values may be used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class StageState:
    """Where a stage stands.

    Parameters
    ----------
    name : str          The stage.
    state : str         'done', 'stale' (something it depends on changed since), 'new' (never run), 'waiting' (for a stage below),
                        'failed' (it cannot be read) or 'deck' (there is nothing to run).
    why : str           In words.
    below : tuple       Stages whose values it takes.
    sensors : dict      Sensor -> RMSE, of a stage that is done. [K]
    standing : str      How far the values of a stage that is done may be trusted, where a reader must be told; empty else.
    because : str       The line that says so, with the stage that is the cause.
    usable : bool       Whether an answer may rest on them.
    edition : int       Counts how often what the stage says was changed on disk.
    """

    name: str
    state: str
    why: str = ""
    below: tuple[str, ...] = ()
    sensors: Mapping[str, float] = field(default_factory=dict)
    standing: str = ""
    because: str = ""
    usable: bool = True
    edition: int = 0
