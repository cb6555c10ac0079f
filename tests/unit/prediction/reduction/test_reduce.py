"""Fewer masses: what must stay exact, how far the rest is off, and a delivery that is checked from its own folder."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import main
from thermid.base.errors import DeckError, ScenarioError

SISNAV = Path(__file__).parents[4] / "examples" / "sisnav"
MACRO = SISNAV / "macro"


def part(name: str, capacitance: float, watts: float, between: tuple[str, str], conductance: float) -> dict[str, object]:
    return {
        "nodes": {name: {"capacitance": f"{capacitance} [J/K]", "reference_point": True}},
        "conductors": {f"to_{name}": {"kind": "conduction", "between": list(between), "conductance": f"{conductance} [W/K]"}},
        "loads": {f"heat_{name}": {"into": name, "power": f"{watts} [W]"}},
    }


def network(*parts: dict[str, object], **more: object) -> td.Model:
    tables: dict[str, dict[str, object]] = {"nodes": {}, "conductors": {}, "loads": {}}
    for p in parts:
        for table, entries in p.items():
            tables[table].update(entries)  # type: ignore[call-overload]
    return td.model_from_dict({"title": "box", "needs": ["air"], **tables, **more})


def box(**more: object) -> td.Model:
    """A heavy base with two boards that are alike and a light chip on it."""
    return network(
        part("base", 800, 5, ("base", "air"), 0.8),
        part("left", 60, 2, ("left", "base"), 0.4),
        part("right", 60, 2, ("right", "base"), 0.4),
        part("chip", 2, 0.5, ("chip", "base"), 0.2),
        **more,
    )


WARM = td.Scenario("warm-up", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="2 [h]")


def test_what_is_alike_becomes_one_and_nothing_moves() -> None:
    found = td.qualify.reduce(box(), WARM, nodes=3)
    assert (found.masses, found.nodes) == ((4, 3), (4, 3))
    assert abs(found.worst.largest) < 1e-6
    assert {d.node for d in found.deviations} == {"base", "left", "right", "chip"}
    capacitances = td.simulation.compile_network(found.model).numbers().capacitances
    assert sorted(float(c or 0.0) for c in capacitances.values()) == pytest.approx([2.0, 120.0, 800.0])


def test_steady_temperatures_stay_exact_without_a_mass() -> None:
    """The chip's mass goes to the base; it stays readable, and settles where it did."""
    found = td.qualify.reduce(box(), WARM, nodes=3, keep=["left", "right", "base"])
    before, after = td.steady(box(), WARM), td.steady(found.model, WARM)
    assert {n: after[n] for n in before} == pytest.approx(before, abs=1e-9)
    numbers = td.simulation.compile_network(found.model).numbers()
    assert numbers.capacitances["chip"] is None
    assert float(numbers.capacitances["base"] or 0.0) == pytest.approx(802.0)
    assert found.by_node()["chip"].largest > 1.0  # at once, where it took ten seconds


def test_a_conductor_of_several_rows_counts_once() -> None:
    """A table of a kind is a row for each of its points; each was given the heat of them all, so that this pipe of 0.2 W/K was 0.6."""
    pipe = {"kind": "heat_pipe", "between": ["chip", "base"], "start_temperature": "30 [degC]", "transition": "10 [K]"}
    bent = part("chip", 2, 0.5, ("chip", "base"), 0.2)
    bent["conductors"] = {"to_chip": {**pipe, "on_conductance": "0.2 [W/K]", "off_conductance": "0.2 [W/K]"}}
    parts = (part("base", 800, 5, ("base", "air"), 0.8), part("left", 60, 2, ("left", "base"), 0.4))
    plain = td.qualify.reduce(network(*parts, part("chip", 2, 0.5, ("chip", "base"), 0.2)), WARM, nodes=2, keep=["base", "left"])
    same = td.qualify.reduce(network(*parts, bent), WARM, nodes=2, keep=["base", "left"])
    assert td.steady(same.model, WARM)["chip"] == pytest.approx(td.steady(plain.model, WARM)["chip"], abs=1e-6)


def test_a_massless_node_follows_an_outside_as_well() -> None:
    """Guyan's row sum: a node with 0.1 W/K to the base and 0.3 W/K outside takes part in the base with a sixteenth of its mass."""
    tail = part("tail", 160, 0, ("tail", "base"), 0.1)
    more = {"kind": "conduction", "between": ["tail", "air"], "conductance": "0.3 [W/K]"}
    tail["conductors"]["loss"] = more  # type: ignore[index]
    model = network(part("base", 800, 5, ("base", "air"), 0.8), tail)
    found = td.qualify.reduce(model, WARM, nodes=1, keep=["base"])
    assert float(td.simulation.compile_network(found.model).numbers().capacitances["base"] or 0.0) == pytest.approx(800 + 160 / 16)
    before, after = td.steady(model, WARM), td.steady(found.model, WARM)
    assert {n: after[n] for n in before} == pytest.approx(before, abs=1e-9)


def test_as_few_as_keep_within_a_limit() -> None:
    scenario = WARM.with_(start="steady", loads={"heat_base": {"times": ["0 [h]", "1 [h]"], "values": ["5 [W]", "9 [W]"], "after": "hold"}})
    loose, tight = (td.qualify.reduce(box(), scenario, within=limit) for limit in ("1 [K]", "0.001 [K]"))
    assert loose.masses[1] < tight.masses[1] <= 4
    assert abs(loose.worst.largest) <= 1.0
    assert abs(tight.worst.largest) <= 0.001


def test_the_deviation_is_that_of_two_runs(tmp_path: Path) -> None:
    scenario = WARM.with_(start="steady", loads={"heat_base": {"times": ["0 [h]", "1 [h]"], "values": ["5 [W]", "9 [W]"], "after": "hold"}})
    found = td.qualify.reduce(box(), scenario, nodes=1)
    td.save_model(found.model, tmp_path / "small.toml")
    small, full = (td.simulate(m, scenario) for m in (td.load_model(tmp_path / "small.toml"), box()))
    for d in found.deviations:
        off = small[d.node].kelvin - full[d.node].kelvin
        assert abs(d.largest) == pytest.approx(np.abs(off).max(), abs=1e-9)
        assert off[np.searchsorted(full.times, d.time)] == pytest.approx(d.largest, abs=1e-9)
        assert d.final == pytest.approx(off[-1], abs=1e-9)


def test_laws_between_nodes_that_stay_are_kept() -> None:
    model = box(
        surfaces={
            "skin": {
                "of": "base",
                "to": "air",
                "area": "0.05 [m^2]",
                "emissivity": "0.8",
                "htc": {"coefficient": "1.4 [W/(m^2 K)]", "exponent": 0.25},
            }
        }
    )
    found = td.qualify.reduce(model, WARM, nodes=3)
    assert abs(found.worst.largest) < 1e-5
    assert found.remarks == (
        "made with 'air' in one state, air at 101325 Pa; its conductances are valid there only, and other states are refused",
    )
    forms = {r.form for r in td.simulation.compile_network(found.model).numbers().conductors}
    assert forms == {"linear", "radiation", "power"}


@pytest.fixture(scope="module")
def macro() -> td.Model:
    return td.qualify.macro_model(MACRO / "macro.toml")


def test_the_unit_on_its_host_with_half_its_masses(macro: td.Model) -> None:
    scenarios = [td.load_scenario(MACRO / f"{n}.toml") for n in ("pad_hold", "transport")]
    found = td.qualify.reduce(macro, scenarios, within="0.2 [K]", at="unit")
    assert found.masses == (10, 5)
    assert found.nodes == (20, 5)
    assert len(found.by_node()) == 8
    assert abs(found.worst.largest) < 0.2
    run = td.simulate(found.inside, scenarios[0])  # same scenario, same names
    assert run["FOG_x"].highest == pytest.approx(td.simulate(macro, scenarios[0])["FOG_x"].highest, abs=0.03)


def test_a_flow_keeps_its_direction(macro: td.Model) -> None:
    still = td.load_scenario(MACRO / "pad.toml")
    found = td.qualify.reduce(macro, still, nodes=6)
    assert "flow" in {r.form for r in td.simulation.compile_network(found.model).numbers().conductors}
    assert abs(found.worst.largest) < 1.5


@pytest.mark.parametrize(
    ("more", "code", "match"),
    [
        ({}, "value.incomplete", "'nodes' or 'within'"),
        ({"nodes": 2, "within": "1 [K]"}, "value.incomplete", "'nodes' or 'within'"),
        ({"nodes": 2, "keep": ["chipp"]}, "name.unknown", r"'chipp'.*'chip'\?"),
        ({"nodes": 2, "at": "unit"}, "name.unknown", "'unit'"),
    ],
)
def test_mistakes_of_a_reduction_are_named(more: dict[str, object], code: str, match: str) -> None:
    with raises_code(code, td.ThermidError, match=match):
        td.qualify.reduce(box(), WARM, **more)


def test_a_thermostat_is_kept_outside() -> None:
    heated = td.model_from_dict(
        {
            "title": "heated",
            "needs": ["air"],
            "nodes": {"a": {"capacitance": "50 [J/K]"}},
            "conductors": {"g": {"kind": "conduction", "between": ["a", "air"], "conductance": "0.2 [W/K]"}},
            "loads": {"h": {"into": "a", "power": "4 [W]", "thermostat": {"on_below": "25 [degC]", "off_above": "28 [degC]"}}},
        }
    )
    with raises_code("model.element-not-supported", DeckError, match=r"'h'.*\(thermostat\.off_above.*thermostat\.on_below\)"):
        td.qualify.reduce(heated, WARM, nodes=1)


def test_a_part_that_changes_in_time_is_refused(macro: td.Model) -> None:
    with raises_code("model.element-not-supported", DeckError, match="'air_flow'"):
        td.qualify.reduce(macro, td.load_scenario(MACRO / "pad_hold.toml"), nodes=6)
    skin = {"of": "base", "to": "air", "area": "0.05 [m^2]", "htc": "4 [W/(m^2 K)]", "emissivity": 0.8}
    thinner = {"times": ["0 [h]", "1 [h]"], "values": ["1 [atm]", "0.1 [atm]"], "after": "hold"}
    with raises_code("model.element-not-supported", DeckError, match="'skin.*'"):
        td.qualify.reduce(box(surfaces={"skin": skin}), WARM.with_(environment={"air": td.simulation.Environment(thinner)}), nodes=3)


# delivery ----------------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def project(tmp_path: Path) -> Path:
    td.save_model(box(), tmp_path / "box.toml")
    (tmp_path / "warm.toml").write_text(
        'title = "warm-up"\nduration = "2 [h]"\nstart = "air"\nboundaries = { air = "20 [degC]" }\n', "utf-8"
    )
    return tmp_path


def test_a_delivery_is_met_from_its_folder(project: Path) -> None:
    model = td.load_model(project / "box.toml").with_values({"to_base.conductance": "0.9 [W/K]"}, "a fit")
    target = td.qualify.deliver(model, [project / "warm.toml"], project / "out", within="0.5 [K]")
    record = json.loads(target.read_text("utf-8"))
    assert set(record["files"]) == {"full/model.toml", "scenarios/warm.toml", "reduced/model.toml"}
    assert record["written"]["by"].startswith("thermid ")
    assert set(record["reduced"]["largest_K"]) == {"base", "left", "right", "chip"}
    assert record["runs"]["warm.toml"]["heat_balance"]["residual"] < 1e-6
    again = td.load_model(project / "out" / "full" / "model.toml")
    assert td.steady(again, WARM)["base"] == pytest.approx(td.steady(model, WARM)["base"], abs=1e-12)
    assert td.qualify.check_delivery(project / "out")["warm.toml"] < 1e-6


def test_a_changed_file_and_a_missed_temperature_are_found(project: Path) -> None:
    td.qualify.deliver(td.load_model(project / "box.toml"), [project / "warm.toml"], project / "out")
    deck = project / "out" / "full" / "model.toml"
    deck.write_text(deck.read_text("utf-8").replace("800", "810"), "utf-8")
    with raises_code("delivery.differs", DeckError, match="'full/model.toml'"):
        td.qualify.check_delivery(project / "out")
    checks = project / "out" / "checks.json"
    record = json.loads(checks.read_text("utf-8"))
    record["files"] = {}
    checks.write_text(json.dumps(record), "utf-8")
    with raises_code("delivery.differs", DeckError, match=r"'.*'.*0\.\d+.*warm\.toml"):
        td.qualify.check_delivery(project / "out")
    checks.unlink()
    with raises_code("file.another-kind", DeckError, match="'out'"):
        td.qualify.check_delivery(project / "out")


def test_mistakes_of_a_delivery(project: Path) -> None:
    model = td.load_model(project / "box.toml")
    with raises_code("output.over-another-file", DeckError):
        td.qualify.deliver(model, [project / "warm.toml"], project)
    with raises_code("value.incomplete", DeckError):
        td.qualify.deliver(model, [], project / "out")
    with raises_code("value.incomplete", ScenarioError, match="'nodes'.*'within'"):
        td.qualify.deliver(model, [project / "warm.toml"], project / "out", nodes=2, within="1 [K]")
    assert not (project / "out").exists()


def command(*words: object) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["thermid", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
    return int(left.value.code or 0)


def test_the_command_delivers_and_checks(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = project / "out"
    assert command("deliver", project / "box.toml", "--scenario", project / "warm.toml", "--to", out, "--nodes", 3) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].endswith(", 1 scenario met")
    assert said[1] == "  box: 3 masses of 4, 3 nodes of 4"
    assert command("deliver", out, "--check", "--json") == 0
    assert json.loads(capsys.readouterr().out)["met_K"]["warm.toml"] < 1e-6
    assert command("deliver", project / "box.toml", "--scenario", project / "warm.toml") == 2
    assert "--to FOLDER" in capsys.readouterr().err
