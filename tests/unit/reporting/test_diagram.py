"""Maps of nested models: every node, conductor and load is there, no text becomes markup."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import Any

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import NameNotFoundError
from thermid.model.tree import KINDS, Flat
from thermid.reporting._diagrams.map import STYLES, clipped, network_map, quantity, width_of

SVG = "{http://www.w3.org/2000/svg}"


def titles(svg: str) -> list[str]:
    return [t.text or "" for t in ET.fromstring(svg).iter(f"{SVG}title")]


def texts(svg: str) -> list[str]:
    return ["".join(t.text or "" for t in [e]) or (e[0].tail or "") for e in ET.fromstring(svg).iter(f"{SVG}text")]


def gyro() -> dict[str, Any]:
    return {
        "title": "Gyro",
        "needs": ["gas", "wall"],
        "offers": ["case"],
        "nodes": {"case": {"capacitance": "300 [J/K]"}},
        "surfaces": {
            "skin": {"of": "case", "to": "gas", "area": "80 [cm^2]", "htc": "5 [W/(m^2 K)]", "emissivity": "0.8", "radiates_to": "wall"}
        },
        "loads": {"coil": {"into": "case", "power": "1.5 [W]"}},
    }


@pytest.fixture(scope="module")
def nested(box: td.Model) -> td.Model:
    """Thirteen nodes on three levels, with every kind of conductor."""
    fog = td.model_from_dict(gyro())
    block = td.model_from_dict(
        {
            "title": "Gyro block",
            "needs": ["air", "wall"],
            "offers": ["plate"],
            "nodes": {"plate": {"capacitance": "800 [J/K]"}, "cavity": {}},
            "submodels": {k: {"use": fog, "bind": {"gas": "cavity", "wall": "wall"}} for k in "xyz"},
            "conductors": {
                **{
                    f"foot_{k}": {
                        "kind": "contact",
                        "between": [f"{k}.case", "plate"],
                        "contact_conductance": "300 [W/(m^2 K)]",
                        "area": "12 [cm^2]",
                    }
                    for k in "xyz"
                },
                "vent": {"kind": "flow", "between": ["cavity", "air"], "mass_flow": "0.2 [g/s]", "specific_heat": "1005 [J/(kg K)]"},
            },
        }
    )
    pair = td.model_from_dict(
        {
            "title": "Electronics",
            "needs": ["air"],
            "offers": ["a.case"],
            "submodels": {k: {"use": box, "bind": {"air": "air"}} for k in "ab"},
            "joints": {"stack": {"between": ["a.skin", "b.skin"], "area": "20 [cm^2]", "contact_conductance": "200 [W/(m^2 K)]"}},
        }
    )
    return td.model_from_dict(
        {
            "title": "Unit",
            "needs": ["air", "wall", "mount"],
            "nodes": {
                "frame": {"capacitance": "5200 [J/K]"},
                "cover": {"capacitance": "900 [J/K]"},
                "lid": {"capacitance": "90 [J/K]"},
                "strap": {},
                "sensor": {"capacitance": "2 [J/K]"},
            },
            "submodels": {"imu": {"use": block, "bind": {"air": "air", "wall": "wall"}}, "ele": {"use": pair, "bind": {"air": "air"}}},
            "conductors": {
                "bolts": {"kind": "conduction", "between": ["frame", "mount"], "conductance": "1.5 [W/K]"},
                "screws": {"kind": "conduction", "between": ["imu.plate", "frame"], "conductance": "2.5 [W/K]"},
                "foot": {"kind": "conduction", "between": ["ele.a.case", "frame"], "conductance": "0.8 [W/K]"},
                "rim": {"kind": "conduction", "between": ["cover", "frame"], "conductance": "4 [W/K]"},
                "seal": {"kind": "conduction", "between": ["lid", "cover"], "conductance": "0.2 [W/K]"},
                "inside": {"kind": "radiation", "between": ["imu.plate", "cover"], "exchange_factor": "0.7", "area": "400 [cm^2]"},
                "braid": {
                    "kind": "table",
                    "between": ["frame", "strap"],
                    "table": {"points": [["0 [degC]", "0.1 [W/K]"], ["50 [degC]", "0.2 [W/K]"]]},
                },
                "strap_end": {"kind": "conduction", "between": ["strap", "mount"], "conductance": "0.3 [W/K]"},
                "glue": {"kind": "conduction", "between": ["sensor", "frame"], "conductance": "0.05 [W/K]"},
            },
        }
    )


def test_the_nested_model_is_what_it_should_be(nested: td.Model) -> None:
    flat = Flat.of_model(nested)
    assert len(flat.nodes) == 13
    assert max(n.path.count(".") for n in flat.nodes) == 2
    assert {c.kind for c in flat.conductors} == {"conduction", "contact", "convection", "effective", "radiation", "flow", "table"}


@pytest.mark.parametrize("which", ["box", "nested"])
def test_every_node_conductor_load_and_boundary_is_drawn(which: str, request: pytest.FixtureRequest) -> None:
    model: td.Model = request.getfixturevalue(which)
    svg, flat = network_map(model), Flat.of_model(model)
    said = titles(svg)
    for node in flat.nodes:
        assert node.path in said
    for c in flat.conductors:
        assert any(f"{c.path} ({c.kind})" in t for t in said), c.path
    for load in flat.loads:
        assert any(f"{load.path} into {load.node}: " in t for t in said), load.path
    assert all(any(b in text for text in texts(svg)) for b in flat.names.boundaries)
    masses = [e.get("class", "") for e in ET.fromstring(svg).iter(f"{SVG}rect") if e.get("class", "").startswith("node")]
    assert [kind == "node massless" for kind in masses].count(False) == sum(bool(n.fields) for n in flat.nodes)


def test_kinds_look_different_and_the_legend_names_those_that_have_a_line(nested: td.Model) -> None:
    svg = network_map(nested)
    for style in ("solid", "dashed", "dotted", "mixed"):
        assert f'class="wire {style}"' in svg
    assert {"conduction, contact", "convection", "radiation", "table"} <= set(texts(svg))


def test_numbers_are_the_models(box: td.Model) -> None:
    svg = network_map(box)
    assert any("0.3 W/K" in t for t in titles(svg))  # 6 W/(m^2 K) on 500 cm^2
    assert "+4 W" in texts(svg)


def test_a_conductance_that_depends_on_temperature_says_so_until_temperatures_are_given() -> None:
    model = td.model_from_dict(gyro())
    assert any("≈" in t for t in titles(network_map(model)))
    known = titles(network_map(model, temperatures={"case": 320.0, "gas": 300.0, "wall": 290.0}))
    assert not any("≈" in t for t in known)
    # eps sigma A (Ta^2 + Tb^2)(Ta + Tb) by hand
    by_hand = 0.8 * 5.670374419e-8 * 80e-4 * (320.0**2 + 290.0**2) * (320.0 + 290.0)
    assert any(quantity(by_hand, "W/K") in t for t in known)


def test_warm_masses_are_tinted_otherwise_than_cold_ones(nested: td.Model) -> None:
    nodes = [n.path for n in Flat.of_model(nested).nodes if n.fields]
    svg = network_map(nested, temperatures={n: 290.0 + k for k, n in enumerate(nodes)})
    assert len(set(re.findall(r'class="node[^>]*style="fill:(#[0-9a-f]{6})"', svg))) == len(nodes)


def test_a_temperature_of_no_node_is_refused(box: td.Model) -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'case'"):
        network_map(box, temperatures={"cas": 300.0})


def test_hostile_titles_stay_text(box: td.Model) -> None:
    evil = '<script>alert("1")</script>'
    bad = td.model_from_dict({**gyro(), "title": evil})
    svg = network_map(bad, title=f"{evil}&")
    assert "<script" not in svg
    assert titles(svg)[0] == f"{evil}&"


def test_a_map_refers_to_nothing_outside(nested: td.Model) -> None:
    svg = network_map(nested).replace('xmlns="http://www.w3.org/2000/svg"', "")
    assert "://" not in svg
    assert "href" not in svg
    assert "url(" not in svg
    assert " id=" not in svg  # several maps stand on one page


def test_a_long_text_is_cut_to_its_room() -> None:
    assert clipped("short", 200.0) == "short"
    cut = clipped("a_name_that_is_far_too_long_for_its_box", 80.0)
    assert cut.endswith("…")
    assert width_of(cut) <= 80.0


def test_every_kind_of_conductor_has_a_line() -> None:
    assert set(STYLES) == set(KINDS)
