"""Forecasts of final temperatures on the virtual laboratory's logs. All is synthetic: a hidden unit seen through sensors with errors."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import code_of
from thermid.measure.records import Channel

HOUR = 3600.0
FOLDER = Path(__file__).parents[2] / "examples" / "sisnav"
TESTS = ("acc", "fog_h", "fog_l", "elegfo", "procsisnav", "pre_both", "imu_all", "sd_all")


@pytest.fixture(scope="module")
def laboratory():
    sys.path.insert(0, str(FOLDER))
    try:
        import laboratory as made

        yield made
    finally:
        sys.path.remove(str(FOLDER))


def record(laboratory, name, world):
    times, columns, _ = laboratory.run(name, world, laboratory.SEED)
    kelvin = {k: Channel.from_array(k, v + 273.15, unit="K") for k, v in columns.items() if k.startswith(("T_", "ACC"))}
    return td.Record.from_arrays(name, times, kelvin)


def settled(laboratory, world, name, channel, room):
    """What a channel would read at rest, with the room where the forecast takes it."""
    test, sensor = laboratory.TESTS[name], laboratory.thermometer(channel)
    rest = td.steady(world.tested(test.model), td.Scenario("rest", boundaries={"cv": f"{room} [K]"}))[test.sensors[channel]]
    return (1.0 + sensor.gain) * (rest - 273.15) + sensor.offset + 273.15


@pytest.mark.campaign
def test_final_temperatures_of_26_sensors(laboratory):
    world = laboratory.World.make()
    counts = {}
    for name in TESTS:
        log = record(laboratory, name, world)
        deck = td.load_model(FOLDER / f"{laboratory.TESTS[name].model}.toml")
        bench = td.Scenario("bench", boundaries={"cv": "24 [degC]"})
        for channel in laboratory.TESTS[name].sensors:
            for kind, hours, led in (
                ("readings", 3.0, {}),
                ("slowest", 2.0, {"slowest": "2 [h]"}),
                ("model", 2.0, {"model": deck, "scenario": bench}),
            ):
                found = td.bench.forecast(log, channel, until=hours * HOUR, reference="T_ROOM", **led)
                truth = settled(laboratory, world, name, channel, found.reference)
                row = counts.setdefault((kind, hours), [0, 0, 0, 0])
                inside = found.final.low <= truth <= found.final.high
                for k, seen in enumerate((True, inside, not found.declined, inside and not found.declined)):
                    row[k] += bool(seen)
    print({k: dict(zip(("all", "inside", "given", "given and inside"), v, strict=True)) for k, v in counts.items()})
    total = np.sum(list(counts.values()), axis=0)
    assert total[1] >= 0.9 * total[0]
    for kind in ("slowest", "model"):  # 3 h before the end of the test
        assert counts[kind, 2.0][2] >= 22
        assert counts[kind, 2.0][3] >= counts[kind, 2.0][2] - 2
    assert counts["readings", 3.0][2] <= 2  # nothing but readings does not exclude a hidden mass


def test_a_hidden_slow_mass_is_declined(laboratory):
    """A gyro with a ballast behind a weak link, which the deck does not have: 3 h seem enough, and are not."""
    world = laboratory.World.make()
    gyro = world.tested("FOG_h")
    deck = td.model_from_dict(
        {
            "title": "gyro with a ballast",
            "needs": ["cv"],
            "submodels": {"fog": {"use": gyro, "bind": {"cv": "cv"}}},
            "nodes": {"ballast": {"capacitance": "9000 [J/K]"}},
            "conductors": {"thread": {"kind": "conduction", "between": ["fog.case", "ballast"], "conductance": "0.08 [W/K]"}},
        }
    )
    bench = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, duration="3 [h]")
    run = td.simulate(deck, bench, every=10.0)
    sensor = laboratory.thermometer("T_FOG1")
    readings = sensor.read(run.times, run["fog.case"].kelvin, np.random.default_rng(laboratory.SEED)) + 273.15
    log = td.Record.from_arrays("fog with ballast", run.times, {"T_FOG1": Channel.from_array("T_FOG1", readings, unit="K")})
    rest = td.steady(deck, bench)["fog.case"]
    assert rest - run["fog.case"].kelvin[-1] > 2.0  # what is hidden
    found = td.bench.forecast(log)
    assert code_of(found.declined) == "result.slow-part-possible"
    assert found.final.low < rest < found.final.high
    assert td.bench.stability(log, "3 C/h").stable  # the rule of SMC-S-016 is content
    known = td.bench.forecast(log, model=deck, scenario=replace(bench, duration=3600.0), within="5 [K]")
    assert known.final.low < rest < known.final.high
