"""What if: a record or scenario run again with its ambient, powers, duration, start or gas changed, beside what it was."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from thermid.app.studio.curves import MAX_SENT_POINTS, text_of
from thermid.app.studio.desk import Desk
from thermid.base.errors import DeckError, NameNotFoundError, ThermidError, refuse_unknown
from thermid.model.deck import Edit
from thermid.model.elements import literal
from thermid.model.tree import Model, parameter_table
from thermid.physics.constants import ICE_POINT
from thermid.physics.finishes import FINISHES
from thermid.prediction.bands import split
from thermid.simulation.network import compile_network
from thermid.simulation.runs import Scenario, simulate

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


def conditions_object(desk: Desk, run: int = 0) -> dict[str, Any]:
    """Return what may be changed of a run, as it is: temperatures at its beginning [degC], loads, duration [h], finishes."""
    model, scenario = desk.run_of(run, {})
    network = compile_network(model)
    boundaries = {n: _at_start(scenario, n) for n in network.boundaries if n in scenario.boundaries}
    return {
        "runs": desk.runs,
        "boundaries": boundaries,
        "loads": sorted(model.loads),
        "hours": scenario.seconds / 3600.0,
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
    parameter = parameter_table(before.model)[f"{load}.power"].parameter
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
