"""The studio in a real browser: sliders, fits, undo, saving, folding, vacuum, swap, keyboard, accessibility."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from thermid.values.store import load_values

from .browser import Page, logs_of, needed, page, studio

EXAMPLES = Path(__file__).parents[2] / "examples"
SLIDE = """
const slider = document.getElementById('s-' + NAME), times = [];
for (let k = 1; k <= 12; k++) {
  slider.value = k / 14; slider.dispatchEvent(new Event('input', { bubbles: true }));
  const before = studio.latencies.length; for (let w = 0; w < 100 && studio.latencies.length === before; w++) await pause(20);
}
slider.dispatchEvent(new Event('change', { bubbles: true }));
return studio.latencies;
"""


CHOOSE = "const c = document.querySelector(arguments[0]); c.value = arguments[1]; c.dispatchEvent(new Event('change'))"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign of example 04 with a second deck to swap in, and its logs."""
    needed()
    root = tmp_path_factory.mktemp("studio")
    for name in ("02_stack", "04_campaign"):
        shutil.copytree(EXAMPLES / name, root / name, ignore=shutil.ignore_patterns("logs", "results", "__pycache__"))
    shutil.copy(EXAMPLES / "thermid.toml", root)
    logs_of(EXAMPLES / "04_campaign" / "make_logs.py", root / "04_campaign" / "logs")
    newer = (root / "02_stack" / "EleGFO.toml").read_text(encoding="utf-8").replace('title  = "EleGFO"', 'title  = "EleGFO_v2"')
    (root / "04_campaign" / "EleGFO_v2.toml").write_text(newer, encoding="utf-8")
    return root / "04_campaign"


@pytest.fixture(scope="module")
def shown(folder: Path) -> Iterator[Page]:
    with studio(str(folder / "campaign.toml")) as address, page(address) as made:
        yield made


def test_stages_are_run_from_the_page(shown: Page) -> None:
    states = "[...document.querySelectorAll('#stages button')].map((b) => b.dataset.state).join()"
    assert shown.run(f"return {states}") == "new,new,waiting"
    shown.click("[data-stage=m_PrE]")
    shown.until("document.querySelector('[aria-current=true]').dataset.stage === 'm_PrE' && !document.getElementById('run-stage').disabled")
    assert shown.run("return document.getElementById('error').hidden")  # one that was never run is no fault
    assert shown.text("#stage-detail").startswith("Run m_PrE and ProcSISNAV, EleGFO below it")
    shown.click("#run-stage")
    shown.until(f"{states} === 'done,done,done'")
    shown.until("document.querySelector('[data-sensor=T_ELE]')")
    assert "Synthetic" in shown.text("#banner")
    shown.clean()


def test_a_slider_moves_curve_and_metric(shown: Page) -> None:
    before = shown.text("[data-sensor=T_ELE] td.num")
    times = shown.wait(SLIDE.replace("NAME", "'stack.gap.htc'"))
    assert len(times) >= 12
    print(f"slider to curve and metric: median {np.median(times):.0f} ms, largest {max(times):.0f} ms")
    assert shown.text("[data-sensor=T_ELE] td.num") != before
    shown.click("#undo")
    shown.until(f"document.querySelector('[data-sensor=T_ELE] td.num').textContent === '{before}'")
    shown.click("#redo")
    shown.until(f"document.querySelector('[data-sensor=T_ELE] td.num').textContent !== '{before}'")
    shown.clean()


def test_a_fit_comes_back_and_is_saved(shown: Page, folder: Path) -> None:
    shown.click("#fit")
    shown.until("document.getElementById('fit-result').textContent.includes('evaluations')")
    found = shown.text("#fit-result")
    assert "stack.gap.htc" in found
    assert "±" in found
    shown.run("document.getElementById('save-name').value = 'from the page'")
    shown.click("#save button")
    shown.until("document.getElementById('status').textContent.includes('Saved')")
    kept = load_values(folder / "results" / "from_the_page.values.toml")
    fitted = load_values(folder / "results" / "m_PrE.values.toml")
    assert kept["stack.gap.htc"].value == pytest.approx(fitted["stack.gap.htc"].value, abs=0.05 * fitted["stack.gap.htc"].error)
    shown.clean()


def test_parts_fold_and_unfold_and_answer_to_clicks(shown: Page) -> None:
    inside = "document.querySelectorAll('#picture [data-path=\"proc.case\"]').length"
    click = "document.querySelector('#picture [{}]').dispatchEvent(new MouseEvent('click', {{ bubbles: true }}))"
    shown.until(f"{inside} > 0")
    shown.run(CHOOSE, "#fold", "proc")
    shown.until(f"{inside} === 0")
    shown.run(click.format("data-part=proc"))
    shown.until(f"{inside} > 0")
    shown.run(click.format('data-path="proc.case"'))
    shown.until("document.getElementById('detail').textContent.includes('proc.case.mass')")
    shown.run("const f = document.getElementById('find'); f.value = ''; f.dispatchEvent(new Event('input'))")
    shown.clean()


def test_two_states_are_compared(shown: Page) -> None:
    """A, a kept file or the deck, stays while B is moved; differences stand in the rows."""
    shown.run(CHOOSE, "#pin", "deck")
    shown.until("document.querySelector('.pin') && document.querySelector('#curves .keys').textContent.includes('A: the deck')")
    shown.run(CHOOSE, "#pin", " from_the_page.values.toml")
    shown.until("document.querySelector('#curves .keys').textContent.includes('A: from_the_page')")
    shown.run(CHOOSE, "#pin", "none")
    shown.until("!document.querySelector('.pin')")
    shown.clean()


def test_tiles_and_the_map_are_tables_too(shown: Page) -> None:
    shown.run("document.getElementById('tables').open = true")
    shown.until("document.querySelectorAll('#map-heat tr').length > 0")
    tables = shown.run("return ['metrics', 'map-temperatures', 'map-heat', 'map-powers'].map((i) => document.getElementById(i).innerText)")
    assert all(tables)
    assert "proc.case" in tables[1]
    track = shown.run("return document.querySelector('[data-track] figcaption').textContent")
    assert "powers" in track


def test_a_swap_marks_what_turns_stale(shown: Page) -> None:
    shown.run("document.getElementById('swap-part').value = 'ele'; document.getElementById('swap-deck').value = 'EleGFO_v2.toml'")
    shown.click("#swap button")
    shown.until("document.getElementById('swap-result').textContent.includes('stages due again')")
    states = shown.run(
        "return Object.fromEntries([...document.querySelectorAll('#stages button')].map((b) => [b.dataset.stage, b.dataset.state]))"
    )
    assert states == {"ProcSISNAV": "done", "EleGFO": "stale", "m_PrE": "stale"}
    said = shown.run("return [...document.querySelectorAll('#stages button[data-state=stale] small')].map((e) => e.textContent)")
    assert said == ["due after the swap"] * 2  # nothing was run yet, and nobody is told to run it again
    shown.wait("await pause(1500)")  # and what is on the disk, which is asked for every second, does not take the marks off
    assert shown.run("return document.querySelector('[data-stage=EleGFO]').dataset.state") == "stale"
    shown.clean()


def test_everything_is_reached_by_the_keyboard(shown: Page) -> None:
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    shown.run("document.activeElement.blur(); window.scrollTo(0, 0)")
    seen: set[str] = set()
    for _ in range(70):
        ActionChains(shown.driver, duration=0).send_keys(Keys.TAB).perform()
        seen.add(str(shown.run("const e = document.activeElement; return e.id || e.dataset.stage || e.tagName")))
    for name in ("fit", "undo", "save-name", "find", "time", "run", "pin", "fold", "picture", "m_PrE", "s-stack.gap.htc"):
        assert name in seen
    before = shown.text("[data-sensor=T_ELE] td.num")
    shown.run("document.getElementById('s-stack.gap.htc').focus()")
    ActionChains(shown.driver, duration=0).send_keys(Keys.ARROW_RIGHT * 40).perform()
    shown.until(f"document.querySelector('[data-sensor=T_ELE] td.num').textContent !== '{before}'")
    ActionChains(shown.driver).key_down(Keys.CONTROL).send_keys("z").key_up(Keys.CONTROL).perform()
    shown.clean()


def test_what_was_moved_comes_back_with_the_page(shown: Page) -> None:
    values = "return studio.state.values"
    shown.wait(SLIDE.replace("NAME", "'stack.gap.htc'"))
    before = shown.wait(values)
    assert before["stack.gap.htc"] > 0.0
    shown.open()
    assert shown.wait(values) == before
    shown.click("[data-stage=EleGFO]")
    shown.until("document.querySelector('#metrics [data-sensor=T_ELE]') && !document.querySelector('[data-sensor=T_PROC]')")
    assert shown.wait(values) == {}
    shown.click("[data-stage=m_PrE]")
    shown.until("document.querySelector('[data-sensor=T_PROC]')")
    assert shown.wait(values) == before
    shown.click("#undo")
    assert shown.wait(values) != before
    shown.clean()


def test_a_page_opened_in_the_middle_of_a_fit_takes_it_up(shown: Page) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    shown.click("[data-stage=m_PrE]")
    shown.until("document.querySelector('[data-sensor=T_PROC]')")
    shown.click("#fit")
    first = shown.driver.current_window_handle
    shown.driver.switch_to.new_window("tab")
    shown.open()  # of the same studio; whether the fit still runs by now or not, a stage is opened and the fit can be asked for
    assert shown.run("return document.querySelector('[aria-current=true]').dataset.stage") == "m_PrE"
    WebDriverWait(shown.driver, 90).until(lambda d: d.execute_script("return !document.getElementById('fit').disabled"))
    shown.driver.close()
    shown.driver.switch_to.window(first)
    shown.until("document.getElementById('fit-result').textContent.includes('evaluations')")
    shown.clean()


@pytest.mark.parametrize("dark", [False, True])
def test_axe_finds_nothing_serious(shown: Page, dark: bool) -> None:
    assert shown.serious(dark) == []


def test_a_narrow_window_needs_no_sideways_scrolling(shown: Page) -> None:
    for width in shown.widths():
        assert shown.run("return document.documentElement.scrollWidth") <= width


def test_no_two_sections_meet(shown: Page) -> None:
    """A panel that stays in sight covers nothing."""
    shown.click("[data-stage=m_PrE]")
    shown.until("document.querySelector('[data-sensor=T_ELE]') && document.querySelector('#table tbody tr')")
    assert shown.meeting() == []


def test_a_stage_that_is_not_credible_has_no_green_tile(shown: Page) -> None:
    told = "const said = { standing: 'not credible', usable: false, because: 'T would have to be wrong' }, p = studio.project.value;"
    mark = "studio.project.value = { ...p, stages: p.stages.map((x, k) => (k === 1 ? { ...x, ...said } : x)) }; await pause(50);"
    tile = "const t = [...document.querySelectorAll('#stages button')], edge = (e) => getComputedStyle(e).borderLeftColor;"
    text, title, edge, others = shown.wait(told + mark + tile + "return [t[1].innerText, t[1].title, edge(t[1]), edge(t[0])]")
    assert "NOT CREDIBLE" in text
    assert "RMSE" not in text
    assert title == "T would have to be wrong"
    assert edge in ("rgb(163, 32, 29)", "rgb(255, 155, 148)")  # what is wrong, in the light or the dark
    assert others not in (edge, "")


def test_a_changed_deck_is_stale_at_the_next_look(shown: Page, folder: Path) -> None:
    deck, state = folder.parent / "02_stack" / "EleGFO.toml", "document.querySelector('[data-stage=EleGFO]').dataset.state"
    before = deck.read_text(encoding="utf-8")
    deck.write_text(before.replace("960", "961", 1), encoding="utf-8")
    assert shown.looks_until(f"{state} === 'stale'") <= 2  # one that was under way, and the next
    deck.write_text(before, encoding="utf-8")
    shown.until(f"{state} === 'done'")
    shown.clean()


@pytest.mark.campaign
def test_a_studio_that_was_ended_is_said_in_words(folder: Path) -> None:
    needed()
    with contextlib.ExitStack() as running:
        shown = Page(running.enter_context(studio(str(folder / "campaign.toml"))))
        try:
            shown.open()
            running.close()
            shown.click("#fit")
            shown.until("document.getElementById('error').textContent.includes('it was ended. Start it again')")
            assert shown.run("return document.getElementById('error').checkVisibility()")
        finally:
            shown.close()


@pytest.mark.campaign
def test_a_deck_with_an_error_is_said_at_its_stage(folder: Path, tmp_path: Path) -> None:
    for name in ("02_stack", "04_campaign"):
        shutil.copytree(folder.parent / name, tmp_path / name, ignore=shutil.ignore_patterns("results"))
    shutil.copy(folder.parent / "thermid.toml", tmp_path)
    deck = tmp_path / "02_stack" / "ProcSISNAV.toml"
    whole = deck.read_text(encoding="utf-8")
    deck.write_text(whole.replace("[nodes]", "[nodess]"), encoding="utf-8")
    with studio(str(tmp_path / "04_campaign" / "campaign.toml")) as address, page(address) as shown:
        assert shown.run("return document.querySelector('[data-stage=ProcSISNAV]').dataset.state") == "failed"
        shown.click("[data-stage=ProcSISNAV]")
        shown.until("document.getElementById('error').textContent.includes(\"'nodess' is not a field here. Did you mean 'nodes'?\")")
        deck.write_text(whole, encoding="utf-8")
        shown.click("#run-stage")  # mended, it runs without a new start
        shown.until("document.querySelector('[data-stage=ProcSISNAV]').dataset.state === 'done'")
        shown.until("document.querySelector('[data-sensor=T_PROC]')")
        shown.clean()


@pytest.mark.campaign
def test_the_navigation_unit_is_tuned_in_the_page(tmp_path: Path) -> None:
    """The study's full model: 25 nodes, 74 sliders, eleven sensors, nine stages."""
    needed()
    logs = logs_of(EXAMPLES / "sisnav" / "laboratory.py", tmp_path / "logs")
    where = ("--data", str(logs), "--results", str(tmp_path / "results"))
    with studio(str(EXAMPLES / "sisnav" / "campaign.toml"), *where) as address, page(address) as shown:
        states = "[...document.querySelectorAll('#stages button')].map((b) => b.dataset.state)"
        shown.click("[data-stage=m_Sd]")
        shown.until("document.getElementById('run-stage')")
        shown.click("#run-stage")
        shown.until(f"{states}.every((s) => s === 'done')", 1200)
        shown.until("document.querySelector('[data-sensor=T_DISK]')")
        times = shown.wait(SLIDE.replace("NAME", "'imu_foot_conductivity'"))
        print(f"slider to curve and metric: median {np.median(times):.0f} ms, largest {max(times):.0f} ms")
        assert len(times) >= 12  # what a step costs is counted in processor time, by scripts/slider_cost.py
        shown.click("#fit")
        shown.until("document.getElementById('fit-result').textContent.includes('imu_foot_conductivity')")
        shown.run(CHOOSE, "#fold", "imu")
        shown.until("document.querySelector('#picture [data-part=imu]') && !document.querySelector('#picture [data-path=\"imu.support\"]')")
        shown.run("document.getElementById('swap-part').value = 'pre.ele'; document.getElementById('swap-deck').value = 'EleGFO_v2.toml'")
        shown.click("#swap button")
        shown.until(f"{states}.join() === 'done,done,done,stale,done,stale,done,done,stale'")
        shown.clean()
