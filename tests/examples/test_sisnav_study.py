"""The whole study, worked through once: what it must show, and the written study, whose numbers are the program's."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import thermid as td
from docs.pages import NUMBER, near
from studio.browser import CHROMIUM, DRIVER, Page
from thermid.app.cli.summary import show_campaign
from webpage import SMALLEST, crossings, faults, filled, limited, without_script

pytestmark = [pytest.mark.campaign, pytest.mark.document]
ROOT = Path(__file__).parents[2]
STUDY = ROOT / "examples" / "sisnav"
WRITTEN = ROOT / "docs" / "studies"
MODULES = ("work", "findings", "drawings", "page", "write_study", "structures", "laboratory", "warm_up")


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """The study's own modules, which stand beside its decks."""
    before = {name: sys.modules.pop(name) for name in MODULES if name in sys.modules}
    sys.path.insert(0, str(STUDY))
    try:
        yield {name: import_module(name) for name in MODULES}
    finally:
        sys.path.remove(str(STUDY))
        for name in MODULES:
            sys.modules.pop(name, None)
        sys.modules.update(before)


@pytest.fixture(scope="module")
def done(modules: dict[str, ModuleType], tmp_path_factory: pytest.TempPathFactory) -> Any:
    return modules["work"].run(tmp_path_factory.mktemp("study"))


def test_no_fit_reads_what_is_hidden(modules: dict[str, ModuleType], done: Any) -> None:
    """The folder `hidden` is named by the laboratory and by what compares afterwards, by no deck and no campaign."""
    files = [*STUDY.glob("*.toml"), *(done.folder / "natural").glob("*.toml"), STUDY / "structures.py"]
    assert not [f.name for f in files if re.search(r"hidden/|truth\.json", f.read_text(encoding="utf-8"))]


def test_held_out_readings_are_predicted_within_half_a_kelvin(done: Any) -> None:
    """At every DS18B20; the noisy accelerometer channel has its limit on the root mean square."""
    assert len(done.natural.verdicts) == 3
    assert all(v.passed for v in done.natural.verdicts)
    largest = [c.found for v in done.natural.verdicts for c in v.checks if c.criterion == "max_error"]
    assert max(largest) < 0.2


def test_the_document_s_structure_misses_what_follows_a_pause(done: Any) -> None:
    assert {v.record for v in done.constant.verdicts if not v.passed} == {"imu_held_out"}
    assert not any(fit.contradicted for fit in (*done.constant.fits, *done.natural.fits))


def test_hidden_values_lie_within_their_stated_errors(done: Any) -> None:
    """About 95 % within two standard errors; none is far out."""
    found = done.recovered
    assert len(found) > 70
    assert sum(r.inside for r in found) >= 0.92 * len(found)
    assert max(abs(r.found.value - r.truth) / r.found.error for r in found) < 4


def test_hidden_temperatures_lie_in_their_bands(done: Any) -> None:
    """At nine of ten sensors at 95 % of the moments, and nowhere far out: the errors of one unit are constant, so that sensors differ."""
    seen = done.hidden_errors()
    assert max(h.error for h in seen) < 0.2
    assert sum(h.inside >= 0.95 for h in seen) >= 0.9 * len(seen)
    assert np.mean([h.inside for h in seen]) >= 0.9
    assert min(h.inside for h in seen) > 0.7


@pytest.mark.xfail(
    strict=True,
    reason="missed: 100 % of the moments are inside; half-widths are 2 to 7 times the RMS error (before 3 to 20, with the room's and the "
    "meters' accuracy counted beside the values that answer to it). Half to two thirds of the variance is what instruments leave the "
    "values, one draw for all sensors of a unit; a quarter to two fifths is what differs from run to run, which this unit has not",
)
def test_bands_of_hidden_temperatures_are_no_wider_than_they_say(done: Any) -> None:
    """A 95 % band holds 95 % of the moments on average."""
    assert np.mean([h.inside for h in done.hidden_errors()]) <= 0.99


def test_V2_vacuum_with_radiation_holds_the_truth_below_the_printed_bound(modules: dict[str, ModuleType], done: Any) -> None:  # noqa: N802
    """The whole unit: the truth inside, half-width at most a quarter of the rise; the printed run is above both."""
    runs = done.vacuum("m_Sd", modules["page"].SEEN)
    assert all(r.inside and r.half_width <= 0.25 and r.beyond < 0.05 for r in runs)
    assert all(r.printed[-1] > r.high[-1] and r.printed[-1] > r.truth[-1] for r in runs)
    for part in ("FOG_h", "FOG_l", "EleGFO", "ProcSISNAV"):
        (run,) = done.vacuum(part, {part: "case"})
        assert run.inside
        assert run.half_width <= 0.25, part


def test_a_painted_power_supply_is_refused(modules: dict[str, ModuleType]) -> None:
    said = modules["findings"].no_room_for_paint()
    assert re.match(r"[^']*'skin' .* 2\.2 W/\(m\^2 K\) .* 'paint, black'", said)
    assert "the area" in said
    assert "the power" in said


def test_fig_21_network_and_equations_agree(modules: dict[str, ModuleType]) -> None:
    _, worst = modules["drawings"].fig_21()
    assert worst < 1e-7


def test_equations_of_the_page_are_the_printed_ones(modules: dict[str, ModuleType]) -> None:
    """`equations` compares as symbols and raises otherwise; the formulas are MathML."""
    pytest.importorskip("sympy")
    section = modules["page"].equations()
    formulas = [b for b in section.blocks if b.kind == "formulas"]
    assert sum(len(b.lines) for b in formulas) == 6
    assert all(text.startswith("<math") for b in formulas for text, _ in b.lines)


def test_V2_the_page_says_what_it_is(modules: dict[str, ModuleType], done: Any, tmp_path: Path) -> None:  # noqa: N802
    text = modules["page"].main(done, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "DEMONSTRATION: 22 ASSUMED PARAMETERS, SYNTHETIC DATA" in text
    assert text.count("synthetic: virtual laboratory") >= 20
    assert "upper bounds" in text
    without_script(text)
    assert [c for c, figure in limited(text) if crossings(figure) and "NOT met" not in c] == []
    assert faults(text) == []
    print(f"page of the study: {len(text.encode()) / 1e6:.2f} MB")
    assert len(text.encode()) < 1_000_000


@pytest.mark.parametrize(("audience", "most"), [("summary", 2), ("agency", 15), ("all", None)])
def test_the_page_begins_with_its_answer_and_is_as_long_as_promised(
    modules: dict[str, ModuleType], done: Any, tmp_path: Path, audience: str, most: int | None
) -> None:
    """First figure within 700 px at 1600 and on the first sheet; 6.5 pt and more; no sheet but the last under a quarter full."""
    check_sheets(lambda to: modules["page"].main(done, tmp_path / to, audience), most)


def test_the_campaign_of_nine_stages_is_read_on_fifteen_sheets(done: Any, tmp_path: Path) -> None:
    """The same of `thermid report --for agency` on the study's campaign."""
    check_sheets(lambda to: td.report(done.constant, to=tmp_path / to, audience="agency"), 15)


def check_sheets(write: Callable[[str], Path], most: int | None) -> None:
    """Fail where a report's first figure comes late, its letters are small, or its sheets are many or hardly filled."""
    pytest.importorskip("selenium", reason="selenium is not installed (extra test)")
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no Chromium with its driver (Debian: chromium, chromium-driver)")
    made = write("report.html")
    first = "return document.querySelector('figure svg').getBoundingClientRect()"
    with contextlib.closing(Page("file:")) as shown:
        shown.driver.get(made.as_uri())
        assert shown.run(first)["top"] <= 700
        shown.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        size = {"width": 688, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        shown.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        shown.driver.get(made.as_uri())
        assert shown.run(first)["bottom"] <= (297 - 34) / 25.4 * 96
        assert [text for text in shown.run(SMALLEST) if text[1] < 6.5] == []
    sheets = filled(write("report.pdf"))
    print(f"{len(sheets)} sheets")
    assert most is None or len(sheets) <= most
    assert [round(share, 2) for share in sheets[:-1] if share < 0.25] == []


def test_the_written_study_has_the_program_s_numbers(modules: dict[str, ModuleType], done: Any) -> None:
    """Word for word, numbers as near as they are printed. Write it again with: python examples/sisnav/write_study.py"""
    shown, found = (WRITTEN / "sisnav.md").read_text(encoding="utf-8"), modules["write_study"].text(done)
    assert NUMBER.sub("#", shown) == NUMBER.sub("#", found)
    apart = [(a, b) for a, b in zip(NUMBER.findall(shown), NUMBER.findall(found), strict=True) if not near(a, float(b))]
    assert apart == []


def test_every_figure_of_the_written_study_is_there(modules: dict[str, ModuleType]) -> None:
    named = re.findall(r"\(figures/([\w.]+)\)", (WRITTEN / "sisnav.md").read_text(encoding="utf-8"))
    assert len(named) >= 9
    assert sorted(set(named)) == sorted(p.name for p in (WRITTEN / "figures").iterdir())
    assert all((WRITTEN / "figures" / n).stat().st_size < 60_000 for n in named)


@pytest.mark.parametrize("columns", [80, 100])
def test_the_study_fits_on_a_screen(done: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    names = [f"{stage}.values.toml" for stage in done.constant]
    show_campaign(done.constant, names)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 45
    assert max(map(len, lines)) <= columns
    assert all(any(line.startswith(f"{stage}: ") for line in lines) for stage in done.constant)
    assert sum(" on " in line and "; " in line for line in lines) == len(done.constant.verdicts)
