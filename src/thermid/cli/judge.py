"""What the channels of a growing log do, by the rule and the forecast of ``thermid settle``, worked out beside the logger."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from thermid.errors import RecordError
from thermid.measure.record.channel import Channel
from thermid.measure.record.record import Record
from thermid.measure.record.sensor import ICE
from thermid.measure.record.stability import SHORTEST, StabilityRule, channel_stability, rule_of

if TYPE_CHECKING:
    from types import TracebackType

    from thermid.acquire.logger import Logger
    from thermid.steadiness.foretold import Forecast

_SHARE = 0.1
"""Share of a processor that it takes: the logger comes first."""


@dataclass(frozen=True)
class Outlook:
    """What is known of one channel.

    Parameters
    ----------
    rate, error : float or None     Its drift and the error of that, None with too few readings. [K/s]
    verdict : str                   ``stable``, ``not stable``, ``cannot tell``, ``too early``.
    forecast : Forecast or None     Where it will end, None where readings are too few.
    """

    rate: float | None
    error: float | None
    verdict: str
    forecast: Forecast | None = None


class Judge:
    """Looks at one channel after the other, in a thread of its own so that no line waits for it.

    Parameters
    ----------
    log : Logger     A running log.
    rule : str       A rule of stability on the rate.

    Raises
    ------
    RecordError   When it is no rule on the rate.
    """

    def __init__(self, log: Logger, rule: str) -> None:
        self.rule: StabilityRule = rule_of(rule)
        if self.rule.stored:
            raise RecordError(
                f"'{self.rule.name}' is about stored heat, which readings alone do not show. Give a rule on the rate.", "--rule"
            )
        self._log = log
        self._seen: dict[str, tuple[float, Outlook]] = {}
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Judge:
        """Begin to look."""
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """End."""
        self._done.set()
        self._thread.join(5.0)

    def of(self, source: str) -> Outlook | None:
        """Return what was found of a sensor under the present conditions, None before the first look."""
        changed, found = self._seen.get(source, (-1.0, None))
        return found if changed == self._log.state.changed else None

    def _run(self) -> None:
        """Go round: every drift, which is cheap, then one forecast."""
        turn = 0
        while not self._done.is_set():
            begun, sources = time.thread_time(), list(self._log.history)
            for source in sources:
                self._look(source, source == sources[turn % len(sources)])
            turn += 1
            # by processor time: on a busy machine it must not give way twice
            self._done.wait(min(max(0.5, (time.thread_time() - begun) * (1.0 / _SHARE - 1.0)), 5.0))

    def _look(self, source: str, ahead: bool) -> None:
        """Look at a sensor; keep the forecast of the time before, unless a new one is due or conditions have changed."""
        changed, before = self._log.state.changed, self.of(source)
        found = self.look(source, ahead)
        if not ahead and before is not None:
            found = replace(found, forecast=before.forecast)
        self._seen[source] = (changed, found)

    def look(self, source: str, ahead: bool = True) -> Outlook:
        """Return what the readings of a sensor say now, with a forecast if asked."""
        from thermid.steadiness.forecast import FEWEST, forecast

        log, sensor = self._log, self._log.sensors.get(source)
        times, celsius = log.history[source].arrays()
        if times.size < 2:
            return Outlook(None, None, "too early")
        offset = sensor.certificate.offset if sensor is not None and sensor.certificate is not None else 0.0
        step = 2.0 ** (8 - log.state.bits.get(source, log.settings.bits))
        channel = Channel.of(source, celsius + ICE - offset, column=source, resolution=step)
        record = Record.from_arrays(log.store.path.name, times, {source: channel}, synthetic=False)
        try:
            found = channel_stability(record, source, self.rule)
        except RecordError:  # the rule looks further back than the readings go
            return Outlook(None, None, "too early")
        enough = ahead and times.size >= FEWEST and times[-1] - times[0] >= SHORTEST
        told = forecast(record, source, rule=self.rule) if enough else None
        return Outlook(found.rate, found.error, found.verdict, told)
