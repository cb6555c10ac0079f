"""What every result can do: a short repr, a table for a notebook, a plot, a frame, names to complete, a way through a pickle."""

from __future__ import annotations

import json
import pickle
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import MissingExtraError
from thermid.base.results import MAX_REPR_CHARACTERS, ROWS, PlottedTrace, Result, clean
from thermid.values.store import FittedValue, FittedValues
from unit.fit.bench import box
from unit.results import of_a_fit, of_a_run

pandas = pytest.importorskip("pandas")
matplotlib = pytest.importorskip("matplotlib")
ABLE = (
    "record",
    "calibration",
    "campaign",
    "joint",
    "verdict",
    "credibility",
    "prediction",
    "foresight",
    "discrepancy",
    "fleet",
    "identifiability",
    "profile",
    "criticism",
    "plausibility",
    "balance",
    "split",
    "margin",
    "advice",
    "history",
    "changes",
    "sizing",
    "worst cases",
    "uncertain runs",
    "hold",
    "forecast",
    "stability",
    "diagnosis",
    "correlation",
    "known",
    "plan of a retune",
    "enclosure of a run",
    "block's run of a run",
    "solution of a run",
    "steady of a run",
    "ensemble of a run",
    "moisture of a run",
    "run of a profile of a run",
    "profile of a run",
    "reduction of a run",
    "qualification of a run",
    "plan of a run",
    "htc of a run",
    "look of a run",
)
"""Results of tests/unit/results.py that have all six abilities."""
WORDS = ("changes", "plan of a retune", "plan of a run", "qualification of a run")
"""Those that hold words and no numbers: their plot is refused."""
NAMED = (
    "record",
    "calibration",
    "campaign",
    "prediction",
    "hold",
    "solution of a run",
    "steady of a run",
    "moisture of a run",
    "qualification of a run",
)
"""Those that are indexed by names."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    one, other = (tmp_path_factory.mktemp(name) for name in ("fit", "run"))
    return of_a_fit(one) | {f"{k} of a run": v for k, v in of_a_run(other).items()}


def test_no_result_is_forgotten(results: dict[str, Any]) -> None:
    assert {name for name, one in results.items() if isinstance(one, Result)} - set(ABLE) <= {"weather of a run"}


@pytest.fixture(autouse=True)
def _figures_are_closed() -> Any:
    matplotlib.use("Agg")
    yield
    from matplotlib import pyplot

    pyplot.close("all")


@pytest.mark.parametrize("name", ABLE)
def test_six_abilities(results: dict[str, Any], name: str) -> None:
    one = results[name]
    text = repr(one)
    assert type(one).__name__ in text
    assert len(text) <= MAX_REPR_CHARACTERS
    assert "\n" not in text
    html = one._repr_html_()
    assert html.startswith("<div>")
    assert html.count("<tr>") <= ROWS + 1
    assert "object at 0x" not in html + text
    if name in WORDS:
        with raises_code("result.nothing-to-draw"):
            one.plot()
    else:
        assert isinstance(one.plot(), matplotlib.axes.Axes)
    frame = one.to_frame()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.size > 0
    assert one.to_xarray().sizes
    assert all(isinstance(n, str) for n in one._ipython_key_completions_())
    assert repr(pickle.loads(pickle.dumps(one))) == text


@pytest.mark.parametrize("name", NAMED)
def test_names_are_completed_and_lead_somewhere(results: dict[str, Any], name: str) -> None:
    names = results[name]._ipython_key_completions_()
    assert names
    for n in names:
        results[name][n]


def test_a_plot_draws_into_the_axes_that_are_given(results: dict[str, Any]) -> None:
    from matplotlib import pyplot

    axes = pyplot.subplots()[1]
    assert results["prediction"].plot(axes) is axes
    assert axes.get_ylabel() == "temperature [degC]"
    assert len(axes.collections) == len(results["prediction"].bands)
    assert len(axes.lines) == len(results["prediction"].bands)


def test_a_frame_holds_the_numbers(results: dict[str, Any]) -> None:
    solution = results["solution of a run"]
    frame = solution.to_frame()
    assert np.array_equal(frame["case"].to_numpy(), solution["case"].celsius)
    assert frame.index.name == "time [s]"
    fit = results["calibration"]
    rows = fit.to_frame().set_index("path")["error"]
    assert {path: v.shown(v.error) for path, v in fit.values.items()} == rows.to_dict()


def test_markup_is_escaped() -> None:
    class Bad(Result):
        def _summary(self) -> str:
            return "<script>alert(1)</script>" + "x" * 500

        def _as_rows(self) -> list[Any]:
            return [{"<b>": "<i>", "n": 1.0}] * 30

    bad = Bad()
    assert len(repr(bad)) == MAX_REPR_CHARACTERS
    html = bad._repr_html_()
    assert "<script>" not in html
    assert "<i>" not in html
    assert "10 more rows" in html


def test_nothing_to_draw_is_refused() -> None:
    with raises_code("result.nothing-to-draw"):
        Result().plot()


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    class Line(Result):
        def _as_traces(self) -> list[PlottedTrace]:
            return [PlottedTrace("a", np.arange(3.0), np.arange(3.0))]

    record = td.Record.from_arrays("log", np.arange(3.0), {"T": np.arange(3.0)}, unit="K")
    run = td.simulate(box(), td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="air", duration="60 [s]"))
    for name, told in (("pandas", Line().to_frame), ("xarray", record.to_xarray), ("xarray", run.to_xarray)):
        monkeypatch.setitem(sys.modules, name, None)
        with raises_code("extra.not-installed", MissingExtraError, match=f"'{name}'"):
            told()


def test_fitted_values_are_a_frame_in_their_units_and_have_no_per_cent_of_degrees() -> None:
    values = FittedValues(
        "box",
        {
            "a": FittedValue("a", 300.15, 2.0, 2.0, False, "degC", 300.0, (0.0, 1e3)),
            "b": FittedValue("b", 3e-3, 3e-5, 3e-5, True, "W/(m^2 K)", 1.0, (0.0, 1e3)),
        },
        np.eye(2),
    )
    frame = values.to_frame()
    assert frame["value"].tolist() == pytest.approx([27.0, 3e-3])
    assert frame["error"].tolist() == pytest.approx([2.0, 3e-5])
    assert [v.relative for v in values.values()] == pytest.approx([np.inf, 0.01])


def test_arrays_and_numbers_of_arrays_are_cleaned_for_json_as_plain_ones_are() -> None:
    """NaN of an array reached the text, and a truth value of one became 1.0."""
    content = {"a": np.array([[1.0, np.nan], [np.inf, 2.0]]), "b": np.bool_(True), "n": np.int64(3), "x": [np.float64(np.nan)]}
    assert json.dumps(clean(content), allow_nan=False) == '{"a": [[1.0, null], [null, 2.0]], "b": true, "n": 3, "x": [null]}'
    assert clean(content, np.shape) == {"a": (2, 2), "b": True, "n": 3, "x": [None]}
