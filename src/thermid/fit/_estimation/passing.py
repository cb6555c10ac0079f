"""A filter passed over a record: at several sets of values at once, with what is needed to smooth and to foresee."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from thermid.base.errors import SolverError
from thermid.base.units import Array
from thermid.fit._estimation.dynamics import JUMP_SHARE_OF_STEP, MAX_CURVATURE_ERROR, At, Dynamics
from thermid.fit._estimation.filtering import Belief, FilterStep, Gain, Innovations, ReadingRow, measurement_update, time_update
from thermid.fit._estimation.steps import responses, step

HALVINGS: Final = 12
"""How often a step may be halved."""


@dataclass(frozen=True, eq=False)
class Pass:
    """What a filter found in a record.

    Parameters
    ----------
    innovations : Innovations   Of all readings up to the end of the pass.
    times : array (grid,)       Of the beliefs. [s]
    beliefs : tuple of Belief   After the readings of every time; empty unless kept.
    legs : tuple of FilterStep         From each of these to the next; empty unless kept.
    last : Belief               At the end.
    """

    innovations: Innovations
    times: Array
    last: Belief
    beliefs: tuple[Belief, ...] = field(default=(), repr=False)
    legs: tuple[tuple[FilterStep, ...], ...] = field(default=(), repr=False)


class Passing:
    """Dynamics of several members, ready to pass over their record.

    Parameters
    ----------
    dynamics : Dynamics     The record's.
    members : sequence      The values of every member.
    """

    def __init__(self, dynamics: Dynamics, members: Sequence[At]) -> None:
        """Begin the passing of a filter with several members of values."""
        self.dynamics, self.members = dynamics, tuple(members)
        self.noise = np.stack([dynamics.noise(m) for m in self.members])
        if dynamics.linear:
            self._precompute_linear()

    def start(self) -> Belief:
        """Return the belief before the first reading."""
        starts = [self.dynamics.start(m) for m in self.members]
        return Belief(np.stack([m for m, _ in starts]), np.stack([np.diag(sd) for _, sd in starts]))

    # one Jacobian for all states and times

    def _precompute_linear(self) -> None:
        """Compute once what a linear network needs at every step: its Jacobian, rows of readings, and steps about the mean start.

        Over a step from t to t + h inputs are linear (first-order hold): ``x+ = x0 + F (x - x0) + P1 f(t) + P2 (f(t + h) - f(t))``, with
        the rates f at the start's mean x0, and F, P1, P2 as in `responses`. The end is taken just before t + h, where inputs may jump.
        """
        d = self.dynamics
        self.about = np.stack([d.start(m)[0] for m in self.members])
        local = [d.local(m, about, 0.0) for m, about in zip(self.members, self.about, strict=True)]
        self.jacobian = np.stack([one.jacobian for one in local])
        sensors = range(len(d.experiment.observations))
        read = [d.readings(m, one, about, 0.0, sensors) for m, one, about in zip(self.members, local, self.about, strict=True)]
        self.rows = np.stack([rows for _, rows in read])
        self.read = np.stack([values for values, _ in read])
        direct = all(d.nodes.index(o.node) in d.massive for o in d.experiment.observations if o.node in d.nodes)
        self.still = direct and all(o.node in d.nodes for o in d.experiment.observations)
        lengths = np.diff(d.grid)
        begins, ends = d.grid[:-1], d.grid[1:] - JUMP_SHARE_OF_STEP * lengths
        both = [d.course(m, about, np.concatenate([begins, ends])) for m, about in zip(self.members, self.about, strict=True)]
        first, last = np.split(np.stack(both), 2, axis=1)
        self._steps = {key: step(self.jacobian, self.noise, float(key)) for key in dict.fromkeys(d.lengths)}
        self._forced = np.tile(self.about[:, None, :], (1, lengths.size, 1))
        names = np.array(d.lengths)
        for key, s in self._steps.items():
            at = names == key
            self._forced[:, at] += along(s.start, first[:, at]) + along(s.slope, (last - first)[:, at])

    # linearised anew at every step

    def _bent_step(self, belief: Belief, begin: float, end: float, halvings: int = 0) -> tuple[Belief, list[FilterStep]]:
        """Return the belief at `end` [s] from that at `begin` [s], temperatures [K], and the legs between, in halves where rates bend.

        Exponential step by the Jacobian [1/s] at the beginning, rates [K/s] straight in time; what the rates at its end miss by, over a
        third of the step, may be `MAX_CURVATURE_ERROR` [K], two thirds of it are added.

        Raises
        ------
        SolverError   When `HALVINGS` halvings are not enough.
        """
        d, seconds = self.dynamics, end - begin
        late = end - JUMP_SHARE_OF_STEP * seconds
        rates, jacobian = d.rates(self.members, belief.mean, begin)
        rise = d.rates(self.members, belief.mean, late)[0] - rates
        _, start, slope = responses(jacobian, seconds)
        change = np.einsum("mij,mj->mi", start, rates) + np.einsum("mij,mj->mi", slope, rise)
        mean = belief.mean + change
        foreseen = rates + rise + np.einsum("mij,mj->mi", jacobian, change)
        rates_after, _ = d.rates(self.members, mean, late)
        missed = float(np.abs((rates_after - foreseen)[:, : d.massive.size]).max()) * seconds / 3.0
        if not np.isfinite(missed) or (missed > MAX_CURVATURE_ERROR and halvings < HALVINGS):
            if halvings >= HALVINGS:
                raise SolverError(
                    f"the filter diverged at {begin:.6g} s. Look for a noise that is far too large.",
                    d.engine.title,
                    code="run.did-not-finish",
                )
            middle = 0.5 * (begin + end)
            half, legs = self._bent_step(belief, begin, middle, halvings + 1)
            whole, more = self._bent_step(half, middle, end, halvings + 1)
            return whole, [*legs, *more]
        # the rates bend quadratically; two thirds of what was missed stands in the mean
        mean = mean + np.einsum("mij,mj->mi", slope, rates_after - foreseen) * (2.0 / 3.0)
        root = step(0.5 * (jacobian + d.rates(self.members, mean, late)[1]), self.noise, seconds)
        return time_update(belief, root.transition, mean, root.noise), [FilterStep(root.transition, root.noise, belief, mean)]

    def ahead(self, belief: Belief, place: int) -> tuple[Belief, tuple[FilterStep, ...]]:
        """Return the belief at the next time of the grid after `place`, no reading in between, and the legs to it.

        Of a linear network x+ = F (x - a) + f, with the transition F over the step, the states a (members, states) about which it was made
        linear, and f what inputs bring from there, exact for inputs that are straight in time; else `_bent_step`. [K]
        """
        if self.dynamics.linear:
            s = self._steps[self.dynamics.lengths[place]]
            mean = np.asarray(np.einsum("mij,mj->mi", s.transition, belief.mean - self.about) + self._forced[:, place])
            out, leg = time_update(belief, s.transition, mean, s.noise), FilterStep(s.transition, s.noise, belief, mean)
            return out, (leg,)
        later, legs = self._bent_step(belief, float(self.dynamics.grid[place]), float(self.dynamics.grid[place + 1]))
        return later, tuple(legs)

    def readings(self, belief: Belief, place: int, time: float) -> list[ReadingRow]:
        """Return the readings due at number `place` of the grid, at `time` [s], ready to update with: y = H x + v.

        The known part h(x_0) - H x_0 of the reading that the model expects at the belief's mean x_0 is taken off each. [K]
        """
        due = self.dynamics.due[place]
        if not due:
            return []
        d, sensors = self.dynamics, [k for k, _ in due]
        read, rows, about = self._foreseen(belief, time, sensors)
        out = []
        for n, (k, m) in enumerate(due):
            measured = float(d.experiment.observations[k].measured[m])
            constant = read[:, n] - np.einsum("mi,mi->m", rows[:, n], about)
            sigma = np.array([at.sigma[k] for at in self.members])
            out.append(ReadingRow(k, measured - constant, rows[:, n], sigma))
        return out

    def _foreseen(self, belief: Belief, time: float, sensors: Sequence[int]) -> tuple[Array, Array, Array]:
        """Return readings (members, sensors) [K] at a state (members, states), their rows (members, sensors, states), and that state.

        The state is the belief's mean at `time` [s]; of a linear model any state does, and a kept one is taken.
        """
        d = self.dynamics
        if d.linear and self.still:
            return self.read[:, sensors], self.rows[:, sensors], self.about
        about = self.about if d.linear else belief.mean
        parts = []
        for m, state in zip(self.members, about, strict=True):
            parts.append(d.readings(m, d.local(m, state, time), state, time, sensors))
        return np.stack([p for p, _ in parts]), np.stack([r for _, r in parts]), about

    def run(self, keep: bool = False, until: float = float("inf"), begin: tuple[int, Belief] | None = None) -> Pass:
        """Return what the filter finds.

        Parameters
        ----------
        keep : bool             Whether all beliefs are held.
        until : float           Readings after it are not taken, time goes to the end. [s]
        begin : (int, Belief)   Position in the grid and the belief there after its readings; the start of the log where none is given.
        """
        d = self.dynamics
        first, belief = begin or (-1, self.start())
        out = _Sheet()
        settled: dict[tuple[str, tuple[int, ...]], _Settled] = {}
        ready = d.linear and self.still and not keep
        place = first + 1
        if begin is not None and keep:
            out.beliefs.append(belief)
        while place < d.grid.size:
            time = float(d.grid[place])
            taken = time <= until
            settled_step = settled.get(d.step_to(place)) if ready and place and taken else None
            if settled_step is not None and settled_step.holds(belief.root):
                end = min(d.alike[place], int(np.searchsorted(d.grid, until, side="right")))
                belief = Belief(self._stretch(belief.mean, place, end, settled_step, out), settled_step.after)
                place = end
                continue
            before, gains = belief.root, []
            if place:
                belief, way = self.ahead(belief, place - 1)
                if keep:
                    out.legs.append(way)
            for reading in self.readings(belief, place, time) if taken else ():
                belief, error, did = measurement_update(belief, reading)
                gains.append(did)
                out.take(reading.sensor, time, error, did.variance)
            if ready and place:
                settled[d.step_to(place)] = _Settled(before, belief.root, tuple(gains))
            if keep:
                out.beliefs.append(belief)
            place += 1
        return Pass(out.innovations(len(self.members)), d.grid[max(first, 0) :], belief, tuple(out.beliefs), tuple(out.legs))

    def _stretch(self, mean: Array, begin: int, end: int, settled_step: _Settled, out: _Sheet) -> Array:
        """Return the mean (members, states) after steps to times `begin` to before `end`, all alike and their gains settled.

        The recursion ``x_k = M x_(k-1) + c_k`` is then one product with a block of powers of M for every `STEPS_PER_BLOCK` steps.
        """
        d, n = self.dynamics, mean.shape[1]
        length, sensors = d.step_to(begin)
        measured = np.array([[d.experiment.observations[k].measured[m] for k, m in d.due[p]] for p in range(begin, end)])
        rows = self.rows[:, sensors] if sensors else np.zeros((len(self.members), 0, n))
        constant = self.read[:, sensors] - np.einsum("mki,mi->mk", rows, self.about) if sensors else np.zeros((len(self.members), 0))
        values = measured.reshape(end - begin, len(sensors))[None] - constant[:, None]
        keep, into = np.tile(np.eye(n), (len(self.members), 1, 1)), np.zeros((len(self.members), n, 0))
        for k, did in enumerate(settled_step.gains):
            take = np.eye(n) - did.gain[:, :, None] * rows[:, k, None, :]
            keep, into = take @ keep, np.concatenate([take @ into, did.gain[:, :, None]], axis=2)
        move = self._steps[length].transition
        forced = self._forced[:, begin - 1 : end - 1] - np.einsum("mij,mj->mi", move, self.about)[:, None]
        forcing = along(keep, forced) + along(into, values)
        means = recursion(keep @ move, forcing, mean)
        foreseen = along(move, np.concatenate([mean[:, None], means[:, :-1]], axis=1)) + forced
        for k, did in enumerate(settled_step.gains):
            errors = values[:, :, k] - (foreseen @ rows[:, k, :, None])[:, :, 0]
            foreseen = foreseen + did.gain[:, None] * errors[:, :, None]
            out.stretch(sensors[k], d.grid[begin:end], errors.T, did.variance)
        return np.asarray(means[:, -1])


STEPS_PER_BLOCK: Final = 32


def along(matrices: Array, vectors: Array) -> Array:
    """Return matrices (members, i, j) times vectors (members, steps, j)."""
    return np.asarray(vectors @ np.swapaxes(matrices, 1, 2))


def recursion(move: Array, forcing: Array, start: Array) -> Array:
    """Return x_k = M x_(k-1) + c_k (members, steps, n) of M (members, n, n) [-], c (members, steps, n) and x before the first (members, n).

    In blocks of `STEPS_PER_BLOCK` steps, each one product with powers of M. x and c have one unit, such as K.
    """
    members, steps, n = forcing.shape
    powers = [np.tile(np.eye(n), (members, 1, 1))]
    for _ in range(min(STEPS_PER_BLOCK, steps)):
        powers.append(powers[-1] @ move)
    size = len(powers) - 1
    triangle = np.zeros((members, size * n, size * n))
    for row in range(size):
        for column in range(row + 1):
            triangle[:, row * n : (row + 1) * n, column * n : (column + 1) * n] = powers[row - column]
    first = np.concatenate(powers[1:], axis=1)
    out = np.empty_like(forcing)
    for begin in range(0, steps, size):
        end = min(begin + size, steps)
        rows = (end - begin) * n
        part = triangle[:, :rows, :rows] @ forcing[:, begin:end].reshape(members, rows, 1) + first[:, :rows] @ start[:, :, None]
        out[:, begin:end] = part.reshape(members, end - begin, n)
        start = out[:, end - 1]
    return out


MAX_ROOT_DIFFERENCE: Final = 1e-12
"""Part of the largest entry by which roots may differ to count as settled."""


@dataclass(frozen=True, eq=False)
class _Settled:
    """What one step and its readings made of a root of the covariance; the same again wherever that root comes back."""

    before: Array
    after: Array
    gains: tuple[Gain, ...]

    def holds(self, root: Array) -> bool:
        """Whether a root is the one that it was taken from, to rounding."""
        return bool((np.abs(root - self.before) <= MAX_ROOT_DIFFERENCE * np.abs(root).max(axis=(1, 2), keepdims=True)).all())


@dataclass(eq=False)
class _Sheet:
    """Innovations and beliefs as they come."""

    sensors: list[int] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    errors: list[Array] = field(default_factory=list)
    variances: list[Array] = field(default_factory=list)
    beliefs: list[Belief] = field(default_factory=list)
    legs: list[tuple[FilterStep, ...]] = field(default_factory=list)

    def take(self, sensor: int, time: float, error: Array, variance: Array) -> None:
        """Take down an innovation."""
        self.sensors.append(sensor)
        self.times.append(time)
        self.errors.append(error)
        self.variances.append(variance)

    def stretch(self, sensor: int, times: Array, errors: Array, variance: Array) -> None:
        """Take down innovations (steps, members) of one sensor, all of one variance (members,)."""
        self.sensors += [sensor] * times.size
        self.times += times.tolist()
        self.errors += list(errors)
        self.variances += [variance] * times.size

    def innovations(self, members: int) -> Innovations:
        """Return the errors [K] and variances [K^2] of all readings (readings, members), in the order of time [s]."""
        shape = (len(self.errors), members)
        order = np.argsort(np.array(self.times), kind="stable")
        errors, variances = np.array(self.errors).reshape(shape), np.array(self.variances).reshape(shape)
        return Innovations(np.array(self.sensors)[order], np.array(self.times)[order], errors[order], variances[order])
