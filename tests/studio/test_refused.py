"""What Build does with what it cannot take: it says why, at the place where it was typed, and goes on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from two_masses import write_log

from .browser import Page, needed, studio
from .test_build import Person

pytestmark = pytest.mark.campaign
DECK = """title = "box"
needs = ["room"]

[nodes]
board = { capacitance = "120 [J/K]" }
case = { capacitance = "450 [J/K]" }

[conductors]
joint = { kind = "contact", between = ["board", "case"], contact_conductance = "500 [W/(m^2 K)]", area = "10 [cm^2]" }

[surfaces]
skin = { of = "case", to = "room", area = "600 [cm^2]", effective_htc = "8 [W/(m^2 K)]" }

[loads]
heater = { into = "board", power = "5 [W]" }
"""


@pytest.fixture
def person(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Person]:
    """A person in Build on the box of two masses with a log in its folder."""
    needed()
    (tmp_path / "logs").mkdir()
    write_log(tmp_path / "logs" / "run.csv")
    deck = tmp_path / "box.toml"
    deck.write_text(DECK, encoding="utf-8")
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
