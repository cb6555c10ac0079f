"""When a fit is refused, and in which words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError
from thermid.fit.least_squares.solve import Fit
from thermid.fit.problem.residuals import Problem
from thermid.fit.uncertainty.grouping import Group, listed, percent, together
from thermid.fit.uncertainty.groups import SHARE, structural_groups
from thermid.fit.uncertainty.information import Information, elsewhere, null_space
from thermid.measure.amounts import short
from thermid.units import unit

if TYPE_CHECKING:
    from thermid.fit.calibration import Calibration
    from thermid.fit.problem.request import Request

Array = NDArray[np.float64]


def refuse_before(request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> None:
    """Refuse a fit of unknowns that the records cannot tell apart.

    Raises
    ------
    IdentificationError   Names them, and what is known of them instead.
    """
    if not problem.unknowns:
        return
    info = Information.of(problem, np.array([u.to_fitted(u.start) for u in problem.unknowns]))
    length = np.linalg.norm(info.rows, axis=0)
    blind = set(np.flatnonzero(length <= 1e-12 * length.max()).tolist())
    for direction in null_space(info.rows) * length:
        blind |= set(np.flatnonzero(np.abs(direction) > SHARE * np.abs(direction).max()).tolist())
    if blind:
        names = {info.names[k] for k in blind}
        groups = structural_groups(info, elsewhere(problem, info))
        group = next(g for g in groups if names & set(g.names))
        raise IdentificationError(_words(group, request, problem, fit), request.name or request.model.title)


def _words(group: Group, request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> str:
    """Return what cannot be told apart, what is known instead, and what to do."""
    if group.form == "unseen":
        return f"no reading depends on '{group.names[0]}'. Fix it, or add a record in which it acts."
    named = listed(group.names) if len(group.names) < 3 else ", ".join(f"'{n}'" for n in group.names)
    cure = "Free one of them, or add a record in which they act differently."
    how = group.pair
    if how in ("product", "ratio"):
        known = _known(group, request, problem, fit)
        return f"the data cannot tell {named} apart; they act only as a {how}{known}. {cure}"
    about = "; ".join(f"{c.text} to about {percent(c.relative)}{f' ({c.meaning})' if c.meaning else ''}" for c in group.known)
    known = f" Known: {about}." if about else ""
    if group.form in ("sum", "series"):
        return f"the data cannot tell {named} apart; {group.acting}.{known} {cure}"
    if group.form == "power law":
        moves = ", or ".join(together(move, len(group.names)) for move in group.moves)
        powers = [n for n in group.names if n.rpartition(".")[2] in ("power", "scale") or _is_power(n, problem)]
        advice = f" Without a measured power only ratios are known: fix '{powers[0]}' or give it a prior." if powers else ""
        return f"the data cannot tell {named} apart: {moves} changes no reading.{known}{advice} {cure}"
    return f"the data cannot tell {named} apart: a change of one is made up for by the others. {cure}"


def _is_power(name: str, problem: Problem) -> bool:
    return any(u.name == name and unit(u.unit).dimension == unit("W").dimension for u in problem.unknowns)


def _known(group: Group, request: Request, problem: Problem, fit: Callable[[Request], Calibration]) -> str:
    """Return the value of a product or ratio of two parameters, from a fit that frees one of them."""
    first, second = group.names
    fewer = tuple(n for n in request.free if request.model.canonical(n) != second)
    if len(fewer) != len(request.free) - 1:
        return ""
    try:
        found = fit(replace(request, free=fewer))
    except IdentificationError:
        return ""
    combination = f"{first}{'*' if group.pair == 'product' else '/'}{second}"
    other = next(u for u in problem.unknowns if u.name == second)
    value = found.values[first]
    factor = other.start if group.pair == "product" else 1.0 / other.start
    of = unit(value.unit).dimension
    from thermid.units import NAMES

    dimension = tuple(a + b if group.pair == "product" else a - b for a, b in zip(of, unit(other.unit).dimension, strict=True))
    text = next((t for t in NAMES if unit(t).dimension == dimension), "SI")
    meaning = next((f", which sets {c.meaning}" for c in group.known if c.meaning), "")
    return f" (known: {combination} = {short(value.value * factor, 3)} +- {short(value.error * factor)} {text}{meaning})"


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
                f"'{u.name}' = {short(value, 3)} +- {short(spread)} {u.unit}: its standard error is wider than its bounds "
                f"{u.low * scale:.4g} .. {u.high * scale:.4g}, so the log says nothing new{_by_instruments(problem, total, k)}. Fix it, "
                "give it a prior, or add a record that moves it.",
                request.name or request.model.title,
            )


def _by_instruments(problem: Problem, total: Array, k: int) -> str:
    """Return which instruments' errors set most of the variance of an unknown; empty where none do."""
    at = [j for j, u in enumerate(problem.unknowns) if u.kind in ("sensor", "shared", "instrument")]
    if not at or not np.isfinite(total[np.ix_([k, *at], [k, *at])]).all():
        return ""
    across = total[at, k]
    if float(across @ np.linalg.pinv(total[np.ix_(at, at)]) @ across) < 0.5 * total[k, k]:
        return ""
    share = across**2 / (np.diag(total)[at] * total[k, k])
    behind = [problem.unknowns[j] for j, s in zip(at, share, strict=True) if s > 0.1]
    if not behind:
        return ""
    names = listed([u.name.removeprefix("sensor ").removesuffix(" error") for u in behind])
    cure = " (if all began at one temperature, say so with `start`: it shows them)" if all(u.kind == "sensor" for u in behind) else ""
    return f"; most of that is the constant error of {names}{cure}"
