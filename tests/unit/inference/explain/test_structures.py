"""The search of structures: what was planted is found and nothing else, from one evaluation each to refits."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import of_code
from thermid.base.errors import code_of
from thermid.fit.calibration import Request, SensorTrace, fit
from thermid.inference._explain.candidates import Fitted, _of_traces, plain_lacks
from thermid.inference._explain.structures import TIE, FittedStructure, StructureSearch, fitted_structure, search_structure
from thermid.inference._explain.weighing import CauseScore
from unit.fit.bench import HTC, MASS, box, log

BARE = {"surfaces/skin/effective_htc": "6 [W/(m^2 K)]", "nodes/case/mass": "1.5 [kg]"}
INNER = {
    "nodes/inner": {"capacitance": "600 [J/K]"},
    "conductors/path": {"kind": "conduction", "between": ["inner", "case"], "conductance": "1.0 [W/K]"},
}
LAG = {
    "nodes/bulb": {"capacitance": "1 [J/K]"},
    "conductors/path": {"kind": "conduction", "between": ["bulb", "case"], "conductance": "0.006 [W/K]"},
}
SKIN = {"of": "case", "to": "air", "area": "0.05 [m^2]"}
HOT = {"parameters/power": "20 [W]"}
"""Radiation bends only where the rise is large."""
RADIANT = HOT | {"surfaces/skin": SKIN | {"htc": "3 [W/(m^2 K)]", "emissivity": 0.8}}


def asked(truth: td.Model, node: str = "case", own: dict[str, Any] = BARE, **more: Any) -> Request:
    """A box of one node, and a synthetic log of something else."""
    data = log(truth, {}, {"T": node}, **{"noise": 0.05, **more})
    data = data.with_channels(replace(data.channel("T"), target="case"))
    return Request(box(own), (data,), (HTC, MASS))


@pytest.mark.parametrize(
    ("truth", "node", "codes"),
    [(INNER, "case", "second-mass"), (LAG, "bulb", "lag"), (RADIANT, "case", "radiation natural-convection")],
    ids=["hidden mass", "lag", "radiation"],
)
def test_what_was_planted_is_proposed(truth: dict[str, Any], node: str, codes: str) -> None:
    found = search_structure(asked(box(BARE | truth), node, BARE | (HOT if truth is RADIANT else {})))
    assert found.complete
    assert len(found.proposed.changes) == 1
    assert code_of(found.proposed.changes[0].name) in {f"element.{c}" for c in codes.split()}
    assert found.likelihood(found.proposed) > 2 * TIE
    assert found.proposed.rmse == pytest.approx(0.05, rel=0.1)
    assert str(found).startswith("Proposed: ")


@pytest.mark.parametrize("evaluations", [10_000, 60])
@pytest.mark.parametrize("pool", [ThreadPoolExecutor, pytest.param(ProcessPoolExecutor, marks=pytest.mark.campaign)])
def test_refits_in_tasks_are_the_same_bits_and_take_the_same_budget(pool: Callable[..., Executor], evaluations: int) -> None:
    request = asked(box(BARE | INNER), samples=101)
    context = {"mp_context": multiprocessing.get_context("forkserver")} if pool is ProcessPoolExecutor else {}
    with pool(2, **context) as workers:
        alone, together = (search_structure(request, rounds=2, evaluations=evaluations, executor=who) for who in (None, workers))
    assert str(alone) == str(together)
    assert alone.refused == together.refused
    assert (alone.evaluations, alone.scored) == (together.evaluations, together.scored)
    for one, other in zip(alone.structures, together.structures, strict=True):
        assert one.end.fitted.tobytes() == other.end.fitted.tobytes()
        assert one.weighing.logs.tobytes() == other.weighing.logs.tobytes()


def test_nothing_is_proposed_where_nothing_is_missing() -> None:
    found = search_structure(asked(box(BARE)))
    assert found.proposed is found.start
    assert not str(found).startswith("Proposed: ")
    assert found.orders[0] == 1


def test_one_more_mass_that_the_readings_cannot_tell_is_said() -> None:
    """A mass that is tried and changes nothing ties; it stays a tie and is not proposed."""
    found = search_structure(asked(box(BARE), samples=101))
    for one in found.ties:
        assert found.likelihood(one) > found.likelihood(found.proposed) - TIE
        assert one.nodes >= found.proposed.nodes


def test_the_adopted_request_is_a_fit_at_the_found_values() -> None:
    found = search_structure(asked(box(BARE | INNER)))
    done = fit(found.proposed.full_request)
    for path, value in found.proposed.values.items():
        assert done.values[path].value == pytest.approx(value, rel=0.1)


def test_changes_of_a_pair_reach_both_and_what_is_between() -> None:
    """Names of elements are free, every change can be laid over the model by itself, and two of them together."""
    deck = {
        "title": "Two",
        "needs": ["room"],
        "nodes": {"a": {"capacitance": "100 [J/K]"}, "b": {"capacitance": "300 [J/K]"}},
        "conductors": {
            "a_loss": {"kind": "conduction", "between": ["a", "room"], "conductance": "0.5 [W/K]"},
            "b_loss": {"kind": "conduction", "between": ["b", "room"], "conductance": "0.5 [W/K]"},
        },
        "loads": {"heat": {"into": "a", "power": "10 [W]"}},
    }
    model = td.model_from_dict(deck)
    run = td.simulate(
        model, td.Scenario("s", boundaries={"room": "20 [degC]"}, duration="1 [h]", start="20 [degC]"), times=np.arange(0, 3601.0, 60.0)
    )
    channels = {n: td.Channel.from_array(n, run[n].kelvin, unit="K", role="node", target=n, noise=0.1) for n in ("a", "b")}
    record = td.Record.from_arrays("r", run.times, channels)
    request = Request(model, (record,), ("a.capacitance",), {"*": td.Scenario("s", boundaries={"room": "20 [degC]"})})
    one = fitted_structure((), request, {})
    changes = {c.name: c for c in Fitted.of_problem(request, one.problem, one.end.fitted).changes()}
    by_code = {code_of(name).removeprefix("element."): c for name, c in changes.items() if "'a'" not in name or "'b'" in name}
    assert {"contact", "common-mass", "lag", "second-mass"} <= {*by_code}
    assert {"element.one-direction", "element.growing-power"} <= {*map(code_of, changes)}
    for change in changes.values():
        assert fitted_structure((change,), change.request, one.fitted).nodes == 2 + change.nodes
    lags = by_code["lag"]
    assert fitted_structure((lags,), lags.request, one.fitted).masses == 2, "thermometers of one kind are no masses of the unit"
    more = lags.beside(by_code["second-mass"])
    assert fitted_structure((more,), more.make(request), one.fitted).masses == 3
    both = by_code["contact"].beside(by_code["second-mass"])
    assert fitted_structure((both,), both.make(request), one.fitted).nodes == 3


def test_commands_that_act_late_are_found() -> None:
    times = np.arange(0.0, 1500.0, 5.0)
    levels = np.where((times // 300).astype(int) % 2 == 0, 20.0, 0.0)
    model = td.model_from_dict(
        {
            "title": "Late",
            "needs": ["room"],
            "nodes": {"a": {"capacitance": "50 [J/K]"}},
            "conductors": {"loss": {"kind": "conduction", "between": ["a", "room"], "conductance": "0.5 [W/K]"}},
            "loads": {"heat": {"into": "a", "power": "0 [W]"}},
        }
    )
    from thermid.fit.calibration import build_problem, starting_point

    def record(values: Any, watts: Any) -> td.Record:
        channels = {
            "T": td.Channel.from_array("T", values, unit="K", role="node", target="a", noise=0.05),
            "P": td.Channel.from_array("P", watts, quantity="power", role="load", target="heat"),
        }
        return td.Record.from_arrays("r", times, channels)

    scenario = {"*": td.Scenario("s", boundaries={"room": "20 [degC]"})}
    true = build_problem(Request(model, (record(np.full(times.size, 293.15), np.roll(levels, 3)),), (), scenario))
    clean = true.blocks(starting_point(true.unknowns))[0].predicted
    noisy = clean + 0.05 * np.random.default_rng(1).standard_normal(times.size)
    request = Request(model, (record(noisy, levels),), ("a.capacitance", "loss.conductance"), scenario)
    found = search_structure(request)
    assert "act 15 s" in found.proposed.name


def test_the_noise_is_that_of_the_structure_that_leaves_least() -> None:
    """The likeliest structure took a misfit of 0.5 K for noise that wanders; structures with a fifth of it were then less likely."""
    scores = [(np.array([-100.0, -10.0]), 1000.0), (np.array([-12.0, -30.0]), 100.0)]  # columns: white, and wandering
    first, better = (
        FittedStructure((), None, None, SimpleNamespace(chi_square=left), CauseScore(logs), 2)  # type: ignore[arg-type]
        for logs, left in scores
    )
    assert StructureSearch((first, better), first, (), 1, 9, True).likelihood(better) == 88.0


def test_structures_are_alike_where_the_readings_cannot_separate_them_whatever_their_residuals() -> None:
    """Residuals 5 % larger can be 20 units of likelihood less: such a structure says nothing of what a log leaves open."""
    nothing = np.zeros((0, 0))
    end: Any = SimpleNamespace(chi_square=100.0, fitted=(), jacobian=nothing, priors=nothing)
    problem: Any = SimpleNamespace(unknowns=())
    first, near, far = (
        FittedStructure((), None, problem, end, CauseScore(np.array([log])), 2)  # type: ignore[arg-type]
        for log in (0.0, 0.1 - TIE, -0.1 - TIE)
    )
    assert StructureSearch((first, near, far), first, (), 1, 9, True).alike == (near,)


def test_air_inside_a_housing_is_not_tried_as_a_radiating_part() -> None:
    """It took one of five places of `criticise`, was refused when its time came, and no other candidate was refitted in its place."""
    skin = {"of": "case", "to": "air", "area": "200 [cm^2]", "htc": "6 [W/(m^2 K)]"}
    wall = {"of": "case", "to": "inside", "area": "150 [cm^2]", "htc": "4 [W/(m^2 K)]"}
    vent = {"kind": "conduction", "between": ["inside", "air"], "conductance": "0.02 [W/K]"}
    model = td.model_from_dict(
        {
            "title": "housing",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": "120 [J/K]"}, "inside": {"capacitance": "5 [J/K]"}},
            "surfaces": {"skin": skin, "wall": wall},
            "conductors": {"vent": vent},
            "loads": {"heat": {"into": "case", "power": "2 [W]"}},
        }
    )
    fit = td.calibrate(model, log(model, {}, {"T": "case", "T_A": "inside"}, samples=61), ["case.capacitance"])
    names = [c.name for c in plain_lacks(Fitted.of_calibration(fit, fit.request))]
    assert of_code(names, "element.radiation", "'case' .*'air'")
    assert not of_code(names, "element.radiation", "'inside'")


def test_of_several_records_the_largest_rise_of_a_node_counts() -> None:
    traces = [
        SensorTrace(r, "T", "case", np.arange(2.0), np.array([300.0, 300.0 + rise]), np.array([300.0, 300.0 + rise]), 0.1)
        for r, rise in (("warm", 20.0), ("idle", 1.0))
    ]
    rises, misfits = _of_traces(traces)
    assert rises == {"case": 20.0}
    assert misfits == {"case": 0.0}
