"""View factors of a few shapes: facing plates and discs, plates at an edge, the inside of a box, a cylinder in a cylinder.

Numbers are those of J. R. Howell, M. P. Menguc and R. Siegel, Thermal Radiation Heat Transfer, 6th ed., appendix C (configurations C-11,
C-14, C-41, C-92 there and in Howell's catalogue). A view factor from i to j is the share of what leaves i that strikes j directly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from thermid.linear_algebra import Array


def facing_plates(length: float, width: float, distance: float) -> float:
    """View factor between two equal rectangles that face each other. [-]

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
    """View factor from a disc to a second one on the same axis. [-]

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
    """Return areas and factors; those of the other direction follow by reciprocity."""
    size = np.array(areas)
    out = np.zeros((size.size, size.size))
    for (i, j), factor in pairs.items():
        out[i, j] = factor
        out[j, i] = factor * size[i] / size[j]
    return size, out


def _plates(d: Mapping[str, float]) -> tuple[Array, Array]:
    area = d["length"] * d["width"]
    return _from_pairs([area, area], {(0, 1): facing_plates(d["length"], d["width"], d["distance"])})


def _discs(d: Mapping[str, float]) -> tuple[Array, Array]:
    first, second = d["first_radius"], d["second_radius"]
    return _from_pairs([math.pi * first**2, math.pi * second**2], {(0, 1): facing_discs(first, second, d["distance"])})


def _box(d: Mapping[str, float]) -> tuple[Array, Array]:
    x, y, z = d["length"], d["width"], d["height"]
    sides = [(x, y), (x, y), (y, z), (y, z), (x, z), (x, z)]
    normal = (z, z, x, x, y, y)
    pairs = {}
    for i in range(6):
        for j in range(i + 1, 6):
            if i // 2 == j // 2:
                pairs[i, j] = facing_plates(*sides[i], normal[i])
            else:
                edge = (x, y, z)[3 - _axis(i) - _axis(j)]
                pairs[i, j] = edge_plates(edge, sides[i][0] * sides[i][1] / edge, sides[j][0] * sides[j][1] / edge)
    return _from_pairs([a * b for a, b in sides], pairs)


def _axis(face: int) -> int:
    """Return the axis that a face of a box stands across: z for floor and lid, x for left and right, y for front and back."""
    return (2, 0, 1)[face // 2]


def _cylinder_in_cylinder(d: Mapping[str, float]) -> tuple[Array, Array]:
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
