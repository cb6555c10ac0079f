"""`StageState`: where a stage of a campaign stands, and whether its values may be used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from thermid.identify.calibration import Calibration

__all__ = ["NOT_CREDIBLE", "StageState", "standing_of"]

NOT_CREDIBLE = "not credible"


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
    standing : str      Empty, or 'not credible': of a stage that is done, by its own fit or by one that it rests on.
    because : str       Why, in words.
    edition : int       Counts how often what the stage says was changed on disk.
    """

    name: str
    state: str
    why: str = ""
    below: tuple[str, ...] = ()
    sensors: Mapping[str, float] = field(default_factory=dict)
    standing: str = ""
    because: str = ""
    edition: int = 0


def standing_of(name: str, done: Mapping[str, Calibration], below: Sequence[str]) -> tuple[str, str]:
    """Return whether the values of a stage are credible (empty, or 'not credible'), and why not.

    Parameters
    ----------
    name : str          The stage.
    done : dict         Stage -> its fit, of all that were run.
    below : sequence    Stages whose values it takes, at any depth.
    """
    own = _doubt(done[name]) if name in done else ""
    if own:
        return NOT_CREDIBLE, own
    doubts = {n: doubt for n in below if n in done and (doubt := _doubt(done[n]))}
    said = "; ".join(f"rests on stage '{n}', which is not credible: {doubt}" for n, doubt in doubts.items())
    return (NOT_CREDIBLE, said) if doubts else ("", "")


def _doubt(fit: Calibration) -> str:
    """Return why a fit is not credible by itself; empty where it is."""
    found = [*fit.contradicted.values(), *([] if fit.converged else ["the search ended before it converged"])]
    return "; ".join(found)
