"""What coefficients that are held constant leave out, of the fit itself and of a prediction away from its conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError
from thermid.identify.coefficients import (
    Conditions,
    coefficient_path,
    conditions_of,
    constant_coefficients,
    courses,
    patterns_of,
    with_patterns,
)
from thermid.identify.residuals import Problem
from thermid.identify.solve import covariances, ended
from thermid.identify.unknowns import Target, Unknown
from thermid.identify.values import FittedValues
from thermid.identify.wander import binned

if TYPE_CHECKING:
    from thermid.identify.calibration import Calibration
    from thermid.identify.coefficients import Course, Pattern
    from thermid.identify.wander import Wander

__all__ = ["Discrepancy", "conditions_found", "discrepancy", "misfit_found", "misfit_kept"]

Array = NDArray[np.float64]
Key = tuple[str, str]
"""Path of a conductor, and 'difference' or 'level'."""
ALIKE = 0.5
"""Correlation of two surfaces' exponents, and of their radiative shares: half of what they do not follow is the room's, half their own."""


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """What constant coefficients leave open of a fit.

    Parameters
    ----------
    conditions : dict               Path of a coefficient's conductor -> where it was found.
    means, sizes : dict             (path, kind) -> mean and standard deviation of the exponent or the radiative share. [-]
    names : tuple of str            Unknowns of the fit.
    response : array (unknowns, patterns)   What the fit would have found for a unit of each pattern, less what it found; fitted form.
    misfit : dict                   Node -> standard deviation of what wanders in its residuals, once the fit has done what it can. [K]
    """

    conditions: Mapping[str, Conditions]
    means: Mapping[Key, float]
    sizes: Mapping[Key, float]
    names: tuple[str, ...]
    response: Array
    misfit: Mapping[str, float]

    @cached_property
    def root(self) -> Array:
        """A root L (patterns, directions) of the covariance of the patterns, ``L L'``."""
        keys = list(self.sizes)
        alike = np.array([[1.0 if a == b else ALIKE if a[1] == b[1] else 0.0 for b in keys] for a in keys]).reshape(len(keys), len(keys))
        sizes = np.array(list(self.sizes.values()))
        return np.asarray(sizes[:, None] * np.linalg.cholesky(alike)) if keys else np.zeros((0, 0))

    @takes_objects
    def widened(self, values: FittedValues) -> FittedValues:
        """Return fitted values with a covariance that counts what constant coefficients leave out of the fit itself.

        An error so widened answers: how far would a model of the right law have put the other values? It holds at the conditions of the
        fit, for a coefficient's mean over them.
        """
        place = {n: k for k, n in enumerate(self.names)}
        rows = self.response[[place[p] for p in values]] @ np.column_stack([self.root, list(self.means.values())])
        covariance = values.covariance + rows @ rows.T
        items = {}
        for k, (p, v) in enumerate(values.items()):
            error = float(np.sqrt(covariance[k, k])) * (abs(v.value) if v.log else 1.0)
            items[p] = replace(v, error=error)
        return replace(values, items_=items, covariance=covariance)

    def __str__(self) -> str:
        """Return where each coefficient was found."""
        return "\n".join(f"{p}: found at a difference of {c}" for p, c in self.conditions.items())


@takes_objects
def discrepancy(fit: Calibration) -> Discrepancy:
    """Return what constant coefficients leave out of a fit.

    Convection grows with the difference of temperature by a power between 0 (blown air) and 1/3 (turbulent, natural); what is radiation
    in a coefficient grows with the level. Each is taken as a consider parameter (Tapley, Schutz and Born, Statistical Orbit Determination,
    Elsevier 2004, section 6.2): not looked for, but not known to be zero; the fit's own response to it is counted, so that a coefficient
    is right where it was fitted and less so further off.

    Raises
    ------
    IdentificationError   When the calibration does not hold its records.
    """
    problem = fit.problem
    if problem is None or not fit.fitted:
        raise IdentificationError("this calibration does not hold its records, so nothing can be asked of it. Run it again.", fit.stage)
    at = np.array(list(fit.fitted.values()))
    ways, conditions = _patterns(fit, problem, at)
    sizes = {(p.path, p.kind): p.sd for several in ways for p in several}
    means = {(p.path, p.kind): p.mean for several in ways for p in several}
    response = _response(fit, problem, at, ways, list(sizes))
    return Discrepancy(conditions, means, sizes, tuple(u.name for u in problem.unknowns), response, _misfit(fit))


def _patterns(fit: Calibration, problem: Problem, at: Array) -> tuple[list[list[Pattern]], dict[str, Conditions]]:
    """Return the patterns of every record, and where each coefficient was found: here, or in the stage below that it was held from."""
    runs = _runs(problem, at)
    here = conditions_of([found for _, found in runs])
    decided = _decided(problem, list(fit.values.assignments))
    here |= {p: c for values in fit.held for p, c in found_at(values).items() if p in here and p not in decided}
    ways = []
    for bench, (times, found) in zip(problem.benches(), runs, strict=True):
        network = bench.wiring.network
        values = network.numbers({p: v.value for p, v in fit.values.assignments.items()}).values
        ways.append(patterns_of(network, times, found, here, values))
    return ways, here


def _runs(problem: Problem, at: Array) -> list[tuple[Array, dict[str, Course]]]:
    """Return times and the course of every constant coefficient, per record."""
    return [courses(b.wiring, b.engine, problem.inputs(i, at)[0], problem.options) for i, b in enumerate(problem.benches())]


def _decided(problem: Problem, paths: Sequence[str]) -> set[str]:
    """Return the conductors whose constant coefficient follows from some parameters."""
    network = problem.experiments[0].network
    touched = set(network.flat.parameters.downstream(paths))
    return {path for path, c in constant_coefficients(network).items() if coefficient_path(c) in touched}


def conditions_found(problem: Problem, at: Array, paths: Sequence[str]) -> dict[str, list[float]]:
    """Return path of a conductor -> difference and level [K] where its coefficient was found, of those that fitted parameters decide."""
    decided = _decided(problem, paths)
    if not decided:
        return {}
    found = conditions_of([run for _, run in _runs(problem, at)])
    return {p: [c.difference, c.level] for p, c in found.items() if p in decided}


def found_at(values: FittedValues) -> dict[str, Conditions]:
    """Return path of a conductor -> where its coefficient was found, as fitted values keep it."""
    return {p: Conditions(float(d), float(t)) for p, (d, t) in values.provenance.get("conditions", {}).items()}


def _response(fit: Calibration, problem: Problem, at: Array, ways: Sequence[Sequence[Pattern]], keys: Sequence[Key]) -> Array:
    """Return d fitted / d pattern (unknowns, patterns): ``-C J'K``, K the derivatives of the weighted residuals to the patterns."""
    size = len(problem.unknowns)
    if not size or not keys:
        return np.zeros((size, len(keys)))
    targets: dict[Key, list[Target]] = {k: [] for k in keys}
    experiments = []
    for i, (experiment, several) in enumerate(zip(problem.experiments, ways, strict=True)):
        network, scenario = with_patterns(experiment.network, experiment.scenario, several)
        experiments.append(replace(experiment, network=network, scenario=scenario))
        for p in several:
            targets[p.path, p.kind] += [Target(i, f"scale.{n}") for n in p.names(network.boundaries)]
    more = tuple(Unknown(f"{kind} {path}", "pattern", tuple(t), 0.0) for (path, kind), t in targets.items())
    wide = replace(problem, experiments=tuple(experiments), unknowns=(*problem.unknowns, *more), coupled=())
    level = max(1.0, fit.reduced_chi_square)
    _, _, known = covariances(ended(problem, at, fit.loss), level)
    known = np.where(np.isfinite(known), known, 0.0)
    cross = np.zeros((size, len(keys)))
    for b in binned(wide, np.concatenate([at, np.zeros(len(keys))]), fit.loss).values():
        cross += b.slopes[:, :size].T @ (b.count[:, None] * b.slopes[:, size:])
    return np.asarray(-known @ cross / level)


def _misfit(fit: Calibration) -> dict[str, float]:
    """Return node -> standard deviation of what wanders in its residuals, over all records. [K]"""
    return misfit_found(fit.problem, fit.wander) if fit.problem is not None and fit.wander is not None else {}


def misfit_found(problem: Problem, wander: Wander) -> dict[str, float]:
    """Return node -> standard deviation of what wanders in its residuals, over all records. [K]"""
    slow = {(t.record, t.sensor): t.slow for t in wander.traces}
    parts: dict[str, list[float]] = {}
    for e in problem.experiments:
        for o in e.observations:
            parts.setdefault(o.seat, []).append(slow.get((e.record.name, o.sensor), 0.0) * o.sigma(problem.noise) ** 2)
    return {n: float(np.sqrt(np.mean(several))) for n, several in parts.items()}


def misfit_kept(values: FittedValues) -> dict[str, float]:
    """Return node -> standard deviation of what the fit could not follow, as fitted values keep it; empty where they are of before. [K]"""
    return {n: float(size) for n, size in values.provenance.get("misfit", {}).items()}
