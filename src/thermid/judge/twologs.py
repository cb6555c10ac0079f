"""Two logs with columns of the same names: readings and a simulation that anybody made."""

from __future__ import annotations

import re
from pathlib import Path

from thermid.errors import RecordError
from thermid.measure import Record, read_record
from thermid.measure.readers.columns import name_and_unit
from thermid.measure.readers.formats import log_cells

_METER = re.compile(r"[PQIU](_|\d|\Z)")
"""How the name of a column begins that holds a power, a heat, a current or a voltage."""
_TEMPERATURES = ("degC", "°C", "K", "degF")


def read_two(measured: Path, simulated: Path, *, accuracy: str = "", time: str | None = None) -> tuple[Record, Record]:
    """Return the temperatures that two logs have in common; a column with another unit, or named as a meter's (``P_ACC``), is none.

    Parameters
    ----------
    measured, simulated : Path  The logs.
    accuracy : str              Standard deviation of the sensors' constant error, as text.
    time : str                  The time column, where it has no usual name.

    Raises
    ------
    RecordError   When they have no column in common.
    """
    first, second = _columns(measured), _columns(simulated)
    common = [c for c in first if c in second and c != (time or first[0])]
    if not common:
        raise RecordError(
            f"'{measured.name}' and '{simulated.name}' have no column of one name besides the time: {', '.join(first)} against "
            f"{', '.join(second)}. Give the columns of the simulation the names of the sensors.",
            "two logs",
        )
    extra: dict[str, object] = {"accuracy": accuracy} if accuracy else {}
    one = read_record(measured, {c: {"node": c} | extra for c in common}, time=time, name=measured.stem)
    return one, read_record(simulated, {c: {"node": c} for c in common}, time=time, name=f"{simulated.stem}, simulated")


def _columns(path: Path) -> list[str]:
    """Return the names of a log's columns, without units."""
    named = [name_and_unit(c) for c in log_cells(path).header]
    return [n for at, (n, u) in enumerate(named) if at == 0 or u in _TEMPERATURES or (u is None and not _METER.match(n))]
