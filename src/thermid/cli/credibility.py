"""``thermid credibility``: what every value of a campaign's model rests on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from thermid.cli.pages import Force


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("credibility")(credibility)


def credibility(
    campaign: Annotated[Path, typer.Argument(help="A campaign (TOML).")],
    data: Annotated[Path | None, typer.Option("--data", help="Folder of logs outside the project; THERMID_DATA does the same.")] = None,
    results: Annotated[Path | None, typer.Option("--results", help="Folder of finished stages; 'results' beside the campaign.")] = None,
    to: Annotated[Path | None, typer.Option("--to", help="The file to write, JSON or TOML; standard output without it.")] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Say of every value its source, state, level, tests, date, range and origin."""
    from thermid.campaign.credibility import credibility as recorded
    from thermid.campaign.stages import run_stages
    from thermid.cli.output import clean
    from thermid.files import CREDIBILITY, may_write

    folder = results if results is not None else campaign.parent / "results"
    if to is not None:
        may_write(to, CREDIBILITY)
    found = recorded(run_stages(campaign, data=data, cache=folder))
    if to is not None:
        found.save(to)
    if as_json:
        typer.echo(json.dumps(clean({"status": "ok", **found.to_dict()})))
    else:
        typer.echo(f"written: {to}" if to is not None else str(found))
