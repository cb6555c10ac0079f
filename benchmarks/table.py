"""The tables of docs/benchmarks.md from the newest JSON of every case in benchmarks/results; ``python benchmarks/table.py`` renews them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from report import duration, remarks, sections, shown

HERE = Path(__file__).parent
RESULTS, PAGE = HERE / "results", HERE.parent / "docs" / "benchmarks.md"
BEGIN, END = "<!-- results: written by benchmarks/table.py -->\n", "<!-- end of results -->\n"
CASES = ("B1", "B2", "B3", "B4", "B5", "B6", "B7", "B8", "B9", "B10", "B11")
PARTS = ("run", "sens", "calibrate")


def newest() -> Iterator[dict[str, Any]]:
    """Yield the latest whole document of every case, or those of its parts where there is none."""
    for case in CASES:
        for names in ((case,), tuple(f"{case}-{part}" for part in PARTS)):
            found = [paths[-1] for name in names if (paths := sorted(RESULTS.glob(f"????-??-??-{name}.json")))]
            yield from (json.loads(path.read_text(encoding="utf-8")) for path in found)
            if found:
                break


def lines(document: dict[str, Any]) -> Iterator[str]:
    """Yield the section of one case."""
    machine, versions = document["machine"], document["machine"]["versions"]
    part = document["sections"][0].get("part") if len({s.get("part") for s in document["sections"]}) == 1 else None
    yield f"### {document['case']}{f', {part}' if part else ''}"
    yield ""
    words = ", ".join(f"{name} {version}" for name, version in versions.items())
    load = f", load {machine['load']:.1f}" if machine.get("load") is not None else ""
    yield f"{document['date']}{load}; {machine['cpu']}, {machine['cores']} cores, Python {machine['python']}; {words}."
    floor = document["floor"]
    yield f"One core copies {floor['copy_GB_s']} GB/s and does {floor['fma_GFLOP_s']} GFLOP/s."
    if document["quick"]:
        yield "**Quick run**: few repetitions, small sizes."
    for section, rows in sections(document):
        yield ""
        yield f"{section['work']}:"
        yield ""
        columns = list(dict.fromkeys(key for row in rows for key in shown(row)))
        yield f"| {' | '.join(columns)} |"
        yield "|" + "---|" * len(columns)
        for row in rows:
            cells = shown(row)
            yield f"| {' | '.join(cells.get(name, '') for name in columns)} |"
        for line in remarks(section):
            if line:
                yield ""
                yield f"{line[0].upper()}{line[1:]}."
        yield from verdicts(rows)
        for row in rows:
            if row["name"] == "thermid" and "simulate_seconds" in row:
                yield ""
                one, first = duration(row["simulate_seconds"]), duration(row["prepare_seconds"])
                yield f"`thermid` takes {row['steps']} steps; preparation costs {first} once, `simulate` from model to table {one}."
    yield ""
    if document["missing"]:
        yield "Missing: " + "; ".join(f"{name} ({why})" for name, why in document["missing"].items()) + "."
        yield ""


def verdicts(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Yield whether targets are reached, and who of the peers that are right comes next, in each way."""
    for row in rows:
        if row["name"] == "thermid" and "target_seconds" in row:
            yield ""
            said = "reached" if row["cpu_seconds"] <= row["target_seconds"] else "missed"
            yield f"Target {duration(row['target_seconds'])}: {said} with {duration(row['cpu_seconds'])} of processor time."
    ways = {"tolerance": "by tolerance alone", "forced": "forced to the samples", "fixed": "with fixed steps"}
    peers = [row for row in rows if row.get("way") in ways]
    if peers:
        yield ""
        words = []
        for way, name in ways.items():
            right = [row for row in peers if row["way"] == way and row["right"]]
            best = min(right, key=lambda row: row["ratio"]) if right else None
            words.append(f"{name} {best['name']}, {best['ratio']:.3g} times the time of thermid" if best else f"{name} none")
        yield f"Fastest peer that is right: {'; '.join(words)}."


def rendered() -> str:
    """Return the results as Markdown."""
    return "\n".join(line for document in newest() for line in lines(document)) + "\n"


def main() -> None:
    """Put the results where the page has them."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}\n{rendered()}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
