"""`Ensemble`: what many runs of one model say together, and how they are run: numbers of all members at once, traces kept or quantiles.

Arithmetic and checks of the model's code run as they are, on a number that holds one value per member. Where a check holds for some
members and not for others, the members are taken apart and each share is computed by itself, so every member goes the way that it would
have gone alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from operator import itemgetter
from time import process_time
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from thermid.base.errors import ScenarioError, SolverError, ThermidError, refuse_unknown
from thermid.base.results import PlottedTrace, Result
from thermid.base.units import ICE_POINT, Array, Bools, Dual, Indices, kelvin, real_power
from thermid.model.tree import UNJUDGED, Constant, Model, Standing
from thermid.simulation._duty import on_shares
from thermid.simulation._many.kept import JobFolder, digest
from thermid.simulation._many.tally import PILOT, Counted, CountGrid, Tally, added
from thermid.simulation._many.tasks import KeptTasks, Workers, in_tasks
from thermid.simulation._solution import Trace
from thermid.simulation._solver.engine import Engine
from thermid.simulation._solver.extremes import MemberTurnings
from thermid.simulation._solver.problem import Options, nodes_to_store, signal_turnings
from thermid.simulation._solver.wiring import Assembled, Wiring


@dataclass(frozen=True, eq=False)
class Ensemble(Result):
    """The runs of many members.

    Statistics are over the members that reached the end; `failed` says of the others why.

    Parameters
    ----------
    title : str             The model's.
    scenario : str          The scenario's title.
    times : array (times,)  [s]
    nodes : tuple of str    Nodes and boundaries that were kept.
    members : int           How many members there are, failed ones among them.
    draws : dict            Name -> value of every member (members,). [SI]
    failed : dict           Member -> why it did not reach the end.
    statistics : dict       Steps (of a group of members, or of one), rejected steps, members run one by one, instruction set.
    duty_cycles : dict      Thermostat -> time on over time (members, 2), of the run and of its last complete cycle, NaN where there is
                            none; empty where members were counted. [-]
    warnings : tuple        What a reader must know.
    standing : Standing     Of the values that it rests on: those of the model, and those that were drawn.
    """

    title: str
    scenario: str
    times: Array
    nodes: tuple[str, ...]
    members: int
    draws: Mapping[str, Array]
    failed: Mapping[int, str]
    statistics: Mapping[str, Any]
    _find: Callable[[str], str] = field(repr=False)
    _traces: Callable[[str], Array] = field(repr=False)
    _counts: Mapping[str, Tally] = field(repr=False)
    _turnings: Mapping[str, MemberTurnings] = field(repr=False)
    duty_cycles: Mapping[str, Array] = field(default_factory=dict, repr=False)
    warnings: tuple[str, ...] = ()
    standing: Standing = UNJUDGED

    def temperatures(self, node: str) -> Array:
        """Return the temperature (times, members) of a node in every member, NaN where a member failed. [K]

        Raises
        ------
        NameNotFoundError   With the nearest name.
        ScenarioError       When the node was not kept, or members were counted.
        """
        self._refuse_counted(node)
        return self._traces(self._stored_node(node))

    def _refuse_counted(self, node: str) -> None:
        """Refuse a node that was not stored, and any node where members were counted and their traces dropped."""
        self._stored_node(node)
        if self._counts:
            text = "members were counted, so what each did is not known. Leave 'quantiles' out to keep every trace, or ask for a quantile."
            raise ScenarioError(text, self.title, code="value.outside-range")

    def trace(self, member: int, node: str) -> Trace:
        """Return the temperature of a node over time in one member, counted from 0; refuse a member that there is not."""
        if not 0 <= member < self.members:
            raise ScenarioError(
                f"member {member} does not exist. Members are numbered from 0 to {self.members - 1}.",
                self.title,
                code="value.outside-range",
            )
        turnings = self.turnings(node)
        of_member = turnings.of_member(member) if turnings is not None else None
        return Trace(self._stored_node(node), self.times, self.temperatures(node)[:, member], of_member)

    def turnings(self, node: str) -> MemberTurnings | None:
        """Return the turning points of a node between samples in every member; None where members were not followed.

        That is so with ``Options(extremes=False)``, where members were counted, and for a massless node that was eliminated, as it is
        unless `nodes` names it: its weights differ from member to member.
        """
        return self._turnings.get(self._stored_node(node))

    def quantile(self, node: str, share: Any) -> Array:
        """Return the temperature below which a share of the members lies, (times,) or (shares, times). [K]

        Where members were counted it is read off counts and may be wrong by `quantile_error`.

        Raises
        ------
        ScenarioError   When a share does not lie between 0 and 1.
        """
        return self._shared(node, share)[0][..., :-2] if self._counts else self._of_whole(node, share)

    def quantile_error(self, node: str, share: Any) -> Array:
        """Return by how much a quantile may be wrong because members were counted in bins: half a bin; zero where traces were kept. [K]"""
        return self._shared(node, share)[1][..., :-2] if self._counts else np.zeros_like(self._of_whole(node, share))

    def highest_quantile(self, node: str, share: Any) -> Array:
        """Return the highest temperature of the run, between samples too, below which that of a share of the members lies. [degC]"""
        return self._of_extremes(node, share, -2)

    def lowest_quantile(self, node: str, share: Any) -> Array:
        """Return the lowest temperature of the run, between samples too, below which that of a share of the members lies. [degC]"""
        return self._of_extremes(node, share, -1)

    def _of_extremes(self, node: str, share: Any, column: int) -> Array:
        """Return quantiles of the highest (column -2) or lowest (-1) temperature of members. [degC]"""
        if self._counts:
            return np.asarray(self._shared(node, share)[0][..., column] - ICE_POINT)
        return np.asarray(np.nanquantile(self.highest(node) if column == -2 else self.lowest(node), shares_of(share, self.title)))

    def _shared(self, node: str, share: Any) -> tuple[Array, Array]:
        """Return quantiles (..., times + 2) of a node that was counted, and by how much each may be wrong. [K]"""
        return self._counts[self._stored_node(node)].read(shares_of(share, self.title))

    def _of_whole(self, node: str, share: Any) -> Array:
        """Return quantiles (..., times) of a node whose traces were kept. [K]"""
        return np.asarray(np.quantile(self._whole(self._stored_node(node)), shares_of(share, self.title), axis=1))

    def mean(self, node: str) -> Array:
        """Return the mean temperature (times,) over the members. [K]"""
        path = self._stored_node(node)
        return self._counts[path].mean[:-2] if self._counts else self._whole(path).mean(axis=1)

    def sd(self, node: str) -> Array:
        """Return the standard deviation (times,) of the temperature over the members. [K]"""
        path = self._stored_node(node)
        return self._counts[path].sd[:-2] if self._counts else spread_of(self._whole(path))

    def highest(self, node: str) -> Array:
        """Return the highest temperature (members,) of each member, NaN where it failed. [degC]

        Between samples too; of the samples alone where `turnings` is None.
        """
        return self._extremes(node, 1.0)

    def lowest(self, node: str) -> Array:
        """Return the lowest temperature (members,) of each member, NaN where it failed; as `highest`. [degC]"""
        return self._extremes(node, -1.0)

    def _extremes(self, node: str, sign: float) -> Array:
        """Return the highest (sign 1) or lowest (-1) temperature (members,) of each member. [degC]"""
        self._refuse_counted(node)
        turnings = self.turnings(node) or MemberTurnings.joined([])
        return turnings.furthest(self._traces(self._stored_node(node)).T, sign) - ICE_POINT

    def exceedance(self, node: str, limit: Any) -> Array:
        """Return the share (times,) of the members in which a node is above a limit, such as ``"50 [degC]"``. [-]

        Members that are above it at any time: ``(ensemble.highest(node) > 50.0).mean()``.
        """
        self._refuse_counted(node)
        return np.asarray((self._whole(self._stored_node(node)) > kelvin(limit)).mean(axis=1))

    def _whole(self, path: str) -> Array:
        """Return the temperatures (times, members that reached the end). [K]"""
        traces = self._traces(path)
        return np.delete(traces, list(self.failed), axis=1) if self.failed else traces

    def _stored_node(self, node: str) -> str:
        """Return the canonical path of a node; refuse one that was not stored, and any where no member reached the end."""
        path = self._find(node)
        refuse_unknown([path], self.nodes, self.title, f"'{node}' was not stored. Name it in 'nodes'. Stored: {{known}}.", ScenarioError)
        if len(self.failed) == self.members:
            raise ScenarioError(
                f"no member of the ensemble reached the end of the run. Member 0: {self.failed[0]}", self.title, code="run.members-failed"
            )
        return path

    def __str__(self) -> str:
        """Return the end of the runs as a short table."""
        lines = [f"{self.title}, {self.scenario}: {self.members} members, {len(self.failed)} failed"]
        width = max(len(n) for n in self.nodes)
        for n in self.nodes if len(self.failed) < self.members else ():
            lines.append(f"  {n:<{width}}  end {self.mean(n)[-1] - ICE_POINT:9.3f} +/- {self.sd(n)[-1]:.3f} degC")
        if self._counts:
            off = max(float(self.quantile_error(n, BAND).max()) for n in self.nodes)
            lines.append(f"  members were counted in bins: quantiles may be {1000.0 * off:.2g} mK off")
        return self.standing.over("\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)]))

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the mean of every node, and where 95 % of the members lie."""
        ends = {n: [self.quantile(n, share) - ICE_POINT for share in BAND] for n in self.nodes}
        return [PlottedTrace(n, self.times, self.mean(n) - ICE_POINT, low, high) for n, (low, high) in ends.items()]

    @staticmethod
    def of_members(
        engine: Engine,
        draws: Mapping[str, Any],
        times: Array,
        options: Options,
        nodes: Sequence[str] | None,
        quantiles: Any,
        threads: int,
        simd: str,
        warnings: tuple[str, ...],
        executor: Workers = None,
    ) -> Ensemble:
        """Run all members at the values of `draws` and return them as an `Ensemble`; arguments as in `ensemble`.

        Raises
        ------
        ScenarioError   When names do not have equally many values, there are no threads, or a folder would have to keep traces.
        """
        wiring, network = engine.wiring, engine.wiring.network
        titles = (network.title, wiring.scenario.title)
        where = ", ".join(titles)
        values, members = _columns(draws, where)
        if threads < 1:
            raise ScenarioError("an ensemble needs at least one thread.", where, code="value.outside-range")
        shares = () if quantiles is None else tuple(float(q) for q in np.atleast_1d(shares_of(quantiles, where)))
        wanted = tuple(dict.fromkeys(network.find(n) for n in nodes)) if nodes is not None else (*network.nodes, *network.boundaries)
        if nodes is not None and options.extremes and (followed := frozenset(wiring.gone) & {*wanted}):
            engine = Engine(Wiring(network, wiring.scenario, wiring.free, followed))  # as sums, their weights would differ between members
        if engine.runner is not None:
            return _one_by_one(engine, values, members, times, wanted, shares, warnings)
        runs = _Runs(engine, times, wanted, options, threads, simd)
        ensemble = partial(Ensemble, *titles, times, wanted, members, values)
        if shares:
            done = _all_counted(runs, values, members, KeptTasks.of_workers(executor))
            return ensemble(done.failed, done.statistics, network.find, dict[str, Array]().__getitem__, done.tallies, {}, {}, warnings)
        if executor is None:
            one = runs.group(values)
            return ensemble(one.failed, one.statistics, network.find, one.temperature, {}, one.turnings, one.duty_cycles, warnings)
        kept_tasks = KeptTasks.of_workers(executor)
        if kept_tasks.folder is not None:
            raise ScenarioError(
                "a folder keeps counts of members, not their traces. Give 'quantiles', or use td.qualify.uncertain_runs.",
                where,
                code="value.incomplete",
            )
        calls = [(f"members from {first} on", (runs, v)) for first, v in _tasks(values, members, LANES)]
        begun, parts = process_time(), [runs.group(calls[0][1][1])]
        others = in_tasks(_Runs.group, calls[1:], kept_tasks.workers, (process_time() - begun) * (len(calls) - 1))
        parts += map(itemgetter(1), sorted(others, key=itemgetter(0)))
        # members are numbered through all groups; turning points of nodes that were not followed in each group are left out
        firsts = np.cumsum([0, *(p.members for p in parts)])[:-1].tolist()
        failed = {first + m: why for first, p in zip(firsts, parts, strict=True) for m, why in p.failed.items()}
        followed_nodes = [n for n in parts[0].turnings if all(n in p.turnings for p in parts)]
        turnings = {
            n: MemberTurnings.joined([(first, p.turnings[n]) for first, p in zip(firsts, parts, strict=True)]) for n in followed_nodes
        }
        duty_cycles = {name: np.concatenate([p.duty_cycles[name] for p in parts]) for name in parts[0].duty_cycles}
        statistics = added([p.statistics for p in parts])
        return ensemble(failed, statistics, network.find, partial(_traces_of, parts), {}, turnings, duty_cycles, warnings)


BAND = (0.025, 0.975)
"""Shares of the members at the ends of a band. [-]"""


def spread_of(values: Array) -> Array:
    """Return the standard deviation (times,) over members (times, members); zero for one member. [K]"""
    return values.std(axis=1, ddof=1) if values.shape[1] > 1 else np.zeros(values.shape[0])


def shares_of(share: Any, where: str) -> Array:
    """Return one share or several (shares,), for quantiles. [-]

    Raises
    ------
    ScenarioError   When a share does not lie between 0 and 1.
    """
    try:
        shares = np.asarray(share)
    except ValueError:  # rows of several lengths
        shares = np.empty(0)
    if shares.dtype.kind not in "iuf" or shares.ndim > 1 or shares.size == 0 or not ((shares >= 0.0) & (shares <= 1.0)).all():
        raise ScenarioError("give a quantile between 0 and 1, such as 0.95.", where, code="value.outside-range")
    return shares


TRACE_BYTES_AT_ONCE = 64_000_000
"""Bytes of traces held at once while members are counted."""
LANES = 8
"""Members that the kernel runs together; groups of whole lanes run as all members would."""
TASKS = 12
"""Shares into which members are divided for workers, so that these end at about the same time."""


class _ApartError(Exception):
    """A check holds for some members only: those of the mask (members,)."""

    def __init__(self, mask: Bools) -> None:
        super().__init__("members differ")
        self.mask = mask


def _all_alike(mask: Bools) -> bool:
    """Return the common answer of a check (members,) for all members.

    Raises
    ------
    _ApartError   When it says different things of them.
    """
    if mask.all():
        return True
    if mask.any():
        raise _ApartError(mask)
    return False


class MemberValues(NDArrayOperatorsMixin, Dual):
    """A number with one value per member; arithmetic and comparisons are those of the arrays, by numpy's mixin.

    It passes for a number with derivatives, of which it has none, because that is what the model's code lets through untouched.

    Parameters
    ----------
    values : array (members,)   [SI]
    """

    values: NDArray[Any]

    def __init__(self, values: NDArray[Any]) -> None:
        object.__setattr__(self, "values", values)

    @property
    def value(self) -> Any:
        """Itself: checks look at all members."""
        return self

    @property
    def gradient(self) -> Array:
        """None of them."""
        return np.zeros(0)

    def __array_ufunc__(self, function: Callable[..., Any], method: str, *inputs: Any, **more: Any) -> Any:
        """Apply a function of numpy member by member."""
        return MemberValues(getattr(function, method)(*(_plain(x) for x in inputs), **more))

    def __bool__(self) -> bool:
        """What a comparison says of all members."""
        return _all_alike(self.values.astype(bool))

    def __format__(self, how: str) -> str:
        """The first member, for a message that is made anew for each."""
        return format(float(self.values[0]), how)

    def __truediv__(self, other: Any) -> MemberValues:
        """Quotient."""
        return _quotient(self.values, _plain(other))

    def __rtruediv__(self, other: Any) -> MemberValues:
        """Quotient, number first."""
        return _quotient(_plain(other), self.values)

    def __pow__(self, other: Any) -> MemberValues:
        """Power."""
        return _power(self.values, _plain(other))

    def __rpow__(self, other: Any) -> MemberValues:
        """Power, number first."""
        return _power(_plain(other), self.values)


def _plain(x: Any) -> Any:
    """Return the array (members,) of a `MemberValues`, and anything else unchanged."""
    return x.values if isinstance(x, MemberValues) else x


def _quotient(above: Any, below: Any) -> MemberValues:
    """Return a quotient (members,); where all members divide by zero it raises ZeroDivisionError, as for one member."""
    if _all_alike(np.broadcast_to(np.asarray(below) == 0.0, np.broadcast_shapes(np.shape(above), np.shape(below)))):
        raise ZeroDivisionError("float division by zero")
    return MemberValues(above / below)


def _power(base: Any, exponent: Any) -> MemberValues:
    """Return a power (members,) [-], each by `real_power` as for one member, so that not even the last bit differs."""
    bases, exponents = np.broadcast_arrays(np.asarray(base, dtype=float), np.asarray(exponent, dtype=float))
    out, wrong = np.empty(bases.shape), np.zeros(bases.shape, dtype=bool)
    for k, (b, e) in enumerate(zip(bases.tolist(), exponents.tolist(), strict=True)):
        try:
            out[k] = real_power(b, e)
        except ArithmeticError:
            wrong[k] = True
    if _all_alike(wrong):
        raise ArithmeticError("a power of a negative number or of zero has no value")
    return MemberValues(out)


@dataclass(frozen=True, eq=False)
class MembersNumbers:
    """Numbers of every member as arrays for the kernel.

    Parameters
    ----------
    coefficients : array (coefficients, members)    [SI]
    initial : array (nodes, members)                NaN where a steady start is asked for. [K]
    weights : dict                                  Eliminated node -> neighbour -> weight (members,), in order of recovery. [-]
    offsets : dict                                  Boundary -> constant part of its temperature (members,). [K]
    refused : dict                                  Member -> why there is no such network; its numbers are NaN.
    """

    coefficients: Array
    initial: Array
    weights: dict[str, dict[str, Array]]
    offsets: dict[str, Array]
    refused: dict[int, str]

    def one(self, member: int, like: Assembled) -> Assembled:
        """Return the numbers of one member, without derivatives, as the kernel takes them."""
        offsets = {b: float(v[member]) for b, v in self.offsets.items()}
        return replace(like, coefficients=self.coefficients[:, member].copy(), initial=self.initial[:, member].copy(), offsets=offsets)


def _fill(numbers: MembersNumbers, wiring: Wiring, values: Mapping[str, Array], share: Indices) -> None:
    """Assemble a share of the members together, or apart where they differ, and write them into their columns of `numbers`."""
    alone = share.size == 1
    try:
        with np.errstate() if alone else np.errstate(over="ignore", invalid="ignore"):
            a = wiring.assembled_at({n: float(v[share[0]]) if alone else MemberValues(v[share]) for n, v in values.items()})
    except _ApartError as apart:
        for part in (share[apart.mask], share[~apart.mask]):
            _fill(numbers, wiring, values, part)
        return
    except ThermidError as error:
        for member in share if not alone else ():
            _fill(numbers, wiring, values, np.array([member]))
        numbers.refused.update({int(share[0]): str(error)} if alone else {})
        return
    for row, number in (*zip(numbers.coefficients, a.coefficients, strict=True), *zip(numbers.initial, a.initial, strict=True)):
        row[share] = _plain(number)
    stars = ((numbers.weights.setdefault(node, {}), star) for node, star in a.reduced.recover)
    for table, entries in (*stars, (numbers.offsets, a.offsets)):
        for name, number in entries.items():
            table.setdefault(name, np.full(numbers.coefficients.shape[1], np.nan))[share] = _plain(number)


def assemble_members(wiring: Wiring, values: Mapping[str, Array], members: int) -> MembersNumbers:
    """Return the kernel's numbers of every member; of members whose values are refused the reason.

    Parameters
    ----------
    wiring : Wiring     With the names of `values` freed.
    values : dict       Free name -> value (members,). [SI]
    members : int       How many there are.
    """
    like = wiring.assemble()
    coefficients, initial = (np.full((n, members), np.nan) for n in (like.coefficients.size, like.initial.size))
    numbers = MembersNumbers(coefficients, initial, {}, {}, {})
    _fill(numbers, wiring, values, np.arange(members))
    return numbers


@dataclass(frozen=True, eq=False)
class _GroupRun:
    """Results of a group of members that ran together; members are counted from zero within the group.

    Parameters
    ----------
    wiring : Wiring
    numbers : MembersNumbers
    kept : tuple of str             Nodes that the kernel stored.
    stored : array (groups, times, kept, lanes)     [K]
    times : array (times,)          [s]
    failed, turnings, statistics, duty_cycles   As of an `Ensemble`.
    """

    wiring: Wiring
    numbers: MembersNumbers
    kept: tuple[str, ...]
    stored: Array
    times: Array
    failed: Mapping[int, str]
    turnings: Mapping[str, MemberTurnings]
    statistics: Mapping[str, Any]
    duty_cycles: Mapping[str, Array]

    def temperature(self, node: str) -> Array:
        """Return the temperature (times, members) of a node, NaN where a member failed. [K]"""
        out = self._recovered(node)
        out[:, list(self.failed)] = np.nan
        return out

    def _recovered(self, name: str) -> Array:
        """Return the temperature (times, members) of a node or boundary from those of the nodes that the kernel stored. [K]"""
        if name in self.kept:
            return np.moveaxis(self.stored[:, :, self.kept.index(name), :], 0, 1).reshape(self.times.size, -1)[:, : self.members]
        if name in self.wiring.network.boundaries:
            signal = self.wiring.signals[f"boundary {name}"]
            varying = np.zeros(self.times.shape) if isinstance(signal, Constant) else signal.at(self.times)
            return varying[:, None] + self.numbers.offsets[name][None, :]
        return np.asarray(sum(w[None, :] * self._recovered(n) for n, w in self.numbers.weights[name].items()))

    @property
    def members(self) -> int:
        """Number of members of the group."""
        return int(self.numbers.coefficients.shape[1])

    def rows(self, node: str) -> Array:
        """Return the rows (times + 2, members that reached the end) of a node, see `MemberTurnings.rows`. [K]"""
        alive = np.setdiff1d(np.arange(self.members), list(self.failed))
        return (self.turnings.get(node) or MemberTurnings.joined([])).rows(self.temperature(node))[:, alive]


@dataclass(frozen=True, eq=False)
class _Runs:
    """Settings that all groups of members share: what a task needs to run some members at their values."""

    engine: Engine
    times: Array
    wanted: tuple[str, ...]
    options: Options
    threads: int
    simd: str

    def group(self, values: Mapping[str, Array]) -> _GroupRun:
        """Run members at values (members,) together, and return their results."""
        engine, members = self.engine, next(iter(values.values())).size
        numbers = _started(engine, assemble_members(engine.wiring, values, members))
        kept_nodes, end = nodes_to_store(self.wanted, numbers.weights, engine.nodes), engine.wiring.scenario.seconds
        kernel = engine.members(numbers.coefficients, numbers.initial, self.times, kept_nodes, end, self.options, self.simd)
        stored = kernel.advance(self.times.size, self.threads)
        failed = _failed(engine, kernel, numbers, self.options)
        turnings = _turnings(engine, kernel, numbers, self.wanted, kept_nodes, failed, self.options)
        statistics = {"steps": kernel.steps, "rejected": kernel.rejected, "one_by_one": int(kernel.alone.sum()), "simd": kernel.simd}
        duty_cycles = _duty_cycles(engine, kernel, members, failed, end)
        return _GroupRun(engine.wiring, numbers, kept_nodes, stored, self.times, failed, turnings, statistics, duty_cycles)

    def key(self, values: Mapping[str, Array]) -> str:
        """Return a hash of all that the counts at values (members,) depend on: model, scenario, values, settings, version."""
        from importlib.metadata import version

        wiring, settings = self.engine.wiring, (self.times, self.wanted, self.options, self.simd, self.at_once, version("thermid"))
        return digest((cast(Model, wiring.network.flat.names.model).identity(), wiring.scenario, dict(values), *settings))

    @property
    def at_once(self) -> int:
        """How many members run together where their traces are not kept."""
        return max(min(TRACE_BYTES_AT_ONCE // (8 * self.times.size * max(len(self.wanted), 1)), PILOT) // LANES, 1) * LANES

    def counted(self, group: _GroupRun, grids: Mapping[str, CountGrid]) -> Counted:
        """Return the counts of a group's temperatures on the grids of nodes."""
        return Counted.on_grids(grids, {node: group.rows(node) for node in grids}, group.members, group.failed, group.statistics)


def _count(runs: _Runs, values: Mapping[str, Array], grids: Mapping[str, CountGrid]) -> Counted:
    """Return the counts of members at values (members,), run in groups of `runs.at_once`: a task of a worker."""
    parts = ((k * runs.at_once, runs.counted(runs.group(v), grids)) for k, v in enumerate(_shares_of(values, runs.at_once)))
    return Counted.gathered(parts, next(iter(values.values())).size)


def _shares_of(values: Mapping[str, Array], size: int) -> list[dict[str, Array]]:
    """Return values (members,) by name in pieces of `size` members, the last one shorter."""
    members = next(iter(values.values())).size
    return [{n: v[first : first + size] for n, v in values.items()} for first in range(0, members, size)]


def _all_counted(runs: _Runs, values: Mapping[str, Array], members: int, kept_tasks: KeptTasks) -> Counted:
    """Return the counts of all members; the first group with a member that reaches the end sets the grids for all.

    Parameters
    ----------
    values : dict       Parameter -> its value in each member (members,). [SI]
    kept_tasks          Who runs the groups, and the folder that keeps their counts.
    """
    pilots, at, begun = [], 0, process_time()
    grids: dict[str, CountGrid] = {}
    while at < members and not grids:
        group = runs.group({n: v[at : at + runs.at_once] for n, v in values.items()})
        grids = Counted.grids({n: group.rows(n) for n in runs.wanted})
        pilots.append((at, runs.counted(group, grids)))
        at += pilots[-1][1].members
    ahead = (process_time() - begun) * (members - at) / at
    tasks = _tasks({n: v[at:] for n, v in values.items()}, members - at, runs.at_once)
    folder = JobFolder.below(kept_tasks.folder, runs.key(values)) if kept_tasks.folder is not None else None
    done = _left_in(folder, {at + first: v for first, v in tasks}, grids)
    open_ = [at + first for first, _ in tasks if at + first not in done]
    calls = [(f"members from {at + first} on", (runs, v, grids)) for first, v in tasks if at + first in open_]
    others = in_tasks(_count, calls, kept_tasks.workers, seconds=ahead)

    def counted() -> Iterator[tuple[int, Counted]]:
        """Yield the counts of each part as it ends, kept in the folder before."""
        for k, part in others:
            if folder is not None:
                folder.save(_file_of(open_[k], part.members), part.arrays())
            yield open_[k], part
            del part  # megabytes, while the next is made

    return Counted.gathered(chain(pilots, done.items(), counted()), members)


def _file_of(first: int, members: int) -> str:
    """Return the name of the file in a job's folder with the counts of `members` members from `first` on."""
    return f"counts_{first:07d}_{members}"


def _left_in(folder: JobFolder | None, tasks: Mapping[int, Mapping[str, Array]], grids: Mapping[str, CountGrid]) -> dict[int, Counted]:
    """Return first member -> counts of the tasks that an earlier run of the job finished; nothing without a folder."""
    files = {first: _file_of(first, next(iter(v.values())).size) for first, v in tasks.items()} if folder is not None else {}
    return {first: part for first, f in files.items() if folder is not None and (part := Counted.read(folder.load(f), grids)) is not None}


def _tasks(values: Mapping[str, Array], members: int, at_once: int) -> list[tuple[int, dict[str, Array]]]:
    """Return the tasks of an ensemble: first member and values of each, in whole groups of `at_once`, about `TASKS` of them."""
    size = at_once * max(1, -(-members // (TASKS * at_once)))
    return [(k * size, v) for k, v in enumerate(_shares_of(values, size))]


def _traces_of(parts: Sequence[_GroupRun], name: str) -> Array:
    """Return the temperature (times, members) of a node in all groups, one behind the other. [K]"""
    return np.concatenate([p.temperature(name) for p in parts], axis=1)


def _one_by_one(
    engine: Engine,
    values: Mapping[str, Array],
    members: int,
    times: Array,
    wanted: tuple[str, ...],
    shares: Sequence[float],
    warnings: tuple[str, ...],
) -> Ensemble:
    """Return the ensemble of a model that a program other than the kernel runs, such as an FMU: one member after the other.

    Raises
    ------
    ScenarioError   When quantiles alone are asked for, or a member gives other names than those that are free.
    """
    wiring = engine.wiring
    titles = (wiring.network.title, wiring.scenario.title)
    if shares or set(values) != set(wiring.free):
        raise ScenarioError(
            "runs of an FMU are kept whole, and one by one. Leave quantiles out.", ", ".join(titles), code="model.element-not-supported"
        )
    temperatures = np.full((members, times.size, len(wanted)), np.nan)
    failed: dict[int, str] = {}
    end = max(wiring.scenario.seconds, float(times[-1]))
    for m in range(members):
        a = wiring.assemble(np.array([values[n][m] for n in wiring.free]), False)
        try:
            answer = engine.integrate(a, times, wanted, end, Options())
        except ThermidError as error:
            failed[m] = str(error)
            continue
        temperatures[m] = answer.temperatures
    place = {n: k for k, n in enumerate(wanted)}

    def traces(node: str) -> Array:
        """Return the temperatures (times, members) of a node. [K]"""
        return np.asarray(temperatures[:, :, place[node]].T)

    statistics = {"steps": 0, "rejected": 0, "one_by_one": members, "simd": "none"}
    return Ensemble(*titles, times, wanted, members, values, failed, statistics, wiring.network.find, traces, {}, {}, {}, warnings)


def _columns(draws: Mapping[str, Any], where: str) -> tuple[dict[str, Array], int]:
    """Return the values of each name as read-only arrays (members,), and the number of members; refuse unequal or empty ones."""
    try:
        values = {name: np.array(v, dtype=float) for name, v in draws.items()}
    except (TypeError, ValueError):
        raise ScenarioError("draws are arrays of numbers, one a member, by name.", where, code="value.wrong-kind") from None
    sizes = {v.shape for v in values.values()}
    if len(sizes) != 1 or any(len(s) != 1 or s[0] == 0 for s in sizes):
        shapes = ", ".join(f"'{n}' {v.shape}" for n, v in values.items()) or "nothing is drawn"
        raise ScenarioError(f"every name needs one value per member, in a list: {shapes}.", where, code="value.shape")
    for v in values.values():
        v.flags.writeable = False
    return values, sizes.pop()[0]


def _started(engine: Engine, numbers: MembersNumbers) -> MembersNumbers:
    """Return the numbers of members with a steady start solved for where the scenario asks for one (initial temperatures of NaN)."""
    waiting = [m for m in np.flatnonzero(np.isnan(numbers.initial).any(axis=0)).tolist() if m not in numbers.refused]
    if not waiting:
        return numbers
    initial, refused, like = numbers.initial.copy(), dict(numbers.refused), engine.wiring.assemble()
    for member in waiting:
        try:
            initial[:, member] = engine.started(numbers.one(member, like)).initial
        except SolverError as error:
            refused[member] = str(error)
    return MembersNumbers(numbers.coefficients, initial, numbers.weights, numbers.offsets, refused)


def _failed(engine: Engine, kernel: Any, numbers: MembersNumbers, options: Options) -> dict[int, str]:
    """Return member -> why it did not reach the end, in words: those whose numbers were refused, and those that the kernel gave up."""
    status, node, time = kernel.status, kernel.node, kernel.time
    out = dict(numbers.refused)
    like = engine.wiring.assemble() if engine.refuses else None
    for m in np.flatnonzero(status).tolist():
        last = kernel.ended(m)
        ended = SimpleNamespace(status=int(status[m]), node=int(node[m]), time=float(time[m]), final_temperatures=last)
        numbers_of_member = numbers.one(m, like) if like is not None and last.size and m not in out else None
        out.setdefault(m, engine.message(ended, options, engine.wiring.scenario.seconds, numbers_of_member))
    return dict(sorted(out.items()))


def _duty_cycles(engine: Engine, kernel: Any, members: int, failed: Mapping[int, str], end: float) -> dict[str, Array]:
    """Return thermostat -> time on over time (members, 2), of the run and of its last complete cycle; NaN where there is none. [-]"""
    out = {name: np.full((members, 2), np.nan) for name in engine.thermostats}
    for m in (m for m in range(members if out else 0) if m not in failed):
        times, switches, states, on = kernel.switchings(m)
        for name, shares in out.items():
            chosen = switches == (k := engine.control_names.index(name))
            before = 1 - states[chosen][0] if chosen.any() else on[k]
            shares[m] = on_shares(times[chosen], states[chosen], int(before), end)[:2]
    return out


def _turnings(
    engine: Engine,
    kernel: Any,
    numbers: MembersNumbers,
    wanted: Sequence[str],
    kept_nodes: Sequence[str],
    failed: Mapping[int, str],
    options: Options,
) -> dict[str, MemberTurnings]:
    """Return node or boundary -> turning points of the members that reached the end; eliminated nodes are left out."""
    if not options.extremes:
        return {}
    member, column, times, kelvin = kernel.turnings  # in order of columns, members and times
    ends = np.searchsorted(column, np.arange(len(kept_nodes) + 1))
    member = member.astype(np.int64)
    out = {n: MemberTurnings(member[i:j], times[i:j], kelvin[i:j]) for n, i, j in zip(kept_nodes, ends[:-1], ends[1:], strict=True)}
    wiring = engine.wiring
    for name in wanted:
        if name in numbers.offsets:
            turns = signal_turnings(wiring.signals[f"boundary {name}"], wiring.scenario.seconds, 0.0)
            out[name] = MemberTurnings.alike(turns, numbers.offsets[name])
    return {n: out[n].without(failed) for n in wanted if n in out}
