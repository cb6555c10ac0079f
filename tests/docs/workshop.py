"""A page is worked through as a reader would: its files written, its Python run, its commands typed, its outputs compared."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import thermid as td
from scripts_here import ran, script
from thermid.app.cli import screen
from thermid.app.cli.app import main
from thermid.base.files import command
from thermid.bench.bench_files import load_programme, load_sensors
from thermid.campaign.stages import CampaignSource

from .formulas import disagreement
from .pages import NUMBER, ROOT, Block, blocks, differences, near

OTHER_PROGRAMS = ("make", "pip", "git", "pre-commit", ".venv/bin/pip", ".venv/bin/pre-commit")
EXIT_CODE = re.compile(r"#.*exit code (\d)\s*$")


def _load_deck(path: Path) -> None:
    errors = [str(finding) for finding in td.load_model(path).check() if finding.severity == "error"]
    assert not errors, errors


def _load_campaign(path: Path) -> None:
    source = CampaignSource.read(path)
    for stage in source.content.stages:
        source.model(stage.model, stage.name)


LOADERS = {
    "deck": _load_deck,
    "scenario": td.load_scenario,
    "campaign": _load_campaign,
    "values": td.load_values,
    "study": td.design.load_study,
    "hold": td.qualify.load_hold,
    "profile": td.qualify.load_profile,
    "plan": td.qualify.load_plan,
    "map": load_sensors,
    "programme": load_programme,
}


LESSON = "examples/04_campaign/campaign.toml"
"""The campaign that many pages fit: its stages are fitted once and found in the folder `results` of each, and beside the campaign."""


def _copied(folder: Path) -> None:
    """Copy the examples into a folder, without what runs of them leave."""
    shutil.copytree(ROOT / "examples", folder / "examples", ignore=shutil.ignore_patterns("__pycache__", "results", "logs", "out"))


@cache
def _fitted() -> tempfile.TemporaryDirectory[str]:
    """A folder with the results of that campaign, as a page's own command would leave them, without its looks."""
    made = tempfile.TemporaryDirectory()
    folder = Path(made.name)
    _copied(folder)
    subprocess.run([sys.executable, "examples/04_campaign/make_logs.py"], cwd=folder, check=True, capture_output=True)
    td.run_stages(folder / LESSON, cache=folder / "results").save(folder / "values")
    (folder / "results" / "looks.json").unlink(missing_ok=True)
    return made


@dataclass
class Workshop:
    """A folder with a copy of the examples, and what a page has done in it so far."""

    page: str
    folder: Path
    names: dict[str, Any] = field(default_factory=lambda: {"__name__": "page"})
    said: str = ""

    @classmethod
    def of(cls, page: str, folder: Path) -> Workshop:
        """Lay out the folder."""
        _copied(folder)
        if LESSON in (ROOT / page).read_text(encoding="utf-8"):
            for place in (folder / "results", folder / Path(LESSON).with_name("results")):
                shutil.copytree(Path(_fitted().name) / "results", place)
        return cls(page, folder)

    def work(self, elsewhere: set[str]) -> None:
        """Do what every block says; `elsewhere` are second words of Python blocks that another test runs."""
        for block in blocks((ROOT / self.page).read_text(encoding="utf-8")):
            kind, rest = block.words[0] if block.words else "", block.words[1:]
            place = f"{self.page}:{block.line}"
            if rest and rest[0] in elsewhere:
                continue
            if kind and len(rest) == 2 and rest[0] in ("file", "more"):
                self._file(block, *rest)
            elif kind == "toml":
                self._toml(block, rest, place)
            elif kind == "python" and not rest:
                self.python(block, place)
            elif kind == "formula":
                assert not (wrong := disagreement(block.text, rest)), f"{place}: {wrong}"
            elif kind == "sh" and not rest:
                self.said = "".join(self._commands(block, place))
            elif kind == "text" and not rest:
                assert not (found := list(differences(block.text, self.said))), f"{place}\n{found[0]}"
            elif kind == "text" and rest == ("figures",):
                self.figures(block, place)
            elif kind == "json" and not rest:
                problems = list(missing(json.loads(block.text, parse_float=Shown), json.loads(self.said)))
                assert not problems, f"{place}: {problems[0]}"
            else:
                raise AssertionError(f"{place}: nobody knows a block '{' '.join(block.words)}'")

    def figures(self, block: Block, place: str) -> None:
        """Compare the words of an output whose numbers change with the model of error; `scripts/renew_page.py` writes them anew."""
        shown, found = (NUMBER.sub("#", text) for text in (block.text, self.said))
        assert not (wrong := list(differences(shown, found))), f"{place}\n{wrong[0]}"

    def _file(self, block: Block, how: str, name: str) -> None:
        """Write a file that a page shows, or add to one that it has shown."""
        path = self.folder / name
        before = path.read_text(encoding="utf-8") if how == "more" else ""
        path.write_text(before + block.text, encoding="utf-8")

    def _toml(self, block: Block, rest: tuple[str, ...], place: str) -> None:
        assert rest, f"{place}: say what it is: toml deck, scenario, campaign, study or values"
        assert rest[0] in LOADERS, f"{place}: say what it is: toml deck, scenario, campaign, study or values"
        path = self.folder / (rest[1] if len(rest) > 1 else f"line_{block.line}.toml")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.text, encoding="utf-8")
        try:
            with command(trust=True):
                LOADERS[rest[0]](path)
        except td.ThermidError as error:
            raise AssertionError(f"{place}: {error}") from error

    def python(self, block: Block, place: str) -> None:
        """Run a block with the names of those before it."""
        code = compile("\n" * (block.line - 1) + block.text, place, "exec")
        heard = io.StringIO()
        with contextlib.redirect_stdout(heard), contextlib.chdir(self.folder):
            exec(code, self.names)
        self.said = heard.getvalue()

    def _commands(self, block: Block, place: str) -> Iterator[str]:
        for number, line in enumerate(block.text.splitlines()):
            words = shlex.split(line, comments=True)
            if not words:
                continue
            where = f"{place} + {number}: {line}"
            if words[0] in OTHER_PROGRAMS:
                self._other(words, where)
                continue
            assert words[0] in ("thermid", "python"), f"{where}: nobody runs this"
            code, out, err = (self._thermid if words[0] == "thermid" else self._script)(words[1:])
            expected = int(found[1]) if (found := EXIT_CODE.search(line)) else 0
            assert code == expected, f"{where}\nexit code {code}\n{out}{err}"
            yield out + (err if expected else "")

    def _thermid(self, arguments: list[str]) -> tuple[int, str, str]:
        """The entry point of the command line, in this process: a page has many commands and a start takes a second."""
        plain = {k: v for k, v in os.environ.items() if k != "THERMID_DATA"} | {"COLUMNS": "140", "NO_COLOR": "1"}
        with mock.patch.dict(os.environ, plain, clear=True), mock.patch.object(screen, "SECONDS_TO_FIRST_PROGRESS", math.inf):
            return ran(main, ["thermid", *arguments], self.folder)

    def _script(self, arguments: list[str]) -> tuple[int, str, str]:
        """A script, in this process too."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # a short script leaves a file to the end of its process
            return script(self.folder / arguments[0], arguments[1:], self.folder)

    def _other(self, words: list[str], where: str) -> None:
        """Commands that are not run here must at least be there."""
        if words[0] == "make":
            targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
            unknown = [w for w in words[1:] if "=" not in w and w not in targets]
            assert not unknown, f"{where}: the Makefile has no {unknown}"
        elif words[0].endswith("pre-commit"):
            assert (ROOT / ".pre-commit-config.yaml").is_file(), where


class Shown(str):
    """A number of a page as it is written."""


def missing(shown: Any, found: Any, path: str = "") -> Iterator[str]:
    """What an object on a page holds and the one found does not."""
    if isinstance(shown, Shown):
        if not near(shown, float(found)):
            yield f"{path} is shown as {shown} and is {found}"
    elif isinstance(shown, dict):
        for key, value in shown.items():
            if not isinstance(found, dict) or key not in found:
                yield f"there is no {path}.{key}"
            else:
                yield from missing(value, found[key], f"{path}.{key}")
    elif isinstance(shown, list):
        for k, value in enumerate(shown):
            if not isinstance(found, list) or k >= len(found):
                yield f"there is no {path}[{k}]"
            else:
                yield from missing(value, found[k], f"{path}[{k}]")
    elif shown != found:
        yield f"{path} is shown as {shown!r} and is {found!r}"
