"""A script run in this process, as if it were a program of its own: a start of Python takes a second."""

from __future__ import annotations

import contextlib
import io
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from unittest import mock


def ran(program: Callable[[], object], arguments: list[str], folder: Path) -> tuple[int, str, str]:
    """Exit code, output and errors of a program that is called with arguments in a folder."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.ExitStack() as stack:
        for each in (contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), contextlib.chdir(folder)):
            stack.enter_context(each)
        stack.enter_context(mock.patch.object(sys, "argv", arguments))
        try:
            program()
        except SystemExit as end:
            return int(end.code or 0), out.getvalue(), err.getvalue()
    return 0, out.getvalue(), err.getvalue()


def script(path: Path, arguments: list[str], folder: Path) -> tuple[int, str, str]:
    """The same of a script, with its own folder first on the path; modules beside it are forgotten, as another copy has others."""
    with mock.patch.object(sys, "path", [str(path.parent), *sys.path]):
        done = ran(lambda: runpy.run_path(str(path), run_name="__main__"), [str(path), *arguments], folder)
    for name in [n for n, m in sys.modules.items() if str(getattr(m, "__file__", "")).startswith(str(path.parent))]:
        del sys.modules[name]
    return done
