"""Ten thousand pad holds of the navigation unit on its host: interrupted, resumed, and the same numbers from three executors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.prediction.members import UncertainRuns
from thermid.simulation.runs import KeptTasks

MACRO = Path(__file__).parents[2] / "examples" / "sisnav" / "macro"
MEMBERS = 10_000


@pytest.fixture(scope="module")
def question() -> td.qualify.HoldQuestion:
    return td.qualify.load_hold(MACRO / "hold.toml")


@pytest.fixture(scope="module")
def whole(question: td.qualify.HoldQuestion, tmp_path_factory: pytest.TempPathFactory) -> tuple[UncertainRuns, td.qualify.Hold]:
    """Stopped after a third, as by Ctrl-C, and gone on with."""
    folder = tmp_path_factory.mktemp("runs")

    def stop(done: int, members: int) -> None:
        if done >= members // 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        question.run(executor=KeptTasks(folder), progress=stop)
    kept = {p: p.stat().st_mtime_ns for p in folder.rglob("*.npz")}
    assert len(kept) == 7
    runs, found = question.run(executor=KeptTasks(folder))
    assert runs.reused == 3500
    assert {p: p.stat().st_mtime_ns for p in kept} == kept
    return runs, found


def test_a_small_hold_of_the_unit(question: td.qualify.HoldQuestion) -> None:
    """Quick: 64 members; no cooling takes a gyro beyond 50 degC in some of them, after hours."""
    runs = td.qualify.uncertain_runs(question.model, question.scenarios, spread=question.spread, n=64, seed=7, nodes=["FOG_x"])
    found = td.qualify.hold(runs, {"FOG_x": "50 [degC]"}, confidence=0.8)
    assert 2.5 * 3600 < found.together.hold < 7 * 3600
    assert 0.2 < found["FOG_x"].never < 0.7
    assert found.watermark == "demonstration, 64 assumed parameters"


@pytest.mark.campaign
def test_ten_thousand_holds(whole: tuple[UncertainRuns, td.qualify.Hold]) -> None:
    runs, found = whole
    assert len(runs) == MEMBERS
    assert not runs.failed
    first = found["FOG_x"]
    assert first.between[1] - first.between[0] < 600.0
    assert {d.name for d in first.drivers[:5]} == {"start_time", "scale.equipment", "sky", "weather", "insulation"}
    assert 0.9 < sum(d.share for d in first.drivers) <= 1.0


@pytest.mark.campaign
def test_processes_give_the_same_ten_thousand(question: td.qualify.HoldQuestion, whole: tuple[UncertainRuns, td.qualify.Hold]) -> None:
    assert np.array_equal(question.run(executor=2)[0].temperatures, whole[0].temperatures)


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_of_two_workers_gives_the_same_ten_thousand(
    question: td.qualify.HoldQuestion, whole: tuple[UncertainRuns, td.qualify.Hold]
) -> None:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        assert np.array_equal(question.run(executor=cluster.scheduler_address)[0].temperatures, whole[0].temperatures)
