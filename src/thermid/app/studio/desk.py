"""`Desk`: one stage or deck made ready for tuning by hand; values in, curves and metrics out, nothing kept.

Curves are thinned to what a screen can hold, without hiding an extreme. A record or scenario is run again with its ambient, powers,
duration, start or gas changed, beside what it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError, NameNotFoundError, ThermidError, refuse_unknown
from thermid.base.units import HOUR, ICE_POINT, Array, from_si, in_si, unit
from thermid.fit.calibration import Bench, Calibration, Problem, Sums, Unknown, in_place
from thermid.model.tree import Edit, Entry, Model, literal
from thermid.physics.finishes import FINISHES
from thermid.prediction.bands import split
from thermid.reporting.diagrams import network_map, parts_of
from thermid.reporting.looks import thinned
from thermid.simulation.runs import Scenario, Simulator, Solution, compile_network, prepare, simulate
from thermid.values.store import INPUT, LeftOut, State, Store, ValueOrigin

Window = tuple[float, float] | None
MAX_SENT_POINTS = 1200
"""Points of a curve that are sent to a page: more than a screen has columns for it."""


def _none() -> Array:
    """Return no samples."""
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class ThinnedCurve:
    """One sensor, or one node where nothing was measured, at the points that a page shows.

    Parameters
    ----------
    name, node : str            The sensor, the node that it observes.
    times : array (points,)     [s]
    simulated : array (points,) [degC]
    seen : array (seen,)        Times of the measured points. [s]
    measured : array (seen,)    Empty where nothing was measured. [degC]
    apart : array (apart,)      Times of what is left; it is thinned by itself, since its extremes lie elsewhere. [s]
    left : array (apart,)       Measured less simulated. [K]
    rmse, bias, largest, count  Of all readings, not only of the points shown. [K]
    sigma : float               Standard deviation that weighs the sensor's residuals. [K]
    """

    name: str
    node: str
    times: Array
    simulated: Array
    seen: Array = field(default_factory=_none)
    measured: Array = field(default_factory=_none)
    apart: Array = field(default_factory=_none)
    left: Array = field(default_factory=_none)
    rmse: float = math.nan
    bias: float = math.nan
    largest: float = math.nan
    count: int = 0
    sigma: float = math.nan

    def as_object(self, measured: bool) -> dict[str, Any]:
        """Return it for a page, without what was measured where that is not asked for."""
        still = ("name", "node", "seen", "measured", "count", "sigma") if measured else ()
        return {k: getattr(self, k) for k in (*still, "times", "simulated", "apart", "left", "rmse", "bias", "largest")}


@dataclass(frozen=True, eq=False)
class RunCurves:
    """All curves of one record or scenario."""

    name: str
    curves: tuple[ThinnedCurve, ...]
    remarks: tuple[str, ...] = ()


def thinned_curve(times: Array, values: Array, window: Window = None, points: int = MAX_SENT_POINTS) -> tuple[Array, Array]:
    """Return at most `points` samples of a curve that keep its lowest and highest values in every interval shown.

    Parameters
    ----------
    times, values : array (samples,)    Values may have gaps (nan), which stay; see `chart.thinned`.
    window : (begin, end)               Only this stretch, with one sample more on either side; all where none is given. [s]
    points : int                        Even; a stretch with fewer samples is returned as it is.
    """
    if window is not None:
        first = max(int(np.searchsorted(times, window[0])) - 1, 0)
        last = int(np.searchsorted(times, window[1], side="right")) + 1
        times, values = times[first:last], values[first:last]
    if times.size <= points:
        return times, values
    chosen = thinned(values, points)
    return times[chosen], values[chosen]


def texts_of(query: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Return the texts of a list that a page gives.

    Raises
    ------
    DeckError   When it is no list of texts.
    """
    several = query.get(key) or ()
    if not isinstance(several, list | tuple) or not all(isinstance(one, str) for one in several):
        raise DeckError(f"'{key}' is no list of texts.", "studio", code="value.wrong-kind")
    return tuple(several)


def text_of(query: Mapping[str, Any], key: str) -> str:
    """Return a text that a page gives; empty without one.

    Raises
    ------
    DeckError   When it is no text.
    """
    text = query.get(key, "")
    if not isinstance(text, str):
        raise DeckError(f"'{key}' must be text.", "studio", code="value.wrong-kind")
    return text


def number_of(query: Mapping[str, Any], key: str) -> float:
    """Return a number that a page gives.

    Raises
    ------
    DeckError   When it is no number, or has no end.
    """
    number = query.get(key)
    if not isinstance(number, int | float) or isinstance(number, bool) or not math.isfinite(number):
        raise DeckError(f"'{key}' is not a number.", "studio", code="value.wrong-kind")
    return float(number)


def window_of(query: Mapping[str, Any]) -> Window:
    """Return the stretch that a page shows, or None for all of it. [s]

    Raises
    ------
    DeckError   When it is no pair of times.
    """
    window = query.get("window")
    if window is None:
        return None
    if not isinstance(window, list) or len(window) != 2 or not all(isinstance(v, int | float) for v in window) or not window[0] < window[1]:
        raise DeckError("give a window as two times, the earlier first.", "studio", code="value.wrong-kind")
    return float(window[0]), float(window[1])


GASES: Final = ("air", "vacuum", "printed")


@dataclass(frozen=True)
class Conditions:
    """A model with what is done to it, and in words what was changed.

    Parameters
    ----------
    model : Model
    scenario : Scenario
    changes : tuple of str      Each with what it was and is.
    """

    model: Model
    scenario: Scenario
    changes: tuple[str, ...] = ()


def conditions_object(desk: Desk) -> dict[str, Any]:
    """Return what may be changed of the first run, as it is: temperatures at its beginning [degC], loads, duration [h], finishes."""
    model, scenario = desk.run_of(0, {})
    network = compile_network(model)
    boundaries = {n: _at_start(scenario, n) for n in network.boundaries if n in scenario.boundaries}
    return {
        "runs": desk.runs,
        "boundaries": boundaries,
        "loads": sorted(model.loads),
        "hours": scenario.seconds / HOUR,
        "finishes": sorted(FINISHES),
    }


def _at_start(scenario: Scenario, boundary: str) -> float:
    """Return the temperature of a boundary at the beginning. [degC]"""
    return float(scenario.boundaries[boundary].at(np.zeros(1))[0]) - ICE_POINT


def changed(desk: Desk, body: Mapping[str, Any]) -> Conditions:
    """Return the conditions of a run with what a page asks for in their place.

    Parameters
    ----------
    desk : Desk     Whose run it is.
    body : dict     ``run``; ``boundaries`` name -> temperature, ``factors`` load -> factor of its power, ``duration`` and ``start``, each a
                    text with its unit as the command takes it, a factor a number too; ``gas``.

    Raises
    ------
    ThermidError   When there is no such boundary, load or gas, or a value makes no sense.
    """
    model, scenario = desk.run_of(int(body.get("run", 0)), {})
    boundaries, factors = dict(body.get("boundaries") or {}), dict(body.get("factors") or {})
    refuse_unknown(boundaries, compile_network(model).boundaries, "what if", "no boundary '{}'.", NameNotFoundError)
    refuse_unknown(factors, model.loads, "what if", "no load '{}'.", NameNotFoundError)
    conditions = Conditions(model, scenario)
    for name, text in boundaries.items():
        before = f"{_at_start(scenario, name):.4g} °C at the start" if name in scenario.boundaries else "not given"
        conditions = _then(conditions, scenario=conditions.scenario.with_(boundaries={name: text}), words=f"{name}: {before}, now {text}")
    for name, factor in factors.items():
        conditions = _powered(conditions, name, literal(factor, "1", f"factors.{name}"))
    if duration := text_of(body, "duration"):
        longer = conditions.scenario.with_(duration=duration)
        held = longer.mapped(lambda s: s.held_on()) if longer.seconds > scenario.seconds else longer
        words = f"duration: {scenario.seconds / 3600:.4g} h, now {longer.seconds / 3600:.4g} h"
        words += "; what ends before keeps its last value" if held is not longer else ""
        conditions = _then(conditions, scenario=held, words=words)
    if start := text_of(body, "start"):
        conditions = _then(conditions, scenario=replace(conditions.scenario, initial={}).with_(start=start), words=f"start: now {start}")
    gas = text_of(body, "gas") or "air"
    refuse_unknown([gas], GASES, "what if", "'{}' is not one of {known}.", DeckError)
    words = {"air": "", "vacuum": "gas: none", "printed": "gas: none, every coefficient zero as printed, an upper bound"}[gas]
    return _then(conditions, words, scenario=conditions.scenario.vacuum(as_printed=gas == "printed")) if words else conditions


def _then(before: Conditions, words: str, model: Model | None = None, scenario: Scenario | None = None) -> Conditions:
    """Return conditions with another model or scenario, and what was changed in words."""
    return Conditions(model or before.model, scenario or before.scenario, (*before.changes, words))


def _powered(before: Conditions, load: str, factor: float) -> Conditions:
    """Return conditions with one power multiplied: in the scenario where it has a course, else in the deck."""
    if factor == 1.0:
        return before
    scenario, words = before.scenario, f"{load}: {factor:g} times its power"
    for table in ("loads", "commands"):
        course = getattr(scenario, table).get(load)
        if course is not None:
            return _then(before, words, scenario=scenario.with_(**{table: {load: course.scaled(factor)}}))
    parameter = before.model.parameter_table()[f"{load}.power"].parameter
    text = f"{factor!r}*({parameter.text})" if parameter.expression.literal is None else _times(parameter.text, factor)
    return _then(before, f"{words}, {parameter.text} in the deck", before.model.with_values({f"{load}.power": text}, "what if"))


def _times(text: str, factor: float) -> str:
    """Return a value with its unit, multiplied."""
    number, _, unit = text.partition("[")
    return f"{float(number) * factor!r} [{unit}"


def finished(surfaces: Sequence[str], finish: str) -> list[Edit]:
    """Return the edits that give surfaces a finish."""
    return [Edit(("surfaces", name, "finish"), finish) for name in surfaces]


def compared(desk: Desk, body: Mapping[str, Any], with_finish: Callable[[Sequence[str], str], Model]) -> dict[str, Any]:
    """Return curves as they are and with the changes; of a vacuum that is refused why, and which surfaces need a finish.

    Parameters
    ----------
    desk, body                  As in `changed`; ``split`` is a finish with which effective coefficients are taken apart for this run alone.
    with_finish : callable      Return the model with a finish on surfaces.
    """
    before = Conditions(*desk.run_of(int(body.get("run", 0)), {}))
    # surfaces whose radiation is in their coefficient, with nothing said of it
    bare = [n for n, s in before.model.surfaces.items() if "emissivity" not in s.fields]
    after = changed(desk, body)
    if finish := text_of(body, "split"):
        apart = split(with_finish(bare, finish), bare, before.scenario)
        after = _then(after, f"{', '.join(bare)} taken apart with the finish '{finish}': {apart}", model=apart.model)
    try:
        curves = {c["node"]: c for c in _curves(after)}
    except ThermidError as error:
        if body.get("gas") != "vacuum" or not bare:
            raise
        return {"refused": str(error), "surfaces": bare, "changes": after.changes}
    out = [{**c, "after": curves[c["node"]]["temperatures"], "after_times": curves[c["node"]]["times"]} for c in _curves(before)]
    return {"curves": out, "changes": after.changes}


def _curves(conditions: Conditions) -> Iterator[dict[str, Any]]:
    """Yield the course of every mass [degC]."""
    solution = simulate(conditions.model, conditions.scenario, every=conditions.scenario.seconds / (MAX_SENT_POINTS // 2))
    for node in solution.nodes:
        yield {"node": node, "times": solution.times, "temperatures": solution[node].celsius}


MIN_CURVE_POINTS = 50
"""Points of a curve that a page may ask for at least."""
TRACK_POINTS = 400
"""Points of the track of powers and boundaries."""


@dataclass(frozen=True, eq=False)
class Moment:
    """What a picture shows of one time of a run.

    Parameters
    ----------
    model : Model           What is drawn.
    temperatures : dict     Node or boundary -> temperature. [K]
    flows : dict            Conductor -> heat flow from its first end to its second. [W]
    powers : dict           Load -> power. [W]
    """

    model: Model
    temperatures: Mapping[str, float]
    flows: Mapping[str, float]
    powers: Mapping[str, float]

    def drawn(self, folded: Sequence[str] = ()) -> str:
        """Return it as SVG, submodels of these paths folded into one mass each."""
        return network_map(self.model, temperatures=self.temperatures, flows=self.flows, powers=self.powers, folded=folded, marked=True)


@dataclass(frozen=True, eq=False)
class Desk:
    """One model, or one stage of a campaign, ready for any values of its parameters.

    Parameters
    ----------
    title : str                     Of the stage or deck.
    model : Model                   As the stage has it, with inherited values.
    problem : Problem or None       The stage's records, wired; None for a deck alone.
    scenarios : tuple               What is run where nothing was measured.
    calibration : Calibration       What the stage's fit found; None before.
    """

    title: str
    model: Model
    problem: Problem | None = None
    scenarios: tuple[Scenario, ...] = ()
    calibration: Calibration | None = None

    @cached_property
    def sliders(self) -> tuple[Slider, ...]:
        """Every parameter that is a number other than zero: those that the stage frees first, then in the order of the decks.

        What a schedule of a run sets has none: it would act on the other runs alone; `scheduled` names it.
        """
        fitted = {} if self.calibration is None else {p: v for p, v in self.calibration.values.items() if v.kind == "parameter"}
        unknowns = {u.name: u for u in self.problem.unknowns if u.kind == "parameter"} if self.problem is not None else {}
        without = {*(p for u in unknowns.values() for p in u.also), *self.scheduled}
        out = []
        for path, entry in self.model.parameter_table().items():
            literal = entry.parameter.expression.literal
            if literal is None or path in without:
                continue
            value, error = (fitted[path].value, fitted[path].error) if path in fitted else (literal.value, None)
            if value != 0.0 and math.isfinite(value):
                out.append(slider_of(path, entry, value, error, unknowns.get(path)))
        return tuple(sorted(out, key=lambda s: not s.free))

    @cached_property
    def scheduled(self) -> tuple[str, ...]:
        """Parameters that a schedule of a run sets over time."""
        runs = self.scenarios if self.problem is None else tuple(e.scenario for e in self.problem.experiments)
        return tuple(dict.fromkeys(self.model.canonical(p) for run in runs for p in run.schedule))

    @cached_property
    def others(self) -> Mapping[str, Unknown]:
        """What the stage looks for beside its parameters: errors of sensors and meters, starts, values of one record."""
        return {u.name: u for u in self.problem.unknowns if u.kind != "parameter"} if self.problem is not None else {}

    def si(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return path -> value for every instance that moves with a slider, from values in the units of the sliders. [SI]

        Raises
        ------
        NameNotFoundError   When there is neither such a slider nor anything else of that name that the stage looks for.
        """
        sliders = {s.path: s for s in self.sliders}
        out: dict[str, float] = {}
        for path, value in values.items():
            if path in self.others:
                continue
            refuse_unknown([path], sliders, self.title, "no slider '{}'.", NameNotFoundError)
            out |= dict.fromkeys((path, *sliders[path].also), in_si(value, sliders[path].unit))
        return out

    def tuned(self, values: Mapping[str, float]) -> Model:
        """Return the model at values in the units of the sliders."""
        moved = {path: v for path, v in values.items() if path not in self.others}
        return self._with_sliders(self.model if self.calibration is None else self.calibration.model, moved)

    def fixed_at(self, values: Mapping[str, float], free: Collection[str]) -> Model:
        """Return the model whose parameters stand where their sliders do, but for those that a fit is about to find.

        These keep the deck's value: it is the mean of a prior that names none.
        """
        fit_values = self.calibration.values if self.calibration is not None else {}
        shown = {
            s.path: values.get(s.path, s.value) for s in self.sliders if s.path not in free and (s.path in values or s.path in fit_values)
        }
        return self._with_sliders(self.model, shown)

    def _with_sliders(self, model: Model, values: Mapping[str, float]) -> Model:
        """Return a model with values of sliders laid over it, in every instance that moves with them."""
        sliders = {s.path: s for s in self.sliders}
        refuse_unknown(values, sliders, self.title, "there is no slider '{}'.", NameNotFoundError)
        texts = {p: f"{v!r} [{sliders[path].unit}]" for path, v in values.items() for p in (path, *sliders[path].also)}
        return model.with_values(texts, "tuned by hand")

    def curves(
        self, values: Mapping[str, float], window: Window = None, runs: Collection[int] | None = None, points: int = MAX_SENT_POINTS
    ) -> tuple[RunCurves, ...]:
        """Return measured and simulated curves of records, or of scenarios where nothing was measured, as `simulate` runs them.

        Parameters
        ----------
        values : dict           Slider -> value in its unit, and what a fit found beside the sliders: name in `others` -> value [SI].
                                What is not given stands as the stage's fit found it, or as the fit would start.
        window : (begin, end)   What a page shows of them; all of it by default. Metrics are of all readings all the same. [s]
        runs : collection       Which records or scenarios; all of them by default.
        points : int            Points of a curve at most, even.

        Raises
        ------
        ThermidError   When a run cannot be finished at these values.
        """
        chosen = range(len(self.runs)) if runs is None else runs
        if self.problem is None:
            values_si = {**self._starts, **self.si(values)}
            solutions = {i: self._simulators[i].run(self._simulators[i].with_units(values_si)) for i in chosen}
            return tuple(
                RunCurves(
                    self.runs[i],
                    tuple(ThinnedCurve(n, n, *thinned_curve(s.times, s[n].celsius, window, points)) for n in self.nodes),
                    tuple(s.warnings),
                )
                for i, s in solutions.items()
            )
        return tuple(self._of_record(i, values, window, points) for i in chosen)

    @cached_property
    def boundaries(self) -> tuple[str, ...]:
        """Names of what is given from outside: gases, plates, shrouds."""
        return compile_network(self.model).boundaries

    @cached_property
    def nodes(self) -> tuple[str, ...]:
        """Paths of all nodes whose temperature a run finds."""
        return compile_network(self.model).nodes

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """Paths of all submodels."""
        return parts_of(self.model)

    def run_of(self, run: int, values: Mapping[str, float], sensors: bool = True) -> tuple[Model, Scenario]:
        """Return the model and the scenario of one run as its curves have them.

        Parameters
        ----------
        run : int       Which record or scenario.
        values : dict   As in `curves`.
        sensors : bool  Whether sensors that touch the hardware belong to the model.
        """
        model = self.tuned(values)
        if self.problem is None:
            return model, self.scenarios[run]
        fitted = self._fitted(values)
        return self.problem.bench(run, fitted).experiment.as_fitted(model, self._inputs(run, fitted), sensors)

    def moment(self, values: Mapping[str, float], run: int, time: float) -> Moment:
        """Return temperatures, heat flows and powers at a time of one run. [s]"""
        model, scenario = self.run_of(run, values)
        solution = prepare(model, scenario, times=np.unique([0.0, min(max(time, 0.0), scenario.seconds)])).run()
        last = {name: {k: float(v[-1]) for k, v in table.items()} for name, table in _tables(solution).items()}
        return Moment(model, last["temperatures"], last["flows"], last["powers"])

    def inputs_of(self, run: int) -> tuple[ThinnedCurve, ...]:
        """Return what a run is given from outside, over time: temperatures of boundaries [degC], and powers as ``W NAME`` [W]."""
        model, scenario = self.run_of(run, {})
        solution = prepare(model, scenario, every=scenario.seconds / (TRACK_POINTS // 2)).run()
        courses = {n: solution[n].celsius for n in self.boundaries} | {f"W {n}": v for n, v in solution.load_powers.items()}
        return tuple(ThinnedCurve(n.split()[-1], n, *thinned_curve(solution.times, v, None, TRACK_POINTS)) for n, v in courses.items())

    def moves(self, path: str, values: Mapping[str, float], run: int) -> dict[str, float]:
        """Return sensor -> largest change of its curve when a parameter grows by one per cent. [K]"""
        at = values.get(path, next((s.value for s in self.sliders if s.path == path), 0.0))
        before, after = (self.curves({**values, path: v}, runs=(run,))[0].curves for v in (at, 1.01 * at))
        moved = {b.name: np.interp(b.times, a.times, a.simulated) - b.simulated for b, a in zip(before, after, strict=True)}
        return {n: float(v[np.argmax(np.abs(v))]) for n, v in moved.items()}

    @cached_property
    def runs(self) -> tuple[str, ...]:
        """Titles of the records, or of the scenarios where nothing was measured."""
        return tuple(s.title for s in self.scenarios) if self.problem is None else tuple(e.record.name for e in self.problem.experiments)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        """Every path that a slider moves."""
        return tuple(dict.fromkeys(p for s in self.sliders for p in (s.path, *s.also)))

    @cached_property
    def _starts(self) -> dict[str, float]:
        """Where every path that a slider moves stands before anything was moved. [SI]"""
        return self.si({s.path: s.value for s in self.sliders})

    @cached_property
    def _simulators(self) -> tuple[Simulator, ...]:
        """One simulator for each scenario, with the values that sliders move."""
        return tuple(
            prepare(self.model, scenario, self._names, every=scenario.seconds / (MAX_SENT_POINTS // 2)) for scenario in self.scenarios
        )

    @cached_property
    def _benches(self) -> dict[int, Bench]:
        """Run -> its record, wired with everything that a slider or the fit moves; made when first asked for."""
        return {}

    def _bench(self, run: int, fitted: Array) -> Bench:
        """Return the bench of a record, its second clock where the unknowns put it."""
        assert self.problem is not None
        in_problem = self.problem.bench(run, fitted)
        cached = self._benches.get(run)
        if cached is None or cached.experiment is not in_problem.experiment:
            cached = self._benches[run] = Bench.of_experiment(in_problem.experiment, tuple(dict.fromkeys((*in_problem.free, *self._names))))
        return cached

    def _fitted(self, values: Mapping[str, float]) -> Array:
        """Return the fitted forms (unknowns,): as moved or found since, else as the stage's fit found them, else where it would start."""
        assert self.problem is not None
        si = {**self.si(values), **{name: v for name, v in values.items() if name in self.others}}
        fitted = self.calibration.fitted if self.calibration is not None else {}
        return np.array(
            [u.to_fitted(si[u.name]) if u.name in si else fitted.get(u.name, u.to_fitted(u.start)) for u in self.problem.unknowns]
        )

    def _inputs(self, run: int, fitted: Array) -> dict[str, float]:
        """Return name in the wiring of a record -> value, of all on which an unknown acts. [SI]"""
        assert self.problem is not None
        return dict(zip(self.problem.benches()[run].free, self.problem.inputs(run, fitted)[0].tolist(), strict=True))

    def _of_record(self, run: int, values: Mapping[str, float], window: Window, points: int) -> RunCurves:
        """Return the curves of one record, with starts, constant errors and powers as the fit found them."""
        problem = self.problem
        assert problem is not None
        fitted = self._fitted(values)
        bench = self._bench(run, fitted)
        values_si = {**self._starts, **self.si(values), **self._inputs(run, fitted)}
        columns, _ = bench.temperatures(np.array([values_si[n] for n in bench.free]), False, None)
        # of the stage as it is, its own statistics: what every other door prints
        statistics = None if values or self.calibration is None else self.calibration.statistics[bench.experiment.record.name]
        out = []
        for k, o in enumerate(bench.experiment.observations):
            predicted = columns[o.index, k] + _bias(problem, o.sensor, fitted)
            times = bench.experiment.times[o.index]
            residuals = o.measured - predicted
            s = Sums.of_residuals(residuals).statistics(0.0) if statistics is None else statistics[o.sensor]
            (at, simulated), (measured_at, measured), (apart, rest) = (
                thinned_curve(times, v, window, points) for v in (predicted - ICE_POINT, o.measured - ICE_POINT, residuals)
            )
            out.append(
                ThinnedCurve(
                    *(o.sensor, o.seat, at, simulated, measured_at, measured, apart, rest),
                    *(s.rmse, s.mean, abs(s.largest), s.samples, o.sigma(problem.noise)),
                )
            )
        return RunCurves(bench.experiment.record.name, tuple(out))


def curves_object(
    desk: Desk,
    values: Mapping[str, float],
    measured: bool = True,
    window: Window = None,
    runs: Collection[int] | None = None,
    points: int = MAX_SENT_POINTS,
) -> dict[str, Any]:
    """Return the curves at values of the sliders, as `Desk.curves` takes them; without what was measured where it is not asked for.

    Raises
    ------
    ThermidError    When a run is refused or cannot be finished.
    """
    curves = desk.curves(values, window, runs, min(max(points // 2 * 2, MIN_CURVE_POINTS), MAX_SENT_POINTS))
    return {"runs": [{"name": r.name, "remarks": r.remarks, "curves": [c.as_object(measured) for c in r.curves]} for r in curves]}


def _tables(solution: Solution) -> dict[str, Mapping[str, Array]]:
    """Return temperatures [K], heat flows and powers [W] over time, by name."""
    temperatures = {n: solution[n].kelvin for n in solution.nodes}
    return {"temperatures": temperatures, "flows": solution.heat_flows, "powers": solution.load_powers}


def _bias(problem: Problem, sensor: str, fitted: Array) -> float:
    """Return the constant error of a sensor. [K]"""
    places = (k for k, u in enumerate(problem.unknowns) if u.kind == "sensor" and u.name == f"sensor {sensor}")
    k = next(places, None)
    return problem.fixed_bias.get(sensor, 0.0) if k is None else float(fitted[k])


@dataclass(frozen=True)
class Slider:
    """A parameter that may be moved.

    Parameters
    ----------
    path : str              The parameter.
    unit : str              In which values and bounds are written.
    value, low, high        Where it starts and how far it may go. [unit]
    log : bool              Whether the track is logarithmic.
    free : bool             Whether the stage fits it.
    error : float or None   Standard error that the fit found. [unit]
    source, note : str      Where the value comes from.
    also : tuple of str     Other instances that move with it.
    prior : (low, high)     Two standard deviations of the prior that the fit uses; empty without one. [unit]
    deck : float            What the decks say. [unit]
    """

    path: str
    unit: str
    value: float
    low: float
    high: float
    log: bool
    free: bool = False
    error: float | None = None
    source: str = ""
    note: str = ""
    also: tuple[str, ...] = ()
    prior: tuple[float, ...] = ()
    deck: float = math.nan


def slider_of(path: str, entry: Entry, value: float, error: float | None, unknown: Unknown | None) -> Slider:
    """Return the slider of a parameter: its own bounds, or a factor of five either way where it has none."""
    parameter = entry.parameter
    of = unit(parameter.unit or "1")
    low, high = (None if b is None else from_si(b, of) for b in (parameter.minimum, parameter.maximum))
    at = from_si(value, of)
    log = at > 0 and not of.absolute and (low is None or low > 0)
    span = abs(at) if not of.absolute else 50.0
    low = low if low is not None else at / 5 if log else at - span
    high = high if high is not None else at * 5 if log else at + span
    shown = None if error is None or not math.isfinite(error) else error / float(of.factor)
    note = "; ".join(t for t in (parameter.note, parameter.basis) if t)
    prior, also = None if unknown is None else unknown.prior, () if unknown is None else unknown.also
    ends = () if prior is None or unknown is None else tuple(from_si(unknown.to_value(prior.mean + k * prior.sd), of) for k in (-2.0, 2.0))
    literal = parameter.expression.literal
    deck = at if literal is None else from_si(literal.value, of)
    where, free = parameter.source or entry.origin, unknown is not None
    return Slider(path, of.text, at, min(low, at), max(high, at), log, free, shown, where, note, also, ends, deck)


WORDS = "'{}' was set in the studio without an error"
INSTRUMENTS = ("sensor", "instrument", INPUT)
"""Kinds of unknowns that a store keeps beside parameters; what belongs to one record alone stays with it."""


def in_force(desk: Desk, values: Mapping[str, float], store: Store) -> Store:
    """Return all values in force.

    Parameters
    ----------
    desk : Desk
    values : dict   As in `Desk.curves`.
    store : Store   What the stage found and inherits.

    Raises
    ------
    NameNotFoundError   When there is neither such a slider nor anything else of that name that the stage looks for.
    """
    desk.si(values)  # refuses names that it does not know
    origin, table = ValueOrigin("hand", f"{desk.title}, by hand"), desk.model.parameter_table()
    moved = [_moved(s, values[s.path], table[s.path].deck_text, origin) for s in desk.sliders if values.get(s.path, s.value) != s.value]
    moved += [_set(u, values[n], origin) for n, u in desk.others.items() if n in values and u.kind in INSTRUMENTS]
    left_out = tuple(LeftOut(WORDS.format(s.path)) for s in moved)
    return in_place(store, Store({s.path: s for s in moved}, root=np.zeros((len(moved), 0)), left_out=left_out))


def _moved(slider: Slider, value: float, deck: str, origin: ValueOrigin) -> State:
    """Return the value of a slider, in its unit, as a state."""
    at, start, low, high = (in_si(v, slider.unit) for v in (value, slider.value, slider.low, slider.high))
    paths = (slider.path, *slider.also)
    return State(slider.path, at, slider.log, slider.unit, (low, high), origin, paths=paths, deck=deck, start=start, known=False)


def _set(unknown: Unknown, value: float, origin: ValueOrigin) -> State:
    """Return the error of an instrument as a state. [SI]"""
    bounds = (unknown.low, unknown.high)
    return State(unknown.name, value, unknown.log, unknown.unit, bounds, origin, unknown.kind, start=unknown.start, known=False)
