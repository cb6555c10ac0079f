"""Two versions of a deck: every planted difference is named, and a deck written in another way differs in nothing."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.campaign._judge.changes import compare_models

DECK: dict[str, Any] = {
    "title": "box",
    "needs": ["air", "wall"],
    "parameters": {"area": "0.1 [m^2]", "paint": {"value": 0.8, "min": 0.6, "max": 0.95, "spread": 0.04}, "share": 0.25},
    "nodes": {
        "box": {"mass": "2 [kg]", "specific_heat": "900 [J/(kg K)]"},
        "lid": {"capacitance": "300 [J/K]"},
        "wax": {"mass": "0.1 [kg]", "specific_heat": {"points": [["0 [degC]", "800 [J/(kg K)]"], ["80 [degC]", "1600 [J/(kg K)]"]]}},
        "seam": {},
    },
    "surfaces": {"side": {"of": "box", "to": "air", "area": "0.05 [m^2]", "htc": "6 [W/(m^2 K)]", "emissivity": 0.7}},
    "conductors": {
        "free": {
            "kind": "convection",
            "between": ["box", "air"],
            "htc": {"coefficient": "1.4 [W/(m^2 K)]", "exponent": 0.25},
            "area": "area",
        },
        "glow": {"kind": "radiation", "between": ["lid", "wall"], "emissivity": "paint", "area": "share*area"},
        "first": {"kind": "conduction", "between": ["box", "seam"], "conductance": "2 [W/K]"},
        "second": {"kind": "conduction", "between": ["seam", "lid"], "resistance": "0.5 [K/W]"},
        "pad": {"kind": "contact", "between": ["box", "wax"], "contact_conductance": "40 [W/(m^2 K)]", "area": "share*area"},
        "blow": {"kind": "flow", "between": ["air", "lid"], "mass_flow": "1e-4 [kg/s]", "specific_heat": "1006 [J/(kg K)]"},
        "strap": {
            "kind": "table",
            "between": ["lid", "wall"],
            "table": {"points": [["0 [degC]", "0.2 [W/K]"], ["80 [degC]", "0.4 [W/K]"]]},
        },
    },
    "loads": {
        "heater": {
            "into": "box",
            "power": "30 [W]",
            "thermostat": {"sensor": "lid", "on_below": "5 [degC]", "off_above": "9 [degC]"},
        },
        "chips": {"into": "lid", "power": "3 [W]"},
        "breath": {"into": "lid", "power": "3 [W]", "sine": {"amplitude": "1 [W]", "period": "1 [h]"}},
    },
}


def test_differences_without_an_effect_are_listed_by_name() -> None:
    """Parts that one version alone has, and laws that differ, follow their names, whatever the seed of Python's hashes."""
    names = [f"wall_{letter}" for letter in "abcdefgh"]
    wall = {"kind": "conduction", "between": ["box", "seam"]}
    old, other = copy.deepcopy(DECK), copy.deepcopy(DECK)
    for k, name in enumerate(names):
        old["conductors"][name] = {**wall, "conductance": "1 [W/K]"}
        if k >= 4:
            other["conductors"][name] = {**wall, "table": {"points": [["0 [degC]", "1 [W/K]"], ["9 [degC]", "2 [W/K]"]]}, "kind": "table"}
    changes = compare_models(td.model_from_dict(old), td.model_from_dict(other)).changes
    assert [c.path for c in changes if c.path in names and "only in" in c.what] == names[:4]
    assert [c.path for c in changes if c.path in names and "only in" not in c.what] == names[4:]


def _leaves(table: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Every number of a deck with its place."""
    items = table.items() if isinstance(table, Mapping) else enumerate(table) if isinstance(table, list) else ()
    for key, value in items:
        if isinstance(value, Mapping | list):
            yield from _leaves(value, (*path, key))
        elif isinstance(value, int | float) or (isinstance(value, str) and value[:1].isdigit()):
            yield (*path, key), value


def _put(deck: dict[str, Any], path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    made = copy.deepcopy(deck)
    place: Any = made
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return made


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, int | float):
        return value * factor
    number, _, unit = value.partition(" ")
    return f"{float(number) * factor or factor!r} {unit}"


def _without(deck: dict[str, Any], group: str, name: str) -> dict[str, Any]:
    made = copy.deepcopy(deck)
    del made[group][name]
    return made


def planted() -> list[tuple[str, str, dict[str, Any]]]:
    """Name, what the difference must name, and the deck with it."""
    out = [(".".join(map(str, path)), str(path[1]), _put(DECK, path, _scaled(value, 1.01))) for path, value in _leaves(DECK)]
    gone = [(group, name) for group in ("surfaces", "conductors", "loads") for name in DECK[group] if name not in ("first", "second")]
    out += [(f"without {name}", name, _without(DECK, group, name)) for group, name in gone]
    moved = {
        ("conductors", "free", "between"): ["box", "wall"],
        ("conductors", "glow", "between"): ["lid", "air"],
        ("conductors", "first", "between"): ["wax", "seam"],
        ("conductors", "blow", "between"): ["lid", "air"],
        ("conductors", "second", "between"): ["seam", "wax"],
        ("loads", "chips", "into"): "box",
        ("loads", "breath", "into"): "wax",
        ("loads", "heater", "thermostat", "sensor"): "wax",
        ("surfaces", "side", "of"): "lid",
        ("surfaces", "side", "to"): "wall",
        ("conductors", "pad", "area"): "0.3*area",
        ("conductors", "glow", "area"): "0.5*area",
        ("conductors", "pad", "kind"): "pad",
        ("nodes", "seam"): {"capacitance": "1 [J/K]"},
        ("nodes", "lid"): {},
        ("nodes", "tab"): {"capacitance": "1 [J/K]"},
        ("needs",): ["air", "wall", "sky"],
        ("parameters", "paint", "spread"): "range",
        ("parameters", "paint"): {"value": 0.8, "min": 0.6, "max": 0.95},
    }
    joined = {"between": ["tab", "box"], "kind": "conduction", "conductance": "1 [W/K]"}
    for path, value in moved.items():
        made = _put(DECK, path, value)
        if path == ("nodes", "tab"):
            made = _put(made, ("conductors", "tab_to_box"), joined)
        if path == ("needs",):
            made = _put(made, ("conductors", "tab_to_box"), joined | {"between": ["lid", "sky"]})
        if path == ("conductors", "pad", "kind"):
            made = _put(DECK, path[:-1], {"kind": "conduction", "between": ["box", "wax"], "conductance": "1.1 [W/K]"})
        out.append((".".join(map(str, path)), "sky" if path == ("needs",) else str(path[1]), made))
    return out


PLANTED = planted()


def test_there_are_sixty_differences() -> None:
    assert len(PLANTED) >= 60


@pytest.mark.parametrize("case", PLANTED, ids=[name for name, _, _ in PLANTED])
def test_a_planted_difference_is_named(case: tuple[str, str, dict[str, Any]]) -> None:
    _, named, deck = case
    found = compare_models(td.model_from_dict(DECK), td.model_from_dict(deck))
    assert any(named in each.path.split(".") for each in found.changes), str(found)
    assert len(found.changes) <= 2, str(found)


def _reversed(table: Any) -> Any:
    return {key: _reversed(table[key]) for key in reversed(list(table))} if isinstance(table, Mapping) else table


OTHER = {
    "0.1 [m^2]": "1000 [cm^2]",
    "2 [kg]": "2000 [g]",
    "300 [J/K]": "0.3 [kJ/K]",
    "30 [W]": "0.03 [kW]",
    "3 [W]": "3000 [mW]",
    "1 [h]": "60 [min]",
    "5 [degC]": "278.15 [K]",
    "80 [degC]": "353.15 [K]",
    "share*area": "area/4",
    "1e-4 [kg/s]": "0.1 [g/s]",
}


def _other_units(table: Any) -> Any:
    if isinstance(table, Mapping):
        return {key: _other_units(value) for key, value in table.items()}
    if isinstance(table, list):
        return [_other_units(value) for value in table]
    return OTHER.get(table, table) if isinstance(table, str) else table


WRITTEN = {
    "order": _reversed(DECK),
    "units and arithmetic": _other_units(DECK),
    "conductance": _put(DECK, ("conductors", "second"), {"kind": "conduction", "between": ["lid", "seam"], "conductance": "2 [W/K]"}),
    "ends": _put(DECK, ("conductors", "strap", "between"), ["wall", "lid"]),
    "capacitance": _put(DECK, ("nodes", "box"), {"capacitance": "1.8 [kJ/K]"}),
    "number": _put(DECK, ("conductors", "free", "area"), "0.1 [m^2]"),
    "contact": _put(DECK, ("conductors", "pad"), {"kind": "conduction", "between": ["box", "wax"], "conductance": "1 [W/K]"}),
    "name of a value": _put(_put(DECK, ("parameters", "face"), "0.1 [m^2]"), ("conductors", "free", "area"), "face"),
    "note": _put(DECK, ("parameters", "area"), {"value": "0.1 [m^2]", "note": "of the drawing", "source": "measured"}),
    "title": DECK | {"title": "another"},
}


@pytest.mark.parametrize("deck", WRITTEN.values(), ids=WRITTEN)
def test_a_deck_written_in_another_way_differs_in_nothing(deck: dict[str, Any]) -> None:
    found = compare_models(td.model_from_dict(DECK), td.model_from_dict(deck))
    assert found.changes == (), str(found)


def test_the_largest_effect_comes_first() -> None:
    changed = _put(_put(DECK, ("loads", "chips", "power"), "6 [W]"), ("parameters", "share"), 0.26)
    changed = _put(changed, ("nodes", "lid", "capacitance"), "310 [J/K]")
    hot = td.Scenario("hot", boundaries={"air": "40 [degC]", "wall": "35 [degC]"})
    cold = td.Scenario("cold", boundaries={"air": "12 [degC]", "wall": "11 [degC]"})
    old, new = td.model_from_dict(DECK), td.model_from_dict(changed)
    found = compare_models(old, new, [hot, cold])
    assert [each.path for each in found.changes] == ["chips.power", "share", "lid.capacitance"]
    alone = old.with_values({"chips.power": "6 [W]"})
    apart = [td.steady(alone, s)[n] - td.steady(old, s)[n] for s in (hot, cold) for n in ("box", "lid", "wax", "seam")]
    assert found.changes[0].effect == pytest.approx(max(map(abs, apart)), rel=1e-9)
    assert found.changes[2].effect == 0.0
    assert found.temperatures["cold"]["lid"] == pytest.approx(td.steady(new, cold)["lid"] - td.steady(old, cold)["lid"], rel=1e-9)
    assert found.totals["power"] == pytest.approx((36.0, 39.0))


def test_a_scenario_without_a_steady_state_is_said() -> None:
    frost = td.Scenario("frost", boundaries={"air": "-20 [degC]", "wall": "-30 [degC]"})  # the thermostat keeps switching
    warm = _put(DECK, ("loads", "chips", "power"), "6 [W]")
    found = compare_models(td.model_from_dict(warm), td.model_from_dict(_put(warm, ("parameters", "share"), 0.3)), [frost])
    assert [each.path for each in found.changes] == ["share"]
    assert found.temperatures == {"frost": {}}


def test_a_value_of_a_submodel_used_twice_is_one_difference(tmp_path: Path) -> None:
    part = {
        "title": "cell",
        "offers": ["core"],
        "needs": ["bus"],
        "parameters": {"g": "0.5 [W/K]"},
        "nodes": {"core": {"capacitance": "20 [J/K]"}},
    }
    part["conductors"] = {"tab": {"kind": "conduction", "between": ["core", "bus"], "conductance": "g"}}
    decks = []
    for value in ("0.5 [W/K]", "0.6 [W/K]"):
        cell = {"use": td.model_from_dict(_put(part, ("parameters", "g"), value)), "bind": {"bus": "rail"}}
        decks.append({"title": "pack", "needs": ["rail"], "submodels": {"a": cell, "b": cell}})
    found = compare_models(*(td.model_from_dict(deck) for deck in decks))
    assert {each.path for each in found.changes} == {"a.g"}


@pytest.mark.parametrize("name", ["a", "b"])
def test_a_value_of_one_use_alone_is_named_there(name: str) -> None:
    """The second use has the same text as the first, until a deck sets its own."""
    part = {"title": "cell", "offers": ["core"], "needs": ["bus"], "parameters": {"g": "0.5 [W/K]"}}
    part |= {"nodes": {"core": {"capacitance": "20 [J/K]"}}}
    part |= {"conductors": {"tab": {"kind": "conduction", "between": ["core", "bus"], "conductance": "g"}}}
    cell = {"use": td.model_from_dict(part), "bind": {"bus": "rail"}}
    pack = {"title": "pack", "needs": ["rail"], "submodels": {"a": cell, "b": cell}}
    old, new = (
        td.model_from_dict({**pack, "set": {"a.g": "0.5 [W/K]", "b.g": "0.5 [W/K]", **moved}}) for moved in ({}, {f"{name}.g": "0.7 [W/K]"})
    )
    assert f"{name}.g" in {each.path for each in compare_models(old, new).changes}


def test_the_command_prints_what_differs(tmp_path: Path) -> None:
    files = [tmp_path / "old.toml", tmp_path / "new.toml"]
    for file, deck in zip(files, (DECK, _put(DECK, ("parameters", "share"), 0.3)), strict=True):
        td.save_model(td.model_from_dict(deck), file)
    result = CliRunner().invoke(app, ["compare", *map(str, files)])
    assert result.exit_code == 0
    assert "share: 0.25 -> 0.3" in result.output
