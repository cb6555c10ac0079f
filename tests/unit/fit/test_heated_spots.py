"""A sensor at the heated end of its part: one node does not hold it, and nobody is told to quote what would be expected then."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.fit.error_model import ErrorModel

sys.path.insert(0, str(Path(__file__).parents[3] / "scripts"))
from judging import benches as b
from judging.tasks import task

Array = np.ndarray


def _zones(v: dict[str, Array], power: Array, room: Array, vacuum: bool = False, step: float = b.STEP) -> Array:
    """As `benches.temperatures`, of a core of three zones with 1 W/K between them, heated and measured in the first. [K]"""

    def rate(y: Array, heat: Array, around: Array) -> Array:
        shell, d = y[3], y[3] - around
        lost = b.AREA * v["natural"] * np.sign(d) * np.abs(d) ** v["exponent"]
        lost += b.AREA * b.SIGMA * v["emissivity"] * (shell**4 - around**4)
        passed = [heat, y[0] - y[1], y[1] - y[2], v["contact"] * (y[2] - shell), lost]
        return np.asarray(-np.diff(passed, axis=0) / np.stack([*[v["core"] / 3] * 3, v["shell"]]))

    y, out = np.repeat(room[:1], 4, axis=0), []
    for heat, around in zip(power, room, strict=True):
        out.append(y[[0, 3]].T)
        middle = y + 0.5 * step * rate(y, heat, around)
        y = y + step * rate(middle, heat, around)
    return np.stack(out)


@pytest.mark.parametrize("zones", [True, False])
def test_a_sensor_at_the_heated_end_is_told_from_one_that_reads_its_node(zones: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the comparison the core was expected 48 to 55 % too small, with a half-width of 4 %."""
    if zones:
        monkeypatch.setattr(b, "temperatures", _zones)
    family = b.FAMILIES["mild"]
    made = b.made(family.with_name("zones", factors={**family.factors, "lead": 0.0}), 1, 20261130)
    t = task(made, 0)
    fit = td.calibrate(t.model, t.records, t.free, priors=t.priors)
    model = ErrorModel.of_fit(fit)
    assert ErrorModel.from_dict(model.to_dict()).spot == model.spot == ("core" if zones else "")
    part = ErrorModel.from_dict(model.to_dict() | {"at": "unit."})  # as the part of a larger model
    assert part.spot == ("unit.core" if zones else "")
    assert bool(part.contradiction) == bool(model.contradiction)
    assert ("core" in fit.unexplained) == zones
    if zones:
        assert not fit.expected
        assert fit.own.state == "not adequate"
