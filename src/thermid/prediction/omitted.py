"""What an answer does not count, in words and where possible in kelvin."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thermid.dual import value_of
from thermid.errors import SolverError
from thermid.fit.discrepancy import coefficient_path, constant_coefficients, kept_in, misfit_kept
from thermid.knowledge.sources import LeftOut
from thermid.model.tree.model import Model
from thermid.model.tree.tree import ParameterSet, parameter_table
from thermid.network.network import compile_network
from thermid.prediction.split import split_needed
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import prepare

if TYPE_CHECKING:
    from thermid.prediction.budget import Budget
    from thermid.prediction.known import Known

TENTH = 0.1
"""Standard deviation of an assumed value whose deck gives no range: a tenth of it."""
UNFITTED = "the model's own error: nothing was fitted, so no log says it"
SILENT = "misfit: the fitted values do not say what their fit could not follow"
FELT = 0.1
"""Share of a band from which what it does not count is named in the first line. [-]"""


def left_out_of(known: Known, whole: Budget, without: Sequence[str]) -> tuple[LeftOut, ...]:
    """Return what the budget of a question leaves out by what is known, and what the caller switched off."""
    out = []
    off = [s for s, cause in zip(whole.sources, whole.causes, strict=True) if {s.kind, cause, s.name} & {*without}]
    if off:
        causes = dict.fromkeys(cause for s, cause in zip(whole.sources, whole.causes, strict=True) if s in off)
        out.append(LeftOut(f"{', '.join(causes)} (switched off)"))
    network = compile_network(whole.model, media=whole.scenario.media(), prescribed=tuple(whole.scenario.prescribed))
    silent = {stage: s for s in known.stores for stage, own in s.provenance.items() if kept_in(own) is None}
    for stage, store in silent.items():
        paths = [p for s in store.parameters.values() if s.origin.stage == stage for p in s.acts]
        moved = set(network.flat.parameters.downstream(paths))
        constant = [p for p, c in constant_coefficients(network).items() if coefficient_path(c) in moved]
        if constant:
            out.append(LeftOut(f"what constant coefficients leave out of {_listed(constant)}: the values of '{stage}' do not say it"))
    if known.values and not any(misfit_kept(p) or kept_in(p) is not None for p in known.provenances):
        out.append(LeftOut(SILENT))
    out += [x for s in known.stores for x in s.left_out]
    fitted = [s for store in known.stores for s in store.parameters.values() if s.origin.kind == "fit" and s.acts]
    surfaces = {p for k in known.kept for p in k.surfaces}
    taken = [*(n for t in whole.targets for n in (t.name, *t.also)), *known.assigned]
    closed = [p for p in split_needed(known.model, whole.scenario, taken) if p not in surfaces]
    if closed:
        out.append(LeftOut(f"radiation without gas of {_listed(closed)}: no record says at which temperatures its coefficient holds"))
    if not known.values:
        out.append(LeftOut(UNFITTED))
    once = [s.acts[0] for s in fitted if len({r for o in (s.origin, *s.history) for r in o.records}) == 1]
    if once:
        out.append(LeftOut(f"how values fitted to one record differ from one test to the next ({_listed(once)})", listed=True))
    given = _given(whole)
    if given:
        out.append(LeftOut(f"inputs that nobody spread ({_listed(given)})", listed=True))
    return tuple(out)


def _given(budget: Budget) -> list[str]:
    """Return what a scenario gives, boundaries, loads and the start, and nothing spreads."""
    spread = {n for t in budget.targets for n in (t.name, *t.also)}
    find, scenario = budget.model.canonical, budget.scenario
    out = [b for b in scenario.boundaries if find(b) not in spread]
    out += [x for x in scenario.loads if not {f"scale.{find(x)}", f"{find(x)}.power"} & spread]
    return out + (["start"] if scenario.start and not any(n.startswith("initial.") for n in spread) else [])


def in_order(left_out: Iterable[LeftOut]) -> tuple[LeftOut, ...]:
    """Return what is left out with what a first line may name before what only the list has."""
    return tuple(sorted(left_out, key=lambda x: x.listed))


@dataclass(frozen=True)
class Assumed:
    """A value that a deck only assumes.

    Parameters
    ----------
    path : str      In the model.
    size : float    Standard deviation: by the range of its deck, or a tenth of itself. [SI]
    ranged : bool   Whether its deck gives a range.
    """

    path: str
    size: float
    ranged: bool


def assumed_values(model: Model, scenario: Scenario, taken: Collection[str]) -> list[Assumed]:
    """Return the assumed values of decks that act in a scenario, but those whose names are taken."""
    table = parameter_table(model)
    driven = {model.canonical(p) for p in (*scenario.schedule, *scenario.gains.values())}
    moved = {p for n in driven if n in table for p in (n, ParameterSet(model).literal_behind(n))}
    loose = [p for p, e in table.items() if e.parameter.source == "assumed" and e.parameter.is_literal and p not in moved]
    numbers = compile_network(model, media=scenario.media(), prescribed=tuple(scenario.prescribed)).numbers().values
    out = []
    for p in (p for p in loose if p not in taken and value_of(numbers[p])):
        low, high = table[p].parameter.minimum, table[p].parameter.maximum
        wide = high - low if low is not None and high is not None else np.inf
        ranged = bool(np.isfinite(wide))
        out.append(Assumed(p, wide / 12**0.5 if ranged else TENTH * abs(float(value_of(numbers[p]))), ranged))
    return out


def assumed_left_out(budget: Budget, nodes: Sequence[str] | None = None) -> tuple[tuple[LeftOut, Mapping[str, float]], ...]:
    """Return the assumed values of decks that nothing spreads, with what they may move each node by once it settled (node -> K)."""
    spread = {n for t in budget.targets for n in (t.name, *t.also)}
    spread |= {f"{n.removeprefix('scale.')}.power" for n in spread if n.startswith("scale.")}
    spread |= {f"{budget.model.canonical(load)}.power" for load in budget.scenario.loads}
    loose = assumed_values(budget.model, budget.scenario, spread)
    if not loose:
        return ()
    words = f"{len(loose)} assumed value{'s' if len(loose) > 1 else ''} that no spread names ({_listed([a.path for a in loose])})"
    duration = budget.scenario if budget.scenario.seconds > 0 else budget.scenario.with_(duration=1.0)
    ready = prepare(budget.model, duration, [a.path for a in loose])
    try:
        _, slopes = ready.settled()
    except SolverError:
        return ((LeftOut(words), {}),)
    sizes = np.array([a.size for a in loose])
    kept = nodes if nodes is not None else [n for n in slopes if n not in ready.wiring.network.boundaries]
    effect = {n: float(np.linalg.norm(slopes[n] * sizes)) for n in kept if n in slopes}
    return ((LeftOut(words, max(effect.values(), default=0.0)), effect),)


def first_line(left_out: Sequence[LeftOut], error: float) -> str:
    """Return what a reader must know first of an answer: what it does not count and might matter; empty where nothing is.

    Parameters
    ----------
    left_out : sequence
    error : float   Standard error of the answer, the largest of several. [K]
    """
    felt = [x for x in left_out if not x.listed and not x.kelvin <= FELT * 1.96 * error]
    words = [f"{x.what}, up to {x.kelvin:.2g} K" if np.isfinite(x.kelvin) else x.what for x in felt]
    return f"not counted: {'; '.join(words)}" if words else ""


def _listed(paths: Sequence[str]) -> str:
    return ", ".join(f"'{p}'" for p in paths[:3]) + (f" and {len(paths) - 3} more" if len(paths) > 3 else "")
