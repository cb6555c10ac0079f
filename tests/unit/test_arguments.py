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
    ("call", "words"),
    [
        (
            lambda: td.calibrate(PART, ANY or "acc.csv", "x"),
            r"calibrate: `records` takes Record, not the text 'acc.csv'. Make it",
        ),
        (lambda: td.calibrate(PART, ANY or ["acc.csv"], ["x"]), "takes Record, not the text 'acc.csv'"),
        (lambda: td.calibrate(ANY or LOG, LOG, ["x"]), "`model` takes Model, not Record. Make it with td.load_model"),
        (lambda: td.calibrate(PART, LOG, ["x"], scenario=ANY or {"log": "s.toml"}), "`scenario` takes Scenario, not the text 's.toml'"),
        (
            lambda: PART.replace("acc", ANY or "file.toml"),
            r"replace: `new` takes Model, not the text 'file.toml'. Make it wi",
        ),
        (lambda: td.load_model(ANY or PART), "load_model: `path` takes the path of a file or folder, not Model. Give the file's name"),
        (
            lambda: td.simulate(PART, ANY or Path("winter.toml")),
            r"takes Scenario, not the path 'winter.toml'. Make it with td.loa",
        ),
        (lambda: td.simulate(PART, ANY or {"air": 20}), "`scenario` takes Scenario, not a dictionary"),
        (lambda: td.simulate(PART, ANY), "`scenario` takes Scenario, not None"),
        (lambda: td.simulate(ANY or {}, BENCH), r"`model` takes Model or Block, not a dictionary. Make it with td.model_from_dict"),
        (lambda: td.model_from_dict(ANY or "part.toml"), "`data` takes a dictionary, not 'part.toml'"),
        (
            lambda: td.validate(ANY or PART, LOG, td.Criteria(rmse="1 [K]")),
            "`calibration` takes Calibration, not Model. Make it with td.c",
        ),
        (
            lambda: td.report(ANY or "c.toml", to="page.html"),
            r"`campaign` takes Campaign, not the text 'c.toml'. Make it with td.r",
        ),
        (lambda: LOG.joined(ANY or "b.csv"), "joined: `other` takes Record, not the text 'b.csv'"),
    ],
)
def test_what_is_mixed_up_is_said(call: Any, words: str) -> None:
    with pytest.raises(DeckError, match=words):
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
    ("call", "words"),
    [
        (lambda: RUN.to_csv(ANY or 5), "to_csv: `path` takes the path of a file or folder, not 5"),
        (lambda: RUN.to_csv("a\0b"), "holds a NUL"),
        (lambda: RUN.plot(ANY or 5), r"plot: `axes` takes Axes, not 5. Make it with matplotlib.pyplot.subplots"),
        (lambda: RUN.slopes(ANY or ["case"]), r"slopes: `node` takes a text, not \['case'\]"),
        (lambda: td.inference.posterior(ANY or PART), "`fit` takes Calibration, not Model"),
        (lambda: td.qualify.uncertain_runs(PART, BENCH, nodes=ANY or [[]]), r"a name is a text such as 'case.mass', not \[\]"),
        (lambda: td.qualify.uncertain_runs(PART, BENCH, nodes=ANY or 3.7), "`nodes` takes a list, not 3.7|takes a dictionary"),
        (lambda: td.Channel.from_array("T", [1.0], unit="K").masked(ANY or "x"), "masked: `where` takes an array of numbers, not 'x'"),
        (lambda: td.Record("r", ANY or "x", {}, ANY), "`times` takes an array of numbers, not 'x'"),
        (lambda: td.simulate(PART, BENCH, fields=ANY or 5), "simulate: `fields` takes a list, not 5"),
        (lambda: td.site.OpenSky(albedo=ANY), "OpenSky: `albedo` takes a number, not None"),
        (lambda: td.simulation.state_space(ANY or 5), "takes Network"),
        (lambda: td.simulation.KeptTasks("jobs\0"), "KeptTasks: `folder` is no file's name"),
        (lambda: td.simulation.KeptTasks(ANY or 5), "KeptTasks: `folder` takes the path of a file or folder, not 5"),
        (lambda: td.site.pad_scenario(sun=ANY or 5), "pad_scenario: `sun` takes True or False, not 5"),
        (lambda: td.qualify.hold(ANY, {}, confidence=0.9), "`runs` takes UncertainRuns, not None"),
        (lambda: td.site.pad_scenario(albedo=float("nan")), "pad_scenario: `albedo` takes a number, not nan"),
        (lambda: td.inference.fleet(PART, ANY or [], ["x"]), r"fleet: `units` takes a dictionary, not \[\]"),
        (
            lambda: td.ensemble(PART, BENCH.with_(start="25 [degC]"), {"case.capacitance": [8.0, 9.0]}, quantiles="nonsense"),
            "give a quantile between 0 and 1",
        ),
        (lambda: td.design.Action(ANY or 5, BENCH), "Action: `name` takes a text, not 5"),
        (lambda: td.design.Action("a", ANY or "s.toml"), r"Action: `scenario` takes Scenario, not the text 's.toml'"),
    ],
)
def test_a_method_and_a_constructor_say_what_they_take(call: Any, words: str) -> None:
    with pytest.raises(td.ThermidError, match=words):
        call()


HTC = ("1 [W]", "0.01 [m^2]", "24 [degC]", "20 [degC]", "0.1 [m]")
HERE = td.site.Site(45.0, 5.0, timezone=1.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: td.prepare(PART, WARM, ["case.capacitance"]).bounds("nonsense"), "no free name 'nonsense'"),
        (lambda: td.qualify.Limits("p", "case", ANY or 5), r"`operating` takes two values, \(low, high\), not 5"),
        (lambda: td.qualify.Limits("p", "case", ("0 [degC]", "9 [degC]"), loads=ANY or 5), "`loads` takes a list of names, not 5"),
        (lambda: td.qualify.equivalent_cycles("0 [degC]", "20 [degC]", ANY or 5), "unknown level '5'"),
        (lambda: td.site.Site(45.0, 5.0, altitude=None), "None is neither a number nor a text with a unit"),
        (lambda: td.site.Site(45.0, 5.0, timezone=ANY or [1]), r"\[1\] is neither a number"),
        (lambda: HERE.instant(ANY or 5), "'5' is not a date and time"),
        (lambda: HERE.sun("2026-02-01 12:00", "nonsense"), "'nonsense' must be a number with a unit"),
        (lambda: td.site.Volume("1 [l]", humidity=ANY or [1]), r"\[1\] is neither a number"),
        (lambda: td.inference.compare_htc(*HTC, box=ANY or 5), "`box` takes two values"),
        (lambda: td.inference.compare_htc(*HTC, air=ANY or 5), "conductivity, viscosity, Prandtl number"),
        (lambda: td.inference.compare_htc(*HTC, emissivity=ANY or "grey"), "`emissivity` takes a number"),
        (lambda: td.Scenario("x", loads={"h": ([0.0, 60.0], [{}, 5.0])}), "is no number"),
        (lambda: td.Record.from_arrays("r", ANY, {"T": td.celsius([1.0, 2.0])}), "finite|times"),
        (lambda: td.ensemble(PART, WARM, {"case.capacitance": [8.0, 9.0]}, executor=ANY or object()), "no address of a scheduler"),
        (lambda: td.qualify.reduce(PART, WARM, within="1 [K]"), "exchanges heat with nothing outside"),
        (lambda: td.model.law(lambda t: t, between=ANY or 5), "`between` takes two values"),
        (lambda: td.bench.SensorPart(lag=ANY or "fast"), "sensor, lag: 'fast' must be a number with a unit"),
        (lambda: td.bench.SensorCertificate(ANY or [1], 0.1), r"certificate, offset: \[1\] is neither a number"),
        (lambda: td.qualify.margins({}, [], states=ANY or {"hot": "nonsense"}), "no state 'nonsense'"),
        (lambda: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", cycles=float("nan")), "is not finite"),
    ],
)
def test_what_was_a_traceback_is_a_sentence(call: Any, words: str) -> None:
    with pytest.raises(td.ThermidError, match=words):
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
    with raises_code("value.wrong-kind", DeckError, match="`free` takes a list of names, not <generator"):
        td.calibrate(PART, LOG, ANY or (name for name in ["case.capacitance"]))


def test_one_number_in_an_array_is_a_number() -> None:
    """`Trace.at` returns such, and they were refused."""

    @takes_objects
    def doubled(number: float) -> float:
        return 2.0 * number

    assert doubled(ANY or np.array(1.5)) == 3.0
    with raises_code("value.wrong-kind", DeckError):
        doubled(ANY or np.array([1.5]))
