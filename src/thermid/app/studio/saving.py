"""What is saved of a desk: all values in force, those of the stage and of the stages below under those that were moved."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from thermid.app.studio.desk import Desk, Slider
from thermid.base.units import in_si
from thermid.fit.calibration import in_place
from thermid.fit.problem import Unknown
from thermid.model.tree import deck_text, parameter_table
from thermid.values.store import LeftOut, State, Store, ValueOrigin

WORDS = "'{}' was set in the studio without an error"
INSTRUMENTS = ("sensor", "instrument", "shared")
"""Kinds of unknowns that a store keeps beside parameters; what belongs to one record alone stays with it."""


def in_force(desk: Desk, values: Mapping[str, float], known: Store) -> Store:
    """Return all values in force.

    Parameters
    ----------
    desk : Desk
    values : dict   As in `Desk.curves`.
    known : Store   What the stage found and inherits.

    Raises
    ------
    NameNotFoundError   When there is neither such a slider nor anything else of that name that the stage looks for.
    """
    desk.si(values)  # refuses names that it does not know
    origin, table = ValueOrigin("hand", f"{desk.title}, by hand"), parameter_table(desk.model)
    moved = [_moved(s, values[s.path], deck_text(table[s.path]), origin) for s in desk.sliders if values.get(s.path, s.value) != s.value]
    moved += [_set(u, values[n], origin) for n, u in desk.others.items() if n in values and u.kind in INSTRUMENTS]
    left_out = tuple(LeftOut(WORDS.format(s.path)) for s in moved)
    return in_place(known, Store({s.path: s for s in moved}, root=np.zeros((len(moved), 0)), left_out=left_out))


def _moved(slider: Slider, value: float, deck: str, origin: ValueOrigin) -> State:
    """Return the value of a slider, in its unit, as a state."""
    at, start, low, high = (in_si(v, slider.unit) for v in (value, slider.value, slider.low, slider.high))
    paths = (slider.path, *slider.also)
    return State(slider.path, at, slider.log, slider.unit, (low, high), origin, paths=paths, deck=deck, start=start, known=False)


def _set(unknown: Unknown, value: float, origin: ValueOrigin) -> State:
    """Return the error of an instrument as a state. [SI]"""
    bounds = (unknown.low, unknown.high)
    return State(unknown.name, value, unknown.log, unknown.unit, bounds, origin, unknown.kind, start=unknown.start, known=False)
