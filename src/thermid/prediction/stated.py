"""Spreads that a caller states: names and patterns of names become values of the model, each spread once."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from typing import Any

from thermid.errors import IdentificationError, NameNotFoundError, ScenarioError
from thermid.model.tree.model import Model
from thermid.model.tree.tree import parameter_table
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import prepare


def expanded(stated: Mapping[str, Any], model: Model) -> list[tuple[list[str], Any]]:
    """Return names that share one value, and how it is spread; patterns reach every number of the model that they match.

    Instances of one part whose value stands in one place share it.

    Raises
    ------
    NameNotFoundError   When a pattern reaches nothing.
    """
    if not any(c in raw for raw in stated for c in "*?["):
        return [([raw], how) for raw, how in stated.items()]
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


def check_moves(names: Sequence[str], model: Model, scenario: Scenario) -> None:
    """Refuse the spread of a deck's power where the scenario gives that power."""
    driven = {f"{path}.power": load for load in scenario.loads for path in (load, model.canonical(load))}
    still = next((n for n in names if n in driven or model.canonical(n) in driven), "")
    if still:
        load = driven.get(still, driven.get(model.canonical(still), ""))
        raise IdentificationError(
            f"the scenario gives the power of '{load}', so that of the deck, '{still}', moves nothing. Spread 'scale.{load}' in per cent.",
            model.title,
        )


def check_variants(stated: Mapping[str, Any], model: Model, scenarios: Sequence[Scenario]) -> None:
    """Refuse a temperature itself as the spread of what differs between scenarios: a shift is the same in all of them."""
    laws = []
    for scenario in scenarios if len(scenarios) > 1 else ():
        names = [n for n in stated if not any(c in n for c in "*?[")]
        ready = prepare(model, scenario if scenario.seconds > 0 else scenario.with_(duration=1.0), names)
        laws.append({n: ready.law(n, stated[n]).mean - ready.nominal[ready.canonical(n)] for n in names})
    for name in laws[0] if laws else ():
        if max(law[name] for law in laws) - min(law[name] for law in laws) > 1e-9:
            raise ScenarioError(
                f"the scenarios have different temperatures of '{name}', and its spread gives one for all. Give a shift in kelvin.",
                model.title,
            )
