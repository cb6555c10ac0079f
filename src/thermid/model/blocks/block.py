"""`Block`: a regular block or plate of cells, with heaters in boxes and faces that exchange or are held."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid.errors import DeckError, NameNotFoundError, nearest
from thermid.model.laws.signal import Signal, literal, signal

Array = NDArray[np.float64]
Ints = NDArray[np.int32]

FACES: Final = ("-x", "+x", "-y", "+y", "-z", "+z")
CELL: Final = re.compile(r"cell\[(\d+),\s*(\d+),\s*(\d+)\]\Z")
_NAME: Final = re.compile(r"[A-Za-z]\w*\Z")


@dataclass(frozen=True, eq=False)
class Heater:
    """Heat put evenly into some cells.

    Parameters
    ----------
    cells : tuple of slice  Which cells in x, y and z.
    power : Signal          Of all of them together. [W]
    """

    cells: tuple[slice, slice, slice]
    power: Signal


@dataclass(frozen=True)
class Exchange:
    """What some faces exchange with.

    Parameters
    ----------
    faces : tuple of str    Some of `FACES`.
    to : str                The boundary.
    htc : float             Coefficient of convection; with an exponent, at a difference of 1 K. [W/(m^2 K)]
    exponent : float        Of natural convection, 0 for a constant coefficient. [-]
    emissivity : float      Towards black surroundings. [-]
    radiates_to : str       Boundary that the faces radiate to.
    held : bool             Whether the faces themselves have the boundary's temperature, behind half a cell.
    contact : float         Conductance per area between a held face and the boundary, infinite for none. [W/(m^2 K)]
    """

    faces: tuple[str, ...]
    to: str
    htc: float = 0.0
    exponent: float = 0.0
    emissivity: float = 0.0
    radiates_to: str = ""
    held: bool = False
    contact: float = math.inf


@dataclass(frozen=True, eq=False)
class Block:
    """A regular block of cells; a plate is a block of one cell in one direction.

    A cell's temperature is that at its centre. Half a cell lies between two centres on either side of their face, so that unequal
    conductivities combine to their harmonic mean. Convection and radiation start from the centre of the outermost cells.

    Parameters
    ----------
    size : three lengths            In x, y, z. [m]
    cells : three int               Number of cells in x, y, z.
    conductivity : value or array   One, or (nx, ny, nz). [W/(m K)]
    density : value or array        [kg/m^3]
    specific_heat : value or array  [J/(kg K)]
    link_factors : three arrays     Factors on the conductances between neighbours, (nx-1, ny, nz), (nx, ny-1, nz), (nx, ny, nz-1). [-]
    title : str                     What it is.

    Raises
    ------
    DeckError   When a size, number or value makes no block.
    """

    size: tuple[Any, Any, Any]
    cells: tuple[int, int, int]
    conductivity: Any
    density: Any
    specific_heat: Any
    link_factors: tuple[Array, Array, Array] | None = None
    title: str = "block"
    heaters: Mapping[str, Heater] = field(default_factory=dict)
    exchanges: tuple[Exchange, ...] = ()

    def __post_init__(self) -> None:
        """Turn texts into numbers, and refuse what makes no block."""
        if len(self.size) != 3 or len(self.cells) != 3:
            raise DeckError("a block has a size and a number of cells in x, y and z.", self.title)
        cells = tuple(int(n) for n in self.cells)
        if min(cells) < 1 or cells != tuple(self.cells):
            raise DeckError(f"the numbers of cells must be whole and at least one, not {self.cells}.", self.title)
        if math.prod(cells) > 2**30:
            raise DeckError("a block holds at most 2^30 cells.", self.title)
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "size", tuple(_number(v, "m", f"{self.title}, size", positive=True) for v in self.size))
        for name, slot in (("conductivity", "W/(m K)"), ("density", "kg/m^3"), ("specific_heat", "J/(kg K)")):
            object.__setattr__(self, name, self._per_cell(getattr(self, name), slot, name))
        if self.link_factors is not None:
            object.__setattr__(self, "link_factors", self._factors(self.link_factors))

    def _per_cell(self, value: Any, slot: str, name: str) -> Any:
        where = f"{self.title}, {name}"
        if not isinstance(value, np.ndarray):
            return _number(value, slot, where, positive=True)
        if value.shape != self.cells:
            raise DeckError(f"an array needs one value per cell, {self.cells}, not {value.shape}.", where)
        if not (np.isfinite(value).all() and (value > 0).all()):
            raise DeckError("every cell needs a value above zero.", where)
        return value.astype(float)

    def _factors(self, given: tuple[Array, Array, Array]) -> tuple[Array, ...]:
        where = f"{self.title}, link_factors"
        out = []
        for axis, factor in enumerate(given):
            shape = tuple(n - (k == axis) for k, n in enumerate(self.cells))
            if np.shape(factor) != shape:
                raise DeckError(f"the factors in {'xyz'[axis]} must have the shape {shape}, not {np.shape(factor)}.", where)
            if not (np.isfinite(factor).all() and (np.asarray(factor) >= 0).all()):
                raise DeckError("a factor must be finite and not negative.", where)
            out.append(np.asarray(factor, dtype=float))
        return tuple(out)

    def heated(self, name: str, power: Any, *, box: Any = None, cells: tuple[slice, slice, slice] | None = None) -> Block:
        """Return the block with a heater, its heat shared evenly by its cells.

        Parameters
        ----------
        name : str              Letters, digits and _; the scenario may give another power under it.
        power : text or Signal  Of the whole heater. [W]
        box : three pairs       From and to in x, y, z; the cells whose centres lie inside. [m]
        cells : three slices    Which cells instead: ``np.s_[2:4, 2:4, :]``.

        Raises
        ------
        DeckError   When the name is taken, or no cell lies in the box.
        """
        where = f"{self.title}, {name}"
        if not _NAME.match(name) or name in self.heaters:
            raise DeckError("a heater needs a name of its own, of letters, digits and _, beginning with a letter.", where)
        if (box is None) == (cells is None):
            raise DeckError("a heater sits in a box or in cells; give one of them.", where)
        chosen = self._in_box(box, where) if cells is None else cells
        if len(chosen) != 3 or any(not range(*s.indices(n)) for s, n in zip(chosen, self.cells, strict=True)):
            raise DeckError("no cell lies there.", where)
        return replace(self, heaters={**self.heaters, name: Heater(chosen, signal(power, "W", where))})

    def _in_box(self, box: Any, where: str) -> tuple[slice, slice, slice]:
        out = []
        for (low, high), step, count in zip(box, self.steps, self.cells, strict=True):
            edges = [_number(v, "m", where) for v in (low, high)]
            centres = (np.arange(count) + 0.5) * step
            inside = np.flatnonzero((centres >= edges[0]) & (centres <= edges[1]))
            out.append(slice(int(inside[0]), int(inside[-1]) + 1) if inside.size else slice(0, 0))
        return out[0], out[1], out[2]

    def exchanging(self, faces: str | Iterable[str], to: str, *, htc: Any = None, emissivity: float = 0.0, radiates_to: str = "") -> Block:
        """Return the block with faces that exchange heat with a boundary.

        Parameters
        ----------
        faces : str or several      Some of `FACES`, in one text or several; ``all`` for every face.
        to : str                    The boundary, whose temperature the scenario gives.
        htc : text or table         A coefficient, or ``{"coefficient": ..., "exponent": ...}`` for h = coefficient |dT|^exponent; beside an
                                    emissivity 0 where nothing convects.
        emissivity : float          Towards black surroundings. [-]
        radiates_to : str           Boundary that they radiate to; `to` when empty.

        Raises
        ------
        DeckError   When there is no such face, nothing is exchanged, or an emissivity stands without a word on convection.
        """
        where = f"{self.title}, exchange with {to}"
        table = htc if isinstance(htc, Mapping) else {"coefficient": htc if htc is not None else 0.0, "exponent": 0.0}
        if set(table) != {"coefficient", "exponent"}:
            raise DeckError("a coefficient that changes with temperature has coefficient and exponent.", where)
        coefficient = _number(table["coefficient"], "W/(m^2 K)", where) if table["coefficient"] else 0.0
        exponent, emits = float(table["exponent"]), float(emissivity)
        if coefficient < 0 or not 0.0 <= emits <= 1.0 or not 0.0 <= exponent <= 1.0 or not (coefficient or emits):
            raise DeckError(
                "faces exchange by a coefficient above zero, an emissivity from 0 to 1, or both; exponents go from 0 to 1.", where
            )
        if emits and htc is None:
            raise DeckError("an emissivity and no htc would be no convection in silence. Give htc; htc = 0 where nothing convects.", where)
        new = Exchange(_faces(faces, where), _boundary(to, where), coefficient, exponent, emits, radiates_to or to)
        return replace(self, exchanges=(*self.exchanges, new))

    def held(self, faces: str | Iterable[str], to: str, *, contact: Any = None) -> Block:
        """Return the block with faces at the temperature of a boundary, or in contact with it.

        Parameters
        ----------
        faces : str or several      As in `exchanging`.
        to : str                    The boundary.
        contact : text              Conductance per area of the contact; perfect when not given. [W/(m^2 K)]
        """
        where = f"{self.title}, held at {to}"
        given = math.inf if contact is None else _number(contact, "W/(m^2 K)", where, positive=True)
        return replace(self, exchanges=(*self.exchanges, Exchange(_faces(faces, where), _boundary(to, where), held=True, contact=given)))

    @property
    def steps(self) -> tuple[float, float, float]:
        """Edges of a cell in x, y, z. [m]"""
        x, y, z = (s / n for s, n in zip(self.size, self.cells, strict=True))
        return x, y, z

    @property
    def count(self) -> int:
        """Number of cells."""
        return math.prod(self.cells)

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Boundaries that faces exchange with, in order of appearance."""
        pairs = [((e.to, bool(e.htc) or e.held), (e.radiates_to, bool(e.emissivity))) for e in self.exchanges]
        return tuple(dict.fromkeys(b for pair in pairs for b, used in pair if used))

    def capacities(self) -> Array:
        """Return the capacitance of every cell (cells,). [J/K]"""
        volume = math.prod(self.steps)
        return np.array(np.broadcast_to(self.density * self.specific_heat * volume, self.cells), dtype=float).ravel()

    def place(self, name: str) -> int:
        """Return the place of a cell among all, z running fastest.

        Raises
        ------
        NameNotFoundError   When there is no such cell.
        """
        found = CELL.match(name)
        index = tuple(int(g) for g in found.groups()) if found else ()
        if not index or any(i >= n for i, n in zip(index, self.cells, strict=True)):
            last = ",".join(str(n - 1) for n in self.cells)
            raise NameNotFoundError(f"no cell '{name}'; they go from cell[0,0,0] to cell[{last}].", self.title)
        return int(np.ravel_multi_index(index, self.cells))

    def name(self, place: int) -> str:
        """Return the name of the cell at a place."""
        return f"cell[{','.join(str(int(i)) for i in np.unravel_index(place, self.cells))}]"

    def face_cells(self, face: str) -> Ints:
        """Return the places (cells,) of the cells at a face."""
        axis, last = "xyz".index(face[1]), face[0] == "+"
        chosen = tuple((slice(-1, None) if last else slice(0, 1)) if k == axis else slice(None) for k in range(3))
        return self._places(chosen)

    def heater_cells(self, name: str) -> Ints:
        """Return the places (cells,) of the cells of a heater."""
        if name not in self.heaters:
            raise NameNotFoundError(f"no heater '{name}'.{nearest(name, self.heaters)}", self.title)
        return self._places(self.heaters[name].cells)

    def _places(self, chosen: tuple[slice, ...]) -> Ints:
        axes = [np.arange(n, dtype=np.int32)[s] for n, s in zip(self.cells, chosen, strict=True)]
        _, ny, nz = self.cells
        found: Ints = (axes[0][:, None, None] * np.int32(ny * nz) + axes[1][:, None] * np.int32(nz) + axes[2]).ravel()
        return found

    def model(self, offers: Iterable[str] = ()) -> Any:
        """Return the block as an ordinary `Model`, of some thousand cells at most: to be a part of another one, or to be calibrated.

        Parameters
        ----------
        offers : iterable   What others may attach to: cells (``cell[0,0,0]``), faces (``+x``, their cells) or ``all``.
        """
        from thermid.model.blocks.block_model import block_model

        return block_model(self, tuple(offers))


def _number(value: Any, slot: str, where: str, positive: bool = False) -> float:
    """Return the SI value of a text or a number."""
    found = literal(value, slot, where) if isinstance(value, str) else float(value)
    if not math.isfinite(found) or (positive and found <= 0):
        raise DeckError(f"the value '{value}' must be finite{' and above zero' if positive else ''}.", where)
    return found


def _faces(given: str | Iterable[str], where: str) -> tuple[str, ...]:
    wanted = given.replace(",", " ").split() if isinstance(given, str) else list(given)
    found = FACES if wanted == ["all"] else tuple(wanted)
    unknown = [f for f in found if f not in FACES]
    if unknown or not found or len(set(found)) < len(found):
        raise DeckError(f"faces are {', '.join(FACES)}, each once, or all; not {' '.join(map(str, wanted)) or 'nothing'}.", where)
    return found


def _boundary(name: str, where: str) -> str:
    if not _NAME.match(name):
        raise DeckError("a boundary needs a name of letters, digits and _, beginning with a letter.", where)
    return name
