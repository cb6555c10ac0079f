"""The residuals of two logs over offset and rate of the second clock, and over what the instruments leave open."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import RecordError, SolverError
from thermid.fit.problem.blocks import Block, Compressed
from thermid.fit.problem.gather import problem_for
from thermid.fit.problem.request import LocalSpec, Request
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.ticks import SHIFT, as_triangle
from thermid.fit.problem.unknowns import Unknown
from thermid.fit.uncertainty.wander import BINS, Binned
from thermid.measure import Record
from thermid.memo import Memo
from thermid.model.laws.signal import Table
from thermid.model.tree.model import Model
from thermid.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]
KEPT = 8
"""Offsets and rates whose residuals are kept."""
CHANGES = 20
"""The largest changes of a sampled power whose instants are followed; what small ones do is small."""


@dataclass(frozen=True, eq=False)
class Clocked:
    """Two logs as least squares over the clock of the second, then over what their instruments leave open.

    At each offset and rate the logs are joined anew, so that times are exact and both may hold compared temperatures.

    Parameters
    ----------
    model, first, second, scenario, local   As in `align`.
    ranges : tuple of (low, high)           Of offset [s] and rate [-]; equal values hold one.
    noise : dict                            Sensor -> standard deviation where a record states none. [K]
    unknowns : tuple                        What is looked for: the open ones of the clock, then constant errors and local values.
    memo : Memo                             Residuals at offsets and rates.
    """

    model: Model
    first: Record
    second: Record
    scenario: Scenario | None
    local: Mapping[str, Any]
    ranges: tuple[tuple[float, float], tuple[float, float]]
    noise: dict[str, float] = field(default_factory=dict)
    unknowns: tuple[Unknown, ...] = ()
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def opened(self, at: tuple[float, float]) -> Clocked:
        """Return the same with its unknowns, the clock starting at an offset [s] and rate."""
        texts = (("clock offset", "s"), ("clock rate", "1"))
        clock = [
            Unknown(name, "local", (), value, low=low, high=high, unit=unit)
            for (name, unit), value, (low, high) in zip(texts, at, self.ranges, strict=True)
            if low < high
        ]
        return replace(self, unknowns=(*clock, *self.problem(at).unknowns))

    @property
    def ticking(self) -> list[int]:
        """Which of offset (0) and rate (1) are looked for, in the order of the unknowns."""
        return [k for k, (low, high) in enumerate(self.ranges) if low < high]

    def clock(self, fitted: Array) -> tuple[float, float]:
        """Return offset [s] and rate."""
        at = [low for low, _ in self.ranges]
        for place, k in enumerate(self.ticking):
            at[k] = float(fitted[place])
        return at[0], at[1]

    def problem(self, at: tuple[float, float], late: tuple[str, int, float] | None = None) -> Problem:
        """Return the residuals at an offset and rate; `late` moves one change of a sampled power: path, place in its table, by so much [s].

        Raises
        ------
        RecordError   When the logs do not overlap there.
        """

        def made() -> Problem:
            record = self.first.joined(self.second, *at)
            specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in self.local.items()}
            request = Request(self.model, (record,), (), {"*": self.scenario} if self.scenario else {}, specs, fit_start=False)
            plain = problem_for(request)
            return replace(plain, noise=plain.noise | self.noise, experiments=(self._switched(plain, late),))

        return self.memo.made((*at, late), made, KEPT)

    def _switched(self, problem: Problem, late: tuple[str, int, float] | None) -> Any:
        """Return the experiment with every change of a sampled power in the middle of the interval in which it happened."""
        experiment = problem.experiments[0]
        tables = {name: dict(getattr(experiment.scenario, name)) for name in ("loads", "commands")}
        for name, path, table in self._sampled(problem):
            moved, change = table.times.copy(), 1 + np.flatnonzero(np.diff(table.values))
            moved[change] -= 0.5 * (table.times[change] - table.times[change - 1])
            if late is not None and path == late[0]:
                moved[late[1]] += late[2]
            tables[name][path] = replace(table, times=moved)
        return replace(experiment, scenario=experiment.scenario.with_(**tables))

    def _sampled(self, problem: Problem) -> Iterator[tuple[str, str, Table]]:
        """Yield table of the scenario, path and signal of every power and command that was sampled, not logged when it changed."""
        experiment = problem.experiments[0]
        canonical = experiment.network.flat.names.model.canonical
        for channel in (*self.first.channels.values(), *self.second.channels.values()):
            if channel.held and not channel.prompt:
                path = canonical(channel.target or channel.name)
                for name in ("loads", "commands"):
                    signal = getattr(experiment.scenario, name).get(path)
                    if isinstance(signal, Table) and signal.held:
                        yield name, path, signal

    def changes(self, at: tuple[float, float]) -> list[tuple[float, Array]]:
        """Return, of the largest changes of sampled powers, the interval of each [s] and what its delay does to the residuals.

        The latter are derivatives of the weighted residuals (samples,). [1/s]
        """
        bare = replace(self, first=_as_prompt(self.first), second=_as_prompt(self.second)).problem(at)
        found = []
        for _, path, table in self._sampled(bare):
            found += [
                (abs(float(table.values[k] - table.values[k - 1])), path, k, float(table.times[k] - table.times[k - 1]))
                for k in (1 + np.flatnonzero(np.diff(table.values))).tolist()
            ]
        out = []
        for _, path, k, width in sorted(found, reverse=True)[:CHANGES]:
            sides = [self.weighted(self.problem(at, (path, k, side * width)), self._rest(bare)) for side in (-0.25, 0.25)]
            out.append((width, (sides[1] - sides[0]) / (0.5 * width)))
        return out

    @staticmethod
    def _rest(problem: Problem) -> Array:
        return np.array([u.to_fitted(u.start) for u in problem.unknowns])

    @staticmethod
    def weighted(problem: Problem, rest: Array) -> Array:
        """Return measured less predicted in units of the noise (samples,), sensor by sensor."""
        return np.concatenate([b.residuals / b.noise for b in problem.blocks(rest)])

    def blocks(self, fitted: Array) -> list[Block]:
        """Return measured and predicted readings of every sensor."""
        return self.problem(self.clock(fitted)).blocks(fitted[len(self.ticking) :])

    def slopes(self, fitted: Array) -> Array:
        """Return d weighted residuals / d unknowns (samples, unknowns); those of the clock by differences on either side.

        A switched power has no derivative with respect to its instant that a run could carry. A difference over less than a part of
        the second log's interval would drown in the integrator's own error.
        """
        at, size = self.clock(fitted), len(self.ticking)
        rest = fitted[size:]
        columns = []
        for k in self.ticking:
            step = SHIFT * self.second.step * (1.0 if k == 0 else 1.0 / max(float(np.abs(self.second.times).max()), self.second.step))
            # within the range where an end of it is near
            low, high = max(at[k] - step, self.ranges[k][0]), min(at[k] + step, self.ranges[k][1])
            sides = [self.weighted(self.problem((v, at[1]) if k == 0 else (at[0], v)), rest) for v in (low, high)]
            columns.append((sides[1] - sides[0]) / (high - low))
        own = self.problem(at)
        return np.column_stack([*columns, own.jacobian(rest)] if rest.size else columns)

    @property
    def samples(self) -> int:
        """How many readings there are."""
        return self.problem(self.clock(np.array([u.start for u in self.unknowns]))).samples

    def compressed(self, fitted: Array, loss: str = "linear", knee: float = 1.0, meshes: Sequence[Array] = ()) -> Compressed:
        """Return the weighted residuals with their derivatives, made into a triangle.

        Raises
        ------
        SolverError   When the model cannot be run, or the logs do not overlap.
        """
        try:
            blocks, full = self.blocks(fitted), self.slopes(fitted)
        except RecordError as error:
            raise SolverError(error.message, error.where) from None
        rows, slopes, square, sums = as_triangle(blocks, full, loss, knee)
        return Compressed(rows, slopes, square, tuple(sums), ())

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of the priors and their derivatives."""
        size = len(self.ticking)
        values, slopes = self.problem(self.clock(fitted)).prior_rows(fitted[size:])
        return values, np.column_stack([np.zeros((values.size, size)), slopes])

    def square(self, found: Compressed) -> float:
        """Return the sum of the squares of the residuals in units of the noise."""
        return found.chi_square

    def pieces(self, fitted: Array) -> dict[tuple[str, str], Binned]:
        """Return (record, sensor) -> its residuals in stretches of time, as `wander` looks at them."""
        slopes, at, out = self.slopes(fitted), 0, {}
        observations = self.problem(self.clock(fitted)).experiments[0].observations
        for block, o in zip(self.blocks(fitted), observations, strict=True):
            z, own = block.residuals / block.noise, slopes[at : at + block.times.size]
            at += z.size
            edges = block.times if z.size <= 2 * BINS else np.linspace(block.times[0], block.times[-1], BINS + 1)[:-1]
            place = np.searchsorted(edges, block.times, side="right") - 1
            count = np.bincount(place, minlength=edges.size).astype(float)
            full = count > 0

            def mean(values: Array, place: NDArray[np.int64] = place, count: Array = count) -> Array:
                return np.bincount(place, values, minlength=count.size) / np.maximum(count, 1.0)

            inside = z - mean(z)[place]
            spare = z.size - int(full.sum())
            columns = np.column_stack([mean(own[:, k]) for k in range(own.shape[1])])
            out[block.record, o.sensor] = Binned(
                mean(z)[full],
                count[full],
                mean(block.times)[full],
                columns[full],
                float(inside @ inside) / max(spare, 1),
                spare,
                float(z @ z),
                o.share,
            )
        return out


def _as_prompt(record: Record) -> Record:
    """Return a record whose changes stand where they were logged."""
    return record.with_channels(*(replace(c, prompt=True) for c in record.channels.values()))
