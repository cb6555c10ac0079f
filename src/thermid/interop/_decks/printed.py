"""Temperatures that SINDA printed, or that ESATAN left in a file of results (TMD).

A TMD of ESATAN-TMS 2018 is an HDF5 file: `AnalysisSet1` holds the nodes (number, model) and the models, each `DataGroup` one solution
with its times and a number for each time, node and attribute. Older TMDs are binary files of a layout that no public text describes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError, ThermidError, cap, raising
from thermid.base.extensions import optional
from thermid.base.files import read_bytes
from thermid.base.units import ICE_POINT
from thermid.interop._decks.cards import SUBMODEL
from thermid.interop._decks.statements import DeckReading

_SUBMODEL = re.compile(r"\s*SUBMODEL NAME = (\w+)")
_TIME = re.compile(r"^\s*(?:PROBLEM TIME\s+TIMEN|TIME)\s*=\s*([-+.\dE]+)")
_PRINT = re.compile(r"\bT\s+(\d+)\s*=\s*([-+.\dE]+)")
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_ROUNDING: Final = float(np.finfo(np.float32).epsneg)
"""Share of a number that single precision rounds to; a TMD has doubles, but no solution is exact to their last digit."""
_KIND: Final = "file.another-kind"


@dataclass(frozen=True)
class Printed:
    """Temperatures of one print, in the file's own unit.

    Parameters
    ----------
    routine : str          What the tool ran: STEADY, TRANSIENT or the name of an older routine; empty where it is not printed.
    time : float           Its problem time, in the file's unit of time.
    numbers : dict         Node path -> temperature.
    digits : dict          Node path -> half a unit of its last digit.
    time_digit : float     Half a unit of the last digit of the time.
    """

    routine: str
    time: float
    numbers: Mapping[str, float]
    digits: Mapping[str, float]
    time_digit: float = 0.0

    @property
    def settled(self) -> bool:
        """Whether it is of a steady state."""
        return not self.routine.startswith(("TRANS", "FWD", "FORW", "ATS"))


def printed_temperatures(path: str | Path) -> list[Printed]:
    """Return the temperatures that a deck's own tool left, in their order: SINDA's printed output, or a TMD of ESATAN.

    Raises
    ------
    DeckError           When the file has no temperatures, or is of another kind.
    MissingExtraError   When a TMD needs h5py, and it is not installed.
    """
    data, file = read_bytes(path), str(path)
    if not data.startswith(_HDF5):
        if b"\0" not in data:
            return sinda_print(path)
        read = "Of SINDA the printed output (.out) is read, of ESATAN a TMD that is an HDF5 file (ESATAN-TMS 2018 writes them)"
        raise DeckError(f"this is a binary file of results. {read}; an older binary TMD, a CSR or a .sav is not.", file, code=_KIND)
    library = optional("h5py", "a TMD", file)
    try:
        with library.File(io.BytesIO(data), "r") as opened:
            return [output for _, analysis in _in_order(opened, "AnalysisSet") for output in _solutions(analysis, file)]
    except ThermidError:
        raise
    except (KeyError, ValueError, IndexError, TypeError, OSError, RecursionError) as error:
        raise DeckError(
            f"this HDF5 file is damaged or no TMD of ESATAN (version 01.00 of the file is known): {error}.", file, code=_KIND
        ) from None


def _in_order(group: Any, kind: str) -> list[tuple[int, Any]]:
    """Return the numbered members of a group, AnalysisSet1 or DataGroup1, in the order of their numbers."""
    members = [(int(name.removeprefix(kind)), member) for name, member in group.items() if name.startswith(kind)]
    if not members:
        raise KeyError(f"it has no {kind}1")
    return sorted(members, key=lambda member: member[0])


def _solutions(analysis: Any, file: str) -> Iterator[Printed]:
    """Yield the temperatures at each time of each solution [degC]; a single time is a steady state. Inactive nodes are left out."""
    models = analysis["models"][()]
    nodes = [f"{_owner(models, model)}.T{number}" for number, model in analysis["thermalNodes"][()].tolist()]
    attribute = list(analysis["thermalNodesRealAttributes"]).index(b"Temperature")
    kind = list(analysis["thermalNodesStringAttributes"]).index(b"Type")
    for _, solution in _in_order(analysis, "DataGroup"):
        times, real = solution["times"][()], solution["thermalNodesRealData"]
        if real.shape[:2] != (times.size, len(nodes)):
            raise ValueError(f"it has {times.size} times and {len(nodes)} nodes, but values of {real.shape[0]} and {real.shape[1]}")
        if real.dtype.itemsize * real.size > cap("unpacked"):
            raise DeckError(f"it has {real.size} values.{raising('unpacked')}", file, code="cap.exceeded")
        celsius = real[:, :, attribute] + (float(analysis.attrs["TAbs"]) - ICE_POINT)
        inactive = solution["thermalNodesStringData"][0, :, kind] == b"X"
        for time, row in zip(times.tolist(), celsius, strict=True):
            numbers = {name: float(t) for name, t, out in zip(nodes, row, inactive, strict=True) if not out}
            digits = {name: _ROUNDING * abs(t) for name, t in numbers.items()}
            yield Printed("TRANSIENT" if times.size > 1 else "STEADY", time, numbers, digits, _ROUNDING * abs(time))


def _owner(models: Any, k: int) -> str:
    """Return the name of the k-th model (from 1): those of the models around it, outermost first, and its own, joined by underscores."""
    _, parent, _ = models[k - 1].tolist()
    name = models[k - 1]["modelName"].decode("latin-1").strip().upper()
    return f"{_owner(models, parent)}_{name}" if parent else name


def sinda_print(path: str | Path) -> list[Printed]:
    """Return the prints of a SINDA output in their order.

    Raises
    ------
    DeckError   When the file prints no temperatures.
    """
    prints: list[Printed] = []
    numbers: dict[str, float] = {}
    digits: dict[str, float] = {}
    submodel, routine, time, time_digit, headed = "", "", 0.0, 0.0, False
    for row in DeckReading().open(Path(path)).split("\n"):
        if row.startswith(" MODEL ="):
            headed = True
        elif headed and row.strip():
            routine, headed = row.strip(), False
        elif match := _SUBMODEL.match(row):
            submodel = match[1]
        elif match := _TIME.search(row):
            time, time_digit, routine = float(match[1]), _half_digit(match[1]), "TRANSIENT" if "DTIMEU" in row else routine
        elif "OUTPUT TEMPERATURES" in row:  # SINDA/G has one submodel
            submodel = SUBMODEL
        for number, word in _PRINT.findall(row) if submodel else ():
            key = f"{submodel}.T{int(number)}"
            if not numbers or key in numbers or (prints[-1].routine, prints[-1].time) != (routine, time):
                numbers, digits = {}, {}
                prints.append(Printed(routine, time, numbers, digits, time_digit))
            numbers[key], digits[key] = float(word), _half_digit(word)
    if not prints:
        raise DeckError("the file has no printed temperatures (T 1= ... under SUBMODEL NAME).", str(path), code="file.another-kind")
    return prints


def _half_digit(word: str) -> float:
    """Return half a unit of the last digit of a printed number."""
    mantissa, _, exponent = word.partition("E")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
