"""Instants of powers: a log has a change at its next sample, and its clock may be late; the temperatures say when it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.campaign._start.proposal import propose
from thermid.campaign._start.roles import Roles, roles_of
from thermid.campaign._start.switching import Instants, instants_text, with_instants

EDGES = (610.0, 2440.0, 4025.0)
"""When the power of the plate changes. [s]"""


def logged(path: Path, late: float = 0.0, edges: tuple[float, ...] = EDGES) -> tuple[Roles, td.Record]:
    """Write a log, a reading a minute, of a plate of 900 J/K with 0.5 W/K; its power is read from a clock that is late."""
    rng, levels = np.random.default_rng(8), np.array([0.0, 30.0, 6.0, 18.0])
    fine = np.arange(0.0, 6000.0, 1.0)
    watts, hot = levels[np.searchsorted(edges, fine, side="right")], np.zeros(fine.size)
    for k in range(1, fine.size):
        hot[k] = hot[k - 1] + (watts[k - 1] - 0.5 * hot[k - 1]) / 900.0
    rows = ["time [s],T_plate [degC],T_room [degC],P [W]"]
    for t in np.arange(0.0, 6000.0, 60.0):
        power = levels[np.searchsorted(edges, t - late, side="right")]
        rows.append(f"{t:g},{22.0 + hot[int(t)] + 0.03 * rng.standard_normal():.3f},{22.0 + 0.03 * rng.standard_normal():.3f},{power:g}")
    path.write_text("\n".join(rows) + "\n")
    roles = roles_of(path)
    return roles, roles.read(path)


@pytest.mark.parametrize("late", [0.0, 45.0])
def test_powers_that_changed_between_samples_are_no_masses(tmp_path: Path, late: float) -> None:
    """Taken as they are logged, 30 W half a minute late are 900 J: the log asked for more masses than the one plate."""
    roles, record = logged(tmp_path / "log.csv", late)
    found = propose(roles, [record], 400)
    assert found.chosen.nodes == 1
    assert found.chosen.values["plate.capacitance"] == pytest.approx(900.0, rel=0.02)
    (instants,) = found.instants.values()
    assert instants.logged + instants.shifts == pytest.approx(EDGES, abs=4.0)
    assert instants_text(found.instants) in str(found)


def test_powers_that_were_logged_when_they_changed_stay(tmp_path: Path) -> None:
    roles, record = logged(tmp_path / "log.csv", edges=(600.0, 2400.0, 4020.0))
    assert propose(roles, [record], 100).instants == {}


def test_a_record_has_rows_at_its_instants_and_the_readings_stay(tmp_path: Path) -> None:
    _, record = logged(tmp_path / "log.csv")
    moved = Instants(np.array([660.0, 2460.0, 4080.0]), np.array([-50.0, -20.0, 30.0]), 60.0)
    (made,) = with_instants([record], {record.name: moved})
    new = np.setdiff1d(made.times, record.times)
    assert new == pytest.approx([610.0, 2440.0, 4110.0])
    assert np.count_nonzero(made["T_plate"].valid) == record.times.size
    power = {float(t): float(v) for t, v in zip(made.times, made["P"].values, strict=True)}
    assert [power[t] for t in (600.0, 610.0, 660.0, 2400.0, 2440.0, 4080.0, 4110.0)] == [0.0, 30.0, 30.0, 30.0, 6.0, 6.0, 18.0]
    (other,) = with_instants([record], {"another": moved})  # no own temperatures said when: the mean of all
    assert np.setdiff1d(other.times, record.times) == pytest.approx([660.0 - 40.0 / 3.0, 2460.0 - 40.0 / 3.0, 4080.0 - 40.0 / 3.0])
