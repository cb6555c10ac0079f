"""Controls: shares that follow temperatures, beside an independent integration (tests/controlled.py): courses, derivatives, balances."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from controlled import Controlled
from thermid.base.errors import SolverError
from thermid.reporting.diagrams import network_map

AIR, START = 293.15, 295.65
TIGHT = td.Options(error=4e-9, method="integrator")


def deck(controls: dict[str, Any], **elements: dict[str, Any]) -> dict[str, Any]:
    """Return a plate that a heater warms, joined to a radiator that loses heat to the air; elements are changed by name."""
    base: dict[str, Any] = {
        "title": "plate and radiator",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "120 [J/K]"}, "radiator": {"capacitance": "80 [J/K]"}},
        "conductors": {
            "pipe": {"kind": "conduction", "between": ["plate", "radiator"], "conductance": "2 [W/K]"},
            "loss": {"kind": "conduction", "between": ["radiator", "air"], "conductance": "0.5 [W/K]"},
            "leak": {"kind": "conduction", "between": ["plate", "air"], "conductance": "0.1 [W/K]"},
        },
        "loads": {"heater": {"into": "plate", "power": "12 [W]"}, "boost": {"into": "radiator", "power": "4 [W]"}},
        "controls": controls,
    }
    for name, changes in elements.items():
        table = next(t for t in ("conductors", "loads") if name in base[t])
        base[table][name] = base[table][name] | changes
    return base


CONTROLS: dict[str, dict[str, Any]] = {
    "table": {"follows": "plate", "table": {"points": [["25 [degC]", "0.1"], ["35 [degC]", "1"], ["45 [degC]", "0.6"]]}},
    "table sampled": {"follows": "plate", "table": {"points": [["25 [degC]", "0.1"], ["35 [degC]", "1"]]}, "sample": "17 [s]"},
    "thermostat": {"follows": "radiator", "thermostat": {"on_below": "26 [degC]", "off_above": "28 [degC]"}},
    "cooler": {"follows": {"plate": 1, "radiator": -1}, "thermostat": {"on_above": "4.5 [K]", "off_below": "3.5 [K]"}},
    "proportional": {"follows": ["plate", "radiator"], "proportional": {"setpoint": "33 [degC]", "band": "5 [K]"}},
    "proportional sampled": {
        "follows": "plate",
        "proportional": {"setpoint": "33 [degC]", "band": "5 [K]", "lowest": 0.1, "highest": 0.8},
        "sample": "11 [s]",
    },
    "PI": {"follows": "plate", "pid": {"setpoint": "34 [degC]", "band": "8 [K]", "integral_time": "90 [s]"}},
    "PI of a mean": {"follows": ["plate", "radiator"], "pid": {"setpoint": "31 [degC]", "band": "8 [K]", "integral_time": "90 [s]"}},
    "PID": {
        "follows": "plate",
        "pid": {
            "setpoint": "34 [degC]",
            "band": "8 [K]",
            "integral_time": "90 [s]",
            "derivative_time": "12 [s]",
            "filter_time": "4 [s]",
            "begins": 0.3,
        },
    },
    "PID sampled": {
        "follows": "plate",
        "pid": {"setpoint": "34 [degC]", "band": "8 [K]", "integral_time": "90 [s]", "derivative_time": "12 [s]", "filter_time": "4 [s]"},
        "sample": "8 [s]",
    },
    "modes": {
        "follows": "plate",
        "modes": {"off": 0, "boost": 1, "hold": 0.3},
        "starts": "boost",
        "transitions": {
            "warm": {"from": "boost", "to": "hold", "above": "33 [degC]"},
            "cold": {"from": "hold", "to": "boost", "below": "29.5 [degC]", "follows": "radiator"},
            "late": {"from": "hold", "to": "off", "after": "70 [s]"},
            "again": {"from": "off", "to": "boost", "below": "31 [degC]"},
        },
    },
}
"""One of every kind."""
PLACES = ("heater", "pipe", "loss")
TIMES = np.linspace(0.0, 600.0, 31)


def run(written: dict[str, Any], free: tuple[str, ...] = (), options: td.Options = TIGHT) -> Any:
    scenario = td.Scenario(boundaries={"air": f"{AIR} [K]"}, start=f"{START} [K]", duration="600 [s]")
    return td.prepare(td.model_from_dict(written), scenario, free, times=TIMES, options=options)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", CONTROLS)
def test_every_control_on_a_load_and_on_conductors(kind: str, place: str) -> None:
    """Temperatures, instants of switching and the heat balance; conductance that follows its own, and a third node."""
    written = deck({"governor": CONTROLS[kind]}, **{place: {"control": "governor"}})
    solution = run(written).run()
    oracle = Controlled(written, {"air": AIR}, START)
    expected = oracle.run(TIMES)
    found = np.column_stack([solution["plate"].kelvin, solution["radiator"].kelvin])
    assert np.abs(found - expected).max() < 2e-6
    switched = [t for t, _ in solution.statistics["switchings"] if t > 0.0]
    assert len(switched) == len(oracle.events)
    np.testing.assert_allclose(switched, [t for t, _ in oracle.events], rtol=0.0, atol=1e-3)
    assert solution.heat_balance().relative < 1e-9


VALUES = {
    "table": ("heater.power", "leak.conductance", "plate.capacitance", "air"),
    "thermostat": ("governor.thermostat.on_below", "governor.thermostat.off_above", "heater.power"),
    "cooler": ("governor.thermostat.on_above", "governor.thermostat.off_below", "radiator.capacitance"),
    "proportional": ("governor.proportional.setpoint", "governor.proportional.band", "air"),
    "proportional sampled": ("governor.proportional.lowest", "governor.proportional.highest", "governor.proportional.setpoint"),
    "PID": tuple(f"governor.pid.{k}" for k in ("setpoint", "band", "integral_time", "derivative_time", "filter_time", "begins")),
    "PID sampled": tuple(f"governor.pid.{k}" for k in ("setpoint", "band", "integral_time", "derivative_time", "filter_time")),
    "modes": (
        "governor.transitions.warm.above",
        "governor.transitions.cold.below",
        "governor.transitions.late.after",
        "governor.modes.hold",
        "heater.power",
    ),
}


@pytest.mark.parametrize("place", ["heater", "pipe"])
@pytest.mark.parametrize("kind", VALUES)
def test_derivatives_are_differences(kind: str, place: str) -> None:
    """Of every number of a control, across its knees and switchings; a sample at the very instant of a switching has two sides."""
    times = TIMES + 0.83
    written = deck({"governor": CONTROLS[kind]}, **{place: {"control": "governor"}})
    scenario = td.Scenario(boundaries={"air": f"{AIR} [K]"}, start=f"{START} [K]", duration="601 [s]")
    simulator = td.prepare(td.model_from_dict(written), scenario, VALUES[kind], times=times, options=TIGHT)
    slopes, nominal = simulator.run(sensitivities=True), simulator.nominal
    for name in VALUES[kind]:
        step = 4e-5 * (1.0 if nominal[name] > 200.0 else max(abs(nominal[name]), 0.1))
        up, down = (simulator.run(simulator.with_units({**nominal, name: nominal[name] + s * step})) for s in (1.0, -1.0))
        for node in ("plate", "radiator"):
            difference = (up[node].kelvin - down[node].kelvin) / (2.0 * step)
            size = np.abs(difference).max()
            assert np.abs(slopes.sensitivity(node, name) - difference).max() < 2e-3 * size + 1e-9, (name, node)


def random_deck(seed: int) -> dict[str, Any]:
    """Return a random network: three to five nodes, every element under none to two controls of any kind."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 6))
    names = [f"n{k}" for k in range(count)]

    def follows() -> Any:
        if rng.random() < 0.3:
            a, b = rng.choice(names, 2, replace=False)
            return [str(a), str(b)]
        return str(rng.choice([*names, "air"] if rng.random() < 0.1 else names))

    def level() -> float:
        return float(rng.uniform(22.0, 45.0))

    def control() -> dict[str, Any]:
        kind = rng.choice(["table", "thermostat", "proportional", "PI", "PID", "modes"])
        sampled = {"sample": f"{rng.uniform(5.0, 30.0):.6g} [s]"} if rng.random() < 0.35 else {}
        t = level()
        if kind == "table":
            y = rng.uniform(0.05, 1.2, 3)
            points = [[f"{t + 6.0 * k!r} [degC]", f"{float(v)!r}"] for k, v in enumerate(y)]
            return {"follows": follows(), "table": {"points": points}} | sampled
        if kind == "thermostat":
            a, b = t, t + float(rng.uniform(0.5, 4.0))
            heats = rng.random() < 0.5
            low, high = ("on_below", "off_above") if heats else ("off_below", "on_above")
            return {"follows": follows(), "thermostat": {low: f"{a!r} [degC]", high: f"{b!r} [degC]"}}
        band = f"{float(rng.uniform(3.0, 12.0) * rng.choice([-1, 1]))!r} [K]"
        if kind == "proportional":
            return {"follows": follows(), "proportional": {"setpoint": f"{t!r} [degC]", "band": band}} | sampled
        if kind in ("PI", "PID"):
            pid = {"setpoint": f"{t!r} [degC]", "band": band, "integral_time": f"{float(rng.uniform(40.0, 300.0))!r} [s]"}
            if kind == "PID":
                pid |= {"derivative_time": f"{float(rng.uniform(2.0, 10.0))!r} [s]", "filter_time": f"{float(rng.uniform(1.0, 5.0))!r} [s]"}
            node = follows()
            return {"follows": node if isinstance(node, str) or kind == "PI" else node[0], "pid": pid} | sampled
        gap = float(rng.uniform(1.0, 4.0))
        return {
            "follows": follows(),
            "modes": {"a": float(rng.uniform(0, 0.4)), "b": float(rng.uniform(0.6, 1.0)), "c": float(rng.uniform(0.3, 0.7))},
            "starts": "b",
            "transitions": {
                "up": {"from": "b", "to": "a", "above": f"{t + gap!r} [degC]"},
                "down": {"from": "a", "to": "c", "below": f"{t!r} [degC]"},
                "late": {"from": "c", "to": "b", "after": f"{float(rng.uniform(30.0, 120.0))!r} [s]"},
            },
        }

    controls = {f"k{j}": control() for j in range(int(rng.integers(1, 4)))}

    def governed() -> dict[str, Any]:
        several = [str(n) for n in rng.permutation(list(controls))[: int(rng.integers(0, 3))]]
        positive = [n for n in several if "table" not in controls[n]]
        out = [f"1 - {n}" if n in positive and rng.random() < 0.25 else n for n in several]
        return {"control": out[0] if len(out) == 1 else out} if out else {}

    conductors: dict[str, Any] = {
        f"c{k}": {"kind": "conduction", "between": [names[k], names[k + 1]], "conductance": f"{float(rng.uniform(0.3, 3.0))!r} [W/K]"}
        | governed()
        for k in range(count - 1)
    }
    conductors["out"] = {"kind": "conduction", "between": [names[-1], "air"], "conductance": "0.4 [W/K]"}
    conductors["own"] = {"kind": "conduction", "between": [names[0], "air"], "conductance": "0.3 [W/K]"} | governed()
    conductors["shine"] = {"kind": "radiation", "between": [names[0], "air"], "area": "0.05 [m^2]", "emissivity": 0.8} | governed()
    loads = {f"q{k}": {"into": str(n), "power": f"{float(rng.uniform(1.0, 9.0))!r} [W]"} | governed() for k, n in enumerate(names[:3])}
    nodes = {n: {"capacitance": f"{float(rng.uniform(40.0, 300.0))!r} [J/K]"} for n in names}
    return {"title": f"random {seed}", "needs": ["air"], "nodes": nodes, "conductors": conductors, "loads": loads, "controls": controls}


def check_random(seed: int) -> None:
    written = random_deck(seed)
    oracle = Controlled(written, {"air": AIR}, START)
    used = {
        n.removeprefix("1 - ") for t in ("conductors", "loads") for e in written[t].values() for n in np.atleast_1d(e.get("control", []))
    }
    expected = oracle.run(TIMES)
    solution = run(written).run()
    found = np.column_stack([solution[n].kelvin for n in oracle.nodes])
    assert np.abs(found - expected).max() < 2e-5, seed
    switched = [t for t, _ in solution.statistics["switchings"] if t > 0.0]
    np.testing.assert_allclose(switched, [t for t, name in oracle.events if name in used], rtol=0.0, atol=1e-3)
    assert solution.heat_balance().relative < 1e-9, seed


@pytest.mark.parametrize("seed", range(8))
def test_random_networks(seed: int) -> None:
    check_random(seed)


@pytest.mark.campaign
def test_many_random_networks() -> None:
    for seed in range(100, 400):
        check_random(seed)


def test_members_are_single_runs_and_large_networks_say_so() -> None:
    written = deck({"governor": CONTROLS["PID"], "stat": CONTROLS["cooler"]}, pipe={"control": "governor"}, boost={"control": "stat"})
    simulator = run(written, ("heater.power", "governor.pid.setpoint"))
    draws = {"heater.power": np.array([11.0, 12.5]), "governor.pid.setpoint": np.array([306.0, 308.0])}
    members = simulator.ensemble(simulator.with_units(draws))
    for k in range(2):
        single = simulator.run(simulator.with_units({name: float(values[k]) for name, values in draws.items()}))
        assert np.abs(members.temperatures("plate")[:, k] - single["plate"].kelvin).max() < 1e-9
    with raises_code("model.element-not-supported", match="'governor'"):
        run(written, options=td.Options(method="large")).run()
    with raises_code("model.element-not-supported", match="'governor'"):
        run(written, options=td.Options(method="modal")).run()


def test_a_deck_is_saved_and_read_again(tmp_path: Path) -> None:
    """Every kind, and every place that names one."""
    controls = {name.replace(" ", "_"): table for name, table in CONTROLS.items()}
    written = deck(controls, pipe={"control": ["table", "1 - PI"]}, heater={"control": list(controls)[2]}, boost={"control": "modes"})
    written["surfaces"] = {
        "face": {
            "of": "radiator",
            "to": "air",
            "area": "0.02 [m^2]",
            "htc": "3 [W/(m^2 K)]",
            "finish": "paint, white",
            "emissivity_control": "table",
            "htc_control": ["proportional", "PID"],
        }
    }
    model = td.model_from_dict(written)
    td.save_model(model, tmp_path / "deck.toml")
    again = td.load_model(tmp_path / "deck.toml")
    assert again == model
    assert again.identity() == model.identity()
    laid = model.with_values({"modes.transitions.warm.above": "36 [degC]", "PID.pid.band": "5 [K]"})
    td.save_model(laid, tmp_path / "other.toml")
    assert td.load_model(tmp_path / "other.toml").at("modes.transitions.warm.above").text == "36 [degC]"  # type: ignore[union-attr]


WRONG: dict[str, tuple[dict[str, Any], str, str]] = {
    "two kinds": (
        {**CONTROLS["table"], "thermostat": {"on_below": "3 [degC]", "off_above": "4 [degC]"}},
        "value.incomplete",
        "table.*thermostat",
    ),
    "no node": ({"proportional": {"setpoint": "3 [degC]", "band": "2 [K]"}}, "value.incomplete", ' = "plate"'),
    "no such node": ({**CONTROLS["PI"], "follows": "plaet"}, "name.unknown", "'plaet'.* 'plate'"),
    "weights": ({**CONTROLS["PI"], "follows": {"plate": 1, "radiator": 1}}, "model.law-refused", " 2;"),
    "a difference has kelvins": (
        {"follows": {"plate": 1, "radiator": -1}, "thermostat": {"on_above": "4 [degC]", "off_below": "3 [degC]"}},
        "unit.scale-for-difference",
        "K",
    ),
    "hysteresis": (
        {"follows": "plate", "thermostat": {"on_below": "30 [degC]", "off_above": "28 [degC]"}},
        "model.refused",
        "on_below .*off_above",
    ),
    "a band": ({"follows": "plate", "proportional": {"setpoint": "30 [degC]", "band": "0 [K]"}}, "value.outside-range", "band' is 0 K"),
    "a mode": ({**CONTROLS["modes"], "starts": "bost"}, "name.unknown", "'bost'.* 'boost'"),
    "lost mode": (
        {**CONTROLS["modes"], "modes": {"off": 0, "boost": 1, "hold": 0.3, "lost": 1}},
        "model.law-refused",
        "'lost'",
    ),
    "half a derivative": (
        {"follows": "plate", "pid": {**CONTROLS["PI"]["pid"], "derivative_time": "3 [s]"}},
        "value.incomplete",
        "derivative_time .*filter_time",
    ),
    "negative share": (
        {"follows": "plate", "table": {"points": [["20 [degC]", "-0.1"], ["30 [degC]", "1"]]}},
        "model.refused",
        "'governor'",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_control_is_refused(case: str) -> None:
    control, code, match = WRONG[case]
    with raises_code(code, match=match):
        run(deck({"governor": control}, pipe={"control": "governor"})).run()


def test_a_control_that_is_not_there() -> None:
    with raises_code("name.unknown", match="'governer'.*'governor'"):
        run(deck({"governor": CONTROLS["table"]}, pipe={"control": "governer"}))


def test_steady_states() -> None:
    """A PI controller reaches its set point, a machine the mode in which it rests; a thermostat that keeps switching is refused."""
    scenario = td.Scenario(boundaries={"air": f"{AIR} [K]"}, start=f"{START} [K]", duration="6 [h]")
    model = td.model_from_dict(deck({"governor": CONTROLS["PI"]}, heater={"control": "governor"}))
    found = td.steady(model, scenario)
    assert found["plate"] == pytest.approx(307.15, abs=1e-7)
    assert td.simulate(model, scenario)["plate"].kelvin[-1] == pytest.approx(found["plate"], abs=1e-5)
    rests = {
        "follows": "plate",
        "modes": {"low": 0.2, "high": 1},
        "starts": "low",
        "transitions": {
            "up": {"from": "low", "to": "high", "below": "36 [degC]"},
            "down": {"from": "high", "to": "low", "above": "60 [degC]"},
        },
    }
    model = td.model_from_dict(deck({"governor": rests}, heater={"control": "governor"}))
    assert td.simulate(model, scenario)["plate"].kelvin[-1] == pytest.approx(td.steady(model, scenario)["plate"], abs=1e-5)
    switching = {"follows": "plate", "thermostat": {"on_below": "30 [degC]", "off_above": "31 [degC]"}}
    with raises_code("run.no-steady-state", SolverError, match="'governor'"):
        td.steady(td.model_from_dict(deck({"governor": switching}, heater={"control": "governor"})), scenario)


def test_the_heat_of_a_steady_state_is_that_of_its_controls() -> None:
    """Flows and powers of `steady` hold the shares and modes in which it rests."""
    controls = {
        "governor": CONTROLS["PI"],
        "valve": CONTROLS["table"],
        "stage": {
            "follows": "radiator",
            "modes": {"low": 0.2, "high": 1},
            "starts": "low",
            "transitions": {
                "up": {"from": "low", "to": "high", "above": "22 [degC]"},
                "down": {"from": "high", "to": "low", "below": "5 [degC]"},
            },
        },
    }
    written = deck(controls, heater={"control": "governor"}, pipe={"control": "valve"}, boost={"control": "stage"})
    found = td.steady(td.model_from_dict(written), td.Scenario(boundaries={"air": f"{AIR} [K]"}, start=f"{START} [K]", duration="1 [h]"))
    share = np.interp(found["plate"], [298.15, 308.15, 318.15], [0.1, 1.0, 0.6])
    pipe = 2.0 * share * (found["plate"] - found["radiator"])
    heater = pipe + 0.1 * (found["plate"] - AIR)
    assert 0.0 < heater < 12.0
    assert found["plate"] == pytest.approx(307.15, abs=1e-6)
    assert 0.5 * (found["radiator"] - AIR) == pytest.approx(pipe + 4.0, rel=1e-8)


def test_a_boundary_that_follows_a_control() -> None:
    """A node without mass between two boundaries stands at the share of the way between them: a chamber that follows the plate."""
    written = deck({"chamber": {"follows": "plate", "table": {"points": [["20 [degC]", "1"], ["40 [degC]", "0"]]}}})
    written["needs"] = ["air", "cold"]
    written["nodes"]["bath"] = {}
    tie = {"kind": "conduction", "conductance": "1e6 [W/K]"}
    written["conductors"] |= {
        "warms": tie | {"between": ["air", "bath"], "control": "chamber"},
        "cools": tie | {"between": ["cold", "bath"], "control": "1 - chamber"},
        "loss": {"kind": "conduction", "between": ["radiator", "bath"], "conductance": "0.5 [W/K]"},
    }
    scenario = td.Scenario(boundaries={"air": "20 [degC]", "cold": "0 [degC]"}, start="22 [degC]", duration="600 [s]")
    run = td.simulate(td.model_from_dict(written), scenario, times=TIMES)
    share = np.interp(run["plate"].kelvin, [293.15, 313.15], [1.0, 0.0])
    np.testing.assert_allclose(run["bath"].kelvin, 273.15 + 20.0 * share, rtol=0.0, atol=2e-4)
    assert run.heat_balance().relative < 1e-9


def test_a_switch_and_a_schedule_while_the_pressure_falls() -> None:
    """A surface whose coefficient follows a schedule and a control while its gas is pumped out: each is a factor, as its flow shows."""
    deck_: dict[str, Any] = {
        "title": "plate in a chamber",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "300 [J/K]"}},
        "surfaces": {
            "skin": {
                "of": "plate",
                "to": "air",
                "area": "0.1 [m^2]",
                "htc": "6 [W/(m^2 K)]",
                "emissivity": 0.8,
                "htc_control": "fan",
                "emissivity_control": "louver",
            }
        },
        "loads": {"heater": {"into": "plate", "power": "20 [W]"}},
        "controls": {
            "fan": {"follows": "plate", "table": {"points": [["20 [degC]", "0.5"], ["50 [degC]", "1.5"]]}},
            "louver": {"follows": "plate", "table": {"points": [["20 [degC]", "0.2"], ["40 [degC]", "1"]]}},
        },
    }
    pressure = {"times": ["0 [s]", "600 [s]"], "values": ["101325 [Pa]", "30000 [Pa]"], "after": "hold"}
    schedule = {"skin.htc": {"times": ["0 [s]", "900 [s]"], "values": ["6 [W/(m^2 K)]", "9 [W/(m^2 K)]"], "after": "hold"}}
    scenario = td.Scenario(
        boundaries={"air": "20 [degC]"},
        start="20 [degC]",
        duration="1200 [s]",
        schedule=schedule,
        environment={"*": td.simulation.Environment(pressure=pressure)},
    )
    run_ = td.simulate(td.model_from_dict(deck_), scenario)
    assert run_.heat_balance().relative < 1e-9
    plain = {k: v for k, v in deck_.items() if k != "controls"}
    plain["surfaces"] = {"skin": {k: v for k, v in deck_["surfaces"]["skin"].items() if not k.endswith("_control")}}
    driven = dict(zip(("times", "values"), ([f"{t} [s]" for t in run_.times], [f"{t} [K]" for t in run_["plate"].kelvin]), strict=True))
    free = td.simulate(
        td.model_from_dict(
            plain
            | {
                "nodes": plain["nodes"] | {"other": {"capacitance": "1 [J/K]"}},
                "conductors": {"x": {"kind": "conduction", "between": ["other", "air"], "conductance": "1 [W/K]"}},
            }
        ),
        scenario.with_(prescribed={"plate": driven | {"after": "hold"}}),
        times=run_.times,
    )
    kelvin = run_["plate"].kelvin
    fan = np.interp(kelvin, [293.15, 323.15], [0.5, 1.5])
    louver = np.interp(kelvin, [293.15, 313.15], [0.2, 1.0])
    np.testing.assert_allclose(run_.heat_flows["skin"], fan * free.heat_flows["skin"], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(run_.heat_flows["skin.radiation"], louver * free.heat_flows["skin.radiation"], rtol=1e-6, atol=1e-6)


def test_check_and_diagram_know_controls() -> None:
    """A control that nothing names is a warning; a diagram writes shares behind values."""
    written = deck(
        {"governor": CONTROLS["PI"], "spare": CONTROLS["table"]}, pipe={"control": "1 - governor"}, heater={"control": "governor"}
    )
    model = td.model_from_dict(written)
    (found,) = [f for f in model.check() if "'spare'" in f.message]
    assert found.code == "model.unused"
    drawn = network_map(model)
    assert "2 W/K \u00d7 (1 - " in drawn
    assert "12 W \u00d7 g" in drawn


def test_a_set_point_follows_a_schedule() -> None:
    """Modelica.Thermal.HeatTransfer.Examples.ControlledTemperature, retyped from its source: 322.421 +- 0.005 K, instants to 1 ms."""
    from scipy.integrate import solve_ivp

    def reference(t: float) -> float:
        return 298.15 + 25.0 * min(max((t - 2.0) / 6.0, 0.0), 1.0)

    losses = td.model.law(lambda t: 10.0 / (1.0 + (t - 293.15) / 255.0), between=("0 [degC]", "120 [degC]"), tolerance=1e-11)
    model = td.model_from_dict(
        {
            "title": "controlled temperature",
            "needs": ["ambient"],
            "nodes": {"resistor": {"capacitance": "1 [J/K]"}},
            "conductors": {"conductor": {"kind": "conduction", "between": ["resistor", "ambient"], "conductance": "0.1 [W/K]"}},
            "loads": {"losses": {"into": "resistor", "table": losses, "control": "on_off"}},
            "controls": {"on_off": {"follows": "resistor", "thermostat": {"on_below": "24 [degC]", "off_above": "26 [degC]"}}},
        }
    )
    ramp = {"times": ["0 [s]", "2 [s]", "8 [s]", "10 [s]"]}
    schedule = {
        f"on_off.thermostat.{name}": ramp | {"values": [f"{t + shift} [degC]" for t in (25, 25, 50, 50)]}
        for name, shift in (("on_below", -1), ("off_above", 1))
    }
    scenario = td.Scenario(boundaries={"ambient": "20 [degC]"}, start="20 [degC]", duration="10 [s]", schedule=schedule)
    solution = td.simulate(model, scenario)

    on, t, kelvin, instants = True, 0.0, 293.15, []
    while t < 10.0:
        state = on

        def rate(_: float, y: Any, state: bool = state) -> list[float]:
            return [(10.0 / (1.0 + (y[0] - 293.15) / 255.0) if state else 0.0) - 0.1 * (y[0] - 293.15)]

        def gap(t: float, y: Any, state: bool = state) -> float:
            return float(y[0] - reference(t) - (1.0 if state else -1.0))

        gap.terminal, gap.direction = True, 1.0 if state else -1.0  # type: ignore[attr-defined]
        stop = next(s for s in (2.0, 8.0, 10.0) if s > t + 1e-12)
        part = solve_ivp(rate, (t, stop), [kelvin], "DOP853", rtol=1e-12, atol=1e-12, events=gap)
        t, kelvin = float(part.t[-1]), float(part.y[0, -1])
        if part.status == 1:
            on = not on
            instants.append(t)
    assert solution["resistor"].kelvin[-1] == pytest.approx(322.421, abs=0.005)
    assert solution["resistor"].kelvin[-1] == pytest.approx(kelvin, abs=1e-6)
    np.testing.assert_allclose([t for t, _ in solution.statistics["switchings"]], instants, rtol=0.0, atol=1e-3)
    assert solution.heat_balance().relative < 1e-9
