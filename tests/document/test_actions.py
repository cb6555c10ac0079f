"""The document's actions as fits: rows A2, A4, A7, B15, H1 and M1 of the acceptance sheet. A6 and the campaign are in tests/examples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td

pytestmark = [pytest.mark.document, pytest.mark.usefixtures("errors_in_turn")]
DECKS = Path(__file__).parents[2] / "examples" / "sisnav"
LEVELS = ("Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV", "m_PrE", "m_AccS", "m_IMU", "m_Sd")
BENCH = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
MINUTES = np.arange(0.0, 18001.0, 60.0)


def deck(name: str) -> td.Model:
    return td.load_model(DECKS / f"{name}.toml")


def log(sensors: dict[str, np.ndarray], noise: float, room: np.ndarray | None = None) -> td.Record:
    """Return a record of temperatures [K] by node; the room too where it is given."""
    made = {n: td.Channel.from_array(n, v, unit="K", role="node", target=n, noise=noise) for n, v in sensors.items()}
    if room is not None:
        made["ROOM"] = td.Channel.from_array("ROOM", room, unit="K", role="boundary", target="cv")
    return td.Record.from_arrays("log", MINUTES, made)


def test_A2_the_area_factor_is_recovered() -> None:  # noqa: N802
    """From 1.00 to the printed 1.08 +- 0.01, with noise of 0.05 K."""
    rng = np.random.default_rng(11)
    truth = td.simulate(deck("Acc"), BENCH, times=MINUTES)["case"].kelvin
    begun = deck("Acc").with_values({"sensor_factor": {"value": 1.0, "min": 0.8, "max": 1.5}})
    fit = td.calibrate(begun, log({"case": truth + 0.05 * rng.standard_normal(truth.size)}, 0.05), ["sensor_factor"], scenario=BENCH)
    found = fit.values.parameters["sensor_factor"]
    assert found.start == 1.0
    assert found.value == pytest.approx(1.08, abs=0.01)
    assert abs(found.value - 1.08) < 3 * found.error < 0.03


def test_A4_interfaces_alone_are_tuned() -> None:  # noqa: N802
    """Planted joint and gap come back to 1 % from a noiseless log; power, capacitance and area of the components stay bit for bit."""
    pair = deck("m_PrE")
    planted = {"stack_conductivity": 0.8, "stack.gap.htc": 6.0}
    step = BENCH.with_(
        loads={"ele.electronics": {"times": ["0 [s]", "3 [h]"], "values": ["2.168 [W]", "0 [W]"], "hold": True}}, duration="5 [h]"
    )
    texts = {"stack_conductivity": "0.8 [W/(m K)]", "stack.gap.htc": "6 [W/(m^2 K)]"}
    run = td.simulate(pair.with_values(texts), step, times=MINUTES)
    record = log({n: run[n].kelvin for n in ("proc.case", "ele.case")}, 0.01)
    fit = td.calibrate(pair, record, list(planted), scenario=step)
    assert {p: v.value for p, v in fit.values.parameters.items()} == pytest.approx(planted, rel=0.01)
    before, after = (td.simulation.compile_network(m) for m in (pair, fit.model))
    one, two = before.numbers(), after.numbers()
    assert dict(one.capacitances) == dict(two.capacitances)
    changed = {p for p, v in one.values.items() if float(two.values[p]) != float(v)}
    assert changed == {"stack_conductivity", "stack.gap.htc", "stack.contact_conductance"}
    assert [(line.surface, line.total) for line in td.model.ledger(pair)] == [
        (line.surface, line.total) for line in td.model.ledger(fit.model)
    ]


@pytest.mark.parametrize("level", LEVELS)
def test_A7_ten_kelvin_more_around_are_ten_kelvin_more_everywhere(level: str) -> None:  # noqa: N802
    one, other = (td.steady(deck(level), td.Scenario("x", boundaries={"cv": f"{t} [degC]"})) for t in (24, 34))
    assert {n: other[n] - one[n] for n in one} == pytest.approx(dict.fromkeys(one, 10.0), abs=1e-9)


def test_H1_humidity_changes_nothing_above_the_dew_point() -> None:  # noqa: N802
    runs = [td.simulate(deck("m_Sd"), BENCH.with_(environment={"cv": td.simulation.Environment(humidity=h)})) for h in (0.1, 0.9)]
    assert np.array_equal(runs[0].temperatures, runs[1].temperatures)
    assert [(r.warnings, r.doubts) for r in runs] == [((), ())] * 2
    assert td.simulate(deck("m_Sd"), BENCH).warnings == ()


def test_H1_what_moist_air_changes_can_be_given() -> None:  # noqa: N802
    """The hook: a coefficient follows a schedule, latent heat is a load. 1 % of the coefficient moves the rise by 1 %."""
    part = deck("EleGFO")
    drier = td.steady(part, BENCH)["case"] - 297.15
    moist = td.steady(part, BENCH.with_(schedule={"skin.effective_htc": "2.222 [W/(m^2 K)]"}))["case"] - 297.15
    assert moist == pytest.approx(drier / 1.01, rel=1e-9)
    wet = td.steady(part, BENCH.with_(loads={"electronics": "2.068 [W]"}))["case"] - 297.15  # a tenth of a watt evaporates
    assert wet == pytest.approx(drier * 2.068 / 2.168, rel=1e-9)


def test_M1_readings_in_sixteenths_give_an_unbiased_fit() -> None:  # noqa: N802
    """24 logs of one part with the DS18B20's steps and little noise: the mean of the fits is the truth within its error."""
    part, truth = deck("EleGFO"), 2.3
    kelvin = td.simulate(part.with_values({"skin.effective_htc": f"{truth} [W/(m^2 K)]"}), BENCH, times=MINUTES)["case"].kelvin
    found = []
    for seed in range(24):
        rng = np.random.default_rng([5, seed])
        celsius = kelvin - 273.15 + rng.uniform(-1 / 32, 1 / 32) + 0.01 * rng.standard_normal(kelvin.size)
        start = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, start="24 [degC]")
        fit = td.calibrate(
            part, log({"case": np.round(celsius * 16) / 16 + 273.15}, 1 / 16 / 12**0.5), ["skin.effective_htc"], scenario=start
        )
        found.append(fit.values.parameters["skin.effective_htc"].value)
    error = np.std(found, ddof=1) / np.sqrt(len(found))
    assert error < 1e-3 * truth
    assert abs(np.mean(found) - truth) < 3 * error


def test_M1_a_room_that_drifts_is_fed_as_it_was() -> None:  # noqa: N802
    """Over 0.7 K of drift: with T_amb(t) the truth comes back, with a constant room it does not."""
    part, truth = deck("ProcSISNAV"), 5.5
    room = 297.15 + 0.7 * MINUTES / MINUTES[-1]
    told = td.Scenario("bench", boundaries={"cv": (MINUTES, td.quantity(room, unit="K"))}, start="24 [degC]", duration="5 [h]")
    kelvin = td.simulate(part.with_values({"skin.effective_htc": f"{truth} [W/(m^2 K)]"}), told, times=MINUTES)["case"].kelvin
    readings = {"case": kelvin + 0.05 * np.random.default_rng(2).standard_normal(kelvin.size)}
    start = td.Scenario("bench", start="24 [degC]")
    fed = td.calibrate(part, log(readings, 0.05, room), ["skin.effective_htc"], scenario=start).values.parameters["skin.effective_htc"]
    blind = td.calibrate(part, log(readings, 0.05), ["skin.effective_htc"], scenario=BENCH).values.parameters["skin.effective_htc"]
    assert abs(fed.value - truth) < 3 * fed.error_random < 0.02
    assert truth - blind.value > 5 * fed.error


def test_B15_a_replaced_gyro_changes_its_block_and_its_foot_alone() -> None:  # noqa: N802
    """The other parts keep their identity and their numbers; a retune of what the new part brought touches three parameters."""
    unit, new = deck("m_IMU"), deck("FOG_l_v2")
    swapped = unit.replace("fog_y", new)
    for part in ("acc", "fog_x", "fog_z"):
        assert swapped.submodel(part).identity() == unit.submodel(part).identity()
    assert swapped.submodel("fog_y").identity() == new.identity() != unit.submodel("fog_y").identity()
    before, after = (td.simulation.compile_network(m).numbers() for m in (unit, swapped))
    moved = {p for p, v in before.values.items() if float(after.values[p]) != float(v)}
    assert moved == {"fog_y.power", "fog_y.mass", "fog_y.electronics.power", "fog_y.case.capacitance"}
    planted = {"fog_y.mass": "0.66 [kg]", "fog_y.skin.effective_htc": "4.4 [W/(m^2 K)]", "fog_foot_conductivity": "2.5 [W/(m K)]"}
    run = td.simulate(swapped.with_values(planted), BENCH, times=MINUTES)
    nodes = ("fog_x.case", "fog_y.case", "fog_z.case", "support")
    fit = td.calibrate(swapped, log({n: run[n].kelvin for n in nodes}, 0.01), list(planted), scenario=BENCH)
    assert {p: v.value for p, v in fit.values.parameters.items()} == pytest.approx(
        {"fog_y.mass": 0.66, "fog_y.skin.effective_htc": 4.4, "fog_foot_conductivity": 2.5}, rel=0.01
    )
