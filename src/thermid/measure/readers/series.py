"""Series of samples, each with times of its own, as the cells of one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from thermid.measure.readers.textfile import Cells, Layout


class Series(NamedTuple):
    """Samples of one sensor.

    Parameters
    ----------
    name : str                  With its unit in a bracket, where known.
    texts : sequence of str     Its cells.
    times : sequence of float   Their times on an axis common to all series; they need not be in order. [s]
    stamps : sequence of str    The same as the file has them.
    lines : sequence of int     Where they stand in the file.
    """

    name: str
    texts: Sequence[str]
    times: Sequence[float]
    stamps: Sequence[str]
    lines: Sequence[int]


def merged(series: Sequence[Series], file: str, time: str, notes: tuple[str, ...], layout: Layout, start: str | None = None) -> Cells:
    """Return one row for each time that any series has; cells of the others are empty there, which the reader masks."""
    rows: dict[float, tuple[str, int]] = {}
    for each in series:
        for t, stamp, line in zip(each.times, each.stamps, each.lines, strict=True):
            rows.setdefault(t, (stamp, line))
    axis = sorted(rows)
    columns = [tuple(rows[t][0] for t in axis)]
    for each in series:
        values: Mapping[float, str] = dict(zip(each.times, each.texts, strict=True))
        columns.append(tuple(values.get(t, "") for t in axis))
    header = (time, *(each.name for each in series))
    return Cells(file, header, columns, [rows[t][1] for t in axis], notes, time=_bare(time), start=start, layout=layout)


def _bare(time: str) -> str:
    return time.partition(" [")[0]


def text_of(value: object) -> str:
    """Return a number, stamp or text as a cell."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, int | float):
        return "" if value != value else repr(value)
    stamp = getattr(value, "isoformat", None)
    return str(stamp()) if stamp is not None else str(value).strip()
