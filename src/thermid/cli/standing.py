"""What a command does with the standing of the values that its answer rests on: the first line, the key of JSON, the exit code."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    from thermid.campaign.hand import Filed
    from thermid.model.parts.standing import Standing
    from thermid.model.tree.model import Model

Accept = Annotated[
    list[str] | None,
    typer.Option("--accept", help="A stage that is accepted as it is: its state stays, the exit code does not count it; may be repeated."),
]
KeepValues = Annotated[
    bool, typer.Option("--keep-values", help="Keep values whose decks say otherwise by now; without it they are left out and listed.")
]
WINS = (2, 3, 4, 1, 5, 0)
"""Exit codes, the one that wins first."""


def leave(standing: Standing, code: int = 0) -> NoReturn:
    """End a command whose answer was given: with its own exit code, or that of the values which the answer rests on."""
    raise SystemExit(min(code, standing.exit_code, key=WINS.index))


def with_fitted(model: Model, file: Path | None, keep: bool = False) -> Model:
    """Return a model with a values file laid over it, as it is without a file; what the file lacks and what is left out is told first.

    Parameters
    ----------
    keep : bool     Whether to keep values that the decks give otherwise by now.
    """
    if file is None:
        return model
    from thermid.campaign.hand import filed

    found = filed(file, model, keep=keep)
    say_first(found, file)
    return found.model


def say_first(found: Filed, file: Path) -> None:
    """Tell what a values file lacks, what of it is left out, and what is hidden."""
    for line in (*found.lacks, *(f"{gone} --keep-values keeps it." for gone in found.gone), *found.hidden):
        typer.echo(f"{file.name}: {line}", err=True)
