"""Whether what a search proposes can be: heat capacities, losses and lags against what parts of that mass and size have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from thermid.base.dual import value_of
from thermid.base.errors import ThermidError
from thermid.base.expression import amount
from thermid.campaign._start.roles import Roles
from thermid.inference.criticism import FittedStructure
from thermid.inference.diagnosis import SPECIFIC_HEAT, RangeCheck
from thermid.model.tree import Model
from thermid.physics.materials import materials as all_materials

LEAST_HEAT = 0.5e6
"""Heat capacity by volume of equipment, at least: plastics and metals have 1.5e6 to 4e6, and most of a box is air. [J/(m^3 K)]"""
FLATTEST = 60.0
"""Area over volume^(2/3), at most: 4.8 for a ball, 43 for a sheet a hundred times as wide as thick, more with fins. [-]"""
MOST_FILM = 31.0
"""Coefficient at most: 25 W/(m^2 K) of slow fans and 6 of radiation. [W/(m^2 K)]"""
LEAST_PART = 0.5
"""A part that carries a sensor has at least this: half a gram of aluminium. [J/K]"""
MOST_BEHIND = 10.0
"""Largest mass without a sensor over a part with one. Of 14 simulated boxes three had 22, 36 and 85: there the mass was the part itself,
and the part was what follows its sensor at once. The others had 1.6 at most. [-]"""
MOST_PART = 2e6
"""Two tonnes of metal. [J/K]"""
SLOWEST_SENSOR = 60.0
"""A sensor that is fixed to a part follows it within this: thermocouples in a second, DS18B20 in its case in 10 to 40 s. [s]"""
AT_BOUND = 1.001
"""A value is at a bound that it is nearer to than by this factor. [-]"""
MATERIAL_SD, ANY_SD = 0.1, 0.35
"""Standard deviation of the logarithm of a heat capacity by weight, of a known material and of any one between copper and plastics. [-]"""


@dataclass(frozen=True)
class KnownMass:
    """What a scale says of a part.

    Parameters
    ----------
    mass : float            [kg]
    low, high : float       Specific heats that it can have. [J/(kg K)]
    sd : float              Standard deviation of the logarithm of its heat capacity. [-]
    """

    mass: float
    low: float
    high: float
    sd: float

    @property
    def capacitance(self) -> float:
        """In the middle of what is possible. [J/K]"""
        return float(self.mass * (self.low * self.high) ** 0.5)

    @property
    def bounds(self) -> tuple[float, float]:
        """Of the part with what is fixed to it, to three digits as a deck has them. [J/K]"""
        return float(f"{0.7 * self.low * self.mass:.3g}"), float(f"{1.5 * self.high * self.mass:.3g}")


def known_masses(masses: Mapping[str, str], materials: Mapping[str, str]) -> dict[str, KnownMass]:
    """Return part -> what its weight and its material say.

    Parameters
    ----------
    masses : dict       Part -> mass with its unit.
    materials : dict    Part -> material, or the beginning of the names of several.

    Raises
    ------
    ThermidError        When a material is of a part without a mass, or not in the table.
    """
    lone = [part for part in materials if part not in masses]
    if lone:
        raise ThermidError(f"a material needs the mass of its part: --mass {lone[0]}='1.2 [kg]'.", "--material", code="value.incomplete")
    out = {}
    for part, text in masses.items():
        weight = amount(text, "kg", f"--mass {part}")
        named = materials.get(part, "")
        solids = [m for name, m in all_materials().items() if name != "air" and name.lower().startswith(named.lower())] if named else []
        heats = [m.specific_heat for m in solids]
        if named and not heats:
            families = ", ".join(dict.fromkeys(name.partition(",")[0] for name in all_materials() if name != "air"))
            raise ThermidError(f"no material '{named}'. Known: {families}. Or leave it out.", f"--material {part}", code="name.unknown")
        low, high = (min(heats), max(heats)) if heats else SPECIFIC_HEAT
        out[part] = KnownMass(weight, low, high, MATERIAL_SD if heats else ANY_SD)
    return out


def not_physical(one: FittedStructure, roles: Roles, masses: Mapping[str, KnownMass]) -> tuple[RangeCheck, ...]:
    """Return what a structure has that no part of that mass and size has; every range is of the table of this module."""
    return tuple(c for c in _checks(one, roles, masses) if c.verdict != "possible")


def weights(model: Model, values: Mapping[str, float], roles: Roles, masses: Mapping[str, KnownMass]) -> tuple[RangeCheck, ...]:
    """Return, of every weighed part, its heat capacity with all masses without a sensor that are fixed to it, and what its weight allows.

    Parameters
    ----------
    model : Model       The structure.
    values : dict       Path -> capacitance [J/K] or conductance [W/K] that was fitted; those of one element alone count.
    """
    held = {path.rpartition(".")[0]: value for path, value in values.items() if path.endswith(".capacitance")}
    inside = {part: 0.0 for part in masses if part in held}
    for node, capacity in held.items():
        seat, visited = node, {node}
        while seat not in roles.parts.values():
            ties = {
                n: values.get(f"{c}.conductance", 0.0) for c, law in model.conductors.items() if seat in law.between for n in law.between
            }
            near = {n: tie for n, tie in ties.items() if n not in visited and n in held}
            if not near:
                break
            seat = max(near, key=near.__getitem__)
            visited.add(seat)
        if seat in inside:
            inside[seat] += capacity
    meaning = "A power is missing or wrong, or an instrument has an offset"
    return tuple(
        RangeCheck(
            f"{part}.capacitance",
            total,
            0.0,
            *masses[part].bounds,
            f"{masses[part].mass:.3g} kg with what is fixed to it",
            "table of init",
            meaning,
        )
        for part, total in inside.items()
    )


def too_far(column: str, offset: tuple[float, float], accuracy: float) -> RangeCheck:
    """Return whether two thermometers of an accuracy [K] can differ by an offset with its error. [K]"""
    most = 3.0 * 2.0**0.5 * accuracy
    meaning = "A power that the log does not have heats this part, or the thermometers are worse: --accuracy"
    what = f"the difference of two thermometers of {accuracy:g} K [K]"
    return RangeCheck(f"offset of {column}", *offset, -most, most, what, "3 standard deviations", meaning)


def _checks(one: FittedStructure, roles: Roles, masses: Mapping[str, KnownMass]) -> Iterator[RangeCheck]:
    """Yield every value of a structure with the range that it should be in."""
    values, errors = one.values, one.errors()
    network = one.problem.experiments[0].network
    held = {n: float(value_of(c)) for n, c in network.numbers(values).capacitances.items() if c is not None}

    def check(path: str, low: float, high: float, what: str, meaning: str) -> RangeCheck:
        return RangeCheck(path, values[path], errors[path] * values[path], low, high, what, "table of init", meaning)

    largest, hidden = max(((c, n) for n, c in held.items() if n not in roles.parts.values()), default=(0.0, ""))
    for heavy in weights(one.request.model, values, roles, masses):
        # a fit that wants more than the weight allows ends at its bound
        yield replace(heavy, error=errors[heavy.path] * values[heavy.path], low=AT_BOUND * heavy.low, high=heavy.high / AT_BOUND)
    for node in (n for n in roles.parts.values() if f"{n}.capacitance" in values and n not in masses):
        least = max(LEAST_PART, largest / MOST_BEHIND)
        meaning = "A power is missing or wrong, or an instrument has an offset"
        if hidden and values[f"{node}.capacitance"] < least:
            meaning = f"'{hidden}' of {largest:.3g} J/K may be this part, behind its sensor: state --mass {node}=... or the paths"
        yield check(f"{node}.capacitance", least, MOST_PART, "a part that carries a sensor", meaning)
    for name, c in one.request.model.conductors.items():
        path = f"{name}.conductance"
        if path not in values:
            continue
        tips = [n for n in c.between if n.endswith("_sensor") and n not in roles.parts.values()]
        if tips:
            lag = held[tips[0]] / values[path]
            meaning = "More is heat that arrives through another mass: state what is between power and sensor"
            yield RangeCheck(
                f"lag of {tips[0]}", lag, errors[path] * lag, 0.0, SLOWEST_SENSOR, "a sensor fixed to a part [s]", "table of init", meaning
            )
        elif roles.boundary in c.between:
            node = next(n for n in c.between if n != roles.boundary)
            size = masses[node].capacitance if node in masses else held.get(node, 0.0)
            most = MOST_FILM * FLATTEST * (size / LEAST_HEAT) ** (2.0 / 3.0)
            what = f"the loss of a part of {size:.3g} J/K"
            yield check(
                path, 0.0, most, what, "Its heat capacity is too small, or heat leaves by a mount or a fan that is not in the model"
            )
