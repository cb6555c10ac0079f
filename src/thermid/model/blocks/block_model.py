"""A small block as an ordinary `Model`: a part of another model, or something to be calibrated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from thermid.errors import DeckError
from thermid.model.blocks.block import FACES, Block, Exchange
from thermid.model.blocks.block_cells import exchange_cells, links
from thermid.model.deck.modelfile import model_from_dict
from thermid.model.laws.signal import Constant
from thermid.model.tree.model import Model

MOST_CELLS: Final = 20_000


def block_model(block: Block, offers: tuple[str, ...]) -> Model:
    """Return a block as a model: nodes ``c0_0_0``, parameters where one value holds for all cells; see `Block.model`.

    Raises
    ------
    DeckError   When the block has too many cells, or a power that changes in time.
    """
    if block.count > MOST_CELLS:
        raise DeckError(f"a model of {block.count} cells would be slow; at most {MOST_CELLS}. Simulate the block itself.", block.title)
    for name, heater in block.heaters.items():
        if not isinstance(heater.power, Constant):
            raise DeckError(
                f"the power of '{name}' changes in time. Give the heater its full power and let the scenario command its loads.",
                block.title,
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
    """Return the places of the cells that others may attach to, each once."""
    found: dict[int, None] = {}
    for offer in offers:
        places = range(block.count) if offer == "all" else block.face_cells(offer) if offer in FACES else [block.place(offer)]
        found |= dict.fromkeys(int(p) for p in places)
    return list(found)


def _nodes(block: Block, names: list[str], parameters: dict[str, Any]) -> dict[str, Any]:
    if isinstance(block.density, np.ndarray) or isinstance(block.specific_heat, np.ndarray):
        return {n: {"capacitance": f"{c!r} [J/K]"} for n, c in zip(names, block.capacities().tolist(), strict=True)}
    parameters |= {"density": f"{block.density!r} [kg/m^3]", "specific_heat": f"{block.specific_heat!r} [J/(kg K)]"}
    parameters["cell_volume"] = f"{float(np.prod(block.steps))!r} [m^3]"
    return {n: {"mass": "density*cell_volume", "specific_heat": "specific_heat"} for n in names}


def _between(block: Block, names: list[str], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the conductors between cells."""
    uniform = not isinstance(block.conductivity, np.ndarray)
    if uniform:
        parameters["conductivity"] = f"{block.conductivity!r} [W/(m K)]"
    _, ny, nz = block.cells
    out: dict[str, Any] = {}
    for axis, (g, step) in enumerate(zip(links(block), (ny * nz, nz, 1), strict=True)):
        thickness = block.steps[axis]
        for i in np.flatnonzero(g).tolist():
            fields = {"conductance": f"{float(g[i])!r} [W/K]"}
            if uniform:  # a factor on the link stands in its area
                area = float(g[i]) * thickness / block.conductivity
                fields = {"conductivity": "conductivity", "area": f"{area!r} [m^2]", "thickness": f"{thickness!r} [m]"}
            out[f"{names[i]}_{'xyz'[axis]}"] = {"kind": "conduction", "between": [names[i], names[i + step]], **fields}
    return out


def _outside(block: Block, exchange: Exchange, k: int, names: list[str], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the conductors of an exchange, its coefficients as parameters."""
    out: dict[str, Any] = {}
    laws: dict[str, tuple[str, str, Mapping[str, Any]]] = {}
    if exchange.htc:
        parameters[f"htc{k}"] = f"{exchange.htc!r} [W/(m^2 K)]"
        law = {"coefficient": f"htc{k}", "exponent": exchange.exponent} if exchange.exponent else f"htc{k}"
        laws["convection"] = ("convection", exchange.to, {"htc": law})
    if exchange.emissivity:
        parameters[f"emissivity{k}"] = exchange.emissivity
        laws["radiation"] = ("radiation", exchange.radiates_to, {"emissivity": f"emissivity{k}"})
    places, areas, conductances = exchange_cells(block, exchange)
    for i, area, conductance in zip(places.tolist(), areas.tolist(), conductances.tolist(), strict=True):
        if exchange.held:
            given = {"kind": "conduction", "between": [names[i], exchange.to], "conductance": f"{conductance!r} [W/K]"}
            out[f"{names[i]}_held{k}"] = given
        for word, (kind, to, fields) in laws.items():
            out[f"{names[i]}_{word}{k}"] = {"kind": kind, "between": [names[i], to], "area": f"{area!r} [m^2]", **fields}
    return out


def _loads(block: Block, names: list[str], parameters: dict[str, Any]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name, heater in block.heaters.items():
        cells = block.heater_cells(name).tolist()
        assert isinstance(heater.power, Constant)
        parameters[f"{name}_power"] = f"{heater.power.value!r} [W]"
        out |= {f"{name}_{names[i]}": {"into": names[i], "power": f"{name}_power/{len(cells)}"} for i in cells}
    return out
