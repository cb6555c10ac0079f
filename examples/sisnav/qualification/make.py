"""What the plan rests on, made from the study: `python examples/sisnav/qualification/make.py`.

Writes the decks with convection and radiation apart, the values that the campaign on the virtual laboratory's logs found, and the logs of
three environmental tests of the hidden unit, as its sensors would have read them. All of it is synthetic and states this.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

import laboratory  # noqa: E402
import structures  # noqa: E402
import tomlkit  # noqa: E402

import thermid as td  # noqa: E402

EVERY = {"thermal cycling": 180.0, "thermal vacuum": 180.0, "humidity": 120.0}
"""Interval of the readings of each test: days of cycling are read less often. [s]"""
CHAMBER = {"offset": 0.4, "noise": 0.05}
"""What the chamber's thermometers are off by, and scatter by. [K]"""
RECORDS = {"thermal cycling": "cycling", "thermal vacuum": "vacuum", "humidity": "humidity"}


def calibrated(folder: Path) -> None:
    """Write decks and values, from the whole campaign on logs of the virtual laboratory."""
    laboratory.main(folder)
    structures.main(folder / "natural")
    campaign = td.run_stages(folder / "natural" / "campaign.toml", data=folder)
    decks = HERE / "decks"
    decks.mkdir(exist_ok=True)
    for name in laboratory.PARTS:
        shutil.copy(folder / "natural" / f"{name}.toml", decks / f"{name}.toml")
    for gyro, (log, sensor) in {"FOG_h": ("fog_h", "T_FOG1"), "FOG_l": ("fog_l", "T_FOG2")}.items():
        level, slope = structures.gyro_power(folder / "logs" / f"{log}.csv", sensor)
        deck = tomlkit.parse((decks / f"{gyro}.toml").read_text(encoding="utf-8"))
        measured = {"source": "measured", "basis": "a line through the synthetic log of the gyro's power over its temperature"}
        loads, parameters = deck["loads"], deck["parameters"]
        loads["electronics"]["temperature_coefficient"] = {"value": f"{slope:.5f} [1/K]", **measured}  # type: ignore[index]
        parameters["power"] = {"value": f"{level:.4f} [W]", **measured}  # type: ignore[index]
        (decks / f"{gyro}.toml").write_text(tomlkit.dumps(deck), encoding="utf-8")
    values = HERE / "m_Sd.values.toml"
    values.unlink(missing_ok=True)
    campaign["m_Sd"].values.save(values)


def logs() -> None:
    """Write what the sensors would have read in the three tests: the hidden unit on the same fixture, in the same courses."""
    from thermid.qualify.plans import load_plan, run_test

    plan = load_plan(HERE / "plan.toml")
    hidden = td.qualify.macro_model(HERE / "fixture.toml", unit=laboratory.World.make().models["m_Sd"])
    sensors = laboratory.TESTS["sd_all"].sensors
    (HERE / "readings").mkdir(exist_ok=True)
    for k, (test, name) in enumerate(RECORDS.items()):
        (planned,) = (t for t in plan.tests if t.name == test)
        trial = run_test(plan, planned.model_copy(update={"log": None}))
        scenario = trial.foresight.scenario
        times = np.arange(0.0, scenario.seconds + 1.0, EVERY[test])
        rng = np.random.default_rng([laboratory.SEED, k])
        run = td.simulate(hidden, scenario, times=times)
        columns = {
            c: laboratory.thermometer(c).read(times, run[f"unit.{n}"].kelvin, rng) for c, n in sensors.items() if c in plan.content.sensors
        }
        for column, boundary in (("T_SHROUD", "shroud"), ("T_PLATE", "plate")):
            columns[column] = run[boundary].celsius + CHAMBER["offset"] + CHAMBER["noise"] * rng.standard_normal(times.size)
        head = f"# {laboratory.REMARK.replace('laboratory.py', 'make.py')}\n" + ",".join(["time_s", *columns])
        table = np.column_stack([times, *columns.values()])
        np.savetxt(
            HERE / "readings" / f"{name}.csv", table, delimiter=",", header=head, comments="", fmt=["%.0f"] + ["%.2f"] * len(columns)
        )


if __name__ == "__main__":
    with TemporaryDirectory() as made:
        calibrated(Path(made))
    logs()
