"""What is known of a surface before its coefficient is split: temperatures of the fit, emissivity by finish, convection by correlation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from thermid.dual import value_of
from thermid.errors import IdentificationError, nearest
from thermid.knowledge.values import FittedValues
from thermid.model.parts.takes import exposed_area
from thermid.model.tree.flat import FlatConductor
from thermid.model.tree.model import Model
from thermid.network.network import Network, compile_network
from thermid.physics.air import dry_air
from thermid.physics.finishes import SPAN, finish
from thermid.physics.plates import body_htc, conduction_floor
from thermid.physics.radiation import linearised_htc
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.steady import steady

SMALLEST_RISE = 0.2
"""Difference below which a test says nothing of a coefficient. [K]"""


@dataclass(frozen=True)
class Prior:
    """What is known of an emissivity beforehand, by its logarithm.

    Parameters
    ----------
    mean, log_sd : float    [-]
    text : str              Where it comes from.
    finish : str            The finish, where it is one.
    """

    mean: float
    log_sd: float
    text: str
    finish: str = ""


@dataclass(frozen=True)
class Part:
    """A surface with an effective coefficient, and what is known of it.

    Parameters
    ----------
    path, where : str               The surface, and its place in the deck.
    emissivity, fitted : str        Paths of the values behind its emissivity and its coefficient.
    prior : Prior                   Of the emissivity.
    effective, effective_error : float      The coefficient and its standard error. [W/(m^2 K)]
    area : float                    What convects and radiates. [m^2]
    surface, gas : float            Temperatures of the fit. [K]
    black : float                   Coefficient of black radiation there. [W/(m^2 K)]
    expected, floor : float         Convection by correlation, and conduction of gas at rest. [W/(m^2 K)]
    """

    path: str
    where: str
    emissivity: str
    fitted: str
    prior: Prior
    effective: float
    effective_error: float
    area: float
    surface: float
    gas: float
    black: float
    expected: float
    floor: float

    @property
    def rise(self) -> float:
        """Surface less gas. [K]"""
        return self.surface - self.gas

    def suspects(self) -> str:
        """Return why the coefficient cannot be split, with what each suspect would have to be."""
        radiation = self.black * self.prior.mean * math.exp(-1.959964 * self.prior.log_sd)
        need = radiation + self.floor
        share = self.effective / need
        power = self.effective * self.area * abs(self.rise)
        return (
            f"the coefficient of '{self.path}' cannot be split: {self.effective:.3g} W/(m^2 K) in air, but {self.prior.text} radiates at"
            f" least {radiation:.2g} and gas at rest conducts at least {self.floor:.2g} W/(m^2 K). One of these is wrong: the area (at most"
            f" {self.area * share:.3g} m^2 in place of {self.area:.3g}: faces counted twice, inside ones?), the power (at least"
            f" {power / share:.3g} W through this surface in place of {power:.3g} W), the position of the sensor (the mean surface is at"
            f" most {abs(self.rise) * share:.2g} K above the gas in place of {abs(self.rise):.3g} K: a hot spot?), or the finish."
        )

    def conflict(self, left: float, spread: float) -> str:
        """Return what it can mean that the correlation and what is left of the coefficient disagree."""
        head = (
            f"beside the radiation {left:.2g} +- {spread:.2g} W/(m^2 K) are left for convection, where the correlation for a body of this"
            f" area says {self.expected:.2g}; it is not used. Suspects:"
        )
        if left < self.expected:
            return f"{head} the area (faces counted twice, inside ones?), the power, the position of the sensor, air that is confined"
        return f"{head} moving air, heat through mounts and leads (which vacuum does not take away), the area, the power"


def parts_of(
    model: Model,
    values: FittedValues,
    wanted: Sequence[str],
    conditions: Scenario | Mapping[str, tuple[float, float]],
    priors: Mapping[str, tuple[float, float]],
) -> list[Part]:
    """Return what is known of each surface; arguments as in `split_values`.

    Raises
    ------
    IdentificationError   When a surface has no effective coefficient, or nothing says what its emissivity may be.
    """
    network = compile_network(model)
    known = {c.path: c for c in network.flat.conductors if c.kind == "effective"}
    chosen = [model.canonical(w) for w in wanted] or list(known)
    for path in chosen:
        if path not in known:
            raise IdentificationError(f"'{path}' is no surface with an effective coefficient.{nearest(path, known)}", model.title)
    if not chosen:
        raise IdentificationError("no surface has an effective coefficient, so there is nothing to split.", model.title)
    at = conditions if isinstance(conditions, Mapping) else _settled(model, conditions, [known[p] for p in chosen])
    if not at:
        raise IdentificationError(
            "at which temperatures were the coefficients fitted? Give the conditions: a scenario that settles there, or a fit that has its"
            " records.",
            network.title,
        )
    return [_part(network, known[p], at.get(p, (math.nan, math.nan)), values, priors) for p in chosen]


def _settled(model: Model, conditions: Scenario, surfaces: Sequence[FlatConductor]) -> dict[str, tuple[float, float]]:
    """Return surface -> temperatures of surface and gas where a scenario settles. [K]"""
    found = steady(model, conditions)
    return {c.path: (found[c.ends[0]], found[c.ends[1]]) for c in surfaces}


def _part(
    network: Network, c: FlatConductor, at: tuple[float, float], fitted: FittedValues, priors: Mapping[str, tuple[float, float]]
) -> Part:
    """Return what is known of one surface."""
    values = network.numbers().values
    hot, cold = at
    if not abs(hot - cold) > SMALLEST_RISE:
        raise IdentificationError(
            f"'{c.path}' was never more than {SMALLEST_RISE:g} K from its gas, so nothing is known of its coefficient.", c.where
        )
    total = value_of(values[c.fields["area"]])
    area = value_of(exposed_area(c.path, values[c.fields["area"]], c.takes, values, c.where))
    effective = value_of(values[c.fields["effective_htc"]])
    root = network.flat.parameters.literal_behind(c.fields["effective_htc"])
    entry = fitted.assignments.get(root)
    air = dry_air(0.5 * (hot + cold))
    return Part(
        c.path,
        c.where,
        _root(network, c, fitted),
        entry.path if entry else "",
        _prior(network, c, priors),
        effective,
        entry.error if entry else 0.0,
        area,
        hot,
        cold,
        float(linearised_htc(1.0, hot, cold)),
        float(body_htc(hot, cold, total, air)),
        float(conduction_floor(total, air.conductivity)),
    )


def _root(network: Network, c: FlatConductor, fitted: FittedValues) -> str:
    """Return the path of the value behind an emissivity; where instances share a fitted one, the path it was fitted under."""
    if not c.emissivity:
        raise IdentificationError(
            f"nothing says what the emissivity of '{c.path}' may be. Give its finish, such as finish = \"aluminium, machined\", or its"
            " emissivity with min and max.",
            c.where,
        )
    root = network.flat.parameters.freeable(c.emissivity, network.flat.names.model.canonical)
    entry = fitted.assignments.get(root)
    return entry.path if entry else root


def _prior(network: Network, c: FlatConductor, priors: Mapping[str, tuple[float, float]]) -> Prior:
    """Return what is known of an emissivity: what the caller says, else the finish, else the bounds in the deck."""
    parameters = network.flat.parameters
    root = parameters.literal_behind(c.emissivity)
    given = parameters.table[root].parameter
    value = float(value_of(network.numbers().values[root]))
    chosen = next((v for k, v in priors.items() if network.flat.names.model.canonical(k) in (root, c.emissivity)), None)
    if chosen is not None:
        mean, sd = chosen
        if not (0.0 < mean <= 1.0 and sd >= 0.0):
            raise IdentificationError(f"an emissivity of {mean:g} +- {sd:g} cannot be a prior; give a mean from 0 to 1.", c.path)
        return Prior(mean, sd / mean, f"an emissivity of {mean:.3g} +- {sd:.2g}")
    if not 0.0 < value <= 1.0:
        raise IdentificationError(f"an emissivity of {value:g} cannot be split from a coefficient; give 0 to 1.", c.where)
    if c.emissivity in network.flat.finishes:
        found = finish(network.flat.finishes[c.emissivity], c.where)
        return Prior(value, found.log_sd, f"finish '{found.name}', {found.low:g} to {found.high:g}", found.name)
    low, high = given.minimum, given.maximum
    if low is not None and high is not None and 0.0 < low < high:
        return Prior(value, math.log(high / low) / SPAN, f"an emissivity of {low:g} to {high:g}")
    return Prior(value, 0.0, f"an emissivity of {value:.3g}, taken as exact")
