"""Fleets: the restricted likelihood against dense formulas and a published fit, what a fleet says of odd units, weak logs, no spread."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from fleet_of_boxes import FREE, MEANS, MODEL, SPREADS, boxes, log
from thermid.app.cli.app import app
from thermid.base.errors import DeckError, IdentificationError
from thermid.inference._fleet.population import (
    PopulationFit,
    RestrictedLikelihood,
    Summaries,
    interval_of_correlation,
    interval_of_mean,
    interval_of_spread,
    odd_units,
)
from thermid.inference._fleet.units import UnitJudgement, checks_of, standing_of
from thermid.model.tree import Standing, model_from_dict
from two_masses import DECK

ORTHODONT = """
26,25,29,31 21.5,22.5,23,26.5 23,22.5,24,27.5 25.5,27.5,26.5,27 20,23.5,22.5,26 24.5,25.5,27,28.5 22,22,24.5,26.5 24,21.5,24.5,25.5
23,20.5,31,26 27.5,28,31,31.5 23,23,23.5,25 21.5,23.5,24,28 17,24.5,26,29.5 22.5,25.5,25.5,26 23,24.5,26,30 22,21.5,23.5,25
21,20,21.5,23 21,21.5,24,25.5 20.5,24,24.5,26 23.5,24.5,25,26.5 21.5,23,22.5,23.5 20,21,21,22.5 21.5,22.5,23,25 23,23,23.5,24
20,21,22,21.5 16.5,19,19,19.5 24.5,25,28,28
"""
"""Distances [mm] of 27 children at the ages of 8, 10, 12 and 14 years: Potthoff and Roy, Biometrika 51 (1964) 313, table 1."""


BAD = ("not credible", "P would need an error of +9 %")


def summaries(count: int, size: int, seed: int, wide: np.ndarray | None = None, noise: float = 0.3) -> tuple[Summaries, np.ndarray]:
    """What linear units say, and their values; a third of them see one direction only."""
    rng = np.random.default_rng(seed)
    values = rng.multivariate_normal(np.zeros(size), np.eye(size) if wide is None else wide, count)
    slopes = rng.normal(size=(count, 6, size)) / noise
    slopes[::3, 1:] = 0.0
    readings = np.einsum("nki,ni->nk", slopes, values) + rng.normal(size=(count, 6))
    information, score = np.einsum("nki,nkj->nij", slopes, slopes), np.einsum("nki,nk->ni", slopes, readings)
    return Summaries(information, score, np.repeat(np.eye(size)[None], count, axis=0)), values


def test_a_published_fit_is_repeated() -> None:
    # Pinheiro and Bates, Mixed-Effects Models in S and S-PLUS (2000), section 4.3: lme(distance ~ age, random = ~ age | Subject), by REML
    y = np.array([[float(v) for v in row.split(",")] for row in ORTHODONT.split()])
    x, residual = np.column_stack([np.ones(4), [8.0, 10.0, 12.0, 14.0]]), 1.3100397
    information = np.repeat((x.T @ x / residual**2)[None], 27, axis=0)
    said = Summaries(information, y @ x / residual**2, np.repeat(np.eye(2)[None], 27, axis=0))
    found = PopulationFit.fitted(said, np.ones((2, 2), dtype=bool))
    assert found.at.beta == pytest.approx([16.76111, 0.6601852], rel=1e-6)
    assert np.sqrt(np.diag(found.at.spread)) == pytest.approx([0.7752461, 0.0712533], rel=1e-4)
    assert found.sizes == pytest.approx([2.3270357, 0.2264279], rel=1e-4)
    assert found.omega[0, 1] / found.sizes.prod() == pytest.approx(-0.609, abs=5e-4)
    constant = -0.5 * float(np.sum(y**2)) / residual**2 - 108 * np.log(residual) - 0.5 * 106 * np.log(2.0 * np.pi)
    assert found.at.log + constant == pytest.approx(-221.3183, abs=1e-4)
    assert [found.freedom_of_mean(c) for c in np.eye(2)] == pytest.approx([26.0, 26.0])


def test_the_restricted_likelihood_is_that_of_all_readings() -> None:
    rng = np.random.default_rng(4)
    slopes = rng.normal(size=(5, 3, 2))
    slopes[0, :, 1] = 0.0
    y, design = rng.normal(size=(5, 3)), np.repeat(np.kron([[1.0]], np.eye(2))[None], 5, axis=0)
    said = Summaries(np.einsum("nki,nkj->nij", slopes, slopes), np.einsum("nki,nk->ni", slopes, y), design)
    differences = []
    for root in (np.diag([0.7, 0.0]), np.array([[1.1, 0.0], [-0.4, 0.5]])):
        # all 15 readings at once: covariance 1 + Z Omega Z', design Z X
        z = np.zeros((15, 10))
        for n in range(5):
            z[3 * n : 3 * n + 3, 2 * n : 2 * n + 2] = slopes[n]
        wide = np.eye(15) + z @ np.kron(np.eye(5), root @ root.T) @ z.T
        x = slopes.reshape(15, 2)
        precise = np.linalg.inv(wide)
        beta = np.linalg.solve(x.T @ precise @ x, x.T @ precise @ y.ravel())
        left = y.ravel() - x @ beta
        dense = -0.5 * (left @ precise @ left + np.linalg.slogdet(wide)[1] + np.linalg.slogdet(x.T @ precise @ x)[1])
        here = RestrictedLikelihood.at(said, root)
        assert here.beta == pytest.approx(beta)
        differences.append(here.log - dense)
    assert differences[0] == pytest.approx(differences[1], abs=1e-10)


def test_slope_is_the_derivative() -> None:
    said, _ = summaries(9, 3, 1)
    root = np.linalg.cholesky(np.array([[1.0, 0.3, 0.0], [0.3, 0.8, -0.2], [0.0, -0.2, 0.5]]))
    at = RestrictedLikelihood.at(said, root)
    for i, j in ((0, 0), (1, 0), (2, 1)):
        step = np.zeros((3, 3))
        step[i, j] = 1e-5
        by_differences = (RestrictedLikelihood.at(said, root + step).log - RestrictedLikelihood.at(said, root - step).log) / 2e-5
        assert (at.slope @ root)[i, j] == pytest.approx(by_differences, rel=1e-5)


def test_degrees_of_freedom_of_alike_units_are_one_less_than_units() -> None:
    rng = np.random.default_rng(5)
    information = np.repeat((1e8 * np.eye(2))[None], 20, axis=0)
    said = Summaries(information, 1e8 * rng.normal(size=(20, 2)), np.repeat(np.eye(2)[None], 20, axis=0))
    found = PopulationFit.fitted(said, np.ones((2, 2), dtype=bool))
    values = said.score / 1e8
    assert found.omega == pytest.approx(np.cov(values.T), rel=1e-5)
    assert found.freedom_of_spread(0) == pytest.approx(19.0, rel=1e-4)
    mean = interval_of_mean(found, np.array([1.0, 0.0]))
    assert (mean.high - mean.low) / 2 == pytest.approx(2.0930 * values[:, 0].std(ddof=1) / 20**0.5, rel=1e-4)


def test_intervals_end_where_the_restricted_likelihood_has_fallen() -> None:
    found = PopulationFit.fitted(summaries(40, 2, 6)[0], np.ones((2, 2), dtype=bool))
    spread, together = interval_of_spread(found, 1), interval_of_correlation(found, 0, 1)
    for end in spread[:2]:
        assert found.rise((1,), end)[0] ** 0.5 == pytest.approx(1.96, abs=0.02)
    for end in together[:2]:
        assert found.rise((0, 1), end)[0] ** 0.5 == pytest.approx(1.96, abs=0.02)
    assert spread.low < found.sizes[1] < spread.high
    assert together.low < found.omega[0, 1] / found.sizes.prod() < together.high


def test_units_that_are_one_log_have_no_spread() -> None:
    """Three copies of a unit: the fit began at a spread of 1e-22 and ended at an infinite one."""
    said = Summaries(np.full((3, 1, 1), 54098.4), np.full((3, 1), -0.3038), np.ones((3, 1, 1)))
    found = PopulationFit.fitted(said, np.ones((1, 1), dtype=bool))
    assert np.isfinite(found.at.log)
    assert found.sizes[0] < 0.01 / np.sqrt(54098.4)
    assert found.at.beta == pytest.approx([-0.3038 / 54098.4], rel=1e-6)


def test_a_spread_of_one_value_ends_where_twice_the_logarithm_of_its_likelihood_has_fallen_by_that_of_95_per_cent() -> None:
    """Twice a logarithm of a likelihood ratio is distributed as chi-square with one degree of freedom: 3.841 by 95 %."""
    said, _ = summaries(40, 1, 7)
    found = PopulationFit.fitted(said, np.ones((1, 1), dtype=bool))
    most = found.at.log
    for end in interval_of_spread(found, 0)[:2]:
        assert 2.0 * (most - RestrictedLikelihood.at(said, np.array([[end]])).log) == pytest.approx(3.841, abs=0.05)


def test_a_spread_that_is_not_there_is_zero() -> None:
    said, _ = summaries(40, 2, 12, np.diag([1.0, 0.0]), noise=1.0)
    found = PopulationFit.fitted(said, np.ones((2, 2), dtype=bool))
    assert found.rise((1,), 0.0)[0] < 0.5
    low, high, _ = interval_of_spread(found, 1)
    assert low == 0.0
    assert 0.05 < high < 0.6


def test_one_value_is_a_population_too() -> None:
    found = PopulationFit.fitted(summaries(20, 1, 4)[0], np.ones((1, 1), dtype=bool))
    low, high, _ = interval_of_spread(found, 0)
    assert low < found.sizes[0] < high
    assert odd_units(found) == []


def test_an_odd_unit_is_named_and_no_other() -> None:
    said, values = summaries(60, 3, 8)
    assert odd_units(PopulationFit.fitted(said, np.ones((3, 3), dtype=bool))) == []
    moved = said.score.copy()
    for unit, k in ((10, 1), (20, 2)):
        moved[unit] += said.information[unit][:, k] * (7.0 - values[unit, k])
    found = odd_units(PopulationFit.fitted(Summaries(said.information, moved, said.design), np.ones((3, 3), dtype=bool)))
    assert {(o.unit, o.value) for o in found} == {(10, 1), (20, 2)}


@pytest.mark.parametrize(("far", "named"), [(1.0, [4]), (0.3, [])])
def test_a_unit_beside_others_that_do_not_differ_is_as_far_as_its_own_error_says(far: float, named: list[int]) -> None:
    """Of four units within their errors, 0.1, the spread vanishes; the fifth was 68,410,206 standard deviations away, of none left."""
    values, information = np.array([-0.05, 0.02, 0.06, -0.03, far]), np.full((5, 1, 1), 0.1**-2)
    said = Summaries(information, 0.1**-2 * values[:, None], np.repeat(np.eye(1)[None], 5, axis=0))
    found = odd_units(PopulationFit.fitted(said, np.ones((1, 1), dtype=bool)))
    assert [o.unit for o in found] == named
    assert [o.distance for o in found] == pytest.approx([far / (0.1 * 1.25**0.5)] * len(found), rel=1e-3)


@pytest.fixture(scope="module")
def logs() -> dict[str, td.Record]:
    return boxes(14, 21, weak=0.4)[0]


@pytest.fixture(scope="module")
def fleet(logs: dict[str, td.Record]) -> td.inference.Fleet:
    return td.inference.fleet(MODEL, logs, FREE)


def test_a_fleet_of_logs_long_and_short(fleet: td.inference.Fleet) -> None:
    for path in FREE:
        v = fleet.values[path]
        assert v.low < MEANS[path] < v.high
        assert v.spread_low < SPREADS[path] < v.spread_high
        assert not v.vanished
        assert 0.9 < v.one_more_unit < 1.0
    true = dict(zip(fleet.units, boxes(14, 21, weak=0.4)[1], strict=True))
    far = [(np.log(v) - true[n][k]) / (e / v) for n, of in fleet.units.items() for k, (v, e) in enumerate(of.values())]
    assert np.std(far) == pytest.approx(1.0, abs=0.4)  # 28 values: three standard deviations of a standard deviation
    assert fleet.odd == ()
    assert fleet.remarks == ()
    assert fleet.standing.fair
    assert not fleet.shared.any()


def test_held_values_are_said_and_what_all_units_share_is_counted() -> None:
    """Intervals of means had only what units differ by: an assumed value was not said, a stated range not counted."""
    held = tomllib.loads("""case = { value = '450 [J/K]', min = 200, max = 900, source = 'assumed', basis = 'a guess' }
area = { value = '600 [cm^2]', spread = '60 [cm^2]', source = 'assumed', basis = 'a sketch' }""")
    skin = {**DECK["surfaces"]["skin"], "area": held["area"]}
    wrong = {**DECK, "nodes": {**DECK["nodes"], "case": {"capacitance": held["case"]}}, "surfaces": {"skin": skin}}
    found = td.inference.fleet(model_from_dict(wrong), boxes(3, 21, spreads=dict.fromkeys(FREE, 0.01))[0], FREE)
    assert any("('case.capacitance')" in r for r in found.remarks)
    assert np.sqrt(found.shared[1, 1]) == pytest.approx(0.1, rel=0.2)
    v, bare = found.values["skin.effective_htc"], interval_of_mean(found.population, np.eye(2)[1])
    assert np.log(v.high / v.low) == pytest.approx(np.hypot(bare.high - bare.low, 3.92 * np.sqrt(found.shared[1, 1])), rel=1e-2)
    assert v.low < MEANS[v.path] < v.high


def test_the_worst_fit_of_a_unit_stands_first(fleet: td.inference.Fleet) -> None:
    """With 45 for 36.5 J/K of a card held, a coefficient was 2.00 (1.92 .. 2.08) for 1.68, and no fit of a unit said a word."""
    of_unit = {"a": ("credible", "", "check: 'T1' differs by 1 K."), "b": (*BAD, "check: 'T2' differs by 2 K.")}
    fits = {n: UnitJudgement(Standing(state, because), (check,), "", np.eye(2)) for n, (state, because, check) in of_unit.items()}
    told = replace(fleet, standing=standing_of(fits))
    assert all(part in str(told) for part in ("NOT CREDIBLE: 1 of 2", "'b': P", "+9 %\n"))
    assert told.to_dict()["standing"]["state"] == "not credible"
    assert checks_of(fits) == ("check: 'T1' differs by 1 K (2 units of 2, 'a' shown)",)


def test_workers_give_the_same(fleet: td.inference.Fleet, logs: dict[str, td.Record]) -> None:
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(2) as pool:
        other = td.inference.fleet(MODEL, dict(list(logs.items())), FREE, executor=pool)
    assert other.to_dict() == fleet.to_dict()


def test_the_next_unit(fleet: td.inference.Fleet) -> None:
    draws = fleet.draws(4000)
    assert {p: np.std(np.log(d)) for p, d in draws.items()} == pytest.approx(
        {p: (v.spread**2 + (np.log(v.high / v.low) / 4.3) ** 2) ** 0.5 for p, v in fleet.values.items()}, rel=0.05
    )
    told = dict(re.findall(r'"(.+)" = \{ mean = "(.+?) \[', fleet.priors()))
    assert {p: float(m) for p, m in told.items()} == pytest.approx({p: v.mean for p, v in fleet.values.items()}, rel=1e-3)
    hot = td.Scenario("hot", boundaries={"room": "40 [degC]"}, start="room", duration="1 [h]")
    runs = fleet.predict(hot, 50)
    assert runs.members == 50
    assert runs.sd("board")[-1] > 0.1
    assert np.isfinite(fleet.plot().get_lines()[0].get_ydata()).all()
    assert list(fleet.to_frame()["path"]) == list(FREE)


def test_covariates_move_means() -> None:
    rng = np.random.default_rng(3)
    masses = np.linspace(0.8, 1.2, 9)
    made = {
        f"b{k}": log(
            f"b{k}",
            {FREE[0]: 640.0 * float(np.exp(0.1 * rng.normal())), FREE[1]: 9.3 * float(np.exp(m - 1.0 + 0.02 * rng.normal()))},
            7200.0,
            rng,
        )
        for k, m in enumerate(masses)
    }
    given = {n: {"mass": float(m), "batch": "AB"[k % 2]} for k, (n, m) in enumerate(zip(made, masses, strict=True))}
    found = td.inference.fleet(MODEL, made, FREE, covariates=given)
    effects = {(e.covariate, e.path): e for e in found.effects}
    mass, batch = effects["mass", FREE[1]], effects["batch B", FREE[1]]
    assert mass.low < 1.0 < mass.high
    assert mass.low > 0.5
    assert batch.low < 0.0 < batch.high
    heavy = found.draws(2000, covariates={"mass": 1.2})[FREE[1]]
    assert np.median(heavy) == pytest.approx(9.3 * np.exp(0.2), rel=0.05)
    with pytest.raises(IdentificationError, match="colour"):
        found.draws(covariates={"colour": 1.0})


@pytest.mark.parametrize(
    ("free", "covariates", "code", "match"),
    [
        (["skin.effective_htc", "skin.area"], {}, "fleet.not-identifiable", ""),
        (list(FREE), {"b000": {"mass": 1.0}}, "fleet.covariate", ""),
        (list(FREE), {"nobody": {"mass": 1.0}}, "name.unknown", ""),
    ],
)
def test_what_cannot_be_is_refused(logs: dict[str, td.Record], free: list[str], covariates: dict, code: str, match: str) -> None:
    few = {n: logs[n] for n in list(logs)[:4]}
    with raises_code(code, IdentificationError, match=match):
        td.inference.fleet(MODEL, few, free, covariates=covariates)


def test_two_units_are_no_fleet(logs: dict[str, td.Record]) -> None:
    with raises_code("fleet.too-small", IdentificationError):
        td.inference.fleet(MODEL, {n: logs[n] for n in list(logs)[:2]}, FREE)


FILE = """
title = "boxes"
[records.units]
files = "b*.csv"
time = "time_s"
[records.units.channels]
board = { node = "board", noise = "0.05 [K]" }
case = { node = "case", noise = "0.05 [K]" }
room = { boundary = "room" }
heater = { load = "heater" }
[[stages]]
name = "box"
model = "box.toml"
records = ["units"]
free = ["joint.contact_conductance", "skin.effective_htc"]
"""


def test_the_command_gives_the_same(logs: dict[str, td.Record], fleet: td.inference.Fleet, tmp_path: Path) -> None:
    import json

    td.save_model(MODEL, tmp_path / "box.toml")
    for n, record in logs.items():
        columns = [record.channels[c].values - (273.15 if c != "heater" else 0.0) for c in ("board", "case", "room", "heater")]
        rows = [",".join(f"{v:.9g}" for v in row) for row in zip(record.times, *columns, strict=True)]
        (tmp_path / f"{n}.csv").write_text("\n".join(["time_s,board,case,room,heater", *rows, ""]), encoding="utf-8")
    units = "\n".join(f'{n} = {{ records = ["{n}"] }}' for n in logs)
    path = tmp_path / "fleet.toml"
    path.write_text(f"{FILE}[fleet.units]\n{units}\n", encoding="utf-8")
    answer = CliRunner().invoke(app, ["fleet", str(path), "--json"])
    assert answer.exit_code == 0, answer.output
    said = json.loads(answer.stdout)
    for p, v in fleet.values.items():
        assert said["values"][p]["mean"] == pytest.approx(v.mean, rel=1e-4)
        assert said["values"][p]["spread"] == pytest.approx(v.spread, rel=1e-3)
    path.write_text(FILE, encoding="utf-8")
    answer = CliRunner().invoke(app, ["fleet", str(path)])
    assert isinstance(answer.exception, DeckError)
