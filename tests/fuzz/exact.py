"""The solution of a linear network in eighty digits: massless nodes eliminated, eigenvalues by Jacobi rotations, one term a mode.

Golub and Van Loan, Matrix Computations, 4th ed., section 8.5. Eighty digits leave nothing to rounding where capacitances and conductances
lie twenty-four orders of magnitude apart.
"""

from __future__ import annotations

from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext
from itertools import pairwise

import numpy as np

from thermid import _kernel as k
from unit.kernel.reference import Net

DIGITS = 80
SMALL = Decimal("1e-25")
Matrix = list[list[Decimal]]
ZERO, ONE = Decimal(0), Decimal(1)


class UndefinedError(Exception):
    """A massless node with no conductance has no temperature."""


def is_linear(net: Net) -> bool:
    """Whether the exact solution holds: conductances that do not change, inputs constant or samples, nothing negative."""
    rows = all(row[0] == k.LINEAR and net.coefs[row[3][0]][1] < 0 for row in net.conductors) and all(r[0] == k.SIGNAL for r in net.loads)
    numbers = [*net.values, *net.start, *(v for _, a, b in net.inputs for v in (*a, *b))]
    positive = all(net.coefs[row[3][0]][0] >= 0 for row in net.conductors) and all(j < 0 or net.values[j] >= 0 for j in net.capacity)
    return rows and positive and bool(np.isfinite(numbers).all()) and all(kind != k.SINE for kind, _, _ in net.inputs)


def solve(net: Net, times: np.ndarray) -> np.ndarray:
    """Return the temperatures (times, nodes) of a linear network. [K]"""
    with localcontext(Context(prec=DIGITS, Emax=MAX_EMAX, Emin=MIN_EMIN, traps=[])):
        return _solve(net, times)


def _solve(net: Net, times: np.ndarray) -> np.ndarray:
    n = len(net.capacity)
    capacity = [Decimal(c) for c in net.capacities().tolist()]
    massive, massless = [i for i in range(n) if capacity[i] > 0], [i for i in range(n) if capacity[i] == 0]
    g: Matrix = [[ZERO] * n for _ in range(n)]
    edge: Matrix = [[ZERO] * len(net.boundaries) for _ in range(n)]
    for _, a, b, slots, _ in net.conductors:
        value = Decimal(net.coefs[slots[0]][0])
        for one, other in ((a, b), (b, a)):
            if one >= 0:
                g[one][one] += value
                if other >= 0:
                    g[one][other] -= value
                else:
                    edge[one][-other - 1] += value
    inner = _Massless(g, massive, massless)
    modes = _Modes(inner.reduced, [capacity[i] for i in massive])
    breaks = sorted({float(t) for _, a, b in net.inputs if len(b) for t in a} | {float(times[0]), float(times[-1])})
    breaks = [t for t in breaks if times[0] <= t <= times[-1]]
    out = np.empty((times.size, n))
    state = [Decimal(net.start[i]) for i in massive]
    for begin, end in [*pairwise(breaks), (breaks[-1], breaks[-1])]:
        inside = [j for j in range(times.size) if begin <= times[j] < end or times[j] == begin == end]
        first, slope = _forcing(net, edge, begin, end)
        push, rate = inner.forcing(first), inner.forcing(slope)
        for j in inside:
            after = Decimal(float(times[j])) - Decimal(begin)
            now = modes.after(state, push, rate, after)
            every = inner.everything(now, [f + r * after for f, r in zip(first, slope, strict=True)])
            out[j] = [float(v) for v in every]
        state = modes.after(state, push, rate, Decimal(end) - Decimal(begin))
    return out


def _forcing(net: Net, edge: Matrix, begin: float, end: float) -> tuple[list[Decimal], list[Decimal]]:
    """Return the heat of boundaries and loads into each node at the beginning of a piece, and its slope."""
    length = Decimal(end) - Decimal(begin)

    def signal(j: int) -> tuple[Decimal, Decimal]:
        value, u = Decimal(net.coefs[j][0]), net.coefs[j][1]
        if u < 0:
            return value, ZERO
        kind, a, b = net.inputs[u]
        if kind != k.SAMPLED_LINEAR or not length or begin >= a[-1] or end <= a[0]:
            return value * Decimal(net.signal(u, begin)), ZERO
        low = max(int(np.searchsorted(a, begin, side="right")) - 1, 0)
        step = (Decimal(b[low + 1]) - Decimal(b[low])) / (Decimal(a[low + 1]) - Decimal(a[low]))
        return value * (Decimal(b[low]) + step * (Decimal(begin) - Decimal(a[low]))), value * step

    ends = [[signal(j) for j in pair if j >= 0] for pair in net.boundaries]
    first, slope = (
        [sum((e * sum((s[part] for s in given), ZERO) for e, given in zip(row, ends, strict=True)), ZERO) for row in edge]
        for part in (0, 1)
    )
    for _, node, slots, _, _ in net.loads:
        power = signal(slots[0])
        first[node] += power[0]
        slope[node] += power[1]
    return first, slope


class _Massless:
    """Elimination of nodes without capacitance: what they weigh in the others' balance, and their own temperatures."""

    def __init__(self, g: Matrix, massive: list[int], massless: list[int]) -> None:
        self.massive, self.massless, self.n = massive, massless, len(g)
        size = len(massless)
        block = [[g[i][j] for j in massless] + [-g[i][j] for j in massive] + [ONE if i == j else ZERO for j in massless] for i in massless]
        _eliminate(block, size)
        self.weights = [row[size : size + len(massive)] for row in block]
        self.inverse = [row[size + len(massive) :] for row in block]
        self.back = [[g[i][j] for j in massless] for i in massive]
        self.reduced = [
            [g[i][j] + sum((self.back[r][m] * self.weights[m][c] for m in range(size)), ZERO) for c, j in enumerate(massive)]
            for r, i in enumerate(massive)
        ]

    def _own(self, heat: list[Decimal]) -> list[Decimal]:
        return [sum((w * heat[i] for w, i in zip(row, self.massless, strict=True)), ZERO) for row in self.inverse]

    def forcing(self, heat: list[Decimal]) -> list[Decimal]:
        own = self._own(heat)
        return [heat[i] - sum((b * o for b, o in zip(row, own, strict=True)), ZERO) for i, row in zip(self.massive, self.back, strict=True)]

    def everything(self, state: list[Decimal], heat: list[Decimal]) -> list[Decimal]:
        out = [ZERO] * self.n
        for i, value in zip(self.massive, state, strict=True):
            out[i] = value
        for i, row, own in zip(self.massless, self.weights, self._own(heat), strict=True):
            out[i] = own + sum((w * v for w, v in zip(row, state, strict=True)), ZERO)
        return out


def _eliminate(block: Matrix, size: int) -> None:
    """Turn the first columns of a symmetric block into the identity."""
    for c in range(size):
        pivot = max(range(c, size), key=lambda r: abs(block[r][c]))
        scale = max((abs(v) for v in block[pivot]), default=ZERO)
        if abs(block[pivot][c]) <= Decimal("1e-60") * scale:
            raise UndefinedError
        block[c], block[pivot] = block[pivot], block[c]
        block[c] = [v / block[c][c] for v in block[c]]
        for r in range(size):
            if r != c and block[r][c]:
                factor = block[r][c]
                block[r] = [v - factor * w for v, w in zip(block[r], block[c], strict=True)]


class _Modes:
    """Modes of a symmetric network: each decays by itself under a heat that is a straight line in time."""

    def __init__(self, g: Matrix, capacity: list[Decimal]) -> None:
        self.roots = [c.sqrt() for c in capacity]
        a = [[v / (self.roots[i] * self.roots[j]) for j, v in enumerate(row)] for i, row in enumerate(g)]
        self.vectors = _jacobi(a)
        self.rates = [max(a[i][i], ZERO) for i in range(len(a))]

    def _into(self, values: list[Decimal]) -> list[Decimal]:
        return [sum((self.vectors[i][m] * values[i] for i in range(len(values))), ZERO) for m in range(len(values))]

    def after(self, state: list[Decimal], push: list[Decimal], slope: list[Decimal], time: Decimal) -> list[Decimal]:
        z = self._into([s * r for s, r in zip(state, self.roots, strict=True)])
        p = self._into([s / r for s, r in zip(push, self.roots, strict=True)])
        q = self._into([s / r for s, r in zip(slope, self.roots, strict=True)])
        out = []
        for zi, pi, qi, rate in zip(z, p, q, self.rates, strict=True):
            x = rate * time
            decay = (-x).exp()
            one = time * (ONE - x / 2 + x * x / 6) if x < SMALL else (ONE - decay) / rate
            two = time * time * (ONE / 2 - x / 6 + x * x / 24) if x < SMALL else (time - one) / rate
            out.append(decay * zi + one * pi + two * qi)
        return [sum((self.vectors[i][m] * out[m] for m in range(len(out))), ZERO) / self.roots[i] for i in range(len(out))]


def _jacobi(a: Matrix) -> Matrix:
    """Diagonalise a symmetric matrix in place and return its vectors as columns."""
    n = len(a)
    v = [[ONE if i == j else ZERO for j in range(n)] for i in range(n)]
    noise = Decimal("1e-79") * max((abs(x) for row in a for x in row), default=ZERO)
    for _ in range(60):
        rotated = False
        for p in range(n):
            for q in range(p + 1, n):
                # relative to both diagonals, so that small eigenvalues beside large ones keep their digits
                if abs(a[p][q]) <= max(noise, Decimal("1e-75") * (abs(a[p][p]) * abs(a[q][q])).sqrt()):
                    continue
                rotated = True
                theta = (a[q][q] - a[p][p]) / (2 * a[p][q])
                t = (1 if theta >= 0 else -1) / (abs(theta) + (theta * theta + 1).sqrt())
                c = 1 / (t * t + 1).sqrt()
                s = t * c
                for row in (*a, *v):
                    row[p], row[q] = c * row[p] - s * row[q], s * row[p] + c * row[q]
                a[p], a[q] = (
                    [c * x - s * y for x, y in zip(a[p], a[q], strict=True)],
                    [s * x + c * y for x, y in zip(a[p], a[q], strict=True)],
                )
        if not rotated:
            break
    return v
