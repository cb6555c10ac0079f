"""The judge: a predictor of known coverage, the interval score by hand, refusals, bootstraps, pairs; its benches and its oracle."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
from judging import benches as b, scores as s  # noqa: E402
from judging.oracle import oracle_bands, reachable  # noqa: E402
from judging.report import difference_table, table  # noqa: E402
from judging.rules import RULES, fitted, rule  # noqa: E402
from judging.tasks import Answer, Question, Refusal, Task, distance, question, stratum, task, truth  # noqa: E402

import judge  # noqa: E402
from thermid.prediction.bands import Knowledge  # noqa: E402

NAMES = {"rule": "made", "set": "set", "stratum": "near", "sensor": "core"}


def rows_of(size: float, half: float, units: int = 200, seed: int = 1, **more: Any) -> list[s.Row]:
    """Rows of normal errors of a size under one half-width."""
    rng = np.random.default_rng(seed)
    names = [{**NAMES, "unit": str(k), "run": str(k), **more} for k in range(units)]
    return [s.scored(size * rng.standard_normal(400), np.array(half), **n) for n in names]


def test_a_band_of_known_coverage_holds_95_percent() -> None:
    found = s.summary(rows_of(0.3, 0.3 * 1.96))
    assert found.inside == pytest.approx(0.95, abs=0.003)  # 80,000 readings: 0.08 %
    assert found.factor == pytest.approx(1.0, abs=0.02)
    assert found.half / found.rms == pytest.approx(1.96, abs=0.02)
    assert found.inside_limits[0] < 0.95 < found.inside_limits[1]
    wide = s.summary(rows_of(0.3, 3.0 * 0.3 * 1.96))
    assert wide.factor == pytest.approx(1.0 / 3.0, abs=0.01)
    assert wide.score > found.score


def test_the_interval_score_is_that_of_a_hand_calculation() -> None:
    off = np.array([0.0, 1.5, -3.0])
    half = np.full(3, 1.0)
    # width 2, and 40 times what lies outside: 0, 0.5, 2
    np.testing.assert_allclose(s.interval_score(off, half), [2.0, 2.0 + 20.0, 2.0 + 80.0])
    row = s.scored(off, half, **NAMES, unit="1", run="1")
    assert (row.inside, row.score) == (pytest.approx(1 / 3), pytest.approx(106.0 / 3.0))
    assert row.square == pytest.approx((1.5**2 + 9.0) / 3.0)


def test_shares_of_runs_and_the_factor_of_a_stratum() -> None:
    good = s.scored(np.zeros(100), np.array(1.0), **NAMES, unit="1", run="1")
    bad = s.scored(np.full(100, 2.0), np.array(1.0), **NAMES, unit="2", run="2")
    found = s.summary([good, bad])
    assert (found.inside, found.most, found.few) == (0.5, 0.5, 0.5)
    assert found.factor == pytest.approx(2.0)
    assert found.rms == pytest.approx(2.0**0.5)


def test_one_run_has_no_limits_and_a_band_that_is_not_finite_is_refused() -> None:
    assert s.limits(rows_of(1.0, 1.0, 1), "score") == (-np.inf, np.inf)
    with pytest.raises(ValueError, match="not finite"):
        s.scored(np.zeros(3), np.array(np.nan), **NAMES, unit="1", run="1")


def test_the_bootstrap_draws_units_and_not_rows() -> None:
    rows = rows_of(1.0, 1.96, 20)
    tripled = [replace(r, run=f"{r.run}, {k}") for r in rows for k in range(3)]
    assert s.limits(tripled, "score") == pytest.approx(s.limits(rows, "score"), rel=1e-12)


def test_pairs_are_of_the_same_rows() -> None:
    before, after = rows_of(0.3, 2.0), rows_of(0.3, 0.3 * 1.96, 150)
    found = s.paired(before, after)
    assert found is not None
    assert found.rows == 150
    change, low, high = found.change["half"]
    assert change == pytest.approx(0.3 * 1.96 - 2.0)
    assert (low, high) == pytest.approx((change, change))  # every pair differs by the same
    assert found.change["score"][2] < 0.0
    assert s.paired(before, rows_of(0.3, 1.0, set="another")) is None
    assert "| all |" in difference_table(before, after)


def test_rows_travel_through_json() -> None:
    one = rows_of(0.3, 1.0, 1)[0]
    again = s.Row.from_dict(one.to_dict())
    assert again.key == one.key
    assert again.score == pytest.approx(one.score, abs=1e-6)


def test_the_constant_width_of_hindsight_holds_95_percent() -> None:
    rng = np.random.default_rng(2)
    offs = [rng.standard_normal(n) for n in (50, 400, 100)]
    rows = [s.scored(o, np.array(9.0), **NAMES, unit=str(k), run=str(k)) for k, o in enumerate(offs)]
    found = s.constant_of_hindsight(list(zip(offs, rows, strict=True)), "hindsight")
    assert np.mean([r.inside for r in found]) == pytest.approx(0.95, abs=0.01)
    assert len({round(r.half, 12) for r in found}) == 1


@pytest.fixture(scope="module")
def made() -> b.Benches:
    return b.made(b.FAMILIES["right"], 12, 5)


def test_a_refusal_is_scored_with_the_reachable_range(made: b.Benches, monkeypatch: pytest.MonkeyPatch) -> None:
    def declined(t: Task, q: Question) -> Refusal:
        return Refusal("no direction is determined")

    monkeypatch.setitem(RULES, "declined", declined)
    t, q = task(made, 0), question(made, 0, "1.5x")
    rows = [row for _, row in judge.judged_rows(rule("declined")(t, q), t, q, "declined")]
    low, high = reachable(made, "1.5x")
    assert [r.refused for r in rows] == [True, True]
    assert [r.half for r in rows] == pytest.approx((0.5 * (high - low)[0]).tolist())
    assert all(r.inside > 0.95 for r in rows)  # the range holds nearly every truth of its own law
    assert s.summary(rows).refused == 1.0


def test_a_band_beyond_the_reachable_range_is_counted(made: b.Benches) -> None:
    t, q = task(made, 0), question(made, 0, "near")
    true = truth(made, 0, "near")
    told = {size: Answer(true, {n: np.full(q.times.size, size) for n in q.nodes}) for size in (0.5, 300.0)}
    narrow, wide = ([r.beyond for _, r in judge.judged_rows(a, t, q, "made")] for a in told.values())
    assert (narrow, wide) == ([False, False], [True, True])


def test_the_oracle_holds_and_is_narrow() -> None:
    found = b.made(b.FAMILIES["right, drift 0"], 40, 7)
    centre, half = oracle_bands(found, "1.5x")
    off = found.runs["1.5x"].truth - centre
    inside = np.mean(np.abs(off) <= half, axis=(0, 2))
    # errors of a bench are nearly one number, so that shares scatter as those of some 40 numbers: 95 % +- 3.4 %
    assert inside.mean() > 0.86
    assert 1.2 < half.mean() / np.sqrt(np.mean(off**2)) < 3.0


def test_benches_have_the_stated_spreads_and_asked_runs_change_no_other() -> None:
    values = b.drawn_values(b.FAMILIES["mild"], 4000, np.random.default_rng(0))
    for name, sd in b.SPREADS.items():
        logs = np.log(values[name] / b.MIDDLES[name])
        assert abs(logs.mean()) < 5.0 * sd / 4000**0.5
        assert logs.std() == pytest.approx(sd, rel=0.06)
    one = b.made(b.FAMILIES["mild"], 2, 3)
    other = b.made(b.FAMILIES["mild"].with_name("mild", asked=("near",)), 2, 3)
    np.testing.assert_array_equal(one.runs["near"].readings, other.runs["near"].readings)
    np.testing.assert_array_equal(one.runs["a"].readings, other.runs["a"].readings)


def test_a_bench_keeps_its_heat() -> None:
    # without losses what is put in is what core and shell hold
    v = {n: np.array([x]) for n, x in b.MIDDLES.items()} | {
        n: np.array([0.0]) for n in ("natural", "emissivity", "lead", "hidden", "growth")
    }
    v |= {"exponent": np.array([1.25]), "hidden capacitance": np.array([150.0])}
    found = b.temperatures(v, np.full((121, 1), 5.0), np.full((121, 1), 295.0))
    held = (found[-1, 0] - 295.0) @ [b.MIDDLES["core"], b.MIDDLES["shell"]]
    assert held == pytest.approx(5.0 * 3600.0, rel=1e-9)


def test_strata_are_the_judges_own() -> None:
    mild = b.FAMILIES["mild"]
    assert [distance(mild, n) for n in ("near", "1.5x", "2x", "vacuum")] == [
        "power 1",
        "power to 1.6, room",
        "power above 1.6, room",
        "gas changed",
    ]
    assert stratum(1.0, 0.0, swapped=True) == "unit swapped"


@pytest.mark.parametrize("structure", ["right", pytest.param("constant", marks=pytest.mark.campaign)])
def test_todays_code_answers_and_its_peers_stand_beside_it(structure: str) -> None:
    family = next(f for f in b.FAMILIES.values() if f.structure == structure).with_name("small", drift=0.0, asked=("1.5x",))
    rows = judge.bench_rows(family, 1, 11, ["today", "today~run", "persistence", "oracle"])
    assert {r.rule for r in rows} == {"today", "today~run", "persistence", "oracle", judge.HINDSIGHT}
    assert not any(r.refused for r in rows)
    shown = table(rows)
    assert "| small | 1.5x: power to 1.6, room | today | 1 |" in shown
    assert np.mean([r.score for r in rows if r.rule == "oracle"]) < np.mean([r.score for r in rows if r.rule == "today"])


def test_what_is_left_out_is_left_out_of_what_the_fit_keeps(made: b.Benches) -> None:
    """By what the fit keeps, not by the band: of a bench that is as its deck says no element departs, with 998 in 1000, in either rule."""
    t, q = task(made, 0), question(made, 0, "1.5x")
    kept = {}
    for left_out in ((), ("run",)):
        assert isinstance(RULES["today"](t, q, left_out), Answer)
        (kept[left_out],) = Knowledge.of_source(fitted(t, left_out)).errors  # type: ignore[arg-type]
    assert kept[()].sizes["run"] > 1e-3
    assert kept["run",].sizes["run"] < 1e-8
    assert kept["run",].sizes["joint"] > 0.0


def test_the_script_runs() -> None:
    done = subprocess.run([sys.executable, str(ROOT / "scripts" / "judge.py"), "--help"], capture_output=True, text=True, check=True)
    assert "--against" in done.stdout
