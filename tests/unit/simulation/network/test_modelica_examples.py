"""Examples of Modelica.Thermal.FluidHeatFlow retyped from their sources, beside their equations integrated here and the library's results.

The results of the library (Dymola, relative tolerance 1e-6) miss the exact solution of TwoMass before its pump starts, 10 exp(-20 t), by
0.8 mK. So the equations are the measure, and the results are read with that error, from
``THERMID_PUBLIC/modelica/MAP-LIB_ReferenceResults``; each file is known by its SHA-256.
"""

from __future__ import annotations

import csv
import hashlib
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import thermid as td
from by_code import raises_code

AMBIENT = 293.15
FOLDER = "modelica/MAP-LIB_ReferenceResults/Modelica/Thermal/FluidHeatFlow/Examples"
SHA256 = {
    "TwoMass": "e003d89aab796d4ac2a0fe48afa7f17a158f6f878332e3a761bd117a149a2ac1",
    "ParallelCooling": "cb15d63c048fe27890f447f713bf15282314d86f335accfdf49a3b9b0dd837ee",
    "IndirectCooling": "2f145aeee03d69c5b6c4789a641410dbf9d8f0c1a72ef262a7bde7c6aef808aa",
}
NAMES = {"heatCapacitor1": "mass1", "heatCapacitor2": "mass2", "heatCapacitor": "mass", "innerPipe": "inner", "outerPipe": "outer"}
PUMP = ([0.0, 0.2, 0.4, 0.6, 0.8, 1.0], [0.0, 0.0, 1.0, 1.0, -1.0, -1.0])
"""Times [s] and flow [kg/s] of the pump of TwoMass, which reverses at 0.7 s."""


def flow(a: str, b: str, text: str, **more: Any) -> dict[str, Any]:
    return {"kind": "flow", "between": [a, b], "fluid": "liquid", "mass_flow": text, "specific_heat": "1 [J/(kg K)]"} | more


def capacity(joules: float) -> dict[str, str]:
    return {"capacitance": f"{joules} [J/K]"}


def joined(a: str, b: str) -> dict[str, Any]:
    return {"kind": "conduction", "between": [a, b], "conductance": "1 [W/K]"}


def branches(main: str, **more: Any) -> dict[str, Any]:
    """Return two masses on two parallel pipes that join a third."""
    return {
        "needs": ["ambient1", "ambient2"],
        "nodes": {n: capacity(0.1) for n in ("pipe1", "pipe2", "pipe3", "mass1", "mass2")},
        "conductors": {
            "g1": joined("mass1", "pipe1"),
            "g2": joined("mass2", "pipe2"),
            **{f"in{k}": flow("ambient1", f"pipe{k}", f"0.5*{main}", **more) for k in (1, 2)},
            **{f"out{k}": flow(f"pipe{k}", "pipe3", f"0.5*{main}", **more) for k in (1, 2)},
            "out": flow("pipe3", "ambient2", main, **more),
        },
    }


DECKS: dict[str, dict[str, Any]] = {
    "TwoMass": {"title": "two masses", "parameters": {"pump": "1 [kg/s]"}, **branches("pump", reversible=True)},
    "ParallelCooling": {
        "title": "parallel cooling",
        "parameters": {"pump": "1 [kg/s]"},
        **branches("pump"),
        "loads": {"q1": {"into": "mass1", "power": "5 [W]"}, "q2": {"into": "mass2", "power": "10 [W]"}},
    },
    "IndirectCooling": {
        "title": "indirect cooling",
        "needs": ["ambient1", "ambient2"],
        "nodes": {n: capacity(0.1) for n in ("pipe1", "inner", "outer")} | {"mass": capacity(0.05)},
        "conductors": {
            "g": joined("mass", "pipe1"),
            "cooler": joined("inner", "outer"),
            "there": flow("pipe1", "inner", "1 [kg/s]"),
            "back": flow("inner", "pipe1", "1 [kg/s]"),
            "in": flow("ambient1", "outer", "1 [kg/s]"),
            "out": flow("outer", "ambient2", "1 [kg/s]"),
        },
        "loads": {"q": {"into": "mass", "power": "10 [W]"}},
    },
}


def solved(name: str, times: NDArray[np.float64]) -> Any:
    schedule = {"pump": {"times": [f"{t} [s]" for t in PUMP[0]], "values": [f"{v} [kg/s]" for v in PUMP[1]]}} if name == "TwoMass" else {}
    scenario = td.Scenario(
        boundaries={"ambient1": f"{AMBIENT} [K]", "ambient2": f"{AMBIENT} [K]"},
        start=f"{AMBIENT} [K]",
        initial={"mass1": "313.15 [K]", "mass2": "333.15 [K]"} if name == "TwoMass" else {},
        duration=f"{times[-1]} [s]",
        schedule=schedule,
    )
    return td.simulate(td.model_from_dict(DECKS[name]), scenario, times=times, options=td.Options(error=4e-6))


def equations(name: str, times: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return node -> temperatures (times,) by the equations of the library: a pipe has the temperature of its outlet. [K]"""
    deck = DECKS[name]
    nodes = list(deck["nodes"])
    c = np.array([float(n["capacitance"].split()[0]) for n in deck["nodes"].values()])

    def rate(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        at = dict(zip(nodes, y, strict=True)) | {"ambient1": AMBIENT, "ambient2": AMBIENT}
        heat = dict.fromkeys(at, 0.0)
        for k in deck["conductors"].values():
            a, b = k["between"]
            if k["kind"] == "flow":
                half = 0.5 if k["mass_flow"].startswith("0.5") else 1.0
                m = half * (float(np.interp(t, *PUMP)) if name == "TwoMass" else 1.0)
                carried = m * (at[a] if m > 0.0 else at[b])
                heat[a] -= carried
                heat[b] += carried
            else:
                heat[a] -= at[a] - at[b]
                heat[b] += at[a] - at[b]
        for load in deck.get("loads", {}).values():
            heat[load["into"]] += float(load["power"].split()[0])
        return np.array([heat[n] for n in nodes]) / c

    y = np.array([{"mass1": 313.15, "mass2": 333.15}.get(n, AMBIENT) if name == "TwoMass" else AMBIENT for n in nodes])
    out, stops = np.empty((times.size, len(nodes))), [0.0, 0.2, 0.4, 0.6, 0.7, 0.8, float(times[-1])]
    for begin, end in pairwise(stops):
        part = solve_ivp(rate, (begin, end), y, "DOP853", rtol=1e-12, atol=1e-12, dense_output=True)
        inside = (times >= begin) & (times <= end)
        out[inside], y = part.sol(times[inside]).T, part.y[:, -1]
    return dict(zip(nodes, out.T, strict=True))


@pytest.mark.parametrize("name", DECKS)
def test_the_equations_of_the_library(name: str) -> None:
    """A pump that reverses (TwoMass); parallel branches and a closed inner loop: within 1e-5 K, mass and heat in balance."""
    times = np.linspace(0.0, 1.0, 401)
    run, exact = solved(name, times), equations(name, times)
    assert max(float(np.abs(run[n].kelvin - exact[n]).max()) for n in exact) < 1e-5
    assert run.heat_balance().relative < 1e-9


def test_what_a_turned_stream_carries() -> None:
    """Its heat counts in the conductor's direction: turned, the stream cools the pipe by what that is warmer than the second ambient."""
    times = np.array([0.0, 0.5, 0.9])
    run = solved("TwoMass", times)
    assert run["pipe3"].kelvin[2] > AMBIENT
    ahead, back = run.heat_flows["out"][1:]
    assert ahead == pytest.approx(run["pipe3"].kelvin[1] - AMBIENT, rel=1e-9)
    assert back == pytest.approx(run["pipe3"].kelvin[2] - AMBIENT, rel=1e-9)


def test_a_flow_below_zero_says_that_it_may_turn() -> None:
    deck = DECKS["ParallelCooling"] | {"parameters": {"pump": "-1 [kg/s]"}}
    scenario = td.Scenario(boundaries={"ambient1": "20 [degC]", "ambient2": "30 [degC]"}, start="20 [degC]", duration="20 [s]")
    with raises_code("value.outside-range", match=r"-0\.5.*kg/s"):
        td.simulate(td.model_from_dict(deck), scenario)
    turned = {"title": "turned", "parameters": {"pump": "-1 [kg/s]"}, **branches("pump", reversible=True)}
    assert td.simulate(td.model_from_dict(turned), scenario)["pipe1"].kelvin[-1] == pytest.approx(303.15, abs=1e-6)


def opened(name: str) -> tuple[list[str], NDArray[np.float64]]:
    folder = os.environ.get("THERMID_PUBLIC")
    if not folder:
        pytest.skip(f"THERMID_PUBLIC is not set; this test reads {FOLDER}/{name}/{name}.csv there")
    path = Path(folder) / FOLDER / name / f"{name}.csv"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    assert hashlib.sha256(path.read_bytes()).hexdigest() == SHA256[name]
    with path.open(encoding="utf-8") as lines:
        head, *rows = csv.reader(lines)
    return head, np.array(rows, dtype=float)


@pytest.mark.parametrize(
    ("name", "within", "at_the_end"), [("TwoMass", 5e-3, 5e-4), ("ParallelCooling", 1.5e-3, 3e-5), ("IndirectCooling", 1.1e-3, 4e-5)]
)
def test_results_of_the_library(name: str, within: float, at_the_end: float) -> None:
    head, data = opened(name)
    times = np.unique(data[:, 0])
    run = solved(name, times)
    for column, title in enumerate(head[1:], 1):
        node = title.removesuffix(".T")
        found = run[NAMES.get(node, node)].kelvin
        assert np.abs(np.interp(data[:, 0], times, found) - data[:, column]).max() < within, title
        assert abs(found[-1] - data[-1, column]) < at_the_end, title
