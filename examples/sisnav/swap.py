"""A part of the unit is replaced: the local retune against refitting everything, in values, tests, time and kelvin.

Run it as ``python examples/sisnav/swap.py``; it makes the logs of the unit before and after, all of them synthetic, and prints a table.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import laboratory
import numpy as np

import thermid as td
from thermid.campaign.stages import CampaignSource

HERE = Path(__file__).parent
SWAPS = {"EleGFO": ("m_PrE.ele", "pre.ele", "EleGFO_v2"), "a gyro": ("m_IMU.fog_y", "imu.fog_y", "FOG_l_v2")}
SENSORS = ("T_PROC", "T_ELE", "T_ACCS", "T_FOG1", "T_FOG2", "T_FOG3", "T_IMUS", "T_DISK")


@dataclass(frozen=True)
class Swap:
    """What one swap cost and reached.

    Parameters
    ----------
    plan : RetunePlan
    values : int            Values that were fitted, those of the new part alone among them.
    seconds : tuple         Processor time of the fits: retune, everything. [s]
    apart : float           Largest difference of the two predictions of the held-out record, any sensor and time. [K]
    rmse : tuple            Against that record: not retuned (the new deck alone), retuned, everything fitted. [K]
    """

    plan: td.design.RetunePlan
    values: int
    seconds: tuple[float, float]
    apart: float
    rmse: tuple[float, float, float]


def predicted(model: td.Model, bias: dict[str, float], record: td.Record) -> tuple[np.ndarray, float]:
    """Return the predicted readings of the thermometers in a record (samples, sensors) and their RMSE. [K]"""
    found = td.compare(model, record, scenario=td.Scenario("held out", start="cv"))
    blocks = {b.sensor: b for b in found.blocks}
    columns = np.column_stack([blocks[s].predicted + bias.get(s, 0.0) for s in SENSORS])
    measured = np.column_stack([blocks[s].measured for s in SENSORS])
    return columns, float(np.sqrt(np.mean((measured - columns) ** 2)))


def swapped(name: str, folder: Path, before: td.Campaign) -> Swap:
    """Return one swap."""
    place, part, deck = SWAPS[name]
    laboratory.main(folder / deck, {place: deck})
    plan = td.design.plan_retune(before, part, HERE / f"{deck}.toml")
    seconds = []
    made = []
    for everything in (False, True):
        known = CampaignSource.read(HERE / "campaign.toml", folder / deck)
        for test in plan.tests if not everything else (*plan.tests, *plan.kept_tests):
            known.record(test)  # reading logs is not what is compared
        begun = time.process_time()
        made.append(plan.run(known, everything=everything))
        seconds.append(time.process_time() - begun)
    local, full = (m["m_Sd"] for m in made)
    held_out = CampaignSource.read(HERE / "campaign.toml", folder / deck).record("sd_held_out")
    (one, near), (other, best) = (predicted(c.model, c.bias, held_out) for c in (local, full))
    old = before["m_Sd"]
    model, what = old.model.replaced(part, plan.model)
    _, plain = predicted(what.starting(model), old.bias, held_out)
    values = sum(len(made[0][s.name].values.parameters) for s in plan.stages if s.action == "run")
    return Swap(plan, values, (seconds[0], seconds[1]), float(np.abs(one - other).max()), (plain, near, best))


def study(folder: Path) -> dict[str, Swap]:
    """Return both swaps."""
    laboratory.main(folder / "before")
    before = td.run_stages(HERE / "campaign.toml", data=folder / "before")
    return {name: swapped(name, folder, before) for name in SWAPS}


def text(found: dict[str, Swap]) -> str:
    """Return the table."""
    heads = ["replaced", "values retuned", "values fitted (all)", "stages run", "tests repeated", "fits, s (all)", "apart, K"]
    heads += ["RMSE of the new deck alone, K", "retuned, K", "all refitted, K"]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for name, s in found.items():
        run = [p for p in s.plan.stages if p.action == "run"]
        every = sum(len(c.values.parameters) for c in s.plan.campaign.stages.values())
        tests = f"{len(s.plan.tests)} of {len(s.plan.tests) + len(s.plan.kept_tests)}"
        lines.append(
            f"| {name} | {len(s.plan.freed)} | {s.values} ({every}) | {len(run)} of {len(s.plan.stages)} | {tests} | "
            f"{s.seconds[0]:.2f} ({s.seconds[1]:.2f}) | {s.apart:.2f} | " + " | ".join(f"{x:.3f}" for x in s.rmse) + " |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        result = study(Path(made))
    for one in result.values():
        print(one.plan, end="\n\n")
    print(text(result))
