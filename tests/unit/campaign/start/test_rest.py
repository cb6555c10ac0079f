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
    start = drifting.starts["initial.plate"]
    assert float(start.start.split()[0]) == pytest.approx(295.15, abs=0.02)
    assert start.sd == pytest.approx(0.5, abs=0.05)  # the room's drift, and noise


@pytest.mark.parametrize(("hour", "since"), [(0.3, 0.0), (1.0, 1.0), (3.0, 2.0)])
def test_a_part_that_follows_a_room_is_behind_it_by_no_more_than_is_said(hour: float, since: float) -> None:
    """The mean difference stood with its own change as error: a part that had been behind all the time was 30 of them off."""
    times, step = np.arange(-3600.0 * since, 3600.0, 30.0), 30.0
    around = 295.15 + 0.3 * (times - times[0]) / 3600.0
    part = np.full(times.size, around[0])
    for k in range(1, times.size):
        part[k] = part[k - 1] + (around[k - 1] - part[k - 1]) * step / (3600.0 * hour)
    seen, rng = times >= 0.0, np.random.default_rng(5)
    columns = {"plate": part[seen] + 1.2, "board": part[seen], "room": around[seen]}
    channels = {n: td.Channel.from_array(n, v + 0.01 * rng.standard_normal(v.size), unit="K") for n, v in columns.items()}
    power = td.Channel.from_array("P", np.where(times[seen] > 2400.0, 20.0, 0.0), quantity="power", unit="W")
    found = beginning_rest(td.Record.from_arrays("r", times[seen], {**channels, "P": power}), ROLES, NOISE, 0.5)
    start = found.starts["initial.plate"]
    off = float(start.start.split()[0]) - part[seen][0]
    assert abs(off) < 2.0 * start.sd
    assert 0.2 < start.sd < 0.6


@pytest.mark.parametrize(("plate", "room", "lag"), [(-10.0, 0.0, 36000.0), (-1.0, 0.5, 0.0), (0.5, 0.0, 0.0), (0.0, 1.5, 0.0)])
def test_a_part_that_cools_or_lags_far_behind_is_not_at_rest(plate: float, room: float, lag: float) -> None:
    assert not rest(plate, room, lag).shows


def test_a_part_without_readings_at_rest_is_named_and_hides_no_other() -> None:
    found = rest(0.0, 0.0, unread=True)
    assert found.shows
    assert found.silent == ("board",)
