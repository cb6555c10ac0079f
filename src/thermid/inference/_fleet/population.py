"""The population of a fleet by restricted likelihood: means, spreads and correlations of what units say, each as a quadratic.

A unit says ``exp(h'd - d'H d / 2)`` of the values d of its parameters about a common reference, H its information, which may be singular:
a short log says little and counts for that. With ``d_i = X_i beta + b_i``, ``b_i ~ N(0, Omega)``, ``Omega = L L'`` and
``A_i = 1 + L'H_i L``, the integral over b_i needs no inverse of H or Omega:

    W_i = H_i - H_i L A_i^-1 L'H_i  (the inverse of H_i^-1 + Omega),   v_i = h_i - H_i L A_i^-1 L'h_i,   S = sum X_i'W_i X_i
    2 ln R = b'S^-1 b + sum h_i'L A_i^-1 L'h_i - sum ln|A_i| - ln|S|,   b = sum X_i'v_i

Restricted likelihood R: Patterson and Thompson, Biometrika 58 (1971) 545; Lindstrom and Bates, J. Am. Stat. Assoc. 83 (1988) 1014. It is
maximised over the entries of L, which may pass zero, by Fisher scoring; a profile holds one spread, or one correlation, and the entries stay
linear in what is free.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from thermid.base.linear_algebra import Array, Bools, symmetric_inverse

EXPECTING, SCORING = 12, 60
"""Steps of expectation and maximisation that begin, and of scoring at most."""
DONE = 1e-7
"""Gain of ln R that a further step would promise, at which scoring ends."""


@dataclass(frozen=True, eq=False)
class Summaries:
    """What units say of their values, and how the means depend on what is known of them.

    Parameters
    ----------
    information : array (units, values, values)     H. [1 / fitted form^2]
    score : array (units, values)                   h, about the reference. [1 / fitted form]
    design : array (units, values, coefficients)    X.
    """

    information: Array
    score: Array
    design: Array

    def without(self, units: list[int]) -> Summaries:
        """Return it without some units."""
        kept = np.setdiff1d(np.arange(len(self.score)), units)
        return Summaries(self.information[kept], self.score[kept], self.design[kept])


def weigh(information: Array, score: Array, root: Array) -> tuple[Array, Array, Array, Array]:
    """Return the Cholesky factor C of A, ``C^-1 L'h``, W and v of units, for a root L of Omega."""
    turned = information @ root
    lower = np.linalg.cholesky(np.eye(root.shape[0]) + root.T @ turned)
    half = np.linalg.solve(lower, np.swapaxes(turned, 1, 2))
    along = np.linalg.solve(lower, (score @ root)[..., None])[..., 0]
    return lower, along, information - np.swapaxes(half, 1, 2) @ half, score - np.einsum("nji,nj->ni", half, along)


@dataclass(frozen=True, eq=False)
class Level:
    """The restricted likelihood at some Omega = L L'.

    Parameters
    ----------
    log : float                         ln R.
    beta, spread : array                Coefficients (coefficients,), and S^-1.
    weights, pushes : array             W (units, values, values) and ``W_i (d_i - X_i beta)`` (units, values).
    carried : array                     W X (units, values, coefficients).
    slope : array (values, values)      Twice the derivative of ln R with respect to Omega.
    """

    log: float
    beta: Array
    spread: Array
    weights: Array
    pushes: Array
    carried: Array
    slope: Array

    @classmethod
    def of(cls, said: Summaries, root: Array) -> Level:
        """Return it for a root L (values, values)."""
        x = said.design
        lower, along, weights, pushed = weigh(said.information, said.score, root)
        carried = weights @ x
        total = np.einsum("nij,nik->jk", x, carried)
        right = np.einsum("nij,ni->j", x, pushed)
        spread = symmetric_inverse(total)
        beta = spread @ right
        pushes = pushed - carried @ beta
        logs = 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum() + np.linalg.slogdet(total)[1]
        slope = pushes.T @ pushes - weights.sum(axis=0) + np.einsum("nij,jk,nlk->il", carried, spread, carried)
        return cls(0.5 * float(right @ beta + np.sum(along**2) - logs), beta, spread, weights, pushes, carried, slope)

    @property
    def outer(self) -> Array:
        """Sum of W x W (values^2, values^2): twice the expected information of Omega, the means taken as known."""
        size = self.weights.shape[1]
        flat = self.weights.reshape(-1, size * size)
        return np.asarray((flat.T @ flat).reshape((size,) * 4).transpose(0, 2, 1, 3).reshape(size * size, size * size))


@dataclass(frozen=True, eq=False)
class Rooms:
    """Which entries of L are free: ``L = base + sum t_m columns_m``, in an order of the values.

    Parameters
    ----------
    order : array (values,)                     Position of each row of L among the values.
    base : array (values, values)
    columns : array (free, values, values)
    """

    order: Array
    base: Array
    columns: Array

    @classmethod
    def of(cls, together: Bools, first: tuple[int, ...] = (), held: float | None = None) -> Rooms:
        """Return it; `first` names one value whose spread is held, or two whose correlation is.

        `together` (values, values) says which values may be correlated; all, or none.
        """
        size = together.shape[0]
        order = np.array([*first, *(k for k in range(size) if k not in first)])
        base, columns = np.zeros((size, size)), []
        for i in range(size):
            for j in range(i + 1):
                if i != j and not together[order[i], order[j]]:
                    continue
                if held is not None and (i, j) == (0, 0) and len(first) == 1:
                    base[0, 0] = held
                    continue
                one = np.zeros((size, size))
                one[i, j] = 1.0
                if held is not None and len(first) == 2 and i == 1:
                    if j == 1:
                        continue
                    one[1, :2] = held, np.sqrt(1.0 - held**2)
                columns.append(one)
        return cls(order, base, np.array(columns).reshape(-1, size, size))

    def start(self, omega: Array) -> Array:
        """Return t near some Omega."""
        size = omega.shape[0]
        there = omega[np.ix_(self.order, self.order)]
        lower = np.linalg.cholesky(there + 1e-12 * np.diag(np.diag(there)) + 1e-300 * np.eye(size))
        flat = self.columns.reshape(len(self.columns), -1)
        return np.asarray(np.linalg.lstsq(flat.T, (lower - self.base).ravel(), rcond=None)[0])

    def root(self, t: Array) -> Array:
        """Return L with its rows in the order of the values."""
        out = np.zeros_like(self.base)
        out[self.order] = self.base + np.tensordot(t, self.columns, 1)
        return out

    @cached_property
    def placed(self) -> Array:
        """The columns with their rows in the order of the values (free, values, values)."""
        out = np.zeros_like(self.columns)
        out[:, self.order] = self.columns
        return out


@dataclass(frozen=True, eq=False)
class Population:
    """The population that is likeliest: coefficients of the means, and Omega.

    Parameters
    ----------
    said : Summaries
    together : array (values, values)   Which values may be correlated.
    omega : array (values, values)      Covariance of units about their means, in the fitted form.
    at : Level                          The restricted likelihood there.
    """

    said: Summaries
    together: Bools
    omega: Array
    at: Level = field(repr=False)

    @classmethod
    def fitted(cls, said: Summaries, together: Bools, near: Array | None = None) -> Population:
        """Return it; `near` is an Omega to begin at."""
        omega = _begun(said, together) if near is None else near
        omega, at = maximise(said, Rooms.of(together), omega)
        return cls(said, together, omega, at)

    @property
    def sizes(self) -> Array:
        """Spreads (values,), in the fitted form."""
        return np.sqrt(np.diag(self.omega))

    def rise(self, first: tuple[int, ...], held: float, near: Array | None = None) -> tuple[float, Array]:
        """Return by how much 2 ln R falls where one spread, or the correlation of two values, is held; and Omega there."""
        omega, at = maximise(self.said, Rooms.of(self.together, first, held), self.omega if near is None else near)
        return 2.0 * (self.at.log - at.log), omega

    def without(self, units: list[int]) -> Population:
        """Return the population without some units."""
        return Population.fitted(self.said.without(units), self.together, self.omega)

    @cached_property
    def _elements(self) -> Array:
        """The free entries of Omega as symmetric matrices (entries, values, values)."""
        out = []
        for i, j in zip(*np.tril_indices(len(self.omega)), strict=True):
            if self.together[i, j] or i == j:
                one = np.zeros_like(self.omega)
                one[i, j] = one[j, i] = 1.0
                out.append(one)
        return np.array(out)

    @cached_property
    def _moved(self) -> Array:
        """What each entry of Omega does to S (entries, coefficients, coefficients): minus its derivative."""
        return np.einsum("nia,eij,njb->eab", self.at.carried, self._elements, self.at.carried, optimize=True)

    @cached_property
    def of_omega(self) -> Array:
        """Covariance (entries, entries) of the entries of Omega, by the expected information of the restricted likelihood.

        tr(P D P D') / 2 with ``P = W - W X S^-1 X'W`` over all units, which are not independent in it.
        """
        at, basis = self.at, self._elements.reshape(len(self._elements), -1)
        size = len(self.omega)
        shared = np.einsum("nia,ab,njb->nij", at.carried, at.spread, at.carried, optimize=True).reshape(-1, size * size)
        cross = (at.weights.reshape(-1, size * size).T @ shared).reshape((size,) * 4).transpose(0, 2, 1, 3).reshape(size**2, size**2)
        kernel = at.outer - cross - cross.T
        between = np.einsum("ab,ebc,cd,fda->ef", at.spread, self._moved, at.spread, self._moved, optimize=True)
        return symmetric_inverse(0.5 * (basis @ kernel @ basis.T + between))

    def freedom_of_spread(self, k: int) -> float:
        """Return the degrees of freedom of a spread: 2 Omega_kk^2 / var(Omega_kk) (Satterthwaite, Biometrics Bull. 2 (1946) 110)."""
        row = self._elements[:, k, k]
        return float(2.0 * self.omega[k, k] ** 2 / max(row @ self.of_omega @ row, 1e-300))

    def freedom_of_mean(self, c: Array) -> float:
        """Return the degrees of freedom of a combination c of coefficients (Giesbrecht and Burns, Biometrics 41 (1985) 477)."""
        along = self.at.spread @ c
        change = np.einsum("a,eab,b->e", along, self._moved, along)
        return float(2.0 * (c @ along) ** 2 / max(change @ self.of_omega @ change, 1e-300))

    def errors_of_pushes(self) -> Array:
        """Return the standard deviations (units, values) of ``W_i (d_i - X_i beta)``."""
        at = self.at
        variance = np.diagonal(at.weights, axis1=1, axis2=2) - np.einsum("nia,ab,nib->ni", at.carried, at.spread, at.carried)
        return np.sqrt(np.maximum(variance, 0.0))


def _begun(said: Summaries, together: Bools) -> Array:
    """Return an Omega (values, values) to begin at: how far what units say is apart, and steps of expectation and maximisation from there.

    A step is ``Omega + Omega slope Omega / units``; it never lowers R.
    """
    size = said.score.shape[1]
    seen = np.diagonal(said.information, axis1=1, axis2=2)
    apart = np.divide(said.score, seen, out=np.zeros_like(seen), where=seen > 0.0)
    middle = np.sum(seen * apart, axis=0) / np.maximum(seen.sum(axis=0), 1e-300)
    weight = np.minimum(seen, np.quantile(seen, 0.75, axis=0))
    wide = np.sum(weight * (apart - middle) ** 2, axis=0) / np.maximum(weight.sum(axis=0), 1e-300)
    omega = np.diag(np.maximum(wide, 1e-8 * np.maximum(wide.max(), 1e-300))) * np.eye(size)
    for _ in range(EXPECTING):
        step = omega @ Level.of(said, np.asarray(np.linalg.cholesky(omega))).slope @ omega / len(said.score)
        omega = omega + np.where(together | np.eye(size, dtype=bool), step, 0.0)
    return np.asarray(omega)


def maximise(said: Summaries, rooms: Rooms, omega: Array) -> tuple[Array, Level]:
    """Return the Omega of largest restricted likelihood among those that `rooms` allows, and the level there.

    Fisher scoring over the free entries of L, damped as by Levenberg and Marquardt.
    """
    t = rooms.start(omega)
    root = rooms.root(t)
    at, damping = Level.of(said, root), 1e-4
    size = root.shape[0]
    for _ in range(SCORING):
        gradient = np.einsum("mij,ij->m", rooms.placed, at.slope @ root)
        turned = np.einsum("mik,jk->mij", rooms.placed, root)
        change = (turned + np.swapaxes(turned, 1, 2)).reshape(len(t), size * size)
        information = 0.5 * change @ at.outer @ change.T
        scale = np.diag(information) + 1e-12 * np.diag(information).max(initial=1e-300)
        while True:
            step = np.linalg.solve(information + np.diag(damping * scale), gradient)
            there = Level.of(said, rooms.root(t + step))
            if there.log >= at.log or damping > 1e8:
                break
            damping *= 8.0
        gain = there.log - at.log
        if gain <= 0.0:
            break
        t, at, damping = t + step, there, max(damping / 8.0, 1e-10)
        root = rooms.root(t)
        if 0.5 * float(gradient @ step) < DONE and gain < DONE:
            break
    return root @ root.T, at
