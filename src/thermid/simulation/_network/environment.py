"""The state of one gas: pressure, gravity, wind and kind of what fills a room, a volume that is vented, or a sealed one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

from thermid.base.errors import ScenarioError, refuse_first
from thermid.base.units import ATMOSPHERE, STANDARD_GRAVITY
from thermid.model.tree import Constant, Signal, literal, signal
from thermid.physics.gas import MolecularGas

ONE_ATMOSPHERE = Constant(ATMOSPHERE)
CALM = Constant(0.0)
FAN_EXPONENT = 0.65
"""Of the pressure, for a coefficient that a fan carries, which keeps its volume flow: in the middle of a laminar plate's, 1/2, and a
turbulent one's, 4/5 (`forced_plate_nusselt`). At 700 mbar either differs by 5.5 %. [-]"""
HIGHEST = 10.0 * ATMOSPHERE
"""Pressure up to which the gas laws, of dilute gases, are used. [Pa]"""


@dataclass(frozen=True)
class Environment:
    """The state of one gas.

    Parameters
    ----------
    pressure : Signal       A text with unit, a table or a signal. [Pa]
    humidity : float or None  Relative, 0 to 1; None where nobody states it. No law uses it, but a run in which water condenses is not
                            credible (`Solution.doubts`). [-]
    gravity : float, str    A number or a text with unit, as the wind and the time constant. [m/s^2]
    gas : str               air, N2, He, Ar, CO2 or H2.
    wind : Signal           Speed along surfaces with a correlation; given as the pressure is. [m/s]
    sealed : bool           Whether the volume keeps its gas when the surroundings lose theirs.
    vented : str            Gas node that this volume is vented to; its own pressure is then that at the start.
    time_constant : float   Of the venting. [s]
    """

    pressure: Any = ONE_ATMOSPHERE
    humidity: float | None = None
    gravity: float = STANDARD_GRAVITY
    gas: str = "air"
    wind: Any = CALM
    sealed: bool = False
    vented: str = ""
    time_constant: float = 0.0

    def __post_init__(self) -> None:
        """Turn a text into a signal, and refuse states that do not exist."""
        object.__setattr__(self, "pressure", signal(self.pressure, "Pa", "environment, pressure"))
        wind = Constant(float(self.wind)) if isinstance(self.wind, int | float) else signal(self.wind, "m/s", "environment, wind")
        object.__setattr__(self, "wind", wind)
        for name, slot in (("humidity", "1"), ("gravity", "m/s^2"), ("time_constant", "s")):
            value: Any = getattr(self, name)
            if not (isinstance(value, Real) or (name == "humidity" and value is None)):
                object.__setattr__(self, name, literal(value, slot, f"environment, {name}"))
        for name in ("gas", "vented"):
            if not isinstance(getattr(self, name), str):
                raise ScenarioError(f"it takes a name, not {getattr(self, name)!r}.", f"environment, {name}", code="value.wrong-kind")
        MolecularGas.named(self.gas, "environment")
        (low, high), humidity = self.pressure.bounds, self.humidity
        refuse_first(
            "",
            (
                humidity is not None and not 0.0 <= humidity <= 1.0,
                f"the relative humidity is {humidity}. Give 0 to 1.",
                "value.outside-range",
            ),
            (low < 0.0, "the pressure is below zero. Give 0 or more.", "value.outside-range"),
            (
                not high <= HIGHEST,
                f"a pressure of {high:.4g} Pa lies beyond {HIGHEST:.4g} Pa, the limit of the gas properties used.",
                "value.outside-range",
            ),
            (
                not (self.gravity >= 0.0 and self.wind.bounds[0] >= 0.0),
                "gravity and wind must not be negative. Give their magnitudes.",
                "value.outside-range",
            ),
            (self.sealed and self.vented, "a volume is either sealed or vented. Leave one of them out.", "value.excludes-another"),
            (
                bool(self.vented) != (self.time_constant > 0.0),
                "give a vented volume the gas node that it is vented to, and a time constant above zero.",
                "value.incomplete",
            ),
            error=ScenarioError,
        )

    def __str__(self) -> str:
        """Return it in words: its gas, its pressure, and whatever else is not as on the ground."""
        low, high = self.pressure.bounds
        words = [f"{self.gas} at {low:.6g}{'' if low == high else f' to {high:.6g}'} Pa"]
        words += [f"gravity {self.gravity:.4g} m/s^2"] if self.gravity != STANDARD_GRAVITY else []
        words += [f"wind up to {self.wind.bounds[1]:.4g} m/s"] if self.wind.bounds[1] > 0.0 else []
        words += ["sealed"] if self.sealed else [f"vented to {self.vented}"] if self.vented else []
        return ", ".join(words)

    def mapped(self, law: Callable[[Signal], Signal]) -> Environment:
        """Return the environment with its signals, pressure and wind, replaced by law(signal)."""
        return replace(self, pressure=law(self.pressure), wind=law(self.wind))

    def lowest(self) -> float:
        """Return the lowest pressure that occurs. [Pa]"""
        return float(self.pressure.bounds[0])

    def natural(self, pressure: Any) -> Any:
        """Return the strength of natural convection at pressures in Pa over that on the ground, (p/p0)^(1/2) (g/g0)^(1/4). [-]"""
        return (pressure / ATMOSPHERE) ** 0.5 * (self.gravity / STANDARD_GRAVITY) ** 0.25

    def forced(self, pressure: Any) -> Any:
        """Return the strength of a fan's convection at pressures in Pa over that on the ground, at any gravity. [-]"""
        return (pressure / ATMOSPHERE) ** FAN_EXPONENT


GROUND = Environment()
"""The room of a laboratory, which holds where nothing is said."""
