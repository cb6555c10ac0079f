"""Gases: properties near room temperature, and the heat they conduct across a gap from one atmosphere to vacuum."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from thermid.base.errors import DeckError, look_up
from thermid.base.units import ATMOSPHERE
from thermid.physics._number import Number, plain
from thermid.physics.air import Gas

MOLAR_GAS_CONSTANT: Final = 8.31446261815324
"""CODATA 2018, exact. [J/(mol K)]"""
REFERENCE: Final = 300.0
"""Temperature at which the fits are anchored. [K]"""

Fit = tuple[float, float, float]


@dataclass(frozen=True)
class MolecularGas:
    """A dilute gas; each property is ``y0 exp(a x + b x^2)`` with x = ln(T / 300 K).

    Parameters
    ----------
    name : str              As decks write it.
    molar_mass : float      [kg/mol]
    conductivity : tuple    y0 [W/(m K)], a, b.
    viscosity : tuple       y0 [Pa s], a, b.
    specific_heat : tuple   At constant pressure: y0 [J/(kg K)], a, b.
    """

    name: str
    molar_mass: float
    conductivity: Fit
    viscosity: Fit
    specific_heat: Fit

    @property
    def constant(self) -> float:
        """Specific gas constant R, the molar one over the molar mass. [J/(kg K)]"""
        return MOLAR_GAS_CONSTANT / self.molar_mass

    def ratio(self, temperature: Number) -> Number:
        """Ratio of specific heats cp / (cp - R) at a temperature in kelvin [-]."""
        cp = self.cp(temperature)
        return cp / (cp - self.constant)

    def cp(self, temperature: Number) -> Number:
        """Specific heat at constant pressure, at a temperature in kelvin [J/(kg K)]."""
        return _fitted(self.specific_heat, temperature)

    def k(self, temperature: Number) -> Number:
        """Conductivity at a temperature in kelvin [W/(m K)]."""
        return _fitted(self.conductivity, temperature)

    def mu(self, temperature: Number) -> Number:
        """Dynamic viscosity at a temperature in kelvin [Pa s]."""
        return _fitted(self.viscosity, temperature)

    def at(self, temperature: Number, pressure: Number = ATMOSPHERE) -> Gas:
        """Properties for the convection correlations at a temperature [K] and a pressure [Pa]: k, mu / rho, mu cp / k and 1/T."""
        density = pressure / (self.constant * temperature)
        k, mu = self.k(temperature), self.mu(temperature)
        return Gas(k, mu / density, mu * self.cp(temperature) / k, 1.0 / temperature)

    def free_molecular_htc(self, temperature: Number, pressure: Number, accommodation: Number = 1.0) -> Number:
        """Coefficient between parallel plates so close, or at so low a pressure, that molecules meet the walls only [W/(m^2 K)].

        ``a/(2-a) (g+1)/(g-1) sqrt(R / (8 pi T)) p``, with the same accommodation a at both plates.

        Parameters
        ----------
        gas, temperature, pressure      As in `mean_free_path`; the temperature is the mean of both plates.
        accommodation : float           Of both surfaces, 0 to 1. [-]

        References
        ----------
        Kennard, Kinetic Theory of Gases, 1938, section 182; Barron, Cryogenic Heat Transfer, 1999, section 8.4.

        Examples
        --------
        Air at 300 K: 1.17 W/(m^2 K) for each pascal.

        >>> round(GASES["air"].free_molecular_htc(300.0, 1.0), 2)
        1.17
        """
        ratio = self.ratio(temperature)
        share = accommodation / (2.0 - accommodation)
        return share * (ratio + 1.0) / (ratio - 1.0) * (self.constant / (8.0 * math.pi * temperature)) ** 0.5 * pressure

    @staticmethod
    def named(name: str, where: str = "") -> MolecularGas:
        """Return a gas by its name.

        Raises
        ------
        DeckError   When there is none of that name.
        """
        return look_up(name, GASES, "unknown gas '{}'.{near} Known: {known}.", where, DeckError)


def _fitted(fit: Fit, temperature: Number) -> Number:
    """Return y0 exp(a x + b x^2) with x = ln(T / 300 K) of a fit (y0, a, b) at temperatures in kelvin, in the unit of y0."""
    x = np.log(np.asarray(temperature) / REFERENCE)
    return plain(fit[0] * np.exp(x * (fit[1] + x * fit[2])))


GASES: Final = {
    g.name: g
    for g in (
        MolecularGas("air", 0.02896546, (0.026358, 0.8478, -0.0722), (1.8525e-5, 0.7816, -0.0776), (1004.9, 0.0183, 0.0424)),
        MolecularGas("N2", 0.02801348, (0.025941, 0.8365, -0.0768), (1.7879e-5, 0.7748, -0.0762), (1039.8, 0.0082, 0.027)),
        MolecularGas("He", 0.004002602, (0.15591, 0.6913, 0.0057), (1.9927e-5, 0.6841, 0.0141), (5193.2, 0.0, 0.0)),
        MolecularGas("Ar", 0.039948, (0.01781, 0.837, -0.0874), (2.2727e-5, 0.8347, -0.0841), (520.57, -0.0012, 0.0015)),
        MolecularGas("CO2", 0.0440098, (0.016734, 1.3692, -0.0726), (1.4999e-05, 0.9509, -0.0622), (846.81, 0.358, 0.0055)),
        MolecularGas("H2", 0.00201588, (0.18654, 0.7808, -0.1243), (8.9379e-6, 0.6928, -0.0004), (14306.0, 0.0804, -0.1283)),
    )
}
"""Fitted to CoolProp 8.0.0 at 10 kPa from 200 to 450 K (carbon dioxide from 220 K); the largest deviation is 0.30 %, at 20 kPa 0.52 %."""


def mean_free_path(gas: MolecularGas, temperature: Number, pressure: Number) -> Number:
    """Mean free path, mu / p sqrt(pi R T / 2) [m].

    Parameters
    ----------
    gas : MolecularGas
    temperature : float or array    [K]
    pressure : float or array       [Pa]

    References
    ----------
    Kennard, Kinetic Theory of Gases, 1938, Eq. 90b; Bird, Molecular Gas Dynamics, 1994, section 4.3.

    Examples
    --------
    Air at 300 K and one atmosphere: 0.067 micrometres.

    >>> round(mean_free_path(GASES["air"], 300.0, 101325.0) * 1e6, 3)
    0.067
    """
    return gas.mu(temperature) / pressure * (math.pi * gas.constant * temperature / 2.0) ** 0.5


def knudsen_number(gas: MolecularGas, temperature: Number, pressure: Number, gap: Number) -> Number:
    """Knudsen number of a gas in a gap, its mean free path over the gap [-].

    Parameters
    ----------
    gas, temperature, pressure      As in `mean_free_path`.
    gap : float or array            [m]

    Examples
    --------
    >>> round(knudsen_number(GASES["air"], 300.0, 100.0, 1e-3), 3)
    0.068
    """
    return mean_free_path(gas, temperature, pressure) / gap


def gap_htc(gas: MolecularGas, temperature: Number, pressure: Number, gap: Number, accommodation: Number = 1.0) -> Number:
    """Coefficient of a gas at rest between parallel plates at any pressure, 1 / (L / k + 1 / h_fm) [W/(m^2 K)].

    Sherman's interpolation: the resistances of the continuum, L / k of the gap L, and of free molecules, h_fm of
    `MolecularGas.free_molecular_htc`, add.

    Parameters
    ----------
    gas, temperature, pressure, accommodation   As in `MolecularGas.free_molecular_htc`.
    gap : float or array                        Distance of the plates. [m]

    References
    ----------
    Sherman, in Rarefied Gas Dynamics (ed. Laurmann), vol. II, 1963, 228; Springer, Advances in Heat Transfer 7 (1971) 163.

    Examples
    --------
    >>> round(gap_htc(GASES["air"], 300.0, 101325.0, 1e-3), 2)
    26.35
    """
    continuum, molecular = gas.k(temperature) / gap, gas.free_molecular_htc(temperature, pressure, accommodation)
    return continuum * molecular / (continuum + molecular)
