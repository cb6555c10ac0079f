"""Ranges of numbers: one row a field, and no way in around them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, SolverError
from thermid.base.units import TEMPERATURE, Dual
from thermid.model._parts.controls import CONTROL_SLOTS, slot_of
from thermid.model._parts.elements import KINDS, LOAD_SLOTS, NODE_SLOTS
from thermid.model._parts.ranges import RANGES, range_of
from thermid.model._tree.flat import allows
from thermid.simulation._ensemble import MemberValues
from thermid.simulation.runs import compile_network

BOLTED = {
    "kind": "bolted", "between": ["plate", "air"], "count": 4, "torque": "1.2 [N m]", "diameter": "4 [mm]", "washer": "8 [mm]",
    "thickness": "5 [mm]", "conductivity": "150 [W/(m K)]", "hardness": "1.1 [GPa]", "roughness": "2 [um]", "slope": 0.1,
}  # fmt: skip
ROOM = td.Scenario("room", boundaries={"air": "20 [degC]"}, start="25 [degC]", duration="2 [min]")


def deck(parameters: dict[str, Any] | None = None, **fields: Any) -> td.Model:
    return td.model_from_dict(
        {
            "title": "plate",
            "needs": ["air"],
            "parameters": parameters or {},
            "nodes": {"plate": {"capacitance": "50 [J/K]"}},
            "conductors": {"screws": BOLTED | fields},
        }
    )


WAYS: dict[str, Callable[[], Any]] = {
    "literal": lambda: td.steady(deck(diameter="0 [mm]"), ROOM),
    "parameter": lambda: td.steady(deck({"d": "0 [mm]"}, diameter="d"), ROOM),
    "expression": lambda: td.steady(deck({"d": "4 [mm]"}, diameter="d - 4 [mm]"), ROOM),
    "laid over": lambda: td.steady(deck().with_values({"screws.diameter": "0 [mm]"}), ROOM),
    "of a fit": lambda: compile_network(deck()).numbers({"screws.diameter": Dual(0.0, np.ones(1))}),
    "schedule": lambda: td.simulate(
        deck(), ROOM.with_(schedule={"screws.diameter": {"times": ["0 [s]", "1 [min]"], "values": ["4 [mm]", "0 [mm]"], "after": "hold"}})
    ),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_value_that_cannot_be_is_refused_whatever_way_it_comes(way: str) -> None:
    with pytest.raises(DeckError, match=r"'screws\.diameter' is 0 m\."):
        WAYS[way]()


def test_a_parameter_is_shown_where_it_was_written() -> None:
    with raises_code("value.outside-range", DeckError, match=r"parameters\.d.*'screws\.diameter'.*0"):
        deck({"d": "0 [mm]"}, diameter="d")
    (found,) = (f for f in deck().with_values({"screws.diameter": "0 [mm]"}).check() if f.severity == "error")
    assert "'screws.diameter' is 0 m" in found.message


def test_members_outside_a_range_fail_alone() -> None:
    run = td.ensemble(deck(), ROOM, {"screws.diameter": np.array([4e-3, 0.0, 5e-3])})
    assert list(run.failed) == [1]
    assert "'screws.diameter' is 0 m" in run.failed[1]


def test_every_field_has_a_row_and_every_row_a_field() -> None:
    fields = {(kind, name, slot) for kind, of in KINDS.items() for name, slot in of.slots.items()}
    fields |= {("reversible", name, slot) for name, slot in KINDS["flow"].slots.items()}
    fields |= {("", name, slot) for slots in (NODE_SLOTS, LOAD_SLOTS, {"absorptance": "1"}) for name, slot in slots.items()}
    controls = [*CONTROL_SLOTS, "modes.open", *(f"transitions.x.{sense}" for sense in ("above", "below", "after"))]
    fields |= {("", name, slot_of(name, difference)) for name in controls for difference in (True, False)}
    used = {id(range_of(kind, name, slot)) for kind, name, slot in fields}
    literals = ("latent_heat", "liquid_specific_heat", "supercooling", "aspect", "dimensions", "sample")
    beside = {
        name
        for name in RANGES
        if name in literals or name.partition(".")[0] in ("made_in", "packages", "ladders", "coolers", "passes", "fans")
    }
    assert [name for name, row in RANGES.items() if id(row) not in used and name not in beside] == []
    assert all(row.words and row.why for row in RANGES.values())


@pytest.mark.parametrize(
    ("field", "allowed", "refused"),
    [
        ("emissivity", (0.0, 0.5, 1.0, 1.0 + 1e-9), (-1e-9, 1.01, np.nan, np.inf)),
        ("accommodation", (1e-9, 1.0), (0.0, 1.1)),
        ("resistance", (1e-9, np.inf), (0.0, -1.0, np.nan)),
        ("conductance", (0.0, 1e9), (-1e-12, np.inf)),
        ("proportional.band", (-2.0, 2.0), (0.0, np.inf, np.nan)),
        (TEMPERATURE, (0.0, 300.0), (-1e-3, np.inf)),
    ],
)
def test_bounds(field: str, allowed: tuple[float, ...], refused: tuple[float, ...]) -> None:
    row = RANGES[field]
    assert [v for v in allowed if not allows(row, v)] == []
    assert [v for v in refused if allows(row, v)] == []
    assert allows(row, MemberValues(np.array(allowed)))
    assert not allows(row, MemberValues(np.array(refused[:1])))
    assert not allows(row, Dual(refused[0], np.ones(2)))


def test_numbers_that_are_possible_one_by_one_have_no_finite_law_together() -> None:
    with raises_code("expression.no-finite-value", DeckError, match="'screws'"):
        compile_network(deck(diameter="1e200 [m]", washer="2e200 [m]"))


def test_a_gap_without_area_carries_nothing() -> None:
    model = td.model_from_dict(
        {
            "title": "gap",
            "needs": ["air"],
            "nodes": {"plate": {"capacitance": "50 [J/K]"}},
            "conductors": {"gap": {"kind": "gas", "between": ["plate", "air"], "area": "0 [m^2]", "gap": "2 [mm]"}},
        }
    )
    assert td.simulate(model, ROOM)["plate"].final == pytest.approx(25.0, abs=1e-9)


def test_an_aspect_is_a_number_however_it_is_written() -> None:
    fields = {"kind": "gas", "between": ["plate", "air"], "area": "0.02 [m^2]", "gap": "25 [mm]", "tilt": "0 [deg]"}
    held = []
    for aspect in ("6", "600 [%]", "2*3"):
        parts = {"title": "gap", "needs": ["air"], "nodes": {"plate": {"capacitance": "50 [J/K]"}}}
        model = td.model_from_dict(parts | {"conductors": {"gap": fields | {"aspect": aspect}}})
        held.append(td.simulate(model, ROOM)["plate"].final)
    assert held[0] == held[1] == held[2]


def test_a_controller_that_samples_too_often_for_its_run_is_refused_before_it() -> None:
    def run(sample: str) -> td.Solution:
        control = {"follows": "plate", "sample": sample, "proportional": {"setpoint": "34 [degC]", "band": "2 [K]"}}
        parts = {"title": "plate", "needs": ["air"], "nodes": {"plate": {"capacitance": "50 [J/K]"}}, "conductors": {"screws": BOLTED}}
        loads = {"heater": {"into": "plate", "power": "2 [W]", "control": "c"}}
        return td.simulate(td.model_from_dict(parts | {"loads": loads, "controls": {"c": control}}), ROOM)

    with raises_code("run.did-not-finish", SolverError, match=r"'c'.*5e-12.*2\.4e\+13"):
        run("5e-12 [s]")
    with pytest.raises(DeckError, match="'sample' is 0 s"):
        run("0 [s]")
    assert run("0.1 [s]")["plate"].final > 20.0
