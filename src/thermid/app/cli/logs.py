"""Commands that read a log: look, settle."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.app.cli.options import Force, Json, say
from thermid.base.errors import RecordError
from thermid.base.files import FileKinds
from thermid.measure import looks as measured
from thermid.measure.readers import parts_between_restarts
from thermid.reporting.looks import log_drawing


def look(
    logs: Annotated[list[Path], typer.Argument(help="Logs in any format: text, workbook, LabVIEW, TDMS, MATLAB, HDF5, netCDF.")],
    time: Annotated[str | None, typer.Option("--time", help="The time column, where it cannot be told.")] = None,
    separator: Annotated[str | None, typer.Option("--separator", help="Separator of the columns, where it cannot be told.")] = None,
    decimal: Annotated[str | None, typer.Option("--decimal", help="Decimal sign, where the file has both.")] = None,
    clock: Annotated[str | None, typer.Option("--clock", help="Form of the stamps, such as '%d/%m/%Y %H:%M'.")] = None,
    unit: Annotated[str | None, typer.Option("--time-unit", help="Unit of the times, where they are numbers without one.")] = None,
    to: Annotated[Path | None, typer.Option("--svg", help="Picture to write (SVG), of one log.")] = None,
    cut: Annotated[Path | None, typer.Option("--cut", help="Folder for the parts of one log between restarts of its board.")] = None,
    join: Annotated[Path | None, typer.Option("--join", help="Log to write (CSV): all logs on the clock of the first.")] = None,
    offset: Annotated[
        list[float], typer.Option("--offset", help="When each further log begins on the clock of the first, in their order. [s]")
    ] = [],  # noqa: B006
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Show layout, clock, gaps, faults and columns of logs.

    The lines for a campaign are printed too. Exit code 2 if times cannot be read.
    """
    for option, one in (("--svg", to), ("--cut", cut)):
        if one is not None and len(logs) > 1:
            raise RecordError("it is of one log. Give one log.", option, code="value.wrong-kind")
    if cut is not None:
        logs = _cut(logs[0], cut)
    if to is not None:
        FileKinds.DRAWING.check_ending(to)
    looks = [measured.look(log, time=time, separator=separator, decimal=decimal, clock=clock, unit=unit) for log in logs]
    if not all(file_look.problem for file_look in looks):  # options of one log's clock are not those of another
        looks = [measured.look(file_look.path) if file_look.problem else file_look for file_look in looks]
    looks = measured.named_apart(looks)
    if to is not None:
        FileKinds.DRAWING.save_text(to, log_drawing(looks[0]) + "\n")
    bad, clocks = any(file_look.problem for file_look in looks), measured.clocks_of(looks)
    parts = ["\n".join(file_look.lines(shutil.get_terminal_size((110, 24)).columns)) for file_look in looks]
    parts += [f"{len(logs)} parts between restarts, each on a clock of its own, written to {cut}"] if cut is not None else []
    if join is not None:
        FileKinds.LOG.save_text(join, looks[0].joined(looks[1:], offset or [measured.stated_offset(c) for c in clocks]))
    lines = measured.clock_lines(looks, clocks) if cut is None else []
    first = [lines.pop(0)] if lines and lines[0].startswith("check: ") else []
    parts = [*first, *parts, *(["\n".join(lines)] if lines else [])]
    unread = (
        f", without {', '.join(bare)}: no unit is known. A unit in the header takes a column along, [1] that of plain numbers"
        if (bare := [name for file_look in looks for name in file_look.unjoined])
        else ""
    )
    text = "\n\n".join(parts) + (f"\npicture: {to}" if to is not None else "")
    text += "\n".join([f"\njoined log: {join}{unread}", *([] if offset else _places(clocks))]) if join is not None else ""
    joining = {"clocks": clocks} if clocks else {}
    say(as_json, {"status": "error" if bad else "ok", "logs": [file_look.as_object() for file_look in looks], **joining}, text)
    raise SystemExit(2 if bad else 0)


def _places(clocks: Sequence[dict[str, Any]]) -> list[str]:
    """Return where a joined log has each further log, and what common steps and stamps leave of that; entries as of `clocks_of`."""
    ranges = [f"; what is known of its clock leaves {' .. '.join(measured.offset_range(c))} s" if "at" in c else "" for c in clocks]
    places = [measured.stated_offset(c) for c in clocks]
    return [
        f"  {c['file']} begins at {late:.6g} s there{wide or ', by its stamps alone'}"
        for c, late, wide in zip(clocks, places, ranges, strict=True)
        if late is not None
    ]


def _cut(log: Path, folder: Path) -> list[Path]:
    """Write the parts of a log between restarts of its board, each on its own clock; return their paths."""
    parts = parts_between_restarts(log)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{log.stem}_{k}.csv" for k in range(1, len(parts) + 1)]
    for path, text in zip(paths, parts, strict=True):
        FileKinds.LOG.save_text(path, text)
    return paths
