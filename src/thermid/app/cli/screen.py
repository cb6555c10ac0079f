"""What people see in a terminal: lines that fit, colours by severity, progress of a long command. What is piped stays plain and whole."""

from __future__ import annotations

import os
import re
import shutil
import signal
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final, Self

import typer

from thermid.base.errors import spoken

if TYPE_CHECKING:
    from types import FrameType

    from rich.console import Console

MAX_LINE_CHARACTERS: Final = 100
"""Characters of a line at most, however wide the terminal is: longer lines are hard to read."""
UNFOLDED: Final = 100_000
"""Characters of a line where there is no terminal, so that none is folded."""
SCREEN: Final = 45
"""Lines that an answer has at most in a terminal without -v, where no warning is lost by that."""
SECONDS_TO_FIRST_PROGRESS: Final = 2.0
"""Time after which a command says how far it is. [s]"""
STYLES: Final = (
    ("bold red", r"NOT CREDIBLE|FAILED|NOT JUDGED|(?i:not met)|^\s*(?:\S+: )?error:|(?i:do not use)|: (?:failed|not credible)$"),
    ("yellow", r"NOT ADEQUATE|INCOMPLETE|^\s*(?:\S+: )?(?:warning|likely mistake|check):|(?i:not decided)|: not adequate$"),
    ("green", r"\bPASSED\b|: met$|: credible$"),
    ("dim", r"^\s*note:"),
)
"""Style -> what a line of that severity has; the first that matches counts."""


def width() -> int:
    """Characters of a line: those of the terminal (or `COLUMNS`), 80 where there is none, at most `MAX_LINE_CHARACTERS`."""
    return min(MAX_LINE_CHARACTERS, shutil.get_terminal_size((80, 24)).columns)


def severity(line: str) -> str:
    """Return the style of a line; empty for a plain one."""
    return next((style for style, pattern in STYLES if re.search(pattern, line)), "")


def folded(line: str, columns: int) -> list[str]:
    """Return a line as lines of at most so many characters, the further ones indented by two more than the first."""
    if len(line) <= columns:
        return [line]
    indent = " " * min(len(line) - len(line.lstrip()) + 2, columns // 2)
    return textwrap.wrap(
        line, columns, subsequent_indent=indent, break_on_hyphens=False, replace_whitespace=False, drop_whitespace=True
    ) or [""]


def brief(lines: Sequence[str], most: int, columns: int) -> list[str]:
    """Return lines that fill at most so many lines of a terminal, and how many were left out.

    First come the first line, the last one where it has no indent, and those that warn; then the heads of paragraphs (lines without
    indent), then the others in turn: the first below each head, the second, and so on. They stand in their old order.

    Parameters
    ----------
    lines : sequence of str     The whole text.
    most, columns : int         Lines and columns that there are.
    """
    if sum(len(folded(line, columns)) for line in lines) <= most:
        return list(lines)
    depth, below = [], 0
    for line in lines:
        below = below + 1 if line[:1] in (" ", "") else 0
        depth.append(below)
    loud = {style: k for k, (style, _) in enumerate(STYLES[:2])}
    rank = [loud.get(severity(line), 2) for line in lines]
    full = [k for k, line in enumerate(lines) if line.strip()]
    ends = {full[0], *(k for k in full[-1:] if depth[k] == 0)}
    room, shown = most - 1, set()
    for k in sorted(full, key=lambda k: (k not in ends, rank[k], depth[k], k)):
        rows = len(folded(lines[k], columns))
        if rows <= room:
            room -= rows
            shown.add(k)
    return [*(lines[k] for k in sorted(shown)), f"{len(full) - len(shown)} more lines: -v"]


def console(err: bool = False) -> Console:
    """Return the console of an output: colours and folded lines in a terminal alone, and no colours where NO_COLOR is set."""
    from rich.console import Console

    whole = not (sys.stderr if err else sys.stdout).isatty()
    return Console(stderr=err, width=UNFOLDED if whole else width(), highlight=False, markup=False, emoji=False, soft_wrap=False)


def show(text: str, err: bool = False, whole: bool = True) -> None:
    """Print a text: folded and coloured in a terminal, where without `whole` it is brief; as it is elsewhere."""
    stream = sys.stderr if err else sys.stdout
    if not stream.isatty():
        typer.echo(text, err=err)
        return
    out, lines = console(err), text.split("\n")
    show_lines(out, lines if whole else brief(lines, SCREEN, out.width))


def show_lines(out: Console, lines: Iterable[str], style: str | None = None) -> None:
    """Print lines, folded and coloured by their severity or in one style."""
    from rich.text import Text

    for line in lines:
        for part in folded(line, out.width):
            out.print(Text(part, style=severity(line) if style is None else style), soft_wrap=True)


class Progress:
    """How far a command is, on standard error, once it takes over `SECONDS_TO_FIRST_PROGRESS`.

    In a terminal one line says what is done, for how long, and the time left as far as it can be estimated; it is cleared at the end.
    Elsewhere each new text is one line, with the time left too.

    Parameters
    ----------
    text : str          What is being done.
    share : callable    Returns how much of the work is done, 0 to 1; 0 where nobody knows.
    """

    def __init__(self, text: str = "", share: Callable[[], float] | None = None) -> None:
        self.text = text
        self.done = 0.0
        self.share: Callable[[], float] = share if share is not None else lambda: self.done
        self._begun = self._counted_from = time.monotonic()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._in_terminal = False
        self._step, self._told = text, ""
        self._pen = threading.Lock()

    def now(self, text: str, done: float | None = None, step: str = "") -> None:
        """Say what is done now, and how much of the whole is finished; texts of one step are one line where there is no terminal."""
        self.text, self._step = text, step or text
        if done is not None:  # work of another size begins at less than what was done, and has a pace of its own
            self._counted_from, self.done = (time.monotonic() if done < self.done else self._counted_from), done
        if time.monotonic() - self._begun >= SECONDS_TO_FIRST_PROGRESS:
            self._tell()

    def _tell(self) -> None:
        """Print the text where there is no terminal, unless its step has been told."""
        with self._pen:
            if not self._in_terminal and self._step and self._step != self._told:
                self._told = self._step
                typer.echo(f"{self.text}{self.time_left()}", err=True)

    def say(self, text: str) -> None:
        """Print a text that stays."""
        if not self._in_terminal:
            typer.echo(text, err=True)
            return
        with self._pen:  # the line of the other thread would otherwise stand between the wiped line and the text
            sys.stderr.write("\r\x1b[2K")
            show(text, err=True)

    def line(self) -> str:
        """Return the line of a terminal: text, time spent, time left."""
        spent = spoken(time.monotonic() - self._begun)
        return f"{self.text}: {spent}{self.time_left()}" if self.text else f"{spent}{self.time_left()}"

    def time_left(self) -> str:
        """Return the time left in words, with a comma before it; empty where nobody knows, as where work has just begun."""
        spent, share = time.monotonic() - self._counted_from, min(max(self.share(), 0.0), 1.0)
        if spent < SECONDS_TO_FIRST_PROGRESS or not 0.0 < share < 1.0:
            return ""
        return f", about {spoken(spent * (1.0 - share) / share)} left"

    def __enter__(self) -> Self:
        """Begin; a line is drawn, or a text told, beside the work, so that one long step is seen too."""
        self._in_terminal = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        self._thread = threading.Thread(target=self._draw, daemon=True)
        self._thread.start()
        if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._interrupted)
        return self

    def _interrupted(self, number: int, frame: FrameType | None) -> None:
        """Say that the interrupt key was seen, before what runs has ended; the second one stops at once."""
        signal.signal(signal.SIGINT, signal.default_int_handler)
        typer.echo("\ninterrupted: stopping. The interrupt key again stops at once.", err=True)
        signal.default_int_handler(number, frame)

    def __exit__(self, *error: object) -> None:
        """End, and clear the line."""
        if signal.getsignal(signal.SIGINT) == self._interrupted:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        self._ended.set()
        if self._thread is not None:
            self._thread.join(1.0)

    def _draw(self) -> None:
        """Redraw the progress line twice a second until the work ends, or tell it once; nothing is drawn for work that ends at once."""
        drawn = False
        if not self._ended.wait(min(SECONDS_TO_FIRST_PROGRESS, threading.TIMEOUT_MAX)):
            self._tell()
        while self._in_terminal and not self._ended.is_set():
            drawn = True
            with self._pen:
                sys.stderr.write(f"\r\x1b[2K{self.line()[: width() - 1]}")
                sys.stderr.flush()
            self._ended.wait(0.5)
        if drawn:
            sys.stderr.write("\r\x1b[2K")
            sys.stderr.flush()


@contextmanager
def working(text: str, seconds: float = 0.0) -> Iterator[Progress]:
    """Say that something long is being done; `seconds` is what it takes at most, where that is known."""
    begun = time.monotonic()
    with Progress(text, (lambda: (time.monotonic() - begun) / seconds) if seconds > 0.0 else None) as progress:
        yield progress


@contextmanager
def searching(text: str) -> Iterator[Callable[[str, float], None]]:
    """Say how far a search is, and the share of its budget; a line for each tenth of that where there is no terminal."""
    with working(text) as progress:
        yield lambda words, share: progress.now(f"{text}: {words}", share, f"{10 * share:.0f}" if share else words)
