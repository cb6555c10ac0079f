"""A log that is followed, watched as `thermid watch` does: when the test may stop, what went wrong, nodes that nobody measures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from thermid.base.errors import RecordError, ThermidError
from thermid.measure.amounts import pairs, with_unit
from thermid.measure.records import Record
from thermid.measure.steadiness import StabilityRule
from thermid.model.tree import Model
from thermid.qualify.watch import Stopping, Watcher
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
        self._watcher: Watcher | None = None
        self._at = 0.0
        self._why = ""

    def look(
        self, record: Record, rule: StabilityRule, asked: Mapping[str, Any], slowest: float | None = None, since: float | None = None
    ) -> dict[str, Any]:
        """Return what a look at a record says, as `thermid watch --json` prints it, with its words.

        Parameters
        ----------
        record : Record     The log.
        rule : StabilityRule
        asked : dict        ``boundaries``, such as ``air=22`` in degC, and ``within`` [K].
        slowest : float     Longest time constant, where no model is there. [s]
        since : float       When conditions last changed; the beginning where it is None. [s]
        """
        of = (
            record.origin.file,
            float(record.times[0]),
            tuple(record.channels),
            rule.name,
            slowest,
            asked.get("boundaries"),
            asked.get("within"),
        )
        try:
            if self._watcher is None or of != self._of or record.times[-1] < self._at:
                self._watcher, self._of = self._made(record, rule, slowest, asked), of
            self._at = float(record.times[-1])
            look = self._watcher.look(record)
        except ThermidError as error:
            self._watcher = None
            return {"advice": "declined", "because": error.message, "alarms": [], "nodes": {}, "assumed": [], "model": ""}
        model = "" if self._watcher.model is None else self._watcher.model.title
        seen = look.as_object()
        out: dict[str, Any] = clean({**seen, "model": model, "assumed": [*seen["assumed"], *([self._why] if self._why else [])]})
        return out

    def _made(self, record: Record, rule: StabilityRule, slowest: float | None, asked: Mapping[str, Any]) -> Watcher:
        """Return a watcher with the project's model where the log has its nodes and everything that it needs is known."""
        within = asked.get("within") or WITHIN
        if isinstance(within, bool) or not isinstance(within, int | float) or not within > 0.0:
            raise RecordError("'within' is a number of kelvin above zero.", "bench")
        model, self._why = self._deck(), ""
        names = tuple(record.channels)
        if model is not None:
            given = pairs(filter(str.strip, str(asked.get("boundaries") or "").split(",")), "bench")
            scenario = Scenario(record.name, boundaries={n: with_unit(t, "degC") for n, t in given.items()})
            try:
                known = set(compile_network(model).nodes)
                names = tuple(n for n in record.channels if n in known)
                missing = [b for b in compile_network(model).boundaries if b not in scenario.boundaries and b not in record.channels]
            except ThermidError as error:
                names, missing, self._why = (), [], error.message
            if names and not missing:
                return Watcher(Stopping(rule, float(within), model=model, scenario=scenario), names, model, scenario)
            if missing and names:
                self._why = f"the model is not used: the temperature of '{missing[0]}' is not known. Give it as {missing[0]}=22"
            elif not self._why:
                self._why = "the model is not used: no channel of the log has the name of one of its nodes"
        more: dict[str, Any] = {} if slowest is None else {"slowest": slowest}
        return Watcher(Stopping(rule, float(within), **more), tuple(record.channels))
