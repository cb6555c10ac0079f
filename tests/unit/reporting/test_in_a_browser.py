"""Pages in a real browser: nothing wider than screen or sheet, figures that answer, keyboard, dark, accessibility, hostile names."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from studio.browser import CHROMIUM, DRIVER, Page
from thermid.campaign.stages import Campaign
from thermid.reporting._blocks.content import AUDIENCES, Formulas, Section
from thermid.reporting._pages.campaign import report
from webpage import SMALLEST, filled

EVIL = "\"><script>window.caught=1</script><img src=x onerror='window.caught=2'> ' & </style></svg> {{ 7*7 }} "
NAMES = (EVIL, "W" * 180, "مستشعر درجة الحرارة", "\u202egnp.exe", "温度センサー", "a.very.long.path" * 9)
AXE = """const [rules, done] = arguments, asked = rules.length ? { runOnly: rules } : {};
const told = (r) => r.violations.map((v) => [v.impact, v.id, v.nodes.map((n) => n.html.slice(0, 160))]);
axe.run(document, { resultTypes: ["violations"], ...asked }).then((r) => done(told(r)));"""
WIDER = """const wide = document.documentElement.clientWidth;
const beyond = (e) => e.getBoundingClientRect().right > wide + 1 && !e.closest(".scroll,.diagram,.formulas,pre,svg,.vh");
const found = [...document.querySelectorAll("main *, header *")].filter(beyond).slice(0, 5);
return [document.documentElement.scrollWidth - wide, found.map((e) => e.outerHTML.slice(0, 120))]"""


TOGETHER = """
const out = [], number = (t) => Number(t.split(' ')[0].replace('\u2212', '-'));
const press = (box, key, n = 1) => { while (n--) box.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true })); };
const read = (box) => {
  const rows = new Map([...box.querySelectorAll('.read > span')].map((r) => [r.children[0].textContent, r.children[1].textContent]));
  const names = ['measured', 'simulated', 'measured less simulated'];
  if (rows.has(names[2])) out.push(names.map((n) => number(rows.get(n))));
};
for (const box of [...document.querySelectorAll('.chart.live')].filter((b) => b.querySelector('[data-less]')).slice(0, 6)) {
  for (const key of ['0', '+']) {
    press(box, key); press(box, 'Home');
    for (let k = 0; k < 30; k++) { press(box, 'ArrowRight', 3); read(box); }
  }
  press(box, '0');
}
return out;"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Page]:
    pytest.importorskip("selenium", reason="selenium is not installed (extra test)")
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no Chromium with its driver (Debian: chromium, chromium-driver)")
    made = Page("file:")
    yield made
    made.close()


@pytest.fixture(scope="module")
def address(campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> str:
    bench = td.Scenario("hot bench", boundaries={"room": "45 [degC]"}, start="24 [degC]", duration="5 [h]")
    run = td.simulate(campaign["submodel"].model, bench)
    return report(campaign, to=tmp_path_factory.mktemp("shown") / "page.html", scenarios=[("Hot", run)]).as_uri()


@pytest.fixture(scope="module")
def hostile(campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The campaign with every name that a stranger may choose turned into an attack, each of another kind."""

    def soiled(fit: td.Calibration, k: int) -> td.Calibration:
        blocks = tuple(
            replace(b, sensor=NAMES[(k + n) % 6], record=NAMES[(k + n + 1) % 6], node=NAMES[(k + n + 2) % 6])
            for n, b in enumerate(fit.blocks)
        )
        model = replace(fit.given_model, title=NAMES[k % 6], use=NAMES[(k + 1) % 6])
        return replace(fit, stage=NAMES[k % 6], given_model=model, blocks=blocks, warnings=NAMES)

    fits = [soiled(c, k) for k, c in enumerate(campaign.stages.values())]
    verdicts = tuple(
        replace(v, model=NAMES[1], record=EVIL, title=NAMES[2], fitted_locally=NAMES, prediction=soiled(v.prediction, 3))
        for v in campaign.verdicts
    )
    made = Campaign(EVIL + NAMES[1], {c.stage: c for c in fits}, verdicts, {c.stage: EVIL for c in fits}, EVIL)
    return report(made, to=tmp_path_factory.mktemp("evil") / "page.html", notes=NAMES).as_uri()


def open_at(browser: Page, address: str, width: int, *, dark: bool = False, paper: bool = False) -> None:
    features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print" if paper else "screen", "features": features})
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.driver.get(address)
    browser.listen()


def test_nothing_is_wider_than_the_screen_or_the_sheet(browser: Page, address: str, hostile: str) -> None:
    for where in (address, hostile):
        for width in (1600, 1024, 390):
            open_at(browser, where, width)
            assert browser.run(WIDER) == [0, []], width
    open_at(browser, address, 688, paper=True)  # A4 less its margins
    beyond = "return [...document.querySelectorAll('table, svg, pre')].filter((e) => e.getBoundingClientRect().right > 690).length"
    assert browser.run(beyond) == 0


def test_what_was_fitted_is_shown_whole_with_its_units(browser: Page, address: str) -> None:
    """Beside the remarks where both have room, above them where not: it was cut inside its last column, the unit."""
    cut = "return [...document.querySelectorAll('.glance .scroll')].map((e) => e.scrollWidth - e.clientWidth)"
    for width in (1600, 1300, 1200, 1100, 900):
        open_at(browser, address, width)
        assert browser.run(cut) == [0], width


def test_hostile_names_run_nothing_and_the_console_is_silent(browser: Page, hostile: str) -> None:
    browser.said.clear()
    browser.asked.clear()
    open_at(browser, hostile, 1600)
    browser.run("for (const e of document.querySelectorAll('.legend button')) { e.click(); e.click(); }")
    browser.run(
        "for (const e of document.querySelectorAll('.chart')) { e.focus(); e.dispatchEvent(new KeyboardEvent('keydown', { key: 'End' })); }"
    )
    browser.listen()
    assert browser.run("return window.caught") is None
    assert browser.run("return document.querySelectorAll('script, img, iframe, object').length") == 1
    assert browser.said == []
    assert {url.split(":")[0] for url in browser.asked} <= {"file", "data", "chrome"}  # the last is the browser's own first page


def test_axe_finds_nothing(browser: Page, address: str) -> None:
    """Every rule in the light, contrast again in the dark."""
    pytest.importorskip("selenium_axe_python", reason="selenium-axe-python is not installed (extra test)")
    axe = files("selenium_axe_python").joinpath("axe-core/axe.min.js").read_text(encoding="utf-8")
    for dark, rules in ((False, []), (True, ["color-contrast"])):
        open_at(browser, address, 1280, dark=dark)
        browser.run("for (const d of document.querySelectorAll('main details')) d.open = true")
        browser.run(axe)
        assert browser.driver.execute_async_script(AXE, rules) == []


def test_headings_are_in_order_and_every_figure_and_table_has_words(browser: Page, address: str) -> None:
    open_at(browser, address, 1280)
    levels = browser.run("return [...document.querySelectorAll('h1,h2,h3,h4')].map((h) => Number(h.tagName[1]))")
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in pairwise(levels))
    assert (
        browser.run(
            "return [...document.querySelectorAll('table')].filter((t) => !t.caption || t.caption.textContent.trim().length < 3).length"
        )
        == 0
    )
    assert (
        browser.run(
            "return [...document.querySelectorAll('svg.plot')].filter((s) => (s.getAttribute('aria-label') || '').length < 40).length"
        )
        == 0
    )


def test_a_figure_answers_to_keys_and_its_values_are_those_of_the_data(browser: Page, address: str, campaign: Campaign) -> None:
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    open_at(browser, address, 1280)
    verdict = campaign.verdicts[0].prediction.blocks[0]
    browser.run("document.querySelector('#verdicts .chart').focus()")

    def press(*keys: str) -> str:
        for key in keys:
            ActionChains(browser.driver, duration=0).send_keys(key).perform()
        return browser.text("#verdicts .chart .read")

    def row(name: str) -> float:
        cells = "[...document.querySelectorAll('#verdicts .read span:first-child')]"
        rows = browser.run(f"return {cells}.map((e) => [e.textContent, e.nextSibling?.textContent])")
        return float(dict(rows)[name].split()[0].replace("\u2212", "-"))

    assert "60.00 min" in press(Keys.ARROW_LEFT, Keys.ARROW_RIGHT)
    k = int(abs(verdict.times - 3600.0).argmin())
    assert row("measured") == pytest.approx(verdict.measured[k] - 273.15, abs=0.02)
    assert row("simulated") == pytest.approx(verdict.predicted[k] - 273.15, abs=0.02)
    assert row("measured less simulated") == pytest.approx(verdict.residuals[k], abs=0.003)
    view = "return document.querySelector('#verdicts .view').getAttribute('transform')"
    whole = browser.run(view)
    press("+")
    zoomed = browser.run(view)
    assert zoomed != whole
    assert row("measured") == pytest.approx(verdict.measured[k] - 273.15, abs=0.02)
    press("0")
    assert browser.run(view) == whole
    browser.run("document.querySelector('#verdicts .legend button').click()")
    assert "measured less simulated" in press(Keys.HOME)
    assert (
        browser.run("return [...document.querySelectorAll('#verdicts .read span:first-child')].some((e) => e.textContent === 'measured')")
        is False
    )


def test_numbers_shown_together_agree(browser: Page, address: str) -> None:
    """At sixty places of every figure with a difference, whole and zoomed: it is that of the two numbers above it."""
    open_at(browser, address, 1280)
    browser.run("for (const d of document.querySelectorAll('main details')) d.open = true")
    shown = browser.run(TOGETHER)
    assert len(shown) >= 120
    assert max(abs(a - b - d) for a, b, d in shown) < 1e-9
    assert any(abs(d) > 0.01 for *_, d in shown)


def test_light_and_dark_change_and_are_kept_nowhere(browser: Page, address: str) -> None:
    open_at(browser, address, 1280)
    paper = "return getComputedStyle(document.body).backgroundColor"
    assert browser.run(paper) == "rgb(255, 255, 255)"
    browser.click("#theme")
    assert browser.run(paper) == "rgb(20, 24, 30)"
    assert browser.run("return document.cookie") == ""
    browser.driver.refresh()
    assert browser.run(paper) == "rgb(255, 255, 255)"


def test_the_contents_stay_in_reach(browser: Page, address: str) -> None:
    for width, shown in ((1600, ".side"), (390, ".menu summary")):
        open_at(browser, address, width)
        browser.run("document.documentElement.style.scrollBehavior = 'auto'; document.getElementById('provenance').scrollIntoView()")
        top, bottom = browser.run(f"const r = document.querySelector('{shown}').getBoundingClientRect(); return [r.top, r.bottom]")
        assert -1 <= top < bottom <= 901
    browser.click(".menu summary")
    browser.click(".menu a[href='#levels']")
    assert browser.run("return document.querySelector('.menu').open") is False


def test_without_script_the_page_stands_as_it_is(browser: Page, address: str) -> None:
    browser.driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        open_at(browser, address, 1280)
    finally:
        browser.driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
    assert browser.run("return document.querySelectorAll('.chart, .legend button').length") == 0
    assert browser.run("return document.getElementById('theme').hidden") is True
    assert browser.run("return document.querySelectorAll('svg.plot .line').length") > 10


def test_a_page_becomes_a_pdf(address: str, tmp_path: Path) -> None:
    from thermid.reporting._blocks.content import page_to_pdf

    if CHROMIUM is None:
        pytest.skip("no Chromium to print with")
    made = page_to_pdf(address.removeprefix("file://"), tmp_path / "new" / "page.pdf")
    data = made.read_bytes()
    assert data.startswith(b"%PDF-")
    assert int(max(re.findall(rb"/Count (\d+)", data), key=int)) > 3


@pytest.fixture(scope="module")
def readers(campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("readers")
    return {a: report(campaign, to=folder / f"{a}.html", audience=a) for a in AUDIENCES}


@pytest.mark.parametrize("audience", AUDIENCES)
def test_nothing_on_paper_is_smaller_than_six_and_a_half_points(browser: Page, readers: dict[str, Path], audience: str) -> None:
    open_at(browser, readers[audience].as_uri(), 688, paper=True)
    assert [text for text in browser.run(SMALLEST) if text[1] < 6.5] == []


@pytest.mark.parametrize("audience", AUDIENCES)
def test_answer_figure_and_network_stand_on_the_first_screen_and_sheet(browser: Page, readers: dict[str, Path], audience: str) -> None:
    open_at(browser, readers[audience].as_uri(), 1600)
    top = "return document.querySelector('#fig-decides svg').getBoundingClientRect().top"
    assert browser.run(top) <= 700
    open_at(browser, readers[audience].as_uri(), 688, paper=True)
    ends = browser.run(
        "return ['.sum', '#fig-decides', '#fig-network'].map((s) => document.querySelector(s).getBoundingClientRect().bottom)"
    )
    assert max(ends) <= (297 - 34) / 25.4 * 96


CUT = """
document.querySelectorAll('details').forEach((e) => { e.open = true; });
return [...document.querySelectorAll('.scroll:has(table)')].filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.ariaLabel);"""


@pytest.mark.parametrize("audience", AUDIENCES)
def test_no_table_is_cut_on_a_laptop(browser: Page, readers: dict[str, Path], audience: str) -> None:
    """Seen by a reader: the tables of parameters and of sensors lost their last columns at 1300 px."""
    open_at(browser, readers[audience].as_uri(), 1300)
    assert browser.run(CUT) == []


@pytest.mark.parametrize(("audience", "most"), [("summary", 2), ("agency", 15), ("all", 30)])
def test_each_reader_gets_a_pdf_of_the_promised_length(readers: dict[str, Path], tmp_path: Path, audience: str, most: int) -> None:
    from thermid.reporting._blocks.content import page_to_pdf

    if CHROMIUM is None:
        pytest.skip("no Chromium to print with")
    made = page_to_pdf(readers[audience], tmp_path / "page.pdf")
    assert 1 <= len(re.findall(rb"/Type /Page\b(?!s)", made.read_bytes())) <= most
    shares = filled(made)
    assert [round(share, 2) for share in shares[:-1] if share < 0.25] == []


def test_formulas_look_the_same_where_no_font_for_them_is_installed(browser: Page, tmp_path: Path) -> None:
    lines = ("<math><msub><mi>T</mi><mi>a</mi></msub><mo>=</mo><mfrac><mn>1</mn><mi>R</mi></mfrac></math>", "(1)")
    section = Section.of_blocks("formulas", "Formulas", [Formulas((lines,))])
    study = td.design.load_study(Path(__file__).parents[3] / "examples" / "sisnav" / "study.toml")
    page = td.reporting.study_report(study, Campaign("none", {}, (), {}), to=tmp_path / "page.html", sections=[section])
    open_at(browser, page.as_uri(), 1280)
    browser.driver.execute_async_script("document.fonts.ready.then(arguments[0])")
    family = "return getComputedStyle(document.querySelector('math')).fontFamily.startsWith('\"Thermid Mathematics\"')"
    assert browser.run(family)
    assert browser.run("return [...document.fonts].map((f) => f.status)") == ["loaded"]
    base, low = browser.run(
        "return ['mi', 'msub > :last-child'].map((s) => document.querySelector(`math ${s}`).getBoundingClientRect().bottom)"
    )
    assert low > base
    assert browser.run("return document.querySelector('mo').getBoundingClientRect().width") > 3
    text = report(Campaign("none", {}, (), {}), to=tmp_path / "plain.html").read_text(encoding="utf-8")
    assert "@font-face" not in text  # a page without formulas carries no font


def test_without_a_browser_the_print_says_what_to_do(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from thermid.reporting._blocks import content as extras

    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(extras, "PLACES", ())
    with raises_code("extra.no-browser", extras.NoBrowserError):
        extras.page_to_pdf(address.removeprefix("file://"), tmp_path / "page.pdf")


def test_a_browser_that_prints_nothing_is_told(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from thermid.reporting._blocks import content as extras

    broken = tmp_path / "chromium"
    broken.write_text("#!/bin/sh\necho out of order >&2\n", encoding="utf-8")
    broken.chmod(0o755)
    monkeypatch.setattr(extras, "browser", lambda: str(broken))
    with raises_code("extra.no-browser", extras.NoBrowserError, match="'chromium'.*PDF.*'page.html'"):
        extras.page_to_pdf(address.removeprefix("file://"), tmp_path / "page.pdf")
    broken.write_text("#!/bin/sh\nsleep 5\n", encoding="utf-8")
    with raises_code("extra.no-browser", extras.NoBrowserError, match=r"'page.html'.*0\.2"):
        extras.page_to_pdf(address.removeprefix("file://"), tmp_path / "page.pdf", seconds=0.2)
