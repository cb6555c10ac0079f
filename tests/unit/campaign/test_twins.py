"""Twins at different heights of a tree: each place of a value reads what a stage found of it, or the first lines name it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from thermid.campaign._stages import Campaign, run_stages
from thermid.fit.calibration import Calibration
from thermid.model.tree import load_model, local_identities
from thermid.values.store import Filed, load_store
from unit.fit.trees import Part, joined, leaf, record_table, stage_table, write_decks, write_logs

pytestmark = pytest.mark.usefixtures("values_alone")

CELL = leaf("cell", 0.20)
PACK = joined("pack", {"c1": CELL}, (0.28, 0.35))
RACK = joined("rack", {"p": PACK, "c2": CELL}, (0.30, 0.26, 0.25))
ROOM = joined("room", {"r": RACK, "c9": CELL}, (0.30, 0.26, 0.25))
NEAR = leaf("cell", 0.295)  # near the deck, so that one that keeps the deck's value misleads no other
G, E = "g.conductance", "e.conductance"
OWN = {"pack": ["to_c1.conductance", E], "rack": ["to_p.conductance", "to_c2.conductance", E], "room": ["to_r.conductance", E]}


def campaign(folder: Path, *stages: str, parts: tuple[Part, ...] = (CELL, PACK, RACK), joint: bool = False) -> Campaign:
    """Decks, logs and stages of some parts; the decks give 0.30 W/K everywhere."""
    write_decks(folder, parts[-1])
    write_logs(folder, parts)
    path = folder / "campaign.toml"
    path.write_text("\n".join(['title = "Twins"', *map(record_table, parts), *stages, *(["[joint]"] if joint else [])]))
    return run_stages(path)


def stages_of(how: str, **more: str) -> list[str]:
    """A cell, the pack that holds one, and the rack that holds the pack and another cell but inherits the pack alone."""
    return [
        stage_table("cell", CELL, [G]),
        stage_table("pack", PACK, OWN["pack"], f'c1 = {{ stage = "cell", as = "{how}" }}', more.get("pack", "")),
        stage_table("rack", RACK, OWN["rack"], f'p = {{ stage = "pack", as = "{how}" }}', more.get("rack", "")),
    ]


def acting(fit: Calibration, path: str) -> float:
    return float(fit.model.at(path).expression.literal.value)


def first_lines(fit: Calibration) -> list[str]:
    """What stands above the first sensor in the text of a fit."""
    lines = str(fit).splitlines()
    return lines[: next(k for k, line in enumerate(lines) if "RMSE" in line)]


@pytest.mark.parametrize("how", ["fixed", "prior"])
def test_a_twin_higher_in_the_tree_has_what_was_found_below(tmp_path: Path, how: str) -> None:
    """Stage by stage, and in the joint fit, whatever the uppermost stage inherits: the pack alone, and neither of the two cells."""
    found = campaign(tmp_path, *stages_of(how), joint=True)
    rack, joint = found["rack"], found.joint
    assert acting(rack, f"c2.{G}") == acting(rack, f"p.c1.{G}") != 0.30
    assert set(rack.store[f"p.c1.{G}"].acts) == {f"p.c1.{G}", f"c2.{G}"}
    for path, true in RACK.values().items():
        assert abs(acting(rack, path) - true) < 4.0 * rack.store.error(path), path
    assert any(f"c2.{G}" in line and (how == "prior" or "'cell'" in line) for line in first_lines(rack))
    known = local_identities(rack.model)
    assert known[f"c2.{G}"].paths == known[f"p.c1.{G}"].paths
    assert joint is not None
    assert {p for p in joint.values.assignments if p.endswith(G)} == {f"p.c1.{G}", f"c2.{G}"}
    assert len([p for p in joint.values if p.endswith(G)]) == 1
    assert abs(joint[f"p.c1.{G}"].value - 0.20) < 4.0 * joint[f"p.c1.{G}"].error


def test_four_levels_with_twins_at_three_heights(tmp_path: Path) -> None:
    how = "prior"
    top = stage_table("room", ROOM, ["to_c9.conductance", *OWN["room"]], f'r = {{ stage = "rack", as = "{how}" }}')
    room = campaign(tmp_path, *stages_of(how), top, parts=(CELL, PACK, RACK, ROOM))["room"]
    cells = [f"{place}.{G}" for place in ("r.p.c1", "r.c2", "c9")]
    assert len({acting(room, p) for p in cells} - {0.30}) == 1
    file = tmp_path / "room.values.toml"
    room.save(file)
    back = load_store(file)[0]
    assert back == room.store
    laid = back.laid_over(load_model(tmp_path / "room.toml"))
    assert {laid.at(p).expression.literal.value for p in cells} == {acting(room, cells[0])}


def test_a_values_file_of_a_part_reaches_its_twins(tmp_path: Path) -> None:
    """By the command line and from Python, with the same members."""
    from thermid.prediction._known import known_of

    pass

    pack = campaign(tmp_path, *stages_of("prior"))["pack"]
    pack.save(tmp_path / "pack.values.toml")
    rack = load_model(tmp_path / "rack.toml")
    found = pack.store[f"c1.{G}"].value
    laid = Filed.read(tmp_path / "pack.values.toml", rack, at="p").model
    known = known_of(pack, rack, at="p")
    for model in (laid, known.model):
        assert model.at(f"c2.{G}").expression.literal.value == model.at(f"p.c1.{G}").expression.literal.value == found
    assert {f"p.c1.{G}", f"c2.{G}"} <= set(known.assigned)
    assert {f"p.c1.{G}", f"c2.{G}"} <= {p for one in known.placed for p in one.assignments}


def test_a_part_that_nothing_inherits_is_named(tmp_path: Path) -> None:
    """A stage that was fitted for nothing: the one above has its deck and no table `inherit`."""
    pack = stage_table("pack", PACK, OWN["pack"])
    found = campaign(tmp_path, stage_table("cell", NEAR, [G]), pack, parts=(NEAR, replace(PACK, parts={"c1": NEAR})))
    assert any({"'cell'", "'c1'"} <= {*x.replace(":", "").split()} for x in first_lines(found["pack"]) if x.strip().startswith("check:"))


@pytest.mark.parametrize("kept_back", [f'only = ["{G}"]', 'without = ["n.capacitance"]'])
def test_a_value_that_a_stage_keeps_back_is_named_and_its_neighbours_are_not(tmp_path: Path, kept_back: str) -> None:
    pack = stage_table("pack", PACK, OWN["pack"], f'c1 = {{ stage = "cell", {kept_back} }}')
    found = campaign(tmp_path, stage_table("cell", CELL, [G, "n.capacitance"]), pack, parts=(CELL, PACK))["pack"]
    (line,) = [x for x in first_lines(found) if x.strip().startswith("check:") and "'cell'" in x]
    assert "'c1.n.capacitance'" in line
    assert G not in line
    assert "'c1'" not in line


def test_a_twin_that_the_deck_above_sets_keeps_that_and_is_named(tmp_path: Path) -> None:
    rack = replace(RACK, sets={f"c2.{G}": "0.22 [W/K]"})
    fit = campaign(tmp_path, *stages_of("fixed"), parts=(CELL, PACK, rack))["rack"]
    assert acting(fit, f"c2.{G}") == 0.22
    (line,) = [x for x in first_lines(fit) if x.strip().startswith("check:") and f"c2.{G}" in x]
    assert "[set] of rack" in line


def test_a_set_above_hides_a_result_at_one_twin_and_not_at_the_others(tmp_path: Path) -> None:
    room = replace(ROOM, sets={f"r.c2.{G}": "0.22 [W/K]"})
    top = stage_table("room", room, ["to_c9.conductance", *OWN["room"]], 'r = { stage = "rack" }')
    fit = campaign(tmp_path, *stages_of("fixed"), top, parts=(CELL, PACK, RACK, room))["room"]
    assert acting(fit, f"r.c2.{G}") == 0.22
    assert acting(fit, f"c9.{G}") == acting(fit, f"r.p.c1.{G}") == fit.store[f"r.p.c1.{G}"].value
    assert any(f"hidden at r.c2.{G}" in line for line in first_lines(fit))


def test_of_two_results_for_twins_neither_is_taken_for_a_third(tmp_path: Path) -> None:
    pack = joined("pack", {"c1": CELL, "c3": CELL}, (0.28, 0.3, 0.35))
    rack = joined("rack", {"p": pack, "c2": CELL}, (0.30, 0.26, 0.25))
    stages = [
        stage_table("pack", pack, [f"c1.{G}", f"c3.{G}", E], "", 'untie = ["c3"]'),
        stage_table("rack", rack, OWN["rack"], 'p = { stage = "pack" }'),
    ]
    fit = campaign(tmp_path, *stages, parts=(pack, rack))["rack"]
    assert acting(fit, f"c2.{G}") == 0.30
    assert acting(fit, f"p.c1.{G}") != acting(fit, f"p.c3.{G}")
    (line,) = [x for x in first_lines(fit) if x.strip().startswith("check:") and f"c2.{G}" in x]
    assert "'pack'" in line


def test_what_a_stage_found_for_one_instance_alone_stays_there(tmp_path: Path) -> None:
    """Its twin was cut from it and kept the deck's value in that fit, so this is no result for a third either."""
    pack = joined("pack", {"c1": NEAR, "c3": NEAR}, (0.28, 0.3, 0.35))
    rack = joined("rack", {"p": pack, "c2": NEAR}, (0.30, 0.26, 0.25))
    stages = [
        stage_table("pack", pack, [f"c1.{G}", E], "", 'untie = ["c1"]'),
        stage_table("rack", rack, OWN["rack"], 'p = { stage = "pack" }'),
    ]
    fit = campaign(tmp_path, *stages, parts=(pack, rack))["rack"]
    assert acting(fit, f"c2.{G}") == acting(fit, f"p.c3.{G}") == 0.30
    named = " ".join(x for x in first_lines(fit) if x.strip().startswith("check:"))
    assert f"c2.{G}" in named
    assert f"p.c3.{G}" in named


@pytest.mark.parametrize(("how", "untie"), [("fixed", '["c2"]'), ("prior", '["c2"]'), ("prior", "true")])
def test_untied_twins_start_from_one_result_each_with_its_error(tmp_path: Path, how: str, untie: str) -> None:
    fit = campaign(tmp_path, *stages_of(how, rack=f"untie = {untie}"))["rack"]
    one, other = acting(fit, f"p.c1.{G}"), acting(fit, f"c2.{G}")
    if how == "fixed":
        assert one == other == fit.store[f"c2.{G}"].value != 0.30
    else:
        assert abs(other - 0.20) < 4.0 * fit.store.error(f"c2.{G}")
        assert one != other
        assert [o.stage for o in fit.store[f"c2.{G}"].history] == ["cell", "pack"]


def test_freezing_a_value_at_one_of_its_places_freezes_it(tmp_path: Path) -> None:
    frozen = "c2.*"
    fit = campaign(tmp_path, *stages_of("prior", rack=f'freeze = ["{frozen}"]'))["rack"]
    assert {acting(fit, f"p.c1.{G}"), acting(fit, f"c2.{G}")} == {fit.store[f"p.c1.{G}"].value}
    assert fit.store[f"p.c1.{G}"].origin.stage == "pack"
    free = campaign(tmp_path, *stages_of("fixed")[:2], stage_table("rack", RACK, [f"*.{G}", E], "", f'freeze = ["{frozen}"]'))["rack"]
    assert set(free.values.parameters) == {E}


def test_one_result_that_may_move_at_one_twin_and_is_fixed_at_the_other_moves_and_is_named(tmp_path: Path) -> None:
    stages = stages_of("fixed")[:2]
    rack = stage_table("rack", RACK, OWN["rack"], 'p = { stage = "pack", as = "prior" }, c2 = { stage = "cell", as = "fixed" }')
    fit = campaign(tmp_path, *stages, rack)["rack"]
    assert acting(fit, f"c2.{G}") == acting(fit, f"p.c1.{G}") != fit.request.store[f"c2.{G}"].value
    (line,) = [x for x in first_lines(fit) if x.strip().startswith("check:") and f"c2.{G}" in x]
    assert "untie" in line.lower()


def test_two_results_at_two_twins_are_kept_apart_and_named(tmp_path: Path) -> None:
    stages = stages_of("prior")[:2]
    rack = stage_table("rack", RACK, OWN["rack"], 'p = { stage = "pack" }, c2 = { stage = "cell" }')
    fit = campaign(tmp_path, *stages, rack)["rack"]
    assert (acting(fit, f"p.c1.{G}"), acting(fit, f"c2.{G}")) == tuple(fit.store[p].value for p in (f"p.c1.{G}", f"c2.{G}"))
    assert [fit.store[p].origin.stage for p in (f"p.c1.{G}", f"c2.{G}")] == ["pack", "cell"]
    (line,) = [x for x in first_lines(fit) if x.strip().startswith("check:") and f"c2.{G}" in x]
    assert "'pack'" in line
    assert "'cell'" in line
