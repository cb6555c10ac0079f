"""Assumed values through a fit: a spread of one cancels where the fit pins the answer, and opens where it does not. Synthetic records."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.fit.calibration import Calibration
from thermid.measure.records import Channel, Record
from thermid.prediction._budget import followed_by
from thermid.prediction._known import Knowledge, known_of
from thermid.values.store import load_values

AREA = {"value": "0.05 [m^2]", "min": 0.03, "max": 0.07, "source": "assumed"}
SKIN = {"of": "case", "to": "air", "area": AREA, "effective_htc": {"value": "6 [W/(m^2 K)]", "min": 0.5, "max": 40}}


def box(watts: str = "4 [W]", lid: str = "0.05 [W/K]") -> td.Model:
    return td.model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": "600 [J/K]"}, "lid": {"capacitance": {"value": "200 [J/K]", "source": "assumed"}}},
            "surfaces": {"skin": SKIN},
            "conductors": {
                "seal": {
                    "kind": "conduction",
                    "between": ["case", "lid"],
                    "conductance": {"value": lid, "min": 0.01, "max": 1, "source": "assumed"},
                }
            },
            "loads": {"heat": {"into": "case", "power": watts}},
        }
    )


def log(model: td.Model, synthetic: bool = True) -> Record:
    rng, times = np.random.default_rng(3), np.linspace(0.0, 7200.0, 241)
    given = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]", duration="2 [h]")
    run = td.simulate(model, given, times=times)
    reading = Channel.from_array(
        "T", run["case"].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target="case", noise=0.05
    )
    return Record.from_arrays("bench", times, {"T": reading}, synthetic=synthetic)


@pytest.fixture(scope="module")
def found() -> Calibration:
    hidden = box().with_values({"skin.effective_htc": "7.5 [W/(m^2 K)]"})
    scenario = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]")
    return td.calibrate(box(), log(hidden), ["skin.effective_htc"], scenario=scenario)


OWN = td.Scenario("own", boundaries={"air": "22 [degC]"}, start="22 [degC]", duration="2 [h]")


def test_in_the_conditions_of_the_fit_a_spread_of_an_assumed_area_widens_a_band_by_at_most_a_tenth(found: Calibration) -> None:
    bare, spread = (td.predict(found, OWN, spread=s)["case"].half_width.max() for s in ({}, {"skin.area": "0.006 [m^2]"}))
    assert spread <= 1.1 * bare
    unsolved = td.predict(Knowledge(found.model), OWN, spread={"skin.area": "0.006 [m^2]"})["case"].half_width.max()
    assert unsolved > 3.0 * bare  # without the fit it would be this


def test_where_the_fit_does_not_pin_the_answer_it_opens(found: Calibration) -> None:
    """The lid's capacitance was hardly seen; with a heated lid its temperature depends on the seal."""
    bare, spread = (td.predict(found, OWN, spread=s)["lid"].half_width.max() for s in ({}, {"seal.conductance": "0.02 [W/K]"}))
    assert spread > 1.7 * bare  # elements depart from run to run as well, and the lid may have a path to the air


def test_the_linear_answer_is_that_of_a_second_fit(found: Calibration) -> None:
    moved = followed_by(Knowledge.of_source(found).discrepancies)["skin.area"]["skin.effective_htc"]
    other = box().with_values({"skin.area": "0.0505 [m^2]"})
    scenario = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]")
    hidden = box().with_values({"skin.effective_htc": "7.5 [W/(m^2 K)]"})
    again = td.calibrate(other, log(hidden), ["skin.effective_htc"], scenario=scenario)
    found_by = np.log(again["skin.effective_htc"].value / found["skin.effective_htc"].value) / 0.0005
    assert moved == pytest.approx(found_by, rel=0.05)


def test_the_first_line_counts_what_is_left_and_names_the_costliest(found: Calibration) -> None:
    told = td.predict(found, OWN)
    (words,) = [x for x in told.left_out if "'seal.conductance'" in x.what]
    assert re.search(r"'seal\.conductance' .*K\); ", words.what), "the costliest, and what to measure"
    (alone,) = [x for x in td.predict(Knowledge(found.model), OWN).left_out if "'seal.conductance'" in x.what]
    assert words.kelvin < alone.kelvin


def test_a_file_says_the_same(found: Calibration, tmp_path: Path) -> None:
    found.save(tmp_path / "box.toml")
    filed = known_of(load_values(tmp_path / "box.toml"), box())
    live, kept = (td.predict(k, OWN, spread={"skin.area": "0.006 [m^2]"})["case"].half_width.max() for k in (found, filed))
    assert kept == pytest.approx(live, rel=1e-6)


def test_below_another_deck_the_names_move_along(found: Calibration, tmp_path: Path) -> None:
    found.save(tmp_path / "box.toml")
    unit = td.model_from_dict({"title": "Unit", "needs": ["air"], "submodels": {"b": {"use": box(), "bind": {"air": "air"}}}})
    known = known_of(load_values(tmp_path / "box.toml"), unit, at="b")
    bare, spread = (td.predict(known, OWN, spread=s)["b.case"].half_width.max() for s in ({}, {"b.skin.area": "0.006 [m^2]"}))
    assert spread <= 1.1 * bare


def test_what_a_scenario_drives_is_left_alone(found: Calibration) -> None:
    course = ([0.0, 7200.0], [0.05, 0.06])
    told = td.predict(found, OWN.with_(schedule={"seal.conductance": course}))
    assert told["case"].final.error > 0.0
    assert not any("seal.conductance" in x.what for x in told.left_out)


STORED = {"value": "600 [J/K]", "min": 450, "max": 750, "source": "assumed"}
CAPACITANCE, HELD = "case.capacitance", ["skin.effective_htc"]


@pytest.fixture(scope="module")
def stored() -> tuple[Calibration, Calibration]:
    """A box whose readings determine an assumed capacitance: fitted with it as it is, and with it free."""
    hidden = box().with_values({"skin.effective_htc": "7.5 [W/(m^2 K)]", CAPACITANCE: "602 [J/K]"})
    model = td.model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": STORED}, "lid": {"capacitance": "200 [J/K]"}},
            "surfaces": {"skin": SKIN},
            "conductors": {"seal": {"kind": "conduction", "between": ["case", "lid"], "conductance": "0.05 [W/K]"}},
            "loads": {"heat": {"into": "case", "power": "4 [W]"}},
        }
    )
    scenario = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]")
    held, free = (td.calibrate(model, log(hidden), names, scenario=scenario) for names in (HELD, [*HELD, CAPACITANCE]))
    return held, free


def test_a_value_that_the_readings_determine_counts_as_if_it_had_been_fitted(stored: tuple[Calibration, Calibration]) -> None:
    held, free = stored
    wide = td.predict(held, OWN, spread={CAPACITANCE: "range"})["case"].half_width.max()
    fitted = td.predict(free, OWN)["case"].half_width.max()
    moved = abs(td.predict(free, OWN)["case"].kelvin - td.predict(held, OWN)["case"].kelvin).max()
    assert wide <= 1.1 * (fitted + 2.0 * moved)
    (variance, shift) = Knowledge.of_source(held).discrepancies[-1].of_assumed[CAPACITANCE]
    assert variance**0.5 == pytest.approx(free[CAPACITANCE].error, rel=0.1)
    assert shift == pytest.approx(free[CAPACITANCE].value - 600.0, rel=0.1)


def test_a_fixed_value_that_the_readings_know_better_than_its_spread_is_named_with_both() -> None:
    """Without a word a fit held an area with its stated spread, where its readings knew it a hundred times better."""
    area = {"value": "0.02 [m^2]", "spread": "0.002 [m^2]"}
    skin = {"of": "case", "to": "air", "area": "area", "effective_htc": "20 [W/(m^2 K)]"}
    deck = {
        "title": "Box",
        "needs": ["air"],
        "parameters": {"area": area},
        "nodes": {"case": {"capacitance": "300 [J/K]"}},
        "surfaces": {"skin": skin},
        "loads": {"heat": {"into": "case", "power": "10 [W]"}},
    }
    model, times = td.model_from_dict(deck), np.arange(0.0, 7200.0, 80.0)
    scenario = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration=float(times[-1]))
    hidden = td.simulate(model.with_values({"area": "0.0204 [m^2]"}), scenario, times=times)["case"].kelvin
    noise = 0.05 * np.random.default_rng(1).standard_normal(times.size)
    bench = Record.from_arrays(
        "bench", times, {"T": Channel.from_array("T", hidden + noise, unit="K", role="node", target="case", noise=0.05)}
    )
    held = td.calibrate(model, bench, ["case.capacitance"], scenario=scenario)
    (remark,) = (w for w in held.warnings if "'area' " in w)
    assert "'area' 0.0204 +- " in remark
    assert " for 0.02 +- 0.0020" in remark


def test_what_the_readings_cannot_separate_keeps_its_spread(found: Calibration) -> None:
    assert "skin.area" not in Knowledge.of_source(found).discrepancies[-1].of_assumed


def test_what_readings_say_of_an_assumed_value_goes_with_the_file(stored: tuple[Calibration, Calibration], tmp_path: Path) -> None:
    held, _ = stored
    held.save(tmp_path / "box.toml")
    unit = td.model_from_dict({"title": "Unit", "needs": ["air"], "submodels": {"b": {"use": held.model, "bind": {"air": "air"}}}})
    live = td.predict(held, OWN, spread={CAPACITANCE: "range"})["case"].half_width.max()
    known = known_of(load_values(tmp_path / "box.toml"), unit, at="b")
    assert td.predict(known, OWN, spread={f"b.{CAPACITANCE}": "range"})["b.case"].half_width.max() == pytest.approx(live, rel=1e-3)


def mounted(gap: str = "0.05 [mm]") -> td.Model:
    """A chip of half a minute on a case by a dry joint, whose gap is assumed; what the chip drives has no thermometer."""
    free = {"min": 1, "max": 50000}
    joint = {"kind": "contact", "between": ["chip", "case"], "area": "6 [cm^2]", "gap": {"value": gap, "source": "assumed"}}
    pad = {"kind": "contact", "between": ["driver", "case"], "area": "2 [cm^2]", "gas": "none"}
    return td.model_from_dict(
        {
            "title": "Mounted",
            "needs": ["air"],
            "nodes": {
                "case": {"capacitance": "900 [J/K]"},
                "chip": {"capacitance": {"value": "40 [J/K]", "min": 10, "max": 90}},
                "driver": {"capacitance": "45 [J/K]"},
            },
            "surfaces": {"skin": SKIN | {"of": "case", "area": "0.05 [m^2]"}},
            "conductors": {
                "joint": joint | {"contact_conductance": {"value": "1200 [W/(m^2 K)]"} | free},
                "pad": pad | {"contact_conductance": {"value": "8000 [W/(m^2 K)]"} | free},
            },
            "loads": {"heat": {"into": "chip", "power": "8 [W]"}, "drive": {"into": "driver", "power": "2 [W]"}},
        }
    )


def test_the_answer_of_a_second_fit_where_a_fast_mass_is_switched() -> None:
    """The joint takes up what is assumed of its gap; derivatives averaged over stretches moved the pad twelve times too far."""
    rng, times = np.random.default_rng(4), np.arange(0.0, 10801.0, 30.0)
    switched = {"times": ["0 [s]", "1200 [s]", "5000 [s]", "7800 [s]"], "hold": True}
    loads = {n: switched | {"values": ["0 [W]", f"{w} [W]", f"{0.2 * w} [W]", f"{w} [W]"]} for n, w in (("heat", 8.0), ("drive", 2.0))}
    given = td.Scenario("bench", boundaries={"air": "22 [degC]"}, start="22 [degC]", loads=loads, duration="3 [h]")
    run = td.simulate(mounted(), given, times=times)
    readings = {
        n: Channel.from_array(n, run[n].kelvin + 0.03 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.03)
        for n in ("case", "chip")
    }
    record = Record.from_arrays("bench", times, readings)
    free = ["joint.contact_conductance", "pad.contact_conductance", "chip.capacitance", "skin.effective_htc"]
    one, other = (
        td.calibrate(mounted(gap), record, free, scenario=given, priors={free[1]: {"sd": "20 [%]"}}) for gap in ("0.05 [mm]", "0.051 [mm]")
    )
    moved = followed_by(Knowledge.of_source(one).discrepancies)["joint.gap"]
    for path in free:
        by_fit = np.log(other[path].value / one[path].value)
        error = one[path].error / one[path].value
        assert 1e-6 * moved[path] == pytest.approx(by_fit, rel=0.1, abs=0.002 * error), path
