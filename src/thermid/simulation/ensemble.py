"""`Ensemble`: what many runs of one model say together - quantiles, means, shares above a limit, single traces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import ScenarioError
from thermid.physics.constants import ICE_POINT
from thermid.simulation.solution import Trace
from thermid.simulation.solver.extremes import MemberTurnings

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Summary:
    """What is kept of one node when only quantiles were asked for.

    Parameters
    ----------
    quantiles : array (shares, times)   [K]
    mean, sd : array (times,)           [K]
    highest, lowest : array (members,)  Of each member's samples, NaN where it failed. [K]
    """

    quantiles: Array
    mean: Array
    sd: Array
    highest: Array
    lowest: Array


@dataclass(frozen=True, eq=False)
class Ensemble:
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
    shares : tuple          Shares of the quantiles that were kept; empty when every trace was. [-]
    statistics : dict       Steps (of a group of members, or of one), rejected steps, members run one by one, instruction set.
    warnings : tuple        What a reader must know.
    """

    title: str
    scenario: str
    times: Array
    nodes: tuple[str, ...]
    members: int
    draws: Mapping[str, Array]
    failed: Mapping[int, str]
    shares: tuple[float, ...]
    statistics: Mapping[str, Any]
    _find: Callable[[str], str] = field(repr=False)
    _traces: Callable[[str], Array] = field(repr=False)
    _summaries: Mapping[str, Summary] = field(repr=False)
    _turnings: Mapping[str, MemberTurnings] = field(repr=False)
    warnings: tuple[str, ...] = ()

    def temperatures(self, node: str) -> Array:
        """Return the temperature (times, members) of a node in every member, NaN where a member failed. [K]

        Raises
        ------
        NameNotFoundError   With the nearest name.
        ScenarioError       When the node was not kept, or only quantiles were.
        """
        path = self._kept(node)
        if self.shares:
            raise ScenarioError("only quantiles were kept; run the ensemble without 'quantiles' to keep every trace.", self.title)
        return self._traces(path)

    def trace(self, member: int, node: str) -> Trace:
        """Return the trace of a node in one member."""
        if not 0 <= member < self.members:
            raise ScenarioError(f"there is no member {member}; they are numbered from 0 to {self.members - 1}.", self.title)
        turnings = self.turnings(node)
        return Trace(
            self._kept(node), self.times, self.temperatures(node)[:, member], turnings.of(member) if turnings is not None else None
        )

    def turnings(self, node: str) -> MemberTurnings | None:
        """Return the turning points of a node between samples in every member; None where members were not followed.

        That is so with ``Options(extremes=False)``, and for a massless node that was eliminated: its weights differ from member to member.
        """
        return self._turnings.get(self._kept(node))

    def quantile(self, node: str, share: Any) -> Array:
        """Return the temperature below which a share of the members lies, (times,) or (shares, times). [K]

        Raises
        ------
        ScenarioError   When a share does not lie between 0 and 1, or was not among those kept.
        """
        path, wanted = self._kept(node), np.atleast_1d(np.asarray(share, dtype=float))
        check_shares(wanted, self.title)
        if self.shares:
            for s in wanted.tolist():
                if s not in self.shares:
                    kept = ", ".join(f"{k:g}" for k in self.shares)
                    raise ScenarioError(f"the quantile {s:g} was not kept, only {kept}. Ask for it in 'quantiles'.", self.title)
            found: Array = self._summaries[path].quantiles[[self.shares.index(s) for s in wanted.tolist()]]
        else:
            found = np.quantile(self._whole(path), wanted, axis=1)
        return found if np.ndim(share) else np.asarray(found[0])

    def mean(self, node: str) -> Array:
        """Return the mean temperature (times,) over the members. [K]"""
        path = self._kept(node)
        return self._summaries[path].mean if self.shares else self._whole(path).mean(axis=1)

    def sd(self, node: str) -> Array:
        """Return the standard deviation (times,) of the temperature over the members. [K]"""
        path = self._kept(node)
        return self._summaries[path].sd if self.shares else spread_of(self._whole(path))

    def highest(self, node: str) -> Array:
        """Return the highest temperature (members,) of each member, NaN where it failed. [degC]

        Between samples too; of the samples alone where `turnings` is None.
        """
        return self._furthest(node, 1.0)

    def lowest(self, node: str) -> Array:
        """Return the lowest temperature (members,) of each member, NaN where it failed; as `highest`. [degC]"""
        return self._furthest(node, -1.0)

    def _furthest(self, node: str, sign: float) -> Array:
        path = self._kept(node)
        if self.shares:
            samples = (self._summaries[path].highest if sign > 0 else self._summaries[path].lowest)[:, None]
        else:
            samples = self._traces(path).T
        turnings = self._turnings.get(path) or MemberTurnings.joined([])
        return turnings.furthest(samples, sign) - ICE_POINT

    def exceedance(self, node: str, limit: float) -> Array:
        """Return the share (times,) of the members in which a node is above a limit [degC]. [-]

        Members that are above it at any time: ``(ensemble.highest(node) > limit).mean()``.
        """
        return np.asarray((self._whole_or_refuse(node) > limit + ICE_POINT).mean(axis=1))

    def _whole_or_refuse(self, node: str) -> Array:
        self.temperatures(node)
        return self._whole(self._kept(node))

    def _whole(self, path: str) -> Array:
        """Return the temperatures (times, members that reached the end). [K]"""
        traces = self._traces(path)
        return np.delete(traces, list(self.failed), axis=1) if self.failed else traces

    def _kept(self, node: str) -> str:
        path = self._find(node)
        if path not in self.nodes:
            raise ScenarioError(f"'{node}' was not kept; name it in 'nodes'. Kept are {', '.join(self.nodes)}.", self.title)
        if len(self.failed) == self.members:
            raise ScenarioError(f"no member reached the end. Member 0: {self.failed[0]}", self.title)
        return path

    def __str__(self) -> str:
        """Return the end of the runs as a short table."""
        lines = [f"{self.title}, {self.scenario}: {self.members} members, {len(self.failed)} failed"]
        width = max(len(n) for n in self.nodes)
        for n in self.nodes if len(self.failed) < self.members else ():
            lines.append(f"  {n:<{width}}  end {self.mean(n)[-1] - ICE_POINT:9.3f} +/- {self.sd(n)[-1]:.3f} degC")
        return "\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)])


def spread_of(values: Array) -> Array:
    """Return the standard deviation (times,) over members (times, members); zero for one member. [K]"""
    return values.std(axis=1, ddof=1) if values.shape[1] > 1 else np.zeros(values.shape[0])


def check_shares(shares: Array, where: str) -> None:
    """Refuse quantiles that are none.

    Raises
    ------
    ScenarioError   When a share does not lie between 0 and 1.
    """
    if shares.ndim != 1 or shares.size == 0 or not ((shares >= 0.0) & (shares <= 1.0)).all():
        raise ScenarioError("a quantile is a share between 0 and 1, such as 0.95.", where)
