"""What scientists expect of objects in Python: short texts, iteration, arrays, frames, plots, and series as inputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import thermid as td
from thermid.base.errors import ScenarioError
from thermid.base.results import PlottedTrace, Result

DECK = {
    "title": "plate",
    "needs": ["air"],
    "nodes": {"box": {"capacitance": "100 [J/K]"}},
    "conductors": {"film": {"kind": "conduction", "between": ["box", "air"], "conductance": "1 [W/K]"}},
    "loads": {"heat": {"into": "box", "power": "3 [W]"}},
}
BENCH = td.Scenario("bench", {"air": "20 [degC]"}, start="20 [degC]", duration="10 [min]")


@pytest.fixture(scope="module")
def run() -> td.Solution:
    return td.simulate(td.model_from_dict(DECK), BENCH)


@pytest.fixture(scope="module")
def fit(run: td.Solution) -> Any:
    channel = td.Channel.from_array("T", run["box"].kelvin, unit="K", role="node", target="box", noise=0.05)
    model = td.model_from_dict(DECK).with_values({"film.conductance": "2 [W/K]"})
    record = td.Record.from_arrays("log", run.times, {"T": channel})
    return td.calibrate(model, record, ["film.conductance", "box.capacitance"], scenario=BENCH)


def test_a_run_is_a_collection_of_its_nodes(run: td.Solution) -> None:
    assert list(run) == list(run.nodes) == ["box", "air"]
    assert "box" in run
    assert "lid" not in run
    assert 3 not in run
    assert len(run) == 2


def test_a_trace_is_an_array_in_degrees_celsius(run: td.Solution) -> None:
    trace = run["box"]
    np.testing.assert_array_equal(np.asarray(trace), trace.celsius)
    assert trace[0] == trace.celsius[0] == pytest.approx(20.0)
    assert trace[-1] == trace.final
    np.testing.assert_array_equal(trace[:5], trace.celsius[:5])
    assert len(trace) == trace.times.size
    assert np.max(trace) == pytest.approx(trace.highest, abs=1e-3)
    assert np.asarray(trace, dtype=np.float32).dtype == np.float32


def test_a_record_and_a_prediction_are_collections_and_a_channel_an_array(fit: Any) -> None:
    band = td.predict(fit, BENCH, nodes=["box"])
    assert (list(band), len(band), "box" in band, 0 in band) == (["box"], 1, True, False)
    masked = td.Channel.from_array("T", [20.0, np.nan, 22.0], unit="degC")
    record = td.Record.from_arrays(
        "log", [0.0, 1.0, 2.0], {"T": masked, "P": td.Channel.from_array("P", [3.0, 4.0, 5.0], unit="W", quantity="power")}
    )
    assert (list(record), len(record), "T" in record, "lid" in record) == (["T", "P"], 2, True, False)
    np.testing.assert_allclose(np.asarray(record["T"]), [20.0, np.nan, 22.0])
    np.testing.assert_allclose(np.asarray(record["P"]), [3.0, 4.0, 5.0])


def test_a_trace_has_a_frame_and_a_plot(run: td.Solution) -> None:
    frame = run["box"].to_frame()
    assert list(frame.columns) == ["box"]
    np.testing.assert_array_equal(frame["box"].to_numpy(), run["box"].celsius)
    pytest.importorskip("matplotlib").use("agg")
    (line,) = run["box"].plot().get_lines()
    np.testing.assert_array_equal(line.get_ydata(), run["box"].celsius)


def test_a_steady_state_has_degrees_celsius() -> None:
    found = td.steady(td.model_from_dict(DECK), BENCH)
    assert found.celsius["box"] == pytest.approx(23.0)
    assert found.celsius["box"] == pytest.approx(found["box"] - 273.15)


def test_a_fit_has_the_covariance_of_its_values(fit: Any) -> None:
    table = fit.covariance
    assert list(table) == ["film.conductance", "box.capacitance"]
    for path, row in table.items():
        assert row[path] == pytest.approx(fit[path].error ** 2)
    assert table["film.conductance"]["box.capacitance"] == table["box.capacitance"]["film.conductance"]


def test_texts_of_objects_are_short(run: td.Solution, fit: Any) -> None:
    band = td.predict(fit, BENCH)
    for shown in (td.model_from_dict(DECK), run, run["box"], fit, fit.values, fit.store, band, band["box"], fit.request.records[0]["T"]):
        assert len(repr(shown)) <= 400, type(shown).__name__
        assert "array(" not in repr(shown)
        assert type(shown).__name__ in repr(shown)
        assert "<div>" in shown._repr_html_()


def test_a_series_is_a_boundary_or_a_load(run: td.Solution) -> None:
    watts = pd.Series([0.0, 6.0, 6.0], index=pd.to_timedelta([0, 300, 600], unit="s"))
    room = pd.Series([20.0, 30.0], index=[0.0, 600.0])
    model = td.model_from_dict(DECK)
    straight = {"values": watts, "hold": False}  # alone it holds, as in a record
    given = td.simulate(model, BENCH.with_(loads={"heat": straight}, boundaries={"air": td.celsius(room)}))
    pairs = {"loads": {"heat": ([0.0, 300.0, 600.0], [0.0, 6.0, 6.0])}, "boundaries": {"air": ([0.0, 600.0], td.celsius([20.0, 30.0]))}}
    pair = td.simulate(model, BENCH.with_(**pairs))
    assert given["box"].final == pair["box"].final
    with pytest.raises(ScenarioError, match=r"td\.celsius"):
        BENCH.with_(boundaries={"air": room})


def test_texts_of_large_objects_are_short() -> None:
    names = [f"a_node_with_a_long_name_{k}" for k in range(200)]
    deck = DECK | {
        "nodes": {n: {"capacitance": "100 [J/K]"} for n in names},
        "conductors": {f"to_{n}": {"kind": "conduction", "between": [n, "air"], "conductance": "1 [W/K]"} for n in names},
        "loads": {f"heat_{n}": {"into": n, "power": "3 [W]"} for n in names},
    }
    model = td.model_from_dict(deck)
    run = td.simulate(model, BENCH.with_(duration="2 [min]"))
    for shown in (model, run, run[names[0]], td.steady(model, BENCH)):
        assert len(repr(shown)) <= 400, type(shown).__name__


def test_texts_of_what_is_given_are_short() -> None:
    """Tables of 2,000 rows, covariances and models stand in them."""
    hours = np.arange(2000.0)
    scenario = BENCH.with_(loads={"heat": (hours, hours)})
    model = td.model_from_dict(DECK)
    spread = td.design.Spread("sensor", ("a",), np.eye(1), (False,))
    shown = (scenario, td.prepare(model, scenario), td.design.Action("on", scenario), td.design.Aim(scenario, "box"), spread)
    for given in shown:
        assert len(repr(given)) <= 400, type(given).__name__
        assert "array(" not in repr(given)
    assert repr(BENCH) == "<Scenario: title='bench', boundaries={air}, start='20 [degC]', duration=600, as_printed=False>"


def test_readings_and_model_of_a_channel_share_a_colour_and_no_two_channels_look_alike(fit: Any) -> None:
    pytest.importorskip("matplotlib").use("agg")

    class Several(Result):
        def _as_traces(self) -> list[PlottedTrace]:
            x = np.arange(3.0)
            return [
                PlottedTrace(f"T{k} {way}", x, x + k, measured=way == "measured", channel=f"T{k}")
                for k in range(14)
                for way in ("measured", "simulated")
            ]

    axes = Several().plot()
    lines = axes.get_lines()
    assert all(points.get_color() == line.get_color() for points, line in zip(lines[::2], lines[1::2], strict=True))
    for of_channels in (lines[::2], lines[1::2]):
        assert len({(line.get_color(), line.get_linestyle(), line.get_marker()) for line in of_channels}) == 14
    axes.figure.canvas.draw()
    legend = axes.get_legend()
    assert [t.get_text() for t in legend.get_texts()] == [f"T{k}" for k in range(14)]
    assert legend.get_window_extent().x0 >= axes.get_window_extent().x1  # beside the data, not over them


def test_a_fit_has_a_plot(fit: Any) -> None:
    pytest.importorskip("matplotlib").use("agg")
    lines = fit.plot().figure.axes[0].get_lines()
    drawn = {tuple(np.round(np.asarray(line.get_ydata(), dtype=float)[:3], 2)) for line in lines}
    measured = tuple(np.round(fit.blocks[0].measured[:3] - 273.15, 2))
    assert measured in drawn


def test_a_table_takes_arrays_as_a_pair_does() -> None:
    """Its times, plain numbers of an array, had to be texts."""
    times, values = np.array([0.0, 600.0, 1200.0]), np.array([1.0, 2.0, 0.0])
    table, pair = ({"heat": {"times": times, "values": values, "hold": True}}, {"heat": (times, values)})
    steps, lines = (td.Scenario("s", {"air": "20 [degC]"}, loads).loads["heat"] for loads in (table, pair))
    np.testing.assert_array_equal([steps.times, steps.values], [lines.times, lines.values])
    assert (steps.hold, lines.hold) == (True, False)
