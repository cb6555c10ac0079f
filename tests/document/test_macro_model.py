"""The macro model: rows A7 and A9 to A11 of the acceptance sheet, and W1, a metallic case around the unit."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.prediction._reduction.macro import host_values

pytestmark = pytest.mark.document
SISNAV = Path(__file__).parents[2] / "examples" / "sisnav"
MACRO = SISNAV / "macro"
NEAR = td.Options(error=4e-7)
SCENARIOS = ("transport", "pad", "pad_hold", "ascent", "coast")


@pytest.fixture(scope="module")
def macro() -> td.Model:
    return td.qualify.macro_model(MACRO / "macro.toml")


@pytest.fixture(scope="module")
def flight() -> td.Model:
    sys.path.insert(0, str(MACRO))
    try:
        import macro as decks

        return decks.flight()
    finally:
        del sys.path[0]


def around(celsius: float, **more: object) -> td.Scenario:
    return td.Scenario("x", boundaries=dict.fromkeys(("weather", "sky", "supply", "stage"), f"{celsius} [degC]"), **more)


def test_A7_ten_kelvin_more_around_the_linear_macro_model(macro: td.Model) -> None:  # noqa: N802
    """Without radiation and with constant coefficients of the host, everything shifts by what the surroundings shift by."""
    skins = ("base_skin", "liner_skin", "shell_skin")
    linear = macro.with_values(
        {f"{s}.emissivity": {"value": 0.0, "min": 0.0} for s in skins} | {f"{s}.htc.exponent": 0.0 for s in skins[:2]}
    )
    one, other = (td.steady(linear, around(t)) for t in (20, 30))
    assert {n: other[n] - one[n] for n in one} == pytest.approx(dict.fromkeys(one, 10.0), abs=1e-9)


def test_A9_without_links_the_unit_is_unchanged(macro: td.Model) -> None:  # noqa: N802
    """Base plate and bay hang on the free ports cd and cv; with a host link of no conductance the unit does what it does alone."""
    alone = td.load_model(SISNAV / "m_Sd.toml")
    room = {"times": ["0 [h]", "5 [h]"], "values": ["24 [degC]", "24.7 [degC]"]}
    free = macro.with_values({"foot_conductance": {"value": "0 [W/K]", "source": "assumed"}})
    inside = td.simulate(free, around(50.0, prescribed={"bay": room}, start="24 [degC]", duration="5 [h]"), options=NEAR)
    bench = td.simulate(alone, td.Scenario("bench", boundaries={"cv": room}, start="24 [degC]", duration="5 [h]"), options=NEAR)
    for node in bench.nodes:
        if node != "cv":
            assert np.abs(inside[f"unit.{node}"].kelvin - bench[node].kelvin).max() < 1e-6, node
    linked = td.simulate(macro, around(50.0, prescribed={"bay": room}, start="24 [degC]", duration="5 [h]"), options=NEAR)
    assert linked["disk"].final > inside["disk"].final + 1.0


def test_A9_the_decks_of_the_unit_are_used_as_they_are(macro: td.Model) -> None:  # noqa: N802
    assert macro.submodel("unit").identity() == td.load_model(SISNAV / "m_Sd.toml").identity()


def test_A10_every_value_of_the_host_has_a_source(macro: td.Model) -> None:  # noqa: N802
    values = host_values(macro)
    assert len(values) > 20
    assert all(v.source and v.basis for v in values)
    assert not any(v.path.startswith("unit.") for v in values)


def test_A10_a_value_without_a_source_is_named(macro: td.Model) -> None:  # noqa: N802
    with raises_code("value.incomplete", match="2.*'foot_conductance'.*'ring.conductance'"):
        td.qualify.macro_model(macro.with_values({"foot_conductance": "0.4 [W/K]", "ring.conductance": "2 [W/K]"}))
    with raises_code("value.incomplete", match="'unit.pre.proc.power'"):
        td.qualify.macro_model(macro.with_values({"unit.pre.proc.power": "4 [W]"}))


def test_A10_a_value_that_is_not_set_is_an_error_with_its_name(tmp_path: Path) -> None:  # noqa: N802
    for name in ("Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV", "m_PrE", "m_AccS", "m_IMU", "m_Sd"):
        (tmp_path / f"{name}.toml").write_text((SISNAV / f"{name}.toml").read_text(encoding="utf-8"), encoding="utf-8")
    text = (MACRO / "macro.toml").read_text(encoding="utf-8").replace("../m_Sd", "m_Sd")
    (tmp_path / "macro.toml").write_text(text.replace('value = "2.5 [W/(m^2 K)]", ', ""), encoding="utf-8")
    with pytest.raises(td.ThermidError, match=r"macro.toml:\d+, parameters.insulation.*value"):
        td.qualify.macro_model(tmp_path / "macro.toml")


def test_A10_what_is_fitted_counts_as_calibrated(macro: td.Model) -> None:  # noqa: N802
    """Action 10's other way: a link of the host from a log of the base plate."""
    hold = td.load_scenario(MACRO / "pad_hold.toml").with_(duration="3 [h]")
    times = np.arange(0.0, 10801.0, 120.0)
    truth = td.simulate(macro.with_values({"ring.conductance": {"value": "4 [W/K]", "source": "assumed"}}), hold, times=times)
    noise = 0.05 * np.random.default_rng(3).standard_normal(times.size)
    channel = td.Channel.from_array("T_BASE", truth["base"].kelvin + noise, unit="K", role="node", target="base", noise=0.05)
    record = td.Record.from_arrays("log", times, {"T_BASE": channel})
    fit = td.calibrate(macro, record, ["ring.conductance"], scenario=hold)
    found = fit["ring.conductance"]
    assert found.value == pytest.approx(4.0, abs=4 * found.error)
    (value,) = (v for v in host_values(td.qualify.macro_model(fit.model)) if v.path == "ring.conductance")
    assert value.source == "calibrated"


@pytest.mark.parametrize("name", SCENARIOS)
def test_A11_every_scenario_of_the_host_keeps_its_energy(name: str, macro: td.Model, flight: td.Model) -> None:  # noqa: N802
    run = td.simulate(flight if name in ("ascent", "coast") else macro, td.load_scenario(MACRO / f"{name}.toml"))
    balance = run.heat_balance()
    assert abs(balance.residual) < 1e-6 * max(abs(balance.loads), abs(balance.boundaries), abs(balance.stored))


def test_A11_tables_of_weather_fairing_and_power(macro: td.Model) -> None:  # noqa: N802
    """Ambient air, the fairing's temperature and a power profile as tables, all at once."""
    hours = ["0 [h]", "1 [h]", "2.5 [h]", "4 [h]"]
    scenario = around(
        22.0,
        duration="4 [h]",
        start="22 [degC]",
        prescribed={"liner": {"times": hours, "values": ["22 [degC]", "35 [degC]", "41 [degC]", "30 [degC]"]}},
        loads={"unit.pre.proc.electronics": {"times": hours, "values": ["0 [W]", "6.8 [W]", "4.1 [W]", "0 [W]"], "hold": True}},
    ).with_(boundaries={"weather": {"times": hours, "values": ["20 [degC]", "28 [degC]", "33 [degC]", "29 [degC]"]}})
    run = td.simulate(macro, scenario)
    assert run["liner"].at(5400.0) == pytest.approx(37.0)
    balance = run.heat_balance()
    assert abs(balance.residual) < 1e-6 * balance.loads


def test_A11_thin_air_needs_radiation_by_itself(macro: td.Model) -> None:  # noqa: N802
    with raises_code("model.needs-gas-law"):
        td.simulate(macro, td.load_scenario(MACRO / "ascent.toml"))


def test_W1_a_metallic_case_around_the_unit_without_touching_its_decks() -> None:  # noqa: N802
    """The document's future work i: a case node around the unit; the components' decks stay as they are."""
    unit = td.load_model(SISNAV / "m_Sd.toml")
    cased = td.model_from_dict(
        {
            "title": "m_Sd in its case",
            "needs": ["cv"],
            "submodels": {"unit": {"use": unit, "bind": {"cv": "inside"}}},
            "nodes": {"inside": {"capacitance": "40 [J/K]"}, "case": {"mass": "3 [kg]", "specific_heat": "900 [J/(kg K)]"}},
            "surfaces": {
                "outer": {"of": "case", "to": "cv", "area": "0.45 [m^2]", "effective_htc": "8 [W/(m^2 K)]"},
                "inner": {"of": "case", "to": "inside", "area": "0.43 [m^2]", "effective_htc": "6 [W/(m^2 K)]"},
            },
            "conductors": {"bolts": {"kind": "conduction", "between": ["unit.disk", "case"], "conductance": "2 [W/K]"}},
        }
    )
    room = td.Scenario("room", boundaries={"cv": "24 [degC]"})
    bare, in_case = td.steady(unit, room), td.steady(cased, room)
    watts = 15.313  # in and out, section 2.5 of the acceptance sheet
    assert in_case["case"] - 297.15 == pytest.approx(watts / (8 * 0.45), abs=1e-3)
    assert all(in_case[f"unit.{n}"] > bare[n] + 2.0 for n in ("pre.proc.case", "imu.fog_x.case", "disk"))
    assert cased.submodel("unit").identity() == unit.identity()
    for part in ("pre.proc", "pre.ele", "imu.fog_x", "imu.fog_y", "imu.acc.acc_x"):
        assert cased.submodel(f"unit.{part}").identity() == unit.submodel(part).identity()
