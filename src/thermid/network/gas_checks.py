"""What the gas of a run asks of a model: what it must say of its surfaces, and what a reader must know of heat paths without gas."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thermid.errors import ScenarioError, quoted
from thermid.model.tree.flat import Flat, FlatConductor, bare, gas_nodes, still, surrounding
from thermid.network.medium import VACUUM_LIMIT, Media
from thermid.physics.constants import ATMOSPHERE

THIN = 0.01 * ATMOSPHERE
"""Pressure at which natural convection is a tenth of that on the ground, (p/p0)^(1/2): radiation is most of what a surface gives. [Pa]"""
TRACE = 1e-9
"""Conductance that stays with gas that is gone, so that its node has a temperature, that of what is around it. [W/K]"""
SOLID = ("conduction", "contact", "table", "heat_pipe")
"""Kinds of conductors that gas has no part in."""


def refuse_unsaid(media: Media, flat: Flat) -> None:
    """Refuse surfaces that say nothing of what is left to them in the gas of a run, or without, and reduced models in another gas.

    Raises
    ------
    ScenarioError   When a surface or lead has a convection alone and its gas is gone at any time; when a surface has radiation alone in a
                    gas; when a reduced model is not in the gas that it was made in.
    """
    thin = {} if media.as_printed else {path: gas for path, gas in bare(flat).items() if media.lowest(gas) <= VACUUM_LIMIT}
    if thin:
        has, them = ("have", "them") if len(thin) > 1 else ("has", "it")
        raise ScenarioError(
            f"{quoted(list(thin))} {has} htc and no emissivity: without gas in {_gases(thin)} nothing would leave {them}. "
            "Give an emissivity or a finish; emissivity = 0 where nothing radiates on purpose.",
            _where(flat, next(iter(thin))),
        )
    filled = {path: gas for path, gas in still(flat).items() if not media.empty(gas)}
    if filled:
        has, they = ("have", "they") if len(filled) > 1 else ("has", "it")
        raise ScenarioError(
            f"{quoted(list(filled))} {has} an emissivity and no htc: in the gas of {_gases(filled)} {they} would have no convection. "
            "Give htc, as a value or from a correlation, htc = { length = ... }; htc = 0 where nothing convects on purpose. "
            "Where no gas is, say so: environment, pressure = '0 [Pa]' (--vacuum).",
            _where(flat, next(iter(filled))),
        )
    for title, gas, state, where in flat.made_in:
        if not media.as_made(gas, state):
            of = "its gas" if gas == "*" else f"'{gas}'"
            raise ScenarioError(
                f"'{title}' was reduced with {of} in one state, {state}, which its conductances hold; it is in another here. "
                "Reduce the full model in the state of this run.",
                where,
            )


def _gases(found: Mapping[str, str]) -> str:
    return quoted(list(dict.fromkeys(found.values())))


def _where(flat: Flat, path: str) -> str:
    """Return the place of a surface or of a lead."""
    face = flat.faces.get(path)
    return face.where if face else next(c.where for c in flat.conductors if c.path.startswith(path))


def traced(media: Media, flat: Flat) -> frozenset[str]:
    """Return the conductors that keep `TRACE`: to inner gas that is gone at any time and that no load heats."""
    heated = {load.node for load in flat.loads}
    gone = {gas for gas in gas_nodes(flat) - heated if media.lowest(gas) <= VACUUM_LIMIT}
    return frozenset(c.path for c in flat.conductors if c.kind in ("convection", "effective") and c.gas in gone)


def gas_remarks(media: Media, flat: Flat, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what stops and what stays in each gas that is gone at any time, and what is not counted where gas is thin or walls are apart.

    Parameters
    ----------
    values : dict   Parameter path -> value. [SI]
    """
    out = []
    gone = {c.gas for c in flat.conductors if c.gas and media.lowest(c.gas) <= VACUUM_LIMIT and not media.as_printed}
    stops = [path for path, c in _through_gas(flat).items() if c.gas in gone and not _radiates(flat, path, c, values)]
    if stops:
        out.append(f"without gas nothing goes through {quoted(stops)}")
    around = gone & surrounding(flat)
    stays = [c.path for c in flat.conductors if c.kind in SOLID and around & set(c.ends)]
    if stays:
        end, stay = ("end", "stay") if len(stays) > 1 else ("ends", "stays")
        ends = dict.fromkeys(e for c in flat.conductors if c.path in stays for e in c.ends if e in around)
        out.append(
            f"{quoted(stays)} {end} in {quoted(list(ends))} and {stay} without its gas: a path through gas is of kind convection or gas"
        )
    thin = [path for path, gas in bare(flat).items() if VACUUM_LIMIT < media.lowest(gas) < THIN]
    if thin and not media.as_printed:
        has = "have" if len(thin) > 1 else "has"
        out.append(f"{quoted(thin)} {has} no emissivity: in gas so thin most of what leaves a surface is radiation, which is not counted")
    whole = [c.path for c in flat.conductors if c.kind == "effective" and c.sees and not media.empty(c.gas)]
    if whole:
        out.append(
            f"the radiation in the effective coefficient of {quoted(whole)} goes to its gas, not to what it sees; `split` takes it apart"
        )
    return tuple(out)


def _through_gas(flat: Flat) -> dict[str, FlatConductor]:
    """Return what carries heat through gas alone, or through gas and by radiation: surfaces, gaps, leads by their paths in a deck."""
    found = {c.path: c for c in flat.conductors if c.kind in ("convection", "effective", "gas")}
    leads = (c for c in flat.conductors if c.kind == "lead" and {"htc", "effective_htc"} & set(c.fields))
    return found | {c.path.removesuffix(".first").removesuffix(".second"): c for c in leads}


def _radiates(flat: Flat, path: str, c: FlatConductor, values: Mapping[str, Any]) -> bool:
    """Return whether something of a surface or lead is left without gas."""
    face = flat.faces.get(path)
    emissivity = face.fields.get("emissivity", "") if face else c.fields.get("emissivity", "")
    return bool(emissivity) and bool(values[emissivity] != 0.0)
