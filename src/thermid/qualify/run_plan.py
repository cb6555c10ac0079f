"""What a campaign of runs draws: fits and their covariance, stated spreads, patterns, weather and start times."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from thermid.errors import NameNotFoundError, ScenarioError
from thermid.identify.calibration import Calibration
from thermid.identify.discrepancy import misfit_kept
from thermid.identify.predict import left_open
from thermid.identify.spread import Spread
from thermid.identify.values import FittedValues
from thermid.model.model import Model
from thermid.model.resolve import parameter_table
from thermid.qualify.campaign_runs import Job
from thermid.qualify.chances import Chance, Inputs, chance, is_shift
from thermid.qualify.starts import begun_at, starts
from thermid.simulation.engine import Options
from thermid.simulation.scenario import Scenario
from thermid.simulation.simulator import Simulator, output_times, prepare

__all__ = ["Values", "plan_runs"]

SAMPLES = 121
CHUNK = 500

Values = Calibration | FittedValues | Spread


def plan_runs(
    model: Model,
    scenario: Scenario | Sequence[Scenario],
    values: Values | Sequence[Values] = (),
    *,
    at: str = "",
    spread: Mapping[str, Any] | None = None,
    seed: int = 0,
    nodes: Sequence[str] | None = None,
    every: str | float | None = None,
    chunk: int = CHUNK,
    options: Options | None = None,
) -> tuple[Job, tuple[str, ...]]:
    """Return what `uncertain_runs` would run, and what a reader must know."""
    from importlib.metadata import version

    given = [values] if isinstance(values, Values) else list(values)
    base = _laid(model, given, at)
    scenarios = [scenario] if isinstance(scenario, Scenario) else list(scenario)
    if not scenarios or chunk < 1:
        raise ScenarioError("a campaign of runs needs a scenario, and chunks of at least one member.", model.title)
    stated = dict(spread or {})
    begun, remarks = starts(stated.pop("start_time"), scenarios[0]) if "start_time" in stated else ([0.0], ())
    open_ = [s for v in given for s in _spreads(v, at)]
    first = begun_at(scenarios[0], begun[0])
    groups = _groups(base, stated)
    names = [x for s in open_ for n in s.names for x in (n, *s.also.get(n, ()))] + [n for group in groups for n in group[0]]
    grid = output_times(first, every, None if every is not None else np.linspace(0.0, first.seconds, SAMPLES))
    ready = prepare(base, first, names, times=grid)
    _once(ready, names)
    chances = tuple(_chance(ready, group, how) for group, how in groups)
    spreads = tuple(_canonical(s, ready) for s in open_)
    centres = {n: 0.0 if is_shift(ready, n) else ready.nominal[n] for s in spreads for n in s.names}
    variants = tuple(begun_at(s, t) for s in scenarios for t in begun)
    chosen = " and ".join(n for n, several in (("scenario", len(scenarios)), ("start_time", len(begun))) if several > 1)
    kept = tuple(dict.fromkeys(ready.wiring.network.find(n) for n in (nodes if nodes is not None else _reference_points(ready))))
    inputs = Inputs(chances, spreads, centres, len(variants), chosen, misfit=_misfit(given, at, kept))
    return Job(base, variants, inputs, kept, grid, seed, chunk, options or Options(), version("thermid")), remarks


def _laid(model: Model, given: Sequence[Values], at: str) -> Model:
    """Return the model with fitted values laid over it."""
    ahead = f"{at}." if at else ""
    for v in given:
        below = [*v.held, v.values] if isinstance(v, Calibration) else [v]
        for found in (x for x in below if isinstance(x, FittedValues)):
            model = model.with_values({ahead + p: x for p, x in found.assignments.items()}, f"stage '{found.stage}'")
    return model


def _spreads(given: Values, at: str) -> list[Spread]:
    if isinstance(given, Spread):
        return [given]
    if isinstance(given, FittedValues):
        return [Spread.of(given, at)]
    ahead = f"{at}." if at else ""
    return [
        Spread(
            s.cause,
            tuple(ahead + n for n in s.names),
            s.covariance,
            s.log,
            {ahead + k: tuple(ahead + x for x in v) for k, v in s.also.items()},
        )
        for s in left_open(given)
        if s.names
    ]


def _misfit(given: Sequence[Values], at: str, kept: Sequence[str]) -> dict[str, float]:
    """Return kept node -> what the fits could not follow; nodes without a reading at the root mean square of the others. [K]"""
    ahead = f"{at}." if at else ""
    known = [misfit_kept(v.values if isinstance(v, Calibration) else v) for v in given if not isinstance(v, Spread)]
    sizes = {ahead + n: size for several in known for n, size in several.items()}
    if not any(sizes.values()):
        return {}
    other = float(np.sqrt(np.mean(np.square(list(sizes.values())))))
    return {n: sizes.get(n, other) for n in kept}


def _groups(model: Model, stated: Mapping[str, Any]) -> list[tuple[list[str], Any]]:
    """Return names that share one value, and how it is spread; patterns reach every number of the model that they match.

    Instances of one part whose value stands in one place share it.
    """
    table = parameter_table(model)
    taken = {model.canonical(raw) for raw in stated}
    out: list[tuple[list[str], Any]] = []
    for raw, how in stated.items():
        if not any(c in raw for c in "*?["):
            out.append(([raw], how))
            continue
        same: dict[str, list[str]] = {}
        for path, entry in table.items():
            given = entry.parameter
            bounded = given.minimum is not None and given.maximum is not None and given.minimum < given.maximum
            if given.is_literal and fnmatch.fnmatchcase(path, raw) and (how != "range" or bounded):
                same.setdefault(entry.where, []).append(path)
        if not same:
            raise NameNotFoundError(f"the pattern '{raw}' reaches no number{' with min and max' if how == 'range' else ''}.", model.title)
        # what is named wins over a pattern that reaches it
        left = ([p for p in paths if p not in taken] for paths in same.values())
        out += [(paths, how) for paths in left if paths]
    return out


def _chance(ready: Simulator, names: Sequence[str], how: Any) -> Chance:
    first, *rest = (ready.canonical(n) for n in names)
    return chance(ready, first, how, rest)


def _canonical(s: Spread, ready: Simulator) -> Spread:
    also = {ready.canonical(k): tuple(map(ready.canonical, v)) for k, v in s.also.items()}
    return Spread(s.cause, tuple(map(ready.canonical, s.names)), s.covariance, s.log, also)


def _once(ready: Simulator, names: Sequence[str]) -> None:
    """Refuse names that are spread twice, and powers that the scenario gives."""
    seen: set[str] = set()
    driven = {f"{path}.power": path for path in (ready.wiring.network.flat.names.model.canonical(n) for n in ready.wiring.scenario.loads)}
    for name in map(ready.canonical, names):
        if name in seen:
            raise ScenarioError(f"'{name}' is spread twice. Leave one out.", ready.title)
        if name in driven:
            load = driven[name]
            raise ScenarioError(
                f"the scenario gives the power of '{load}', so that of the deck moves nothing. Spread 'scale.{load}' in per cent.",
                ready.title,
            )
        seen.add(name)


def _reference_points(ready: Simulator) -> list[str]:
    network = ready.wiring.network
    found = [n.path for n in network.flat.nodes if n.reference_point]
    return found or [n for n in network.nodes if network.numbers().capacitances.get(n) is not None]
