"""Attributes under their old names: served with a warning that states the new one, until the version that the table says."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.campaign.joint import JointFit
from thermid.campaign.methodology import LogEntry
from thermid.judge.criteria import Deviation
from thermid.judge.metrics import Residuals
from thermid.renamed import REMOVED, RENAMED

ROOT = Path(__file__).parents[2]


def _log(name: str, run: td.Solution, seed: int) -> td.Record:
    """Log of node a with noise."""
    noisy = run["a"].kelvin + np.random.default_rng(seed).normal(0.0, 0.05, run.times.size)
    return td.Record.from_arrays(name, run.times, {"T": td.Channel.of("T", noisy, unit="K", role="node", target="a", noise=0.05)})


@pytest.fixture(scope="module")
def objects() -> dict[str, Any]:
    """One object of every class of the table."""
    deck = {"title": "x", "needs": ["air"], "nodes": {"a": {"capacitance": "900 [J/K]"}}}
    deck["surfaces"] = {"s": {"of": "a", "to": "air", "area": "0.05 [m^2]", "htc": {"value": "8 [W/(m^2 K)]", "min": 1}, "emissivity": 0}}
    model = td.model_from_dict(deck)
    bench = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="60 [degC]", duration="1 [h]")
    run = td.simulate(model, bench, every="30 [s]")
    record, held_out = (_log(name, run, seed) for seed, name in enumerate(("log", "held out")))
    fit = td.calibrate(model, record, ["s.htc"], scenario=bench)
    (check, *_) = td.validate(fit, held_out, td.Criteria(rmse="1 [K]"), scenario=bench).checks
    residuals = Residuals.of(record.times, record["T"].values - run["a"].kelvin)
    assert fit.autocorrelation is not None
    return {
        "Calibration": fit,
        "Autocorrelation": fit.autocorrelation,
        "TraceNoise": fit.autocorrelation.traces[0],
        "Check": check,
        "Deviation": Deviation("case", "T", "transient", residuals, 300.0, 300.0),
        "LogEntry": LogEntry("find", "stage", "log", "T", residuals),
    }


@pytest.mark.parametrize(("owner", "old"), [(owner, old) for owner, names in RENAMED.items() for old in names])
def test_an_old_name_gives_what_the_new_one_does(objects: dict[str, Any], owner: str, old: str) -> None:
    new = RENAMED[owner][old]
    one = objects[owner]
    with pytest.warns(DeprecationWarning, match=rf"'\.{old}' was renamed to '.*{new.strip('[]')}.*'; the old name will be removed in"):
        found = getattr(one, old)
    np.testing.assert_equal(found, one[new[1:-1]] if new.startswith("[") else getattr(one, new))


@pytest.mark.parametrize("owner", RENAMED)
def test_what_never_was_a_name_is_none(objects: dict[str, Any], owner: str) -> None:
    assert type(objects[owner]).__name__ == owner
    with pytest.raises(AttributeError, match=f"'{owner}' object has no attribute 'temprature'"):
        _ = objects[owner].temprature
    assert type(pickle.loads(pickle.dumps(copy.copy(objects[owner])))).__name__ == owner


def test_old_names_go_with_the_version_that_says_so() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    before = tuple(map(int, version.split("."))) < tuple(map(int, REMOVED.split(".")))
    assert before or not RENAMED, f"thermid {version} still serves old names; take them out of src/thermid/renamed.py"


def test_limits_by_place_are_refused_in_words() -> None:
    with pytest.raises(td.ThermidError, match=r"give limits as a table, not '2 \[K\]': Criteria\(rmse="):
        td.Criteria("1 [K]", "2 [K]")  # type: ignore[arg-type]


def test_a_joint_fit_has_the_old_names_of_a_calibration(objects: dict[str, Any]) -> None:
    fit = objects["Calibration"]
    joint = JointFit(**{f.name: getattr(fit, f.name) for f in dataclasses.fields(fit) if f.init}, levels={})
    with pytest.warns(DeprecationWarning, match="effective_samples"):
        assert joint.effective == fit.effective_samples
    with pytest.raises(AttributeError, match="'JointFit' object has no attribute 'temperatures'"):
        _ = joint.temperatures
