"""Sun, sky and streams on outer surfaces: hand calculations, the ledger, energy, superposition, derivatives, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError, ScenarioError
from thermid.base.units import STEFAN_BOLTZMANN

SUN = 1361.0
BRIGHT = "1361 [W/m^2]"


def plate(**surface: Any) -> td.Model:
    """A plate of 0.1 m^2 that sees a boundary 'space'."""
    face = {"of": "plate", "to": "space", "area": "0.1 [m^2]", "htc": 0, "emissivity": 0.85, "absorptance": 0.25} | surface
    face = {k: v for k, v in face.items() if v is not None}
    return td.model_from_dict(
        {"title": "plate", "needs": ["space"], "nodes": {"plate": {"capacitance": "100 [J/K]"}}, "surfaces": {"face": face}}
    )


def under(kelvin: float = 2.7, duration: str = "4 [h]", **flux: Any) -> td.Scenario:
    """What falls on it."""
    return td.Scenario(
        "sun",
        boundaries={"space": f"{kelvin} [K]"},
        irradiation={"face": td.simulation.Irradiation(**flux)},
        start="300 [K]",
        duration=duration,
    )


def test_a_plate_in_sun_settles_where_absorbed_is_emitted() -> None:
    """Hand: 0.25 * 1361 = 0.85 sigma (T^4 - 2.7^4), 289.8 K for a plate that emits from one side."""
    settled = td.steady(plate(), under(direct=BRIGHT))["plate"]
    assert settled == pytest.approx((0.25 * SUN / (0.85 * STEFAN_BOLTZMANN) + 2.7**4) ** 0.25, abs=1e-6)
    assert settled == pytest.approx(289.9, abs=0.05)


def test_a_plate_under_a_sky_settles_at_the_sky() -> None:
    whole = td.steady(plate(), under(300.0, sky="260 [K]", sky_view=1.0))["plate"]
    half = td.steady(plate(), under(300.0, sky="260 [K]", sky_view=0.5))["plate"]
    assert whole == pytest.approx(260.0, abs=1e-6)
    assert half == pytest.approx((0.5 * 260.0**4 + 0.5 * 300.0**4) ** 0.25, abs=1e-6)


def test_infrared_is_absorbed_by_emissivity_and_a_stream_whole() -> None:
    sigma = STEFAN_BOLTZMANN
    warm = td.steady(plate(), under(infrared="200 [W/m^2]"))["plate"]
    struck = td.steady(plate(), under(stream="200 [W/m^2]"))["plate"]
    assert warm == pytest.approx((200.0 / sigma + 2.7**4) ** 0.25, abs=1e-6)
    assert struck == pytest.approx((200.0 / (0.85 * sigma) + 2.7**4) ** 0.25, abs=1e-6)


def test_parts_of_the_sun_add_up() -> None:
    parts = under(direct="700 [W/m^2]", diffuse="80 [W/m^2]", albedo="40 [W/m^2]")
    assert td.steady(plate(), parts)["plate"] == pytest.approx(td.steady(plate(), under(total="820 [W/m^2]"))["plate"], abs=1e-9)


def test_a_joint_shades_what_it_covers() -> None:
    """The ledger leaves 0.06 of 0.1 m^2 to the sun."""
    part = plate()
    deck = {
        "title": "pair",
        "needs": ["space"],
        "submodels": {n: {"use": part, "bind": {"space": "space"}} for n in ("a", "b")},
        "joints": {"seam": {"between": ["a.face", "b.face"], "area": "0.04 [m^2]", "contact_conductance": "100 [W/(m^2 K)]"}},
    }
    deck["submodels"]["a"]["use"] = td.model_from_dict(
        {"title": "p", "needs": ["space"], "offers": ["face"], "nodes": {"plate": {"capacitance": "100 [J/K]"}}}
        | {"surfaces": {"face": {"of": "plate", "to": "space", "area": "0.1 [m^2]", "htc": 0, "emissivity": 0.85, "absorptance": 0.25}}}
    )
    deck["submodels"]["b"]["use"] = deck["submodels"]["a"]["use"]
    made = td.model_from_dict(deck)
    sun = td.Scenario(
        "sun",
        boundaries={"space": "2.7 [K]"},
        irradiation={"a.face": td.simulation.Irradiation(direct=BRIGHT)},
        start="300 [K]",
        duration=600.0,
    )
    powers = td.simulate(made, sun).load_powers
    assert powers["a.face.sun"] == pytest.approx(0.25 * 0.06 * SUN)


def test_heat_balances_and_an_eclipse_cools() -> None:
    eclipse = {"times": ["0 [s]", "30 [min]", "66 [min]"], "values": [f"{SUN} [W/m^2]", "0 [W/m^2]", f"{SUN} [W/m^2]"], "hold": True}
    run = td.simulate(plate(), under(direct=eclipse, infrared="150 [W/m^2]", duration="92 [min]"), every="1 [min]")
    lit = 0.25 * 0.1 * SUN * (30 + 26) * 60.0
    assert np.trapezoid(run.load_powers["face.longwave"], run.times) == pytest.approx(0.85 * 0.1 * 150.0 * 92 * 60)
    balance = run.heat_balance()
    assert balance.relative < 1e-6
    assert balance.loads == pytest.approx(lit + 0.85 * 0.1 * 150.0 * 92 * 60, rel=1e-9)
    temperature = run["plate"].kelvin
    assert temperature[66] == pytest.approx(temperature.min(), abs=1e-9)


def test_what_two_suns_do_is_the_sum_of_what_each_does() -> None:
    """Superposition in a linear model, with exact modes."""
    linear = plate(htc="5 [W/(m^2 K)]", emissivity=None)

    def rise(**flux: str) -> np.ndarray:
        made = under(300.0, **flux) if flux else td.Scenario("dark", boundaries={"space": "300 [K]"}, start="300 [K]", duration="4 [h]")
        run = td.simulate(linear, made)
        assert run.statistics["method"] == "modal"
        return run["plate"].kelvin - 300.0

    both = rise(direct="500 [W/m^2]", albedo="90 [W/m^2]")
    assert np.abs(both - rise(direct="500 [W/m^2]") - rise(albedo="90 [W/m^2]")).max() < 1e-9
    assert np.abs(rise()).max() < 1e-9


def test_absorptance_and_the_sun_itself_have_derivatives() -> None:
    """An absorptance can be fitted, and a factor on the sun is a spread of the environment."""
    names = ("face.absorptance", "face.area", "scale.face.sun")
    tool = td.prepare(plate(), under(direct=BRIGHT), names)
    base = tool.run(sensitivities=True)
    for name in names:
        step = 1e-4 * tool.nominal[name]
        ends = [tool.run({name: tool.nominal[name] + s * step})["plate"].kelvin[-1] for s in (1, -1)]
        # a steady plate does not care for its area, so that slope is small
        assert base.sensitivity("plate", name)[-1] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4, abs=1e-2)


def test_the_sun_is_given_in_watts_too() -> None:
    run = td.simulate(plate(), under(direct=BRIGHT).with_(loads={"face.sun": "3 [W]"}))
    assert run.load_powers["face.sun"][-1] == pytest.approx(3.0)


def test_an_absorptance_and_a_facing_survive_a_file(tmp_path: Any) -> None:
    made = plate(facing={"tilt": "90 [deg]", "azimuth": 270}, absorptance={"value": 0.3, "min": 0.2, "max": 0.4, "source": "datasheet"})
    td.save_model(made, tmp_path / "plate.toml")
    again = td.load_model(tmp_path / "plate.toml")
    assert again.surfaces["face"].facing == made.surfaces["face"].facing
    assert again.at("face.absorptance").source == "datasheet"
    assert made.identity() == again.identity()


@pytest.mark.parametrize(
    ("surface", "flux", "code", "match"),
    [
        ({"absorptance": None}, {"direct": BRIGHT}, "value.incomplete", r"surfaces\.face.*'face'"),
        ({"emissivity": None, "htc": "5 [W/(m^2 K)]"}, {"infrared": "200 [W/m^2]"}, "value.incomplete", r"surfaces\.face.*'face'"),
        ({"absorptance": 1.2}, {"direct": BRIGHT}, "value.outside-range", r"'face\.absorptance'.*1\.2.*0.*1"),
        ({"absorptance": -0.1}, {"direct": BRIGHT}, "value.outside-range", r"'face\.absorptance'.*-0\.1"),
        ({"facing": {"tilt": 200}}, {}, "value.outside-range", "200.*0.*180"),
        ({"facing": {"tilt": 90, "azimuth": 400}}, {}, "value.outside-range", "400.*0.*360"),
        ({"facing": {"tilt": "90 [m]"}}, {}, "value.wrong-kind", r"surfaces\.face\.facing.*'90 \[m\]'.*'90 \[deg\]'"),
    ],
)
def test_surfaces_that_cannot_be_are_refused(surface: dict[str, Any], flux: dict[str, str], code: str, match: str) -> None:
    with raises_code(code, DeckError, match=match):
        td.simulate(plate(**surface), under(**flux))


@pytest.mark.parametrize(
    ("flux", "code", "match"),
    [
        ({"direct": "-5 [W/m^2]"}, "value.outside-range", "-5.*W/m.*2"),
        ({"direct": "1361 [kW/m^2]"}, "value.outside-range", r"1\.361e\+06.*W/m"),
        ({"total": "800 [W/m^2]", "diffuse": "100 [W/m^2]"}, "value.excludes-another", ""),
        ({"sky": "260 [K]"}, "value.incomplete", "sky_view"),
        ({"sky": "260 [K]", "sky_view": 1.5}, "value.outside-range", r"sky_view.*1\.5"),
    ],
)
def test_radiation_that_cannot_be_is_refused(flux: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, ScenarioError, match=match):
        td.simulation.Irradiation(**flux)


def test_a_wrong_name_is_offered_the_right_one() -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'face'"):
        td.simulate(plate(), under(direct=BRIGHT).with_(irradiation={"fase": td.simulation.Irradiation(direct=BRIGHT)}))


def test_check_sees_an_absorptance_above_one() -> None:
    with raises_code("value.outside-range", DeckError, match="1.3"):
        plate(absorptance=1.3)
