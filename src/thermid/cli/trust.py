"""``thermid identify``: what the logs of a campaign can tell of what its stages free."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("identify")(identify)


def identify(
    campaign: Annotated[Path, typer.Argument(help="A campaign (TOML).")],
    stage: Annotated[str, typer.Option("--stage", help="One stage; all of them without it.")] = "",
    after: Annotated[bool, typer.Option("--after", help="Look at the ends of the fits, not at their starts.")] = False,
    data: Annotated[Path | None, typer.Option("--data", help="Folder of logs outside the project.")] = None,
    results: Annotated[Path | None, typer.Option("--results", help="Folder of finished stages; 'results' beside the campaign.")] = None,
    as_json: Json = False,
) -> None:
    """Say what the logs of each stage can tell of the parameters that it frees, what they cannot, and what would help."""
    from thermid.campaign.survey import survey
    from thermid.cli.app import _Progress
    from thermid.cli.output import clean

    progress = _Progress()
    try:
        found = survey(campaign, stage, after=after, data=data, cache=results or campaign.parent / "results", notice=progress)
    finally:
        progress.end()
    if as_json:
        typer.echo(json.dumps(clean({"schema": 1, "status": "ok", "stages": {n: i.to_dict() for n, i in found.items()}})))
    else:
        typer.echo("\n\n".join(f"{i}\n  inputs:\n{i.inputs.indented}" for i in found.values()))
