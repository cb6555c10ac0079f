"""Tables of a judgement: one of scores, one of paired differences, and the page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from . import scores as s
from .benches import FAMILIES

SCALES = Path(__file__).with_name("scales.json")
"""Set -> sensor -> standard deviation of its readings [K], by which scores are divided; ``all`` where sensors are averaged."""


def scales() -> dict[str, dict[str, float]]:
    """Return the committed scales."""
    found: dict[str, dict[str, float]] = json.loads(SCALES.read_text(encoding="utf-8"))
    return found


def _ordered(rows: Sequence[s.Row], *names: str) -> list[tuple[str, ...]]:
    return list(dict.fromkeys(tuple(getattr(r, n) for n in names) for r in rows))


def _cells(rows: Sequence[s.Row], peers: dict[str, list[s.Row]], scale: dict[str, float]) -> list[str]:
    """Return the cells of one rule in one stratum of a set; sensors with strokes between."""
    sensors = [n for (n,) in _ordered(rows, "sensor")]
    each = {n: s.summary([r for r in rows if r.sensor == n]) for n in sensors}

    def cell(form: str, name: str, times: float = 1.0) -> str:
        return " / ".join(form.format(times * getattr(e, name)) for e in each.values())

    ends = [e.score_limits for e in each.values()]
    limits = " / ".join(f"{low:.2g} to {high:.2g}" if high < float("inf") else "-" for low, high in ends)
    over = " / ".join(f"{e.half / e.rms:.1f}" if e.rms > 0 else "-" for e in each.values())
    scaled = " / ".join(f"{e.score / scale[n]:.2f}" if n in scale else "-" for n, e in each.items())
    shares = [f"{100 * max(getattr(e, n) for e in each.values()):.0f}" for n in ("refused", "beyond")]
    known = [" / ".join(_score(peers[p], n) for n in sensors) for p in PEERS]
    counts = str(next(iter(each.values())).runs)
    first = [counts, *(cell("{:.0f}", n, 100.0) for n in ("inside", "most", "few"))]
    return [
        *first,
        cell("{:.2f}", "rms"),
        cell("{:.2f}", "half"),
        over,
        cell("{:.2f}", "score"),
        limits,
        scaled,
        cell("{:.2f}", "factor"),
        *shares,
        *known,
    ]


def _score(rows: Sequence[s.Row], sensor: str) -> str:
    """Return the mean score of a peer; a stroke where it has none."""
    own = [r.score for r in rows if r.sensor == sensor]
    return f"{sum(own) / len(own):.3g}" if own else "-"


HINDSIGHT, ORACLE, PERSISTENCE = "constant width of hindsight", "oracle", "persistence"
PEERS = (ORACLE, HINDSIGHT, PERSISTENCE)
"""Rules whose scores stand beside those of the judged ones."""
HEAD = (
    "| set | asked | rule | runs | inside % | runs >= 90 % | runs < 50 % | RMS K | half-width K | half / RMS | score K | its limits "
    "| score / scale | factor | refused % | beyond reach % | oracle K | hindsight K | persistence K |\n|" + "---|" * 19
)


def table(rows: Sequence[s.Row]) -> str:
    """Return one table of every set, stratum and rule, the scores of its peers in the last columns."""
    lines, known = [HEAD], scales()
    judged = [r for (r,) in _ordered(rows, "rule") if r not in PEERS]
    for name, stratum in _ordered(rows, "set", "stratum"):
        here = [r for r in rows if r.set == name and r.stratum == stratum]
        peers = {p: [r for r in here if r.rule == p] for p in PEERS}
        for rule in judged:
            own = [r for r in here if r.rule == rule]
            if own:
                lines.append(f"| {name} | {stratum} | {rule} | {' | '.join(_cells(own, peers, known.get(name, {})))} |")
    lines.append("")
    for rule in [*judged, *PEERS]:
        for what, benches in (("benches", True), ("logs", False)):
            own = [r for r in rows if r.rule == rule and (r.sensor != "all") is benches]
            if own:
                mean, low, high = s.over_sets(own)
                lines.append(
                    f"- {rule}, {what}: {100 * mean:.1f} % inside, sets alike ({100 * low:.0f} to {100 * high:.0f} %, by set and run)"
                )
    return "\n".join(lines)


def difference_table(before: Sequence[s.Row], after: Sequence[s.Row]) -> str:
    """Return the paired differences, set by set and stratum by stratum."""
    lines = [
        "",
        "| set | asked | pairs | score K (95 % limits) | inside points | half-width K | mean square K^2 |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, stratum in [*_ordered(after, "set", "stratum"), ("all", "")]:
        own = [r for r in after if name == "all" or (r.set == name and r.stratum == stratum)]
        found = s.paired(before, own)
        if found is None:
            continue
        cells = [
            f"{k * found.change[f][0]:+.3g} ({k * found.change[f][1]:.3g} .. {k * found.change[f][2]:.3g})"
            for f, k in (("score", 1), ("inside", 100), ("half", 1), ("square", 1))
        ]
        lines.append(f"| {name} | {stratum} | {found.rows} | {' | '.join(cells)} |")
    return "\n".join(lines)


BEGIN, END = "<!-- judge: begin -->", "<!-- judge: end -->"
PAGE_HEAD = """## The judge of bands

Made by `python scripts/judge.py --page` ({made}). What each column says:

- *Inside*: readings (of benches: true temperatures) inside the 95 % band, averaged per run, then per set; and the shares of runs with
  at least 90 % and with less than 50 % of theirs inside.
- *RMS*: of the centre of the rule's own band, pooled over runs. *Half-width*: its mean. *Score*: the interval score (Gneiting and
  Raftery 2007), width and 40 times what lies outside, with limits by a bootstrap over benches or runs; divided by the standard
  deviation of what is judged in the set, which is committed. *Factor*: on every band of the row, with which it would hold 95 %.
- *Refused* questions are scored with the range that the network can reach with 1 and 99 % of the stated spreads; *beyond reach* are
  bands that are wider than that range and leave it.
- Two figures are those of core and shell. Benches are judged by truths that only the judge knows, logs by readings; they share no row.

Benches: a heated core in a shell in a room, {families} families. Two runs are fitted, with all spreads stated; runs at 5, 9 and 12 W are
asked, the last two in a room 10 K warmer, of some families without gas. *right* is fitted with the law of the truth, *half* with a
constant contact, the others with a constant contact and one constant coefficient of the shell (*finish*: with a stated emissivity of
0.8; in *wrong finish* it is 0.3). *strong* has a contact that grows three times faster and a hidden mass, *mirror* blown air, a bright
skin and a contact that falls, *hidden mass* one that the right deck lacks. The room wanders by 0.2 K unless a row says otherwise, of
which the rule has the prior of all logged rooms; every run begins at its room's temperature.

Logs: runs of one condition (of the motor and the boards of another maker: a run; of the cube: a pressure) are left out at a time.
*Oracle* knows the law and all distributions. *Persistence* holds the first temperature. The *constant width of hindsight* is the one
half-width about
the first rule's centre that holds 95 %, known afterwards. Of the three the score stands in the last columns.

"""


def section(rows: Sequence[s.Row], made: str) -> str:
    """Return the section of the page."""
    return f"{BEGIN}\n\n{PAGE_HEAD.format(made=made, families=len(FAMILIES))}{table(rows)}\n\n{END}"


def scaled_by(rows: Sequence[s.Row]) -> dict[str, dict[str, float]]:
    """Return set -> sensor -> standard deviation of what is judged, pooled over its runs. [K]"""
    out: dict[str, dict[str, float]] = {}
    for name, sensor in _ordered(rows, "set", "sensor"):
        own = {(r.unit, r.run): r.variance for r in rows if r.set == name and r.sensor == sensor}
        out.setdefault(name, {})[sensor] = round(float(np.sqrt(np.mean(list(own.values())))), 3)
    return out
