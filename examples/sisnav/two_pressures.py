"""A second record at low pressure: what a component's log without gas adds to the one in air. All logs are synthetic.

A log in air gives the sum of convection and radiation; how much stays without gas rests on the finish that a handbook names. An hour-long
look into a vacuum chamber settles it. Run it as ``python two_pressures.py FOLDER``; the folder gets the logs and the decks of
``structures.py``.
"""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import laboratory
import numpy as np
import structures

import thermid as td

HERE = Path(__file__).parent
PARTS = {"Acc": "acc", "FOG_h": "fog_h", "FOG_l": "fog_l", "EleGFO": "elegfo", "ProcSISNAV": "procsisnav"}
BENCH = td.Scenario("bench at 24 degC", boundaries={"cv": "24 [degC]"}, start="cv", duration="5 [h]")
FREE = ("skin.htc.coefficient", "mass", "skin.emissivity")


@dataclass(frozen=True)
class Without:
    """The end of five hours without gas: the prediction with half of its 95 % interval over the rise, and the hidden truth."""

    part: str
    records: int
    celsius: float
    half_width: float
    low: float
    high: float
    truth: float

    @property
    def inside(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.truth <= self.high


def make_logs(folder: Path, world: laboratory.World) -> None:
    """Write the logs of the components in air and without gas; those in air are those of the campaign."""
    (folder / "logs").mkdir(parents=True, exist_ok=True)
    names = [*laboratory.TESTS, *laboratory.CHAMBER]
    for k, name in enumerate(names):
        if name.removesuffix("_vacuum") in PARTS.values():
            times, columns, _ = laboratory.run(name, world, laboratory.SEED + k)
            laboratory.write(folder / "logs" / f"{name}.csv", laboratory.REMARK, times, columns)


def record(folder: Path, name: str) -> td.Record:
    """Return a log with the channels that the campaign gives the component."""
    plan = tomllib.loads((HERE / "campaign.toml").read_text(encoding="utf-8"))
    given = plan["records"][name.removesuffix("_vacuum")]
    return td.read_record(folder / "logs" / f"{name}.csv", given["channels"], time=given["time"]).resample("30 [s]")


def as_logged(folder: Path, part: str, model: td.Model) -> td.Model:
    """Return a fitted component; a gyro's power follows its temperature as the log in air has it (a fit takes the logged power itself)."""
    if not part.startswith("FOG"):
        return model
    sensor = laboratory.TESTS[PARTS[part]].sensors
    level, slope = structures.gyro_power(folder / "logs" / f"{PARTS[part]}.csv", next(iter(sensor)))
    return model.with_values({"electronics.temperature_coefficient": f"{slope!r} [1/K]", "power": f"{level!r} [W]"}, "logged power")


def without_gas(folder: Path, part: str, second: bool, world: laboratory.World) -> Without:
    """Return what a component's fit says of five hours without gas, from its log in air alone or with a `second` one without gas."""
    names = [PARTS[part]] + ([f"{PARTS[part]}_vacuum"] if second else [])
    bench = BENCH.with_(boundaries={})
    scenarios = {n: td.Scenario(n, start="cv") for n in names}
    if second:
        scenarios[names[1]] = scenarios[names[1]].vacuum()
    deck = td.load_model(folder / "natural" / f"{part}.toml")
    fit = td.calibrate(deck, [record(folder, n) for n in names], FREE, scenario=scenarios)
    model, meter = as_logged(folder, part, fit.model), {"scale.electronics": f"{laboratory.POWER_ACCURACY}"}
    told = td.predict(fit, BENCH.vacuum(), model=model, spread=meter, nodes=["case"])
    low, high = (float(x[-1]) for x in told["case"].interval(0.95))
    truth = td.simulate(world.models[part], BENCH.vacuum(), times=np.linspace(0.0, bench.seconds, 61))["case"].final
    middle = float(told["case"].celsius[-1])
    return Without(part, len(names), middle, 0.5 * (high - low) / (middle - 24.0), low, high, truth)


def main(folder: Path) -> list[Without]:
    """Return both predictions of every component."""
    world = laboratory.World.make()
    make_logs(folder, world)
    structures.main(folder / "natural")
    return [without_gas(folder, part, second, world) for part in PARTS for second in (False, True)]


if __name__ == "__main__":
    for found in main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "two_pressures"):
        told = "truth inside" if found.inside else "truth OUTSIDE"
        print(f"{found.part:11} {found.records} log(s)  {found.celsius:6.2f} degC  half-width {found.half_width:5.1%} of the rise  {told}")
