"""Properties of budgets: members and derivatives agree, each source counts once, what is left out is named; and the constants behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.fit._discrepancy import discrepancy
from thermid.fit.discrepancy import FlowHistory, OperatingPoint, patterns_of
from thermid.prediction import _budget as budget, _predict as predict, _setting as setting
from thermid.prediction._budget import Budget, budget_of, first_line
from thermid.prediction._predict import foresee
from thermid.prediction._setting import Setting
from thermid.simulation.network import compile_network
from thermid.values import spreads
from thermid.values.store import LeftOut, Uniform
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
            out.append((node, budget_of(fit, scenario.with_(duration="40 [min]"), spread)))
    return out


@pytest.mark.parametrize("seed", [1, 2])
def test_members_are_derivatives_once_all_sources_shrink(seed: int) -> None:
    """A tenth of every source: 300 members have the straight model's mean and width within what their number leaves open."""
    for node, full in budgets(seed):
        small = replace(full, gain=0.1 * full.gain)
        setting = Setting.of(small, times=[1200.0, 2400.0])
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
        setting = Setting.of(full, times=[2400.0])
        columns = setting.linear([node]).columns[node]
        whole = sum(full.parts(columns).values())
        for k, source in enumerate(full.sources):
            left = full.without([source.name])
            again = Setting.of(left, times=[2400.0]).linear([node]).columns[node]
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
        "discrepancy=False": td.predict(fit, far, nodes=[node], discrepancy=False),
        "foresee": foresee(td.design.Known.of(fit), far, nodes=[node], without=off).prediction,
    }
    runs = td.qualify.uncertain_runs(fit.model, far, fit, n=400, nodes=[node], without=off)
    for told in routes.values():
        assert told[node].error[-1] < 0.2 * wide.error[-1]
        assert any(x.what == "constant coefficients, misfit (switched off)" for x in told.left_out)
        assert str(told).splitlines()[0].startswith("not counted: constant coefficients, misfit (switched off)")
        assert told[node].error[-1] == pytest.approx(runs.of(node)[:, -1].std(), rel=0.15)
    assert "not counted: constant coefficients, misfit (switched off)" in str(td.qualify.hold(runs, {node: "90 [degC]"}))
    assert [x.what for x in runs.left_out] == [x.what for x in routes["predict"].left_out]


def test_what_is_left_out_does_not_depend_on_the_route() -> None:
    assumed = {"value": "0.05 [m^2]", "min": 0.03, "max": 0.07, "source": "assumed"}
    model = plate({"htc": HTC, "area": assumed})
    known = td.design.Known(model)
    told = td.predict(known, BENCH, spread={"air": "0.1 [K]"})
    runs = td.qualify.uncertain_runs(model, BENCH, spread={"air": "0.1 [K]"}, n=50, nodes=["plate"])
    seen = foresee(known, BENCH, spread={"air": "0.1 [K]"}).prediction
    words = [x.what for x in told.left_out]
    assert words == [
        "the model's own error, because no fit has measured it",
        "1 assumed value without a stated spread ('skin.area')",
        "inputs without a stated spread ('heat', 'start')",
    ]
    assert [x.what for x in runs.left_out] == [x.what for x in seen.left_out] == words
    # settled, the rise is P/(h A): a rectangular 0.03 to 0.07 m^2 moves it by a quarter
    assert told.left_out[1].kelvin == pytest.approx(2.5 / (5.0 * 0.05) * (0.04 / 12**0.5 / 0.05), rel=1e-3)
    named = td.predict(known, BENCH, spread={"air": "0.1 [K]", "skin.area": "range"})
    assert [x.what for x in named.left_out] == [words[0], words[2]]
    every = td.predict(known, BENCH, spread={"air": "0.1 [K]", "scale.heat": "5 [%]", "initial.plate": "0.1 [K]", "skin.area": "range"})
    assert [x.what for x in every.left_out] == words[:1]


def test_values_of_one_record_are_listed_and_no_headline() -> None:
    case = CASES["natural"]()
    told = td.predict(case.fit, case.inside, nodes=[case.node])
    once, given = (x.what for x in told.left_out if x.listed)
    assert once == "how values fitted to one record differ from one test to the next ('skin.htc.coefficient', 'plate.capacitance')"
    assert given == "inputs without a stated spread ('air', 'heat', 'start')"
    assert "one record" not in str(told)
    assert "inputs without a stated spread" not in str(told)


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
    loose, tight = (td.predict(td.design.Known(model), long, spread={"skin.htc": {"log_sd": s}})["plate"] for s in (0.5, 0.02))
    assert tight.members is None
    assert loose.members is not None
    end = loose.final
    assert end.high - end.celsius > 1.5 * (end.celsius - end.low)
    assert any("members were drawn" in w for w in td.predict(td.design.Known(model), long, spread={"skin.htc": {"log_sd": 0.5}}).warnings)
    # the mean of 1/h with a log-normal h, in closed form
    assert end.celsius - 24.0 == pytest.approx(10.0 * np.exp(0.5 * 0.5**2), rel=0.06)


def test_a_uniform_law_has_no_normal_tails() -> None:
    model = plate({"htc": HTC})
    band = td.predict(td.design.Known(model), BENCH, spread={"air": {"low": "-3 [K]", "high": "3 [K]"}})["air"]
    low, high = band.interval()
    assert (low[-1], high[-1]) == pytest.approx((24 - 2.85, 24 + 2.85), abs=0.1)


# constants ---------------------------------------------------------------------------------------------------------------------------


def course(size: float = 10.0) -> tuple[np.ndarray, FlowHistory]:
    times = np.array([0.0, 10.0])
    return times, FlowHistory(np.array([330.0, 360.0]), np.array([310.0, 320.0]), np.array([size, 2.0 * size]))


def test_modes_of_a_bare_coefficient() -> None:
    """Free air: exponent anywhere from 1/5 to 1/3, radiative share anywhere up to that of 0.95, of what is left beside it."""
    network = compile_network(plate({"htc": HTC, "carried_by": "free air"}))
    times, one = course()
    at = OperatingPoint(20.0, 320.0)
    grown, warmer = patterns_of(network, times, {"skin": one}, {"skin": at}, network.numbers().values)
    most = min(1.0, 0.95 * 4 * 5.670374419e-8 * 320.0**3 / 5.0)
    share, spread = most / 2, most / 12**0.5
    assert (warmer.mean, warmer.sd) == pytest.approx((share, spread), rel=1e-6)
    exponent = Uniform(1.0 / 5.0, 1.0 / 3.0)
    square = exponent.variance + exponent.mean**2
    assert grown.mean == pytest.approx(exponent.mean * (1 - share), rel=1e-9)
    assert grown.sd == pytest.approx((1 - share) * (square - exponent.mean**2) ** 0.5, rel=1e-6)
    # what a unit adds to the heat, at the mean exponent: of r^n the derivative; radiation less the convection it replaces
    grows = (one.difference / 20.0) ** exponent.mean
    assert grown.watts.values == pytest.approx(one.heat * grows * np.log(one.difference / 20.0))
    linear = (one.first**2 + one.second**2) * (one.first + one.second) / (4.0 * 320.0**3)
    assert warmer.watts.values == pytest.approx(one.heat * (linear - grows))
    assert (grown.unsaid, warmer.unsaid) == (0.0, 0.0)


def test_modes_of_a_coefficient_of_which_nobody_says_what_carries_the_heat() -> None:
    """Free air in half of all cases, and neither an exponent nor radiation in the others; the own doubt counts whole (decision 248)."""
    times, one = course()
    at = OperatingPoint(20.0, 320.0)
    stated, silent = (
        patterns_of(n, times, {"skin": one}, {"skin": at}, n.numbers().values)
        for n in (compile_network(plate({"htc": HTC} | word)) for word in ({"carried_by": "free air"}, {}))
    )
    for free, open_ in zip(stated, silent, strict=True):
        assert open_.mean == pytest.approx(0.5 * free.mean)
        assert open_.sd**2 == pytest.approx(free.sd**2 + 0.25 * free.mean**2)
        assert open_.unsaid == pytest.approx(0.5 * free.mean / open_.sd)
    for word in ("fan", "cold plate", "leads"):
        still = compile_network(plate({"htc": HTC, "carried_by": word}))
        assert patterns_of(still, times, {"skin": one}, {"skin": at}, still.numbers().values) == []


def test_surfaces_are_half_alike() -> None:
    two = plate(
        {"htc": HTC},
        surfaces={n: {"of": "plate", "to": "air", "area": "0.02 [m^2]", "htc": HTC, "carried_by": "free air"} for n in ("top", "side")},
    )
    times = np.arange(0.0, 7201.0, 120.0)
    kelvin = td.simulate(two, BENCH, times=times)["plate"].kelvin
    record = td.Record.from_arrays("log", times, {"T": td.Channel.of("T", kelvin, unit="K", role="node", target="plate", noise=0.05)})
    fit = td.calibrate(two, record, ["top.htc"], scenario=BENCH)
    budget = budget_of(fit, BENCH.with_(boundaries={"air": "60 [degC]"}))
    names = [s.name for s in budget.sources]
    k = [names.index(f"exponent of {n}") for n in ("top", "side")]
    other = names.index("radiative share of top")
    assert budget.alike[k[0], k[1]] == 0.5
    assert budget.alike[k[0], other] == 0.0
    drawn = budget.drawn(budget.numbers(0, 0, 20_000))[k]
    assert np.corrcoef(drawn)[0, 1] == pytest.approx(0.5, abs=0.02)


def test_constants_that_decide_the_width_of_a_band() -> None:
    """Each with the decision note that gives its reason; a change is a decision, and not a slip."""
    assert (discrepancy.EXPONENTS, discrepancy.UNSAID) == ((1 / 5, 1 / 3), 0.5)  # 195
    assert (discrepancy.BLACKEST, discrepancy.FINISH, discrepancy.SMALL) == (0.95, 0.15, 1e-3)  # 034
    assert discrepancy.ALIKE == 0.5  # 034
    assert discrepancy.MOST == pytest.approx(0.026 / 10e-6, rel=0.03)  # 054
    assert (setting.GUESSED, predict.FAR, predict.MEAN_MISS, predict.WIDTH_MISS, predict.SMALL) == (0.25, (1.25, 10.0), 0.1, 0.1, 0.05)
    assert (budget.TENTH, budget.FELT) == (0.1, 0.1)
    assert (spreads.LEAST, spreads.LARGEST_SHIFT) == (1e-3, 100.0)


@pytest.mark.parametrize(
    ("ratio", "level", "far"), [(1.24, 0.0, False), (1.26, 0.0, True), (1 / 1.26, 0.0, True), (1.0, 9.0, False), (1.0, -11.0, True)]
)
def test_from_where_a_coefficient_is_far_from_its_fit(ratio: float, level: float, far: bool) -> None:
    assert predict._far(OperatingPoint(10.0, 300.0), OperatingPoint(10.0 * ratio, 300.0 + level)) is far


def test_a_member_depends_on_its_number_alone() -> None:
    case = CASES["constant"]()
    budget = budget_of(case.fit, case.outside, STATED)
    every, some = budget.members(4, 0, 9), budget.members(4, 3, 5)
    assert set(every) == set(budget.targets)
    assert all(np.array_equal(some[t], every[t][3:8]) for t in every)
