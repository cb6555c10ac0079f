"""What physics and the pages allow of each number of a deck: one row a field, with its reason.

It was written from the pages and from physics, and asks nothing of the package: the table of ranges of the product is judged by it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

INF: Final = math.inf


class Row(NamedTuple):
    """A field: the lowest and the highest value [SI], whether they themselves are allowed, and why."""

    low: float
    high: float
    ends: bool
    reason: str


def _from(low: float, reason: str, high: float = INF) -> Row:
    return Row(low, high, True, reason)


def _above(low: float, reason: str, high: float = INF) -> Row:
    return Row(low, high, False, reason)


_SECOND = "heat goes from hot to cold: a conductance below zero breaks the second law"
_EXTENT = "no length or area is below zero"
_DIVIDES = "it stands below a fraction bar: at zero the conductance, speed or pressure has no bound"
_SHARE = "a share of what is there: zero to one"
_KELVIN = "nothing is colder than 0 K"
_STORES = "heat that goes in warms: no capacity is below zero"
_AMOUNT = "there is no less of it than none"
_TIME = "a time that passes is above zero"
_WAITS = "nothing answers before it is asked"
_ANY = Row(-INF, INF, True, "either sign has a meaning")

ROWS: Final[dict[str, Row]] = {
    "capacitance": _from(0.0, _STORES),
    "case_capacitance": _from(0.0, _STORES),
    "mass": _from(0.0, _AMOUNT),
    "specific_heat": _from(0.0, _STORES),
    "liquid_specific_heat": _from(0.0, _STORES),
    "specific_heat.points.1": _from(0.0, _STORES),
    "enthalpy.points.1": _ANY,
    "latent_heat": _from(0.0, "melting takes heat up"),
    "supercooling": _from(0.0, "a melt is no warmer than where it melts while it supercools"),
    "density": _from(0.0, _AMOUNT),
    # temperatures
    "melts_from": _from(0.0, _KELVIN),
    "melts_to": _from(0.0, _KELVIN),
    "start_temperature": _from(0.0, _KELVIN),
    "reference_temperature": _from(0.0, _KELVIN),
    "T_hot": _above(0.0, "the Seebeck coefficient is a voltage divided by it"),
    "setpoint": _from(0.0, _KELVIN),
    "on_below": _from(0.0, _KELVIN),
    "off_above": _from(0.0, _KELVIN),
    "above": _from(0.0, _KELVIN),
    "points.0": _from(0.0, _KELVIN),
    "difference": _ANY,
    "on_above": _ANY,
    "off_below": _ANY,
    # paths of heat
    "conductance": _from(0.0, _SECOND),
    "conductance_each": _from(0.0, _SECOND),
    "on_conductance": _from(0.0, _SECOND),
    "off_conductance": _from(0.0, _SECOND),
    "contact_conductance": _from(0.0, _SECOND),
    "resistance": _above(0.0, _DIVIDES),
    "theta_JC": _above(0.0, _DIVIDES),
    "theta_JB": _above(0.0, _DIVIDES),
    "psi_JT": _from(0.0, "the top of a heated case is no warmer than its junction"),
    "deviation_JC": _above(-1.0, "a resistance less all of itself is none"),
    "deviation_JB": _above(-1.0, "a resistance less all of itself is none"),
    "conductivity": _from(0.0, _SECOND),
    "fin_conductivity": _from(0.0, _SECOND),
    "filler_conductivity": _from(0.0, _SECOND),
    "conductivity.points.1": _from(0.0, _SECOND),
    "htc": _from(0.0, _SECOND),
    "effective_htc": _from(0.0, _SECOND),
    "coefficient": _from(0.0, _SECOND),
    "exponent": _above(-1.0, "the heat, difference to the power of one more, would not vanish with the difference"),
    "convection_factor": _from(0.0, _SECOND),
    "scale": _from(0.0, _SECOND),
    "loads.scale": _ANY,
    "table.points.1": _from(0.0, _SECOND),
    "transition": _from(0.0, _EXTENT),
    "resistance_length": _above(0.0, _DIVIDES),
    "vacuum_resistance_length": _above(0.0, _DIVIDES),
    # extents
    "area": _from(0.0, _EXTENT),
    "source_area": _from(0.0, _EXTENT),
    "plate_area": _from(0.0, _EXTENT),
    "cross_section": _from(0.0, _EXTENT),
    "perimeter": _from(0.0, _EXTENT),
    "diameter": _from(0.0, _EXTENT),
    "washer": _above(0.0, _DIVIDES),
    "bolted.diameter": _above(0.0, _DIVIDES),
    "duct.diameter": _above(0.0, _DIVIDES),
    "width": _above(0.0, _DIVIDES),
    "height": _above(0.0, _DIVIDES),
    "distance": _above(0.0, _DIVIDES),
    "length": _above(0.0, _DIVIDES),
    "duct.length": _from(0.0, _EXTENT),
    "heat_sink.length": _from(0.0, _EXTENT),
    "wedge_lock.length": _from(0.0, _EXTENT),
    "thickness": _above(0.0, _DIVIDES),
    "bolted.thickness": _from(0.0, _EXTENT),
    "spreading.thickness": _from(0.0, _EXTENT),
    "filler_thickness": _above(0.0, _DIVIDES),
    "fin_thickness": _from(0.0, _EXTENT),
    "gap": _from(0.0, _EXTENT),
    "roughness": _above(0.0, _DIVIDES),
    "slope": _from(0.0, _EXTENT),
    "aspect": _above(0.0, "the height of a gap over its thickness"),
    "tilt": _ANY,
    "azimuth": _ANY,
    "count": _from(0.0, _AMOUNT),
    "duct.count": _above(0.0, _DIVIDES),
    "heat_sink.count": _above(0.0, _DIVIDES),
    # forces
    "contact_pressure": _from(0.0, "what is pressed together is not pulled"),
    "hardness": _above(0.0, _DIVIDES),
    "torque": _from(0.0, "a screw that is turned open presses nothing"),
    "nut_factor": _above(0.0, _DIVIDES),
    # radiation and gas
    "emissivity": _from(0.0, _SHARE, 1.0),
    "absorptance": _from(0.0, _SHARE, 1.0),
    "accommodation": _from(0.0, _SHARE, 1.0),
    "exchange_factor": _from(0.0, _SHARE, 1.0),
    "view_factors": _from(0.0, _SHARE, 1.0),
    "pressure": _from(0.0, "a gas pushes"),
    "gravity": _from(0.0, "the size of a vector"),
    "wind": _from(0.0, "the size of a vector"),
    # streams
    "mass_flow": _from(0.0, "without `reversible` a stream goes one way"),
    "volume_flow": _from(0.0, "without `reversible` a stream goes one way"),
    "reversible.volume_flow": _ANY,
    "curve.0": _from(0.0, "a fan's curve is that of its forward flow"),
    "curve.1": Row(-INF, INF, True, "beyond its free flow a fan is a brake"),
    "passes.0": _above(0.0, _DIVIDES),
    "passes.1": _from(0.0, "a resistance takes pressure"),
    "linear_resistance": _from(0.0, "a resistance takes pressure"),
    "fans.resistance": _from(0.0, "a resistance takes pressure"),
    "speed": _from(0.0, "stated as a share of that of the curve"),
    "head": _from(0.0, "a fan pushes where nothing flows"),
    "slope_of_fan": _ANY,
    # powers and courses
    "power": _ANY,
    "command_curve": _ANY,
    "amplitude": _ANY,
    "temperature_coefficient": _ANY,
    "quadratic_coefficient": _ANY,
    "exponential_coefficient": _ANY,
    "current": _ANY,
    "loads.table.points.1": _ANY,
    "duty": _from(0.0, _SHARE, 1.0),
    "period": _above(0.0, _TIME),
    "times": _ANY,
    "values": _ANY,
    # controls
    "gain": _ANY,
    "band": Row(-INF, INF, True, "a negative band cools; at zero the factor has no value"),
    "lowest": _ANY,
    "highest": _ANY,
    "begins": _ANY,
    "sample": _above(0.0, _TIME),
    "integral_time": _above(0.0, _DIVIDES),
    "derivative_time": _from(0.0, _WAITS),
    "filter_time": _from(0.0, _WAITS),
    "after": _from(0.0, _WAITS),
    "follows": _ANY,
    "modes": _ANY,
    "controls.table.points.1": _ANY,
    # parts of data sheets
    "R": _above(0.0, _DIVIDES),
    "tau": _above(0.0, _TIME),
    "C": _from(0.0, _STORES),
    "V_max": _above(0.0, "a resistance of the module is proportional to it"),
    "I_max": _above(0.0, "the resistance of the module is divided by it"),
    "dT_max": _above(0.0, "the conductance of the module is divided by it"),
    "Q_max": _above(0.0, "a cooler takes heat up"),
    "size": _from(0.0, _AMOUNT),
}  # fmt: skip
"""By the last words of a field; with the kind of conductor, or the group, before them where that changes what is allowed."""
NOT_ZERO: Final = ("band",)
"""Fields of either sign that are not zero."""
RISING: Final = ("points.0", "times", "curve.0")
"""Columns whose rows rise: two values at one place are no table."""
NOT_FALLING: Final = ("enthalpy.points.1",)
"""Columns whose rows do not fall: heat that goes in warms."""
FALLING: Final = ("curve.1",)
"""Columns whose rows fall: stall is not modelled."""
UNBOUNDED: Final = ("resistance", "resistance_length", "vacuum_resistance_length", "theta_JC", "theta_JB", "R")
"""Resistances may be infinite: no path."""
NOT_BELOW: Final = {
    "plate_area": "source_area",
    "melts_to": "melts_from",
    "off_above": "on_below",
    "on_above": "off_below",
    "highest": "lowest",
    "T_hot": "dT_max",
}
"""Field -> the field of the same table that it is not below."""
_ENDS: Final = {"R1": "R", "R2": "R", "R3": "R", "C1": "C", "C2": "C", "C3": "C", "open": "modes", "closed": "modes"}
_OF_FANS: Final = {
    "head_0": "head",
    "head_1": "head",
    "slope_0": "slope_of_fan",
    "slope_1": "slope_of_fan",
    "resistance": "fans.resistance",
}


def row_of(deck: dict[str, Any], place: Sequence[str | int]) -> tuple[str, Row]:
    """Return the name of the row of a place in a deck, or of a path of a parameter, and the row.

    Raises
    ------
    KeyError   When no row has it.
    """
    words = [w for w in place if isinstance(w, str)]
    groups = {g: held for g, held in deck.items() if isinstance(held, dict)}
    group = words[0] if words[0] in groups else next((g for g, held in groups.items() if words[0] in held), "")
    name = words[1] if group == words[0] else words[0]
    table = groups.get(group, {}).get(name, {})
    kind = table.get("kind", "") if isinstance(table, dict) else ""
    last = words[-1]
    if "fans" in (group, words[0]):
        last = _OF_FANS.get(last, last)
    last = _ENDS.get(last, last)
    if group == "controls" and "follows" in words:
        last = "follows"
    if last in ("points", "curve", "passes", "foster", "cauer"):
        column = place[-1]
        if last in ("foster", "cauer"):
            last = ("R", "tau" if last == "foster" else "C")[int(column)]
        elif last == "points" and column == 0:
            last = "difference" if isinstance(table.get("table"), dict) and table["table"].get("over") == "difference" else "points.0"
        elif last == "points":
            last = f"{words[-2]}.points.1"
        else:
            last = f"{last}.{column}"
    before = [group, kind, *(["reversible"] if table.get("reversible") else [])] if isinstance(table, dict) else [group]
    key = next((f"{b}.{last}" for b in before if f"{b}.{last}" in ROWS), last)
    return key, ROWS[key]


def _number(deck: dict[str, Any], place: Sequence[str | int], read: Any) -> float | None:
    now: Any = deck
    for step in place:
        if isinstance(now, dict) and step not in now:
            return None
        now = now[step]
    return read(now)


def forbidden(deck: dict[str, Any], place: Sequence[str | int], value: float, read: Any) -> str:
    """Return why a value may not stand at a place of a deck, or nothing.

    Parameters
    ----------
    deck : dict       As it was before the value came in.
    place : sequence  Of the value, or the words of its path.
    value : float     In SI.
    read : callable   From what stands in a deck to a number in SI, or None.
    """
    key, row = row_of(deck, place)
    last = key.rpartition(".")[2] if key not in RISING else key
    if not math.isfinite(value) and not (key in UNBOUNDED and value > 0.0):
        return f"{key}: no quantity of a deck is without bound"
    if value < row.low or value > row.high or (not row.ends and value == row.low) or (last in NOT_ZERO and value == 0.0):
        return f"{key}: {row.reason}"
    if place[0] not in deck:
        return ""  # a path: what stands beside it is judged by its place
    if key in (*RISING, *NOT_FALLING, *FALLING):
        depth = -1 if key == "times" else -2
        for step in (-1, 1):
            near = [*place]
            near[depth] = int(place[depth]) + step  # type: ignore[call-overload]
            if int(near[depth]) < 0:  # type: ignore[call-overload]
                continue
            try:
                other = _number(deck, near, read)
            except IndexError:
                continue
            sign = -step if key in FALLING else step
            if other is not None and ((value - other) * sign > 0.0 or (value == other and key not in NOT_FALLING)):
                return f"{key}: a row is not beyond the one before"
    for upper, lower in NOT_BELOW.items():
        if last in (upper, lower):
            other = _number(deck, [*place[:-1], lower if last == upper else upper], read)
            if other is not None and (value - other) * (1.0 if last == upper else -1.0) < 0.0:
                return f"{upper} is not below {lower}"
    return ""
