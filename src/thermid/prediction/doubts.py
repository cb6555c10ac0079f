"""What a test without gas would meet that no test in air has told: emissivities, and joints that have lost their gas."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import Prior
from thermid.model.laws.signal import Signal
from thermid.model.parts.parameter import Parameter
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.physics.finishes import finish
from thermid.simulation.scenarios.scenario import Scenario

THIN = 1e4
"""Pressure below which gas no longer does what it did in the room. [Pa]"""
EMISSIVITY = 0.15
"""What an emissivity of a deck is good to, where no finish says it. [-]"""
JOINT = 0.7
"""Standard deviation of the logarithm of a joint's conductance without gas about that with it: a factor of two either way. Gas carries more
than half of the heat between bare, lightly pressed faces (Yovanovich, IEEE Trans. CPT 28 (2005) 182); a filled joint loses nothing. [-]"""


def doubts_without_gas(model: Model, scenario: Scenario) -> dict[str, float]:
    """Return path -> relative standard deviation of what thin gas meets and air does not tell; empty where gas stays as it is."""
    if not any(_thin(e.pressure) for e in scenario.environment.values()):
        return {}
    flat = compile_network(model).flat
    parameters = flat.parameters
    out: dict[str, float] = {}

    def doubt(path: str, size: float) -> None:
        root = parameters.literal_behind(path)
        given: Parameter = parameters.table[root].parameter
        if given.is_literal and parameters.evaluate({})[root] > 0:
            out[root] = size

    finishes = {parameters.literal_behind(path): finish(named).log_sd for path, named in flat.finishes.items()}
    for c in flat.conductors:
        for path in filter(None, (c.emissivity, c.fields.get("emissivity", ""))):
            doubt(path, finishes.get(parameters.literal_behind(path), EMISSIVITY))
        if "contact_conductance" in c.fields:
            doubt(c.fields["contact_conductance"], JOINT)
    return out


def _thin(pressure: Signal) -> bool:
    return pressure.bounds[0] < THIN


def doubted(problem: Problem, doubts: Mapping[str, float]) -> Problem:
    """Return a problem whose doubtful values have priors of their own."""
    unknowns = []
    for u in problem.unknowns:
        if u.name in doubts:
            size = doubts[u.name]
            u = replace(u, prior=Prior(math.log(u.start), size) if u.log else Prior(u.start, size * u.start))
        unknowns.append(u)
    return replace(problem, unknowns=tuple(unknowns))
