"""Arrays, chains and links of a part, values where it is used, tables of elements, cycles of a load."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, code_of
from thermid.model._deck.modelfile import save_model

Decks = Callable[..., td.Model]
CELL: dict[str, Any] = {
    "title": "cell",
    "needs": ["left", "air"],
    "offers": ["body"],
    "nodes": {"body": {"capacitance": "10 [J/K]"}},
    "conductors": {
        "to_left": {"kind": "conduction", "between": ["body", "left"], "conductance": "2 [W/K]"},
        "loss": {"kind": "conduction", "between": ["body", "air"], "conductance": "0.1 [W/K]"},
    },
    "loads": {"heat": {"into": "body", "power": "1 [W]"}},
}
WEB = {"kind": "conduction", "between": ["body", "body"], "conductance": {"value": "0.5 [W/K]", "min": 0.1, "max": 2}}
ROOM = td.Scenario("room", boundaries={"base": "20 [degC]", "air": "15 [degC]"}, start="20 [degC]", duration="10 [min]")


def row(deck: dict[str, Any] | None = None, **use: Any) -> td.Model:
    cell = {"use": td.model_from_dict(CELL), "bind": {"left": "base", "air": "air"}} | use
    return td.model_from_dict({"title": "row", "needs": ["base", "air"], "submodels": {"cell": cell}} | (deck or {}))


def by_hand(count: int, watts: list[float]) -> np.ndarray:
    """Settled temperatures of a chain, from its matrix. [degC]"""
    a, q = np.zeros((count, count)), np.array(watts) + 0.1 * 15.0
    for k in range(count):
        a[k, k] += 2.1
        if k:
            a[k, k - 1] -= 2.0
            a[k - 1, k] -= 2.0
            a[k - 1, k - 1] += 2.0
    q[0] += 2.0 * 20.0
    return np.linalg.solve(a, q)


def test_a_chain_is_the_chain_by_hand() -> None:
    watts = [1.0, 2.0, 3.0, 6.0, 0.5]
    model = row(count=5, chain={"left": "body"}, values={"heat.power": [f"{w} [W]" for w in watts]})
    settled = td.steady(model, ROOM)
    assert [settled[f"cell_{k}.body"] - 273.15 for k in range(1, 6)] == pytest.approx(by_hand(5, watts), abs=1e-9)
    assert list(model.submodels) == [f"cell_{k}" for k in range(1, 6)]
    assert td.simulate(model, ROOM).heat_balance().relative < 1e-9


def test_values_where_a_part_is_used_take_names_of_the_deck_and_the_index() -> None:
    model = row({"parameters": {"p": "0.5 [W]"}}, count=3, values={"heat.power": "{i}*p"})
    settled = td.steady(model, ROOM)
    for k in (1, 2, 3):
        assert settled[f"cell_{k}.body"] - 273.15 == pytest.approx((2 * 20.0 + 1.5 + 0.5 * k) / 2.1, abs=1e-9)
    assert str(model.settings["cell_2.heat.power"].text) == "2*p"


def test_one_part_takes_values_without_a_row_of_set() -> None:
    plain = row(values={"heat.power": {"value": "4 [W]", "min": 1, "max": 8}})
    assert plain.settings["cell.heat.power"].maximum == 8.0
    assert td.steady(plain, ROOM)["cell.body"] - 273.15 == pytest.approx((40 + 1.5 + 4) / 2.1, abs=1e-9)
    with raises_code("name.taken", DeckError, match=r"'cell\.heat\.power'"):
        row({"set": {"cell.heat.power": "2 [W]"}}, values={"heat.power": "4 [W]"})


def test_neighbours_of_a_grid_are_linked_and_share_one_value() -> None:
    model = row(count=[2, 3], links={"web": WEB}, values={"heat.power": ["6 [W]", *["0 [W]"] * 5]})
    assert len(model.conductors) == 7
    assert {"cell_web_1_1_to_2_1", "cell_web_1_2_to_1_3"} <= set(model.conductors)
    names = [f"cell_{i}_{j}" for i in (1, 2) for j in (1, 2, 3)]
    a, q = 2.1 * np.eye(6), np.full(6, 41.5)
    q[0] += 6.0
    for i, j in ((0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (1, 4), (2, 5)):
        a[i, i] += 0.5
        a[j, j] += 0.5
        a[i, j] = a[j, i] = -0.5
    settled = td.steady(model, ROOM)
    assert [settled[f"{n}.body"] - 273.15 for n in names] == pytest.approx(np.linalg.solve(a, q), abs=1e-9)
    first = "cell_web_1_1_to_2_1.conductance"
    changed = td.steady(model.with_values({first: "1.5 [W/K]"}), ROOM)
    assert changed["cell_2_3.body"] > settled["cell_2_3.body"] + 0.01
    run = td.prepare(model, ROOM, (first,)).run(sensitivities=True)
    assert np.abs(run.sensitivity("cell_2_3.body", first)).max() > 0.01


@pytest.mark.parametrize(
    ("use", "code", "match"),
    [
        ({"count": 3, "values": {"heat.power": ["1 [W]", "2 [W]"]}}, "value.shape", r"submodels\.cell\.values\.heat\.power.*2.*3"),
        ({"count": 0}, "file.wrong-value", "1"),
        ({"count": [2, 2], "chain": {"left": "body"}}, "model.law-refused", r"submodels\.cell\.chain"),
        ({"count": 2, "chain": {"right": "body"}}, "name.unknown", "'cell'.*'right'"),
        ({"count": 2, "chain": {"left": "skin"}}, "name.unknown", "'skin'"),
        ({"values": {"heat.powr": "1 [W]"}}, "name.unknown", r"'cell'.*'heat\.powr'.*'heat\.power'"),
        (
            {"links": {"web": {"kind": "conduction", "between": ["body", "body"], "conductance": "1 [W/K]"}}},
            "model.law-refused",
            r"submodels\.cell\.links",
        ),
        (
            {"count": 2, "links": {"web": {"kind": "conduction", "between": ["body", "body"]}}},
            "value.incomplete",
            r"links\.web.*'conduction'",
        ),
        ({"count": 2, "values": {"heat.power": "1 [K]"}}, "unit.wrong-dimension", r"set\.cell_1\.heat\.power.*'\[K\]'.*\[W\]"),
    ],
)
def test_what_an_array_cannot_be(use: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        td.steady(row(**use), ROOM)


def test_a_name_that_an_array_makes_is_taken() -> None:
    with raises_code("name.taken", DeckError, match="'cell_2'"):
        row({"nodes": {"cell_2": {"capacitance": "1 [J/K]"}}}, count=2)


def test_an_array_is_saved_and_read_again(tmp_path: Path) -> None:
    model = row(count=3, chain={"left": "body"}, values={"heat.power": ["1 [W]", "2 [W]", "3 [W]"]})
    save_model(model, tmp_path / "row.toml")
    assert td.load_model(tmp_path / "row.toml") == model


MAIN = """title = "rack"
needs = ["air", "base"]

[parameters]
unit = "0.5 [W]"

[tables.cells]
file  = "cells.csv"
makes = "submodels"
each  = { use = "cell.toml", bind = { air = "air", left = "base" } }

[tables.straps]
file  = "straps.csv"
makes = "conductors"
"""
PART = """title = "cell"
needs = ["left", "air"]
offers = ["body"]
[nodes]
body = { capacitance = "10 [J/K]" }
[conductors]
to_left = { kind = "conduction", between = ["body", "left"], conductance = "2 [W/K]" }
loss = { kind = "conduction", between = ["body", "air"], conductance = "0.1 [W/K]" }
[loads]
heat = { into = "body", power = "1 [W]" }
"""
CELLS = """# synthetic
name, values.heat.power, values.body.capacitance [J/K], bind.left
a, 2 [W], 12,
b, unit,, a.body

c, , 15, base
"""
STRAPS = "name;kind;between;conductance [mW/K]\nstrap;conduction;a.body | c.body;250\n"


def rack(decks: Decks, tmp_path: Path, main: str = MAIN, cells: str = CELLS, straps: str = STRAPS) -> td.Model:
    (tmp_path / "cells.csv").write_text(cells, encoding="utf-8")
    (tmp_path / "straps.csv").write_text(straps, encoding="utf-8")
    return decks(main=main, cell=PART)


def test_a_table_of_parts_is_the_deck_written_out(decks: Decks, tmp_path: Path) -> None:
    model = rack(decks, tmp_path)
    part = td.model_from_dict(CELL)
    whole = td.model_from_dict(
        {
            "title": "rack",
            "needs": ["air", "base"],
            "parameters": {"unit": "0.5 [W]"},
            "submodels": {
                "a": {"use": part, "bind": {"air": "air", "left": "base"}},
                "b": {"use": part, "bind": {"air": "air", "left": "a.body"}},
                "c": {"use": part, "bind": {"air": "air", "left": "base"}},
            },
            "set": {
                "a.heat.power": "2 [W]",
                "a.body.capacitance": "12 [J/K]",
                "b.heat.power": "unit",
                "c.body.capacitance": "15 [J/K]",
            },
            "conductors": {"strap": {"kind": "conduction", "between": ["a.body", "c.body"], "conductance": "250 [mW/K]"}},
        }
    )
    assert model.identity() == whole.identity()


@pytest.mark.parametrize(
    ("cells", "code", "match"),
    [
        (CELLS.replace("a, 2 [W], 12,", "a, 2 [W], 12"), "value.wrong-kind", r"cells\.csv:3.*3.*4"),
        (
            CELLS.replace("values.heat.power,", "vals.heat.power,"),
            "name.unknown",
            r"cells\.csv:3.*'vals'",
        ),
        (CELLS.replace("b, unit", "a, unit"), "name.taken", r"cells\.csv:4.*'a'.*cells\.csv:3"),
        (CELLS.replace("2 [W]", "2 [K]"), "unit.wrong-dimension", r"cells\.csv:3.*set\.a\.heat\.power.*'\[K\]'"),
        (CELLS.replace("c, ,", "c, 1/0 [W],"), "expression.no-finite-value", r"cells\.csv:6"),
        (CELLS.replace("values.heat.power", "values.heat.pwr"), "name.unknown", r"'heat\.pwr'.*'heat\.power'"),
        (CELLS.replace("name,", "nome,"), "model.refused", r"cells\.csv:2.*'name'"),
        (CELLS.replace("bind.left", "name"), "model.refused", r"cells\.csv:2.*'name'"),
        ("name\n", "value.incomplete", r"'cells\.csv'"),
        (CELLS.replace("name,", "name[,"), "value.wrong-kind", r"cells\.csv:2.*'name\['"),
        (CELLS.replace("b, unit", ", unit"), "value.incomplete", r"cells\.csv:4"),
        (CELLS.replace("a.body", "d.body"), "name.unknown", r"cells\.csv:4"),
    ],
)
def test_a_mistake_in_a_table_is_named_with_its_line(decks: Decks, tmp_path: Path, cells: str, code: str, match: str) -> None:
    with raises_code(code, match=match):
        td.steady(rack(decks, tmp_path, cells=cells), ROOM)


def test_a_table_needs_a_group_and_a_file_that_is_there(decks: Decks, tmp_path: Path) -> None:
    for main, code, data in (
        (MAIN.replace('"submodels"', '"submodel"'), "name.unknown", "'submodels'?"),
        (MAIN.replace("cells.csv", "cels.csv"), "file.not-found", "'cells.csv'?"),
        (MAIN.replace("cells.csv", "../../../etc/passwd"), "file.outside-project", "'../../../etc/passwd'"),
        (MAIN.replace("makes = ", "make = ", 1), "file.key-missing", "'makes'?"),
    ):
        with pytest.raises(DeckError) as caught:
            rack(decks, tmp_path, main)
        assert code_of(str(caught.value)) == code
        assert data in str(caught.value)
    with raises_code("value.wrong-kind", DeckError):
        td.model_from_dict({"title": "x", "tables": {"t": {"file": "a.csv", "makes": "nodes"}}})
    made = td.model_from_dict({"title": "x", "tables": {"t": {"makes": "nodes", "rows": [{"name": "n", "capacitance": "4 [J/K]"}]}}})
    assert list(made.nodes) == ["n"]


def test_a_hundred_parts_are_quick_and_their_notes_few(decks: Decks, tmp_path: Path) -> None:
    lines = "\n".join(f"p{k}, {k % 7 + 1} [W], {k + 5}, base" for k in range(100))
    model = rack(decks, tmp_path, main=MAIN.partition("[tables.straps]")[0], cells=CELLS.splitlines()[1] + "\n" + lines)
    assert len(model.submodels) == 100
    assert len(model.check()) < 15


# cycles ------------------------------------------------------------------------------------------------------------------------------


def cycled(cycle: dict[str, Any], **load: Any) -> td.Model:
    return td.model_from_dict(
        {
            "title": "x",
            "needs": ["air"],
            "nodes": {"a": {"capacitance": "50 [J/K]"}},
            "conductors": {"g": {"kind": "conduction", "between": ["a", "air"], "conductance": "1 [W/K]"}},
            "loads": {"q": {"into": "a", "power": "10 [W]", "cycle": cycle} | load},
        }
    )


AIR = td.Scenario("air", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="20 [min]")
STEPS = {"times": ["0 [s]", "20 [s]", "50 [s]"], "values": [1.0, 0.2, 0.6], "hold": True, "period": "90 [s]"}


@pytest.mark.parametrize("method", ["auto", "integrator", "large"])
@pytest.mark.parametrize("steps", [True, False])
def test_a_cycle_of_a_deck_is_the_command_of_a_scenario(steps: bool, method: str) -> None:
    cycle = STEPS if steps else {k: v for k, v in STEPS.items() if k != "hold"}
    bare = td.model_from_dict(
        {
            "title": "x",
            "needs": ["air"],
            "nodes": {"a": {"capacitance": "50 [J/K]"}},
            "conductors": {"g": {"kind": "conduction", "between": ["a", "air"], "conductance": "1 [W/K]"}},
            "loads": {"q": {"into": "a", "power": "10 [W]"}},
        }
    )
    options = td.Options(method=method)
    here = td.simulate(cycled(cycle), AIR, options=options)
    there = td.simulate(bare, AIR.with_(commands={"q": cycle | {"after": "repeat"}}), options=options)
    assert np.abs(here["a"].kelvin - there["a"].kelvin).max() < 1e-9
    assert here["a"].highest == pytest.approx(there["a"].highest, abs=1e-9)


def test_a_cycle_multiplies_a_command_and_has_a_mean() -> None:
    mean = (20 * 1.0 + 30 * 0.2 + 40 * 0.6) / 90
    assert td.steady(cycled(STEPS), AIR, "mean")["a"] - 293.15 == pytest.approx(10 * mean, abs=1e-9)
    assert td.steady(cycled(STEPS), AIR.with_(commands={"q": 0.5}), "mean")["a"] - 293.15 == pytest.approx(5 * mean, abs=1e-9)
    back = td.steady(cycled(STEPS), AIR, "periodic")
    assert back["a"] - 293.15 == pytest.approx(10 * mean, abs=1e-6)
    assert back.highest["a"] > back.lowest["a"] + 1.0


@pytest.mark.parametrize(
    ("change", "code", "match"),
    [
        ({"period": "40 [s]"}, "value.outside-range", r"loads\.q\.cycle"),
        ({"times": ["5 [s]", "20 [s]", "50 [s]"]}, "value.outside-range", r"loads\.q\.cycle"),
        ({"values": [1.0, 0.2]}, "value.shape", r"loads\.q\.cycle"),
        ({"period": None, "hold": False}, "model.law-refused", r"loads\.q\.cycle.*'24 \[h\]'"),
        ({"values": ["1 [W]", 0.2, 0.6]}, "unit.wrong-dimension", r"loads\.q\.cycle"),
    ],
)
def test_cycles_that_cannot_be(change: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        cycled({k: v for k, v in (STEPS | change).items() if v is not None})
