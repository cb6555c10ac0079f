"""The key of a stage: it changes if and only if one of its ingredients does, and that one is the reason which is told."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from thermid.campaign._cache import KeptStage
from thermid.campaign._file import CampaignSource
from thermid.campaign._stages import keyed, request_of, run_stages
from thermid.fit._problem import request as room
from thermid.fit.calibration import KeptFit, LocalSpec, Reading, Request
from thermid.simulation.runs import Options, Scenario
from thermid.values.store import State, Store, ValueOrigin
from unit.fit.bench import HTC, MASS, box, log, pair
from unit.fit.trees import joined, leaf, record_table, stage_table, write_decks, write_logs

STATE = State("case.mass", 1.6, True, "kg", (0.5, 4.0), ValueOrigin("fit", "below"), paths=("case.mass",))
BELOW = Store({"case.mass": STATE})
DATA = log(box(), {}, {"T": "case"}, noise=0.05)
CHANGES: dict[str, tuple[Any, str]] = {
    "model": (box({"loads/heat/power": "2 [W]"}), "deck"),
    "records": ((DATA.with_channels(replace(DATA["T"], noise=0.06)),), "records"),
    "free": ((HTC, MASS), "free and fixed"),
    "scenarios": ({"*": Scenario("other", start="300 [K]")}, "scenario"),
    "local": ({"air": LocalSpec("295 [K]")}, "scenario"),
    "record_local": ({DATA.name: {"air": LocalSpec("295 [K]", 1.0)}}, "scenario"),
    "priors": ({HTC: ("", "10 [%]")}, "priors"),
    "store": (Store({"case.mass": replace(STATE, hidden=("case.mass",))}), "free and fixed"),
    "prior": (("case.mass",), "free and fixed"),
    "held_bias": ({"T": 0.1}, "priors"),
    "held_errors": ({}, "priors"),
    "weights": ({"T": 2.0}, "free and fixed"),
    "untie": (True, "cuts"),
    "loss": ("huber", "free and fixed"),
    "loss_scale": (2.0, "free and fixed"),
    "search": ("multistart", "free and fixed"),
    "window": (60.0, "scenario"),
    "structural_errors": (True, "free and fixed"),
    "readings": ({"initial.case": Reading("T")}, "scenario"),
    "fit_start": (False, "free and fixed"),
    "options": (Options(error=4e-5), "free and fixed"),
    "hand": (BELOW, "values by hand"),
}
NONE = {"name", "seen", "remarks", "key", "adequate", "accepted", "of_logs", "idle_ranges"}
"""What no end of a search depends on, or what a fit finds from the others."""


def plain() -> Request:
    return Request(box(), (DATA,), (HTC,), store=BELOW)


def test_every_field_of_a_request_is_an_ingredient_or_changes_no_fit() -> None:
    assert {f.name for f in fields(Request)} == set(CHANGES) | NONE


@pytest.mark.parametrize("name", CHANGES)
def test_a_field_of_a_request_changes_its_own_ingredient_alone(name: str) -> None:
    value, reason = CHANGES[name]
    before, after = plain(), replace(plain(), **{name: value})
    told = [r.ingredients(["key of below"]) for r in (before, after)]
    assert [n for n in told[0] if told[0][n] != told[1][n]] == [reason]
    assert before.fit_key != after.fit_key


def test_what_changes_no_fit_changes_no_key() -> None:
    other = replace(plain(), name="other", seen={"ab": "who"}, remarks=("said",), adequate=0.1, accepted=True)
    assert other.ingredients([]) == plain().ingredients([])
    laid = plain().model.with_values({MASS: "1.6 [kg]"}, "stage 'below'")
    found = replace(plain(), model=laid, store=Store({"case.mass": replace(STATE, value=1.7)}))
    assert found.ingredients(["k"]) == plain().ingredients(["k"]), "what stages below found is in their keys"
    assert replace(plain(), model=laid).fit_key != plain().fit_key, "in Python nobody else says what was laid over the deck"
    whole, cut = (Request(m, ()).ingredients([]) for m in (pair(), pair().cut("b")))
    assert [n for n in whole if whole[n] != cut[n]] == ["cuts"]


def test_requests_in_python_on_other_stores_have_other_keys() -> None:
    """Their noise has the key as its name: it is not to be taken for one and the same."""
    again = Store({"case.mass": replace(STATE, origin=ValueOrigin("fit", "below", key="another fit"))})
    assert replace(plain(), store=again).fit_key != plain().fit_key


COMPONENT = leaf("component", 0.20)
PAIR = joined("pair", {"p": COMPONENT}, (0.30, 0.25))
HAND = '[[stages]]\nname = "bench"\nmodel = "component.toml"\nvalues = "hand.toml"\n'
FREE = 'free = ["to_p.conductance"]'
EDITS = [
    ("pair.toml", "100 [J/K]", "110 [J/K]", {"pair": "deck"}),
    ("logs/pair.csv", "\n6000.0000", "\n6000.5000", {"pair": "records"}),
    ("campaign.toml", 'T_body = { node = "body", noise = "0.02 [K]"', 'T_body = { node = "body", noise = "0.03 [K]"', {"pair": "records"}),
    ("campaign.toml", FREE, f'{FREE}\nscenario = {{ start = "295 [K]" }}', {"pair": "scenario"}),
    ("campaign.toml", FREE, f'{FREE}\nlocal = {{ "initial.body" = {{ start = "295 [K]", sd = "1 [K]" }} }}', {"pair": "scenario"}),
    ("campaign.toml", FREE, f'{FREE}\nwindow = "60 [s]"', {"pair": "scenario"}),
    ("campaign.toml", FREE, 'free = ["to_p.conductance", "e.conductance"]', {"pair": "free and fixed"}),
    ("campaign.toml", FREE, f'{FREE}\nloss = "huber"', {"pair": "free and fixed"}),
    ("campaign.toml", FREE, f"{FREE}\nweights = {{ T_body = 2.0 }}", {"pair": "free and fixed"}),
    ("campaign.toml", 'as = "fixed"', 'as = "prior"', {"pair": "free and fixed"}),
    ("campaign.toml", FREE, f'{FREE}\npriors = {{ "to_p.conductance" = {{ sd = "10 [%]" }} }}', {"pair": "priors"}),
    ("campaign.toml", FREE, f"{FREE}\nuntie = true", {"pair": "cuts"}),
    ("hand.toml", "0.01", "0.02", {"bench": "values by hand", "pair": "below"}),
    ("hand.toml", '"0.2 [W/K]"', '"0.21 [W/K]"', {"bench": "values by hand", "pair": "below"}),
    ("pair.toml", 'title = "pair"', 'title = "pair"  # joined', {}),
    ("campaign.toml", FREE, f'{FREE}\nnote = "said"\nadequate = "0.1 [K]"', {}),
    ("campaign.toml", 'title = "Keys"', 'title = "Keys"\naccept = ["pair"]', {}),
]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    folder = tmp_path_factory.mktemp("keys")
    write_decks(folder, PAIR)
    write_logs(folder, [PAIR])
    (folder / "hand.toml").write_text('"g.conductance" = { value = "0.2 [W/K]", sd = "0.01 [W/K]" }\n')
    stage = stage_table("pair", PAIR, ["to_p.conductance"], 'p = { stage = "bench", as = "fixed" }')
    (folder / "campaign.toml").write_text("\n".join(['title = "Keys"', record_table(PAIR), HAND, stage]))
    return folder, run_stages(folder / "campaign.toml", cache=folder / "results").stages


def told(folder: Path, done: Any) -> dict[str, str]:
    """Stage -> the reasons to fit it again that a campaign tells; a stage by hand keeps nothing, so its ingredients are kept here."""
    source = CampaignSource.read(folder / "campaign.toml")
    known: dict[str, str] = {}
    out = {}
    for k, stage in enumerate(source.content.stages):
        request, made = keyed(request_of(source, stage, k, done), stage, known)
        known[stage.name] = request.key
        kept = folder / "kept" / f"{stage.name}.fit.json"
        if not kept.is_file():
            KeptStage(folder / "kept", stage.name).remember(request.key, KeptFit({}, 1), made)
        out[stage.name] = ", ".join(KeptStage(folder / "kept", stage.name).changed_since(made))
    return {n: reason for n, reason in out.items() if reason}


@pytest.mark.parametrize(("file", "old", "new", "reasons"), EDITS)
def test_an_edit_is_told_as_the_one_ingredient_that_it_is(
    ran: tuple[Path, Any], file: str, old: str, new: str, reasons: dict[str, str]
) -> None:
    folder, done = ran
    assert told(folder, done) == {}
    path = folder / file
    before = path.read_text()
    assert before.count(old) == 1
    path.write_text(before.replace(old, new))
    try:
        assert told(folder, done) == reasons
    finally:
        path.write_text(before)


def test_another_version_is_a_reason_for_all(ran: tuple[Path, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    folder, done = ran
    assert told(folder, done) == {}
    monkeypatch.setattr(room, "version", lambda _: "0.0")
    seen = told(folder, done)
    assert seen == {"bench": "version", "pair": "below, version"}
