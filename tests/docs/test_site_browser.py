"""The site in a browser, from the disk: search answers, nothing is asked of another host, no page is wider than a telephone."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .hooks import gallery, notebooks, studio_pictures
from .pages import ROOT

pytestmark = pytest.mark.campaign

QUIET = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking")
QUIET += ("--disable-component-update", "--disable-sync", "--hide-scrollbars")
PAGES = (
    "index",
    "tutorial",
    "from/esatan",
    "howto/report",
    "files",
    "physics",
    "nomenclature",
    "benchmarks",
    "reference/model",
    "commands",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for module in ("mkdocs", "material", "mkdocstrings"):
        pytest.importorskip(module, reason=f"{module} is not installed (extra docs)")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    return folder


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed (extra test)")
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("no Chromium with its driver (Debian: chromium, chromium-driver)")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for word in QUIET:
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    started = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield started
    started.quit()


def _asked(browser: Any) -> list[str]:
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]


def test_the_gallery_and_the_notebooks_have_their_pictures(site: Path) -> None:
    drawn = [(site / f"pictures/gallery/{name}.svg").read_text(encoding="utf-8") for name in gallery.GALLERY]
    assert min(map(len, drawn)) > 10 * len(gallery.BLANK)
    for name in notebooks.notebooks():
        assert "pictures/" in (site / f"notebooks/{name}.html").read_text(encoding="utf-8"), name


def test_the_pictures_of_the_studio_are_pictures(site: Path) -> None:
    """Each is a view of a page, 400 px wide at least and with the colours of one; a card in its place has fewer of both."""
    if shutil.which("chromium") is None or shutil.which("chromedriver") is None:
        pytest.skip("no Chromium with its driver (Debian: chromium, chromium-driver)")
    image = pytest.importorskip("matplotlib.image")
    for name in studio_pictures.names():
        assert (site / name).read_bytes() != studio_pictures.missing(studio_pictures.PARTS[Path(name).stem][2]), name
        pixels = image.imread(site / name)
        assert pixels.shape[1] >= 400, name
        assert len(np.unique((255 * pixels[::3, ::3, :3]).astype(np.uint8).reshape(-1, 3), axis=0)) > 100, name


def test_search_answers_from_the_disk(site: Path, browser: Any) -> None:
    browser.set_window_size(1600, 900)
    browser.get((site / "index.html").as_uri())
    field = browser.find_element("css selector", "input.md-search__input")
    browser.execute_script("document.querySelector('label[for=__search]').click()")
    field.send_keys("emissivity")
    end = time.monotonic() + 30
    while not (found := browser.find_elements("css selector", ".md-search-result__item")) and time.monotonic() < end:
        time.sleep(0.1)
    assert len(found) > 3
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    assert [url for url in _asked(browser) if not url.startswith(("file:", "data:"))] == []


@pytest.mark.parametrize("name", PAGES)
def test_a_page_fits_a_telephone_and_asks_nobody(site: Path, browser: Any, name: str) -> None:
    browser.set_window_size(500, 900)
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": False})
    browser.get((site / f"{name}.html").as_uri())
    wide, window = browser.execute_script("return [document.documentElement.scrollWidth, innerWidth]")
    assert window == 390
    assert wide <= window
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    assert [url for url in _asked(browser) if not url.startswith(("file:", "data:"))] == []
