"""Published measurements that shipped examples need: where their originals lie, and how these become the logs of the example.

The originals are taken from their public address at one commit, or from a folder that holds copies of them, `OWNER/REPOSITORY/path`. They
are converted without MATLAB, and the samples are checked against sums that the example knows; nothing is filtered or filled in.
"""

from __future__ import annotations

import csv
import gzip
import hashlib
import io
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.error import URLError
from urllib.parse import quote
from urllib.request import urlopen

import numpy as np

from thermid.base.errors import MissingDataError, RecordError
from thermid.measure.readers import objects_of, series_of

ADDRESS = "https://raw.githubusercontent.com/{repository}/{commit}/{path}"
PUBLIC = "THERMID_PUBLIC"
"""Environment variable: a folder with copies of published repositories."""
DOWNLOAD_TIMEOUT = 30.0
"""Time for one file. [s]"""


@dataclass(frozen=True)
class Original:
    """One file of a published data set.

    Parameters
    ----------
    path : str          Where it lies in its repository.
    to : str            The log that is made of it, in the example's folder of data.
    convert : callable  (bytes, name) -> text of the log.
    sha256 : str        Of the parsed samples of the log, as `samples_sum` makes it; at least its beginning.
    """

    path: str
    to: str
    convert: Callable[[bytes, str], str]
    sha256: str = ""


@dataclass(frozen=True)
class DataSet:
    """A published data set.

    Parameters
    ----------
    repository, commit : str    On GitHub.
    licence, author : str       What its licence file says.
    files : tuple of Original
    """

    repository: str
    commit: str
    licence: str
    author: str
    files: tuple[Original, ...]

    @property
    def words(self) -> str:
        """Source and licence in a line."""
        return f"data: {self.author}, https://github.com/{self.repository}, commit {self.commit[:7]}, {self.licence} licence"


def samples_sum(text: str) -> str:
    """Return the SHA-256 of the numbers of a log in comma-separated form: each column as float64, in order, whatever their digits."""
    rows = [row for row in csv.reader(io.StringIO(text)) if row][1:]
    return hashlib.sha256(np.array(rows, dtype=np.float64).T.tobytes()).hexdigest()


def _plain(value: float) -> str:
    """Return a number with two decimals at most, as the published conversion writes it."""
    return f"{value:.2f}".rstrip("0").rstrip(".") or "0"


def tclab(data: bytes, name: str) -> str:
    """Return the log of a TCLab run: levels of both heaters and readings of both sensors from its two `timeseries`.

    Readings stand at their own times; a level is the one that holds there, the last of several at one time.

    Raises
    ------
    RecordError     When the file has not the objects u1u2 and y1y2.
    """
    series = {n: series_of(p) for n, p in objects_of(data, name).items()}
    levels, readings = series.get("u1u2"), series.get("y1y2")
    if levels is None or readings is None:
        raise RecordError(
            f"it holds {', '.join(series) or 'no objects'}, not the timeseries u1u2 and y1y2.", name, code="record.layout-unclear"
        )
    at = np.searchsorted(np.round(levels["Time"], 6), np.round(readings["Time"], 6), side="right") - 1
    held = levels["Data"][np.maximum(at, 0), :2]
    table = np.column_stack([held, readings["Data"]])
    rows = [f"{t:.2f},{','.join(map(_plain, row))}" for t, row in zip(readings["Time"].tolist(), table.tolist(), strict=True)]
    return "\n".join(["time_s,Q1_pct,Q2_pct,T1_C,T2_C", *rows, ""])


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


def _tclab_files() -> Iterator[Original]:
    root = "Simulink (MATLAB R2016a)"
    for heater in ("H1", "H2"):
        for level in range(10, 101, 10):
            for way in (f"000_{level:03d}", f"{level:03d}_000"):
                run = f"ens{heater}_{way}_en1"
                yield Original(f"{root}/Resultados/Step/ens01/{run}.mat", f"step/{run}.csv.gz", tclab)
    for kind, count in (("H1", 3), ("H2", 3), ("H1H2", 4)):
        for k in range(1, count + 1):
            run = f"ens_Identification{kind}_Random_{k:02d}"
            yield Original(f"{root}/Resultados/Random/{kind}/{run}.mat", f"random_{kind}/{run}.csv.gz", tclab)
    for k in (1, 2):
        run = f"ens_IdentificacaoH1_0to50_{k:02d}"
        yield Original(f"{root}/00-PeriodoDeAmostragem/Ensaios/{run}.mat", f"step0to50/{run}.csv.gz", tclab)


TCLAB = DataSet(
    "TiagoPrata/TCLabSP", "e8dfcb02fb74fcc8b5b3b7d4655f93f35bd81820", "MIT", "Copyright (c) 2019 Tiago Prata", tuple(_tclab_files())
)
"""Runs of a TCLab board in Sao Paulo; the campaign of the example has the sum of the samples of each."""

MOTOR = DataSet(
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
"""Three runs of a brushless motor without load."""


def copies(folder: Path | None) -> Path | None:
    """Return the folder with copies of published repositories, as given or of the environment; None for the public addresses."""
    return folder or (Path(os.environ[PUBLIC]) if os.environ.get(PUBLIC) else None)


def taken(source: DataSet, file: Original, folder: Path | None) -> bytes:
    """Return the bytes of an original, from a folder of copies or from its public address.

    Raises
    ------
    MissingDataError    When the folder has no copy, or the address cannot be reached.
    """
    if folder is not None:
        for place in (folder / source.repository / file.path, folder / source.repository.partition("/")[2] / file.path, folder / file.path):
            if place.is_file():
                return place.read_bytes()
        raise MissingDataError(
            f"no '{source.repository}/{file.path}' below '{folder}'. Get the repository (git clone https://github.com/"
            f"{source.repository}), or leave --from out to take the files from their public address.",
            str(folder),
        )
    address = ADDRESS.format(repository=source.repository, commit=source.commit, path=quote(file.path))
    try:
        with urlopen(address, timeout=DOWNLOAD_TIMEOUT) as answer:
            return bytes(answer.read())
    except (URLError, TimeoutError, OSError) as error:
        raise MissingDataError(
            f"{address} cannot be reached ({getattr(error, 'reason', error)}). Offline, set THERMID_PUBLIC to a folder with "
            "copies of repositories, OWNER/REPOSITORY/path; `thermid example` has --from FOLDER for it too.",
            source.repository,
        ) from None


def converted(source: DataSet, file: Original, folder: Path | None) -> bytes:
    """Return the log that is made of an original, packed where its name states this.

    Raises
    ------
    RecordError     When its samples are not those that the example knows.
    """
    text = file.convert(taken(source, file, folder), file.path.rpartition("/")[2])
    if file.sha256 and not samples_sum(text).startswith(file.sha256):
        raise RecordError(
            f"the samples of '{file.path}' have the checksum {samples_sum(text)[:16]}, not {file.sha256[:16]}: this is not the file "
            "of commit "
            f"{source.commit[:7]}.",
            source.repository,
            code="record.another-log",
        )
    return gzip.compress(text.encode(), mtime=0) if file.to.endswith(".gz") else text.encode()
