"""A headless browser on a studio that runs in a process of its own, as a user starts it."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.resources import files
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FIREFOX = os.environ.get("THERMID_BROWSER", "") == "firefox"
"""Whether Firefox is asked for (Debian: firefox-esr; and Mozilla's geckodriver): what only Chromium can be told is left out then."""
QUIET = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
)


BOXES = """
window.scrollTo(0, arguments[0] * (document.documentElement.scrollHeight - innerHeight));
return [...document.querySelectorAll('main section')].filter((e) => e.checkVisibility()).map((e) => {
  const r = e.getBoundingClientRect();
  return [e.getAttribute('aria-labelledby'), r.left, r.top, r.right, r.bottom];
});"""
"""Scrolls to a share of the page, and says where its sections are."""


def _meet(a: list[float], b: list[float]) -> bool:
    """Return whether two rectangles (left, top, right, bottom) share more than an edge."""
    return min(a[2], b[2]) - max(a[0], b[0]) > 0.5 and min(a[3], b[3]) - max(a[1], b[1]) > 0.5


def needed() -> None:
    """Skip with a message where a browser, its driver or the studio's extra is missing."""
    for module in ("selenium", "uvicorn", "starlette"):
        pytest.importorskip(module, reason=f"{module} is not installed (extras studio and test)")
    if FIREFOX and shutil.which("geckodriver") is None:
        pytest.fail("THERMID_BROWSER=firefox needs geckodriver on the PATH")
    if not FIREFOX and (CHROMIUM is None or DRIVER is None):
        pytest.skip("no Chromium with its driver (Debian: chromium, chromium-driver)")


def _chromium(width: int, height: int, profile: str, traced: bool) -> Any:
    """Return the driver of a new Chromium."""
    from selenium.webdriver import Chrome
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    for flag in (*QUIET, f"--window-size={width},{height}", f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.binary_location = str(CHROMIUM)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    if traced:
        options.add_experimental_option("perfLoggingPrefs", {"traceCategories": "toplevel"})
    return Chrome(options=options, service=Service(DRIVER))


def _firefox(width: int, height: int) -> Any:
    """Return the driver of a new Firefox."""
    from selenium.webdriver import Firefox
    from selenium.webdriver.firefox.options import Options
    from selenium.webdriver.firefox.service import Service

    options = Options()
    for flag in ("-headless", f"--width={width}", f"--height={height}"):
        options.add_argument(flag)
    return Firefox(options=options, service=Service(shutil.which("geckodriver"), log_output=subprocess.DEVNULL))


@contextlib.contextmanager
def studio(*arguments: str) -> Iterator[str]:
    """Yield the address of a studio."""
    command = [sys.executable, "-m", "thermid", "studio", *arguments, "--no-browser"]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={"XDG_STATE_HOME": tempfile.gettempdir(), **os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        address = re.search(r"https?://\S+", line)
        if address is None:
            pytest.fail(line + process.stdout.read())
        yield address[0]
    finally:
        process.terminate()
        process.wait(20)
        process.stdout.close()


_idle: dict[tuple[int, int, bool], Any] = {}
"""Browsers that no page is in, by width and height [px] and by whether they trace; their start would cost more than most tests."""


def _started(width: int, height: int, traced: bool) -> Any:
    """Return a new browser, which ends with the tests."""
    profile = tempfile.mkdtemp()
    driver = _firefox(width, height) if FIREFOX else _chromium(width, height, profile, traced)
    driver.set_script_timeout(120)
    atexit.register(shutil.rmtree, profile, ignore_errors=True)
    atexit.register(driver.quit)
    return driver


class Page:
    """A page of the studio in a browser.

    Parameters
    ----------
    address : str           Where the studio is.
    width, height : int     Of the window. [px]
    traced : bool           Whether the performance log has the tasks of every thread.
    """

    def __init__(self, address: str, width: int = 1600, height: int = 1000, traced: bool = False) -> None:
        self.address, self._key = address, (width, height, traced)
        self.driver = _idle.pop(self._key, None) or _started(*self._key)
        self.asked: list[str] = []
        self.said: list[str] = []

    def open(self) -> Page:
        """Load the page and wait until its first stage is shown."""
        self.driver.get(self.address)
        self.until("window.studio && window.studio.ready")
        return self

    def until(self, condition: str, seconds: float = 90.0) -> None:
        """Wait until a condition of the page holds."""
        end = time.monotonic() + seconds
        while not self.run(f"return Boolean({condition})"):
            if time.monotonic() > end:
                pytest.fail(f"the page never came to: {condition}; it says: {self.run('return document.body.innerText.slice(0, 600)')}")
            time.sleep(0.05)

    def run(self, script: str, *given: Any) -> Any:
        """Return what a script of the page returns."""
        return self.driver.execute_script(script, *given)

    def wait(self, script: str) -> Any:
        """Return what an asynchronous body, with `pause(ms)` at hand, returns."""
        return self.driver.execute_async_script(
            "const done = arguments[arguments.length - 1], pause = (ms) => new Promise((r) => setTimeout(r, ms));"
            f"(async () => {{ {script} }})().then(done, (e) => done({{ failed: String(e) }}));"
        )

    def looks_until(self, condition: str) -> int:
        """Return how often the page asks, once a second, whether a file was changed, from now until a condition holds."""
        count = "performance.getEntriesByType('resource').filter((e) => e.name.endsWith('/api/fresh')).length"
        self.run("performance.clearResourceTimings(); performance.setResourceTimingBufferSize(1e5)")
        looks, held = self.wait(f"for (let k = 0; k < 4000 && !({condition}); k++) await pause(20); return [{count}, Boolean({condition})]")
        assert held, condition
        return int(looks)

    def text(self, selector: str) -> str:
        """Return the text of an element."""
        return str(self.run("return document.querySelector(arguments[0]).textContent", selector))

    def click(self, selector: str) -> None:
        """Click an element that a person can see."""
        seen = self.run("const e = document.querySelector(arguments[0]), ok = e.checkVisibility(); if (ok) e.click(); return ok", selector)
        assert seen, f"{selector} is not shown"

    def widths(self) -> Iterator[int]:
        """Yield the widths of a desk, a tablet and a telephone, each taken on; Firefox cannot be told one. [px]"""
        if FIREFOX:
            pytest.skip("Firefox takes on no size of a telephone")
        for width in (1600, 1024, 390):
            size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
            self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            yield width
        self.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})

    def meeting(self) -> list[tuple[int, int, str, str]]:
        """Return width [px], place and names of every two sections that share more than an edge: five widths, twenty places of the page."""
        found = []
        if FIREFOX:
            pytest.skip("Firefox takes on no size of a telephone")
        for width in (1920, 1600, 1300, 820, 390):
            size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
            self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            self.wait("await pause(60)")
            for place in range(20):
                boxes = self.run(BOXES, place / 19)
                found += [(width, place, a[0], b[0]) for a, b in combinations(boxes, 2) if _meet(a[1:], b[1:])]
        self.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        self.run("window.scrollTo(0, 0)")
        return found

    def emulate(self, **features: str) -> None:
        """Take on what a person prefers, such as `color_scheme="dark"` or `reduced_motion="reduce"`, and nothing else."""
        preferred = [{"name": f"prefers-{name.replace('_', '-')}", "value": value} for name, value in features.items()]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": preferred})

    def serious(self, dark: bool, **preferred: str) -> list[Any]:
        """Return what axe-core calls serious or critical in the page as it stands, sizes of targets too, in the light or the dark."""
        pytest.importorskip("selenium_axe_python", reason="selenium-axe-python is not installed (extra test)")
        if not FIREFOX:
            self.emulate(color_scheme="dark" if dark else "light", **preferred)
        if not self.run("return Boolean(window.axe)"):
            self.run(files("selenium_axe_python").joinpath("axe-core/axe.min.js").read_text(encoding="utf-8"))
        contrast = "" if not FIREFOX else ", 'color-contrast': { enabled: false }"  # which takes Firefox minutes
        rules = f"{{ rules: {{ 'target-size': {{ enabled: true }}{contrast} }} }}"  # of WCAG 2.2, which axe leaves out by itself
        found = self.wait(
            f"return (await axe.run(document, {rules})).violations.map((v) => [v.impact, v.id, v.nodes.map((n) => n.html.slice(0, 120))])"
        )
        return [v for v in found if v[0] in ("serious", "critical")]

    def listen(self) -> None:
        """Take over what the console said and what the page asked for since last time; Firefox hands out neither."""
        if FIREFOX:
            return
        self.said += [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                self.asked.append(message["params"]["request"]["url"])

    def clean(self) -> None:
        """Fail when the console noted an error or anything outside this studio was asked for."""
        self.listen()
        assert self.said == [], self.said
        assert self.run("return window.studio.errors") == []
        own = self.address.partition("?")[0]
        assert [url for url in self.asked if url.startswith(("http", "ws", "ftp")) and not url.startswith(own)] == []

    def close(self) -> None:
        """Leave the browser to the next page of its size, as it was when it began."""
        from selenium.common.exceptions import WebDriverException

        try:
            self.driver.delete_all_cookies()
            self.run("if (origin.startsWith('http')) { localStorage.clear(); sessionStorage.clear(); }")
            if not FIREFOX:
                self.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
                self.emulate()
            self.driver.get("about:blank")
            self.listen()
        except WebDriverException:  # a browser that no longer answers is not used again
            self.driver.quit()
        else:
            _idle[self._key] = self.driver


@contextlib.contextmanager
def page(address: str, width: int = 1600, height: int = 1000, traced: bool = False) -> Iterator[Page]:
    """Yield a page of a studio, opened."""
    made = Page(address, width, height, traced)
    try:
        yield made.open()
    finally:
        made.close()


def logs_of(script: Path, folder: Path) -> Path:
    """Return a folder with the synthetic logs that an example's script makes."""
    subprocess.run([sys.executable, str(script), str(folder)], check=True, capture_output=True)
    return folder
