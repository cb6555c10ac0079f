"""A desk answers with the numbers that the library itself gives; thinning keeps what a reader would see."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.app.studio.desk import thinned_curve
from thermid.app.studio.project import Project
from thermid.base.errors import DeckError, IdentificationError, NameNotFoundError

EXAMPLES = Path(__file__).parents[4] / "examples"
DECK = EXAMPLES / "01_accelerometer" / "accelerometer.toml"


@pytest.fixture
def project() -> Project:
    return Project(DECK)


def test_a_deck_alone_runs_its_plain_scenario(project: Project) -> None:
    desk = project.desk(project.title)
    (run,) = desk.curves({})
    (curve,) = run.curves
    bench = td.Scenario(boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
    assert curve.simulated[-1] == pytest.approx(td.simulate(td.load_model(DECK), bench)["case"].celsius[-1], abs=1e-9)
    assert curve.measured.size == 0
    assert np.isnan(curve.rmse)


def test_a_slider_acts_as_the_parameter_does(project: Project) -> None:
    desk = project.desk(project.title)
    bench = td.Scenario(boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
    changed = td.load_model(DECK).with_values({"area": "0.005 [m^2]"})
    (run,) = desk.curves({"area": 0.005})
    assert run.curves[0].simulated[-1] == pytest.approx(td.simulate(changed, bench)["case"].celsius[-1], abs=1e-9)
    assert td.simulate(desk.tuned({"area": 0.005}), bench)["case"].final == td.simulate(changed, bench)["case"].final


def test_sliders_have_units_bounds_and_sources(project: Project) -> None:
    sliders = {s.path: s for s in project.desk(project.title).sliders}
    area = sliders["area"]
    assert (area.low, area.high) == pytest.approx((0.003, 0.006))
    assert area.unit == "m^2"
    assert all(s.low <= s.value <= s.high for s in sliders.values())


def test_what_is_no_slider_is_refused(project: Project) -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'aera'.*'area'"):
        project.desk(project.title).curves({"aera": 1.0})


def test_a_deck_has_nothing_to_fit_or_run(project: Project) -> None:
    with raises_code("studio.not-now", IdentificationError):
        project.fit(project.title, {}, ("area",))
    with raises_code("studio.not-now", DeckError):
        project.run(project.title)


def test_saving_keeps_older_files_and_reads_back(project: Project, tmp_path: Path) -> None:
    project.results = tmp_path
    first = project.save(project.title, {"area": 0.005}, "by hand")
    second = project.save(project.title, {"area": 0.0045}, "by hand")
    assert [first.name, second.name] == ["by_hand.values.toml", "by_hand_2.values.toml"]
    from thermid.values.store import load_values

    kept = load_values(first)["area"]
    assert kept.value == pytest.approx(0.005)
    assert np.isinf(kept.error)
    assert "by hand" in kept.origin
    with raises_code("studio.not-now", DeckError):
        project.save(project.title, {}, "empty")
    with raises_code("name.not-valid", DeckError):
        project.save(project.title, {"area": 0.005}, "../")


def test_thinning_keeps_the_ends_and_the_extremes() -> None:
    times = np.arange(10_001.0)
    values = np.sin(times / 700.0)
    values[4321] = 9.0
    shown, seen = thinned_curve(times, values, points=200)
    assert shown.size <= 202
    assert {0.0, 4321.0, 10_000.0} <= set(shown)
    assert seen.max() == 9.0
    assert seen.min() == values.min()
    few = np.arange(5.0)
    assert thinned_curve(few, few)[0] is few
