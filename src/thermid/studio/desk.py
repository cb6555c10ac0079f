"""`Desk`: one stage or deck made ready for tuning by hand; values in, curves and metrics out, nothing kept."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermid.errors import NameNotFoundError, nearest
from thermid.identify.calibration import Calibration
from thermid.identify.residuals import Problem
from thermid.identify.wired import Bench
from thermid.model.model import Model
from thermid.model.resolve import parameter_table
from thermid.network.network import compile_network
from thermid.reporting.diagram import diagram
from thermid.reporting.folding import parts_of
from thermid.simulation.scenario import Scenario
from thermid.simulation.simulator import Simulator, prepare
from thermid.simulation.solution import Solution
from thermid.studio.curves import POINTS, Curve, RunCurves, Window, thinned
from thermid.studio.sliders import Slider, slider_of
from thermid.units import unit

__all__ = ["Desk"]

Array = NDArray[np.float64]
ICE = 273.15


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
        """Every parameter that is a number other than zero: those that the stage frees first, then in the order of the decks."""
        found = {} if self.calibration is None else {p: v for p, v in self.calibration.values.items() if v.kind == "parameter"}
        unknowns = {u.name: u for u in self.problem.unknowns if u.kind == "parameter"} if self.problem is not None else {}
        shared = {p for u in unknowns.values() for p in u.also}
        out = []
        for path, entry in parameter_table(self.model).items():
            literal = entry.parameter.expression.literal
            if literal is None or path in shared:
                continue
            value, error = (found[path].value, found[path].error) if path in found else (literal.value, None)
            if value != 0.0 and math.isfinite(value):
                unknown = unknowns.get(path)
                out.append(slider_of(path, entry, value, error, unknown is not None, unknown.also if unknown is not None else ()))
        return tuple(sorted(out, key=lambda s: not s.free))

    def si(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return path -> value for every instance that moves with a slider, from values in the units of the sliders. [SI]

        Raises
        ------
        NameNotFoundError   When there is no such slider.
        """
        known = {s.path: s for s in self.sliders}
        out: dict[str, float] = {}
        for path, value in values.items():
            if path not in known:
                raise NameNotFoundError(f"no slider '{path}'.{nearest(path, known)}", self.title)
            of = unit(known[path].unit)
            out |= dict.fromkeys((path, *known[path].also), value * float(of.factor) + float(of.offset))
        return out

    def tuned(self, values: Mapping[str, float]) -> Model:
        """Return the model at values in the units of the sliders."""
        units = {s.path: s for s in self.sliders}
        held = self.calibration.fitted_model if self.calibration is not None else self.model
        given = {p: f"{v!r} [{units[path].unit}]" for path, v in values.items() for p in (path, *units[path].also)}
        return held.with_values(given, "tuned by hand")

    def curves(self, values: Mapping[str, float], window: Window = None) -> tuple[RunCurves, ...]:
        """Return measured and simulated curves of every record, or of every scenario where nothing was measured.

        Parameters
        ----------
        values : dict           Slider -> value in its unit; the fit's, or the deck's, where none is given.
        window : (begin, end)   What a page shows of them; all of it by default. Metrics are of all readings all the same. [s]

        Raises
        ------
        ThermidError   When a run cannot be finished at these values.
        """
        si = self.si(values)
        if self.problem is None:
            return tuple(_of_scenario(simulator, si, window) for simulator in self._simulators)
        return tuple(self._of_record(i, bench, si, window) for i, bench in enumerate(self._benches))

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

    def without_gas(self, values: Mapping[str, float], as_printed: bool) -> dict[str, tuple[Curve, ...]]:
        """Return run -> the same curves in vacuum, or with every coefficient zero as the source document prints it.

        Raises
        ------
        ThermidError   When a coefficient holds radiation that nobody has split off, or a run cannot be finished.
        """
        model, out = self.tuned(values), {}
        for title, scenario, nodes in self.conditions:
            simulator = prepare(model, scenario.vacuum(as_printed), every=scenario.seconds / (POINTS // 2))
            out[title] = _curves_of(simulator.run(), nodes or simulator.wiring.network.nodes)
        return out

    def drawn(self, values: Mapping[str, float], run: int, time: float | None, folded: Sequence[str]) -> str:
        """Return the model as SVG, with temperatures and heat flows at a time of one of its runs.

        Parameters
        ----------
        values : dict       Slider -> value in its unit.
        run : int           Which record or scenario.
        time : float        Since its beginning; None for the plain picture. [s]
        folded : sequence   Submodels drawn as one mass.
        """
        model = self.tuned(values)
        if time is None or not 0 <= run < len(self.conditions):
            return diagram(model, folded=folded, marked=True)
        scenario = self.conditions[run][1]
        at = min(max(time, 0.0), scenario.seconds)
        solution = prepare(model, scenario, times=np.unique([0.0, at])).run()
        temperatures = {n: float(solution[n].kelvin[-1]) for n in solution.nodes}
        flows = {c: float(q[-1]) for c, q in solution.heat_flows.items()}
        return diagram(model, temperatures=temperatures, flows=flows, folded=folded, marked=True)

    @cached_property
    def conditions(self) -> tuple[tuple[str, Scenario, tuple[str, ...]], ...]:
        """Title, scenario and nodes shown of every run."""
        if self.problem is None:
            return tuple((s.title, s, ()) for s in self.scenarios)
        return tuple((e.record.name, e.bare, tuple(o.seat for o in e.observations)) for e in self.problem.experiments)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        """Every path that a slider moves."""
        return tuple(dict.fromkeys(p for s in self.sliders for p in (s.path, *s.also)))

    @cached_property
    def _starts(self) -> dict[str, float]:
        """Where every path that a slider moves stands before anything was moved. [SI]"""
        return self.si({s.path: s.value for s in self.sliders})

    @cached_property
    def _benches(self) -> tuple[Bench, ...]:
        assert self.problem is not None
        return tuple(Bench.of(b.experiment, tuple(dict.fromkeys((*b.free, *self._names)))) for b in self.problem.benches())

    @cached_property
    def _simulators(self) -> tuple[Simulator, ...]:
        return tuple(prepare(self.model, scenario, self._names, every=scenario.seconds / (POINTS // 2)) for scenario in self.scenarios)

    def _of_record(self, i: int, bench: Bench, si: Mapping[str, float], window: Window) -> RunCurves:
        """Return the curves of one record, with starts, constant errors and powers as the fit found them."""
        problem = self.problem
        assert problem is not None
        fitted = _start(problem) if self.calibration is None else np.array(list(self.calibration.fitted.values()))
        held = dict(zip(problem.benches()[i].free, problem.inputs(i, fitted)[0], strict=True))
        given = {**self._starts, **held, **si}
        columns, _ = bench.temperatures(np.array([given[n] for n in bench.free]), False, problem.options)
        out = []
        for k, o in enumerate(bench.experiment.observations):
            predicted = columns[o.index, k] + _bias(problem, o.sensor, fitted)
            times = bench.experiment.times[o.index]
            left = o.measured - predicted
            rmse, bias, largest = float(np.sqrt(np.mean(left**2))), float(left.mean()), float(np.abs(left).max())
            (at, simulated), (seen, measured), (apart, rest) = (
                thinned(times, v, window) for v in (predicted - ICE, o.measured - ICE, left)
            )
            out.append(Curve(o.sensor, o.seat, at, simulated, seen, measured, apart, rest, rmse, bias, largest, int(left.size)))
        return RunCurves(bench.experiment.record.name, tuple(out))


def _of_scenario(simulator: Simulator, si: Mapping[str, float], window: Window) -> RunCurves:
    """Return the curves of a scenario, those of every mass."""
    solution = simulator.run(dict(si))
    return RunCurves(
        simulator.wiring.scenario.title, _curves_of(solution, simulator.wiring.network.nodes, window), tuple(solution.warnings)
    )


def _curves_of(solution: Solution, nodes: Sequence[str], window: Window = None) -> tuple[Curve, ...]:
    return tuple(Curve(n, n, *thinned(solution.times, solution[n].celsius, window)) for n in nodes)


def _start(problem: Problem) -> Array:
    """Return the fitted forms (unknowns,) at which a fit would start."""
    return np.array([u.to_fitted(u.start) for u in problem.unknowns])


def _bias(problem: Problem, sensor: str, fitted: Array) -> float:
    """Return the constant error of a sensor. [K]"""
    places = (k for k, u in enumerate(problem.unknowns) if u.kind == "sensor" and u.name == f"sensor {sensor}")
    k = next(places, None)
    return problem.fixed_bias.get(sensor, 0.0) if k is None else float(fitted[k])
