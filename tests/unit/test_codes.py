"""A code travels with its text: through places and other words, copies and processes, findings and remarks, to the command line."""

from __future__ import annotations

import copy
import json
import pickle
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from by_code import raises_code, warns_code
from thermid import errors
from thermid.app.cli.app import main
from thermid.app.texts import add_codes, mark_codes
from thermid.base import units
from thermid.base.errors import CodedText, ThermidError, ThermidWarning, code_of
from thermid.physics.air import dry_air
from thermid.physics.htc import biot_number, compare_htc

KINDS = sorted((k for k in vars(errors).values() if isinstance(k, type) and issubclass(k, ThermidError)), key=lambda k: k.__name__)


@pytest.mark.parametrize("kind", KINDS)
def test_whatever_happens_to_an_error_its_code_stays(kind: type[ThermidError]) -> None:
    error = kind("a text", code="unit.unknown")
    assert kind("a text").code == kind.code
    again = [
        error.located("a.toml"),
        error.within("b.toml"),
        error.reworded("other words"),
        copy.copy(error),
        pickle.loads(pickle.dumps(error)),
    ]
    assert [type(each) for each in again] == [kind] * 5
    assert [each.code for each in (error, *again)] == ["unit.unknown"] * 6
    assert code_of(str(again[0])) == code_of(again[-1].message) == "unit.unknown"
    assert ThermidError(again[-1].message).code == "unit.unknown"


def test_a_class_that_is_a_cause_has_its_code() -> None:
    assert errors.MissingExtraError("a text").code == "extra.not-installed"
    assert errors.MissingExtraError("a text", code="unit.unknown").code == "unit.unknown"
    assert errors.RecordError(errors.MissingDataError("a text").message).code == "record.log-missing"


def test_a_coded_text_is_a_text() -> None:
    text = CodedText("it is late", "time.late")
    assert (text, code_of(text), code_of("it is late"), code_of(f"{text}.")) == ("it is late", "time.late", "", "")
    assert json.loads(json.dumps([text])) == ["it is late"]
    assert code_of(pickle.loads(pickle.dumps(text))) == code_of(copy.deepcopy(text)) == code_of(CodedText(text)) == "time.late"


def test_codes_of_a_document() -> None:
    late, early = CodedText("it is late", "time.late"), CodedText("it is late and dark", "time.dark")
    found = {"severity": "note", "code": "time.late", "message": late}
    assert add_codes({"warnings": (late, early, late), "findings": [found], "title": "a title"})["codes"] == {
        "time.late": ["it is late"],
        "time.dark": ["it is late and dark"],
    }
    assert add_codes({"findings": [found]}) == {"findings": [found]}
    assert add_codes({"code": "", "message": late, "more": [late]})["codes"] == {"time.late": ["it is late"]}
    assert mark_codes("a: it is late\nb: it is late and dark", {"w": [late, early]}) == (
        "a: it is late [time.late]\nb: it is late and dark [time.dark]"
    )


def test_a_test_of_another_code_fails() -> None:
    with pytest.raises(AssertionError, match=r"unit\.unknown"), raises_code("unit.ambiguous"):
        units.unit("watts per inch")
    with pytest.raises(AssertionError, match="999"), raises_code("unit.unknown", match="999"):
        units.unit("watts per inch")
    with pytest.raises(AssertionError, match=r"no 'unit\.nonsense'"), raises_code("unit.nonsense"):
        units.unit("watts per inch")
    with pytest.raises(AssertionError, match=r"physics\.outside-range"), warns_code("physics.not-one-temperature"):
        dry_air(900.0)


def test_a_warning_becomes_a_remark_with_its_code() -> None:
    with warns_code("physics.not-one-temperature", match=r"0\.4"):
        biot_number(8.0, 0.05, 1.0)
    with pytest.warns(ThermidWarning):
        found = compare_htc(200.0, 4.0, "340 [K]", "300 [K]", 2.0)
    assert {code_of(remark) for remark in found.remarks} == {"physics.outside-range", "htc.differs"}


DECK = """title = "plate"
needs = ["air"]
nodes.plate = { capacitance = "100 [J/K]" }
nodes.lid = { capacitance = "10 [J/K]" }
conductors.film = { kind = "convection", between = ["plate", "air"], htc = "8 [W/(m^2 K)]", area = "0.05 [m^2]" }
loads.heater = { into = "plate", power = "5 [W]" }
"""


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    path = tmp_path / "plate.toml"
    path.write_text(DECK, encoding="utf-8")
    return path


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[str, str]]:
    """What a command prints on both outputs."""

    def printed(*words: object) -> tuple[str, str]:
        monkeypatch.setattr(sys, "argv", ["thermid", *map(str, words)])
        with pytest.raises(SystemExit):
            main()
        out, err = capsys.readouterr()
        return out, err

    return printed


Run = Callable[..., tuple[str, str]]


def test_the_command_line_shows_the_code_of_an_error(deck: Path, run: Run) -> None:
    deck.write_text(DECK.replace("J/K", "Joule pro K"), encoding="utf-8")
    assert "unit.unknown" not in run("steady", deck, "--boundary", "air=20 [degC]")[1]
    assert run("steady", deck, "--boundary", "air=20 [degC]", "-v")[1].rstrip().endswith("[unit.unknown]")
    assert json.loads(run("steady", deck, "--boundary", "air=20 [degC]", "--json")[0])["code"] == "unit.unknown"
    assert json.loads(run("check", deck, "--json")[0])["code"] == "unit.unknown"
    assert json.loads(run("steady", "--nonsense", "--json")[0])["code"] == "command.not-understood"


def test_the_command_line_shows_the_codes_of_findings_and_remarks(deck: Path, run: Run) -> None:
    assert {f["code"] for f in json.loads(run("check", deck, "--json")[0])["findings"]} == {"model.unconnected", "model.carrier-unstated"}
    assert "[model.unconnected]" in run("check", deck, "-v")[0]
    assert "model.unconnected" not in run("check", deck)[0]
    words = ("steady", deck, "--boundary", "air=20 [degC]", "--vacuum")
    assert run(*words, "-v")[1].rstrip().endswith("[model.no-path-to-boundary]")
    ran = json.loads(run("simulate", deck, "--boundary", "air=20 [degC]", "--for", "1 [h]", "--json")[0])
    assert ran["codes"] == {"model.no-path-to-boundary": ran["warnings"]}
