"""Range of every number of a deck by field, each with its reason: what physics allows, whatever way the number came in.

A field is looked up as ``kind.field`` first, such as ``table.scale`` of a conductor of kind `table`, then by its name alone. Temperatures
have one row for all. Bounds are those of SI.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from thermid.base.units import TEMPERATURE, value_of

INFINITE: Final = float("inf")
MAX_FLOAT, MIN_FLOAT = sys.float_info.max, math.ulp(0.0)
"""Largest finite number, and smallest one above zero."""
BOUND_ROUNDING: Final = 1e-6
"""Share of an upper bound by which a value may lie above it: what a fit at its bound makes of one. [-]"""


@dataclass(frozen=True)
class Range:
    """Values that a field may have.

    Parameters
    ----------
    words : str         What to give, in words.
    why : str           The reason.
    low, high : float   Bounds, both allowed. [SI]
    nonzero : bool      Whether zero is out.
    """

    words: str
    why: str
    low: float = -MAX_FLOAT
    high: float = MAX_FLOAT
    nonzero: bool = False


def _above_zero(why: str) -> Range:
    """Return finite values above zero, for the reason `why`."""
    return Range("a finite value above zero", why, MIN_FLOAT)


def _above_zero_or_infinite(why: str) -> Range:
    """Return values above zero, infinity too, for the reason `why`."""
    return Range("a value above zero", why, MIN_FLOAT, INFINITE)


def _from_zero(why: str) -> Range:
    """Return finite values from zero on, for the reason `why`."""
    return Range("a finite value, zero or more", why, 0.0)


def _share(why: str) -> Range:
    """Return 0 to 1 with a little rounding at the top, for the reason `why`."""
    return Range("0 to 1", why, 0.0, 1.0 + BOUND_ROUNDING)


def _finite(why: str) -> Range:
    """Return all finite values, for the reason `why`."""
    return Range("a finite number", why)


def _nonzero(why: str) -> Range:
    """Return all finite values but zero, for the reason `why`."""
    return Range("a finite value other than zero", why, nonzero=True)


_LENGTH: Final = _above_zero("a body has a size in every direction")
_CONDUCTS: Final = _from_zero("heat never flows from cold to hot by itself")
_HEAT: Final = _above_zero("a body that becomes warmer takes up heat")
_MATERIAL: Final = _above_zero("the formula divides by it, and every material has some")
_LEVEL: Final = _finite("a temperature difference may have either sign")

RANGES: Final[Mapping[str, Range]] = {
    TEMPERATURE: Range("a temperature of 0 K or more", "nothing is colder than absolute zero", 0.0),
    # nodes
    "mass": _above_zero("for a massless node leave mass and specific_heat out"),
    "specific_heat": _HEAT,
    "capacitance": _above_zero("for a massless node leave it out"),
    "latent_heat": _HEAT,
    "liquid_specific_heat": _HEAT,
    "supercooling": _above_zero("a melt that freezes at its melting point has none: leave it out"),
    "made_in.pressure": _from_zero("a gas presses, it does not pull"),
    "made_in.gravity": _from_zero("give its magnitude"),
    "made_in.wind": _from_zero("give its speed"),
    # surfaces, conductors, joints
    "area": _from_zero("an area cannot be negative"),
    "htc": _CONDUCTS,
    "effective_htc": _CONDUCTS,
    "htc.coefficient": _CONDUCTS,
    "htc.exponent": Range("0 to 3", "a coefficient stays finite where the difference is zero; boiling has 2, convection less", 0.0, 3.0),
    "htc.length": _LENGTH,
    "emissivity": _share("a black surface emits 1"),
    "absorptance": _share("a surface absorbs at most what falls on it"),
    "exchange_factor": _share("no pair exchanges more than two black faces; an exchange area belongs into the area"),
    "conductivity": _CONDUCTS,
    "thickness": _above_zero("without a thickness both nodes would have one temperature: merge them"),
    "conductance": _CONDUCTS,
    "resistance": _above_zero_or_infinite("without a resistance both nodes would have one temperature: merge them"),
    "contact_conductance": _CONDUCTS,
    "contact_pressure": _from_zero("a joint presses, it does not pull"),
    "hardness": _MATERIAL,
    "roughness": _above_zero("the formula of a contact divides by it; every face has some"),
    "slope": _above_zero("the asperities of every face have a slope"),
    "gap": _above_zero("a gap has a distance"),
    "aspect": Range("1 or more", "the gap is measured along its longer side; turn it otherwise", 1.0),
    "dimensions": _LENGTH,
    "accommodation": Range(
        "a value above 0, up to 1", "the share of molecules that take a face's temperature", MIN_FLOAT, 1.0 + BOUND_ROUNDING
    ),
    "convection_factor": _CONDUCTS,
    "mass_flow": _from_zero("a stream that may change direction is a flow with reversible = true"),
    "volume_flow": _from_zero("a stream that may change direction is a flow with reversible = true"),
    "reversible.mass_flow": _finite("its sign is the direction of the stream"),
    "reversible.volume_flow": _finite("its sign is the direction of the stream"),
    "density": _MATERIAL,
    "diameter": _LENGTH,
    "width": _LENGTH,
    "height": _LENGTH,
    "length": _LENGTH,
    "count": _above_zero("leave out what is not there"),
    "fin_thickness": _LENGTH,
    "fin_conductivity": _MATERIAL,
    "cross_section": _LENGTH,
    "perimeter": _LENGTH,
    "lead.conductivity": _MATERIAL,
    "bolted.conductivity": _MATERIAL,
    "spreading.conductivity": _MATERIAL,
    "on_conductance": _CONDUCTS,
    "off_conductance": _CONDUCTS,
    "transition": _above_zero("a heat pipe starts over some kelvin"),
    "conductance_each": _CONDUCTS,
    "torque": _from_zero("a screw is tightened, not loosened"),
    "washer": _LENGTH,
    "nut_factor": _above_zero("the preload of a screw is its torque over this factor"),
    "filler_conductivity": _CONDUCTS,
    "filler_thickness": _LENGTH,
    "resistance_length": _above_zero_or_infinite("an edge without a resistance would join both nodes: merge them"),
    "vacuum_resistance_length": _above_zero_or_infinite("an edge without a resistance would join both nodes: merge them"),
    "source_area": _LENGTH,
    "plate_area": _LENGTH,
    "table.scale": _CONDUCTS,
    # loads
    "power": _finite("a load heats or cools"),
    "scale": _finite("a load heats or cools"),
    "command_curve": _finite("a power may rise faster or slower than its command"),
    "temperature_coefficient": _finite("a power may rise or fall with temperature"),
    "quadratic_coefficient": _finite("a power may rise or fall with temperature"),
    "exponential_coefficient": _finite("a power may rise or fall with temperature"),
    "periodic.period": _above_zero("a period is a time"),
    "periodic.duty": _share("it is the part of each period in which the load is on"),
    "sine.amplitude": _finite("its sign is the phase of the sine"),
    "sine.period": _above_zero("a period is a time"),
    "proportional.gain": _nonzero("a control without a gain does nothing; a negative one cools"),
    # controls
    "thermostat.on_below": _LEVEL,
    "thermostat.off_above": _LEVEL,
    "thermostat.on_above": _LEVEL,
    "thermostat.off_below": _LEVEL,
    "proportional.setpoint": _LEVEL,
    "proportional.band": _nonzero("for a band of zero use a thermostat; a negative band cools"),
    "proportional.lowest": _from_zero("a control lets through a share of a load or conductor"),
    "proportional.highest": _from_zero("a control lets through a share of a load or conductor"),
    "pid.setpoint": _LEVEL,
    "pid.band": _nonzero("for a band of zero use a thermostat; a negative band cools"),
    "pid.integral_time": _above_zero("the integral of a controller divides by it"),
    "pid.derivative_time": _above_zero("leave out a derivative part that does nothing"),
    "pid.filter_time": _above_zero("a derivative without a filter is infinite at a step"),
    "pid.lowest": _from_zero("a control lets through a share of a load or conductor"),
    "pid.highest": _from_zero("a control lets through a share of a load or conductor"),
    "pid.begins": _finite("an integral begins anywhere; its limits hold the output"),
    "sample": _above_zero("a controller samples at intervals"),
    "modes": _from_zero("a control lets through a share of a load or conductor"),
    "transitions.above": _LEVEL,
    "transitions.below": _LEVEL,
    "transitions.after": _above_zero("a mode lasts some time"),
    # elements that are written out
    "packages.psi_JT": _from_zero("in its test nothing is warmer than the junction"),
    "packages.psi_JB": _from_zero("in its test nothing is warmer than the junction"),
    "ladders.R": _above_zero("a rung without a resistance joins its nodes: leave it out"),
    "ladders.tau": _above_zero("a rung without a time constant stores nothing: leave it out"),
    "coolers.V_max": _above_zero("the constants of a module are quotients of the values of its data sheet"),
    "coolers.I_max": _above_zero("the constants of a module are quotients of the values of its data sheet"),
    "coolers.dT_max": _above_zero("the constants of a module are quotients of the values of its data sheet"),
    "coolers.size": _above_zero("leave out a cooler that is not there"),
    "passes.flow": _above_zero("a point of a system's curve has a flow"),
    "passes.pressure": _above_zero("a point of a system's curve has a pressure"),
    "fans.resistance": _from_zero("a system takes pressure from a stream"),
    "fans.linear_resistance": _from_zero("a system takes pressure from a stream"),
    "fans.speed": _from_zero("a fan blows one way; at zero it stands"),
    "fans.count": _above_zero("leave out a fan that is not there"),
}
"""Field -> values that it may have. Written from physics and the documentation of each field, before the code that computes with it."""


UNSTATED: Final = _finite("nothing that is computed from it would be finite")
"""Range of a field that has no row: of a kind of conductor that somebody adds."""


def range_of(kind: str, field: str, slot: str) -> Range:
    """Return the range of a field.

    Parameters
    ----------
    kind : str      Kind of conductor, group of an element that is written out, or `reversible` for a stream that may turn; empty for none.
    field : str     As elements hold it: ``htc.length``, ``modes.open``, ``transitions.warm.above``.
    slot : str      Its unit, or `temperature`.
    """
    group, _, rest = field.partition(".")
    name = "modes" if group == "modes" else f"transitions.{rest.rpartition('.')[2]}" if group == "transitions" else field
    return RANGES[TEMPERATURE] if slot == TEMPERATURE else RANGES.get(f"{kind}.{name}", RANGES.get(name, UNSTATED))


def outside(allowed: Range, slot: str, number: Any, path: str) -> str:
    """Return the message that a number lies outside its range; `slot` is the unit of its field, `path` its parameter."""
    unit = {TEMPERATURE: " K", "1": ""}.get(slot, f" {slot}")
    return f"'{path}' is {value_of(number):.6g}{unit}. Give {allowed.words}: {allowed.why}."
