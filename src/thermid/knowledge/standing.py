"""`Standing`: how far values, and whatever rests on them, may be trusted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

__all__ = ["CREDIBLE", "UNJUDGED", "Standing", "State", "worst"]

State = Literal["credible", "unjudged", "not adequate", "not credible", "failed"]
ORDER: tuple[State, ...] = get_args(State)
"""From best to worst."""


@dataclass(frozen=True)
class Standing:
    """How far a value or a result may be trusted, and why.

    Parameters
    ----------
    state : str     credible (a fit that its data support), unjudged (a deck's or hand-tuned value), not adequate (the model misses more
                    than its stage allows), not credible (contradicts what was stated, or did not converge), or failed (a verdict failed).
    because : str   The reason in words; empty for credible and unjudged.
    stage : str     The stage that the reason is about; empty for none.
    """

    state: State
    because: str = ""
    stage: str = ""

    @property
    def rank(self) -> int:
        """Position from best (0, credible) to worst."""
        return ORDER.index(self.state)

    @property
    def usable(self) -> bool:
        """Whether an answer may rest on it: neither not credible nor failed."""
        return self.rank < ORDER.index("not credible")


CREDIBLE = Standing("credible")
UNJUDGED = Standing("unjudged")


def worst(standings: Iterable[Standing]) -> Standing:
    """Return the worst of several standings, the first of equals; credible where there is none."""
    return max(standings, key=lambda s: s.rank, default=CREDIBLE)
