"""The document's laboratory in files of its instruments, SYNTHETIC: logs of the virtual laboratory as its programs would keep them.

DS18B20 sensors come as a serial capture with a banner, accelerometers as a LabVIEW file of ProcSISNAV at 1 Hz with a clock of its own,
powers as a spreadsheet saved in Brazil (date and hour in two columns, semicolons, decimal commas).
"""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import numpy as np

SISNAV = Path(__file__).parents[2] / "examples" / "sisnav"
NOISES = {"T": "0.2 [K]", "A": "0.4 [K]"}
LATE = {"proc": 5.0, "potencia": 30.0}
"""When the first sample of each further file was taken, after the first one of the Arduino. [s]"""
HEAD = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\nMulti_Headings\tNo\nX_Columns\tNo\n"
    "Time_Pref\tAbsolute\nOperator\tSYNTHETIC\nDate\t2026/11/20\nTime\t09:58:00,25\n***End_of_Header***\t\n\t\n"
)


def _clock(seconds: float) -> str:
    whole = int(seconds)
    return f"{10 + whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def _arduino(times: np.ndarray, columns: dict[str, np.ndarray]) -> str:
    lines = [f"09:59:58.102 -> SYNTHETIC capture, {len(columns)} x DS18B20, 12 bit, ice point at 0 C"]
    for k in range(0, times.size, 10):
        pairs = "  ".join(f"{name}: {np.round(16.0 * v[k]) / 16.0:.4f} C" for name, v in columns.items())
        lines.append(f"{_clock(times[k])}.000 -> {pairs}")
    return "\n".join(lines) + "\n"


def _labview(times: np.ndarray, columns: dict[str, np.ndarray]) -> str:
    first = int(np.searchsorted(times, LATE["proc"]))
    count, size = len(columns), times.size - first

    def row(key: str, text: str) -> str:
        return f"{key}\t" + f"{text}\t" * count + "\n"

    body = [HEAD, f"Channels\t{count}" + "\t" * count + "\n", row("Samples", str(size)), row("Date", "2026/11/20")]
    body += [row("Time", f"{_clock(LATE['proc'])},0"), row("Y_Unit_Label", "Deg C"), row("X_Dimension", "Time"), row("X0", "0,0E+0")]
    body += [
        row("Delta_X", "1,000000"),
        "***End_of_Header***" + "\t" * (count + 1) + "\n",
        "X_Value\t" + "\t".join(columns) + "\tComment\n",
    ]
    rows = zip(*(v[first:] for v in columns.values()), strict=True)
    return "".join(body) + "".join("\t" + "\t".join(f"{v:.6f}".replace(".", ",") for v in values) + "\n" for values in rows)


def _planilha(times: np.ndarray, columns: dict[str, np.ndarray]) -> str:
    first = int(np.searchsorted(times, LATE["potencia"]))
    lines = ["SYNTHETIC;fonte de bancada", ";".join(["Data", "Hora", *(f"{name} (W)" for name in columns)])]
    for k in range(first, times.size, 10):
        numbers = (f"{v[k]:.4f}".replace(".", ",") for v in columns.values())
        lines.append(";".join(["20/11/2026", _clock(times[k]), *numbers]))
    return "\n".join(lines) + "\n"


def written(logs: Path, folder: Path, only: tuple[str, ...] = (), decks: Path = SISNAV) -> Path:
    """Write decks, files of the instruments and campaign of the document into a folder, and return the path of the campaign.

    Parameters
    ----------
    logs : path     Logs of the virtual laboratory.
    only : tuple    Stages that are kept; all of them where empty.
    decks : path    Folder of the decks and of their campaign.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "thermid.toml").write_text("")
    for deck in decks.glob("*.toml"):
        shutil.copy(deck, folder / deck.name)
    text = (decks / "campaign.toml").read_text()
    content = tomllib.loads(text)
    stages = ["[[" + part for part in text.split("[[")[1:] if part.startswith(("stages]]", "verdicts]]"))]
    kept = [s for s in stages if not only or any(f'"{name}"' in s.splitlines()[1] for name in only)]
    tables = {}
    for name, table in content["records"].items():
        files = sorted(logs.glob(Path(table.get("files", table.get("file"))).name))
        for file in files:
            record = name if "file" in table else file.stem
            if any(f'"{record}"' in s for s in kept):
                tables[record] = (file, table["channels"])
    out = ['title = "SISNAV from the files of the instruments"', 'note = "SYNTHETIC: no log was measured."']
    for record, (file, channels) in tables.items():
        out += _record(record, file, channels, folder)
    path = folder / "campaign.toml"
    path.write_text("\n".join(out) + "\n" + "".join(kept))
    return path


def _record(record: str, file: Path, channels: dict[str, dict[str, str]], folder: Path) -> list[str]:
    """Write the files of one test, and return the lines of its records."""
    header = file.read_text().splitlines()[1].split(",")
    values = dict(zip(header, np.loadtxt(file, delimiter=",", skiprows=2).T, strict=True))
    times = values.pop("time_s")
    kinds = {"arduino": ("txt", "T", _arduino), "proc": ("lvm", "A", _labview), "potencia": ("csv", "P", _planilha)}
    lines, joined = [], []
    for kind, (ending, letter, write) in kinds.items():
        own = {c: v for c, v in values.items() if c[0] == letter}
        if not own:
            continue
        first = not lines
        name = record if first else f"{record}_{kind}"
        (folder / f"{record}_{kind}.{ending}").write_text(write(times, own))
        part = [f"[records.{name}]", f'file = "{record}_{kind}.{ending}"']
        part += ['prepare = [{ resample = "30 [s]" }]'] if letter != "P" else []
        part += [f"[records.{name}.channels]"]
        keys = {c: ", ".join(f'{k} = "{v}"' for k, v in channels[c].items()) for c in own}
        part += [f"{c} = {{ {text} }}" for c, text in keys.items()]
        lines.append(part)
        joined += [] if first else [f'{{ record = "{name}", offset = "{LATE[kind]:g} [s]" }}']
    lines[0].insert(2, f"joined = [{', '.join(joined)}]")
    return [line for part in lines for line in part]
