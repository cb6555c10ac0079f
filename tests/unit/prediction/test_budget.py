"""Properties of budgets: members and derivatives agree, each source counts once, what is left out is named; and the constants behind."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.fit._error_model import discrepancy
from thermid.prediction import _budget as budget, _predict as predict
from thermid.prediction._budget import UNFITTED, Budget, budget_of, first_line
from thermid.prediction._predict import foresee
from thermid.prediction._setting import Setting, prepared
from thermid.values import _spreads as spreads
from thermid.values.store import LeftOut
from unit.prediction.things import BENCH, CASES, HTC, plate

STATED = {"scale.heat": {"low": 0.8, "high": 1.3}, "air": "2 [K]"}


def budgets(seed: int) -> list[tuple[str, Budget]]:
    """Budgets of the three models with random spreads beside the fits."""
    rng = np.random.default_rng(seed)
    out = []
    for case in CASES.values():
        fit, node = case().fit, case().node
        spread = {
            "air": f"{rng.uniform(0.2, 3.0):.3f} [K]",
            "scale.heat": {"log_sd": float(rng.uniform(0.02, 0.3))},
            f"initial.{node}": {"low": f"{-rng.uniform(0, 4):.3f} [K]", "high": f"{rng.uniform(0, 4):.3f} [K]"},
        }
        for scenario in (case().inside, case().outside):
            out += [(node, own) for _, own in budget_of(fit, scenario.with_(duration="40 [min]"), spread).weighted_ways]
    return out


@pytest.mark.parametrize("seed", [1, 2])
def test_members_are_derivatives_once_all_sources_shrink(seed: int) -> None:
    """A tenth of every source: 300 members have the straight model's mean and width within what their number leaves open."""
    for node, full in budgets(seed):
        small = replace(full, gain=0.1 * full.gain)
        setting = Setting.of_budget(small, prepared(small, times=[1200.0, 2400.0]))
        linear = setting.linear([node])
        drawn = small.drawn(small.numbers(seed, 0, 300))
        actual = setting.temperatures(drawn, [node]).kelvin
        straight = linear.run[node].kelvin[:, None] + linear.columns[node][:-1] @ drawn
        size = straight.std(axis=1)
        assert (size > 0).all()
        # member by member: what bends is of second order, most of all a joint that may lose all of its gas
        assert (np.abs(actual[node] - straight).std(axis=1) < 0.12 * size).all()
        assert straight.mean(axis=1) == pytest.approx(actual[node].mean(axis=1), abs=0.15 * size.max())


@pytest.mark.parametrize("seed", [3])
def test_removing_a_source_takes_its_column_away_and_nothing_else(seed: int) -> None:
    for node, full in budgets(seed):
        setting = Setting.of_budget(full, prepared(full, times=[2400.0]))
        columns = setting.linear([node]).columns[node]
        whole = sum(full.parts(columns).values())
        for k, source in list(enumerate(full.sources))[seed::9]:
            left = full.without([source.name])
            again = Setting.of_budget(left, prepared(left, times=[2400.0])).linear([node]).columns[node]
            others = (np.delete(np.arange(len(full.sources)), k), full.alike[k])
            own = (columns[:, k] * full.sizes[k]) ** 2
            shared = 2.0 * columns[:, k] * full.sizes[k] * ((columns * full.sizes)[:, others[0]] @ others[1][others[0]])
            assert sum(left.parts(again).values())[0] == pytest.approx((whole - own - shared)[0], rel=1e-4, abs=1e-12), source.name


def test_a_source_that_is_left_out_is_gone_from_every_consumer(tmp_path: Path) -> None:
    case = CASES["constant"]()
    fit, node, far = case.fit, case.node, case.outside
    wide = td.predict(fit, far, nodes=[node])[node]
    off = ("structural", "misfit")
    routes = {
        "predict": td.predict(fit, far, nodes=[node], without=off),
        "foresee": foresee(td.design.Knowledge.of_source(fit), far, nodes=[node], without=off).prediction,
    }
    runs = td.qualify.uncertain_runs(fit.model, far, fit, n=400, nodes=[node], without=off)
    for told in routes.values():
        assert told[node].error[-1] < 0.2 * wide.error[-1]
        assert any(x.what == "extrapolation (switched off)" for x in told.left_out)
        assert str(told).splitlines()[0].startswith("not counted: extrapolation (switched off)")
        assert told[node].error[-1] == pytest.approx(runs.node_temperatures(node)[:, -1].std(), rel=0.15)
    assert "not counted: extrapolation (switched off)" in str(td.qualify.hold(runs, {node: "90 [degC]"}))
    assert [x.what for x in runs.left_out] == [x.what for x in routes["predict"].left_out]


def test_what_is_left_out_does_not_depend_on_the_route() -> None:
    assumed = {"value": "0.05 [m^2]", "min": 0.03, "max": 0.07, "source": "assumed"}
    model = plate({"htc": HTC, "area": assumed})
    known = td.design.Knowledge(model)
    told = td.predict(known, BENCH, spread={"air": "0.1 [K]"})
    runs = td.qualify.uncertain_runs(model, BENCH, spread={"air": "0.1 [K]"}, n=50, nodes=["plate"])
    seen = foresee(known, BENCH, spread={"air": "0.1 [K]"}).prediction
    words = [x.what for x in told.left_out]
    own, assumed_value, inputs = words
    assert own == UNFITTED
    assert re.match(r"1 .*\('skin\.area'\)", assumed_value)
    assert inputs.endswith("('heat' and 'start')")
    assert [x.what for x in runs.left_out] == [x.what for x in seen.left_out] == words
    # settled, the rise is P/(h A): a rectangular 0.03 to 0.07 m^2 moves it by a quarter
    assert told.left_out[1].kelvin == pytest.approx(2.5 / (5.0 * 0.05) * (0.04 / 12**0.5 / 0.05), rel=1e-3)
    named = td.predict(known, BENCH, spread={"air": "0.1 [K]", "skin.area": "range"})
    assert [x.what for x in named.left_out] == [words[0], words[2]]
    every = td.predict(known, BENCH, spread={"air": "0.1 [K]", "scale.heat": "5 [%]", "initial.plate": "0.1 [K]", "skin.area": "range"})
    assert [x.what for x in every.left_out] == words[:1]
    weighed = td.predict(td.design.Knowledge(plate({"htc": HTC, "area": assumed | {"source": "measured"}})), BENCH).left_out
    assert [x.listed for x in weighed if x.what.endswith("('skin.area')")] == [True]


def test_few_settled_members_and_their_line_say_what_all_would(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a bent model settles: 2,000 steady states a prediction took 83 % of its time, 7.4 of 9.4 minutes of a unit of 13 masses."""
    area = {"value": "0.05 [m^2]", "min": 0.03, "max": 0.07, "source": "assumed"}
    known = td.design.Knowledge(plate({"htc": HTC, "area": area}))
    spread = {"air": "1 [K]", "scale.heat": "15 [%]", "skin.area": "range"}
    few = td.predict(known, BENCH, spread=spread, draws=1000).settled["plate"]
    monkeypatch.setattr(predict, "PROBE_MEMBERS", 250)
    whole = td.predict(known, BENCH, spread=spread, draws=1000).settled["plate"]
    wide = whole.high - whole.low
    assert wide > 5.0
    assert few.error != whole.error
    for one, other in ((few.celsius, whole.celsius), (few.low, whole.low), (few.high, whole.high), (few.error, whole.error)):
        assert one == pytest.approx(other, abs=0.04 * wide)


def test_values_of_one_record_are_listed_and_no_headline() -> None:
    case = CASES["natural"]()
    told = td.predict(case.fit, case.inside, nodes=[case.node])
    once, given = (x.what for x in told.left_out if x.listed)
    assert once.endswith("('skin.htc.coefficient' and 'plate.capacitance')")
    assert given.endswith("('air', 'heat' and 'start')")
    assert once not in str(told)
    assert given not in str(told)


def test_a_small_omission_is_no_headline() -> None:
    small, large, unknown = LeftOut("a", 0.01), LeftOut("b", 1.0), LeftOut("c")
    assert first_line([small], 1.0) == ""
    assert first_line([small, large, unknown], 1.0) == "not counted: b, up to 1 K; c"
    assert first_line([LeftOut("a", 0.19)], 1.0) == ""
    assert first_line([LeftOut("a", 0.20)], 1.0) != ""


def test_predict_draws_members_by_itself_where_derivatives_do_not_do() -> None:
    """A conductance known to a factor: the band is lopsided, and says so; where it is known well nothing is drawn."""
    model = plate({"htc": HTC})
    long = BENCH.with_(duration="20 [h]")
    loose, tight = (td.predict(td.design.Knowledge(model), long, spread={"skin.htc": {"log_sd": s}})["plate"] for s in (0.5, 0.02))
    assert tight.members is None
    assert loose.members is not None
    end = loose.final
    assert end.high - end.celsius > 1.5 * (end.celsius - end.low)
    assert td.predict(td.design.Knowledge(model), long, spread={"skin.htc": {"log_sd": 0.5}}).warnings
    # the mean of 1/h with a log-normal h, in closed form
    assert end.celsius - 24.0 == pytest.approx(10.0 * np.exp(0.5 * 0.5**2), rel=0.06)


def test_a_uniform_law_has_no_normal_tails() -> None:
    model = plate({"htc": HTC})
    band = td.predict(td.design.Knowledge(model), BENCH, spread={"air": {"low": "-3 [K]", "high": "3 [K]"}})["air"]
    low, high = band.interval()
    assert (low[-1], high[-1]) == pytest.approx((24 - 2.85, 24 + 2.85), abs=0.1)


# constants ---------------------------------------------------------------------------------------------------------------------------


def test_constants_that_decide_the_width_of_a_band() -> None:
    """Each with the decision note that gives its reason; a change is a decision, and not a slip."""
    assert discrepancy.MAX_GAS_CONDUCTANCE == pytest.approx(0.026 / 10e-6, rel=0.03)  # 054
    assert (predict.MAX_MEAN_MISS, predict.MAX_WIDTH_MISS, predict.NEGLIGIBLE_HALF_WIDTH) == (0.1, 0.1, 0.05)
    assert (budget.ASSUMED_SD_SHARE, budget.MIN_SHARE_OF_BAND) == (0.1, 0.1)
    assert (spreads.MIN_SHARE_IN_BOUNDS, spreads.LARGEST_SHIFT) == (1e-3, 100.0)


def test_a_member_depends_on_its_number_alone() -> None:
    case = CASES["constant"]()
    budget = budget_of(case.fit, case.outside, STATED)
    every, some = budget.members(4, 0, 9), budget.members(4, 3, 5)
    assert set(every) == set(budget.targets)
    assert all(np.array_equal(some[t], every[t][3:8]) for t in every)


def test_a_member_is_the_same_among_however_many() -> None:
    rng = np.random.default_rng(5)
    weights, rows = rng.normal(size=(7, 64)) * (rng.random(64) < 0.8), rng.normal(size=(64, 33))
    written_out = sum(weights[:, s, None] * rows[s] for s in np.flatnonzero(weights.any(axis=0)))
    for several in (slice(0, 1), slice(0, 2), slice(4, 9), slice(0, 33)):
        for members in (rows, np.asfortranarray(rows)):
            assert np.array_equal(budget.combined(weights, members[:, several]), written_out[:, several])
