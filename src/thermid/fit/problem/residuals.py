"""Weighted residuals of all records, with exact derivatives from the kernel; the readings that they predict."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import overload

import numpy as np
from numpy.typing import NDArray

from thermid.errors import SolverError
from thermid.fit.problem.blocks import Block as Block
from thermid.fit.problem.blocks import Compressed as Compressed
from thermid.fit.problem.experiment import Experiment, Observation
from thermid.fit.problem.statistics import Sums
from thermid.fit.problem.ticks import OFFSET, RATE, clock_at, compressed_in_full, slopes_of_clock
from thermid.fit.problem.unknowns import Target, Unknown
from thermid.fit.problem.wired import Bench
from thermid.memo import Memo
from thermid.simulation.solver.engine import Options
from thermid.simulation.solver.squares import Weighing

Array = NDArray[np.float64]
FAILED = 1e4
"""Residual that stands for a run that the integrator could not finish; the optimiser then turns back."""


@dataclass(frozen=True, eq=False)
class Problem:
    """All records of a fit, as weighted residuals over the unknowns.

    Parameters
    ----------
    experiments : tuple     The records, bound to the model.
    unknowns : tuple        What is looked for.
    noise : dict            Sensor -> standard deviation where a record states none. [K]
    options : Options       The integrator's.
    fixed_bias : dict       Sensor -> constant error that is not looked for. [K]
    coupled : tuple         (positions of unknowns, mean, inverse square root of the covariance) of joint priors, in the fitted form.
    memo : Memo             Its benches.
    """

    experiments: tuple[Experiment, ...]
    unknowns: tuple[Unknown, ...]
    noise: dict[str, float]
    options: Options
    fixed_bias: dict[str, float] = field(default_factory=dict)
    coupled: tuple[tuple[NDArray[np.int64], Array, Array], ...] = ()
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def benches(self) -> tuple[Bench, ...]:
        """Return one bench per experiment, made once."""
        return self.memo.made("benches", lambda: tuple(Bench.of(e, self._names(i)) for i, e in enumerate(self.experiments)))

    def bench(self, i: int, fitted: Array) -> Bench:
        """Return the bench of an experiment with its second clock where the unknowns put it."""
        experiment = self.experiments[i]
        if experiment.ticks is None or (at := clock_at(self, i, fitted)) == experiment.ticks.at:
            return self.benches()[i]
        return Bench.of(experiment, self._names(i), at)

    def ticking(self, i: int) -> list[tuple[int, str]]:
        """Return position and name of the unknowns that are offset or rate of an experiment's second clock."""
        return [(k, t.name) for k, u in enumerate(self.unknowns) for t in u.targets if t.experiment == i and t.name in (OFFSET, RATE)]

    def _names(self, i: int) -> tuple[str, ...]:
        return tuple(dict.fromkeys(target.name for _, target in self._acting(i)))

    def _acting(self, i: int) -> list[tuple[int, Target]]:
        """Return position and target of every unknown that acts in an experiment; several may act on one name."""
        there = [(k, target) for k, u in enumerate(self.unknowns) for target in u.targets if target.experiment == i]
        return [(k, target) for k, target in there if target.name not in (OFFSET, RATE)]

    def _bias(self, sensor: str, fitted: Array) -> tuple[float, int | None]:
        """Return the constant error of a sensor and its position among the unknowns."""
        for k, u in enumerate(self.unknowns):
            if u.kind == "sensor" and u.name == f"sensor {sensor}":
                return float(fitted[k]), k
        return self.fixed_bias.get(sensor, 0.0), None

    def inputs(self, i: int, fitted: Array) -> tuple[Array, Array]:
        """Return the values of an experiment's free names and their slopes (names, unknowns) to the fitted form."""
        place = {name: n for n, name in enumerate(self.benches()[i].free)}
        values, slopes = np.zeros(len(place)), np.zeros((len(place), len(self.unknowns)))
        for k, t in self._acting(i):
            values[place[t.name]] += t.offset + t.factor * self.unknowns[k].to_value(float(fitted[k]))
            slopes[place[t.name], k] += t.factor * self.unknowns[k].slope(float(fitted[k]))
        return values, slopes

    def blocks(self, fitted: Array) -> list[Block]:
        """Return measured and predicted readings of every sensor of every record."""
        return [block for i in range(len(self.experiments)) for block in self.blocks_of(i, fitted)]

    def blocks_of(self, i: int, fitted: Array) -> list[Block]:
        """Return measured and predicted readings of every sensor of a record."""
        out, bench = [], self.bench(i, fitted)
        x, _ = self.inputs(i, fitted)
        columns, _ = bench.temperatures(x, False, self.options)
        for k, o in enumerate(bench.experiment.observations):
            bias, _ = self._bias(o.sensor, fitted)
            predicted = columns[o.index, k] + bias
            times = bench.experiment.times[o.index]
            out.append(Block(bench.experiment.record.name, o.sensor, o.seat, times, o.measured, predicted, o.sigma(self.noise)))
        return out

    def compressed(self, fitted: Array, loss: str = "linear", knee: float = 1.0, meshes: Sequence[Array] = ()) -> Compressed:
        """Return the weighted residuals of all data with their derivatives, from one run of each record.

        Each record gives a triangle with one row per free name and constant error, and one row for what no unknown can change. With the
        `meshes` of another evaluation the steps are the same, and the difference of both is smooth.

        Raises
        ------
        SolverError   When a record cannot be run.
        """
        rows: list[Array] = []
        slopes: list[Array] = []
        sums: list[tuple[str, str, Sums]] = []
        taken: list[Array] = []
        chi = 0.0
        for i, bench in enumerate(self.benches()):
            if bench.experiment.ticks is not None:
                own, part, square, sizes = compressed_in_full(self, i, fitted, loss, knee)
                rows, slopes, chi, sums = [*rows, own], [*slopes, part], chi + square, [*sums, *sizes]
                taken.append(np.zeros(0))
                continue
            x, chain = self.inputs(i, fitted)
            seen = bench.experiment.observations
            bias, columns, shifts = self._shifts(bench, x, chain, fitted)
            sigma = np.array([o.sigma(self.noise) for o in seen])
            weighing = Weighing(sigma, bias, columns, loss, knee)
            found = bench.squares(x, bool(self.unknowns), self.options, weighing, meshes[i] if meshes else None)
            at = x.size
            part = found.triangle[:, :at] @ chain + found.triangle[:, at:] @ shifts
            rest = found.cost - float(found.rotated @ found.rotated)
            rows += [found.rotated, np.sqrt(np.maximum([rest], 0.0))]
            slopes += [part, np.zeros((1, part.shape[1]))]
            chi += found.chi_square
            taken.append(found.mesh)
            sums += [(bench.experiment.record.name, o.sensor, Sums(*line)) for o, line in zip(seen, found.sums.tolist(), strict=True)]
        return Compressed(np.concatenate(rows), np.concatenate(slopes), chi, tuple(sums), tuple(taken))

    def _shifts(self, bench: Bench, x: Array, chain: Array, fitted: Array) -> tuple[Array, NDArray[np.int32], Array]:
        """Return what is added to each sensor's temperatures [K], its column or -1, and the slopes (columns, unknowns) of the columns."""
        biases = [self._bias(o.sensor, fitted) for o in bench.experiment.observations]
        shift = np.array([b for b, _ in biases])
        slopes = np.zeros((len(biases), len(self.unknowns)))
        for k, (_, position) in enumerate(biases):
            if position is not None:
                slopes[k, position] = 1.0
        for k, place, about in bench.scales():
            shift[k] -= about * x[place]
            slopes[k] -= about * chain[place]
        used = np.flatnonzero(slopes.any(axis=1))
        columns = np.full(len(biases), -1, dtype=np.int32)
        columns[used] = np.arange(used.size)
        return shift, columns, slopes[used]

    def residuals(self, fitted: Array) -> Array:
        """Return the weighted residuals of all data in full. [-]"""
        try:
            return np.concatenate([(b.measured - b.predicted) / b.noise for b in self.blocks(fitted)])
        except SolverError:
            return np.full(self.samples, FAILED)

    @property
    def samples(self) -> int:
        """How many readings there are."""
        return sum(o.index.size for e in self.experiments for o in e.observations)

    @property
    def worth(self) -> float:
        """Independent samples that they are worth by what is said of their noise."""
        return sum(o.worth for e in self.experiments for o in e.observations)

    def square(self, found: Compressed) -> float:
        """Return the sum of the squares of the residuals in units of the noise, whatever the loss."""
        sigma = [o.sigma(self.noise) for o in self.observations()]
        return sum(s.count * s.mean_square / size**2 for (_, _, s), size in zip(found.sums, sigma, strict=True))

    def jacobian(self, fitted: Array) -> Array:
        """Return d residuals / d fitted (samples, unknowns) in full; what a fit needs of it is in `compressed`."""
        parts = []
        for i, experiment in enumerate(self.experiments):
            slopes = self.slopes(i, fitted)
            parts += [slopes[o.index, k, :] for k, o in enumerate(experiment.observations)]
        return np.concatenate(parts)

    def slopes(self, i: int, fitted: Array, times: Array | None = None) -> Array:
        """Return d weighted residuals / d fitted (times, sensors, unknowns) of an experiment, at its own times or at others [s]."""
        bench = self.bench(i, fitted)
        x, chain = self.inputs(i, fitted)
        columns, derivatives = bench.temperatures(x, bool(x.size), self.options, times)
        out = -(derivatives @ chain) if x.size else np.zeros((*columns.shape, len(self.unknowns)))
        for at, own in slopes_of_clock(self, i, fitted, times).items():
            out[:, :, at] -= own
        for k, o in enumerate(bench.experiment.observations):
            _, position = self._bias(o.sensor, fitted)
            if position is not None:
                out[:, k, position] -= 1.0
            out[:, k, :] /= o.sigma(self.noise)
        return np.asarray(out)

    def prior_rows(self, fitted: Array) -> tuple[Array, Array]:
        """Return the residuals of the priors and their derivatives."""
        values, slopes = [], []
        below = {int(k) for at, _, _ in self.coupled for k in at}
        for k, u in enumerate(self.unknowns):
            # what stages below found of an instrument holds its accuracy
            if u.prior is not None and (u.kind == "parameter" or k not in below):
                row = np.zeros(len(self.unknowns))
                row[k] = 1.0 / u.prior.sd
                values.append((float(fitted[k]) - u.prior.mean) / u.prior.sd)
                slopes.append(row)
        for at, mean, root in self.coupled:
            rows = np.zeros((root.shape[0], len(self.unknowns)))
            rows[:, at] = root
            values += list(root @ (fitted[at] - mean))
            slopes += list(rows)
        return np.array(values), np.array(slopes).reshape(len(values), len(self.unknowns))

    def observations(self) -> list[Observation]:
        """Return every observation of every experiment."""
        return [o for e in self.experiments for o in e.observations]


class Predictions(Sequence[Block]):
    """Blocks that are predicted when they are first looked at; what a fit needs of them it has in its sums.

    Parameters
    ----------
    sums : sequence of (str, str, Sums)     Record, sensor, and the sums of its residuals.
    problem : Problem                       Predicts the blocks, in the same order.
    fitted : array (unknowns,)              Where.
    """

    def __init__(self, sums: Sequence[tuple[str, str, Sums]], problem: Problem, fitted: Array) -> None:
        self.sums, self.problem, self.fitted = tuple(sums), problem, fitted
        self.memo = Memo()

    def _blocks(self) -> tuple[Block, ...]:
        return self.memo.made("blocks", lambda: tuple(self.problem.blocks(self.fitted)))

    @overload
    def __getitem__(self, at: int) -> Block: ...
    @overload
    def __getitem__(self, at: slice) -> tuple[Block, ...]: ...
    def __getitem__(self, at: int | slice) -> Block | tuple[Block, ...]:
        """Return a block, or several."""
        return self._blocks()[at]

    def __iter__(self) -> Iterator[Block]:
        """Yield the blocks."""
        return iter(self._blocks())

    def __len__(self) -> int:
        """How many there are."""
        return len(self.sums)
