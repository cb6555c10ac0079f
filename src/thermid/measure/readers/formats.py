"""The formats of logs: each is recognised by what stands in the file, never by its name, and read into cells.

One line of `FORMATS` is one format; what reads text ends in `textfile`, what reads numbers in `series`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Final

from thermid.errors import MissingDataError
from thermid.measure.readers import binary, capture, labview, longform
from thermid.measure.readers.textfile import Cells, Layout, cells_of_text, decoded, read_bytes

BENCH: Final = "thermid.acquire.benchlog"
"""Module of the optional bench that reads its logs; the core names it and never imports it by itself."""


@dataclass(frozen=True)
class Format:
    """One format of logs.

    Parameters
    ----------
    name : str            What it is called.
    known_by : str        What it is recognised by, in words.
    recognised : function Of the first bytes of a file: whether it is one.
    read : function       Of all bytes, the name of the file and a separator or None: its cells.
    needs : str           Package that reads it, where an extra brings it.
    """

    name: str
    known_by: str
    recognised: Callable[[bytes], bool]
    read: Callable[[bytes, str, str | None], Cells]
    needs: str = ""


def _text(read: Callable[[str, str], Cells]) -> Callable[[bytes, str, str | None], Cells]:
    """Return a reader of bytes of one of text."""

    def of_bytes(data: bytes, file: str, separator: str | None) -> Cells:
        text, notes = decoded(data, file)
        cells = read(text, file)
        return replace(cells, notes=(*notes, *cells.notes))

    return of_bytes


def _plain(data: bytes, file: str, separator: str | None) -> Cells:
    text, notes = decoded(data, file)
    return longform.pivoted(longform.with_units_of_cells(cells_of_text(text, file, separator, notes)))


def _head(data: bytes) -> str:
    """Return the first characters of a text, whatever its encoding."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data[: len(data) // 2 * 2].decode("utf-16", "replace")
    return data.decode("latin-1").removeprefix("\xef\xbb\xbf")


def is_bench_log(data: bytes) -> bool:
    """Whether the first bytes of a file are those of a log of the bench."""
    head = data[:4096]
    return head.startswith(b"# thermid bench log") or b"# session {" in head


def _bench(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of a log of the bench, read by the optional package that writes it.

    Raises
    ------
    MissingDataError   When that package is not there.
    """
    try:
        reader = import_module(BENCH)
    except ImportError:
        raise MissingDataError(f"this is a log of the bench, and the package that reads it, {BENCH}, is not installed.", file) from None
    cells: Cells = reader.bench_cells(data, file)
    return cells


FORMATS: Final = (
    Format("bench log", "its first line", is_bench_log, _bench),
    Format("NI TDMS", "the bytes TDSm", lambda d: d[:4] == b"TDSm", binary.tdms, "npTDMS"),
    Format("HDF5", "its signature", lambda d: d[:8] == b"\x89HDF\r\n\x1a\n", binary.hdf5, "h5py"),
    Format("netCDF classic", "the bytes CDF", lambda d: d[:3] == b"CDF" and d[3:4] in b"\x01\x02", binary.netcdf),
    Format("MATLAB", "MATLAB 5.0 in its first line", lambda d: d[:10] == b"MATLAB 5.0", binary.matlab),
    Format("MATLAB 7.3", "MATLAB 7.3 in its first line", lambda d: d[:10] == b"MATLAB 7.3", binary.hdf5, "h5py"),
    Format("workbook", "a zip archive with xl/ or content.xml", binary.is_workbook, binary.workbook, "python-calamine"),
    Format("workbook of old Excel", "its signature", lambda d: d[:8] == binary.OLD_OFFICE, binary.workbook, "python-calamine"),
    Format("LabVIEW measurement", "LabVIEW Measurement in its first line", lambda d: labview.is_labview(_head(d)), _text(labview.read)),
    Format("InfluxDB annotated CSV", "#datatype or #group before a header", lambda d: longform.is_influx(_head(d)), _text(longform.influx)),
    Format("serial capture", "stamps with -> before each line", lambda d: capture.is_capture(_head(d)), _text(capture.read)),
    Format("text", "anything else that is text: columns divided by commas, semicolons or tabs", lambda d: True, _plain),
)
"""In the order in which they are tried."""

_HEAD: Final = 8192


def log_cells(path: Path, separator: str | None = None) -> Cells:
    """Return the cells of a log in any format that is known.

    Raises
    ------
    MissingDataError   When there is no such file, or the package that reads it is not installed.
    RecordError        When it cannot be read for certain.
    """
    data = read_bytes(path)
    name = path.name
    of = next(each for each in FORMATS if each.recognised(data[:_HEAD]))
    cells = of.read(data, name, separator)
    return replace(cells, layout=replace(cells.layout, format=of.name)) if cells.layout.format == Layout().format else cells
