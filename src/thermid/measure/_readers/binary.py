"""Logs in binary files as cells: NI TDMS, MATLAB, HDF5, netCDF and workbooks, each read by a library of its own.

Numbers become text with all their digits, so that units, clocks and faults are read in one place for every format. These readers run in a
process of their own, see `confined`, and leave the errors of libraries to it.
"""

from __future__ import annotations

import io
import re
import struct
import sys
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from importlib.util import find_spec
from typing import Any, Final, cast

import numpy as np

from thermid.base.errors import MissingExtraError, RecordError, UnitError, cap, missing, optional, raising
from thermid.base.units import DAY, require, unit as parsed_unit
from thermid.measure._readers.confined import confined
from thermid.measure._readers.headers import spelt
from thermid.measure._readers.matlab_objects import objects_of, series_of
from thermid.measure._readers.stamps import MATLAB_DAYS, SPREADSHEET_EPOCH
from thermid.measure._readers.textfile import Cells, ChannelSeries, Layout, cells_of_text, merged, text_of

_TIMES: Final = ("time", "t", "time_s", "timestamp", "datetime", "tout", "zeit", "tempo", "date_time", "x_value", "tempos", "elapsed")
_SINCE: Final = re.compile(r"(?P<unit>\w+) since (?P<stamp>.+)\Z")

Vectors = dict[str, tuple[Any, str]]
"""Name -> samples (samples,), unit as text; both empty where unknown."""


MEMORY_OVER_UNPACKED: Final = 5.0
"""Memory that reading a file may take, over what it may unpack to. [-]"""
Reader = Callable[[bytes, str, str | None], Cells]


def in_child(read: Reader, module: str = "") -> Reader:
    """Return a reader that runs one of the readers below in a process of its own.

    Parameters
    ----------
    read : callable     The reader.
    module : str        Module that it needs, as it is imported; its memory is not counted as that of the file.
    """

    def of_bytes(data: bytes, file: str, separator: str | None) -> Cells:
        """Read a file in a process of its own with limited memory; refuse it where its library is not installed."""
        if module and (sys.modules.get(module, module) is None or find_spec(module) is None):
            raise MissingExtraError(missing([module], "this kind of file"), file)
        memory = MEMORY_OVER_UNPACKED * cap("unpacked")
        # cells as they were before `to_json`
        held = confined(to_json, data, memory, module, reader=read.__name__, file=file, separator=separator)
        held |= {"header": tuple(held["header"]), "columns": [tuple(c) for c in held["columns"]], "notes": tuple(held["notes"])}
        return Cells(**held | {"prompt": frozenset(held["prompt"]), "layout": Layout(**held["layout"])})

    return of_bytes


def to_json(data: bytes, reader: str, file: str, separator: str | None) -> dict[str, Any]:
    """Return the cells that a reader, given by its name, finds, as JSON can hold them."""
    cells: Cells = globals()[reader](data, file, separator)
    return vars(cells) | {"prompt": sorted(cells.prompt), "layout": vars(cells.layout)}


def _check_unpacked_size(size: float, file: str) -> None:
    """Refuse a size [bytes] above the cap for unpacked files.

    Raises
    ------
    RecordError   With the cap.
    """
    if size > cap("unpacked"):
        raise RecordError(
            f"it unpacks to {size / 1e6:.0f} MB or more. Save the channels that are needed.{raising('unpacked')}", file, code="cap.exceeded"
        )


def _inflated(data: bytes, most: int) -> int:
    """Return the unpacked length of zlib data [bytes], counted until it exceeds `most`."""
    engine, out = zlib.decompressobj(), 0
    while out <= most and data and not engine.eof:
        out += len(engine.decompress(data, 1 << 20))
        data = engine.unconsumed_tail
    return out


def tdms(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of an NI TDMS file; channels of groups with other samples are put on one axis of times.

    Raises
    ------
    RecordError   When a channel has neither a waveform's times nor a time channel in its group.
    """
    library = optional("nptdms", "this kind of file", file)
    with library.TdmsFile.read(io.BytesIO(data)) as opened:
        cut = bool(opened.file_status.incomplete_final_segment)
        groups = [(group.name, {c.name: c for c in group.channels() if len(c)}) for group in opened.groups()]
        groups = [(name, channels) for name, channels in groups if channels]
        begun = _beginning(channels for _, channels in groups)
        several = len(groups) > 1
        series = [one for name, channels in groups for one in _tdms_series(name if several else "", channels, begun, file)]
    if not series:
        raise RecordError("the TDMS file has no samples.", file, code="record.no-samples")
    start = None if begun is None else str(begun.isoformat())
    notes = ("the last segment of the file is cut short; the samples before it were read",) if cut else ()
    return merged(series, file, "time [s]", notes, Layout("NI TDMS", ""), start)


def _beginning(groups: Iterator[Mapping[str, Any]]) -> datetime | None:
    """Return the earliest start of a waveform or stamp of a time channel; None without either."""
    out = []
    for channels in groups:
        for channel in channels.values():
            start = channel.properties.get("wf_start_time")
            if start is not None and "wf_increment" in channel.properties:
                out.append(_moment(start))
            elif np.issubdtype(channel.dtype, np.datetime64):
                out.append(_moment(channel[0]))
    return min(out) if out else None


def _moment(value: Any) -> datetime:
    """Return an instant of numpy or of a TDMS property as a datetime. [UTC]"""
    return cast("datetime", np.datetime64(value, "us").astype(datetime))


def _tdms_series(group: str, channels: Mapping[str, Any], begun: datetime | None, file: str) -> list[ChannelSeries]:
    """Return the channels of one group with their times.

    Raises
    ------
    RecordError   When a channel has no times.
    """
    time_channel = next((n for n, c in channels.items() if np.issubdtype(c.dtype, np.datetime64)), None)
    time_channel = time_channel or next((n for n in channels if n.lower().partition(" ")[0].partition("[")[0] in _TIMES), None)
    out = []
    for name, channel in channels.items():
        if name == time_channel:
            continue
        times = _tdms_times(channel, channels.get(time_channel) if time_channel else None, begun)
        if times is None or len(times) != len(channel):
            raise RecordError(
                f"channel '{name}' has no times: neither wf_increment nor a time channel of as many samples in its group.",
                file,
                code="record.time-unclear",
            )
        unit = str(channel.properties.get("unit_string", "") or channel.properties.get("NI_UnitDescription", "")).strip()
        shown = f"{group}/{name}" if group else name
        texts = [text_of(v) for v in channel[:].tolist()]
        out.append(ChannelSeries(_named(shown, unit), texts, times, [repr(t) for t in times], range(1, len(times) + 1)))
    return out


def _tdms_times(channel: Any, clock: Any, begun: datetime | None) -> list[float] | None:
    """Return the times of a channel from the start of the file, by its waveform or its group's time channel; None without either. [s]"""
    if channel.properties.get("wf_increment"):
        offset = float(channel.properties.get("wf_start_offset", 0.0))
        start = channel.properties.get("wf_start_time")
        shift = (_moment(start) - begun).total_seconds() if start is not None and begun is not None else 0.0
        step = float(channel.properties["wf_increment"])
        return [round(shift + offset + step * k, 9) for k in range(len(channel))]
    if clock is None:
        return None
    if np.issubdtype(clock.dtype, np.datetime64):
        assert begun is not None
        return [float(t) for t in (clock[:] - np.datetime64(begun)) / np.timedelta64(1, "s")]
    return [float(t) for t in clock[:]]


def _named(name: str, unit: str) -> str:
    """Return ``name [unit]``, or the name where it ends with a unit already or there is none."""
    return f"{name} [{unit}]" if unit and not name.rstrip().endswith(("]", ")")) else name


def matlab(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of a MATLAB file of version 5 to 7.2: vectors of one length, also in structures and objects of time and data.

    Raises
    ------
    RecordError   When it has no time beside vectors of its length, or only objects that no published layout describes.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadWarning

    _check_unpacked_size(_matlab_size(data), file)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MatReadWarning)  # objects have no names there; `objects_of` reads them
        held = loadmat(cast("Any", io.BytesIO(data)), squeeze_me=True, struct_as_record=True)
    opaque = any("MatlabOpaque" in type(value).__name__ for value in held.values())
    return of_variables(held, file, _of_series(objects_of(data, file), file) if opaque else {})


def _matlab_size(data: bytes) -> int:
    """Return the unpacked size of a MATLAB file of version 5, counted no further than just beyond the cap. [bytes]"""
    if len(data) < 128 or data[126:128] not in (b"IM", b"MI"):
        return len(data)
    order, at, out = "<" if data[126:128] == b"IM" else ">", 128, 128
    while at + 8 <= len(data) and out <= cap("unpacked"):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        packed = kind == 15  # miCOMPRESSED
        out += _inflated(data[at + 8 : at + 8 + size], int(cap("unpacked"))) if packed else 8 + size
        at += 8 + size + (0 if packed else -size % 8)
    return out


def _of_series(objects: Mapping[str, Mapping[str, Any]], file: str) -> Vectors:
    """Return the time and the columns of `timeseries` objects as vectors.

    Raises
    ------
    RecordError   When two of them have different times.
    """
    out: Vectors = {}
    clock = ""
    for name, properties in objects.items():
        series = series_of(properties)
        if series is None or len(series["Time"]) < 2:
            continue
        if clock and not np.array_equal(out["Time"][0], series["Time"]):
            raise RecordError(
                f"'{clock}' and '{name}' have different times. Save one of them in a separate file: save('log.mat', '{clock}').",
                file,
                code="record.times-differ",
            )
        clock = clock or name
        out["Time"] = series["Time"], "s"
        out |= _flattened(name, series["Data"])
    return out


def of_variables(held: Mapping[str, Any], file: str, series: Vectors | None = None) -> Cells:
    """Return the cells of the variables of a MATLAB file and of the columns of its objects (`series`); see `matlab`.

    Raises
    ------
    RecordError   When no variable is a time.
    """
    vectors: Vectors = dict(series or {})
    objects = [name for name, value in held.items() if "MatlabOpaque" in type(value).__name__ or "Function" in type(value).__name__]
    for name, value in held.items():
        if not name.startswith("__") and name not in objects:
            vectors |= _flattened(name, value)
    if objects and not _clock_of(vectors):
        raise RecordError(
            f"'{objects[0]}' is a MATLAB object (timetable, table, or a timeseries without numbers), "
            "whose layout is not published. In MATLAB: "
            f"t = {objects[0]}.Time; T = {objects[0]}.Data; save('log.mat', 't', 'T', '-v7').",
            file,
            code="record.layout-unclear",
        )
    return _of_vectors(vectors, file, "MATLAB")


def _flattened(name: str, value: Any) -> Vectors:
    """Return name -> vector of a variable: columns of a matrix, fields of a structure, signals of a Simulink log."""
    if isinstance(value, np.ndarray | np.void) and value.dtype.names:
        if value.ndim == 0 or value.size == 1:
            fields = np.asarray(value).reshape(-1)[0]
            out: Vectors = {}
            for field in value.dtype.names:
                label = _label(fields) if field == "values" else ""
                inner = label or ("" if field in ("values", "signals") else field)
                out |= _flattened(f"{name}.{inner}" if inner and not label else label or name, fields[field])
            return out
        rows = enumerate(value.reshape(-1), 1)
        return {n: v for k, row in rows for n, v in _flattened(f"{name}.{k}", np.array(row, dtype=value.dtype)).items()}
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub" or value.size < 2:
        return {}
    if value.ndim == 1:
        return {name: (value, "")}
    return {f"{name}_{k + 1}": (value[:, k], "") for k in range(value.shape[1])} if value.ndim == 2 else {}


def _label(fields: Any) -> str:
    """Return the label of a Simulink signal; empty where it has none."""
    names = fields.dtype.names or ()
    return str(fields["label"]) if "label" in names and isinstance(fields["label"], str | np.str_) else ""


def _clock_of(vectors: Vectors) -> str:
    """Return the name of the first vector that is called a time; empty where none is."""
    return next((name for name in vectors if re.split(r"[./]", name)[-1].lower().partition(" ")[0] in _TIMES), "")


def _of_vectors(vectors: Vectors, file: str, kind: str) -> Cells:
    """Return the cells of a time vector and of all vectors as long as it.

    Raises
    ------
    RecordError   When none is called a time, or none is as long as it.
    """
    clock = _clock_of(vectors)
    if not clock:
        held = ", ".join(f"{n} ({len(v)})" for n, (v, _) in vectors.items()) or "no numeric vectors"
        raise RecordError(
            f"no vector has the name of a time ({', '.join(_TIMES[:6])}); it holds {held}. Rename the vector with the times.",
            file,
            code="record.time-unclear",
        )
    times, unit = vectors.pop(clock)
    alike = {name: vector for name, vector in vectors.items() if len(vector[0]) == len(times)}
    other = [name for name in vectors if name not in alike]
    if not alike:
        raise RecordError(
            f"no vector is as long as '{clock}' ({len(times)} samples); there are {', '.join(vectors) or 'none'}.",
            file,
            code="record.shape",
        )
    texts, unit, start, name = _clock_texts(times, unit, re.split(r"[./]", clock)[-1], kind)
    header = (f"{name} [{unit}]" if unit else name, *(_named(n, u) for n, (_, u) in alike.items()))
    columns = [texts, *(tuple(text_of(v) for v in np.asarray(values).tolist()) for values, _ in alike.values())]
    notes = (f"left out, because their length differs from that of '{clock}': {', '.join(other)}",) if other else ()
    return Cells(
        file, header, columns, list(range(1, len(times) + 1)), notes, time=name, start=start, layout=Layout(kind, ""), commas=False
    )


def _clock_texts(times: Any, unit: str, name: str, kind: str) -> tuple[tuple[str, ...], str, str | None, str]:
    """Return times as cells, with their unit, start and name; days of MATLAB and times since a date are converted."""
    values = np.asarray(times)
    if values.dtype.kind == "M":
        return tuple(np.datetime_as_string(values).tolist()), "", None, name
    if values.dtype.kind in "SUO":
        return tuple(v.decode() if isinstance(v, bytes) else str(v) for v in values.tolist()), "", None, name
    if since := _SINCE.match(unit):
        return _since(values, since, name)
    first, last = float(values[0]), float(values[-1])
    if kind.startswith("MATLAB") and not unit and MATLAB_DAYS[0] < first <= last < MATLAB_DAYS[1]:
        day = SPREADSHEET_EPOCH + timedelta(days=first - MATLAB_DAYS[2])
        # a day since year 0 has room for 1e-5 s
        return tuple(repr(round(v, 4)) for v in ((values - first) * DAY).tolist()), "s", day.isoformat(), name
    return tuple(repr(v) for v in values.tolist()), unit, None, name


def _since(values: Any, since: re.Match[str], name: str) -> tuple[tuple[str, ...], str, str | None, str]:
    """Return times since a date, as netCDF's conventions write them, as times from the first one; values as of `_clock_texts`."""
    unit, stamp = spelt(since["unit"]), since["stamp"].strip().removesuffix("UTC").strip()
    try:
        of = parsed_unit(unit)
        require(of.dimension, "s", unit)
        first = datetime.fromisoformat(stamp) + timedelta(seconds=float(values[0]) * float(of.factor))
    except (ValueError, UnitError):
        return tuple(repr(v) for v in values.tolist()), unit, stamp, name
    return tuple(repr(v) for v in (values - values[0]).tolist()), unit, first.isoformat(), name


def hdf5(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of an HDF5 file (also netCDF 4 and MATLAB 7.3): data sets of one dimension and one length, units from attributes.

    Raises
    ------
    RecordError   When it has no time, or is damaged.
    """
    library = optional("h5py", "this kind of file", file)
    vectors: Vectors = {}
    unpacked = 0

    def visit(name: str, item: Any) -> None:
        """Refuse an item whose values are in other files, and add up what it unpacks to."""
        nonlocal unpacked
        links = [k for k in item if isinstance(item.get(k, getlink=True), library.ExternalLink)] if isinstance(item, library.Group) else []
        is_vector = isinstance(item, library.Dataset) and "#" not in name and item.ndim > 0 and item.size > 1
        if links or (is_vector and (item.external or item.is_virtual)):
            how = "an external link" if links else "a virtual data set" if item.is_virtual else "external storage"
            raise RecordError(
                f"'{'/'.join([name, *links[:1]]).lstrip('/')}' is {how}: its values are in other files, which are not read. "
                "Save them in this one.",
                file,
                code="record.values-elsewhere",
            )
        if not is_vector:
            return
        unpacked += item.size * item.dtype.itemsize
        _check_unpacked_size(unpacked, file)
        values = np.squeeze(item[()])
        unit = next((_plain(item.attrs[key]) for key in ("units", "unit", "Units", "Unit") if key in item.attrs), "")
        if item.dtype.names:
            vectors.update({field: (values[field], "") for field in item.dtype.names})
        elif values.ndim == 1:
            vectors[name] = (values, unit)
        elif values.ndim == 2 and values.dtype.kind in "fiu":
            rows = values if values.shape[0] > values.shape[1] else values.T
            vectors.update({f"{name}_{k + 1}": (rows[:, k], unit) for k in range(rows.shape[1])})

    with library.File(io.BytesIO(data), "r") as opened:
        visit("", opened)
        opened.visititems(visit)
    return _of_vectors(vectors, file, "MATLAB 7.3" if data[:10] == b"MATLAB 7.3" else "HDF5")


def _plain(value: Any) -> str:
    """Return an attribute of a file as text."""
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0] if value.size else ""
    return (value.decode() if isinstance(value, bytes) else str(value)).strip()


def netcdf(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of a netCDF file of version 3: variables of one dimension, units from attributes.

    Raises
    ------
    RecordError   When it has no time, or is damaged.
    """
    from scipy.io import netcdf_file

    with netcdf_file(io.BytesIO(data), mmap=False) as opened:
        vectors: Vectors = {
            name: (np.array(v[:]).astype(v[:].dtype.newbyteorder("=")), _plain(getattr(v, "units", "")))
            for name, v in opened.variables.items()
            if len(v.shape) == 1 and v.shape[0] > 1
        }
    return _of_vectors(vectors, file, "netCDF classic")


def workbook(data: bytes, file: str, separator: str | None) -> Cells:
    """Return the cells of a workbook (.xlsx, .xls, .ods): the sheet with the most numbers.

    Raises
    ------
    RecordError   When no sheet has samples, or the file is damaged.
    """
    try:
        _check_unpacked_size(
            sum(part.file_size for part in zipfile.ZipFile(io.BytesIO(data)).infolist()) if data[:2] == b"PK" else 0.0, file
        )
    except zipfile.BadZipFile:
        raise RecordError(
            "this is a binary file, not a text log (a workbook or archive). Export it as CSV.", file, code="record.damaged"
        ) from None
    library = optional("python_calamine", "this kind of file", file)
    book = library.CalamineWorkbook.from_filelike(io.BytesIO(data))
    sheets = {name: book.get_sheet_by_name(name).to_python() for name in book.sheet_names}
    best = max(sheets, key=lambda name: _numbers(sheets[name]), default="")
    if not best or not _numbers(sheets[best]):
        raise RecordError("no sheet of the workbook holds numbers.", file, code="record.no-samples")
    text = "\n".join("\t".join(_cell(cell) for cell in row) for row in sheets[best]) + "\n"
    cells = cells_of_text(text, file, "\t")
    others = [name for name in sheets if name != best and _numbers(sheets[name])]
    notes = (f"sheet '{best}' was read; not read: {', '.join(others)}",) if others else ()
    layout = Layout("workbook", "", "cells of a sheet", cells.layout.preamble, cells.layout.units_row)
    return Cells(
        file, cells.header, cells.columns, cells.lines, (*cells.notes, *notes), cells.synthetic, commas=cells.commas, layout=layout
    )


def _numbers(rows: Sequence[Sequence[Any]]) -> int:
    """Return how many cells of a sheet are numbers."""
    return sum(isinstance(cell, int | float) and not isinstance(cell, bool) for row in rows for cell in row)


def _cell(value: Any) -> str:
    """Return a cell as text; whole numbers without a point, as they are seen."""
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return repr(value.total_seconds()) if isinstance(value, timedelta) else re.sub(r"[\t\r\n]+", " ", text_of(value))
