"""The plot of B3: time and memory against the number of cells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np


def plot(sections: list[dict[str, Any]], path: Path) -> None:
    """Write the plot of transient and steady runs, each with its exponent."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (time, memory) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for section in sections:
        for name in dict.fromkeys(row["name"] for row in section["results"]):
            rows = [row for row in section["results"] if row["name"] == name]
            size, seconds, peak = (np.array([row[k] for row in rows], dtype=float) for k in ("nodes", "cpu_seconds", "peak_MB"))
            power = f", exponent {np.polyfit(np.log(size), np.log(seconds), 1)[0]:.2f}" if len(rows) > 1 else ""
            style = "o-" if name == "thermid" else "s--"
            time.loglog(size, seconds, style, label=f"{name}, {section['part']}{power}")
            memory.loglog(size, peak, style, label=f"{name}, {section['part']}")
    time.set(xlabel="cells", ylabel="processor time [s]")
    memory.set(xlabel="cells", ylabel="peak memory of the process [MB]")
    for axes in (time, memory):
        axes.grid(True, which="both", alpha=0.3)
        axes.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
