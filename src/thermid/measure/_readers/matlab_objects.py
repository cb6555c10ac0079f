"""Objects of MATLAB (`timeseries`) in a MAT file of version 5 to 7.2, as structures of time and data.

In: the bytes of the file. Out: variable -> structure with the fields that the object stores. MATLAB keeps the properties of objects in a
part of the file of its own, the subsystem: a table of names, classes and objects, and one cell for each value. Its layout is not
published by its maker; it is read here as the files show it (MAT-File Level 5 for all that is published: MathWorks, MAT-File Format,
R2016a, chapter 1). What does not follow it is refused, and no value is guessed.
"""

from __future__ import annotations

import io
import struct
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, cast

import numpy as np

from thermid.base.errors import RecordError

_MARK: Final = 0xDD000000
"""First number of what stands for an object."""
_HEADER: Final = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
_DEEPEST: Final = 8


class _NotSoError(Exception):
    """The subsystem has another layout than the known one."""


@dataclass(frozen=True, eq=False)
class _Subsystem:
    """The tables of all objects of a file.

    Parameters
    ----------
    classes : list of str       Name of each class, from 1.
    objects : list of tuple     (class, block of simple properties, block of others) of each object, from 1.
    simple, other : list        Blocks of (name, kind, value) triples.
    values : list               The cells that kind 1 points to.
    names : list of str         Names of classes and properties.
    """

    classes: list[str]
    objects: list[tuple[int, int, int]]
    simple: list[list[tuple[int, int, int]]]
    other: list[list[tuple[int, int, int]]]
    values: list[Any]
    names: list[str]

    @classmethod
    def read(cls, table: bytes, values: list[Any]) -> _Subsystem:
        """Parse the tables in the first cell of the subsystem.

        Raises
        ------
        _NotSoError   When they are laid out otherwise.
        """
        version, count = struct.unpack_from("<II", table, 0)
        if not (2 <= version <= 4 and count < 100000):
            raise _NotSoError(f"version {version}")
        offsets = struct.unpack_from("<6I", table, 8)
        names = [n.decode("ascii", "replace") for n in table[40 : offsets[0]].split(b"\0")][:count]
        if len(names) != count:
            raise _NotSoError("names")
        words = [np.frombuffer(table[a:b], dtype="<u4") for a, b in pairwise(offsets)]
        classes = [names[int(row[1]) - 1] if row[1] else "" for row in words[0].reshape(-1, 4)]
        objects = [(int(row[0]), int(row[3]), int(row[4])) for row in words[2].reshape(-1, 6)]
        return cls(classes, objects, list(_blocks(words[1])), list(_blocks(words[3])), values, names)

    def fields(self, number: int, deep: int = 0) -> tuple[str, dict[str, Any]]:
        """Return class and stored properties of an object; objects among them become structures too.

        Raises
        ------
        _NotSoError   When there is no such object, or objects are nested too deep.
        """
        if not 0 < number < len(self.objects) or deep > _DEEPEST:
            raise _NotSoError(f"object {number}")
        of, simple, other = self.objects[number]
        block = self.simple[simple] if simple else self.other[other] if other else []
        out: dict[str, Any] = {}
        for name, kind, value in block:
            if kind == 1:  # a value of its own, two cells behind the table and an empty one
                out[self.names[name - 1]] = self.opened(self.values[value + 2], deep)
            elif kind == 2:
                out[self.names[name - 1]] = bool(value)
            else:
                out[self.names[name - 1]] = self.names[value - 1] if 0 < value <= len(self.names) else ""
        return self.classes[of], out

    def opened(self, value: Any, deep: int = 0) -> Any:
        """Return a value, or the properties of the object that it stands for."""
        number = _object_number(value)
        return value if number is None else self.fields(number, deep + 1)[1]


def _blocks(words: Any) -> Iterator[list[tuple[int, int, int]]]:
    """Yield blocks of triples, each behind its count and filled up to eight bytes."""
    at = 0
    while at < words.size:
        count = int(words[at])
        end = at + 1 + 3 * count
        if end > words.size:
            raise _NotSoError("properties")
        rows = words[at + 1 : end].reshape(-1, 3).tolist()
        yield [(int(a), int(b), int(c)) for a, b, c in rows]
        at = end + end % 2


def _object_number(value: Any) -> int | None:
    """Return the number of the object that a value stands for; None where it stands for none."""
    if not isinstance(value, np.ndarray) or value.dtype != np.uint32:
        return None
    flat = value.reshape(-1)
    return int(flat[4]) if flat.size == 6 and int(flat[0]) == _MARK and int(flat[1]) == 2 and int(flat[2]) == int(flat[3]) == 1 else None


def objects_of(data: bytes, file: str) -> dict[str, Mapping[str, Any]]:
    """Return variable -> properties of each object of a MAT file; empty where it holds none.

    Parameters
    ----------
    data : bytes    The file.
    file : str      Its name, for messages.

    Raises
    ------
    RecordError     When the objects are not laid out as those of MATLAB R2010b to R2024.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import varmats_from_mat

    numbers_of_objects: dict[str, int] = {}
    workspace: Any = None
    try:
        for _, part in varmats_from_mat(cast("Any", io.BytesIO(data))):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of functions and objects, which are what is looked for
                held = loadmat(cast("Any", part))
            workspace = held.get("__function_workspace__", workspace)
            for value in held.values():
                if type(value).__name__ == "MatlabOpaque" and (number := _object_number(value[0]["arr"])) is not None:
                    numbers_of_objects[value[0]["s0"].decode()] = number
        if workspace is None or not numbers_of_objects:
            return {}
        cells = _cells(workspace.tobytes())
        tables = _Subsystem.read(cells[0].tobytes(), cells)
        return {name: tables.fields(number)[1] for name, number in numbers_of_objects.items()}
    except (_NotSoError, ValueError, IndexError, KeyError, TypeError, struct.error) as error:
        raise RecordError(
            f"its MATLAB objects ({', '.join(numbers_of_objects) or 'of unknown name'}) have an unknown layout ({error}). In MATLAB: "
            "t = x.Time; T = x.Data; save('log.mat', 't', 'T', '-v7').",
            file,
            code="record.layout-unclear",
        ) from None


def _cells(subsystem: bytes) -> list[Any]:
    """Return the cells of the subsystem: the tables, an empty one, and the values."""
    from scipy.io import loadmat
    from scipy.io.matlab import varmats_from_mat

    # the subsystem is a MAT file but for its header
    for _, part in varmats_from_mat(cast("Any", io.BytesIO(_HEADER + subsystem[8:]))):
        for value in loadmat(cast("Any", part)).values():
            if isinstance(value, np.ndarray) and "MCOS" in (value.dtype.names or ()):
                return list(value["MCOS"][0, 0][0]["arr"].reshape(-1))
    raise _NotSoError("no table of objects")


def series_of(properties: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return `Time` (samples,) and `Data` (samples, columns) of a `timeseries`; None for another object.

    A time that MATLAB stores as start, increment and length is computed from these.
    """
    data, clock = _stored(properties, "Data"), _stored(properties, "TimeInfo")
    times = _stored(properties, "Time")
    if isinstance(clock, Mapping) and not np.size(times):
        times = _stored(clock, "Time")
    if isinstance(clock, Mapping) and not np.size(times):
        start, step, count = (np.asarray(_stored(clock, n)).reshape(-1) for n in ("Start", "Increment", "Length"))
        if start.size == step.size == count.size == 1 and np.isfinite(step[0]):
            times = start[0] + step[0] * np.arange(int(count[0]))
    if not isinstance(data, np.ndarray) or not isinstance(times, np.ndarray) or times.size < 1:
        return None
    table = np.squeeze(data) if times.size > 1 else data.reshape(1, -1)
    if table.ndim == 2 and table.shape[0] != times.size and table.shape[1] == times.size:
        table = table.T
    return {"Time": times.reshape(-1).astype(float), "Data": table} if table.shape[:1] == (times.size,) else None


def _stored(properties: Mapping[str, Any], name: str) -> Any:
    """Return a property, stored under its name or with an underscore behind it; an empty array where there is none."""
    return properties.get(f"{name}_", properties.get(name, np.zeros(0)))
