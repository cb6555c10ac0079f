"""Stored traces of the examples: what has changed since they were written with `pytest --update-references`.

A change here is no error by itself, but one to explain. The runs are at a tight tolerance, so that another way to step changes nothing.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from strategies import TIGHTER

pytestmark = pytest.mark.regression
EXAMPLES = Path(__file__).parents[2] / "examples"
STORED = Path(__file__).parent / "references"
ACCELEROMETER, STACK = "01_accelerometer/accelerometer.toml", "02_stack/m_PrE.toml"


def _bench(need: str) -> td.Scenario:
    return td.Scenario("bench", boundaries={need: "24 [degC]"}, start="24 [degC]", duration="5 [h]")


DAY = {"mean": "24 [degC]", "amplitude": "3 [K]", "period": "2 [h]", "phase": 0.5}
DRIFT = {"times": ["0 [s]", "5 [h]"], "values": ["24 [degC]", "24.7 [degC]"]}
OFF = {"times": ["0 [s]", "3 [h]"], "values": ["2.168 [W]", "0 [W]"], "hold": True}

CASES = {
    "accelerometer_bench": (ACCELEROMETER, _bench("air")),
    "accelerometer_vacuum_as_printed": (ACCELEROMETER, _bench("air").vacuum(as_printed=True)),
    "accelerometer_day": (ACCELEROMETER, _bench("air").with_(boundaries={"air": DAY}, initial={"case": "30 [degC]"})),
    "stack_bench": (STACK, _bench("cv")),
    "stack_vacuum_as_printed": (STACK, _bench("cv").vacuum(as_printed=True)),
    "stack_drift_and_step": (STACK, _bench("cv").with_(boundaries={"cv": DRIFT}, loads={"ele.electronics": OFF})),
    "stack_cools_from_steady": (
        STACK,
        _bench("cv").with_(
            start="steady", schedule={"proc.power": {"times": ["0 [s]", "1 [h]"], "values": ["4.11 [W]", "2 [W]"], "after": "hold"}}
        ),
    ),
}


def _trace(name: str) -> tuple[str, np.ndarray]:
    """Return the header and the columns of a run: time, temperatures, heat flows and powers in the order of their names."""
    deck, scenario = CASES[name]
    # between the jumps, where every quantity has one value
    solution = td.simulate(td.load_model(EXAMPLES / deck), scenario, times=np.arange(150.0, 18000.0, 300.0), options=TIGHTER)
    columns = {"time_s": solution.times}
    columns |= {f"T {n} [K]": solution[n].kelvin for n in sorted(solution.nodes)}
    columns |= {f"Q {n} [W]": q for n, q in sorted(solution.heat_flows.items())}
    columns |= {f"P {n} [W]": p for n, p in sorted(solution.load_powers.items())}
    return ",".join(columns), np.column_stack(list(columns.values()))


@pytest.mark.parametrize("name", CASES)
def test_stored_trace(name: str, request: pytest.FixtureRequest) -> None:
    path = STORED / f"{name}.csv"
    header, table = _trace(name)
    if request.config.getoption("--update-references"):
        path.parent.mkdir(exist_ok=True)
        np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.10g")
        pytest.skip(f"{path.name} was written")
    assert path.is_file(), "no trace is stored; look at the run, then write it with pytest --update-references"
    assert path.read_text(encoding="utf-8").partition("\n")[0] == header
    stored = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.abs(table - stored).max() < 1e-6


def test_every_stored_trace_has_its_case() -> None:
    assert {p.stem for p in STORED.glob("*.csv")} == set(CASES)
