"""A heater programme: duties of the heaters over time, from a file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from thermid.errors import MissingDataError, RecordError, nearest
from thermid.files import parse_toml, read_text
from thermid.measure.amounts import amount

_KEYS = ("at", "heater1", "heater2")
_TOP = ("steps", "end", "title")


@dataclass(frozen=True)
class Programme:
    """Duties that hold from one time to the next.

    Parameters
    ----------
    times : tuple of float            When each step begins. [s]
    duties : tuple of pairs of int    Duties of both heaters. [0.1 %]
    end : float or None               When heaters go off and the log ends. [s]
    """

    times: tuple[float, ...]
    duties: tuple[tuple[int, int], ...]
    end: float | None = None

    @property
    def heats(self) -> bool:
        """Whether any of its steps turns a heater on."""
        return any(any(pair) for pair in self.duties)

    def at(self, seconds: float) -> tuple[int, int]:
        """Return both duties at a time. [0.1 %]"""
        if self.end is not None and seconds >= self.end:
            return (0, 0)
        now = [duty for time, duty in zip(self.times, self.duties, strict=True) if time <= seconds]
        return now[-1] if now else (0, 0)


def load_programme(path: str | Path) -> Programme:
    """Return the programme of a file.

    Raises
    ------
    MissingDataError   When there is no such file.
    RecordError        When it is no TOML, times do not increase, a duty is not 0 to 100 %, or a key is unknown.
    """
    place = Path(path)
    if not place.is_file():
        raise MissingDataError("there is no such heater programme.", str(place))
    try:
        content = parse_toml(read_text(place))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RecordError(f"it is no TOML: {error}.", place.name) from None
    for key in content:
        if key not in _TOP:
            raise RecordError(f"no key '{key}'; there are {', '.join(_TOP)}.{nearest(key, _TOP)}", place.name)
    steps = content.get("steps")
    if not isinstance(steps, list) or not steps:
        raise RecordError('a programme has steps = [{ at = "0 [s]", heater1 = "40 [%]" }, ...].', place.name)
    times: list[float] = []
    duties: list[tuple[int, int]] = []
    held = (0, 0)
    for k, step in enumerate(steps):
        where = f"{place.name}, steps[{k}]"
        if not isinstance(step, Mapping) or "at" not in step:
            raise RecordError('a step needs a time: at = "10 [min]".', where)
        for key in step:
            if key not in _KEYS:
                raise RecordError(f"no key '{key}'; there are {', '.join(_KEYS)}.{nearest(key, _KEYS)}", where)
        times.append(amount(step["at"], "s", f"{where}, at"))
        if times[-1] < 0 or (k and times[-1] <= times[-2]):
            raise RecordError(f"its time {times[-1]:g} s does not follow {times[-2] if k else 0:g} s.", where)
        held = (_duty(step.get("heater1"), held[0], f"{where}, heater1"), _duty(step.get("heater2"), held[1], f"{where}, heater2"))
        duties.append(held)
    end = None if "end" not in content else amount(content["end"], "s", f"{place.name}, end")
    if end is not None and end <= times[-1]:
        raise RecordError(f"its end, {end:g} s, does not follow its last step, {times[-1]:g} s.", place.name)
    return Programme(tuple(times), tuple(duties), end)


def _duty(given: object, held: int, where: str) -> int:
    """Return a duty, or the one before where none is given. [0.1 %]"""
    if given is None:
        return held
    share = amount(given, "1", where)
    if not 0 <= share <= 1:
        hint = f" Write '{given} [%]'." if isinstance(given, (int, float)) and 1 < given <= 100 else ""
        raise RecordError(f"{given!r} is not from 0 to 100 %.{hint}", where)
    return round(share * 1000)
