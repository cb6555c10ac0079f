"""What a step of 1 s of an exported FMU of 100 nodes costs a host in C, with inputs at rest, and with one that changes at each step.

    python scripts/fmu_steps.py [--steps 20000]

A chain of 100 nodes that cools by convection, and a plate of 10 by 10 that radiates too. Processor time, the least of five runs; the host's
own calls (two readings of the clock) are in it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import thermid as td
from unit.interop.hosts import unpacked


def network(rows: int) -> td.Model:
    """Return 100 nodes in rows; a row alone does not radiate."""
    names, across = [f"n{k}" for k in range(100)], 100 // rows
    conductors: dict[str, dict[str, object]] = {}
    for k, name in enumerate(names):
        for other, there in ((k + 1, k % across < across - 1), (k + across, k + across < 100)):
            if there:
                conductors[f"c{k}_{other}"] = {"kind": "conduction", "between": [name, names[other]], "conductance": "0.4 [W/K]"}
        conductors[f"h{k}"] = {"kind": "convection", "between": [name, "air"], "htc": "6 [W/(m^2 K)]", "area": "4 [cm^2]"}
        if rows > 1:
            conductors[f"r{k}"] = {"kind": "radiation", "between": [name, "air"], "emissivity": 0.8, "area": "4 [cm^2]"}
    nodes = {n: {"capacitance": "9 [J/K]"} for n in names}
    loads = {"heat": {"into": names[55], "power": "8 [W]"}}
    return td.model_from_dict({"title": "network", "needs": ["air"], "nodes": nodes, "conductors": conductors, "loads": loads})


def main() -> None:
    """Print the four figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=20_000)
    steps = parser.parse_args().steps
    scenario = td.Scenario("bench", boundaries={"air": "20 [degC]"}, duration="1 [h]", start="20 [degC]")
    for rows, shape in ((1, "chain"), (10, "plate, radiating")):
        with tempfile.TemporaryDirectory() as folder:
            fmu = unpacked(network(rows), scenario, Path(folder))
            for what, swing in (("inputs at rest", {}), ("an input that changes at each step", {"load.heat": (1.0, 0.05)})):
                for _ in range(5):
                    fmu.run(["T.n55"], float(steps), 1.0, swing=swing)
                print(f"{shape}, {what}: {min(fmu.spent[-5:]) / 1000.0:.1f} us a step")


if __name__ == "__main__":
    main()
