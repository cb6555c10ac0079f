"""A part is replaced: what that touches, which stages and tests are due again, and what every sensor is predicted to show."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.arguments import takes_objects
from thermid.campaign.sharing import Level, places_of
from thermid.campaign.swap.retune_plan import RetunePlan, StagePlan, Touch
from thermid.errors import DeckError, IdentificationError, SolverError
from thermid.fit.calibration import Calibration
from thermid.model.deck.modelfile import load_model
from thermid.model.laws.signal import Constant
from thermid.model.parts.parameter import exact
from thermid.model.tree.areas import ledger
from thermid.model.tree.model import Model
from thermid.model.tree.replacement import PlaceStart, touching
from thermid.model.tree.tree import ParameterSet
from thermid.simulation.scenarios.scenario import Scenario

if TYPE_CHECKING:
    from thermid.campaign.stages import Campaign

FELT = 0.05
"""A value is worth retuning when a change of 10 % moves some sensor by this much. [K]"""


@takes_objects
def plan_retune(campaign: Campaign, part: str, new: Model | str | os.PathLike[str]) -> RetunePlan:
    """Return the plan of a replacement: what it assumes, drops and touches, which stages and tests are due, predictions before and after.

    Parameters
    ----------
    campaign : Campaign     As `run_stages` returned it.
    part : str              Path of the part in the model of the last stage.
    new : Model or path     The new part, or its deck.

    Raises
    ------
    ThermidError   When there is no such part, the new one does not fit its place, or the campaign was made in Python.
    """
    source = campaign.source
    if source is None:
        raise DeckError("a plan needs the campaign's file; this campaign was made in Python. Call run_stages on a file.", campaign.title)
    model = new if isinstance(new, Model) else load_model(new)
    levels = [Level(name, request) for name, request in campaign.requests.items()]
    top = levels[-1].name
    above = campaign[top].fitted_model
    part = above.canonical(part)
    old = above.submodel(part)
    places = places_of(source, levels, top)
    swapped, what = above.replaced(part, model)
    swapped = what.starting(swapped)
    plans: list[StagePlan] = []
    touched: list[Touch] = []
    for level in levels:
        plan, touches = _staged(campaign, level, places[level.name], part, model)
        plans += plan
        touched += touches
    by_deck, logged = _at_rest(campaign[top], part), _at_rest(campaign[top], "")
    cold, warm, shown = _steady(above, by_deck), _steady(swapped, by_deck), _steady(above, logged)
    watts, given = (_watts(above, by_deck, part), _watts(swapped, by_deck, part)), _watts(above, logged, part)
    before, after, as_logged = (_observed(t, campaign[top]) for t in (cold, warm, shown))
    neighbours = _neighbours(above, swapped, part, cold, warm)
    stages, values = tuple(plans), tuple(touched)
    return RetunePlan(
        part, old.title, model.title, stages, values, neighbours, before, after, as_logged, watts, given, what, campaign, model
    )  # fmt: skip


def _staged(campaign: Campaign, level: Level, places: tuple[str, ...], part: str, new: Model) -> tuple[list[StagePlan], list[Touch]]:
    """Return what becomes of a stage, and what of its values the part touches."""
    done, request = campaign[level.name], level.request
    records = tuple(r.name for r in request.records)
    same = done.model.identity()
    kept = StagePlan(level.name, level.name, "kept", "nothing that it depends on changes", (), (), (same, same), done.model)
    if f"{part}." in places:
        free = tuple(p for p in request.free if request.model.canonical(p) in ParameterSet(new).table)
        lost = [p for p in request.free if p not in free]
        why = "the new part, tested alone" + (f"; it has no {', '.join(lost)}" if lost else "")
        alone = StagePlan(level.name, level.name, "run", why, free, records, (same, new.identity()), new, "", True)
        if len(places) == 1:
            return [alone], []
        name = f"{level.name} at {part}"
        return [kept, StagePlan(name, level.name, "run", why, free, records, (same, new.identity()), new, "", True)], []
    holds = [place for place in places if part.startswith(place) and place != f"{part}."]
    if not holds:
        return [kept], []
    if len(places) > 1:
        raise IdentificationError(
            f"stage '{level.name}' stands at {len(places)} places of '{campaign.title}', and the part in one of them. Give the unit that "
            "is rebuilt a stage of its own.",
            part,
        )
    inner = part.removeprefix(holds[0])
    model = request.model.replace(inner, new)
    touches, starts = _touches(done, level, inner, new)
    free = tuple(t.path for t in touches if not t.held)
    identity = (request.model.identity(), model.identity())
    if not free:
        why = "its model changes, but of what it fits nothing is to be retuned"
        return [StagePlan(level.name, level.name, "carried", why, (), (), identity, model, inner, starts=starts)], touches
    why = f"{', '.join(free)} anew"
    return [StagePlan(level.name, level.name, "run", why, free, records, identity, model, inner, starts=starts)], touches


def _touches(done: Calibration, level: Level, inner: str, new: Model) -> tuple[list[Touch], tuple[PlaceStart, ...]]:
    """Return the values of a stage that act at the part's interfaces, and those of the place that it decides and that start anew."""
    model = done.fitted_model
    values, found = ParameterSet(model), touching(model, inner)
    bare, what = model.replaced(inner, new)
    after = what.starting(bare)
    known = ParameterSet(after)
    numbers = known.evaluate({})
    fitted = done.values.assignments
    behind = {s.path: [p for p in fitted if s.path in values.downstream([p])] for s in what.starts if s.path in values.table}
    starts = tuple(s for s in what.starts if behind.get(s.path))
    anew = {p: s.path for s in starts for p in behind[s.path]}
    rest = _at_rest(done, inner)
    still = _observed(_steady(after, rest), done)
    out = []
    for path in dict.fromkeys((*(s.path for s in starts), *fitted)):
        through, elsewhere = found.why(values, path)
        inside = path.startswith(f"{inner}.") and path not in found.settings
        if path not in known.table or not (through or inside) or (path in anew and anew[path] != path and not elsewhere):
            continue
        given = known.table[path].parameter
        high = given.maximum if given.maximum is not None else np.inf
        number = float(numbers[path]) * (1.1 if 1.1 * float(numbers[path]) <= high else 0.9)
        changed = after.with_values({path: exact(number, given.unit)}, "a change of 10 %") if given.is_literal else after
        moved = _observed(_steady(changed, rest), done)
        kelvin = max(abs(t - still[o]) for o, t in moved.items())
        held = ""
        if path in anew and anew[path] != path:
            held = f"stays with {', '.join(elsewhere)}; {anew[path]} has a number of its own"
        elif elsewhere and path not in anew:
            held = f"shared with {', '.join(elsewhere)}, which the swap leaves alone"
        elif kelvin < FELT and not inside:
            held = f"10 % move no sensor by {FELT} K"
        out.append(Touch(level.name, path, tuple(through) or ("the part itself",), kelvin, held))
    return out, starts


def _at_rest(done: Calibration, without: str) -> Scenario:
    """Return the last record of a fit with every input at its mean; loads of a part, where one is named, are left to its deck."""
    given = done.experiments[-1].bare

    def constant(signals: Mapping[str, Any], unit: str) -> dict[str, Any]:
        kept = {k: v for k, v in signals.items() if not without or not k.startswith(f"{without}.")}
        return {k: f"{v.mean_over(0.0, given.seconds)!r} [{unit}]" if not isinstance(v, Constant) else v for k, v in kept.items()}

    return replace(
        given,
        title="at rest",
        boundaries=constant(given.boundaries, "K"),
        loads=constant(given.loads, "W"),
        commands=constant(given.commands, "1"),
    )


def _watts(model: Model, scenario: Scenario, part: str) -> float:
    """Return the power of a part: by its deck, or as a scenario gives it. [W]"""
    from thermid.dual import value_of
    from thermid.network.network import compile_network

    given = {model.canonical(n): v.value for n, v in scenario.loads.items() if isinstance(v, Constant)}
    rows = compile_network(model, media=scenario.media()).numbers().loads
    inside = {row.name: float(value_of(row.coefficients[0])) for row in rows if row.name.startswith(f"{part}.")}
    return float(sum(given.get(name, watts) for name, watts in inside.items()))


def _steady(model: Model, scenario: Scenario) -> Mapping[str, float]:
    """Return the temperatures at rest. [K]"""
    from thermid.simulation.steady import steady

    try:
        return steady(model, scenario)
    except SolverError as error:
        raise IdentificationError(f"a swap is judged at rest, and there is none: {error.message}", model.title) from None


def _observed(rest: Mapping[str, float], done: Calibration) -> dict[str, float]:
    """Return sensor -> temperature at rest, of the nodes that a model still has. [K]"""
    return {o.sensor: rest[o.seat] for o in done.experiments[-1].observations if o.seat in rest}


def _neighbours(
    before: Model, after: Model, part: str, cold: Mapping[str, float], warm: Mapping[str, float]
) -> dict[str, tuple[float, float, float]]:
    """Return surface beside the part -> exposed area before and after, and the change of its node at rest."""
    beside, old = touching(before, part), {line.surface: line for line in ledger(before)}
    new = {line.surface: line.exposed for line in ledger(after)}
    near = {s for s, line in old.items() if s in beside.neighbours or set(line.joints) & set(beside.elements)}
    near |= {s for s, line in old.items() if abs(new.get(s, line.exposed) - line.exposed) > 1e-12}
    out = {}
    for surface in sorted(s for s in near if not s.startswith(f"{part}.")):
        inner, _, name = surface.rpartition(".")
        owner = before.submodel(inner) if inner else before
        node = f"{inner}.{owner.canonical(owner.surfaces[name].of)}".lstrip(".")
        out[surface] = (old[surface].exposed, new[surface], warm[node] - cold[node])
    return out
