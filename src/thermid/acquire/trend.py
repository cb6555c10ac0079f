"""The rate of a channel as it grows, whether it has settled, and when it will."""

from __future__ import annotations

from collections import deque
from math import exp, inf, log

import numpy as np

__all__ = ["Trend"]

_POINTS = 240


class Trend:
    """The last stretch of one channel, thinned so that it stays small.

    Parameters
    ----------
    window : float   Stretch over which the rate is taken. [s]
    limit : float    Rate below which a channel counts as settled. [K/s]
    """

    def __init__(self, window: float = 600.0, limit: float = 1.0 / 3600.0) -> None:
        self.window, self.limit = window, limit
        self._points: deque[tuple[float, float]] = deque()
        self._mean = (0.0, 0.0, 0)

    def add(self, seconds: float, value: float) -> None:
        """Take in a sample; those that lie closer than a 240th of the window are averaged. [s, K]"""
        time, total, count = self._mean
        if count and seconds - time >= self.window / _POINTS:
            self._points.append((time, total / count))
            count, total = 0, 0.0
        self._mean = (time if count else seconds, total + value, count + 1)
        while self._points and seconds - self._points[0][0] > self.window:
            self._points.popleft()

    def _line(self, part: slice) -> tuple[float, float, float]:
        """Return the rate of a part, its standard error and the time of its middle [K/s, K/s, s]."""
        times, values = np.array(list(self._points)[part]).T
        x = times - times.mean()
        rate = float(x @ values / (x @ x))
        off = values - values.mean() - rate * x
        return rate, float(np.sqrt(off @ off / max(1, x.size - 2) / (x @ x))), float(times.mean())

    @property
    def rate(self) -> float | None:
        """Rate over the window, None before a quarter of it is filled. [K/s]"""
        if len(self._points) < 8 or self._points[-1][0] - self._points[0][0] < 0.25 * self.window:
            return None
        return self._line(slice(None))[0]

    @property
    def settled(self) -> bool:
        """Whether the whole window is filled and the rate lies below the limit."""
        rate = self.rate
        return rate is not None and abs(rate) < self.limit and self._points[-1][0] - self._points[0][0] > 0.9 * self.window

    def forecast(self) -> tuple[float, float] | None:
        """Return the value at which it will end and the seconds until its rate falls below the limit, where it decays like one body.

        A rate that falls by exp(-t/tau) leaves ``rate tau`` still to come. None where the rate does not fall, or noise hides it.
        """
        if self.rate is None or self.settled:
            return None
        half = len(self._points) // 2
        old, old_error, old_time = self._line(slice(0, half))
        new, new_error, new_time = self._line(slice(half, None))
        if old * new <= 0 or abs(old) - abs(new) < 3.0 * (old_error + new_error) or abs(new) < 3.0 * new_error:
            return None
        tau = (new_time - old_time) / log(old / new)
        time, value = self._points[-1]
        now = new * exp(-(time - new_time) / tau)
        wait = tau * log(abs(now) / self.limit) if abs(now) > self.limit else 0.0
        return (value + now * tau, wait) if wait < inf else None
