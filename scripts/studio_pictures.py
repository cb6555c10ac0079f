"""Pictures of the studio and of a report for the site, taken by a headless browser when the pages are built.

Where no Chromium with its driver is installed, a card that says so stands in their place.
"""

from __future__ import annotations

import base64
import os
import shutil
import sys
from pathlib import Path

PARTS = {
    "studio": ("correlate", "body", "The studio: stages, a tile for every sensor, map, values"),
    "stages": ("correlate", ".stages", "Stages of the campaign"),
    "model": ("correlate", "#model", "The model at one time: temperatures, heat flows, powers"),
    "curves": ("correlate", "#curves", "Measured and simulated readings with residuals"),
    "parameters": ("correlate", "#tuning", "One track for each parameter"),
    "levels": ("correlate", "#levels", "Coefficients by level"),
    "scenario": ("scenario", "body", "A profile of a standard, run on the model with its limits"),
    "build": ("build", "body", "A model on the canvas, with its values and its log"),
    "watch": ("watch", "body", "A log as it grows"),
    "report": ("report", "body", "The first screen of a report"),
}
"""Name of a picture -> the view, the part of it, and what it shows."""


def names() -> list[str]:
    """Return the names of the pictures."""
    return [f"pictures/studio/{name}.png" for name in PARTS]


def wanted() -> bool:
    """Return whether pictures that take long are made; a test of pages and links does without."""
    return os.environ.get("THERMID_DOCS_PICTURES") != "0"


def able() -> bool:
    """Return whether pictures can be taken here."""
    try:
        import pytest  # noqa: F401
        import selenium  # noqa: F401
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError:
        return False
    return shutil.which("chromium") is not None and shutil.which("chromedriver") is not None


def missing(title: str) -> bytes:
    """Return a card in place of a picture that could not be taken, as PNG.

    Parameters
    ----------
    title : str     What the picture would show.
    """
    import matplotlib

    matplotlib.use("Agg")
    from io import BytesIO

    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 2.0))
    figure.text(0.5, 0.58, title, ha="center", va="center", fontsize=12)
    figure.text(0.5, 0.34, "This picture needs Chromium and its driver where the pages are built.", ha="center", va="center", fontsize=9)
    out = BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def taken() -> dict[str, bytes]:
    """Return every picture by its name, as PNG; a card stands in place of each that could not be taken."""
    out = {name: missing(title) for name, (_, _, title) in PARTS.items()}
    if not (wanted() and able()):
        return out
    if (here := str(Path(__file__).parent)) not in sys.path:  # a site builder takes it off again after hooks are loaded
        sys.path.append(here)
    from screenshots import VIEWS, prepared, view

    with prepared() as work:
        for name in VIEWS:
            try:
                with view(name, work) as page:
                    out |= _parts(page, name)
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # also an outcome of pytest, by which the helper of the browser fails
                print(f"the view '{name}' could not be taken, cards stand in its place: {error}", file=sys.stderr)
    return out


def _parts(page: object, view: str) -> dict[str, bytes]:
    """Return the pictures of one view: its first screen, or one of its parts."""
    driver = page.driver  # type: ignore[attr-defined]
    out = {}
    for name, (of, part, _) in PARTS.items():
        if of != view:
            continue
        # a part is taken whole, so the window is as high as the highest of them; a narrow one has the stages side by side
        size = {
            "width": 1100 if name == "stages" else 1600,
            "height": 1000 if part == "body" else 1900,
            "deviceScaleFactor": 1,
            "mobile": False,
        }
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        driver.execute_script("window.scrollTo(0, 0)")
        page.wait("await pause(400)")  # type: ignore[attr-defined]
        if part == "body":
            shot = driver.execute_cdp_cmd("Page.captureScreenshot", {"fromSurface": True})["data"]
            out[name] = base64.b64decode(shot)
        else:
            out[name] = driver.find_element("css selector", part).screenshot_as_png
    return out


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in taken().items():
        (folder / f"{name}.png").write_bytes(data)
