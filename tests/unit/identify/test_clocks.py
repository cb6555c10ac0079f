"""Two logs on two clocks: joined, and aligned by a model."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from thermid.errors import IdentificationError, RecordError

BOX = td.model_from_dict(
    {
        "title": "Box",
        "needs": ["air"],
        "nodes": {"case": {"capacitance": "300 [J/K]"}},
        "conductors": {"out": {"kind": "conduction", "between": ["case", "air"], "conductance": "0.5 [W/K]"}},
        "loads": {"heat": {"into": "case", "power": "10 [W]"}},
    }
)
SLOW = np.arange(0.0, 1801.0, 5.0)
FAST = np.arange(0.0, 1201.0, 2.0)
POWER = np.where((FAST > 100) & (FAST < 500), 20.0, np.where((FAST > 700) & (FAST < 1100), 12.0, 0.0))
AIR = td.Scenario("s", {"air": "20 [degC]"}, start="20 [degC]")


def logs(offset: float, rate: float) -> tuple[td.Record, td.Record]:
    """Return temperatures, and powers on a clock that runs otherwise."""
    there = offset + rate * FAST
    power = (np.concatenate([[0.0], there, [SLOW[-1]]]), np.concatenate([[0.0], POWER, [0.0]]))
    made = td.Scenario("s", {"air": "20 [degC]"}, {"heat": power}, start="20 [degC]", duration=float(SLOW[-1]))
    readings = td.simulate(BOX, made, times=SLOW)["case"].kelvin + 0.05 * np.random.default_rng(3).standard_normal(SLOW.size)
    first = td.Record.from_arrays("bench", SLOW, {"T": td.Channel.of("T", readings, role="node", target="case", noise=0.05)})
    second = td.Record.from_arrays("meter", FAST, {"P": td.Channel.of("P", POWER, quantity="power", role="load", target="heat")})
    return first, second


def test_offset_and_rate_come_back() -> None:
    found = td.align(BOX, *logs(130.0, 1.08), offset=(0.0, 300.0), rate=(0.9, 1.2), scenario=AIR)
    assert found.offset == pytest.approx(130.0, abs=3.0)
    assert found.rate == pytest.approx(1.08, abs=0.005)
    assert found.rmse["T"] < 0.15
    assert "offset 1" in str(found)


def test_a_rate_can_be_held() -> None:
    found = td.align(BOX, *logs(130.0, 1.0), offset=(0.0, 300.0), scenario=AIR)
    assert (found.rate, found.rate_error) == (1.0, 0.0)
    assert found.offset == pytest.approx(130.0, abs=3.0)


def test_no_offset_is_refused() -> None:
    with pytest.raises(IdentificationError, match="no offset lets the model run over both logs"):
        td.align(BOX, *logs(130.0, 1.0), offset=(5000.0, 6000.0), scenario=AIR)


def test_joined_records_keep_every_sample() -> None:
    first, second = logs(130.0, 1.0)
    both = first.joined(second, 130.0, 1.0)
    assert both["T"].valid.sum() == SLOW.size
    assert both["P"].valid.sum() == FAST.size
    at = both.times[both["P"].valid]
    assert at == pytest.approx(130.0 + FAST)
    assert both["P"].values[both["P"].valid] == pytest.approx(POWER)
    assert both.origin.sha256 not in (first.origin.sha256, second.origin.sha256)
    assert "joined with" in both.steps[-1]


def test_records_that_cannot_be_joined() -> None:
    first, second = logs(130.0, 1.0)
    with pytest.raises(RecordError, match="must be above zero"):
        first.joined(second, 0.0, 0.0)
    with pytest.raises(RecordError, match="'T' is a channel of both logs"):
        first.joined(first)
    with pytest.raises(RecordError, match="do not overlap"):
        first.joined(second, 5000.0)
