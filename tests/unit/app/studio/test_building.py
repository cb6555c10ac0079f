"""Models built by commands: every step a deck, one undo over deck, campaign and places, nothing lost, nothing of others overwritten."""

from __future__ import annotations

import json
import random
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from hand_written import hand_written
from planted import campaign
from thermid.app.studio.building import CARD_ROOM, Building
from thermid.app.studio.draft import journal_of, merged_text
from thermid.app.studio.project import Project
from thermid.app.studio.room import Room
from thermid.app.studio.shapes import PALETTE
from thermid.base.errors import DeckError, MissingDataError, NameNotFoundError, ThermidError, code_of
from thermid.campaign.stages import check_campaign, run_stages
from thermid.fit.calibration import calibrate
from thermid.measure.readers import read_record
from thermid.model.tree import Edit, load_model, model_from_dict
from thermid.simulation.runs import Scenario, simulate
from torture.elements import network
from two_masses import write_log

pytestmark = pytest.mark.usefixtures("values_alone")


def do(building: Building, what: str, **more: Any) -> dict[str, Any]:
    return building.commanded({"do": what, **more})


def box(folder: Path) -> Building:
    """Return the box of two masses, built by commands."""
    building = Building(folder / "box.toml")
    for name, value in (("board", "120 [J/K]"), ("case", "450 [J/K]")):
        do(building, "add", shape="mass", name=name, x=100, y=100)
        do(building, "set", keys=["nodes", name, "capacitance"], value=value, source="measured")
    do(building, "add", shape="boundary", name="room", x=500, y=300)
    do(building, "add", shape="contact", name="joint", ends=["board", "case"])
    do(building, "add", shape="convection", name="skin", ends=["case", "room"])
    do(building, "set", keys=["surfaces", "skin", "area"], value="600 [cm^2]", source="")
    do(building, "add", shape="load", name="heater", ends=["board"])
    return building


def test_the_sheet_shows_a_spread_and_keeps_it_when_the_value_is_edited(tmp_path: Path) -> None:
    building = box(tmp_path)
    known = 'source = "assumed", spread = "5 [%]"'
    do(building, "text", text=building.draft.deck.text.replace('source = "measured"', known, 1))
    state = do(building, "set", keys=["nodes", "board", "capacitance"], value="130 [J/K]", source="assumed")
    (field,) = (f for e in state["elements"] if e["name"] == "board" for f in e["fields"] if f["name"] == "capacitance")
    assert (field["number"], field["spread"]) == ("130", "5 [%]")
    assert 'spread = "5 [%]"' in building.draft.deck.text


def test_what_is_built_fits_as_calibrate_does(tmp_path: Path) -> None:
    building = box(tmp_path)
    file = building.stored_log("test run.csv", write_log(tmp_path / "elsewhere.csv").read_bytes())
    state = do(building, "log", file=file)
    assert state["log"]["channels"] == {
        "board C": {"node": "board", "unit": "degC", "accuracy": "0.5 [K]", "noise": "0.056 [K]"},
        "case C": {"node": "case", "unit": "degC", "accuracy": "0.5 [K]", "noise": "0.049 [K]"},
        "room C": {"boundary": "room", "unit": "degC", "accuracy": "0.5 [K]"},
        "heater W": {"load": "heater", "unit": "W"},
    }
    free = ["joint.contact_conductance", "skin.effective_htc"]
    do(building, "free", paths=free)
    building.fit()
    building.jobs.wait()
    assert not building.jobs.state()["error"]
    do(building, "take fit")
    building.save(building.difference()["diff"])
    record = read_record(tmp_path / file, state["log"]["channels"])
    truth = calibrate(load_model(tmp_path / "box.toml"), record, free).values
    for path in free:
        assert building.fitted[path]["value"] == pytest.approx(truth[path].value, rel=0.01)
    findings, _ = check_campaign(tmp_path / "box_campaign.toml", None)
    assert [f for f in findings if f.severity == "error"] == []


def test_nodes_of_two_tabs_at_one_place_lie_beside_one_another(tmp_path: Path) -> None:
    building = Building(tmp_path / "one.toml")
    do(building, "add", shape="mass", name="first", x=100.0, y=40.0)
    state = do(building, "add", shape="mass", name="second", x=104.0, y=40.0)
    one, two = (np.array(state["places"][n]) for n in ("first", "second"))
    assert (np.abs(one - two) >= CARD_ROOM).any()
    state = do(building, "move", name="second", x=100.0, y=40.0)
    assert tuple(state["places"]["second"]) == (96.0, 40.0)  # where a person drags it, it stays


def test_a_value_of_the_palette_is_missing_until_somebody_gives_it(tmp_path: Path) -> None:
    building = Building(tmp_path / "one.toml")
    state = do(building, "add", shape="mass", name="case")
    assert state["missing"] == 1
    state = do(building, "set", keys=["nodes", "case", "capacitance"], value="3 [kJ/K]", source="measured")
    assert state["missing"] == 0
    assert load_model(_saved(building)).nodes["case"].fields["capacitance"].text == "3 [kJ/K]"


def _saved(building: Building) -> Path:
    building.save(building.difference()["diff"])
    return building.draft.deck.path


def test_a_new_name_goes_wherever_the_old_one_stood(tmp_path: Path) -> None:
    building = box(tmp_path)
    do(building, "log", file=building.stored_log("run.csv", write_log(tmp_path / "elsewhere.csv").read_bytes()))
    do(building, "free", paths=["board.capacitance"])
    state = do(building, "rename", keys=["nodes", "board"], name="pcb")
    assert {e["name"]: e["ends"] for e in state["elements"]}["joint"] == ["pcb", "case"]
    assert state["log"]["channels"]["board C"]["node"] == "pcb"
    assert [p["path"] for p in state["parameters"] if p["free"]] == ["pcb.capacitance"]
    assert state["places"]["pcb"] == (96.0, 96.0)
    state = do(building, "undo")
    assert state["log"]["channels"]["board C"]["node"] == "board"


def test_what_is_joined_goes_with_a_node_and_comes_back_with_it(tmp_path: Path) -> None:
    building = box(tmp_path)
    before = building.draft.deck.text
    state = do(building, "remove", keys=["nodes", "case"])
    assert sorted(e["name"] for e in state["elements"]) == ["board", "heater", "room"]
    do(building, "undo")
    assert building.draft.deck.text == before


def test_a_text_that_is_no_deck_changes_nothing_and_tells_its_line(tmp_path: Path) -> None:
    building = box(tmp_path)
    text = building.draft.deck.text
    for wrong, line in (("600 [cm^2]", "600 [kg]"), ('of = "case"', 'of = "nobody"')):
        state = do(building, "text", text=text.replace(wrong, line))
        assert state["refused"]["line"] == next(k for k, row in enumerate(text.split("\n"), 1) if wrong in row)
        assert building.draft.deck.text == text
    assert do(building, "text", text=text + "\n[nodes.x\n")["refused"]["line"] is not None
    state = do(building, "text", text="# a comment\n" + text)
    assert "refused" not in state
    assert do(building, "set", keys=["loads", "heater", "power"], value="4 [W]", source="")["text"].startswith("# a comment\n")


def test_edits_survive_a_killed_studio(tmp_path: Path) -> None:
    building = box(tmp_path)
    again = Building(tmp_path / "box.toml")
    assert again.draft == building.draft
    assert again.notice
    while again.draft.past:
        do(again, "undo")
    assert again.state()["elements"] == []


def test_a_file_that_somebody_else_changed_is_merged(tmp_path: Path) -> None:
    """Their lines and ours, in one step that can be undone; the studio that was started again does the same."""
    building = box(tmp_path)
    file = _saved(building)
    do(building, "set", keys=["loads", "heater", "power"], value="4 [W]", source="")
    theirs = file.read_text(encoding="utf-8").replace("600 [cm^2]", "700 [cm^2]") + "# weighed on Monday\n"
    file.write_text(theirs, encoding="utf-8")
    for one in (building, Building(file)):
        assert one.state()["changed"] == ["box.toml"]
        with pytest.raises(DeckError) as refused:
            one.save(one.draft.diff())
        assert refused.value.code == "output.changed-meanwhile"
        assert file.read_text(encoding="utf-8") == theirs
    state = do(building, "merge")
    assert (state["changed"], state["undo"]) == ([], 1)
    for words in ("700 [cm^2]", "4 [W]", "weighed on Monday"):
        assert words in state["text"]
    assert do(building, "undo")["text"] == theirs
    do(building, "redo")
    building.save(building.difference()["diff"])
    assert file.read_text(encoding="utf-8") == state["text"]


def test_a_line_that_both_changed_is_refused_with_its_number(tmp_path: Path) -> None:
    building = box(tmp_path)
    file = _saved(building)
    do(building, "set", keys=["surfaces", "skin", "area"], value="500 [cm^2]", source="")
    theirs = file.read_text(encoding="utf-8").replace("600 [cm^2]", "700 [cm^2]")
    file.write_text(theirs, encoding="utf-8")
    before = building.draft
    with raises_code("output.changed-meanwhile", DeckError):
        building.difference()
    assert building.draft == before
    assert "700 [cm^2]" in do(building, "restart")["text"]
    assert file.read_text(encoding="utf-8") == theirs


@pytest.mark.parametrize("seed", range(40))
def test_edits_of_different_lines_merge_in_either_order(seed: int) -> None:
    rng = random.Random(seed)
    base = [f"line {k}\n" for k in range(30)]
    places = rng.sample(range(0, 30, 2), 8)

    def changed(own: list[int]) -> str:
        ways = {k: rng.choice(["", "other\n", f"line {k}\nmore\n"]) for k in own}
        return "".join(ways.get(k, line) for k, line in enumerate(base))

    mine, theirs = changed(places[:4]), changed(places[4:])
    both = merged_text("".join(base), mine, theirs, "x")
    assert both == merged_text("".join(base), theirs, mine, "x")
    assert merged_text(mine, mine, both, "x") == both
    assert merged_text("".join(base), mine, mine, "x") == mine
    untouched = [line for k, line in enumerate(base) if k not in places]
    assert [line for line in both.splitlines(keepends=True) if line in untouched] == untouched


def test_a_broken_journal_is_dropped(tmp_path: Path) -> None:
    file = _saved(box(tmp_path))
    for text in ("", "{}", "[1]", json.dumps({"documents": {"deck": {"text": "a = ["}}})):
        journal_of(file).write_text(text, encoding="utf-8")
        assert not Building(file).draft.past


def test_a_log_is_stored_once_and_replaces_nothing(tmp_path: Path) -> None:
    building = Building(tmp_path / "box.toml")
    assert [building.stored_log("../a.csv", data) for data in (b"1", b"2", b"1")] == ["logs/a.csv", "logs/a_2.csv", "logs/a.csv"]
    for name in ("..", "a\nb.csv", "/", "x" * 300):
        with pytest.raises(DeckError):
            building.stored_log(name, b"1")


def test_a_log_that_is_looked_at_again_keeps_what_a_person_bound(tmp_path: Path) -> None:
    """Seen by a first user: a hand-written product of volts and amperes was dropped, and the misfit went from 0.16 to 22 K."""
    building = box(tmp_path)
    data = write_log(tmp_path / "elsewhere.csv").read_bytes()
    first, second = (building.stored_log(name, data) for name in ("run.csv", "next.csv"))
    assert first != second
    do(building, "log", file=first)
    own = {"node": "board", "unit": "degC", "accuracy": "0.5 [K]"}
    do(building, "bind", channels={"board C": own, "room C": None})
    state = do(building, "log", file=second)
    assert state["log"]["channels"]["board C"] == own  # a second log of the same columns has them as the first
    before = do(building, "bind", channels={"heater W": None})["text"]
    state = do(building, "log", file=first)
    assert state["log"]["channels"]["board C"] == own
    assert "room C" not in state["log"]["channels"]
    assert "heater W" in state["log"]["channels"]
    assert state["text"] == before


def test_a_part_has_its_needs_bound(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text('title = "part"\nneeds = ["air"]\n[nodes]\nbody = { capacitance = "9 [J/K]" }\n', encoding="utf-8")
    stage = '[[stages]]\nname = "part"\nmodel = "part.toml"\n'
    (tmp_path / "part_campaign.toml").write_text(f'title = "part"\n[records]\n{stage}', encoding="utf-8")
    building = Building(tmp_path / "whole.toml")
    assert building.state()["decks"] == ["part.toml"]  # a campaign was offered as a part
    with pytest.raises(DeckError):
        do(building, "add", shape="submodel", use="part.toml")
    do(building, "add", shape="boundary", name="room")
    state = do(building, "add", shape="submodel", name="p", use="part.toml")
    assert state["elements"][-1]["bind"] == {"air": "room"}


def random_command(rng: random.Random, building: Building) -> dict[str, Any]:
    elements = building.state()["elements"]
    nodes = [e["name"] for e in elements if e["table"] in ("nodes", "needs")] or ["none"]
    one = rng.choice(elements) if elements else {"table": "nodes", "name": "none", "fields": []}
    shape = PALETTE[rng.choice([s for s in PALETTE if s != "submodel"])]
    keys = [one["table"], one["name"]]
    field = rng.choice(one["fields"])["name"] if one["fields"] else "mass"
    return rng.choice(
        [
            {"do": "add", "shape": shape.name, "ends": rng.sample(nodes, min(shape.ends, len(nodes))), "x": rng.randint(0, 900), "y": 8},
            {"do": "set", "keys": [*keys, field], "value": f"{rng.uniform(0.1, 9):.3f} [{rng.choice(['W', 'J/K', 'cm^2', '1'])}]"},
            {"do": "set", "keys": [*keys, field], "value": "", "source": "measured"},
            {"do": "rename", "keys": keys, "name": f"n{rng.randint(0, 99)}"},
            {"do": "remove", "keys": keys},
            {"do": "stored", "name": one["name"], "how": rng.choice(["mass", "capacitance", "massless"])},
            {"do": "schedule", "keys": keys, "on": rng.choice(["", "40 [min]"]), "off": "5 [min]", "share": rng.choice(["", "0.3"])},
            {"do": "hold", "name": rng.choice(nodes), "value": rng.choice(["", "23 [degC]"])},
            {"do": "move", "name": one["name"], "x": rng.randint(-500, 500), "y": rng.randint(-500, 500)},
            {"do": "text", "text": building.draft.deck.text + f"\n# {rng.randint(0, 9)}\n"},
        ]
    )


@pytest.mark.parametrize("decks", [1, pytest.param(200, marks=pytest.mark.campaign)])
def test_forty_commands_and_their_undoing_give_the_same_bytes(tmp_path: Path, decks: int) -> None:
    """Of random networks of every kind of element, written as people write decks; a value that is set changes the line that it is on."""
    done = 0
    for seed in range(decks):
        rng, file = random.Random(seed), tmp_path / f"deck{seed}.toml"
        deck = network(seed).deck
        first = hand_written(deck, rng)
        file.write_bytes(first)
        building = Building(file)
        load = next(iter(deck["loads"]))
        do(building, "set", keys=["loads", load, "power"], value="7.25 [W]", source="")
        lines = zip(first.decode().splitlines(), building.draft.deck.text.splitlines(), strict=True)
        pairs = [(a, b) for a, b in lines if a != b]
        assert ["7.25 [W]" in b for _, b in pairs] == [True], pairs
        for _ in range(40):
            try:
                before = building.draft
                building.commanded(random_command(rng, building))
                done += building.draft is not before
            except (ThermidError, KeyError):
                continue
            load_model(_copy(building, tmp_path))  # every step is a deck that reads
        last = building.draft
        while building.draft.past:
            do(building, "undo")
        assert building.draft.deck.text.encode() == first
        while building.draft.future:
            do(building, "redo")
        assert building.draft.documents == last.documents
    print(f"{done} commands done on {decks} decks")
    assert done > 8 * decks


def _copy(building: Building, folder: Path) -> Path:
    file = folder / "step.toml"
    file.write_bytes(building.draft.deck.text.encode())
    return file


def test_what_is_in_the_text_alone_is_counted(tmp_path: Path) -> None:
    building = box(tmp_path)
    state = do(building, "text", text=building.draft.deck.text + '\n[parameters]\nq = "2 [W]"\n')
    assert state["others"] == {"parameters": 1}, state.get("refused")


def test_the_run_of_a_draft_is_that_of_simulate(tmp_path: Path) -> None:
    building = box(tmp_path)
    building.run()
    building.jobs.wait()
    curve = building.jobs.state()["result"]["runs"][0]["curves"][0]
    scenario = Scenario("x", boundaries={"room": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
    solution = simulate(load_model(_saved(building)), scenario, times=curve["times"])
    assert np.abs(solution[curve["node"]].celsius - curve["simulated"]).max() < 1e-9
    assert model_from_dict(building.draft.deck.content).title == "box"


def test_a_stage_is_built_on_what_it_inherits(three_levels: Path, tmp_path: Path) -> None:
    """Its fit is that of the campaign, with values of the stages below; before those ran, it says which one is missing."""
    project = Project(campaign(tmp_path, planted=False))
    room = Room(tmp_path, project)
    building = room.built()
    state = building.state()
    assert (state["stage"], state["stages"]) == ("whole", ["part", "pair", "whole"])
    assert code_of(state["inherited"][0]["words"]) == "record.log-missing"
    with pytest.raises(MissingDataError, match="Run it in Correlate"):
        building.fit()
    shutil.copytree(three_levels / "results", tmp_path / "results")
    for name in project.stages:
        assert project.look(name).usable
    inherited = {v["path"]: v["words"] for v in building.state()["inherited"]}
    assert inherited
    assert all("stage '" in words for words in inherited.values())
    building.fit()
    building.jobs.wait()
    assert building.jobs.state()["error"] == ""
    known = project.done["whole"].values
    assert {p: v["value"] for p, v in building.fitted.items()} == pytest.approx({p: known[p].value for p in building.fitted}, rel=1e-6)
    state = do(building, "stage", name="part")
    assert (state["stage"], state["inherited"]) == ("part", [])
    building.run()
    building.jobs.wait()
    assert building.jobs.state()["error"] == ""
    with pytest.raises(NameNotFoundError):
        do(building, "stage", name="parts")


def test_a_schedule_goes_with_its_element_and_keeps_to_it_when_renamed(tmp_path: Path) -> None:
    building = Building(tmp_path / "box.toml")
    do(building, "add", shape="mass", name="a")
    do(building, "add", shape="load", name="heater", ends=["a"])
    plain = building.draft.deck.content
    do(building, "schedule", keys=["loads", "heater"], on="40 [min]", off="", share="")
    do(building, "rename", keys=["loads", "heater"], name="chips")
    state = do(building, "schedule", keys=["loads", "chips"], on="40 [min]", off="20 [min]", share="0.3")
    assert state["elements"][-1]["schedule"] == {"on": "40 [min]", "off": "20 [min]", "share": "0.3"}
    assert [p["path"] for p in state["parameters"]] == ["a.capacitance", "chips.power"]  # a fit does not find when it is on
    assert "controls" not in state["others"]
    do(building, "remove", keys=["loads", "chips"])
    assert not building.draft.deck.content.get("controls")
    do(building, "undo")
    do(building, "schedule", keys=["loads", "chips"], on="", off="", share="")
    assert building.draft.deck.content["loads"]["chips"] == plain["loads"]["heater"]
    with raises_code("name.unknown", NameNotFoundError):
        do(building, "schedule", keys=["nodes", "a"], on="40 [min]", off="", share="")


def test_a_boundary_without_a_column_is_held_and_a_duty_is_a_command(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time_s,Q1_pct,T1_C\n" + "".join(f"{5 * k},{60 if k < 50 else 0},23.{k}\n" for k in range(10, 90)))
    building = Building(tmp_path / "lab.toml")
    do(building, "add", shape="mass", name="T1")
    do(building, "add", shape="boundary", name="room")
    do(building, "add", shape="conduction", ends=["T1", "room"])
    do(building, "add", shape="load", name="Q1", ends=["T1"])
    state = do(building, "log", file="run.csv")
    assert state["log"]["channels"]["Q1_pct"] == {"command": "Q1"}
    assert state["held"] == {"room": ""}
    with raises_code("run.input-missing", match="'room'"):
        building.desk().run_of(0, {})
    assert do(building, "hold", name="room", value="23 [degC]")["held"] == {"room": "23 [degC]"}
    assert building.desk().run_of(0, {})[1].boundaries["room"].value == pytest.approx(296.15)
    assert do(building, "hold", name="room", value="")["held"] == {"room": ""}


def _electric(file: Path, seed: int = 3) -> bytes:
    """The log of the box with the heater's voltage and current in place of its power."""
    head, *rows = write_log(file, seed).read_text(encoding="utf-8").splitlines()
    out = [head.replace("heater W", "U out (V),I out (mA)")]
    for row in rows:
        *cells, watts = row.split(",")
        out.append(",".join([*cells, *(("10.0", "500") if float(watts) else ("0.0", "0"))]))
    return "\n".join([*out, ""]).encode()


def _with_log(folder: Path, data: bytes | None = None, name: str = "run.csv") -> tuple[Building, dict[str, Any]]:
    building = box(folder)
    return building, do(building, "log", file=building.stored_log(name, data or write_log(folder / "elsewhere.csv").read_bytes()))


def test_a_log_that_is_chosen_again_keeps_its_record(tmp_path: Path) -> None:
    building, state = _with_log(tmp_path, _electric(tmp_path / "a.csv"))
    do(building, "bind", channels={"case C": None})
    before = building.draft.documents["campaign"].text
    other = do(building, "log", file=building.stored_log("other.csv", write_log(tmp_path / "b.csv", 4).read_bytes()))
    assert other["log"]["record"] == "other"
    state = do(building, "log", file="logs/run.csv")
    assert state["log"]["record"] == "run"
    assert state["log"]["channels"]["P_supply"]["power"] == {"volts": "U out", "amperes": "I out"}
    assert "case C" not in state["log"]["channels"]
    while "other" in building.draft.documents["campaign"].content["records"]:
        do(building, "undo")
    assert building.draft.documents["campaign"].text == before


def _two_loggers(folder: Path, late: int = 0) -> tuple[bytes, bytes]:
    """Return the log of the temperatures of one test, and that of its power, with stamps where it begins later by some seconds."""
    head, *rows = (line.split(",") for line in write_log(folder / "whole.csv").read_text(encoding="utf-8").splitlines())
    begin = np.datetime64("2026-05-14T08:00:00")
    stamps = [[str(begin + np.timedelta64(int(cells[0]) + more, "s")) for cells in rows] for more in (0, late)]
    times = stamps if late else [[cells[0] for cells in rows]] * 2
    first = "stamp" if late else head[0]
    warm = [",".join([first, *head[1:-1]]), *(",".join([at, *cells[1:-1]]) for at, cells in zip(times[0], rows, strict=True))]
    fed = [f"{first},{head[-1]}", *(f"{at},{2.0 if late else cells[-1]}" for at, cells in zip(times[1], rows, strict=True))]
    return "\n".join(warm).encode(), "\n".join(fed).encode()


def test_a_log_that_begins_hours_later_is_joined_to_the_second(tmp_path: Path) -> None:
    """By stamps of two clocks, so within a range about 12347 s; it was 12340 s late."""
    warm, fed = _two_loggers(tmp_path, late=12347)
    building, _ = _with_log(tmp_path, warm)
    state = do(building, "log", file=building.stored_log("supply.csv", fed))
    low, high = map(float, state["records"][-1]["offset"].split(" to "))
    assert 0.5 * (low + high) == 12347.0


def test_a_log_that_others_are_joined_with_is_not_joined_and_is_taken_out_with_them(tmp_path: Path) -> None:
    """A campaign was written that nothing could read, and a log stayed in it that no list showed."""
    warm, fed = _two_loggers(tmp_path)
    building, _ = _with_log(tmp_path, warm)
    for name, data in (("supply.csv", fed), ("second.csv", warm)):
        do(building, "log", file=building.stored_log(name, data))
    do(building, "use", record="second", how="fit")
    with raises_code("campaign.refused"):
        do(building, "use", record="run", how="joined", host="second")
    do(building, "use", record="run", how="none")
    assert [*building.draft.documents["campaign"].content["records"]] == ["second"]


def test_the_log_of_a_supply_belongs_to_the_test_that_another_logger_saw(tmp_path: Path) -> None:
    """It was held out of the fit, which had the power of the deck, and judged on sensors that it has not."""
    warm, fed = _two_loggers(tmp_path)
    building, state = _with_log(tmp_path, warm)
    assert next(f["missing"] for e in state["elements"] if e["name"] == "heater" for f in e["fields"] if f["name"] == "power")
    state = do(building, "log", file=building.stored_log("supply.csv", fed))
    joined = {"name": "supply", "use": "joined", "host": "run", "offset": "0", "file": "logs/supply.csv"}
    # a constant power has no step by which clocks are compared: its log was joined at 0 s without a question
    assert [r for r in state["records"] if r["use"] != "fit"] == [{**joined, "offset": "..."}]
    assert state["held"] == {}  # the other log has the room
    free = ["joint.contact_conductance", "skin.effective_htc"]
    do(building, "free", paths=free)
    with raises_code("expression.not-arithmetic", match="joined.offset"):
        building.fit()
    do(building, "offset", record="supply", value="-300 to 300")
    building.fit()
    building.jobs.wait()
    ((name, words),) = building.jobs.state()["result"]["clocks"].items()  # what the fit found of it was said nowhere
    assert name.startswith("run: ")
    late, error = re.fullmatch(r"([-0-9.]+) \+- ([0-9.]+) s", words).groups()  # type: ignore[union-attr]
    assert abs(float(late)) < 3.0 * float(error)
    state = do(building, "offset", record="supply", value="0")
    assert state["records"][-1] == joined
    for wrong, code in (("soon", "value.wrong-kind"), ("3 [K]", "unit.wrong-dimension")):
        with raises_code(code):
            do(building, "offset", record="supply", value=wrong)
    building.fit()
    building.jobs.wait()
    found = building.jobs.state()["result"]["fitted"]
    record = read_record(tmp_path / "whole.csv", _with_log(_made(tmp_path / "at once"))[1]["log"]["channels"])
    truth = calibrate(building.model, record, free).values
    assert {p: found[p]["value"] for p in free} == {p: pytest.approx(truth[p].value, rel=1e-3) for p in free}
    content = building.draft.documents["campaign"].content
    assert do(building, "use", record="supply", how="held out")["records"][-1]["use"] == "held out"
    assert "joined" not in building.draft.documents["campaign"].text
    with raises_code("name.unknown", NameNotFoundError):
        do(building, "use", record="supply", how="joined", host="supply")
    do(building, "use", record="supply", how="joined", host="run")
    do(building, "offset", record="supply", value="0")
    assert building.draft.documents["campaign"].content == content
    do(building, "use", record="supply", how="none")
    assert [*building.draft.documents["campaign"].content["records"]] == ["run"]


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def test_logs_of_one_name_are_two_records(tmp_path: Path) -> None:
    building, _ = _with_log(tmp_path)
    (tmp_path / "day2").mkdir()
    write_log(tmp_path / "day2" / "run.csv", 4)
    assert do(building, "log", file="day2/run.csv")["log"]["record"] == "run_2"
    assert building.draft.documents["campaign"].content["records"]["run"]["file"] == "logs/run.csv"


def test_thermometers_are_bound_with_the_errors_that_they_show(tmp_path: Path) -> None:
    """The noise that `thermid look` proposes, and the accuracy that `thermid init` assumes; a person may give others, or none."""
    building, state = _with_log(tmp_path)
    for column in ("board C", "case C"):
        table = state["log"]["channels"][column]
        assert float(table["noise"].removesuffix(" [K]")) == pytest.approx(0.05, rel=0.2)
        assert table["accuracy"] == "0.5 [K]"
    assert state["log"]["channels"]["room C"] == {"boundary": "room", "unit": "degC", "accuracy": "0.5 [K]"}
    bare = {k: v for k, v in state["log"]["channels"]["case C"].items() if k not in ("noise", "accuracy")}
    given = {**bare, "noise": "0.1 [K]", "accuracy": ""}
    assert do(building, "bind", channels={"case C": given})["log"]["channels"]["case C"] == {**bare, "noise": "0.1 [K]"}
    do(building, "bind", channels={"case C": None})
    state = do(building, "bind", channels={"case C": bare})
    assert state["log"]["channels"]["case C"]["accuracy"] == "0.5 [K]"
    with pytest.raises(ThermidError):
        do(building, "bind", channels={"case C": {**bare, "noise": "0.1 [W]"}})


def test_volts_and_amperes_are_the_power_of_a_load(tmp_path: Path) -> None:
    building, state = _with_log(tmp_path, _electric(tmp_path / "a.csv"))
    rows = {c["name"]: c for c in state["log"]["columns"]}
    assert state["log"]["channels"]["P_supply"] == {"load": "heater", "power": {"volts": "U out", "amperes": "I out"}}
    assert rows["P_supply"]["roles"] == ("load",)
    assert rows["case C"]["roles"] == ("node", "boundary")
    for column in ("U out", "I out"):
        assert rows[column]["roles"] == ()
        assert rows[column]["used"] == ["P_supply"]
    assert next(e for e in state["elements"] if e["name"] == "heater")["logged"]
    (tmp_path / "plain").mkdir()
    plain, _ = _with_log(tmp_path / "plain")
    for one in (building, plain):
        one.run()
        one.jobs.wait()
    ends = [one.jobs.state()["result"]["runs"][0]["curves"][0]["simulated"][-1] for one in (building, plain)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)
    state = do(building, "bind", channels={"P_supply": None})  # and it can be taken away, and given again
    assert "P_supply" not in state["log"]["channels"]
    assert "P_supply" in {c["name"] for c in state["log"]["columns"]}
    state = do(building, "bind", channels={"P_supply": {"load": "heater"}})
    assert state["log"]["channels"]["P_supply"]["power"] == {"volts": "U out", "amperes": "I out"}


@pytest.mark.parametrize(("column", "binding"), [("U out", {"load": "heater"}), ("I out", {"node": "board"})])
def test_a_column_that_cannot_be_what_it_is_bound_to_is_refused_at_once(tmp_path: Path, column: str, binding: dict[str, str]) -> None:
    """It was taken, and every run refused."""
    building, state = _with_log(tmp_path, _electric(tmp_path / "a.csv"))
    with pytest.raises(ThermidError, match=r"is needed|a power|temperature"):
        do(building, "bind", channels={column: binding})
    assert building.state()["log"]["channels"] == state["log"]["channels"]


def test_a_unit_that_nobody_knows_can_be_given(tmp_path: Path) -> None:
    data = write_log(tmp_path / "a.csv").read_text(encoding="utf-8").replace("case C", "case [blorb]").encode()
    building, state = _with_log(tmp_path, data)
    row = next(c for c in state["log"]["columns"] if c["name"] == "case")
    assert row["open"]
    with pytest.raises(ThermidError):
        do(building, "bind", channels={"case": {"node": "case"}})
    state = do(building, "bind", channels={"case": {"node": "case", "unit": "degC"}})
    assert state["log"]["channels"]["case"]["unit"] == "degC"


def test_a_second_log_is_held_out_until_the_fit_is_to_use_it(tmp_path: Path) -> None:
    building, state = _with_log(tmp_path, _electric(tmp_path / "a.csv"))
    do(building, "bind", channels={"case C": {"node": "case", "unit": "degC", "noise": "0.07 [K]"}})
    state = do(building, "log", file=building.stored_log("second.csv", _electric(tmp_path / "b.csv", 4)))
    assert [(r["name"], r["use"]) for r in state["records"]] == [("run", "fit"), ("second", "held out")]
    first = building.draft.documents["campaign"].content["records"]["run"]["channels"]
    assert state["log"]["channels"] == first  # bindings made by hand go over to the same columns
    content = building.draft.documents["campaign"].content
    assert content["stages"][0]["records"] == ["run"]
    assert content["verdicts"][0] | {"criteria": 0} == {"model": "box", "record": "second", "criteria": 0}
    limit = float(content["verdicts"][0]["criteria"]["rmse"].removesuffix(" [K]"))
    assert 0.1 < limit < 3.0
    state = do(building, "limit", record="second", value="0.4 [K]")
    assert state["records"][1]["limit"] == "0.4 [K]"
    for value in ("4 [W]", ""):  # without a limit the run ended in an error
        with pytest.raises(ThermidError):
            do(building, "limit", record="second", value=value)
    with raises_code("name.unknown", NameNotFoundError, match="'rom'"):
        do(building, "hold", name="rom", value="20 [degC]")
    with raises_code("value.outside-range", match="below 0 K"):
        do(building, "hold", name="room", value="-300 [degC]")
    before = building.draft
    twice = Edit(("verdicts", 1), {**content["verdicts"][0], "name": "again"})
    building.draft = before.edited({"campaign": [twice]})
    do(building, "use", record="second", how="none")
    assert "verdicts" not in building.draft.documents["campaign"].content, "one of two verdicts on the log was left behind"
    building.draft = before
    do(building, "free", paths=["joint.contact_conductance", "skin.effective_htc"])
    building.save(building.difference()["diff"])
    verdicts = run_stages(tmp_path / "box_campaign.toml").verdicts
    assert [(v.record, v.passed) for v in verdicts] == [("second", True)]
    third = do(building, "log", file=building.stored_log("third.csv", _electric(tmp_path / "c.csv", 5)))
    assert [r["use"] for r in third["records"]] == ["fit", "held out", "held out"]
    do(building, "use", record="third", how="none")
    state = do(building, "use", record="second", how="fit")
    assert [(r["name"], r["use"]) for r in state["records"]] == [("run", "fit"), ("second", "fit")]
    assert not building.draft.documents["campaign"].content.get("verdicts")
    state = do(building, "use", record="second", how="none")
    assert [r["name"] for r in state["records"]] == ["run"]
    assert state["log"]["record"] == "run"


def test_a_text_that_is_no_deck_yet_is_not_lost(tmp_path: Path) -> None:
    """Any edit in the sheet, an undo or a reload threw away what was typed."""
    building = box(tmp_path)
    text = building.draft.deck.text
    typed = text + "oops = [\n"
    do(building, "text", text=typed)
    for what, more in (("undo", {}), ("set", {"keys": ["loads", "heater", "power"], "value": "4 [W]", "source": ""})):
        with raises_code("output.edit-refused", DeckError):
            do(building, what, **more)
    with raises_code("output.edit-refused", DeckError):
        building.difference()
    again = Building(tmp_path / "box.toml")
    assert again.state()["typed"] == typed
    assert "TOML" in again.state()["refused"]["message"]
    state = do(again, "drop text")
    assert (state["text"], "typed" in state) == (text, False)
    do(again, "text", text=typed)
    state = do(again, "text", text=text + "# mended\n")
    assert "typed" not in state
    assert do(again, "undo")["text"] == text


def test_a_model_that_was_never_saved_is_on_the_start_page(tmp_path: Path) -> None:
    room = Room(tmp_path)
    room.new("my box")
    assert room.front()["waiting"] == []
    room.ordering["edit"]({"do": "add", "shape": "mass", "ends": [], "name": "case"})
    again = Room(tmp_path)
    assert again.front()["waiting"] == ["my_box"]
    again.new("my_box")
    assert [e["name"] for e in again.built().state()["elements"]] == ["case"]
    again.ordering["draft/save"]({"diff": again.ordering["draft/difference"]({})["diff"]})
    assert again.front()["waiting"] == []


def test_a_heading_with_the_letter_of_its_unit_is_bound_with_it(tmp_path: Path) -> None:
    """A column "board_F" was bound without a unit, refused as unclear, and had no field for one."""
    data = write_log(tmp_path / "a.csv").read_text(encoding="utf-8").replace("board C", "board_K").replace("time_s", "time s").encode()
    _, state = _with_log(tmp_path, data)
    row = next(c for c in state["log"]["columns"] if c["name"] == "board_K")
    assert row["open"]
    assert state["log"]["channels"]["board_K"]["unit"] == "K"
    assert state["log"]["problem"] == ""


def test_the_time_column_of_a_log_can_be_named(tmp_path: Path) -> None:
    """Where none had a usual name, the page said to give one and had no field for it."""
    data = write_log(tmp_path / "a.csv").read_text(encoding="utf-8").replace("time_s", "moment").encode()
    building, state = _with_log(tmp_path, data)
    assert code_of(state["log"]["problem"]) == "record.time-unclear"
    state = do(building, "time", record=state["log"]["record"], column="moment")
    assert state["log"]["problem"] == ""
    assert state["log"]["sampling"]["length"] == 14400.0
    assert "noise" in state["log"]["channels"]["board C"]


def test_a_name_that_is_refused_says_why_and_offers_another(tmp_path: Path) -> None:
    building = box(tmp_path)
    for name, match in (("chip board", "chip_board"), ("case", "")):
        with raises_code("output.edit-refused", DeckError, match=match):
            do(building, "rename", keys=["nodes", "board"], name=name)
