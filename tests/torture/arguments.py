"""Mutants of what a caller in Python gives as dictionaries, texts and numbers: the library's own errors, as for files."""

# ruff: noqa: E501  # lines of files and tables

from __future__ import annotations

import copy
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import thermid as td
from thermid.campaign.stages import Criteria, read_limits
from thermid.prediction._monte_carlo.hold import limits_of
from torture.mutants import _change

MODEL: Final = {
    "title": "plate",
    "needs": ["air"],
    "nodes": {"plate": {"capacitance": "100 [J/K]"}},
    "conductors": {
        "film": {
            "kind": "convection",
            "between": ["plate", "air"],
            "htc": {"value": "8 [W/(m^2 K)]", "min": 2, "max": 20},
            "area": "0.05 [m^2]",
        }
    },
    "loads": {"heater": {"into": "plate", "power": "5 [W]"}},
}


def _record() -> Any:
    return td.read_record("rig.csv", {"T_CASE": {"node": "plate"}, "ROOM": {"boundary": "air"}, "POWER": {"load": "heater"}}, time="time_s")


def _calibrate(given: Any) -> None:
    free, options = given["free"], given["options"]
    td.calibrate(td.model_from_dict(MODEL), _record(), free, **options)


def _simulate(given: Any) -> None:
    td.simulate(td.model_from_dict(MODEL), td.Scenario("x", **given), every="5 [min]")


CALLS: Final[dict[str, tuple[Callable[[Any], Any], Any]]] = {
    "model_from_dict": (td.model_from_dict, MODEL),
    "Scenario": (
        _simulate,
        {
            "boundaries": {"air": {"mean": "20 [degC]", "amplitude": "3 [K]", "period": "24 [h]"}},
            "loads": {"heater": {"times": ["0 [s]", "1 [h]"], "values": ["1 [W]", "2 [W]"]}},
            "schedule": {"film.htc": "9 [W/(m^2 K)]"},
            "start": "20 [degC]",
            "initial": {"plate": "25 [degC]"},
            "duration": "30 [min]",
        },
    ),
    "Environment": (
        lambda given: _simulate({"boundaries": {"air": "20 [degC]"}, "duration": "60 [s]", "environment": {"air": td.simulation.Environment(**given)}}),
        {"pressure": "0.5 [bar]", "humidity": 0.5, "gas": "air", "gravity": "1 [m/s^2]", "wind": "1 [m/s]", "sealed": False},
    ),
    "environment": (
        lambda given: td.Scenario("x", boundaries={"air": "20 [degC]"}, environment=given),
        {"air": {"pressure": "1 [bar]"}, "*": {"gas": "He"}},
    ),
    "calibrate": (
        _calibrate,
        {
            "free": ["film.htc"],
            "options": {
                "priors": {"film.htc": {"mean": "8 [W/(m^2 K)]", "sd": "1 [W/(m^2 K)]"}},
                "scenario": None,
                "local": {},
                "loss": "linear",
            },
        },
    ),
    "read_record": (
        lambda given: td.read_record("rig.csv", **given),
        {
            "channels": {
                "T_CASE": {"node": "plate", "noise": "0.1 [K]", "accuracy": "0.3 [K]", "certificate": {"offset": "0 [K]", "uncertainty": "0.1 [K]"}},
                "POWER": {"load": "heater", "prompt": True},
            },
            "time": "time_s",
            "units": {"POWER": "W"},
        },
    ),
    "Criteria": (lambda given: Criteria.read(given, "here"), {"rmse": "0.5 [K]", "max_error": "2 [K]", "sensors": {"T": {"rmse": "1 [K]"}}}),
    "limits": (lambda given: read_limits(given, "here"), {"box": {"node": "plate", "operating": ["0 [degC]", "50 [degC]"], "loads": ["heater"]}}),
    "limits of a hold": (lambda given: limits_of(given, "here"), {"plate": {"highest": "50 [degC]", "lowest": "0 [degC]"}, "b": "5 [degC]"}),
    "profile_of": (
        lambda given: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", **given).steps,
        {"level": "acceptance", "cycles": 2, "hot": "60 [degC]", "cold": {"value": "-20 [degC]", "mark": "project"}, "predicted": ["0 [degC]", "40 [degC]"]},
    ),
    "uncertain_runs": (
        lambda given: td.qualify.uncertain_runs(td.model_from_dict(MODEL), td.Scenario("x", boundaries={"air": "20 [degC]"}, duration="60 [s]"), **given),
        {"spread": {"film.htc": {"sd": "1 [W/(m^2 K)]"}, "air": "1 [K]"}, "n": 8, "seed": 1},
    ),
    "Options": (
        lambda given: td.simulate(
            td.model_from_dict(MODEL), td.Scenario("x", boundaries={"air": "20 [degC]"}, duration="60 [s]"), options=td.Options(**given)
        ),
        {"error": "10 [uK]", "max_step": 10.0, "extremes": True},
    ),
    "with_values": (
        lambda given: td.simulate(
            td.model_from_dict(MODEL).with_values(given), td.Scenario("x", boundaries={"air": "20 [degC]"}, duration="60 [s]")
        ),
        {"film.htc": "9 [W/(m^2 K)]", "plate.capacitance": {"value": "50 [J/K]", "min": 10}},
    ),
}  # fmt: skip


def called(name: str, base: Path, seed: str) -> Callable[[], Any]:
    """Return the call with a mutant of its argument."""
    call, good = CALLS[name]
    dice, given = random.Random(seed), copy.deepcopy(good)
    for _ in range(dice.choice((1, 1, 2))):
        _change(dice, given)
        if {*given} != {*good}:
            given = {**copy.deepcopy(good), **{k: v for k, v in given.items() if k in good}} if isinstance(given, dict) else given
    return lambda: call(given)
