"""Rows of gas at any pressure: conduction at rest down to free molecules, natural convection by tables, fitted values thinned."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from thermid.dual import Number, value_of
from thermid.model.laws.curves import Curve
from thermid.model.parts.kinds import ACCOMMODATION, Law
from thermid.model.tree.flat import FlatConductor
from thermid.network.rows import ANCHOR, ConductorRow
from thermid.physics.bodies import THINNEST
from thermid.physics.constants import ATMOSPHERE, STANDARD_GRAVITY
from thermid.physics.correlations import forced_plate_nusselt, signed_nusselt
from thermid.physics.gas import MolecularGas, free_molecular_htc, gas_named

POINTS = np.linspace(200.0, 450.0, 26)
"""Temperatures of the tables of properties, which are smooth; the fits were made over them. [K]"""


@dataclass(frozen=True)
class GasState:
    """A gas as the rows of a conductor see it: numbers where it is constant, inputs where it changes.

    Parameters
    ----------
    gas : MolecularGas
    pressure : float        [Pa]; 1 where it follows an input.
    natural : float         Strength of natural convection, (p/p0)^(1/2) (g/g0)^(1/4); 1 where it follows an input. [-]
    wind : float            [m/s]
    key : str               Name of the gas in the inputs; empty where all is constant.
    levels : tuple          Streams at one atmosphere between which a wind that changes in time is interpolated. [m/s]
    gust : str              Name of the inputs that say how much of each level there is.
    """

    gas: MolecularGas
    pressure: float
    natural: float
    wind: float = 0.0
    key: str = ""
    levels: tuple[float, ...] = ()
    gust: str = ""

    def named(self, what: str) -> str:
        """Return the name of an input of this gas; empty where it is constant."""
        return f"{what} {self.key}" if self.key else ""


@lru_cache(maxsize=64)
def conductivity_curve(gas: MolecularGas) -> Curve:
    """Return the conductivity of a gas over that at 300 K, with slopes. [-]"""
    return _over_temperature(lambda t: gas.k(t) / gas.k(ANCHOR))


@lru_cache(maxsize=64)
def _root_curve(gas: MolecularGas, windy: bool) -> Curve:
    """Return the fourth root of g beta / (nu alpha) over that at 300 K; in wind, times the conductivity."""

    def buoyancy(t: Any) -> Any:
        at = gas.at(t)
        root = (at.expansion_at(t) / (at.kinematic_viscosity * at.thermal_diffusivity())) ** 0.25
        return root * (gas.k(t) if windy else 1.0)

    return _over_temperature(lambda t: buoyancy(t) / buoyancy(ANCHOR))


@lru_cache(maxsize=8)
def _one() -> Curve:
    return _over_temperature(lambda t: np.ones(np.shape(t)))


def _over_temperature(function: Any) -> Curve:
    step = 1e-3
    slopes = (function(POINTS + step) - function(POINTS - step)) / (2.0 * step)
    return Curve("temperature", POINTS, np.asarray(function(POINTS), dtype=float), np.asarray(slopes, dtype=float))


def _plain(number: Number) -> float:
    """Return a number without derivatives; of many members the first, since a table is made once for all of them."""
    found: Any = value_of(number)
    return float(found.values[0] if hasattr(found, "values") else found)


def _rest(c: FlatConductor, continuum: Number, molecular: Number, state: GasState, signal: str = "") -> ConductorRow:
    """Return the row of gas at rest: conductance of the continuum [W/K], and that of free molecules for each pascal [W/(K Pa)]."""
    ratio = molecular / continuum * state.pressure
    return ConductorRow(c.path, "gas", c.ends, (continuum, ratio), conductivity_curve(state.gas), signal, state.named("pressure"))


def gap(c: FlatConductor, law: Law, state: GasState) -> ConductorRow:
    """Return the row of a gap between parallel plates: Sherman's interpolation from continuum to free molecules."""
    area, distance, share = law.coefficients
    gas = gas_named(c.words["gas"], c.where) if "gas" in c.words else state.gas
    own = GasState(gas, state.pressure, state.natural, key=state.key)
    molecular = area * (share / (2.0 - share)) * free_molecular_htc(gas, ANCHOR, 1.0)
    return _rest(c, area * gas.k(ANCHOR) / distance, molecular, own)


def correlated(c: FlatConductor, law: Law, state: GasState) -> tuple[ConductorRow, ...]:
    """Return the rows of a surface with a correlation: gas at rest, and what natural convection and wind add to it."""
    area, length = law.coefficients
    gas, at = state.gas, state.gas.at(ANCHOR)
    name, orientation = c.words.get("htc.correlation", ""), c.words.get("htc.orientation", "vertical")
    prandtl = float(at.prandtl)
    scale = gas.k(ANCHOR) / length * area
    buoyancy = STANDARD_GRAVITY * float(at.expansion_at(ANCHOR) / (at.kinematic_viscosity * at.thermal_diffusivity()))
    root = buoyancy**0.25 * length**0.75 * state.natural
    moving = []
    for k, speed in enumerate(state.levels or (state.wind * (state.pressure / ATMOSPHERE),)):
        # a stream at another pressure has the Reynolds number of one as much slower
        forced = float(forced_plate_nusselt(speed * _plain(length) / float(at.kinematic_viscosity), prandtl)) if speed > 0.0 else 0.0
        x, y, least = signed_nusselt(name, orientation, prandtl, forced, c.where)
        film = (_one() if forced else conductivity_curve(gas), _root_curve(gas, forced > 0.0))
        curve = Curve("difference", x, y, None, film, interpolation="smooth")
        signal = f"{state.gust} {k}" if state.gust else ""
        moving.append(ConductorRow(c.path, "natural", c.ends, (scale, root), curve, signal, state.named("natural")))
    still = _rest(c, scale * least, ACCOMMODATION * free_molecular_htc(gas, ANCHOR, 1.0) * area, state)
    return still, *moving


def thinned(c: FlatConductor, law: Law, area: Number, state: GasState) -> tuple[ConductorRow, ...]:
    """Return the rows of a coefficient that was fitted on the ground, at another pressure or gravity.

    With s = (p/p0)^(1/2) (g/g0)^(1/4), as laminar convection goes, the conductance is s times what was fitted and (1 - s) times that of gas
    at rest, which is rarefied as the pressure falls.
    """
    first, *rest = law.coefficients
    fitted = ConductorRow(c.path, law.form, c.ends, (state.natural * first, *rest), c.curve, state.named("natural"))
    if value_of(area) == 0.0:
        return (fitted,)
    gas = state.gas
    least = THINNEST * gas.k(ANCHOR) * area**0.5
    if law.form == "linear" and value_of(least) > value_of(first):
        least = first
    if value_of(least) == 0.0:
        return (fitted,)
    still = _rest(c, least, ACCOMMODATION * free_molecular_htc(gas, ANCHOR, 1.0) * area, state, state.named("rest"))
    share = 1.0 if state.key else 1.0 - state.natural
    return fitted, ConductorRow(
        c.path, still.form, c.ends, (share * still.coefficients[0], still.coefficients[1]), still.curve, still.signal, still.second
    )
