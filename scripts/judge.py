"""The judge of 95 % bands: on benches against the truth, on logs against readings, never mixed; see docs/coverage.md.

``python scripts/judge.py`` scores today's code beside persistence, an oracle and the constant width of hindsight in minutes;
``--count 200`` makes the full table, ``--rules today,error-model`` judges others beside it, ``today~run`` without a part;
``--save FILE`` keeps every row, ``--against FILE`` prints paired differences; ``--page`` writes the page.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from judging import benches as b, scores as s
from judging.oracle import reachable
from judging.real import REAL_SETS, real_rows
from judging.report import BEGIN, END, HINDSIGHT, ORACLE, PERSISTENCE, SCALES, difference_table, scaled_by, section, table
from judging.rules import rule
from judging.runs import DATA
from judging.tasks import Answer, Question, Refusal, Task, distance, question, task, truth

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "coverage.md"
SEED, COUNT = 20261124, 20
BESIDE = (PERSISTENCE, ORACLE)


def judged_rows(answer: Answer | Refusal, t: Task, q: Question, rule_name: str) -> Iterator[tuple[np.ndarray, s.Row]]:
    """Yield truth less centre and the row of every node of a question."""
    family, true = t.made.family, truth(t.made, t.index, q.name)
    low, high = (x[t.index] for x in reachable(t.made, q.name))
    for i, node in enumerate(q.nodes):
        middle, wide = 0.5 * (low[i] + high[i]), 0.5 * (high[i] - low[i])
        names = {"rule": rule_name, "set": family.name, "stratum": f"{q.name}: {distance(family, q.name)}"}
        names |= {"unit": str(t.index), "run": f"{t.index}, {q.name}", "sensor": node, "variance": float(true[node].var())}
        if isinstance(answer, Refusal):
            off, half, aside, beyond = true[node] - middle, np.full(true[node].shape, wide), 0.0, False
        else:
            off, half, aside = true[node] - answer.centre[node], answer.half[node], answer.aside.get(node, 0.0)
            beyond = bool(np.any(answer.centre[node] + aside + half > high[i]) and np.any(half > wide))
        yield off, s.scored(off, half, aside, refused=isinstance(answer, Refusal), beyond=beyond, **names)


def bench_rows(family: b.Family, count: int, seed: int, rules: Sequence[str], synthetic: bool = False) -> list[s.Row]:
    """Return the rows of all rules on the benches of a family, and those of the constant width that the first of them needs."""
    made = b.made(family, count, seed)
    rows: list[s.Row] = []
    offs: dict[tuple[str, str], list[tuple[np.ndarray, s.Row]]] = {}
    for k in range(count):
        t = task(made, k, synthetic)
        for name in family.asked:
            q = question(made, k, name)
            for rule_name in rules:
                for off, row in judged_rows(rule(rule_name)(t, q), t, q, rule_name):
                    rows.append(row)
                    if rule_name == rules[0]:
                        offs.setdefault((row.stratum, row.sensor), []).append((off, row))
    for several in offs.values():
        rows += s.constant_of_hindsight(several, HINDSIGHT)
    return rows


def every_row(options: argparse.Namespace) -> tuple[list[s.Row], dict[str, float]]:
    """Return all rows that are asked for, and set -> seconds of processor time."""
    rules = [*options.rules.split(","), *(r for r in BESIDE if r not in options.rules.split(","))]
    rows: list[s.Row] = []
    seconds: dict[str, float] = {}
    for name in options.only or [*b.FAMILIES, *(REAL_SETS if options.data.is_dir() else ())]:
        begun = time.process_time()
        if name in b.FAMILIES:
            found = bench_rows(b.FAMILIES[name], options.count, options.seed, rules, options.synthetic)
        else:
            found = real_rows(name, options.data, rules, HINDSIGHT)
        rows += found
        seconds[name] = time.process_time() - begun
        print(f"{name}: {seconds[name]:.0f} s", file=sys.stderr, flush=True)
    return rows, seconds


def main() -> None:
    """Judge, print, and write what is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rules", default="today", help="names with commas; the constant width of hindsight is that of the first")
    parser.add_argument("--count", type=int, default=COUNT, help="benches of a family")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--only", nargs="*", choices=[*b.FAMILIES, *REAL_SETS], help="some of the families and sets of logs")
    parser.add_argument("--synthetic", action="store_true", help="call the records of benches synthetic")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the logs")
    parser.add_argument("--save", type=Path, help="write every row")
    parser.add_argument("--rows", type=Path, nargs="*", help="rows of earlier judgements, shown together instead of judging")
    parser.add_argument("--against", type=Path, help="rows of an earlier judgement: print paired differences")
    parser.add_argument("--pair", default="", help="a rule of this judgement to print the first rule's differences from")
    parser.add_argument("--scales", action="store_true", help="write the standard deviations by which scores are divided anew")
    parser.add_argument("--page", action="store_true", help=f"write docs/{PAGE.name}")
    options = parser.parse_args()
    if options.rows:
        kept = [json.loads(f.read_text(encoding="utf-8")) for f in options.rows]
        rows, made = [s.Row.from_dict(r) for k in kept for r in k["rows"]], "; ".join(k["made"] for k in kept)
    else:
        rows, seconds = every_row(options)
        sets = ", ".join(n for n in seconds) if options.only else "all sets"
        made = f"{sets}: seed {options.seed}, {options.count} benches a family, {sum(seconds.values()) / 60:.1f} minutes of processor time"
    print(table(rows), f"\n{made}", sep="\n")
    if options.save:
        options.save.write_text(json.dumps({"made": made, "rows": [r.to_dict() for r in rows]}), encoding="utf-8")
    first = options.rules.split(",")[0]
    if options.pair:
        print(difference_table([r for r in rows if r.rule == options.pair], [r for r in rows if r.rule == first]))
    if options.against:
        before = [s.Row.from_dict(r) for r in json.loads(options.against.read_text(encoding="utf-8"))["rows"]]
        print(difference_table([r for r in before if r.rule == "today"], [r for r in rows if r.rule == first]))
    if options.scales:
        SCALES.write_text(json.dumps(scaled_by(rows), indent=1), encoding="utf-8")
    if options.page:
        text = PAGE.read_text(encoding="utf-8")
        before, _, rest = text.partition(BEGIN)
        PAGE.write_text(f"{before.rstrip()}\n\n{section(rows, made)}{rest.partition(END)[2] or chr(10)}", encoding="utf-8")


if __name__ == "__main__":
    main()
