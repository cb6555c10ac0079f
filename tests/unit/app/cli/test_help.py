"""Help: commands by group in the order of work, whole lines at 80 columns, an example each, one table of exit codes, completion."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from docs.pages import tables
from thermid import errors
from thermid.app.cli.app import COMMANDS, EXITS, GROUPS, OnDemand
from thermid.app.cli.options import PRECEDENCE
from thermid.model._parts.parameter import INADEQUATE, UNUSABLE
from unit.app.cli.conftest import Call

FILES = Path(__file__).parents[4] / "docs" / "files.md"


def test_groups_stand_in_the_order_of_work(call: Call) -> None:
    said = call("--help").out
    heads = [line.rstrip(":") for line in said.splitlines() if re.fullmatch(r"[A-Z]\w+:", line)]
    assert [h for h in heads if h in GROUPS] == list(GROUPS)
    assert {place.group for place in COMMANDS.values()} == set(GROUPS)
    order = [place.group for place in COMMANDS.values()]
    assert order == sorted(order, key=GROUPS.index)


def test_every_line_is_whole_at_80_columns(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    said = call("--help").out
    for word, place in COMMANDS.items():
        line = next(line for line in said.splitlines() if line.startswith(f"  {word} "))
        assert line.endswith(place.summary)
        assert place.summary.endswith(".")
    assert max(map(len, said.splitlines())) <= 80
    assert "..." not in said.partition("Start:")[2]


@pytest.mark.parametrize("word", COMMANDS)
def test_examples_are_commands_that_parse(word: str, call: Call) -> None:
    said = call(word, "--help").out
    assert COMMANDS[word].examples
    for example in COMMANDS[word].examples:
        assert f"\n    {example}\n" in said
        program, command, *arguments = shlex.split(example)
        assert (program, command) == ("thermid", word)
        with OnDemand(word, COMMANDS[word]).make_context(word, arguments):
            pass


def test_an_example_with_a_wrong_option_is_seen() -> None:
    with pytest.raises(Exception, match=r"[Nn]o such option"):
        OnDemand("check", COMMANDS["check"]).make_context("check", ["box.toml", "--verbos"])


def test_exit_codes_are_one_table(call: Call) -> None:
    said = call("--help").out
    shown = {int(c): text for c, text in re.findall(r"^  (\d+) +(.+)$", said.partition("Exit codes:")[2], re.M)}
    assert shown == EXITS
    rows = next(
        rows for rows in tables(FILES.read_text(encoding="utf-8")).values() if rows and rows[0][0] == "0" and "verdict" in rows[0][1]
    )
    assert {int(row[0]): row[1] for row in rows} == EXITS
    of_errors = {e.exit_code for e in vars(errors).values() if isinstance(e, type) and issubclass(e, errors.ThermidError)}
    assert {*of_errors, *PRECEDENCE, UNUSABLE, INADEQUATE, 130} == set(EXITS)


@pytest.mark.parametrize(("typed", "expected"), [("thermid cal", "calibrate"), ("thermid simulate --sce", "--scenario")])
def test_completion_of_a_shell(typed: str, expected: str) -> None:
    environment = {**os.environ, "_THERMID_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(len(typed.split()) - 1)}
    code = "import sys\nsys.argv = ['thermid']\nfrom thermid.app.cli import main\nmain()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=60, check=False)
    assert expected in done.stdout.split(), done.stderr


def test_shared_options_may_stand_before_the_command(call: Call) -> None:
    """`thermid -v check` was refused."""
    assert call("--json", "schema", "no such").out == call("schema", "no such", "--json").out
    assert call("-v", "check", "none.toml").err == call("check", "none.toml", "-v").err
