"""Scenarios and bench in a real browser: limits on curves, a log that grows, keyboard, accessibility, hostile names."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from .browser import Page, needed, page, studio

EVIL = '"><script>window.evil = 1</script><img src=x onerror="window.evil = 1">'
DECK = """
title = "unit"
needs = ["air"]
[nodes]
plate = { capacitance = "900 [J/K]" }
core  = { capacitance = "1500 [J/K]", reference_point = true }
[surfaces]
skin = { of = "plate", to = "air", area = "0.12 [m^2]", htc = "8 [W/(m^2 K)]", emissivity = 0.8 }
[conductors]
foot = { kind = "conduction", between = ["core", "plate"], conductance = "1.2 [W/K]" }
[loads]
chips = { into = "core", power = "6 [W]" }
"""
LIMITS = """
[core]
node = "core"
operating = ["-30 [degC]", "60 [degC]"]
non_operating = ["-50 [degC]", "90 [degC]"]
start_up = ["-30 [degC]", "50 [degC]"]
loads = ["chips"]
"""
CHOOSE = "const c = document.getElementById('course'); c.value = arguments[0]; c.dispatchEvent(new Event('change'));"
SET = "const i = document.querySelector(arguments[0]); i.value = arguments[1]; i.dispatchEvent(new Event('change'));"


def lines(first: int, last: int) -> list[str]:
    """Return rows of a synthetic log."""
    rng = np.random.default_rng(first)
    times = np.arange(first, last) * 10.0
    case = 24.0 + 9.0 * (1.0 - np.exp(-times / 1000.0)) + 0.02 * rng.standard_normal(times.size)
    return [f"{t:.1f},{v:.3f},{'' if 1000 <= t < 1200 else f'{v - 3.0:.3f}'}\n" for t, v in zip(times, case, strict=True)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    needed()
    root = tmp_path_factory.mktemp("views")
    (root / "unit.toml").write_text(DECK, encoding="utf-8")
    (root / "limits.toml").write_text(LIMITS, encoding="utf-8")
    own = f"[profile]\nlike = 'SMC-S-016 unit thermal cycle'\nlevel = 'acceptance'\ntitle = '''{EVIL}'''\ncycles = 1\n"
    (root / "own.toml").write_text(own, encoding="utf-8")
    (root / "run.csv").write_text(
        "# SYNTHETIC\ntime_s,T_CASE," + EVIL.replace('"', "") + " [degC]\n" + "".join(lines(0, 300)), encoding="utf-8"
    )
    return root


@pytest.fixture(scope="module")
def shown(folder: Path) -> Iterator[Page]:
    with studio(str(folder / "unit.toml")) as address, page(address) as made:
        yield made


def run_course(shown: Page, key: str) -> None:
    done = shown.run("return studio.outcomes || 0")
    shown.click("[data-view=scenarios]")
    shown.run(CHOOSE, key)
    shown.until("document.querySelector('#profile-numbers table')")
    if shown.run("return Boolean(document.querySelector('[data-number=cycles]'))"):
        shown.run(SET, "[data-number=cycles]", "1")
    shown.click("#scenario-run")
    shown.until(f"(studio.outcomes || 0) > {done}")


def open_log(shown: Page) -> None:
    shown.click("[data-view=watch]")
    shown.run("document.getElementById('log').value = 'run.csv'")
    shown.click("#bench-open")
    shown.until("(studio.looks || 0) > 0")


def test_a_profile_is_run_and_its_worst_part_named(shown: Page) -> None:
    run_course(shown, "SMC-S-016 unit thermal cycle, acceptance")
    verdict = shown.text("#verdict")
    assert "✗ passed a limit" in verdict  # the word and the mark say it, not the colour alone
    assert "core (core), start-up" in verdict
    assert shown.run("return document.getElementById('focus').value") == "core"
    assert shown.run("return document.querySelectorAll('#checks tbody tr').length") == 3
    assert shown.text("#phases").count("dwell") == 1
    inked = """
    const c = document.querySelector('#scenario-chart canvas');
    const copy = Object.assign(document.createElement('canvas'), { width: c.width, height: c.height });
    const g = copy.getContext('2d', { willReadFrequently: true }); g.drawImage(c, 0, 0);
    const d = g.getImageData(0, 0, c.width, c.height).data;
    let red = 0; for (let k = 0; k < d.length; k += 4) if (d[k] > 140 && d[k + 1] < 60 && d[k + 2] < 60) red += 1; return red;"""
    with_limits = shown.run(inked)
    shown.run(SET, "#focus", "")
    shown.wait("await pause(120)")
    assert with_limits > shown.run(inked) + 200  # limits are drawn with the point that they belong to
    shown.clean()


def test_a_stretch_of_a_run_is_zoomed_by_keys(shown: Page) -> None:
    shown.run("document.querySelector('#scenario-chart .plot').focus()")
    press = "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', { key: arguments[0], bubbles: true }))"
    asked = "performance.getEntriesByType('resource').filter((e) => e.name.endsWith('/api/outcome')).length"
    before = shown.run(f"return {asked}")
    for key in ("+", "ArrowRight", "0"):
        shown.run(press, key)
    shown.until(f"{asked} >= {before + 3}")
    shown.clean()


def test_a_number_of_a_profile_that_is_refused_is_marked(shown: Page) -> None:
    """The message stood above, and the number in its field as if it counted."""
    for number, wrong in (("hot", "3 [W]"), ("stable", "warm")):
        field = f"[data-number={number}]"
        shown.run(SET, field, wrong)
        shown.until(f"document.querySelector('{field}').getAttribute('aria-invalid') === 'true'", 15)
        shown.run(SET, field, "")
        shown.until(f"document.querySelector('{field}').getAttribute('aria-invalid') === null", 15)
    shown.clean()


def test_a_long_run_is_stopped(shown: Page) -> None:
    shown.run(CHOOSE, "SMC-S-016 unit thermal cycle, qualification")
    shown.until("document.querySelector('[data-number=cycles]')")
    shown.run(SET, "[data-number=cycles]", "400")
    shown.click("#scenario-run")
    shown.until("document.getElementById('stop')")
    shown.click("#stop")
    shown.until("!document.getElementById('stop') && document.getElementById('error').textContent.includes('was stopped')")
    assert shown.text("#verdict") == ""
    shown.clean()


@pytest.mark.campaign
def test_a_humidity_course_is_stopped_in_its_balance(shown: Page) -> None:
    """All steps are done and the vapour is being balanced: the longest part, and it ends at the next pass."""
    shown.run(CHOOSE, "SMC-S-016 unit humidity")
    shown.until("document.querySelector('#profile-numbers table')")
    shown.click("#scenario-run")
    shown.until("document.getElementById('status').textContent.includes('all its steps') || !document.getElementById('stop')")
    if shown.run("return document.getElementById('stop')"):
        shown.click("#stop")
        shown.until("!document.getElementById('stop') && document.getElementById('error').textContent.includes('was stopped')")
        assert shown.text("#verdict") == ""
    run_course(shown, "SMC-S-016 unit thermal cycle, acceptance")  # and another begins at once
    shown.clean()


def test_hostile_names_of_profiles_and_channels_stay_text(shown: Page) -> None:
    run_course(shown, "profile own.toml")
    assert EVIL in shown.text("#scenario-title")
    open_log(shown)
    assert "<script>" in shown.text("#channels")
    assert "no stop advised" in shown.text("#bench-watch").lower()
    assert "the model is not used" in shown.text("#bench-watch")
    assert shown.run("return window.evil") is None
    shown.clean()


def test_a_log_outside_the_project_is_refused(shown: Page) -> None:
    shown.click("[data-view=watch]")
    shown.run("document.getElementById('log').value = '../../../../../../../etc/passwd'")
    shown.click("#bench-open")
    shown.until("document.getElementById('error').textContent.includes('lies outside the project')")
    shown.click("[data-view=scenarios]")
    shown.clean()


@pytest.mark.campaign
def test_a_log_that_grows_is_followed(folder: Path) -> None:
    file = folder / "growing.csv"
    file.write_text("time_s,T_CASE [degC],T_LID [degC]\n" + "".join(lines(0, 60)), encoding="utf-8")

    def grow(first: int, last: int) -> None:
        with file.open("a", encoding="utf-8") as out:
            for text in lines(first, last):  # each line in two pieces, as a logger without line buffering leaves them
                for piece in (text[:-3], text[-3:]):
                    out.write(piece)
                    out.flush()
                    time.sleep(0.005)

    with studio(str(folder / "unit.toml"), "--log", str(file)) as address, page(address) as shown:
        shown.until("(studio.looks || 0) > 0")
        assert "not stable" in shown.text("#bench-verdict")
        assert "Where T_CASE will end is not known yet" in shown.text("#bench-verdict")
        rows = "Number(document.getElementById('bench-title').textContent.match(/([0-9]+) rows/)[1])"
        for first, last in pairwise((60, 180, 300, 420)):
            grow(first, last)
            shown.until(f"{rows} === {last}", 30)
        shown.until("document.getElementById('bench-verdict').textContent.includes('✓ stable')", 30)
        assert "20 \u00d7 not a number" in shown.text("#channels")
        shown.run(SET, "#slowest", "0.4")
        shown.until("document.querySelector('#bench-verdict').textContent.includes('T_CASE will end at 3')", 30)
        shown.clean()


@pytest.mark.campaign
def test_the_views_are_reached_by_the_keyboard(shown: Page) -> None:
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    run_course(shown, "SMC-S-016 unit thermal cycle, acceptance")
    open_log(shown)
    for view, wanted in (
        ("scenarios", {"course", "lowest", "highest", "base", "state", "scenario-run", "focus"}),
        ("watch", {"log", "bench-open", "rule", "since", "slowest", "reference", "bench-focus", "watch-limits", "follow"}),
    ):
        shown.click(f"[data-view={view}]")
        shown.run("document.querySelector('[data-view=correlate]').focus()")
        seen: set[str] = set()
        for _ in range(45):
            ActionChains(shown.driver, duration=0).send_keys(Keys.TAB).perform()
            seen.add(str(shown.run("return document.activeElement.id")))
        assert wanted <= seen
    shown.clean()


@pytest.mark.parametrize("dark", [False, True])
def test_axe_finds_nothing_serious_in_the_views(shown: Page, dark: bool) -> None:
    for view in ("scenarios", "watch"):
        shown.click(f"[data-view={view}]")
        assert shown.serious(dark) == []
        for width in shown.widths():
            assert shown.run("return document.documentElement.scrollWidth") <= width
