"""Every kind of file has one grammar: what does not follow it is refused with file, line and key, all faults at once."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest

import thermid as td
from thermid.acquire.bench_files import load_programme, load_sensors
from thermid.errors import DeckError, RecordError, ScenarioError, ThermidError
from thermid.extensions import GRAMMARS, json_schema
from thermid.judge.limits import load_limits
from thermid.judge.verdict import looks_at
from thermid.toml_files import read_json

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("kind", GRAMMARS)
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
    (td.load_scenario, ScenarioError, "duration = true\n", "x.toml:1, duration: a text with its unit"),
    (td.load_scenario, ScenarioError, "\n[boundaries]\nair = [1]\n", "x.toml:3, boundaries.air: a text with its unit"),
    (td.load_scenario, ScenarioError, "[loads]\nq = { times = ['0 [s]'], valus = [] }\n", "x.toml:2, loads.q.values: is missing"),
    (td.load_scenario, ScenarioError, "[loads]\nq = { mean = 1, amplitude = true, period = '1 [h]' }\n", "loads.q.amplitude: a text with"),
    (td.load_scenario, ScenarioError, "[environment]\nair = 3\n", "x.toml:2, environment.air: a table is needed, not 3"),
    (td.load_scenario, ScenarioError, "[environment.air]\npresure = '1 [bar]'\n", r"air\.presure: .* Did you mean 'pressure'"),
    (td.load_scenario, ScenarioError, "[irradiation.lid]\nsky_view = 2.0\n", r"x.toml:2, irradiation\.lid\.sky_view"),
    (td.load_scenario, ScenarioError, "[gains]\nq = 1\n", "x.toml:2, gains.q: a text is needed, not 1"),
    (td.load_scenario, ScenarioError, "as_printed = 'yes'\n", "as_printed: true or false is needed, not 'yes'"),
    (td.load_scenario, ScenarioError, "[weather]\nfile = 3\n", "x.toml:2, weather.file: a text is needed"),
    (td.load_scenario, ScenarioError, "[weather]\nyear = 2025.5\n", "x.toml:2, weather.year"),
    (td.load_scenario, ScenarioError, "[wind.lid]\nlength = '1 [m]'\n", "wind.lid.calm: is missing"),
    (td.load_scenario, ScenarioError, "[ascent]\nflow = { lid = 2.0 }\n", "ascent.flow.lid"),
    (load_limits, ScenarioError, "[box]\nnode = 1\noperating = ['', '5 [degC]']\n", "x.toml:2, box.node: a text is needed, not 1"),
    (load_limits, ScenarioError, "box = 1\n", "x.toml:1, box: a table is needed"),
    (load_limits, ScenarioError, "[box]\nnode = 'a'\noperating = [{}, 1]\n", r"x.toml:3, box\.operating\.0: a text with its unit"),
    (td.load_profile, ScenarioError, "[profile]\nhot = true\n", "x.toml:2, profile.hot: a text with its unit"),
    (td.load_profile, ScenarioError, "[profile]\nsteps = 3\n", "x.toml:2, profile.steps: a list is needed"),
    (td.load_profile, ScenarioError, "[profile]\nsteps = [{ wait = 'no' }]\n", r"profile\.steps\.0\.wait: true or false"),
    (td.load_profile, ScenarioError, "profile = 3\n", "x.toml:1, profile: a table is needed"),
    (td.load_hold, DeckError, "model = 1\nscenario = 'a'\nlimits = { a = '1 [degC]' }\n", "x.toml:1, model: a text is needed"),
    (
        td.load_hold,
        DeckError,
        "model = 'a'\nscenario = [1]\nlimits = { a = '1 [degC]' }\n",
        "x.toml:2, scenario: a text or a list",
    ),
    (td.load_hold, DeckError, "model = 'a'\nscenario = 'b'\nlimits = { a = [] }\n", "x.toml:3, limits.a: a text with its unit"),
    (td.load_values, DeckError, "schema = 2\nstage = 1\n", "this is no values file of thermid"),
    (td.load_values, DeckError, "schema = 1\n", "this is no values file of thermid"),
    (td.load_values, DeckError, "schema = 'x'\n", "this is no values file of thermid"),
    (load_sensors, RecordError, "sensors = 3\n", "sensors: a table is needed"),
    (load_sensors, RecordError, "[sensors.T1]\nrom = 28\n", r"sensors\.T1\.rom: a text is needed, not 28"),
    (load_programme, RecordError, "steps = 3\n", "steps: a list is needed"),
    (load_programme, RecordError, "steps = [{ at = true }]\n", r"steps\.0\.at: a text with its unit"),
    (td.load_plan, DeckError, "title = 1\n", "x.toml"),
    (td.load_study, DeckError, "title = 1\n", r"x.toml:1, title: a text is needed"),
]


@pytest.mark.parametrize(("load", "error", "text", "words"), FAULTS)
def test_a_fault_is_named_with_its_place(load: Any, error: type[ThermidError], text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(error, match=words):
        load(file)


def test_all_faults_are_listed_and_a_long_list_is_counted(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_text("\n".join(f"k{n} = 1" for n in range(30)), encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        td.load_scenario(file)
    assert str(caught.value).count("is no field here") == 13
    assert str(caught.value).endswith("and 17 more faults.")


@pytest.mark.parametrize("text", ["", "{", "[1]", "{}", '[{"record": 1}]', "[" * 100_000, "1" * 5000, '"x"', "[null]"])
def test_a_damaged_list_of_looks_forgets_nothing(text: str, tmp_path: Path) -> None:
    (tmp_path / "looks.json").write_text(text, encoding="utf-8")
    with pytest.raises(DeckError, match="the file is damaged"):
        looks_at(tmp_path, "x")


@pytest.mark.parametrize("text", ["", "[]", '{"locks": 1, "looks": []}', '{"locks": [{}], "looks": []}', '{"locks": [], "looks": [1]}'])
def test_a_damaged_lock_is_no_lock(text: str, tmp_path: Path) -> None:
    file = tmp_path / "plan.lock.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DeckError, match="it is no lock of a plan any more"):
        read_json(file, "lock")


def test_what_a_grammar_takes_is_what_its_schema_says() -> None:
    for kind in GRAMMARS:
        json.dumps(json_schema(kind))
