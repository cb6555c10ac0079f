"""What a log can tell, before and after a fit: laws that bind parameters, groups that this log hardly separates, errors, causes, cures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError
from thermid.campaign.stages import survey
from thermid.fit.calibration import percent
from unit.fit.bench import AREA, HTC, MASS, box, log, metered, pair
from unit.fit.project import make_project

ROOM = {"air": "24 [degC]"}


def two(kind: str, side_by_side: bool) -> td.Model:
    """A case with two ways out, side by side or one behind the other."""
    ends = (("case", "air"), ("case", "air")) if side_by_side else (("case", "mid"), ("mid", "air"))
    value = "0.5 [W/K]" if kind == "conductance" else "2 [K/W]"
    deck: dict[str, Any] = {
        "title": "Two",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "500 [J/K]"}} | ({} if side_by_side else {"mid": {}}),
        "conductors": {n: {"kind": "conduction", "between": list(e), kind: value} for n, e in zip("ab", ends, strict=True)},
        "loads": {"heat": {"into": "case", "power": "4 [W]"}},
    }
    return td.model_from_dict(deck)


class TestLaws:
    @pytest.mark.parametrize(
        ("kind", "side_by_side", "form", "text"),
        [
            ("conductance", True, "sum", "a.conductance + b.conductance"),
            ("conductance", False, "series", "1/a.conductance + 1/b.conductance"),
            ("resistance", True, "series", "1/a.resistance + 1/b.resistance"),
            ("resistance", False, "sum", "a.resistance + b.resistance"),
        ],
    )
    def test_two_ways_out(self, kind: str, side_by_side: bool, form: str, text: str) -> None:
        # both start alike, where a sum and a product have the same derivatives
        model, free = two(kind, side_by_side), [f"a.{kind}", f"b.{kind}"]
        scenario = td.Scenario("bench", boundaries=ROOM, start="24 [degC]", duration="5 [h]")
        found = td.identifiability(model, free=free, scenario=scenario, sensors={"case": "0.1 [K]"})
        (group,) = found.groups
        (known,) = group.known
        assert (group.structural, group.form, known.text) == (True, form, text)
        alone = td.identifiability(model, free=free[:1], scenario=scenario, sensors={"case": "0.1 [K]"})[free[0]]
        size = alone.error if form == "sum" else alone.error / alone.value**2
        assert known.error == pytest.approx(size, rel=1e-4)
        with pytest.raises(IdentificationError, match=r"'a\.\w+' and 'b\.\w+' "):
            td.calibrate(model, td.Record.from_arrays("r", *_reading(model, scenario)), free, scenario=scenario)

    def test_a_joint_with_a_gap_has_a_direction_that_follows_no_simple_law(self) -> None:
        # two boxes of one kind stay alike, so no heat crosses the joint: what leaves one box is all that shows
        model = pair({"joints/stack/gap": {"area": "30 [cm^2]", "htc": "4 [W/(m^2 K)]", "to": "room"}})
        free = ["stack.contact_conductance", "stack.gap.htc", "a.skin.effective_htc"]
        scenario = td.Scenario("bench", boundaries={"room": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
        found = td.identifiability(model, free=free, scenario=scenario, sensors={"a.case": "0.05 [K]", "b.case": "0.05 [K]"})
        assert found.rank == 1
        assert found.structural[0].form == "mixture"

    def test_an_accident_of_the_start_is_no_law(self) -> None:
        # at rest, with the box as warm as the room, the coefficient does nothing at the start values and much at others
        scenario = td.Scenario("rest", boundaries=ROOM, start="24 [degC]", duration="2 [h]")
        found = td.identifiability(box(), free=["power", HTC], scenario=scenario, sensors={"case": "0.1 [K]"})
        assert found.structural == ()

    def test_one_that_no_reading_sees(self) -> None:
        data = metered(log(box(), {}, {"T": "case"}, samples=51), "heat", 4.0)
        found = td.identifiability(box(), data, ["power", HTC])
        assert found.structural[0].form == "unseen"
        assert "'power'" in str(found)
        assert found["power"].relative == np.inf
        assert found[HTC].relative < 0.01


def _reading(model: td.Model, scenario: td.Scenario) -> tuple[np.ndarray, dict[str, td.Channel]]:
    run = td.simulate(model, scenario)
    return run.times, {"T": td.Channel.from_array("T", run["case"].kelvin, unit="K", role="node", target="case", noise=0.1)}


class TestThisLog:
    def test_a_short_log_hardly_separates_mass_and_loss(self) -> None:
        data = log(box(), {}, {"T": "case"}, hours=0.25, samples=41, noise=0.1)
        found = td.identifiability(box(), data, [HTC, MASS])
        (group,) = found.practical
        assert set(group.names) == {HTC, MASS}
        assert not group.structural
        assert f"'{HTC}' and '{MASS}' " in str(found)
        assert found[HTC].relative > 0.1
        assert f"'{MASS}' to 5 %" in str(found)
        long = td.identifiability(box(), log(box(), {}, {"T": "case"}, hours=5, samples=41, noise=0.1), [HTC, MASS])
        assert (long.practical, long.cures) == ((), ())

    def test_errors_before_are_those_after(self) -> None:
        data = log(box(), {}, {"T": "case"}, samples=101, noise=0.1, accuracy=0.3)
        before = td.identifiability(box(), data, [HTC, MASS])
        fit = td.calibrate(box(), data, [HTC, MASS])
        after = td.identifiability(fit)
        assert (before.stage, after.stage) == ("before", "after")
        for path in (HTC, MASS):
            assert before[path].relative == pytest.approx(fit[path].error / fit[path].value, rel=0.1)
            assert after[path].error == pytest.approx(fit[path].error, rel=0.02)
        assert after[HTC].limit == "sensor T"

    def test_a_planned_test_says_what_the_same_log_says(self) -> None:
        scenario = td.Scenario("bench", boundaries=ROOM, duration="5 [h]")
        sensors = {"case": {"noise": "0.1 [K]", "accuracy": "0.3 [K]", "name": "T"}, "heat": {"accuracy": "0.1 [W]"}}
        planned = td.identifiability(box(), free=[HTC, MASS], scenario=scenario, sensors=sensors, every="3 [min]")
        data = metered(log(box(), {}, {"T": "case"}, samples=101, noise=0.1, accuracy=0.3, swing=0.0), "heat", 4.0, accuracy=0.1)
        logged = td.identifiability(box(), data, [HTC, MASS])
        for path in (HTC, MASS):
            assert planned[path].relative == pytest.approx(logged[path].relative, rel=0.05)
        assert planned[MASS].limit == "heat error"
        assert "mainly from the accuracy of heat" in str(planned)

    def test_as_plain_data(self) -> None:
        data = log(box(), {}, {"T": "case"}, samples=51)
        told = td.identifiability(box(), data, [HTC, AREA]).to_dict()
        assert (told["rank"], told["free"]) == (1, 2)
        (group,) = told["groups"]
        assert group["structural"]
        assert group["known"][0]["formula"] == f"{HTC}*{AREA}"
        assert group["known"][0]["value"] == pytest.approx(0.3)


class TestAsked:
    def test_nothing_free_and_nothing_measured(self) -> None:
        with raises_code("fit.nothing-free", IdentificationError):
            td.identifiability(box())
        with raises_code("value.incomplete", IdentificationError):
            td.identifiability(box(), free=[HTC])

    def test_sensors(self) -> None:
        scenario = td.Scenario("bench", boundaries=ROOM, duration="5 [h]")
        with raises_code("value.incomplete", IdentificationError, match=r"sensors\.case"):
            td.identifiability(box(), free=[HTC], scenario=scenario, sensors={"case": {"accuracy": "1 [K]"}})
        with raises_code("name.unknown", IdentificationError, match="'noise'"):
            td.identifiability(box(), free=[HTC], scenario=scenario, sensors={"case": {"nois": "1 [K]"}})
        with raises_code("value.incomplete", IdentificationError):
            td.identifiability(box(), free=[HTC], scenario=scenario, sensors={"air": {"noise": "1 [K]"}})

    def test_words_of_errors(self) -> None:
        assert [percent(x) for x in (0.00073, 0.05, 2.0, 5.0, np.inf)] == ["0.073 %", "5 %", "200 %", "a factor of 5", "unlimited"]


def test_every_stage_of_a_campaign(tmp_path) -> None:  # type: ignore[no-untyped-def]
    campaign = make_project(tmp_path)
    found = survey(campaign)
    assert list(found) == ["box", "pair"]
    assert found["box"].stage == "before"
    (only,) = survey(campaign, "pair", after=True).values()
    assert only.stage == "after"
    assert only["stack.contact_conductance"].value == pytest.approx(150.0, rel=0.1)
    with raises_code("name.unknown", match="'pear'.*'pair'"):
        survey(campaign, "pear")
