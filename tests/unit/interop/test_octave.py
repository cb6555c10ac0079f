"""Octave functions: the numbers of `simulate` where Octave is installed, the text of the file, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.interop._wired import identifiers
from thermid.interop.octave import _groups
from unit.interop.networks import GAP, HOT, SIGNALS, TIGHT, hot_box
from unit.interop.programs import octave


def test_every_law_and_every_signal_agree(tmp_path: Path) -> None:
    model, times = hot_box(), np.linspace(0.0, 3.0 * 3600.0, 25)
    td.interop.to_octave(model, SIGNALS, tmp_path / "hot_box.m")
    found = octave(tmp_path / "hot_box.m", times)
    ours = td.simulate(model, SIGNALS, times=times, options=TIGHT)
    assert np.abs(found - np.column_stack([ours["box"].celsius, ours["lid"].celsius])).max() < 2e-6


@pytest.mark.parametrize("pressure", ["101.325 [kPa]", "50 [Pa]"])
def test_the_gas_of_a_joint_at_one_pressure_agrees(pressure: str, tmp_path: Path) -> None:
    """The form that is advised for a box was refused, in plain air too."""
    still = dict(HOT["conductors"]["leak"])
    model, times = hot_box(pad=GAP, blow=still), np.linspace(0.0, 3600.0, 9)  # every law and signal has its three hours above
    scenario = SIGNALS.with_(environment={"*": td.simulation.Environment(pressure)})
    td.interop.to_octave(model, scenario, tmp_path / "hot_box.m")
    found = octave(tmp_path / "hot_box.m", times)
    ours = td.simulate(model, scenario, times=times, options=TIGHT)
    assert np.abs(found - np.column_stack([ours["box"].celsius, ours["lid"].celsius])).max() < 1e-3
    assert np.abs(ours["lid"].celsius - td.simulate(hot_box(blow=still), scenario, times=times)["lid"].celsius).max() > 0.5


def test_values_can_be_changed_in_octave(tmp_path: Path) -> None:
    model, times = hot_box(), np.linspace(0.0, 3600.0, 5)
    td.interop.to_octave(model, SIGNALS, tmp_path / "hot_box.m")
    found = octave(tmp_path / "hot_box.m", times, "p.share = 0.5; p.leak_conductance = 0.2;")
    ours = td.simulate(model.with_values({"share": "0.5", "leak.conductance": "0.2 [W/K]"}), SIGNALS, times=times, options=TIGHT)
    assert np.abs(found - np.column_stack([ours["box"].celsius, ours["lid"].celsius])).max() < 2e-6


def test_a_gain_stands_in_place_of_the_power(tmp_path: Path) -> None:
    model, times = hot_box(), np.linspace(0.0, 3600.0, 5)
    scenario = SIGNALS.with_(gains={"heater": "_gain"})
    assert "p.x_gain = 28;" in td.interop.to_octave(model, scenario, tmp_path / "hot_box.m")
    found = octave(tmp_path / "hot_box.m", times)
    ours = td.simulate(model, scenario, times=times, options=TIGHT)
    assert np.abs(found - np.column_stack([ours["box"].celsius, ours["lid"].celsius])).max() < 2e-6


def test_a_gas_that_leaves_agrees(tmp_path: Path) -> None:
    """A surface with an emissivity in air, then in vacuum: two laws, each with the presence of its gas."""
    model = td.model_from_dict(
        {
            "title": "plate",
            "needs": ["air"],
            "nodes": {"plate": {"capacitance": "200 [J/K]"}},
            "surfaces": {"skin": {"of": "plate", "to": "air", "area": "0.05 [m^2]", "effective_htc": "8 [W/(m^2 K)]", "emissivity": 0.6}},
            "loads": {"heater": {"into": "plate", "power": "6 [W]"}},
        }
    )
    from thermid.model.tree import TableSignal

    pump = TableSignal(np.array([0.0, 1800.0]), np.array([101325.0, 0.0]), hold=True)
    scenario = td.Scenario("pump", boundaries={"air": "20 [degC]"}, environment={"air": td.simulation.Environment(pump)}, duration="1 [h]")
    times = np.linspace(0.0, 3600.0, 13)
    td.interop.to_octave(model, scenario, tmp_path / "plate.m")
    ours = td.simulate(model, scenario, times=times, options=TIGHT)["plate"].celsius
    assert ours[-1] > ours[6] + 5.0
    assert np.abs(octave(tmp_path / "plate.m", times)[:, 0] - ours).max() < 2e-6


def test_a_steady_start_and_an_open_path(tmp_path: Path) -> None:
    """An infinite resistance is a conductance of zero, not a NaN (E4 of the acceptance sheet)."""
    model = td.model_from_dict(
        {
            "title": "pair",
            "needs": ["air"],
            "nodes": {"a": {"capacitance": "100 [J/K]"}, "b": {"capacitance": "50 [J/K]"}, "mid": {}},
            "conductors": {
                "one": {"kind": "conduction", "between": ["a", "mid"], "resistance": "2 [K/W]"},
                "two": {"kind": "conduction", "between": ["b", "mid"], "resistance": "1 [K/W]"},
                "gap": {"kind": "conduction", "between": ["mid", "air"], "resistance": "inf [K/W]"},
                "skin": {"kind": "conduction", "between": ["a", "air"], "resistance": "4 [K/W]"},
            },
            "loads": {"heater": {"into": "b", "power": "3 [W]"}},
        }
    )
    held = td.Scenario(boundaries={"air": "20 [degC]"}, start="steady", duration="1 [h]")
    text = td.interop.to_octave(model, held, tmp_path / "pair.m")
    assert "p.gap_resistance = Inf;" in text
    found = octave(tmp_path / "pair.m", np.array([0.0, 1800.0, 3600.0]))
    assert np.abs(found - [32.0, 41.0]).max() < 1e-6


def test_the_file_says_what_it_is() -> None:
    text = td.interop.to_octave(hot_box(), SIGNALS)
    assert text.startswith("function [t, T, names] = hot_box(t, p)\n% hot_box: temperatures of the thermal model 'hot box' in the scenario")
    assert "  p.area = 0.1;  % [m^2]\n" in text
    assert "  p.glow_area = p.share*p.area;  % [m^2]\n" in text
    assert "G_free = p.free_htc_coefficient*p.free_area*((T_box - T_air)^2 + 0.01^2)^(p.free_htc_exponent/2);" in text
    assert "% Columns of T [degC]: box, lid.\n% Without mass, and eliminated: seam, glue.\n" in text


def test_words_of_the_author_stay_in_their_comments() -> None:
    said = {"title": "box\nsystem('ls')", "parameters": {**HOT["parameters"], "area": {"value": "0.1 [m^2]", "note": "one\r\ntwo"}}}
    scenario = SIGNALS.with_(title="a\nb")
    model = td.model_from_dict({**HOT, **said})
    assert "model 'box system('ls')' in the scenario 'a b'." in td.interop.to_octave(model, scenario, name="box")
    assert "% [m^2] one two\n" in td.interop.to_octave(model, scenario, name="box")
    assert td.interop.to_spice(model, scenario).splitlines()[0].startswith("* box system('ls'), a b: ")


def test_words_are_made_unlike() -> None:
    assert identifiers(["a.b", "a_b", "A.b", "x"]) == {"a.b": "a_b", "a_b": "a_b_2", "A.b": "A_b", "x": "x"}
    assert identifiers(["a.b", "A_b"], caseless=True) == {"a.b": "a_b", "A_b": "A_b_2"}
    assert identifiers(["_a", "9"]) == {"_a": "x_a", "9": "x9"}
    assert len("boundary_" + identifiers(["x" * 80, "x" * 90])["x" * 90]) <= 63


POINTS = {"over": "difference", "interpolation": "smooth", "points": [["0 [K]", "1 [W/K]"], ["9 [K]", "2 [W/K]"]]}


@pytest.mark.parametrize(
    ("change", "scenario", "code", "match"),
    [
        (
            {},
            {"schedule": {"area": "0.1 [m^2]"}},
            "output.not-expressible",
            "'area'",
        ),
        ({}, {"duration": 0.0}, "value.outside-range", r'"5 \[h\]".*"5 \[h\]"'),
        (
            {"bent": {"kind": "radiation", "between": ["glue", "wall"], "emissivity": 0.5, "area": "1 [m^2]"}},
            {},
            "output.not-expressible",
            "'bent'.*'glue'",
        ),
        (
            {"bent": {"kind": "table", "between": ["box", "wall"], "table": POINTS}},
            {},
            "output.not-expressible",
            "'bent'",
        ),
    ],
)
def test_what_cannot_be_written_is_refused(
    change: dict[str, dict[str, object]], scenario: dict[str, object], code: str, match: str
) -> None:
    with raises_code(code, match=match):
        td.interop.to_octave(hot_box(**change), SIGNALS.with_(**scenario))


def test_a_load_that_depends_on_temperature_is_refused() -> None:
    loads = {"heater": {"into": "box", "power": "3 [W]", "temperature_coefficient": "0.01 [1/K]", "reference_temperature": "20 [degC]"}}
    model = td.model_from_dict({**HOT, "loads": loads})
    with raises_code("output.not-expressible", match="'heater'"):
        td.interop.to_octave(model, SIGNALS.with_(commands={}))
    off = replace(SIGNALS, commands={}, loads={"heater": "0 [W]"})  # as its refusal advises
    td.interop.to_octave(model, off)


@pytest.mark.parametrize("name", ["2boxes", "end", "initial", "hot-box", "x" * 64])
def test_a_file_that_is_no_function_is_refused(name: str, tmp_path: Path) -> None:
    with raises_code("name.not-valid"):
        td.interop.to_octave(hot_box(), SIGNALS, tmp_path / f"{name}.m")
    assert list(tmp_path.iterdir()) == []


def test_massless_nodes_are_eliminated_together_with_all_that_are_joined_to_them() -> None:
    """`b` joins `a` and `c`, which come before it and stand apart until then; `d` stands alone, `case` has a mass."""
    ends = [("a", "case"), ("a", "b"), ("d", "case"), ("b", "c")]
    wired: Any = SimpleNamespace(massless=("a", "c", "d", "b"), conductors=[("", SimpleNamespace(ends=e)) for e in ends])
    assert sorted(_groups(wired)) == [["a", "c", "b"], ["d"]]
