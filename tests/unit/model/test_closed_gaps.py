"""Convection in closed gaps: the laws by their published forms, pressure, gravity and tilt, and what a deck may say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError
from thermid.physics.correlations import gap_nusselt
from thermid.physics.gas import GASES


def gap(watts: float = 1.0, **more: Any) -> td.Model:
    layer = {"kind": "gas", "between": ["board", "lid"], "area": "200 [cm^2]", "gap": "25 [mm]"} | more
    loads = {"q": {"into": "board", "power": f"{watts} [W]"}}
    deck = {"title": "x", "needs": ["lid"], "nodes": {"board": {"capacitance": "50 [J/K]"}}, "conductors": {"c": layer}, "loads": loads}
    return td.model_from_dict(deck)


LID = td.Scenario("lid", boundaries={"lid": "30 [degC]"}, start="30 [degC]", duration="2 [h]")


def rise(scenario: td.Scenario = LID, watts: float = 1.0, **more: Any) -> float:
    return td.steady(gap(watts, **more), scenario)["board"] - 303.15


def nusselt(dt: float, watts: float, pressure: float = 101325.0, gravity: float = 9.80665) -> tuple[float, float]:
    """Rayleigh and Nusselt number of a gap that shows a rise, from properties at its mean temperature."""
    mean = 303.15 + 0.5 * dt
    air = GASES["air"]
    at = air.at(mean, pressure)
    ra = gravity * float(at.expansion_at(mean) / (at.kinematic_viscosity * at.thermal_diffusivity())) * dt * 0.025**3
    return ra, watts / (air.k(mean) * 0.02 / 0.025 * dt)


def test_a_board_under_a_lid_is_16_k_warm_and_not_44() -> None:
    """1 W over 200 cm2 and 25 mm: the gas was taken to be at rest."""
    assert rise() == pytest.approx(44.3, abs=0.1)
    assert rise(tilt="0 [deg]", aspect="6") == pytest.approx(16.3, abs=0.1)
    assert rise(tilt="180 [deg]", aspect="6") == pytest.approx(rise(), abs=1e-6)


@pytest.mark.parametrize("watts", [0.005, 0.1, 1.0, 5.0])
def test_hollands_to_a_per_cent(watts: float) -> None:
    """Hollands 1976, written out; below 1708 the gas is at rest."""
    ra, found = nusselt(rise(watts=watts, tilt="0 [deg]", aspect="20"), watts)
    truth = 1 + 1.44 * max(0.0, 1 - 1708 / ra) + max(0.0, (ra / 5830) ** (1 / 3) - 1)
    assert found == pytest.approx(truth, rel=0.01)


@pytest.mark.parametrize("pressure", [20e3, 101325.0, 300e3])
@pytest.mark.parametrize("gravity", [1.62, 9.80665])
def test_it_follows_pressure_and_gravity(pressure: float, gravity: float) -> None:
    state = LID.with_(environment={"*": td.simulation.Environment(pressure=f"{pressure} [Pa]", gravity=f"{gravity} [m/s^2]")})
    ra, found = nusselt(rise(state, tilt="0 [deg]", aspect="20"), 1.0, pressure, gravity)
    truth = 1 + 1.44 * max(0.0, 1 - 1708 / ra) + max(0.0, (ra / 5830) ** (1 / 3) - 1)
    assert found == pytest.approx(truth, rel=0.01)


def test_without_gas_nothing_is_carried() -> None:
    closed = gap(0.0, tilt="0 [deg]", aspect="6")
    run = td.simulate(closed, LID.vacuum().with_(start="60 [degC]"))
    assert run["board"].final == pytest.approx(60.0, abs=1e-6)


@pytest.mark.parametrize(
    ("tilt", "aspect"), [(30.0, 20.0), (60.0, 20.0), (75.0, 20.0), (90.0, 20.0), (90.0, 4.0), (40.0, 4.0), (120.0, 20.0)]
)
def test_tilted_and_upright_by_their_published_forms(tilt: float, aspect: float) -> None:
    ra, found = nusselt(rise(tilt=f"{tilt} [deg]", aspect=f"{aspect}"), 1.0)

    def upright(r: float) -> float:
        if aspect < 12:
            return 0.22 * (0.71 / 0.91 * r) ** 0.28 * aspect**-0.25
        two = (1 + (0.104 * r**0.293 / (1 + (6310 / r) ** 1.36)) ** 3) ** (1 / 3)
        return max(0.0605 * r ** (1 / 3), two, 0.242 * (r / aspect) ** 0.272)

    def lying(r: float, angle: float) -> float:
        c = r * math.cos(math.radians(angle))
        turned = 1 - 1708 * math.sin(math.radians(1.8 * angle)) ** 1.6 / c
        return 1 + 1.44 * (1 - 1708 / c) * turned + (c / 5830) ** (1 / 3) - 1

    critical = 53.0 + (60.0 - 53.0) / 3.0
    if tilt > 90:
        truth = 1 + (upright(ra) - 1) * math.sin(math.radians(tilt))
    elif aspect < 12:
        share = tilt / critical
        flat = lying(ra, 0.0)
        truth = flat * (upright(ra) / flat) ** share * math.sin(math.radians(critical)) ** (share / 4) if tilt < critical else upright(ra)
    else:
        truth = lying(ra, tilt) if tilt <= 60 else lying(ra, 60.0) + (tilt - 60) / 30 * (upright(ra) - lying(ra, 60.0))
    assert found == pytest.approx(truth, rel=0.01)


def test_the_warmer_plate_may_change() -> None:
    """One gap, heated from above first and from below then: a tilt of 0 with the first end colder is one of 180."""
    above = td.steady(gap(-1.0, tilt="0 [deg]", aspect="20"), LID)["board"]
    assert 303.15 - above == pytest.approx(303.15 - td.steady(gap(-1.0), LID)["board"], abs=1e-6)


@pytest.mark.parametrize("aspect", [1.0, 3.0, 11.9, 12.0, 60.0])
def test_no_law_is_below_gas_at_rest_or_jumps(aspect: float) -> None:
    for ra in np.geomspace(1.0, 1e7, 57).tolist():
        found = np.array([gap_nusselt(ra, tilt, aspect) for tilt in np.linspace(0.0, 180.0, 361)])
        assert found.min() >= 1.0
        assert np.abs(np.diff(found)).max() < 0.35 * found.max()


def test_its_scatter_is_carried_and_its_derivatives_are_those_of_differences() -> None:
    model = gap(tilt="0 [deg]", aspect="20")
    factor = model.at("c.convection_factor")
    assert (factor.minimum, factor.maximum, factor.source) == (0.95, 1.05, "published")
    assert gap(tilt="0 [deg]", aspect="6").at("c.convection_factor").maximum == 1.1
    free = ("c.area", "c.gap", "c.convection_factor", "q.power")
    ready = td.prepare(model, LID, free, options=td.Options(error=8e-9))
    run = ready.run(sensitivities=True)
    assert run.heat_balance().relative < 1e-9
    for name in free:
        step = 1e-4 * ready.nominal[name]
        high, low = (ready.run({name: ready.nominal[name] + s * step})["board"].kelvin for s in (1.0, -1.0))
        quotient = (high - low) / (2 * step)
        assert run.sensitivity("board", name) == pytest.approx(quotient, abs=3e-4 * np.abs(quotient).max()), name


@pytest.mark.parametrize("method", ["integrator", "large"])
def test_members_and_large_networks_are_single_runs(method: str) -> None:
    model = gap(tilt="30 [deg]", aspect="20")
    plain = td.simulate(model, LID, every=300.0)["board"].kelvin
    other = td.simulate(model, LID, every=300.0, options=td.Options(method=method))["board"].kelvin
    assert other == pytest.approx(plain, abs=2e-2)
    many = td.ensemble(model, LID, {"c.convection_factor": np.array([0.95, 1.0, 1.05])}, every=300.0)
    assert many.temperatures("board")[:, 1] == pytest.approx(plain, abs=1e-3)


def test_ranges_and_gas_at_rest_are_said() -> None:
    wide = td.simulate(gap(2000.0, tilt="0 [deg]", aspect="20", gap="60 [cm]"), LID.with_(duration="1 [h]"))
    assert any("1e+08" in w for w in wide.warnings)
    assert any("'c'" in w for w in td.simulate(gap(), LID).warnings)
    assert not td.simulate(gap(tilt="0 [deg]", aspect="6"), LID).warnings


@pytest.mark.parametrize(
    ("more", "code", "match"),
    [
        ({"tilt": "0 [deg]"}, "value.incomplete", r'conductors\.c.*"0 \[deg\]"'),
        ({"aspect": "4"}, "value.incomplete", r'conductors\.c.*"0 \[deg\]"'),
        ({"tilt": "190 [deg]", "aspect": "4"}, "value.outside-range", "190"),
        ({"tilt": "flat", "aspect": "4"}, "value.wrong-kind", "'flat'"),
        ({"tilt": "0", "aspect": "0.2"}, "value.outside-range", r"'aspect'.*0\.2"),
        ({"convection_factor": 1.1}, "value.without-effect", "convection_factor"),
    ],
)
def test_what_a_gap_cannot_be(more: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, DeckError, match=match):
        gap(**more)
