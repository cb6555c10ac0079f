"""`valley`: how a fit worsens over two parameters that may make up for each other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError, NameNotFoundError, SolverError, nearest
from thermid.fit.calibration import Calibration
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import Unknown
from thermid.inference.identifiability import Identifiability
from thermid.inference.profile import Held, asked, spread_of
from thermid.linear_algebra import Array

GRID = 25


@dataclass(frozen=True, eq=False)
class Valley:
    """The weighted sum of squares over two parameters, all others adjusting themselves.

    Parameters
    ----------
    names, units : (str, str)           The parameters, and units for people.
    first, second : array (points,)     Values. [SI]
    rise : array (points, points)       Growth over the best, second down, first across; NaN where the model cannot be run. [-]
    best : (float, float)               [SI]
    along : array (line, 2)             The valley: for each value of the first, the best second. [SI]
    bounds : pair of (float, float)     [SI]
    logs : (bool, bool)                 Whether each is fitted by its logarithm.
    fitted : bool                       Whether `best` is the end of a fit; else it is where one would start.
    """

    names: tuple[str, str]
    units: tuple[str, str]
    first: Array
    second: Array
    rise: Array
    best: tuple[float, float]
    along: Array
    bounds: tuple[tuple[float, float], tuple[float, float]]
    logs: tuple[bool, bool]
    fitted: bool = True


@takes_objects
def valley(source: Calibration | Identifiability, first: str, second: str, points: int = GRID) -> Valley:
    """Return how the fit worsens over two parameters; where they can make up for each other, the map shows a valley.

    Parameters
    ----------
    source : Calibration or Identifiability     A fit, or what is known before one, where a fit would be refused.
    first, second : str                         Paths of two free parameters.
    points : int                                Values along each axis.

    Notes
    -----
    Everything else follows by one step of Gauss and Newton at each point, from where the derivatives at the best place it.
    """
    if first == second:
        raise IdentificationError(f"a valley lies between two parameters; '{first}' was given twice.", "valley")
    if isinstance(source, Calibration):
        (problem, i), (_, j) = asked(source, first), asked(source, second)
        at = np.array([source.fitted[u.name] for u in problem.unknowns])
        error = np.array([source.values[problem.unknowns[k].name].error for k in (i, j)])
        error = error / np.array([problem.unknowns[k].slope(at[k]) for k in (i, j)])
        spread = spread_of(problem, at, (i, j), error)
    else:
        problem, at, spread = source.problem, source.information.at, 1.0
        i, j = (_position(source, path) for path in (first, second))
        error = np.sqrt(np.diag(source.information.covariance()))[[i, j]]
    pair = (problem.unknowns[i], problem.unknowns[j])
    axes = [_axis(u, float(at[k]), float(e), points) for u, k, e in zip(pair, (i, j), error, strict=True)]
    held = Held.of(problem, at, (i, j), spread)
    response = _response(problem, at, (i, j), held.kept)
    rise = np.full((points, points), np.nan)
    for m, y in enumerate(axes[1]):
        for n, x in enumerate(axes[0]):
            moved = at.copy()
            moved[held.kept] += response @ np.array([x - at[i], y - at[j]])
            moved[[i, j]] = x, y
            rise[m, n] = _settled(held, moved)
    # before a fit the start is not the best; of a fit the middle of the map is
    rise -= np.nanmin(rise)
    values = [np.array([u.to_value(x) for x in axis]) for u, axis in zip(pair, axes, strict=True)]
    best = pair[0].to_value(at[i]), pair[1].to_value(at[j])
    along = np.column_stack([values[0], [_lowest(values[1], column) for column in rise.T]])
    bounds = (pair[0].low, pair[0].high), (pair[1].low, pair[1].high)
    names, units = (pair[0].name, pair[1].name), (pair[0].unit, pair[1].unit)
    return Valley(
        names, units, values[0], values[1], rise, best, along, bounds, (pair[0].log, pair[1].log), isinstance(source, Calibration)
    )


def _position(source: Identifiability, path: str) -> int:
    names = source.information.names
    if path not in names:
        raise NameNotFoundError(f"'{path}' is not free here.{nearest(path, names)}", source.title)
    return names.index(path)


def _axis(u: Unknown, at: float, error: float, points: int) -> Array:
    """Return the values to look at, in the fitted form: 3.5 standard errors either side, at most a factor of 4, within the bounds."""
    wide = min(3.5 * error, 1.4) if u.log else 3.5 * error if np.isfinite(error) else 4.0 * u.scale
    low, high = u.fitted_bounds()
    return np.linspace(max(at - wide, low), min(at + wide, high), points)


def _response(problem: Problem, at: Array, pair: tuple[int, int], kept: NDArray[np.int64]) -> Array:
    """Return how the others move (others, 2) when the pair is moved from the best."""
    rows = np.concatenate([problem.compressed(at).slopes, problem.prior_rows(at)[1]])
    found: Array = np.linalg.lstsq(rows[:, kept], -rows[:, list(pair)], rcond=1e-10)[0]
    return found


def _settled(held: Held, moved: Array) -> float:
    """Return the sum of squares at some values of all unknowns, the others following by two Newton steps; NaN where none runs."""
    here, square, at = replace(held, values=moved), np.nan, moved[held.kept]
    for last in (False, True):
        try:
            found = here.compressed(at)
        except SolverError:
            return square
        priors, slopes = here.prior_rows(at)
        rows, jacobian = np.concatenate([found.rows, priors]), np.concatenate([found.slopes, slopes])
        step = np.linalg.lstsq(jacobian, -rows, rcond=1e-10)[0] if at.size else at
        square = float(np.sum((rows + jacobian @ step) ** 2))
        if last or not at.size:
            break
        at = at + step
    return square


def _lowest(values: Array, column: Array) -> float:
    """Return where a column of the map is lowest, by a parabola through the lowest point and its neighbours."""
    if np.isnan(column).all():
        return float("nan")
    k = int(np.nanargmin(column))
    if not 0 < k < values.size - 1:
        return float("nan")  # beyond the edge
    left, middle, right = column[k - 1 : k + 2]
    bend = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / bend if bend > 0 else 0.0
    return float(np.interp(k + shift, np.arange(values.size), values))
