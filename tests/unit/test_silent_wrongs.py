"""Wrong results and wrong messages that users met: one test for each, named after what was seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.errors import DeckError, IdentificationError, RecordError, SolverError, UnitError
from thermid.model.kinds import KINDS
from thermid.model.modelfile import save_model
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.physics.correlations import correlation
from thermid.physics.decay import radiative_decay
from thermid.qualify.correlation import correlate
from thermid.qualify.criteria import CriteriaSet
from thermid.reporting.diagram import STYLES, diagram
from thermid.studio.project import Project
from thermid.units import unit

# every kind of element is drawn ------------------------------------------------------------------------------------------------------

RISING = {"points": [["0 [degC]", "0.1 [W/K]"], ["60 [degC]", "0.3 [W/K]"]]}
EXAMPLES: dict[str, dict[str, Any]] = {
    "conduction": {"between": ["a", "b"], "conductance": "0.5 [W/K]"},
    "contact": {"between": ["a", "b"], "contact_conductance": "250 [W/(m^2 K)]", "area": "1 [cm^2]", "gap": "0.1 [mm]"},
    "convection": {"between": ["b", "air"], "htc": {"length": "3 [cm]", "orientation": "up"}, "area": "9 [cm^2]"},
    "gas": {"between": ["a", "b"], "area": "2 [cm^2]", "gap": "0.5 [mm]"},
    "effective": {"between": ["b", "air"], "effective_htc": "5 [W/(m^2 K)]", "area": "1 [cm^2]"},
    "radiation": {"between": ["a", "walls"], "emissivity": 0.1, "area": "5 [cm^2]"},
    "flow": {"between": ["air", "b"], "mass_flow": "0.01 [g/s]", "specific_heat": "1006 [J/(kg K)]"},
    "lead": {"between": ["a", "walls"], "conductivity": "390 [W/(m K)]", "diameter": "1 [mm]", "length": "40 [cm]"}
    | {"htc": "5 [W/(m^2 K)]", "to": "air"},
    "heat_pipe": {"between": ["a", "b"], "on_conductance": "5 [W/K]", "off_conductance": "0.1 [W/K]"}
    | {"start_temperature": "40 [degC]", "transition": "4 [K]"},
    "table": {"between": ["a", "b"], "table": RISING},
}
"""One conductor of every kind."""


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
    named = {f"k_{kind}": {"kind": kind, **fields} for kind, fields in EXAMPLES.items()}
    return deck(named, loads=loads, surfaces={"skin": skin})


def test_a_lead_and_every_other_kind_is_drawn(tmp_path: Path) -> None:
    """A deck with a lead, or a heat pipe, ended `diagram`, `report` and the studio with a KeyError."""
    assert set(EXAMPLES) == set(KINDS) == set(STYLES)
    model = one_of_each()
    plain = diagram(model)
    for kind in KINDS:
        assert f"k_{kind} ({kind})" in plain
    assert {"lead", "heat loss of a lead", "heat pipe"} <= {text.split("<")[0] for text in plain.split(">")}
    file = tmp_path / "box.toml"
    save_model(model, file)
    project = Project(file)
    assert "k_lead" in project.desk(project.title).drawn({}, 0, 60.0, ())


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
    run = td.simulate(ball(), scenario, options=td.Options(method=method, large_tolerance=1e-5))
    assert run["ball"].kelvin[-1] == pytest.approx(float(radiative_decay(3600.0, 400.0, 0.8 * 0.1 * STEFAN_BOLTZMANN, 1000.0)), abs=2e-3)


@pytest.mark.parametrize("method", ["integrator", "large"])
def test_a_start_at_0_k_warms(method: str) -> None:
    scenario = td.Scenario("space", boundaries={"space": "0 [K]"}, start="0 [K]", duration="100 [h]")
    run = td.simulate(ball("10 [W]"), scenario, options=td.Options(method=method, large_tolerance=1e-5))
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
    with pytest.raises(td.ThermidError, match="below 0 K"):
        td.Scenario("space", boundaries={"space": "-1 [K]"}, start="300 [K]", duration="1 [h]")
    scenario = td.Scenario("space", boundaries={"space": "0 [K]"}, start="-1 [K]", duration="1 [h]")
    with pytest.raises(SolverError, match="must not lie below 0 K"):
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
    (said,) = [w for w in run.warnings if "no path" in w]
    assert said == "'a', 'b' have no path to a boundary: the heat that is there stays there"


def test_a_stream_that_leaves_cools_nothing_upstream() -> None:
    """A stream carries the temperature of its first end: a node that it only leaves has no path to a boundary."""
    stream = {"kind": "flow", "between": ["a", "b"], "mass_flow": "1 [g/s]", "specific_heat": "1000 [J/(kg K)]"}
    link = {"kind": "conduction", "between": ["b", "air"], "conductance": "1 [W/K]"}
    model = deck({"k": stream, "l": link}, loads={"heat": {"into": "a", "power": "1 [W]"}})
    bench = td.Scenario("bench", boundaries={"air": "300 [K]", "walls": "300 [K]"}, start="300 [K]", duration="100 [s]")
    run = td.simulate(model, bench)
    assert run["a"].kelvin[-1] == pytest.approx(301.0, abs=1e-6)
    assert any("'a' has no path to a boundary: warms at 36 K/h" in w for w in run.warnings)
    with pytest.raises(SolverError, match="'a' has no path to a boundary"):
        td.steady(model, bench)


@pytest.mark.parametrize("method", ["integrator", "large"])
def test_a_constant_load_does_not_grow_with_temperature(method: str) -> None:
    scenario = td.Scenario("space", boundaries={"space": "3 [K]"}, start="300 [K]", duration="100 [h]")
    with pytest.raises(SolverError) as caught:
        td.simulate(ball("-10 [W]"), scenario, options=td.Options(method=method))
    assert "a negative power takes more than there is" in str(caught.value)
    assert "grows" not in str(caught.value)
    with pytest.raises(SolverError) as caught:
        td.steady(ball("-10 [W]"), scenario)
    assert "negative power that takes more than can flow in" in str(caught.value)


def test_a_correlation_of_a_vertical_plate_is_not_for_horizontal_plates() -> None:
    """`ht` gives it an argument `buoyancy` that it does not use."""
    found = correlation("Nu_free_vertical_plate")
    assert not found.facing
    assert found.nusselt(1e6, 0.7, True) == pytest.approx(correlation("Nu_vertical_plate_Churchill").nusselt(1e6, 0.7, True), rel=1e-9)
    with pytest.raises(DeckError, match="'Nu_free_horizontal_plate' is for horizontal plates"):
        correlation("Nu_free_horizontal_plate")
    with pytest.raises(DeckError, match=r"is for vertical plates, and the orientation is 'up'"):
        correlation("Nu_free_vertical_plate", "up")
    with pytest.raises(DeckError, match="takes Pr, Gr, L, D"):
        correlation("Nu_vertical_cylinder_Al_Arabi_Khamis")


@pytest.mark.parametrize(
    ("written", "cure"),
    [
        ("cfm", r"Write ft\^3/min for cfm"),
        ("CFM", r"Write ft\^3/min for CFM"),
        ("lpm", "Write l/min"),
        ("W/m2K", r"Did you mean 'W/\(m\^2 K\)'\?"),
        ("W/m^2K", r"Did you mean 'W/\(m\^2 K\)'\?"),
        ("W/m²K", r"Did you mean 'W/\(m\^2 K\)'\?"),
        ("kJ/kgK", r"Did you mean 'kJ/\(kg K\)'\?"),
        ("m3/s", r"Did you mean 'm\^3/s'\?"),
        ("W/mK", r"mK is the millikelvin\. Write \(m K\)"),
    ],
)
def test_cfm_is_no_length_and_w_m2k_no_heat_flux(written: str, cure: str) -> None:
    with pytest.raises(UnitError, match=cure):
        unit(written)


def test_what_is_advised_for_cfm_is_a_volume_flow() -> None:
    assert unit("ft^3/min").dimension == unit("m^3/s").dimension
    assert float(unit("ft^3/min").factor) == pytest.approx(4.719474e-4, rel=1e-6)


# blank tails --------------------------------------------------------------------------------------------------------------------------

MINUTES = np.arange(0.0, 121.0) * 60.0
LEVEL = {"bench": [(5400.0, 7200.0)]}


def log(name: str, values: Any, valid: Any = True) -> td.Record:
    own = np.array(np.broadcast_to(valid, MINUTES.shape))
    return td.Record.from_arrays(name, MINUTES, {"T1": np.where(own, values, np.nan)})


def test_a_blank_tail_of_the_simulation_does_not_agree() -> None:
    """The simulated column ends at 3600 s, where both are at 300 K: its last number was kept, "met, 0.00 K". In truth it goes on rising."""
    truth = 300.0 + 3.42 * np.clip((MINUTES - 3600.0) / 1800.0, 0.0, 1.0)
    measured = log("bench", np.full(MINUTES.size, 300.0))
    ours = CriteriaSet("ours", each=3.0, kinds=("steady",))
    whole = correlate((measured, log("run", truth)), [ours], steady=LEVEL)
    assert not whole.passed("ours")
    assert whole.deviations[0].mean == pytest.approx(-3.42)
    early = MINUTES <= 3600.0
    with pytest.raises(RecordError, match=r"simulated numbers of 'T1' run from 0 s to 3600 s, its readings from 0 s to 7200 s"):
        correlate((measured, log("run", np.where(early, truth, np.nan), early)), [ours], steady=LEVEL)
    hole = (MINUTES < 3600.0) | (MINUTES > 5400.0)
    with pytest.raises(RecordError, match="no numbers for 'T1' between 3540 s and 5460 s, where there are readings"):
        correlate((measured, log("run", np.where(hole, truth, np.nan), hole)), [ours], steady=LEVEL)
    with pytest.raises(RecordError, match="no simulated number at all"):
        correlate((measured, log("run", truth, np.zeros(MINUTES.size, dtype=bool))), [ours])


def test_a_blank_tail_of_the_readings_does_not_agree() -> None:
    """Readings that end within a settled stretch were taken for all of it."""
    truth = 300.0 + 3.42 * np.clip((MINUTES - 5400.0) / 1800.0, 0.0, 1.0)
    early = MINUTES <= 5700.0
    with pytest.raises(IdentificationError, match=r"has readings of 'T1' in 'bench' from 5400 s to 5700 s only"):
        correlate((log("bench", np.where(early, 300.0, np.nan), early), log("run", truth)), steady=LEVEL)
