"""``thermid look``: what is in a log, before anything is made of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from thermid.cli.pages import Force


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("look")(look)


def look(
    logs: Annotated[list[Path], typer.Argument(help="Logs in any format: text, workbook, LabVIEW, TDMS, MATLAB, HDF5, netCDF.")],
    time: Annotated[str | None, typer.Option("--time", help="The time column, where it cannot be told.")] = None,
    separator: Annotated[str | None, typer.Option("--separator", help="Separator of the columns, where it cannot be told.")] = None,
    decimal: Annotated[str | None, typer.Option("--decimal", help="Decimal sign, where the file has both.")] = None,
    clock: Annotated[str | None, typer.Option("--clock", help="Form of the stamps, such as '%d/%m/%Y %H:%M'.")] = None,
    unit: Annotated[str | None, typer.Option("--time-unit", help="Unit of the times, where they are numbers without one.")] = None,
    to: Annotated[Path | None, typer.Option("--svg", help="Picture to write (SVG), of one log.")] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Show layout, clock, gaps, faults and columns of logs, and the lines for a campaign. Exit code 2 if times cannot be read."""
    import shutil

    from thermid.cli.output import clean
    from thermid.errors import RecordError
    from thermid.files import PICTURE, write_text
    from thermid.reporting.pictures.look import look as of

    if to is not None and (len(logs) > 1 or to.suffix.lower() != ".svg"):
        raise RecordError("one log is drawn as one SVG. Give one log, and a name that ends in .svg.", "--svg")
    seen = [of(log, time=time, separator=separator, decimal=decimal, clock=clock, unit=unit) for log in logs]
    if to is not None:
        write_text(to, seen[0].svg() + "\n", PICTURE)
    if as_json:
        bad = any(each.problem for each in seen)
        typer.echo(json.dumps(clean({"schema": 1, "status": "error" if bad else "ok", "logs": [each.as_object() for each in seen]})))
    else:
        width = shutil.get_terminal_size((110, 24)).columns
        typer.echo("\n\n".join("\n".join(each.lines(width)) for each in seen))
        if to is not None:
            typer.echo(f"picture: {to}")
    raise SystemExit(2 if any(each.problem for each in seen) else 0)
