"""A plain table, header and numbers, whose columns are read in the units that its header or its reader names."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from thermid.errors import NameNotFoundError, RecordError, ThermidError, nearest
from thermid.measure.readers.columns import decimal_sign, name_and_unit, numbers
from thermid.measure.readers.formats import log_cells
from thermid.measure.readers.stamps import clock_column, read_times
from thermid.measure.readers.textfile import Cells
from thermid.measure.record.channel import FloatArray
from thermid.units import require, unit


@dataclass(frozen=True, eq=False)
class PlainTable:
    """A table of text.

    Parameters
    ----------
    cells : Cells   What stands in it.
    time : str      The time column; by default the only one with a usual name.
    """

    cells: Cells
    time: str | None = None

    @property
    def file(self) -> str:
        """The name of the file."""
        return self.cells.file

    @cached_property
    def heads(self) -> list[tuple[str, str | None]]:
        """Name and unit of every column."""
        return [name_and_unit(h) for h in self.cells.header]

    @property
    def names(self) -> list[str]:
        """Names of the columns."""
        return [name for name, _ in self.heads]

    @cached_property
    def _decimal(self) -> str:
        return decimal_sign(self.cells, None)

    @cached_property
    def _clock(self) -> tuple[FloatArray, str | None]:
        try:
            clock = clock_column(self.cells, self.time)
        except NameNotFoundError:
            if self.time is not None:
                raise
            raise RecordError(f"which column is the time? Say time = '...'; there are {', '.join(self.names)}.", self.file) from None
        read = read_times(self.cells, clock, self._decimal, None, clock.unit)
        times, stamp = read.values, read.start
        if times.size < 2:
            raise RecordError("a table over time needs two times.", self.file)
        back = np.flatnonzero(np.diff(times) <= 0)
        if back.size:
            k = int(back[0])
            raise RecordError(
                f"time does not go on: {times[k]:g} s is followed by {times[k + 1]:g} s.", self.cells.where(k + 1, clock.name)
            )
        return times, stamp

    @property
    def times(self) -> FloatArray:
        """Times (samples,); from the first stamp where the table has stamps. [s]"""
        return self._clock[0]

    @property
    def stamp(self) -> str | None:
        """The first stamp, or None where the table has seconds."""
        return self._clock[1]

    def _at(self, name: str) -> int:
        if name not in self.names:
            raise NameNotFoundError(f"no column '{name}'.{nearest(name, self.names)}", self.file)
        return self.names.index(name)

    def column(self, name: str, slot: str, usual: str = "") -> FloatArray:
        """Return the values (samples,) of a column, NaN where one is missing. [SI]

        Parameters
        ----------
        name : str    The column.
        slot : str    What it must be: a unit or `temperature`.
        usual : str   Unit where the header names none; that of the slot by default.

        Raises
        ------
        NameNotFoundError   When there is no such column.
        RecordError         When a cell is no number.
        UnitError           When the header's unit is of another dimension.
        """
        at = self._at(name)
        parsed = numbers(self.cells.columns[at], self._decimal)
        if isinstance(parsed, int):
            raise RecordError(f"'{self.cells.columns[at][parsed]}' is no number.", self.cells.where(parsed, name))
        text = usual if usual and self.heads[at][1] is None else self.heads[at][1] or ("K" if slot == "temperature" else slot)
        if slot == "1" and text in ("deg", "°"):
            text = "1"
        try:
            of = unit(text)
            require(of.dimension, slot, text, of.absolute)
        except ThermidError as error:
            raise error.located(self.cells.where(None, name)) from None
        return parsed * float(of.factor) + float(of.offset)

    def whole(self, name: str, slot: str, usual: str = "") -> FloatArray:
        """Return the values (samples,) of a column without holes. [SI]

        Raises
        ------
        RecordError   At the first hole; and as `column`.
        """
        values = self.column(name, slot, usual)
        gone = np.flatnonzero(~np.isfinite(values))
        if gone.size:
            raise RecordError("here is no value. Fill it, or take the line out.", self.cells.where(int(gone[0]), name))
        return values


def read_plain(path: str | Path, time: str | None = None) -> PlainTable:
    """Return a plain table of a file, in any format of `formats`; lines that start with '#' are comments."""
    return PlainTable(log_cells(Path(path)), time)
