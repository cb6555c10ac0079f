"""Ducts and heat sinks: coefficients beside the library `ht` and hand calculations, heat along a cabinet, gas that is thin or gone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.physics.convection import duct_nusselt, rectangle_nusselt
from thermid.physics.gas import MolecularGas

AIR = MolecularGas.named("air", "")
K, MU, PR = float(AIR.k(300.0)), float(AIR.mu(300.0)), float(AIR.at(300.0).prandtl)


def run(conductor: dict[str, Any], free: tuple[str, ...] = (), **scenario: Any) -> Any:
    """Return 20 W into a wall that a stream of 20 degC cools: its steady temperature is 20 W over the conductance."""
    deck = {
        "title": "wall",
        "needs": ["air"],
        "nodes": {"wall": {"capacitance": "40 [J/K]"}},
        "conductors": {"cooling": {"between": ["wall", "air"]} | conductor},
        "loads": {"heat": {"into": "wall", "power": "2 [W]"}},
    }
    given = td.Scenario(boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1 [h]", **scenario)
    return td.prepare(td.model_from_dict(deck), given, free)


def conductance(conductor: dict[str, Any], **scenario: Any) -> float:
    simulator = run(conductor, **scenario)
    return 2.0 / (simulator.settled()[0]["wall"] - 293.15)


@pytest.mark.parametrize("grams", [0.02, 0.2, 0.35, 0.6, 3.0])
def test_a_pipe_laminar_and_turbulent(grams: float) -> None:
    """Within 10 % of Gnielinski's full equation where it is turbulent, of Hausen's where laminar, by `ht`."""
    ht = pytest.importorskip("ht")
    diameter, length = 0.008, 0.4
    found = conductance({"kind": "duct", "diameter": "8 [mm]", "length": "40 [cm]", "mass_flow": f"{grams} [g/s]"})
    reynolds = 4e-3 * grams / (math.pi * diameter * MU)
    nusselt = found / (math.pi * diameter * length) * diameter / K
    assert nusselt == pytest.approx(duct_nusselt(reynolds, PR, diameter / length), rel=1e-9)
    if reynolds < 2300.0:
        graetz = reynolds * PR * diameter / length
        assert nusselt == pytest.approx(3.66 + 0.0668 * graetz / (1.0 + 0.04 * graetz ** (2.0 / 3.0)), rel=0.1)
    elif reynolds > 4000.0:
        friction = (0.79 * math.log(reynolds) - 1.64) ** -2
        entrance = 1.0 + (diameter / length) ** (2.0 / 3.0)
        assert nusselt == pytest.approx(ht.turbulent_Gnielinski(reynolds, PR, friction) * entrance, rel=0.1)


def test_between_laminar_and_turbulent_the_coefficient_is_continuous() -> None:
    for edge in (2300.0, 4000.0):
        below, above = (duct_nusselt(edge * (1.0 + s * 1e-9), 0.7, 0.01) for s in (-1.0, 1.0))
        assert above == pytest.approx(below, rel=1e-6)
    assert duct_nusselt(3150.0, 0.7, 0.01) == pytest.approx(0.5 * (duct_nusselt(2300.0, 0.7, 0.01) + duct_nusselt(4000.0, 0.7, 0.01)))


def test_channels_of_a_heat_sink_have_the_efficiency_of_their_fins() -> None:
    """12 channels of 2 x 15 mm, fins of 0.4 mm: the formulas written out; long and thin fins give less than their area."""
    sink = {"kind": "heat_sink", "width": "2 [mm]", "height": "15 [mm]", "length": "6 [cm]", "count": 12, "mass_flow": "1.5 [g/s]"}
    found = conductance(sink | {"fin_thickness": "0.4 [mm]", "fin_conductivity": "150 [W/(m K)]"})
    w, h, length, n, thick, k = 0.002, 0.015, 0.06, 12, 0.0004, 150.0
    d = 2.0 * w * h / (w + h)
    reynolds = 1.5e-3 / (n * w * h) * d / MU
    htc = duct_nusselt(reynolds, PR, d / length, rectangle_nusselt(w / h)) * K / d
    m = h * math.sqrt(2.0 * htc / (k * thick))
    assert found == pytest.approx(htc * (n * w * length + 2 * n * h * length * math.tanh(m) / m), rel=1e-9)
    assert found < htc * (n * w * length + 2 * n * h * length)


def test_a_volume_is_a_mass_at_the_pressure_of_its_gas() -> None:
    """Turbulent, h goes with the mass to 0.8; a given mass gives one coefficient at any pressure; none in vacuum."""
    duct = {"kind": "duct", "diameter": "20 [mm]", "length": "1 [m]"}
    mass = duct | {"mass_flow": "3 [g/s]"}
    half = {"environment": {"*": td.simulation.Environment(pressure="50663 [Pa]")}}
    assert conductance(mass, **half) == pytest.approx(conductance(mass), rel=1e-9)
    density = 101325.0 / (AIR.constant * 293.15)
    volume = duct | {"volume_flow": f"{3e-3 / density!r} [m^3/s]"}
    assert conductance(volume) == pytest.approx(conductance(mass), rel=1e-9)
    assert conductance(volume, **half) < 0.7 * conductance(volume)
    gone = run(mass, environment={"*": td.simulation.Environment(pressure="0 [Pa]")})
    assert gone.run()["wall"].kelvin[-1] == pytest.approx(293.15 + 2.0 * 3600.0 / 40.0, rel=1e-9)


def test_derivatives_are_differences() -> None:
    sink = {"kind": "heat_sink", "width": "2 [mm]", "height": "15 [mm]", "length": "6 [cm]", "count": 12, "mass_flow": "1.5 [g/s]"}
    free = tuple(f"cooling.{f}" for f in ("width", "height", "length", "fin_thickness", "fin_conductivity", "mass_flow"))
    simulator = run(sink | {"fin_thickness": "0.4 [mm]", "fin_conductivity": "150 [W/(m K)]"}, free)
    slopes = simulator.settled()[1]["wall"]
    for k, name in enumerate(free):
        step = 1e-5 * simulator.nominal[name]
        up, down = (simulator.settled({name: simulator.nominal[name] + s * step})[0]["wall"] for s in (1.0, -1.0))
        assert slopes[k] == pytest.approx((up - down) / (2.0 * step), rel=1e-6), name


def test_air_is_heated_along_a_cabinet() -> None:
    """Eight bays of one duct with equal heat: air rises by Q / (m c) from bay to bay, walls stand above it by Q / (h A)."""
    n, mass, watts = 8, 2e-3, 5.0
    nodes: dict[str, Any] = {f"air{k}": {"capacitance": "1 [J/K]", "stands_for": "air"} for k in range(n)}
    nodes |= {f"wall{k}": {"capacitance": "30 [J/K]"} for k in range(n)}
    conductors: dict[str, Any] = {}
    for k in range(n):
        before = "inlet" if k == 0 else f"air{k - 1}"
        conductors[f"stream{k}"] = {"kind": "flow", "between": [before, f"air{k}"], "fluid": "air", "mass_flow": "flow"}
        shape = {"width": "60 [mm]", "height": "15 [mm]", "length": "10 [cm]", "mass_flow": "flow"}
        conductors[f"bay{k}"] = {"kind": "duct", "between": [f"wall{k}", f"air{k}"]} | shape
    conductors["exhaust"] = {"kind": "flow", "between": [f"air{n - 1}", "inlet"], "fluid": "air", "mass_flow": "flow"}
    loads = {f"board{k}": {"into": f"wall{k}", "power": f"{watts} [W]"} for k in range(n)}
    deck = {"title": "cabinet", "needs": ["inlet"], "parameters": {"flow": f"{mass} [kg/s]"}, "nodes": nodes}
    run = td.simulate(
        td.model_from_dict(deck | {"conductors": conductors, "loads": loads}),
        td.Scenario(boundaries={"inlet": "25 [degC]"}, start="25 [degC]", duration="4 [h]"),
    )
    heat = float(AIR.cp(293.15))
    for k in range(n):
        assert run[f"air{k}"].kelvin[-1] - 298.15 == pytest.approx((k + 1) * watts / (mass * heat), rel=1e-6)
    rises = np.array([run[f"wall{k}"].kelvin[-1] - run[f"air{k}"].kelvin[-1] for k in range(n)])
    assert np.ptp(rises) < 1e-5
    assert run.heat_balance().relative < 1e-9


@pytest.mark.parametrize(
    ("fields", "code", "match"),
    [
        ({"kind": "duct", "diameter": "4 [mm]", "length": "0 [m]", "mass_flow": "1 [g/s]"}, "value.outside-range", r"'cooling\.length'.*0"),
        (
            {"kind": "duct", "width": "4 [mm]", "length": "1 [m]", "mass_flow": "1 [g/s]"},
            "value.incomplete",
            r"conductors\.cooling.*'duct'.*mass_flow",
        ),
        (
            {"kind": "duct", "diameter": "4 [mm]", "length": "1 [m]", "mass_flow": "-1 [g/s]"},
            "value.outside-range",
            r"'cooling\.mass_flow'",
        ),
    ],
)
def test_what_is_no_duct_is_refused(fields: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        run(fields).run()


def test_a_pressure_that_changes_is_refused() -> None:
    falling = {"times": ["0 [s]", "1 [h]"], "values": ["101325 [Pa]", "60000 [Pa]"]}
    duct = {"kind": "duct", "diameter": "4 [mm]", "length": "1 [m]", "mass_flow": "1 [g/s]"}
    with raises_code("value.without-effect"):
        run(duct, environment={"*": td.simulation.Environment(pressure=falling)})
