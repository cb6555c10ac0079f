"""`ProcessNoise`: what drives a node, a load or a boundary beside what a model and its log say; read from what a user writes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from thermid.base.errors import IdentificationError, ThermidError, nearest, refuse_unknown
from thermid.model.tree import literal
from thermid.simulation.runs import Network

WIENER, MARKOV = "wiener", "gauss-markov"
FREE: Final = "free"
KEYS: Final = ("kind", "size", "time", "start")
UNITS: Final = {("node", WIENER): "K/s^0.5", ("load", WIENER): "W/s^0.5", ("boundary", WIENER): "K/s^0.5"} | {
    (place, MARKOV): unit for place, unit in (("node", "W"), ("load", "W"), ("boundary", "K"))
}
"""Unit of the size, by place and kind."""
GUESS: Final = {"K/s^0.5": 1e-3, "W/s^0.5": 1e-2, "W": 0.5, "K": 0.5}
"""Where the search for a size begins where nobody said. [SI]"""
HOUR: Final = 3600.0


@dataclass(frozen=True)
class ProcessNoise:
    """One noise that drives a model.

    Parameters
    ----------
    target : str        Canonical path of a node, load or boundary.
    place : str         Which of these it is.
    kind : str          ``wiener``: white noise on the rate of a node, or a random walk of what is added to a load or boundary;
                        ``gauss-markov``: a heat into a node, or what is added to a load or boundary, that forgets after `time`.
    size : float        Of a Wiener noise per root of time [K/s^0.5, W/s^0.5]; of the other its standard deviation [W, K].
    free : bool         Whether the size is looked for, from `size` on.
    time : float        Time after which it forgets; infinite for a Wiener noise. [s]
    free_time : bool    Whether that is looked for.
    """

    target: str
    place: str
    kind: str
    size: float
    free: bool
    time: float = math.inf
    free_time: bool = False

    @property
    def unit(self) -> str:
        """Of its size."""
        return UNITS[self.place, self.kind]

    @property
    def has_state(self) -> bool:
        """Whether it adds a state; a Wiener noise on a node acts on that itself."""
        return not (self.place == "node" and self.kind == WIENER)

    @property
    def state(self) -> str:
        """Name of what it adds."""
        return f"unlogged heat into {self.target}" if self.place == "node" else f"added to {self.target}"

    @property
    def walks(self) -> bool:
        """Whether it is a random walk of what is added to a boundary: its level at the start is a state too."""
        return self.place == "boundary" and self.kind == WIENER

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what is looked for: its size, its time."""
        out = [f"noise of {self.target}"] if self.free else []
        return (*out, f"noise time of {self.target}") if self.free_time else tuple(out)


def read_process(process_noise: Mapping[str, Any], network: Network, where: str) -> tuple[ProcessNoise, ...]:
    """Return the noises that a table asks for.

    Parameters
    ----------
    process_noise : dict  Node, load or boundary -> ``"free"``, a size with its unit (held), either with ``over`` and a time or ``free``
                        after it (``"0.5 [W] over 20 [min]"``: it forgets after that time), or a table with `kind` (``wiener``,
                        ``gauss-markov``), `size`, `time` (``"free"`` or a value each) and `start` (of a free size).
    network : Network   The model's.
    where : str         For messages.

    Raises
    ------
    IdentificationError   For what names nothing, a node without heat capacity, a key or kind that does not exist.
    UnitError             For a size in another unit than its kind has.
    """
    out = [_one(raw, table, network, f"{where}, process_noise.{raw}") for raw, table in process_noise.items()]
    twice = sorted({p.target for p in out if sum(q.target == p.target for q in out) > 1})
    if twice:
        raise IdentificationError(f"'{twice[0]}' has two process noises. Leave one out.", where, code="name.taken")
    return tuple(out)


def _one(raw: str, written: Any, network: Network, where: str) -> ProcessNoise:
    """Return a process noise from a text ``SIZE over TIME`` or a table, where it acts as `raw` names it."""
    first, over, after = ("", "", "") if isinstance(written, Mapping) else str(written).partition(" over ")  # a text: SIZE over TIME
    table = dict(written) if isinstance(written, Mapping) else {"size": first.strip(), "time": after.strip()} if over else {"size": written}
    refuse_unknown(table, KEYS, where, "a process noise has {known}, not {}.", IdentificationError)
    target, place = _place(raw, network, where)
    kind = str(table.get("kind", MARKOV if "time" in table else WIENER))
    refuse_unknown(
        [kind], (WIENER, MARKOV), where, f"unknown process noise '{{}}'.{{near}} Write {WIENER} or {MARKOV}.", IdentificationError
    )
    if kind == WIENER and "time" in table:
        raise IdentificationError(
            f"a {WIENER} noise has no correlation time. Leave time out, or write kind = '{MARKOV}'.", where, code="value.without-effect"
        )
    unit = UNITS[place, kind]
    free = table.get("size", FREE) == FREE
    if "start" in table and not free:
        raise IdentificationError(
            "a fixed size has no start value. Write size = 'free', or leave start out.", where, code="value.without-effect"
        )
    size = _positive(table.get("start", None) if free else table["size"], unit, GUESS[unit], f"{where}, {'start' if free else 'size'}")
    late = table.get("time", FREE)
    time = math.inf if kind == WIENER else _positive(None if late == FREE else late, "s", HOUR, f"{where}, time")
    return ProcessNoise(target, place, kind, size, free, time, kind == MARKOV and late == FREE)


def _positive(written: Any, unit: str, otherwise: float, where: str) -> float:
    """Return a number above zero in SI from what is written; `otherwise` where nothing is."""
    if written is None:
        return otherwise
    value = literal(written, unit, where)
    if not (math.isfinite(value) and value > 0):
        raise IdentificationError(
            f"{written} must be above zero and finite. For no noise leave the entry out.", where, code="value.outside-range"
        )
    return float(value)


def _place(raw: str, network: Network, where: str) -> tuple[str, str]:
    """Return canonical path and place of what a noise drives."""
    loads = {load.path: load.node for load in network.flat.loads}
    path = network.flat.names.model.canonical(raw)
    if path in loads:
        if loads[path] not in network.nodes:
            raise IdentificationError(
                f"'{raw}' heats '{loads[path]}', whose temperature is given; noise of it would change nothing.",
                where,
                code="value.without-effect",
            )
        return path, "load"
    try:
        node = network.find(raw, where)
    except ThermidError as error:
        raise IdentificationError(
            f"'{raw}' is not a node, load or boundary.{nearest(raw, [*network.nodes, *network.boundaries, *loads])}",
            where,
            code="name.unknown",
        ) from error
    if node in network.boundaries:
        return node, "boundary"
    if network.numbers().capacitances[node] is None:
        raise IdentificationError(
            f"'{raw}' has no heat capacity, so process noise cannot act on it. Give the noise to a neighbour.",
            where,
            code="model.element-not-supported",
        )
    return node, "node"
