"""The score of real runs: factors come from other kinds alone, conformal prediction needs 19 runs, a refusal holds nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
import real_runs  # noqa: E402


def run(name: str, kind: str, size: float, half: float = 1.0) -> real_runs.Run:
    off = size * np.random.default_rng(len(name)).standard_normal(400)
    return real_runs.Run("made", kind, name, "mode", (off,), (np.full(400, half),))


@pytest.fixture(scope="module")
def curves() -> dict[str, dict[str, object]]:
    runs = [run("a" * k, "calm", 0.5) for k in range(1, 11)] + [run("b" * k, "wild", 2.0) for k in range(1, 11)]
    return {r.name: r.curves() for r in runs}


def test_share_width_and_score_at_a_factor() -> None:
    one = run("x", "k", 0.5).curves()
    share, half, score = real_runs.at(one, 1.0)
    assert share == pytest.approx(0.954, abs=0.02)
    assert half == pytest.approx(1.0)
    assert score == pytest.approx(2.0 + 40 * 0.5 * 0.0085, abs=0.4)
    assert real_runs.at(one, 2.0)[1] == pytest.approx(2.0)


def test_a_factor_comes_from_the_other_kinds(curves: dict[str, dict[str, object]]) -> None:
    rows = real_runs.table(curves, real_runs.best_factor)
    calm = np.mean([r[1] for n, r in rows.items() if curves[n]["kind"] == "calm"])
    wild = np.mean([r[1] for n, r in rows.items() if curves[n]["kind"] == "wild"])
    assert calm > 2.0 * wild  # the calm ones get the factor that the wild ones need, and the other way round


def test_conformal_prediction_is_infinite_with_few_runs(curves: dict[str, dict[str, object]]) -> None:
    few = [c for c in curves.values() if c["kind"] == "calm"]
    assert real_runs.conformal_factor(few) == float("inf")
    many = list(curves.values())
    assert real_runs.conformal_factor(many) == pytest.approx(max(float(c["factor"]) for c in many))  # type: ignore[arg-type]
    share, half, _ = real_runs.at(few[0], float("inf"))
    assert (share, half) == (1.0, float("inf"))


def test_a_refusal_holds_nothing() -> None:
    refused = real_runs.Run("made", "k", "x", "mode", (), (), "no").curves()
    rows = {"x": real_runs.at(refused, 1.0), "y": real_runs.at(run("y", "k", 0.5).curves(), 1.0)}
    assert real_runs.mean(rows, 0) == pytest.approx(0.5 * rows["y"][0])
    assert real_runs.mean(rows, 1) == pytest.approx(1.0)


def test_the_interval_is_over_kinds() -> None:
    shares = {f"{k}{i}": k == "a" for k in "ab" for i in range(50)}
    low, high = real_runs.interval({n: float(s) for n, s in shares.items()}, {n: n[0] for n in shares})
    assert (low, high) == (0.0, 1.0)


def test_what_fails_stands_first() -> None:
    now = real_runs.Row(0.8, (0.7, 0.9), 1.0, 2.0, {"k": (4, 0.7, 1.0, 2.0)})
    peer = real_runs.Row(0.8, (0.7, 0.9), 1.0, 4.0, {})
    found = real_runs.checks(now, dict.fromkeys(real_runs.PEERS, peer))
    assert [met for _, _, met in found] == [False, False, True, True, True]


def test_the_frozen_figures_are_those_of_the_commit() -> None:
    kept = json.loads(real_runs.FROZEN.read_text(encoding="utf-8"))
    assert kept["commit"] == "7b51ca9"
    rows = real_runs.table(kept["runs"]["tclabsp, room fitted"], real_runs.still)
    assert len(rows) == 57
    assert real_runs.mean(rows, 0) == pytest.approx(0.898, abs=0.001)
    assert real_runs.mean(rows, 1) == pytest.approx(0.714, abs=0.001)


def test_without_the_data_it_says_so(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "benchmarks" / "real_runs.py", "--data", tmp_path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0
    assert done.stderr.count("skipped") == len(real_runs.SETS)
    assert "--data" in done.stderr
