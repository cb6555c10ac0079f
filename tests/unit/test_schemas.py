"""Every kind of file has one grammar: what does not follow it is refused with file, line and key, all faults at once."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from typing import Any

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, RecordError, ScenarioError, ThermidError
from thermid.base.files import file_kinds, json_schema, read_json
from thermid.bench.bench_files import load_programme, load_sensors
from thermid.campaign._judge.verdict import _read
from thermid.campaign.stages import load_limits

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("kind", file_kinds())
def test_the_schemas_for_editors_are_current(kind: str) -> None:
    spec = importlib.util.spec_from_file_location("write_schema", ROOT / "scripts/write_schema.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert (script.FOLDER / f"{kind}.schema.json").read_text(encoding="utf-8") == script.text(kind), "run: python scripts/write_schema.py"


def test_a_schema_says_names_and_types() -> None:
    schema = json_schema("scenario")
    assert schema["additionalProperties"] is False
    assert {"boundaries", "loads", "environment", "duration", "weather", "ascent"} <= set(schema["properties"])
    assert {"TimesTable", "SineTable", "ColumnTable", "GasTable"} <= set(schema["$defs"])
    assert schema["properties"]["as_printed"]["type"] == "boolean"


FAULTS: list[tuple[Any, type[ThermidError], str, str]] = [
    (td.load_scenario, ScenarioError, "duration = true\n", "file.wrong-kind", "x.toml:1"),
    (td.load_scenario, ScenarioError, "\n[boundaries]\nair = [1]\n", "file.wrong-kind", "x.toml:3, boundaries.air"),
    (td.load_scenario, ScenarioError, "[loads]\nq = { times = ['0 [s]'], valus = [] }\n", "file.key-missing", "x.toml:2, loads.q.values"),
    (
        td.load_scenario,
        ScenarioError,
        "[loads]\nq = { mean = 1, amplitude = true, period = '1 [h]' }\n",
        "file.wrong-kind",
        "loads.q.amplitude",
    ),
    (td.load_scenario, ScenarioError, "[environment]\nair = 3\n", "file.wrong-kind", "x.toml:2, environment.air.*3"),
    (td.load_scenario, ScenarioError, "[environment.air]\npresure = '1 [bar]'\n", "file.unknown-key", r"air\.presure.*'pressure'"),
    (td.load_scenario, ScenarioError, "[irradiation.lid]\nsky_view = 2.0\n", "file.wrong-value", r"x.toml:2, irradiation\.lid\.sky_view"),
    (td.load_scenario, ScenarioError, "[gains]\nq = 1\n", "file.wrong-kind", "x.toml:2, gains.q.*1"),
    (td.load_scenario, ScenarioError, "as_printed = 'yes'\n", "file.wrong-kind", "as_printed.*'yes'"),
    (td.load_scenario, ScenarioError, "[weather]\nfile = 3\n", "file.wrong-kind", "x.toml:2, weather.file"),
    (td.load_scenario, ScenarioError, "[weather]\nyear = 2025.5\n", "file.wrong-kind", "x.toml:2, weather.year"),
    (td.load_scenario, ScenarioError, "[wind.lid]\nlength = '1 [m]'\n", "file.key-missing", "wind.lid.calm"),
    (td.load_scenario, ScenarioError, "[ascent]\nflow = { lid = 2.0 }\n", "file.wrong-value", "ascent.flow.lid"),
    (load_limits, ScenarioError, "[box]\nnode = 1\noperating = ['', '5 [degC]']\n", "file.wrong-kind", "x.toml:2, box.node.*1"),
    (load_limits, ScenarioError, "box = 1\n", "file.wrong-kind", "x.toml:1, box"),
    (load_limits, ScenarioError, "[box]\nnode = 'a'\noperating = [{}, 1]\n", "file.wrong-kind", r"x.toml:3, box\.operating\.0"),
    (td.qualify.load_profile, ScenarioError, "[profile]\nhot = true\n", "file.wrong-kind", "x.toml:2, profile.hot"),
    (td.qualify.load_profile, ScenarioError, "[profile]\nsteps = 3\n", "file.wrong-kind", "x.toml:2, profile.steps"),
    (td.qualify.load_profile, ScenarioError, "[profile]\nsteps = [{ wait = 'no' }]\n", "file.wrong-kind", r"profile\.steps\.0\.wait"),
    (td.qualify.load_profile, ScenarioError, "profile = 3\n", "file.wrong-kind", "x.toml:1"),
    (td.qualify.load_hold, DeckError, "model = 1\nscenario = 'a'\nlimits = { a = '1 [degC]' }\n", "file.wrong-kind", "x.toml:1"),
    (
        td.qualify.load_hold,
        DeckError,
        "model = 'a'\nscenario = [1]\nlimits = { a = '1 [degC]' }\n",
        "file.wrong-kind",
        "x.toml:2",
    ),
    (td.qualify.load_hold, DeckError, "model = 'a'\nscenario = 'b'\nlimits = { a = [] }\n", "file.wrong-kind", "x.toml:3, limits.a"),
    (td.load_values, DeckError, "schema = 2\nstage = 1\n", "file.wrong-kind", ""),
    (td.load_values, DeckError, "schema = 1\n", "file.wrong-value", ""),
    (td.load_values, DeckError, "schema = 'x'\n", "file.wrong-value", ""),
    (load_sensors, RecordError, "sensors = 3\n", "file.wrong-kind", ""),
    (load_sensors, RecordError, "[sensors.T1]\nrom = 28\n", "file.wrong-kind", r"sensors\.T1\.rom.*28"),
    (load_programme, RecordError, "steps = 3\n", "file.wrong-kind", ""),
    (load_programme, RecordError, "steps = [{ at = true }]\n", "file.wrong-kind", r"steps\.0\.at"),
    (td.qualify.load_plan, DeckError, "title = 1\n", "plan.incomplete", "x.toml"),
    (td.design.load_study, DeckError, "title = 1\n", "file.wrong-kind", "x.toml:1"),
]


@pytest.mark.parametrize(("load", "error", "text", "code", "match"), FAULTS)
def test_a_fault_is_named_with_its_place(load: Any, error: type[ThermidError], text: str, code: str, match: str, tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_text(text, encoding="utf-8")
    with raises_code(code, error, match=match):
        load(file)


def test_all_faults_are_listed_and_a_long_list_is_counted(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_text("\n".join(f"k{n} = 1" for n in range(30)), encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        td.load_scenario(file)
    named = re.findall(r"'k\d+'", str(caught.value))
    assert (caught.value.code, len(named)) == ("file.unknown-key", 13)
    assert f" {30 - len(named)} " in str(caught.value).splitlines()[-1]


@pytest.mark.parametrize("text", ["", "{", "[1]", "{}", '[{"record": 1}]', "[" * 100_000, "1" * 5000, '"x"', "[null]"])
def test_a_damaged_list_of_looks_forgets_nothing(text: str, tmp_path: Path) -> None:
    (tmp_path / "looks.json").write_text(text, encoding="utf-8")
    with pytest.raises(DeckError, match=r"looks\.json") as refused:
        _read(tmp_path)
    assert refused.value.code == ("file.not-valid" if text[-1:] not in ("]", "}", '"') else "file.wrong-kind")


@pytest.mark.parametrize("text", ["", "[]", '{"locks": 1, "looks": []}', '{"locks": [{}], "looks": []}', '{"locks": [], "looks": [1]}'])
def test_a_damaged_lock_is_no_lock(text: str, tmp_path: Path) -> None:
    file = tmp_path / "plan.lock.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DeckError, match=r"plan\.lock\.json") as refused:
        read_json(file, "lock")
    assert refused.value.code in ("file.not-valid", "file.wrong-kind", "file.key-missing")


WATTS = {"times": ["0 [s]", "1 [h]"], "values": ["1 [W]", "2 [W]"]}


@pytest.mark.parametrize(
    ("call", "code", "match"),
    [
        (lambda: td.Scenario("x", boundaries={"air": {"times": 3, "values": ["1 [degC]"]}}), "value.wrong-kind", "3"),
        (lambda: td.Scenario("x", loads={"q": {**WATTS, "values": [{}, 1]}}), "value.incomplete", r"loads\.q.*'5 \[W\]'"),
        (lambda: td.Scenario("x", loads={"q": True}), "value.incomplete", r"loads\.q.*'5 \[W\]'"),
        (lambda: td.Scenario("x", schedule={"a": {"times": ["0 [s]"], "values": 3}}), "value.wrong-kind", "3"),
        (lambda: td.Scenario("x", initial=3), "value.wrong-kind", ""),
        (lambda: td.Scenario("x", initial={"a": None}), "value.wrong-kind", r"initial\.a"),
        (lambda: td.Scenario("x", environment=[1]), "value.wrong-kind", r"\[1\]"),
        (lambda: td.Scenario("x", gains="a"), "value.wrong-kind", "'a'"),
        (lambda: td.Scenario("x", duration={}), "value.not-an-amount", r"'4 \[s\]'"),
        (lambda: td.Scenario("x", start=[]), "value.wrong-kind", r"\[\].*'24 \[degC\]'.*td\.celsius"),
        (lambda: td.simulation.Environment(humidity=[]), "value.incomplete", r"'5 \[1\]'.*\[\]"),
        (lambda: td.simulation.Environment(gas={}), "value.wrong-kind", ""),
        (lambda: td.simulation.Environment(wind=None), "value.incomplete", ""),
        (lambda: td.Options(error=True), "value.outside-range", ""),
        (lambda: td.Options(max_steps=1.5), "value.outside-range", "max_steps"),
        (lambda: td.Options(method=None), "value.wrong-kind", ""),
        (lambda: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", level={}), "value.wrong-kind", "`level`"),
        (
            lambda: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", predicted=({}, 1)),
            "value.wrong-kind",
            r"SMC-S-016.*'24 \[degC\]'.*td\.celsius",
        ),
        (
            lambda: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", cycles=10**9, hot="60 [degC]", cold="-20 [degC]").steps,
            "cap.exceeded",
            "10000",
        ),
        (lambda: td.read_record("x.csv", "T"), "value.wrong-kind", "`channels`.*'T'"),
        (lambda: td.read_record("x.csv", {"T": "T"}, units={"T": 3}), "value.wrong-kind", "3"),
    ],
)
def test_arguments_of_another_type_are_refused_in_words(call: Any, code: str, match: str) -> None:
    with raises_code(code, match=match):
        call()


PLATE = {
    "title": "plate",
    "needs": ["air"],
    "nodes": {"plate": {"capacitance": "100 [J/K]"}},
    "conductors": {"film": {"kind": "conduction", "between": ["plate", "air"], "conductance": "0.4 [W/K]"}},
    "loads": {"heater": {"into": "plate", "power": "5 [W]"}},
}


def warming(folder: Path) -> td.Record:
    rows = [f"{30 * k},{20.0 + 0.05 * k},20" for k in range(40)]
    (folder / "rig.csv").write_text("\n".join(["time_s,T,ROOM", *rows, ""]), encoding="utf-8")
    return td.read_record(folder / "rig.csv", {"T": {"node": "plate"}, "ROOM": {"boundary": "air"}})


def test_a_prior_without_a_mean_is_about_the_deck_s_value(tmp_path: Path) -> None:
    """It ended with a ValueError behind the fit: a table of one key was unpacked as a pair."""
    given = [{"sd": "0.1 [W/K]"}, ("", "0.1 [W/K]"), {"mean": "0.4 [W/K]", "sd": "0.1 [W/K]"}]
    model, record = td.model_from_dict(PLATE), warming(tmp_path)
    found = [td.calibrate(model, record, ["film.conductance"], priors={"film.conductance": one})["film.conductance"].value for one in given]
    assert found == pytest.approx([found[0]] * 3, rel=1e-9)


@pytest.mark.parametrize(
    ("free", "more", "match"),
    [
        ([{}], {}, "`free`"),
        (3, {}, "`free`"),
        (["film.conductance"], {"priors": {"film.conductance": 3}}, r"plate\.priors\.film\.conductance.*'sd'.*'1 \[K\]'"),
        (["film.conductance"], {"priors": 3}, "`priors`.*3"),
        (["film.conductance"], {"local": 3}, "`local`"),
        (["film.conductance"], {"scenario": [1]}, "`scenario`"),
    ],
)
def test_a_fit_refuses_what_is_no_name_and_no_prior(free: Any, more: dict[str, Any], match: str, tmp_path: Path) -> None:
    with raises_code("value.wrong-kind", match=match):
        td.calibrate(td.model_from_dict(PLATE), warming(tmp_path), free, **more)


def test_what_a_grammar_takes_is_what_its_schema_says() -> None:
    for kind in file_kinds():
        json.dumps(json_schema(kind))
