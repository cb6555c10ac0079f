"""Are fitted values physical? A good residual with an impossible value is a finding."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError, NameNotFoundError, code_of
from thermid.inference._explain.plausibility import RangeCheck
from unit.fit.bench import AREA, HTC, MASS, box, log, pair

EXAMPLES = Path(__file__).parents[4] / "examples"
JOINT = "stack.contact_conductance"
BARE = {"surfaces/skin/effective_htc": "6 [W/(m^2 K)]", "nodes/case/mass": "1.5 [kg]"}


def fitted(truth: dict[str, str], free: list[str]) -> td.Calibration:
    return td.calibrate(box(BARE), log(box(BARE), truth, {"T": "case"}), free)


class TestCoefficients:
    def test_still_air_and_radiation(self) -> None:
        found = td.inference.plausibility(fitted({HTC: "7 [W/(m^2 K)]"}, [HTC]))[HTC]
        assert found.verdict == "possible"
        assert 2.0 < found.low < 5.0 < 10.0 < found.high < 15.0
        assert "500 cm^2" in str(found)

    def test_too_low_is_an_area_counted_twice(self) -> None:
        found = td.inference.plausibility(fitted({HTC: "1.5 [W/(m^2 K)]"}, [HTC]))
        assert found[HTC].verdict == "not physical"
        assert not found.physical
        assert code_of(found[HTC].meaning) == "fit.below-still-air"
        assert found[HTC].meaning in str(found)

    def test_too_high_is_moving_air_or_a_mount(self) -> None:
        for value, code in (("20 [W/(m^2 K)]", "fit.above-still-air"), ("80 [W/(m^2 K)]", "fit.above-slow-fans")):
            found = td.inference.plausibility(fitted({HTC: value}, [HTC]))[HTC]
            assert found.verdict == "not physical"
            assert code_of(found.meaning) == code
            assert found.meaning in str(found)

    def test_the_gyro_supply_of_the_source_document(self) -> None:
        """2.2 W/(m^2 K) on 822 cm^2, where a box of that shape in still air has about 6.8: its area counts too much (E18)."""
        part = td.load_model(EXAMPLES / "02_stack" / "EleGFO.toml")
        bench = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
        run = td.simulate(part, bench)
        noise = 0.06 * np.random.default_rng(1).standard_normal(run.times.size)
        data = td.Record.from_arrays(
            "bench",
            run.times,
            {
                "T": td.Channel.from_array("T", run["case"].kelvin + noise, unit="K", role="node", target="case", noise=0.06),
                "ROOM": td.Channel.from_array("ROOM", run["air"].kelvin, unit="K", role="boundary", target="air"),
            },
        )
        found = td.inference.plausibility(td.calibrate(part, data, [HTC]))[HTC]
        assert found.verdict == "not physical"
        assert found.low > 2.2
        assert code_of(found.meaning) == "fit.below-still-air"


class TestJoints:
    def test_a_gap_and_a_weld(self) -> None:
        cold = box({"parameters/power/value": "1 [W]", "title": "Cool"})
        model = pair({"joints/stack/contact_conductance": "200 [W/(m^2 K)]"}, second=cold)
        truth = {"possible": 300.0, "not physical": 30.0}
        for verdict, value in truth.items():
            data = log(model, {JOINT: f"{value} [W/(m^2 K)]"}, {"A": "a.case", "B": "b.case"}, boundary="room", noise=0.01)
            found = td.inference.plausibility(td.calibrate(model, data, [JOINT]))[JOINT]
            assert found.verdict == verdict
        assert "A gap of air of 0.8" in str(found)
        assert "IEEE Trans. CPT 28" in str(found)

    def test_doubtful_is_outside_but_not_surely(self) -> None:
        at = RangeCheck("x", 90.0, 8.0, 100.0, 1000.0, "a range", "a book", "It may be.")
        assert at.verdict == "doubtful"
        assert replace(at, error=4.0).verdict == "not physical"
        assert replace(at, value=1010.0).verdict == "doubtful"


class TestMasses:
    def test_a_capacitance_against_a_weight(self) -> None:
        fit = fitted({MASS: "1.7 [kg]"}, [MASS, HTC])
        good = td.inference.plausibility(fit, weights={"case": "1.6 [kg]"})
        assert good[MASS].verdict == "possible"
        heavy = td.inference.plausibility(fit, weights={"case": "0.8 [kg]"})
        assert heavy[MASS].verdict == "not physical"
        assert " 191" in str(heavy)
        assert code_of(heavy[MASS].meaning) == "fit.more-than-its-weight"
        light = td.inference.plausibility(fit, weights={"case": "5 [kg]"})
        assert code_of(light[MASS].meaning) == "fit.less-than-its-weight"

    def test_what_has_no_range_is_said(self) -> None:
        found = td.inference.plausibility(fitted({}, [AREA]))
        assert found.unjudged == (AREA,)
        assert str(found).splitlines()[1].endswith(f" {AREA}")
        with raises_code("name.unknown", NameNotFoundError, match=r"'skin\.area'"):
            found[AREA]


def test_what_is_asked_must_make_sense() -> None:
    fit = fitted({}, [HTC])
    with raises_code("fit.needs-session", IdentificationError):
        td.inference.plausibility(replace(fit, experiments=()))
