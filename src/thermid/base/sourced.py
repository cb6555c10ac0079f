"""Numbers of standards and rules: the clause that each comes from, the mark of how it is known, and what may decide nothing.

In: a number, its mark and source. Out: a `Figure`; the weakest of several marks, the verdict on several verdicts.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from thermid.base.errors import ScenarioError, refuse_unknown

MARKS = {
    "read": "read in the text of its source",
    "project": "the project's own",
    "secondary": "quoted from a secondary document",
    "memory": "from memory; shown for information, not used for a verdict",
}
"""Mark -> what it says, the surest first."""
VERDICTS = {True: "met", False: "NOT met", None: "not decided"}
"""Verdict -> its words."""


@dataclass(frozen=True)
class Figure:
    """One number of a rule.

    Parameters
    ----------
    value : float   The number. [SI; a margin in K]
    mark : str      A key of `MARKS`.
    source : str    Document and clause.
    """

    value: float
    mark: str
    source: str

    def __post_init__(self) -> None:
        """Refuse a mark that is none."""
        check_mark(self.mark, self.source or "figure")

    @property
    def decides(self) -> bool:
        """Whether a verdict may rest on it: not on a number quoted from memory."""
        return self.mark != "memory"


def check_mark(mark: str, where: str) -> str:
    """Return a mark that is known.

    Raises
    ------
    ScenarioError   With the nearest mark.
    """
    refuse_unknown([mark], MARKS, where, "'{}' is not a mark; use one of {known}.", ScenarioError)
    return mark


def weakest(marks: Iterable[str]) -> str:
    """The least sure of some marks; ``read`` of none.

    >>> weakest(["read", "memory", "project"])
    'memory'
    """
    return max(marks, key=list(MARKS).index, default="read")


def weigh(verdicts: Iterable[bool | None]) -> bool | None:
    """Return the verdict on several: False where one is, else None where one is not decided, or where there is none at all.

    >>> weigh([True, None, True]), weigh([None, False]), weigh([])
    (None, False, None)
    """
    decisions = list(verdicts)
    return False if False in decisions else None if None in decisions or not decisions else True
