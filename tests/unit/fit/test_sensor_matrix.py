"""Every key of a sensor against every function and command that takes a fit: a sensor that lags is no reason to end in an error."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.app.objects import fit_object, swap_object
from thermid.app.studio.desk import curves_object
from thermid.app.studio.project import Project
from thermid.app.studio.room import as_json, desk_object, picture, project_object
from thermid.app.studio.work import Work
from thermid.inference.intervals import identifiability
from thermid.measure.records import Record
from thermid.model.tree import save_model
from thermid.prediction.advice import next_test
from thermid.values.store import error_table_of
from unit.fit.bench import HTC, box, log, pair
from unit.fit.project import COOL, write_log

pytestmark = pytest.mark.usefixtures("errors_in_turn")

KEYS = {
    "none": "",
    "offset": 'accuracy = "0.3 [K]"',
    "gain": 'gain_accuracy = "1 [%]"',
    "lag": 'lag = "40 [s]", lag_accuracy = "20 [s]"',
    "mass": 'mass = "2 [g]", specific_heat = "400 [J/(kg K)]"',
    "lead": 'lead = { conductance = "1 [mW/K]", to = "air" }',
    "certificate": 'certificate = { offset = "0.05 [K]", uncertainty = "0.02 [K]" }',
    "range": 'range = ["-40 [degC]", "125 [degC]"]',
    "correlation": 'correlation_time = "5 [min]"',
    "resolution": 'resolution = "0.0625 [K]"',
}
TOGETHER = {
    "none": ("none",),
    "stated errors": ("offset", "gain", "correlation", "range"),
    "lag": ("lag",),
    "nodes of its own": ("mass", "lead"),
    "certificate": ("certificate", "resolution"),
}
"""Every key once, several on one sensor: a key that breaks a result breaks it in company too. Each alone is asked in the campaign."""
OUTER = """
title  = "Shelf"
needs  = ["room"]
offers = ["box.case"]
[submodels]
box = { use = "box.toml", bind = { air = "room" } }
[conductors]
foot = { kind = "conduction", between = ["box.case", "room"], conductance = { value = "0.1 [W/K]", min = 0.01, max = 1 } }
"""
CAMPAIGN = """
title = "One sensor"

[records.bench]
file = "bench.csv"
time = "time_s"
channels = { T = { node = "case", noise = "0.05 [K]"KEY }, ROOM = { boundary = "air" } }

[records.again]
file = "again.csv"
time = "time_s"
channels = { T = { node = "case", noise = "0.05 [K]"KEY }, ROOM = { boundary = "air" } }

[records.shelf]
file = "shelf.csv"
time = "time_s"
channels = { T = { node = "box.case", noise = "0.05 [K]"OUT }, ROOM = { boundary = "room" } }

[[stages]]
name    = "box"
model   = "box.toml"
records = ["bench"]
free    = ["skin.effective_htc", "case.mass"]

[[stages]]
name    = "shelf"
model   = "shelf.toml"
records = ["shelf"]
free    = ["foot.conductance"]
inherit = { box = { stage = "box", as = "fixed" } }

[[verdicts]]
model    = "box"
record   = "again"
criteria = { rmse = "0.5 [K]" }

[joint]
"""
FINISH = {"surfaces/skin/finish": "aluminium, oxidised", "nodes/case/mass/min": 0.5}
HOUR = "1 [h]"


class Cell:
    """The project of some keys on one sensor, with its fits made once."""

    def __init__(self, keys: Sequence[str], folder: Path) -> None:
        self.folder = folder
        said = "".join(f", {KEYS[key]}" for key in keys if KEYS[key])
        save_model(box(FINISH), folder / "box.toml")
        save_model(box({**FINISH, **COOL}), folder / "cool.toml")
        (folder / "thermid.toml").write_text("")
        (folder / "shelf.toml").write_text(OUTER)
        for k, name in enumerate(("bench", "again")):
            data = log(box(FINISH), {HTC: "7 [W/(m^2 K)]"}, {"T": "case"}, samples=31, seed=k, start=f"{24 + 4 * k} [degC]")
            write_log(data, folder / f"{name}.csv")
        shelf, truth = td.load_model(folder / "shelf.toml"), {f"box.{HTC}": "7 [W/(m^2 K)]", "foot.conductance": "0.15 [W/K]"}
        write_log(log(shelf, truth, {"T": "box.case"}, samples=31, seed=2, boundary="room"), folder / "shelf.csv")
        self.path = folder / "campaign.toml"
        self.path.write_text(CAMPAIGN.replace("KEY", said).replace("OUT", said.replace('"air"', '"room"')))

    @cached_property
    def campaign(self) -> td.Campaign:
        return td.run_stages(self.path, cache=self.folder / "results")

    @property
    def fit(self) -> td.Calibration:
        return self.campaign["box"]

    @property
    def record(self) -> Record:
        return self.fit.experiments[0].record

    @cached_property
    def studio(self) -> Project:
        self.campaign  # noqa: B018  the studio finds the stages in the results folder
        project = Project(self.path)
        for name in project.stages:
            project.look(name)
        return project

    def command(self, *words: str) -> object:
        self.campaign  # noqa: B018  a finished stage is not fitted again
        got = CliRunner().invoke(app, list(words))
        assert got.exception is None or isinstance(got.exception, SystemExit), got.exception
        assert got.exit_code in (0, 1), got.output
        return json.loads(got.stdout) if "--json" in words else got.stdout


def finite(value: object) -> None:
    """Fail where a result holds no number, or one that is not finite."""
    assert np.all(np.isfinite(np.asarray(value, dtype=float)))


def validated(c: Cell) -> None:
    (verdict,) = c.campaign.verdicts
    finite([check.found for check in verdict.checks])
    assert verdict.passed


def predicted(c: Cell) -> None:
    hot = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="air", duration=HOUR)
    band = td.predict(c.fit, hot, times=np.arange(0.0, hot.seconds + 1.0, 600.0))["case"]
    finite([band.final.celsius, band.final.error])
    assert set(td.predict(c.fit, hot, times=np.arange(0.0, hot.seconds + 1.0, 600.0)).bands) == {"case", "air"}


def taken_apart(c: Cell) -> None:
    finite(td.inference.split(c.fit)["skin"].emissivity)


def fitted_jointly(c: Cell) -> None:
    assert c.campaign.joint is not None
    finite(list(c.campaign.joint.fitted.values()))
    assert "box" in str(td.inference.credibility(c.campaign))


def criticised(c: Cell) -> None:
    assert "T" in str(td.inference.criticise(c.fit))


def kept(c: Cell) -> None:
    c.fit.save(c.folder / "values.toml")
    again = td.load_values(c.folder / "values.toml")
    assert {p: v.value for p, v in again.items()} == {p: v.value for p, v in c.fit.values.items()}


def balanced(c: Cell) -> None:
    found = td.inference.energy_balance(c.fit, c.record, "3 [h]", limit="100 [K/h]")
    finite([found.total, found.error])
    assert set(found.temperatures) == {"case", "air"}


def profiled(c: Cell) -> None:
    finite([td.inference.profile(c.fit, HTC).low, td.inference.profile(c.fit, HTC).high])


def advised(c: Cell) -> None:
    hot = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="air", duration=HOUR)
    finite([option.error for option in next_test(c.fit, HTC, [td.design.Action("hot", hot)]).options])


def identified(c: Cell) -> None:
    assert HTC in str(identifiability(c.fit))


def bounded(c: Cell) -> None:
    found = td.inference.discrepancy(c.fit)
    kept_errors = error_table_of(c.fit.values.provenance)
    assert kept_errors is not None
    finite(td.inference.ErrorModel.from_dict(kept_errors).covariance)
    assert set(found.conditions) == {"skin"}  # whatever its sensors add to the model
    assert "case" in str(td.inference.plausibility(c.fit))


def foreseen(c: Cell) -> None:
    hot = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="air", duration=HOUR)
    finite(td.design.foresee(td.design.Knowledge.of_source(c.fit), hot).prediction["case"].final.error)
    finite(td.qualify.uncertain_runs(c.fit.model, hot, c.fit, n=4, every=1800.0).temperatures)


def shown(c: Cell) -> None:
    for name in c.studio.stages:
        desk = c.studio.desk(name)
        for answer in (desk_object(desk), curves_object(desk, {}), fit_object(c.studio.done[name])):
            as_json(answer)
        rmse = desk.curves({})[0].curves[0].rmse
        assert rmse == pytest.approx(c.campaign[name].statistics[desk.curves({})[0].name]["T"].rmse, rel=1e-2, abs=1e-3)
    as_json(project_object(c.studio, Work(c.studio).state()))


def drawn(c: Cell) -> None:
    for name in c.studio.stages:
        desk = c.studio.desk(name)
        for time in (0.0, 3600.0):
            assert "<svg" in picture(desk, {}, {"run": 0, "time": time})["svg"]
        as_json([*(q.simulated for q in desk.inputs_of(0)), *(desk.moves(s.path, {}, 0) for s in desk.sliders[:2])])


def swapped(c: Cell) -> None:
    plan = td.design.plan_retune(c.campaign, "box", c.folder / "cool.toml")
    assert plan.touched
    as_json(swap_object(plan))


def commanded(c: Cell) -> None:
    (c.folder / "hot.toml").write_text('start = "room"\nduration = "1 [h]"\n[boundaries]\nroom = "40 [degC]"\n')
    campaign = str(c.path)
    for words in (
        ["calibrate", campaign],
        ["identify", campaign],
        ["credibility", campaign],
        ["predict", campaign, "--stage", "shelf", "--scenario", str(c.folder / "hot.toml")],
        ["swap", campaign, "box", str(c.folder / "cool.toml")],
    ):
        assert c.command(*words, "--json")


def diagnosed(c: Cell) -> None:
    read = log(pair(), {}, {"T": "a.case", "T2": "b.case"}, samples=31, boundary="room")
    part = c.record["T"].part
    worn = read.with_channels(replace(read["T"], part=part and replace(part, lead_to="room" if part.lead_to else "")))
    finite(list(td.inference.diagnose(td.compare(pair(), worn)).groups.values()))


def recovered(c: Cell) -> None:
    found = td.inference.power_history(
        c.fit.model, c.record, "heat", known=[("0 [min]", "60 [min]", "4 [W]")], prior="walk", every="30 [min]"
    )
    finite(found.power)


def reported(c: Cell) -> None:
    page = c.folder / "page.html"
    td.report(c.campaign, to=page)
    assert "shelf" in page.read_text()


CHECKS: dict[str, Callable[[Cell], None]] = {
    "validate": validated,
    "predict": predicted,
    "split": taken_apart,
    "joint": fitted_jointly,
    "criticise": criticised,
    "values": kept,
    "balance": balanced,
    "profile": profiled,
    "next_test": advised,
    "identifiability": identified,
    "discrepancy": bounded,
    "foresee": foreseen,
    "studio": shown,
    "picture": drawn,
    "swap": swapped,
    "diagnose": diagnosed,
    "power history": recovered,
    "command line": commanded,
    "report": reported,
}


SLOW = {"command line", "report"}
"""Checks that are asked of every key in the campaign only; here of one that puts a node of its own into the model."""
ALONE = [pytest.param((key,), id=f"{key} alone", marks=pytest.mark.campaign) for key in KEYS]


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory, errors_in_turn: str) -> Callable[[tuple[str, ...]], Cell]:
    """The cell of some keys, made once."""
    return cache(lambda keys: Cell(keys, tmp_path_factory.mktemp("sensor")))


def test_every_key_is_asked() -> None:
    assert sorted(key for keys in TOGETHER.values() for key in keys) == sorted(KEYS)


@pytest.mark.parametrize("keys", [pytest.param(keys, id=name) for name, keys in TOGETHER.items()] + ALONE)
@pytest.mark.parametrize("check", [c for c in CHECKS if c not in SLOW])
def test_every_key_of_a_sensor_with_every_result(cells: Callable[[tuple[str, ...]], Cell], keys: tuple[str, ...], check: str) -> None:
    CHECKS[check](cells(keys))


@pytest.mark.usefixtures("errors_in_full_here")
@pytest.mark.parametrize("keys", [pytest.param(TOGETHER[name], id=name) for name in ("lag", "nodes of its own")])
def test_every_key_of_a_sensor_with_the_model_of_error(keys: tuple[str, ...], tmp_path: Path) -> None:
    cell = Cell(keys, tmp_path)
    cell.campaign = td.run_stages(cell.path, only={"box"})
    for check in ("predict", "discrepancy"):
        CHECKS[check](cell)


@pytest.mark.parametrize("keys", [pytest.param(("lag",), id="lag"), *ALONE])
@pytest.mark.parametrize("check", sorted(SLOW))
def test_commands_and_pages_of_a_sensor(cells: Callable[[tuple[str, ...]], Cell], keys: tuple[str, ...], check: str) -> None:
    CHECKS[check](cells(keys))
