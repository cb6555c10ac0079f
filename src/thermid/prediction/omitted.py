"""What an answer does not count, in words and where possible in kelvin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from thermid.dual import value_of
from thermid.errors import SolverError
from thermid.identify.coefficients import coefficient_path, constant_coefficients
from thermid.identify.discrepancy import discrepancy_kept, misfit_kept
from thermid.identify.split import split_needed
from thermid.knowledge.sources import LeftOut
from thermid.model.resolve import ParameterSet, parameter_table
from thermid.network.network import compile_network
from thermid.simulation.simulator import prepare

if TYPE_CHECKING:
    from thermid.prediction.budget import Budget
    from thermid.prediction.known import Known

__all__ = ["assumed_left_out", "first_line", "left_out_of"]

TENTH = 0.1
"""Standard deviation of an assumed value whose deck gives no range: a tenth of it."""
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
    silent = [v for v in known.placed if v.parameters and discrepancy_kept(v) is None]
    for values in silent:
        moved = set(network.flat.parameters.downstream(list(values.assignments)))
        constant = [p for p, c in constant_coefficients(network).items() if coefficient_path(c) in moved]
        if constant:
            out.append(
                LeftOut(f"what constant coefficients leave out of {_listed(constant)}: the values of '{values.stage}' do not say it")
            )
    if known.values and not any(misfit_kept(v) or discrepancy_kept(v) is not None for v in known.placed):
        out.append(LeftOut("misfit: the fitted values do not say what their fit could not follow"))
    surfaces = {p for k in known.kept for p in k.surfaces}
    taken = [n for t in whole.targets for n in (t.name, *t.also)] + [p for v in known.placed for p in v.assignments]
    closed = [p for p in split_needed(known.model, whole.scenario, taken) if p not in surfaces]
    if closed:
        out.append(LeftOut(f"radiation without gas of {_listed(closed)}: no record says at which temperatures its coefficient holds"))
    if not known.values and not whole.sources:
        out.append(LeftOut("the model's own error: nothing was fitted, and no spread is stated"))
    return tuple(out)


def assumed_left_out(budget: Budget, nodes: Sequence[str] | None = None) -> tuple[tuple[LeftOut, Mapping[str, float]], ...]:
    """Return the assumed values of decks that nothing spreads, with what they may move each node by once it settled (node -> K).

    A value with a range in its deck counts with that, another one with a tenth of itself.
    """
    table = parameter_table(budget.model)
    spread = {n for t in budget.targets for n in (t.name, *t.also)}
    spread |= {f"{n.removeprefix('scale.')}.power" for n in spread if n.startswith("scale.")}
    driven = {budget.model.canonical(p) for p in (*budget.scenario.schedule, *budget.scenario.gains.values())}
    moved = {p for n in driven if n in table for p in (n, ParameterSet(budget.model).literal_behind(n))}
    moved |= {f"{budget.model.canonical(load)}.power" for load in budget.scenario.loads}
    loose = [p for p, e in table.items() if e.parameter.source == "assumed" and e.parameter.is_literal and p not in spread | moved]
    network = compile_network(budget.model, media=budget.scenario.media(), prescribed=tuple(budget.scenario.prescribed))
    numbers = network.numbers().values
    loose = [p for p in loose if value_of(numbers[p])]
    if not loose:
        return ()
    sizes = []
    for p in loose:
        low, high = table[p].parameter.minimum, table[p].parameter.maximum
        ranged = low is not None and high is not None and bool(np.isfinite(high - low))
        sizes.append(
            (high - low) / 12**0.5 if ranged and low is not None and high is not None else TENTH * abs(float(value_of(numbers[p])))
        )
    words = f"{len(loose)} assumed value{'s' if len(loose) > 1 else ''} that no spread names ({_listed(loose)})"
    duration = budget.scenario if budget.scenario.seconds > 0 else budget.scenario.with_(duration=1.0)
    try:
        _, slopes = prepare(budget.model, duration, loose).settled()
    except SolverError:
        return ((LeftOut(words), {}),)
    kept = nodes if nodes is not None else [n for n in slopes if n not in network.boundaries]
    effect = {n: float(np.linalg.norm(slopes[n] * sizes)) for n in kept if n in slopes}
    return ((LeftOut(words, max(effect.values(), default=0.0)), effect),)


def first_line(left_out: Sequence[LeftOut], error: float) -> str:
    """Return what a reader must know first of an answer: what it does not count and might matter; empty where nothing is.

    Parameters
    ----------
    left_out : sequence
    error : float   Standard error of the answer, the largest of several. [K]
    """
    felt = [x for x in left_out if not x.kelvin <= FELT * 1.96 * error]
    words = [f"{x.what}, up to {x.kelvin:.2g} K" if np.isfinite(x.kelvin) else x.what for x in felt]
    return f"not counted: {'; '.join(words)}" if words else ""


def _listed(paths: Sequence[str]) -> str:
    return ", ".join(f"'{p}'" for p in paths[:3]) + (f" and {len(paths) - 3} more" if len(paths) > 3 else "")
