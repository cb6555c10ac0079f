"""The readings of one channel since conditions last changed, in a bounded space: the latest as they came, older ones as means."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_LATE = 900
_EARLY = 600


class History:
    """Readings of one channel; one thread may add while another looks."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.clear()

    def clear(self) -> None:
        """Forget all: conditions have changed."""
        with self._lock:
            self._late: list[tuple[float, float]] = []
            self._early = np.empty((3, 0))  # time, value and how many readings they stand for
            self._width = 0.0

    def add(self, seconds: float, value: float) -> None:
        """Take in a reading. [s, K]"""
        with self._lock:
            self._late.append((seconds, value))
            if len(self._late) < 2 * _LATE:
                return
            moved = np.array([(t, v, 1.0) for t, v in self._late[:_LATE]]).T
            del self._late[:_LATE]
            self._width = self._width or 2.0 * float(moved[0, -1] - moved[0, 0]) / _LATE
            self._early = _binned(np.hstack([self._early, moved]), self._width)
            while self._early.shape[1] > _EARLY:
                self._width *= 2.0
                self._early = _binned(self._early, self._width)

    def arrays(self) -> tuple[Array, Array]:
        """Return times and values. [s], [K]"""
        with self._lock:
            early, late = self._early, np.array(self._late).reshape(-1, 2).T
        return np.hstack([early[0], late[0]]), np.hstack([early[1], late[1]])


def _binned(points: Array, width: float) -> Array:
    """Return means over bins of a width (3, bins)."""
    starts = np.flatnonzero(np.diff(np.floor(points[0] / width), prepend=-np.inf))
    count = np.add.reduceat(points[2], starts)
    return np.vstack([np.add.reduceat(row * points[2], starts) / count for row in points[:2]] + [count])
