"""Published originals of this example: three runs of a brushless motor without load."""

from __future__ import annotations

import csv
import io

from thermid.app.examples import DataSet, Original
from thermid.base.errors import RecordError

TEMPERATURES = {"Winding Temp (°C)": "Winding_Temp_C", "Ambient (°C)": "Ambient_C", "Stator Body (°C)": "Stator_Body_C"}
CONTROLLER = {
    "Voltage (V)": "Voltage_V",
    "Current (A)": "Current_A",
    "Temperature (C)": "ESC_Temperature_C",
    "eRPM": "eRPM",
    "Throttle Duty": "Throttle_Duty_pct",
    "Motor Duty": "Motor_Duty_pct",
    "Phase Current (A)": "Phase_Current_A",
    "Power (W)": "Power_W",
}


def thermocouples(data: bytes, name: str) -> str:
    """Return the temperatures of a motor's run; times from the scan rate that the file states, which are finer than its stamps.

    Raises
    ------
    RecordError     When it states no scan rate.
    """
    lines = list(csv.reader(io.StringIO(data.decode("utf-8-sig"))))
    head = next((k for k, row in enumerate(lines) if row and row[0] == "Sample"), None)
    rate = next((float(row[0].partition(":")[2]) for row in lines[: head or 0] if row and row[0].startswith("Scan Rate")), None)
    if head is None or rate is None:
        raise RecordError("it has no row 'Sample' below a 'Scan Rate'.", name, code="record.layout-unclear")
    columns = [lines[head].index(c) for c in TEMPERATURES if c in lines[head]]
    names = [c for c in TEMPERATURES if c in lines[head]]
    order = [lines[head][c] for c in sorted(columns)]
    out = [",".join(["Time_s", *(TEMPERATURES[n] for n in order)])]
    for row in lines[head + 1 :]:
        if len(row) > max(columns):
            out.append(",".join([f"{round(int(row[0]) / rate, 3):g}" if names else "", *(f"{float(row[c]):g}" for c in sorted(columns))]))
    return "\n".join([*out, ""])


def controller(data: bytes, name: str) -> str:
    """Return the electrical values of a motor's controller, row by row; it has no clock.

    Raises
    ------
    RecordError     When a column is missing.
    """
    lines = list(csv.reader(io.StringIO(data.decode("utf-8-sig"))))
    missing = [c for c in CONTROLLER if c not in lines[0]]
    if missing:
        raise RecordError(f"it has no column {', '.join(missing)}.", name, code="record.layout-unclear")
    columns = [lines[0].index(c) for c in CONTROLLER]
    rows = [",".join(f"{float(row[c]):.6g}" for c in columns) for row in lines[1:] if len(row) > max(columns)]
    return "\n".join([",".join(CONTROLLER.values()), *rows, ""])


DATA = DataSet(
    "TasS-RV/Motor-Thermal-Modelling-Tool",
    "e94b107658671379781b3a0708aa592606619338",
    "MIT",
    "Copyright (c) 2025 TasS-RV",
    tuple(
        Original(f"{run}/{source}", f"{run}_{kind}.csv", convert, known)
        for run, kind, source, convert, known in (
            ("Run1-Throttle4", "temperatures", "DAQ_run1.csv", thermocouples, "813eaa5fd908b622"),
            ("Run1-Throttle4", "esc", "Export_DataAPD_run1.csv", controller, "e343296227006067"),
            ("Run2-Throttle100", "temperatures", "DAQ_run2.csv", thermocouples, "b3dacb5c497b7236"),
            ("Run2-Throttle100", "esc", "Export_DataAPD_run2.csv", controller, "21a86a1f2fad86a0"),
            ("Run3-Throttle48", "temperatures", "DAQ_Run3.csv", thermocouples, "cd61fbb07b2fa946"),
            ("Run3-Throttle48", "esc", "Export_DataAPD_run3.csv", controller, "088b4fb3b0397071"),
        )
    ),
)
