"""Streams of a deck: what they are, what they carry, and the mass balance of each node that they join."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from thermid.dual import value_of
from thermid.model.tree.flat import Flat, FlatConductor
from thermid.model.tree.surroundings import gas_nodes
from thermid.physics.gas import GASES

BALANCED: Final = 1e-3
"""Share of a node's flow that may be missing: flows are written with three digits or more. [-]"""


def streams_of(conductors: Iterable[FlatConductor]) -> tuple[FlatConductor, ...]:
    """Return the streams between two nodes."""
    return tuple(c for c in conductors if c.kind == "flow" and c.ends[0] != c.ends[1])


def fluid_of(c: FlatConductor) -> str:
    """Return the fluid of a stream: a gas, liquid, or empty where it names none."""
    return c.words.get("fluid", "")


def by_volume(c: FlatConductor) -> bool:
    """Return whether a stream is written as a flow of volume."""
    return "volume_flow" in c.fields


def flow_of(c: FlatConductor, values: Mapping[str, Any]) -> Any:
    """Return the flow of a stream as it is written: of mass [kg/s], or of volume [m^3/s] where its density follows from the gas."""
    flow = value_of(values[c.fields["volume_flow" if by_volume(c) else "mass_flow"]])
    return flow * value_of(values[c.fields["density"]]) if "density" in c.fields else flow


def unclosed(flat: Flat, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield place and sentence of each node that does not pass on what enters it, where a stream names its fluid or the node is gas.

    What enters a node and is not passed on leaves it unwritten, at its temperature: the last node of a line. A boundary gives and takes.

    Parameters
    ----------
    values : dict   Parameter path -> value. [SI]
    """
    inner, gases = {n.path for n in flat.nodes}, gas_nodes(flat)
    joined: dict[str, list[FlatConductor]] = {}
    for c in streams_of(flat.conductors):
        for end in c.ends:
            joined.setdefault(end, []).append(c)
    for node in joined:
        for fluid, several in _by_fluid(joined[node]).items() if node in inner else ():
            into = [c for c in several if c.ends[1] == node]
            out = [c for c in several if c.ends[0] == node]
            if out and (fluid or (into and node in gases)):  # of one without fluid that none feeds, `unfed` speaks
                yield from _met(node, several)
                yield from _kept(node, into, out, values)


def _kept(node: str, into: Sequence[FlatConductor], out: Sequence[FlatConductor], values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with the sums of a node."""
    entering, leaving = (sum((flow_of(c, values) for c in part), start=0.0) for part in (into, out))
    gap, most = entering - leaving, entering + leaving
    if gap * gap > (BALANCED * most) * (BALANCED * most):
        yield (
            out[0].where,
            f"'{node}' takes in {_said(into, entering, values)} and passes on {_said(out, leaving, values)}. "
            "A node of a stream keeps no mass. Make them equal, or write the stream that is missing, from or to a boundary such as "
            "the ambient; one parameter for all streams of a line keeps it closed in fits and schedules.",
        )


def _by_fluid(streams: Sequence[FlatConductor]) -> dict[str, list[FlatConductor]]:
    """Return fluid -> streams of a node: all gas in one, with a stream that names no fluid beside it; a liquid apart."""
    gas = any(fluid_of(c) in GASES for c in streams)
    out: dict[str, list[FlatConductor]] = {}
    for c in streams:
        fluid = fluid_of(c)
        out.setdefault("gas" if fluid in GASES or (gas and not fluid) else fluid, []).append(c)
    return out


def _met(node: str, streams: Sequence[FlatConductor]) -> Iterator[tuple[str, str]]:
    """Yield two gases in one node, and volumes of gas beside masses."""
    gases = {fluid_of(c): c for c in streams if fluid_of(c)}
    if len(gases) > 1:
        (one, a), (two, b) = list(gases.items())[:2]
        yield b.where, f"{one} ('{a.path}') and {two} ('{b.path}') meet in '{node}'. Gases that mix are one fluid here: name one."
    kinds = {by_volume(c) and "density" not in c.fields: c for c in streams}
    if len(kinds) > 1:
        yield (
            kinds[False].where,
            f"in '{node}' the volume of '{kinds[True].path}' meets the mass of '{kinds[False].path}', whose balance closes at one pressure "
            "and temperature at most. Write streams that meet all as volume_flow or all as mass_flow.",
        )


def unfed(flat: Flat) -> dict[str, str]:
    """Return what is said of each stream that names no fluid and leaves a gas node that no stream enters, by its path."""
    streams = streams_of(flat.conductors)
    empty = gas_nodes(flat) - {c.ends[1] for c in streams}
    return {
        c.path: f"'{c.path}' takes no heat from '{c.ends[0]}', since no stream enters there: write its inlet, and the fluid of both"
        for c in streams
        if not fluid_of(c) and c.ends[0] in empty
    }


def _said(streams: Sequence[FlatConductor], flow: Any, values: Mapping[str, Any]) -> str:
    """Return a flow with the names of its streams, as volume where all are written so; of many members the first."""
    if not streams:
        return "nothing"
    volume = all(by_volume(c) for c in streams)
    size = sum((value_of(values[c.fields["volume_flow"]]) for c in streams), start=0.0) if volume else flow
    plain = float(np.asarray(getattr(size, "values", size)).ravel()[0])
    text = f"{6e4 * plain:.4g} l/min" if volume else f"{1e3 * plain:.4g} g/s"
    return f"{text} ({', '.join(repr(c.path) for c in streams)})"
