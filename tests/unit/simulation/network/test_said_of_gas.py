"""What surfaces must say of gas and of vacuum, what radiation can reach, parts whose air and walls are apart, reductions in one gas."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import of_code, raises_code
from thermid.app.cli.app import main
from thermid.base.errors import DeckError, NameNotFoundError, ScenarioError, code_of
from thermid.base.units import ATMOSPHERE, STEFAN_BOLTZMANN
from thermid.model._tree.identity import to_dict
from thermid.model.tree import TableSignal

ROOM = td.Scenario("room", boundaries={"air": "20 [degC]"}, start="air", duration="10 [h]")
PUMPED = ROOM.with_(
    environment={
        "*": td.simulation.Environment(TableSignal(np.array([0.0, 600.0, 1200.0]), np.array([ATMOSPHERE, ATMOSPHERE, 0.0]), after="hold"))
    }
)
HTC = {"htc": "5 [W/(m^2 K)]"}
ONE_STATE = "model.element-not-supported"
SAYS_NO_EMISSIVITY = "'skin' .*'air' .* = 0 "
SAYS_NO_HTC = "'skin' .* htc: .*'air' .*--vacuum"


def plate(**skin: Any) -> td.Model:
    """100 cm2 with 1 W."""
    return td.model_from_dict(
        {
            "title": "plate",
            "needs": ["air"],
            "nodes": {"body": {"capacitance": "100 [J/K]"}},
            "surfaces": {"skin": {"of": "body", "to": "air", "area": "100 [cm^2]"} | skin},
            "loads": {"heat": {"into": "body", "power": "1 [W]"}},
        }
    )


def rise(model: td.Model, scenario: td.Scenario) -> float:
    return td.steady(model, scenario)["body"] - 293.15


def refused(text: str, code: str = "model.needs-gas-law") -> Any:
    return raises_code(code, ScenarioError, match=text)


# convection without a word on radiation ------------------------------------------------------------------------------------------------


def test_vacuum_is_named_once_in_a_title() -> None:
    said = ROOM.with_(title="vacuum, room 22").vacuum()
    assert said.title == "vacuum, room 22"
    assert said.vacuum(as_printed=True).title.startswith("vacuum, room 22, ")
    assert ROOM.vacuum().title == f"{ROOM.title}, vacuum"


def test_vacuum_with_a_bare_htc_dropped_all_exchange_in_silence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """120 degC for 36 degC; whether the gas is gone from the start or on the way, for one run, many, a prediction and the command line."""
    bare = plate(htc={"value": "5 [W/(m^2 K)]", "min": 1, "max": 20})
    assert rise(bare, ROOM) == pytest.approx(20.0)
    for scenario in (ROOM.vacuum(), PUMPED):
        with refused(SAYS_NO_EMISSIVITY):
            td.simulate(bare, scenario)
    with refused(SAYS_NO_EMISSIVITY):
        td.ensemble(bare, ROOM.vacuum(), {"skin.htc": np.array([4.0, 5.0])})
    times = np.arange(0.0, 36000.0, 600.0)
    kelvin = td.simulate(bare, ROOM, times=times)["body"].kelvin + 0.1 * np.random.default_rng(1).standard_normal(times.size)
    record = td.Record.from_arrays(
        "log", times, {"T": td.Channel.from_array("T", kelvin, unit="K", role="node", target="body", noise=0.1, accuracy=0.2)}
    )
    fit = td.calibrate(bare, record, ["skin.htc"], scenario=ROOM)
    with refused(SAYS_NO_EMISSIVITY):
        td.predict(fit, ROOM.vacuum())
    td.save_model(bare, tmp_path / "plate.toml")
    words = ["simulate", str(tmp_path / "plate.toml"), "--boundary", "air=20", "--for", "1 [h]", "--vacuum", "--json"]
    monkeypatch.setattr(sys, "argv", ["thermid", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert re.search(SAYS_NO_EMISSIVITY, json.loads(capsys.readouterr().out)["message"])
    assert [f.severity for f in bare.check() if f.code == "model.no-emissivity" and "'skin'" in f.message] == ["note"]


def test_an_emissivity_or_zero_on_purpose_is_a_word() -> None:
    none = td.simulate(plate(**HTC, emissivity=0), ROOM.vacuum().with_(duration="1 [h]"))
    assert none["body"].final == pytest.approx(20.0 + 36.0)
    assert "run.heat-stops-without-gas" in {code_of(w) for w in none.warnings}
    painted = plate(**HTC, finish="paint, white")
    grey = painted.at("skin.emissivity").expression.literal.value
    assert (rise(painted, ROOM.vacuum()) + 293.15) ** 4 - 293.15**4 == pytest.approx(1.0 / (STEFAN_BOLTZMANN * grey * 0.01))
    assert td.simulate(plate(**HTC), ROOM.vacuum(as_printed=True).with_(duration="1 [h]"))["body"].final == pytest.approx(56.0)
    sealed = ROOM.with_(environment={"air": td.simulation.Environment(sealed=True)})
    assert rise(plate(**HTC), sealed.vacuum()) == pytest.approx(20.0)


def test_gas_so_thin_that_radiation_decides_is_remarked() -> None:
    thin = ROOM.with_(environment={"air": td.simulation.Environment("50 [Pa]")}, duration="10 [min]")
    assert any(code_of(w) == "model.no-emissivity" for w in td.simulate(plate(**HTC), thin).warnings)
    assert td.simulate(plate(**HTC, emissivity=0.3), thin).warnings == ()
    assert (
        td.simulate(plate(**HTC, carried_by="free air"), ROOM.with_(environment={"air": td.simulation.Environment("60 [kPa]")})).warnings
        == ()
    )


def test_a_lead_with_a_bare_htc_lost_nothing_in_vacuum() -> None:
    wire = {
        "kind": "lead",
        "between": ["body", "air"],
        "conductivity": "390 [W/(m K)]",
        "diameter": "1 [mm]",
        "length": "40 [cm]",
        "to": "air",
    }

    def wired(**more: Any) -> td.Model:
        deck = to_dict(plate(**HTC, emissivity=0.8))
        return td.model_from_dict({k: v for k, v in deck.items() if k != "box"} | {"conductors": {"wire": wire | HTC | more}})

    with refused("'wire' .*'air' "):
        td.simulate(wired(), ROOM.vacuum())
    for emissivity, lost in ((0, True), (0.5, False)):
        run = td.simulate(wired(emissivity=emissivity), ROOM.vacuum())
        assert (run.heat_flow("wire.first")[-1] == 0.0) == lost
        assert ("run.heat-stops-without-gas" in {code_of(w) for w in run.warnings}) == lost


# radiation without a word on convection ------------------------------------------------------------------------------------------------


def test_an_emissivity_alone_in_air_had_no_convection_in_silence() -> None:
    """19.8 K from 1 W on 100 cm2."""
    alone = plate(emissivity=0.8)
    for scenario in (ROOM, PUMPED, ROOM.with_(environment={"air": td.simulation.Environment("5 [Pa]")})):
        with refused(SAYS_NO_HTC):
            td.steady(alone, scenario)
    assert [(f.severity, f.code) for f in alone.check()] == [("warning", "model.no-convection")]
    assert "'skin'" in alone.check()[0].message
    for zero in (0, "0", "0 [W/(m^2 K)]", {"value": 0, "source": "assumed"}):
        assert rise(plate(emissivity=0.8, htc=zero), ROOM) == pytest.approx(19.782, abs=1e-3)
    assert plate(emissivity=0.8, htc=0).check() == ()
    assert rise(alone, ROOM.vacuum()) == pytest.approx(19.782, abs=1e-3)
    with raises_code("value.incomplete", DeckError):
        td.Block(("10 [mm]",) * 3, (2, 2, 2), "15 [W/(m K)]", "4000 [kg/m^3]", "500 [J/(kg K)]").exchanging("all", "air", emissivity=0.8)


def test_faces_of_an_enclosure_need_no_htc() -> None:
    deck = {
        "title": "gap",
        "needs": ["cold"],
        "nodes": {"body": {"capacitance": "10 [J/K]"}},
        "surfaces": {"up": {"of": "body", "to": "cold", "area": "100 [cm^2]", "emissivity": 0.5}},
    }
    other = deck["surfaces"] | {"down": {"of": "lid", "to": "cold", "area": "100 [cm^2]", "emissivity": 0.5}}
    faces = {"between": {"faces": {"a": "up", "b": "down"}, "view_factors": [[0, 1], [1, 0]]}}
    lid = {"body": {"capacitance": "10 [J/K]"}, "lid": {"capacitance": "10 [J/K]"}}
    screw = {"foot": {"kind": "conduction", "between": ["lid", "cold"], "conductance": "1 [W/K]"}}
    load = {"heat": {"into": "body", "power": "1 [W]"}}
    model = td.model_from_dict(deck | {"nodes": lid, "surfaces": other, "enclosures": faces, "conductors": screw, "loads": load})
    lid_at, area = 294.15, 0.01
    expected = (lid_at**4 + 1.0 * (2 / 0.5 - 1) / (STEFAN_BOLTZMANN * area)) ** 0.25
    assert td.steady(model, td.Scenario("x", boundaries={"cold": "20 [degC]"}))["body"] == pytest.approx(expected)


# air does not radiate ------------------------------------------------------------------------------------------------------------------

WALL = {"mass": "1 [kg]", "specific_heat": "900 [J/(kg K)]"}


def box(inside: dict[str, Any] | None = None, skin: dict[str, Any] | None = None, **more: Any) -> td.Model:
    """A board in the air of a box, whose wall stands in the room."""
    surfaces = {
        "board_skin": {"of": "board", "to": "inside", "area": "200 [cm^2]", **HTC, "emissivity": 0.8} | (skin or {}),
        "wall_in": {"of": "wall", "to": "inside", "area": "600 [cm^2]", "htc": "3 [W/(m^2 K)]", "emissivity": 0},
        "wall_out": {"of": "wall", "to": "air", "area": "700 [cm^2]", "htc": "4 [W/(m^2 K)]", "emissivity": 0.9},
    }
    nodes = {"board": {"capacitance": "80 [J/K]"}, "wall": WALL, "inside": inside if inside is not None else {"capacitance": "5 [J/K]"}}
    deck = {"title": "box", "needs": ["air"], "nodes": nodes, "loads": {"chip": {"into": "board", "power": "3 [W]"}}}
    return td.model_from_dict(deck | more | {"surfaces": surfaces | more.get("surfaces", {})})


@pytest.mark.parametrize("inside", [{}, {"capacitance": "5 [J/K]"}, {"capacitance": "5 [J/K]", "stands_for": "air"}])
def test_a_surface_radiated_into_the_air_of_a_box_in_vacuum_too(inside: dict[str, Any]) -> None:
    model = box(inside)
    for scenario in (ROOM, ROOM.vacuum()):
        with raises_code("model.radiates-into-gas", DeckError, match="'board_skin'.*'inside'"):
            td.steady(model, scenario)
    assert [f.severity for f in model.check() if f.code == "model.radiates-into-gas"] == ["error"]


def test_cures_of_radiation_into_air() -> None:
    seen = box(skin={"sees": "wall"})
    held = td.steady(seen, ROOM.vacuum())
    outside = (293.15**4 + 3.0 / (STEFAN_BOLTZMANN * 0.9 * 0.07)) ** 0.25
    assert held["wall"] == pytest.approx(outside)
    assert held["board"] == pytest.approx((outside**4 + 3.0 / (STEFAN_BOLTZMANN * 0.8 * 0.02)) ** 0.25)
    assert seen == td.model_from_dict(to_dict(box(skin={"radiates_to": "wall"}))), "the older name is read"
    star = td.steady(box({"capacitance": "5 [J/K]", "stands_for": "air and walls"}), ROOM)
    assert star["board"] > star["inside"] > star["wall"]
    solid = box({**WALL, "stands_for": "walls"})
    assert td.steady(solid, ROOM)["board"] == pytest.approx(star["board"])
    assert td.steady(box(skin={"emissivity": 0}), ROOM)["board"] > star["board"]


def test_what_else_radiated_into_air() -> None:
    """A conductor, the rest of an enclosure, an effective coefficient's emissivity, a lead."""
    shine = {"shine": {"kind": "radiation", "between": ["wall", "inside"], "emissivity": 0.5, "area": "1 [cm^2]"}}
    wire = {"kind": "lead", "between": ["board", "wall"], "conductivity": "390 [W/(m K)]", "diameter": "1 [mm]", "length": "40 [cm]"}
    lead = {"wire": wire | HTC | {"emissivity": 0.5, "to": "inside"}}
    faces = {"cavity": {"faces": {"a": "wall_in", "b": "board_skin"}, "view_factors": [[0.5, 0.25], [0.75, 0]], "rest": "inside"}}
    grey = {"wall_in": {"of": "wall", "to": "inside", "area": "600 [cm^2]", "htc": "3 [W/(m^2 K)]", "emissivity": 0.5}}
    seeing = {"sees": "wall"}
    for name, model in {
        "shine": box(skin=seeing, conductors=shine),
        "wire": box(skin=seeing, conductors=lead),
        "cavity": box(surfaces=grey, enclosures=faces),
        "board_skin": box(skin={"htc": None, "effective_htc": "8 [W/(m^2 K)]"}),
    }.items():
        with raises_code("model.radiates-into-gas", DeckError, match=f"'{name}' radiates to '"):
            td.simulation.compile_network(model)


def test_a_solid_that_air_passes_is_no_gas() -> None:
    """A node with a surface of its own takes radiation, whatever convects to it; so does a boundary, a room with its walls."""
    lid = {"lid_out": {"of": "inside", "to": "air", "area": "100 [cm^2]", **HTC}}
    assert td.steady(box(surfaces=lid), ROOM)["board"] > 293.15
    assert td.steady(plate(**HTC, emissivity=0.8), ROOM)["body"] > 293.15


# a part's air bound apart --------------------------------------------------------------------------------------------------------------


def part(**skin: Any) -> td.Model:
    return td.model_from_dict(
        {
            "title": "part",
            "needs": ["air"],
            "nodes": {"board": {"capacitance": "80 [J/K]"}},
            "surfaces": {"board_skin": {"of": "board", "to": "air", "area": "200 [cm^2]"} | skin},
            "loads": {"chip": {"into": "board", "power": "3 [W]"}},
        }
    )


def installed(inner: td.Model, deeper: bool = False) -> td.Model:
    """The part in the box, by one level or by two; its air is the box's, and it sees the wall."""
    use: Any = inner
    if deeper:
        use = td.model_from_dict({"title": "shell", "needs": ["cv"], "submodels": {"unit": {"use": inner, "bind": {"air": "cv"}}}})
    whole = to_dict(box())
    whole = {k: v for k, v in whole.items() if k not in ("box", "loads")}
    whole["nodes"].pop("board")
    whole["surfaces"].pop("board_skin")
    need = use.needs[0]
    return td.model_from_dict(whole | {"submodels": {"p": {"use": use, "bind": {need: {"to": "inside", "sees": "wall"}}}}})


@pytest.mark.parametrize("deeper", [False, True])
def test_a_part_of_one_air_is_bound_to_air_and_walls_apart(deeper: bool, tmp_path: Path) -> None:
    skin = HTC | {"emissivity": 0.8}
    flat, whole = box(skin={"sees": "wall"}), installed(part(**skin), deeper)
    name = "p.unit.board" if deeper else "p.board"
    td.save_model(whole, tmp_path / "whole.toml")
    for scenario in (ROOM, ROOM.vacuum(), PUMPED):
        expected = td.simulate(flat, scenario)
        for model in (whole, td.load_model(tmp_path / "whole.toml")):
            assert td.simulate(model, scenario)[name].kelvin == pytest.approx(expected["board"].kelvin, abs=1e-6)
    changed = whole.replace("p", whole.submodels["p"].model)
    assert changed.submodels["p"].sees == {whole.submodels["p"].model.needs[0]: "wall"}
    with raises_code("name.unknown", NameNotFoundError, match="'walll'"):
        td.simulation.compile_network(
            td.model_from_dict(
                to_dict(whole) | {"submodels": {"p": {"use": part(**skin), "bind": {"air": {"to": "inside", "sees": "walll"}}}}}
            )
        )


def test_an_effective_coefficient_radiates_to_what_it_sees_once_gas_is_gone() -> None:
    model = installed(part(effective_htc="9 [W/(m^2 K)]", emissivity=0.8))
    run = td.simulate(model, ROOM)
    assert of_code(run.warnings, "model.radiation-not-split", r"'p\.board_skin'")
    assert run.heat_flow("p.board_skin")[-1] == pytest.approx(3.0, abs=1e-3)
    empty = td.simulate(model, ROOM.vacuum().with_(duration="40 [h]"))
    flat = td.simulate(box(skin={"sees": "wall"}), ROOM.vacuum().with_(duration="40 [h]"))
    assert empty["p.board"].final == pytest.approx(flat["board"].final, abs=1e-6)
    assert not of_code(empty.warnings, "model.radiation-not-split")
    falling = td.simulate(model, PUMPED)
    assert falling.heat_balance().relative < 1e-6
    assert falling["p.board"].final == pytest.approx(td.simulate(model, ROOM.vacuum())["p.board"].final, abs=1e-3)


# what stops and what stays -------------------------------------------------------------------------------------------------------------


def test_first_lines_say_what_stops_and_what_stays_without_gas() -> None:
    conductors = {
        "seal": {"kind": "conduction", "between": ["inside", "wall"], "conductance": "0.1 [W/K]"},
        "slot": {"kind": "gas", "between": ["board", "wall"], "gap": "2 [mm]", "area": "10 [cm^2]"},
        "draft": {"kind": "convection", "between": ["board", "inside"], **HTC, "area": "1 [cm^2]"},
    }
    model = box(skin={"sees": "wall"}, conductors=conductors)
    assert td.simulate(model, ROOM).warnings == ()
    stops, stays = td.simulate(model, ROOM.vacuum()).warnings
    assert of_code([stops], "run.heat-stops-without-gas", "'wall_in', 'slot' and 'draft'$")
    assert of_code([stays], "run.path-stays-without-gas", "^'seal' .*'inside' ")
    kept = ROOM.with_(
        environment={"inside": td.simulation.Environment(sealed=True), "wall": td.simulation.Environment(sealed=True)}
    ).vacuum()
    assert td.simulate(model, kept).warnings == ()


def test_gas_that_is_gone_has_no_temperature_and_the_run_says_so() -> None:
    """Inner gas that nothing but gas joined to the rest was predicted at 22.00 +- 1e-05 degC, without a word."""
    model = box(skin={"sees": "wall"})
    assert "run.heat-stops-without-gas" in {code_of(w) for w in td.simulate(model, ROOM.vacuum()).warnings}
    assert not of_code(td.simulate(model, ROOM).warnings, "run.heat-stops-without-gas")
    still = td.steady(model, ROOM.vacuum())
    assert "run.heat-stops-without-gas" in [getattr(r, "code", "") for r in still.remarks]
    with raises_code("name.unknown", NameNotFoundError):
        still["inside"]


# reductions ----------------------------------------------------------------------------------------------------------------------------


def chain(**middle: Any) -> td.Model:
    """Three masses in a row, all in air, the last one heated."""
    masses = {"a": {"capacitance": "100 [J/K]", "reference_point": True}, "b": {"capacitance": "10 [J/K]"} | middle}
    if middle:
        masses["b"].pop("capacitance")
    links = {f"{x}{y}": {"kind": "conduction", "between": [x, y], "conductance": "0.5 [W/K]"} for x, y in ("ab", "bc")}
    skins = {f"s{x}": {"of": x, "to": "air", "area": "100 [cm^2]", **HTC, "emissivity": 0.8} for x in "ab"}
    nodes = masses | {"c": {"capacitance": "300 [J/K]", "reference_point": True}}
    loads = {"heat": {"into": "c", "power": "3 [W]"}}
    return td.model_from_dict({"title": "chain", "needs": ["air"], "nodes": nodes, "surfaces": skins, "conductors": links, "loads": loads})


def test_a_reduced_deck_kept_its_air_in_vacuum(tmp_path: Path) -> None:
    """36.5 degC for 47.4 degC."""
    found = td.qualify.reduce(chain(), ROOM, nodes=2)
    assert re.search("'air' .* 101325 Pa", found.remarks[0])
    td.save_model(found.model, tmp_path / "small.toml")
    again = td.load_model(tmp_path / "small.toml")
    assert again == found.model
    host = td.model_from_dict({"title": "host", "needs": ["room"], "submodels": {"p": {"use": again, "bind": {"air": "room"}}}})
    said = "'chain reduced to 2' .*'{}' .* 101325 Pa"
    others = {
        "pressure": td.simulation.Environment("60 [kPa]"),
        "gas": td.simulation.Environment(gas="He"),
        "gravity": td.simulation.Environment(gravity=0.0),
    }
    for scenario in (ROOM.vacuum(), PUMPED, *(ROOM.with_(environment={"air": e}) for e in others.values())):
        with refused(said.format("air"), ONE_STATE):
            td.simulate(again, scenario)
    with refused(said.format("room"), ONE_STATE):
        td.simulate(host, td.Scenario("x", boundaries={"room": "20 [degC]"}, start="room", duration="1 [h]").vacuum())
    assert td.simulate(again, ROOM)["c"].final == pytest.approx(td.simulate(chain(), ROOM)["c"].final, abs=0.05)
    with refused(said.format("air"), ONE_STATE):
        td.qualify.reduce(chain(), [ROOM, ROOM.vacuum()], nodes=2)
    empty = td.qualify.reduce(chain(), ROOM.vacuum(), nodes=2)
    assert td.simulate(empty.model, ROOM.vacuum())["c"].final == pytest.approx(td.simulate(chain(), ROOM.vacuum())["c"].final, abs=0.3)
    with refused("'chain reduced to 2' .*'air' ", ONE_STATE):
        td.simulate(empty.model, ROOM)


def test_reduce_made_phase_change_constant_without_a_remark() -> None:
    wax = [["0 [degC]", "0 [kJ/kg]"], ["27 [degC]", "54 [kJ/kg]"], ["29 [degC]", "244 [kJ/kg]"], ["80 [degC]", "346 [kJ/kg]"]]
    with raises_code("model.element-not-supported", DeckError, match="'b'"):
        td.qualify.reduce(chain(mass="10 [g]", enthalpy={"points": wax}), ROOM, nodes=2)
    rising = {"points": [["0 [degC]", "800 [J/(kg K)]"], ["100 [degC]", "1200 [J/(kg K)]"]]}
    found = td.qualify.reduce(chain(mass="10 [g]", specific_heat=rising), ROOM, nodes=3)
    assert any(re.search(r"^'b' .* 912\.9 J/\(kg K\) .* \d+ to \d+", r) for r in found.remarks)
    assert abs(found.worst.largest) < 0.02
