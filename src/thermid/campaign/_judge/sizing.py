"""The window of a design value in which limits hold with their margins: every crossing, what binds there, and how sure it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, Final

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.errors import NameNotFoundError, ScenarioError, Wait, refuse_unknown
from thermid.base.expression import amount
from thermid.base.results import Result
from thermid.base.units import counted, si_unit
from thermid.campaign._judge.limits import STATES, Limits, text_of
from thermid.fit.calibration import Calibration
from thermid.model.elements import UNJUDGED, Standing
from thermid.model.tree import Model, ParameterSet
from thermid.prediction.bands import Knowledge, known_of, predict
from thermid.simulation.runs import Scenario, simulate, steady

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
        return {
            "value": self.path,
            "unit": self.unit,
            "ends": rows,
            "best": list(self.best),
            "worst": self.worst,
            "standing": self.standing.to_dict(),
        }

    def _as_rows(self) -> list[Mapping[str, object]]:
        """Return both ends of every window with their standard errors and the limits that bind there."""
        return [
            {"end": word, "value": end.value, "error": end.error, "assured": end.assured, "by": end.by}
            for window in self.windows
            for word, end in zip(("least", "most"), window, strict=True)
        ]


@takes_objects
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
    samples = Wait("size").over(grid.tolist(), RANGE_SAMPLES, "further values of the range")
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
    """Yield the values at which a limit has nothing to spare, the turning points that samples hide among them."""
    from scipy.optimize import brentq, minimize_scalar

    points, heights = grid.tolist(), spare.tolist()
    for k in range(1, grid.size - 1):
        side = 1.0 if spare[k] > 0.0 else -1.0
        near = side * spare[k - 1 : k + 2]
        if near.min() > 0.0 and near[1] == near.min():  # it comes near zero and turns back: is it beyond between the samples?
            turn = minimize_scalar(lambda x, s=side: s * item.spare(x), bounds=(grid[k - 1], grid[k + 1]), method="bounded")
            if turn.fun < 0.0:
                points.append(float(turn.x))
                heights.append(side * float(turn.fun))
    order = np.argsort(points)
    for i, j in pairwise(order):
        if heights[i] == 0.0:
            yield points[i]
        elif heights[i] * heights[j] < 0.0:
            yield float(brentq(item.spare, points[i], points[j], xtol=CROSSING_SHARE * (grid[-1] - grid[0])))


def _best(least: Spare, grid: np.ndarray, spare: np.ndarray) -> tuple[float, float]:
    """Return the value at which the worst limit has most to spare, and how much. [K]"""
    from scipy.optimize import minimize_scalar

    k = int(np.argmax(spare))
    ends = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, grid.size - 1)])
    turn = minimize_scalar(lambda x: -least(x), bounds=ends, method="bounded", options={"xatol": CROSSING_SHARE * (grid[-1] - grid[0])})
    return max((float(turn.x), -float(turn.fun)), (float(grid[k]), float(spare[k])), key=lambda point: point[1])
