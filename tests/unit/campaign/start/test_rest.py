"""What the beginning of a log without power says of the offsets of its thermometers."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from thermid.campaign._start.proposal import Rest, beginning_rest
from thermid.campaign._start.roles import Power, Roles

ROLES = Roles({"plate": "plate", "board": "board"}, "room", (Power("P", "plate"),))
NOISE = {"plate": 0.04, "board": 0.04}


def rest(plate: float, room: float, lag: float = 0.0, unread: bool = False) -> Rest:
    """That of 40 min without power, in which plate and room change by so much [K], the plate with a lag [s]."""
    times = np.arange(0.0, 3600.0, 30.0)
    course, rng = np.minimum(times, 2400.0) / 2400.0, np.random.default_rng(4)
    heat = np.exp(-times / lag) if lag else 1.0 - course
    columns = {
        "plate": 295.15 + plate * (1.0 - heat) + 10.0 * (times > 2400.0) + 1.2 + 0.04 * rng.standard_normal(times.size),
        "board": 294.85 + 0.5 * room * course + 0.04 * rng.standard_normal(times.size),
        "room": np.round((295.15 + room * course) * 10.0) / 10.0,
    }
    if unread:
        columns["board"][times <= 2400.0] = np.nan
    channels = {n: td.Channel.from_array(n, values, unit="K") for n, values in columns.items()}
    power = td.Channel.from_array("P", np.where(times > 2400.0, 20.0, 0.0), quantity="power", unit="W")
    return beginning_rest(td.Record.from_arrays("r", times, {**channels, "P": power}), ROLES, NOISE, 0.5)


def test_a_still_room_and_one_that_drifts_are_rest() -> None:
    """A room that drifted by 0.5 K in 40 min was no rest: the user was told to wait, who had."""
    still, drifting = rest(0.0, 0.0), rest(0.2, 0.5)
    assert (still.seconds, still.steady, still.shows, still.silent) == (2400.0, True, True, ())
    assert (drifting.seconds, drifting.steady, drifting.shows) == (2400.0, False, True)
    assert drifting.drift == pytest.approx(0.15, abs=0.03)
    value, error = drifting.offsets["plate"]
    assert abs(value - 1.2) < 3 * error < 0.5


@pytest.mark.parametrize(("plate", "room", "lag"), [(-10.0, 0.0, 36000.0), (-1.0, 0.5, 0.0), (0.5, 0.0, 0.0), (0.0, 1.5, 0.0)])
def test_a_part_that_cools_or_lags_far_behind_is_not_at_rest(plate: float, room: float, lag: float) -> None:
    assert not rest(plate, room, lag).shows


def test_a_part_without_readings_at_rest_is_named_and_hides_no_other() -> None:
    found = rest(0.0, 0.0, unread=True)
    assert found.shows
    assert found.silent == ("board",)
