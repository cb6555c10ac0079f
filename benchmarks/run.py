"""``python benchmarks/run.py CASE [--part PART] [--json]``: thermid and its peers side by side on one case, in one run."""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"  # before the first import that reads it: every contestant has one thread
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import argparse
import contextlib
import json
import sys
import tempfile
import warnings
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

import report
from machine import floor, machine
from peers import MODULES

CASES = ("B1", "B2", "B3", "B4", "B5", "B6", "B7", "B8", "B9", "B10", "B11")
PARTS = ("run", "sens", "calibrate")
TIMING = (
    "seconds: best wall time; cpu_seconds: best processor time; ratio: of processor times (B5: of wall times). "
    "One thread each, in turns within one process (B3, B5, B6, B9, B11: each in a process of its own)"
)


def arguments(given: list[str] | None = None) -> argparse.Namespace:
    """Return what was asked for on the command line."""
    parser = argparse.ArgumentParser(prog="run.py", description=__doc__)
    parser.add_argument("case", choices=CASES)
    parser.add_argument("--part", choices=PARTS, help="of B1 (run, sens) and B2 (run, sens, calibrate); all of them when left out")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--save", type=_absolute, metavar="FOLDER", help="also write the JSON to FOLDER/DATE-CASE.json")
    parser.add_argument("--quick", action="store_true", help="few repetitions and small sizes, to see whether it works")
    parser.add_argument(
        "--peers", nargs="*", choices=MODULES, default=MODULES, metavar="PEER", help=f"of {', '.join(MODULES)}; none: thermid alone"
    )
    parser.add_argument("--sizes", nargs="+", type=int, metavar="NODES", help="of B3, B7 to B9 and B11")
    parser.add_argument("--plot", type=_absolute, metavar="FILE", help="of B3: time and memory against size")
    found = parser.parse_args(given)
    if found.part and found.part not in getattr(import_module(found.case.lower()), "PARTS", ()):
        parser.error(f"{found.case} has no part '{found.part}'")
    found.peers = tuple(found.peers)
    found.rounds = 3 if found.quick else 15
    return found


def _absolute(given: str) -> Path:
    return Path(given).absolute()


def main() -> None:
    """Run the case and print or write what came out."""
    options = arguments()
    warnings.simplefilter("ignore")  # of peers; thermid's own are errors of its tests
    case = import_module(options.case.lower())
    # some peers talk while they work, and leave files where they stand
    with contextlib.redirect_stdout(sys.stderr), tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        sections = case.run(options)
        facts = {"machine": machine(), "floor": floor()}
    document: dict[str, Any] = {
        "case": options.case,
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "quick": options.quick,
        "timing": TIMING,
        **facts,
        "results": [{k: section[k] for k in ("part", "room") if k in section} | row for section in sections for row in section["results"]],
        "sections": [{k: v for k, v in section.items() if k != "results"} for section in sections],
        "missing": {name: why for section in sections for name, why in section.get("missing", {}).items()},
    }
    if options.save:
        options.save.mkdir(parents=True, exist_ok=True)
        part = f"-{options.part}" if options.part else ""
        path = options.save / f"{document['date'][:10]}-{options.case}{part}.json"
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    if options.json:
        print(json.dumps(document, indent=1))
    else:
        report.show(document)


if __name__ == "__main__":
    main()
