"""The screen: lines that fit, colours by severity, progress with the time left, packages that are asked for before the work."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from by_code import raises_code
from thermid.app.cli import app as command_line, screen, summary
from thermid.app.cli.screen import MAX_LINE_CHARACTERS, Progress, folded, severity, spoken, working
from thermid.app.cli.summary import show_campaign
from thermid.base.errors import MissingExtraError, ThermidWarning, missing, modules_of, require
from thermid.campaign.stages import run_stages
from thermid.fit.calibration import Calibration, Input, InputTable
from thermid.inference._explain.structures import EvaluationBudget
from thermid.reporting._blocks import content as extras
from unit.app.cli.conftest import Call

pty = pytest.importorskip("pty", reason="a pseudo-terminal needs a posix system")
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


@cache
def in_a_terminal(*arguments: object, columns: int = 80, **environment: str) -> str:
    """What a command shows in a terminal of so many columns, escape sequences included."""
    master, slave = pty.openpty()
    around = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "THERMID_DATA")}
    around |= {"COLUMNS": str(columns), "TERM": "xterm", "OMP_NUM_THREADS": "1", **environment}
    command = [sys.executable, "-m", "thermid", *map(str, arguments)]
    process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=around, close_fds=True)
    os.close(slave)
    parts = []
    while True:
        try:
            part = os.read(master, 65536)
        except OSError:
            break
        if not part:
            break
        parts.append(part)
    process.wait(timeout=120)
    os.close(master)
    return b"".join(parts).decode().replace("\r\n", "\n")


def plain(text: str) -> str:
    return ESCAPES.sub("", text)


@pytest.mark.parametrize("columns", [60, pytest.param(80, marks=pytest.mark.campaign), 200])
def test_no_line_is_longer_than_the_terminal_or_100(accelerometer: Path, columns: int) -> None:
    said = plain(in_a_terminal("check", accelerometer, "-v", columns=columns))
    assert max(map(len, said.splitlines())) <= min(columns, MAX_LINE_CHARACTERS)
    said = plain(in_a_terminal("simulate", accelerometer, "--boundary", "air=24", "--for", "1 [h]", "--vacuum", columns=columns))
    assert said.startswith("error: accelerometer.toml:15, surfaces.skin: ")
    assert max(map(len, said.splitlines())) <= min(columns, MAX_LINE_CHARACTERS)


class Terminal:
    """A terminal of which each write is kept, and takes a while."""

    def __init__(self) -> None:
        self.kept: list[str] = []

    def write(self, text: str) -> int:
        self.kept.append(text)
        time.sleep(0.01)
        return len(text)

    def flush(self) -> None:
        pass

    def isatty(self) -> bool:
        return True


def test_no_progress_stands_before_a_text_that_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(screen, "SECONDS_TO_FIRST_PROGRESS", 0.0)
    monkeypatch.setenv("TERM", "xterm")

    def slowly(text: str, err: bool = False, whole: bool = True) -> None:
        time.sleep(0.7)  # longer than the line of progress rests
        terminal.write(f"{text}\n")

    monkeypatch.setattr(screen, "show", slowly)
    with Progress("work") as progress:
        progress.say("a text that stays")
    before = terminal.kept[terminal.kept.index("a text that stays\n") - 1]
    assert before == "\r\x1b[2K"


def test_one_long_step_is_told_without_a_terminal_and_a_short_one_is_not(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A text of the first seconds was left out, and nothing followed it for minutes."""
    monkeypatch.setattr(screen, "SECONDS_TO_FIRST_PROGRESS", 0.2)
    with working("", 0.0) as progress:
        progress.now("a short step")
        progress.now("a long step")
        time.sleep(1.0)
        progress.now("a long step")
    assert capsys.readouterr().err == "a long step\n"


@pytest.mark.parametrize(("options", "code"), [([], ""), (["-v"], " [physics.outside-range]")])
def test_a_warning_is_a_sentence_without_the_path_of_the_package(
    options: list[str], code: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What packages below warn of, as numpy of an overflow, is nothing that a user can mend."""

    def warn(**_: object) -> int:
        warnings.warn(ThermidWarning("no such range", code="physics.outside-range"), stacklevel=1)
        warnings.warn("overflow encountered in multiply", RuntimeWarning, stacklevel=1)
        return 0

    monkeypatch.setattr(command_line, "app", warn)
    monkeypatch.setattr(sys, "argv", ["thermid", *options])
    monkeypatch.setattr(sys, "warnoptions", [])
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        with pytest.raises(SystemExit):
            command_line.main()
    assert capsys.readouterr().err == f"warning: no such range{code}\n"


def test_colour_in_a_terminal_and_none_where_it_is_not_wanted(accelerometer: Path) -> None:
    refused = ("simulate", accelerometer, "--boundary", "air=24", "--for", "1 [h]", "--vacuum")
    assert "\x1b[1;31merror: " in in_a_terminal(*refused, columns=60)
    bare = in_a_terminal(*refused, NO_COLOR="1")
    assert bare.startswith("error: ") or bare.startswith("\x1b[1merror: ")
    assert "31m" not in bare


def test_not_credible_is_red_and_first(tmp_path: Path) -> None:
    from unit.fit.test_contradicted import project

    path = project(tmp_path, 180.0)
    said = in_a_terminal("calibrate", path)
    answer = said.rpartition("\r\x1b[2K")[2]  # after the line of progress, where there was one
    assert answer.startswith("\x1b[1;31mNOT CREDIBLE: stage 'box'")
    assert max(map(len, plain(answer).splitlines())) <= 80


@pytest.mark.parametrize("columns", [80, pytest.param(120, marks=pytest.mark.campaign)])
def test_a_campaign_fits_on_a_screen(made: Path, tmp_path: Path, columns: int) -> None:
    # each line of progress is wiped before the next one, so that only the last text of a line is seen
    said = plain(re.sub(r"[^\n]*\r\x1b\[2K", "", in_a_terminal("calibrate", made, "--to", tmp_path, columns=columns))).replace("\r", "")
    lines = said.splitlines()
    assert len(lines) <= 45
    assert max(map(len, lines)) <= min(columns, MAX_LINE_CHARACTERS)
    assert "pair on pair_two: PASSED" in said


@pytest.mark.parametrize("terminal", [True, False])
def test_each_of_many_stages_shows_values_and_what_all_assume_is_said_once(
    made_and_fitted: Path, terminal: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nine stages printed no value, five lines of assumed loads each, and a file had lines of 80 characters."""
    found = run_stages(made_and_fitted, cache=made_and_fitted.parent / "results")
    fit = found["pair"]
    advice = "check: 'a' differs. Check contacts, radiation and powers in the assembly, one after the other, before anything else."
    power = Input("two", "load", "heat", "assumed", "no log gives it")
    loads = InputTable((power, *(replace(power, name=f"load_{k}") for k in range(5))))
    monkeypatch.setattr(Calibration, "inputs", loads)
    many = {f"s{k}": replace(fit, warnings=(advice.replace("'a'", f"'a_{k}'"),)) for k in range(9)}
    monkeypatch.setattr(sys.stdout, "isatty", lambda: terminal)
    monkeypatch.setenv("COLUMNS", "80")
    show_campaign(replace(found, stages=many), ["s0.values.toml"])
    lines = plain(capsys.readouterr().out).splitlines()
    rows = [line for line in lines if line.startswith("  ") and " +- " in line]
    count = len([v for v in fit.estimates.values() if v.kind in ("parameter", "level")])
    assert len(rows) == 9 * (min(3, count) if terminal else count)
    assert max(map(len, lines)) <= 80 if terminal else max(map(len, lines)) > 150
    assert "s8: 6" in " ".join(lines)
    assert " ".join(" ".join(lines).split()).count("Check contacts") == 1


@pytest.mark.parametrize(
    ("line", "style"),
    [
        ("NOT CREDIBLE: stage 'box'", "bold red"),
        ("pair on two: FAILED; T_A", "bold red"),
        ("  T_A: max error 0.9 K, limit 0.5 K: NOT met", "bold red"),
        ("error: no such file", "bold red"),
        ("NOT ADEQUATE: stage", "yellow"),
        ("  warning: residuals are not white", "yellow"),
        ("box: likely mistake: the clock", "yellow"),
        ("pair on two: PASSED", "green"),
        ("  T_A: max error 0.2 K, limit 0.5 K: met", "green"),
        ("note: air=300 is read in degC", "dim"),
        ("case 24.0 degC", ""),
        ("the metal warning lamp", ""),
    ],
)
def test_severity(line: str, style: str) -> None:
    assert severity(line) == style


def test_folded_lines_hang_and_lose_nothing() -> None:
    line = "  warning: " + " ".join(f"word{k}" for k in range(40)) + " /a/very/long/path" * 8
    parts = folded(line, 50)
    assert all(len(p) <= 50 for p in parts)
    assert all(p.startswith("    ") for p in parts[1:])
    assert "".join("".join(parts).split()) == "".join(line.split())
    assert folded("short", 50) == ["short"]
    assert folded("", 50) == [""]


def test_work_that_begins_anew_has_a_time_left_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second search of 6,000 runs said '19 h 44 min left' after its first run: the time before counted for it."""
    now = [0.0]
    monkeypatch.setattr(screen.time, "monotonic", lambda: now[0])
    progress = screen.Progress("search")
    now[0] = 60.0
    progress.now("first", 0.5)
    assert "1 min left" in progress.time_left()
    progress.now("second", 1 / 6000)
    assert progress.time_left() == ""
    now[0] = 70.0
    progress.now("second", 0.25)
    assert "30 s left" in progress.time_left()


def test_time_left_is_in_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    progress = Progress("work")
    now = time.monotonic()
    monkeypatch.setattr(screen.time, "monotonic", lambda: now + 30.0)
    progress._begun = progress._counted_from = now
    assert progress.line() == "work: 30 s"
    progress.now("more", 0.25)
    assert progress.line() == "more: 30 s, about 1 min 30 s left"
    with working("search", 60.0) as search:
        monkeypatch.setattr(screen.time, "monotonic", lambda: now + 45.0)
        assert search.line() == "search: 15 s, about 45 s left"


def test_progress_of_a_campaign_never_goes_back() -> None:
    progress = summary.CampaignProgress({"a": 3.0, "b": 5.0})
    seen = []
    for stage, count in [("a", 1), ("a", 5), ("b", 1), ("b", 9), ("verdict on c", 0)]:
        progress(stage, count, 1.0)
        seen.append(progress.done)
    assert seen == [0.0, 0.0, 3.0 / 8.0, 3.0 / 8.0, 1.0]  # finished stages alone: how long one takes is not known beforehand


def test_the_time_left_of_a_stage_ends_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stayed in the line of the next stage."""
    now = time.monotonic()
    monkeypatch.setattr(screen.time, "monotonic", lambda: now)
    progress = summary.CampaignProgress({"a": 3.0, "b": 5.0})
    progress.ahead("a", "a search", 60.0)
    progress("a", 1, 1.0)
    of_the_search = progress.time_left()
    progress("b", 1, 1.0)
    of_all = progress.time_left()
    assert " min" in of_the_search
    assert of_the_search != of_all


@pytest.mark.parametrize(("seconds", "said"), [(9.9, []), (10.0, ["a: a search"])])
def test_what_takes_ten_seconds_is_said_beforehand(seconds: float, said: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as a reader waits without a word; a line for each shorter search would fill the screen."""
    heard: list[str] = []
    progress = summary.CampaignProgress({"a": 3.0})
    monkeypatch.setattr(progress, "say", heard.append)
    progress.ahead("a", "a search", seconds)
    assert heard == said


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.4, "0 s"), (59.4, "59 s"), (60, "1 min"), (61, "1 min 1 s"), (1234, "21 min"), (7322, "2 h 2 min")]
)
def test_durations(seconds: float, words: str) -> None:
    assert spoken(seconds) == words


class TestExtras:
    def test_the_packages_are_those_of_the_project(self) -> None:
        assert modules_of("report") == ["matplotlib", "jinja2"]
        assert modules_of("log") == ["serial"]
        assert modules_of("readers")[0] == "nptdms"

    def test_the_command_installs_the_packages_by_their_own_names(self) -> None:
        text = missing(["serial", "nptdms"], "the bench")
        assert "'pyserial' and 'npTDMS'" in text
        assert re.search(rf"{re.escape(sys.executable)} -m pip .*pyserial npTDMS$", text)

    def test_it_is_refused_as_an_import_error_too(self, monkeypatch: pytest.MonkeyPatch) -> None:
        require("report", "a report")
        monkeypatch.setitem(sys.modules, "jinja2", None)
        with raises_code("extra.not-installed", MissingExtraError, match="'jinja2'"):
            require("report", "a report")
        with pytest.raises(ImportError):
            require("report", "a report")

    def test_it_is_told_before_the_work(self, call: Call, campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "jinja2", None)
        said = call("report", campaign, "--to", tmp_path / "page.html")
        assert (said.code, said.out) == (2, "")
        assert "jinja2\n" in said.err
        assert not (campaign.parent / "results").exists()


class TestBrief:
    def text(self, stages: int) -> list[str]:
        blocks = [[f"stage {k}", f"  a {k}", f"  warning: w {k}", f"  b {k}", ""] for k in range(stages)]
        return ["answer", *(line for block in blocks for line in block), "end"]

    def test_what_fits_is_whole(self) -> None:
        assert screen.brief(self.text(2), 12, 80) == self.text(2)

    def test_first_and_last_then_warnings_then_heads_then_what_fits(self) -> None:
        assert screen.brief(self.text(3), 6, 80) == ["answer", *(f"  warning: w {k}" for k in range(3)), "end", "9 more lines: -v"]
        assert screen.brief(self.text(3), 10, 80) == [
            *("answer", "stage 0", "  a 0", "  warning: w 0", "stage 1", "  warning: w 1", "stage 2", "  warning: w 2", "end"),
            "5 more lines: -v",
        ]

    @pytest.mark.parametrize("most", [4, 7, 20, 45])
    @pytest.mark.parametrize("columns", [30, 80])
    def test_it_never_fills_more_lines_than_there_are_and_counts_what_is_left_out(self, most: int, columns: int) -> None:
        lines = [line * (1 + k % 3) for k, line in enumerate(self.text(12))]
        found = screen.brief(lines, most, columns)
        assert sum(len(folded(line, columns)) for line in found) <= most
        assert found[-1] == f"{sum(map(bool, lines)) - len(found) + 1} more lines: -v"

    def test_a_terminal_gets_what_fits_and_a_pipe_the_whole(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        text = "\n".join(self.text(40))
        screen.show(text, whole=False)
        assert capsys.readouterr().out == text + "\n"
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        screen.show(text, whole=False)
        shown = capsys.readouterr().out.splitlines()
        assert len(shown) <= screen.SCREEN
        assert shown[-1].endswith("more lines: -v")
        screen.show(text)
        assert len(capsys.readouterr().out.splitlines()) == len(self.text(40))


class TestReportAsPdf:
    def test_it_is_a_pdf_or_refused(self, call: Call, campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        made: list[Path] = []

        def pdf(page: Path, to: Path) -> Path:
            made.append(to)
            to.write_bytes(b"%PDF-1.7\n")
            return to

        monkeypatch.setattr(extras, "browser", lambda: "browser")
        monkeypatch.setattr(extras, "page_to_pdf", pdf)
        said = call("report", campaign, "--to", tmp_path / "x.pdf")
        assert said.code == 0
        assert made == [tmp_path / "x.pdf"]
        assert [p.name for p in tmp_path.glob("x.*")] == ["x.pdf"]


def test_a_search_says_where_it_is_and_each_tenth_of_its_budget(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(screen, "SECONDS_TO_FIRST_PROGRESS", 0.0)
    with screen.searching("search") as told:
        for k in (1, 2):
            told(f"begin {k} of 2", 0.0)
        counted = EvaluationBudget(100, told).watch("stage")
        for spent in (12, 13, 20):
            counted(spent, 0.0)
    lines = capsys.readouterr().err.splitlines()
    told_lines = lines[lines[0] == "search" :]  # what is done is told after that time, here none, unless more is known by then
    assert [line.endswith(" left") for line in told_lines] == [False, False, True, True]
    assert [re.findall(r"\d+", line)[:2] for line in told_lines] == [["1", "2"], ["2", "2"], ["12", "100"], ["20", "100"]]
