"""`Block`: a regular block or plate of cells, with heaters in boxes and faces that exchange or are held; its geometry; it as a `Model`."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from thermid.base.arguments import guard_methods
from thermid.base.errors import DeckError, NameNotFoundError, cap, raising, refuse_first, refuse_unknown
from thermid.base.results import Shown
from thermid.base.units import Array, Ints, amount
from thermid.model._deck.modelfile import model_from_dict
from thermid.model._laws.signal import Constant, Signal, signal
from thermid.model._tree.model import Model

FACES: Final = ("-x", "+x", "-y", "+y", "-z", "+z")
"""Faces of a block by the direction of their outward normals."""
CELL: Final = re.compile(r"cell\[(\d+),\s*(\d+),\s*(\d+)\]\Z")
_NAME: Final = re.compile(r"[A-Za-z]\w*\Z")


@dataclass(frozen=True, eq=False)
class Heater:
    """Heat put into some cells of a block, the same in each.

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
    held : bool             Whether the faces themselves have the boundary's temperature, behind half a cell.
    contact : float         Conductance per area between a held face and the boundary, infinite for none. [W/(m^2 K)]
    """

    faces: tuple[str, ...]
    to: str
    htc: float = 0.0
    exponent: float = 0.0
    emissivity: float = 0.0
    held: bool = False
    contact: float = math.inf


@guard_methods
@dataclass(frozen=True, eq=False)
class Block(Shown):
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
        """Turn texts into SI numbers, and refuse sizes, numbers of cells or properties that make no block."""
        if len(self.size) != 3 or len(self.cells) != 3:
            raise DeckError("give the size and the number of cells of a block in x, y and z.", self.title, code="value.incomplete")
        cells = tuple(int(n) for n in self.cells)
        refuse_first(
            lambda _: self.title,
            (
                min(cells) < 1 or cells != tuple(self.cells),
                f"the numbers of cells must be whole and at least one, not {self.cells}.",
                "",
                "value.outside-range",
            ),
            (math.prod(cells) > 2**30, "a block holds at most 2^30 cells.", "", "value.outside-range"),
        )
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "size", tuple(_number(v, "m", f"{self.title}, size", positive=True) for v in self.size))
        for name, slot in (("conductivity", "W/(m K)"), ("density", "kg/m^3"), ("specific_heat", "J/(kg K)")):
            object.__setattr__(self, name, self._per_cell(getattr(self, name), slot, name))
        if self.link_factors is not None:
            object.__setattr__(self, "link_factors", self._factors(self.link_factors))

    def _per_cell(self, value: Any, slot: str, name: str) -> Any:
        """Return a property as one SI number or as an array (nx, ny, nz), all above zero."""
        where = f"{self.title}, {name}"
        if not isinstance(value, np.ndarray):
            return _number(value, slot, where, positive=True)
        refuse_first(
            lambda _: where,
            (value.shape != self.cells, f"an array needs one value per cell, {self.cells}, not {value.shape}.", "", "value.shape"),
            (
                not (np.isfinite(value).all() and (value > 0).all()),
                "every cell needs a value above zero.",
                "",
                "value.outside-range",
            ),
        )
        return value.astype(float)

    def _factors(self, factors: tuple[Array, Array, Array]) -> tuple[Array, ...]:
        """Return the factors on links in x, y and z as arrays after checking their shapes and signs. [-]"""
        where = f"{self.title}, link_factors"
        for axis, factor in enumerate(factors):
            shape = tuple(n - (k == axis) for k, n in enumerate(self.cells))
            refuse_first(
                lambda _: where,
                (
                    np.shape(factor) != shape,
                    f"the factors in {'xyz'[axis]} must have the shape {shape}, not {np.shape(factor)}.",
                    "",
                    "value.shape",
                ),
                (
                    not (np.isfinite(factor).all() and (np.asarray(factor) >= 0).all()),
                    "a factor must be finite and not negative.",
                    "",
                    "value.outside-range",
                ),
            )
        return tuple(np.asarray(factor, dtype=float) for factor in factors)

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
        refuse_first(
            lambda _: where,
            (
                not _NAME.match(name) or name in self.heaters,
                "give each heater its own name: letters, digits and _, beginning with a letter.",
                "",
                "name.taken",
            ),
            (
                (box is None) == (cells is None),
                "give the place of a heater as a box or as cells, not both.",
                "",
                "value.excludes-another",
            ),
        )
        chosen = self._in_box(box, where) if cells is None else cells
        if len(chosen) != 3 or any(not range(*s.indices(n)) for s, n in zip(chosen, self.cells, strict=True)):
            raise DeckError("no cell of the block lies in this box. Correct the coordinates.", where, code="value.contradicts")
        return replace(self, heaters={**self.heaters, name: Heater(chosen, signal(power, "W", where))})

    def _in_box(self, box: Any, where: str) -> tuple[slice, slice, slice]:
        """Return the slices of the cells whose centres lie in a box of (from, to) in x, y, z [m]; empty ones where none does."""
        out = []
        for (low, high), step, count in zip(box, self.steps, self.cells, strict=True):
            edges = [_number(v, "m", where) for v in (low, high)]
            centres = (np.arange(count) + 0.5) * step
            inside = np.flatnonzero((centres >= edges[0]) & (centres <= edges[1]))
            out.append(slice(int(inside[0]), int(inside[-1]) + 1) if inside.size else slice(0, 0))
        return out[0], out[1], out[2]

    def exchanging(self, faces: str | Iterable[str], to: str, *, htc: Any = None, emissivity: float = 0.0) -> Block:
        """Return the block with faces that exchange heat with a boundary.

        Parameters
        ----------
        faces : str or several      Some of `FACES`, in one text or several; ``all`` for every face.
        to : str                    The boundary, whose temperature the scenario gives.
        htc : text or table         A coefficient, or ``{"coefficient": ..., "exponent": ...}`` for h = coefficient |dT|^exponent; beside an
                                    emissivity 0 where nothing convects.
        emissivity : float          Towards black surroundings. [-]

        Raises
        ------
        DeckError   When there is no such face, nothing is exchanged, or an emissivity stands without a word on convection.
        """
        where = f"{self.title}, exchange with {to}"
        table = htc if isinstance(htc, Mapping) else {"coefficient": htc if htc is not None else 0.0, "exponent": 0.0}
        if set(table) != {"coefficient", "exponent"}:
            raise DeckError("give coefficient and exponent of a coefficient that depends on temperature.", where, code="value.incomplete")
        coefficient = _number(table["coefficient"], "W/(m^2 K)", where) if table["coefficient"] else 0.0
        exponent, emits = float(table["exponent"]), float(emissivity)
        refuse_first(
            lambda _: where,
            (
                coefficient < 0 or not 0.0 <= emits <= 1.0 or not 0.0 <= exponent <= 1.0 or not (coefficient or emits),
                "give a coefficient above zero, an emissivity from 0 to 1, or both; an exponent lies from 0 to 1.",
                "",
                "value.incomplete",
            ),
            (
                emits and htc is None,
                "the face has an emissivity but no htc, so it would have no convection. Give htc, or htc = 0 if that is intended.",
                "",
                "value.incomplete",
            ),
        )
        new = Exchange(_faces(faces, where), _boundary(to, where), coefficient, exponent, emits)
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
        coefficient = math.inf if contact is None else _number(contact, "W/(m^2 K)", where, positive=True)
        return replace(
            self, exchanges=(*self.exchanges, Exchange(_faces(faces, where), _boundary(to, where), held=True, contact=coefficient))
        )

    @property
    def steps(self) -> tuple[float, float, float]:
        """Lengths of a cell in x, y, z: size / number of cells. [m]"""
        x, y, z = (s / n for s, n in zip(self.size, self.cells, strict=True))
        return x, y, z

    @property
    def count(self) -> int:
        """Number of cells."""
        return math.prod(self.cells)

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Boundaries that faces exchange with, in order of appearance."""
        return tuple(dict.fromkeys(e.to for e in self.exchanges))

    def capacities(self) -> Array:
        """Return the capacitance of every cell, density * specific heat * volume (cells,). [J/K]"""
        volume = math.prod(self.steps)
        return np.array(np.broadcast_to(self.density * self.specific_heat * volume, self.cells), dtype=float).ravel()

    def place(self, name: str) -> int:
        """Return the place of a cell among all, z running fastest.

        Raises
        ------
        NameNotFoundError   When there is no such cell.
        """
        match = CELL.match(name)
        index = tuple(int(g) for g in match.groups()) if match else ()
        if not index or any(i >= n for i, n in zip(index, self.cells, strict=True)):
            last = ",".join(str(n - 1) for n in self.cells)
            raise NameNotFoundError(f"no cell '{name}'. Cells go from cell[0,0,0] to cell[{last}].", self.title)
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
        refuse_unknown([name], self.heaters, self.title, "no heater '{}'.", NameNotFoundError)
        return self._places(self.heaters[name].cells)

    def _places(self, chosen: tuple[slice, ...]) -> Ints:
        """Return the numbers (cells,) of the cells in slices of x, y, z: (i ny + j) nz + k."""
        axes = [np.arange(n, dtype=np.int32)[s] for n, s in zip(self.cells, chosen, strict=True)]
        _, ny, nz = self.cells
        places: Ints = (axes[0][:, None, None] * np.int32(ny * nz) + axes[1][:, None] * np.int32(nz) + axes[2]).ravel()
        return places

    def model(self, offers: Iterable[str] = ()) -> Model:
        """Return the block as an ordinary `Model`, of some thousand cells at most: to be a part of another one, or to be calibrated.

        Parameters
        ----------
        offers : iterable   What others may attach to: cells (``cell[0,0,0]``), faces (``+x``, their cells) or ``all``.
        """
        return _block_model(self, tuple(offers))

    @property
    def links(self) -> tuple[Array, Array, Array]:
        """Return three arrays (cells,): the conductance from every cell to the next in x, y and z, zero for the last ones. [W/K]

        It is f k A / d with k = 2 k1 k2 / (k1 + k2) of both cells, side A, distance d of the centres, and the block's link factor f.
        """
        out = []
        for axis in range(3):
            conductances = np.zeros(self.cells)
            low: Any = tuple(slice(None, -1) if k == axis else slice(None) for k in range(3))
            high: Any = tuple(slice(1, None) if k == axis else slice(None) for k in range(3))
            k = self.conductivity
            mean = 2.0 * k[low] * k[high] / (k[low] + k[high]) if isinstance(k, np.ndarray) else k
            conductances[low] = mean * _face_area(self, axis) / self.steps[axis]
            if self.link_factors is not None:
                conductances[low] *= self.link_factors[axis]
            out.append(conductances.ravel())
        return out[0], out[1], out[2]

    def exchange_cells(self, exchange: Exchange) -> tuple[Ints, Array, Array]:
        """Return places, areas [m^2] and conductances to held faces [W/K] (cells,) of the cells of an exchange, each once.

        A cell at several faces has the sum of their areas A and of their conductances  A / (d / (2 k) + 1 / contact),  d the cell's length.
        """
        cells, areas, conductances = [], [], []
        for face in exchange.faces:
            axis, at = "xyz".index(face[1]), self.face_cells(face)
            area = _face_area(self, axis)
            k = self.conductivity.ravel()[at] if isinstance(self.conductivity, np.ndarray) else self.conductivity
            cells.append(at)
            areas.append(np.full(at.size, area))
            conductances.append(np.broadcast_to(area / (0.5 * self.steps[axis] / k + 1.0 / exchange.contact), at.shape))
        places, index = np.unique(np.concatenate(cells), return_inverse=True)
        area_of, conductance_of = (np.bincount(index, np.concatenate(v)).astype(np.float64) for v in (areas, conductances))
        return places, area_of, conductance_of


def _number(value: Any, slot: str, where: str, positive: bool = False) -> float:
    """Return the finite SI value of a text or a number in the unit `slot`, above zero where it must be `positive`."""
    number = amount(value, slot, where)
    if not math.isfinite(number) or (positive and number <= 0):
        raise DeckError(f"the value '{value}' must be finite{' and above zero' if positive else ''}.", where, code="value.outside-range")
    return number


def _faces(text_or_names: str | Iterable[str], where: str) -> tuple[str, ...]:
    """Return the names of faces, each once, from '+x -x', a list of names, or 'all'."""
    wanted = text_or_names.replace(",", " ").split() if isinstance(text_or_names, str) else list(text_or_names)
    names = FACES if wanted == ["all"] else tuple(wanted)
    unknown = [f for f in names if f not in FACES]
    if unknown or not names or len(set(names)) < len(names):
        raise DeckError(
            f"faces are {', '.join(FACES)}, each once, or all; not {' '.join(map(str, wanted)) or 'nothing'}.",
            where,
            code="value.wrong-kind",
        )
    return names


def _boundary(name: str, where: str) -> str:
    """Return the name of a boundary, or refuse it where it is no name."""
    if not _NAME.match(name):
        raise DeckError("give the boundary a name of letters, digits and _, beginning with a letter.", where, code="name.not-valid")
    return name


def _face_area(block: Block, axis: int) -> float:
    """Return the area of the side of one cell that faces along an axis, 0 to 2. [m^2]"""
    return math.prod(s for k, s in enumerate(block.steps) if k != axis)


def _block_model(block: Block, offers: tuple[str, ...]) -> Model:
    """Return a block as a model: nodes ``c0_0_0``, parameters where one value holds for all cells; see `Block.model`.

    Raises
    ------
    DeckError   When the block has too many cells, or a power that changes in time.
    """
    if block.count > cap("cells"):
        raise DeckError(
            f"a model of {block.count} cells would be slow; the limit is {cap('cells'):.0f}. "
            f"Simulate the block itself, or use fewer cells.{raising('cells')}",
            block.title,
            code="cap.exceeded",
        )
    for name, heater in block.heaters.items():
        if not isinstance(heater.power, Constant):
            raise DeckError(
                f"the power of '{name}' changes in time. Give the heater its full power, and a command for its loads in the scenario.",
                block.title,
                code="model.element-not-supported",
            )
    names = [f"c{'_'.join(str(i) for i in index)}" for index in np.ndindex(*block.cells)]
    parameters: dict[str, Any] = {}
    conductors = _between(block, names, parameters)
    for k, exchange in enumerate(block.exchanges):
        conductors |= _outside(block, exchange, k, names, parameters)
    deck = {
        "title": block.title,
        "needs": list(block.boundaries),
        "offers": [names[k] for k in _offered(block, offers)],
        "nodes": _nodes(block, names, parameters),
        "conductors": conductors,
        "loads": _loads(block, names, parameters),
        "parameters": parameters,
    }
    return model_from_dict({key: value for key, value in deck.items() if value})


def _offered(block: Block, offers: tuple[str, ...]) -> list[int]:
    """Return the numbers of the cells that `offers` names as cells, faces or 'all', each once."""
    cells: dict[str, Any] = {"all": range(block.count)} | {face: block.face_cells(face) for face in FACES}
    return list(dict.fromkeys(int(p) for offer in offers for p in (cells[offer] if offer in cells else [block.place(offer)])))


def _nodes(block: Block, names: list[str], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the deck's nodes, one per cell; what is uniform goes to `parameters`, else each has its capacitance."""
    if isinstance(block.density, np.ndarray) or isinstance(block.specific_heat, np.ndarray):
        return {n: {"capacitance": f"{c!r} [J/K]"} for n, c in zip(names, block.capacities().tolist(), strict=True)}
    parameters |= {"density": f"{block.density!r} [kg/m^3]", "specific_heat": f"{block.specific_heat!r} [J/(kg K)]"}
    parameters["cell_volume"] = f"{float(np.prod(block.steps))!r} [m^3]"
    return {n: {"mass": "density*cell_volume", "specific_heat": "specific_heat"} for n in names}


def _between(block: Block, names: list[str], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the deck's conductors between neighbouring cells, as table name -> fields.

    Conductances G [W/K] are those of the block's links; a uniform conductivity k [W/(m K)] goes to `parameters`, and a link then has the
    area A = G d / k [m^2] over its step d [m].
    """
    uniform = not isinstance(block.conductivity, np.ndarray)
    if uniform:
        parameters["conductivity"] = f"{block.conductivity!r} [W/(m K)]"
    _, ny, nz = block.cells
    out: dict[str, Any] = {}
    for axis, (g, step) in enumerate(zip(block.links, (ny * nz, nz, 1), strict=True)):
        thickness = block.steps[axis]
        for i in np.flatnonzero(g).tolist():
            fields = {"conductance": f"{float(g[i])!r} [W/K]"}
            if uniform:  # a factor on the link stands in its area
                area = float(g[i]) * thickness / block.conductivity
                fields = {"conductivity": "conductivity", "area": f"{area!r} [m^2]", "thickness": f"{thickness!r} [m]"}
            out[f"{names[i]}_{'xyz'[axis]}"] = {"kind": "conduction", "between": [names[i], names[i + step]], **fields}
    return out


def _outside(block: Block, exchange: Exchange, k: int, names: list[str], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the deck's conductors from the cells of the k-th exchange to its boundary; coefficients go to `parameters`."""
    out: dict[str, Any] = {}
    laws: dict[str, tuple[str, str, Mapping[str, Any]]] = {}
    if exchange.htc:
        parameters[f"htc{k}"] = f"{exchange.htc!r} [W/(m^2 K)]"
        law = {"coefficient": f"htc{k}", "exponent": exchange.exponent} if exchange.exponent else f"htc{k}"
        laws["convection"] = ("convection", exchange.to, {"htc": law})
    if exchange.emissivity:
        parameters[f"emissivity{k}"] = exchange.emissivity
        laws["radiation"] = ("radiation", exchange.to, {"emissivity": f"emissivity{k}"})
    places, areas, conductances = block.exchange_cells(exchange)
    for i, area, conductance in zip(places.tolist(), areas.tolist(), conductances.tolist(), strict=True):
        if exchange.held:
            conductor = {"kind": "conduction", "between": [names[i], exchange.to], "conductance": f"{conductance!r} [W/K]"}
            out[f"{names[i]}_held{k}"] = conductor
        for word, (kind, to, fields) in laws.items():
            out[f"{names[i]}_{word}{k}"] = {"kind": kind, "between": [names[i], to], "area": f"{area!r} [m^2]", **fields}
    return out


def _loads(block: Block, names: list[str], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the deck's loads, one per cell of each heater with its equal share; the powers go to `parameters`."""
    out: dict[str, Any] = {}
    for name, heater in block.heaters.items():
        cells = block.heater_cells(name).tolist()
        assert isinstance(heater.power, Constant)
        parameters[f"{name}_power"] = f"{heater.power.value!r} [W]"
        out |= {f"{name}_{names[i]}": {"into": names[i], "power": f"{name}_power/{len(cells)}"} for i in cells}
    return out
