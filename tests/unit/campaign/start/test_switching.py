"""Instants of powers: a log has a change at its next sample, and its clock may be late; the temperatures say when it was."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.campaign._start.project import parted, write_project
from thermid.campaign._start.proposal import propose
from thermid.campaign._start.roles import Roles, roles_of

pytestmark = pytest.mark.usefixtures("values_alone")

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


@pytest.mark.parametrize(
    ("late", "edges", "count"),
    [(0.0, EDGES, 3), (45.0, EDGES, 3), (0.0, (600.0, 2400.0, 4020.0), 0)],
    ids=["between", "late", "at samples"],
)
def test_powers_that_changed_between_samples_are_no_masses(tmp_path: Path, late: float, edges: tuple[float, ...], count: int) -> None:
    """Taken as they are logged, 30 W half a minute late are 900 J: the log asked for more masses than the one plate."""
    roles, record = logged(tmp_path / "log.csv", late, edges)
    found = propose(roles, [record], 400)
    assert found.chosen.nodes == 1
    assert found.chosen.values["plate.capacitance"] == pytest.approx(900.0, rel=0.02)
    assert sum(len(e.instants) for e in found.chosen.problem.experiments) == count


def test_the_campaign_finds_the_instants_and_the_logs_stay_as_they_are(tmp_path: Path) -> None:
    roles, record = logged(tmp_path / "log.csv", 45.0)
    fitted, holdout, _ = parted([record])
    written = write_project(tmp_path / "p", propose(roles, fitted, 400), fitted, holdout, "log.csv", "plate")
    assert written.proposal.instants_text in str(written)
    records = tomllib.loads((tmp_path / "p" / "campaign.toml").read_text())["records"]
    assert [r["channels"]["P"]["prompt"] for r in records.values()] == [False, False]
    again = td.read_record(tmp_path / "p" / "logs" / "fit.csv", {"P": {"load": "heat"}})
    assert again.times.tolist() == fitted[0].times.tolist()
    fit = td.run_stages(tmp_path / "p" / "campaign.toml").stages["first fit"]
    assert fit.values["plate.capacitance"].value == pytest.approx(900.0, rel=0.02)
