"""Logs of a swap: those of two loggers, a sensor that sits elsewhere on the new part, and what its first figures compare."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import app
from thermid.base.errors import DeckError, MissingDataError, code_of
from thermid.campaign.stages import check_replacement, new_logs
from thermid.inference.criticism import Mistakes
from thermid.measure.records import Record
from thermid.model.tree import load_model
from thermid.prediction.bands import Knowledge
from thermid.values.store import Filed
from unit.fit.bench import log
from unit.fit.project import write_log

PART = """title = "{title}"
needs = ["air"]
offers = ["case"]

[parameters]
power = {{ value = "{power} [W]", min = 0.1, max = 20 }}

[nodes]
case = {{ capacitance = "500 [J/K]" }}
{seat} = {{ capacitance = "20 [J/K]" }}

[conductors]
seat = {{ kind = "conduction", between = ["case", "{seat}"], conductance = "2 [W/K]" }}
skin = {{ kind = "conduction", between = ["{seat}", "air"], conductance = {{ value = "0.15 [W/K]", min = 0.01, max = 2 }} }}

[loads]
heat = {{ into = "case", power = "power" }}
"""
UNIT = """title = "Unit"
needs = ["air"]
submodels = { x = { use = "part.toml", bind = { air = "air" } } }

[nodes]
plate = { capacitance = "900 [J/K]" }

[conductors]
foot = { kind = "conduction", between = ["x.case", "plate"], conductance = { value = "0.5 [W/K]", min = 0.05, max = 5 } }
face = { kind = "conduction", between = ["plate", "air"], conductance = "0.4 [W/K]" }
"""
CAMPAIGN = """title = "Two loggers"

[records.part]
file = "logs/part.csv"
time = "time_s"
joined = { record = "second", offset = "0 [s]" }
channels = { T = { node = "d", noise = "0.03 [K]" }, AIR = { boundary = "air" } }

[records.second]
file = "logs/second.csv"
time = "time_s"
channels = { T2 = { node = "case", noise = "0.03 [K]" } }

[records.unit]
file = "logs/unit.csv"
time = "time_s"
channels = { TX = { node = "x.d", noise = "0.03 [K]" }, TP = { node = "plate", noise = "0.03 [K]" }, AIR = { boundary = "air" } }

[[stages]]
name = "part"
model = "part.toml"
records = ["part"]
free = ["power", "skin.conductance"]

[[stages]]
name = "unit"
model = "unit.toml"
records = ["unit"]
free = ["foot.conductance"]
inherit = { x = { stage = "part" } }
"""
SKIN = "skin.conductance"


def written(folder: Path, unit: td.Model, power: float, skin: float, seat: str, seed: int) -> None:
    """Logs of a part by two loggers and of the unit with it."""
    part = unit.submodel("x")
    truth = {"power": f"{power} [W]", SKIN: f"{skin} [W/K]"}
    folder.mkdir(exist_ok=True)
    both = log(part, truth, {"T": seat, "T2": "case"}, noise=0.03, samples=61, seed=seed)
    write_log(renamed(both, {"T": "T", "ROOM": "AIR"}), folder / "logs" / "part.csv")
    write_log(renamed(both, {"T2": "T2"}), folder / "logs" / "second.csv")
    hidden = {f"x.{p}": v for p, v in truth.items()} | {"foot.conductance": "0.7 [W/K]"}
    seen = log(unit, hidden, {"TX": f"x.{seat}", "TP": "plate"}, noise=0.03, samples=61, seed=seed + 1)
    write_log(renamed(seen, {"TX": "TX", "TP": "TP", "ROOM": "AIR"}), folder / "logs" / "unit.csv")


def renamed(record: Record, names: dict[str, str]) -> Record:
    """Some channels of a record under other names."""
    return replace(record, channels={new: replace(record[old], name=new) for old, new in names.items()})


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> td.Campaign:
    folder = tmp_path_factory.mktemp("swap_logs")
    (folder / "thermid.toml").write_text("")
    (folder / "part.toml").write_text(PART.format(title="Old", power=2, seat="d"))
    (folder / "unit.toml").write_text(UNIT)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    written(folder, load_model(folder / "unit.toml"), 2.3, 0.2, "d", 1)
    return td.run_stages(folder / "campaign.toml")


def new_part(campaign: td.Campaign, folder: Path, seat: str) -> tuple[Path, Path]:
    """The deck of a new part, and a folder with the logs of its tests."""
    deck = folder / "new.toml"
    deck.write_text(PART.format(title="New", power=4, seat=seat))
    written(folder / "again", campaign["unit"].model.replace("x", load_model(deck)), 4.4, 0.25, seat, 11)
    return deck, folder / "again"


def check(made: td.Campaign) -> None:
    for stage, path, true in (("part", "power", 4.4), ("part", SKIN, 0.25), ("unit", "foot.conductance", 0.7)):
        value = made[stage].store[path]
        assert abs(value.value - true) < 4.0 * made[stage].store.error(path), path


def test_a_value_that_acts_in_one_of_two_records_is_retuned(tmp_path: Path) -> None:
    """Gas between the part and its plate: the last record is in vacuum, where it moves no sensor."""
    foot = 'foot = { kind = "conduction", between = ["x.case", "plate"], conductance = { value = "0.5 [W/K]", min = 0.05, max = 5 } }'
    gas = """foot = { kind = "conduction", between = ["x.case", "plate"], conductance = "0.1 [W/K]" }
film = { kind = "gas", between = ["x.case", "plate"], area = "0.02 [m^2]", gap = { value = "1 [mm]", min = "0.1 [mm]", max = "9 [mm]" } }"""
    (tmp_path / "thermid.toml").write_text("")
    (tmp_path / "part.toml").write_text(PART.format(title="Old", power=2, seat="d"))
    (tmp_path / "unit.toml").write_text(UNIT.replace(foot, gas))
    both = CAMPAIGN.replace('records = ["unit"]\nfree = ["foot.conductance"]', 'records = ["unit", "empty"]\nfree = ["film.gap"]')
    empty = CAMPAIGN[CAMPAIGN.index("[records.unit]") : CAMPAIGN.index("[[stages]]")].replace("unit", "empty")
    bare = both.replace("[[stages]]", f'{empty}environment = {{ "*" = {{ pressure = "0 [Pa]" }} }}\n\n[[stages]]', 1)
    (tmp_path / "campaign.toml").write_text(bare)
    unit = load_model(tmp_path / "unit.toml")
    part = unit.submodel("x")
    alone = log(part, {}, {"T": "d", "T2": "case"}, noise=0.03, samples=61)
    write_log(renamed(alone, {"T": "T", "ROOM": "AIR"}), tmp_path / "logs" / "part.csv")
    write_log(renamed(alone, {"T2": "T2"}), tmp_path / "logs" / "second.csv")
    for name, conductance in (("unit", 0.505), ("empty", 0.1)):  # 0.1 W/K and 1.3 mm of air
        (tmp_path / "truth.toml").write_text(UNIT.replace(foot, foot.replace("0.5 [", f"{conductance} [")))
        read = log(load_model(tmp_path / "truth.toml"), {}, {"TX": "x.d", "TP": "plate"}, noise=0.03, samples=61)
        write_log(renamed(read, {"TX": "TX", "TP": "TP", "ROOM": "AIR"}), tmp_path / "logs" / f"{name}.csv")
    (tmp_path / "new.toml").write_text(PART.format(title="New", power=2, seat="d"))
    plan = td.design.plan_retune(td.run_stages(tmp_path / "campaign.toml"), "x", tmp_path / "new.toml")
    (touch,) = (t for t in plan.touched if t.path == "film.gap")
    assert touch.kelvin > 0.1
    assert not touch.held


def test_logs_of_two_loggers(campaign: td.Campaign, tmp_path: Path) -> None:
    deck, again = new_part(campaign, tmp_path, "d")
    plan = td.design.plan_retune(campaign, "x", deck)
    made = plan.run(again)
    check(made)
    assert set(made["part"].sensors) == {"T", "T2"}
    shutil.move(again / "logs" / "second.csv", tmp_path / "gone.csv")
    with raises_code("record.log-missing", MissingDataError):
        plan.run(again)


def test_one_short_test_of_the_new_part_is_enough(campaign: td.Campaign, tmp_path: Path) -> None:
    """Of two tests that a stage was fitted to one is made again: what is not tells nothing, and is named."""
    deck, again = new_part(campaign, tmp_path, "d")
    folder = tmp_path / "two"
    assert campaign.source is not None
    shutil.copytree(campaign.source.path.parent, folder, ignore=shutil.ignore_patterns("results"))
    shutil.copy(folder / "logs" / "unit.csv", folder / "logs" / "later.csv")
    block = CAMPAIGN[CAMPAIGN.index("[records.unit]") : CAMPAIGN.index("[[stages]]")]
    later = block.replace("records.unit", "records.later").replace("unit.csv", "later.csv")
    twice = CAMPAIGN.replace(block, block + later).replace('records = ["unit"]', 'records = ["unit", "later"]')
    (folder / "campaign.toml").write_text(twice)
    plan = td.design.plan_retune(td.run_stages(folder / "campaign.toml"), "x", deck)
    assert plan.tests == ("part", "unit", "later")
    check_replacement(folder / "campaign.toml", "x", deck, new_logs(folder / "campaign.toml", again))
    made = plan.run(again)
    check(made)
    assert [*made["unit"].records] == ["unit"]
    assert "No new log of later" in made.note
    (again / "logs" / "unit.csv").unlink()
    with raises_code("record.log-missing", MissingDataError, match="unit"):
        plan.run(again)


def test_a_sensor_that_sits_elsewhere_on_the_new_part(campaign: td.Campaign, tmp_path: Path) -> None:
    deck, again = new_part(campaign, tmp_path, "cover")
    plan = td.design.plan_retune(campaign, "x", deck)
    assert [line for line in str(plan).splitlines() if "'d'" in line and "TX" in line]
    with raises_code("campaign.refused", DeckError, match="'d'"):
        plan.run(again)
    placed = td.design.plan_retune(campaign, "x", deck, sensors={"d": "cover"})
    check(placed.run(again))
    assert set(placed.after) == {"TX", "TP"}
    with raises_code("name.unknown", match="'lid'"):
        td.design.plan_retune(campaign, "x", deck, sensors={"d": "lid"})
    with pytest.raises(td.ThermidError, match="'e'"):
        td.design.plan_retune(campaign, "x", deck, sensors={"e": "cover"})


def test_the_first_figures_say_whose_power_they_compare(campaign: td.Campaign, tmp_path: Path) -> None:
    deck, _ = new_part(campaign, tmp_path, "d")
    lines = str(td.design.plan_retune(campaign, "x", deck)).splitlines()
    said = next(k for k, line in enumerate(lines) if re.search(r"'part' .* 4 W ", line))
    assert f"{campaign['part']['power'].value:.4g} W" in lines[said]
    figures = [k for k, line in enumerate(lines) if " K at rest" in line or "degC" in line]
    assert said < min(figures)


LATE = CAMPAIGN.replace('file = "logs/unit.csv"', 'file = "logs/unit.csv"\njoined = { record = "supply", offset = ["-90 [s]", "90 [s]"] }')
LATE = LATE.replace('noise = "0.03 [K]" }', 'noise = "0.03 [K]", accuracy = "0.3 [K]" }').replace('"power", ', "")
LATE = LATE.replace(
    "[[stages]]", '[records.supply]\nfile = "logs/supply.csv"\ntime = "time_s"\nchannels = { W = { load = "x.heat" } }\n\n[[stages]]', 1
)
SWITCHED = (0.0, 3000.0, 6200.0, 9500.0, 13000.0), (2.0, 6.0, 1.0, 5.0, 2.0)


def switched(folder: Path, unit: td.Model, values: tuple[float, float], offset: float, bias: dict[str, float], seed: int) -> None:
    """Logs of a part at the power of its deck, and of the unit with it: a supply that switches, whose clock is not that of the others."""
    written(folder, unit, 2.0, values[0], "d", seed)
    hidden = {f"x.{SKIN}": f"{values[0]} [W/K]", "foot.conductance": f"{values[1]} [W/K]"}
    loads = {"x.heat": {"times": [f"{t} [s]" for t in SWITCHED[0]], "values": [f"{w} [W]" for w in SWITCHED[1]], "hold": True}}
    seen = log(unit, hidden, {"TX": "x.d", "TP": "plate"}, loads=loads, bias=bias, noise=0.03, seed=seed)
    write_log(renamed(seen, {"TX": "TX", "TP": "TP", "ROOM": "AIR"}), folder / "logs" / "unit.csv")
    times = np.arange(0.0, 18001.0, 10.0)
    watts = np.array(SWITCHED[1])[np.searchsorted(SWITCHED[0], np.maximum(times + offset, 0.0), side="right") - 1]
    np.savetxt(folder / "logs" / "supply.csv", np.column_stack([times, watts]), delimiter=",", header="time_s,W [W]", comments="")


def test_the_instruments_of_another_logger(tmp_path: Path) -> None:
    """Constant errors of the old logger, fixed, pushed what they misfit into the clock: -20 +- 19 s."""
    (tmp_path / "thermid.toml").write_text("")
    (tmp_path / "part.toml").write_text(PART.format(title="Old", power=2, seat="d"))
    (tmp_path / "unit.toml").write_text(UNIT)
    (tmp_path / "campaign.toml").write_text(LATE)
    unit, new = load_model(tmp_path / "unit.toml"), tmp_path / "new.toml"
    new.write_text(PART.format(title="New", power=2, seat="d"))
    before = {"TX": 0.3, "TP": -0.2}
    switched(tmp_path, unit, (0.2, 0.7), 0.0, before, 1)
    plan = td.design.plan_retune(td.run_stages(tmp_path / "campaign.toml"), "x", new)
    for name, bias in (("other", {"TX": -0.3, "TP": 0.25}), ("same", before)):
        switched(tmp_path / name, unit, (0.25, 0.6), -36.7, bias, 11)
        made = plan.run(tmp_path / name)["unit"]
        clock = next(i for i in made.local if i.name == "clock offset")
        assert abs(clock.value + 36.7) < 3.0 * clock.error < 10.0, name
        assert abs(made.store["foot.conductance"].value - 0.6) < 3.0 * made.store.error("foot.conductance"), name
        assert made.chi_square < 1.2 * made.freedom, name
        assert [w for w in made.warnings if "TX -0.59 K" in w] or name == "same"
        assert bool(made.request.held_bias) == (name == "same"), name


ONE = """title = "One unit"

[records.unit]
file = "../logs/unit.csv"
time = "time_s"
joined = { record = "supply", offset = "0 [s]" }
channels = { TX = { node = "x.d", noise = "0.03 [K]", accuracy = "0.3 [K]", lag = "60 [s]", lag_accuracy = "30 [s]" }, TP = { node = "plate", noise = "0.03 [K]", accuracy = "0.3 [K]" }, AIR = { boundary = "air" } }

[records.supply]
file = "../logs/supply.csv"
time = "time_s"
channels = { W = { load = "x.heat" } }

[[stages]]
name = "unit"
model = "../unit.toml"
records = ["unit"]
free = ["x.skin.conductance", "foot.conductance", "face.conductance"]

[predictions.hot]
scenario = "../hot.toml"
limits = { "x.case" = ["0 [degC]", "30 [degC]"] }
"""  # noqa: E501


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of a unit, in a folder of its own beside the logs."""
    root = tmp_path_factory.mktemp("one")
    (root / "thermid.toml").write_text("")
    (root / "part.toml").write_text(PART.format(title="Old", power=2, seat="d"))
    (root / "unit.toml").write_text(UNIT)
    (root / "hot.toml").write_text('title = "hot"\nstart = "40 [degC]"\nduration = "5 [h]"\nboundaries = { air = "40 [degC]" }\n')
    (root / "own").mkdir()
    (root / "own" / "campaign.toml").write_text(ONE)
    unit = load_model(root / "unit.toml")
    (root / "new.toml").write_text(PART.format(title="New", power=0.1, seat="d"))
    switched(root, unit, (0.2, 0.7), 0.0, {}, 1)
    swapped = unit.replace("x", load_model(root / "new.toml"))
    switched(root / "same", swapped, (0.25, 0.6), 0.0, {}, 11)
    switched(root / "other", swapped.with_values({"face.conductance": "0.9 [W/K]"}), (0.25, 0.6), 0.0, {}, 11)
    for name in ("same", "other"):
        for log_file in ("unit.csv", "supply.csv"):
            shutil.move(root / name / "logs" / log_file, root / name / log_file)
    return root


def test_what_stays_is_known_as_before(own: Path) -> None:
    """Values that stay keep the model of error of the fit before, so bands far from the part stay; lags that it found hold."""
    before = td.run_stages(own / "own" / "campaign.toml", cache=own / "kept")
    plan = td.design.plan_retune(before, "x", own / "new.toml")
    assert {*plan.freed} == {"unit: x.skin.conductance", "unit: foot.conductance"}, "though 25 % of the joint move no sensor by 0.05 K"
    assert [line for line in str(plan).splitlines() if line.endswith("'supply' 0 [s]")]
    made = plan.run(own / "same")["unit"]
    lag = before["unit"].values["lag of TX"].value
    assert made.request.records[0].channels["TX"].part.lag == lag < 50.0
    (errors,) = Knowledge.of_source(made).errors
    assert {"face.conductance", "foot.conductance", f"x.{SKIN}"} <= {*errors.seen}
    way = errors.ways[0]
    for path, fit in (("face.conductance", before["unit"]), ("foot.conductance", made)):
        assert way.values[path] == pytest.approx(fit.fitted[path], abs=0.1), path
    assert len(way.root) == len(way.values) + len(way.columns) == len(way.places)
    scenario = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="40 [degC]", duration="5 [h]")
    bands = [td.predict(fit, scenario)["plate"] for fit in (before["unit"], made)]
    assert bands[1].error[-1] < 1.3 * bands[0].error[-1]


def test_values_that_new_logs_contradict_are_not_credible(own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The face, which stays fixed, carries twice the heat by the new logs: exit code 1, and what rests on it says so."""
    for sought, nothing in (("prediction._predict.explained", ()), ("campaign._stages.mistakes_of", Mistakes("unit"))):
        monkeypatch.setattr(f"thermid.{sought}", lambda fit, nothing=nothing: nothing)  # what would explain it takes longest
    call = ["swap", str(own / "own" / "campaign.toml"), "x", str(own / "new.toml"), "--new-data"]
    done = CliRunner().invoke(app, [*call, str(own / "other"), "--results", str(own / "kept"), "--to", str(tmp_path / "new")])
    assert done.exit_code == 1, done.output
    assert done.output.startswith("NOT CREDIBLE: ")
    assert "face.conductance, " in done.output
    assert re.search(r" of \d+ degC by \d+\.\d\d K; 95 % ", done.output)
    deck, values = tmp_path / "new" / "decks" / "unit.toml", tmp_path / "new" / "unit.values.toml"
    told = CliRunner().invoke(app, ["predict", str(deck), "--values", str(values), "--scenario", str(own / "hot.toml")])
    assert told.exit_code == 1, told.output
    assert told.output.startswith("NOT CREDIBLE: ")


def test_logs_that_are_not_there_are_missed_before_any_fit(own: Path, tmp_path: Path) -> None:
    call = ["swap", str(own / "own" / "campaign.toml"), "x", str(own / "no_deck.toml"), "--new-data", str(tmp_path)]
    done = CliRunner().invoke(app, call)
    assert code_of(str(done.exception)) == "record.log-missing", "and not that the deck is missing, which is found after the fits"


def test_a_log_that_is_due_whatever_stages_find_is_missed_before_any_fit(campaign: td.Campaign, own: Path, tmp_path: Path) -> None:
    """With a log of another test in the folder they were missed after all stages had run, 16 s of work in a small campaign."""
    (tmp_path / "supply.csv").write_text("")
    call = ["swap", str(own / "own" / "campaign.toml"), "x", str(own / "new.toml"), "--new-data", str(tmp_path)]
    assert code_of(str(CliRunner().invoke(app, [*call, "--results", str(tmp_path / "kept")]).exception)) == "record.log-missing"
    assert not (tmp_path / "kept").exists(), "no stage ran"
    assert campaign.source is not None
    deck, again = new_part(campaign, tmp_path, "d")
    (again / "logs" / "part.csv").unlink()
    with raises_code("record.log-missing", MissingDataError):
        check_replacement(campaign.source.path, "x", deck, new_logs(campaign.source.path, again))


def test_the_written_deck_has_the_text_of_every_start(campaign: td.Campaign, tmp_path: Path) -> None:
    """A joint that starts with the value of the old one had that as its deck's text: its value was ignored with the deck written."""
    deck, again = new_part(campaign, tmp_path, "d")
    plan = td.design.plan_retune(campaign, "x", deck)
    (unit,) = (p for p in plan.run(again, part_only=True).save(tmp_path) if p.name == "unit.values.toml")
    read = Filed.read(unit, plan.deck)
    assert not read.gone
    assert f"{read.model.at('foot.conductance').text}" != f"{plan.deck.at('foot.conductance').text}"
