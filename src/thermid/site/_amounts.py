"""Values of this room's functions, as a text with a unit or as a number in SI."""

from __future__ import annotations

from thermid.model.laws import literal


def si_number(value: str | float, slot: str, where: str) -> float:
    """Return the number of a text with a unit, or a number as it is. [SI]

    Parameters
    ----------
    value : str or float    What the caller wrote.
    slot : str              The unit that is needed.
    where : str             What it is for, for the message.

    Raises
    ------
    UnitError   When its unit has another dimension, or it has none.
    """
    return literal(value, slot, where) if isinstance(value, str) else float(value)
