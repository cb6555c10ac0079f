"""``thermid hold``: how long limits are kept, with which probability."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from thermid.cli.output import SCHEMA, clean
from thermid.cli.pages import Force
from thermid.cli.standing import Accept, leave


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(hold)


def hold(
    question: Annotated[Path, typer.Argument(help="A hold question (TOML): model, scenario, limits, spread.")],
    members: Annotated[int, typer.Option("--members", help="How many runs; the file's, or 10000.", min=0)] = 0,
    to: Annotated[Path | None, typer.Option("--to", help="Folder where runs are kept; 'results' beside the file.")] = None,
    workers: Annotated[int, typer.Option("--workers", help="Processes of this machine.", min=1)] = 1,
    cluster: Annotated[str, typer.Option("--cluster", help="Address of a Dask scheduler, tcp://host:8786.")] = "",
    figure: Annotated[Path | None, typer.Option("--figure", help="Write the curve (png, svg, pdf).")] = None,
    accept: Accept = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Say how long limits are kept: the probability of passing them against time, the time that is safe, what decides it.

    Runs are kept in a folder: an interrupted command goes on where it was.
    """
    from thermid.errors import SolverError
    from thermid.files import PICTURE, may_write
    from thermid.monte_carlo.hold import load_hold
    from thermid.reporting.pictures.trust import check_ending, picture

    if figure is not None:
        may_write(check_ending(figure), PICTURE)
    asked = load_hold(question)
    folder = to if to is not None else question.parent / "results"
    progress = _Progress()
    try:
        _, found = asked.run(n=members, folder=folder, workers=workers, cluster=cluster, progress=progress)
    except KeyboardInterrupt:
        done = f"interrupted with {progress.done} of {progress.members} members done"
        raise SolverError(f"{done}. The same command goes on from there.") from None
    finally:
        progress.end()
    found = replace(found, standing=found.standing.accept(accept or ()))
    if figure is not None:
        picture(found, figure)
    typer.echo(json.dumps(clean({"schema": SCHEMA, "status": "ok", **found.to_dict()})) if as_json else str(found))
    leave(found.standing)


class _Progress:
    """Members done and time left, on standard error."""

    def __init__(self) -> None:
        self.done, self.members = 0, 0
        self._begun, self._at = time.monotonic(), -1

    def __call__(self, done: int, members: int) -> None:
        if self._at < 0:
            self._at = done  # what the folder held took no time
        spent = time.monotonic() - self._begun
        left = f", {spent * (members - done) / (done - self._at):.0f} s left" if self._at < done < members else ""
        self.done, self.members = done, members
        text = f"{done} of {members} members{left}"
        if sys.stderr.isatty():
            typer.echo(f"\r\x1b[2K{text}", nl=False, err=True)
        else:
            typer.echo(text, err=True)

    def end(self) -> None:
        """Leave the line."""
        if self.members and sys.stderr.isatty():
            typer.echo("", err=True)
