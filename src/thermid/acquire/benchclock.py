"""Times of a bench log: the board's clock tells durations, the host's says when, and what each run of the board drifted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Final, NamedTuple

import numpy as np

from thermid.acquire.wire import Line

_TURN: Final = 1 << 32
_NEAR_TURN: Final = _TURN - (1 << 24)
_LONG_ENOUGH: Final = 600.0
_NOT_A_CLOCK: Final = 0.02
"""No quartz or resonator is off by 2 %; a simulated board, run faster than time, is."""


class Heard(NamedTuple):
    """A line of the board and when it was heard.

    Parameters
    ----------
    session : int     Which start of the logger.
    elapsed : float   Time since that start, by a clock that nobody sets. [s]
    at : int          Line of the file.
    line : Line       What the board said.
    """

    session: int
    elapsed: float
    at: int
    line: Line


class _Run(NamedTuple):
    """Lines from one reset of the board to the next: their places, host times and board times. [s]"""

    places: list[int]
    host: np.ndarray
    board: np.ndarray
    sessions: np.ndarray


def clocks(heard: Sequence[Heard], walls: Mapping[int, str]) -> tuple[list[float], list[str]]:
    """Return the time of each line from the first one [s], and what to know of the clocks.

    Within one run of the board its own clock counts, stretched by its drift against the host where ten minutes or more show it. A board
    that runs more than 2 % fast or slow is a simulated one: its own seconds count.
    """
    starts, notes = _session_starts(heard, walls)
    runs, lost = _runs(heard, starts)
    moments = [0.0] * len(heard)
    rate = 1.0  # host seconds in a board second, of the last run that showed it
    origin = end = last_host = 0.0
    drifts = []
    for k, run in enumerate(runs):
        seen = _rate(run)
        if seen is not None:
            rate = seen
            drifts.append(seen)
        simulated = abs(rate - 1.0) > _NOT_A_CLOCK
        own = (run.board - run.board[0]) * (1.0 if simulated else rate)
        # the median forgives lines that a busy host stamped late
        mine = run.sessions == run.sessions[0]
        begun = float(run.host[0] if simulated else np.median(run.host[mine] - own[mine]))
        origin = origin if k else begun
        begin = end + (float(run.host[0]) - last_host) / rate if simulated else begun - origin
        begin = max(begin, end + 1e-3) if k else 0.0
        for place, moment in zip(run.places, (own + begin).tolist(), strict=True):
            moments[place] = round(moment, 6)
        end, last_host = float(own[-1]) + begin, float(run.host[-1])
    if len(runs) > 1:
        notes.append(f"resets of the board: {len(runs) - 1}")
    if lost:
        notes.append(f"lines of the board that are missing: {lost}")
    if drifts:
        notes.append(_drift(drifts))
    return moments, notes


def _drift(drifts: Sequence[float]) -> str:
    """Return the drift of the board's clock in words."""
    rate = drifts[-1]
    if abs(rate - 1.0) > _NOT_A_CLOCK:
        return f"the board's clock runs {1.0 / rate:.3g} times as fast as the host's: a simulated board, times are its own"
    return f"the board's clock is {(rate - 1.0) * 1e6:+.0f} ppm slow against the host's; times are corrected"


def _session_starts(heard: Sequence[Heard], walls: Mapping[int, str]) -> tuple[dict[int, float], list[str]]:
    """Return when each start of the logger was, from the first [s]; one that is not known follows the one before."""
    starts: dict[int, float] = {}
    notes = []
    last: dict[int, float] = {}
    for each in heard:
        last[each.session] = max(last.get(each.session, 0.0), each.elapsed)
    end, origin = 0.0, None
    for session in sorted(last):
        wall = _seconds(walls.get(session))
        origin = wall if origin is None else origin
        start = wall - origin if wall is not None and origin is not None else None
        if start is None or start < end:
            if starts:
                why = "is not in the log" if wall is None else "lies before the end of the one before: the host's clock was set back"
                notes.append(f"the start of session {session} {why}; it follows at once")
            start = end
        starts[session] = start
        end = start + last[session]
    if len(starts) > 1:
        notes.append(f"starts of the logger: {len(starts)}")
    return starts, notes


def _seconds(wall: str | None) -> float | None:
    """Return a wall time as seconds, None where it is none."""
    try:
        return datetime.fromisoformat(wall).timestamp() if wall else None
    except (ValueError, OverflowError):
        return None


def _runs(heard: Sequence[Heard], starts: Mapping[int, float]) -> tuple[list[_Run], int]:
    """Return the runs of the board, and how many of its lines are missing."""
    groups: list[list[tuple[int, float, float, int]]] = []
    lost = 0
    number = ms = turns = 0
    for place, (session, elapsed, _, line) in enumerate(heard):
        wrapped = ms > _NEAR_TURN and line.ms < _TURN - _NEAR_TURN and line.number >= number
        again = line.number <= number or (line.ms < ms and not wrapped)
        if number > _NEAR_TURN and line.number < _TURN - _NEAR_TURN:
            again = False
        if not groups or again:
            groups.append([])
            turns = 0
            lost += line.number if len(groups) > 1 else 0
        else:
            lost += (line.number - number - 1) % _TURN
            turns += wrapped
        number, ms = line.number, line.ms
        groups[-1].append((place, starts[session] + elapsed, (ms + turns * _TURN) / 1000.0, session))
    runs = []
    for group in groups:
        places, host, board, sessions = zip(*group, strict=True)
        runs.append(_Run(list(places), np.array(host), np.array(board), np.array(sessions)))
    return runs, lost


def _rate(run: _Run) -> float | None:
    """Return host seconds in one second of the board, from the longest session of a run; None where it is too short to say."""
    best = max(set(run.sessions.tolist()), key=lambda s: int(np.count_nonzero(run.sessions == s)))
    mine = run.sessions == best
    host, board = run.host[mine], run.board[mine]
    if host.size < 20 or board[-1] - board[0] < 5.0 or host[-1] <= host[0]:
        return None
    keep = np.ones(host.size, dtype=bool)
    slope = float(host[-1] - host[0]) / float(board[-1] - board[0])
    if abs(slope - 1.0) > _NOT_A_CLOCK:
        return slope
    if board[-1] - board[0] < _LONG_ENOUGH:
        return None
    for _ in range(3):  # a stalled host stamps late, never early
        x = board[keep] - board[0]
        slope, start = np.polyfit(x, host[keep], 1)
        off = host - (start + slope * (board - board[0]))
        keep = np.abs(off - np.median(off)) <= 4.0 * max(1e-3, float(np.median(np.abs(off - np.median(off)))))
    return float(slope)
