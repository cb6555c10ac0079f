"""Pictures of the studio and of a report page at three widths, light and dark: ``python scripts/screenshots.py [FOLDER]``.

They are to be looked at, not kept: the folder, ``out/screenshots`` by default, is none of the repository's.
"""

from __future__ import annotations

import base64
import contextlib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.studio.browser import CHROMIUM, DRIVER, Page, logs_of, studio  # noqa: E402

EXAMPLES = ROOT / "examples"
WIDTHS = {1600: 1000, 1000: 900, 390: 844}
COURSE = "SMC-S-016 unit thermal cycle, acceptance"
CHOOSE = "const c = document.querySelector(arguments[0]); c.value = arguments[1]; c.dispatchEvent(new Event('change'));"


def shoot(page: Page, folder: Path, name: str) -> None:
    """Save what is on a page, whole, at every width, light and dark."""
    for scheme in ("light", "dark"):
        page.emulate(color_scheme=scheme)
        for width, height in WIDTHS.items():
            size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
            page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            page.wait("await pause(700)")
            shot = page.driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "fromSurface": True})
            target = folder / f"{name}_{width}_{scheme}.png"
            target.write_bytes(base64.b64decode(shot["data"]))
            print(target.relative_to(ROOT) if target.is_relative_to(ROOT) else target)
    page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def correlate(page: Page) -> None:
    """Run all stages, fit, compare with the deck, and ask what a swap costs."""
    page.click("[data-stage=m_PrE]")
    page.until("document.getElementById('run-stage')")
    page.click("#run-stage")
    page.until("[...document.querySelectorAll('nav [data-stage]')].every((b) => b.dataset.state === 'done')", 300)
    page.until("document.querySelector('[data-tile=T_ELE]') && document.querySelector('#picture svg')")
    page.click("#fit")
    page.until("document.getElementById('fit-result').textContent.includes('evaluations')", 120)
    page.run(CHOOSE, "#pin", "deck")
    page.run(CHOOSE, "#swap-part", "ele")
    page.run(CHOOSE, "#swap-deck", "EleGFO_v2.toml")
    page.click("#swap button")
    page.until("document.getElementById('swap-result').textContent.includes('stages due again')", 120)


def scenario(page: Page) -> None:
    """Run a profile that comes near to a limit."""
    page.click("[data-view=scenarios]")
    page.run(CHOOSE, "#course", COURSE)
    page.until("document.querySelector('[data-number=cycles]')")
    for where, value in (("[data-number=cycles]", "2"), ("#lowest", "-5"), ("#highest", "65")):
        page.run(CHOOSE, where, value)
        page.wait("await pause(300)")
    page.click("#scenario-run")
    page.until("studio.outcomes", 300)


def watch(page: Page) -> None:
    """Look at a log."""
    page.until("studio.looks", 120)


def build(page: Page) -> None:
    """Open the deck of the last stage on the canvas, and choose a part of it."""
    page.driver.get(page.address.partition("?")[0] + "build")
    page.until("window.studio && window.studio.ready && document.querySelector('[data-node]')")
    page.run("document.querySelector('[data-node=disk]').focus(); canvas.dispatchEvent(new KeyboardEvent('keydown', { key: ' ' }))")
    page.until("document.querySelector('#sheet-name')")


@dataclass(frozen=True)
class Work:
    """What the views show: a copy of example 04 with its synthetic logs, and a unit of the sisnav study.

    Parameters
    ----------
    campaign, unit, log : Path      A campaign, a deck with limits beside it, a log.
    page : Path                     Where the report of the campaign is written.
    """

    campaign: Path
    unit: Path
    log: Path
    page: Path


@contextlib.contextmanager
def prepared() -> Iterator[Work]:
    """Yield the files of all views, in a folder of their own."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name in ("02_stack", "04_campaign"):
            shutil.copytree(EXAMPLES / name, folder / name, ignore=shutil.ignore_patterns("logs", "results", "__pycache__"))
        shutil.copy(EXAMPLES / "thermid.toml", folder)
        shutil.copy(EXAMPLES / "06_swap" / "EleGFO_v2.toml", folder / "04_campaign")
        logs = logs_of(EXAMPLES / "04_campaign" / "make_logs.py", folder / "04_campaign" / "logs")
        unit = EXAMPLES / "sisnav" / "qualification" / "decks" / "m_Sd.toml"
        yield Work(folder / "04_campaign" / "campaign.toml", unit, logs / "stack_bench.csv", folder / "page.html")


VIEWS = ("correlate", "scenario", "watch", "build", "report")
"""The views in the order in which they are taken: those after the first find the stages that it ran."""


@contextlib.contextmanager
def view(name: str, work: Work) -> Iterator[Page]:
    """Yield a page that shows one view, ready to be looked at.

    Parameters
    ----------
    name : str      One of `VIEWS`.
    work : Work     What it shows.
    """
    if name == "report":
        command = [sys.executable, "-m", "thermid", "report", str(work.campaign), "--to", str(work.page)]
        subprocess.run(command, check=True, capture_output=True)
        with contextlib.closing(Page(work.page.as_uri())) as page:
            page.driver.get(work.page.as_uri())
            yield page
        return
    arguments, ready = {
        "correlate": ((str(work.campaign),), correlate),
        "build": ((str(work.unit),), build),
        "scenario": ((str(work.unit),), scenario),
        "watch": ((str(work.campaign), "--log", str(work.log)), watch),
    }[name]
    with studio(*arguments) as address, contextlib.closing(Page(address)) as page:
        ready(page.open())
        yield page


def main() -> None:
    """Make every picture."""
    if CHROMIUM is None or DRIVER is None:
        sys.exit("screenshots need Chromium and its driver (Debian: chromium, chromium-driver).")
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "out" / "screenshots"
    folder.mkdir(parents=True, exist_ok=True)
    with prepared() as work:
        for name in sys.argv[2:] or VIEWS:
            with view(name, work) as page:
                shoot(page, folder, name)


if __name__ == "__main__":
    main()
