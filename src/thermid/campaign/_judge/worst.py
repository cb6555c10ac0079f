"""The worst hot and cold case within ranges of what may vary, and how much of the ranges may still be worse.

Powers and temperatures of boundaries act one way where a network is passive: more heat, or a warmer surrounding, makes no node colder
(the heat into a node rises with every other temperature; Smith, Monotone Dynamical Systems, AMS 1995, ch. 3). Their worst values are their
ends. Everything else is searched: uniform draws first, which also bound what was missed, then descents from the worst draws.

The window of a design value in which limits hold with their margins: every crossing, what binds there, and how sure it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product
from math import ceil, log
from typing import Any, Final

import numpy as np

from thermid.base.errors import NameNotFoundError, ScenarioError, refuse_unknown, with_time_left
from thermid.base.results import Result
from thermid.base.units import TEMPERATURE, Array, Kelvin, amount, counted, si_unit
from thermid.campaign._judge.limits import STATES, Limits, text_of
from thermid.fit.calibration import Calibration
from thermid.model.tree import UNJUDGED, Model, ParameterSet, Standing
from thermid.prediction.bands import Knowledge, known_of, predict
from thermid.simulation.runs import Network, Scenario, compile_network, simulate, steady

RANGE_SAMPLES: Final = 33
"""Values of the range at which every limit is evaluated before its crossings are sought between them."""
CROSSING_SHARE: Final = 1e-9
"""Share of the range to which a crossing is found."""
ONE_SIDED: Final = 1.6448536269514722
"""Standard errors that a normal variable stays below in 95 %."""
Spare = Callable[[float], float]
"""What a limit has to spare at a value: positive where it holds with its margin. [K]"""


@dataclass(frozen=True)
class Bound:
    """One end of a window.

    Parameters
    ----------
    value : float       [SI]
    by : str            The limit that binds there: scenario, point, side; or that the range ends.
    error : float       Standard error of the value by what is not known exactly; nan where nothing is. [SI]
    assured : float     The value, further inside the window, at which this limit holds in 95 % of what is not known exactly; nan without
                        an error. [SI]
    """

    value: float
    by: str
    error: float = float("nan")
    assured: float = float("nan")


@dataclass(frozen=True)
class Sizing(Result):
    """Where a design value meets its limits.

    Parameters
    ----------
    path, unit : str        The value and its SI unit.
    searched : (low, high)  [SI]
    windows : tuple         Of (`Bound`, `Bound`), from the least value on; none where no value meets all limits.
    best : (value, spare)   Where the worst limit has most to spare [SI], [K]; negative where none meets all: the least violation.
    worst : str             The limit that is worst there.
    standing : Standing     Of the values that it rests on.
    """

    path: str
    unit: str
    searched: tuple[float, float]
    windows: tuple[tuple[Bound, Bound], ...]
    best: tuple[float, float]
    worst: str
    standing: Standing = UNJUDGED

    def __str__(self) -> str:
        """Return it as text, a line an end."""
        value, spare = self.best
        lines = [f"{self.path}: {counted(len(self.windows), 'window')} within {self.searched[0]:.6g} .. {self.searched[1]:.6g} {self.unit}"]
        if len(self.windows) == 1:
            lines = [f"{self.path}: {self.windows[0][0].value:.6g} .. {self.windows[0][1].value:.6g} {self.unit}"]
        if not self.windows:
            lines = [f"{self.path}: NO VALUE meets every limit; least violation {-spare:.3f} K at {value:.6g} {self.unit}, {self.worst}"]
        for window in self.windows:
            for word, end in zip(("least", "most"), window, strict=True):
                error = f" +- {end.error:.2g}, in 95 %: {end.assured:.6g}" if np.isfinite(end.error) else ""
                lines.append(f"  {word} {end.value:.6g} {self.unit}{error}: {end.by}")
            if window[0].assured > window[1].assured:
                lines.append("  no value holds at both ends in 95 %: the window is narrower than the errors of its ends")
        return self.standing.over("\n".join(lines))

    def to_dict(self) -> dict[str, Any]:
        """Return it for a file."""
        rows = [{key: None if value != value else value for key, value in row.items()} for row in self._as_rows()]
        least = {"best": list(self.best), "worst": self.worst, "standing": self.standing.to_dict()}
        return {"value": self.path, "unit": self.unit, "ends": rows, **least}

    def _as_rows(self) -> list[Mapping[str, object]]:
        """Return both ends of every window with their standard errors and the limits that bind there."""
        return [
            {"end": word, "value": end.value, "error": end.error, "assured": end.assured, "by": end.by}
            for window in self.windows
            for word, end in zip(("least", "most"), window, strict=True)
        ]


def size(
    knowledge: Calibration | Knowledge | Model,
    path: str,
    limits: Sequence[Limits],
    scenarios: Sequence[Scenario] | Mapping[str, Sequence[Scenario]],
    *,
    between: tuple[Any, Any] | None = None,
    margin: float = 0.0,
    spread: Any = (),
) -> Sizing:
    """Return where a design value meets limits with a margin in every scenario.

    A scenario with a duration is run, and its extremes count; one without is settled with the inputs of its beginning. The range is
    sampled; crossings are found between samples, and where a limit comes near and turns back its turning point is found first. Errors of
    the ends are those of the temperature that binds, over its slope.

    Parameters
    ----------
    knowledge : Calibration, Knowledge, Model   What is known; of a fit or its knowledge the ends have errors.
    path : str                  The value: an area, conductance, power, duty, emissivity or mass flow.
    limits : sequence           As from `load_limits`.
    scenarios : sequence        All of the state operating; or state -> scenarios: ``{"operating": [hot], "non-operating": [cold]}``.
    between : (low, high)       Range, as numbers in SI or texts with unit; the bounds of the value in the deck by default.
    margin : float              What must be left to each limit. [K]
    spread : dict, Spread       What else is not known exactly, as in `predict`.

    Raises
    ------
    ScenarioError   Without a range, a limit or a scenario.
    SolverError     When a run does not come out.
    """
    source = known_of(knowledge)
    task = _Task(source.model, source.model.canonical(path), margin)
    low, high = task.searched(between)
    items = list(_items(task, limits, scenarios))
    if not items:
        raise ScenarioError("no limit applies to a scenario. Give limits of the state of the scenarios.", path, code="value.incomplete")
    grid = np.linspace(low, high, RANGE_SAMPLES)
    samples = with_time_left(grid.tolist(), RANGE_SAMPLES, "size", "further values of the range")
    spare = np.array([[item.spare(x) for item in items] for x in samples]).T
    ends = [(x, item) for item, row in zip(items, spare, strict=True) for x in _crossings(item, grid, row)]
    edges: list[tuple[float, _LimitSide | None]] = [(low, None), *sorted(ends, key=lambda end: end[0]), (high, None)]
    least: Spare = lambda x: min(item.spare(x) for item in items)  # noqa: E731
    windows: list[list[tuple[float, _LimitSide | None]]] = []
    for a, b in pairwise(edges):
        if b[0] <= a[0] or least(0.5 * (a[0] + b[0])) < 0.0:
            continue
        if windows and windows[-1][1][0] == a[0]:
            windows[-1][1] = b  # a limit that only touches
        else:
            windows.append([a, b])
    value, spare_there = _best(least, grid, spare.min(axis=0))
    worst = min(items, key=lambda item: item.spare(value))
    windows_found = tuple(
        (task.bound(a, 1.0, source, spread, high - low), task.bound(b, -1.0, source, spread, high - low)) for a, b in windows
    )
    return Sizing(task.path, task.unit, (low, high), windows_found, (value, spare_there), str(worst), source.standing)


def extremes(model: Model, scenario: Scenario) -> Mapping[str, tuple[float, float]]:
    """Return node -> its lowest and highest temperature in a run, or the steady one of a scenario without a duration. [K]"""
    if scenario.seconds > 0.0:
        run = simulate(model, scenario)
        return {n: (float(run[n].kelvin.min()), float(run[n].kelvin.max())) for n in run.nodes}
    return {n: (t, t) for n, t in steady(model, scenario).items()}


class _Task:
    """The model with one value laid over it, and its extremes in scenarios, each computed once."""

    def __init__(self, model: Model, path: str, margin: float) -> None:
        values = ParameterSet(model)
        refuse_unknown([path], values.table, model.title, "no value '{}'.", NameNotFoundError)
        self.model, self.path, self.margin = model, path, margin
        self.parameter, self.unit = values.bounded(path), si_unit(values.dimension(path))
        self._kept: dict[tuple[int, float], Mapping[str, tuple[float, float]]] = {}

    def searched(self, between: tuple[Any, Any] | None) -> tuple[float, float]:
        """Return the range. [SI]"""
        deck = ParameterSet(self.model).table[self.path].parameter
        deck = deck if deck.is_range else self.parameter
        ends = between if between is not None else (deck.minimum, deck.maximum)
        low, high = (np.nan if end is None else amount(end, self.unit, f"between, {self.path}") for end in ends)
        if not low < high:
            raise ScenarioError(
                "the range is missing or empty. Give between=(low, high), or min and max in the deck.", self.path, code="value.incomplete"
            )
        return low, high

    def at(self, x: float) -> Model:
        """Return the model at a value."""
        return self.model.with_values({self.path: f"{float(x)!r} [{self.unit}]"})

    def extremes(self, scenario: Scenario, x: float) -> Mapping[str, tuple[float, float]]:
        """Return node -> its lowest and highest temperature in a scenario, at a value. [K]"""
        key = (id(scenario), x)
        if key not in self._kept:
            self._kept[key] = extremes(self.at(x), scenario)
        return self._kept[key]

    def bound(self, end: tuple[float, _LimitSide | None], inward: float, source: Knowledge, spread: Any, width: float) -> Bound:
        """Return one end of a window. Its standard error is that of the extreme temperature over the slope dT/dx of what is to spare.

        Parameters
        ----------
        end : (value [SI], limit)   The limit that is met there; None where the searched range ends, which has no error.
        inward : float              1 at the low end, -1 at the high end: towards the inside, where the limit holds with 95 %. [-]
        source, spread              As in `predict`; without values and spread there is no error.
        width : float               Of the searched range; the slope is a central difference over 1e-4 of it either way. [SI]
        """
        x, item = end
        if item is None:
            return Bound(x, "the range ends there")
        if not (source.values or spread):
            return Bound(x, str(item))
        step = 1e-4 * width
        slope = (item.spare(x + step) - item.spare(x - step)) / (2.0 * step)
        runs = item.scenario.seconds > 0.0
        lasting = item.scenario if runs else item.scenario.with_(duration="1 [s]", start="steady")
        band = predict(source, lasting, model=self.at(x), spread=spread, nodes=[item.node])[item.node]
        k = int(np.argmax(band.simulated) if item.upper else np.argmin(band.simulated))
        error = float(band.error[k]) / abs(slope)
        return Bound(x, str(item), error, x + inward * ONE_SIDED * error)


@dataclass(frozen=True, eq=False)
class _LimitSide:
    """One side of a limit in one scenario."""

    task: _Task
    scenario: Scenario
    state: str
    point: str
    node: str
    upper: bool
    limit: float

    def __str__(self) -> str:
        """Return scenario, point, side."""
        return f"{self.point} {'most' if self.upper else 'least'} {text_of(self.limit)} ({self.state}), {self.scenario.title}"

    def spare(self, x: float) -> float:
        """Return what the limit has to spare at a value, beyond the margin. [K]"""
        low, high = self.task.extremes(self.scenario, x)[self.node]
        return (self.limit - high if self.upper else low - self.limit) - self.task.margin


def _items(task: _Task, limits: Sequence[Limits], scenarios: Sequence[Scenario] | Mapping[str, Sequence[Scenario]]) -> Iterator[_LimitSide]:
    """Yield every side of every limit in every scenario of its state."""
    by_state = scenarios if isinstance(scenarios, Mapping) else {"operating": scenarios}
    refuse_unknown(by_state, STATES, "scenarios", "no state '{}'; there are {known}.", ScenarioError)
    for state, several in by_state.items():
        for scenario, one in product(several, limits):
            for upper, end in enumerate(one.ends(state) or ()):
                if np.isfinite(end):
                    yield _LimitSide(task, scenario, state, one.point, task.model.canonical(one.node), bool(upper), float(end))


def _crossings(item: _LimitSide, grid: np.ndarray, spare: np.ndarray) -> Iterator[float]:
    """Yield the values at which a limit has nothing to spare, by Brent's method to `CROSSING_SHARE` of the grid's length.

    Between the samples it looks for turning points where the margin comes near zero and turns back.

    Parameters
    ----------
    grid : array (points,)      Values of the quantity that varies, rising.
    spare : array (points,)     Margin to the limit at each. [K]
    """
    from scipy.optimize import brentq, minimize_scalar

    points, heights = grid.tolist(), spare.tolist()
    for k in range(1, grid.size - 1):
        side = 1.0 if spare[k] > 0.0 else -1.0
        near = side * spare[k - 1 : k + 2]
        if 0.0 < near[1] == near.min() < near.max():  # it comes near zero and turns back: is it beyond between the samples?
            turn = minimize_scalar(lambda x, s=side: s * item.spare(x), bounds=(grid[k - 1], grid[k + 1]), method="bounded")
            if turn.fun < 0.0:
                points.append(float(turn.x))
                heights.append(side * float(turn.fun))
    for i, j in pairwise(np.argsort(points)):
        if heights[i] == 0.0:
            yield points[i]
        elif heights[i] * heights[j] < 0.0:
            yield float(brentq(item.spare, points[i], points[j], xtol=CROSSING_SHARE * (grid[-1] - grid[0])))


def _best(least: Spare, grid: np.ndarray, spare: np.ndarray) -> tuple[float, float]:
    """Return the value at which the worst limit has most to spare, and how much. [K]

    The best of `grid` (points,), where `spare` (points,) is what `least` gives [K], then Brent's search between its neighbours.
    """
    from scipy.optimize import minimize_scalar

    k = int(np.argmax(spare))
    ends = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, grid.size - 1)])
    turn = minimize_scalar(lambda x: -least(x), bounds=ends, method="bounded", options={"xatol": CROSSING_SHARE * (grid[-1] - grid[0])})
    return max((float(turn.x), -float(turn.fun)), (float(grid[k]), float(spare[k])), key=lambda point: point[1])


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
        search = {"one_way": list(self.one_way), "searched": list(self.searched), "declined": self.declined, "runs": self.runs}
        return {"cases": self._as_rows(), "units": dict(self.units), "standing": self.standing.to_dict()} | search | bound


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
    return WorstCases(hot, cold, task.units, task.one_way, task.searched, task.declined, task.count, model.standing)


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
    """Return the point (size,) of a box of unit edges at which a function is least, by about `runs` evaluations at most.

    `DRAWS` uniform draws and the corners come first; then descents of the simplex of Nelder and Mead (1965) from the worst of them that
    lie `MIN_CORNER_DISTANCE` apart, which share what is left.

    Parameters
    ----------
    spare : callable    Point (size,) -> what is to spare. [K]
    seed : int          Of the draws.
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
