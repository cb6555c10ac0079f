"""What a profile asks for, one thing after the other: go to a temperature, wait until the unit is stable, stay, switch off, switch on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from thermid.errors import ScenarioError, nearest
from thermid.model.laws.signal import literal
from thermid.sourced.number import MARKS, SLOTS
from thermid.units import TEMPERATURE

if TYPE_CHECKING:
    from thermid.profiles.profile import ThermalProfile

__all__ = ["STEP_KEYS", "Step", "steps_of"]

STEP_KEYS = ("name", "cycle", "to", "over", "ramp", "pressure", "humidity", "wait", "dwell", "power", "mark")


@dataclass(frozen=True)
class Step:
    """One step of a profile. What is None stays as it was.

    Parameters
    ----------
    name : str                  What it is.
    cycle : int                 The cycle that it belongs to, from 1; 0 before the first and after the last.
    target : float or None      Temperature that the chamber goes to. [K]
    over : float or None        Time in which it goes there. [s]
    ramp : float or None        Rate at which it goes there, where no time is given. [K/s]
    pressure : float or None    Pressure that it goes to. [Pa]
    humidity : float or None    Relative humidity that it goes to. [-]
    wait : bool                 Whether to wait until the unit is stable.
    dwell : float               Time to stay after that. [s]
    power : bool or None        Whether the unit is switched on.
    mark : str                  How the numbers of the step are known.
    """

    name: str
    cycle: int = 0
    target: float | None = None
    over: float | None = None
    ramp: float | None = None
    pressure: float | None = None
    humidity: float | None = None
    wait: bool = False
    dwell: float = 0.0
    power: bool | None = None
    mark: str = "read"


def steps_of(profile: ThermalProfile) -> tuple[Step, ...]:
    """Return the steps of a profile, every cycle written out.

    Raises
    ------
    ScenarioError   When a number that the steps need is missing.
    """
    count = int(profile.value("cycles"))
    if count < 1 or count != profile.value("cycles"):
        raise ScenarioError(f"a profile has a whole number of cycles, at least one, not {profile['cycles'].text}.", profile.title)
    if not profile.plan:
        return tuple(_cycling(profile, count))
    out: list[Step] = []
    for k in range(1, count + 1):
        written = (_read(profile, row, f"{profile.title}, step {n}") for n, row in enumerate(profile.plan, 1))
        out += [replace(s, cycle=s.cycle or k) for s in written]
    return tuple(out)


def _read(profile: ThermalProfile, row: Mapping[str, Any], where: str) -> Step:
    """Return a step as a file writes it; a value may be the name of a number of the profile."""
    for key in row:
        if key not in STEP_KEYS:
            raise ScenarioError(f"a step has no '{key}'; it has {', '.join(STEP_KEYS)}.{nearest(key, STEP_KEYS)}", where)

    def value(key: str, slot: str) -> float | None:
        given = row.get(key)
        if given is None:
            return None
        if isinstance(given, str) and given in SLOTS:
            return profile.value(given)
        found = literal(given, slot, f"{where}, {key}")
        if slot != TEMPERATURE and found < 0.0:
            raise ScenarioError(f"{given!r} is below zero.", f"{where}, {key}")
        return found

    power = row.get("power")
    if power not in (None, "on", "off"):
        raise ScenarioError(f"{power!r}: power is on or off.", where)
    mark = row.get("mark", profile.step_mark)
    if mark not in MARKS:
        raise ScenarioError(f"there is no mark '{mark}'; there are {', '.join(MARKS)}.{nearest(str(mark), MARKS)}", where)
    target, over = value("to", TEMPERATURE), value("over", "s")
    ramp = value("ramp", "K/s")
    if target is not None and over is None and ramp is None:
        ramp = profile.value("ramp")
    return Step(
        str(row.get("name", "step")),
        int(row.get("cycle", 0)),
        target,
        over,
        ramp,
        value("pressure", "Pa"),
        value("humidity", "1"),
        bool(row.get("wait", False)),
        value("dwell", "s") or 0.0,
        None if power is None else power == "on",
        mark,
    )


def _cycling(profile: ThermalProfile, count: int) -> Iterator[Step]:
    """Yield the steps of cycles between hot and cold."""
    value, has = profile.value, profile.has
    ramp, powered = value("ramp"), profile.word("starts", "never") != "never"
    if has("pressure"):
        if has("rough_pressure"):
            yield Step("pump down", power=powered, pressure=value("rough_pressure"), over=value("pump_down"))
        yield Step("high vacuum", power=powered, pressure=value("pressure"), over=value("pump_down") if has("pump_down") else 600.0)
    first = profile.word("first", "hot")
    order = (first, "cold" if first == "hot" else "hot")
    for k in range(1, count + 1):
        for side in order:
            yield from _plateau(profile, side, k, count, ramp, powered)
    if profile.word("last", order[1]) != order[1]:
        yield Step(f"to {first}, closing half cycle", 0, value(first), None, ramp, wait=True, power=powered)
        yield Step(f"{first}, closing half cycle", 0, dwell=value("dwell") if has("dwell") else 0.0)
    yield Step("return", 0, value("ambient"), None, ramp, power=powered)
    if has("pressure"):
        yield Step("let in gas", 0, pressure=profile.ground, over=600.0)


def _plateau(profile: ThermalProfile, side: str, k: int, count: int, ramp: float, powered: bool) -> Iterator[Step]:
    """Yield one stay at hot or cold: there, stable, dwell, off, start, operation until the soak is over."""
    value = profile.value

    def at_ends(name: str) -> float:
        """Return a number that may be another in the first and the last cycle."""
        own = f"{name}_ends" if k in (1, count) and profile.has(f"{name}_ends") else name
        return value(own) if profile.has(own) else 0.0

    starts = profile.word("starts", "never")
    start = starts == "each" or (starts == "first and last" and k in (1, count))
    dwell = value("dwell") if profile.has("dwell") else 0.0
    off = value("off") if start and profile.has("off") else 0.0
    operate = at_ends("operate") if side == "hot" and start else 0.0
    left = max(at_ends("soak") - dwell - off, operate)
    yield Step(f"to {side}", k, value(side), None, ramp, wait=profile.has("stable"), power=powered)
    if start:
        if dwell:
            yield Step(f"{side} dwell", k, dwell=dwell)
        yield Step(f"{side}, off", k, dwell=off, power=False)
        yield Step(f"{side} start", k, dwell=left, power=True)
    elif dwell + left > 0.0:
        yield Step(f"{side} soak" if not dwell else f"{side} dwell", k, dwell=dwell + left)
