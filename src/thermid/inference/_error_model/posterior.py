"""Posterior of the shared unknowns of several runs, averaged over sizes: Gram matrices in, weights, means and roots of members out.

Unknowns of one run alone are integrated out run by run. With the rows of a run ``[A_s A_o]`` for shared and own unknowns in units of their
priors, ``M_o = I + A_o'A_o``, what the run says of the shared ones is ``A_s'(I + A_o A_o')^-1 A_s = A_s'A_s - A_s'A_o M_o^-1 A_o'A_s``
(Woodbury), and its ``ln det`` grows by ``ln |M_o|``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thermid.base.linear_algebra import Array
from thermid.inference._error_model.gaussian import WhiteRows


@dataclass(frozen=True, eq=False)
class RunRows:
    """What a run says of shared unknowns and of its own: products of its white rows.

    Parameters
    ----------
    gram : array (s + o + 1, s + o + 1)     ``[H y]'[H y]``, shared unknowns first, then those of the run, then the readings.
    shared : int                            s.
    log_det : float                         Of the covariance by which the rows were made white.
    count : int                             Readings.
    """

    gram: Array
    shared: int
    log_det: float
    count: int

    @classmethod
    def of(cls, rows: WhiteRows, shared: int) -> RunRows:
        """Return the products of white rows."""
        upper = np.column_stack([rows.triangle, rows.rotated])
        gram = upper.T @ upper
        gram[-1, -1] += rows.rest
        return cls(gram, shared, rows.log_det, rows.count)

    def without_own(self, sizes: Array) -> tuple[Array, Array]:
        """Return the products of shared unknowns and readings with the run's own integrated out, and ln |M_o|, for members of sizes.

        Parameters
        ----------
        sizes : array (members, o)  Standard deviations of the run's own unknowns.
        """
        keep = [*range(self.shared), self.gram.shape[0] - 1]
        own = slice(self.shared, self.gram.shape[0] - 1)
        base = np.broadcast_to(self.gram[np.ix_(keep, keep)], (len(sizes), len(keep), len(keep)))
        if not sizes.shape[1]:
            return base, np.zeros(len(sizes))
        inner = np.eye(sizes.shape[1]) + sizes[:, :, None] * self.gram[own, own] * sizes[:, None, :]
        lower = np.linalg.cholesky(inner)
        across = np.linalg.solve(lower, sizes[:, :, None] * self.gram[own][:, keep])
        grown = 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
        return base - np.swapaxes(across, 1, 2) @ across, grown


@dataclass(frozen=True, eq=False)
class Members:
    """Posteriors of shared unknowns at sets of sizes.

    Parameters
    ----------
    log_evidence : array (members,)
    mean : array (members, s)
    root : array (members, s, s)        Roots of the covariances, ``A A'``.
    square : array (members,)           ``y' S^-1 y`` of the readings over a reading, S their covariance before they were read; one is
                                        what it is where the model of error is right. [-]
    """

    log_evidence: Array
    mean: Array
    root: Array
    square: Array


def members_of(runs: Sequence[RunRows], centre: Array, sizes: Array, own: Sequence[Array]) -> Members:
    """Return the posteriors of the shared unknowns at members of sizes.

    Parameters
    ----------
    centre : array (s,)                     Mean of their prior.
    sizes : array (members, s)              Standard deviations of their prior.
    own : sequence of array (members, o)    The same of the unknowns of each run.
    """
    count, s = sizes.shape
    total, log_det, readings = np.zeros((count, s + 1, s + 1)), np.zeros(count), 0
    for run, each in zip(runs, own, strict=True):
        gram, grown = run.without_own(each)
        total = total + gram
        log_det += grown + run.log_det
        readings += run.count
    inner, cross, square = total[:, :s, :s], total[:, :s, s], total[:, s, s]
    cross = cross - inner @ centre
    square = square - 2.0 * total[:, :s, s] @ centre + np.einsum("i,mij,j->m", centre, inner, centre)
    lower = np.linalg.cholesky(np.eye(s) + sizes[:, :, None] * inner * sizes[:, None, :])
    half = np.linalg.solve(lower, (sizes * cross)[:, :, None])[:, :, 0]
    inverse = np.linalg.inv(lower)
    root = sizes[:, :, None] * np.swapaxes(inverse, 1, 2)
    mean = centre + (root @ half[:, :, None])[:, :, 0]
    log_det += 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
    square = square - np.sum(half**2, axis=1)
    evidence = -0.5 * (square + log_det + readings * np.log(2.0 * np.pi))
    return Members(evidence, mean, root, square / max(readings, 1))
