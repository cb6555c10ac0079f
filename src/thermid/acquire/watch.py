"""Faults as they come: each beginning and each end is a mark, and no faulty value is shown as a temperature."""

from __future__ import annotations

from collections.abc import Callable, Collection

from thermid.acquire.benchlog import MOST_CURRENT, RANGE
from thermid.acquire.wire import Line

_WORDS = {
    "crc": "three readings with a wrong CRC",
    "lost": "nothing answers",
    "short": "the bus is held low",
    "power": "it was without supply and may show 85 degC",
    "range": "its value lies outside -55 to 125 degC",
    "over": f"{MOST_CURRENT:g} A, the most that it can measure, is reached",
    "absent": "it is in the map and does not answer",
    "85": "it shows the 85 degC of power-up",
}
_QUIET = ("count",)


class Watch:
    """State of each source.

    Parameters
    ----------
    name_of : callable   Name of a source.
    roms : collection    Sensors of the map.
    """

    def __init__(self, name_of: Callable[[str], str], roms: Collection[str] = ()) -> None:
        self._name, self._known = name_of, set(roms)
        self._called: set[str] = set()
        self._told: set[str] = set()
        self.values: dict[str, float] = {}
        """Last good value of each source: degC, heater share of one, V, A."""
        self.faults: dict[str, str] = {}
        self.counts: dict[str, int] = {}

    def look(self, line: Line) -> list[tuple[str, str]]:
        """Return the marks that a line asks for: word and text."""
        if line.kind == "E" and line.fields[0] not in _QUIET:
            if line.fields[0] == "latched":
                return [("latched", f"heaters stay off since they were cut off ({line.fields[1]}), until --clear-latch")]
            detail = self._name(line.fields[1]) if len(line.fields) > 1 else ""
            return [(line.fields[0], f"the board says so{' of ' + detail if detail else ''}")]
        if line.kind in "BSC":
            return self._roll_call(line)
        if line.kind != "D":
            return []
        source, _, status = line.fields
        value = None if line.raw is None else line.raw * (1 / 16 if len(source) == 16 else {"H": 1e-3, "V": 1e-3, "I": 1e-4}[source[0]])
        fault = "" if status == "ok" else status
        if not fault and len(source) == 16 and value is not None:
            if not RANGE[0] <= value <= RANGE[1]:
                fault = "range"
            elif value == 85.0 and abs(self.values.get(source, 0.0) - 85.0) > 2.0:
                fault = "85"
        elif not fault and source[0] == "I" and value is not None and abs(value) >= MOST_CURRENT:
            fault = "over"
        before = self.faults.get(source, "")
        if fault:
            self.faults[source] = fault
            self.counts[source] = self.counts.get(source, 0) + 1
        else:
            self.faults.pop(source, None)
            if value is not None:
                self.values[source] = value
        if fault == before:
            return []
        return (
            [("fault", f"{self._name(source)} {fault}: {_WORDS[fault]}")] if fault else [("good", f"{self._name(source)} after {before}")]
        )

    def _roll_call(self, line: Line) -> list[tuple[str, str]]:
        """Return marks for sensors of the map that do not answer, and for those that answer and are not in it."""
        if line.kind == "B":
            self._called = set()
        if line.kind == "S":
            self._called.add(line.fields[0])
        absent, unnamed = self._known - self._called, self._called - self._known
        if line.kind != "C" or not self._known or self._told == absent | unnamed:
            return []
        self._told = absent | unnamed
        self.faults |= dict.fromkeys(absent, "absent")
        return [("absent", f"{self._name(rom)} (ROM {rom}): {_WORDS['absent']}") for rom in sorted(absent)] + [
            ("unnamed", f"{rom} answers and is not in the map") for rom in sorted(unnamed)
        ]
