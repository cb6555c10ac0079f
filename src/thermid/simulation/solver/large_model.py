"""Ordinary models with many nodes on the integrator of large networks: when, and how their rows become flat arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError, nearest
from thermid.network.eliminate import held_in
from thermid.simulation.solver.beyond import NEAR
from thermid.simulation.solver.large import METHODS, Watched, integrate
from thermid.simulation.solver.sparse import NONE, LoadGroup, RowGroup, SparseNetwork, link_arrays

if TYPE_CHECKING:
    from thermid.simulation.solver.engine import Answer, Engine, Options
    from thermid.simulation.solver.wiring import Assembled

Array = NDArray[np.float64]
LARGE_FROM: Final = 500
"""Nodes from which a model is run as a large network: the small integrator's dense matrices grow with the third power."""
OTHERS: Final = ("auto", "integrator", "modal")


def takes_over(engine: Engine, options: Options, gradients: bool) -> bool:
    """Return whether a model is run as a large network: asked for by name, or large and of a form that can be.

    Raises
    ------
    ScenarioError   When the method does not exist, or cannot run this model.
    """
    method, where = options.method, f"{engine.wiring.network.title}, {engine.wiring.scenario.title}"
    if method not in METHODS and method not in OTHERS:
        known = (*OTHERS, *METHODS)
        raise ScenarioError(f"there is no method '{method}'.{nearest(method, known)} There are {', '.join(dict.fromkeys(known))}.", where)
    if method not in METHODS or (method == "auto" and _size(engine) < LARGE_FROM):
        return False
    why = "sensitivities are asked for, which large networks do not carry" if gradients else refusal(engine)
    if why and method != "auto":
        raise ScenarioError(f"method '{method}' cannot run this model: {why}. Leave the method out.", where)
    return not why


def _size(engine: Engine) -> int:
    """Return how many nodes a model has, the heat of one that stores it by a table not counted beside it."""
    stores = engine.wiring.network.stores
    return len(engine.nodes) - sum(held_in(n) in engine.nodes for n in stores)


def refusal(engine: Engine) -> str:
    """Return why a model cannot be run as a large network; empty when it can."""
    s = engine.wiring.structure()
    follows, n = s["coefficient_input"], len(engine.nodes)
    for form, a, _, places, curve, name in s["conductors"]:
        if form == "flow":
            return f"'{name}' carries heat one way"
        if any(follows[p] >= 0 for p in places[1:]):
            return f"the {'exponent' if form == 'power' else 'pressure'} of '{name}' changes in time"
        if (form == "hinge of difference" or (curve is not None and curve.over == "difference")) and a >= n:
            return f"'{name}' is a table over a difference that begins at a boundary"
    heated = {control: node for _, node, _, _, _, control in s["loads"]}
    first = {places[0] for _, _, places, _, _, _ in s["loads"]}
    for k, (control, sensor, places, name) in enumerate(s["controls"]):
        if control == "thermostat":
            return f"'{name}' is a thermostat"
        if sensor != heated[k]:
            return f"'{name}' follows the temperature of another node"
        if any(follows[p] >= 0 for p in places if p not in first):
            return f"a coefficient of '{name}' changes in time"
    for _, _, places, _, name, _ in s["loads"]:
        if any(follows[p] >= 0 for p in places[1:]):
            return f"a coefficient of '{name}' changes in time"
    return ""


def sparse_of(engine: Engine, a: Assembled) -> SparseNetwork:
    """Return a model's numbers as flat arrays."""
    wiring = engine.wiring
    s, c = wiring.structure(), a.coefficients
    follows = s["coefficient_input"]
    stored = a.reduced.stored
    place = _places(engine, a)
    first = [n for n in engine.nodes if n not in stored]
    links, rows = _conductors([r for r in s["conductors"] if r[5] not in stored], c, follows, place, len(first))
    loads = []
    for tag, (form, node, places, curve, _, j) in enumerate(s["loads"]):
        law = np.zeros((4, 1))
        law[: len(places), 0] = c[places]
        control, settings = "", np.zeros((3, 1))
        if j >= 0:
            control, _, own, _ = s["controls"][j]
            settings[: len(own), 0] = [np.nan if p == places[0] else c[p] for p in own]
        loads.append(LoadGroup(form, tag, np.array([place[node]], dtype=np.int32), law, follows[places[0]], curve, control, settings))
    gains = tuple(follows[g] if g >= 0 else NONE for g in s["gain"])
    offsets = np.array([c[k] for k in s["offset"]], dtype=float)
    signals = tuple(wiring.signals[name] for name in wiring.used)
    names = tuple(r[4] for r in s["loads"])
    capacities, stores = np.zeros(len(first)), {}
    index = {n: k for k, n in enumerate(first)}
    np.add.at(capacities, place, engine.capacities(a))  # that of a node stands with what holds its heat
    for node, store in stored.values():
        stores[index[node]] = store.curve
    return SparseNetwork(capacities, links, rows, loads, names, wiring.network.boundaries, gains, offsets, signals, stores)


def _places(engine: Engine, a: Assembled) -> NDArray[np.int32]:
    """Return the place in the large network of every node; that of the heat that a node holds is the node's own."""
    stored = a.reduced.stored
    known = {n: k for k, n in enumerate(n for n in engine.nodes if n not in stored)}
    return np.array([known[stored[n][0] if n in stored else n] for n in engine.nodes], dtype=np.int32)


def _levelled(engine: Engine, a: Assembled, temperatures: Array) -> Array:
    """Return what the small integrator solves for, levels too, from the temperatures of a large network. [K]"""
    found = temperatures[_places(engine, a)]
    for k, name in enumerate(engine.nodes):
        if name in a.reduced.stored:
            found[k] = float(a.reduced.stored[name][1].level(found[k]))
    return found


def _conductors(table: Sequence[Any], c: Array, follows: Sequence[int], place: NDArray[np.int32], n: int) -> tuple[Any, list[RowGroup]]:
    """Return the constant links between nodes, and the other conductors in groups."""
    links: list[tuple[int, int, float]] = []
    groups: dict[tuple[Any, ...], list[tuple[int, int, float]]] = {}
    curves = {}
    for form, one, other, places, curve, _ in table:
        a, b = (int(place[k]) if k < place.size else k - place.size + n for k in (one, other))
        if a >= n and b >= n:
            continue  # heat between two given temperatures changes no unknown
        first, second = (b, a) if a >= n else (a, b)
        given = follows[places[0]]
        if form == "linear" and second < n and given < 0:
            links.append((first, second, c[places[0]]))
            continue
        exponent = c[places[1]] if len(places) > 1 else 0.0
        boundary = second - n if second >= n else NONE
        groups.setdefault((form, boundary, given, id(curve), exponent), []).append((first, 0 if boundary >= 0 else second, c[places[0]]))
        curves[id(curve)] = curve
    ends = np.array([row[:2] for row in links], dtype=np.int32).reshape(-1, 2)
    made = link_arrays(ends[:, 0], ends[:, 1], np.array([row[2] for row in links], dtype=float), n)
    rows = []
    for (form, boundary, given, curve_id, exponent), found in groups.items():
        at = np.array([row[:2] for row in found], dtype=np.int32)
        values = np.array([row[2] for row in found], dtype=float)
        rows.append(RowGroup(form, boundary, at[:, 0], at[:, 1], values, float(exponent), given, curves[curve_id]))
    return made, rows


def integrate_model(
    engine: Engine, a: Assembled, times: Array, nodes: Sequence[str], end: float, options: Options, extremes: bool = False
) -> Answer:
    """Return what `Engine.integrate` does, by the integrator of large networks."""
    from thermid.simulation.solver.engine import Answer

    network = sparse_of(engine, a)
    place, size = _places(engine, a), network.capacities.size
    held = np.array([n in a.reduced.stored for n in engine.nodes], dtype=bool)
    index = {name: int(place[k]) + (size if held[k] else 0) for k, name in enumerate(engine.nodes)}
    watched = [Watched("mean", np.array([index[n]], dtype=np.int32), np.ones(1)) for n in nodes]
    names = [n for n in engine.nodes if n not in a.reduced.stored]
    initial = a.initial[~held]
    initial[place[held]] = a.initial[held]

    def left(time: float, temperatures: Array) -> str:
        return engine.left(a, time, _levelled(engine, a, temperatures), NEAR)

    where = f"{engine.wiring.network.title}, {engine.wiring.scenario.title}"
    beyond = left if engine.refuses else None
    found = integrate(network, initial, end, times, watched, np.zeros(0), options, where, names.__getitem__, extremes, beyond)
    slopes = np.zeros((times.size, len(nodes), 0))
    energies = (found.load_energy, found.boundary_energy, np.zeros(0))
    on = np.zeros(len(engine.control_names), dtype=np.int32)
    turnings = dict(zip(nodes, found.turnings, strict=True)) if found.turnings is not None else None
    return Answer(
        found.watched,
        slopes,
        a.initial,
        np.where(held, found.levels[place], found.final[place]),
        *energies,
        end,
        found.statistics,
        on,
        (),
        turnings,
    )


def settle_model(engine: Engine, a: Assembled, time: float) -> Array | None:
    """Return the steady temperatures (nodes,) [K] of a model with many nodes; None where the dense way is to be taken."""
    # powers that never grow with temperature, so that a balance is stable
    if _size(engine) < LARGE_FROM or engine.refuses or refusal(engine) or any(r[0] != "signal" for r in engine.wiring.structure()["loads"]):
        return None
    from thermid.simulation.solver.large_steady import settle_large

    rest = settle_large(sparse_of(engine, a), time, f"{engine.wiring.network.title}, {engine.wiring.scenario.title}")[0]
    return _levelled(engine, a, rest)
