"""Pictures of the studio and of a report page at three widths, light and dark: ``python scripts/screenshots.py [FOLDER]``.

They are to be looked at, not kept: the folder, ``out/screenshots`` by default, is none of the repository's.
"""

from __future__ import annotations

import base64
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.studio.browser import CHROMIUM, DRIVER, Page, logs_of, studio  # noqa: E402

EXAMPLES = ROOT / "examples"
WIDTHS = {1600: 1000, 1024: 900, 390: 844}
COURSE = "SMC-S-016 unit thermal cycle, acceptance"
CHOOSE = "const c = document.querySelector(arguments[0]); c.value = arguments[1]; c.dispatchEvent(new Event('change'));"


def shoot(page: Page, folder: Path, name: str) -> None:
    """Save what is on a page, whole, at every width, light and dark."""
    for scheme in ("light", "dark"):
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
        for width, height in WIDTHS.items():
            size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
            page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            page.wait("await pause(700)")
            shot = page.driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "fromSurface": True})
            target = folder / f"{name}_{width}_{scheme}.png"
            target.write_bytes(base64.b64decode(shot["data"]))
            print(target.relative_to(ROOT) if target.is_relative_to(ROOT) else target)
    page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def tune(page: Page) -> None:
    """Run all stages, fit, lay a run without convection beside it, and ask what a swap costs."""
    page.click("[data-stage=m_PrE]")
    page.until("document.getElementById('run-stage')")
    page.click("#run-stage")
    page.until("[...document.querySelectorAll('nav [data-stage]')].every((b) => b.dataset.state === 'done')", 300)
    page.until("document.querySelector('[data-sensor=T_ELE]') && document.querySelector('#picture svg')")
    page.click("#fit")
    page.until("document.getElementById('fit-result').textContent.includes('evaluations')", 120)
    page.run(CHOOSE, "#gas", "printed")
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
    page.click("#scenario-run")
    page.until("studio.courses", 300)


def bench(page: Page) -> None:
    """Look at a log."""
    page.until("studio.looks", 120)


def main() -> None:
    """Make every picture."""
    if CHROMIUM is None or DRIVER is None:
        sys.exit("screenshots need Chromium and its driver (Debian: chromium, chromium-driver).")
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "out" / "screenshots"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as made:
        work = Path(made)
        for name in ("02_stack", "04_campaign"):
            shutil.copytree(EXAMPLES / name, work / name, ignore=shutil.ignore_patterns("logs", "results", "__pycache__"))
        shutil.copy(EXAMPLES / "thermid.toml", work)
        shutil.copy(EXAMPLES / "06_swap" / "EleGFO_v2.toml", work / "04_campaign")
        logs = logs_of(EXAMPLES / "04_campaign" / "make_logs.py", work / "04_campaign" / "logs")
        campaign, unit = str(work / "04_campaign" / "campaign.toml"), str(EXAMPLES / "sisnav" / "qualification" / "decks" / "m_Sd.toml")
        log = str(logs / "stack_bench.csv")
        views: dict[str, tuple[tuple[str, ...], Callable[[Page], None]]] = {
            "studio_tune": ((campaign,), tune),
            "studio_scenario": ((unit,), scenario),
            "studio_bench": ((campaign, "--log", log), bench),
        }
        for name, (arguments, ready) in views.items():
            with studio(*arguments) as address:
                page = Page(address)
                try:
                    ready(page.open())
                    shoot(page, folder, name)
                finally:
                    page.close()
        report = work / "page.html"
        subprocess.run([sys.executable, "-m", "thermid", "report", campaign, "--to", str(report)], check=True, capture_output=True)
        page = Page(report.as_uri())
        try:
            page.driver.get(report.as_uri())
            shoot(page, folder, "report")
        finally:
            page.close()


if __name__ == "__main__":
    main()
