"""An effective coefficient taken apart: feasible, infeasible, against a hidden truth, and by a second record at low pressure."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, IdentificationError
from thermid.measure.records import Channel, Record
from thermid.model._tree.identity import to_dict
from thermid.model.tree import StatedRange
from thermid.physics.finishes import FINISHES, Finish
from thermid.physics.radiation import linearised_htc

BENCH = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="air", duration="5 [h]")
MACHINED = "aluminium, machined"


def log_sd(finish: Finish) -> float:
    """Standard deviation of the logarithm: the range holds 95 %. [-]"""
    return StatedRange(finish.low, finish.high).log_sd(finish.typical)


def part(area: str, htc: Any, power: str, finish: str = MACHINED, capacitance: str = "700 [J/K]") -> td.Model:
    """A part with one surface; `htc` is an effective value, or what a surface has in its place."""
    surface = {"of": "case", "to": "air", "area": area} | (htc if isinstance(htc, dict) else {"effective_htc": htc})
    return td.model_from_dict(
        {
            "title": "Part",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": capacitance}},
            "surfaces": {"skin": surface | ({"finish": finish} if finish else {})},
            "loads": {"heat": {"into": "case", "power": power}},
        }
    )


def elegfo(finish: str) -> td.Model:
    return part("0.082241 [m^2]", "2.2 [W/(m^2 K)]", "2.168 [W]", finish)


def log_of(truth: td.Model, bench: td.Scenario, seed: int, sensor: float = 0.1, noise: float = 0.05) -> Record:
    """A log of a hidden truth: the same thermometer every time, with a constant error that it keeps."""
    seen = td.simulate(truth, bench, every="2 [min]")
    rng = np.random.default_rng(seed)
    readings = seen["case"].kelvin + 0.8 * sensor + noise * rng.standard_normal(seen.times.size)
    channel = Channel.from_array("T", readings, unit="K", role="node", target="case", noise=noise, accuracy=sensor)
    return Record.from_arrays(bench.title, seen.times, {"T": channel})


def half_width(values: Any, model: td.Model, bench: td.Scenario, truth: float) -> float:
    """Half of what holds 95 % of the predictions at the end, over the rise; the truth must lie inside."""
    draws = {k: np.minimum(v, 1.0) if k.endswith("emissivity") else v for k, v in values.draws(1000, seed=1).items()}
    found = td.ensemble(model, bench, draws, times=[0.0, bench.seconds])
    low, middle, high = found.quantile("case", (0.025, 0.5, 0.975))[:, -1]
    assert low < truth < high
    return float((high - low) / 2 / (middle - 297.15))


def test_a_painted_elegfo_is_refused_with_its_suspects() -> None:
    """The document's 2.2 W/(m^2 K) leaves no room for the radiation of paint."""
    with pytest.raises(IdentificationError, match=r"'skin' .* 2\.2 W.*'paint, white'.* 0\.0321 m\^2 .* 5\.56 W ") as refusal:
        td.inference.split(elegfo("paint, white"), conditions=BENCH)
    # at the rise of the fit a surface of 0.84 radiates 5.2 and gas at rest conducts 0.3: the area would have to be 40 % of what it is
    assert "0.032" in str(refusal.value)


def test_a_bare_elegfo_is_split_and_its_convection_named_as_too_low() -> None:
    found = td.inference.split(elegfo(MACHINED), conditions=BENCH)["skin"]
    assert found.radiative + found.convective == pytest.approx(2.2)
    assert found.radiative == pytest.approx(float(linearised_htc(found.emissivity, found.surface, found.gas)))
    assert not found.used
    assert re.search(r"\d", found.remark)
    assert found.floor < found.convective < 0.6 * found.expected


def test_prior_and_correlation_meet_by_their_errors() -> None:
    """One surface: the maximum over a grid of both densities, and a narrower emissivity than the finish alone has."""
    model = part("0.00420536 [m^2]", "6 [W/(m^2 K)]", "0.225 [W]", "stainless steel, machined")
    found = td.inference.split(model, "skin", BENCH)
    one, finish = found["skin"], FINISHES["stainless steel, machined"]
    z = np.linspace(math.log(0.05), math.log(0.6), 20001)
    black = one.radiative / one.emissivity
    cost = ((z - math.log(finish.typical)) / log_sd(finish)) ** 2 + ((6.0 - black * np.exp(z) - one.expected) / (0.25 * one.expected)) ** 2
    assert one.emissivity == pytest.approx(float(np.exp(z[cost.argmin()])), rel=2e-3)
    assert one.used
    assert one.emissivity_error < log_sd(finish) * one.emissivity
    assert one.correlation == -1.0  # of two parts with a known sum
    assert found.model.at("skin.emissivity").expression.literal.value == pytest.approx(one.emissivity)


def test_a_spread_of_an_emissivity_is_its_prior_as_that_of_a_finish_is() -> None:
    """It was taken as exact: the split moved none of it."""
    finish = FINISHES["stainless steel, machined"]
    made = part("0.00420536 [m^2]", "6 [W/(m^2 K)]", "0.225 [W]", "stainless steel, machined")
    deck = to_dict(made)
    deck["surfaces"]["skin"].pop("finish")
    deck["surfaces"]["skin"]["emissivity"] = {"value": finish.typical, "spread": f"{100.0 * log_sd(finish)!r} [%]"}
    found = td.inference.split(td.model_from_dict(deck), conditions=BENCH)["skin"]
    assert found.emissivity == pytest.approx(td.inference.split(made, conditions=BENCH)["skin"].emissivity, rel=1e-3)


def test_the_floor_cuts_off_what_leaves_less_than_gas_at_rest() -> None:
    """Oxidised aluminium on a coefficient that hardly holds it: the emissivity is pushed below the finish's typical value."""
    found = td.inference.split(part("0.01 [m^2]", "2.3 [W/(m^2 K)]", "0.3 [W]", "aluminium, oxidised"), conditions=BENCH)["skin"]
    assert found.emissivity < FINISHES["aluminium, oxidised"].typical
    assert found.convective > found.floor


def test_surfaces_of_one_finish_are_alike_in_part() -> None:
    deck = to_dict(elegfo(MACHINED))
    deck["surfaces"]["other"] = dict(deck["surfaces"]["skin"])
    found = td.inference.split(td.model_from_dict(deck), conditions=BENCH).values
    assert list(found) == ["skin.emissivity", "other.emissivity"]
    assert found.covariance[0, 1] / found.covariance[0, 0] == pytest.approx(0.5, abs=0.05)


def test_nothing_is_split_without_knowing_the_surface_or_the_conditions() -> None:
    with raises_code("value.incomplete", IdentificationError, match="'skin'"):
        td.inference.split(elegfo(""), conditions=BENCH)
    with raises_code("value.incomplete", IdentificationError):
        td.inference.split(elegfo(MACHINED))
    with raises_code("name.unknown", IdentificationError, match="'skn'"):
        td.inference.split(elegfo(MACHINED), "skn", BENCH)
    with raises_code("fit.not-determined", IdentificationError, match=r"0\.2"):
        td.inference.split(part("0.1 [m^2]", "5 [W/(m^2 K)]", "0.01 [W]"), conditions=BENCH)
    with raises_code("fit.not-determined", IdentificationError):
        td.inference.split(part("0.1 [m^2]", {"htc": "5 [W/(m^2 K)]"}, "1 [W]"), conditions=BENCH)


def test_a_callers_prior_stands_in_place_of_the_finish() -> None:
    forms: tuple[Any, ...] = (("0.06", "5 [%]"), ("6 [%]", "0.003"), {"mean": 0.06, "sd": td.quantity(5, unit="%")}, (0.06, 0.003))
    for prior in forms:
        found = td.inference.split(elegfo(MACHINED), conditions=BENCH, priors={"skin.emissivity": prior})["skin"]
        assert found.emissivity_error == pytest.approx(0.003, rel=0.05), prior
    assert found.emissivity == pytest.approx(0.06, rel=0.01)
    assert found.emissivity_error == pytest.approx(0.003, rel=0.05)
    with raises_code("value.outside-range", IdentificationError, match=r"1\.2.*0\.1"):
        td.inference.split(elegfo(MACHINED), conditions=BENCH, priors={"skin.emissivity": (1.2, 0.1)})
    with raises_code("value.wrong-kind", IdentificationError):
        td.inference.split(elegfo(MACHINED), conditions=BENCH, priors={"skin.emissivity": "0.06"})


HIDDEN = part("0.03 [m^2]", {"htc": {"coefficient": "2.4 [W/(m^2 K)]", "exponent": 0.25}, "emissivity": 0.86}, "2.5 [W]", "")


def test_fitted_in_air_the_hidden_vacuum_is_contained() -> None:
    """A painted box whose convection lies 15 % below the correlation: half-width at most a quarter of the rise, by the finish alone."""
    model = part("0.03 [m^2]", "8 [W/(m^2 K)]", "2.5 [W]", "plastic")
    fit = td.calibrate(model, log_of(HIDDEN, BENCH, 3), ["skin.effective_htc", "case.capacitance"], scenario=BENCH)
    found = td.inference.split(fit)
    assert list(found.values) == ["skin.effective_htc", "case.capacitance", "skin.emissivity"]
    assert found["skin"].effective_error > 0
    assert "'case.capacitance'" in found.caution
    assert str(found).endswith(found.caution)
    assert td.inference.split(td.calibrate(model, log_of(HIDDEN, BENCH, 3), ["skin.effective_htc"], scenario=BENCH)).caution == ""
    far = BENCH.vacuum().with_(duration="40 [h]")
    truth = td.simulate(HIDDEN, far)["case"].kelvin[-1]
    assert half_width(found.values, found.model, far, truth) < 0.25


def test_a_prediction_without_gas_splits_by_itself() -> None:
    """`predict` of a fit in air: the band holds the hidden truth, whose radiation stands in the law of the surface."""
    model = part("0.03 [m^2]", "8 [W/(m^2 K)]", "2.5 [W]", "plastic")
    fit = td.calibrate(model, log_of(HIDDEN, BENCH, 3), ["skin.effective_htc", "case.capacitance"], scenario=BENCH)
    far = BENCH.vacuum().with_(duration="40 [h]")
    found = td.predict(fit, far)
    truth = td.simulate(HIDDEN, far)["case"].kelvin[-1]
    band = found["case"]
    another = 'source = "measured"'
    assert any(another in w for w in found.warnings)
    low, high = (end[-1] for end in band.interval())
    assert low < truth - 273.15 < high
    # one deck in five states another finish than its part has: that counts until the emissivity is measured
    measured = {"effective_htc": "8 [W/(m^2 K)]", "emissivity": {"value": 0.9, "source": "measured", "basis": "emissometer"}}
    known = td.calibrate(
        part("0.03 [m^2]", measured, "2.5 [W]", ""), log_of(HIDDEN, BENCH, 3), ["skin.effective_htc", "case.capacitance"], scenario=BENCH
    )
    sure = td.predict(known, far)
    assert not any(another in w for w in sure.warnings)
    band = sure["case"]
    sd = float(band.error[-1])
    assert abs(float(band.kelvin[-1]) - truth) < 2 * sd < 0.5 * (truth - 297.15)
    painted = part("0.08 [m^2]", "2.2 [W/(m^2 K)]", "2.5 [W]", "paint, white")
    cool = part("0.08 [m^2]", {"htc": "2.2 [W/(m^2 K)]"}, "2.5 [W]", "")
    doubtful = td.calibrate(painted, log_of(cool, BENCH, 3), ["skin.effective_htc"], scenario=BENCH)
    assert td.predict(doubtful, far)["case"].error[-1] > 0.0


def test_a_second_record_without_gas_overrides_the_finish() -> None:
    """Both fitted together: the finish hardly matters then, and the split hands on what was fitted."""
    empty = BENCH.vacuum().with_(title="pumped", duration="8 [h]")
    records = [log_of(HIDDEN, BENCH, 3), log_of(HIDDEN, empty, 4)]
    scenarios = {"bench": BENCH, empty.title: empty}
    far = BENCH.vacuum().with_(duration="40 [h]")
    truth = td.simulate(HIDDEN, far)["case"].kelvin[-1]
    lawful = part("0.03 [m^2]", {"htc": {"coefficient": "3 [W/(m^2 K)]", "exponent": 0.25}}, "2.5 [W]", "paint, any non-metallic")
    fit = td.calibrate(lawful, records, ["skin.htc.coefficient", "case.capacitance", "skin.emissivity"], scenario=scenarios)
    assert half_width(fit.values, fit.model, far, truth) < 0.10
    # a constant coefficient is not what the air does: the fit says so, and the emissivity is near all the same
    constant = part("0.03 [m^2]", "8 [W/(m^2 K)]", "2.5 [W]", "paint, any non-metallic")
    fit = td.calibrate(constant, records, ["skin.effective_htc", "case.capacitance", "skin.emissivity"], scenario=scenarios)
    assert all(sensor.wanders for sensor in fit.sensors.values())
    found = td.inference.split(fit)
    assert found["skin"].prior == "fitted"
    assert found["skin"].emissivity == fit.values["skin.emissivity"].value == pytest.approx(0.86, rel=0.01)
    assert found.values.covariance == pytest.approx(fit.values.bare().covariance)


def test_a_freed_emissivity_brings_the_prior_of_its_finish() -> None:
    """Convection as a power law, and radiation by finish: the fit itself splits, and says how far the log moved the emissivity."""
    model = part("0.03 [m^2]", {"htc": {"coefficient": "3 [W/(m^2 K)]", "exponent": 0.25}}, "2.5 [W]", "plastic")
    fit = td.calibrate(model, log_of(HIDDEN, BENCH, 3), ["skin.htc.coefficient", "skin.emissivity", "case.capacitance"], scenario=BENCH)
    found, finish = fit["skin.emissivity"], FINISHES["plastic"]
    assert found.prior == (pytest.approx(math.log(finish.typical)), pytest.approx(log_sd(finish)))
    assert found.error <= log_sd(finish) * found.value * 1.01


def test_every_finish_lies_in_its_range_and_names_its_source() -> None:
    for name, one in FINISHES.items():
        assert 0.0 < one.low < one.typical < one.high <= 1.0, name
        assert one.source, name


def test_a_finish_gives_the_emissivity_and_survives_saving(tmp_path: Any) -> None:
    model = elegfo("paint, white")
    assert model.at("skin.emissivity").expression.literal.value == FINISHES["paint, white"].typical
    assert "0.84 to 0.93" in model.at("skin.emissivity").basis
    td.save_model(model, tmp_path / "a.toml")
    assert "emissivity" not in (tmp_path / "a.toml").read_text(encoding="utf-8")
    assert td.load_model(tmp_path / "a.toml").identity() == model.identity()
    own = model.with_values({"skin.emissivity": 0.87})
    td.save_model(own, tmp_path / "b.toml")
    again = td.load_model(tmp_path / "b.toml")
    assert again.at("skin.emissivity").expression.literal.value == 0.87
    assert again.surfaces["skin"].finish == "paint, white"


def test_an_unknown_finish_is_refused_with_the_nearest() -> None:
    with raises_code("name.unknown", DeckError, match=r"surfaces\.skin\.finish.*'paint, whit'.*'paint, white'"):
        elegfo("paint, whit")
    with raises_code("name.unknown", DeckError, match="'aluminium, polished'"):
        elegfo("aluminium")


@pytest.mark.parametrize(("emissivity", "rise"), [(0.3, 26.274), (0.85, 10.055)])
def test_v2_the_accelerometer_in_vacuum_settles_by_radiation(emissivity: float, rise: float) -> None:
    model = part("0.00420536 [m^2]", {"effective_htc": "6 [W/(m^2 K)]", "emissivity": emissivity}, "0.225 [W]", "")
    assert td.steady(model, BENCH.vacuum())["case"] - 297.15 == pytest.approx(rise, abs=1e-3)
