"""Streams of gas in a network: their mass by the pressure and temperature of their sources, and vacuum that stops them.

A stream of gas is fixed in mass (`mass_flow`) or in volume (`volume_flow`). A volume is that which enters the line where it begins: from
there on every stream of the line carries that mass, whatever temperature it takes. Where lines meet, masses add.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from thermid.base.errors import CodedText, ScenarioError, quoted
from thermid.base.units import AMBIENT_DEFAULT, ATMOSPHERE, ICE_POINT, Memo, Number
from thermid.model.tree import Constant, Drawn, Flat, FlatConductor, Law, Mixed, Signal, streams_of
from thermid.physics.gas import GASES
from thermid.simulation._network.medium import AIR_RANGE, VACUUM_LIMIT, Media
from thermid.simulation._network.rows import ConductorRow, reached


@dataclass(frozen=True, eq=False)
class Streams:
    """The streams of gas of a network, and how their mass follows pressures and the temperatures of their sources.

    Parameters
    ----------
    conductors : tuple      Streams of a gas.
    shares : dict           Stream -> source -> share of its flow that comes from there, both by path; a source is the stream that begins
                            a line at a boundary, or a stream of a loop that begins nowhere. [-]
    lines : dict            Stream -> nodes of the streams that are joined with it.
    unfed : dict            What is said of streams of no fluid that leave a gas node which none enters, by path.
    boundaries : frozenset  Nodes whose temperature is given, by path.
    media : Media
    memo : Memo             Courses that were worked out.
    """

    conductors: tuple[FlatConductor, ...]
    shares: Mapping[str, Mapping[str, float]]
    lines: Mapping[str, tuple[str, ...]]
    unfed: Mapping[str, str]
    boundaries: frozenset[str]
    media: Media
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    @classmethod
    def of_network(cls, flat: Flat, values: Mapping[str, Any], media: Media) -> Streams:
        """Return the streams of gas of a network.

        Raises
        ------
        ScenarioError   When a stream that names no fluid has another pressure than that of the ground at an end.
        """
        for c in streams_of(flat.conductors):
            off = [n for n in c.ends for low, high in (media.pressure(n).bounds,) if low < AIR_RANGE[0] or high > AIR_RANGE[1]]
            if off and not c.fluid:
                raise ScenarioError(
                    f"'{c.path}' has no fluid, and the pressure in {quoted(off)} is not atmospheric. The flow of a gas depends on "
                    'pressure, that of a liquid does not. Write fluid = "air" (or another gas; its density then follows), or '
                    'fluid = "liquid".',
                    c.where,
                    code="model.needs-gas-law",
                )
        gas, inner = tuple(c for c in streams_of(flat.conductors) if c.fluid in GASES), {n.path for n in flat.nodes}
        ends = frozenset(n for c in gas for n in c.ends)
        return cls(gas, _shares(gas, values, inner), _lines(gas, inner), flat.unfed_streams, ends - inner, media)

    def __contains__(self, path: str) -> bool:
        """Whether the conductor at a path is a stream of gas."""
        return path in self.shares

    def sources(self, path: str) -> dict[str, float]:
        """Return node -> share of a stream's flow that comes from it. [-]"""
        out: dict[str, float] = {}
        for source, share in self.shares[path].items():
            node = self._named[source].ends[0]
            out[node] = out.get(node, 0.0) + share
        return out

    def course(self, path: str, temperatures: Mapping[str, Signal]) -> Drawn:
        """Return the mass flow of a stream over time, relative to that with its gas at one atmosphere and 20 degC. [-]

        For a volume flow sum_n x_n p_n / p0 T0 / T_n over its sources n with shares x_n, for a mass flow 1; zero while any pressure of
        its line is that of vacuum.

        Parameters
        ----------
        path : str              Of the stream.
        temperatures : dict     Boundary -> temperature; a source that is not among them has 20 degC. [K]
        """
        sources = self.sources(path) if self._named[path].by_volume else {}
        line = self.lines[path]
        # the distinct pressures of the nodes of the line, and node -> place of its own among them
        of_node = self.memo.value(line, lambda: {n: self.media.pressure(n) for n in line})
        distinct = {id(s): s for s in of_node.values()}
        pressures, place = list(distinct.values()), {n: list(distinct).index(id(s)) for n, s in of_node.items()}
        warm = {n: temperatures[n] for n in sources if n in temperatures}
        place_of = {n: len(pressures) + k for k, n in enumerate(warm)}

        def flow(*pressures_and_temperatures: Any) -> Any:
            """Return the share of the stream that flows at pressures [Pa] and temperatures [K]: none in vacuum."""
            present = np.all([p > VACUUM_LIMIT for p in pressures_and_temperatures[: len(pressures)]], axis=0)
            if not sources:
                return 1.0 * present
            dense = [
                pressures_and_temperatures[place[n]]
                / ATMOSPHERE
                * (AMBIENT_DEFAULT / pressures_and_temperatures[place_of[n]] if n in place_of else 1.0)
                for n in sources
            ]
            return sum(share * source_flow for share, source_flow in zip(sources.values(), dense, strict=True)) * present

        return Mixed(flow, (*pressures, *warm.values())).drawn(self.media.seconds)

    def still(self, path: str) -> Drawn:
        """Return `course` with all sources at 20 degC: what a network has before a scenario gives temperatures. [-]"""
        return self.memo.value(path, lambda: self.course(path, {}))

    def row(self, c: FlatConductor, law: Law) -> ConductorRow:
        """Return the row of a stream of gas: its heat capacity rate at the density of its gas."""
        rate, course = law.scaled(self._standard(c)), self.still(c.path)
        if isinstance(course, Constant):
            return ConductorRow(c.path, c.ends, rate.scaled(course.value))
        return ConductorRow(c.path, c.ends, rate, None, signal_of(c.path))

    @staticmethod
    def _standard(c: FlatConductor) -> float:
        """Return the factor from a flow as written to its heat capacity rate at one atmosphere and 20 degC.

        The density for a volume flow, else 1, times the specific heat unless the deck gives it.
        """
        gas = GASES[c.fluid]
        density = ATMOSPHERE / (gas.constant * AMBIENT_DEFAULT) if c.by_volume else 1.0
        return density * (1.0 if "specific_heat" in c.fields else float(gas.cp(AMBIENT_DEFAULT)))

    def written(self, path: str, rate: float, specific_heat: float) -> tuple[str, float]:
        """Return the deck's field, volume_flow or mass_flow, and the flow [m^3/s or kg/s] that gives a heat capacity rate; 0 without gas.

        Parameters
        ----------
        path : str              Of the stream.
        rate : float            As its row has it. [W/K]
        specific_heat : float   Written beside the flow. [J/(kg K)]
        """
        c, course = self._named[path], self.still(path)
        gas, factor = GASES[c.fluid], course.value if isinstance(course, Constant) else 1.0
        density = ATMOSPHERE / (gas.constant * AMBIENT_DEFAULT) if c.by_volume else 1.0
        return ("volume_flow" if c.by_volume else "mass_flow"), rate / (factor * density * specific_heat) if factor else 0.0

    def signals(self) -> dict[str, Signal]:
        """Return the inputs that multiply rows of streams whose mass changes in time, by `signal_of` their paths. [-]"""
        return {signal_of(c.path): s for c in self.conductors if not isinstance(s := self.still(c.path), Constant)}

    def shifted(self, path: str, boundaries: Mapping[str, Signal], offsets: Mapping[str, Number]) -> Number:
        """Return the factor on a stream's mass where free offsets make its sources warmer than their signals. [-]

        The ratio of sum_n x_n T0 / T_n with and without the offsets, at the mean temperatures of the run; 1 for a mass flow.

        Parameters
        ----------
        boundaries : dict   Boundary -> its signal. [K]
        offsets : dict      Boundary -> temperature where the signal is constant, else what is added to it. [K]
        """
        sources = {n: share for n, share in self.sources(path).items() if n in offsets}
        if not sources or not self._named[path].by_volume:
            return 1.0
        before: Number = 1.0 - sum(sources.values())
        after: Number = before
        for n, share in sources.items():
            boundary = boundaries[n]
            mean = boundary.mean_over(0.0, self.media.seconds)
            now = offsets[n] if isinstance(boundary, Constant) else offsets[n] + mean
            before, after = before + share / mean * AMBIENT_DEFAULT, after + share * AMBIENT_DEFAULT / now
        return after / before

    def remarks(self, end: float) -> Iterator[str]:
        """Yield what a reader of a run must know of its streams; `end` of it [s]."""
        yield from self.unfed.values()
        stopped: dict[tuple[str, float], list[FlatConductor]] = {}
        for c in self.conductors:
            gone = self._gone(c.path, end)
            if gone is not None:
                stopped.setdefault((c.fluid, gone), []).append(c)
        for (fluid, begin), group in stopped.items():
            which, many = quoted([c.path for c in group]), len(group) > 1
            pressures = {n: self.media.pressure(n) for c in group for n in self.lines[c.path]}
            empty = [n for n, p in pressures.items() if (p.at(np.append(p.knots(0.0, end), end)) <= VACUUM_LIMIT).any()]
            when = f" from {begin:g} s" if begin > 0.0 else ""
            yield CodedText(
                f"{which} {'are' if many else 'is'} {fluid} and {'stop' if many else 'stops'} without gas in {quoted(empty)}{when}",
                "run.heat-stops-without-gas",
            )
        entered = {c.ends[1] for c in self.conductors} - self.boundaries
        loops = [c.path for c in self.conductors if c.by_volume and set(self.sources(c.path)) <= entered]
        if loops:
            come, their = ("come", "their") if len(loops) > 1 else ("comes", "its")
            yield CodedText(
                f"{quoted(loops)} {come} from no boundary: {their} density is that at {AMBIENT_DEFAULT - ICE_POINT:g} degC",
                "run.density-assumed",
            )
        for c in self.conductors:
            other = {n: self.media.gas(n) for n in c.ends if self.media.gas(n) != c.fluid}
            if other:
                kind = next(iter(other.values()))
                yield (
                    CodedText(
                        f"'{c.path}' is {c.fluid}, and the gas of {quoted(list(other))} is {kind} for convection there. Give both the "
                        "same gas, in the environment or as the fluid",
                        "run.gases-differ",
                    )
                )

    @cached_property
    def _named(self) -> dict[str, FlatConductor]:
        """Path -> conductor of each stream."""
        return {c.path: c for c in self.conductors}

    def _gone(self, path: str, end: float) -> float | None:
        """Return the first instant of a run at which a stream stands still for want of gas; None where it never does. [s]"""
        course = self.still(path)
        if isinstance(course, Constant):
            return 0.0 if course.value == 0.0 else None
        times = course.knots(0.0, end)
        none = (course.at(times) == 0.0) & (times < end)
        return float(max(times[none.argmax()], 0.0)) if none.any() else None


def signal_of(path: str) -> str:
    """Return the name of the input that multiplies the row of a stream, ``stream <path>``."""
    return f"stream {path}"


def _shares(streams: Sequence[FlatConductor], values: Mapping[str, Any], inner: set[str]) -> dict[str, dict[str, float]]:
    """Return stream -> source -> share of its flow, from the mixing in every node: what a node passes on is the mixture that enters it.

    With the flow m of each stream and the shares x of each node, x_n sum(m into n) = sum(m x of the first end), a source counting itself.
    """
    entered = [n for n in dict.fromkeys(c.ends[1] for c in streams) if n in inner]
    after = {n: {c.ends[1] for c in streams if c.ends[0] == n} & inner for n in entered}
    fed = reached({c.ends[1] for c in streams if c.ends[0] not in after} & inner, after)  # from boundaries
    index = {n: k for k, n in enumerate(entered) if n in fed}
    origins = [c.path for c in streams if c.ends[0] not in index]
    flows = {c.path: float(c.flow(values)) for c in streams}
    least = 1e-12 * max(flows.values(), default=0.0) or 1.0
    matrix, right = np.zeros((len(entered), len(entered))), np.zeros((len(entered), len(origins)))
    for c in streams:
        flow = max(flows[c.path], least)
        if c.ends[1] not in index:
            continue
        k = index[c.ends[1]]
        matrix[k, k] += flow
        if c.ends[0] in index:
            matrix[k, index[c.ends[0]]] -= flow
        else:
            right[k, origins.index(c.path)] += flow
    rows = list(index.values())
    mixed = dict(zip(index, np.linalg.solve(matrix[np.ix_(rows, rows)], right[rows]), strict=True)) if rows else {}
    out = {}
    for c in streams:
        x = mixed.get(c.ends[0])
        out[c.path] = {c.path: 1.0} if x is None else {s: float(v) for s, v in zip(origins, x, strict=True) if v > 0.0}
    return out


def _lines(streams: Sequence[FlatConductor], inner: set[str]) -> dict[str, tuple[str, ...]]:
    """Return stream -> nodes of all streams that are joined with it by inner nodes that gas passes through."""
    passed = {c.ends[0] for c in streams} & {c.ends[1] for c in streams} & inner
    line: dict[str, list[str]] = {}
    for c in streams:
        joined = list(dict.fromkeys(id(line[n]) for n in c.ends if n in passed and n in line))
        lines = {id(line_nodes): line_nodes for line_nodes in line.values()}
        nodes = list(dict.fromkeys([*(n for key in joined for n in lines[key]), *c.ends]))
        line |= dict.fromkeys((n for n in nodes if n in passed), nodes)
    return {c.path: tuple(next((line[n] for n in c.ends if n in passed), c.ends)) for c in streams}
