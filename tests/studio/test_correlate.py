"""Correlate and Watch as a person has them on a screen: eleven sensors at once, small windows, a log of six hours that grows."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from unit.app.studio.test_live import DECK, printed, unnamed, warm, write

from .browser import Page, needed, page, studio
from .large import dense_campaign

pytestmark = pytest.mark.campaign
TILES = "return [...document.querySelectorAll('#tiles .tile')].map((e) => { const r = e.getBoundingClientRect(); return [e.dataset.tile || '', r.left, r.top, r.right, r.bottom]; })"  # noqa: E501
SLIDE = """
const slider = document.getElementById('s-skin.effective_htc'), gaps = [];
for (let k = 0; k < 40; k++) { slider.value = 0.2 + 0.01 * k; slider.dispatchEvent(new Event('input', { bubbles: true })); await pause(15); }
slider.dispatchEvent(new Event('change', { bubbles: true })); await pause(1500);
const last = studio.state.values['skin.effective_htc'];
const answer = await fetch('/api/curves', { method: 'POST', headers: { 'x-thermid-studio': '1' }, body: JSON.stringify({ stage: studio.state.stage, values: studio.state.values, run: 0, measured: false }) });
return [last, (await answer.json()).runs[0].curves.map((c) => c.rmse), studio.state.runs[0].curves.map((c) => c.rmse)];
"""  # noqa: E501
LABELS = """
const drawn = [], plain = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) { drawn.push([this.canvas, text]); plain.call(this, text, x, y); };
document.documentElement.style.fontSize = '15.5px'; window.dispatchEvent(new Event('resize'));
for (const p of document.querySelectorAll('#tiles .plot')) p.style.maxHeight = `${p.clientHeight - 3}px`;
await pause(800);
CanvasRenderingContext2D.prototype.fillText = plain;
return [...document.querySelectorAll('#tiles canvas')].map((c) => [...new Set(drawn.filter(([d]) => d === c).map(([, t]) => t))]);
"""


@pytest.fixture(scope="module")
def rack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of eleven sensors of two thousand readings each."""
    needed()
    with studio(str(dense_campaign(tmp_path_factory.mktemp("rack"), 11, 2000))) as address, page(address) as made:
        made.until("document.querySelectorAll('#tiles canvas').length === 12 && document.querySelector('#picture svg')")
        yield made


def test_eleven_sensors_are_seen_at_once(rack: Page) -> None:
    """Each on at least 220 px either way, the worst first, none beyond the screen, none on another."""
    tiles = rack.run(TILES)
    assert len(tiles) == 12
    assert tiles[0][0] == "T10"  # furthest off in units of its noise
    for name, left, top, right, bottom in tiles:
        assert min(right - left, bottom - top) >= 220, name
        assert right <= 1600
        assert bottom <= 1000, name
    heights = rack.run("return [document.documentElement.scrollHeight, innerHeight]")
    assert heights[0] <= heights[1]
    rack.clean()


def test_every_axis_has_two_labels_or_more(rack: Page) -> None:
    for texts in rack.wait(LABELS)[:11]:
        numbers = [t for t in texts if t not in ("°C", "K")]
        assert {"°C", "K"} <= set(texts)
        assert sum(t.endswith((" h", " min")) for t in texts) == 1
        assert len(numbers) >= 2 + 2 + 3  # time, temperature, residual
    rack.clean()


def test_the_last_input_is_drawn(rack: Page) -> None:
    last, asked, shown = rack.wait(SLIDE)
    assert last > 0.0
    assert shown == pytest.approx(asked, abs=1e-9)
    rack.run("document.getElementById('reset').click()")
    rack.clean()


def test_on_a_telephone_the_worst_tile_stays_in_view(rack: Page) -> None:
    size = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    rack.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        rack.wait("await pause(400)")
        rack.run("document.querySelector('[data-slider=\"skin.effective_htc\"]').scrollIntoView({ block: 'end' })")
        rack.wait("await pause(200)")
        _, left, top, right, bottom = rack.run(TILES)[0]
        assert (left >= 0, right <= 390, top >= 0, bottom <= 844) == (True, True, True, True)
        assert right - left > 300
        slider = rack.run("const r = document.getElementById('s-skin.effective_htc').getBoundingClientRect(); return [r.top, r.bottom]")
        assert bottom <= slider[0] < slider[1] <= 844
    finally:
        rack.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_no_digit_unit_or_error_is_cut_in_the_table_of_values(rack: Page) -> None:
    """Of values, errors and units as long as they come; a name as deep as those of a full model keeps its end, and its row 26 px."""
    longest = """
    const row = document.querySelector('[data-slider="skin.effective_htc"]'), put = (s, t) => { row.querySelector(s).textContent = t; };
    const cells = ['bdi', '.unit', '.error-of'], old = cells.map((s) => row.querySelector(s).textContent);
    const number = row.querySelector('.number'), was = number.value, label = row.querySelector('label'), told = label.title, cut = [];
    put('bdi', 'electronics_box.processor_board.power_supply_to_frame.contact_conductance');
    put('.unit', 'W/(m² K)'); put('.error-of', '± 1.2e-05');
    const inside = (e) => e.scrollWidth <= e.clientWidth;
    for (const text of ['-0.0012345', '1.2345e-7', '123450']) { number.value = text; if (!inside(number)) cut.push(text); }
    for (const s of ['.unit', '.error-of']) if (!inside(row.querySelector(s))) cut.push(s);
    const name = label.getBoundingClientRect(), end = row.querySelector('bdi').getBoundingClientRect();
    const found = [cut, row.getBoundingClientRect().height, end.right <= name.right + 1, name.width];
    cells.forEach((s, k) => put(s, old[k])); number.value = was; return [...found, told];"""
    cut, high, kept, wide, told = rack.run(longest)
    assert (cut, kept) == ([], True)
    assert high <= 26
    assert wide >= 100
    assert told.startswith("skin.effective_htc: ")


MOVING = """
const named = (e) => `${e.tagName} ${e.id || e.className}`, style = (e) => getComputedStyle(e);
const moves = (e) => ['transitionDuration', 'animationDuration'].some((k) => style(e)[k].split(', ').some((t) => parseFloat(t) > 0) && (k[0] === 't' || style(e).animationName !== 'none'));
if (!matchMedia('(prefers-reduced-motion: reduce)').matches) return ['motion is not reduced'];
return [...document.getAnimations().map(() => 'an animation'), ...[...document.querySelectorAll('*')].filter((e) => moves(e) || style(e).scrollBehavior === 'smooth').map(named)];
"""  # noqa: E501


def test_names_on_the_map_and_of_powers_can_be_read(rack: Page) -> None:
    """Seen by a first user: twelve masses were drawn with letters of five pixels, and of two powers one was named."""
    sizes = "[...document.querySelectorAll('#picture text')].map((t) => t.getScreenCTM().a * parseFloat(getComputedStyle(t).fontSize))"
    assert min(rack.run(f"return {sizes}")) >= 9.0
    keys = "document.querySelector('[data-track] figcaption')"
    assert rack.run(f"return {keys}.scrollHeight - {keys}.clientHeight") <= 1


@pytest.mark.parametrize(("width", "height"), [(320, 700), (800, 500)])
def test_a_narrow_window_and_twice_the_size_need_no_sideways_scrolling(rack: Page, width: int, height: int) -> None:
    """800 x 500 is a screen of 1600 x 1000 at 200 %; every view, in the light and the dark, without motion."""
    size = {"width": width, "height": height, "deviceScaleFactor": 2, "mobile": False}
    rack.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    still = {"reduced_motion": "reduce"}

    def look(name: str) -> None:
        rack.emulate(**still)
        rack.wait("await pause(300)")
        assert rack.run(MOVING) == [], name
        wide = rack.run("return document.documentElement.scrollWidth")
        assert wide <= width, name
        assert [rack.serious(dark, **still) for dark in (False, True)] == [[], []], name

    try:
        for view in ("correlate", "scenarios", "watch"):
            rack.click(f"[data-view={view}]")
            look(view)
        for path in ("build", "start"):
            rack.driver.get(f"{rack.address.partition('?')[0]}{path}")
            rack.until("document.querySelector('[data-ready], [data-node]')", 15)
            look(path)
    finally:
        rack.driver.get(rack.address.partition("?")[0])
        rack.until("window.studio && studio.ready")
        rack.emulate()
        rack.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


SET = "const i = document.getElementById(arguments[0]); i.value = arguments[1]; i.dispatchEvent(new Event('change'))"
FASTER = float(os.environ.get("THERMID_REPLAY", "720"))
"""How many times faster a log is replayed; sixty takes nine minutes a log, and every look is then compared, otherwise eight of them."""
STEP = 10.0
"""Time between two lines of the log. [s]"""
TRUE_SPEED = 20
"""One look in so many is at true speed: the next line comes as late as it does from a logger."""


def replay(lines: list[str], file: Path) -> None:
    """Write a log as a logger would, faster but for one line in as many as come in so many looks of a second."""
    slow, due = round(TRUE_SPEED * FASTER / STEP), time.monotonic()
    with file.open("a", encoding="utf-8") as out:
        for k, line in enumerate(lines, 1):
            due += STEP if k % slow == 0 else STEP / FASTER
            time.sleep(max(0.0, due - time.monotonic()))
            out.write(line)
            out.flush()


@pytest.mark.parametrize("fault", [False, True])
def test_a_log_of_six_hours_is_watched_as_the_command_watches_it(tmp_path: Path, fault: bool) -> None:
    """Forecast, stop or the planted fault, and at every look what `thermid watch --json` says of the same readings."""
    needed()
    (tmp_path / "rig.toml").write_text(DECK, encoding="utf-8")
    courses = warm(6 * 3600.0)
    if fault:
        courses["case"][720:] = 273.15  # the sensor falls off after two hours
    whole = write(tmp_path / "whole.txt", courses, 3).read_text(encoding="utf-8").splitlines(keepends=True)
    file = tmp_path / "run.csv"
    file.write_text("".join(whole[:20]), encoding="utf-8")
    with studio(str(tmp_path / "rig.toml"), "--log", str(file)) as address, page(address) as shown:
        shown.run(SET, "watch-boundaries", "air=22")
        writer = threading.Thread(target=replay, args=(whole[20:], file))
        writer.start()
        looks: dict[float, dict[str, Any]] = {}
        while writer.is_alive():
            time.sleep(0.2)
            look = shown.run("return studio.look")
            if look and look.get("model"):
                looks[look["at_s"]] = look
        shown.until("studio.look.at_s === 21600")
        last = shown.run("return studio.look")
        looks[last["at_s"]] = last
        alarm = shown.run("return [...document.querySelectorAll('[data-alarm]')].map((e) => e.textContent)")
        advice = shown.run("return document.getElementById('bench-watch').dataset.advice")
        if not fault:  # by the readings alone, of a unit whose slowest part is known, the forecast is a fan
            for where, value in (("watch-boundaries", ""), ("slowest", "1")):
                shown.run(SET, where, value)
            shown.until("document.querySelectorAll('[data-fan]').length === 2")
        shown.clean()
    times = sorted(looks)
    slow = len(whole[20:]) // round(TRUE_SPEED * FASTER / STEP)
    print(f"{len(times)} looks over {(times[-1] - times[0]) / 3600.0:.1f} h of the log, {FASTER:g} times faster, {slow} at true speed")
    assert slow >= 1
    for at in times if FASTER <= 60.0 else times[:: max(len(times) // 8, 1)]:
        prefix = [*whole[:2], *(line for line in whole[2:] if float(line.split(",")[0]) <= at)]
        part = tmp_path / "part.csv"
        part.write_text("".join(prefix), encoding="utf-8")
        told = printed(str(part), "--model", str(tmp_path / "rig.toml"), "--boundary", "air=22 [degC]")
        seen = {k: v for k, v in looks[at].items() if k not in ("unused", "model", "like", "bound")}
        assert json.loads(json.dumps(seen)) == told, at
    if fault:
        assert "ALARM sensor: case" in "".join(alarm)
        assert advice == "declined"
    else:
        assert advice == last["advice"] == "stop"
        assert alarm == []
        assert np.isfinite(last["ends"]["chip"]["final_C"])


def type_into(shown: Page, place: str, text: str) -> None:
    """Type as a browser does it: what is typed is seen before the field is left."""
    script = "const i = document.querySelector(arguments[0]); i.value = arguments[1]; "
    for event in ("input", "change"):
        shown.run(f"{script}i.dispatchEvent(new Event('{event}', {{ bubbles: true }}))", place, text)


def test_columns_without_names_and_units_are_bound_on_the_page(tmp_path: Path) -> None:
    """A logger's A0, A1 and Q1: what each is, its unit and the power at 100 % are said in the table, by keys as by the mouse."""
    needed()
    (tmp_path / "rig.toml").write_text(DECK, encoding="utf-8")
    log = unnamed(tmp_path / "run.csv", 2700.0)
    with studio(str(tmp_path / "rig.toml"), "--log", str(log)) as address, page(address) as shown:
        shown.until("document.querySelector('#watch-columns')")
        assert "Say in the table of columns what each is." in shown.text("#bench-verdict")
        assert "a load needs its power at 100 %" in shown.text("#watch-columns")
        type_into(shown, "[aria-label='Unit of A0']", "degF")
        type_into(shown, "[aria-label='A0 is']", "node:chip")
        shown.until("document.querySelector('[data-channel-tile=A0]')")
        assert shown.run("return document.getElementById('watch-columns').open")  # there is more to say
        type_into(shown, "[aria-label='A1 is']", "node:case")
        type_into(shown, "[aria-label='Q1 is']", "load:heater")
        type_into(shown, "[data-full=Q1]", "24")
        type_into(shown, "#watch-boundaries", "air=22")
        shown.until("studio.look && studio.look.model === 'rig' && studio.look.bound.Q1 && studio.look.bound.Q1.full_scale")
        look = shown.run("return studio.look")
        assert look["bound"] == {
            "A0": {"node": "chip", "unit": "degF"},
            "A1": {"node": "case"},
            "Q1": {"load": "heater", "full_scale": "24 [W]"},
        }
        assert look["advice"] == "stop"
        assert shown.run("return document.querySelectorAll('#hidden tbody tr').length") == 1
        assert shown.serious(False) == []
        for width in shown.widths():
            assert shown.run("return document.documentElement.scrollWidth") <= width
        shown.driver.get_screenshot_as_file(str(tmp_path / "columns.png"))
        shown.clean()
