"""Heat that the nodes of a deck absorb along an orbit, as Thermal Desktop computes it and SINDA's LOADQ applies it.

The rates stand in a file beside the deck (.hra): array 1 holds the mean of each node, 3 areas where rates are fluxes, 4 a scale, 5 the
times, and one array from 6 on the course of each node; CARRAY DATA names the nodes in that order. Newer versions let SINDA read the same
arrays from a binary copy (.hra_bin) and leave them in the text file as comments, which are read here as the arrays that they are.
LOADQ interpolates linearly, cyclically when the times begin at 0, and takes the means for a steady state with DTIMES = 0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from thermid.base.errors import DeckError
from thermid.base.units import counted
from thermid.interop._decks.network_file import FileCourse

SUFFIX: Final = ".hra"
"""End of the name of a file of heat rates."""
FIRST_COURSE: Final = 6
"""Number of the array that holds the course of the first node."""
OWNER: Final = re.compile(r".* - (\w+)\.(\d+)\s+Area\b")
"""The comment before an array that names its node: `solar albedo planetshine - PLATE.4 Area = 0.0008`."""
_BEGIN: Final = re.compile(r"C\s+\d+\s*=")
_NUMBER: Final = re.compile(r"[-+]?[\d.]+(?:[eEdD][-+]?\d+)?")
CALL: Final = re.compile(r"F?\s*CALL\s+LOADQ(?:_(\w+)_\d+\s*$|\s*\(\s*'(\w+)')", re.IGNORECASE)
"""A call that applies the rates of a submodel."""


@dataclass(frozen=True)
class HeatRate:
    """Heat that a node absorbs: its mean and its course [the deck's unit of power]; no course in a file with means only."""

    into: tuple[str, str]
    mean: float
    course: FileCourse | None


class CommentedArrays:
    """Reader of arrays that are commented out; it remembers whether the last comment belonged to one.

    An array begins with a comment such as `C 6 = 0.0, 1.5`. The comments after it belong to it as long as they have numbers only.
    """

    def __init__(self) -> None:
        self.inside = False

    def row(self, comment: str) -> str | None:
        """Return the next comment of the file without its comment mark if it is a row of an array, else None; call it for each in order."""
        begins = _BEGIN.match(comment)
        words = re.split(r"[\s,]+", comment[begins.end() if begins else 1 :].strip(" ,"))
        self.inside = (self.inside or begins is not None) and all(_NUMBER.fullmatch(word) for word in words)
        return f" {comment[1:]}" if self.inside else None


def heat_rates(
    arrays: Mapping[int, Sequence[float]], owners: Mapping[int, tuple[str, str]], words: Sequence[str], seconds: float, where: str
) -> tuple[list[HeatRate], list[str]]:
    """Return the heat rates of a file, and the nodes that it names without a rate.

    A rate is the array's number times the scale (array 4) times the node's area (array 3), in the deck's unit of power; times (array 5)
    that begin at zero repeat after the last.

    Parameters
    ----------
    arrays : dict       Number of an array -> its numbers.
    owners : dict       Number of an array -> the node that its comment names. A file leaves out nodes that absorb nothing: then its
                        arrays do not follow the nodes of CARRAY DATA.
    words : list        CARRAY DATA in order: a submodel, then numbers of its nodes.
    seconds : float     The deck's unit of time. [s]
    where : str         Place that an error names.

    Raises
    ------
    DeckError           When an array has another length than the nodes or the times.
    """
    nodes = list(_nodes(words, where))
    scale, areas, means = arrays.get(4, [1.0]), np.array(arrays.get(3, [])), arrays.get(1)
    times = np.array(arrays.get(5, [])) * seconds
    for number, what in ((1, means), (3, areas if areas.any() else None)):
        if what is not None and len(what) != len(nodes):
            raise DeckError(
                f"array {number} has {counted(len(what), 'number')} for {counted(len(nodes), 'node')} in CARRAY DATA.",
                where,
                code="import.not-understood",
            )
    if len(scale) != 1:
        raise DeckError(f"array 4 has {counted(len(scale), 'scale')}; one for all nodes is read.", where, code="import.not-understood")
    rates, absent = [], []
    courses = {owner: arrays[number] for number, owner in owners.items()}
    if not courses and len([number for number in arrays if number >= FIRST_COURSE]) == len(nodes):
        courses = {into: arrays[FIRST_COURSE + k] for k, into in enumerate(nodes) if FIRST_COURSE + k in arrays}
    for k, into in enumerate(nodes):
        factor = scale[0] * (float(areas[k]) if areas.any() else 1.0)
        numbers = courses.get(into)
        course = None
        if numbers is not None and times.size:
            period = float(times[-1]) if times[0] == 0.0 else 0.0
            course = FileCourse(times, np.array(numbers) * factor, period, where)
        if course is not None:
            mean = means[k] * factor if means is not None else course.mean
            rates.append(HeatRate(into, mean, course if times.size > 1 else None))
        elif means is None or means[k] != 0.0:  # else it absorbs nothing
            absent.append(".".join(into))
    return rates, absent


def _nodes(words: Sequence[str], where: str) -> list[tuple[str, str]]:
    """Return the nodes that CARRAY DATA lists."""
    nodes: list[tuple[str, str]] = []
    submodel = ""
    for word in words:
        if not word.isdigit():
            submodel = word.upper()
        elif not submodel:
            raise DeckError(f"node {word} of CARRAY DATA stands before the name of its submodel.", where, code="import.not-understood")
        else:
            nodes.append((submodel, f"T{int(word)}"))
    return nodes
