"""A campaign made in Python: a box alone, two boxes together, and a verdict on a record held out."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.campaign.stages import Campaign

BOX: dict[str, Any] = {
    "title": "Box",
    "use": "Temperature of the case on the bench",
    "needs": ["air"],
    "offers": ["case", "skin"],
    "nodes": {"case": {"mass": {"value": "1.5 [kg]", "source": "derived"}, "specific_heat": "900 [J/(kg K)]"}},
    "surfaces": {
        "skin": {
            "of": "case",
            "to": "air",
            "area": "500 [cm^2]",
            "effective_htc": {"value": "6 [W/(m^2 K)]", "min": 1, "max": 15, "source": "published", "basis": "Table 2"},
        }
    },
    "loads": {"heat": {"into": "case", "power": "4 [W]"}},
}
PAIR: dict[str, Any] = {
    "title": "Pair",
    "needs": ["room"],
    "offers": ["mid"],
    "joints": {
        "stack": {
            "between": ["a.skin", "b.skin"],
            "area": "20 [cm^2]",
            "contact_conductance": {"value": "200 [W/(m^2 K)]", "min": 50, "max": 1000, "source": "assumed"},
            "mid": "mid",
        }
    },
    "set": {"b.skin.effective_htc": "3 [W/(m^2 K)]"},
}
SECONDS = 7200.0


def record(name: str, model: td.Model, boundary: str, nodes: dict[str, str], powers: dict[str, float], seed: int) -> td.Record:
    """A log of a model: noise on every sensor, the powers and a constant room logged."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, SECONDS + 1.0, 60.0)
    bench = td.Scenario(
        name, boundaries={boundary: "24 [degC]"}, loads={k: f"{v} [W]" for k, v in powers.items()}, start="24 [degC]", duration=SECONDS
    )
    solution = td.simulate(model, bench, times=times)
    channels = {
        s: td.Channel.from_array(
            s, solution[n].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.05, accuracy=0.2
        )
        for s, n in nodes.items()
    }
    for load, watts in powers.items():
        channels[f"P {load}"] = td.Channel.from_array(f"P {load}", np.full(times.size, watts), quantity="power", role="load", target=load)
    return td.Record.from_arrays(name, times, channels)


@pytest.fixture(scope="session")
def box() -> td.Model:
    return td.model_from_dict(BOX)


@pytest.fixture(scope="session")
def campaign(box: td.Model) -> Campaign:
    """Two stages and a verdict, all on synthetic records."""
    pair = td.model_from_dict({**PAIR, "submodels": {k: {"use": box, "bind": {"air": "room"}} for k in "ab"}})
    truth = {"skin.effective_htc": "5.2 [W/(m^2 K)]"}
    alone = record("alone", box.with_values(truth), "air", {"T box": "case"}, {"heat": 4.0}, 1)
    true_pair = pair.with_values({"a.skin.effective_htc": "5.2 [W/(m^2 K)]", "stack.contact_conductance": "150 [W/(m^2 K)]"})
    both = {"T a": "a.case", "T b": "b.case"}
    together = record("together", true_pair, "room", both, {"a.heat": 4.0, "b.heat": 0.5}, 2)
    held = record("held out", true_pair, "room", both, {"a.heat": 2.0, "b.heat": 3.0}, 3)
    first = td.calibrate(box, alone, ["skin.effective_htc"], scenario=td.Scenario("s", boundaries={"air": "24 [degC]"}), name="component")
    above = pair.replace("a", box.with_values(first.values.assignments, "stage 'component'"))
    room = td.Scenario("s", boundaries={"room": "24 [degC]"})
    second = td.calibrate(above, together, ["stack.contact_conductance", "a.skin.effective_htc"], scenario=room, name="submodel")
    verdict = td.validate(second, held, td.Criteria(rmse="0.3 [K]", max_error="0.0001 [K]"), scenario=room)
    keys = {"component": "0123456789abcdef", "submodel": "fedcba9876543210"}
    return Campaign("Two boxes", {"component": first, "submodel": second}, (verdict,), keys, "Made in Python.")


@pytest.fixture(scope="session")
def measured(campaign: Campaign) -> Campaign:
    """The same as if its records had been measured."""

    def as_measured(fit: td.Calibration) -> td.Calibration:
        experiments = tuple(replace(e, record=replace(e.record, origin=replace(e.record.origin, synthetic=False))) for e in fit.experiments)
        values = replace(fit.values, provenance={**fit.values.provenance, "synthetic": False})
        return replace(fit, experiments=experiments, values=values)

    verdicts = tuple(replace(v, prediction=as_measured(v.prediction)) for v in campaign.verdicts)
    return replace(campaign, stages={k: as_measured(c) for k, c in campaign.stages.items()}, verdicts=verdicts)


def points_in(markup: str) -> int:
    """Return how many points the lines and areas of a figure have, counted in what is drawn."""
    paths = re.findall(r'class="(?:line|area)"[^>]* d="([^"]*)"', markup)
    return sum(len(re.findall(r"-?\d+", part)) // 2 for path in paths for part in path.split("M"))
