"""Arguments of the wrong kind, and names that nobody knows, are refused in a sentence; what is meant is taken."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import thermid as td
from by_code import raises_code

DECK: dict[str, Any] = {
    "title": "box",
    "needs": ["air"],
    "nodes": {"case": {"capacitance": "400 [J/K]"}},
    "conductors": {"film": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.8 [W/K]"}},
    "loads": {"heat": {"into": "case", "power": "5 [W]"}},
}
BOX = td.model_from_dict(DECK)
BENCH = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="air", duration="4 [h]")
RUN = td.simulate(BOX, BENCH, every="2 [min]")
COLUMNS: dict[str, Any] = {"T": {"unit": "degC", "node": "case", "noise": "0.1 [K]"}, "ROOM": {"unit": "degC", "boundary": "air"}}


def frame() -> Any:
    noise = 0.1 * np.random.default_rng(1).standard_normal((2, RUN.times.size))
    return pd.DataFrame({"T": RUN["case"].kelvin - 273.15 + noise[0], "ROOM": 20.0 + noise[1]}, index=RUN.times)


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    return td.calibrate(BOX, td.Record.from_dataframe("log", frame(), COLUMNS), ["case.capacitance"])


@pytest.mark.parametrize("ask", ["predict", "foresee", "uncertain_runs"])
def test_an_unknown_source_of_errors_is_refused(fit: td.Calibration, ask: str) -> None:
    asked = {
        "predict": lambda without: td.predict(fit, BENCH, without=without),
        "foresee": lambda without: td.design.foresee(td.design.Knowledge.of_source(fit), BENCH, without=without),
        "uncertain_runs": lambda without: td.qualify.uncertain_runs(BOX, BENCH, fit, n=8, without=without),
    }[ask]
    with raises_code("name.unknown", td.errors.ScenarioError, "'structural'"):
        asked(("structurl",))
    with raises_code("value.wrong-kind", td.errors.DeckError):
        asked("structural")
    assert asked(("structural", "misfit", "hidden defects")) is not None


def test_values_are_taken_alone_in_several_and_from_files(fit: td.Calibration, tmp_path: Path) -> None:
    file = tmp_path / "box.values.toml"
    fit.save(file)
    several: tuple[Any, ...] = (fit, fit.values, (fit.values,), [fit], file, str(file), (file,))
    ends = [td.predict(td.design.Knowledge(fit.model, values), BENCH)["case"].final.celsius for values in several]
    assert ends == pytest.approx([ends[0]] * len(ends), abs=1e-6)
    for values in several:
        assert td.qualify.uncertain_runs(BOX, BENCH, values, n=2).failed == {}
    for wrong in (5, [5], None, BOX, {"case.capacitance": "5 [J/K]"}):
        for door in (td.design.Knowledge, lambda m, v: td.qualify.uncertain_runs(m, BENCH, v)):
            with raises_code("value.wrong-kind", td.errors.DeckError):
                door(BOX, wrong)


def test_values_that_physics_forbids_are_refused_with_the_dictionary() -> None:
    surface = {"skin": {"of": "case", "to": "air", "area": "-0.1 [m^2]", "emissivity": 1.2, "htc": "5 [W/(m^2 K)]"}}
    wrong = DECK | {"nodes": {"case": {"mass": "-1 [kg]", "specific_heat": "900 [J/(kg K)]"}}, "surfaces": surface}
    with raises_code("value.outside-range", td.errors.DeckError) as refused:
        td.model_from_dict(wrong)
    for name in ("case.mass", "skin.area", "skin.emissivity"):
        assert name in str(refused.value)


def test_a_record_without_any_accuracy_is_named_in_the_first_lines(fit: td.Calibration) -> None:
    (row,) = [line for line in str(fit).splitlines()[:4] if "accuracy" in line]
    assert "T, ROOM" in row
    assert "accuracy = '0.5 [K]'" in row
    stated = COLUMNS | {"T": COLUMNS["T"] | {"accuracy": "0.3 [K]"}}
    for record in (td.Record.from_dataframe("log", frame(), stated), td.Record.from_dataframe("log", frame(), COLUMNS, synthetic=True)):
        other = td.calibrate(BOX, record, ["case.capacitance"])
        assert not [r for r in other.inputs.assumed if r.kind == "accuracy"]
