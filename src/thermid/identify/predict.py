"""`predict`: a fitted model and a scenario in, temperatures with their bands out, and what the bands come from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError, SolverError
from thermid.identify.calibration import Calibration
from thermid.identify.further import Further
from thermid.identify.joint_gas import with_gas_in_joints
from thermid.identify.prediction import Band, Prediction
from thermid.identify.split import split, split_needed
from thermid.identify.spread import Spread
from thermid.identify.values import FittedValues, view
from thermid.knowledge.standing import of_model, worst
from thermid.model.model import Model
from thermid.simulation.engine import Options
from thermid.simulation.scenario import Scenario
from thermid.simulation.simulator import Simulator, prepare
from thermid.simulation.solution import Solution

__all__ = ["left_open", "predict"]

Array = NDArray[np.float64]
Columns = dict[str, Array]
"""Node -> (times and the settled state, directions): what a spread of one standard deviation along each direction does. [K]"""


@takes_objects
def predict(
    fit: Calibration,
    scenario: Scenario,
    *,
    model: Model | None = None,
    spread: Mapping[str, Any] | Spread | Sequence[Mapping[str, Any] | Spread] = (),
    every: str | float | None = None,
    times: Any = None,
    nodes: Sequence[str] | None = None,
    discrepancy: bool = True,
    draws: int = 0,
    seed: int = 0,
    options: Options | None = None,
) -> Prediction:
    """Return what a fitted model says of a scenario, with standard errors and what they come from.

    Errors are carried by the derivatives of every temperature with respect to every value (Joint Committee for Guides in Metrology,
    GUM 2008, 5.2.2), with their whole covariance; where values spread so far that the model bends, ask for `draws`.

    Where the scenario thins the gas of surfaces whose coefficients are effective, these are split first; see `split`. Joints that were
    fitted in air are then as doubtful as the gas in them is.

    Parameters
    ----------
    fit : Calibration           Its values, with their joint covariance.
    scenario : Scenario         What is done to the model; it is taken as exact but for what `spread` says.
    model : Model               Another model that holds the fitted paths; the fitted one by default.
    spread : dict, Spread       What else is not known exactly: name -> standard deviation as text, or `Spread`, or several of these.
    every, times                When to store, as in `simulate`.
    nodes : sequence of str     Nodes to predict; all by default.
    discrepancy : bool          Whether to count what constant coefficients leave out, and what the fit could not follow; see `discrepancy`.
    draws : int                 Members drawn from the spreads; bands are then quantiles. 0 for derivatives alone.
    seed : int                  Of the draws.
    options : Options           The integrator's.

    Raises
    ------
    IdentificationError     When a value is spread twice, or has no finite error; when a coefficient that must be split cannot be.
    """
    base = fit.fitted_model if model is None else fit.store.on(model)
    standing = worst([fit.standing, of_model(base)]) if model is None else of_model(base)
    given = [spread] if isinstance(spread, Mapping | Spread) else list(spread)
    if draws < 0:
        raise IdentificationError(f"{draws} members cannot be drawn; give 0 for derivatives alone, or some hundred.", base.title)
    base, own, loose = (base, left_open(fit), "") if model is not None else _in_gas(fit, base, scenario, given)
    names = [n for s in (*own, *given) for n in _names(s)]
    ready = prepare(base, scenario, names, every=every, times=times, options=options)
    spreads = [*own, *(s if isinstance(s, Spread) else Spread.stated(s, ready) for s in given)]
    _check_once(spreads, ready)
    _check_moves(given, base, scenario)
    misfit = Further.of(fit, base, ready) if discrepancy and fit.problem is not None else Further(ready)
    run = misfit.ready.run(misfit.still, sensitivities=True)
    found = {n: run[n].path for n in (nodes if nodes is not None else run.nodes)}
    kept = list(dict.fromkeys(found.values()))
    settled, moves = _settled(misfit)
    columns: dict[str, Columns] = {}
    for s in (s for s in spreads if s.names):
        more = _columns(misfit.ready, s, kept, run, moves)
        columns[s.cause] = {n: np.hstack([columns[s.cause][n], c]) if s.cause in columns else c for n, c in more.items()}
    columns |= misfit.columns(kept, run, moves)
    shift = {n: misfit.shift(n, run, moves) for n in kept}
    members = _members(ready, spreads, kept, draws, seed) if draws else {}
    _err_further(members, shift, [columns[c] for c in misfit.words], seed)
    bands, rest = {}, {}
    for n in kept:
        parts = {cause: np.sum(c[n] ** 2, axis=1) for cause, c in columns.items()}
        bands[n] = Band(n, ready.times, run[n].kelvin, shift[n][:-1], {c: v[:-1] for c, v in parts.items()}, members.get(n))
        if settled:
            rest[n] = Band(n, ready.times[-1:], np.array([settled[n]]), shift[n][-1:], {c: v[-1:] for c, v in parts.items()}).final
    words = {s.cause: _words([n for t in spreads if t.cause == s.cause for n in t.names]) for s in spreads if s.names}
    warnings = (*run.warnings, *([loose] * bool(loose)), *misfit.guessed(kept, run, moves))
    return Prediction(base.title, scenario.title, ready.times, bands, rest, {**words, **misfit.words}, warnings, found, standing)


def _in_gas(fit: Calibration, base: Model, scenario: Scenario, given: Sequence[Any]) -> tuple[Model, list[Spread], str]:
    """Return the model and what it leaves open, coefficients split and joints doubted where a scenario thins their gas, and a remark."""
    own, thin = left_open(fit), split_needed(fit, scenario, [n for s in given for n in _names(s)])
    values, cause = fit.values, "fit"
    if thin:
        apart = split(fit, thin)
        base, values, cause = apart.model, apart.values, "fit, and split of effective coefficients"
    values, remark = with_gas_in_joints(fit, values, scenario)
    cause += ", and gas in joints" if remark else ""
    if not (thin or remark):
        return base, own, remark
    below = _uncertain(fit, [p for p in fit.store.parameters if p not in fit.values])
    return base, [Spread.of(values, cause=cause), Spread.of(below, cause="stages below")], remark


def left_open(fit: Calibration) -> list[Spread]:
    """Return what the fit and the stages below leave open: one spread, for the errors of fixed values move those that were fitted."""
    return [Spread.of(_uncertain(fit, fit.store.parameters), cause="fit")]


def _uncertain(fit: Calibration, paths: Iterable[str]) -> FittedValues:
    """Return those of some values that act in the model and have an error."""
    sure = [p for p in paths if (s := fit.store[p]).acts and s.known and fit.store.error(p) > 0]
    return view(fit.store, sure, fit.stage)


def _names(spread: Mapping[str, Any] | Spread) -> list[str]:
    """Return every name that a spread moves, instances that share a value among them."""
    if not isinstance(spread, Spread):
        return list(spread)
    return [n for name in spread.names for n in (name, *spread.also.get(name, ()))]


def _check_moves(given: Sequence[Mapping[str, Any] | Spread], model: Model, scenario: Scenario) -> None:
    """Refuse the spread of a deck's power where the scenario gives that power."""
    driven = {f"{path}.power": load for load in scenario.loads for path in (load, model.canonical(load))}
    still = next((n for s in given for n in _names(s) if n in driven), "")
    if still:
        raise IdentificationError(
            f"the scenario gives the power of '{driven[still]}', so that of the deck, '{still}', moves nothing. "
            f"Spread 'scale.{driven[still]}' in per cent.",
            model.title,
        )


def _check_once(spreads: Sequence[Spread], ready: Simulator) -> None:
    """Refuse names that two causes spread; what they say would be added up."""
    owner: dict[str, str] = {}
    for s in spreads:
        for name in map(ready.canonical, _names(s)):
            if name in owner:
                raise IdentificationError(f"'{name}' is spread twice, by {owner[name]} and by {s.cause}. Leave one out.", ready.title)
            owner[name] = s.cause


def _settled(misfit: Further) -> tuple[dict[str, float], dict[str, Array]]:
    """Return node -> settled temperature [K] and its derivatives; empty where nothing settles."""
    try:
        return misfit.ready.settled(misfit.still)
    except SolverError:
        return {}, {}


def _columns(ready: Simulator, spread: Spread, kept: Sequence[str], run: Solution, moves: Mapping[str, Array]) -> Columns:
    """Return what each direction of a spread does to each node."""
    place = {name: k for k, name in enumerate(ready.free)}
    chain = np.zeros((len(place), len(spread.names)))
    for k, (name, log) in enumerate(zip(spread.names, spread.log, strict=True)):
        for path in map(ready.canonical, (name, *spread.also.get(name, ()))):
            chain[place[path], k] = ready.nominal[path] if log else 1.0
    chain = chain @ spread.root()
    out = {}
    for n in kept:
        slopes = np.column_stack([run.sensitivity(n, name) for name in ready.free])
        out[n] = np.vstack([slopes, moves.get(n, np.full(len(place), np.nan))[None, :]]) @ chain
    return out


def _members(ready: Simulator, spreads: Sequence[Spread], kept: Sequence[str], count: int, seed: int) -> dict[str, Array]:
    """Return node -> temperatures (times, members) at drawn values. [K]"""
    generator = np.random.default_rng(seed)
    values: dict[str, Array] = {}
    for s in spreads:
        values |= s.draws({n: ready.nominal[ready.canonical(n)] for n in s.names}, count, generator)
    many = ready.ensemble(values, nodes=list(kept))
    return {n: many.temperatures(n) for n in kept}


def _err_further(members: Mapping[str, Array], shift: Mapping[str, Array], columns: Sequence[Columns], seed: int) -> None:
    """Add to every member what constant coefficients leave out, drawn once for all nodes and times."""
    generator = np.random.default_rng([seed, 1])
    for c in columns if members else ():
        directions = next(iter(c.values())).shape[1]
        drawn = generator.standard_normal((directions, next(iter(members.values())).shape[1]))
        for n, traces in members.items():
            traces += c[n][:-1] @ drawn
    for n, traces in members.items():
        traces += shift[n][:-1, None]


def _words(names: Sequence[str]) -> str:
    """Return what spreads of some names stand for."""
    listed = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return f"what is left open of {listed}"
