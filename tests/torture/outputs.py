"""Every output of every command, aimed at every kind of file that a command reads, by four names of it: nothing is changed.

``python -m torture.outputs SECONDS`` in the folder tests prints one JSON object: how many were refused, and what was wrong.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from thermid.app.cli.app import main
from unit.app.cli.test_outputs import ENDINGS, OUTPUTS, contents, laboratory


def _said(words: list[str]) -> tuple[int, str]:
    sys.argv = ["thermid", *words]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as left:
            return int(left.code or 0), err.getvalue()
    return 0, err.getvalue()


def campaign(seconds: float) -> dict[str, Any]:
    """Aim outputs until the time is over."""
    counts, found, end = dict.fromkeys(OUTPUTS, 0), [], time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as place:
        bench, back = Path(place), Path.cwd()
        laboratory(bench)
        os.chdir(bench)
        before = contents(bench)
        try:
            for name in before:
                for output, words in OUTPUTS.items():
                    if time.monotonic() > end:
                        break
                    ending = ENDINGS.get(output, ".csv")
                    twin, link = bench / f"twin{ending}", bench / f"link{ending}"
                    os.link(bench / name, twin)
                    link.symlink_to(name)
                    for target in (name, str(bench / name), twin.name, link.name):
                        code, said = _said([*words, target])
                        counts[output] += 1
                        if code != 2 or not said.startswith("error: "):
                            found.append(f"{output} {target} ({name}): exit code {code}: {said[:120]}")
                    link.unlink()
                    twin.unlink()
                    after = contents(bench)
                    if after != before:
                        changed = [k for k in {*before, *after} if before.get(k) != after.get(k)]
                        found.append(f"{output} at {name}: changed {', '.join(changed[:5])}")
                        before = after
        finally:
            os.chdir(back)
    return {"counts": {"outputs": len(OUTPUTS), "kinds": len(before), "aimed": sum(counts.values())}, "findings": found}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(campaign(float(sys.argv[1])), indent=1) + "\n")
