"""What coefficients that are held constant leave out, of the fit itself and of a prediction away from its conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError
from thermid.fit.coefficients import (
    Conditions,
    coefficient_path,
    conditions_of,
    constant_coefficients,
    courses,
    patterns_of,
    with_patterns,
)
from thermid.fit.joint_gas import separated
from thermid.fit.least_squares.solve import covariances, ended
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import Target, Unknown
from thermid.fit.uncertainty.wander import binned
from thermid.knowledge.values import FittedValues

if TYPE_CHECKING:
    from thermid.fit.calibration import Calibration
    from thermid.fit.coefficients import Course, Pattern
    from thermid.fit.uncertainty.wander import Wander

Array = NDArray[np.float64]
KEY = "structural"
"""Where the provenance of fitted values keeps it."""
Key = tuple[str, str]
"""Path of a conductor, and 'difference' or 'level'."""
ALIKE = 0.5
"""Correlation of two surfaces' exponents, and of their radiative shares: half of what they do not follow is the room's, half their own."""


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """What a fit leaves open in its model's structure; kept with its values, so that a file says what the fit does.

    Parameters
    ----------
    conditions : dict               Path of a coefficient's conductor -> where it was found.
    means, sizes : dict             (path, kind) -> mean and standard deviation of the exponent or the radiative share. [-]
    names : tuple of str            Fitted values.
    response : array (names, patterns)      What the fit would have found for a unit of each pattern, less what it found; fitted form.
    misfit : dict                   Node -> standard deviation of what wanders in its residuals, once the fit has done what it can. [K]
    surfaces : dict                 Path of a conductor -> mean temperatures of its surface and gas over the records. [K]
    separated : tuple of str        Contacts of which some record had another gas, or another pressure of it, than air on the ground.
    """

    conditions: Mapping[str, Conditions]
    means: Mapping[Key, float]
    sizes: Mapping[Key, float]
    names: tuple[str, ...]
    response: Array
    misfit: Mapping[str, float]
    surfaces: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    separated: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts for a file."""
        modes = [
            {"path": p, "kind": kind, "mean": self.means[p, kind], "sd": sd, "response": self.response[:, k].tolist()}
            for k, ((p, kind), sd) in enumerate(self.sizes.items())
        ]
        return {
            "conditions": {p: [c.difference, c.level] for p, c in self.conditions.items()},
            "modes": modes,
            "names": list(self.names),
            "misfit": dict(self.misfit),
            "surfaces": {p: list(at) for p, at in self.surfaces.items()},
            "separated": list(self.separated),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Discrepancy:
        """Return what `to_dict` gave."""
        modes, names = data["modes"], tuple(str(n) for n in data["names"])
        response = np.array([[float(x) for x in m["response"]] for m in modes]).reshape(len(modes), len(names)).T
        return cls(
            {p: Conditions(float(d), float(t)) for p, (d, t) in data["conditions"].items()},
            {(m["path"], m["kind"]): float(m["mean"]) for m in modes},
            {(m["path"], m["kind"]): float(m["sd"]) for m in modes},
            names,
            response,
            {n: float(x) for n, x in data["misfit"].items()},
            {p: (float(hot), float(cold)) for p, (hot, cold) in data["surfaces"].items()},
            tuple(data["separated"]),
        )

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
    IdentificationError   When the calibration does not hold what its fit left open.
    """
    kept = discrepancy_kept(fit.values)
    if kept is None:
        raise IdentificationError("this calibration does not hold what its fit left open. Run it again.", fit.stage)
    return kept


def discrepancy_kept(values: FittedValues) -> Discrepancy | None:
    """Return what fitted values keep of what their fit left open; None where they are of a file of before."""
    return kept_in(values.provenance)


def kept_in(provenance: Mapping[str, Any]) -> Discrepancy | None:
    """Return what the provenance of a stage keeps; None where it is of a file of before."""
    kept = provenance.get(KEY)
    return Discrepancy.from_dict(kept) if kept is not None else None


def with_discrepancy(fit: Calibration) -> Calibration:
    """Return a fit whose values keep what it leaves open."""
    problem = fit.problem
    assert problem is not None
    at = np.array(list(fit.fitted.values()))
    runs = _runs(problem, at)
    own = [e.model.identity() == fit.model.identity() for e in problem.experiments]
    seen = [found for (_, found), here in zip(runs, own, strict=True) if here]
    conditions = conditions_of(seen)
    decided = _decided(problem, list(fit.values.assignments))
    before = fit.request.store.provenance.values() if fit.request is not None else ()
    conditions |= {p: c for known in before for p, c in _conditions(known).items() if p in conditions and p not in decided}
    ways = []
    for bench, (times, found), here in zip(problem.benches(), runs, own, strict=True):
        network = bench.wiring.network
        values = network.numbers({p: v.value for p, v in fit.values.assignments.items()} if here else {}).values
        ways.append(patterns_of(network, times, found, conditions, values) if here else [])
    sizes = {(p.path, p.kind): p.sd for several in ways for p in several}
    means = {(p.path, p.kind): p.mean for several in ways for p in several}
    response = _response(fit, problem, at, ways, list(sizes))
    place = {u.name: k for k, u in enumerate(problem.unknowns)}
    names = tuple(fit.values)
    misfit = misfit_found(problem, fit.wander) if fit.wander is not None else {}
    joints = separated(problem.experiments[0].network, [e.scenario.media() for e in problem.experiments])
    kept = Discrepancy(conditions, means, sizes, names, response[[place[n] for n in names]], misfit, _surfaces(seen), joints)
    known = {p: [c.difference, c.level] for p, c in conditions.items() if p in decided}
    provenance = {**fit.values.provenance, **({"conditions": known} if known else {}), "misfit": misfit, KEY: kept.to_dict()}
    store = replace(fit.store, provenance={**fit.store.provenance, fit.values.stage: provenance})
    return replace(fit, values=replace(fit.values, provenance=provenance), store=store)


def _surfaces(seen: Sequence[Mapping[str, Course]]) -> dict[str, tuple[float, float]]:
    """Return conductor -> mean temperatures of its ends over the records, weighted by the square of their difference. [K]"""
    out = {}
    for path in dict.fromkeys(p for run in seen for p in run):
        parts = [run[path] for run in seen if path in run]
        first, second = (np.concatenate(x) for x in zip(*((c.first, c.second) for c in parts), strict=True))
        weight = (first - second) ** 2
        if weight.sum() > 0.0:
            out[path] = (float(weight @ first / weight.sum()), float(weight @ second / weight.sum()))
    return out


def _runs(problem: Problem, at: Array) -> list[tuple[Array, dict[str, Course]]]:
    """Return times and the course of every constant coefficient, per record; no run where there is none."""
    if not any(constant_coefficients(e.network) for e in problem.experiments):
        return [(np.zeros(0), {}) for _ in problem.experiments]
    return [courses(b.wiring, b.engine, problem.inputs(i, at)[0], problem.options) for i, b in enumerate(problem.benches())]


def _decided(problem: Problem, paths: Sequence[str]) -> set[str]:
    """Return the conductors whose constant coefficient follows from some parameters."""
    network = problem.experiments[0].network
    touched = set(network.flat.parameters.downstream(paths))
    return {path for path, c in constant_coefficients(network).items() if coefficient_path(c) in touched}


def found_at(values: FittedValues) -> dict[str, Conditions]:
    """Return path of a conductor -> where its coefficient was found, as fitted values keep it."""
    return _conditions(values.provenance)


def _conditions(provenance: Mapping[str, Any]) -> dict[str, Conditions]:
    return {p: Conditions(float(d), float(t)) for p, (d, t) in provenance.get("conditions", {}).items()}


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


def misfit_found(problem: Problem, wander: Wander) -> dict[str, float]:
    """Return node -> standard deviation of what wanders in its residuals, over all records. [K]"""
    slow = {(t.record, t.sensor): t.slow for t in wander.traces}
    parts: dict[str, list[float]] = {}
    for e in problem.experiments:
        for o in e.observations:
            parts.setdefault(o.seat, []).append(slow.get((e.record.name, o.sensor), 0.0) * o.sigma(problem.noise) ** 2)
    return {n: float(np.sqrt(np.mean(several))) for n, several in parts.items()}


def misfit_kept(provenance: Mapping[str, Any]) -> dict[str, float]:
    """Return node -> standard deviation of what a stage could not follow, as its provenance keeps it; empty where it does not. [K]"""
    return {n: float(size) for n, size in provenance.get("misfit", {}).items()}
