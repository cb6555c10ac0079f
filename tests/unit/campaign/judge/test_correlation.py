"""Criteria and gates on deviations whose size is known."""

from __future__ import annotations

import re

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError, NameNotFoundError, RecordError, ScenarioError
from thermid.campaign._judge.correlation import Exclusions, Overlay, correlate
from thermid.campaign._judge.verdict import CRITERIA, Criteria
from unit.qualify.things import soak, unit

TIMES = np.arange(0.0, 7200.1, 60.0)
SETTLED = {"hot": [(3600.0, 7200.0)]}


def seen(*shifts: float, case: str = "hot") -> list[Overlay]:
    """Sensors that read so much more than is simulated."""
    base = 300.0 + 10.0 * (1 - np.exp(-TIMES / 900.0))
    return [Overlay(case, f"T{k}", "", TIMES, base + shift, base, 0.3) for k, shift in enumerate(shifts, 1)]


def gates(found, kind: str = "steady") -> dict[str, object]:
    return {g.criterion: g for g in found.gates if g.kind == kind}


def test_bias_and_spread_are_told_apart() -> None:
    """A common shift is all mean and no spread; opposite shifts are all spread and no mean."""
    common = gates(correlate(seen(1.5, 1.5, 1.5), steady=SETTLED))
    assert (common["mean"].found, common["spread"].found) == (pytest.approx(1.5), pytest.approx(0.0, abs=1e-9))
    opposite = gates(correlate(seen(-2.0, 2.0), steady=SETTLED))
    assert (opposite["mean"].found, opposite["spread"].found) == (pytest.approx(0.0, abs=1e-9), pytest.approx(2.0))


@pytest.mark.parametrize(
    ("shifts", "failed"),
    [
        ((2.1, 2.1, 2.1), {"mean"}),
        ((1.9, 1.9, 1.9), set()),
        ((-3.2, 3.2), {"spread"}),
        ((5.2, 0.0, 0.0, 0.0), {"each"}),
        ((9.0, 0.0, -1.0), {"mean", "spread", "each"}),
    ],
)
def test_the_gate_that_failed_is_named(shifts: tuple[float, ...], failed: set[str]) -> None:
    found = correlate(seen(*shifts), ["ECSS"], steady=SETTLED)
    assert {g.criterion for g in found.failed} == failed
    assert found.passed("ECSS") is (not failed)


def test_several_sets_at_once_each_with_its_verdict() -> None:
    own = Criteria("ours", each=1.0, kinds=("steady", "transient"))
    found = correlate(seen(2.5, 0.5, -1.5), ["ECSS", "MIL-HDBK-340", own], steady=SETTLED)
    assert found.verdicts == {"ECSS": True, "MIL-HDBK-340": True, "ours": False}
    assert {g.kind for g in found.failed} == {"steady", "transient"}
    (steady,) = (g for g in found.failed if g.kind == "steady")
    assert steady.sensor == "T1"
    assert steady.outside == ("T1", "T3")
    assert "NOT met" in str(found)
    assert str(found).index("NOT met") < str(found).index("T1, steady: measured"), "the verdict comes before what it rests on"


def test_a_case_too_warm_does_not_make_up_for_one_too_cold() -> None:
    found = correlate([*seen(2.5, 2.5), *seen(-2.5, -2.5, case="cold")], ["ECSS"], steady=SETTLED | {"cold": [(3600.0, 7200.0)]})
    assert [(g.case.split(",")[0], g.criterion) for g in found.failed] == [("hot", "mean"), ("cold", "mean")]


def test_weights_move_the_mean() -> None:
    """(3 x 2.5 + 0.1) / 4 = 1.9."""
    found = gates(correlate(seen(2.5, 0.1), steady=SETTLED, weights={"T1": 3.0}))
    assert found["mean"].found == pytest.approx(1.9)


def test_a_part_of_the_sensors_may_lie_outside_where_the_set_says_so() -> None:
    most = Criteria("most", each=1.0, share=0.75)
    assert correlate(seen(2.0, 0.0, 0.0, 0.0), [most], steady=SETTLED).passed("most")
    assert not correlate(seen(2.0, 2.0, 0.0, 0.0), [most], steady=SETTLED).passed("most")


def test_an_exclusion_needs_a_reason_and_room_under_the_cap() -> None:
    bad = seen(9.0, 0.1, 0.2, -0.1)
    found = correlate(bad, steady=SETTLED, exclusions=Exclusions({"T1": "came off the wall at 0.3 h"}, 0.25))
    assert found.passed("ECSS")
    assert [d.excluded for d in found.deviations if d.sensor == "T1"] == ["came off the wall at 0.3 h"] * 2
    for reasons, cap, code, match in (
        ({"T1": " "}, 0.5, "verdict.criteria", ""),
        ({"T1": "loose", "T2": "loose"}, 0.25, "verdict.criteria", "2 of 4.*25 %"),
        ({"T9": "loose"}, 0.5, "name.unknown", "'T9'"),
    ):
        with raises_code(code, IdentificationError, match=match):
            correlate(bad, steady=SETTLED, exclusions=Exclusions(reasons, cap))


def test_a_limit_from_memory_decides_nothing() -> None:
    heard = Criteria("heard", each=1.0, mark="memory")
    found = correlate(seen(2.0, 0.0), [heard], steady=SETTLED)
    assert found.passed("heard") is None
    assert found.failed == ()
    assert re.search(r"limit 1 K \[memory\], 1 of 2 ", str(found))


def test_a_criterion_without_data_is_refused() -> None:
    with raises_code("verdict.criteria", IdentificationError, match="'ECSS'"):
        correlate(seen(0.1), ["ECSS"])
    with raises_code("record.nothing-there", IdentificationError, match="'T1'"):
        correlate(seen(0.1), ["ECSS"], steady={"hot": [(9000.0, 9900.0)]})
    with raises_code("name.unknown", IdentificationError, match="'hott'"):
        correlate(seen(0.1), ["ECSS"], steady={"hott": [(0.0, 9900.0)]})
    with raises_code("record.nothing-there", IdentificationError):
        correlate([], ["ECSS"])


def test_words_that_mean_nothing_are_refused() -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'ECSS'"):
        correlate(seen(0.1), ["ECS"], steady=SETTLED)
    with raises_code("name.unknown", NameNotFoundError, match="'MIL'"):
        correlate(seen(0.1), steady=SETTLED).passed("MIL")
    with raises_code("value.outside-range", IdentificationError):
        correlate(seen(0.1), steady=SETTLED, weights={"T1": 0.0})
    for table, code, match in (
        ({}, "value.incomplete", ""),
        ({"each": "1 [K]", "kinds": ["stedy"]}, "name.unknown", r"'steady'\?"),
        ({"eech": "1 [K]"}, "name.unknown", r"'each'\?"),
        ({"each": "1 [K]", "share": 0.0}, "value.outside-range", ""),
        ({"each": "1 [K]", "mark": "heard"}, "name.unknown", ""),
    ):
        with raises_code(code, ScenarioError, match=match):
            Criteria.read(table, "plan.toml", "ours")
    assert Criteria.read({"mean": "1.5 [K]", "kinds": ["transient"]}, "plan.toml", "ours").limits == {"mean": 1.5}


def test_published_sets_carry_their_marks() -> None:
    assert CRITERIA["ECSS"].limits == {"mean": 2.0, "spread": 3.0, "each": 5.0}
    assert CRITERIA["ECSS"].mark == "secondary"
    assert CRITERIA["MIL-HDBK-340"].mark == "read"
    assert all(c.source for c in CRITERIA.values())


def test_a_model_beside_a_record() -> None:
    run = td.simulate(unit().with_values({"out.conductance": "1.0 [W/K]"}), soak(), times=TIMES)
    made = {n: td.Channel.from_array(n, run[n].kelvin, unit="K", role="node", target=n, accuracy=0.3) for n in ("proc", "ele")}
    told = td.compare(unit(), td.Record.from_arrays("hot", TIMES, made), scenario=soak(hours=2.0))
    found = correlate(told, ["ECSS"], steady=SETTLED)
    assert {o.node for o in found.overlays} == {"proc", "ele"}
    own = td.simulate(unit(), soak(hours=2.0), times=TIMES)
    assert all(np.allclose(o.simulated, own[o.node].kelvin, atol=1e-4) for o in found.overlays)
    assert {o.accuracy for o in found.overlays} == {0.3}


def test_two_logs_must_share_columns_and_times() -> None:
    one = td.Record.from_arrays("measured", TIMES, {"T1": TIMES * 0 + 300.0}, unit="K")
    with raises_code("record.not-overlapping", RecordError, match="T2"):
        correlate((one, td.Record.from_arrays("simulated", TIMES, {"T2": TIMES * 0 + 300.0}, unit="K")), steady=SETTLED)
    short = td.Record.from_arrays("simulated", TIMES[:50], {"T1": TIMES[:50] * 0 + 300.0}, unit="K")
    with raises_code("record.not-overlapping", RecordError):
        correlate((one, short), steady=SETTLED)


def test_a_stretch_named_steady_in_which_a_sensor_drifts_is_remarked_on_with_the_drift() -> None:
    noise = np.random.default_rng(7).normal(0.0, 0.3, TIMES.size)
    for rate, drifts in ((3.2, True), (0.3, False)):
        readings = 348.45 + rate * (TIMES - 3600.0) / 3600.0
        found = correlate([Overlay("hot", n, "", TIMES, readings + x, readings) for n, x in (("T1", 0.0), ("T2", noise))], steady=SETTLED)
        if drifts:
            (remark,) = found.remarks
            assert re.search(r"'T1' .* 75\.3 .* 78\.5 degC, \+3\.2 K/h, .*1 ", remark) or "'T2'" in remark
            assert f"remark: {remark}" in str(found)
        assert found.to_dict()["remarks"] == list(found.remarks)
        assert bool(found.remarks) == drifts
