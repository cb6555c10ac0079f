"""The electronics box: how large it is, what it says, and mistakes planted in it."""

from __future__ import annotations

import contextlib
import io
import shutil
import sys
from pathlib import Path
from unittest import mock

import pytest

import thermid as td
from thermid.app.cli.app import main
from thermid.model.tree import Flat

BOX = Path(__file__).parents[2] / "examples" / "box"
HOT = td.Scenario("hot", boundaries={"room": "35 [degC]", "mount": "40 [degC]"}, start="35 [degC]", duration="3 [h]")


def said(*words: str) -> tuple[str, int]:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out), mock.patch.object(sys, "argv", ["thermid", *words]):
        try:
            main()
        except SystemExit as end:
            return out.getvalue(), int(end.code or 0)
    return out.getvalue(), 0


def test_the_box_is_as_large_as_it_says_in_110_lines_and_a_table() -> None:
    flat = Flat.of_model(td.load_model(BOX / "box.toml"))
    assert (len(flat.nodes), len(flat.conductors)) == (50, 150)
    assert sum(len(p.read_text(encoding="utf-8").splitlines()) for p in BOX.glob("*.toml")) <= 110
    assert len(list(BOX.glob("*.csv"))) == 1


def test_every_node_balances_and_every_run() -> None:
    model = td.load_model(BOX / "box.toml")
    heat = td.steady(model, HOT).heat
    assert heat is not None
    assert heat.worst() < 1e-9
    taken = sum(b.residual for b in heat.balances() if b.given)
    assert taken == pytest.approx(sum(w for _, w in heat.loads.values()), rel=1e-9)
    assert td.simulate(model, HOT).heat_balance().relative < 1e-9


def test_check_prints_five_lines_and_counts_the_rest() -> None:
    text, code = said("check", str(BOX / "box.toml"))
    *five, more = text.splitlines()
    assert code == 0
    assert len(five) <= 5
    assert "0 errors, 0 warnings" in five[-1]
    assert more.endswith("more: -v")
    everything = said("check", str(BOX / "box.toml"), "-v")[0].splitlines()
    assert len(everything) == len(five) + int(more.split()[0])


MISTAKES = {
    "a factor of a thousand in a resistance": ("parts.csv", "0.9, 0.81", "900, 0.81", "'u7.heat.power' is 900 [W]"),
    "millikelvin for kelvin": ("parts.csv", "10, 7.5,", "10, 7500,", "'u7.theta_JB' is 7500 [K/W]"),
    "an area in square metres": ("parts.csv", "3.2, 5.3", "3.2, 5.3 [m^2]", "'u1.top.area' is 5.3 [m^2]"),
    "a zone that is not there": ("parts.csv", "u5, QFN32, zone_1_3", "u5, QFN32, zone_1_4", "zone_1_4"),
    "a unit of another kind": ("parts.csv", "theta_JB [K/W]", "theta_JB [W/K]", "parts.csv:3"),
    "a part twice": ("parts.csv", "u9, SO8", "u8, SO8", "parts.csv:10"),
    "a part without its board resistance": ("parts.csv", "90, 110, 0.04", "90, 0.04", "parts.csv:17: "),
    "an emissivity in per cent": (
        "box.toml",
        "value = 0.88, min = 0.84, max = 0.93",
        "value = 88",
        "parameters.paint: 'base_out.emissivity' is 88. Give 0 to 1",
    ),
    "radiation into air": ("zone.toml", 'sees = "base", ', "", "nodes.air: 'zone_1_1.bottom'"),
    "a screw with nothing behind it": ("box.toml", '"base", "mount"]', '"base", "lid"]', "box.toml:2, needs: "),
    "more screws than joint": (
        "box.toml",
        "slope        = 0.1",
        'slope = 0.1\narea = "1 [cm^2]"',
        "filler_conductivity",
    ),
    "a value that nothing uses": ("box.toml", 'emissivity = "paint"', "emissivity = 0.88", "parameters.paint: "),
    "a field in other letters": ("parts.csv", "theta_JB [K/W]", "theta_jb [K/W]", "Did you mean 'theta_JB'?"),
    "a lid that hangs in the air": (
        "box.toml",
        'between = ["wall", "lid"], count = 8',
        'between = ["wall", "ldi"], count = 8',
        "Did you mean 'lid'?",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_stands_among_the_five(mistake: str, tmp_path: Path) -> None:
    shutil.copytree(BOX, tmp_path / "box")
    file, old, new, words = MISTAKES[mistake]
    path = tmp_path / "box" / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    shown = said("check", str(tmp_path / "box" / "box.toml"))[0]
    assert words in shown, shown
    assert len(shown.splitlines()) <= 6


def test_steady_prints_margins_and_flows() -> None:
    boundaries = ("--boundary", "room=35", "--boundary", "mount=40")
    text, code = said("steady", str(BOX / "box.toml"), *boundaries, "--limit", "*.junction=-40..70", "--limit", "lid=85", "--flows")
    lines = text.splitlines()
    assert code == 0
    assert lines[0].startswith("electronics box, ")
    assert lines[0].count("u1.junction") == 2  # the hottest, and that of the least margin
    assert lines[2].split()[0] == "u1.junction"
    assert "u1.junction" in text
    assert any(line.split()[1:2] == ["base_in.radiation"] for line in lines)
    for words, message in (
        (("--limit", "*.junktion=100"), "no node matches '*.junktion'"),
        (("--group", "x=zebra*"), "no node matches 'zebra"),
    ):
        text, code = said("steady", str(BOX / "box.toml"), *boundaries, *words)
        assert (code, message in text) == (2, True)
    text, code = said("steady", str(BOX / "box.toml"), *boundaries, "--limit", "lid=85..20")
    assert (code, "not below" in text) == (2, True)
