"""Duty cycles of thermostats beside the exponentials of one node; members that sum their powers beside runs that do not."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.simulation._duty import DutyCycle

AIR, ON, OFF, POWER, CONDUCTANCE, TAU = -20.0, 5.0, 8.0, 12.0, 0.3, 400.0
COLD = td.Scenario("cold", boundaries={"air": f"{AIR} [degC]"}, start="7 [degC]", duration="1 [h]")
LIMITS = {"on_below": f"{ON} [degC]", "off_above": f"{OFF} [degC]"}


def deck(by_control: bool, **loads: Any) -> dict[str, Any]:
    """Return a box with a heater and a thermostat, of the load itself or of a control that it names."""
    table: dict[str, Any] = {
        "title": "box",
        "needs": ["air"],
        "nodes": {"box": {"capacitance": f"{TAU * CONDUCTANCE} [J/K]"}},
        "conductors": {"loss": {"kind": "conduction", "between": ["box", "air"], "conductance": f"{CONDUCTANCE} [W/K]"}},
        "loads": {"heater": {"into": "box", "power": f"{POWER} [W]"}, **loads},
    }
    if by_control:
        return table | {
            "loads": table["loads"] | {"heater": table["loads"]["heater"] | {"control": "trim"}},
            "controls": {"trim": {"follows": "box", "thermostat": LIMITS}},
        }
    table["loads"]["heater"]["thermostat"] = LIMITS
    return table


@pytest.mark.parametrize("by_control", [False, True], ids=["of the load", "of a control"])
def test_the_last_cycle_is_that_of_two_exponentials(by_control: bool) -> None:
    run = td.simulate(td.model_from_dict(deck(by_control)), COLD)
    hot = AIR + POWER / CONDUCTANCE
    on, off = TAU * math.log((hot - ON) / (hot - OFF)), TAU * math.log((OFF - AIR) / (ON - AIR))
    first = TAU * math.log((7.0 - AIR) / (ON - AIR))
    cycles = 1 + int((3600.0 - first) / (on + off))
    begun = first + (cycles - 1) * (on + off)
    whole = (cycles - 1) * on + min(on, 3600.0 - begun)
    (duty,) = run.duty_cycles.values()
    assert duty.cycles == cycles > 2
    assert duty.period == pytest.approx(on + off, rel=1e-4)
    assert duty.last_share == pytest.approx(on / (on + off), rel=1e-4)
    assert duty.share == pytest.approx(whole / 3600.0, rel=1e-4)
    assert duty.energy == pytest.approx(POWER * whole, rel=1e-4)
    assert (duty.mean_power, duty.last_power) == pytest.approx((duty.energy / 3600.0, POWER * duty.last_share))
    members = td.ensemble(td.model_from_dict(deck(by_control)), COLD, {"air": td.celsius(np.array([AIR, 20.0]))})
    ((name, shares),) = members.duty_cycles.items()
    assert name in run.duty_cycles
    assert shares[0] == pytest.approx((duty.share, duty.last_share), rel=1e-6)
    assert shares[1, 0] == 0.0  # in a warm room it never switches on
    assert math.isnan(shares[1, 1])


def test_the_heat_of_a_heater_on_a_node_without_mass_is_whole() -> None:
    table = deck(False)
    table["nodes"]["foil"] = {}
    table["conductors"] |= {f"glue_{n}": {"kind": "conduction", "between": ["foil", n], "conductance": "1 [W/K]"} for n in ("box", "air")}
    table["loads"]["heater"] |= {"into": "foil", "power": "70 [W]", "thermostat": LIMITS | {"sensor": "box"}}
    run = td.simulate(td.model_from_dict(table), COLD)
    assert run.duty_cycles["heater"].cycles > 1
    assert run.duty_cycles["heater"].energy == pytest.approx(run.heat_balance().loads, rel=1e-12)


def test_the_command_states_the_duty_cycle(tmp_path: Path) -> None:
    td.save_model(td.model_from_dict(deck(False)), tmp_path / "box.toml")
    words = ["simulate", str(tmp_path / "box.toml"), "--boundary", "air=-20", "--start", "7 [degC]", "--for", "1 [h]"]
    assert re.search(r"heater: .* 66\.3 %, 7\.96 W", CliRunner().invoke(app, words).output)
    stated = json.loads(CliRunner().invoke(app, [*words, "--json"]).output)["duty_cycles"]["heater"]
    assert 0.4 < stated["share"] < stated["last_share"] + 0.1
    never = json.loads(CliRunner().invoke(app, [*words[:3], "air=30", *words[4:], "--json"]).output)["duty_cycles"]["heater"]
    assert (never["share"], never["last_share"], never["cycles"]) == (0.0, None, 0)


def test_members_that_sum_their_powers_are_the_runs_themselves() -> None:
    """Straight lines of several grids, a held one and a constant into one node: what is summed is what acts."""
    rng = np.random.default_rng(11)
    sampled = {f"p{k}": {"into": "box", "power": "1 [W]"} for k in range(5)}
    grids = [np.sort(rng.uniform(200.0, 3500.0, 12)) for _ in sampled]
    powers = {
        n: {
            "times": [f"{t} [s]" for t in grid],
            "values": [f"{v} [W]" for v in rng.uniform(0.0, 2.0, 12)],
            "hold": n == "p4",
            "before": "hold",
        }
        for n, grid in zip(sampled, grids, strict=True)
    }
    scenario = COLD.with_(loads={n: p | {"before": "hold", "after": "hold"} for n, p in powers.items()})
    ready = td.prepare(td.model_from_dict(deck(False, **sampled)), scenario, [f"scale.{n}" for n in sampled])
    draws = {n: rng.uniform(-1.0, 2.0, 3) for n in ready.free}
    members = ready.ensemble(draws)
    for k in range(3):
        run = ready.run({n: float(v[k]) for n, v in draws.items()})
        assert run.statistics["switchings"]
        np.testing.assert_allclose(members.temperatures("box")[:, k], run["box"].kelvin, atol=1e-7)


def test_the_duty_of_a_prediction_lies_within_its_band() -> None:
    """It was that of the run at the fitted values, beside the band of members: 44.9 % (45.9 .. 53.8)."""
    own = DutyCycle(0.449, 0.376, 100.0, 5, 1000.0, 60.0, 53.0)
    told = own.of_members(np.array([[0.46, np.nan], [0.5, np.nan], [0.54, np.nan]]))
    assert (told.share, told.last_share, told.last_power) == (pytest.approx(0.5), 0.376, 53.0)
    assert told.mean_power / told.share == pytest.approx(own.mean_power / own.share)
    assert told.interval()[0, 0] < told.share < told.interval()[1, 0]
