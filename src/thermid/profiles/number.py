"""A number of a standard, with the clause it stands in and the mark of how it is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from thermid.errors import ScenarioError, nearest
from thermid.model.laws.signal import literal
from thermid.physics.constants import ICE_POINT
from thermid.sourced import check_mark
from thermid.units import TEMPERATURE

SLOTS: Final[Mapping[str, str]] = {
    "hot": TEMPERATURE,
    "cold": TEMPERATURE,
    "middle": TEMPERATURE,
    "ambient": TEMPERATURE,
    "hot_least": TEMPERATURE,
    "cold_least": TEMPERATURE,
    "margin": "K",
    "tolerance": "K",
    "ramp": "K/s",
    "ramp_least": "K/s",
    "cycles": "1",
    "base_cycles": "1",
    "base_range": "K",
    "range_exponent": "1",
    "dwell": "s",
    "soak": "s",
    "soak_ends": "s",
    "operate": "s",
    "operate_ends": "s",
    "off": "s",
    "pressure": "Pa",
    "rough_pressure": "Pa",
    "pump_down": "s",
    "humidity": "1",
    "longest_wait": "s",
    "average": "s",
}
"""Numbers of a profile -> their unit."""

USUAL: Final[Mapping[str, str]] = {TEMPERATURE: "degC", "K/s": "K/min", "s": "h"}
"""Unit of a number -> the one that a person means who writes none."""

WORDS: Final[Mapping[str, tuple[str, ...]]] = {
    "stable": (),
    "starts": ("each", "first and last", "never"),
    "first": ("hot", "cold"),
    "last": ("hot", "cold"),
}
"""Words of a profile -> what they may be; the rule of stability is checked by itself."""


@dataclass(frozen=True)
class Number:
    """A number or word of a profile.

    Parameters
    ----------
    value : float or str    [SI]
    slot : str              Its unit; empty for a word.
    mark : str              How it is known; see `MARKS`.
    clause : str            Where it stands.
    note : str              What a reader must know beside it.
    """

    value: float | str
    slot: str
    mark: str
    clause: str = ""
    note: str = ""

    @property
    def text(self) -> str:
        """The value with its unit, as a file holds it."""
        if isinstance(self.value, str):
            return self.value
        v = self.value
        if self.slot == TEMPERATURE:
            return f"{round(v - ICE_POINT, 9):.6g} [degC]"
        if self.slot == "K/s":
            return f"{round(60.0 * v, 9):.6g} [K/min]"
        if self.slot == "s":
            return f"{v / 3600.0:.6g} [h]" if v >= 7200.0 or (v >= 3600.0 and v % 3600.0 == 0) else f"{v / 60.0:.6g} [min]"
        return f"{v:.6g}" if self.slot == "1" else f"{v:.6g} [{self.slot}]"


def number(name: str, spec: Any, mark: str, clause: str, where: str) -> Number:
    """Return a number from what a file or a caller writes: a value, or a table of value, mark, clause and note.

    Raises
    ------
    ScenarioError   When there is no such number, mark or word.
    UnitError       When its unit does not fit.
    """
    place = f"{where}, {name}"
    if isinstance(spec, Number):
        return spec
    if name not in SLOTS and name not in WORDS:
        raise ScenarioError(f"a profile has no '{name}'.{nearest(name, [*SLOTS, *WORDS])}", where)
    note = ""
    if isinstance(spec, Mapping):
        unknown = set(spec) - {"value", "mark", "clause", "note"}
        if unknown or "value" not in spec:
            raise ScenarioError("a number is a value, or a table of value, mark, clause and note.", place)
        mark, clause, note = spec.get("mark", mark), spec.get("clause", clause), spec.get("note", "")
        spec = spec["value"]
    check_mark(mark, place)
    if name in WORDS:
        if not isinstance(spec, str) or (WORDS[name] and spec not in WORDS[name]):
            raise ScenarioError(f"{spec!r} is none of {', '.join(WORDS[name]) or 'the rules of stability'}.", place)
        return Number(spec, "", mark, clause, note)
    if isinstance(spec, bool) or not isinstance(spec, str | int | float):
        raise ScenarioError(f"{spec!r} is no value with a unit.", place)
    value = literal(spec, SLOTS[name], place) if isinstance(spec, str) else float(spec)
    if SLOTS[name] != TEMPERATURE and value < 0.0:
        raise ScenarioError(f"{spec!r} is below zero.", place)
    return Number(value, SLOTS[name], mark, clause, note)


def typed(name: str, text: str) -> str | float:
    """Return what a person wrote for a number of a profile, in its usual unit where there is none; a word as it is."""
    slot = SLOTS.get(name)
    try:
        value = float(text)
    except ValueError:
        return text.strip()
    if slot is None:
        return text.strip()
    return value if slot == "1" else f"{text.strip()} [{USUAL.get(slot, slot)}]"
