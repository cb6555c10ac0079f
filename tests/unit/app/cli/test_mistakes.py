"""Mistakes that people make at the command line: each is answered in a sentence, with exit code 2 and nothing written."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from .conftest import Call


@pytest.mark.parametrize(
    ("arguments", "code", "match"),
    [
        (("diagram", "DECK", "--to", "x.png"), "output.wrong-ending", r"^x\.png: .*'\.png' .* PNG, .*\.svg"),
        (("diagram", "DECK", "--to", "x"), "output.wrong-ending", r"^x: .*\.svg"),
        (("report", "x.toml", "--to", "x.docx"), "output.wrong-ending", r"'\.docx' .*\.html or \.htm"),
        (("simulate", "DECK", "--for", "60", "--csv", "x.xlsx"), "output.wrong-ending", r"^x\.xlsx: .*'\.xlsx' .*\.csv"),
        (
            ("export", "DECK", "--as", "spice", "--for", "60", "--boundary", "air=24", "--to", "x.pdf"),
            "output.wrong-ending",
            r"^x\.pdf: .*\.csv or \.toml or \.json",
        ),
        (
            ("deliver", "DECK", "--to", "x", "--scenario", "s.toml", "--at", "foo"),
            "value.incomplete",
            "^--at: 'foo' .*--nodes, --within .*--values",
        ),
        (("predict", "x.toml", "--draws", "-5"), "", "'--draws'"),
        (("correlate", "a.csv", "a.csv", "--steady", "100:50"), "value.outside-range", "^--steady: '100:50'"),
        (("check", "."), "file.not-found", r"'\.': "),
        (("check", "no/such.toml"), "file.not-found", r"'such\.toml', .* 'no'\."),
        (("check", "suply.toml"), "file.not-found", r"'suply\.toml' .* 'supply\.toml'"),
        (("check", "nosuch.toml"), "file.not-found", r"'nosuch\.toml' [^']*$"),
        (
            ("moisture", "DECK", *"--boundary air=24 --for 60 --humidity air=60".split()),
            "value.outside-range",
            r"'air' .* 60\. .*'60 \[%\]'",
        ),
    ],
    ids=lambda given: " ".join(given[:1]) if isinstance(given, tuple) else "",
)
def test_one_sentence(
    call: Call, accelerometer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], code: str, match: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("supply.toml", "box.toml", "s.toml", "a.csv"):
        (tmp_path / name).touch()
    before = sorted(p.name for p in tmp_path.rglob("*"))
    said = call(*(accelerometer if a == "DECK" else a for a in arguments))
    assert (said.code, said.out, said.codes) == (
        2,
        "",
        (code,) if code else (),
    )  # a number out of range is refused by the parser of options
    assert re.search(match, said.err.removeprefix("error: "))
    assert sorted(p.name for p in tmp_path.rglob("*")) == before


def test_powers_are_not_compared_as_temperatures(call: Call, tmp_path: Path) -> None:
    for name, power in (("a.csv", 3.0), ("b.csv", 300.0)):
        rows = "".join(f"{60 * k},{20 + 0.1 * k},{power},{power},{21 + 0.1 * k}\n" for k in range(20))
        (tmp_path / name).write_text(f"time_s,T1,P_1,heat [W],case [degC]\n{rows}")
    said = call("correlate", tmp_path / "a.csv", tmp_path / "b.csv", "--json")
    assert said.code == 0
    assert {row["sensor"] for row in said.object["sensors"]} == {"T1", "case"}
