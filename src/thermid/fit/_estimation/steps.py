"""One step of a linear network with noise, exactly: transition, response to inputs straight between samples, root of the noise.

``dx = (A (x - r) + f0 + (f1 - f0) t/h) dt + G dW`` has ``x(h) = r + F (x(0) - r) + P1 f0 + P2 (f1 - f0)`` and adds the covariance
``Q = integral of exp(A s) G G' exp(A' s) over 0..h``. Van Loan (IEEE Trans. Autom. Control 23 (1978) 395) reads both integrals off one
exponential of a block matrix. Its block for Q holds exp(-A h), which overflows where a node is much faster than the samples, and has no
square root to the last digit; so Q is summed here as a root, by Gauss's rule over a short stretch, and the stretch doubled:
``Q(2h) = F(h) Q(h) F(h)' + Q(h)``. Both agree to rounding (tests).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from thermid.base.units import Array
from thermid.fit._estimation._constants import PADE, THETA

MAX_GAUSS_NORM: Final = 0.5
"""Largest norm of A h over which Gauss's rule is taken; ten points are then exact to rounding."""
GAUSS_POINTS: Final = 10
GAUSS: Final = np.polynomial.legendre.leggauss(GAUSS_POINTS)
"""Points and weights of Gauss's rule on -1 to 1."""


@dataclass(frozen=True, eq=False)
class NoisyStep:
    """What one step does, of several members at once.

    Parameters
    ----------
    transition : array (members, states, states)    F.
    start, slope : arrays of the same shape          P1, P2. [s]
    noise : array (members, states, states)         A lower triangular root of Q.
    """

    transition: Array
    start: Array
    slope: Array
    noise: Array


def lower(rows: Array) -> Array:
    """Return the lower triangular L (..., n, n), no diagonal below zero, with ``L L' = rows rows'`` of `rows` (..., n, m), by QR."""
    size = rows.shape[-2]
    if rows.shape[-1] < size:
        rows = np.concatenate([rows, np.zeros((*rows.shape[:-1], size - rows.shape[-1]))], axis=-1)
    triangle = np.linalg.qr(np.swapaxes(rows, -1, -2), mode="r")
    sign = np.where(np.diagonal(triangle, axis1=-2, axis2=-1) < 0.0, -1.0, 1.0)
    return np.asarray(np.swapaxes(triangle, -1, -2) * sign[..., None, :])


def exponential(matrices: Array) -> Array:
    """Return exp(A) (..., n, n) of matrices A (..., n, n) [-]: Pade approximant of degree 13 with scaling and squaring, all scaled alike.

    Many small ones cost one call each of numpy's. Higham, SIAM J. Matrix Anal. Appl. 26 (2005) 1179: `PADE`, `THETA`.
    """
    norm = float(np.abs(matrices).sum(axis=-2).max(initial=0.0))
    halvings = max(0, int(np.ceil(np.log2(norm / THETA)))) if norm > THETA else 0
    a = matrices / 2.0**halvings
    eye = np.eye(a.shape[-1])
    b = PADE
    a2 = a @ a
    a4 = a2 @ a2
    a6 = a4 @ a2
    odd = a @ (a6 @ (b[13] * a6 + b[11] * a4 + b[9] * a2) + b[7] * a6 + b[5] * a4 + b[3] * a2 + b[1] * eye)
    even = a6 @ (b[12] * a6 + b[10] * a4 + b[8] * a2) + b[6] * a6 + b[4] * a4 + b[2] * a2 + b[0] * eye
    out = np.linalg.solve(even - odd, even + odd)
    for _ in range(halvings):
        out = out @ out
    return np.asarray(out)


def responses(rates: Array, seconds: float) -> tuple[Array, Array, Array]:
    """Return F = exp(A h), P1 and P2 (members, n, n) of matrices A = `rates` (members, n, n) [1/s] over a step h = `seconds`. [-], [s], [s]

    P1 = int exp(A u) du and P2 = int exp(A u) (1 - u / h) du from 0 to h: what a rate that is constant, or rises from 0 to 1 over the
    step, adds. By one exponential of the block matrix [A h, 1, 0; 0, 0, 1; 0, 0, 0] (Van Loan, IEEE Trans. Autom. Control 23 (1978) 395).
    """
    members, n, _ = rates.shape
    block = np.zeros((members, 3 * n, 3 * n))
    block[:, :n, :n] = rates * seconds
    block[:, :n, n : 2 * n] = block[:, n : 2 * n, 2 * n :] = np.eye(n)
    whole = exponential(block)
    return whole[:, :n, :n], seconds * whole[:, :n, n : 2 * n], seconds * whole[:, :n, 2 * n :]


def noise_root(rates: Array, noise: Array, seconds: float) -> Array:
    """Return a lower triangular root (members, n, n) of Q of matrices A (members, n, n) and G (members, n, sources) over a step.

    A = `rates` [1/s], G = `noise`. Q = int exp(A u) G G' exp(A' u) du from 0 to h = `seconds`, by Gauss points, whose roots stand side by
    side; a step with |A| h above `MAX_GAUSS_NORM` is halved, and Q(2 h) = F Q F' + Q doubles it again. [K]
    """
    members, n, _ = rates.shape
    if not noise.any():
        return np.zeros((members, n, n))
    size = float(np.abs(rates).sum(axis=2).max()) * seconds
    halvings = max(0, int(np.ceil(np.log2(size / MAX_GAUSS_NORM)))) if size > MAX_GAUSS_NORM else 0
    short = seconds / 2**halvings
    points, weights = GAUSS
    moves = exponential(rates[None] * (0.5 * short * (1.0 + points))[:, None, None, None])
    parts = moves @ noise * np.sqrt(0.5 * short * weights)[:, None, None, None]
    root = lower(np.concatenate(list(parts), axis=2))
    move = exponential(rates * short)
    for _ in range(halvings):
        root = lower(np.concatenate([move @ root, root], axis=2))
        move = move @ move
    return root


def step(rates: Array, noise: Array, seconds: float) -> NoisyStep:
    """Return what a step of some seconds does, of matrices A (members, n, n) [1/s] and noise inputs G (members, n, sources)."""
    return NoisyStep(*responses(rates, seconds), noise_root(rates, noise, seconds))
