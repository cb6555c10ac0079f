"""The local page: studio."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from thermid.app.cli.options import Data
from thermid.app.studio.project import Project
from thermid.app.studio.room import Room
from thermid.app.studio.server import serve
from thermid.base.errors import DeckError, require
from thermid.base.files import FileKinds, scratch


def studio(
    file: Annotated[Path | None, typer.Argument(help="A deck or a campaign (TOML); without one the start page.")] = None,
    data: Data = None,
    results: Annotated[Path | None, typer.Option("--results", help="Folder of finished stages; 'results' beside the file.")] = None,
    log: Annotated[Path | None, typer.Option("--log", help="A log that grows, to be followed in the view Watch.")] = None,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port on this machine; any free one where it is 0.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Whether to open the page in a browser.")] = True,
) -> None:
    """Open or begin a deck or campaign, as a page on this machine.

    The page has a view in which models are built, sliders, levels, scenarios, and a view of a log that grows. Nothing leaves this machine.
    The address holds a token: who has it sees the project and may save values; other users of the machine are refused.
    """
    require("studio", "thermid studio")
    if file is None and (data or results or log):
        raise DeckError("--data, --results and --log belong to a deck or campaign. Give one.", "studio", code="value.incomplete")
    project = None if file is None else Project(file, data, results)
    room = Room(Path.cwd() if project is None else project.path.parent, project, log.resolve() if log is not None else None)
    with scratch() as folder:

        def ready(address: str) -> None:
            """Say the address, and open it where a browser is wanted."""
            typer.echo(f"studio: {address}  (this machine only; end it with Ctrl+C)")
            if browser:
                # a page in a private folder that leads to an address: the arguments of a browser are seen by every user of the machine
                page = f'<!doctype html><meta charset="utf-8"><title>studio</title><meta http-equiv="refresh" content="0; url={address}">\n'
                webbrowser.open(FileKinds.PAGE.save_text(folder / "studio.html", page).as_uri())

        serve(room, port, ready)
