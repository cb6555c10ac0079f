"""A model for a bare log: every measured part a mass, joined to all others and the surroundings, then what held-out readings ask for."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, ThermidError
from thermid.campaign._start.roles import SURROUNDINGS, Power, Roles, part_name, with_noise
from thermid.fit.problem import LocalSpec, Request, first_reading
from thermid.inference.criticism import (
    Fitted,
    FittedStructure,
    MissingElement,
    StructureSearch,
    changes_of,
    fitted_structure,
    search_structure,
)
from thermid.measure.records import Record
from thermid.model.deck import model_from_dict
from thermid.simulation.scenarios import Scenario

MOST_MASSES = 4
"""Masses that a proposal may have, those of measured parts included; more measured parts than that stay."""
ASSUMED = 100.0
"""Heat capacity of the first part where no power is known in watts, so that only ratios to it can be found. [J/K]"""
COMPLETE = 5
"""Most measured parts that are all joined to one another at the beginning."""
LOOSE_AMBIENT = 5.0
"""Standard deviation of an ambient that no column logs, about the lowest first reading. [K]"""
PACES = (0.03, 0.15, 0.6)
"""Time constants that a fit is begun with, in parts of the log. [-]"""
UNSAID = ("direction", "commands that act", "that settles")
"""Changes that a first project does not have: a coupling with a direction, a delay and a power that settles are left to `improve`."""
UNEXPLAINED, NOISES = 0.2, 3.0
"""Residuals above this share of the spread of the readings, and above so many noises, mean that no structure explains a log. [-]"""
MOST_PLACEMENTS = 9
"""Ways to place powers in parts that are tried."""
CONTACTS = (0.3, 10.0)
"""Conductances between parts that a fit is begun with, over those to the surroundings. [-]"""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A structure for a log.

    Parameters
    ----------
    roles : Roles               What the columns are, each power with the part that it heats.
    search : StructureSearch    Every structure that was tried.
    noise : dict                Column -> noise of one reading, as found. [K]
    assumed : str               What was assumed because the log cannot tell it; empty for nothing.
    """

    roles: Roles
    search: StructureSearch
    noise: Mapping[str, float]
    assumed: str

    @property
    def chosen(self) -> FittedStructure:
        """The proposed structure."""
        return self.search.proposed

    @property
    def unexplained(self) -> str:
        """That no structure explains the log, and what to log; empty where one does."""
        one = self.chosen
        readings = [o.measured for e in one.problem.experiments for o in e.observations]
        spread = float(np.sqrt(np.mean([np.var(values) for values in readings])))
        # the usual residual, which single readings that leap do not move
        left = 1.4826 * max(float(np.median(np.abs(b.residuals))) for b in one.problem.blocks(one.end.fitted))
        if left <= max(UNEXPLAINED * spread, NOISES * max(self.noise.values())):
            return ""
        found = f"No structure explains this log: its residuals are {100.0 * left / spread:.0f} % of the spread of the readings. "
        if not self.roles.powers:
            return f"{found}It has no power; log every power that heats a part."
        return f"{found}Log every power that heats a part and the temperature of the surroundings, and check what each column is."

    def __str__(self) -> str:
        """Return the answer first, then what was tried and what the log cannot tell."""
        one = self.chosen
        orders = self.search.orders
        hidden = one.nodes - len(self.roles.parts)
        lines = [f"{one.nodes} masses: {len(self.roles.parts)} measured, {hidden} hidden; RMSE {one.rmse:.3g} K."]
        if len(orders) > 1:
            lines.append(f"This log cannot separate structures of {orders_text(orders)} masses.")
        lines[1:1] = [self.unexplained] if self.unexplained else []
        lines += [f"Assumed: {self.assumed}"] if self.assumed else []
        return "\n".join([*lines, str(self.search)])


def orders_text(orders: Sequence[int]) -> str:
    """Return numbers of masses in words: 3, 4 and 5."""
    *first, last = (str(n) for n in sorted(orders))
    return f"{', '.join(first)} and {last}" if first else last


def base_deck(roles: Roles, capacity: float, loss: float, contact: float = 0.3) -> dict[str, Any]:
    """Return the deck of measured parts, each joined to all others and to the surroundings.

    Parameters
    ----------
    roles : Roles       With a part for every power.
    capacity : float    Heat capacity that each begins with. [J/K]
    loss : float        Conductance to the surroundings that each begins with. [W/K]
    contact : float     Conductance between two parts that each begins with, over `loss`. [-]
    """
    parts = list(roles.parts.values())
    pairs = itertools.combinations(parts, 2) if len(parts) <= COMPLETE else itertools.pairwise(parts)
    links = {f"{a}_to_{b}": {"kind": "conduction", "between": [a, b], "conductance": f"{contact * loss!r} [W/K]"} for a, b in pairs}
    losses = {f"{p}_loss": {"kind": "conduction", "between": [p, SURROUNDINGS], "conductance": f"{loss!r} [W/K]"} for p in parts}
    return {
        "title": "Proposed",
        "needs": [SURROUNDINGS],
        "nodes": {p: {"capacitance": f"{capacity!r} [J/K]"} for p in parts},
        "conductors": {**links, **losses},
        "loads": {p.load: {"into": p.node, "power": "1 [W]" if p.anchored else "0 [W]"} for p in roles.powers},
    }


def request_of(roles: Roles, records: Sequence[Record], capacity: float, loss: float, contact: float = 0.3) -> Request:
    """Return the fit of the parts alone; without a power in watts the first heat capacity is assumed and not fitted."""
    deck = base_deck(roles, capacity, loss, contact)
    free = [f"{n}.capacitance" for n in deck["nodes"]] + [f"{c}.conductance" for c in deck["conductors"]]
    if not _in_watts(roles):
        first = next(iter(deck["nodes"]))
        deck["nodes"][first]["capacitance"] = f"{ASSUMED!r} [J/K]"
        free = free[1:] + [f"{p.load}.power" for p in roles.powers]
    scenario = Scenario("log", boundaries={SURROUNDINGS: roles.surroundings} if roles.surroundings and not roles.logged else {})
    local = {}
    if not roles.surroundings:
        lowest = min((first_reading(r, c), c) for r in records for c in roles.parts if c in r.channels)
        local = {SURROUNDINGS: LocalSpec(lowest[1], LOOSE_AMBIENT)}
    return Request(model_from_dict(deck), tuple(records), tuple(free), {"*": scenario}, local, name="proposed")


def _in_watts(roles: Roles) -> bool:
    return any(not p.anchored for p in roles.powers)


def propose(roles: Roles, records: Sequence[Record], seconds: float = 60.0, noise: Mapping[str, float] | None = None) -> Proposal:
    """Propose a structure for logs.

    Parameters
    ----------
    roles : Roles           What the columns are.
    records : sequence      The logs, read with these roles.
    seconds : float         Time for the search. [s]
    noise : dict            Column -> noise where it is known; from the log elsewhere. [K]

    Raises
    ------
    IdentificationError     When nothing in the log moves: no part's temperature changes by more than its noise.
    """
    made, sizes = [], dict(noise or {})
    for record in records:
        one, found = with_noise(record, sizes)
        made.append(one)
        sizes = {**found, **sizes}
    _refuse_still(made, roles, sizes)
    roles = replace(roles, powers=tuple(_placed(p, roles, made) for p in roles.powers))
    roles, begun = _begun(roles, made)
    search = search_structure(begun.request, changes=_within(len(roles.parts)), seconds=seconds, begin=begun.fitted)
    assumed = ""
    if not _in_watts(roles):
        first = next(iter(roles.parts.values()))
        assumed = (
            f"{first}.capacitance = {ASSUMED:g} J/K, because no column gives a power in watts, so the log determines ratios to it "
            "only. Give --full-scale COLUMN='... [W]', or that heat capacity in the deck."
        )
    return Proposal(roles, search, sizes, assumed)


def _within(measured: int) -> Any:
    """Return the changes of a fitted structure that keep it within the masses of a proposal."""

    def changes(seen: Fitted) -> list[MissingElement]:
        room = max(MOST_MASSES, measured + 1) - len(seen.request.model.nodes)
        lags = [f"a lag of the sensor at '{n}'" for n in seen.request.model.nodes] + ["a lag of every sensor"]
        return [c for c in changes_of(seen) if (c.nodes <= room or c.name in lags) and not any(w in c.name for w in UNSAID)]

    return changes


def _refuse_still(records: Sequence[Record], roles: Roles, noise: Mapping[str, float]) -> None:
    for record in records:
        for column in roles.parts:
            channel = record.channels.get(column)
            if channel is not None and float(np.ptp(channel.values[channel.valid])) > 8.0 * noise[column]:
                return
    raise IdentificationError(
        "no temperature of a part changes by more than its noise, so the log does not determine any time constant. Log a test in "
        "which a power or the ambient changes.",
        records[0].name,
    )


def _placed(power: Power, roles: Roles, records: Sequence[Record]) -> Power:
    """Return a power with the part that it heats: as told, by its name, or the part that answers first to its changes."""
    parts = roles.parts
    if power.node or len(parts) == 1:
        return replace(power, node=power.node or next(iter(parts.values())))
    digits = [c for c in power.column if c.isdigit()]
    named = [n for c, n in parts.items() if (digits and [d for d in c if d.isdigit()] == digits) or n in part_name(power.column)]
    if len(named) == 1:
        return replace(power, node=named[0])
    best = max(parts, key=lambda column: _answer(power.column, column, records))
    return replace(power, node=parts[best], told=False)


def _answer(power: str, column: str, records: Sequence[Record]) -> float:
    """Return how strongly changes of a power are followed at once by the rate of a temperature. [K/s per W, in parts of its range]"""
    size = 0.0
    for r in records:
        if power not in r.channels or column not in r.channels:
            continue
        watts, kelvin = np.nan_to_num(r[power].values), r[column].values
        span = max(r.times.size // 60, 2)
        rate = (kelvin[span:] - kelvin[:-span]) / (r.times[span:] - r.times[:-span])
        moves = watts[:-span] - watts.mean()
        size += abs(float(np.dot(moves, rate - rate.mean()))) / max(float(np.dot(moves, moves)), 1e-12)
    return size


def _begun(roles: Roles, records: Sequence[Record]) -> tuple[Roles, FittedStructure]:
    """Return the parts alone, fitted from several time constants, the best end; and what each power heats there.

    A power whose part nobody told is tried in every part.
    """
    rise, span, watts = _scales(roles, records)
    best: tuple[Roles, FittedStructure] | None = None
    refusal: ThermidError | None = None
    for placed in _placements(roles):
        for pace, contact in itertools.product(PACES, CONTACTS if len(roles.parts) > 1 else CONTACTS[:1]):
            loss = watts / max(rise, 1e-3) / len(roles.parts) if _in_watts(roles) else ASSUMED / (pace * span)
            asked = request_of(placed, records, max(loss * pace * span, 1e-3), max(loss, 1e-6), contact)
            try:
                one = fitted_structure((), asked, {})
            except ThermidError as error:
                refusal = error
                continue
            if best is None or one.end.cost < best[1].end.cost:
                best = placed, one
    if best is None:
        raise refusal or IdentificationError(
            "no structure could be fitted. Check the roles of the columns with `thermid look`.", records[0].name
        )
    return best


def _placements(roles: Roles) -> list[Roles]:
    """Return the roles with each power that nobody placed in every part in turn; as it is where that would be too many."""
    parts = list(roles.parts.values())
    choices = [[p] if p.told else [replace(p, node=n) for n in parts] for p in roles.powers]
    made = list(itertools.islice(itertools.product(*choices), MOST_PLACEMENTS + 1))
    return [replace(roles, powers=powers) for powers in made] if len(made) <= MOST_PLACEMENTS else [roles]


def _scales(roles: Roles, records: Sequence[Record]) -> tuple[float, float, float]:
    """Return a typical rise [K], the length of the longest log [s], and the mean power [W]."""
    rise = max(float(np.ptp(r[c].values[r[c].valid])) for r in records for c in roles.parts if c in r.channels)
    span = max(r.duration for r in records)
    powers = [np.nanmean(np.abs(r[p.column].values)) for r in records for p in roles.powers if p.column in r.channels]
    return rise, span, max(float(np.sum(powers)) / max(len(records), 1), 1e-3)
