"""The worst hot and cold case within ranges of what may vary, and how much of the ranges may still be worse.

Powers and temperatures of boundaries act one way where a network is passive: more heat, or a warmer surrounding, makes no node colder
(the heat into a node rises with every other temperature; Smith, Monotone Dynamical Systems, AMS 1995, ch. 3). Their worst values are their
ends. Everything else is searched: uniform draws first, which also bound what was missed, then descents from the worst draws.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import ceil, log
from typing import Any, Final

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import ScenarioError
from thermid.base.expression import Kelvin, amount
from thermid.base.linear_algebra import Array
from thermid.base.results import Result
from thermid.base.units import TEMPERATURE, si_unit
from thermid.campaign._judge.limits import Limits, text_of
from thermid.campaign._judge.sizing import extremes
from thermid.model.elements import UNJUDGED, Standing
from thermid.model.tree import Model
from thermid.simulation.network import Network, compile_network
from thermid.simulation.runs import Scenario
from thermid.values.store import model_standing

SHARE_WORSE: Final = 0.01
"""Share of what is searched that may be worse than the result, in 95 % of searches (Wilks 1941). [-]"""
CONFIDENCE: Final = 0.95
DRAWS: Final = ceil(log(1.0 - CONFIDENCE) / log(1.0 - SHARE_WORSE))
"""Uniform draws whose worst is exceeded by that share at most: 299."""
SEARCHED_MOST: Final = 4
"""Values that are searched at most: beyond, a few hundred draws say little of where the worst is."""
DESCENTS: Final = 5
"""Worst draws and corners, apart from each other, from which a descent begins."""
MIN_CORNER_DISTANCE: Final = 0.15
"""Least distance between two of them, in a box of unit edges."""
ONE_WAY_KINDS: Final = frozenset(
    {"conduction", "contact", "convection", "gas", "effective", "radiation", "flow", "lead", "bolted", "wedge_lock", "spreading"}
)
"""Kinds of conductors whose heat rises with the temperature of one end and falls with that of the other, at all temperatures."""
Cases = Scenario | Callable[[Mapping[str, float]], Scenario]
"""What is done to the hardware; or what makes it of the values that the model does not have, such as an orbit's angle."""


@dataclass(frozen=True)
class WorstCase:
    """The values that leave a limit least.

    Parameters
    ----------
    values : dict       Name -> value. [SI]
    spare : float       What the limit has to spare; negative beyond it. [K]
    by : str            The limit.
    """

    values: Mapping[str, float]
    spare: float
    by: str


@dataclass(frozen=True)
class WorstCases(Result):
    """The worst hot and cold case.

    Parameters
    ----------
    hot, cold : WorstCase or None   Of all upper and of all lower limits; None where there is no such limit.
    units : dict                    Name -> SI unit.
    one_way : tuple                 Names that stand at an end by the corner rule.
    searched : tuple                Names that were searched.
    declined : str                  Why the corner rule does not apply; empty where it does.
    runs : int                      Runs that it took.
    standing : Standing             Of the values of the model.
    """

    hot: WorstCase | None
    cold: WorstCase | None
    units: Mapping[str, str] = field(default_factory=dict)
    one_way: tuple[str, ...] = ()
    searched: tuple[str, ...] = ()
    declined: str = ""
    runs: int = 0
    standing: Standing = UNJUDGED

    def __str__(self) -> str:
        """Return both cases, then how they were found and what may have been missed."""
        lines = []
        for word, case in (("hot", self.hot), ("cold", self.cold)):
            if case is not None:
                units = {name: "" if unit == "1" else unit for name, unit in self.units.items()}
                shown = {n: text_of(v) if units[n] == "K" else f"{v:.6g} {units[n]}".rstrip() for n, v in case.values.items()}
                values = ", ".join(f"{name} {text}" for name, text in shown.items())
                spare = f"{case.spare:.3f} K left" if case.spare >= 0.0 else f"VIOLATED by {-case.spare:.3f} K"
                lines.append(f"{word}: {spare}, {case.by}: {values}")
        if self.declined:
            lines.append(f"  the corner rule does not apply: {self.declined}")
        elif self.one_way:
            lines.append(f"  at their ends, because the network is passive: {', '.join(self.one_way)}")
        if self.searched:
            lines.append(
                f"  searched in {self.runs} runs: {', '.join(self.searched)}; in {100 * CONFIDENCE:.0f} % of such searches at most "
                f"{100 * SHARE_WORSE:.0f} % of their ranges is worse"
            )
        return self.standing.over("\n".join(lines))

    def _as_rows(self) -> list[Mapping[str, object]]:
        """Return the hot and the cold case: what is spare to the limit [K], where, and the values that make it."""
        cases = [(word, case) for word, case in (("hot", self.hot), ("cold", self.cold)) if case is not None]
        return [{"case": word, "spare_K": case.spare, "by": case.by, **case.values} for word, case in cases]

    def to_dict(self) -> dict[str, Any]:
        """Return it for a file."""
        bound = {"share_worse": SHARE_WORSE, "confidence": CONFIDENCE} if self.searched else {}
        search = {"one_way": [*self.one_way], "searched": [*self.searched], "declined": self.declined, "runs": self.runs}
        return {"cases": self._as_rows(), "units": dict(self.units), "standing": self.standing.to_dict()} | search | bound


@takes_objects
def worst_case(
    model: Model,
    limits: Sequence[Limits],
    scenario: Cases,
    ranges: Mapping[str, tuple[Any, Any]],
    *,
    runs: int = 2000,
    seed: int = 0,
) -> WorstCases:
    """Return the values within ranges at which operating limits have least to spare: the worst hot case and the worst cold case.

    A scenario with a duration is run, and its extremes count; one without is settled. Names of ranges are boundaries, loads (a constant
    power in place of the scenario's), values of the model, or, where `scenario` is a function, values that it takes.

    Parameters
    ----------
    model : Model           What the hardware is.
    limits : sequence       As from `load_limits`; those of the state operating.
    scenario : Scenario     What is done to it; or a function of the values that the model does not have.
    ranges : dict           Name -> (low, high), as texts with unit, values with theirs, or numbers in SI; of a temperature with its unit.
    runs : int              Runs for both cases together, at least twice the 299 draws.
    seed : int              Of the draws.

    Raises
    ------
    ScenarioError   Without a limit, for an empty or unknown range, and for more than four values to search.
    RecordError     When an end of a range is no amount.
    UnitError       When its unit has another dimension, or a temperature has none.
    SolverError     When a run does not come out.
    """
    if runs < 2 * DRAWS:
        raise ScenarioError(
            f"{runs} runs are fewer than the {2 * DRAWS} draws that bound what is missed.", "runs", code="value.outside-range"
        )
    task = _Ranges(model, scenario, ranges, limits)
    if len(task.searched) > SEARCHED_MOST:
        why = f" The corner rule does not apply: {task.declined}." if task.declined else ""
        raise ScenarioError(
            f"{len(task.searched)} values would be searched; {SEARCHED_MOST} at most.{why}",
            ", ".join(task.searched),
            code="value.outside-range",
        )
    hot, cold = (task.worst(upper, runs // 2, seed) for upper in (True, False))
    if hot is None and cold is None:
        raise ScenarioError("no operating limit is finite. Give a lower one, an upper one, or both.", "limits", code="value.incomplete")
    return WorstCases(hot, cold, task.units, task.one_way, task.searched, task.declined, task.count, model_standing(model))


class _Ranges:
    """What may vary, by how it acts, and the runs at its values."""

    def __init__(self, model: Model, scenario: Cases, ranges: Mapping[str, tuple[Any, Any]], limits: Sequence[Limits]) -> None:
        self.model, self.scenario, self.limits, self.count = model, scenario, limits, 0
        network = compile_network(model)
        self.boundaries = {name for name in ranges if name in network.boundaries}
        self.loads = {load.path for load in network.flat.loads}.intersection(ranges)
        direct = {*self.boundaries, *self.loads}
        powers = {path for load in network.flat.loads for slot, path in load.fields.items() if slot == "power"}
        table = network.flat.parameters
        self.units = {
            name: "K" if name in self.boundaries else "W" if name in self.loads else si_unit(table.dimension(name))
            for name in ranges
            if name in direct or name in table.table
        }
        foreign = [name for name in ranges if name not in self.units]
        if foreign and isinstance(scenario, Scenario):
            raise ScenarioError("it is no boundary, load or value of the model.", foreign[0], code="name.unknown")
        self.units |= dict.fromkeys(foreign, "1")
        self.foreign = tuple(foreign)
        self.ends = {name: self._ends(name, pair) for name, pair in ranges.items()}
        self.declined = _not_passive(network)
        acts = {name for name in ranges if name in direct or name in powers}
        self.one_way = tuple(name for name in ranges if name in acts and not self.declined)
        self.searched = tuple(name for name in ranges if name not in self.one_way)

    def _ends(self, name: str, pair: tuple[Any, Any]) -> tuple[float, float]:
        """Return a range. [SI]"""
        slot = TEMPERATURE if name in self.boundaries else self.units[name]
        low, high = (amount(end, slot, f"ranges, {name}") for end in pair)
        if not low < high:
            raise ScenarioError(
                "the range is empty: its lower end is not below its upper one.", f"ranges, {name}", code="value.outside-range"
            )
        return low, high

    def worst(self, upper: bool, runs: int, seed: int) -> WorstCase | None:
        """Return the worst case of one side of all limits."""
        if not any(np.isfinite(limits.operating[upper]) for limits in self.limits):
            return None
        ends = {name: self.ends[name][upper] for name in self.one_way}

        def values(x: Array) -> dict[str, float]:
            """Return name -> value at a point (searched,) of the unit cube, 0 at the lower end and 1 at the upper."""
            between = {name: float(a + (b - a) * s) for (name, s) in zip(self.searched, x, strict=True) for a, b in (self.ends[name],)}
            return {name: (ends | between)[name] for name in self.ends}

        point = searched_worst(lambda x: min(spare for spare, _ in self._spares(values(x), upper)), len(self.searched), runs, seed)
        spare, by = min(self._spares(values(point), upper))
        return WorstCase(values(point), spare, by)

    def _spares(self, values: Mapping[str, float], upper: bool) -> Iterator[tuple[float, str]]:
        """Yield what each limit of one side has to spare, and its name. [K]"""
        self.count += 1
        case = self.scenario if isinstance(self.scenario, Scenario) else self.scenario({name: values[name] for name in self.foreign})
        boundaries = {**case.boundaries, **{name: Kelvin(values[name]) for name in self.boundaries}}
        loads = {**case.loads, **{name: f"{values[name]!r} [W]" for name in self.loads}}
        others = [name for name in values if name not in {*self.boundaries, *self.loads, *self.foreign}]
        model = self.model.with_values({name: f"{values[name]!r} [{self.units[name]}]" for name in others})
        reached = extremes(model, case.with_(boundaries=boundaries, loads=loads))
        for limits in self.limits:
            limit = float(limits.operating[upper])
            if np.isfinite(limit):
                low, high = reached[self.model.canonical(limits.node)]
                yield (limit - high if upper else low - limit), f"{limits.point} {'most' if upper else 'least'} {text_of(limit)}"


def _not_passive(network: Network) -> str:
    """Return what may make a node colder as more heat comes; empty in a passive network."""
    flat = network.flat
    for load in flat.loads:
        if (
            (load.sensor and load.sensor != load.node)
            or load.controls
            or any(slot.startswith(("thermostat", "prop")) for slot in load.fields)
        ):
            return f"{load.path} is controlled"
    if flat.controls:
        return f"{next(iter(flat.controls))} is a control"
    for conductor in flat.conductors:
        if conductor.kind not in ONE_WAY_KINDS or conductor.curve is not None or conductor.controls:
            return f"the heat of {conductor.path} ({conductor.kind}) need not rise with the temperature of its end"
    return ""


def searched_worst(spare: Callable[[Array], float], size: int, runs: int, seed: int) -> Array:
    """Return the point (size,) of a box of unit edges at which a function is least, of as many evaluations at most.

    `DRAWS` uniform draws and the corners come first; then descents of the simplex of Nelder and Mead (1965) from the worst of them that lie
    apart.
    """
    from scipy.optimize import minimize

    if size == 0:
        return np.empty(0)
    draws = np.random.default_rng(seed).uniform(size=(DRAWS, size))
    points = np.vstack([draws, np.array(list(product((0.0, 1.0), repeat=size)))])
    heights = np.array([spare(x) for x in points])
    starts: list[int] = []
    for k in np.argsort(heights):
        if len(starts) < DESCENTS and all(np.abs(points[k] - points[j]).max() > MIN_CORNER_DISTANCE for j in starts):
            starts.append(int(k))
    best, least = points[starts[0]], float(heights[starts[0]])
    for k in starts:
        simplex = np.clip(points[k] + MIN_CORNER_DISTANCE * np.vstack([np.zeros(size), np.eye(size)]), 0.0, None)
        simplex = np.where(simplex > 1.0, points[k] - MIN_CORNER_DISTANCE, simplex)
        most = max((runs - points.shape[0]) // len(starts), 0)
        if most <= size + 1:
            continue
        options: Any = {"maxfev": most, "initial_simplex": simplex}
        descent = minimize(spare, points[k], method="Nelder-Mead", bounds=[(0.0, 1.0)] * size, options=options)
        if descent.fun < least:
            best, least = descent.x, float(descent.fun)
    return np.asarray(best)
