"""Rows of the law table: conductors and loads with their numbers, ready for the kernel."""

from __future__ import annotations

from dataclasses import dataclass

from thermid.dual import Number
from thermid.model.curves import Curve

__all__ = ["ConductorRow", "LoadRow"]


@dataclass(frozen=True, eq=False)
class ConductorRow:
    """One law between two nodes.

    Parameters
    ----------
    name : str                      Path of the conductor it comes from.
    form : str                      linear, power, radiation, flow, table, gas, natural, potential, hinge or hinge of difference.
    ends : (str, str)               Node paths; heat flow is positive from the first to the second.
    coefficients : tuple of Number  The first one scales the heat flow.
    curve : Curve or None           For tables.
    signal : str                    Name of the input that the first coefficient is multiplied by; empty for none.
    second : str                    The same for the second coefficient.
    """

    name: str
    form: str
    ends: tuple[str, str]
    coefficients: tuple[Number, ...]
    curve: Curve | None = None
    signal: str = ""
    second: str = ""


@dataclass(frozen=True, eq=False)
class LoadRow:
    """One heat load law.

    Parameters
    ----------
    name : str                      Path of the load it comes from.
    form : str                      signal, polynomial, exponential, table, thermostat or proportional.
    node, sensor : str              Node that is heated; node whose temperature counts.
    coefficients : tuple of Number  The first one scales the power.
    curve : Curve or None           For tables.
    signal : str                    Name of the input that the first coefficient is multiplied by; empty for none.
    """

    name: str
    form: str
    node: str
    sensor: str
    coefficients: tuple[Number, ...]
    curve: Curve | None = None
    signal: str = ""
