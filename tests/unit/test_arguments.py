"""A path where an object is expected, and the other way round, is refused in words, in every public function."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.arguments import takes_objects
from thermid.base.errors import DeckError, ScenarioError

PART = td.model_from_dict({"title": "Part", "needs": ["air"], "nodes": {"case": {"capacitance": "9 [J/K]"}}})
BENCH = td.Scenario("bench", boundaries={"air": "20 [degC]"}, duration="1 [h]")
LOG = td.Record.from_arrays(
    "log", [0.0, 1.0, 2.0], {"T": td.Channel.from_array("T", [293.0, 293.1, 293.2], unit="K", role="node", target="case")}
)
ANY: Any = None


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (
            lambda: td.calibrate(PART, ANY or "acc.csv", "x"),
            r"`records`.*'acc\.csv'",
        ),
        (lambda: td.calibrate(PART, ANY or ["acc.csv"], ["x"]), r"'acc\.csv'"),
        (lambda: td.calibrate(ANY or LOG, LOG, ["x"]), r"`model`.*td\.load_model"),
        (lambda: td.calibrate(PART, LOG, ["x"], scenario=ANY or {"log": "s.toml"}), r"`scenario`.*'s\.toml'"),
        (
            lambda: PART.replace("acc", ANY or "file.toml"),
            r"`new`.*'file\.toml'",
        ),
        (lambda: td.load_model(ANY or PART), "load_model.*`path`"),
        (
            lambda: td.simulate(PART, ANY or Path("winter.toml")),
            r"'winter\.toml'.*td\.loa",
        ),
        (lambda: td.simulate(PART, ANY or {"air": 20}), "`scenario`"),
        (lambda: td.simulate(PART, ANY), "`scenario`"),
        (lambda: td.simulate(ANY or {}, BENCH), r"`model`.*td\.model_from_dict"),
        (lambda: td.model_from_dict(ANY or "part.toml"), r"`data`.*'part\.toml'"),
        (
            lambda: td.validate(ANY or PART, LOG, td.Criteria(rmse="1 [K]")),
            r"`calibration`.*td\.c",
        ),
        (
            lambda: td.report(ANY or "c.toml", to="page.html"),
            r"`campaign`.*'c\.toml'.*td\.r",
        ),
        (lambda: LOG.joined(ANY or "b.csv"), r"`other`.*'b\.csv'"),
    ],
)
def test_what_is_mixed_up_is_said(call: Any, match: str) -> None:
    with raises_code("value.wrong-kind", DeckError, match=match):
        call()


def test_every_public_function_that_takes_an_object_is_guarded() -> None:
    for space, names in {"": td._TOP, **td._NAMESPACES}.items():
        for name in names:
            function = getattr(getattr(td, space) if space else td, name)
            if inspect.isfunction(function):
                assert hasattr(function, "__wrapped__"), f"td.{space}.{name}"
                assert pickle.loads(pickle.dumps(function)) is function, f"td.{space}.{name}"


def test_methods_of_what_is_shown_are_guarded() -> None:
    """In one place, so that no class can be forgotten."""
    for made in (td.Solution, td.Prediction, td.Record, td.simulation.Ensemble, td.qualify.UncertainRuns, td.inference.Posterior):
        for name, method in vars(made).items():
            if inspect.isfunction(method) and not name.startswith("_") and len(inspect.signature(method).parameters) > 1:
                assert hasattr(method, "__wrapped__"), f"{made.__name__}.{name}"


WARM = BENCH.with_(start="25 [degC]")
RUN = td.simulate(PART, WARM, every="10 [min]")


@pytest.mark.parametrize(
    ("call", "code", "match"),
    [
        (lambda: RUN.to_csv(ANY or 5), "value.wrong-kind", "to_csv.*`path`.*5"),
        (lambda: RUN.to_csv("a\0b"), "value.wrong-kind", "to_csv.*`path`.*'s name: '"),
        (lambda: RUN.plot(ANY or 5), "value.wrong-kind", r"`axes`.*5.*matplotlib\.pyplot\.subplots"),
        (lambda: RUN.slopes(ANY or ["case"]), "value.wrong-kind", r"`node`.*\['case'\]"),
        (lambda: td.inference.posterior(ANY or PART), "value.wrong-kind", "`fit`"),
        (lambda: td.qualify.uncertain_runs(PART, BENCH, nodes=ANY or [[]]), "value.wrong-kind", r"'case\.mass'.*\[\]"),
        (lambda: td.qualify.uncertain_runs(PART, BENCH, nodes=ANY or 3.7), "value.wrong-kind", r"`nodes`.*3\.7"),
        (lambda: td.Channel.from_array("T", [1.0], unit="K").masked(ANY or "x"), "value.wrong-kind", "`where`.*'x'"),
        (lambda: td.Record("r", ANY or "x", {}, ANY), "value.wrong-kind", "`times`.*'x'"),
        (lambda: td.simulate(PART, BENCH, fields=ANY or 5), "value.wrong-kind", "`fields`.*5"),
        (lambda: td.site.OpenSky(albedo=ANY), "value.wrong-kind", "`albedo`"),
        (lambda: td.simulation.state_space(ANY or 5), "value.wrong-kind", r"state_space.*`network`.*td\.simulation\.compile_network"),
        (lambda: td.simulation.KeptTasks("jobs\0"), "value.wrong-kind", "`folder`"),
        (lambda: td.simulation.KeptTasks(ANY or 5), "value.wrong-kind", "`folder`.*5"),
        (lambda: td.site.pad_scenario(sun=ANY or 5), "value.wrong-kind", "pad_scenario.*`sun`.*5"),
        (lambda: td.qualify.hold(ANY, {}, confidence=0.9), "value.wrong-kind", "`runs`"),
        (lambda: td.site.pad_scenario(albedo=float("nan")), "value.wrong-kind", "pad_scenario.*`albedo`"),
        (lambda: td.inference.fleet(PART, ANY or [], ["x"]), "value.wrong-kind", r"`units`.*\[\]"),
        (
            lambda: td.ensemble(PART, BENCH.with_(start="25 [degC]"), {"case.capacitance": [8.0, 9.0]}, quantiles="nonsense"),
            "value.outside-range",
            "0.*1",
        ),
        (lambda: td.design.Action(ANY or 5, BENCH), "value.wrong-kind", "`name`.*5"),
        (lambda: td.design.Action("a", ANY or "s.toml"), "value.wrong-kind", r"`scenario`.*'s\.toml'"),
    ],
)
def test_a_method_and_a_constructor_say_what_they_take(call: Any, code: str, match: str) -> None:
    with raises_code(code, match=match):
        call()


def test_a_factor_on_a_power_is_bounded_by_zero_and_a_temperature_is_not() -> None:
    heated = td.model_from_dict(
        {
            "title": "Part",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": "9 [J/K]"}},
            "loads": {"heater": {"into": "case", "power": "1 [W]"}},
        }
    )
    prepared = td.prepare(heated, WARM, ["scale.heater", "initial.case"])
    assert prepared.bounds("scale.heater") == (0.0, float("inf"))
    assert prepared.bounds("initial.case") == (float("-inf"), float("inf"))


HTC = ("1 [W]", "0.01 [m^2]", "24 [degC]", "20 [degC]", "0.1 [m]")
HERE = td.site.Site(45.0, 5.0, timezone=1.0)


@pytest.mark.parametrize(
    ("call", "code", "match"),
    [
        (lambda: td.prepare(PART, WARM, ["case.capacitance"]).bounds("nonsense"), "name.unknown", "'nonsense'"),
        (lambda: td.qualify.Limits("p", "case", ANY or 5), "value.wrong-kind", "`operating`.*5"),
        (lambda: td.qualify.Limits("p", "case", ("0 [degC]", "9 [degC]"), loads=ANY or 5), "value.wrong-kind", "`loads`.*5"),
        (lambda: td.qualify.equivalent_cycles("0 [degC]", "20 [degC]", ANY or 5), "name.unknown", "'5'"),
        (lambda: td.site.Site(45.0, 5.0, altitude=None), "value.not-an-amount", r"'4 \[m\]'"),
        (lambda: td.site.Site(45.0, 5.0, timezone=ANY or [1]), "value.not-an-amount", r"\[1\]"),
        (lambda: HERE.instant(ANY or 5), "value.wrong-kind", "'5'"),
        (lambda: HERE.sun("2026-02-01 12:00", "nonsense"), "value.wrong-kind", "'nonsense'"),
        (lambda: td.site.Volume("1 [l]", humidity=ANY or [1]), "value.not-an-amount", r"\[1\]"),
        (lambda: td.inference.compare_htc(*HTC, box=ANY or 5), "value.wrong-kind", "`box`"),
        (lambda: td.inference.compare_htc(*HTC, air=ANY or 5), "value.wrong-kind", ""),
        (lambda: td.inference.compare_htc(*HTC, emissivity=ANY or "grey"), "value.wrong-kind", "`emissivity`"),
        (lambda: td.Scenario("x", loads={"h": ([0.0, 60.0], [{}, 5.0])}), "value.wrong-kind", r"loads\.h.*\[\{\}, 5\.0\].*'24 \[degC\]'"),
        (lambda: td.Record.from_arrays("r", ANY, {"T": td.celsius([1.0, 2.0])}), "value.wrong-kind", "`times`"),
        (
            lambda: td.ensemble(PART, WARM, {"case.capacitance": [8.0, 9.0]}, executor=ANY or object()),
            "run.cluster",
            "<object object at",
        ),
        (lambda: td.qualify.reduce(PART, WARM, within="1 [K]"), "model.element-not-supported", "'Part'"),
        (lambda: td.model.law(lambda t: t, between=ANY or 5), "value.wrong-kind", "`between`"),
        (lambda: td.bench.SensorPart(lag=ANY or "fast"), "value.wrong-kind", "'fast'"),
        (lambda: td.bench.SensorCertificate(ANY or [1], 0.1), "value.not-an-amount", r"\[1\]"),
        (lambda: td.qualify.margins({}, [], states=ANY or {"hot": "nonsense"}), "name.unknown", "'nonsense'"),
        (lambda: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", cycles=float("nan")), "value.outside-range", "SMC-S-016"),
    ],
)
def test_what_was_a_traceback_is_a_sentence(call: Any, code: str, match: str) -> None:
    with raises_code(code, match=match):
        call()


def test_a_sensor_takes_texts_with_a_unit() -> None:
    """They were kept as texts, without a word."""
    assert td.bench.SensorPart(lag="2 [min]", capacitance="1 [mJ/K]") == td.bench.SensorPart(lag=120.0, capacitance=1e-3)
    assert td.bench.SensorCertificate("0.1 [K]", "20 [mK]").uncertainty == 0.02


@pytest.mark.parametrize("times", [10**400, [[], 1.0], ["a", 2]])
def test_times_that_are_none_are_refused(times: Any) -> None:
    with pytest.raises(td.ThermidError, match=r"times|finite|number|text"):
        td.simulate(PART, WARM, times=times)


def test_a_guarded_function_is_itself() -> None:
    assert pickle.loads(pickle.dumps(td.steady)) is td.steady
    assert list(inspect.signature(td.steady).parameters) == ["model", "scenario", "time"]


def test_a_table_of_a_scenario_is_a_dictionary() -> None:
    with raises_code("value.wrong-kind", ScenarioError, match="'air'"):
        BENCH.with_(boundaries="air")


def test_a_dictionary_whose_arrays_are_read_anew_is_taken(tmp_path: Path) -> None:
    """NumPy's files are such; their items are not compared."""

    @takes_objects
    def sizes(arrays: Mapping[str, np.ndarray]) -> list[int]:
        return [a.size for a in arrays.values()]

    np.savez(tmp_path / "arrays.npz", T=np.arange(2.0))
    with np.load(tmp_path / "arrays.npz") as arrays:
        assert sizes(arrays) == [2]


def test_names_that_are_gone_once_they_were_read_are_refused() -> None:
    """A generator of free names was empty when they were read again: a fit of nothing."""
    with raises_code("value.wrong-kind", DeckError, match="`free`"):
        td.calibrate(PART, LOG, ANY or (name for name in ["case.capacitance"]))


def test_one_number_in_an_array_is_a_number() -> None:
    """`Trace.at` returns such, and they were refused."""

    @takes_objects
    def doubled(number: float) -> float:
        return 2.0 * number

    assert doubled(ANY or np.array(1.5)) == 3.0
    with raises_code("value.wrong-kind", DeckError):
        doubled(ANY or np.array([1.5]))
