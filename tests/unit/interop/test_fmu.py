"""FMUs of thermid in other people's hosts: FMPy with CVode and a host in C, beside `simulate`."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import OutputError
from thermid.interop._fmu.export import to_fmu
from unit.interop.hosts import Unpacked, unpacked
from unit.interop.networks import SIGNALS, TIGHT, hot_box

CLOSE = 1e-5
EXACT = td.Options(error=4e-10)


def deck(**more: Any) -> td.Model:
    """Two nodes in a row to the air; `more` replaces whole groups."""
    return td.model_from_dict(
        {
            "title": "two",
            "needs": ["air"],
            "parameters": {
                "g": {"value": "0.8 [W/K]", "min": 0.1, "max": 5},
                "c": "50 [J/K]",
                "power": "5 [W]",
                "paint": "0.8",
                "rho": "0.1 [kg/m^3]",
                "area": "0.02 [m^2]",
            },
            "nodes": {"a": {"capacitance": "c"}, "b": {"capacitance": "2*c"}},
            "conductors": {
                "ab": {"kind": "conduction", "between": ["a", "b"], "conductance": "g"},
                "out": {"kind": "conduction", "between": ["b", "air"], "resistance": "1/g"},
            },
            "loads": {"heat": {"into": "a", "power": "power"}},
            **more,
        }
    )


GLOW = {"kind": "radiation", "between": ["a", "air"], "emissivity": "paint", "area": "area"}
CONDUCTORS = {
    "ab": {"kind": "conduction", "between": ["a", "b"], "conductance": "g"},
    "out": {"kind": "conduction", "between": ["b", "air"], "conductance": "g"},
}
BLOWN = {"a": {"capacitance": "c"}, "b": {"capacitance": "2*c"}, "gas": {"capacitance": "40 [J/K]", "stands_for": "air"}}
STREAM = {
    "in": {"kind": "flow", "between": ["air", "gas"], "mass_flow": "rho*fan.flow", "specific_heat": "1006 [J/(kg K)]"},
    "film": {"kind": "convection", "between": ["a", "gas"], "htc": "20 [W/(m^2 K)]", "area": "area"},
    "past": {"kind": "flow", "between": ["gas", "air"], "mass_flow": "rho*fan.flow", "specific_heat": "1006 [J/(kg K)]"},
}
FAN = {
    "curve": [["0 [m^3/h]", "38 [Pa]"], ["40 [m^3/h]", "26 [Pa]"], ["95 [m^3/h]", "0 [Pa]"]],
    "passes": ["60 [m^3/h]", "12 [Pa]"],
    "linear_resistance": "10 [Pa s/m^3]",
    "speed": 0.8,
}
"""The flow where it meets its system is the highest of the lowest of roots."""
THERMOSTAT = {"heat": {"into": "a", "power": "6*power", "thermostat": {"sensor": "b", "on_below": "28 [degC]", "off_above": "31 [degC]"}}}
QUIET = td.Scenario("quiet", boundaries={"air": "12 [degC]"}, start="20 [degC]", duration="1200 [s]")
STEPS = QUIET.with_(
    commands={"heat": {"times": ["0 [s]", "130 [s]", "700 [s]"], "values": ["1", "0.25", "1.5"], "hold": True, "after": "hold"}},
    boundaries={"air": {"times": ["0 [s]", "300 [s]", "1200 [s]"], "values": ["12 [degC]", "25 [degC]", "5 [degC]"]}},
)
MODELS: dict[str, tuple[td.Model, td.Scenario, tuple[str, ...]]] = {
    "linear": (deck(), QUIET, ("a", "b")),
    "radiation": (deck(conductors={**CONDUCTORS, "glow": GLOW}), QUIET, ("a", "b")),
    "thermostat": (deck(conductors={**CONDUCTORS, "glow": GLOW}, loads=THERMOSTAT), QUIET, ("a", "b")),
    "schedule": (deck(), STEPS, ("a", "b")),
    "massless": (hot_box(), SIGNALS, ("box", "lid", "seam", "glue")),
    "fan": (deck(nodes=BLOWN, conductors={**CONDUCTORS, **STREAM}, fans={"fan": FAN}), QUIET, ("a", "b", "gas")),
}


def fmpy_run(file: Path, form: str, times: Any, nodes: tuple[str, ...], start: dict[str, float] | None = None) -> dict[str, Any]:
    """Temperatures by FMPy, CVode for model exchange, at times."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (pip install 'thermid[fmu]')")
    found = fmpy.simulate_fmu(
        str(file),
        fmi_type=form,
        stop_time=float(times[-1]),
        output_interval=float(times[1]),
        relative_tolerance=1e-10,
        output=[f"T.{n}" for n in nodes],
        start_values=start or {},
    )
    at = [np.flatnonzero(np.isclose(found["time"], t, atol=1e-9))[-1] for t in times]
    return {n: found[f"T.{n}"][at] for n in nodes}


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("name", MODELS)
def test_fmpy_finds_the_temperatures_of_simulate(name: str, version: str, tmp_path: Path) -> None:
    model, scenario, nodes = MODELS[name]
    to_fmu(model, scenario, tmp_path / "m.fmu", version)
    times = np.linspace(0.0, scenario.seconds, 121)
    ours = td.simulate(model, scenario, times=times, options=TIGHT)
    for form in ("ModelExchange", "CoSimulation"):
        found = fmpy_run(tmp_path / "m.fmu", form, times, nodes)
        for node in nodes:
            assert np.abs(found[node] - ours[node].kelvin).max() < CLOSE, (form, node)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("name", MODELS)
def test_fmpy_finds_nothing_wrong(name: str, version: str, tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation", reason="FMPy is not installed (pip install 'thermid[fmu]')")
    model, scenario, _ = MODELS[name]
    to_fmu(model, scenario, tmp_path / "m.fmu", version)
    assert validation.validate_fmu(str(tmp_path / "m.fmu")) == []


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("name", MODELS)
def test_a_host_in_c_finds_them_too(name: str, version: str, tmp_path: Path) -> None:
    model, scenario, nodes = MODELS[name]
    fmu = unpacked(model, scenario, tmp_path, version)
    step = scenario.seconds / 120.0
    ours = td.simulate(model, scenario, times=np.linspace(0.0, scenario.seconds, 121), options=TIGHT)
    found = fmu.run([f"T.{n}" for n in nodes], scenario.seconds, step)
    for k, node in enumerate(nodes):
        assert np.abs(found[:, k + 1] - ours[node].kelvin).max() < CLOSE, node
    found = fmu.run([f"T.{n}" for n in nodes], scenario.seconds, scenario.seconds / 1200.0, "me")[::10]
    for k, node in enumerate(nodes):
        assert np.abs(found[:, k + 1] - ours[node].kelvin).max() < CLOSE, node


CHANGES = {
    "linear": {"g": "1.7 [W/K]", "c": "31 [J/K]", "power": "9 [W]"},
    "radiation": {"paint": "0.3", "area": "0.05 [m^2]", "g": "0.4 [W/K]"},
    "thermostat": {"power": "4.2 [W]", "heat.thermostat.on_below": "299 [K]", "paint": "0.5"},
    "schedule": {"g": "0.3 [W/K]", "c": "90 [J/K]"},
    "fan": {"fan.speed": "0.5", "fan.linear_resistance": "900 [Pa s/m^3]", "g": "0.4 [W/K]"},
    "massless": {"area": "0.13 [m^2]", "paint": "0.6", "share": "0.2", "free.htc.exponent": "0.31"},
}


@pytest.mark.parametrize("name", MODELS)
def test_parameters_changed_before_the_run_are_exact(name: str, tmp_path: Path) -> None:
    model, scenario, nodes = MODELS[name]
    fmu = unpacked(model, scenario, tmp_path)
    changed = model.with_values(CHANGES[name])
    ours = td.simulate(changed, scenario, times=np.linspace(0.0, scenario.seconds, 121), options=EXACT)
    values = {f"p.{path}": float(value.split()[0]) for path, value in CHANGES[name].items()}
    found = fmu.run([f"T.{n}" for n in nodes], scenario.seconds, scenario.seconds / 120.0, values=values, tolerance=1e-11)
    before = fmu.run([f"T.{n}" for n in nodes], scenario.seconds, scenario.seconds / 120.0)
    assert np.abs(found - before).max() > 0.5
    for k, node in enumerate(nodes):
        assert np.abs(found[:, k + 1] - ours[node].kelvin).max() < 1e-6, node


def instance(fmu: Unpacked, form: str) -> Any:
    """An instance in FMPy, made and not yet begun: an FMU3Model or an FMU3Slave."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (pip install 'thermid[fmu]')")
    described = fmpy.read_model_description(str(fmu.file))
    host = getattr(fmpy.fmi3, form)(
        guid=described.guid, unzipDirectory=str(fmu.folder), modelIdentifier=described.modelExchange.modelIdentifier, instanceName="d"
    )
    host.instantiate()
    return host


def off_differences(fmu: Unpacked, host: Any, but: str = "") -> tuple[float, str]:
    """The largest relative difference of directional derivatives from differences of values where a host stands, and by what it is.

    Rates, massless temperatures, heats and powers by states, inputs and parameters, `but` one.
    """
    refs, written = fmu.references, fmu.written
    massless = [v.name for v in written.variables if v.name.startswith("T.") and v.name not in (*written.states, *written.names("input"))]
    ask = [refs[v.name] for v in written.variables if v.name.startswith(("der(", "heat.", "power."))] + [refs[n] for n in massless]
    worst = (0.0, "")
    for name in {*written.states, *written.names("input"), *written.names("parameter")} - {but}:
        ours = np.array(host.getDirectionalDerivative(ask, [refs[name]], [1.0]))
        (at,) = host.getFloat64([refs[name]])
        size, step = np.abs(np.array(host.getFloat64(ask))), 1e-4 * max(abs(at), 1e-3)

        def moved(by: float, ref: int = refs[name], at: float = at) -> np.ndarray:
            host.setFloat64([ref], [at + by])
            return np.array(host.getFloat64(ask))

        near, far = ((moved(x) - moved(-x)) / (2.0 * x) for x in (step, 2.0 * step))
        moved(0.0)
        left = np.where(np.isin(ask, [refs[n] for n in massless]), 2e-12 * size / step, 0.0)  # by Newton's method, of massless temperatures
        missed = np.maximum(np.abs(ours - (4.0 * near - far) / 3.0) - left, 0.0)
        off = float((missed / (np.abs(ours) + 1e-6 * size / max(abs(at), 1.0) + 1e-9)).max())
        worst = max(worst, (off, name))
    return worst


def test_derivatives_are_those_of_differences(tmp_path: Path) -> None:
    """The temperatures of every law."""
    bent = {"kind": "radiation", "between": ["glue", "wall"], "emissivity": 0.5, "area": "0.02 [m^2]"}
    fmu = unpacked(hot_box(bent=bent), SIGNALS.with_(boundaries={"air": "10 [degC]", "wall": "15 [degC]"}, commands={}), tmp_path)
    host = instance(fmu, "FMU3Model")
    host.enterInitializationMode(startTime=1000.0)
    host.exitInitializationMode()
    worst = off_differences(fmu, host)
    host.terminate()
    host.freeInstance()
    assert worst[0] < 1e-6, worst


SWITCH = {
    "follows": "b",
    "modes": {"open": 0.2, "closed": 1},
    "starts": "open",
    "transitions": {
        "warm": {"from": "open", "to": "closed", "above": "28 [degC]"},
        "cold": {"from": "closed", "to": "open", "below": "20 [degC]"},
    },
}
PID = {"follows": "b", "pid": {"setpoint": "26 [degC]", "band": "9 [K]", "integral_time": "4 [min]"}, "sample": "30 [s]"}
MELTING = {"latent_heat": "50 [kJ/kg]", "melts_from": "24 [degC]", "melts_to": "26 [degC]"}
EVENTFUL = {
    "thermostat": (MODELS["thermostat"][0], "mode.heat", "T.b"),
    "controls": (
        deck(
            conductors={**CONDUCTORS, "out": {**CONDUCTORS["out"], "control": "switch"}},
            loads={"heat": {"into": "a", "power": "6*power", "control": "duty"}},
            controls={"switch": SWITCH, "duty": PID},
        ),
        "mode.switch",
        "T.b",
    ),
    "melting": (
        deck(
            nodes={"a": {"capacitance": "c"}, "b": {"mass": "0.01 [kg]", "specific_heat": "2000 [J/(kg K)]", **MELTING}},
            loads={"heat": {"into": "a", "power": "3*power"}},
        ),
        "",
        "T.b",
    ),
    "fan": (MODELS["fan"][0], "", "T.gas"),
}
"""Model, what switches, and the temperature that it goes by."""


@pytest.mark.parametrize("name", EVENTFUL)
def test_derivatives_are_right_on_both_sides_of_an_event(name: str, tmp_path: Path) -> None:
    """The standard defines them at an instant, with the modes that hold there: after each of 30 steps, over switches between the points."""
    model, switches, felt = EVENTFUL[name]
    fmu = unpacked(model, QUIET, tmp_path)
    host = instance(fmu, "FMU3Slave")
    host.enterInitializationMode()
    host.exitInitializationMode()
    modes, temperatures = [], []
    for k in range(30):
        host.doStep(currentCommunicationPoint=17.0 * k, communicationStepSize=17.0)
        modes += host.getInt32([fmu.references[switches]]) if switches else []
        temperatures += host.getFloat64([fmu.references[felt]])
        worst = off_differences(fmu, host, "p.b.mass")  # it moves the melt's temperature by less than Newton's method leaves
        assert worst[0] < (1e-5 if name == "melting" else 1e-6), (17.0 * (k + 1), worst)  # differences by a stiff tie are coarser
        if name == "melting":
            (rate,) = host.getFloat64([fmu.references["der(held.b)"]])
            (by,) = host.getDirectionalDerivative([fmu.references["der(held.b)"]], [fmu.references["p.b.mass"]], [1.0])
            assert by == pytest.approx(-rate / 0.01, rel=1e-5, abs=1e-3)
    host.freeInstance()
    assert len(set(modes)) == (2 if switches else 0)
    assert name != "melting" or min(temperatures) < 297.0 < 298.0 < max(temperatures)


@pytest.mark.parametrize(("name", "threshold", "moves"), [("thermostat", 304.15, "p.power"), ("controls", 301.15, "T.b")])
def test_derivatives_change_in_event_mode_alone(name: str, threshold: float, moves: str, tmp_path: Path) -> None:
    """Model exchange: a microkelvin before a threshold and after it; until the event they are the old mode's."""
    model, switches, felt = EVENTFUL[name]
    fmu = unpacked(model, QUIET, tmp_path)
    host = instance(fmu, "FMU3Model")
    host.enterInitializationMode()
    host.exitInitializationMode()
    host.updateDiscreteStates()
    host.enterContinuousTimeMode()
    found, seen = [], []
    for by, event in ((-1e-6, True), (1e-6, False), (1e-6, True)):
        host.setFloat64([fmu.references[felt]], [threshold + by])
        if event:
            host.enterEventMode()
            host.updateDiscreteStates()
            host.enterContinuousTimeMode()
        seen.append(host.getInt32([fmu.references[switches]])[0])
        rates = [fmu.references[f"der(T.{n})"] for n in "ab"]
        found.append(host.getDirectionalDerivative(rates, [fmu.references[moves]], [1.0]))
        worst = off_differences(fmu, host)
        assert worst[0] < 1e-6, worst
    host.freeInstance()
    assert seen[0] == seen[1] != seen[2]
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    assert np.abs(np.subtract(found[1], found[2])).max() > 1e-3


@pytest.mark.parametrize(
    ("name", "turns"),
    [("thermostat", 20), *(pytest.param(n, 170, marks=pytest.mark.campaign) for n in MODELS)],
)
def test_what_follows_a_kept_state_is_the_same_to_the_bit(name: str, turns: int, tmp_path: Path) -> None:
    """However often it is brought back, whatever was stepped in between, as bytes too; over switches, six models of 170 turns each."""
    fmu = unpacked(*MODELS[name][:2], tmp_path)
    host = instance(fmu, "FMU3Slave")
    host.enterInitializationMode()
    host.exitInitializationMode()
    ask = [k for n, k in fmu.references.items() if n.partition(".")[0] in ("T", "power", "heat")]
    draw, now = np.random.default_rng(1), 0.0

    def go(steps: np.ndarray) -> list[float]:
        at = now
        for step in steps:
            host.doStep(currentCommunicationPoint=at, communicationStepSize=step)
            at += step
        return [at, *host.getFloat64(ask)]

    for _ in range(turns):
        state = host.getFMUState()
        raw, steps = host.serializeFMUState(state), draw.choice([1.0, 3.0, 10.0], 4)
        straight = go(steps)
        for kept in (state, host.deserializeFMUState(raw)):
            host.setFMUState(kept)
            go(draw.choice([0.5, 2.0, 7.0], 3))
            host.setFMUState(kept)
            assert go(steps) == straight
            host.freeFMUState(kept)
        now = straight[0]
    host.freeInstance()


@pytest.mark.parametrize("name", ["linear", "radiation"])
def test_an_input_that_the_host_drives(name: str, tmp_path: Path) -> None:
    """A power that swings from step to step, beside a command of the scenario that does."""
    model, scenario, _ = MODELS[name]
    fmu = unpacked(model, scenario, tmp_path)
    found = fmu.run(["T.a", "T.b"], 1200.0, 60.0, swing={"load.heat": (1.0, 0.4)})
    swinging = {"times": [f"{60 * k} [s]" for k in range(20)], "values": [1.4 if k % 2 == 0 else 0.6 for k in range(20)]}
    driven = scenario.with_(commands={"heat": {**swinging, "hold": True, "after": "hold"}})
    ours = td.simulate(model, driven, times=np.linspace(0.0, 1200.0, 21), options=TIGHT)
    for k, node in enumerate(("a", "b")):
        assert np.abs(found[:, k + 1] - ours[node].kelvin).max() < 1e-6, node


@pytest.mark.campaign
def test_a_host_may_step_for_as_long_as_it_likes(tmp_path: Path) -> None:
    """More than a million steps with an input that changes at each: the limit of a run holds for each of them."""
    model, scenario, _ = MODELS["linear"]
    found = unpacked(model, scenario, tmp_path).run(["T.a"], 1_100_000.0, 1.0, swing={"load.heat": (1.0, 0.4)})
    assert found.shape[0] == 1_100_001


@pytest.mark.parametrize("reads", [False, True], ids=["", "read before the step"])
@pytest.mark.parametrize("name", ["linear", "thermostat", "massless"])
def test_steps_that_reach_beyond_the_hosts_are_given_up_where_an_input_changes(name: str, reads: bool, tmp_path: Path) -> None:
    """A load changes every 37 steps of 1 s; those between are read off longer ones, and values that are read first change nothing."""
    model, scenario, nodes = MODELS[name]
    fmu = unpacked(model, scenario, tmp_path)
    load = next(n for n in fmu.references if n.startswith("load."))
    host = instance(fmu, "FMU3Slave")
    host.enterInitializationMode()
    host.exitInitializationMode()
    ask, drive, every, count = [fmu.references[f"T.{n}"] for n in nodes], fmu.references[load], 37, 600
    factors = [1.0 + 0.6 * (-1) ** k for k in range(count // every + 1)]
    found = [host.getFloat64(ask)]
    for k in range(count):
        if k % every == 0:
            host.setFloat64([drive], [factors[k // every]])
            if reads:
                host.getFloat64(ask)
        host.doStep(currentCommunicationPoint=float(k), communicationStepSize=1.0)
        found.append(host.getFloat64(ask))
    host.freeInstance()
    command = {"times": [f"{every * k} [s]" for k in range(len(factors))], "values": factors, "hold": True, "after": "hold"}
    driven = scenario.with_(commands={**scenario.commands, load.partition(".")[2]: command})
    ours = td.simulate(model, driven, times=np.arange(count + 1.0), options=TIGHT)
    between = np.arange(count + 1) % every != 0  # at a change itself a massless node has two temperatures
    for k, node in enumerate(nodes):
        assert np.abs(np.array(found)[:, k] - ours[node].kelvin)[between].max() < CLOSE, node


def test_the_heat_of_boundaries_closes_the_balance(tmp_path: Path) -> None:
    fmu = unpacked(*MODELS["thermostat"][:2], tmp_path)
    found = fmu.run(["der(T.a)", "der(T.b)", "heat.air", "power.heat"], 1200.0, 10.0)
    assert found[:, 3].max() > 5.0
    assert set(np.round(found[:, 4], 9)) == {0.0, 30.0}
    assert np.abs(50.0 * found[:, 1] + 100.0 * found[:, 2] + found[:, 3] - found[:, 4]).max() < 1e-9


def test_what_a_host_sees(tmp_path: Path) -> None:
    """Names, units, bounds and start of a linear model, in both versions."""
    for version, key in (("3.0", "instantiationToken"), ("2.0", "guid")):
        fmu = unpacked(*MODELS["linear"][:2], tmp_path, version)
        root = ElementTree.parse(fmu.folder / "modelDescription.xml").getroot()
        assert root.get("fmiVersion") == version
        assert len(root.get(key, "")) == 64
        variables = {v.get("name"): v for v in root.find("ModelVariables")}  # type: ignore[union-attr]
        assert list(variables) == [
            *("time", "p.g", "p.c", "p.power", "T.air", "load.heat", "T.a", "T.b", "der(T.a)", "der(T.b)", "heat.air", "power.heat")
        ]
        given = variables["p.g"] if version == "3.0" else variables["p.g"][0]
        assert (given.get("start"), given.get("min"), given.get("max"), given.get("unit")) == ("0.8", "0.1", "5.0", "W/K")
    assert [p.suffix for p in (fmu.folder / "binaries").rglob("*.*")] == [".so"] or sys.platform != "linux"


def test_the_same_model_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one.fmu", "two.fmu"):
        to_fmu(*MODELS["massless"][:2], tmp_path / name)
    assert (tmp_path / "one.fmu").read_bytes() == (tmp_path / "two.fmu").read_bytes()


def test_other_platforms_compile_the_sources(tmp_path: Path) -> None:
    """The files that the build description names, as a compiler sees them: each is there, and what it includes too."""
    fmu = unpacked(*MODELS["linear"][:2], tmp_path)
    build = ElementTree.parse(fmu.folder / "sources" / "buildDescription.xml").getroot()
    sources = fmu.folder / "sources"
    names = [f.get("name", "") for f in build.iter("SourceFile")]
    assert len(names) > 15
    for name in names:
        lines = (sources / name).read_text().splitlines()
        own = [line.split('"')[1] for line in lines if line.startswith('#include "')]
        assert all((sources / each).is_file() for each in own), name
    done = subprocess.run(
        ["c++", "-std=c++17", "-fsyntax-only", "-I", sources, sources / "fmu" / "fmi3.cpp"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_damaged_files_are_refused_by_the_library(tmp_path: Path) -> None:
    """Cut short, changed, another model's token: no instance, and a reason."""
    fmu = unpacked(*MODELS["thermostat"][:2], tmp_path)
    with pytest.raises(RuntimeError, match="belong to different models"):
        fmu.run(["T.a"], 10.0, 1.0, token="0" * 64)
    data = fmu.folder / "resources" / "model.bin"
    whole = data.read_bytes()
    rng = np.random.default_rng(5)
    for k in range(40):
        cut = whole[: int(rng.integers(len(whole)))]
        hurt = bytearray(whole)
        hurt[int(rng.integers(80, len(whole)))] ^= int(rng.integers(1, 256))
        data.write_bytes(cut if k % 2 else bytes(hurt))
        if k % 2:
            with pytest.raises(RuntimeError, match="damaged"):
                fmu.run(["T.a"], 10.0, 1.0)
            continue
        with suppress(RuntimeError):  # a changed number may still be a model; that a signal ended the host is no RuntimeError
            fmu.run(["T.a"], 10.0, 1.0)


def test_what_cannot_be_set_is_fixed_and_named(tmp_path: Path) -> None:
    """Conductivity from a table that a parameter makes; the courses of a scenario."""
    text = str(to_fmu(*MODELS["schedule"][:2], tmp_path / "m.fmu"))
    assert re.search(r" 1200 s; .*: air, heat\.", text)


def test_wrong_requests_are_refused(tmp_path: Path) -> None:
    with raises_code("name.unknown", match=r"'1\.0'"):
        to_fmu(*MODELS["linear"][:2], tmp_path / "m.fmu", "1.0")
    with raises_code("output.wrong-ending", OutputError):
        to_fmu(*MODELS["linear"][:2], tmp_path / "m.zip")
    (tmp_path / "other.fmu").write_bytes(b"mine")
    with pytest.raises(OutputError):
        to_fmu(*MODELS["linear"][:2], tmp_path / "other.fmu")
    with zipfile.ZipFile(tmp_path / "theirs.fmu", "w") as packed:
        packed.writestr("modelDescription.xml", "<fmiModelDescription/>")
    with pytest.raises(OutputError):
        to_fmu(*MODELS["linear"][:2], tmp_path / "theirs.fmu")


def test_the_host_may_not_make_nonsense(tmp_path: Path) -> None:
    """A capacitance of zero ends the run with a reason that names the node."""
    fmu = unpacked(*MODELS["linear"][:2], tmp_path)
    with pytest.raises(RuntimeError, match=r"a capacitance must lie above zero.* at 'a', at 0"):
        fmu.run(["T.a"], 10.0, 1.0, values={"p.c": 0.0})
