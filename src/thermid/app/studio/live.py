"""A log that is followed, watched as `thermid watch` does: when the test may stop, what went wrong, nodes that nobody measures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from thermid.base.errors import RecordError, ThermidError
from thermid.measure.amounts import pairs, with_unit
from thermid.measure.steadiness import StabilityRule
from thermid.model.tree import Model
from thermid.qualify.watch import BoundColumns, Watcher, WatchRequest
from thermid.reporting.objects import clean
from thermid.simulation.network import compile_network
from thermid.simulation.scenarios import Scenario

WITHIN = 1.0
"""Half of the interval of where a channel ends, at most, where the page asks for none. [K]"""


class LiveWatch:
    """The watcher of the log that is looked at, kept from look to look.

    Parameters
    ----------
    deck : callable     Returns the model of the project; None where it has no single one.
    """

    def __init__(self, deck: Callable[[], Model | None]) -> None:
        self._deck = deck
        self._of: tuple[Any, ...] | None = None
        self._request: WatchRequest
        self._watcher: Watcher | None = None
        self._begin = self._end = 0.0
        self._why = ""

    def look(
        self, path: Path, rule: StabilityRule, asked: Mapping[str, Any], slowest: float | None = None, since: float | None = None
    ) -> dict[str, Any]:
        """Return what a look at a log says, as `thermid watch --json` prints it, with its words.

        Parameters
        ----------
        path : Path         The log.
        rule : StabilityRule
        asked : dict        ``boundaries``, such as ``air=22`` in degC, and ``within`` [K].
        slowest : float     Longest time constant, where no model is there. [s]
        since : float       When conditions last changed; the beginning where it is None. [s]
        """
        of = (path, rule.name, slowest, since, asked.get("boundaries"), asked.get("within"))
        try:
            if self._watcher is None or of != self._of:
                self._request, self._watcher, self._of = self._made(path, rule, slowest, since, asked), None, of
            record = self._request.read(path)
            begin, end = float(record.times[0]), float(record.times[-1])
            if self._watcher is None or begin != self._begin or end < self._end:
                self._watcher = self._request.watcher(record)
            self._begin, self._end = begin, end
            look = self._watcher.look(record)
        except ThermidError as error:
            self._watcher = None
            return {"advice": "declined", "because": error.message, "alarms": [], "nodes": {}, "assumed": [], "model": ""}
        model = "" if self._watcher.model is None else self._watcher.model.title
        seen = look.as_object()
        out: dict[str, Any] = clean({**seen, "model": model, "assumed": [*seen["assumed"], *([self._why] if self._why else [])]})
        return out

    def _made(self, path: Path, rule: StabilityRule, slowest: float | None, since: float | None, asked: Mapping[str, Any]) -> WatchRequest:
        """Return a request with the project's model where the log has its nodes and everything that it needs is known."""
        within = asked.get("within") or WITHIN
        if isinstance(within, bool) or not isinstance(within, int | float) or not within > 0.0:
            raise RecordError("'within' is a number of kelvin above zero.", "bench")
        model, self._why = self._deck(), ""
        begun: str | float = "start" if since is None else since
        bare = WatchRequest(BoundColumns(), rule, float(within), slowest=slowest, since=begun)
        if model is None:
            return bare
        given = pairs(filter(str.strip, str(asked.get("boundaries") or "").split(",")), "bench")
        scenario = Scenario(path.stem, boundaries={n: with_unit(t, "degC") for n, t in given.items()}) if given else None
        made = replace(bare, columns=BoundColumns(model=model), scenario=scenario, slowest=None)
        try:
            logged = {c.target or c.name for c in made.read(path).channels.values()}
            missing = [b for b in compile_network(model).boundaries if b not in given and b not in logged]
        except ThermidError as error:
            self._why = f"the model is not used: {error.message}"
            return bare
        if missing:
            self._why = f"the model is not used: the temperature of '{missing[0]}' is not known. Give it as {missing[0]}=22"
            return bare
        return made
