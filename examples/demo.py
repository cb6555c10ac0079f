"""The study of the source document, end to end: synthetic logs, nine levels twice, scenarios, and one report page.

Run by ``make demo``. Every log is made here and labelled as synthetic; examples/tclab does the same on measured ones.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "sisnav"))

import page  # noqa: E402
import work  # noqa: E402


def main(folder: Path) -> Path:
    """Run the demonstration into a folder and return the path of the page."""
    begun = time.monotonic()

    def say(text: str) -> None:
        print(f"[{time.monotonic() - begun:5.1f} s] {text}", flush=True)

    done = work.run(folder, say)
    say("predicting temperature, humidity and vacuum; drawing the page")
    report = page.main(done, folder / "report.html")
    say("done")
    print(f"\nreport page: {report}")
    return report


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out") / "demo")
