"""One table of codes: what the source uses is in it, what is in it is used, and texts without a code get fewer."""

from __future__ import annotations

import ast
import re
import runpy

import pytest

from thermid.base.code_table import CODES, SUBJECTS

from .codes import PASSED_ON, Place, constants, places
from .source import ROOT, Module

MOST_CODES = 300
"""Codes are by cause, not by place: so many at most for all of thermid."""
WITHOUT_CODE = 13
"""Places that make an error, a warning or a finding without a code; may only shrink, so write the new number here when it did."""


@pytest.fixture(scope="module")
def every_place(modules: dict[str, Module]) -> list[Place]:
    return places(modules)


def test_the_source_uses_the_codes_of_the_table_and_no_other(modules: dict[str, Module], every_place: list[Place]) -> None:
    used = {place.code for place in every_place} - {"", PASSED_ON} | constants(modules)
    assert not used - CODES.keys(), "not in CODES of thermid.base.code_table"
    assert not CODES.keys() - used, "in CODES of thermid.base.code_table, and nothing uses it"


def test_codes_have_one_form_and_each_stands_once(modules: dict[str, Module]) -> None:
    assert len(CODES) <= MOST_CODES
    assert list(CODES) == sorted(CODES)
    assert {code.partition(".")[0] for code in CODES} == set(SUBJECTS)
    assert [code for code in CODES if not re.fullmatch(r"[a-z]+\.[a-z]+(-[a-z]+)*", code)] == []
    written = next(
        n.value for n in modules["thermid.base.code_table"].nodes if isinstance(n, ast.AnnAssign) and getattr(n.target, "id", "") == "CODES"
    )
    assert isinstance(written, ast.Dict)
    assert len(written.keys) == len(CODES), "a code stands twice in the table"


def test_the_table_says_what_kind_of_text_has_a_code(every_place: list[Place]) -> None:
    known = [place for place in every_place if place.code in CODES and place.kind in ("error", "warning")]
    assert [place for place in known if place.kind not in CODES[place.code].kind] == []
    assert {word for code in CODES.values() for word in code.kind.split(", ")} == {"error", "warning", "remark"}


def test_texts_without_a_code_get_fewer(every_place: list[Place]) -> None:
    without = [place for place in every_place if not place.code]
    assert len(without) <= WITHOUT_CODE, "give a new message a code: docs/recipes.md, 'A message'"
    assert len(without) > WITHOUT_CODE - 25, f"write the new number, {len(without)}, into this file"


def test_the_page_is_current() -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "write_codes.py"))
    assert script["PAGE"].read_text(encoding="utf-8") == script["page"](), "run: python scripts/write_codes.py"


PLANTED = """
class LostError(RecordError):
    code = "record.log-missing"

raise DeckError("a text")
raise DeckError("a text", "a place", code="unit.unknown")
raise LostError("a text")
raise SolverError(error.message, "a place")
raise RecordError(f"in other words: {error.message}")
warnings.warn("a text", ThermidWarning, stacklevel=2)
warnings.warn(ThermidWarning("a text", code="fit.takes-long"))
Finding("note", "a place", "a text", "model.unused")
out.append(CodedText("a text", "run.start-held"))
"""


def test_planted_places_are_seen() -> None:
    errors = Module("thermid.base.errors", "".join(f"class {n}Error(ThermidError): ...\n" for n in ("Deck", "Record", "Solver")))
    seen = places({"thermid.base.errors": errors, "thermid.model.one": Module("thermid.model.one", PLANTED)})
    assert [(place.line, place.kind, place.code) for place in seen] == [
        (5, "error", ""),
        (6, "error", "unit.unknown"),
        (7, "error", "record.log-missing"),
        (8, "error", PASSED_ON),
        (9, "error", ""),
        (10, "warning", ""),
        (11, "warning", "fit.takes-long"),
        (12, "remark", "model.unused"),
        (13, "remark", "run.start-held"),
    ]


def test_the_page_of_statistics_has_the_numbers_of_the_table() -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "write_numbers.py"))
    assert script["PAGE"].read_text(encoding="utf-8") == script["page"](), "run: python scripts/write_numbers.py"
