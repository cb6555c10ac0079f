"""Tables of straight lines in Octave and SPICE: the same lines, or a refusal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError
from unit.interop.networks import TIGHT
from unit.interop.programs import ngspice, octave

LINK = {"points": [["0 [degC]", "0.1 [W/K]"], ["10 [degC]", "0.1 [W/K]"], ["20 [degC]", "0.5 [W/K]"], ["40 [degC]", "0.3 [W/K]"]]}
APART = {"over": "difference", "outside": "linear", "points": [["-10 [K]", "0.1 [W/K]"], ["5 [K]", "0.1 [W/K]"], ["15 [K]", "0.3 [W/K]"]]}
HEAT = {"points": [["0 [degC]", "40 [W]"], ["15 [degC]", "34 [W]"], ["30 [degC]", "28 [W]"], ["80 [degC]", "5 [W]"]]}
BAR = {"points": [["0 [degC]", "10 [W/(m K)]"], ["25 [degC]", "30 [W/(m K)]"], ["90 [degC]", "20 [W/(m K)]"]]}
BENCH = td.Scenario("bench", boundaries={"air": "0 [degC]"}, start="air", duration="10 [min]")


def box(bar: dict[str, Any] | None = None, **link: Any) -> td.Model:
    conductors: dict[str, Any] = {
        "link": {"kind": "table", "between": ["x", "air"], "table": LINK | link},
        "apart": {"kind": "table", "between": ["x", "y"], "table": APART},
    }
    if bar:
        conductors["bar"] = {"kind": "conduction", "between": ["y", "air"], "conductivity": bar, "area": "1 [cm^2]", "thickness": "2 [cm]"}
    return td.model_from_dict(
        {
            "title": "box",
            "needs": ["air"],
            "nodes": {"x": {"capacitance": "50 [J/K]"}, "y": {"capacitance": "20 [J/K]"}},
            "conductors": conductors,
            "loads": {"heat": {"into": "x", "table": HEAT}},
        }
    )


def test_octave_reads_the_same_lines(tmp_path: Path) -> None:
    times = np.linspace(0.0, 600.0, 31)
    td.interop.to_octave(box(BAR), BENCH, tmp_path / "tabled.m")
    ours = td.simulate(box(BAR), BENCH, times=times, options=TIGHT)
    found = octave(tmp_path / "tabled.m", times)
    assert np.abs(found - np.column_stack([ours["x"].celsius, ours["y"].celsius])).max() < 2e-6


def test_spice_reads_the_same_lines(tmp_path: Path) -> None:
    td.interop.to_spice(box(), BENCH, tmp_path / "box.cir")
    times, found = ngspice(tmp_path / "box.cir")
    ours = td.simulate(box(), BENCH, times=times, options=TIGHT)
    assert np.abs(found["x"] - ours["x"].celsius).max() < 2e-3


def test_what_is_not_written_is_refused() -> None:
    with raises_code("output.not-expressible", DeckError, match="'link'"):
        td.interop.to_octave(box(interpolation="smooth"), BENCH)
    with raises_code("output.not-expressible", DeckError, match="'refuse'.*SPICE"):
        td.interop.to_spice(box(outside="refuse"), BENCH)
    with raises_code("output.not-expressible", DeckError, match="SPICE"):
        td.interop.to_spice(box(BAR), BENCH)
