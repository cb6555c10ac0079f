"""Every public result goes to another process and says the same there; a copy with another field shares no memo with the original."""

from __future__ import annotations

import importlib
import inspect
import pickle
import pkgutil
import subprocess
import sys
from copy import copy
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

import thermid
import thermid as td
from thermid.base.units import Memo
from thermid.fit.calibration import Experiment, Problem
from thermid.model.tree import Constant
from thermid.simulation.runs import Media, Network
from unit.results import numbers, of_a_fit, of_a_run, that_take_longer

ELSEWHERE = {"Estimation", "Evidence", "HoldQuestion", "Study", "Posterior", "Equations", "ErrorModel", "ErrorBand"}
"""What takes seconds to make, some of it in the campaign below, and what is read from a folder of files."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    one, other = (tmp_path_factory.mktemp(name) for name in ("fit", "run"))
    return of_a_fit(one) | {f"{k} of a run": v for k, v in of_a_run(other).items()}


def changed_on_the_way(results: dict[str, Any], folder: Path) -> set[str]:
    """Return the results that say something else in another process."""
    (folder / "results.pickle").write_bytes(pickle.dumps(results))
    here = {name: numbers(one) for name, one in results.items()}
    command = [sys.executable, "-m", "unit.results", str(folder / "results.pickle")]
    got = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True, check=False)
    assert got.returncode == 0, got.stderr
    there = dict(line.split("\t") for line in got.stdout.splitlines())
    return {n for n in here if here[n] != there.get(n)}


@pytest.fixture(scope="module")
def everything(results: dict[str, Any]) -> list[Any]:
    """Every object of the package in them."""
    seen: dict[int, Any] = {}
    for one in results.values():
        parts(one, seen)
    return list(seen.values())


def test_no_public_class_is_forgotten(results: dict[str, Any], everything: list[Any]) -> None:
    classes = [
        one
        for one in (getattr(importlib.import_module(f"thermid.{module}"), name) for name, module in td._PUBLIC.items())
        if inspect.isclass(one)
    ]
    public = {one.__name__ for one in classes if not issubclass(one, BaseException | Warning)}  # an alias is no class of its own
    made = {type(one).__name__ for one in (*results.values(), *everything)}
    assert not public - made - ELSEWHERE, "make one in tests/unit/results.py"


def test_every_result_says_the_same_in_another_process(results: dict[str, Any], tmp_path: Path) -> None:
    assert changed_on_the_way(results, tmp_path) == set()


@pytest.mark.campaign
def test_so_do_those_that_take_longer(tmp_path: Path) -> None:
    assert changed_on_the_way(that_take_longer(), tmp_path) == set()


def memos(value: Any) -> dict[str, Memo]:
    return {f.name: getattr(value, f.name) for f in fields(value) if isinstance(getattr(value, f.name), Memo)}


def changed(value: Any) -> list[Any]:
    """Return the value with each of its fields given anew, one at a time."""
    return [replace(value, **{f.name: copy(getattr(value, f.name))}) for f in fields(value) if f.init]


def parts(value: Any, seen: dict[int, Any]) -> dict[int, Any]:
    """Return every dataclass in a value, by identity."""
    if id(value) in seen or isinstance(value, type):
        return seen
    if is_dataclass(value):
        seen[id(value)] = value
        for f in fields(value):
            parts(getattr(value, f.name), seen)
        for inner in [v for k, v in vars(value).items() if k not in {f.name for f in fields(value)}]:
            parts(inner, seen)
    elif isinstance(value, dict | MappingProxyType):
        for inner in value.values():
            parts(inner, seen)
    elif isinstance(value, list | tuple):
        for inner in value:
            parts(inner, seen)
    elif hasattr(value, "__dict__") and type(value).__module__.startswith("thermid"):
        seen[id(value)] = value
        for inner in vars(value).values():
            parts(inner, seen)
    return seen


def test_a_copy_with_another_field_shares_no_memo(everything: list[Any]) -> None:
    """A field that `replace` copied would hold what was worked out for the other value: two of them once gave wrong answers."""
    kinds: dict[type, Any] = {}
    for one in everything:
        if is_dataclass(one) and (type(one) not in kinds or any(memos(one).values())):
            kinds[type(one)] = one
    assert {td.Calibration, td.simulation.Simulator, td.Solution, Network, Problem, Experiment} <= set(kinds)
    assert {Network, Problem, Experiment, Media} <= {kind for kind, one in kinds.items() if any(memos(one).values())}
    for kind, one in kinds.items():
        kept = memos(one)
        for again in changed(one) if type(one).__dataclass_params__.frozen else []:
            assert all(not getattr(again, name) and getattr(again, name) is not memo for name, memo in kept.items()), kind
            # what a cached property has made stands in the instance alone
            assert set(vars(again)) <= {f.name for f in fields(again)}, kind


def test_values_work_out_anew_what_their_fields_say(results: dict[str, Any]) -> None:
    """The same as a value made from nothing: networks, experiments and problems after each change."""
    fit = results["calibration"]
    problem, at = fit.problem, np.array(list(fit.fitted.values()))
    before = problem.residuals(at)
    (experiment,) = problem.experiments
    warm = replace(experiment.scenario, loads={"heat": Constant(5.0)})
    moved = replace(problem, experiments=(replace(experiment, scenario=warm),))
    fresh = Problem(moved.experiments, problem.unknowns, problem.noise, problem.options, problem.fixed_bias, problem.coupled)
    assert moved.residuals(at) == pytest.approx(fresh.residuals(at), abs=0.0)
    assert np.abs(moved.residuals(at) - before).max() > 1.0
    assert problem.residuals(at) == pytest.approx(before, abs=0.0)
    network = results["network of a run"]
    bare = replace(network, flat=replace(network.flat, conductors=network.flat.conductors[:1]))
    assert len(network.numbers().conductors) > len(bare.numbers().conductors) == 1


def test_no_dataclass_keeps_what_it_works_out_in_a_field_of_its_own() -> None:
    """A private field with a default dictionary or list, which the initialiser takes, is a cache that `replace` would share."""
    loose = []
    for info in pkgutil.walk_packages(thermid.__path__, "thermid."):
        if info.name.rpartition(".")[2] in ("__main__", "_kernel"):
            continue
        module = importlib.import_module(info.name)
        for name, made in vars(module).items():
            if inspect.isclass(made) and made.__module__ == info.name and is_dataclass(made):
                loose += [
                    f"{name}.{f.name}"
                    for f in fields(made)
                    if (f.name.startswith("_") and f.init and f.default_factory in (dict, list))
                    or (f.type in ("Memo", Memo) and (f.init or f.compare or f.repr))
                ]
    assert loose == ["Prediction._find"]  # names, given where it is made
