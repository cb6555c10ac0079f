"""Why the test of the pair has a pause: its fit on a warm-up alone, and on the same test with the pause. All logs are synthetic.

A warm-up with masses fixed by the stages below is one exponential: its end gives power over coefficient, its rate coefficient over mass.
The hidden unit convects as the temperature difference to the power 1.25, so it warms faster than a constant coefficient says. With the
mass fixed, only a larger power and a larger coefficient together follow that. The power meter takes the blame. Cooling needs no power:
a pause fixes the rate without the meter. Run it as ``python warm_up.py FOLDER``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import laboratory

import thermid as td
from thermid.campaign.stages import CampaignSource

HERE = Path(__file__).parent
CHANNEL = "P_PROC"
STAGES, RECORDS = ("ProcSISNAV", "EleGFO", "m_PrE"), ("procsisnav", "elegfo", "pre")


@dataclass(frozen=True)
class Meter:
    """What fitted values of the pair say of the processor's power meter: its error over the reading, and over its accuracy. [-]"""

    test: str
    error: float
    times: float


def logs(folder: Path, pause: bool, world: laboratory.World) -> None:
    """Write the logs that the stages up to the pair read; without `pause` the pair's first test is a warm-up alone."""
    (folder / "logs").mkdir(parents=True, exist_ok=True)
    for k, (name, test) in enumerate(laboratory.TESTS.items()):
        if test.model in STAGES:
            given = test if pause or name != "pre_both" else replace(test, off={})
            times, columns, _ = laboratory.run(name, world, laboratory.SEED + k, given)
            laboratory.write(folder / "logs" / f"{name}.csv", laboratory.REMARK, times, columns)


def meter(folder: Path, pause: bool, world: laboratory.World) -> Meter:
    """Return what the pair's fit says of the processor's power meter."""
    logs(folder, pause, world)
    source = CampaignSource.read(HERE / "campaign.toml", folder)
    stages = [s for s in source.content.stages if s.name in STAGES]
    records = {name: table for name, table in source.content.records.items() if name in RECORDS}
    narrowed = source.content.model_copy(update={"stages": stages, "records": records, "verdicts": []})
    fit = td.run_stages(replace(source, content=narrowed))["m_PrE"]
    found = fit.values[f"{CHANNEL} error"]
    assert found.prior is not None
    test = ("with a pause" if pause else "warm-up alone") + ("" if world.exponent else ", convection of exponent 0")
    return Meter(test, found.value, abs(found.value - found.prior[0]) / found.prior[1])


def main(folder: Path) -> tuple[Meter, Meter, Meter]:
    """Return the meter on a warm-up alone, with the pause, and on a warm-up of a hidden unit whose coefficients are constant."""
    world, flat = laboratory.World.make(), laboratory.World.make(exponent=0.0)
    return meter(folder / "warm_up", False, world), meter(folder / "pause", True, world), meter(folder / "flat", False, flat)


if __name__ == "__main__":
    for found in main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "warm_up"):
        print(f"{found.test:38}  {CHANNEL} wrong by {100 * found.error:+.2f} %, {found.times:.1f} times its accuracy")
