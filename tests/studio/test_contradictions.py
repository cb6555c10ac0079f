"""The page shows what the numbers say: stages that are not credible, fits, files that change on disk, sections that keep apart."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from planted import campaign
from two_masses import write_plan

from .browser import Page, needed, page, studio

pytestmark = pytest.mark.campaign
TILES = "return Object.fromEntries([...document.querySelectorAll('#stages button')].map((b) => [b.dataset.stage, b.innerText]))"
ROWS = "[...document.querySelectorAll('#metrics tbody tr')]"
RMSE = f"return Object.fromEntries({ROWS}.map((r) => [r.dataset.sensor, Number(r.cells[2].textContent)]))"
VALUES = "return studio.state.desk.sliders.map((x) => x.value)"
SHOWN = """
return studio.state.desk.sliders.map((x) => [x.path, x.value,
  Number(document.querySelector(`[data-slider="${x.path}"] .number`)?.value ?? NaN)])
  .filter(([, value, shown]) => Number.isFinite(shown) && Math.abs(shown / value - 1) > 1e-4);"""
"""Values of the table that are not those of the stage."""
SLOW = """
window.plain ??= window.fetch;
window.fetch = async (at, how) => { const got = await plain(at, how); if (arguments[0] && at.includes(arguments[0])) await new Promise((r) => setTimeout(r, 500)); return got; };
"""  # noqa: E501
"""Makes answers of some address come half a second late; of none where it is empty."""
VALUE = "studio.state.desk?.sliders.find((x) => x.path === 'base.capacitance').value"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    needed()
    return campaign(tmp_path_factory.mktemp("contradictions"), planted=True)


@pytest.fixture(scope="module")
def shown(file: Path) -> Iterator[Page]:
    with studio(str(file)) as address, page(address) as made:
        yield made


def run_all(shown: Page) -> None:
    """Show the uppermost stage, run."""
    shown.click("[data-stage=whole]")
    shown.until("!document.getElementById('run-stage').disabled")
    if shown.run("return document.querySelector('[data-stage=whole]').dataset.state") != "done":
        shown.click("#run-stage")
    shown.until("[...document.querySelectorAll('#stages button')].every((b) => b.dataset.state === 'done')")
    shown.until("document.querySelector('[data-sensor=T_BASE]')")


def test_after_a_run_the_table_has_its_values(shown: Page) -> None:
    """Seen by a first user: tiles and verdict were those of the fit, and the table of values said what the deck had before it."""
    shown.click("[data-stage=part]")
    shown.until("document.querySelector('[data-sensor=T1]') && document.querySelector('.slider .number')")
    before = shown.run(VALUES)
    shown.click("#run-stage")
    shown.until("document.querySelector('[data-stage=part]').dataset.state === 'done' && studio.state.desk?.fitted")
    assert shown.run(VALUES) != before
    time.sleep(0.2)
    assert shown.run(SHOWN) == []


def test_after_fit_these_the_metrics_are_those_of_a_run(shown: Page) -> None:
    """From the moment at which the page says what the fit found: its text came before its curves, and beside those of another question."""
    worst = 0.0
    shown.run(SLOW, "/api/curves")
    for stage, sensor in (("part", "T1"), ("pair", "T_PLATE"), ("whole", "T_BASE")):
        shown.click(f"[data-stage={stage}]")
        shown.until(f"document.querySelector('[data-sensor={sensor}]')")
        shown.click("#fit")
        fitted = shown.wait(f"while (!document.getElementById('fit-result').textContent.includes('evaluations')) await pause(5); {RMSE}")
        shown.click("#run-stage")
        shown.until(f"document.querySelector('[data-stage={stage}]').dataset.state === 'done'")
        shown.until("document.getElementById('fit-result').textContent.includes('What the stage')")
        ran = shown.run(RMSE)
        assert set(fitted) == set(ran)
        worst = max([worst, *(abs(fitted[s] - ran[s]) for s in ran)])
    shown.run(SLOW, "")
    print(f"RMSE after Fit these less RMSE after Run: at most {1e3 * worst:.1f} mK")
    assert worst <= 0.002
    shown.clean()


def test_the_stage_that_was_opened_last_is_shown(shown: Page) -> None:
    """Whichever desk comes first; until one is there, a fit is that of the stage whose values stand on the page."""
    run_all(shown)
    shown.run(SLOW, "stage=pair")
    shown.click("[data-stage=pair]")
    shown.click("#fit")
    shown.until("document.getElementById('status').textContent.includes('The fit of whole has ended')")
    shown.click("[data-stage=part]")
    shown.until("document.querySelector('[data-sensor=T1]')")
    shown.wait("await pause(800)")
    shown.run(SLOW, "")
    assert shown.run("return [studio.state.stage, studio.state.desk.title]") == ["part", "part"]
    shown.clean()


def test_a_zoom_while_a_slider_moves_has_the_readings_too(shown: Page) -> None:
    """They stayed those of the window before."""
    run_all(shown)
    shown.run(SLOW, "/api/curves")
    slider = "document.querySelector('.slider input[type=range]')"
    shown.run(f"{slider}.value = 0.4; {slider}.dispatchEvent(new Event('input', {{ bubbles: true }}))")
    shown.click("[aria-label='Zoom in']")
    shown.run(SLOW, "")
    shown.wait("await pause(1500)")
    ends = shown.run(
        "const { runs, window: w } = studio.state; return runs[0].curves.map((c) => [c.seen[0], c.seen[c.seen.length - 1], ...w])"
    )
    assert all(begin - 61.0 <= first and last <= end + 61.0 for first, last, begin, end in ends)  # one reading more on either side
    shown.click("#zoom-all")
    shown.click("#undo")
    shown.clean()


def test_the_tile_of_a_stage_that_is_not_credible_says_so_and_those_that_rest_on_it(shown: Page) -> None:
    run_all(shown)
    tiles = shown.run(TILES)
    assert set(tiles) == {"part", "pair", "whole"}
    assert all("NOT CREDIBLE" in text and "RMSE" not in text for text in tiles.values())
    assert "rests on stage 'part' (T_LAB would need an error of" in shown.text("#stage-detail")
    for stage, sensor in (("pair", "T_PLATE"), ("part", "T1"), ("whole", "T_BASE")):
        shown.click(f"[data-stage={stage}]")
        shown.until(f"document.querySelector('[data-sensor={sensor}]')")
        assert "T_LAB would need" in shown.text("#stage-detail")
    edge = "return getComputedStyle(document.querySelector('[data-stage=part]')).borderLeftColor"
    assert shown.run(edge) == "rgb(163, 32, 29)"  # that of what is wrong, and not green
    shown.clean()


def test_a_deck_is_written_once_its_difference_was_seen(shown: Page, file: Path) -> None:
    run_all(shown)
    shown.click("[data-stage=whole]")
    shown.until("document.querySelector('[data-sensor=T_BASE]') && !document.getElementById('fit').disabled")
    deck = file.parent / "whole.toml"
    before = deck.read_bytes()
    shown.click("#write-back")
    shown.until("document.querySelector('pre.diff')")
    assert "+bolts = {" in shown.text("pre.diff")
    assert deck.read_bytes() == before
    shown.click("#write-now")
    shown.until("document.getElementById('status').textContent.includes('Written: whole.toml')")
    assert deck.read_bytes() != before
    deck.write_bytes(before)
    shown.until("document.querySelector('[data-stage=whole]').dataset.state === 'done'")
    shown.clean()


def test_no_two_sections_meet(shown: Page) -> None:
    run_all(shown)
    assert shown.meeting() == []


def test_a_changed_deck_is_stale_at_the_next_look_and_a_mended_one_works(shown: Page, file: Path) -> None:
    run_all(shown)
    deck = file.parent / "whole.toml"
    before = deck.read_text(encoding="utf-8")
    state = "document.querySelector('[data-stage=whole]').dataset.state"
    deck.write_text(before.replace('"2500 [J/K]"', '"2600 [J/K]"'), encoding="utf-8")
    assert shown.looks_until(f"{state} === 'stale'") <= 2  # one that was under way, and the next
    shown.wait(f"for (let k = 0; k < 60 && {VALUE} !== 2600; k++) await pause(50)")
    assert shown.wait(f"return {VALUE}") == 2600.0
    assert "changed since it was run" in shown.text("#stage-detail")
    deck.write_text(before.replace("[nodes]", "[nodess]"), encoding="utf-8")
    shown.until(f"{state} === 'failed' && document.getElementById('error').textContent.includes('nodess')")
    assert "✗ CANNOT BE READ" in shown.text("[data-stage=whole]")
    deck.write_text(before, encoding="utf-8")
    shown.until(f"{state} === 'done' && document.getElementById('error').hidden && document.querySelector('[data-sensor=T_BASE]')")
    shown.clean()


def test_a_stage_above_one_that_cannot_be_read_says_why(shown: Page, file: Path) -> None:
    """One that only waits is no error; this one would wait for ever."""
    run_all(shown)
    deck = file.parent / "part.toml"
    before = deck.read_text(encoding="utf-8")
    deck.write_text(before.replace("[nodes]", "[nodess]"), encoding="utf-8")
    shown.until("document.querySelector('[data-stage=part]').dataset.state === 'failed'")
    shown.click("[data-stage=pair]")
    shown.until("document.getElementById('error').textContent.includes('nodess')")
    deck.write_text(before, encoding="utf-8")
    shown.until("document.querySelector('[data-stage=pair]').dataset.state === 'done' && document.getElementById('error').hidden")
    shown.clean()


MOVED = """const s = document.querySelector('[id="s-joint.contact_conductance"]');
s.value = 0.9; for (const type of ['input', 'change']) s.dispatchEvent(new Event(type, { bubbles: true }))"""
TABLE = """Object.fromEntries([...document.querySelectorAll('[data-slider]')].map((r) =>
  [r.dataset.slider, [Number(r.querySelector('.number').value), r.querySelector('.error-of').textContent]]))"""


def test_the_table_shows_what_a_run_found(tmp_path: Path) -> None:
    """It kept the values from before the fit, without their errors, until the page was loaded anew."""
    needed()
    with studio(str(write_plan(tmp_path))) as address, page(address) as made:
        before = made.run(f"return {TABLE}")
        made.run(MOVED)
        made.until("Object.keys(studio.state.values).length === 1")
        made.click("#run-stage")
        made.until("studio.state.desk && studio.state.desk.fitted")
        made.wait("await pause(300)")
        shown, found = made.run(f"return [{TABLE}, Object.fromEntries(studio.state.desk.sliders.map((x) => [x.path, x.value]))]")
        assert {p: v for p, (v, _) in shown.items()} == {p: pytest.approx(v, rel=1e-4) for p, v in found.items()}
        for path in ("joint.contact_conductance", "skin.effective_htc"):
            assert shown[path][0] != before[path][0]
            assert shown[path][1].startswith("±")
        assert made.run("return studio.state.values") == {}  # what was moved before lay over what the run found
        made.click("#undo")
        assert list(made.run("return studio.state.values")) == ["joint.contact_conductance"]
        made.clean()
