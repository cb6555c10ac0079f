"""Synthetic campaigns whose truths and constant errors are drawn as the stated priors say: fits, and a test that no stage saw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from recovery.cases import STACK, Z95, Bench, draw
from thermid.fit.calibration import calibrate
from thermid.measure.records import Record
from thermid.model.tree import Model, load_model, model_from_dict
from thermid.prediction.bands import predict
from thermid.simulation.runs import Scenario, simulate

STEP = 0.0625
"""Of a DS18B20. [K]"""


def m_pre() -> Bench:
    """m_PrE: both coefficients and the joint, from two tests; sensors to 0.25 K in steps of 1/16 K, meters to 1 %, a room that drifts."""
    ranges = {
        "proc.skin.effective_htc": (4.0, 9.0, "W/(m^2 K)"),
        "ele.skin.effective_htc": (1.6, 3.5, "W/(m^2 K)"),
        "stack.contact_conductance": (120.0, 500.0, "W/(m^2 K)"),
    }
    both, one = {"proc.electronics": 4.11, "ele.electronics": 2.168}, {"proc.electronics": 4.11, "ele.electronics": 0.0}
    sensors = {"T1": "proc.case", "T2": "ele.case"}
    return Bench(load_model(STACK), ranges, sensors, "cv", [(both, 0.0), (one, 0.0)], 0.25, 0.01, step=STEP)


def _part(area: str, watts: str) -> Model:
    skin = {"of": "case", "to": "air", "area": area, "effective_htc": {"value": "6 [W/(m^2 K)]", "min": 0.5, "max": 40}}
    return model_from_dict(
        {
            "title": f"Part of {watts}",
            "needs": ["air"],
            "offers": ["case", "skin"],
            "nodes": {"case": {"mass": "0.8 [kg]", "specific_heat": "900 [J/(kg K)]"}},
            "surfaces": {"skin": skin},
            "loads": {"heat": {"into": "case", "power": watts}},
        }
    )


def four_parts() -> Bench:
    """Four parts in a row, each with its own coefficient, three joints between them: seven values from two tests."""
    powers = {"a": 4.0, "b": 1.5, "c": 2.5, "d": 0.5}
    parts = {n: {"use": _part(f"{0.03 + 0.01 * k} [m^2]", f"{w} [W]"), "bind": {"air": "room"}} for k, (n, w) in enumerate(powers.items())}
    deck: dict[str, Any] = {"title": "Row", "needs": ["room"], "submodels": parts, "joints": {}}
    for first, second in ("ab", "bc", "cd"):
        contact = {"value": "250 [W/(m^2 K)]", "min": 20, "max": 3000}
        deck["joints"][first + second] = {
            "between": [f"{first}.skin", f"{second}.skin"],
            "area": "15 [cm^2]",
            "contact_conductance": contact,
            "mid": f"mid_{first}{second}",
        }
    ranges = {f"{n}.skin.effective_htc": (4.0, 9.0, "W/(m^2 K)") for n in powers}
    ranges |= {f"{j}.contact_conductance": (150.0, 400.0, "W/(m^2 K)") for j in deck["joints"]}
    every = {f"{n}.heat": w for n, w in powers.items()}
    one = {load: 0.0 for load in every} | {"a.heat": 6.0}
    sensors = {f"T{k}": f"{n}.case" for k, n in enumerate(powers, 1)}
    return Bench(model_from_dict(deck), ranges, sensors, "room", [(every, 0.0), (one, 0.0)], 0.25, 0.01, step=STEP)


CASES = {"m_PrE": m_pre, "four parts": four_parts}


@dataclass(frozen=True)
class Row:
    """One parameter or predicted temperature over all draws: deviation in standard errors, and half-width of the 95 % interval."""

    scores: np.ndarray
    halves: np.ndarray
    unit: str

    @property
    def coverage(self) -> float:
        """Share of draws whose 95 % interval holds the truth."""
        return float(np.mean(np.abs(self.scores) <= Z95))

    @property
    def half(self) -> float:
        """Median half-width, in per cent of the value for a parameter, in kelvin for a temperature."""
        return float(np.median(self.halves))


def unseen(bench: Bench) -> Scenario:
    """Return a test that no stage saw: a room at 45 C and powers of the first test times 1.5 and 0.5 in turn."""
    powers = {load: f"{w * (1.5 if k % 2 == 0 else 0.5)!r} [W]" for k, (load, w) in enumerate(bench.runs[0][0].items())}
    return Scenario("unseen", boundaries={bench.boundary: "45 [degC]"}, loads=powers, start="20 [degC]", duration="4 [h]")


def unbiased(record: Record) -> Record:
    """Return a record whose instruments claim to have no constant error."""
    return record.with_channels(*(replace(c, accuracy=None) for c in record.channels.values()))


def campaign(case: str, draws: int, seed: int, biases: bool = True) -> dict[str, Row]:
    """Return parameter, or predicted node, -> how intervals meet hidden truths; `biases` whether the fit knows of constant errors."""
    bench, rng = CASES[case](), np.random.default_rng(seed)
    given = unseen(bench)
    rows: dict[str, list[tuple[float, float]]] = {}
    for _ in range(draws):
        truth, records = draw(bench, rng)
        found = calibrate(bench.model, records if biases else [unbiased(r) for r in records], list(bench.ranges))
        hidden = bench.model.with_values({p: f"{v!r} [{bench.ranges[p][2]}]" for p, v in truth.items()})
        for p, v in truth.items():
            error = found[p].error / found[p].value
            rows.setdefault(p, []).append((float(np.log(found[p].in_unit / v)) / error, 100 * Z95 * error))
        end = simulate(hidden, given)
        told = predict(found, given, times=[7200.0, 14400.0], without=("structural", "misfit"))
        for node in bench.nodes.values():
            e = told[node].final
            rows.setdefault(node, []).append(((e.celsius - end[node].final) / e.error, Z95 * e.error))
    units: Mapping[str, str] = dict.fromkeys(bench.ranges, "%")
    return {k: Row(*np.array(several).T, units.get(k, "K")) for k, several in rows.items()}
