"""Linear algebra of information: covariance, null space, pseudo-inverse and roots, with the tolerances of two questions.

Can an unknown be told from the others (RANK_TOLERANCE), and has it any effect at all (NOTHING)?

Rows J are derivatives of residuals in units of their errors: J'J is the information, and (J'J)^-1 the covariance of the unknowns. Columns
are scaled to length one first, so that no unit decides what counts as nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from functools import lru_cache
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from thermid.base._numbers import Array, Bools

RANK_TOLERANCE = 1e-6
"""Singular value of scaled rows, beside the largest, up to which a direction holds no information: derivatives of a run are not good to
more. Eigenvalues of J'J and of a covariance are squares of these, so that theirs is its square."""
MAX_PART_WITHOUT_INFORMATION = 1e-3
"""Part that an unknown may have in directions without information and still count as known."""
NOTHING = 1e-12
"""What rounding leaves: length of a column, beside the longest, up to which no row depends on its unknown, and singular value of scaled
rows up to which a combination has no effect. Between this and RANK_TOLERANCE rows depend on it, weakly: its error is finite and large."""


def scaled(rows: Array) -> tuple[Array, Array, Bools]:
    """Return `rows` (rows, columns) with columns of length one, these lengths (columns,), and which columns have entries (columns,).

    The length of a column below `NOTHING` of the longest counts as 1 and its entries as 0. Rows of zeros are added below where there are
    fewer rows than columns, so that singular values count every unknown.
    """
    length = np.linalg.norm(rows, axis=0)
    nonzero = length > NOTHING * length.max(initial=0.0)
    length = np.where(nonzero, length, 1.0)
    below = np.zeros((max(0, rows.shape[1] - rows.shape[0]), rows.shape[1]))
    return np.concatenate([np.where(nonzero, rows / length, 0.0), below]), length, nonzero


def _decomposed(rows: Array, tolerance: float) -> tuple[Array, Array, Bools, Array]:
    """Return singular values and right singular vectors of the scaled rows, which directions hold nothing, and the scale."""
    unit_columns, length, _ = scaled(rows)
    _, s, v = np.linalg.svd(unit_columns, full_matrices=False)
    return s, v, s <= tolerance * s[0], length


def pseudo_inverse(rows: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """Return the pseudo-inverse of J'J: right for combinations of which the rows state something, nothing of the others."""
    return _inverse(rows, tolerance)[0]


def _inverse(rows: Array, tolerance: float) -> tuple[Array, Array]:
    """Return the pseudo-inverse (unknowns, unknowns) of J'J, and the part (unknowns,) of each in directions that J leaves open. [-]

    V S^-2 V' of J = U S V' with columns of unit length, scaled back; singular values below `tolerance` of the largest count as none.
    """
    if rows.shape[1] == 0:
        return np.zeros((0, 0)), np.zeros(0)
    s, v, weak, length = _decomposed(rows, tolerance)
    inverted = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, s))
    # (J'J)^-1 = V S^-2 V'
    return (v.T * inverted**2) @ v / np.outer(length, length), np.linalg.norm(v[weak], axis=0)


def covariance(rows: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """Return (J'J)^-1 (unknowns, unknowns) of rows J (rows, unknowns); infinite for an unknown without information.

    That is one with a part above `MAX_PART_WITHOUT_INFORMATION` in directions without; it goes with no other. `tolerance` as in
    `_inverse`.
    """
    out, unknown = _inverse(rows, tolerance)
    lost = unknown > MAX_PART_WITHOUT_INFORMATION
    out[lost, :] = out[:, lost] = 0.0
    out[lost, lost] = np.inf
    return out


def null_space(rows: Array) -> Array:
    """Return the directions (directions, unknowns) that no row sees; unknowns that no row depends on are left out."""
    _, _, nonzero = scaled(rows)
    if nonzero.sum() < 2:
        return np.zeros((0, rows.shape[1]))
    _, v, weak, inner = _decomposed(rows[:, nonzero], RANK_TOLERANCE)
    out = np.zeros((int(weak.sum()), rows.shape[1]))
    out[:, nonzero] = v[weak] / inner
    return out


def _eigen(matrix: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues (n,) and vectors (n, n) of a symmetric matrix M_ij / (s_i s_j) with a diagonal of ones, and the scale s (n,). [-]

    s_i = sqrt(M_ii), 1 where that is not positive.
    """
    scale = np.sqrt(np.where(np.diag(matrix) > 0, np.diag(matrix), 1.0))
    if not matrix.size:
        return np.zeros(0), matrix, scale
    sizes, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return sizes, vectors, scale


def square_root(matrix: Array, *, drop: bool = False) -> Array:
    """Return a root L of a covariance, ``L L'``: as many columns as rows, or only the directions in which it is not zero."""
    sizes, vectors, scale = _eigen(matrix)
    chosen = sizes > RANK_TOLERANCE**2 * sizes.max(initial=0.0) if drop else slice(None)
    return np.asarray(scale[:, None] * vectors[:, chosen] * np.sqrt(np.maximum(sizes[chosen], 0.0)))


def inverse_square_root(matrix: Array, floor: float = RANK_TOLERANCE**2) -> Array:
    """Return a root R of an information, ``R'R = covariance^-1``; eigenvalues below `floor` of the largest count as that."""
    sizes, vectors, scale = _eigen(matrix)
    return np.asarray((vectors / np.sqrt(np.maximum(sizes, floor * sizes.max(initial=0.0)))).T / scale)


def symmetric_inverse(matrix: Array) -> Array:
    """Return the pseudo-inverse (unknowns, unknowns) of a covariance `matrix` (unknowns, unknowns), or of an information given in full.

    By eigenvalues of the matrix scaled to a unit diagonal; those up to `RANK_TOLERANCE`^2 of the largest count as none.
    """
    sizes, vectors, scale = _eigen(matrix)
    weak = sizes <= RANK_TOLERANCE**2 * sizes.max(initial=0.0)
    inverted = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, sizes))
    return np.asarray((vectors * inverted) @ vectors.T / np.outer(scale, scale))


def variance(information: Array, gradient: Array) -> float:
    """Return the variance g' I^-1 g of a combination g (unknowns,) of unknowns by an information I in full; infinite where none is of it.

    That is where more than `MAX_PART_WITHOUT_INFORMATION` of its length lies in directions without. [square of what g combines]
    """
    sizes, vectors, scale = _eigen(information)
    part = vectors.T @ (gradient / scale)
    weak = sizes <= RANK_TOLERANCE**2 * sizes.max(initial=0.0)
    if np.linalg.norm(part[weak]) > MAX_PART_WITHOUT_INFORMATION * np.linalg.norm(part):
        return float("inf")
    return float(np.sum(part[~weak] ** 2 / sizes[~weak]))


def quadratic_forms(rows: Array, matrix: Array) -> Array:
    """Return the variance (n,) of each of some rows (n, m) of a vector with a covariance (m, m): the diagonal of A C A'."""
    return np.asarray(np.sum((rows @ matrix) * rows, axis=1))


def anderson_step(states: Sequence[Array], steps: Sequence[Array], tolerance: float) -> Array:
    """Return the next state of a fixed-point iteration by Anderson's method: x + f - (dX + dF) g, g of least squares of dF g = f.

    Whole steps may overshoot; the combination of the last ones whose linear forecast of what is left is smallest does not: Walker and Ni,
    SIAM J. Numer. Anal. 49 (2011) 1715, eq. 1.3.

    Parameters
    ----------
    states, steps : sequences of arrays   The last states, of any shape, and the step from each; x and f are the last of them, dX and dF
                                          differences of successive ones.
    tolerance : float                     Singular values of dF, beside the largest, that count as zero. [-]
    """
    if len(states) < 2:
        return np.asarray(states[-1] + steps[-1])
    moved, changed = (np.column_stack([(b - a).ravel() for a, b in pairwise(sequence)]) for sequence in (states, steps))
    share = np.linalg.lstsq(changed, steps[-1].ravel(), rcond=tolerance)[0]
    return np.asarray(states[-1] + steps[-1] - ((moved + changed) @ share).reshape(states[-1].shape))


_libraries = lru_cache(maxsize=4)(lambda *loaded: import_module("threadpoolctl").ThreadpoolController())


def one_thread() -> AbstractContextManager[Any]:
    """Return a context in which libraries of matrices keep to one thread: in some hundred rows two wait for one another.

    Libraries are looked for once, which takes 2 ms, and again once scipy has loaded its own.
    """
    return _libraries("scipy.linalg" in sys.modules, "scipy.special" in sys.modules).limit(limits=1)  # type: ignore[no-any-return]
