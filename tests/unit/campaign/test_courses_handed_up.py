"""A stage with a course of an unlogged power hands up what it knows of its deck; the course is of its own logs."""

from __future__ import annotations

from pathlib import Path

import pytest

from thermid.campaign._stages import Campaign, run_stages
from thermid.fit.power import PowerCourse
from thermid.model.tree import load_model
from thermid.prediction._known import known_of
from thermid.prediction.bands import predict
from thermid.simulation.runs import Scenario
from thermid.values.store import Filed, load_store, load_values
from unit.fit.project import write_log
from unit.fit.trees import joined, leaf, record_of, record_table, stage_table, write_decks

GYRO = leaf("gyro", 0.20)
UNIT = joined("unit", {"x": GYRO}, (0.30, 0.25))
G = "g.conductance"
COURSE = 'courses = { start_up = { into = "n", shape = "step", power = "1 [W]" } }'


def two_stages(folder: Path, inherit: str, course: str = COURSE, seed: int = 1) -> Campaign:
    """A gyro with 1.5 W more for the first 1200 s of its log, and a unit with it, whose log begins when that is over."""
    write_decks(folder, UNIT)
    (folder / "logs").mkdir()
    gyro, unit = (load_model(folder / f"{p.definition}.toml") for p in (GYRO, UNIT))
    more = PowerCourse("start_up", "n", "step", 1200.0, 1.5).in_model(gyro)
    write_log(record_of(more, GYRO.values(), GYRO.nodes(), "gyro", seed, 0.02, {}), folder / "logs" / "gyro.csv")
    write_log(record_of(unit, UNIT.values(), UNIT.nodes(), "unit", seed + 1, 0.02, {}), folder / "logs" / "unit.csv")
    stages = [
        stage_table("gyro", GYRO, [G], "", course),
        stage_table("unit", UNIT, ["to_x.conductance", "e.conductance"], f'x = {{ stage = "gyro", {inherit} }}'),
    ]
    path = folder / "campaign.toml"
    write_log(record_of(unit, UNIT.values(), UNIT.nodes(), "unit2", seed + 2, 0.02, {}), folder / "logs" / "unit2.csv")
    tables = [
        record_table(GYRO),
        record_table(UNIT),
        record_table(UNIT).replace("records.unit", "records.unit2").replace("unit.csv", "unit2.csv"),
    ]
    verdict = '[[verdicts]]\nmodel = "unit"\nrecord = "unit2"\ncriteria = { rmse = "0.5 [K]" }\n'
    path.write_text("\n".join(['title = "Start-up"', *tables, *stages, verdict]))
    return run_stages(path)


@pytest.mark.parametrize("how", ['as = "fixed"', 'as = "prior"', 'as = "prior", without = ["start_up.power"]'])
def test_a_stage_with_a_course_hands_up_its_deck(tmp_path: Path, how: str) -> None:
    found = two_stages(tmp_path, how)
    gyro, unit = found["gyro"], found["unit"]
    assert abs(gyro["start_up.power"].value - 1.5) < 4.0 * gyro["start_up.power"].error < 0.1
    for path, true in UNIT.values().items():
        assert abs(unit.store[path].value - true) < 4.0 * unit.store.error(path), path
    assert not [p for p in unit.store.parameters if "start_up" in p]
    assert [v.passed for v in found.verdicts] == [True]
    lines = [x for x in str(unit).splitlines() if "start_up.power" in x]
    assert [x.strip().startswith("check:") for x in lines] == ([] if "without" in how else [True]), lines
    assert "not inherited" not in str(unit)
    for file, fit in zip(found.save(tmp_path / "out"), (gyro, unit), strict=True):
        assert load_store(file)[0] == fit.store


def test_the_values_file_of_such_a_stage_is_of_its_deck(tmp_path: Path) -> None:
    gyro = two_stages(tmp_path, 'as = "fixed"')["gyro"]
    gyro.save(tmp_path / "v.toml")
    deck = load_model(tmp_path / "gyro.toml")
    laid = Filed.read(tmp_path / "v.toml", deck)
    assert laid.model.at(G).expression.literal.value == gyro[G].value
    assert ["start_up.power" in line for line in laid.lines] == [True]
    scenario = Scenario("s", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration=3600.0)
    by_file, by_fit = (predict(known_of(one, deck), scenario) for one in (load_values(tmp_path / "v.toml"), gyro))
    assert by_file["n"].final.celsius == by_fit["n"].final.celsius
    assert by_file["n"].final.error == by_fit["n"].final.error > 0.0


def test_what_is_kept_back_leaves_nothing_in_what_is_told_of_a_fit(tmp_path: Path) -> None:
    """Of any value: what the fit says of its structure named it, and a prediction above moved it."""
    unit = two_stages(tmp_path, 'as = "fixed", without = ["g.conductance"]', course="")["unit"]
    told = unit.store.provenance["gyro"]["structural"]
    assert told["names"] == []
    assert all(moved == [] for moved in told["assumed"].values())
