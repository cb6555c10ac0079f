"""Rows of the law table: conductors and loads with their numbers, ready for the kernel."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from thermid import _kernel
from thermid.base.units import Array, Number
from thermid.model.tree import EXTENSION_REACH, Curve, Law

ANCHOR: Final = _kernel.GAS_ANCHOR
"""Temperature to which the coefficients of gas laws refer. [K]"""
SMOOTHING: Final = _kernel.SMOOTHING
"""Temperature difference below which a power law is smoothed, so that its derivative stays finite at zero. [K]"""


def reached(start: Iterable[str], joined: Mapping[str, set[str]]) -> set[str]:
    """Return every node that can be reached from `start` along `joined`, node -> neighbours; `start` is among them."""
    out, edge = set(start), list(start)
    while edge:
        fresh = joined[edge.pop()] - out
        out |= fresh
        edge += fresh
    return out


class KernelLaw(NamedTuple):
    """One row of the kernel's table of laws.

    Parameters
    ----------
    kind : int              Its number in the kernel.
    coefficients : int      How many it has.
    tables : int            How many tables it looks up.
    linear : bool           Whether its heat is linear in temperatures.
    one_way : bool          Whether its heat counts at the second end only, as that of a stream.
    """

    kind: int
    coefficients: int
    tables: int
    linear: bool
    one_way: bool


CONDUCTORS: Final[Mapping[str, KernelLaw]] = {name: KernelLaw(*row) for name, row in _kernel.CONDUCTOR_LAWS.items()}
"""The kernel's laws of conductors by form."""
LOADS: Final[Mapping[str, KernelLaw]] = {name: KernelLaw(*row) for name, row in _kernel.LOAD_LAWS.items()}
"""The kernel's laws of loads by form."""
CONTROLS: Final[Mapping[str, KernelLaw]] = {name: KernelLaw(*row) for name, row in _kernel.CONTROL_LAWS.items()}
"""The kernel's controls of loads by name."""


def conductor_law(form: str, curve: Curve | None = None) -> KernelLaw:
    """Return the kernel's law of a form; for 'table' that over the mean temperature or over the difference, as its curve says."""
    over_difference = form == "table" and curve is not None and curve.over == "difference"
    return CONDUCTORS["table of difference" if over_difference else form]


EDGE: Final = 1e-9
"""How far outside its points a table that is refused there may still be read: what rounding makes of a boundary at its end. [K]"""


def curve_arrays(curve: Curve, refuse: bool = False) -> tuple[Array, Array, Array]:
    """Return knots [K], values and slopes (knots,) of a table for the kernel, no slopes for straight lines.

    With `refuse` a table has no values, NaN, outside its limits, so that a run that leaves them ends; they begin `EDGE` beyond, up to
    where it is carried on at its last slope. Else it is held there.
    """
    x, y, d = curve.table
    if refuse and curve.limits is not None:
        inside = (x >= curve.limits[0]) & (x <= curve.limits[1])
        x, y, d = x[inside], y[inside], None if d is None else d[inside]
        first, last = (0.0, 0.0) if d is None else (d[0], d[-1])
        if np.isfinite(curve.limits[0]):
            x, y = np.r_[x[0] - (EXTENSION_REACH, EDGE), x], np.r_[np.nan, y[0] - EDGE * first, y]
            d = None if d is None else np.r_[0.0, first, d]
        if np.isfinite(curve.limits[1]):
            x, y = np.r_[x, x[-1] + (EDGE, EXTENSION_REACH)], np.r_[y, y[-1] + EDGE * last, np.nan]
            d = None if d is None else np.r_[d, last, 0.0]
    return x, y, np.zeros(0) if d is None else d


def tables_behind(form: str, curve: Curve) -> tuple[Curve, ...]:
    """Return the tables that a law of a form looks up, in the kernel's order: the curve, then its film tables (of a potential one)."""
    return (curve, *(curve.film[:1] if form == "potential" else curve.film))


def _evaluated(form: str, coefficients: Sequence[Any], curve: Curve | None, hot: Array, cold: Array) -> Array:
    """Return (5, times) from the kernel: heat Q [W], dQ/dT_hot, dQ/dT_cold [W/K], dQ/dc_1, dQ/dc_2 of a law.

    `hot` and `cold` (times,) are the temperatures of its ends [K]; Q counts from the first end, `hot`, to the second.
    """
    law = conductor_law(form, curve)
    hot, cold = (np.ascontiguousarray(t, dtype=float) for t in np.broadcast_arrays(hot, cold))
    pair = [np.broadcast_to(np.asarray(c, dtype=float), hot.shape) for c in (*coefficients, 0.0)[:2]]
    tables = [curve_arrays(table) for table in tables_behind(form, curve)] if curve is not None else []
    return _kernel.conductor_heat(law.kind, hot.ravel(), cold.ravel(), np.column_stack([c.ravel() for c in pair]), tables)


def heat(form: str, coefficients: Sequence[Any], curve: Curve | None, hot: Array, cold: Array) -> Array:
    """Return the heat flow (times,) of a law from its first end to its second. [W]

    Parameters
    ----------
    form : str                  As in `thermid.model._parts.elements.Law`.
    coefficients : sequence     Floats or arrays (times,). [SI]
    curve : Curve or None       For tables.
    hot, cold : array (times,)  Temperatures of the first and the second end. [K]
    """
    return np.asarray(_evaluated(form, coefficients, curve, hot, cold)[0])


def conductance(form: str, coefficients: Sequence[Any], curve: Curve | None, hot: Array, cold: Array) -> Array:
    """Return heat flow over temperature difference (times,); where that is zero, its limit. [W/K]

    Parameters as of `heat`.
    """
    flow, slope, *_ = _evaluated(form, coefficients, curve, hot, cold)
    apart = np.broadcast_to(hot - cold, flow.shape)
    return np.asarray(np.where(apart != 0.0, flow / np.where(apart != 0.0, apart, 1.0), slope))


@cache
def same_both_ways(form: str) -> bool:
    """Return whether exchanging the ends of a law without tables only changes the sign of its heat; tried at 290 and 310 K."""
    hot, cold = np.array([310.0, 290.0]), np.array([290.0, 310.0])
    there, back = heat(form, (1.0, 0.3)[: CONDUCTORS[form].coefficients], None, hot, cold)
    return bool(np.isclose(there, -back, rtol=1e-9))


@dataclass(frozen=True, eq=False)
class ConductorRow:
    """One law between two nodes.

    Parameters
    ----------
    name : str              Path of the conductor it comes from.
    ends : (str, str)       Node paths; heat flow is positive from the first to the second.
    law : Law               Its form, one of `CONDUCTORS`, and its coefficients, the first of which scales the heat flow.
    curve : Curve or None   For tables.
    signal : str            Name of the input that the first coefficient is multiplied by; empty for none.
    second : str            The same for the second coefficient.
    controls : tuple        Controls whose shares the heat flow is multiplied by.
    turned : bool           Whether it is a stream the other way round: its heat counts against the conductor's direction.
    """

    name: str
    ends: tuple[str, str]
    law: Law
    curve: Curve | None = None
    signal: str = ""
    second: str = ""
    controls: tuple[str, ...] = ()
    turned: bool = False

    @property
    def form(self) -> str:
        """Form of its law."""
        return self.law.form

    @property
    def coefficients(self) -> tuple[Number, ...]:
        """Coefficients of its law."""
        return self.law.coefficients

    @property
    def kernel(self) -> KernelLaw:
        """The kernel's law of its form."""
        return conductor_law(self.form, self.curve)


@dataclass(frozen=True, eq=False)
class LoadRow:
    """One heat load: a law, and a control that lets through a share of it.

    Parameters
    ----------
    name : str                      Path of the load it comes from; rows of one load have one control.
    form : str                      One of `LOADS`.
    node, sensor : str              Node that is heated, whose temperature the law follows; node whose temperature the control follows.
    coefficients : tuple of Number  Those of the law, the first of which scales the power, then those of the control.
    curve : Curve or None           For tables.
    signal : str                    Name of the input that the first coefficient is multiplied by; empty for none.
    control : str                   One of `CONTROLS`; empty for none.
    controls : tuple                Controls of the deck whose shares the power is multiplied by too.
    follows : str                   What the law follows where it is not the node: of a controller's state.
    """

    name: str
    form: str
    node: str
    sensor: str
    coefficients: tuple[Number, ...]
    curve: Curve | None = None
    signal: str = ""
    control: str = ""
    controls: tuple[str, ...] = ()
    follows: str = ""

    @property
    def of_law(self) -> tuple[Number, ...]:
        """The coefficients of the law."""
        return self.coefficients[: LOADS[self.form].coefficients]

    @property
    def settings(self) -> tuple[Number, ...]:
        """The coefficients of the control; a proportional one without its third, full power, has the law's first for it."""
        return self.coefficients[LOADS[self.form].coefficients :]

    @property
    def fixed(self) -> bool:
        """Whether its power follows no temperature."""
        return self.form == "signal" and not self.control and not self.controls
