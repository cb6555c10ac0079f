"""Published originals of this example: runs of a TCLab board in Sao Paulo; its campaign has the sum of the samples of each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from thermid.app.examples import DataSet, Original
from thermid.base.errors import RecordError
from thermid.measure.readers import objects_of, series_of


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


def _tclab_files() -> Iterator[Original]:
    """Yield the logs of the heater board with their places in the repository."""
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


DATA = DataSet(
    "TiagoPrata/TCLabSP", "e8dfcb02fb74fcc8b5b3b7d4655f93f35bd81820", "MIT", "Copyright (c) 2019 Tiago Prata", tuple(_tclab_files())
)
