"""Mistakes that people make at the command line: each is answered in a sentence, with exit code 2 and nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest

from .conftest import Call


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("diagram", "DECK", "--to", "x.png"),
            "x.png: the ending '.png' promises a picture in PNG, but the picture is written as .svg. Give",
        ),
        (
            ("diagram", "DECK", "--to", "x"),
            "x: the name does not say a format, and the picture is written as .svg.",
        ),
        (
            ("report", "x.toml", "--to", "x.docx"),
            "the ending '.docx' promises a word processor's document, but the page",
        ),
        (("simulate", "DECK", "--for", "60", "--csv", "x.xlsx"), "x.xlsx: the ending '.xlsx' promises a workbook, but the table of"),
        (("export", "DECK", "--as", "spice", "--for", "60", "--boundary", "air=24", "--to", "x.pdf"), "but the export is written as"),
        (("deliver", "DECK", "--to", "x", "--scenario", "s.toml", "--at", "foo"), "--at: 'foo' is the part that is reduced or has values"),
        (("predict", "x.toml", "--draws", "-5"), "Invalid value for '--draws'"),
        (("correlate", "a.csv", "a.csv", "--steady", "100:50"), "--steady: '100:50' ends before it begins."),
        (("check", "."), "there is no file '.': it is a folder."),
        (("check", "no/such.toml"), "there is no file 'such.toml', and no folder 'no'."),
        (("check", "suply.toml"), "there is no file 'suply.toml' in this folder. Did you mean 'supply.toml'?"),
        (("check", "nosuch.toml"), "there is no file 'nosuch.toml' in this folder."),
        (
            ("moisture", "DECK", *"--boundary air=24 --for 60 --humidity air=60".split()),
            "'air' has a relative humidity of 60. Give 0 to 1, or a text such as '60 [%]'",
        ),
    ],
    ids=lambda given: " ".join(given[:1]) if isinstance(given, tuple) else "",
)
def test_one_sentence(
    call: Call, accelerometer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("supply.toml", "box.toml", "s.toml", "a.csv"):
        (tmp_path / name).touch()
    before = sorted(p.name for p in tmp_path.rglob("*"))
    said = call(*(accelerometer if a == "DECK" else a for a in arguments))
    assert (said.code, said.out) == (2, "")
    assert words in said.err
    assert sorted(p.name for p in tmp_path.rglob("*")) == before


def test_powers_are_not_compared_as_temperatures(call: Call, tmp_path: Path) -> None:
    for name, power in (("a.csv", 3.0), ("b.csv", 300.0)):
        rows = "".join(f"{60 * k},{20 + 0.1 * k},{power},{power},{21 + 0.1 * k}\n" for k in range(20))
        (tmp_path / name).write_text(f"time_s,T1,P_1,heat [W],case [degC]\n{rows}")
    said = call("correlate", tmp_path / "a.csv", tmp_path / "b.csv", "--json")
    assert said.code == 0
    assert {row["sensor"] for row in said.object["sensors"]} == {"T1", "case"}
