"""Limits of temperature at reference points, and the file that holds them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thermid.arguments import takes_objects
from thermid.errors import ScenarioError, nearest
from thermid.model.deck.modelfile import read_toml
from thermid.model.laws.signal import literal
from thermid.physics.constants import ICE_POINT
from thermid.sourced.marks import check_mark
from thermid.units import TEMPERATURE

Ends = tuple[float, float]
STATES = {"operating": "operating", "non-operating": "non_operating", "start-up": "start_up"}
"""State of a unit -> the limit that holds in it."""
KEYS = ("node", *STATES.values(), "loads", "mark", "source")


@dataclass(frozen=True)
class Limits:
    """Limits of temperature at one reference point.

    Parameters
    ----------
    point : str             What people call it.
    node : str              Its node in the model.
    operating : (low, high) While it is switched on; infinite where nobody set one. [K]
    non_operating, start_up : (low, high) or None   Switched off, and at the instant at which it is switched on. [K]
    loads : tuple of str    Loads that are on when it operates; without them the run says the state.
    mark : str              How sure the numbers are, a key of `MARKS`.
    source : str            Where they stand.
    """

    point: str
    node: str
    operating: Ends
    non_operating: Ends | None = None
    start_up: Ends | None = None
    loads: tuple[str, ...] = ()
    mark: str = "project"
    source: str = ""

    def __post_init__(self) -> None:
        """Refuse limits in the wrong order.

        Raises
        ------
        ScenarioError   Which two are the wrong way round.
        """
        where = f"limits of '{self.point}'"
        check_mark(self.mark, where)
        if not np.isfinite(self.operating).any():
            raise ScenarioError(
                "operating: neither end is a number, so nothing would be checked. Give the lower, the upper, or both.", where
            )
        for state, field in STATES.items():
            ends = getattr(self, field)
            if ends is not None and not ends[0] < ends[1]:
                raise ScenarioError(f"{state}: the lower limit, {text_of(ends[0])}, is not below the upper one, {text_of(ends[1])}.", where)
        for inner, outer in (("operating", "non-operating"), ("start-up", "non-operating")):
            a, b = self.ends(inner), self.ends(outer)
            if a is None or b is None:
                continue
            for side, wrong in (("lower", -np.inf < a[0] < b[0]), ("upper", np.inf > a[1] > b[1])):
                if wrong:
                    k = 0 if side == "lower" else 1
                    raise ScenarioError(
                        f"the {side} {inner} limit, {text_of(a[k])}, lies beyond the {side} {outer} one, {text_of(b[k])}; what a unit "
                        "bears switched off it must bear at least as far as what it works at.",
                        where,
                    )

    def ends(self, state: str) -> Ends | None:
        """Return the limits of a state. [K]"""
        found: Ends | None = getattr(self, STATES[state])
        return found


def text_of(kelvin: float) -> str:
    """Return a temperature in degrees Celsius as text; none where there is none."""
    return f"{kelvin - ICE_POINT:.1f} degC" if np.isfinite(kelvin) else "none"


@takes_objects
def load_limits(path: str | os.PathLike[str]) -> tuple[Limits, ...]:
    """Return the limits of a file: a table per reference point.

    Raises
    ------
    ScenarioError   When a key is unknown, a limit is no pair of temperatures, or limits are in the wrong order.
    """
    target = Path(path)
    data, _ = read_toml(target)
    return read_limits(data, target.name)


def read_limits(tables: Mapping[str, Any], where: str) -> tuple[Limits, ...]:
    """Return limits from tables: name of a reference point -> node, operating, non_operating, start_up, loads, mark, source."""
    if not tables:
        raise ScenarioError("no limits are given. Write a table per reference point: node, operating = [low, high].", where)
    return tuple(_limits(name, table, f"{where}, {name}") for name, table in tables.items())


def _limits(name: str, table: Any, where: str) -> Limits:
    if not isinstance(table, Mapping):
        raise ScenarioError("a reference point is a table with node and operating = [low, high].", where)
    for key in table:
        if key not in KEYS:
            raise ScenarioError(f"a reference point has {', '.join(KEYS)}, not '{key}'.{nearest(key, KEYS)}", where)
    if "node" not in table or "operating" not in table:
        raise ScenarioError("a reference point needs its node, and operating = [low, high].", where)
    ends = {field: _ends(table[field], f"{where}.{field}") for field in STATES.values() if field in table}
    loads, mark = table.get("loads", []), str(table.get("mark", "project"))
    return Limits(name, str(table["node"]), **ends, loads=tuple(loads), mark=mark, source=str(table.get("source", "")))


def _ends(given: Any, where: str) -> Ends:
    if not isinstance(given, list | tuple) or len(given) != 2:
        raise ScenarioError('a limit is a pair, ["-20 [degC]", "55 [degC]"]; an empty text for an end that nobody set.', where)
    low, high = (literal(t, TEMPERATURE, where) if t else None for t in given)
    return (-np.inf if low is None else low, np.inf if high is None else high)
