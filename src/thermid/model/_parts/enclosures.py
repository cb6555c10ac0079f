"""Enclosures: from the tables of a deck to one radiating pair for every two faces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError, refuse_first
from thermid.base.units import STEFAN_BOLTZMANN, Array, Memo, Number, gradient_of, value_of, values_of
from thermid.model._parts.elements import Enclosure, Law, Surface, Take, exposed_area
from thermid.physics.enclosure import absorbing_areas, check_view_factors, exchange_areas_of
from thermid.physics.view_factors import SHAPES

SAME_AREA: Final = 0.01
"""Largest relative difference of a surface's area and that of the face of a shape which it fills. [-]"""


@dataclass(frozen=True)
class Face:
    """A surface as the face of an enclosure: its name there, its path, what it is, its node and what joints take from it."""

    name: str
    path: str
    surface: Surface
    node: str
    takes: tuple[Take, ...]


@dataclass(frozen=True, eq=False)
class Pair:
    """Two faces that exchange heat: path, the two nodes, the parameters of all faces (path -> path), and the law that follows."""

    path: str
    ends: tuple[str, str]
    fields: Mapping[str, str]
    recipe: Callable[[Mapping[str, Any]], Law]


def enclosure_to(enclosure: Enclosure) -> dict[str, Any]:
    """Return the table of a deck."""
    out: dict[str, Any] = {"faces": dict(enclosure.faces)}
    if enclosure.shape:
        out |= {"shape": enclosure.shape, "dimensions": {n: f"{d!r} [m]" for n, d in enclosure.dimensions.items()}}
    for name in ("view_factors", "exchange_factors"):
        if getattr(enclosure, name):
            out[name] = [list(row) for row in getattr(enclosure, name)]
    return out | ({"rest": enclosure.rest} if enclosure.rest else {})


_Matrix = Callable[[list[Number], list[Number]], list[list[Number]]]


def _memorised(memo: Memo, areas: list[Number], shares: list[Number], law: _Matrix) -> list[list[Number]]:
    """Return law(areas, shares), a matrix (faces, faces), from `memo` if these values were asked for just before.

    Areas and shares (faces,) are floats, numbers with derivatives, or arrays over members; members are taken one after the other.
    """
    numbers: tuple[Any, ...] = (*areas, *shares)
    many: Any = next((x for x in numbers if hasattr(x, "values")), None)
    if many is not None:
        sets = np.array([np.broadcast_to(getattr(x, "values", x), many.values.shape) for x in numbers]).T
        split = len(areas)
        matrices = memo.value(sets.tobytes(), lambda: np.array([law(m[:split], m[split:]) for m in sets.tolist()]).transpose(1, 2, 0), 1)
        return [[type(many)(np.ascontiguousarray(one)) for one in row] for row in matrices]
    free = max((gradient_of(x, 0).size for x in numbers), default=0)
    key = np.concatenate([[value_of(x), *gradient_of(x, free)] for x in numbers]).tobytes()
    return memo.value(key, lambda: law(areas, shares), 1)


@dataclass(frozen=True, eq=False)
class FaceExchange:
    """The exchange areas of an enclosure by its faces' values; the latest are kept, since every pair of faces asks for them."""

    path: str
    enclosure: Enclosure
    faces: Sequence[Face]
    rest: bool
    where: str
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)
    suns: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def at(self, values: Mapping[str, Number]) -> list[list[Number]]:
        """Return the exchange areas (faces, faces), the rest as a last face: face i gives face j sigma S[i][j] (T_i^4 - T_j^4). [m^2]"""
        areas = [exposed_area(f.path, values[f"{f.path}.area"], f.takes, values, self.where) for f in self.faces]
        grey = [values[f"{f.path}.emissivity"] for f in self.faces]
        return _memorised(self.memo, areas, grey, self._exchange_areas)

    def absorbed(self, values: Mapping[str, Number]) -> list[list[Number]]:
        """Return S (faces, faces), the rest as a last row: face i absorbs S[i][j] q of a solar flux q [W/m^2] that falls on face j. [m^2]

        Raises
        ------
        DeckError   When an absorptance is none, or only exchange factors are given, which hold no reflections of the sun.
        """
        areas = [exposed_area(f.path, values[f"{f.path}.area"], f.takes, values, self.where) for f in self.faces]
        dark = [values[f"{f.path}.absorptance"] for f in self.faces]
        return _memorised(self.suns, areas, dark, self._absorbed)

    def _absorbed(self, areas: list[Number], dark: list[Number]) -> list[list[Number]]:
        """Return the matrix of `absorbed` for free areas [m^2] and absorptances [-] of the faces."""
        if self.enclosure.exchange_factors:
            raise DeckError(
                f"what the sun leaves in '{self.path}' is reflected by view factors, and it has exchange factors, which hold those of heat "
                "alone. Give view_factors, a shape or places.",
                self.where,
                code="value.contradicts",
            )
        size, names = values_of(areas), [f.name for f in self.faces]
        factors, sized, areas = self._factors(size, names, areas)
        check_view_factors(factors, sized, names, self.where, closed=not self.rest)
        if not self.rest and all(value_of(a) == 0.0 for a in dark):
            raise DeckError(
                f"no face of '{self.path}' absorbs, so the sun in it goes round for ever. Give one an absorptance.",
                self.where,
                code="value.contradicts",
            )
        out = absorbing_areas(factors, areas, dark)
        if self.rest:
            first = [sum((row[k] for row in out), 0.0 * out[0][k]) for k in range(len(areas))]
            out.append([area - taken for area, taken in zip(areas, first, strict=True)])
        return out

    def _factors(self, size: Array, names: list[str], areas: list[Number]) -> tuple[Array, Array, list[Number]]:
        """Return the view factors F_ij (faces, faces) [-], the areas (faces,) that they are of [m^2], and these with derivatives.

        Of a shape they are computed, and its own areas replace `size` (faces,), those of the deck.
        """
        if not self.enclosure.shape:
            return np.array(self.enclosure.view_factors), size, areas
        factors, size = self._of_shape(size, names)
        return factors, size, list(size.tolist())

    def _exchange_areas(self, areas: list[Number], grey: list[Number]) -> list[list[Number]]:
        """Return the matrix of `at` for free areas [m^2] and emissivities [-] of the faces."""
        for face, number in zip(self.faces, grey, strict=True):
            if not 0.0 < value_of(number) <= 1.0:
                raise DeckError(
                    f"the emissivity of '{face.path}' is {value_of(number):g}. In an enclosure it must be above 0, up to 1.",
                    self.where,
                    code="value.outside-range",
                )
        size = values_of(areas)
        names = [f.name for f in self.faces]
        if self.enclosure.exchange_factors:
            # exchange areas (A_i F_ij + A_j F_ji) / 2 from exchange factors F, whose directions must agree [m^2]
            factors, places = np.array(self.enclosure.exchange_factors), range(len(names))
            check_view_factors(factors - np.diag(np.diag(factors)), size, names, self.where, closed=False)
            return [[0.5 * (areas[i] * factors[i, j] + areas[j] * factors[j, i]) for j in places] for i in places]
        factors, size, areas = self._factors(size, names, areas)
        check_view_factors(factors, size, names, self.where, closed=not self.rest)
        if self.rest:
            lost = np.maximum(1.0 - factors.sum(axis=1), 0.0)
            opening = float(lost @ size)
            back = lost * size / opening if opening > 0.0 else 0.0 * lost
            factors = np.block([[factors, lost[:, None]], [back[None, :], np.zeros((1, 1))]])
            areas, grey = [*areas, opening or 1.0], [*grey, 1.0]  # a black face sends only what it emits
        return exchange_areas_of(factors, areas, grey)

    def _of_shape(self, size: Array, names: list[str]) -> tuple[Array, Array]:
        """Return the view factors (faces, faces) [-] of the faces that are there, and their areas (faces,) [m^2] by its dimensions.

        Parameters
        ----------
        size : array (faces,)   Areas of the surfaces. [m^2]
        names : list            Faces of the shape that they are.

        Raises
        ------
        DeckError   When the area of a surface differs from that of its face by more than `SAME_AREA`.
        """
        shape = SHAPES[self.enclosure.shape]
        geometric, factors = shape.factors(self.enclosure.dimensions)
        at = [shape.faces.index(n) for n in names]
        for face, area, wanted in zip(self.faces, size, geometric[at], strict=True):
            if abs(area - wanted) > SAME_AREA * wanted:
                raise DeckError(
                    f"the surface '{face.path}' has {area * 1e4:.6g} cm^2 free, but the face '{face.name}' has {wanted * 1e4:.6g} cm^2. "
                    "Correct the area or a dimension, or give view factors.",
                    self.where,
                    code="value.contradicts",
                )
        return factors[np.ix_(at, at)], geometric[at]


def _pair_law(exchange: FaceExchange, first: int, second: int, values: Mapping[str, Any]) -> Law:
    """Return the radiation between two faces, sigma S[first][second] [W/K^4], at values, path -> value [SI]."""
    return Law("radiation", (STEFAN_BOLTZMANN * exchange.at(values)[first][second],), "radiation")


@dataclass(frozen=True, eq=False)
class SunShare:
    """Entry (`to`, `first`) of `FaceExchange.absorbed`: what face `to` absorbs of the sun on face `first`. [m^2]"""

    exchange: FaceExchange
    to: int
    first: int

    def __call__(self, values: Mapping[str, Any]) -> Number:
        """Return the entry at values, path -> value [SI]. [m^2]"""
        return self.exchange.absorbed(values)[self.to][self.first]


@dataclass(frozen=True, eq=False)
class Enclosed:
    """A surface in its enclosure: its place among the faces, the enclosure's faces, and the node of the rest, empty without one."""

    place: int
    exchange: FaceExchange
    rest: str

    def targets(self) -> list[tuple[str, str, SunShare]]:
        """Return (name, node, `SunShare`) of everything that absorbs the sun which falls on it: itself first, other faces, the rest."""
        faces = [(f.name, f.node) for f in self.exchange.faces] + ([("rest", self.rest)] if self.rest else [])
        order = [self.place, *(k for k in range(len(faces)) if k != self.place)]
        return [(*faces[k], SunShare(self.exchange, k, self.place)) for k in order]

    def fields(self) -> dict[str, str]:
        """Return the parameters that its absorbed areas depend on, path -> path: area, absorptance and joints' areas of every face.

        Raises
        ------
        DeckError   When a face has no absorptance.
        """
        out: dict[str, str] = {}
        for face in self.exchange.faces:
            if "absorptance" not in face.surface.fields:
                path = self.exchange.faces[self.place].path
                raise DeckError(
                    f"'{path}' is in the sun and reflects it to '{face.path}' in '{self.exchange.path}', which has no absorptance. "
                    "Give it one; 1 for a black face.",
                    self.exchange.where,
                    code="model.view-factors",
                )
            out |= {p: p for p in (f"{face.path}.area", f"{face.path}.absorptance", *(t.path for t in face.takes))}
        return out


def pairs(exchange: FaceExchange, rest: str) -> list[Pair]:
    """Return one `Pair` for every two faces of different nodes of an enclosure, the rest as a last face.

    Parameters
    ----------
    exchange : FaceExchange     Its faces.
    rest : str              The node of the rest; empty without one.

    Raises
    ------
    DeckError   When a face is no surface with an emissivity of its own.
    """
    path, faces, where = exchange.path, exchange.faces, exchange.where
    for face in faces:
        why = "its effective_htc includes radiation already" if face.surface.is_effective else "it has no emissivity"
        refuse_first(
            lambda _: where,
            (
                face.surface.is_effective or "emissivity" not in face.surface.fields,
                f"'{face.path}' cannot be a face of '{path}': {why}. Give it htc and emissivity.",
                "",
                "value.contradicts",
            ),
            (
                face.surface.sees,
                f"'{face.path}' radiates to '{face.surface.sees}' and in the enclosure '{path}', so its radiation would "
                "count twice. Leave sees out.",
                "",
                "value.contradicts",
            ),
        )
    fields = {p: p for f in faces for p in (f"{f.path}.area", f"{f.path}.emissivity", *(t.path for t in f.takes))}
    nodes = [(f.name, f.node) for f in faces] + ([("rest", rest)] if rest else [])
    return [
        Pair(f"{path}.{second}.{first}", (b, a), fields, partial(_pair_law, exchange, j, i))
        for i, (first, a) in enumerate(nodes)
        for j, (second, b) in enumerate(nodes[:i])
        if a != b
    ]
