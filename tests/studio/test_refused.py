"""What Build does with what it cannot take: it says why, at the place where it was typed, and goes on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from two_masses import BOX, write_log

from .browser import Page, needed, studio
from .test_build import Person

pytestmark = pytest.mark.campaign


@pytest.fixture
def person(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Person]:
    """A person in Build on the box of two masses with a log in its folder."""
    needed()
    (tmp_path / "logs").mkdir()
    write_log(tmp_path / "logs" / "run.csv")
    deck = tmp_path / "box.toml"
    deck.write_text(BOX, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with studio(str(deck)) as address:
        page = Page(address).open()
        try:
            page.driver.get(f"{address.partition('?')[0]}build")
            page.until("document.querySelector('[data-node=case]') && window.studio.ready")
            yield Person(page)
        finally:
            page.close()


def test_a_run_and_a_fit_that_are_refused_leave_the_page_ready(person: Person) -> None:
    """Area and conductance of one joint cannot both be found; Stop stayed and Run was grey until the page was loaded anew."""
    page = person.page
    person.choose("#log-known", "logs/run.csv")
    page.until("document.querySelector('#columns')")
    person.click("[data-path='joint.contact_conductance']", "[data-path='joint.area']", "#fit")
    page.until("document.getElementById('error').textContent.includes('joint')")
    page.wait("await pause(400)")
    assert page.run("return document.getElementById('run').disabled") is False
    assert "Stop" not in page.text(".tabs")
    person.click("[data-path='joint.area']", "#fit")
    page.until("document.querySelector('#fitted')", 15)


@pytest.mark.parametrize("wrong", ["1e-12", "500 [W]", "0,8"])
def test_a_value_that_is_refused_is_marked_until_it_is_mended(person: Person, wrong: str) -> None:
    """It stood in the sheet as if it were in force, once anything else was done."""
    page, field = person.page, "#field-capacitance"
    person.click("[data-node=board] rect")
    person.fill(field, wrong)
    person.click("#run")
    page.until("document.querySelector('.results[data-what=run]')", 30)
    person.click("[data-pane=log]")
    assert page.run("return document.getElementById('error').hidden")  # the message above is gone, that at the field stays
    assert page.run(f"const e = document.querySelector('{field}'); return [e.value, e.getAttribute('aria-invalid')]") == [wrong, "true"]
    assert page.text(f"{field}-why").endswith("In force: 120 J/K.")
    assert page.serious(False) == []
    person.fill(field, "130")
    assert page.run(f"const e = document.querySelector('{field}'); return [e.value, e.getAttribute('aria-invalid')]") == ["130", None]
    person.fill(field, wrong)
    person.click("[data-node=case] rect")  # and what was refused there is no value of another node
    assert page.run(f"const e = document.querySelector('{field}'); return [e.value, e.getAttribute('aria-invalid')]") == ["450", None]


def test_names_boundaries_and_units_that_are_refused_are_marked(person: Person) -> None:
    page = person.page
    person.choose("#log-known", "logs/run.csv")
    page.until("document.querySelector('#columns')")
    person.choose("[aria-label='room C is']", "")
    for field, wrong, now in (
        ("[data-held=room]", "warm", ""),
        ("[aria-label='Unit of case C']", "blorb", "degC"),
        ("[data-error='noise case C']", "-1", "0.049"),
    ):
        person.fill(field, wrong)
        shown = page.run("const e = document.querySelector(arguments[0]); return [e.value, e.getAttribute('aria-invalid')]", field)
        assert shown == [wrong, "true"]
        why = page.run("return document.querySelector(arguments[0]).closest('td, label').querySelector('.why').textContent", field)
        assert now.replace("degC", "°C") in why
        person.fill(field, now or "23")
        assert page.run("return document.querySelector(arguments[0]).getAttribute('aria-invalid')", field) is None
    person.click("[data-node=board] rect")
    person.fill("#sheet-name", "case")
    assert page.run("return document.querySelector('#sheet-name').getAttribute('aria-invalid')") == "true"
    assert "board" in page.run("return document.querySelector('#sheet-name').parentElement.textContent")


def test_the_focus_goes_on_after_a_name(person: Person) -> None:
    """M, a name, Tab, a value, Enter: the sheet was built anew and the value typed into nothing."""
    from selenium.webdriver.common.keys import Keys

    page = person.page
    person.click(".canvas > svg")
    person.press("m")
    person.press("lid", Keys.TAB)
    page.until("document.querySelector('[data-node=lid]')")
    person.press("250", Keys.ENTER)
    assert page.run("return document.querySelector('#field-capacitance').value") == "250"
    assert person.at("#field-capacitance")
    person.fill("#sheet-name", "cover")
    assert person.at("#sheet-name")


def test_what_if_marks_the_field_that_is_refused(person: Person) -> None:
    """Letters for a factor were no answer of the server at all; of a wrong ambient the field said nothing."""
    page = person.page
    person.click("[data-pane=if]")
    page.until("document.querySelector('#if-run')", 15)
    marked = (
        "return [...document.querySelectorAll('.whatif [aria-invalid=true]')].map((e) => e.dataset.boundary || e.dataset.factor || e.id)"
    )
    for field, name, wrong, right in (
        ("[data-boundary=room]", "room", "warm", "35"),
        ("[data-factor=heater]", "heater", "1,5", "1.5"),
        ("#if-duration", "if-duration", "0", "6"),
        ("#if-start", "if-start", "hot", "30"),
    ):
        person.fill(field, wrong)
        page.until("document.querySelector('.whatif .why')", 15)
        assert page.run(marked) == [name]
        person.fill(field, right)
        page.until("document.querySelector('#changes')", 30)
        assert page.run(marked) == []
    said = page.run("return [...document.querySelectorAll('#changes li')].map((e) => e.textContent)")
    assert len(said) == 4
    assert page.serious(False) == []
