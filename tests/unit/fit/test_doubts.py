"""What is said where errors cannot count what a structure may lack, and the heats that they count. Synthetic logs."""

from __future__ import annotations

import numpy as np
import pytest

from recovery.mass_cases import drawn
from thermid.base.errors import SolverError
from thermid.fit._calibrate import calibrate
from thermid.fit._discrepancy import doubts
from thermid.fit._discrepancy.doubts import settling


@pytest.mark.parametrize("error", [SolverError("the run ends at 12 s."), np.linalg.LinAlgError("singular")])
def test_what_cannot_be_counted_is_said(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fails(*_: object) -> None:
        raise error

    monkeypatch.setattr(doubts, "_widened_by", fails)
    bench = drawn(102)
    found = calibrate(bench.model, bench.record, list(bench.free))
    assert not found.doubted
    (said,) = [w for w in found.warnings if "do not count what the structure may lack" in w]
    assert said.endswith("Look for it with `thermid criticise`.")
    assert ("the run ends at 12 s)" in said) == isinstance(error, SolverError)


def test_a_power_settles_after_each_of_its_steps() -> None:
    """From rest a step of 6 W has 6 exp(-t / pace) W yet to settle, at every time."""
    times = np.linspace(0.0, 3600.0, 721)
    assert settling(times, np.full(times.size, 6.0), 600.0) == pytest.approx(6.0 * np.exp(-times / 600.0))
