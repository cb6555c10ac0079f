"""SPICE netlists: the numbers of `simulate` where ngspice is installed, the text, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import thermid as td
from by_code import raises_code
from unit.interop.networks import GAP, SIGNALS, TIGHT, hot_box
from unit.interop.programs import ngspice


def test_every_law_and_every_signal_agree(tmp_path: Path) -> None:
    """Behavioural sources, sines, ramps and jumps; massless nodes at curved laws too, since the simulator solves for them."""
    bent = {"kind": "radiation", "between": ["glue", "wall"], "emissivity": 0.5, "area": "0.02 [m^2]"}
    model = hot_box(bent=bent)
    td.interop.to_spice(model, SIGNALS, tmp_path / "hot.cir")
    times, found = ngspice(tmp_path / "hot.cir")
    times = np.minimum(times, SIGNALS.seconds)
    ours = td.simulate(model, SIGNALS, times=times, options=TIGHT)
    for node in ("box", "lid", "seam", "glue"):
        assert np.abs(found[node] - ours[node].celsius)[1:].max() < 2e-4, node


def test_the_gas_of_a_joint_agrees(tmp_path: Path) -> None:
    """Its table over temperature has straight lines; the simulator's steps add their part at such a joint."""
    td.interop.to_spice(hot_box(pad=GAP), SIGNALS, tmp_path / "hot.cir")
    times, found = ngspice(tmp_path / "hot.cir")
    ours = td.simulate(hot_box(pad=GAP), SIGNALS, times=np.minimum(times, SIGNALS.seconds), options=TIGHT)
    for node in ("box", "lid"):
        assert np.abs(found[node] - ours[node].celsius)[1:].max() < 2e-3, node


def test_the_netlist_of_one_mass() -> None:
    model = td.model_from_dict(
        {
            "title": "block",
            "needs": ["Air"],
            "nodes": {"air": {"capacitance": "26 [J/K]"}},
            "conductors": {"skin": {"kind": "conduction", "between": ["air", "Air"], "resistance": "40 [K/W]"}},
            "loads": {"heater": {"into": "air", "power": "0.25 [W]"}},
        }
    )
    head, rest = td.interop.to_spice(model, td.Scenario("test", boundaries={"Air": "24 [degC]"}, duration="5 [h]")).split("\n", 1)
    assert re.fullmatch(r"\* block, test: .* degC, .* W, .* K/W, .* J/K", head)
    assert rest == (
        "V_Air_2 Air_2 0 DC 24\n"
        "C_air air 0 26 IC=24\n"
        "R_skin air Air_2 40\n"
        "* load heater\n"
        "I_1 0 air DC 0.25\n"
        ".options reltol=1e-7 abstol=1e-12 vntol=1e-9\n"
        ".tran 3.6 18000 0 3.6 UIC\n"
        ".print tran V(air)\n"
        ".end\n"
    )


def test_an_open_path_is_left_out() -> None:
    text = td.interop.to_spice(hot_box(leak={"kind": "conduction", "between": ["glue", "air"], "resistance": "inf [K/W]"}), SIGNALS)
    assert "R_leak" not in text
    assert "\n* leak: " in text


def test_a_schedule_is_refused() -> None:
    with raises_code("output.not-expressible", match="'area'.*SPICE"):
        td.interop.to_spice(hot_box(), SIGNALS.with_(schedule={"area": "0.1 [m^2]"}))
