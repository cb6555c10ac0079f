"""Structural discrepancy: what constant coefficients and joints with gas leave out of a fit and of a prediction away from its conditions.

A conductance G that grows by a small part c of a pattern, ``G (1 + c p(t))``, is to first order the same as the heat ``c q(t) p(t)`` put
into the second end and taken from the first. So every pattern is a pair of heat loads of zero size, and the kernel's derivatives with
respect to their size are the answer of the whole network to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.dual import value_of
from thermid.base.errors import IdentificationError
from thermid.base.linear_algebra import Array, covariance, finite, pseudo_inverse, sandwich, square_root
from thermid.base.results import Result
from thermid.fit._calibration import Calibration
from thermid.fit._discrepancy.own_values import OWN, own_values_of
from thermid.fit._minimisation import covariances, ended
from thermid.fit._problem.request import key_for
from thermid.fit._problem.residuals import Influence, Problem, Unknown
from thermid.fit._uncertainty.noise import Autocorrelation, Binned, answers_to_inputs, autocorrelation_of_traces, binned, score_excess
from thermid.model.elements import CARRIED_BY, Law
from thermid.model.identity import identity_of
from thermid.model.laws import TableSignal
from thermid.model.tree import FlatConductor, FlatLoad
from thermid.physics.constants import STEFAN_BOLTZMANN
from thermid.physics.gas import GASES, REFERENCE
from thermid.simulation.network import Media, Network
from thermid.simulation.scenarios import Scenario
from thermid.simulation.solver import Engine, Options, Traces, Wiring
from thermid.values.fitted import FittedValues

POINTS = 301
MANY = 40
"""Assumed values beyond which none is solved again: each costs a derivative of every run."""
SMALL = 1e-3
"""Part of the reference difference below which a coefficient's growth with the difference no longer matters: no heat flows."""
EXPONENTS = (1.0 / 5.0, 1.0 / 3.0)
"""Of natural convection with the difference of temperature: 1/5 under a warm plate, 1/4 laminar, 1/3 turbulent (Incropera and others,
Fundamentals of Heat and Mass Transfer, 2011, 9.6); evenly between. 0 where air is blown, or a solid carries the heat."""
FREE_AIR, STREAM = "free air", "fan"
EXPECTED = "expected"
"""Kind of a mode that is no doubt: the heat that is expected beyond the constant's and the means of the other modes."""
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
        return names_of_loads(self, boundaries)


def names_of_loads(of: CoefficientMode | ExpectedHeat, boundaries: Sequence[str]) -> list[str]:
    """Return the loads that stand for a heat between two ends, one per end that is no boundary."""
    ends = zip(("from", "to"), of.ends, strict=True)
    return [f"pattern {of.kind} {which} {of.path}" for which, n in ends if n not in boundaries]


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


@dataclass(frozen=True)
class ExpectedHeat:
    """What the heat of a coefficient is expected to be beside that of the constant, and how it holds its own difference down.

    Parameters
    ----------
    path : str
    ends : (str, str)
    watts : TableSignal     From the first end to the second, less what a unit of each mode adds times the mean of that mode. [W]
    stiffness : float       Conductance beside the constant one by which the heat follows the difference, about `about`. [W/K]
    about : Array           Difference of temperature of the run of the model (times,). [K]
    kind, mean, sd, unsaid  As those of a mode: it is sure, and of size 1.
    """

    path: str
    ends: tuple[str, str]
    watts: TableSignal
    stiffness: float
    about: Array
    kind: str = EXPECTED
    mean: float = 1.0
    sd: float = 0.0
    unsaid: float = 0.0

    def names(self, boundaries: Sequence[str]) -> list[str]:
        """Return the loads that stand for it, one per end that is no boundary."""
        return names_of_loads(self, boundaries)


@dataclass(frozen=True)
class _Way:
    """What is possible of one coefficient: probability of free air, of radiation, radiative share if there is some, and its spread."""

    free: float
    lit: float
    share: float
    spread: float
    known: bool

    @property
    def exponent(self) -> float:
        """Mean exponent in free air. [-]"""
        return 0.5 * sum(EXPONENTS)

    @property
    def of_convection(self) -> float:
        """Part of the radiative share's effect that convection, which it takes the place of, has with a growing coefficient. [-]"""
        return self.free if self.known or self.free == 1.0 else 0.0

    def grown(self, ratio: Array) -> Array:
        """Return what convection grows by in free air (times,), at ratios of differences. [-]"""
        return np.asarray(np.expm1(self.exponent * np.log(ratio)))

    def per_exponent(self, ratio: Array) -> Array:
        """Return what one more of the exponent adds to the heat (times,), in parts of the constant's.

        In free air the tangent at its mean; where that is not said, the way from none to free air. [-]
        """
        return self.grown(ratio) / self.exponent if self.free < 1.0 else np.log(ratio) * (1.0 + self.grown(ratio))

    def per_share(self, ratio: Array, warmer: Array) -> Array:
        """Return what one more of the radiative share adds to the heat (times,), in parts of the constant's. [-]"""
        return warmer - self.of_convection * self.grown(ratio)

    def expected(self, ratio: Array, warmer: Array) -> Array:
        """Return the expected heat beyond the constant's (times,), in parts of that. [-]"""
        return self.free * (1.0 - self.share) * self.grown(ratio) + self.lit * self.share * warmer


def _way(c: FlatConductor, radiates: bool, coefficient: float, at: OperatingPoint, values: Mapping[str, Any]) -> _Way:
    share, spread = _radiative(c, coefficient, at, values) if radiates else (0.0, 0.0)
    free = {FREE_AIR: 1.0, "": UNSAID}.get(c.words.get(CARRIED_BY, ""), 0.0)
    known = bool(c.emissivity)
    return _Way(free, 1.0 if known else free, share, spread, known)  # an emissivity of the deck radiates whatever carries the rest


def _ways(
    network: Network, found: Mapping[str, FlowHistory], reference: Mapping[str, OperatingPoint], values: Mapping[str, Any]
) -> dict[str, tuple[FlatConductor, _Way]]:
    """Return path -> conductor and what is possible of it, of every constant coefficient that acts in a run."""
    radiating = {c.path.removesuffix(".radiation") for c in network.flat.conductors if c.kind == "radiation"}
    out = {}
    for path, c in constant_coefficients(network).items():
        if path in found and path in reference:
            radiates = path not in radiating and c.words.get(CARRIED_BY, FREE_AIR) in (FREE_AIR, STREAM)
            out[path] = c, _way(c, radiates, float(value_of(values[coefficient_path(c)])), reference[path], values)
    return out


def growth(course: FlowHistory, at: OperatingPoint) -> tuple[Array, Array]:
    """Return the ratio of differences, and what linearised radiation grows by with the level (times,). [-]"""
    ratio = np.maximum(course.difference, SMALL * at.difference) / at.difference
    return ratio, (course.first**2 + course.second**2) * (course.first + course.second) / (4.0 * at.level**3) - 1.0


def patterns_of(
    network: Network, times: Array, found: Mapping[str, FlowHistory], reference: Mapping[str, OperatingPoint], values: Mapping[str, Any]
) -> list[CoefficientMode]:
    """Return the patterns of every constant coefficient in a run, about the conditions where each was found.

    Parameters
    ----------
    network : Network
    times : array (times,)  [s]
    found : dict            Path -> course.
    reference : dict        Path -> where its coefficient was found.
    values : dict           Path of a parameter -> value. [SI]

    Notes
    -----
    A coefficient G0 that was found at a difference d0 and a level T0 is, in free air, ``G0 ((1 - s) (d/d0)^n + s (T/T0)^3)`` with the
    exponent n and the radiative share s. Modes are ``n (1 - s)``, with s at its mean, and s; what each adds is the derivative there.
    """
    out = []
    low, high = EXPONENTS
    for path, (c, way) in _ways(network, found, reference, values).items():
        course = found[path]
        ratio, warmer = growth(course, reference[path])
        own, share = 1.0 - way.share, (way.share, way.share**2 + way.spread**2)
        # of a coefficient that is part radiation only the rest grows with the difference
        grows = way.exponent * own, (low**2 + low * high + high**2) / 3.0 * own**2
        ways = (("difference", way.free, *grows, way.per_exponent(ratio)), ("level", way.lit, *share, way.per_share(ratio, warmer)))
        for kind, probability, mean, square, course_of in ways:
            if probability * mean > 0.0:
                # the band must hold whichever carries the heat: its own doubt counts whole, not with the chance that it is there
                apart = probability * (1.0 - probability) * mean**2
                sd = float(np.sqrt(apart + square - mean**2))
                unsaid = float(np.sqrt(apart)) / sd
                watts = TableSignal(times, course.heat * course_of, False)
                out.append(CoefficientMode(path, kind, probability * mean, sd, c.ends, watts, unsaid))
    return out


def expected_heats(
    network: Network,
    times: Array,
    found: Mapping[str, FlowHistory],
    reference: Mapping[str, OperatingPoint],
    values: Mapping[str, Any],
    plain: Mapping[str, FlowHistory],
    modes: Sequence[CoefficientMode],
) -> list[ExpectedHeat]:
    """Return the expected heat of every constant coefficient in a run, and by what conductance it follows the difference.

    A coefficient that grows with the difference holds it down: an error of its heat moves the temperatures by less than it would beside
    the constant. `found` are courses at the temperatures that are expected, `plain` those of the run of the model.
    """
    out = []
    for path, (c, way) in _ways(network, found, reference, values).items():
        course, before = found[path], plain[path].first - plain[path].second
        ratio, warmer = growth(course, reference[path])
        level = reference[path].level
        own = [x for x, end in zip((course.first, course.second), c.ends, strict=True) if end not in network.boundaries]
        steeper = np.mean([(x / level) ** 3 for x in own], axis=0) - 1.0 if own else np.zeros(times.size)
        slope = way.free * (1.0 - way.share) * (way.grown(ratio) * (1.0 + way.exponent) + way.exponent) + way.lit * way.share * steeper
        weight = np.abs(course.heat)
        apart = course.first - course.second
        flowing = np.abs(apart) > SMALL * reference[path].difference
        if not (weight[flowing] > 0.0).any():
            continue
        constant = float(weight[flowing].sum() / np.abs(apart[flowing]).sum())
        said = CARRIED_BY in c.words  # otherwise the coefficient may be constant, and the wider band stands
        stiffness = max(0.0, constant * float(weight @ slope / weight.sum())) if said else 0.0
        mean = {m.kind: m.mean for m in modes if m.path == path}
        moved = mean.get("difference", 0.0) * way.per_exponent(ratio) + mean.get("level", 0.0) * way.per_share(ratio, warmer)
        watts = course.heat * (way.expected(ratio, warmer) - moved) - stiffness * (apart - before)
        out.append(ExpectedHeat(path, c.ends, TableSignal(times, watts, False), stiffness, before))
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


@dataclass(frozen=True)
class _Held:
    """A recipe of a conductance that no deck has."""

    conductance: float

    def __call__(self, fields: Mapping[str, Any]) -> Law:
        return Law("linear", (self.conductance,))


def with_patterns(network: Network, scenario: Scenario, patterns: Sequence[CoefficientMode | ExpectedHeat]) -> tuple[Network, Scenario]:
    """Return a network and its scenario with a pair of loads for every pattern; ``scale.<load>`` frees their size.

    What holds a difference down is a conductance beside the constant one, and the heat that it would take from the run of the model back.
    """
    loads: list[FlatLoad] = []
    more: list[FlatConductor] = []
    powers = {}

    def pair(name: str, at: str, watts: TableSignal) -> None:
        loads.append(FlatLoad(name, at, at, {}))
        powers[name] = watts

    for p in patterns:
        for name in p.names(network.boundaries):
            away = " from " in name
            pair(name, p.ends[0] if away else p.ends[1], replace(p.watts, values=-p.watts.values) if away else p.watts)
        if isinstance(p, ExpectedHeat) and p.stiffness:
            more.append(FlatConductor(f"stiffness of {p.path}", "conduction", p.ends, {}, recipe=_Held(p.stiffness)))
            for end, sign in zip(p.ends, (1.0, -1.0), strict=True):
                if end not in network.boundaries:
                    pair(f"stiffness {sign:+g} of {p.path}", end, replace(p.watts, values=sign * p.stiffness * p.about))
    flat = replace(network.flat, loads=(*network.flat.loads, *loads), conductors=(*network.flat.conductors, *more))
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


@dataclass(frozen=True)
class Accounted:
    """What is left of a fit's noise and misfit once what its constant coefficients leave out is counted by itself.

    Parameters
    ----------
    key : str       Of the stage: its sources of noise begin with it.
    noise : dict    Fitted value -> its error by noise, in parts of the one that it has with the fit. [-]
    misfit : dict   Node -> standard deviation of what still wanders. [K]
    """

    key: str
    noise: Mapping[str, float]
    misfit: Mapping[str, float]


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
    accounted : Accounted or None   What is left of noise and misfit where the deck says what carries the heat.
    of_assumed : dict               Assumed value of a deck -> variance that the readings alone leave it with all else open, and how far
                                    from the deck's they ask it to be; SI units. Without an entry they say nothing.
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
    accounted: Accounted | None = None
    of_assumed: Mapping[str, tuple[float, float]] = field(default_factory=dict)

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
            "of_assumed": {p: list(said) for p, said in self.of_assumed.items()},
            **({"accounted": asdict(self.accounted)} if self.accounted is not None else {}),
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
            Accounted(**data["accounted"]) if data.get("accounted") else None,
            {p: (float(variance), float(shift)) for p, (variance, shift) in data.get("of_assumed", {}).items()},
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
            items[p] = replace(v, error=max(v.error, error))  # an error that counts other doubts is not made smaller
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
    ways: list[list[CoefficientMode | ExpectedHeat]] = []
    for bench, (times, found), here in zip(problem.benches(), runs, own, strict=True):
        network = bench.wiring.network
        values = network.numbers({p: v.value for p, v in fit.values.assignments.items()} if here else {}).values
        modes = patterns_of(network, times, found, conditions, values) if here else []
        heats = expected_heats(network, times, found, conditions, values, found, modes)
        ways.append([*modes, *(replace(h, stiffness=0.0) for h in heats if h.path in {m.path for m in modes})])
    sizes = {(p.path, p.kind): p.sd for several in ways for p in several}
    means = {(p.path, p.kind): p.mean for several in ways for p in several}
    unsaid = {(p.path, p.kind): p.unsaid for several in ways for p in several if p.unsaid}
    more = np.concatenate([at, np.zeros(len(sizes))])
    pieces = binned(_with_ways(problem, ways, list(sizes)), more, fit.loss) if sizes and problem.unknowns else {}
    response = _moved_in(fit, problem, more, pieces) if pieces else np.zeros((len(problem.unknowns), len(sizes)))
    place = {u.name: k for k, u in enumerate(problem.unknowns)}
    names = tuple(fit.values)
    misfit = misfit_found(problem, fit.autocorrelation) if fit.autocorrelation is not None else {}
    joints = separated(problem.experiments[0].network, [e.scenario.media() for e in problem.experiments])
    rows = [place[n] for n in names]
    moved, said = _moved_by_assumed(fit, problem, at)
    assumed = {p: each[rows] for p, each in moved.items()}
    kept = Discrepancy(conditions, means, sizes, names, response[rows], misfit, _surfaces(seen), joints, assumed, unsaid, of_assumed=said)
    kept = replace(kept, accounted=_accounted(fit, problem, kept, response, pieces))
    known = {p: [c.difference, c.level] for p, c in conditions.items() if p in decided}
    alone = [o.to_dict() for o in own_values_of(fit)]
    provenance = {**fit.values.provenance, **({"conditions": known} if known else {}), "misfit": misfit, KEY: kept.to_dict()}
    provenance |= {OWN: alone} if alone else {}
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


def _with_ways(problem: Problem, ways: Sequence[Sequence[CoefficientMode | ExpectedHeat]], keys: Sequence[Key]) -> Problem:
    """Return a problem with the size of every pattern as a further unknown."""
    targets: dict[Key, list[Influence]] = {k: [] for k in keys}
    experiments = []
    for i, (experiment, several) in enumerate(zip(problem.experiments, ways, strict=True)):
        network, scenario = with_patterns(experiment.network, experiment.scenario, several)
        experiments.append(replace(experiment, network=network, scenario=scenario))
        for p in several:
            targets[p.path, p.kind] += [Influence(i, f"scale.{n}") for n in p.names(network.boundaries)]
    more = tuple(Unknown(f"{kind} {path}", "pattern", tuple(t), 0.0) for (path, kind), t in targets.items())
    return replace(problem, experiments=tuple(experiments), unknowns=(*problem.unknowns, *more), coupled=())


def _accounted(
    fit: Calibration, problem: Problem, kept: Discrepancy, response: Array, pieces: Mapping[tuple[str, str], Binned]
) -> Accounted | None:
    """Return what is left of noise and misfit once what coefficients are known to do is counted by itself; None where it is not known.

    What wanders in the residuals is, where a deck states free air, mostly what a constant coefficient cannot follow of it. A band that
    counts the law counts that already. The residuals less what is expected of it, with what is doubtful of it as further causes, tell
    what else wanders.

    Parameters
    ----------
    response : array (unknowns, patterns)   What the fit would have found for a unit of each pattern, less what it found.
    pieces : dict                           Residuals in stretches, with derivatives to unknowns and patterns.
    """
    if not kept.sizes or kept.unsaid or fit.request is None:
        return None
    size = len(problem.unknowns)
    found = ended(problem, np.array(list(fit.fitted.values())), fit.loss)
    means, root = np.array(list(kept.means.values())), kept.root
    own = {key: replace(b, slopes=b.slopes[:, :size]) for key, b in pieces.items()}
    answers = {key: b.slopes[:, size:] + b.slopes[:, :size] @ response for key, b in pieces.items()}
    calm = {key: replace(b, mean=b.mean + answers[key] @ means) for key, b in own.items()}
    less = sum(float(b.count @ (calm[key].mean ** 2 - b.mean**2)) for key, b in own.items())
    calm = {k: replace(b, squares=b.squares + float(b.count @ (b.mean**2 - own[k].mean ** 2))) for k, b in calm.items()}
    inputs = answers_to_inputs(problem, found.fitted, own)
    causes = {key: np.concatenate([inputs.get(key, np.zeros((a.shape[0], 0))), a @ root], axis=1) for key, a in answers.items()}
    left = autocorrelation_of_traces(calm, replace(found, chi_square=found.chi_square + less), problem.effective_samples, causes)
    excess = score_excess(own, left.traces, left.variance_factor, inputs)
    was = fit.autocorrelation
    assert was is not None
    before = np.diag(finite(covariances(found, was.variance_factor, was.score_excess)[1]))
    after = np.diag(finite(covariances(found, left.variance_factor, excess)[1]))
    names = [u.name for u in problem.unknowns]
    place = [names.index(n) for n in kept.names]
    parts = np.clip(after[place] / np.where(before[place] > 0.0, before[place], np.inf), 0.0, 1.0) ** 0.5
    noise = dict(zip(kept.names, parts.tolist(), strict=True))
    misfit = misfit_found(problem, left)
    return Accounted(key_for(fit.request)[:16], noise, {n: min(x, kept.misfit.get(n, x)) for n, x in misfit.items()})


def _moved_by_assumed(fit: Calibration, problem: Problem, at: Array) -> tuple[dict[str, Array], dict[str, tuple[float, float]]]:
    """Return assumed value of the deck -> what every unknown (unknowns,) would move by for one more of its SI unit, and `_said_of`.

    So a spread of an assumed value is solved again: it cancels where the fit pins the answer, and opens where it does not.
    """
    if not problem.unknowns or any(identity_of(e.model) != identity_of(fit.model) for e in problem.experiments):
        return {}, {}
    table = problem.experiments[0].network.flat.parameters.table
    free = {t.name for u in problem.unknowns for t in u.targets}
    free |= {p for e in problem.experiments for p in e.scenario.driven(e.network.flat)}
    paths = [p for p, e in table.items() if e.parameter.source == "assumed" and e.parameter.is_literal and p not in free]
    if not paths or len(paths) > MANY:
        return {}, {}
    values = problem.experiments[0].network.numbers({p: v.value for p, v in fit.values.assignments.items()}).values
    runs = range(len(problem.experiments))
    more = [Unknown(p, "parameter", tuple(Influence(i, p) for i in runs), float(value_of(values[p]))) for p in paths]
    wide = replace(problem, unknowns=(*problem.unknowns, *more), coupled=())
    ends = np.concatenate([at, [u.start for u in more]])
    pieces = binned(wide, ends, fit.loss)
    moved = _moved_in(fit, problem, ends, pieces)
    return {p: moved[:, k] for k, p in enumerate(paths)}, _said_of(fit, problem, paths, at, pieces)


def _said_of(
    fit: Calibration, problem: Problem, paths: Sequence[str], at: Array, pieces: Mapping[tuple[str, str], Binned]
) -> dict[str, tuple[float, float]]:
    """Return assumed value -> variance that the readings leave it with all else open, and how far away they ask it to be; SI units.

    Without a word of the deck's range: with other assumed values open too, so that what they can only say of several together counts for
    none of them. Values of which they say nothing are left out.
    """
    noise = fit.autocorrelation
    if noise is None:
        return {}
    level, size = noise.variance_factor, at.size
    left, priors = problem.prior_rows(at)
    priors = np.concatenate([priors, np.zeros((priors.shape[0], len(paths)))], axis=1)
    rows = np.concatenate([*(np.sqrt(b.count / level)[:, None] * b.slopes for b in pieces.values()), priors])
    known = pseudo_inverse(rows)  # whole: of what cannot be separated only the values that take no part in it are used below
    excess = score_excess(pieces, noise.traces, level, {})
    variance = np.diag(covariance(rows) + sandwich(known, excess) / level**2)
    score = sum((b.slopes.T @ (b.count * b.mean) for b in pieces.values()), np.zeros(rows.shape[1])) / level + priors.T @ left
    step = np.abs(known @ score)
    return {p: (float(variance[k]), float(step[k])) for k, p in enumerate(paths, size) if np.isfinite(variance[k])}


def _moved_in(fit: Calibration, problem: Problem, at: Array, pieces: Mapping[tuple[str, str], Binned]) -> Array:
    """Return the same of residuals in stretches of time, with derivatives to all unknowns of the wide problem."""
    size = len(problem.unknowns)
    level = max(1.0, fit.reduced_chi_square)
    known = finite(covariances(ended(problem, at[:size], fit.loss), level)[2])
    cross = np.zeros((size, at.size - size))
    for b in pieces.values():
        cross += b.slopes[:, :size].T @ (b.count[:, None] * b.slopes[:, size:])
    return np.asarray(-known @ cross / level)


ROUNDING: Final = 1e-6
"""What wanders by less is the end of a search or of a step, not what a model does not follow. [K]"""


def misfit_found(problem: Problem, autocorrelation: Autocorrelation) -> dict[str, float]:
    """Return node -> standard deviation of what wanders in its residuals, over all records; 0 below `ROUNDING`. [K]"""
    slow = {(t.record, t.sensor): t.correlated_variance for t in autocorrelation.traces}
    parts: dict[str, list[float]] = {}
    for e in problem.experiments:
        for o in e.observations:
            parts.setdefault(o.seat, []).append(slow.get((e.record.name, o.sensor), 0.0) * o.sigma(problem.noise) ** 2)
    sizes = {n: float(np.sqrt(np.mean(several))) for n, several in parts.items()}
    return {n: size if size >= ROUNDING else 0.0 for n, size in sizes.items()}


def misfit_kept(provenance: Mapping[str, Any]) -> dict[str, float]:
    """Return node -> standard deviation of what a stage could not follow, as its provenance keeps it; empty where it does not. [K]"""
    return {n: float(size) for n, size in provenance.get("misfit", {}).items()}
