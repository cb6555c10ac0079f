"""What would help where a log cannot tell: each cure is tried on the equations, and the errors that it would leave are given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermid.errors import SolverError
from thermid.fit.problem.experiment import Experiment
from thermid.fit.problem.residuals import Problem
from thermid.fit.uncertainty.grouping import Group, listed, percent
from thermid.fit.uncertainty.information import Information
from thermid.model.laws.signal import Table
from thermid.model.parts.elements import HeatLoad
from thermid.model.parts.parameter import parameter

Array = NDArray[np.float64]
KNOWN = 0.05
"""A prior that is easily had: 5 %."""
MOST = 4
HEATER = "heater_of_known_power"
GAIN = 0.7
"""A cure is named when it leaves less than this part of the worst error."""


@dataclass(frozen=True)
class Cure:
    """Something that would help.

    Parameters
    ----------
    action : str        What to do.
    errors : dict       Parameter -> relative error that would be left. [-]
    """

    action: str
    errors: Mapping[str, float]

    def __str__(self) -> str:
        """What to do, and what would be known then."""
        return f"{self.action}: then {', '.join(f'{n} +- {percent(e)}' for n, e in self.errors.items())}"


def cures(problem: Problem, info: Information, groups: Sequence[Group], doubtful: Sequence[str]) -> tuple[Cure, ...]:
    """Return what would help, the best first: to fix a member of a group or know it to 5 %, or to add a step of known power.

    Parameters
    ----------
    problem : Problem
    info : Information              At the values where it is to be judged.
    groups : sequence of Group      What cannot be told apart.
    doubtful : sequence of str      Parameters that are hardly known.
    """
    names = info.names
    wanted = [names.index(p) for p in doubtful]
    before = info.errors()
    out: list[tuple[float, Cure]] = []
    members = dict.fromkeys(n for g in groups for n in g.names if len(g.names) > 1 and n in names)
    for name in members:
        k = names.index(name)
        touched = [j for j in wanted if j != k]
        if info.unknowns[k].kind != "parameter" or not touched:
            continue
        fixed, loose = info.errors(held=[k]), info.errors(more=info.prior_row(k, KNOWN))
        if _worst(loose, touched) < GAIN * _worst(before, touched):
            exact = ", ".join(percent(float(fixed[j])) for j in touched)
            cure = Cure(f"know '{name}' to +- 5 % (fixed exactly it leaves {exact})", {names[j]: float(loose[j]) for j in touched})
            out.append((_worst(loose, touched), cure))
    out += _pairs(info, list(members), wanted) if not out and len(members) > 2 else []
    step = _known_step(problem, info)
    if step is not None:
        row, words = step
        left = info.errors(more=row)
        if _worst(left, wanted) < GAIN * _worst(before, wanted):
            out.append((_worst(left, wanted), Cure(words, {names[j]: float(left[j]) for j in wanted})))
    return tuple(cure for _, cure in sorted(out, key=lambda item: item[0])[:MOST])


def _worst(errors: Array, at: Sequence[int]) -> float:
    return float(np.max(errors[list(at)], initial=0.0))


def _pairs(info: Information, members: Sequence[str], wanted: Sequence[int]) -> list[tuple[float, Cure]]:
    """Return cures that need two parameters, where one is not enough."""
    out = []
    places = [info.names.index(n) for n in members if info.unknowns[info.names.index(n)].kind == "parameter"]
    before = info.errors()
    for n, i in enumerate(places):
        for j in places[n + 1 :]:
            touched = [k for k in wanted if k not in (i, j)]
            left = info.errors(more=np.concatenate([info.prior_row(i, KNOWN), info.prior_row(j, KNOWN)]))
            if touched and _worst(left, touched) < GAIN * _worst(before, touched):
                action = f"know both {listed([info.names[i], info.names[j]])} to +- 5 %"
                out.append((_worst(left, touched), Cure(action, {info.names[k]: float(left[k]) for k in touched})))
    return out


def _known_step(problem: Problem, info: Information) -> tuple[Array, str] | None:
    """Return the rows of the longest log made once more with a step of known power in its largest load, and what to do in words."""
    lengths = [e.scenario.seconds for e in problem.experiments]
    i = int(np.argmax(lengths))
    found = _stepped(problem.experiments[i])
    if found is None:
        return None
    experiment, load, watts = found
    unknowns = tuple(replace(u, targets=tuple(replace(t, experiment=0) for t in u.targets if t.experiment == i)) for u in problem.unknowns)
    again = replace(problem, experiments=(experiment,), unknowns=unknowns)
    try:
        rows = Information.of(again, info.at, exact=False).data
    except SolverError:
        return None
    hours = lengths[i] / 3600.0
    return rows, f"repeat the test of {hours:.3g} h with {watts:.3g} W of known power more where '{load}' heats, on after its first half"


def _stepped(experiment: Experiment) -> tuple[Experiment, str, float] | None:
    """Return an experiment with a heater that gives the power of its largest load once more, known exactly, in the second half."""
    from thermid.network.network import compile_network

    network = experiment.network
    powers = {load.path: (load.node, _power(experiment, load.path)) for load in network.flat.loads if "power" in load.fields}
    name = max(powers, key=lambda path: powers[path][1], default="")
    if not name or not powers[name][1] > 0:
        return None
    node, watts = powers[name]
    model = network.flat.names.model
    heater = HeatLoad(node, {"power": parameter("1 [W]", HEATER)})
    grown = replace(model, loads={**model.loads, HEATER: heater})
    half = 0.5 * experiment.scenario.seconds
    scenario = experiment.scenario.with_(loads={HEATER: Table(np.array([0.0, half]), np.array([0.0, watts]), True)})
    again = compile_network(grown, media=scenario.media(), prescribed=network.prescribed)
    return replace(experiment, network=again, scenario=scenario), name, watts


def _power(experiment: Experiment, load: str) -> float:
    """Return the largest power of a load over an experiment. [W]"""
    signal = experiment.scenario.loads.get(load)
    if signal is not None:
        return float(np.max(signal.at(np.linspace(0.0, experiment.scenario.seconds, 101))))
    flat = experiment.network.flat
    field = next(row.fields["power"] for row in flat.loads if row.path == load)
    return float(flat.parameters.evaluate({})[field])
