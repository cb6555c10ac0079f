"""One question has one answer: prediction, foresight, runs, hold time and margin agree, from a fit and from its values file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.campaign.stages import Limits
from thermid.prediction._predict import foresee
from thermid.prediction._records import predict_record
from unit.prediction.things import CASES, Case

PLACES = ("inside", "outside")


def ends(band: Any) -> tuple[float, float]:
    """Mean and half-width of the 95 % band at the end of a run. [degC]"""
    low, high = (float(x[-1]) for x in band.interval())
    return float(band.celsius[-1]), (high - low) / 2


def answers(case: Case, scenario: td.Scenario, file: Path, members: int) -> dict[str, tuple[float, float]]:
    """Mean and half-width at the end by every route."""
    fit, node = case.fit, case.node
    fit.save(file)
    values = td.load_values(file)
    out = {"predict": ends(td.predict(fit, scenario, nodes=[node])[node])}
    of_file = td.design.Knowledge(fit.given_model, (values,))
    for route, known in (("foresee", td.design.Knowledge.of_source(fit)), ("foresee, file", of_file)):
        seen = foresee(known, scenario, nodes=[node])
        out[route] = ends(seen.prediction[node])
        limits = Limits("point", node, operating=td.quantity((-np.inf, 700.0), unit="K"))
        (margin,) = td.qualify.margins({"run": seen}, [limits])
        if margin.time == scenario.seconds:  # it counts to the end of the band on its side, which of a mixture need not be the nearer one
            assert margin.predicted - 273.15 == pytest.approx(out[route][0])
            assert margin.predicted - 273.15 + margin.uncertainty == pytest.approx(float(seen.prediction[node].interval()[1][-1]))
    for route, given in (("runs", fit), ("runs, file", values)):
        runs = td.qualify.uncertain_runs(fit.model, scenario, given, n=members, nodes=[node], seed=7)
        end = runs.node_temperatures(node)[:, -1] - 273.15
        low, high = np.quantile(end, [0.025, 0.975])
        out[route] = (float(end.mean()), float(high - low) / 2)
        out[f"hold, {route}"] = _by_hold(runs, node, end)
    return out


def _by_hold(runs: td.qualify.UncertainRuns, node: str, end: np.ndarray[Any, Any]) -> tuple[float, float]:
    """Mean and half-width as probabilities of never passing limits say them; the mean is the area above their curve."""
    limits = np.quantile(end, [0.0, 0.01, 0.02, *np.linspace(0.025, 0.975, 25), 0.98, 0.99, 1.0])
    kept = [td.qualify.hold(runs, {node: f"{x!r} [degC]"})[node].never for x in limits.tolist()]
    low, high = np.interp([0.025, 0.975], kept, limits)
    return float(limits[0] + np.trapezoid(1.0 - np.array(kept), limits)), float(high - low) / 2


def check(found: dict[str, tuple[float, float]], mean_miss: float, width_miss: float) -> None:
    mean, half = found["predict"]
    for route, (own, wide) in found.items():
        assert own == pytest.approx(mean, abs=mean_miss * half), route
        assert wide == pytest.approx(half, rel=width_miss), route


@pytest.mark.parametrize(("name", "place"), [*((name, "outside") for name in CASES), ("natural", "inside")])
def test_every_route_gives_one_answer(name: str, place: str, tmp_path: Path) -> None:
    """A thousand members know their mean to 3 % of a half-width, and the half-width to 4 %; every pair is asked in the campaign."""
    case = CASES[name]()
    found = answers(case, getattr(case, place), tmp_path / "fit.values.toml", 1000)
    assert len(found) >= 7
    check(found, 0.1, 0.1)


@pytest.mark.campaign
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", CASES)
def test_every_route_gives_one_answer_of_ten_thousand_members(name: str, place: str, tmp_path: Path) -> None:
    case = CASES[name]()
    found = answers(case, getattr(case, place), tmp_path / "fit.values.toml", 10_000)
    check(found, 0.1, 0.1)


@pytest.mark.parametrize("name", CASES)
def test_a_file_gives_the_numbers_of_the_fit(name: str, tmp_path: Path) -> None:
    case = CASES[name]()
    case.fit.save(tmp_path / "fit.values.toml")
    live, filed = (
        foresee(k, case.outside, nodes=[case.node]).prediction[case.node]
        for k in (
            td.design.Knowledge.of_source(case.fit),
            td.design.Knowledge(case.fit.given_model, (td.load_values(tmp_path / "fit.values.toml"),)),
        )
    )
    assert filed.kelvin == pytest.approx(live.kelvin, abs=1e-6)
    assert filed.error == pytest.approx(live.error, rel=1e-6, abs=1e-9)
    assert filed.shift == pytest.approx(live.shift, abs=1e-6)
    assert set(filed.parts) - {"fit of plate", "fit of stack"} == set(live.parts) - {"fit"}
    assert sum(filed.parts.values()) == pytest.approx(sum(live.parts.values()), rel=1e-5, abs=1e-12)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", CASES)
def test_what_moves_the_centre_of_a_band_is_said_with_its_size(name: str, place: str) -> None:
    """Run with the best values, and what each cause adds: together the centre, of a prediction and of runs that are drawn."""
    case = CASES[name]()
    scenario: td.Scenario = getattr(case, place)
    told = td.predict(case.fit, scenario, nodes=[case.node])
    band = told[case.node]
    run = td.simulate(case.fit.model, scenario, times=band.times)[case.node].kelvin
    assert band.simulated == pytest.approx(run, abs=1e-3)
    assert run + sum(band.moved.values(), np.zeros(run.size)) == pytest.approx(band.kelvin, abs=1e-3)
    drawn = td.qualify.uncertain_runs(case.fit.model, scenario, case.fit, n=400, nodes=[case.node], seed=7)
    middle = td.simulate(case.fit.model, scenario, times=drawn.times)[case.node].kelvin
    off = np.abs(drawn.node_temperatures(case.node).mean(axis=0) - middle).max()
    for apart, said in ((np.abs(band.kelvin - run).max(), told.centre), (off, drawn.centre)):
        if apart > 0.1:
            (kelvin,) = re.findall(rf"'{case.node}' .*? ([-+]?[\d.]+) K", said)
            assert abs(float(kelvin)) == pytest.approx(apart, rel=0.3, abs=0.05)
        if apart < 0.02:
            assert said == ""
    assert (drawn.centre in td.qualify.hold(drawn, {case.node: "90 [degC]"}).warnings) or not drawn.centre
    assert told.to_dict()["nodes"][case.node]["run_C"] == pytest.approx(run[-1] - 273.15, abs=1e-3)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", CASES)
def test_a_verdict_judges_the_centre_of_the_band(name: str, place: str) -> None:
    """Expected values with expected departures, and expected errors of instruments: not the run with the fitted values."""
    case = CASES[name]()
    scenario: td.Scenario = getattr(case, place)
    times = np.arange(0.0, scenario.seconds + 1.0, 60.0)
    seen = td.simulate(case.fit.model, scenario, times=times)[case.node].kelvin + 0.3
    seen += 0.1 * np.random.default_rng(5).standard_normal(times.size)
    channel = td.Channel.from_array("T", seen, unit="K", role="node", target=case.node, noise=0.1, accuracy=0.2)
    record = td.Record.from_arrays("hold-out", times, {"T": channel})
    verdict = td.validate(case.fit, record, td.Criteria(rmse="5 [K]"), scenario=scenario)
    (judged,), ((band,), (statistics,)) = verdict.blocks, (x.values() for x in (verdict.bands.bands, verdict.statistics))
    told = predict_record(case.fit, record, scenario=scenario)
    assert judged.predicted == pytest.approx(told.bands["T"].predicted, abs=1e-9)
    assert verdict.checks[0].found == pytest.approx(band.rmse, abs=1e-9)
    assert statistics.rmse == pytest.approx(band.rmse, abs=1e-9)
    assert f"RMSE {band.rmse:.3g} K" in str(told)
