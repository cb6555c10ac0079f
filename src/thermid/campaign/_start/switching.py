"""When powers changed: a log has a change at its next sample, or on another clock; the temperatures say where it was.

A power of 18 W that changes half a minute before its sample gives 540 J that the log does not have, which is 0.4 K of a box of 1300 J/K.
A search of a structure would answer such a step with a mass.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.units import Indices
from thermid.fit.calibration import build_problem
from thermid.inference.criticism import CHALLENGES, EvaluationBudget, Fitted, FittedStructure, MissingElement, fitted_structure
from thermid.measure.records import FloatArray, Record

MOST_INSTANTS = 12
"""Changes of power that have an instant of their own; where there are more, all act later or earlier by one time."""
LEAST_CHANGE = 0.1
"""Change of a power, over its range, whose instant is looked for. [-]"""
MAX_SWITCHING_STEPS = 5
"""Steps of Gauss and Newton, each of an interval at most."""
PROVES_INSTANT = 4.0
"""Log-likelihood that each instant has to gain, those that do nothing gain a half. [-]"""
FARTHEST_SHIFT = 4.0
"""Most that a change may be moved, over an interval: more is a clock of its own. [-]"""


@dataclass(frozen=True, eq=False)
class Instants:
    """When the powers of a record changed.

    Parameters
    ----------
    logged : array (changes,)   Times of the samples from which on a power is another one. [s]
    shifts : array (changes,)   How much later it changed; negative for earlier. [s]
    step : float                Usual interval of the record. [s]
    """

    logged: FloatArray
    shifts: FloatArray
    step: float

    @property
    def mean(self) -> float:
        """Shift of a change whose instant is not known. [s]"""
        return float(self.shifts.mean())

    @property
    def penalty(self) -> float:
        """Half the square of how far they are from the middle of their intervals, on a clock that may be an interval off. [-]

        An instant is anywhere in the interval before its sample, step^2/12, and the offset of the clock is common, step^2.
        """
        return 0.5 * float(np.sum((self.root @ (self.shifts + 0.5 * self.step)) ** 2))

    @property
    def root(self) -> FloatArray:
        """Root of the inverse of the covariance of the shifts (changes, changes). [1/s]"""
        covariance = self.step**2 * (np.eye(self.shifts.size) / 12.0 + 1.0)
        return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))

    def laid_over(self, record: Record) -> Record:
        """Return a record whose powers and commands change at these instants; rows are added at which all else is empty."""
        driven = _driven(record)
        edges = _edges(record, driven)
        if not edges.size:
            return record
        times = record.times
        moved = np.clip(np.maximum.accumulate(times[edges] + [self._shift(t) for t in times[edges]]), times[0], times[-1])
        every = np.union1d(times, moved)
        before, place = np.searchsorted(times[edges], every, side="right"), np.searchsorted(moved, every, side="right")
        last = np.clip(np.searchsorted(times, every, side="right") - 1, 0, None)
        starts, ends = np.concatenate([[0], edges]), np.concatenate([edges, [times.size]]) - 1
        source = np.where(before == place, last, np.clip(last, starts[place], ends[place]))
        logged = np.isin(every, times)
        channels = []
        for name, c in record.channels.items():
            at, valid = (source, c.valid[source]) if name in driven else (last, c.valid[last] & logged)
            channels.append(replace(c, values=c.values[at], valid=valid, masks={}, prompt=c.prompt or name in driven))
        remark = f"powers change when temperatures say, {self.mean:+.3g} s from their samples on average"
        return replace(record, times=every, channels={c.name: c for c in channels}, steps=(*record.steps, remark))

    def _shift(self, time: float) -> float:
        """Return by how much a change lies before its sample. [s]"""
        near = np.flatnonzero(np.abs(self.logged - time) < 1e-6)
        return float(self.shifts[near[0] if self.shifts.size > 1 else 0]) if near.size else self.mean

    def stepped(self, step: FloatArray) -> Instants:
        """Return the instants after a step (changes,). [s]"""
        moved = self.shifts + np.clip(step, -self.step, self.step)
        return replace(self, shifts=np.clip(moved, -FARTHEST_SHIFT * self.step, FARTHEST_SHIFT * self.step))


def found_instants(
    begun: FittedStructure, changes: Callable[[Fitted], Sequence[MissingElement]], budget: EvaluationBudget
) -> Mapping[str, Instants]:
    """Return record -> when its powers changed, for records whose readings prove it.

    Each instant is an unknown beside those of the structure. A mass would answer a delay too, so instants have to fit the readings better
    than one mass more does, whichever fits them best.

    Parameters
    ----------
    begun : FittedStructure     The structure at the beginning.
    changes : callable          Changes of it that may be.
    budget : EvaluationBudget   What the evaluations of its fits are taken from.
    """
    records = begun.request.records
    candidates = {
        r.name: Instants(r.times[edges], np.zeros(edges.size if edges.size <= MOST_INSTANTS else 1), r.step)
        for r in records
        if (edges := _edges(r, _driven(r))).size
    }
    if not candidates:
        return {}
    rival = _with_a_mass(begun, changes, budget)
    (cost, instants, at), other = (_settled(one, candidates, budget) for one in (begun, rival))
    reduced = max(min(e.end.chi_square / max(e.problem.freedom, 1.0) for e in (at, other[2])), 1e-12)
    if other[0] < cost - PROVES_INSTANT * reduced:  # a mass beside the instants has to prove itself too: one for nothing would move them
        cost, instants, at = other
    if any(float(np.ptp(f.shifts)) > 1.1 * f.step for f in instants.values()):
        return {}  # each is in the interval before its sample, on one clock: what differs by more is no instant, but a mass
    if all(float(np.max(np.abs(f.shifts))) < 0.2 * f.step or float(np.min(f.shifts)) > 0.0 for f in instants.values()):
        return {}  # they were logged when they changed, or all before, and then their heat arrives through a mass
    return instants if rival.end.cost - cost > PROVES_INSTANT * reduced * sum(f.shifts.size for f in instants.values()) else {}


def _settled(
    one: FittedStructure, begin: Mapping[str, Instants], budget: EvaluationBudget
) -> tuple[float, Mapping[str, Instants], FittedStructure]:
    """Return the least cost of a structure with instants of its own, these, and the structure fitted with them."""
    ends, at, instants, records = [], one, begin, one.request.records
    for _ in range(MAX_SWITCHING_STEPS):
        try:
            instants = _stepped(at, records, instants)
            at = fitted_structure(one.changes, replace(one.request, records=_records_at(records, instants)), at.fitted, None, budget)
        except (ThermidError, np.linalg.LinAlgError):
            break
        ends.append((at.end.cost + sum(f.penalty for f in instants.values()), instants, at))
    return min(ends, key=lambda end: end[0], default=(np.inf, {}, one))


def with_instants(records: Sequence[Record], instants: Mapping[str, Instants]) -> list[Record]:
    """Return records whose powers change at the instants that were found; a record without its own takes the mean of all."""
    if not instants:
        return list(records)
    step = float(np.mean([f.step for f in instants.values()]))
    usual = Instants(np.zeros(0), np.array([np.mean([f.mean for f in instants.values()])]), step)
    return [instants.get(r.name, usual).laid_over(r) for r in records]


def instants_text(instants: Mapping[str, Instants]) -> str:
    """Return what was changed in logs and why; empty for nothing."""
    if not instants:
        return ""
    moves = [
        f"{t:.0f} s {by:+.0f} s"
        for f in instants.values()
        for t, by in zip(f.logged, np.broadcast_to(f.shifts, f.logged.shape), strict=True)
    ]
    shown = ", ".join(moves[:MOST_INSTANTS])
    return (
        f"Powers changed at other times than logged, by the temperatures: {shown}. The logs that init writes have these times; "
        "in the hold-out record every change is moved by their mean."
    )


def _records_at(records: Sequence[Record], instants: Mapping[str, Instants]) -> tuple[Record, ...]:
    """Return records, those with instants of their own at these."""
    return tuple(instants[r.name].laid_over(r) if r.name in instants else r for r in records)


def _driven(record: Record) -> list[str]:
    """Return the powers and commands of a record that hold from a sample to the next, and are not logged as they change."""
    return [n for n, c in record.channels.items() if c.role in ("load", "command") and c.held and not c.prompt and c.valid.any()]


def _edges(record: Record, driven: Sequence[str]) -> Indices:
    """Return the places of samples from which on a power is another one."""
    out = np.zeros(0, dtype=np.intp)
    for name in driven:
        values = np.nan_to_num(record[name].values)
        out = np.union1d(out, 1 + np.flatnonzero(np.abs(np.diff(values)) > LEAST_CHANGE * float(np.ptp(values))))
    return out.astype(np.intp)


def _with_a_mass(one: FittedStructure, changes: Callable[[Fitted], Sequence[MissingElement]], budget: EvaluationBudget) -> FittedStructure:
    """Return a structure with one mass more, that which fits the readings best; as it is where none does."""
    structures = [one]
    every = changes(Fitted.of_problem(one.request, one.problem, one.end.fitted))
    for promised in one.promises([c for c in every if c.nodes == 1], [])[:CHALLENGES]:
        try:
            structures.append(fitted_structure((promised.change,), promised.change.request, one.fitted, promised.start, budget))
        except (ThermidError, np.linalg.LinAlgError):
            continue
    return min(structures, key=lambda m: m.end.cost)


def _stepped(one: FittedStructure, records: Sequence[Record], instants_of_record: Mapping[str, Instants]) -> dict[str, Instants]:
    """Return the instants after one step of Gauss and Newton of all unknowns; `records` are as they were logged."""
    from scipy.linalg import block_diag

    at = one.end.fitted
    priors, slopes = one.problem.prior_rows(at)
    rows = _weighted(one, records, instants_of_record)
    tables = [(one.problem.slopes(i, at), e.observations) for i, e in enumerate(one.problem.experiments)]
    derivatives = np.concatenate([table[o.index, k, :] for table, observed in tables for k, o in enumerate(observed)])
    columns = []
    for name, instants in instants_of_record.items():
        by = 0.25 * instants.step
        for unit in np.eye(instants.shifts.size):
            columns.append((_weighted(one, records, {**instants_of_record, name: instants.stepped(by * unit)}) - rows) / by)
    roots = block_diag(*(f.root for f in instants_of_record.values()))
    middles = np.concatenate([f.shifts + 0.5 * f.step for f in instants_of_record.values()])
    matrix = np.block(
        [
            [derivatives, np.column_stack(columns)],
            [slopes, np.zeros((priors.size, len(columns)))],
            [np.zeros((len(columns), at.size)), roots],
        ]
    )
    residuals = np.concatenate([rows, priors, roots @ middles])
    steps = np.split(
        np.linalg.lstsq(matrix, -residuals, rcond=None)[0][at.size :], np.cumsum([f.shifts.size for f in instants_of_record.values()])[:-1]
    )
    return {name: f.stepped(step) for (name, f), step in zip(instants_of_record.items(), steps, strict=True)}


def _weighted(one: FittedStructure, records: Sequence[Record], instants: Mapping[str, Instants]) -> FloatArray:
    """Return the weighted residuals with powers that change at other instants, at the values of a fit."""
    problem = build_problem(replace(one.request, records=_records_at(records, instants)))
    return np.concatenate([b.weighted for b in problem.blocks(one.end.fitted)])
