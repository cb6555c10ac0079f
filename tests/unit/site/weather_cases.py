"""Weather files made up for tests: two days over a place near the equator, in the forms that weather comes in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

HOURS = np.arange(1, 49)
"""Ends of the hours. [h]"""
DRY = 27.0 + 4.0 * np.sin((HOURS - 9) / 12 * np.pi)
SUN = np.maximum(0.0, 900.0 * np.sin((HOURS % 24 - 6.5) / 12 * np.pi))

EPW_HEAD = """LOCATION,Made up,MA,XXX,invented,000000,-2.37,-44.40,-3.0,40.0
DESIGN CONDITIONS,0
TYPICAL/EXTREME PERIODS,0
GROUND TEMPERATURES,0
HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0
COMMENTS 1,invented
COMMENTS 2,
DATA PERIODS,1,1,Data,Sunday,1/1,1/2
"""


def epw(path: Path, missing: Sequence[int] = (), years: tuple[int, int] = (2026, 2026), skip: Sequence[int] = ()) -> Path:
    """Write an EPW file; dry bulb of the hours `missing` is 99.9, hours in `skip` are left out."""
    lines = []
    for k, hour in enumerate(HOURS):
        if k in skip:
            continue
        day, of_day = (int(hour) - 1) // 24, (int(hour) - 1) % 24 + 1
        dry = 99.9 if k in missing else DRY[k]
        values = [dry, 22.0, 75, 100900, 0, 0, 390.0, SUN[k], 0.8 * SUN[k], 0.25 * SUN[k], 0, 0, 0, 0, 90, 5.0, 3, 3, 9999, 99999, 9]
        values += ["999999999", 30, 0.1, 0, 88, 0.2, 0.0, 0]
        lines.append(",".join([f"{years[day]},1,{day + 1},{of_day},0,?9?9", *(f"{v}" for v in values)]))
    path.write_text(EPW_HEAD + "\n".join(lines) + "\n", encoding="ascii")
    return path


def tmy3(path: Path, missing: Sequence[int] = ()) -> Path:
    """Write a TMY3 file; dry bulb of the hours `missing` is -9900."""
    head = ["Date (MM/DD/YYYY)", "Time (HH:MM)", "ETR (W/m^2)", "ETRN (W/m^2)", "GHI (W/m^2)", "GHI source", "DNI (W/m^2)", "DHI (W/m^2)"]
    head += ["TotCld (tenths)", "Dry-bulb (C)", "Dew-point (C)", "RHum (%)", "Pressure (mbar)", "Wdir (degrees)", "Wspd (m/s)"]
    rows = []
    for k, hour in enumerate(HOURS):
        day, of_day = (int(hour) - 1) // 24, (int(hour) - 1) % 24 + 1
        dry = -9900.0 if k in missing else round(float(DRY[k]), 2)
        values = [f"01/{day + 1:02d}/1999", f"{of_day:02d}:00", 0, 0, round(SUN[k]), 1, round(0.8 * SUN[k]), round(0.25 * SUN[k])]
        rows.append(",".join(map(str, [*values, 3, dry, 22.0, 75, 1009, 90, 5.0])))
    text = "000000,MADE UP,XX,-3.0,-2.37,-44.40,40\n" + ",".join(head) + "\n" + "\n".join(rows) + "\n"
    path.write_text(text, encoding="ascii")
    return path


def table(path: Path, *, humidity: float = 75.0, missing: Sequence[int] = (), zone: str = "-03:00") -> Path:
    """Write a plain table, hourly; dry bulb of the rows `missing` is empty."""
    lines = ["# made up", "time,dry_bulb [degC],humidity [%],wind [m/s],global [W/m^2],rain [mm/h]"]
    for k in range(49):
        wet, wind, rain = humidity if k == 20 else 75, 5 if k < 24 else 0, 5 if k == 15 else 0
        dry = "" if k in missing else f"{27 + 4 * np.sin((k - 9) / 12 * np.pi):.3f}"
        sun = max(0.0, 900 * np.sin((k % 24 - 6) / 12 * np.pi))
        lines.append(f"2026-03-{21 + k // 24} {k % 24:02d}:00{zone},{dry},{wet},{wind},{sun:.1f},{rain}")
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path
