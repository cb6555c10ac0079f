"""What the page builds with: the palette, and the sheet of an element with its values, their units and where they come from."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from thermid.base.errors import DeckError, NameNotFoundError, refuse_unknown
from thermid.campaign.start import word
from thermid.model.tree import KINDS, LOAD_SLOTS, DeckDocument, Edit, Renamed

PLACEHOLDER: Final = "a number of the palette; replace it"
"""Basis of a value that nobody gave yet."""
SOURCES: Final = ("measured", "datasheet", "published", "derived", "assumed")
NODE_FIELDS: Final = {"capacitance": "J/K", "mass": "kg", "specific_heat": "J/(kg K)"}
SURFACE_FIELDS: Final = {"area": "m^2", "effective_htc": "W/(m^2 K)", "htc": "W/(m^2 K)", "emissivity": "1"}
UNITS: Final = {
    "J/K": ("J/K", "kJ/K"),
    "kg": ("kg", "g"),
    "J/(kg K)": ("J/(kg K)",),
    "m^2": ("m^2", "cm^2", "mm^2"),
    "m": ("m", "cm", "mm"),
    "W": ("W", "mW", "kW"),
    "W/K": ("W/K", "mW/K"),
    "s": ("s", "min", "h"),
    "1": ("1",),
}
"""Units that a picker offers for a slot, the first one its unit; any other unit is typed with its value."""
ENDS: Final = {"surfaces": ("of", "to"), "loads": ("into",)}
"""Fields that name what an element is joined to; conductors have ``between``, submodels ``bind``."""
NAMING: Final = ("of", "to", "into", "sees", "radiates_to", "rest", "between", "bind", "faces", "sensor", "follows")
"""Fields in which names of nodes stand."""
SWITCHED: Final = {"surfaces": "htc_control", "loads": "control", "conductors": "control"}
"""Field that names the control of an element: a fan's schedule on a surface."""
TABLES: Final = ("surfaces", "conductors", "loads", "submodels")
"""Tables that the canvas draws beside nodes."""


def _assumed(value: str, **more: Any) -> dict[str, Any]:
    """Return a value of the palette, which somebody is to replace."""
    return {"value": value, **more, "source": "assumed", "basis": PLACEHOLDER}


@dataclass(frozen=True)
class PaletteEntry:
    """An entry of the palette.

    Parameters
    ----------
    name, words, key : str  Its name, what it is, and the letter that chooses it.
    table : str             Where its elements stand in a deck; 'needs' for a boundary.
    ends : int              How many nodes it is joined to.
    content : dict          What a new one says beside its ends.
    """

    name: str
    words: str
    key: str
    table: str
    ends: int = 0
    content: Mapping[str, Any] = field(default_factory=dict)


PALETTE: Final[Mapping[str, PaletteEntry]] = {
    s.name: s
    for s in (
        PaletteEntry(
            "mass", "a mass with one temperature", "m", "nodes", 0, {"capacitance": _assumed("100 [J/K]", min="1 [J/K]", max="1e5 [J/K]")}
        ),
        PaletteEntry("massless", "a node without heat capacity", "n", "nodes"),
        PaletteEntry("boundary", "a temperature from outside: room, plate, shroud", "b", "needs"),
        PaletteEntry(
            *("conduction", "conduction between two nodes", "k", "conductors", 2),
            {"kind": "conduction", "conductance": _assumed("1 [W/K]", min="1e-3 [W/K]", max="1e3 [W/K]")},
        ),
        PaletteEntry(
            *("contact", "two faces pressed together", "c", "conductors", 2),
            {
                "kind": "contact",
                "contact_conductance": _assumed("500 [W/(m^2 K)]", min="10 [W/(m^2 K)]", max="2e4 [W/(m^2 K)]"),
                "area": _assumed("10 [cm^2]"),
            },
        ),
        PaletteEntry(
            *("convection", "a surface to air, radiation included", "v", "surfaces", 2),
            {"area": _assumed("100 [cm^2]"), "effective_htc": _assumed("8 [W/(m^2 K)]", min="1 [W/(m^2 K)]", max="100 [W/(m^2 K)]")},
        ),
        PaletteEntry(
            *("radiation", "radiation between two nodes", "r", "conductors", 2),
            {"kind": "radiation", "emissivity": _assumed("0.8 [1]", min=0.02, max=1.0), "area": _assumed("100 [cm^2]")},
        ),
        PaletteEntry("load", "heat into a node", "l", "loads", 1, {"power": _assumed("1 [W]")}),
        PaletteEntry("sensor", "a node whose temperature is measured or judged", "s", "sensors", 1),
        PaletteEntry("submodel", "a deck of this folder as a part", "u", "submodels"),
    )
}


def palette() -> list[dict[str, Any]]:
    """Return the palette for a page."""
    return [{k: v for k, v in asdict(s).items() if k != "content"} for s in PALETTE.values()]


def added(content: Mapping[str, Any], shape: str, name: str, ends: Sequence[str], part: Mapping[str, Any]) -> tuple[list[Edit], str]:
    """Return the edits that add an element, and its name.

    Parameters
    ----------
    content : dict      Of the deck.
    shape : str         A name of the palette.
    name : str          Of the element; one of its unit is chosen where it is empty.
    ends : sequence     Nodes that it is joined to.
    part : dict         What a submodel says.

    Raises
    ------
    NameNotFoundError   When there is no such shape.
    DeckError           When an end is missing, both are one, or the name is taken.
    """
    refuse_unknown([shape], PALETTE, "palette", "no '{}' in the palette.", NameNotFoundError)
    kind = PALETTE[shape]
    if len(ends) != kind.ends or len(set(ends)) != len(ends):
        raise DeckError(f"'{shape}' joins {kind.ends} different nodes; {len(set(ends))} were chosen.", "palette", code="value.incomplete")
    if kind.table == "sensors":
        return [Edit(("nodes", ends[0], "reference_point"), True)], ends[0]
    taken = names_of(content)
    chosen = name.strip() or free_name("_".join(ends if kind.ends == 2 else (shape, *ends)), taken)
    if chosen in taken or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", chosen):
        raise _no_name(chosen)
    if kind.table == "needs":
        return [Edit(("needs",), [*content.get("needs", []), chosen])], chosen
    fields: dict[str, Any] = dict(zip(ENDS.get(kind.table, ()), ends, strict=False)) or ({"between": list(ends)} if ends else {})
    return [Edit((kind.table, chosen), {**fields, **part, **kind.content})], chosen


def free_name(wanted: str, taken: Container[str]) -> str:
    """Return a name made of letters of a wanted one that is not taken yet."""
    plain = word(wanted)
    return next(n for k in range(1, 10**6) if (n := plain if k == 1 else f"{plain}_{k}") not in taken)


def _no_name(name: str) -> DeckError:
    """Return the refusal of a name that is taken or none."""
    plain = re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII)
    why = "is taken. Give another name" if plain else f"is no name. Give letters, digits and _ only, a letter first, such as {word(name)}"
    return DeckError(f"'{name}' {why}.", "palette", code="output.edit-refused")


def stored(content: Mapping[str, Any], name: str, how: str) -> list[Edit]:
    """Return the edits that give a node its heat by 'capacitance', by 'mass' and specific heat, or by nothing.

    Raises
    ------
    NameNotFoundError   When there is no such way.
    """
    ways = {
        "capacitance": {"capacitance": PALETTE["mass"].content["capacitance"]},
        "mass": {"mass": _assumed("100 [g]", min="1 [g]", max="100 [kg]"), "specific_heat": _assumed("900 [J/(kg K)]")},
        "massless": {},
    }
    refuse_unknown([how], ways, name, "no '{}' among the ways to store heat.", NameNotFoundError)
    gone = [k for k in NODE_FIELDS if k in content["nodes"][name]]
    return [*(Edit(("nodes", name, k)) for k in gone), *(Edit(("nodes", name, k), v) for k, v in ways[how].items())]


def scheduled(content: Mapping[str, Any], keys: Sequence[str], on: str, off: str, share: str) -> list[Edit]:
    """Return the edits that switch an element over and over, from the start of a run; without a time that it is on they end that.

    Parameters
    ----------
    content, keys   Of the deck; table and name of the element.
    on, off : str   How long it is on, then off, with units.
    share : str     What is left of its power or coefficient while it is off. [-]

    Raises
    ------
    NameNotFoundError   When such an element cannot be switched.
    """
    table, name = keys
    refuse_unknown([table], SWITCHED, name, "what stands in '{}' is not switched.", NameNotFoundError)
    naming = (table, name, SWITCHED[table])
    control = content[table][name].get(SWITCHED[table]) or free_name(f"{name}_schedule", set(content.get("controls", {})))
    if not on.strip():
        return [Edit(naming), Edit(("controls", control))]
    turns = {"ends": {"from": "on", "to": "off", "after": on}, "begins": {"from": "off", "to": "on", "after": off or on}}
    course = {"modes": {"on": 1, "off": share or "0"}, "starts": "on", "transitions": turns}
    return [Edit(("controls", control), course), Edit(naming, control)]


def _schedule_of(content: Mapping[str, Any], table: str, name: str) -> dict[str, str] | None:
    """Return how long an element is on and off, and its share then; None where the sheet does not say it."""
    if table not in SWITCHED:
        return None
    control = content[table][name].get(SWITCHED[table])
    if not control:
        return {"on": "", "off": "", "share": ""}
    if sum(control in (e.get("control"), e.get("htc_control")) for t in TABLES for e in content.get(t, {}).values()) > 1:
        return None  # it switches others too
    try:
        course = content["controls"][control]
        turns = course["transitions"]
        return {"on": str(turns["ends"]["after"]), "off": str(turns["begins"]["after"]), "share": str(course["modes"]["off"])}
    except (KeyError, TypeError):
        return None


def schedules(content: Mapping[str, Any]) -> set[str]:
    """Return the names of controls that are schedules of an element and that its sheet says."""
    pairs = ((t, n) for t in SWITCHED for n in content.get(t, {}))
    return {str(content[t][n][SWITCHED[t]]) for t, n in pairs if (s := _schedule_of(content, t, n)) and s["on"]}


def names_of(content: Mapping[str, Any]) -> set[str]:
    """Return the names that are taken: of nodes, boundaries and everything that may be joined or fitted."""
    return {*content.get("needs", []), *(name for table in ("nodes", "parameters", *TABLES) for name in content.get(table, {}))}


def removed(content: Mapping[str, Any], keys: Sequence[str]) -> list[Edit]:
    """Return the edits that take an element away, with everything that is joined to it."""
    table, name = keys
    if table == "needs":
        edits = [Edit(("needs",), [n for n in content["needs"] if n != name])]
    else:
        edits = [Edit((table, name))]
    if table not in ("nodes", "needs", "submodels"):
        now = _schedule_of(content, table, name)
        return [*edits, *([Edit(("controls", content[table][name][SWITCHED[table]]))] if now and now["on"] else [])]
    others = [(t, n, e) for t in TABLES for n, e in content.get(t, {}).items() if (t, n) != (table, name)]
    joined = [(t, n) for t, n, e in others if any(end == name or end.startswith(f"{name}.") for end in ends_of(e))]
    return [*(Edit(pair) for pair in joined), *edits]


def ends_of(element: Mapping[str, Any]) -> list[str]:
    """Return the nodes that an element is joined to."""
    if "between" in element:
        return list(element["between"])
    if "use" in element:
        return [b if isinstance(b, str) else str(b["to"]) for b in element.get("bind", {}).values()]
    return [str(element[key]) for key in ("of", "into", "to") if key in element]


def renamed(content: Mapping[str, Any], keys: Sequence[str], name: str) -> list[Edit]:
    """Return the edits that give an element another name, everywhere that it stands.

    Raises
    ------
    DeckError   When the name is taken, or no name.
    """
    table, old = keys
    if name in names_of(content) or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise _no_name(name)
    if table == "needs":
        edits = [Edit(("needs",), [name if n == old else n for n in content["needs"]])]
    else:
        edits = [Edit((table, old), Renamed(name))]
    if table in ("nodes", "needs", "submodels"):
        tables = [t for t, v in content.items() if isinstance(v, Mapping) and t not in ("parameters", "nodes", "set", "aliases")]
        edits += [
            Edit((t, n, key), new)
            for t in tables
            for n, element in content[t].items()
            if isinstance(element, Mapping)
            for key in NAMING
            if key in element and (new := _replaced(element[key], old, name)) != element[key]
        ]
    return edits


def _replaced(value: Any, old: str, new: str) -> Any:
    """Return a value with a name replaced by another, in texts, lists and tables."""
    if isinstance(value, str):
        return new + value[len(old) :] if value == old or value.startswith(f"{old}.") else value
    if isinstance(value, list):
        return [_replaced(v, old, new) for v in value]
    return {k: _replaced(v, old, new) for k, v in value.items()} if isinstance(value, Mapping) else value


def valued(content: Mapping[str, Any], keys: Sequence[str | int], text: str, source: str) -> list[Edit]:
    """Return the edits that set the value and the source of a field; an empty text removes the field.

    Where the field is no table yet, it becomes one if there is a source, and a plain text otherwise. A placeholder of the palette loses
    its mark and its source. In any other table only what differs is changed; an empty source removes the old one.
    """
    here: Any = content
    for key in keys:
        here = here.get(key) if isinstance(here, Mapping) else None
    where = tuple(keys)
    if not text.strip():
        return [Edit(where)]
    if not isinstance(here, Mapping):
        return [Edit(where, {"value": text, "source": source} if source else text)]
    if here.get("basis") == PLACEHOLDER:
        rest = {k: v for k, v in here.items() if k not in ("source", "basis")}
        return [Edit(where, {**rest, "value": text} | ({"source": source} if source else {}))]
    edits = [Edit((*where, "value"), text)] if here.get("value") != text else []
    if source and here.get("source") != source:
        edits.append(Edit((*where, "source"), source))
    return edits if source or "source" not in here else [*edits, Edit((*where, "source"))]


def sheets(document: DeckDocument) -> Iterator[dict[str, Any]]:
    """Yield every element that the canvas draws, with its ends and fields; boundaries among them."""
    content = document.content
    for name in content.get("needs", []):
        yield {"table": "needs", "name": name, "shape": "boundary", "ends": [], "fields": [], "sensor": False}
    for name, element in content.get("nodes", {}).items():
        massless = not {"capacitance", "mass", "enthalpy"} & set(element)
        yield {
            **{"table": "nodes", "name": name, "shape": "massless" if massless else "mass", "ends": []},
            **{"fields": _fields(element, NODE_FIELDS), "sensor": bool(element.get("reference_point"))},
        }
    for table in TABLES:
        for name, element in content.get(table, {}).items():
            kind = str(element.get("kind", {"surfaces": "convection", "loads": "load"}.get(table, "submodel")))
            slots = KINDS[kind].slots if table == "conductors" and kind in KINDS else {}
            slots = {"surfaces": SURFACE_FIELDS, "loads": LOAD_SLOTS}.get(table, slots)
            out = {"table": table, "name": name, "shape": kind, "ends": ends_of(element), "fields": _fields(element, slots)}
            yield out | {
                "sensor": False,
                "use": element.get("use", ""),
                "bind": element.get("bind", {}),
                "schedule": _schedule_of(content, table, name),
            }


def _fields(element: Mapping[str, Any], slots: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the fields of an element that are values, those that it has first."""
    names = sorted((n for n in slots if "." not in n), key=lambda n: n not in element)
    return [_field(name, element.get(name), slots[name]) for name in names]


def _field(name: str, written: Any, slot: str) -> dict[str, Any]:
    """Return a field of a sheet: its text, number, unit and the units that a picker offers."""
    table = written if isinstance(written, Mapping) else {} if written is None else {"value": written}
    text = str(table.get("value", ""))
    plain = re.fullmatch(r"\s*([-+0-9.eE]+)\s*(?:\[([^\]]*)\])?\s*", text)
    number, unit = (plain[1], plain[2] or slot) if plain else (text, "")
    units = list(dict.fromkeys([*([unit] if unit else []), *UNITS.get(slot, (slot,))]))
    return {
        **{"name": name, "number": number, "unit": unit or slot, "units": units, "expression": bool(text) and not plain},
        **{"source": table.get("source", ""), "given": bool(table), "law": bool(table) and "value" not in table},
        **{"missing": table.get("basis") == PLACEHOLDER, "low": str(table.get("min", "")), "high": str(table.get("max", ""))},
        "spread": str(table.get("spread", "")),
    }
