"""Three ways from parts to an assembly, compared by what they predict: constants carried upward, priors carried upward, all at once.

``python scripts/three_ways.py [--tclab DIR] [--write]`` prints the tables of docs/levels.md, or writes them there. The logs of the
navigation unit are made by its virtual laboratory; those of the heater board are read from DIR.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from thermid.campaign._joint import fit_jointly
from thermid.campaign.stages import CampaignSource, request_of, scenario_of
from thermid.fit.calibration import Request, fit

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "levels.md"
LOOSE = td.Criteria(rmse="100 [K]")


@dataclass(frozen=True)
class Way:
    """What one way reached: held-out runs -> sensor -> RMSE [K] and largest error [K], or why it was refused."""

    name: str
    free: int
    seconds: float
    held_out: Mapping[str, Mapping[str, tuple[float, float]]]
    moved: str = ""
    refused: str = ""


def laboratory(folder: Path) -> None:
    """Make the logs of the virtual laboratory."""
    spec = importlib.util.spec_from_file_location("laboratory", ROOT / "examples" / "sisnav" / "laboratory.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["laboratory"] = module
    spec.loader.exec_module(module)
    module.main(folder)


def opened(campaign: Path, data: Path, stages: Mapping[str, Mapping[str, Any]] | None = None) -> CampaignSource:
    """Return a campaign with some stages, changed, and no verdicts; every other stage is left out."""
    source = CampaignSource.read(campaign, data)
    of = {s.name: s for s in source.content.stages}
    kept = [of[n].model_copy(update=dict(changes)) for n, changes in (stages or {key: {} for key in of}).items()]
    return replace(source, content=source.content.model_copy(update={"stages": kept, "verdicts": [], "checksums": {}}))


def as_priors(source: CampaignSource) -> CampaignSource:
    """Return the campaign with every inheritance turned into a prior with covariance."""
    for k, stage in enumerate(source.content.stages):
        handed = {part: i.model_copy(update={"as_": "prior"}) for part, i in stage.inherit.items()}
        source.content.stages[k] = stage.model_copy(update={"inherit": handed})
    return source


def untold(source: CampaignSource) -> dict[str, Request]:
    """Return what each stage asks when it is told nothing by the others."""
    stages = source.content.stages
    return {s.name: request_of(source, s.model_copy(update={"inherit": {}}), k, {}) for k, s in enumerate(stages)}


def judged(source: CampaignSource, at: Callable[[str], td.Calibration], plan: Mapping[str, tuple[str, Any]]) -> dict[str, Any]:
    """Return held-out record -> sensor -> RMSE and largest error; `plan` gives record -> stage and local values."""
    of = {s.name: s for s in source.content.stages}
    out = {}
    for record, (stage, local) in plan.items():
        table = of[stage]
        found = td.validate(
            at(stage), source.bound(record, table), LOOSE, scenario=scenario_of(table.scenario, record), local=local, title=record
        )
        out[record] = {s: (v.rmse, abs(v.largest)) for s, v in found.statistics.items()}
    return out


def ways(make: Callable[[], CampaignSource], plan: Mapping[str, tuple[str, Any]], last: str) -> list[Way]:
    """Return the ways on one campaign; `last` is the uppermost stage."""
    out = []
    for name, source in (("constants upward", make()), ("priors upward", as_priors(make()))):
        begun = time.process_time()
        made = td.run_stages(source)
        spent = time.process_time() - begun
        free = sum(len(c.values.parameters) for c in made.stages.values())
        moves = made[last].moved
        out.append(Way(name, free, spent, judged(source, made.__getitem__, plan), ", ".join(g.verdict for g in moves.groups[-1:])))
        if name == "constants upward":
            begun = time.process_time()
            joint = td.inference.joint(made)
            out.append(_way("... and a joint fit", joint, spent + time.process_time() - begun, source, plan))
    source = make()
    begun = time.process_time()
    flat = fit_jointly(source, untold(source), {}, staged=False)
    out.append(_way("all at once, no stages", flat, time.process_time() - begun, source, plan))
    out.append(_top_alone(make(), flat, last, plan))
    return out


def _way(name: str, joint: Any, seconds: float, source: CampaignSource, plan: Mapping[str, tuple[str, Any]]) -> Way:
    free = sum(v.kind in ("parameter", "level") for v in joint.values.values())
    verdict = ", ".join(g.verdict for g in joint.moved.groups[-1:])
    return Way(name, free, seconds, judged(source, joint.at, plan), verdict)


def _top_alone(source: CampaignSource, flat: Any, last: str, plan: Mapping[str, tuple[str, Any]]) -> Way:
    """Return the fit of everything that the uppermost model has to the uppermost records alone."""
    asked = replace(untold(source)[last], priors={})
    free = tuple(p for p in flat.values.parameters)
    begun = time.process_time()
    try:
        found = fit(replace(asked, free=free))
    except td.ThermidError as error:
        return Way("the assembly's logs alone", len(free), time.process_time() - begun, {}, refused=error.message)
    above = {r: p for r, p in plan.items() if p[0] == last}
    return Way("the assembly's logs alone", len(free), time.process_time() - begun, judged(source, lambda _: found, above))


def sisnav(folder: Path) -> list[Way]:
    """Return the ways on the navigation unit."""
    plan = {"pre_held_out": ("m_PrE", None), "imu_held_out": ("m_IMU", None), "sd_held_out": ("m_Sd", None)}
    return ways(lambda: opened(ROOT / "examples" / "sisnav" / "campaign.toml", folder), plan, "m_Sd")


def tclab(folder: Path) -> list[Way]:
    """Return the ways on the heater board: runs of one heater, then two runs of both; two others are held out."""
    room = {"room": {"start": "22.5 [degC]", "sd": "2 [K]"}}
    plan = {f"ens_IdentificationH1H2_Random_0{k}": ("both heaters", room) for k in (3, 4)}
    both = {"free": ["between", "to_room", "pcb.capacitance"], "priors": {}, "weights": {}}
    parts = {"heater 1": {"weights": {}}, "heater 2": {"free": ["h2.alpha", "h2.body.specific_heat", "h2.to_board"], "weights": {}}}
    return ways(lambda: opened(ROOT / "examples" / "tclab" / "campaign.toml", folder, parts | {"both heaters": both}), plan, "both heaters")


def text(rows: Sequence[Way], groups: Mapping[str, Sequence[str]], sensors: Sequence[str]) -> str:
    """Return a Markdown table: RMSE and largest error over some sensors of each group of held-out records. [K]"""
    heads = ["way", "free", "CPU, s", *groups, "against the stages below"]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for w in rows:
        if w.refused:
            lines.append(f"| {w.name} | {w.free} | {w.seconds:.1f} |" + " refused |" * len(groups) + " |")
            continue
        cells = []
        for records in groups.values():
            found = [v for r in records if r in w.held_out for s, v in w.held_out[r].items() if s in sensors]
            size = float(np.sqrt(np.mean([v[0] ** 2 for v in found]))) if found else 0.0
            cells.append(f"{size:.3f} (largest {max(v[1] for v in found):.2f})" if found else "")
        lines.append(f"| {w.name} | {w.free} | {w.seconds:.1f} | " + " | ".join(cells) + f" | {w.moved} |")
    lines += [f"\n*{w.name}*: refused: {w.refused}" for w in rows if w.refused]
    return "\n".join(lines)


def tables(rows: Mapping[str, Sequence[Way]]) -> dict[str, str]:
    """Return name -> table of every study that was run."""
    out = {}
    if "sisnav" in rows:
        groups = {"pair, K": ["pre_held_out"], "measurement unit, K": ["imu_held_out"], "full model, K": ["sd_held_out"]}
        seen = ["T_PROC", "T_ELE", "T_ACCS", "T_FOG1", "T_FOG2", "T_FOG3", "T_IMUS", "T_DISK"]
        out["sisnav"] = text(rows["sisnav"], groups, seen)
    if "tclab" in rows:
        last = [f"ens_IdentificationH1H2_Random_0{k}" for k in (3, 4)]
        out["tclab T1"] = text(rows["tclab"], {"T1, K": last}, ["T1_C"])
        out["tclab T2"] = text(rows["tclab"], {"T2, K": last}, ["T2_C"])
    return out


def main() -> None:
    """Print or write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tclab", type=Path, help="folder of the logs of the heater board")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/levels.md")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        laboratory(Path(folder))
        rows = {"sisnav": sisnav(Path(folder))}
    if given.tclab:
        rows["tclab"] = tclab(given.tclab)
    page = PAGE.read_text(encoding="utf-8") if given.write else ""
    for name, table in tables(rows).items():
        print(f"{name}\n\n{table}\n")
        if given.write:
            head, mark, rest = page.partition(f"<!-- {name} -->\n")
            assert mark, name
            page = f"{head}{mark}{table}\n<!-- end -->{rest.partition('<!-- end -->')[2]}"
    if given.write:
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
