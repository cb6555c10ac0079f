"""Volumes that exchange vapour, with each other and with their walls: water is conserved, and an independent fine integrator agrees."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermid as td
from by_code import raises_code
from thermid.model.tree import Constant
from thermid.physics.air import mass_transfer_coefficient, saturation_pressure, vapour_density, vapour_pressure
from thermid.site.moisture import Moisture
from thermid.site.vapour import follow

PAIR = td.model_from_dict(
    {
        "title": "two volumes on a wall",
        "needs": ["air"],
        "nodes": {"wall": {"capacitance": "200 [J/K]"}, "a": {"capacitance": "5 [J/K]"}, "b": {"capacitance": "5 [J/K]"}},
        "surfaces": {
            "outer": {"of": "wall", "to": "air", "area": "0.05 [m^2]", "htc": "10 [W/(m^2 K)]"},
            "in_a": {"of": "wall", "to": "a", "area": "0.05 [m^2]", "htc": "5 [W/(m^2 K)]"},
            "in_b": {"of": "wall", "to": "b", "area": "0.05 [m^2]", "htc": "5 [W/(m^2 K)]"},
        },
    }
)
WARM = td.Scenario("warm", boundaries={"air": "30 [degC]"}, start="30 [degC]", duration="1 [h]")
LITRES = 2e-3


def vapour(found: td.site.Moisture, gas: str) -> np.ndarray:
    """Vapour of a gas by its dew point (times,). [kg/m^3]"""
    kelvin = found.solution[gas].kelvin
    return np.asarray(saturation_pressure(found.dew_points[gas], "surface") / (461.523 * kelvin))


def whole(found: td.site.Moisture, gases: str = "ab") -> np.ndarray:
    """Water in volumes and on surfaces (times,). [kg]"""
    return np.asarray(sum(LITRES * vapour(found, g) for g in gases) + sum(0.05 * s.film for s in found.surfaces.values()))


@pytest.mark.parametrize("written", ["both", "one"])
def test_two_volumes_that_exchange_keep_their_water(written: str) -> None:
    """What one loses the other gains, at once, whether both write the exchange or one: (a - b) falls with 2 E / V."""
    volumes = {
        "a": td.site.Volume("2 [l]", exchange="0.1 [l/min]", to="b", humidity=0.9),
        "b": td.site.Volume("2 [l]", **({"exchange": "0.1 [l/min]", "to": "a"} if written == "both" else {}), humidity=0.1),
    }
    found = td.site.moisture(PAIR, WARM, {}, volumes)
    assert whole(found) == pytest.approx(np.full(found.solution.times.size, whole(found)[0]), rel=1e-9)
    apart = vapour(found, "a") - vapour(found, "b")
    wanted = apart[0] * np.exp(-2.0 * 0.1e-3 / 60.0 / LITRES * found.solution.times)
    assert apart == pytest.approx(wanted, abs=1e-6 * apart[0])
    assert found.water.relative < 1e-9


def test_one_exchange_with_two_sizes_is_refused() -> None:
    volumes = {"a": td.site.Volume("2 [l]", exchange="0.1 [l/s]", to="b"), "b": td.site.Volume("2 [l]", exchange="0.2 [l/s]", to="a")}
    with raises_code("value.contradicts"):
        td.site.moisture(PAIR, WARM, {}, volumes)


def test_a_volume_that_exchanges_with_itself_is_refused() -> None:
    with raises_code("model.self-reference", match="'a'"):
        td.site.moisture(PAIR, WARM, {}, {"a": td.site.Volume("2 [l]", exchange="0.1 [l/s]", to="a")})


def test_water_that_crosses_into_the_open_is_counted() -> None:
    """A vented volume that dries out: what left by exchange is what is missing inside."""
    volumes = {
        "a": td.site.Volume("2 [l]", exchange="0.1 [l/min]", to="b", humidity=0.9),
        "b": td.site.Volume("2 [l]", "0.1 [l/min]", "air", 0.6),
    }
    found = td.site.moisture(PAIR, WARM.with_(boundaries={"air": "30 [degC]"}, duration="6 [h]"), {"air": 0.1}, volumes)
    before, after = whole(found)[[0, -1]]
    assert found.water.exchanged == pytest.approx(after - before, rel=1e-6)
    assert found.water.exchanged < -0.5 * before
    assert found.water.relative < 1e-9
    assert re.search(r"water: .* \d\.\de-\d\d\b", str(found))


def test_a_balance_that_does_not_close_stands_first() -> None:
    """Where water is missing, the first lines of the result give the amount."""
    scenario = WARM.with_(start="10 [degC]")
    found = td.site.moisture(PAIR, scenario, {"air": 0.8})
    flat = found.solution._run.network.flat
    parts = [c for c in flat.conductors if c.path == "outer"]
    followed = follow(found.solution, parts, {"air": Constant(0.8)}, {})
    holed = replace(followed, water=replace(followed.water, films=followed.water.films - 1e-3 * followed.water.settled))
    missing = re.compile(r": [+-][\d.e-]+ kg .* [\d.e-]+ kg .* `every`")
    assert missing.search(str(Moisture.of_run(found.solution, parts, holed)).splitlines()[1])
    assert not missing.search(str(Moisture.of_run(found.solution, parts, followed)))


def test_an_isothermal_wall_takes_vapour() -> None:
    """The coefficient is that of the law, not a heat flow over a difference: a wall at its gas' temperature still takes vapour."""
    cold = {"a": td.site.Volume("2 [l]", "10 [l/min]", "b", 0.9), "b": td.site.Volume("50 [m^3]", humidity=1.0)}
    model = td.model_from_dict(
        {
            "title": "cold store beside a warm room",
            "needs": ["cold", "warm"],
            "nodes": {
                "wall": {"capacitance": "1e6 [J/K]"},
                "a": {"capacitance": "1 [J/K]"},
                "b": {"capacitance": "1e6 [J/K]"},
            },
            "surfaces": {"in_a": {"of": "wall", "to": "a", "area": "0.05 [m^2]", "htc": "5 [W/(m^2 K)]"}},
            "conductors": {
                "hold": {"kind": "conduction", "between": ["b", "warm"], "conductance": "1 [W/K]"},
                "keep": {"kind": "conduction", "between": ["wall", "cold"], "conductance": "1e3 [W/K]"},
            },
        }
    )
    scenario = td.Scenario(
        "s", boundaries={"cold": "10 [degC]", "warm": "30 [degC]"}, start="10 [degC]", initial={"b": "30 [degC]"}, duration="1 [h]"
    )
    found = td.site.moisture(model, scenario, {}, cold)
    assert found["in_a"].film[-1] > 0.05
    assert found.water.relative < 1e-9


def random_case(seed: int) -> tuple[td.Model, td.Scenario, dict[str, td.site.Volume]]:
    """Volumes with one or two walls each, that a warm and cold plate drives through the dew point and back, exchanging at random."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5))
    gases = [f"g{k}" for k in range(count)]
    deck: dict[str, Any] = {"title": f"random {seed}", "needs": ["air", "plate"], "nodes": {}, "surfaces": {}, "conductors": {}}
    volumes = {}
    for k, gas in enumerate(gases):
        deck["nodes"][gas] = {"capacitance": "2 [J/K]"}
        for j in range(int(rng.integers(1, 3))):
            wall = f"w{k}{j}"
            deck["nodes"][wall] = {"capacitance": f"{rng.uniform(20, 80):.4g} [J/K]"}
            area, htc = rng.uniform(0.005, 0.05), rng.uniform(2, 10)
            deck["surfaces"][f"s{k}{j}"] = {"of": wall, "to": gas, "area": f"{area:.4g} [m^2]", "htc": f"{htc:.4g} [W/(m^2 K)]"}
            conductance = f"{rng.uniform(0.3, 3.0):.4g} [W/K]"
            deck["conductors"][f"c{k}{j}"] = {"kind": "conduction", "between": [wall, "plate"], "conductance": conductance}
        partners = ["", "air", *(g for g in gases if g != gas and volumes.get(g, td.site.Volume(1.0)).to != gas)]
        to = partners[int(rng.integers(len(partners)))]
        exchange = f"{rng.uniform(0.05, 2.0):.4g} [l/min]" if to else 0.0
        volumes[gas] = td.site.Volume(f"{rng.uniform(0.5, 10.0):.4g} [l]", exchange, to, float(rng.uniform(0.3, 0.95)))
    plate = {
        "times": ["0 [min]", "3 [min]", "6 [min]", "12 [min]"],
        "values": [f"{t:.3g} [degC]" for t in (25.0, *rng.uniform(-5, 35, 2), 30.0)],
    }
    pressure = rng.uniform(50e3, 110e3)
    scenario = td.Scenario(
        "random",
        boundaries={"air": "25 [degC]", "plate": plate},
        start="25 [degC]",
        duration="12 [min]",
        environment={"*": td.simulation.Environment(pressure=f"{pressure:.6g} [Pa]")},
    )
    return td.model_from_dict(deck), scenario, volumes


def reference(
    found: td.site.Moisture, model: td.Model, scenario: td.Scenario, volumes: dict[str, td.site.Volume], humidity: float
) -> np.ndarray:
    """Vapour of the volumes and films at the end, by an implicit integrator with error control over one smooth system.

    Temperatures are those of the run. Drying stops over the last 1e-8 kg/m^2 of a film, in place of an event.
    """
    times, gases = found.solution.times, list(volumes)
    kelvin = {n: found.solution[n].kelvin for n in found.solution.nodes}
    pressure = float(scenario.environment["*"].pressure.value)
    surfaces = [(name, s.of, s.to) for name, s in model.surfaces.items()]
    numbers = found.solution._run.assembled.numbers.values
    conductances = found.solution._run.conductances(times, found.solution.temperatures)
    size = np.array([float(volumes[g].volume) for g in gases])
    area = np.array([numbers[f"{s}.area"] for s, _, _ in surfaces])
    at = np.array([gases.index(g) for _, _, g in surfaces])
    skin, air = (np.array([kelvin[s[k]] for s in surfaces]) for k in (1, 2))
    htc = np.array([conductances[s] for s, _, _ in surfaces]) / area[:, None]
    outside = float(vapour_density(vapour_pressure(298.15, humidity), 298.15))
    pairs = [(k, gases.index(v.to) if v.to in gases else -1, float(v.exchange)) for k, v in enumerate(volumes.values()) if v.to]
    settled = vapour_density(saturation_pressure(skin, "surface"), skin)
    speed = mass_transfer_coefficient(htc, 0.5 * (skin + air), pressure)

    def change(t: float, y: np.ndarray) -> np.ndarray:
        c, film = y[: len(gases)], y[len(gases) :]
        i = min(int(np.searchsorted(times, t, side="right")) - 1, times.size - 2)
        share = (t - times[i]) / (times[i + 1] - times[i])
        v, w = ((1 - share) * x[:, i] + share * x[:, i + 1] for x in (speed, settled))
        gain = v * (c[at] - w)
        gain = np.where(gain < 0.0, gain * np.clip(film / 1e-8, 0.0, 1.0), gain)
        out = np.zeros(len(gases))
        np.add.at(out, at, -area * gain)
        for a, b, flow in pairs:
            moved = flow * ((c[b] if b >= 0 else outside) - c[a])
            out[a] += moved
            if b >= 0:
                out[b] -= moved
        return np.concatenate((out / size, gain))

    start = [float(vapour_density(vapour_pressure(kelvin[g][0], volumes[g].humidity), kelvin[g][0])) for g in gases]
    y = np.concatenate((start, np.zeros(len(surfaces))))
    return np.asarray(solve_ivp(change, (0.0, times[-1]), y, "LSODA", rtol=1e-8, atol=1e-11, max_step=30.0).y[:, -1])


def agrees(seed: int) -> None:
    """Vapour and films at the end to 2e-4 of what there is, water to 1e-9."""
    model, scenario, volumes = random_case(seed)
    open_air = {"air": 0.6} if any(v.to == "air" for v in volumes.values()) else {}
    found = td.site.moisture(model, scenario, open_air, volumes, every="60 [s]")
    assert found.water.relative < 1e-9, seed
    wanted = reference(found, model, scenario, volumes, 0.6)
    gases = len(volumes)
    ends = np.array([vapour(found, g)[-1] for g in volumes])
    films = np.array([found[s].film[-1] for s in model.surfaces])
    most = np.array([max(found[s].film.max(), 1e-6) for s in model.surfaces])
    assert ends == pytest.approx(wanted[:gases], rel=2e-4), seed
    assert np.abs(films - wanted[gases:]) / most == pytest.approx(0.0, abs=2e-4), seed


@pytest.mark.parametrize("seed", range(20))
def test_random_volumes_agree_with_a_fine_integrator(seed: int) -> None:
    agrees(seed)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(100, 600))
def test_many_random_volumes(seed: int) -> None:
    agrees(seed)
