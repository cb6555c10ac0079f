"""What each gas does to a conductor: one atmosphere, vacuum, or a change between them in time.

Pressure, humidity and gravity belong to a named gas node. Between one atmosphere and vacuum the laws of rarefied gas are needed; they are
refused here in words rather than guessed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from thermid.dual import Number
from thermid.errors import ScenarioError
from thermid.model.flat import FlatConductor
from thermid.model.kinds import Law
from thermid.model.signal import Constant, Signal, Sine, Table
from thermid.network.rows import ConductorRow
from thermid.physics.constants import ATMOSPHERE, STANDARD_GRAVITY
from thermid.physics.radiation import radiation_coefficient

__all__ = ["VACUUM_LIMIT", "Environment", "Media"]

VACUUM_LIMIT = 1e-2
"""Pressure below which gas carries no heat worth counting between walls of equipment. [Pa]"""
ONE_ATMOSPHERE = Constant(ATMOSPHERE)
AIR_RANGE = (0.85 * ATMOSPHERE, 1.1 * ATMOSPHERE)
"""Pressures at which a coefficient fitted on the ground is used as it is. [Pa]"""


@dataclass(frozen=True)
class Environment:
    """The state of one gas.

    Parameters
    ----------
    pressure : Signal   [Pa]
    humidity : float    Relative, 0 to 1; it does not enter the classical equations and is kept for the record. [-]
    gravity : float     [m/s^2]
    """

    pressure: Signal = ONE_ATMOSPHERE
    humidity: float = 0.5
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self) -> None:
        """Refuse states that do not exist."""
        if not 0.0 <= self.humidity <= 1.0:
            raise ScenarioError(f"a relative humidity of {self.humidity:g} does not exist; give 0 to 1.")
        if self.lowest() < 0.0:
            raise ScenarioError("a pressure below zero does not exist.")

    def samples(self) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        """Return the pressures that occur. [Pa]"""
        p = self.pressure
        if isinstance(p, Table):
            return p.values
        if isinstance(p, Sine):
            return np.array([p.mean - p.amplitude, p.mean + p.amplitude])
        return np.array([p.value])

    def lowest(self) -> float:
        """Return the lowest pressure that occurs. [Pa]"""
        return float(self.samples().min())


@dataclass(frozen=True)
class Media:
    """The state of every gas node of a scenario.

    Parameters
    ----------
    environments : dict     Gas node -> Environment; ``*`` stands for every gas not named; one atmosphere where none is given.
    as_printed : bool       Whether convection is set to zero as the source document does, radiation inside it included: a bound.
    """

    environments: Mapping[str, Environment] = field(default_factory=dict)
    as_printed: bool = False

    def signals(self) -> dict[str, Signal]:
        """Return the factor of each gas that changes in time: 1 in air, 0 in vacuum."""
        out: dict[str, Signal] = {}
        for gas, environment in self.environments.items():
            p = environment.pressure
            if isinstance(p, Table):
                present = (p.values > VACUUM_LIMIT).astype(float)
                out[f"gas {gas}"] = Table(p.times, present, hold=True)
                out[f"no gas {gas}"] = Table(p.times, 1.0 - present, hold=True)
        return out

    def _key(self, gas: str) -> str:
        return gas if gas in self.environments else "*"

    def _state(self, gas: str, where: str) -> str:
        """Return air, vacuum or changing for a gas node."""
        environment = self.environments.get(self._key(gas))
        if environment is None:
            return "air"
        pressures = environment.samples()
        air = (pressures >= AIR_RANGE[0]) & (pressures <= AIR_RANGE[1])
        empty = pressures <= VACUUM_LIMIT
        if not (air | empty).all():
            odd = float(pressures[~(air | empty)][0])
            raise ScenarioError(
                f"the gas '{gas}' is at {odd:.4g} Pa. Between one atmosphere and vacuum convection follows laws of rarefied gas that this "
                f"model does not hold; give one atmosphere, or at most {VACUUM_LIMIT:g} Pa.",
                where,
            )
        if empty.all():
            return "vacuum"
        if abs(environment.gravity - STANDARD_GRAVITY) > 0.01 * STANDARD_GRAVITY:
            raise ScenarioError(
                f"gravity in '{gas}' is {environment.gravity:g} m/s^2; a coefficient of natural convection fitted on the "
                "ground does not hold there.",
                where,
            )
        if air.all():
            return "air"
        if not (isinstance(environment.pressure, Table) and environment.pressure.hold):
            raise ScenarioError(f"the pressure of '{gas}' must jump between one atmosphere and vacuum: write hold = true.", where)
        return "changing"

    def empty(self, gas: str, where: str = "") -> bool:
        """Return whether there is no gas at a gas node at any time."""
        return self._state(gas, where) == "vacuum"

    def rows(self, c: FlatConductor, law: Law, fields: Mapping[str, Number], emissivity: Number | None) -> tuple[ConductorRow, ...]:
        """Return the rows that a conductor is, in the state of its gas.

        Raises
        ------
        ScenarioError   When an effective coefficient meets vacuum without an emissivity to keep, or a pressure has no law here.
        """

        def row(form: str, coefficients: tuple[Number, ...], signal: str = "") -> ConductorRow:
            return ConductorRow(c.path, form, c.ends, coefficients, c.curve, signal)

        if law.medium in ("solid", "radiation"):
            return (row(law.form, law.coefficients),)
        state = self._state(c.gas, c.where)
        if state == "air":
            return (row(law.form, law.coefficients),)
        gone = (row(law.form, (0.0 * law.coefficients[0], *law.coefficients[1:])),)
        if law.medium == "gas" or self.as_printed:
            return gone if state == "vacuum" else (row(law.form, law.coefficients, f"gas {self._key(c.gas)}"),)
        if emissivity is None:
            raise ScenarioError(
                f"the coefficient of '{c.path}' is effective: it contains radiation, which vacuum does not take away. "
                "Give the surface's emissivity, "
                "or ask for vacuum as printed (--as-printed), which sets it to zero and is an upper bound.",
                c.where,
            )
        kept = (radiation_coefficient(emissivity, fields["area"]),)
        if state == "vacuum":
            return (row("radiation", kept),)
        return row(law.form, law.coefficients, f"gas {self._key(c.gas)}"), row("radiation", kept, f"no gas {self._key(c.gas)}")
