"""The map of a network: every node on one page, no card over another, all names legible, one picture for one deck."""

from __future__ import annotations

import itertools
import re
import sys
import time
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree

import pytest

import thermid as td
from thermid.app.cli.app import main
from thermid.model.tree import flatten
from thermid.reporting._diagrams.map import PAGE, SMALLEST, network_map, placed

BOX = Path(__file__).parents[3] / "examples" / "box" / "box.toml"


def chain(count: int, ring: bool = False) -> td.Model:
    ends = [(k, k + 1) for k in range(count - 1)] + ([(count - 1, 0)] if ring and count > 2 else [])
    links = {f"c{a}_{b}": {"kind": "conduction", "between": [f"n{a}", f"n{b}"], "conductance": "1 [W/K]"} for a, b in ends}
    out = {"kind": "convection", "between": ["n0", "air"], "htc": "5 [W/(m^2 K)]", "area": "0.1 [m^2]"}
    nodes = {f"n{k}": {"capacitance": "5 [J/K]"} for k in range(count)}
    return td.model_from_dict({"title": f"chain {count}", "needs": ["air"], "nodes": nodes, "conductors": links | {"out": out}})


def models() -> list[td.Model]:
    return [chain(1), chain(2), chain(5), chain(25, ring=True), chain(60), td.load_model(BOX), chain(80)]


@pytest.mark.parametrize("model", models(), ids=lambda m: m.title)
def test_every_node_is_on_one_page_and_no_card_over_another(model: td.Model) -> None:
    flat = flatten(model)
    start = time.process_time()
    text = network_map(model)
    assert time.process_time() - start < 1.5
    cards, _ = placed(model, flat)
    assert sorted(node for card in cards for node in card.nodes) == sorted(n.path for n in flat.nodes)
    for card in cards:
        assert card.x >= 0.0
        assert card.y >= 0.0
        assert card.x + card.width <= PAGE[0]
        assert card.y + card.height <= PAGE[1] - 40.0
    for a, b in itertools.combinations(cards, 2):
        assert a.x + a.width <= b.x or b.x + b.width <= a.x or a.y + a.height <= b.y or b.y + b.height <= a.y
    ElementTree.fromstring(text)
    assert min(float(size) for size in re.findall(r'font-size="([\d.]+)"', text)) >= SMALLEST >= 9.0
    assert network_map(model) == text


def test_neighbours_lie_near_one_another() -> None:
    """Along a chain of 25 nodes a step is one place on the grid, mostly; in the order of their names on the grid it is more."""
    cards, _ = placed(chain(25), flatten(chain(25)))
    at = {card.name: (card.x, card.y) for card in cards}
    wide = min(abs(a[0] - b[0]) for a, b in itertools.combinations(at.values(), 2) if abs(a[0] - b[0]) > 30.0)
    steps = [abs(at[f"n{k}"][0] - at[f"n{k + 1}"][0]) / wide for k in range(24)]
    assert sum(steps) / 24 < 1.3


def test_parts_are_cards_and_hubs_are_named_on_them() -> None:
    text = network_map(td.load_model(BOX))
    assert "named on their cards: air, lid" in text
    assert text.count(">to air, lid<") >= 20
    assert "<title>u1.JB (conduction)</title>" in text
    assert "<title>u1.JC (conduction)</title>" in text


def test_the_command_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    to = tmp_path / "map.svg"
    with mock.patch.object(sys, "argv", ["thermid", "diagram", str(BOX), "--map", "--to", str(to)]), pytest.raises(SystemExit) as left:
        main()
    assert not left.value.code
    assert to.read_text(encoding="utf-8").startswith('<svg class="thermid-map"')
    arguments = ["thermid", "diagram", str(BOX), "--map", "--fold", "u1", "--to", str(to)]
    with mock.patch.object(sys, "argv", arguments), pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    assert "a map shows every node" in capsys.readouterr().err
