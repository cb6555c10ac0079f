"""Unknowns that act together: which combinations of them the readings know, which they do not, and in which words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from thermid.base.errors import quoted
from thermid.base.linear_algebra import RANK_TOLERANCE, null_space, pseudo_inverse
from thermid.base.units import NAMES, Array, short, unit
from thermid.fit._uncertainty.information import Information

SAME_EXPONENT = 1e-3


@dataclass(frozen=True)
class Combination:
    """A combination of parameters that is known although its members are not.

    Parameters
    ----------
    text : str                  As a formula of the paths.
    value, error : float        Its value and standard error. [SI]
    unit : str                  SI unit, where it has a name; empty otherwise.
    meaning : str               What it sets: 'the temperature rise', 'the time constant', 'the rate of warming'; empty otherwise.
    """

    text: str
    value: float
    error: float
    unit: str
    meaning: str = ""

    @property
    def relative(self) -> float:
        """Standard error over value. [-]"""
        return self.error / abs(self.value) if self.value else np.inf

    def __str__(self) -> str:
        """Formula, value and error."""
        unit_text = f" {self.unit}" if self.unit else ""
        meaning = f", which sets {self.meaning}" if self.meaning else ""
        return f"{self.text} = {self.value:.4g}{unit_text} +- {percent(self.relative)}{meaning}"


@dataclass(frozen=True)
class Group:
    """Parameters that cannot be separated, or hardly.

    Parameters
    ----------
    names : tuple of str                The parameters.
    structural : bool                   Whether no log of this kind can separate them; else it is this log that cannot.
    form : str                          'power law', 'sum', 'series' (sum of reciprocals) or 'mixture'.
    moves : tuple of dict               Name -> relative change; such a change of all together changes no reading (structural), or none by
                                        more than its noise allows, all readings taken together (else).
    known : tuple of Combination        What is known of them.
    """

    names: tuple[str, ...]
    structural: bool
    form: str
    moves: tuple[dict[str, float], ...]
    known: tuple[Combination, ...]

    @property
    def pair(self) -> str:
        """'product' or 'ratio' where two parameters act only so; empty otherwise."""
        if not (self.structural and self.form == "power law" and len(self.names) == 2):
            return ""
        first, second = (self.moves[0][n] for n in self.names)
        return "product" if abs(first + second) < SAME_EXPONENT else "ratio" if abs(first - second) < SAME_EXPONENT else ""

    @property
    def acting(self) -> str:
        """How they act, in words; empty where that has none."""
        if self.pair:
            return f"they act only as a {self.pair}"
        return {"sum": "they act only as a sum", "series": "they act only as a sum of reciprocals"}.get(self.form, "")

    def __str__(self) -> str:
        """What cannot be told, and what is known instead, in words."""
        who = quoted(self.names)
        if self.structural and self.acting:
            text = f"{who} cannot be separated; {self.acting}"
        elif self.structural and self.form == "mixture":
            moves = " or ".join(_percents({n: 0.1 * w for n, w in m.items()}) for m in self.moves)
            text = f"{who} cannot be separated: near these values, {moves} together changes no reading"
        elif self.structural:
            text = f"{who} cannot be separated: {' or '.join(together(m, len(self.names)) for m in self.moves)} changes no reading"
        else:
            text = f"{who} can hardly be separated: {' or '.join(_percents(m) for m in self.moves)} stays within the noise"
        return text + (f". Known: {'; '.join(map(str, self.known))}" if self.known else "")

    @staticmethod
    def all_structural(here: Information, there: Information | None) -> tuple[Group, ...]:
        """Return the groups of unknowns of which the readings see combinations only, and unknowns that no reading sees.

        Parameters
        ----------
        here, there : Information   At two sets of values: a law that binds a group holds at both, an accident of the first does not.
        """
        rows = np.concatenate([here.data, here.nuisance])
        length = np.linalg.norm(rows, axis=0)
        dead = np.flatnonzero(length <= 1e-12 * length.max())
        out = [Group((here.names[k],), True, "unseen", ({here.names[k]: 1.0},), ()) for k in dead]
        for at in _blocks(null_space(rows) * length):
            out.append(_structural(here, there or here, at))
        return tuple(out)

    @staticmethod
    def all_practical(info: Information, tell: float) -> tuple[Group, ...]:
        """Return the groups of parameters that this log can hardly separate.

        A parameter belongs to one when its relative error exceeds `tell`, is more than twice what it would be with all others known, and
        goes with that of another (correlation above 0.8).
        """
        covariance = info.covariance()
        error = np.sqrt(np.diag(covariance)) / info.sizes
        loose = [k for k in info.parameters if np.isfinite(error[k]) and error[k] > tell and error[k] > 2.0 * info.alone[k]]
        finite = [k for k in info.parameters if np.isfinite(error[k]) and error[k] > 0]
        scale = np.sqrt(np.where(np.isfinite(np.diag(covariance)), np.diag(covariance), 1.0))
        correlation = covariance / np.outer(scale, scale)
        sets: list[set[int]] = []
        for k in loose:
            mine = {k, *(j for j in finite if j != k and abs(correlation[k, j]) > MIN_GROUP_CORRELATION)}
            touching = [s for s in sets if s & mine]
            sets = [s for s in sets if not s & mine] + [mine.union(*touching)]
        return tuple(_practical(info, sorted(s), covariance, tell) for s in sets if len(s) > 1)


def percent(relative: float) -> str:
    """Return a relative error as a reader takes it in.

    >>> percent(0.00561), percent(0.2), percent(float("inf")), percent(40.0)
    ('0.56 %', '20 %', 'unlimited', 'a factor of 40')
    """
    if not np.isfinite(relative) or relative > 1e4:
        return "unlimited"
    return f"a factor of {short(relative)}" if relative > 3.0 else f"{short(100.0 * relative)} %"


def together(move: dict[str, float], of: int) -> str:
    """Return a change of several parameters, of so many, that changes nothing."""
    if len({round(w, 3) for w in move.values()}) == 1:
        return f"multiplying {'all of them' if len(move) == of else quoted(list(move))} by any one factor"
    return f"changing {', '.join(f'{n} by x^{w:.3g}' for n, w in move.items())} together, with any x,"


def _percents(move: dict[str, float]) -> str:
    """Return relative changes of values in words."""
    return " with ".join(f"{n} {100 * w:+.2g} %" for n, w in move.items())


SHARE, MIN_GROUP_CORRELATION = 0.02, 0.8
ANGLE = 3e-4
"""Two null spaces are one when no direction of the second leans out of the first by more, in relative changes; where a law holds they
agree to rounding."""
FORMS = ("power law", "sum", "series")
MOST_PIVOTS = 300
KINDS_OF: Mapping[str, Mapping[str, float]] = {
    "power": {"W": 1.0},
    "held": {"kg": 1.0, "J/K": 1.0, "J/(kg K)": 1.0},
    "out": {"W/K": 1.0, "W/(m^2 K)": 1.0, "W/(m K)": 1.0, "m^2": 1.0, "K/W": -1.0},
}
MEANINGS: Mapping[tuple[float, ...], str] = {
    (1.0, 0.0, -1.0): "the temperature rise",
    (0.0, 1.0, -1.0): "the time constant",
    (1.0, -1.0, 0.0): "the rate of warming",
    (0.0, 0.0, 1.0): "the heat loss",
}
INNER = tuple(unit(u).dimension for u in ("W/K", "K/W", "W/(m^2 K)", "W/(m K)", "m^2", "m"))


def _blocks(scaled: Array) -> list[list[int]]:
    """Return sets of unknowns that directions (directions, unknowns) tie together: terms above 1e-4 of a direction's largest."""
    sets: list[set[int]] = []
    for direction in scaled:
        mine = set(np.flatnonzero(np.abs(direction) > 1e-4 * np.abs(direction).max()).tolist())
        touching = [s for s in sets if s & mine]
        sets = [s for s in sets if not s & mine] + [mine.union(*touching)]
    return [sorted(s) for s in sets]


def _structural(here: Information, there: Information, at: list[int]) -> Group:
    """Return the group of the unknowns in positions `at`: as a law if it has one at both sets of values, else as a mixture.

    A form of law counts where the null spaces of readings, scaled by it, span the same space at both sets of values to `ANGLE`.
    """
    names = tuple(here.names[k] for k in at)
    part, lasting = (null_space(np.concatenate([i.data, i.nuisance])[:, at]).T for i in (here, there))
    stays = lasting.shape[1] >= part.shape[1]
    plain = _few_terms(part / here.sizes[at, None], lambda _: 0.0)
    moves = tuple({n: float(w / np.abs(v).max()) for n, w in zip(names, v, strict=True) if w} for v in plain)
    for form in FORMS if stays else ():
        scale, other = _scales(here, at, form), _scales(there, at, form)
        if scale is None or other is None:
            continue
        size = np.abs(scale) * here.sizes[at]
        p, q = (np.linalg.qr(x / np.linalg.norm(x, axis=0))[0] for x in (part * (scale / size)[:, None], lasting * (other / size)[:, None]))
        if np.linalg.norm(q - p @ (p.T @ q)) < ANGLE:  # they span the same space
            return Group(names, True, form, moves, _combinations(here, at, part * scale[:, None], form, scale))
    return Group(names, stays, "mixture", moves, ())


def _scales(info: Information, at: list[int], form: str) -> Array | None:
    """Return d coordinate / d fitted form (unknowns,) of the coordinates in which a form is a plain sum; None where it has none."""
    values, slopes = info.values[at], info.slopes[at]
    if form == "sum":
        return slopes
    if (values <= 0).any():
        return None
    return slopes / values if form == "power law" else -slopes / values**2


def _combinations(info: Information, at: list[int], null: Array, form: str, scale: Array) -> tuple[Combination, ...]:
    """Return what is known of a group in the fewest terms: combinations orthogonal to its null space `null` (members, directions).

    Each has one member that no other has. `scale` (members,) is d(term) / d(fitted form) of the `form`.
    """
    u, s, _ = np.linalg.svd(null / np.linalg.norm(null, axis=0), full_matrices=True)
    complement = u[:, int((s > RANK_TOLERANCE).sum()) :]
    if not complement.shape[1]:
        return ()
    covariance = pseudo_inverse(info.rows)[np.ix_(at, at)]

    def variance(weights: Array) -> float:
        """Return the variance of a combination with these weights."""
        gradient = weights * scale
        return float(gradient @ covariance @ gradient)

    hidden = [k for k, place in enumerate(at) if unit(info.unknowns[place].unit).dimension in INNER]
    weights = _few_terms(complement, variance, hidden)
    return tuple(_combination(info, at, w, form, variance(w)) for w in weights)


def _few_terms(complement: Array, variance: Callable[[Array], float], inner: Sequence[int] = ()) -> Array:
    """Return a basis (combinations, unknowns) of a space: the one with the fewest terms, and among these the best known.

    Each combination has one unknown that no other has; rather none of `inner`, so that powers and capacitances stand over conductances.
    Coefficients at a multiple of a half to `SAME_EXPONENT` are put there: they are exponents of products; fewest odd ones come before best
    known.

    Parameters
    ----------
    complement : array (unknowns, combinations)     Any basis of the space.
    variance : callable         Coefficients (unknowns,) -> variance of the combination; the sum over all is least.
    inner : sequence            Places of conductances between nodes.
    """
    d, r = complement.shape
    choices = [*combinations(range(d), r)] if comb(d, r) <= MOST_PIVOTS else [tuple(_independent(complement, r))]
    best: tuple[tuple[float, ...], Array] | None = None
    for pivots in choices:
        block = complement[list(pivots)]
        # the smallest singular value and no determinant: that of many rows is small however independent they are
        if len(choices) > 1 and np.linalg.svd(block, compute_uv=False)[-1] < 1e-9:
            continue
        basis = np.linalg.solve(block.T, complement.T)
        basis = np.where(np.abs(basis) < SAME_EXPONENT, 0.0, basis)
        basis = np.where(np.abs(basis - np.round(2 * basis) / 2) < SAME_EXPONENT, np.round(2 * basis) / 2, basis)
        odd = float(np.sum(np.abs(basis - np.round(basis)) > SAME_EXPONENT))
        key = (float(len(set(pivots) & set(inner))), float(np.count_nonzero(basis)), odd, float(sum(variance(row) for row in basis)))
        if best is None or key < best[0]:
            best = key, np.asarray(basis, dtype=np.float64)
    assert best is not None
    return best[1]


def _independent(complement: Array, count: int) -> list[int]:
    """Return `count` rows of a basis (rows, columns) that are independent, each time the one longest beside those chosen."""
    remaining, out = complement.copy(), list[int]()
    for _ in range(count):
        k = int(np.argmax(np.linalg.norm(remaining, axis=1)))
        out.append(k)
        direction = remaining[k] / np.linalg.norm(remaining[k])
        remaining = remaining - np.outer(remaining @ direction, direction)
    return out


def _combination(info: Information, at: list[int], weights: Array, form: str, variance: float) -> Combination:
    """Return a combination of values [SI] in positions `at` with its error: prod v^w of a power law, sum w / v in series, else sum w v.

    `variance` is that of the logarithm of a power law, of the sum itself else.
    """
    used = [(info.names[k], float(w), float(info.values[k]), info.unknowns[k].unit) for k, w in zip(at, weights, strict=True) if w]
    if form == "power law":
        value = float(np.prod([v**w for _, w, v, _ in used]))
        return Combination(_product(used), value, abs(value) * variance**0.5, _unit(used), _meaning(used))
    if form == "series":
        value = sum(w / v for _, w, v, _ in used)
        return Combination(
            _terms([(f"1/{n}", w) for n, w, _, _ in used]), value, variance**0.5, _unit([(n, -1.0, v, t) for n, _, v, t in used[:1]])
        )
    return Combination(
        _terms([(n, w) for n, w, _, _ in used]),
        sum(w * v for _, w, v, _ in used),
        variance**0.5,
        _unit([(used[0][0], 1.0, 1.0, used[0][3])]),
    )


def _meaning(used: Sequence[tuple[str, float, float, str]]) -> str:
    """Return what a power law of parameters sets in a log, by the kinds of its members: heat in, heat held, heat let out."""
    net = {"power": 0.0, "held": 0.0, "out": 0.0}
    for _, weight, _, text in used:
        for kind, units in KINDS_OF.items():
            for u, sign in units.items():
                net[kind] += sign * weight if unit(text).dimension == unit(u).dimension else 0.0
    signs = tuple(float(np.sign(net[k])) for k in ("power", "held", "out"))
    signs = signs if signs[:2] >= (0.0, 0.0) else tuple(-x for x in signs)
    return MEANINGS.get(signs, "")


def _product(used: Sequence[tuple[str, float, float, str]]) -> str:
    """Return a product of powers as text without its value, such as ``area*htc^0.5/mass``.

    `used` has name, exponent, value and unit of each factor; only name and exponent are read.
    """

    def factor(name: str, power: float) -> str:
        """Return one factor as text."""
        return name if power == 1 else f"{name}^{power:.3g}"

    above = [factor(n, w) for n, w, _, _ in used if w > 0]
    below = [factor(n, -w) for n, w, _, _ in used if w < 0]
    under = f"({'*'.join(below)})" if len(below) > 1 else "".join(below)
    return ("*".join(above) or "1") + (f"/{under}" if below else "")


def _terms(parts: Sequence[tuple[str, float]]) -> str:
    """Return a weighted sum of names as text."""
    text = ""
    for name, weight in parts:
        sign = " - " if weight < 0 else " + "
        size = "" if abs(abs(weight) - 1.0) < SAME_EXPONENT else f"{abs(weight):.3g}*"
        text += f"{sign}{size}{name}"
    return text.removeprefix(" + ").strip()


def _unit(used: Sequence[tuple[str, float, float, str]]) -> str:
    """Return the SI unit of a power law, where it has a name."""
    if any(w != int(w) for _, w, _, _ in used):
        return ""
    parts = [(int(w), unit(text).dimension) for _, w, _, text in used]
    dimension = tuple(sum(w * d[k] for w, d in parts) for k in range(len(parts[0][1])))
    more = ("K", "s", "1/s")
    return next((t for t in (*NAMES, *more) if unit(t).dimension == dimension and t != "1"), "")


def _practical(info: Information, at: list[int], covariance: Array, tell: float) -> Group:
    """Return the group of the unknowns at some places: its weak directions, and the combinations that are known.

    With C = covariance_ij / (size_i size_j) and C v = s^2 v: a direction is a move s v where s exceeds `tell`, a relative error [-].
    Combinations span the directions that are not weak; they are sought where all unknowns are fitted by their logarithms.
    """
    names = tuple(info.names[k] for k in at)
    sizes = info.sizes[at]
    part = covariance[np.ix_(at, at)] / np.outer(sizes, sizes)
    spread, vectors = np.linalg.eigh(part)
    weak = np.sqrt(spread) > min(tell, 0.5 * float(np.sqrt(spread[-1])))
    moves = tuple(
        {n: float(w) for n, w in zip(names, v * s, strict=True)} for v, s in zip(vectors.T, np.sqrt(spread), strict=True) if s > tell
    )
    logs = all(info.unknowns[k].log for k in at)
    combinations: tuple[Combination, ...] = ()
    if logs and not weak.all() and moves:
        weights = _few_terms(vectors[:, ~weak], lambda w: float(w @ part @ w))
        weights = np.round(weights, 2)
        combinations = tuple(_combination(info, at, w, "power law", float(w @ part @ w)) for w in weights)
    return Group(names, False, "power law" if logs else "mixture", moves, combinations)
