"""`thermid diagram`: a model as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from thermid.cli.pages import Force


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(diagram)


def diagram(
    deck: Annotated[Path, typer.Argument(help="A deck (TOML).")],
    to: Annotated[Path, typer.Option("--to", help="The SVG file to write.")],
    force: Force = False,
    fold: Annotated[list[str], typer.Option("--fold", help="A submodel drawn as one mass; may be repeated.")] = [],  # noqa: B006
) -> None:
    """Draw a model as SVG: masses, conductors by kind, loads, boundaries, submodels as boxes."""
    from thermid.errors import ScenarioError
    from thermid.files import PICTURE, write_text
    from thermid.model.deck.modelfile import load_model
    from thermid.reporting.diagrams.diagram import diagram as draw

    if to.suffix.lower() != ".svg":
        raise ScenarioError(f"a diagram is written as SVG; '{to.name}' does not end in .svg.", "--to")
    write_text(to, draw(load_model(deck), folded=fold) + "\n", PICTURE)
    typer.echo(f"diagram: {to}")
