"""When a fit is refused, and in which words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError
from thermid.identify.identifiability import Blind, blind_spots
from thermid.identify.residuals import Problem
from thermid.identify.solve import Fit
from thermid.units import unit

if TYPE_CHECKING:
    from thermid.identify.calibration import Calibration
    from thermid.identify.request import Request

__all__ = ["refuse_after", "refuse_before"]

Array = NDArray[np.float64]


def refuse_before(request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> None:
    """Refuse a fit of unknowns that the records cannot tell apart.

    Raises
    ------
    IdentificationError   Names them, and what is known of them instead.
    """
    if not problem.unknowns:
        return
    start = np.array([u.to_fitted(u.start) for u in problem.unknowns])
    spots = blind_spots(problem, start)
    if spots:
        raise IdentificationError(_words(spots[0], request, problem, fit), request.name or request.model.title)


def _words(spot: Blind, request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> str:
    """Return a blind spot in words."""
    if spot.kind == "none":
        return f"no reading depends on '{spot.names[0]}'. Fix it, or add a record in which it acts."
    named = " and ".join(f"'{n}'" for n in spot.names) if len(spot.names) < 3 else ", ".join(f"'{n}'" for n in spot.names)
    cure = "Free one of them, or add a record in which they act differently."
    if spot.kind in ("product", "ratio"):
        known = _known(spot, request, problem, fit)
        return f"the data cannot tell {named} apart; they act only as a {spot.kind}{known}. {cure}"
    logs = {u.name: u.log for u in problem.unknowns}
    if all(logs[n] for n in spot.names):
        moves = ", ".join(f"{n} by x^{w:.3g}" for n, w in zip(spot.names, spot.weights, strict=True))
        powers = [n for n in spot.names if n.rpartition(".")[2] in ("power", "scale") or _is_power(n, problem)]
        advice = f" Without a measured power only ratios are known: fix '{powers[0]}' or give it a prior." if powers else ""
        return f"the data cannot tell {named} apart: changing {moves} together, with any x, changes no reading.{advice} {cure}"
    return f"the data cannot tell {named} apart: a change of one is made up for by the others. {cure}"


def _is_power(name: str, problem: Problem) -> bool:
    return any(u.name == name and unit(u.unit).dimension == unit("W").dimension for u in problem.unknowns)


def _known(spot: Blind, request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> str:
    """Return the value of a product or ratio of two parameters, from a fit that frees one of them."""
    first, second = spot.names
    fewer = tuple(n for n in request.free if request.model.canonical(n) != second)
    if len(fewer) != len(request.free) - 1:
        return ""
    try:
        found = fit(replace(request, free=fewer))
    except IdentificationError:
        return ""
    other = next(u for u in problem.unknowns if u.name == second)
    value = found.values[first]
    factor = other.start if spot.kind == "product" else 1.0 / other.start
    of = unit(value.unit).dimension
    from thermid.units import NAMES

    dimension = tuple(a + b if spot.kind == "product" else a - b for a, b in zip(of, unit(other.unit).dimension, strict=True))
    text = next((t for t in NAMES if unit(t).dimension == dimension), "SI")
    return f" (known: {spot.combination()} = {value.value * factor:.3g} +- {value.error * factor:.2g} {text})"


def refuse_after(request: Request, problem: Problem, found: Fit, total: Array) -> None:
    """Refuse a fit whose standard error is wider than the bounds it was given.

    Raises
    ------
    IdentificationError   Names the parameter, its error and its bounds.
    """
    for k, u in enumerate(problem.unknowns):
        if u.kind != "parameter":
            continue
        error = float(np.sqrt(total[k, k]))
        if not np.isfinite(error):
            raise IdentificationError(
                f"at the end of the fit no reading depends on '{u.name}'. Fix it.", request.name or request.model.title
            )
        low, high = u.fitted_bounds()
        if not u.log:
            width = high - low
        else:
            width = high - low if u.low > 0 else np.inf
        if np.isfinite(width) and 2 * error > width:
            scale = 1.0 / float(unit(u.unit).factor)
            value, spread = u.to_value(float(found.fitted[k])) * scale, error * u.slope(float(found.fitted[k])) * scale
            raise IdentificationError(
                f"'{u.name}' = {value:.3g} +- {spread:.2g} {u.unit}: its standard error is wider than its bounds {u.low * scale:.4g} .. "
                f"{u.high * scale:.4g}, so the log says nothing new. Fix it, give it a prior, or add a record that moves it.",
                request.name or request.model.title,
            )
