"""Wrong results and wrong messages that users met: one test for each, named after what was seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from oracles.decay import radiative_decay
from thermid.app.studio.project import Project
from thermid.base.errors import DeckError, IdentificationError, RecordError, SolverError, UnitError, code_of
from thermid.base.units import STEFAN_BOLTZMANN, unit
from thermid.campaign.stages import Criteria, Limits, check_limits, correlate
from thermid.model._tree.identity import to_dict
from thermid.model.tree import KINDS, save_model
from thermid.physics.correlations import correlation
from thermid.prediction._reduction.macro import host_values
from thermid.prediction.reduction import assumed
from thermid.qualify.plans import deliver
from thermid.reporting._diagrams.map import STYLES
from thermid.reporting.diagrams import network_map
from unit.model.every_kind import firsts

# every kind of element is drawn ------------------------------------------------------------------------------------------------------

RISING = {"points": [["0 [degC]", "0.1 [W/K]"], ["60 [degC]", "0.3 [W/K]"]]}
EXAMPLES: dict[str, dict[str, Any]] = {kind: {**fields, "between": ["a", "b"]} for kind, fields in firsts().items()} | {
    "contact": {"between": ["a", "b"], "contact_conductance": "250 [W/(m^2 K)]", "area": "1 [cm^2]", "gap": "0.1 [mm]"},
    "convection": {"between": ["b", "air"], "htc": {"length": "3 [cm]", "orientation": "up"}, "area": "9 [cm^2]"},
    "gas": {"between": ["a", "b"], "area": "2 [cm^2]", "gap": "0.5 [mm]"},
    "effective": {"between": ["b", "air"], "effective_htc": "5 [W/(m^2 K)]", "area": "1 [cm^2]"},
    "radiation": {"between": ["a", "walls"], "emissivity": 0.1, "area": "5 [cm^2]"},
    "flow": {"between": ["air", "b"], "mass_flow": "0.01 [g/s]", "specific_heat": "1006 [J/(kg K)]"},
    "duct": {"between": ["b", "air"], "diameter": "4 [mm]", "length": "20 [cm]", "mass_flow": "0.1 [g/s]"},
    "heat_sink": {"between": ["b", "air"], "width": "2 [mm]", "height": "15 [mm]", "length": "6 [cm]", "count": 12}
    | {"fin_thickness": "1 [mm]", "fin_conductivity": "180 [W/(m K)]", "volume_flow": "100 [l/min]"},
    "lead": {"between": ["a", "walls"], "conductivity": "390 [W/(m K)]", "diameter": "1 [mm]", "length": "40 [cm]"}
    | {"htc": "5 [W/(m^2 K)]", "to": "air"},
    "table": {"between": ["a", "b"], "table": RISING},
}
"""One conductor of every kind; below stand those with ends or fields of their own."""


def deck(conductors: dict[str, Any], **more: Any) -> td.Model:
    nodes = {"a": {"capacitance": "100 [J/K]", "reference_point": True}, "b": {"capacitance": "50 [J/K]"}}
    return td.model_from_dict({"title": "Box", "needs": ["air", "walls"], "nodes": nodes, "conductors": conductors} | more)


def one_of_each() -> td.Model:
    load = {"into": "a", "power": "1 [W]"}
    loads = {
        "plain": load,
        "pulse": load | {"periodic": {"period": "10 [min]", "duty": "30 [%]"}},
        "wave": load | {"sine": {"amplitude": "0.5 [W]", "period": "1 [h]"}},
        "stat": load | {"thermostat": {"sensor": "b", "on_below": "20 [degC]", "off_above": "25 [degC]"}},
        "prop": load | {"proportional": {"gain": "0.5 [W/K]", "setpoint": "20 [degC]"}},
        "curve": {"into": "b", "table": {"points": [["0 [degC]", "1 [W]"], ["60 [degC]", "0.5 [W]"]]}},
    }
    skin = {"of": "a", "to": "air", "area": "0.02 [m^2]", "htc": "4 [W/(m^2 K)]", "emissivity": 0.8, "radiates_to": "walls"}
    named = {f"k_{kind}": {**fields, "kind": kind} for kind, fields in EXAMPLES.items()}
    return deck(named, loads=loads, surfaces={"skin": skin})


def test_a_lead_and_every_other_kind_is_drawn(tmp_path: Path) -> None:
    """A deck with a lead, or a heat pipe, ended `diagram`, `report` and the studio with a KeyError."""
    assert set(EXAMPLES) == set(KINDS) == set(STYLES)
    model = one_of_each()
    plain = network_map(model)
    for kind in KINDS:
        assert f"k_{kind} ({kind})" in plain
    file = tmp_path / "box.toml"
    save_model(model, file)
    project = Project(file)
    assert "k_lead" in project.desk(project.title).moment({}, 0, 60.0).drawn()


# absolute zero ------------------------------------------------------------------------------------------------------------------------


def ball(load: str = "0 [W]") -> td.Model:
    glow = {"kind": "radiation", "between": ["ball", "space"], "emissivity": 0.8, "area": "0.1 [m^2]"}
    return td.model_from_dict(
        {
            "title": "Ball",
            "needs": ["space"],
            "nodes": {"ball": {"capacitance": "1 [kJ/K]"}},
            "conductors": {"glow": glow},
            "loads": {"heat": {"into": "ball", "power": load}},
        }
    )


@pytest.mark.parametrize("method", ["integrator", "large"])
def test_a_sink_at_0_k_takes_radiation(method: str) -> None:
    """It was refused: "a temperature must lie above 0 K". The decay to 0 K has a closed form."""
    scenario = td.Scenario("space", boundaries={"space": "0 [K]"}, start="400 [K]", duration="1 [h]")
    run = td.simulate(ball(), scenario, options=td.Options(error=2e-4, method=method))
    assert run["ball"].kelvin[-1] == pytest.approx(float(radiative_decay(3600.0, 400.0, 0.8 * 0.1 * STEFAN_BOLTZMANN, 1000.0)), abs=2e-3)


@pytest.mark.parametrize("method", ["integrator", "large"])
def test_a_start_at_0_k_warms(method: str) -> None:
    scenario = td.Scenario("space", boundaries={"space": "0 [K]"}, start="0 [K]", duration="100 [h]")
    run = td.simulate(ball("10 [W]"), scenario, options=td.Options(error=2e-4, method=method))
    assert run["ball"].kelvin[-1] == pytest.approx(td.steady(ball("10 [W]"), scenario)["ball"], abs=2e-3)
    early = td.simulate(ball("10 [W]"), scenario.with_(duration="60 [s]"), options=td.Options(method=method))
    assert early["ball"].kelvin[-1] == pytest.approx(0.6, abs=1e-6)
    cold = td.simulate(ball(), scenario, options=td.Options(method=method))
    assert np.abs(cold["ball"].kelvin).max() < 1e-6


def test_a_linear_network_starts_at_0_k_and_ends_there() -> None:
    link = {"kind": "conduction", "between": ["a", "air"], "conductance": "1 [W/K]"}
    model = td.model_from_dict({"title": "A", "needs": ["air"], "nodes": {"a": {"capacitance": "10 [J/K]"}}, "conductors": {"k": link}})
    for method in ("modal", "integrator"):
        options = td.Options(method=method)
        up = td.simulate(model, td.Scenario("up", boundaries={"air": "10 [K]"}, start="0 [K]", duration="10 [s]"), options=options)
        assert up["a"].kelvin[-1] == pytest.approx(10.0 * (1.0 - np.exp(-1.0)), abs=1e-5)
        down = td.simulate(model, td.Scenario("down", boundaries={"air": "0 [K]"}, start="10 [K]", duration="1 [h]"), options=options)
        assert down["a"].kelvin[-1] == pytest.approx(0.0, abs=1e-5)


def test_members_of_an_ensemble_start_at_0_k() -> None:
    scenario = td.Scenario("space", boundaries={"space": "0 [K]"}, start="0 [K]", duration="60 [s]")
    found = td.prepare(ball("10 [W]"), scenario, free=("heat.power",)).ensemble({"heat.power": [5.0, 10.0]})
    assert not found.failed
    assert found.temperatures("ball")[-1] == pytest.approx([0.3, 0.6], abs=1e-5)


def test_below_0_k_is_still_refused() -> None:
    with raises_code("value.outside-range", match="0"):
        td.Scenario("space", boundaries={"space": "-1 [K]"}, start="300 [K]", duration="1 [h]")
    scenario = td.Scenario("space", boundaries={"space": "0 [K]"}, start="-1 [K]", duration="1 [h]")
    with raises_code("value.outside-range", match="0"):
        td.simulate(ball(), scenario)


# messages -----------------------------------------------------------------------------------------------------------------------------


def test_nothing_changes_there_is_not_said_of_a_node_that_falls_by_50_k() -> None:
    """Two bodies without a way out even their temperatures out: one falls from 100 to 50 degC."""
    link = {"kind": "conduction", "between": ["a", "b"], "conductance": "1 [W/K]"}
    nodes = {"a": {"capacitance": "50 [J/K]"}, "b": {"capacitance": "50 [J/K]"}}
    model = td.model_from_dict({"title": "Pair", "needs": ["air"], "nodes": nodes, "conductors": {"k": link}})
    run = td.simulate(
        model, td.Scenario("pair", boundaries={"air": "0 [degC]"}, start="0 [degC]", initial={"a": "100 [degC]"}, duration="1 [h]")
    )
    assert run["a"].celsius[-1] == pytest.approx(50.0, abs=1e-3)
    (said,) = [w for w in run.warnings if code_of(w) == "model.no-path-to-boundary"]
    assert code_of(said) == "model.no-path-to-boundary"
    assert "'a', 'b'" in said


def test_a_stream_that_leaves_cools_nothing_upstream() -> None:
    """A stream carries the temperature of its first end: a node that it only leaves has no path to a boundary."""
    stream = {"kind": "flow", "between": ["a", "b"], "mass_flow": "1 [g/s]", "specific_heat": "1000 [J/(kg K)]"}
    link = {"kind": "conduction", "between": ["b", "air"], "conductance": "1 [W/K]"}
    model = deck({"k": stream, "l": link}, loads={"heat": {"into": "a", "power": "1 [W]"}})
    bench = td.Scenario("bench", boundaries={"air": "300 [K]", "walls": "300 [K]"}, start="300 [K]", duration="100 [s]")
    run = td.simulate(model, bench)
    assert run["a"].kelvin[-1] == pytest.approx(301.0, abs=1e-6)
    assert any(code_of(w) == "model.no-path-to-boundary" and "36 K/h" in w for w in run.warnings)
    with raises_code("model.no-path-to-boundary", SolverError, match="'a'"):
        td.steady(model, bench)


@pytest.mark.parametrize("method", ["integrator", "large"])
def test_a_constant_load_does_not_grow_with_temperature(method: str) -> None:
    scenario = td.Scenario("space", boundaries={"space": "3 [K]"}, start="300 [K]", duration="100 [h]")
    with pytest.raises(SolverError) as caught:
        td.simulate(ball("-10 [W]"), scenario, options=td.Options(method=method))
    assert code_of(str(caught.value)) == "run.did-not-finish"
    assert "2" in str(caught.value)
    assert "grows" not in str(caught.value)
    with pytest.raises(SolverError) as caught:
        td.steady(ball("-10 [W]"), scenario)
    assert code_of(str(caught.value)) == "run.no-steady-state"
    assert "0 K" in str(caught.value)


def test_a_correlation_of_a_vertical_plate_is_not_for_horizontal_plates() -> None:
    """`ht` gives it an argument `buoyancy` that it does not use."""
    found = correlation("Nu_free_vertical_plate")
    assert not found.facing
    assert found.nusselt(1e6, 0.7, True) == pytest.approx(correlation("Nu_vertical_plate_Churchill").nusselt(1e6, 0.7, True), rel=1e-9)
    with raises_code("value.incomplete", DeckError, match="'Nu_free_horizontal_plate'"):
        correlation("Nu_free_horizontal_plate")
    with raises_code("value.excludes-another", DeckError, match="'up'"):
        correlation("Nu_free_vertical_plate", "up")
    with raises_code("model.element-not-supported", DeckError):
        correlation("Nu_vertical_cylinder_Al_Arabi_Khamis")


@pytest.mark.parametrize(
    ("written", "code", "match"),
    [
        ("cfm", "unit.unknown", "3/min"),
        ("CFM", "unit.unknown", "3/min"),
        ("lpm", "unit.unknown", "l/min"),
        ("W/m2K", "unit.unknown", r"'W/\(m\^2 K\)'"),
        ("W/m^2K", "unit.unknown", r"'W/\(m\^2 K\)'"),
        ("W/m²K", "unit.unknown", r"'W/\(m\^2 K\)'"),
        ("kJ/kgK", "unit.unknown", r"'kJ/\(kg K\)'"),
        ("W/mK", "unit.ambiguous", r"'\[W/mK\]'"),
    ],
)
def test_cfm_is_no_length_and_w_m2k_no_heat_flux(written: str, code: str, match: str) -> None:
    with raises_code(code, UnitError, match=match):
        unit(written)


def test_what_is_advised_for_cfm_is_a_volume_flow() -> None:
    assert unit("ft^3/min").dimension == unit("m^3/s").dimension
    assert float(unit("ft^3/min").factor) == pytest.approx(4.719474e-4, rel=1e-6)


# blank tails --------------------------------------------------------------------------------------------------------------------------

MINUTES = np.arange(0.0, 121.0) * 60.0
LEVEL = {"bench": [(5400.0, 7200.0)]}


def log(name: str, values: Any, valid: Any = True) -> td.Record:
    own = np.array(np.broadcast_to(valid, MINUTES.shape))
    return td.Record.from_arrays(name, MINUTES, {"T1": np.where(own, values, np.nan)}, unit="K")


def test_a_blank_tail_of_the_simulation_does_not_agree() -> None:
    """The simulated column ends at 3600 s, where both are at 300 K: its last number was kept, "met, 0.00 K". In truth it goes on rising."""
    truth = 300.0 + 3.42 * np.clip((MINUTES - 3600.0) / 1800.0, 0.0, 1.0)
    measured = log("bench", np.full(MINUTES.size, 300.0))
    ours = Criteria("ours", each=3.0, kinds=("steady",))
    whole = correlate((measured, log("run", truth)), [ours], steady=LEVEL)
    assert not whole.passed("ours")
    assert whole.deviations[0]["mean"] == pytest.approx(-3.42)
    early = MINUTES <= 3600.0
    with raises_code("record.not-overlapping", RecordError, match="'T1'.*0.*3600.*0.*7200"):
        correlate((measured, log("run", np.where(early, truth, np.nan), early)), [ours], steady=LEVEL)
    hole = (MINUTES < 3600.0) | (MINUTES > 5400.0)
    with raises_code("record.not-overlapping", RecordError, match="'T1'.*3540.*5460"):
        correlate((measured, log("run", np.where(hole, truth, np.nan), hole)), [ours], steady=LEVEL)
    with raises_code("record.not-overlapping", RecordError):
        correlate((measured, log("run", truth, np.zeros(MINUTES.size, dtype=bool))), [ours])


def test_a_blank_tail_of_the_readings_does_not_agree() -> None:
    """Readings that end within a settled stretch were taken for all of it."""
    truth = 300.0 + 3.42 * np.clip((MINUTES - 5400.0) / 1800.0, 0.0, 1.0)
    early = MINUTES <= 5700.0
    with raises_code("record.nothing-there", IdentificationError, match="'T1'.*'bench'.*5400.*5700"):
        correlate((log("bench", np.where(early, 300.0, np.nan), early), log("run", truth)), steady=LEVEL)


# coolers, tables without a source, files of one name ----------------------------------------------------------------------------------


def test_a_cooler_that_runs_is_on() -> None:
    """A load of negative power counted as off, so that the limits of a unit switched off were those that held."""
    link = {"kind": "conduction", "between": ["a", "air"], "conductance": "1 [W/K]"}
    cooler = {"cooler": {"into": "a", "power": "-5 [W]", "periodic": {"period": "2 [h]", "duty": "50 [%]"}}}
    bench = td.Scenario("bench", boundaries={"air": "20 [degC]", "walls": "20 [degC]"}, start="air", duration="2 [h]")
    run = td.simulate(deck({"k": link}, loads=cooler), bench, every="1 [min]")
    one = Limits("a", "a", td.quantity((288.15, 308.15), unit="K"), td.quantity((268.15, 328.15), unit="K"), loads=("cooler",))
    states = {c.state: c for c in check_limits(run, [one])}
    assert states["operating"].lowest == pytest.approx(288.15, abs=1e-3)
    assert 0.0 < states["operating"].lowest_time <= 3600.0
    assert states["non-operating"].highest == pytest.approx(293.15, abs=1e-3)


def host(**source: str) -> td.Model:
    """A host with a table of conductance, one of conductivity, one of specific heat and one of power."""
    known = {"source": "measured", "basis": "bench of May"}
    heat = {"points": [["0 [degC]", "900 [J/(kg K)]"], ["60 [degC]", "950 [J/(kg K)]"]]} | known
    bar = {"points": [["0 [degC]", "150 [W/(m K)]"], ["60 [degC]", "140 [W/(m K)]"]]} | known
    power = {"points": [["0 [degC]", "1 [W]"], ["60 [degC]", "0.5 [W]"]]} | known
    part = {"title": "Unit", "needs": ["foot"], "offers": ["case"], "nodes": {"case": {"capacitance": "1 [J/K]"}}}
    touch = {"kind": "table", "between": ["case", "foot"], "table": RISING}
    unit_deck = td.model_from_dict(part | {"conductors": {"touch": touch}})
    sized = {"area": {"value": "1 [cm^2]", **known}, "thickness": {"value": "1 [cm]", **known}}
    return td.model_from_dict(
        {
            "title": "Host",
            "needs": ["air"],
            "nodes": {"plate": {"mass": {"value": "1 [kg]", **known}, "specific_heat": heat}},
            "submodels": {"unit": {"use": unit_deck, "bind": {"foot": "plate"}}},
            "conductors": {
                "strap": {"kind": "table", "between": ["plate", "air"], "table": RISING | source},
                "bar": {"kind": "conduction", "between": ["plate", "air"], "conductivity": bar, **sized},
            },
            "loads": {"chip": {"into": "plate", "table": power}},
        }
    )


def test_a_table_without_a_source_is_no_macro_model() -> None:
    """Tables were not asked for their source, and did not count among the assumed values."""
    with raises_code("value.incomplete", DeckError, match="'strap.table'"):
        td.qualify.macro_model(host())
    made = td.qualify.macro_model(host(source="assumed", basis="a guess"))
    assert assumed(made) == ("strap.table",)
    tables = [v for v in host_values(made) if "table" in v.text]
    assert {v.path: v.source for v in tables} == {
        "strap.table": "assumed",
        "bar.conductivity": "measured",
        "plate.specific_heat": "measured",
        "chip.table": "measured",
    }
    assert all(v.basis for v in tables)


def test_the_source_of_a_table_is_saved_with_it(tmp_path: Path) -> None:
    made = host(source="assumed", basis="a guess")
    save_model(made, tmp_path / "host.toml")
    again = td.load_model(tmp_path / "host.toml")
    assert to_dict(again)["conductors"] == to_dict(made)["conductors"]
    assert again.conductors["strap"].curve == made.conductors["strap"].curve
    assert again.conductors["strap"].curve != host().conductors["strap"].curve
    shape = td.model.law(lambda t: 0.1 + 0.0 * t, between=("200 [K]", "400 [K]"), source="published", basis="a book")
    assert (shape.source, shape.basis) == ("published", "a book")


def test_a_delivery_with_two_scenarios_of_one_file_name_is_refused(tmp_path: Path) -> None:
    """The second took the place of the first without a word."""
    files = []
    for folder, level in (("hot", 50), ("cold", -10)):
        (tmp_path / folder).mkdir()
        files.append(tmp_path / folder / "case.toml")
        text = f'title = "{folder}"\nduration = "1 [min]"\nstart = "air"\n[boundaries]\nair = "{level} [degC]"\n'
        files[-1].write_text(text, encoding="utf-8")
    with raises_code("name.taken", DeckError, match="'case.toml'"):
        deliver(host(), files, tmp_path / "out")
    assert not (tmp_path / "out").exists()


# two schedules ------------------------------------------------------------------------------------------------------------------------


def test_two_streams_with_schedules_of_which_one_starts_at_zero() -> None:
    """They were refused where no sample has both streams: "the coefficient vanishes at the reference of its schedule"."""
    stream = {"kind": "flow", "mass_flow": "1 [g/s]", "specific_heat": "1000 [J/(kg K)]"}
    conductors = {"in_a": stream | {"between": ["air", "a"]}, "in_b": stream | {"between": ["air", "b"]}}
    model = deck(conductors)
    schedule = {
        "in_a.mass_flow": {"times": ["0 [s]", "200 [s]"], "values": ["0 [g/s]", "1 [g/s]"], "hold": True},
        "in_b.mass_flow": {"times": ["0 [s]", "200 [s]"], "values": ["2 [g/s]", "0 [g/s]"], "hold": True},
    }
    about = {"boundaries": {"air": "0 [degC]", "walls": "0 [degC]"}, "start": "100 [degC]", "duration": "400 [s]"}
    scenario = td.Scenario("swap", schedule=schedule, **about)
    run = td.simulate(model, scenario, times=[0.0, 200.0, 300.0, 400.0])
    assert run["a"].celsius == pytest.approx([100.0, 100.0, 100.0 * np.exp(-1.0), 100.0 * np.exp(-2.0)], abs=1e-3)
    assert run["b"].celsius == pytest.approx([100.0] + 3 * [100.0 * np.exp(-8.0)], abs=1e-3)
    free = td.prepare(model, scenario, ("in_a.specific_heat", "in_b.specific_heat"), times=[0.0, 200.0, 400.0]).run(sensitivities=True)
    slopes = free.slopes("a")[-1], free.slopes("b")[-1]
    assert slopes[0] == pytest.approx([-2.0e-3 * 100.0 * np.exp(-2.0), 0.0], abs=1e-6)
    assert slopes[1] == pytest.approx([0.0, -8.0e-3 * 100.0 * np.exp(-8.0)], abs=1e-6)
