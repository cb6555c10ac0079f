"""Which structure the board has: every candidate fitted to all training runs together, judged by likelihood and on unseen runs.

Run it as ``python examples/tclab/structures.py --data DIR``; ``--only board "board, 1/4"`` takes some, ``--json`` prints one object. With
``--from-parts`` only runs of one heater are fitted and all runs of both are predicted: what the parts alone say of the assembly.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from candidates import Candidate, candidates

import thermid as td
from thermid.base.errors import IdentificationError, ThermidError
from thermid.campaign.stages import CampaignSource
from thermid.fit.calibration import LocalSpec, Reading, Request, fit

HERE = Path(__file__).parent
TRAINING = {
    "steps": ["ensH?_*"],
    "random_H1": ["ens_IdentificationH1_Random_*"],
    "random_H2": ["ens_IdentificationH2_Random_*"],
    "random_H1H2": ["ens_IdentificationH1H2_Random_0[12]"],
}
UNSEEN = ["ens_IdentificationH1H2_Random_0[34]"]
CONSTANT = ["ens_IdentificationH1H2_Random_0[12]"]
"""Runs that say how far the room stands above a first reading."""
KNEE = 5.0
GRID = 5.0
SENSORS = ("T1_C", "T2_C")
ROOM = {"start": "T1_C", "sd": "0.5 [K]"}
WALLS = LocalSpec("23 [degC]", 3.0)
"""Of a hot start: the walls of a box are nearer the room than the board is, whose start the campaign gives."""
LOOSE = td.Criteria(rmse="100 [K]")
"""Limits that nothing misses: here the figures count, the campaign judges."""

# what textbooks and data sheets allow (README.md gives the sources); SI
PLAUSIBLE = {
    "specific_heat": (380.0, 1000.0),
    "tau": (5.0, 40.0),
    "alpha": (0.4, 2.0),
    "beta": (0.0, 0.005),
    "to_board": (0.002, 0.06),
    "between": (0.001, 0.01),
    "pcb.capacitance": (8.0, 40.0),
    "emissivity": (0.5, 1.0),
    "box.capacitance": (50.0, 1500.0),
}


def from_parts() -> None:
    """Fit runs of one heater only, and leave all runs of both unseen."""
    UNSEEN[:] = ["ens_IdentificationH1H2_Random_*"]
    CONSTANT[:] = [*TRAINING["random_H1"], *TRAINING["random_H2"]]
    del TRAINING["random_H1H2"]


def shifted(source: CampaignSource, name: str, delay: float) -> td.Record:
    """Return a record of the campaign whose commands act later; before the first sample the level of its file name held."""
    if not delay:
        return source.record(name)
    path, table = source.names()[name]
    raw = td.read_record(path, table.channels, time=table.time, name=name)
    before = {c: 0.0 for c in ("Q1_pct", "Q2_pct")}
    if name.startswith("ensH") and name.endswith("_000_en1"):
        before[f"Q{name[4]}_pct"] = float(name[6:9]) / 100.0
    made = []
    for channel, level in before.items():
        at = np.searchsorted(raw.times, raw.times - delay, side="right") - 1
        old = raw.channel(channel)
        made.append(replace(old, values=np.where(at >= 0, old.values[np.maximum(at, 0)], level)))
    return raw.with_channels(*made).prepare(table.prepare)


def bound(source: CampaignSource, name: str, which: Candidate, step: float) -> td.Record:
    """Return a record for a candidate: commands as late as it says, readings taken at the node that its sensors read."""
    record = shifted(source, name, which.delay)
    record = record.resample(step) if step > GRID else record
    targets = {"T1_C": f"h1.{which.sensor}", "T2_C": f"h2.{which.sensor}"}
    return record.with_channels(*(replace(record[c], target=t) for c, t in targets.items()))


def scenario(which: Candidate) -> td.Scenario:
    """Return the start of every run: all at the first reading of sensor 1, heater 2 at that of sensor 2."""
    return td.Scenario("run", start="T1_C", initial=dict.fromkeys(("h2.body", f"h2.{which.sensor}"), "T2_C"))


def request(source: CampaignSource, which: Candidate, records: Sequence[td.Record]) -> Request:
    """Return the joint fit with the noise, the priors and the loss of the campaign."""
    own: dict[str, dict[str, LocalSpec]] = {}
    for record in records:
        of = source.local_of_record(record.name)
        board = of.pop("initial.pcb", None)
        if board is not None:
            of |= {f"initial.{n}": WALLS if n == "box" and len(which.slow) > 1 else board for n in which.slow}
        own[record.name] = of
    return Request(
        which.model,
        tuple(records),
        which.free,
        {"*": scenario(which)},
        {"room": LocalSpec.read(ROOM, "room")},
        record_local=own,
        untie=True,
        loss="soft_l1",
        loss_scale=KNEE,
        name=which.title,
    )


def deviance(asked: Request, found: td.Calibration) -> float:
    """Return -2 log likelihood up to a constant, priors of single runs included. [-]

    The loss is soft_l1: 2 knee^2 (sqrt(1 + (r / (knee sigma))^2) - 1) per reading, r^2 / sigma^2 where it is small.
    """
    total = 0.0
    for block in found.blocks:
        z = block.residuals / block.noise / KNEE
        total += float(np.sum(2.0 * KNEE**2 * (np.sqrt(1.0 + z**2) - 1.0)))
    records = {r.name: r for r in asked.records}
    for own in found.local:
        record = records[own.record]
        total += ((own.value - asked.local_start(record, own.name)) / asked.locals_of(record)[own.name].sd) ** 2
    return total


def inflation(found: td.Calibration) -> float:
    """Return by how much -2 log likelihood overstates what the residuals say. [-]

    Per trace: mean square in units of the noise times 1 + 2 (autocorrelation summed up to its first zero), the time over which
    residuals wander in samples; the mean over traces.
    """
    factors = []
    for block in found.blocks:
        z = block.residuals / block.noise
        centred = z - z.mean()
        spectrum = np.abs(np.fft.rfft(centred, 2 * z.size)) ** 2
        memory = np.fft.irfft(spectrum)[: z.size]
        ends = int(np.argmax(memory < 0.0)) or z.size
        factors.append(float(np.mean(z**2) * (1.0 + 2.0 * np.sum(memory[1:ends]) / memory[0])))
    return float(np.mean(factors))


def first_reading(which: Candidate, found: td.Calibration, records: Sequence[td.Record]) -> td.Calibration:
    """Return the one constant of the board: how far the room stands above the first reading of sensor 1, all else held."""
    asked = Request(
        found.model,
        tuple(records),
        ("first_reading",),
        {"*": scenario(which)},
        held_bias=found.bias,
        readings={"room": Reading("T1_C", "first_reading")},
        loss="soft_l1",
        loss_scale=KNEE,
        fit_start=False,
    )
    return fit(asked)


def unseen(source: CampaignSource, which: Candidate, found: td.Calibration) -> dict[str, Any]:
    """Return RMSE on runs that the fit has not seen, on the 5 s grid: room fitted, and from the run's first readings. [K]"""
    last = [bound(source, n, which, GRID) for n in source.pick(UNSEEN, "unseen")]
    constant = first_reading(which, found, [bound(source, n, which, GRID) for n in source.pick(CONSTANT, "constant")])
    room = {"room": {"start": "22.5 [degC]", "sd": "2 [K]"}}
    reading = {"room": {"channel": "T1_C", "offset": "first_reading"}}
    fitted = [td.validate(found, r, LOOSE, scenario=scenario(which), local=room) for r in last]
    first = [td.validate(constant, r, LOOSE, scenario=scenario(which), readings=reading) for r in last]
    return {
        "unseen_fitted_K": [float(np.median([v.statistics[s].rmse for v in fitted])) for s in SENSORS],
        "unseen_first_K": [float(np.median([v.statistics[s].rmse for v in first])) for s in SENSORS],
        "first_reading_K": constant["first_reading"].value,
        "unseen_runs_K": {s: {v.record: v.statistics[s].rmse for v in fitted} for s in SENSORS},
    }


def medians(source: CampaignSource, found: td.Calibration) -> dict[str, list[float]]:
    """Return the median over runs of the RMSE per kind of run, both sensors. [K]"""
    out = {}
    for kind, patterns in TRAINING.items():
        names = source.pick(patterns, kind)
        out[kind] = [float(np.median([found.statistics[n][s].rmse for n in names])) for s in SENSORS]
    return out


def implausible(found: td.Calibration) -> list[str]:
    """Return what is unphysical or unknown: values at a bound, outside what textbooks allow, or with an error above a third."""
    out = []
    for path, value in found.values.parameters.items():
        ends = [b for b in value.bounds if math.isfinite(b) and abs(value.value - b) <= 0.01 * abs(b)]
        key = next((k for k in PLAUSIBLE if path == k or path.endswith(f".{k}")), "")
        low, high = PLAUSIBLE.get(key, (-math.inf, math.inf))
        if ends:
            out.append(f"{path} ends at its bound {value.in_unit:.3g} {value.unit}")
        elif not low <= value.value <= high:
            out.append(f"{path} = {value.in_unit:.3g} {value.unit}, outside {low:g} .. {high:g}")
        elif value.error > abs(value.value) / 3.0:
            out.append(f"{path} = {value.in_unit:.2g} +- {value.error / abs(value.value) * 100:.0f} %: not known")
    return out


def room_trend(asked: Request, found: td.Calibration) -> float:
    """Return how much farther the fitted room stands above the first reading in steps to 80..100 % than in steps to 10..30 %. [K]

    The room cannot know the level, so anything but zero is heat that the structure misses.
    """
    above = {r.name: -float(r["T1_C"].values[r["T1_C"].valid][0]) for r in asked.records}
    for own in found.local:
        above[own.record] += own.value if own.name == "room" else 0.0
    high, low = (
        np.mean([v for n, v in above.items() if n.startswith(("ensH1_000_", "ensH2_000_")) and n[10:13] in levels])
        for levels in (("080", "090", "100"), ("010", "020", "030"))
    )
    return float(high - low)


def judged(source: CampaignSource, name: str, which: Candidate, step: float) -> dict[str, Any]:
    """Return what a candidate reaches."""
    begun = time.perf_counter()
    names = source.pick([p for patterns in TRAINING.values() for p in patterns], "training")
    asked = request(source, which, [bound(source, n, which, step) for n in names])
    row: dict[str, Any] = {"name": name, "title": which.title, "free": len(which.free)}
    try:
        found = fit(asked, told(name))
    except IdentificationError as error:
        return row | {"refused": error.message}
    return row | {
        "free_with_runs": len(found.fitted),
        "deviance": deviance(asked, found),
        "inflation": inflation(found),
        **medians(source, found),
        **unseen(source, which, found),
        "room_trend_K": room_trend(asked, found),
        "values": {p: {"value": v.in_unit, "error": v.shown(v.error), "unit": v.unit} for p, v in found.values.parameters.items()},
        "implausible": implausible(found),
        "converged": found.converged,
        "seconds": time.perf_counter() - begun,
    }


def told(name: str) -> Any:
    """Return a function that says on standard error how far a fit is, at most twice a second."""
    last = [0.0]

    def tell(count: int, rms: float) -> None:
        if sys.stderr.isatty() and time.monotonic() - last[0] > 0.5:
            last[0] = time.monotonic()
            print(f"\r\x1b[2K{name}: evaluation {count}, weighted RMS {rms:.3g}", end="", file=sys.stderr, flush=True)

    return tell


def compared(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows with their differences of AIC from the best, as printed and with the deviance divided by its inflation.

    Residuals wander over minutes, so samples are no independent witnesses. Dividing by the inflation of the likeliest structure
    follows K. P. Burnham and D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer 2002, section 2.5 (QAIC).
    """
    known = [r for r in rows if "deviance" in r]
    if not known:
        return rows
    spread = min(known, key=lambda r: r["deviance"])["inflation"]
    for row in known:
        row["aic"] = row["deviance"] + 2 * row["free_with_runs"]
        row["qaic"] = row["deviance"] / spread + 2 * row["free_with_runs"]
    for key in ("aic", "qaic"):
        best = min(r[key] for r in known)
        for row in known:
            row[f"{key}_difference"] = row[key] - best
    return rows


def text(rows: list[Mapping[str, Any]]) -> str:
    """Return the comparison as a table of Markdown, with what is doubtful below."""
    heads = ["structure", "free", "-2 log L", "dAIC", "dQAIC", *(kind.replace("_", " ") for kind in TRAINING)]
    heads += ["hold-out, ambient fitted", "hold-out, first readings", "ambient trend"]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    notes = []
    for row in rows:
        if "refused" in row:
            lines.append(f"| {row['name']} | {row['free']} | refused |" + " |" * (len(heads) - 3))
            notes.append(f"- {row['name']}: refused: {row['refused']}")
            continue
        kinds = [*TRAINING, "unseen_fitted_K", "unseen_first_K"]
        cells = [row["name"], str(row["free"]), f"{row['deviance']:.0f}", f"{row['aic_difference']:.0f}", f"{row['qaic_difference']:.0f}"]
        cells += [" / ".join(f"{x:.2f}" for x in row[k]) for k in kinds] + [f"{row['room_trend_K']:+.1f}"]
        lines.append("| " + " | ".join(cells) + " |")
        notes.append(f"- {row['name']}: {row['title']}." + (f" Doubtful: {'; '.join(row['implausible'])}." if row["implausible"] else ""))
    return "\n".join([*lines, "", *notes])


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the comparison and return the exit code."""
    parser = argparse.ArgumentParser(description="Fit every candidate structure to all training runs and compare them.")
    parser.add_argument("--data", default=os.environ.get("THERMID_DATA"), help="folder of the logs; THERMID_DATA does the same")
    parser.add_argument(
        "--step", type=float, default=15.0, help="grid of the fit in seconds, 5 or a multiple; unseen runs are judged at 5 s"
    )
    parser.add_argument("--only", nargs="+", choices=list(candidates()), metavar="NAME", help="some of: " + ", ".join(candidates()))
    parser.add_argument("--from-parts", action="store_true", help="fit runs of one heater only, and predict all runs of both")
    parser.add_argument("--json", action="store_true", help="print one JSON object on standard output")
    given = parser.parse_args(arguments)
    if given.from_parts:
        from_parts()
    begun = time.perf_counter()
    try:
        source = CampaignSource.read(HERE / "campaign.toml", given.data)
        chosen = {n: c for n, c in candidates().items() if not given.only or n in given.only}
        rows = []
        for name, which in chosen.items():
            print(f"{name}: {which.title}", file=sys.stderr)
            rows.append(judged(source, name, which, given.step))
    except ThermidError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    seconds = time.perf_counter() - begun
    rows = compared(rows)
    if given.json:
        print(json.dumps({"schema": 1, "status": "ok", "step_s": given.step, "seconds": seconds, "structures": rows}))
    else:
        print(text(rows))
        print(f"\n{len(rows)} structures on a {given.step:g} s grid in {seconds:.0f} s.")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
