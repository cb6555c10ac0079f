"""What a command does with the standing of the values that its answer rests on: the first line, the key of JSON, the exit code."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    from thermid.knowledge.standing import Standing
    from thermid.model.model import Model

__all__ = ["Accept", "leave", "with_fitted"]

Accept = Annotated[
    list[str] | None,
    typer.Option("--accept", help="A stage that is accepted as it is: its state stays, the exit code does not count it; may be repeated."),
]
WINS = (2, 3, 4, 1, 5, 0)
"""Exit codes, the one that wins first."""


def leave(standing: Standing, code: int = 0) -> NoReturn:
    """End a command whose answer was given: with its own exit code, or that of the values which the answer rests on."""
    raise SystemExit(min(code, standing.exit_code, key=WINS.index))


def with_fitted(model: Model, file: Path | None) -> Model:
    """Return a model with a file of fitted values laid over it; as it is without a file."""
    if file is None:
        return model
    from thermid.identify.values import load_values

    return model.with_values(load_values(file).assignments, file.name)
