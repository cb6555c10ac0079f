"""Faults planted before logs are made: which group of parameters would explain what is seen."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError
from thermid.inference._explain.candidates import faults_of
from thermid.inference._explain.diagnosis import diagnose
from unit.inference.explain.plants import GROUPS, left_open, plant
from unit.qualify.things import soak, unit

SISNAV = Path(__file__).parents[4] / "examples" / "sisnav"
SENSORS = {"T_PROC": "proc", "T_ELE": "ele", "T_PLATE": "plate"}
IMU = {"ACC_X": "acc.acc_x.case", "ACC_Y": "acc.acc_y.case", "ACC_Z": "acc.acc_z.case", "T_ACCS": "acc.support"}
IMU |= {"T_FOG1": "fog_x.case", "T_FOG2": "fog_y.case", "T_FOG3": "fog_z.case", "T_IMUS": "support"}
WHOLE = {"T_PROC": "pre.proc.case", "T_ELE": "pre.ele.case", "T_DISK": "disk"} | {s: f"imu.{n}" for s, n in IMU.items()}


def cases(model: td.Model) -> list[td.Scenario]:
    """A hot and a cold soak with some loads switched off towards the end."""
    network = td.simulation.compile_network(model)
    loads, (room,) = [x.path for x in network.flat.loads], network.boundaries
    out = []
    for name, celsius, off in (("hot", 55, loads[:1]), ("cold", -20, loads[1:])):
        ramp = {"times": ["0 [h]", "2 [h]"], "values": ["24 [degC]", f"{celsius} [degC]"], "after": "hold"}
        pause = {"times": ["0 [h]", "7 [h]"], "values": [1, 0], "hold": True}
        out.append(td.Scenario(name, boundaries={room: ramp}, start="24 [degC]", duration="10 [h]", commands=dict.fromkeys(off, pause)))
    return out


def named(model: td.Model, sensors: dict[str, str], count: int, seed: int) -> dict[str, list[bool]]:
    """Return group -> whether each plant of it was named."""
    rng, courses = np.random.default_rng(seed), cases(model)
    out: dict[str, list[bool]] = {g: [] for g in GROUPS}
    for k in range(count):
        group = GROUPS[k % len(GROUPS)]
        planted = plant(model, courses, sensors, group, rng)
        out[group].append(diagnose(planted.told, spread=left_open(model)).group == group)
    return out


def test_nine_of_ten_faults_of_a_small_unit_are_named() -> None:
    found = named(unit(), SENSORS, 10, 7)
    assert sum(sum(v) for v in found.values()) >= 9


@pytest.mark.campaign
@pytest.mark.parametrize(("deck", "sensors"), [("m_Sd", WHOLE), ("m_IMU", IMU)])
def test_nine_of_ten_random_faults_of_the_navigation_unit_are_named(deck: str, sensors: dict[str, str]) -> None:
    """Forty plants each, eight of every group; no group is lost on the way."""
    found = named(td.load_model(SISNAV / f"{deck}.toml"), sensors, 40, 20261121)
    assert sum(sum(v) for v in found.values()) >= 36
    assert all(sum(v) >= 6 for v in found.values())


def seen(model: td.Model, shift: dict[str, float]) -> td.Calibration:
    times = np.arange(0.0, 6 * 3600.1, 60.0)
    run = td.simulate(model, soak(), times=times)
    rng = np.random.default_rng(2)
    made = {
        s: td.Channel.from_array(
            s, run[n].kelvin + shift.get(s, 0.0) + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, accuracy=0.3
        )
        for s, n in SENSORS.items()
    }
    return td.compare(unit(), td.Record.from_arrays("log", times, made), scenario=soak())


def test_the_fault_is_named_with_its_size() -> None:
    found = diagnose(seen(unit().with_values({"cpu.power": "7.5 [W]"}), {}))
    assert found.group == "power"
    assert found.best is not None
    assert found.best.name == "power of cpu"
    assert found.best.amount == pytest.approx(0.25, abs=0.02)
    assert found.best.left < 0.1
    assert "cpu +2" in str(found)


def test_what_sensors_and_model_are_said_to_err_by_needs_no_fault() -> None:
    told = seen(unit(), {"T_PROC": 0.3, "T_ELE": -0.2})
    found = diagnose(told, spread={"cpu.power": "0.05 [W]"})
    assert found.groups == diagnose(told, spread={"cpu.power": 0.05}).groups != diagnose(told).groups
    found = diagnose(told)
    assert found.group == "nothing"
    assert found.best is None
    assert re.search(r"\d\.\d\d K", str(found))


def test_a_sensor_that_a_run_started_from_is_seen_as_that() -> None:
    """The offset also stands in the start of its node, and decays there."""
    times = np.arange(0.0, 6 * 3600.1, 60.0)
    run = td.simulate(unit(), soak(), times=times)
    made = {
        s: td.Channel.from_array(
            s, run[n].kelvin + (3.0 if s == "T_ELE" else 0.0), unit="K", role="node", target=n, noise=0.05, accuracy=0.3
        )
        for s, n in SENSORS.items()
    }
    free = td.Scenario("log", boundaries={"air": "40 [degC]"}, start="measured")
    found = diagnose(td.compare(unit(), td.Record.from_arrays("log", times, made), scenario=free))
    assert found.group == "sensor"
    assert found.best is not None
    assert found.best.amount == pytest.approx(3.0, abs=0.3)


def test_links_that_are_there_may_weaken_and_others_only_appear() -> None:
    grown, found = faults_of(unit(), SENSORS)
    links = {c.name: c.one_sided for c in found if c.group == "link"}
    assert links == {
        "link proc - plate": False,
        "link ele - plate": False,
        "link plate - air": False,
        "link proc - air": False,
        "missing link proc - ele": True,
        "missing link ele - air": True,
    }
    assert sum(c.group == "capacitance" for c in found) == 3
    settled = [td.steady(m, soak())["proc"] for m in (unit(), grown)]
    assert settled[0] == pytest.approx(settled[1], abs=1e-9)


def test_one_sensor_tells_no_groups_apart() -> None:
    told = seen(unit(), {})
    one = td.Record.from_arrays("log", told.experiments[0].record.times, {"T": told.experiments[0].record["T_PROC"].values}, unit="K")
    alone = td.compare(
        unit(), one.with_channels(td.Channel.from_array("T", one["T"].values, unit="K", role="node", target="proc")), scenario=soak()
    )
    with raises_code("fit.not-possible", IdentificationError):
        diagnose(alone)
