"""What if: a run with other conditions has the curve of the command, and a refused vacuum has three ways on."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.app.cli.app import main
from thermid.app.studio.building import Building
from thermid.base.errors import NameNotFoundError, ThermidError
from thermid.model.tree import toml_text
from two_masses import DECK, write_log

CHANGES: dict[str, tuple[dict[str, Any], list[str]]] = {
    "ambient": ({"boundaries": {"room": "35 [degC]"}}, ["--boundary", "room=35"]),
    "power": ({"factors": {"heater": 1.5}}, ["--load", "heater=7.5 [W]"]),
    "duration": ({"duration": "10 [h]"}, ["--for", "10 [h]"]),
    "start": ({"start": "40 [degC]"}, ["--start", "40"]),
    "printed": ({"gas": "printed"}, ["--as-printed"]),
}


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """``run("simulate", deck)``: what a command prints."""

    def printed(*words: str) -> str:
        monkeypatch.setattr(sys, "argv", ["thermid", *words])
        with pytest.raises(SystemExit):
            main()
        return capsys.readouterr().out

    return printed


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    file = tmp_path / "box.toml"
    file.write_text(toml_text(DECK), encoding="utf-8")
    return file


@pytest.mark.parametrize("change", CHANGES)
def test_the_curve_is_that_of_the_command(deck: Path, run: Callable[..., str], change: str) -> None:
    body, options = CHANGES[change]
    curves = Building(deck).compared(body)
    assert len(curves["changes"]) == 1
    plain = {"--boundary": "room=24", "--start": "24", "--for": "5 [h]"}
    words = [w for pair in plain.items() if pair[0] not in options for w in pair] + options
    times = curves["curves"][0]["after_times"][[1, 7, 300, -1]]
    moments = [w for t in times for w in ("--at", f"{float(t)!r} [s]")]
    nodes = json.loads(run("simulate", str(deck), *words, *moments, "--json"))["nodes"]
    for curve in curves["curves"]:
        drawn = curve["after"][np.searchsorted(curve["after_times"], times)]
        assert np.abs(drawn - nodes[curve["node"]]["at_C"]).max() < 1e-9


def test_a_longer_record_holds_what_ends_and_says_so(deck: Path) -> None:
    building = Building(deck)
    file = building.stored_log("run.csv", write_log(deck.parent / "elsewhere.csv").read_bytes())
    building.commanded({"do": "log", "file": file})
    made = building.compared({"duration": "10 [h]", "factors": {"heater": 1.5}, "boundaries": {"room": "35 [degC]"}})
    assert made["curves"][0]["after_times"][-1] == 36000.0
    assert len(made["changes"]) == 3
    assert re.match(r"\w+: 4 h, .* 10 h; ", made["changes"][2])


def test_a_refused_vacuum_names_its_surfaces_and_each_way_goes_on(deck: Path) -> None:
    building = Building(deck)
    refused = building.compared({"gas": "vacuum"})
    assert refused["surfaces"] == ["skin"]
    assert "curves" not in refused
    split = building.compared({"gas": "vacuum", "split": "paint, black"})
    printed = building.compared({"gas": "printed"})
    assert "emissivity" not in building.draft.deck.text
    building.commanded({"do": "finish", "surfaces": ["skin"], "finish": "paint, black"})
    ends = [made["curves"][0]["after"][-1] for made in (split, printed, building.compared({"gas": "vacuum"}))]
    assert ends[0] == pytest.approx(ends[2], abs=0.5)
    assert ends[1] > ends[2]  # an upper bound


@pytest.mark.parametrize("factor", ["1,5", "", None, [2.0], "3 [W]"])
def test_a_factor_that_is_no_number_is_refused_with_its_place(deck: Path, factor: object) -> None:
    """Letters came as null, and the answer was an error of the server."""
    with pytest.raises(ThermidError) as refused:
        Building(deck).compared({"factors": {"heater": factor}})
    assert refused.value.where == "factors.heater"
    said, number = (Building(deck).compared({"factors": {"heater": f}})["changes"] for f in ("1.5", 1.5))
    assert said == number != ()


def test_a_start_below_zero_kelvin_is_refused_at_its_field(deck: Path) -> None:
    """The run ended in an error that named no field."""
    with raises_code("value.outside-range", match="-300 degC lies below 0 K") as refused:
        Building(deck).compared({"start": "-300 [degC]"})
    assert refused.value.where.endswith(", start")


def test_unknown_names_are_refused(deck: Path) -> None:
    for body in ({"boundaries": {"nobody": "3 [degC]"}}, {"factors": {"nobody": 2.0}}):
        with pytest.raises(NameNotFoundError):
            Building(deck).compared(body)
