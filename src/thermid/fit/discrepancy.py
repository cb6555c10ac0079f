"""Structural discrepancy: what constant coefficients and joints with gas leave out of a fit and of a prediction away from its conditions.

A conductance G that grows by a small part c of a pattern, ``G (1 + c p(t))``, is to first order the same as the heat ``c q(t) p(t)`` put
into the second end and taken from the first. So every pattern is a pair of heat loads of zero size, and the kernel's derivatives with
respect to their size are the answer of the whole network to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from thermid.arguments import takes_objects
from thermid.dual import value_of
from thermid.errors import IdentificationError
from thermid.fit.calibration import Calibration
from thermid.fit.minimisation import covariances, ended
from thermid.fit.problem.residuals import Problem
from thermid.fit.problem.unknowns import Influence, Unknown
from thermid.fit.regime_runs import regimes_of
from thermid.fit.regimes import KEY as REGIMES
from thermid.fit.uncertainty.noise import Autocorrelation, binned
from thermid.knowledge.values import FittedValues
from thermid.linear_algebra import Array, finite, square_root
from thermid.model.laws.signal import TableSignal
from thermid.model.parts.kinds import CARRIED_BY
from thermid.model.tree.flat import FlatConductor, FlatLoad
from thermid.model.tree.identity import identity_of
from thermid.network.medium import Media
from thermid.network.network import Network
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.physics.gas import GASES, REFERENCE
from thermid.results import Result
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.solver.engine import Engine
from thermid.simulation.solver.problem import Options, Traces
from thermid.simulation.solver.wiring import Wiring

POINTS = 301
MANY = 40
"""Assumed values beyond which none is solved again: each costs a derivative of every run."""
SMALL = 1e-3
"""Part of the reference difference below which a coefficient's growth with the difference no longer matters: no heat flows."""
EXPONENTS = (1.0 / 5.0, 1.0 / 3.0)
"""Of natural convection with the difference of temperature: 1/5 under a warm plate, 1/4 laminar, 1/3 turbulent (Incropera and others,
Fundamentals of Heat and Mass Transfer, 2011, 9.6); evenly between. 0 where air is blown, or a solid carries the heat."""
FREE_AIR, STREAM = "free air", "fan"
UNSAID = 0.5
"""Probability of free air where nobody says what carries the heat: one possibility is as likely as the other."""
BLACKEST = 0.95
FINISH = 0.15
"""What an emissivity of a deck is good to, relative. [-]"""


@dataclass(frozen=True)
class OperatingPoint:
    """Where a coefficient was found.

    Parameters
    ----------
    difference : float      Of temperature between its ends, geometric mean weighted by the heat that flows. [K]
    level : float           Mean temperature of its ends, weighted likewise. [K]
    """

    difference: float
    level: float

    def __str__(self) -> str:
        """Return them in words."""
        return f"{self.difference:.2g} K at {self.level - 273.15:.0f} degC"


@dataclass(frozen=True)
class CoefficientMode:
    """One way in which a coefficient may differ from a constant.

    Parameters
    ----------
    path : str      Of the conductor.
    kind : str      'difference' (grows with a power of the difference of temperature) or 'level' (part of it is radiation).
    mean, sd : float    Of the exponent, or of the radiative share, over what is possible. [-]
    ends : (str, str)
    watts : TableSignal   What a unit of it adds to the heat from the first end to the second. [W]
    unsaid : float      Its correlation with what carries the heat, free air or not; zero where the deck says it. [-]
    """

    path: str
    kind: str
    mean: float
    sd: float
    ends: tuple[str, str]
    watts: TableSignal
    unsaid: float = 0.0

    def names(self, boundaries: Sequence[str]) -> list[str]:
        """Return the loads that stand for it, one per end that is no boundary."""
        ends = zip(("from", "to"), self.ends, strict=True)
        return [f"pattern {self.kind} {which} {self.path}" for which, n in ends if n not in boundaries]


def constant_coefficients(network: Network) -> dict[str, FlatConductor]:
    """Return path -> conductor, of those whose constant coefficient stands for convection, or convection and radiation."""
    return {c.path: c for c in network.flat.conductors if c.kind == "effective" or (c.kind == "convection" and "htc" in c.fields)}


def unsaid_paths(network: Network) -> list[str]:
    """Return the conductors with a constant coefficient of which the deck does not say what carries the heat."""
    return [path for path, c in constant_coefficients(network).items() if CARRIED_BY not in c.words]


def steady_paths(network: Network) -> list[str]:
    """Return the conductors whose coefficient is constant by what the deck says: a stream or a solid carries the heat."""
    return [path for path, c in constant_coefficients(network).items() if c.words.get(CARRIED_BY, FREE_AIR) != FREE_AIR]


def coefficient_path(c: FlatConductor) -> str:
    """Return the path of a conductor's coefficient."""
    return c.fields["effective_htc" if c.kind == "effective" else "htc"]


@dataclass(frozen=True, eq=False)
class FlowHistory:
    """The course of a conductor over time: differences and levels of its ends [K], and its heat flow [W]."""

    first: Array
    second: Array
    heat: Array

    @property
    def difference(self) -> Array:
        """Difference of temperature (times,), without sign. [K]"""
        return np.abs(self.first - self.second)

    @property
    def level(self) -> Array:
        """Mean temperature (times,). [K]"""
        return 0.5 * (self.first + self.second)


def courses(wiring: Wiring, engine: Engine, x: Array | None, options: Options) -> tuple[Array, dict[str, FlowHistory]]:
    """Return times [s], and path -> course of every constant coefficient that acts in a run at some values of its free names."""
    end = wiring.scenario.seconds
    times = np.linspace(0.0, end, POINTS)
    a = engine.started(wiring.assemble(x, False))
    answer = engine.integrate(a, times, a.reduced.nodes, end, options)
    traces = Traces(wiring, a, times, a.reduced.nodes, answer.temperatures, answer.sensitivities)
    known = {n: traces.temperature(n) for n in (*wiring.network.nodes, *wiring.network.boundaries)}
    modes = dict(zip(engine.control_names, answer.states(times).T, strict=True))
    every = {**known, **{n: traces.temperature(n) for n in a.reduced.controllers}}
    flows = wiring.conductor_flows(a.numbers, known, times, wiring.shares(a.numbers, every.__getitem__, times, modes.__getitem__))
    forms: dict[str, list[str]] = {}
    for row in a.numbers.conductors:
        forms.setdefault(row.name, []).append(row.form if value_of(row.coefficients[0]) else "")
    wanted = constant_coefficients(wiring.network)
    return times, {
        p: FlowHistory(known[c.ends[0]], known[c.ends[1]], flows[p])
        for p, c in wanted.items()
        if forms.get(p) == ["linear"] and c.ends[0] != c.ends[1]
    }


def ending_settled(course: FlowHistory, first: float, second: float) -> FlowHistory:
    """Return a course that ends where it would settle, at temperatures of its ends [K]."""
    before = course.first[-1] - course.second[-1]
    heat = course.heat[-1] * (first - second) / before if abs(before) > 1e-12 else 0.0
    return FlowHistory(
        *(np.append(x[:-1], y) for x, y in zip((course.first, course.second, course.heat), (first, second, heat), strict=True))
    )


def conditions_of(found: Sequence[Mapping[str, FlowHistory]]) -> dict[str, OperatingPoint]:
    """Return path -> the conditions over several runs, weighted by the heat that flows."""
    out = {}
    for path in dict.fromkeys(p for run in found for p in run):
        parts = [run[path] for run in found if path in run]
        heat, difference, level = (np.concatenate(x) for x in zip(*((np.abs(c.heat), c.difference, c.level) for c in parts), strict=True))
        if heat.sum() > 0:
            seen = heat > 0
            mean = float(np.exp(heat[seen] @ np.log(np.maximum(difference[seen], 1e-9)) / heat[seen].sum()))
            out[path] = OperatingPoint(mean, float(heat @ level / heat.sum()))
    return out


def patterns_of(
    network: Network,
    times: Array,
    found: Mapping[str, FlowHistory],
    reference: Mapping[str, OperatingPoint],
    values: Mapping[str, Any],
    expected: Mapping[str, float] | None = None,
) -> list[CoefficientMode]:
    """Return the patterns of every constant coefficient in a run, about the conditions where each was found.

    Parameters
    ----------
    network : Network
    times : array (times,)  [s]
    found : dict            Path -> course.
    reference : dict        Path -> where its coefficient was found.
    values : dict           Path of a parameter -> value. [SI]
    expected : dict         Path -> exponent by which the heat of the pattern is right, not to first order alone. [-]
    """
    radiating = {c.path.removesuffix(".radiation") for c in network.flat.conductors if c.kind == "radiation"}
    out = []
    for path, c in constant_coefficients(network).items():
        if path not in found or path not in reference:
            continue
        course, at = found[path], reference[path]
        radiates = path not in radiating and c.words.get(CARRIED_BY, FREE_AIR) in (FREE_AIR, STREAM)
        share, spread = _radiative(c, value_of(values[coefficient_path(c)]), at, values) if radiates else (0.0, 0.0)
        free = {FREE_AIR: 1.0, "": UNSAID}.get(c.words.get(CARRIED_BY, ""), 0.0)
        lit = 1.0 if c.emissivity else free  # an emissivity of the deck radiates whatever carries the rest
        grown = np.log(np.maximum(course.difference, SMALL * at.difference) / at.difference)
        exponent = (expected or {}).get(path, 0.0)
        grown = np.expm1(exponent * grown) / exponent if exponent else grown
        warmer = (course.first**2 + course.second**2) * (course.first + course.second) / (4.0 * at.level**3) - 1.0
        low, high = EXPONENTS
        # of a coefficient that is part radiation only the rest grows with the difference
        grows = 0.5 * (low + high) * (1.0 - share), (low**2 + low * high + high**2) / 3.0 * ((1.0 - share) ** 2 + spread**2)
        ways = (("difference", free, *grows, grown), ("level", lit, share, share**2 + spread**2, warmer))
        for kind, probability, mean, square, course_of in ways:
            if probability * mean > 0.0:
                sd = float(np.sqrt(probability * square - (probability * mean) ** 2))
                unsaid = float(np.sqrt(probability * (1.0 - probability))) * mean / sd
                watts = TableSignal(times, course.heat * course_of, False)
                out.append(CoefficientMode(path, kind, probability * mean, sd, c.ends, watts, unsaid))
    return out


def alike(keys: Sequence[Key], unsaid: Mapping[Key, float]) -> Array:
    """Return the correlations (patterns, patterns) of the patterns of all coefficients.

    Half of what two surfaces do not follow is the surroundings', half their own (`ALIKE`). Exponent and radiative share of one surface
    are independent, but for what carries its heat, where the deck does not say it: either both are there or neither (`unsaid`).
    """
    place = np.array([[1.0 if a[0] == b[0] else ALIKE for b in keys] for a in keys]).reshape(len(keys), len(keys))
    kinds = {kind: k for k, kind in enumerate(dict.fromkeys(kind for _, kind in keys), 1)}
    parts = np.zeros((len(keys), 1 + len(kinds)))
    for row, key in zip(parts, keys, strict=True):
        row[0] = unsaid.get(key, 0.0)
        row[kinds[key[1]]] = np.sqrt(1.0 - row[0] ** 2)
    # the product of two matrices of correlations, element by element, is one (Schur)
    return np.asarray(place * (parts @ parts.T))


def _radiative(c: FlatConductor, coefficient: float, at: OperatingPoint, values: Mapping[str, Any]) -> tuple[float, float]:
    """Return mean and standard deviation of the part of a coefficient that is radiation: any emissivity, or the one that the deck gives."""
    # h_r = 4 eps sigma T^3 of a grey body in large surroundings, as a share of the coefficient (Incropera, 6th ed., Eq. 1.9 at T = T_sur)
    black = 4.0 * STEFAN_BOLTZMANN * at.level**3 / max(coefficient, 1e-9)
    if c.emissivity:
        known = min(1.0, value_of(values[c.emissivity]) * black)
        return known, FINISH * known
    most = min(1.0, BLACKEST * black)
    # uniform from 0 to the most
    return 0.5 * most, most / float(np.sqrt(12.0))


def with_patterns(network: Network, scenario: Scenario, patterns: Sequence[CoefficientMode]) -> tuple[Network, Scenario]:
    """Return a network and its scenario with a pair of loads for every pattern; ``scale.<load>`` frees their size."""
    loads, powers = [], {}
    for p in patterns:
        for name in p.names(network.boundaries):
            away = " from " in name
            node = p.ends[0] if away else p.ends[1]
            loads.append(FlatLoad(name, node, node, {}))
            powers[name] = replace(p.watts, values=-p.watts.values) if away else p.watts
    flat = replace(network.flat, loads=(*network.flat.loads, *loads))
    return replace(network, flat=flat), scenario.with_(loads=powers)


THINNEST: Final = 10e-6
"""Effective distance of machined surfaces that touch, from which the most that gas can carry follows. Yovanovich has 1.53 s (P/H)^-0.097,
3 to 15 micrometres for roughness s of 1 to 5 (Bejan and Kraus, Heat Transfer Handbook, 2003, section 4.16). [m]"""
MOST: Final = float(GASES["air"].k(REFERENCE)) / THINNEST
"""The most that gas between faces can carry. [W/(m^2 K)]"""


def bare_contacts(network: Network) -> list[FlatConductor]:
    """Return the contacts whose deck does not say what of them is gas: touching spots and gas between in one conductance."""
    own = network.flat.conductors
    return [c for c in own if c.kind == "contact" and "contact_conductance" in c.fields and "gap" not in c.fields]


def separated(network: Network, media: Sequence[Media]) -> tuple[str, ...]:
    """Return the contacts of which some record, by the states of its gases, had another gas or pressure than air on the ground."""
    return tuple(c.path for c in bare_contacts(network) if any(m.changed(g) for m in media for g in _gases(network, c)))


def losing_gas(network: Network, media: Media, seen: Sequence[str]) -> list[FlatConductor]:
    """Return the contacts whose gas a scenario changes, less those (`seen`) whose parts a record had separated."""
    return [c for c in bare_contacts(network) if c.path not in seen and any(media.changed(g) for g in _gases(network, c))]


def _gases(network: Network, joint: FlatConductor) -> list[str]:
    """Return the gases about the parts that a joint holds together; every gas of the model where these have no surface."""
    skins = [c for c in network.flat.conductors if c.kind in ("convection", "effective")]
    parts = {end for c in network.flat.conductors if c.kind == "contact" and set(c.ends) & set(joint.ends) for end in c.ends}
    near = [c.gas for c in skins if set(c.ends) & parts]
    return list(dict.fromkeys(near or [c.gas for c in skins] or network.boundaries))


KEY = "structural"
"""Where the provenance of fitted values keeps it."""
Key = tuple[str, str]
"""Path of a conductor, and 'difference' or 'level'."""
ALIKE = 0.5
"""Correlation of two surfaces' exponents, and of their radiative shares: half of what they do not follow is the room's, half their own."""


@dataclass(frozen=True, eq=False)
class Discrepancy(Result):
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
    unsaid : dict                   (path, kind) -> correlation with what carries the heat, where the deck does not say it. [-]
    assumed : dict                  Assumed value of a deck -> what the fit would have found for one more of its SI unit, less what it
                                    found (names,); fitted form.
    """

    conditions: Mapping[str, OperatingPoint]
    means: Mapping[Key, float]
    sizes: Mapping[Key, float]
    names: tuple[str, ...]
    response: Array
    misfit: Mapping[str, float]
    surfaces: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    separated: tuple[str, ...] = ()
    assumed: Mapping[str, Array] = field(default_factory=dict)
    unsaid: Mapping[Key, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts for a file."""
        modes = [
            {
                "path": p,
                "kind": kind,
                "mean": self.means[p, kind],
                "sd": sd,
                "response": self.response[:, k].tolist(),
                "unsaid": self.unsaid.get((p, kind), 0.0),
            }
            for k, ((p, kind), sd) in enumerate(self.sizes.items())
        ]
        return {
            "conditions": {p: [c.difference, c.level] for p, c in self.conditions.items()},
            "modes": modes,
            "names": list(self.names),
            "misfit": dict(self.misfit),
            "surfaces": {p: list(at) for p, at in self.surfaces.items()},
            "separated": list(self.separated),
            "assumed": {p: moved.tolist() for p, moved in self.assumed.items()},
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Discrepancy:
        """Return what `to_dict` gave."""
        modes, names = data["modes"], tuple(str(n) for n in data["names"])
        response = np.array([[float(x) for x in m["response"]] for m in modes]).reshape(len(modes), len(names)).T
        return cls(
            {p: OperatingPoint(float(d), float(t)) for p, (d, t) in data["conditions"].items()},
            {(m["path"], m["kind"]): float(m["mean"]) for m in modes},
            {(m["path"], m["kind"]): float(m["sd"]) for m in modes},
            names,
            response,
            {n: float(x) for n, x in data["misfit"].items()},
            {p: (float(hot), float(cold)) for p, (hot, cold) in data["surfaces"].items()},
            tuple(data["separated"]),
            {p: np.array(moved, dtype=float) for p, moved in data.get("assumed", {}).items()},
            {(m["path"], m["kind"]): float(m["unsaid"]) for m in modes if m.get("unsaid")},
        )

    @cached_property
    def root(self) -> Array:
        """A root L (patterns, directions) of the covariance of the patterns, ``L L'``."""
        sizes = np.array(list(self.sizes.values()))
        return sizes[:, None] * square_root(alike(list(self.sizes), self.unsaid)) if sizes.size else np.zeros((0, 0))

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

    In free air convection grows with the difference of temperature by a power (`EXPONENTS`), and what is radiation in a coefficient grows
    with the level. Behind a fan, a cold plate or leads neither does. A deck states which by ``carried_by``; where it does not, both
    possibilities count, each as likely. Each is taken as a consider parameter (Tapley, Schutz and Born, Statistical Orbit Determination,
    Elsevier 2004, section 6.2): not looked for, but not known to be zero; the fit's own response to it is counted, so that a coefficient
    is right where it was fitted and less so further off.

    Raises
    ------
    IdentificationError   When the calibration does not hold what its fit left open.
    """
    kept = discrepancy_kept(fit.values)
    if kept is None:
        raise IdentificationError("this calibration does not include the data on its model discrepancy. Run the fit again.", fit.stage)
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
    own = [identity_of(e.model) == identity_of(fit.model) for e in problem.experiments]
    seen = [found for (_, found), here in zip(runs, own, strict=True) if here]
    conditions = conditions_of(seen)
    decided = _decided(problem, list(fit.values.assignments))
    before = fit.request.store.provenance.values() if fit.request is not None else ()
    conditions |= {p: c for known in before for p, c in operating_points(known).items() if p in conditions and p not in decided}
    ways = []
    for bench, (times, found), here in zip(problem.benches(), runs, own, strict=True):
        network = bench.wiring.network
        values = network.numbers({p: v.value for p, v in fit.values.assignments.items()} if here else {}).values
        ways.append(patterns_of(network, times, found, conditions, values) if here else [])
    sizes = {(p.path, p.kind): p.sd for several in ways for p in several}
    means = {(p.path, p.kind): p.mean for several in ways for p in several}
    unsaid = {(p.path, p.kind): p.unsaid for several in ways for p in several if p.unsaid}
    response = _response(fit, problem, at, ways, list(sizes))
    place = {u.name: k for k, u in enumerate(problem.unknowns)}
    names = tuple(fit.values)
    misfit = misfit_found(problem, fit.autocorrelation) if fit.autocorrelation is not None else {}
    joints = separated(problem.experiments[0].network, [e.scenario.media() for e in problem.experiments])
    rows = [place[n] for n in names]
    assumed = {p: moved[rows] for p, moved in _moved_by_assumed(fit, problem, at).items()}
    kept = Discrepancy(conditions, means, sizes, names, response[rows], misfit, _surfaces(seen), joints, assumed, unsaid)
    known = {p: [c.difference, c.level] for p, c in conditions.items() if p in decided}
    regimes = regimes_of(fit, misfit)
    provenance = {**fit.values.provenance, **({"conditions": known} if known else {}), "misfit": misfit, KEY: kept.to_dict()}
    provenance |= {REGIMES: regimes.to_dict()} if regimes is not None else {}
    store = replace(fit.store, provenance={**fit.store.provenance, fit.values.stage: provenance})
    return replace(fit, values=replace(fit.values, provenance=provenance), store=store)


def _surfaces(seen: Sequence[Mapping[str, FlowHistory]]) -> dict[str, tuple[float, float]]:
    """Return conductor -> mean temperatures of its ends over the records, weighted by the square of their difference. [K]"""
    out = {}
    for path in dict.fromkeys(p for run in seen for p in run):
        parts = [run[path] for run in seen if path in run]
        first, second = (np.concatenate(x) for x in zip(*((c.first, c.second) for c in parts), strict=True))
        weight = (first - second) ** 2
        if weight.sum() > 0.0:
            out[path] = (float(weight @ first / weight.sum()), float(weight @ second / weight.sum()))
    return out


def _runs(problem: Problem, at: Array) -> list[tuple[Array, dict[str, FlowHistory]]]:
    """Return times and the course of every constant coefficient, per record; no run where there is none."""
    if not any(constant_coefficients(e.network) for e in problem.experiments):
        return [(np.zeros(0), {}) for _ in problem.experiments]
    return [courses(b.wiring, b.engine, problem.inputs(i, at)[0], problem.options) for i, b in enumerate(problem.benches())]


def _decided(problem: Problem, paths: Sequence[str]) -> set[str]:
    """Return the conductors whose constant coefficient follows from some parameters."""
    network = problem.experiments[0].network
    touched = set(network.flat.parameters.downstream(paths))
    return {path for path, c in constant_coefficients(network).items() if coefficient_path(c) in touched}


def operating_points(provenance: Mapping[str, Any]) -> dict[str, OperatingPoint]:
    """Return path of a conductor -> where its coefficient was found, as the provenance of fitted values keeps it."""
    return {p: OperatingPoint(float(d), float(t)) for p, (d, t) in provenance.get("conditions", {}).items()}


def _response(fit: Calibration, problem: Problem, at: Array, ways: Sequence[Sequence[CoefficientMode]], keys: Sequence[Key]) -> Array:
    """Return d fitted / d pattern (unknowns, patterns): ``-C J'K``, K the derivatives of the weighted residuals to the patterns."""
    size = len(problem.unknowns)
    if not size or not keys:
        return np.zeros((size, len(keys)))
    targets: dict[Key, list[Influence]] = {k: [] for k in keys}
    experiments = []
    for i, (experiment, several) in enumerate(zip(problem.experiments, ways, strict=True)):
        network, scenario = with_patterns(experiment.network, experiment.scenario, several)
        experiments.append(replace(experiment, network=network, scenario=scenario))
        for p in several:
            targets[p.path, p.kind] += [Influence(i, f"scale.{n}") for n in p.names(network.boundaries)]
    more = tuple(Unknown(f"{kind} {path}", "pattern", tuple(t), 0.0) for (path, kind), t in targets.items())
    wide = replace(problem, experiments=tuple(experiments), unknowns=(*problem.unknowns, *more), coupled=())
    return _moved_by(fit, problem, wide, np.concatenate([at, np.zeros(len(more))]))


def _moved_by_assumed(fit: Calibration, problem: Problem, at: Array) -> dict[str, Array]:
    """Return assumed value of the deck -> what every unknown (unknowns,) would move by for one more of its SI unit.

    So a spread of an assumed value is solved again: it cancels where the fit pins the answer, and opens where it does not.
    """
    if not problem.unknowns or any(identity_of(e.model) != identity_of(fit.model) for e in problem.experiments):
        return {}
    table = problem.experiments[0].network.flat.parameters.table
    free = {t.name for u in problem.unknowns for t in u.targets}
    free |= {p for e in problem.experiments for p in e.scenario.driven(e.network.flat)}
    paths = [p for p, e in table.items() if e.parameter.source == "assumed" and e.parameter.is_literal and p not in free]
    if not paths or len(paths) > MANY:
        return {}
    values = problem.experiments[0].network.numbers({p: v.value for p, v in fit.values.assignments.items()}).values
    runs = range(len(problem.experiments))
    more = [Unknown(p, "parameter", tuple(Influence(i, p) for i in runs), float(value_of(values[p]))) for p in paths]
    wide = replace(problem, unknowns=(*problem.unknowns, *more), coupled=())
    moved = _moved_by(fit, problem, wide, np.concatenate([at, [u.start for u in more]]))
    return {p: moved[:, k] for k, p in enumerate(paths)}


def _moved_by(fit: Calibration, problem: Problem, wide: Problem, at: Array) -> Array:
    """Return what the unknowns of a fit would move by for a unit of those that `wide` has beyond them: ``-C J'K`` (unknowns, more).

    `at` are the unknowns of `wide` at the end of the fit.
    """
    size = len(problem.unknowns)
    level = max(1.0, fit.reduced_chi_square)
    known = finite(covariances(ended(problem, at[:size], fit.loss), level)[2])
    cross = np.zeros((size, at.size - size))
    for b in binned(wide, at, fit.loss).values():
        cross += b.slopes[:, :size].T @ (b.count[:, None] * b.slopes[:, size:])
    return np.asarray(-known @ cross / level)


def misfit_found(problem: Problem, autocorrelation: Autocorrelation) -> dict[str, float]:
    """Return node -> standard deviation of what wanders in its residuals, over all records. [K]"""
    slow = {(t.record, t.sensor): t.correlated_variance for t in autocorrelation.traces}
    parts: dict[str, list[float]] = {}
    for e in problem.experiments:
        for o in e.observations:
            parts.setdefault(o.seat, []).append(slow.get((e.record.name, o.sensor), 0.0) * o.sigma(problem.noise) ** 2)
    return {n: float(np.sqrt(np.mean(several))) for n, several in parts.items()}


def misfit_kept(provenance: Mapping[str, Any]) -> dict[str, float]:
    """Return node -> standard deviation of what a stage could not follow, as its provenance keeps it; empty where it does not. [K]"""
    return {n: float(size) for n, size in provenance.get("misfit", {}).items()}
