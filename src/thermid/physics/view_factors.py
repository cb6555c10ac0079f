"""View factors of a few shapes: facing plates and discs, plates at an edge, the inside of a box, a cylinder in a cylinder.

Numbers are those of J. R. Howell, M. P. Menguc and R. Siegel, Thermal Radiation Heat Transfer, 6th ed., appendix C (configurations C-11,
C-14, C-41, C-91, C-92 there and in Howell's catalogue). A view factor from i to j is the share of what leaves i that strikes j directly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import DeckError
from thermid.base.units import Array


def facing_plates(length: float, width: float, distance: float) -> float:
    """View factor between two equal rectangles that face each other. [-]

    With X = length / distance, Y = width / distance: 2 / (pi X Y) [ln sqrt((1 + X^2)(1 + Y^2) / (1 + X^2 + Y^2)) + X sqrt(1 + Y^2) atan(X /
    sqrt(1 + Y^2)) + Y sqrt(1 + X^2) atan(Y / sqrt(1 + X^2)) - X atan X - Y atan Y].

    Parameters
    ----------
    length, width, distance : float   Sides of the plates and the distance between them. [m]

    References
    ----------
    Howell C-11; Incropera, 6th ed., Table 13.2.

    Examples
    --------
    Opposite faces of a cube:

    >>> round(facing_plates(1.0, 1.0, 1.0), 4)
    0.1998
    """
    x, y = length / distance, width / distance
    x1, y1 = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    logs = 0.5 * math.log(x1 * x1 * y1 * y1 / (1 + x * x + y * y))
    angles = x * y1 * math.atan(x / y1) + y * x1 * math.atan(y / x1) - x * math.atan(x) - y * math.atan(y)
    return 2.0 / (math.pi * x * y) * (logs + angles)


def edge_plates(edge: float, depth: float, height: float) -> float:
    """View factor from a plate, edge by depth, to one at right angles on that edge, edge by height. [-]

    With w = (depth / edge)^2, h = (height / edge)^2, s = w + h and a(x) = sqrt(x) atan(1 / sqrt(x)): (a(w) + a(h) - a(s) + L / 4) /
    (pi sqrt(w)), L = ln((1+w)(1+h)/(1+s)) + w ln(w(1+s)/((1+w)s)) + h ln(h(1+s)/((1+h)s)).

    Parameters
    ----------
    edge, depth, height : float   The common edge, the other side of the first plate and of the second. [m]

    References
    ----------
    Howell C-14; Incropera, 6th ed., Table 13.2.

    Examples
    --------
    Neighbouring faces of a cube:

    >>> round(edge_plates(1.0, 1.0, 1.0), 4)
    0.2
    """
    w, h = (depth / edge) ** 2, (height / edge) ** 2
    s = w + h
    angle_w, angle_h, angle_s = (math.sqrt(x) * math.atan(1 / math.sqrt(x)) for x in (w, h, s))
    logs = math.log((1 + w) * (1 + h) / (1 + s)) + w * math.log(w * (1 + s) / ((1 + w) * s)) + h * math.log(h * (1 + s) / ((1 + h) * s))
    return (angle_w + angle_h - angle_s + 0.25 * logs) / (math.pi * math.sqrt(w))


def facing_discs(radius: float, other_radius: float, distance: float) -> float:
    """View factor from a disc to a second one on the same axis: (S - sqrt(S^2 - 4 (R2 / R1)^2)) / 2, S = 1 + (1 + R2^2) / R1^2. [-]

    R1 and R2 are the radii over the distance.

    Parameters
    ----------
    radius, other_radius, distance : float   Radii of the first and the second disc, and the distance between them. [m]

    References
    ----------
    Howell C-41; Incropera, 6th ed., Table 13.2.

    Examples
    --------
    Equal discs one radius apart: (3 - sqrt 5) / 2.

    >>> round(facing_discs(1.0, 1.0, 1.0), 6)
    0.381966
    """
    first, second = radius / distance, other_radius / distance
    s = 1 + (1 + second * second) / (first * first)
    return 0.5 * (s - math.sqrt(s * s - 4 * (second / first) ** 2))


def _cylinders(inner: float, outer: float, length: float) -> tuple[float, float]:
    """Return the view factors of the outer one of two cylinders of equal length on one axis: to the inner one and to itself. [-]

    Howell C-91 and C-92, with R the ratio of the radii and H the length over the inner radius.
    """
    r, h = outer / inner, length / inner
    a, b = h * h + r * r - 1, h * h - r * r + 1
    part = math.sqrt((a + 2) ** 2 - (2 * r) ** 2) * math.acos(b / (r * a)) + b * math.asin(1 / r) - math.pi * a / 2
    to_inner = (1 - (math.acos(b / a) - part / (2 * h)) / math.pi) / r
    root = math.sqrt(4 * r * r + h * h) / h
    arc = math.asin((4 * (r * r - 1) + (h / r) ** 2 * (r * r - 2)) / (h * h + 4 * (r * r - 1)))
    last = root * arc - math.asin((r * r - 2) / (r * r)) + math.pi / 2 * (root - 1)
    to_itself = 1 - 1 / r + 2 / (math.pi * r) * math.atan(2 * math.sqrt(r * r - 1) / h) - h / (2 * math.pi * r) * last
    return to_inner, to_itself


@dataclass(frozen=True)
class Shape:
    """An enclosure whose view factors follow from a few lengths.

    Parameters
    ----------
    faces : tuple of str        Names of its faces, in the order of the factors.
    dimensions : tuple of str   Names of its lengths. [m]
    factors : callable          Lengths -> areas (faces,) [m^2] and view factors (faces, faces) [-].
    """

    faces: tuple[str, ...]
    dimensions: tuple[str, ...]
    factors: Callable[[Mapping[str, float]], tuple[Array, Array]]


def _from_pairs(areas: list[float], pairs: Mapping[tuple[int, int], float]) -> tuple[Array, Array]:
    """Return areas (faces,) [m^2] and view factors (faces, faces) [-] from factors of pairs (i, j); F_ji = F_ij A_i / A_j."""
    size = np.array(areas)
    out = np.zeros((size.size, size.size))
    for (i, j), factor in pairs.items():
        out[i, j] = factor
        out[j, i] = factor * size[i] / size[j]
    return size, out


def _plates(d: Mapping[str, float]) -> tuple[Array, Array]:
    """Return areas and view factors of two facing plates by `length`, `width` and `distance` [m]."""
    area = d["length"] * d["width"]
    return _from_pairs([area, area], {(0, 1): facing_plates(d["length"], d["width"], d["distance"])})


def _discs(d: Mapping[str, float]) -> tuple[Array, Array]:
    """Return areas and view factors of two discs on one axis by `first_radius`, `second_radius` and `distance` [m]."""
    first, second = d["first_radius"], d["second_radius"]
    return _from_pairs([math.pi * first**2, math.pi * second**2], {(0, 1): facing_discs(first, second, d["distance"])})


def _box(d: Mapping[str, float]) -> tuple[Array, Array]:
    """Return areas (6,) [m^2] and view factors (6, 6) [-] of the inner faces of a box: floor, lid, left, right, front, back.

    Left and right stand at the ends of the length. `d` has length, width and height. [m] Pairs by `facing_plates` and `edge_plates`.
    """
    x, y, z = d["length"], d["width"], d["height"]
    sides = [(x, y), (x, y), (y, z), (y, z), (x, z), (x, z)]
    normal = (z, z, x, x, y, y)
    pairs = {}
    for i in range(6):
        for j in range(i + 1, 6):
            if i // 2 == j // 2:
                pairs[i, j] = facing_plates(*sides[i], normal[i])
            else:
                edge = (x, y, z)[3 - sum((2, 0, 1)[face // 2] for face in (i, j))]  # floor and lid stand across z, sides across x, y
                pairs[i, j] = edge_plates(edge, sides[i][0] * sides[i][1] / edge, sides[j][0] * sides[j][1] / edge)
    return _from_pairs([a * b for a, b in sides], pairs)


def _cylinder_in_cylinder(d: Mapping[str, float]) -> tuple[Array, Array]:
    """Return areas (4,) [m^2] and view factors (4, 4) [-] between two cylinders on one axis: inner and outer side, bottom and top ring.

    The sides see each other by `_cylinders`; what is left of their view is shared equally by bottom and top. Other directions by
    reciprocity A_i F_ij = A_j F_ji, and bottom to top by rows that sum to one. `d` has inner_radius, outer_radius and length. [m]
    """
    inner, outer, length = d["inner_radius"], d["outer_radius"], d["length"]
    to_inner, to_itself = _cylinders(inner, outer, length)
    areas = np.array([2 * math.pi * inner * length, 2 * math.pi * outer * length, *[math.pi * (outer**2 - inner**2)] * 2])
    out = np.zeros((4, 4))
    out[1, 0], out[1, 1] = to_inner, to_itself
    out[0, 1] = to_inner * areas[1] / areas[0]
    out[:2, 2] = out[:2, 3] = 0.5 * (1.0 - out[:2].sum(axis=1))
    out[2:, :2] = (out[:2, 2:] * areas[:2, None]).T / areas[2:, None]
    out[2, 3] = out[3, 2] = 1.0 - out[2, :2].sum()
    return areas, out


SHAPES: Final[Mapping[str, Shape]] = {
    "facing plates": Shape(("first", "second"), ("length", "width", "distance"), _plates),
    "facing discs": Shape(("first", "second"), ("first_radius", "second_radius", "distance"), _discs),
    "box": Shape(("floor", "lid", "left", "right", "front", "back"), ("length", "width", "height"), _box),
    "cylinder in cylinder": Shape(("inner", "outer", "bottom", "top"), ("inner_radius", "outer_radius", "length"), _cylinder_in_cylinder),
}


Point = tuple[float, float, float]
Flags = NDArray[np.bool_]
RAYS: Final = 1 << 17
"""Rays from each face; with them factors are right to some 0.1 %. [-]"""
TOUCHING: Final = 1e-9
"""Distance within which a ray still touches what it leaves, as a share of the size of the whole. [-]"""
MAX_LOST_RAY_SHARE: Final = 2e-3
"""Share of the rays of a face that may meet the back of another, or nothing in a closed room. [-]"""


@dataclass(frozen=True)
class PlacedFace:
    """A face in space: a rectangle, a disc, or the side of a cylinder, inside or out. Lengths in metres.

    Parameters
    ----------
    kind : str              rectangle, disc or cylinder.
    at : (x, y, z)          Corner of a rectangle; centre of a disc; centre of a cylinder's foot.
    first, second           Sides of a rectangle, which looks to first x second; the normal of a disc; the axis of a cylinder.
    radius : float          Of a disc or cylinder.
    inside : bool           Whether a cylinder radiates inward.
    """

    kind: str
    at: Point
    first: Point
    second: Point = (0.0, 0.0, 0.0)
    radius: float = 0.0
    inside: bool = False

    @property
    def area(self) -> float:
        """Area of the face: a rectangle |first x second|, a disc pi r^2, the side of a cylinder 2 pi r |first|. [m^2]"""
        if self.kind == "rectangle":
            return float(np.linalg.norm(np.cross(self.first, self.second)))
        return math.pi * self.radius**2 if self.kind == "disc" else 2.0 * math.pi * self.radius * float(np.linalg.norm(self.first))

    def sample_points(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return points spread evenly over the face (rays, 3) [m] and the normals there (rays, 3), for u, v from 0 to 1 (rays,).

        A rectangle is o + u a + v b, a disc o + R sqrt(u) e(2 pi v), a cylinder o + u a + R e(2 pi v), with the origin o, the sides or
        axis a and b, and e a unit vector across the axis; a cylinder's normal is e, or -e where its inside radiates.
        """
        origin, first = np.array(self.at), np.array(self.first)
        if self.kind == "rectangle":
            second = np.array(self.second)
            return origin + u[:, None] * first + v[:, None] * second, np.broadcast_to(_unit(np.cross(first, second)), (u.size, 3))
        axis = _unit(first)
        # two directions across an axis and across one another
        across = _unit(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]))
        beside = np.cross(axis, across)
        angle = 2.0 * np.pi * v[:, None]
        round_ = np.cos(angle) * across + np.sin(angle) * beside
        if self.kind == "disc":
            return origin + self.radius * np.sqrt(u)[:, None] * round_, np.broadcast_to(axis, (u.size, 3))
        return origin + u[:, None] * first + self.radius * round_, -round_ if self.inside else round_

    def hit_distances(self, start: Array, ray: Array, near: float) -> tuple[Array, Flags]:
        """Return the distance (rays,) [m] at which rays hit the face, infinite where they miss it, and whether they hit its radiating side.

        s = n.(o - p) / n.r of a plane through o with the normal n, where the point lies on the face; n.r < 0 is its radiating side. Rays
        begin at `start` p (rays, 3) [m] in the unit directions `ray` r (rays, 3); hits nearer than `near` [m] do not count.
        """
        origin, first = np.array(self.at), np.array(self.first)
        if self.kind == "cylinder":
            return self._cylinder_hits(start - origin, ray, near)
        normal = _unit(np.cross(first, self.second)) if self.kind == "rectangle" else _unit(first)
        falling = ray @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            far = ((origin - start) @ normal) / falling
            offset = start + far[:, None] * ray - origin
        if self.kind == "disc":
            on = np.sum(offset**2, axis=1) <= self.radius**2
        else:
            sides = np.array([self.first, self.second])
            share = offset @ np.linalg.solve(sides @ sides.T, sides).T
            on = (share >= 0.0).all(axis=1) & (share <= 1.0).all(axis=1)
        return np.where(on & (far > near) & np.isfinite(far), far, np.inf), falling < 0.0

    def _cylinder_hits(self, start: Array, ray: Array, near: float) -> tuple[Array, Flags]:
        """Return distances (rays,) [m] along rays to a cylinder's side and whether they meet its front: the nearer root of a quadratic.

        Of |p + s r|^2 = R^2 with start p and direction r less their parts along the axis, for s beyond `near` [m], at a height on the
        cylinder's length; infinite where none.

        Parameters
        ----------
        start : array (rays, 3)     Relative to the foot of the axis. [m]
        ray : array (rays, 3)       Unit vectors.
        """
        length, axis = float(np.linalg.norm(self.first)), _unit(np.array(self.first))
        flat, toward = start - np.outer(start @ axis, axis), ray - np.outer(ray @ axis, axis)
        a, b, c = np.sum(toward**2, axis=1), np.sum(flat * toward, axis=1), np.sum(flat**2, axis=1) - self.radius**2
        best, front = np.full(a.size, np.inf), np.zeros(a.size, dtype=bool)
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(b * b - a * c)
            for far, inner in (((-b - root) / a, False), ((-b + root) / a, True)):
                height = (start + far[:, None] * ray) @ axis
                good = np.isfinite(far) & (far > near) & (height >= 0.0) & (height <= length) & (far < best)
                best, front = np.where(good, far, best), np.where(good, inner == self.inside, front)
        return best, front


def _unit(vector: Array) -> Array:
    """Return a vector (3,) scaled to length one."""
    return np.asarray(vector, dtype=float) / float(np.linalg.norm(vector))


@lru_cache(maxsize=32)
def placed_factors(faces: tuple[PlacedFace, ...], names: tuple[str, ...], rays: int = RAYS, where: str = "") -> tuple[Array, Array, float]:
    """Return areas [m^2], view factors (faces, faces) [-] of faces in space that may hide one another, and their error [-].

    Rays leave every face over its area and by the cosine of their angle, at points of an even sequence in place of random ones, and go to
    the first face that they meet. Both directions of a pair are joined, so that reciprocity is exact; where next to no ray leaves the
    faces, rows are made to sum to one. The error is the largest difference of both directions, of the larger face.

    Raises
    ------
    DeckError   When a face sees the back of another.

    References
    ----------
    Howell, Menguc, Siegel, Thermal Radiation Heat Transfer, 6th ed., chapter 7 (Monte Carlo); the sequence: Roberts' generalised golden
    ratio, the root of x^5 = x + 1.

    Examples
    --------
    Two squares that face one another at the distance of their side, 0.1998 (Incropera, 6th ed., Fig. 13.4):

    >>> low = PlacedFace("rectangle", (0, 0, 0), (1, 0, 0), (0, 1, 0))
    >>> high = PlacedFace("rectangle", (0, 0, 1), (0, 1, 0), (1, 0, 0))
    >>> round(float(placed_factors((low, high), ("low", "high"))[1][0, 1]), 3)
    0.2
    """
    count = len(faces)
    size = np.array([f.area for f in faces])
    spread = max(float(np.linalg.norm(np.array(f.at) - np.array(faces[0].at))) + f.radius + float(np.sqrt(f.area)) for f in faces)
    golden = 1.1673039782614187
    even = (0.5 + np.outer(np.arange(1, rays + 1), golden ** -np.arange(1.0, 5.0))) % 1.0
    shares = np.zeros((count, count))
    for i, face in enumerate(faces):
        start, normal = face.sample_points(even[:, 0], even[:, 1])
        ray = _cosine_directions(normal, even[:, 2], even[:, 3])
        crossings = [other.hit_distances(start, ray, TOUCHING * spread) for other in faces]
        far = np.column_stack([d + np.where(front, 0.0, 10.0 * TOUCHING * spread) for d, front in crossings])
        first = np.argmin(far, axis=1)
        hit = np.isfinite(far[np.arange(rays), first])
        front = np.column_stack([f for _, f in crossings])[np.arange(rays), first]
        behind = hit & ~front
        for j in np.unique(first[behind]).tolist():
            if np.mean(behind & (first == j)) > MAX_LOST_RAY_SHARE:
                raise DeckError(
                    f"'{names[i]}' sees the back of '{names[j]}'. Define a separate face for that side, or exchange its sides.",
                    where,
                    code="model.view-factors",
                )
        shares[i] = np.bincount(first[hit & front], minlength=count) / rays
    both = size[:, None] * shares
    error = float((np.abs(both - both.T) / np.maximum(size[:, None], size[None, :])).max())
    joined = 0.5 * (both + both.T)
    if (shares.sum(axis=1) > 1.0 - MAX_LOST_RAY_SHARE).all():
        for _ in range(200):  # a symmetric scaling that gives every row its area
            joined *= np.sqrt(np.outer(size / joined.sum(axis=1), size / joined.sum(axis=1)))
    return size, joined / size[:, None], error


def _cosine_directions(normal: Array, u: Array, v: Array) -> Array:
    """Return unit directions (rays, 3) about normals (rays, 3), as dense as the cosine of their angle, for u, v from 0 to 1 (rays,). [-]

    sqrt(u) (cos(2 pi v) a + sin(2 pi v) b) + sqrt(1 - u) n, with a and b across the normal n: points that lie evenly in the unit disc are
    raised to the hemisphere (Malley).
    """
    helper = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    across = np.cross(normal, helper)
    across /= np.linalg.norm(across, axis=1)[:, None]
    beside = np.cross(normal, across)
    flat, angle = np.sqrt(u)[:, None], 2.0 * np.pi * v[:, None]
    return np.asarray(flat * (np.cos(angle) * across + np.sin(angle) * beside) + np.sqrt(1.0 - u)[:, None] * normal)
