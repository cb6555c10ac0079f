"""What a model says of a test before it is made: temperatures, their errors, and how large these were before anything was fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.identify.calibration import Calibration
from thermid.identify.discrepancy import misfit_kept
from thermid.identify.further import MISFIT
from thermid.identify.predict import predict
from thermid.identify.prediction import Band, Prediction
from thermid.identify.split import split, split_needed
from thermid.identify.spread import Spread
from thermid.identify.values import FittedValues
from thermid.knowledge.standing import Standing, of_model, worst
from thermid.model.model import Model
from thermid.simulation.engine import Options
from thermid.simulation.scenario import Scenario
from thermid.simulation.simulator import Simulator, prepare
from thermid.simulation.solution import Solution
from thermid.simulation.transient import simulate

__all__ = ["IN_TESTS", "Foresight", "Known", "foresee", "prior_spread", "widened"]

Array = NDArray[np.float64]
Given = Mapping[str, Any]
IN_TESTS = "misfit in tests"
"""Cause: what the model could not follow in the logs of a plan."""


@dataclass(frozen=True, eq=False)
class Known:
    """A model with what is known of its values.

    Parameters
    ----------
    model : Model                       With its best values.
    values : tuple of FittedValues      What was fitted, each with its covariance.
    fit : Calibration or None           The fit itself, where its records are at hand; then the discrepancy is counted too.
    synthetic : bool                    Whether any record behind the values was made and not measured.
    at : str                            The submodel that the values belong to; empty for the model itself.
    """

    model: Model
    values: tuple[FittedValues, ...] = ()
    fit: Calibration | None = None
    synthetic: bool = False
    at: str = ""

    @classmethod
    @takes_objects
    def of(cls, source: Model | Calibration) -> Known:
        """Return what a fit knows; of a model that nobody fitted, nothing but its values."""
        if isinstance(source, Model):
            return cls(source)
        return cls(source.fitted_model, (*source.held, source.values), source, source.synthetic)

    @property
    def misfit(self) -> dict[str, float]:
        """Node -> standard deviation of what the fit could not follow; empty where the values do not say it. [K]"""
        ahead = f"{self.at}." if self.at else ""
        found = next((m for v in reversed(self.values) if (m := misfit_kept(v))), {})
        return {ahead + n: size for n, size in found.items()}

    @property
    def standing(self) -> Standing:
        """Of the values of the model, and of the fit where it is at hand."""
        return worst([of_model(self.model), *([self.fit.standing] if self.fit is not None else [])])


@dataclass(frozen=True, eq=False)
class Foresight:
    """What is expected of one run.

    Parameters
    ----------
    scenario : Scenario
    solution : Solution     The run with the best values.
    prediction : Prediction Expected temperatures with their errors and what these come from, at the same times.
    before : dict           Node -> standard error (times,) if nothing had been fitted, the values anywhere in their ranges. [K]
    """

    scenario: Scenario
    solution: Solution
    prediction: Prediction
    before: Mapping[str, Array] = field(default_factory=dict)

    @property
    def standing(self) -> Standing:
        """Of the values that it rests on."""
        return self.prediction.standing


@takes_objects
def foresee(
    known: Known,
    scenario: Scenario,
    *,
    nodes: Sequence[str] = (),
    spread: Given | Sequence[Given] = (),
    times: Any = None,
    options: Options | None = None,
) -> Foresight:
    """Return what a model says of a scenario.

    Parameters
    ----------
    known : Known           The model and what is known of its values.
    scenario : Scenario     The test.
    nodes : sequence        Nodes to predict; all by default.
    spread : dict           What else is not known exactly: name -> standard deviation as text, as in `predict`.
    times : array           Times to store; 301 by default. [s]
    options : Options       The integrator's.
    """
    if known.fit is None:
        return _told(known, scenario, list(nodes), [spread] if isinstance(spread, Mapping) else list(spread), times, options)
    names = [*spread] if isinstance(spread, Mapping) else [n for s in spread for n in s]
    thin = split_needed(known.fit, scenario, names)
    model = split(known.fit, thin).model if thin else known.model
    solution = simulate(model, scenario, times=times, options=options)
    wanted = list(nodes) or list(solution.nodes)
    told = predict(known.fit, scenario, spread=spread, times=solution.times, nodes=wanted, options=options)
    prior = prior_spread(known.values)
    before: dict[str, Array] = {}
    if prior.names:
        ready = prepare(model, scenario, prior.names, times=solution.times, options=options)
        before = _sizes(ready, prior, wanted, ready.run(sensitivities=True))
    return Foresight(scenario, solution, told, before)


def _sizes(ready: Simulator, spread: Spread, nodes: Sequence[str], run: Solution) -> dict[str, Array]:
    """Return node -> standard error (times,) that a spread gives it. [K]"""
    found = _columns(ready, [spread], nodes, run)
    return {n: np.sqrt(np.sum(list(parts.values()), axis=0)) for n, parts in found.items()}


def prior_spread(values: Sequence[FittedValues], at: str = "") -> Spread:
    """Return how far fitted values could lie before they were fitted: their priors, or anywhere within their bounds.

    A value that had neither is left out; its error before the fit has no size.
    """
    found: dict[str, tuple[float, bool, tuple[str, ...]]] = {}
    for several in values:
        for path, v in several.parameters.items():
            low, high = v.bounds
            if v.prior is not None and np.isfinite(v.prior[1]):
                size = v.prior[1]
            elif v.log and low > 0 and np.isfinite(high):
                size = float(np.log(high / low)) / 12**0.5
            elif not v.log and np.isfinite(low) and np.isfinite(high):
                size = (high - low) / 12**0.5
            elif v.log and low >= 0 and np.isfinite(high) and v.start > 0:
                size = min(1.0, (high - low) / 12**0.5 / v.start)
            else:
                continue
            ahead = f"{at}." if at else ""
            found[ahead + path] = (size, v.log, tuple(ahead + p for p in v.also))
    names = tuple(found)
    sizes = np.array([found[n][0] for n in names])
    also = {n: found[n][2] for n in names if found[n][2]}
    return Spread("before the fit", names, np.diag(sizes**2), tuple(found[n][1] for n in names), also)


def _told(known: Known, scenario: Scenario, nodes: Sequence[str], given: Sequence[Given], times: Any, options: Options | None) -> Foresight:
    """Return what values say whose records are not at hand: their covariance, what their fit could not follow, and what is stated.

    What constant coefficients leave out needs the records. One run for all of it.
    """
    spreads = [Spread.of(v, at=known.at, cause=f"fit of {v.stage}") for v in known.values if v.parameters]
    prior = prior_spread(known.values, known.at)
    names = [n for s in (*spreads, prior) for own in s.names for n in (own, *s.also.get(own, ()))] + [n for s in given for n in s]
    ready = prepare(known.model, scenario, tuple(dict.fromkeys(names)), times=times, options=options)
    spreads += [Spread.stated(s, ready) for s in given if s]
    run = ready.run(sensitivities=bool(names))
    wanted = list(nodes) or list(run.nodes)
    parts = _columns(ready, spreads, wanted, run)
    still = np.zeros(ready.times.size)
    bands = {run[n].path: Band(run[n].path, ready.times, run[n].kelvin, still, parts[n]) for n in wanted}
    causes = {s.cause: f"what is left open of {', '.join(s.names[:4])}{' and more' if len(s.names) > 4 else ''}" for s in spreads}
    find = {n: run[n].path for n in wanted}
    told = Prediction(known.model.title, scenario.title, ready.times, bands, {}, causes, tuple(run.warnings), find, known.standing)
    seen = Foresight(scenario, run, told, _sizes(ready, prior, wanted, run) if prior.names else {})
    return widened(seen, known.misfit, MISFIT, "what the model could not follow in the records that it was fitted to")


def widened(seen: Foresight, sizes: Mapping[str, float], cause: str, words: str) -> Foresight:
    """Return what is expected with a further standard deviation for what the model could not follow.

    Nodes without a reading of their own get the root mean square of those that have one; boundaries get none. What is counted of this
    already, under another of the two causes, is not added up but the larger one taken.

    Parameters
    ----------
    seen : Foresight
    sizes : dict        Node -> standard deviation; empty for none. [K]
    cause, words : str  What it is called, and what it stands for.
    """
    if not any(sizes.values()):
        return seen
    other = float(np.sqrt(np.mean(np.square(list(sizes.values())))))
    boundaries = seen.solution._run.network.boundaries
    bands = {}
    for path, band in seen.prediction.bands.items():
        variance = 0.0 if path in boundaries else sizes.get(path, other) ** 2
        parts = dict(band.parts)
        before = parts.pop(MISFIT, np.zeros(band.times.size))
        parts |= {cause: np.full(band.times.size, variance)} if variance > float(before.max()) else {MISFIT: before}
        bands[path] = replace(band, parts=parts)
    told = replace(seen.prediction, bands=bands, causes={**seen.prediction.causes, cause: words})
    return replace(seen, prediction=told)


def _columns(ready: Simulator, spreads: Sequence[Spread], nodes: Sequence[str], run: Solution) -> dict[str, dict[str, Array]]:
    """Return node -> cause -> variance (times,) that the spreads give it. [K^2]"""
    place = {name: k for k, name in enumerate(ready.free)}
    slopes = {n: run.slopes(n) if ready.free else None for n in nodes}
    out: dict[str, dict[str, Array]] = {n: {} for n in nodes}
    for s in spreads:
        chain = np.zeros((len(place), len(s.names)))
        for k, (name, log) in enumerate(zip(s.names, s.log, strict=True)):
            for path in map(ready.canonical, (name, *s.also.get(name, ()))):
                chain[place[path], k] = ready.nominal[path] if log else 1.0
        chain = chain @ s.root()
        for n in nodes:
            known = slopes[n]
            if known is not None:
                out[n][s.cause] = out[n].get(s.cause, 0.0) + np.sum((known @ chain) ** 2, axis=1)
    return out
