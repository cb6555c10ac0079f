"""Radiation inside an enclosure of grey, diffuse, isothermal faces: from view factors to the exchange area of every pair.

What leaves face i, its radiosity, is what it emits and what it reflects of what the others send: J = e sigma T^4 + (1 - e) F J. Solved
for one face warm at a time, it gives the exchange areas S with heat from i to j equal to S_ij sigma (T_i^4 - T_j^4): Hottel's script-F
times the area, with every reflection counted. Hottel and Sarofim, Radiative Transfer, McGraw-Hill 1967, chapter 3; Incropera, 6th ed.,
Section 13.3; Gebhart's factors are B_ij = S_ij / (e_i A_i).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.units import Array, Dual, Number, values_of

RECIPROCITY = 1e-3
"""Largest relative difference of A_i F_ij and A_j F_ji, and of a row's sum from one; given factors have three or four digits. [-]"""


def exchange_areas(factors: Array, areas: Array, emissivities: Array) -> Array:
    """Return the exchange area S of every pair of faces (faces, faces): heat from i to j is S_ij sigma (T_i^4 - T_j^4). [m^2]

    S_ij = e_i A_i sum_k F_ik J_kj, with J_kj the radiosity of face k while face j alone emits; both directions of a pair are averaged.

    Parameters
    ----------
    factors : array (faces, faces)      View factors, rows summing to one. [-]
    areas, emissivities : array (faces,)    [m^2], [-]

    Examples
    --------
    Two large facing plates of emissivity 0.3 exchange 0.176 of what black ones would (Incropera, Table 13.3), not 0.3:

    >>> plates = exchange_areas(np.array([[0.0, 1.0], [1.0, 0.0]]), np.ones(2), np.array([0.3, 0.3]))
    >>> round(float(plates[0, 1]), 3)
    0.176
    """
    sent = _sent(areas[:, None] * factors, areas, emissivities)
    exchange = emissivities[:, None] * (areas[:, None] * factors) @ sent
    return np.asarray(0.5 * (exchange + exchange.T))


def _sent(area_factors: Array, areas: Array, emissivities: Array) -> Array:
    """Return the radiosity J (faces, faces) of each face while one face after the other (columns) emits as one black unit.

    Solves (diag(A) - (1 - e) A F) J = diag(e A), with `area_factors` A F [m^2].
    """
    return np.asarray(np.linalg.solve(np.diag(areas) - (1.0 - emissivities)[:, None] * area_factors, np.diag(emissivities * areas)))


def absorbing_areas(factors: Array, areas: Sequence[Number], absorptances: Sequence[Number]) -> list[list[Number]]:
    """Return the heat (faces, faces) that each face absorbs of a unit flux falling on another one, all diffuse reflections counted. [m^2]

    Row i, column j is M_ij = a_i A_i ((1 - F R)^-1)_ij with the reflectances R = diag(1 - a): the irradiances obey H = H0 + F R H, with H0
    the flux on face j alone. In a closed enclosure column j sums to the area of face j.

    Parameters
    ----------
    factors : array (faces, faces)              View factors. [-]
    areas, absorptances : sequence (faces,)     With derivatives or without. [m^2], [-]

    Examples
    --------
    Two large facing plates, both half absorbing, one under the sun: it takes two thirds, the other one third.

    >>> found = absorbing_areas(np.array([[0.0, 1.0], [1.0, 0.0]]), [1.0, 1.0], [0.5, 0.5])
    >>> [round(float(row[0]), 4) for row in found]
    [0.6667, 0.3333]
    """
    share = values_of(absorptances)
    size = values_of(areas)
    spread = np.linalg.inv(np.eye(size.size) - factors * (1.0 - share))
    values = (share * size)[:, None] * spread
    gradient = np.zeros((*values.shape, _free_parameters(*areas, *absorptances)))
    for k, (area, absorptance) in enumerate(zip(areas, absorptances, strict=True)):
        if isinstance(area, Dual):
            gradient[k] += share[k] * spread[k][:, None] * area.gradient
        if isinstance(absorptance, Dual):
            gradient[k] += size[k] * spread[k][:, None] * absorptance.gradient
            gradient -= np.outer(values @ factors[:, k], spread[k])[..., None] * absorptance.gradient
    return _with_gradients(values, gradient)


def _free_parameters(*numbers: Number) -> int:
    """Return the length of the gradients of numbers; zero where none carries derivatives."""
    return next((x.gradient.size for x in numbers if isinstance(x, Dual)), 0)


def _with_gradients(values: Array, gradient: Array) -> list[list[Number]]:
    """Return a matrix (faces, faces) as rows of numbers with their gradients (faces, faces, free); plain floats where free is zero."""
    rows: list[list[float]] = values.tolist()
    return [[Dual(v, gradient[i, j]) if gradient.size else v for j, v in enumerate(row)] for i, row in enumerate(rows)]


def exchange_areas_of(factors: Array, areas: Sequence[Number], emissivities: Sequence[Number]) -> list[list[Number]]:
    """Return `exchange_areas` (faces, faces) as rows of numbers, with derivatives where areas or emissivities carry them. [m^2]"""
    size = values_of(areas)
    grey = values_of(emissivities)
    values = exchange_areas(factors, size, grey)
    gradient = np.zeros((*values.shape, _free_parameters(*areas, *emissivities)))
    for numbers, derivative in ((areas, _derivative_by_area), (emissivities, _derivative_by_emissivity)):
        for k, number in enumerate(numbers):
            if isinstance(number, Dual):
                one = derivative(factors, size, grey, k)
                gradient += 0.5 * (one + one.T)[..., None] * number.gradient
    return _with_gradients(values, gradient)


def _derivative_by_area(factors: Array, areas: Array, grey: Array, k: int) -> Array:
    """Return dS_ij / dA_k (faces, faces) of the exchange areas before averaging, view factors kept; `grey` are the emissivities e. [-]

    S = e (A F) J with J as `_sent` solves it: (diag(A) - (1 - e) A F) dJ = dR, where row k of dR is (1 - e_k) F_k J - J_k, plus e_k at (k,
    k).
    """
    area_factors = areas[:, None] * factors
    sent = _sent(area_factors, areas, grey)
    more = np.zeros_like(area_factors)
    more[k] = factors[k]
    right = np.zeros_like(area_factors)
    right[k] = (1.0 - grey[k]) * (factors[k] @ sent) - sent[k]
    right[k, k] += grey[k]
    change = np.linalg.solve(np.diag(areas) - (1.0 - grey)[:, None] * area_factors, right)
    return np.asarray(grey[:, None] * (more @ sent + area_factors @ change))


def _derivative_by_emissivity(factors: Array, areas: Array, grey: Array, k: int) -> Array:
    """Return dS_ij / de_k (faces, faces) of the exchange areas before averaging; `grey` are the emissivities e. [m^2]

    S = e (A F) J with J as `_sent` solves it: (diag(A) - (1 - e) A F) dJ = dR, where row k of dR is -(A F J)_k, plus A_k at (k, k).
    """
    area_factors = areas[:, None] * factors
    sent = _sent(area_factors, areas, grey)
    right = np.zeros_like(area_factors)
    right[k] = -(area_factors[k] @ sent)
    right[k, k] += areas[k]
    change = np.linalg.solve(np.diag(areas) - (1.0 - grey)[:, None] * area_factors, right)
    out = grey[:, None] * (area_factors @ change)
    out[k] += area_factors[k] @ sent
    return np.asarray(out)


def check_view_factors(factors: Array, areas: Array, names: Sequence[str], where: str, closed: bool = True) -> None:
    """Refuse view factors that are negative, violate reciprocity A_i F_ij = A_j F_ji, or whose rows do not sum to one.

    Parameters
    ----------
    factors : array (faces, faces)  [-]
    areas : array (faces,)          [m^2]
    names : sequence of str         Of the faces, for messages.
    where : str                     For messages.
    closed : bool                   Whether the rows must sum to one; else to at most one.

    Raises
    ------
    DeckError   Names the first face or pair that is wrong, with both numbers.
    """
    if factors.min() < 0.0:
        i, j = np.argwhere(factors < 0.0)[0]
        raise DeckError(
            f"the view factor from '{names[i]}' to '{names[j]}' is {factors[i, j]:g}; it must not be negative.",
            where,
            code="model.view-factors",
        )
    shared = areas[:, None] * factors
    off = np.abs(shared - shared.T)
    allowed = RECIPROCITY * np.maximum(shared, shared.T) + 1e-9 * areas.max()
    if (off > allowed).any():
        i, j = divmod(int(np.argmax(off - allowed)), len(names))
        raise DeckError(
            f"view factors of '{names[i]}' and '{names[j]}' violate reciprocity: area times factor is {shared[i, j]:.5g} m^2 one way "
            f"({areas[i]:.4g} m^2 times {factors[i, j]:.4g}) and {shared[j, i]:.5g} m^2 the other ({areas[j]:.4g} m^2 times "
            f"{factors[j, i]:.4g}). Correct a factor or an area.",
            where,
            code="model.view-factors",
        )
    sums = factors.sum(axis=1)
    bad = np.abs(sums - 1.0) > RECIPROCITY if closed else sums > 1.0 + RECIPROCITY
    if bad.any():
        k = int(np.argmax(bad))
        cure = (
            "Correct them, or name the node that fills the rest of the view: rest = a node."
            if closed
            else ("The sum must not exceed one. Correct them.")
        )
        raise DeckError(f"the view factors of '{names[k]}' sum to {sums[k]:.5g}, not to one. {cure}", where, code="model.view-factors")
