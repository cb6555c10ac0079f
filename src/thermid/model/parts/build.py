"""The elements of a model from the tables of a deck; `written` goes the other way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from thermid.errors import DeckError, nearest
from thermid.model.laws.curves import INTERPOLATIONS, OUTSIDE, Curve, curve, limited
from thermid.model.laws.signal import literal
from thermid.model.laws.stores import TABULATED, melting, tabulated
from thermid.model.parts.elements import CONTROLS, LOAD_SLOTS, Conductor, HeatLoad, Joint, MadeIn, Node, Surface
from thermid.model.parts.enclosures import enclosure_from
from thermid.model.parts.facing import facing_from
from thermid.model.parts.kinds import KINDS
from thermid.model.parts.parameter import Parameter, parameter
from thermid.physics.finishes import finish
from thermid.physics.gas import GASES, gas_named

Where = Callable[[str], str]
LIQUID = "liquid"
"""What a stream names that no pressure touches."""
NODE_FIELDS = ("mass", "specific_heat", "capacitance")
MELTING = {"latent_heat": "J/kg", "melts_from": "temperature", "melts_to": "temperature", "liquid_specific_heat": "J/(kg K)"}
"""Fields of a node that melts, beside its mass and specific heat, with their units."""
SURFACE_FIELDS = ("area", "htc", "effective_htc", "emissivity", "absorptance")
JOINT_FIELDS = ("area", "contact_conductance", "conductivity", "thickness", "gap")
LOAD_FIELDS = tuple(dict.fromkeys(slot.partition(".")[0] for slot in LOAD_SLOTS))
PLAIN_GROUPS = {"to", "sensor", "correlation", "orientation"}


def _fields(table: Mapping[str, Any], names: tuple[str, ...], where: Where, key: str) -> dict[str, Parameter]:
    """Return field -> parameter; a table without `value` is a group, whose fields are ``group.field``."""
    out = {}
    for name in names:
        if name not in table:
            continue
        given = table[name]
        if isinstance(given, Mapping) and "value" not in given:
            for inner, value in given.items():
                if inner not in PLAIN_GROUPS:
                    out[f"{name}.{inner}"] = parameter(_cleaned(value), where(f"{key}.{name}.{inner}"))
        else:
            out[name] = parameter(_none(given) if name == "htc" else _cleaned(given), where(f"{key}.{name}"))
    return out


def _none(given: Any) -> Any:
    """Return a coefficient of heat transfer; a plain 0, no convection on purpose, needs no unit."""
    table = _cleaned(given)
    if isinstance(table, Mapping):
        return {**table, "value": _none(table["value"])}
    return "0 [W/(m^2 K)]" if table == 0 or table == "0" else table


def _words(table: Mapping[str, Any], names: frozenset[str]) -> dict[str, str]:
    """Return the fields of a table that are names, those of a group as ``group.field``."""
    out: dict[str, str] = {}
    for name in sorted(names):
        group, _, inner = name.partition(".")
        given = table.get(group)
        found = given.get(inner, "") if inner and isinstance(given, Mapping) else "" if inner else given
        out |= {name: str(found)} if found else {}
    return out


def _cleaned(value: Any) -> Any:
    return {k: v for k, v in value.items() if v not in (None, "")} if isinstance(value, Mapping) else value


def _points(table: Mapping[str, Any], slot: str, where: str) -> Curve | None:
    """Return the curve of a table of points."""
    given = table.get("table")
    if given is None or isinstance(given, Curve):
        return given
    over = given.get("over", "temperature")
    slots = ("temperature" if over == "temperature" else "K", slot, slope_unit(slot))
    return _curve(given, over, slots, where)


def _property(table: Mapping[str, Any], name: str, where: str) -> tuple[dict[str, Any], Curve | None]:
    """Return a table of an element without a property that is given over temperature, and that property."""
    given = table.get(name)
    if not isinstance(given, Mapping) or "points" not in given:
        return dict(table), None
    slot = TABULATED[name]
    slots = ("temperature", slot, slope_unit(slot))
    shape = _curve(given, "temperature", slots, where, steps=name == "enthalpy")
    return {k: v for k, v in table.items() if k != name}, tabulated(name, shape, where)


def _curve(given: Mapping[str, Any], over: str, slots: tuple[str, ...], where: str, steps: bool = False) -> Curve:
    """Return the curve of a table of points, each a text for every slot or for the first two."""
    points = [tuple(literal(v, s, where) for v, s in zip(p, slots, strict=False)) for p in given["points"]]
    kind, outside = given.get("interpolation") or INTERPOLATIONS[0], given.get("outside") or OUTSIDE[0]
    return curve(over, points, where, given.get("source") or "", given.get("basis") or "", kind, outside, steps)


def slope_unit(slot: str) -> str:
    """Return the unit of a slope over temperature."""
    return {"W/K": "W/K^2", "W": "W/K", "W/(m K)": "W/(m K^2)", "J/(kg K)": "J/(kg K^2)", "J/kg": "J/(kg K)"}[slot]


def elements_from(deck: Mapping[str, Any], where: Where) -> dict[str, dict[str, Any]]:
    """Return the element tables of a `Model` from those of a deck.

    Raises
    ------
    DeckError   When an element lacks what it needs, or has two of what it may have once.
    """
    return {
        "nodes": {n: _node(n, t, where) for n, t in deck["nodes"].items()},
        "surfaces": {n: _surface(n, t, where) for n, t in deck["surfaces"].items()},
        "conductors": {n: _conductor(n, t, where) for n, t in deck["conductors"].items()},
        "joints": {n: _joint(n, t, where) for n, t in deck["joints"].items()},
        "enclosures": {n: enclosure_from(t, where(f"enclosures.{n}")) for n, t in deck["enclosures"].items()},
        "loads": {n: _load(n, t, where) for n, t in deck["loads"].items()},
    }


def made_from(table: Mapping[str, Any], where: str) -> MadeIn:
    """Return the state of a gas in which a reduced model was made, from its table in a deck."""
    slots = {"pressure": "Pa", "gravity": "m/s^2", "wind": "m/s"}
    numbers = {name: literal(table[name], slot, f"{where}.{name}") for name, slot in slots.items()}
    return MadeIn(gas=gas_named(table["gas"], where).name, **numbers)


def _node(name: str, table: Mapping[str, Any], where: Where) -> Node:
    key = f"nodes.{name}"
    table = _melting(table, where(key))
    table, heat = _property(table, "specific_heat", where(f"{key}.specific_heat"))
    table, enthalpy = _property(table, "enthalpy", where(f"{key}.enthalpy"))
    fields = _fields(table, NODE_FIELDS, where, key)
    stands_for = table.get("stands_for", "")
    if heat is not None or enthalpy is not None:
        if set(fields) != {"mass"} or (heat is not None and enthalpy is not None):
            raise DeckError("a table of specific heat or of enthalpy stands beside a mass, and beside nothing else.", where(key))
        shape = ("specific_heat", heat) if heat is not None else ("enthalpy", enthalpy)
        return Node(fields, table["reference_point"], table["test_only"], shape, stands_for)  # type: ignore[arg-type]  # one of them is there
    if set(fields) not in (set(), {"capacitance"}, {"mass", "specific_heat"}):
        raise DeckError("a node has mass and specific_heat, or capacitance, or nothing (a massless node).", where(f"nodes.{name}"))
    return Node(fields, table["reference_point"], table["test_only"], None, stands_for)


def _melting(table: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """Return a node's table with an enthalpy in place of a specific heat and a latent heat."""
    given = {k: table[k] for k in MELTING if table.get(k)}
    if not given:
        return table
    if table.get("enthalpy") or not {"latent_heat", "melts_from"} <= set(given) or not isinstance(table.get("specific_heat"), str):
        raise DeckError(
            "a node that melts has mass, specific_heat, latent_heat and melts_from as plain quantities, and may have melts_to and"
            " liquid_specific_heat; or it has a table of enthalpy.",
            where,
        )
    heat = literal(table["specific_heat"], "J/(kg K)", f"{where}.specific_heat")
    values = {k: literal(v, MELTING[k], f"{where}.{k}") for k, v in given.items()}
    begins = values["melts_from"]
    shape = melting(heat, values.get("liquid_specific_heat", heat), values["latent_heat"], begins, values.get("melts_to", begins), where)
    points = [[f"{x!r} [K]", f"{y!r} [J/kg]"] for x, y in zip(shape.x.tolist(), shape.y.tolist(), strict=True)]
    left = {k: v for k, v in table.items() if k not in MELTING and k != "specific_heat"}
    return left | {"enthalpy": {"points": points}}


def _surface(name: str, table: Mapping[str, Any], where: Where) -> Surface:
    key = f"surfaces.{name}"
    fields = _fields(table, SURFACE_FIELDS, where, key)
    if "effective_htc" in fields and any(f.startswith("htc") for f in fields):
        raise DeckError(
            "a surface has htc (convection alone) or effective_htc (convection and radiation together, as fitted in air), not both.",
            where(key),
        )
    if table["finish"]:
        fields.setdefault("emissivity", finish_emissivity(table["finish"], where(f"{key}.finish")))
    if not {"htc", "htc.coefficient", "htc.length", "effective_htc", "emissivity"} & set(fields):
        raise DeckError("a surface exchanges nothing: give htc, effective_htc, emissivity or finish.", where(key))
    words = _words(table, KINDS["convection"].words)
    if table["sees"] and table["radiates_to"]:
        raise DeckError("sees and radiates_to are one thing under two names. Give sees.", where(key))
    facing = facing_from(table["facing"], where(f"{key}.facing")) if table.get("facing") else None
    sees = table["sees"] or table["radiates_to"]
    return Surface(table["of"], table["to"], fields, sees, table["test_only"], table["finish"], words, facing)


def finish_emissivity(name: str, where: str) -> Parameter:
    """Return the emissivity of a finish."""
    found = finish(name, where)
    return parameter({"value": found.typical, "min": 0.005, "max": 1.0, "source": "assumed", "basis": found.basis}, where)


def _check_stream(given: set[str], fluid: str, where: str) -> None:
    """Refuse a stream whose fluid is unknown, a gas with a density of its own, and another fluid without its properties."""
    if fluid in GASES:
        if "density" in given:
            raise DeckError(f"the density of {fluid} follows from its pressure and temperature: leave density out.", where)
        return
    if fluid not in ("", LIQUID):
        raise DeckError(
            f"no fluid is called '{fluid}'.{nearest(fluid, (*GASES, LIQUID))} There are {', '.join(GASES)} and {LIQUID}.", where
        )
    whole = given in ({"mass_flow", "specific_heat"}, {"volume_flow", "density", "specific_heat"})
    if not whole:
        what = f"of {fluid}" if fluid else "that names no fluid"
        cure = "" if fluid else '. A gas brings both with it: fluid = "air"'
        raise DeckError(
            f"a stream {what} needs volume_flow and density and specific_heat, or mass_flow and specific_heat{cure}. "
            f"Given: {', '.join(sorted(given))}.",
            where,
        )


def _conductor(name: str, table: Mapping[str, Any], where: Where) -> Conductor:
    key = f"conductors.{name}"
    kind = KINDS[table["kind"]]
    table, shape = _property(table, kind.tabulated or "conductivity", where(f"{key}.{kind.tabulated or 'conductivity'}"))
    if shape is not None and not kind.tabulated:
        raise DeckError(f"a conductor of kind '{table['kind']}' takes no table of conductivity.", where(key))
    given = _fields(table, tuple(dict.fromkeys(s.partition(".")[0] for k in KINDS.values() for s in k.slots)), where, key)
    words = _words(table, frozenset().union(*(k.words for k in KINDS.values())))
    odd = sorted(set(words) - kind.words)
    if odd:
        raise DeckError(f"a conductor of kind '{table['kind']}' has no {odd[0]}.", where(key))
    named = {*given, kind.tabulated} if shape is not None else set(given)
    if named - kind.optional not in [set(a) for a in kind.alternatives]:
        wanted = ", or ".join(" and ".join(s for s in kind.slots if s in a) for a in kind.alternatives if a)
        strange = sorted(set(given) - set(kind.slots))
        also = (
            f" It has no {', '.join(strange)}.{nearest(strange[0], kind.slots)}" if strange else f" Given: {', '.join(given) or 'nothing'}."
        )
        raise DeckError(f"a conductor of kind '{table['kind']}' needs {wanted}.{also}", where(key))
    if table["kind"] == "flow":
        _check_stream(set(given), words.get("fluid", ""), where(key))
    points = _points(table, "W/K", where(key))
    if (points is not None) != kind.needs_curve:
        raise DeckError(f"a conductor of kind '{table['kind']}' {'needs' if kind.needs_curve else 'has no'} table of points.", where(key))
    if points is not None and (points.y < 0).any():
        k = int(np.argmax(points.y < 0))
        raise DeckError(
            f"the table gives {points.y[k]:g} W/K at {points.x[k]:.9g} K; with a negative conductance heat would flow uphill.", where(key)
        )
    points = points and limited(points)
    if table["between"][0] == table["between"][1]:
        raise DeckError("both ends are the same node.", where(key))
    if table["takes"] and "area" not in given:
        raise DeckError("it takes area from a surface but has no area of its own.", where(f"{key}.takes"))
    ends = (table["between"][0], table["between"][1])
    return Conductor(table["kind"], ends, given, points or shape, tuple(table["takes"]), table["test_only"], words)


def _joint(name: str, table: Mapping[str, Any], where: Where) -> Joint:
    key = f"joints.{name}"
    fields = _fields(table, JOINT_FIELDS, where, key)
    own = {f for f in fields if not f.startswith("gap.")}
    if own not in ({"area", "contact_conductance"}, {"area", "conductivity", "thickness"}):
        raise DeckError("a joint needs area and contact_conductance, or area, conductivity and thickness, of each half.", where(key))
    if table["between"][0] == table["between"][1]:
        raise DeckError("a joint needs two surfaces; both ends are the same one.", where(key))
    return Joint((table["between"][0], table["between"][1]), fields, table["mid"], table.get("gap", {}).get("to", ""), table["test_only"])


def _load(name: str, table: Mapping[str, Any], where: Where) -> HeatLoad:
    key = f"loads.{name}"
    fields = _fields(table, LOAD_FIELDS, where, key)
    shape = _points(table, "W", where(key))
    shape = shape and limited(shape, positive=False)
    if ("power" in fields) == (shape is not None):
        raise DeckError("a load has power, or a table of power over temperature; one of them.", where(key))
    controls = [c for c in CONTROLS if c in table]
    if len(controls) > 1:
        raise DeckError(f"{' and '.join(controls)} cannot both control one load. Split it into two loads.", where(key))
    curved = [f for f in fields if f.endswith("_coefficient")]
    if curved and shape is not None:
        raise DeckError(f"{curved[0]} and a table are two laws of one temperature; put both into the table.", where(key))
    if "proportional" in table and ("proportional.gain" in fields) == ("proportional.band" in fields):
        raise DeckError("proportional needs gain [W/K] or band [K]; one of them.", where(f"{key}.proportional"))
    if "proportional.gain" in fields and shape is not None:
        raise DeckError("a gain in W/K refers to a power, which a table has not. Give band in K.", where(f"{key}.proportional"))
    if curved and "reference_temperature" not in fields:
        raise DeckError(f"{curved[0]} needs reference_temperature: the temperature at which `power` holds.", where(key))
    if "exponential_coefficient" in fields and len(curved) > 1:
        raise DeckError("exponential_coefficient and the polynomial coefficients exclude one another.", where(key))
    if "scale" in fields and shape is None:
        raise DeckError("scale belongs to a table of power; for a constant power change power itself.", where(key))
    sensor = next((table[c].get("sensor", "") for c in controls), "")
    return HeatLoad(table["into"], fields, sensor, shape, table["test_only"])
