"""Logs of a swap: those of two loggers, a sensor that sits elsewhere on the new part, and what its first figures compare."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, MissingDataError
from thermid.measure.records import Record
from thermid.model.deck import load_model
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


def test_logs_of_two_loggers(campaign: td.Campaign, tmp_path: Path) -> None:
    deck, again = new_part(campaign, tmp_path, "d")
    plan = td.design.plan_retune(campaign, "x", deck)
    made = plan.run(again)
    check(made)
    assert set(made["part"].sensors) == {"T", "T2"}
    shutil.move(again / "logs" / "second.csv", tmp_path / "gone.csv")
    with raises_code("record.log-missing", MissingDataError):
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
    said = next(k for k, line in enumerate(lines) if "of stage 'part'" in line and "4 W of its deck" in line)
    assert f"{campaign['part']['power'].value:.4g} W" in lines[said]
    assert "no band" in lines[said]
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
        assert [w for w in made.warnings if "TX -0.6" in w] or name == "same"
        assert bool(made.request.held_bias) == (name == "same"), name
