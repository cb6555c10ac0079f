"""`ErrorModel`: what a fit leaves open, as a value that stands on its own: no logs and no problem behind it, plain numbers in a file.

A way in which the heat of surfaces may be carried has its own posterior of values and departures; members of sizes are collapsed to
their mean and covariance, which is all that a straight answer asks of them. Values come first in the triangular root of that
covariance, so that what is left of departures once the values are known has unknowns of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, ThermidError, quoted
from thermid.base.results import Result, Row
from thermid.base.units import Array
from thermid.fit._calibration import FIRST, Calibration, contradicted, far_from_sheet
from thermid.fit._error_model.courses import FREE_AIR, OperatingPoint
from thermid.fit._error_model.elements import (
    ANOTHER,
    AS_BUILT,
    BEND_OF,
    CONDUCTANCE_OF,
    EXPONENT_OF,
    JOINT,
    LAW,
    SHARE_OF,
    SURFACE,
    TREND_OF,
    WITH_ENTRIES,
    WITH_PATHS,
    ElementLaw,
    JointLaw,
    PathLaw,
    SurfaceLaw,
    Way,
    linear_recipe,
    ways_of,
)
from thermid.fit._error_model.gaussian import log_sum, weights_of
from thermid.fit._error_model.model import GROUPS, FittedWay, before, course_in_fit, fitted_way, left_prior, points_of
from thermid.fit._error_model.runs import Departures, Smooth, UnknownColumn, departures_of
from thermid.fit._error_model.sizes import (
    COUNTED,
    DEPARTURE_ODDS,
    FAR_SIZE,
    KEPT_OF_PRIOR,
    MIN_LOG_BAYES_FACTOR,
    OTHER_FINISH,
    OUTSIDE,
    SIZES,
)
from thermid.fit._problem.residuals import Problem, Unknown
from thermid.fit._uncertainty.information import square_between
from thermid.model.tree import CARRIED_BY, Standing, identity_of, outside
from thermid.physics.htc import BIOT_LIMIT
from thermid.simulation.runs import Network
from thermid.values.store import AS_FITTED, EXPECTED, INPUT, LaterTable, Normal, Source

ERRORS_KEY = "errors"
"""Where the provenance of fitted values keeps it."""
FOLLOWED = "prediction.error-not-followed"
"""Code of what is said of a fit whose elements cannot be followed."""
SIGNIFICANT_DIGITS = 7
"""Significant digits of a file."""


@dataclass(frozen=True)
class SeenValue:
    """A value of a fit that its runs share.

    Parameters
    ----------
    kind : str          'parameter', 'sensor' or 'input'.
    log : bool          Whether it is fitted by its logarithm.
    acts : tuple        (name, factor, offset) of what it acts on; nothing for a sensor.
    mean, sd : float    What was known of it before any reading; fitted form.
    low, high : float   Its bounds; fitted form.
    """

    kind: str
    log: bool
    acts: tuple[tuple[str, float, float], ...]
    mean: float
    sd: float
    low: float
    high: float

    @classmethod
    def of_unknown(cls, u: Unknown) -> SeenValue:
        """Return what an unknown of a fit is."""
        shared = ((t.name, float(t.factor), float(t.offset)) for t in u.targets) if u.kind == INPUT else ()
        acts = ((p, 1.0, 0.0) for p in (u.name, *u.also)) if u.kind == "parameter" else dict.fromkeys(shared)
        return cls(u.kind, u.log, tuple(acts), *map(float, before(u)), *map(float, u.fitted_bounds()))

    def si(self, fitted: float) -> float:
        """Return the value of a fitted form. [SI]"""
        return float(np.exp(np.clip(fitted, -700.0, 700.0))) if self.log else fitted


@dataclass(frozen=True, eq=False)
class KeptWay:
    """The posterior where the heat of surfaces is carried in one way.

    Parameters
    ----------
    name : str              ``free air``, ``fan``, or ``as the deck says``.
    weight : float          Its probability by the readings, as likely as any other before them. [-]
    laws : dict             Conductor -> its law where the derivatives were taken.
    values : dict           Value -> where the derivatives were taken; fitted form.
    departures : Departures
    columns : tuple of UnknownColumn    Unknowns beside the values.
    mean : array (values + columns,)    Of all, less where the derivatives were taken.
    root : array (values + columns, values + columns)   Lower triangular root of the covariance of all.
    sizes : dict            Group -> root mean square of its size.
    left : tuple            (probability, size [K], time constant in parts of a run) of what no element explains.
    """

    name: str
    weight: float
    laws: Mapping[str, ElementLaw]
    values: Mapping[str, float]
    departures: Departures
    columns: tuple[UnknownColumn, ...]
    mean: Array
    root: Array
    sizes: Mapping[str, float]
    left: tuple[tuple[float, float, float], ...]

    @property
    def places(self) -> dict[str, int]:
        """Value or column -> its place among the unknowns."""
        return {name: k for k, name in enumerate((*self.values, *(c.name for c in self.columns)))}

    @property
    def carrier(self) -> str:
        """What carries the heat, whatever the finish."""
        return self.name.partition(", ")[0]

    @property
    def beside_deck(self) -> tuple[bool, bool, bool]:
        """Whether a finish is not the deck's, and whether there is what the deck lacks: a path to a boundary, parts where heat enters."""
        return ANOTHER in self.name, self.name.endswith(WITH_PATHS), self.name.endswith(WITH_ENTRIES)

    @property
    def way(self) -> Way:
        """What of its laws is not known."""
        kinds = (EXPONENT_OF, SHARE_OF, TREND_OF, BEND_OF, CONDUCTANCE_OF)
        columns = {(c.source, kind): (c.group, c.size) for c in self.columns for kind in kinds if c.name == f"{kind} of {c.source}"}
        return Way(self.name, self.laws, columns)

    @property
    def left_over(self) -> float:
        """Root mean square of what no element explains, at a sensor. [K]"""
        return float(np.sqrt(sum(p * size**2 for p, size, _ in self.left)))

    def laws_in(self, network: Network) -> dict[str, ElementLaw]:
        """Return conductor -> its law in a network, of those that it has."""
        conductors = {c.path: c for c in network.flat.conductors}
        paths = {p: law for p, law in self.laws.items() if isinstance(law, PathLaw)}
        return {p: replace(law, linear=linear_recipe(conductors[p])) for p, law in self.laws.items() if p in conductors} | paths

    def agrees(self, network: Network) -> bool:
        """Return whether it is what the deck of a network says of its surfaces, as far as that says anything."""
        free_air = {c.path: c.words[CARRIED_BY] == FREE_AIR for c in network.flat.conductors if CARRIED_BY in c.words}
        return all(free_air[p] == (law.exponent > 0.0) for p, law in self.laws.items() if p in free_air and isinstance(law, SurfaceLaw))

    @property
    def elements(self) -> tuple[str, ...]:
        """Paths of the conductors and nodes whose departures it holds."""
        return (*self.laws, *self.departures.smooth, *self.departures.nodes, *(c.source for c in self.columns))

    def only(self, there: Collection[str], names: Mapping[str, str]) -> KeptWay:
        """Return what it says of some elements, and of the values in `names`, by their names then."""
        columns = [k for k, c in enumerate(self.columns) if c.source in there]
        kept = [*(k for k, n in enumerate(self.values) if n in names), *(len(self.values) + k for k in columns)]
        rows = self.root[kept]
        smooth = {p: x for p, x in self.departures.smooth.items() if p in there}
        return replace(
            self,
            laws={p: law for p, law in self.laws.items() if p in there},
            values={names[n]: x for n, x in self.values.items() if n in names},
            departures=replace(self.departures, smooth=smooth, nodes=tuple(n for n in self.departures.nodes if n in there)),
            columns=tuple(self.columns[k] for k in columns),
            mean=self.mean[kept],
            root=_triangular(rows @ rows.T),
        )

    def beside(self, other: KeptWay) -> KeptWay:
        """Return the way of both, of different values and elements, independent: its mean and root are theirs in blocks, values first."""
        mine, more = len(self.root), len(other.root)
        order = np.argsort([n not in w.values for w in (self, other) for n in w.places], kind="stable")  # values first
        root = np.block([[self.root, np.zeros((mine, more))], [np.zeros((more, mine)), other.root]])[order]
        a, b = self.departures, other.departures
        return replace(
            self,
            weight=self.weight * other.weight,
            laws={**self.laws, **other.laws},
            values={**self.values, **other.values},
            departures=replace(a, smooth={**a.smooth, **b.smooth}, hidden=tuple({*a.hidden, *b.hidden}), nodes=(*a.nodes, *b.nodes)),
            columns=(*self.columns, *other.columns),
            mean=np.concatenate([self.mean, other.mean])[order],
            root=_triangular(root @ root.T),
        )

    @classmethod
    def of_fitted(cls, way: FittedWay, shares: Array) -> KeptWay:
        """Return a way by its members and their probabilities `shares` (members,): their common mean and covariance, fitted form.

        With p the shares over their sum, mean sum p m_i and covariance sum p (C_i + m_i m_i') - mean mean'. Sizes are roots of mean
        squares. Members below `COUNTED` of the mean share are left out of mean and covariance; so are pairs of size and time constant of
        what no element explains whose p, summed over members, is below it.
        """
        weight = float(shares.sum())
        every = shares / weight
        seen = np.flatnonzero(every > COUNTED / every.size)
        mean, covariance = way.members.at(seen).mixed(every[seen] / every[seen].sum())
        values = {way.runs.problem.unknowns[k].name: float(way.runs.fitted[k]) for k in way.runs.values}
        sizes = dict(zip(GROUPS, np.sqrt(every @ way.sizes**2).tolist(), strict=True))
        by_pair = {pair: float(every[(way.left == pair).all(axis=1)].sum()) for pair in {(float(a), float(b)) for a, b in way.left}}
        rest = tuple((share, *pair) for pair, share in sorted(by_pair.items()) if share > COUNTED)
        return cls(
            way.way.name, weight, way.laws, values, way.runs.departures, way.runs.columns, mean, _triangular(covariance), sizes, rest
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts for a file."""
        smooth = {
            p: {
                "at": [s.at.difference, s.at.level],
                "kind": s.kind,
                "pivots": _short(s.pivots),
                "centre": _short(s.centre),
                "thinned": list(s.thinned),
                "outside": s.outside,
            }
            for p, s in self.departures.smooth.items()
        }
        laws = {
            p: {k: x for k, x in vars(w).items() if k != "linear"}
            | ({} if isinstance(w, PathLaw) else {"at": [*vars(w.at).values()], "surface": isinstance(w, SurfaceLaw)})
            for p, w in self.laws.items()
        }
        return {
            "name": self.name,
            "weight": self.weight,
            "laws": laws,
            "values": dict(self.values),
            "smooth": smooth,
            "hidden": list(self.departures.hidden),
            "nodes": list(self.departures.nodes),
            "aside": self.departures.aside,
            "columns": [[c.name.removesuffix(f" of {c.source}"), c.group, c.size, c.source] for c in self.columns],
            "mean": _short(self.mean),
            "root": [_short(row[: k + 1]) for k, row in enumerate(self.root)],
            "sizes": dict(self.sizes),
            "left": [list(x) for x in self.left],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], at: str) -> KeptWay:
        """Return the way that `to_dict` gave, its paths behind `at`, such as "unit."; numbers are SI, the root lower triangular."""
        laws: dict[str, ElementLaw] = {}
        for p, w in data["laws"].items():
            if "node" in w:
                laws[at + p] = PathLaw(at + w["node"], at + w["beside"], w["end"], w["conductance"])
            else:
                fields = {k: x for k, x in w.items() if k != "surface"} | {"at": OperatingPoint(*map(float, w["at"])), "linear": None}
                laws[at + p] = SurfaceLaw(**fields) if w["surface"] else JointLaw(**fields)
        smooth = {
            at + p: Smooth(
                OperatingPoint(*map(float, s["at"])),
                s["kind"],
                np.array(s["pivots"], dtype=float).reshape(-1, 2),
                np.array(s["centre"], dtype=float),
                tuple(map(bool, s["thinned"])),
                float(s.get("outside", 0.0)),
            )
            for p, s in data["smooth"].items()
        }
        columns = tuple(UnknownColumn(f"{what} of {at}{p}", group, float(size), at + p) for what, group, size, p in data["columns"])
        size, mean = len(data["root"]), np.array(data["mean"], dtype=float)
        root = np.zeros((size, size))
        for k, row in enumerate(data["root"]):
            root[k, : k + 1] = row
        return cls(
            data["name"],
            float(data["weight"]),
            laws,
            {placed(n, at): float(x) for n, x in data["values"].items()},
            Departures(smooth, tuple(map(float, data["hidden"])), tuple(at + n for n in data["nodes"]), int(data["aside"])),
            columns,
            np.concatenate([np.zeros(size - mean.size), mean]),  # files before took derivatives where values are expected
            root,
            {n: float(x) for n, x in data["sizes"].items()},
            tuple((float(p), float(s), float(t)) for p, s, t in data["left"]),
        )


@dataclass(frozen=True, eq=False)
class ErrorModel(Result):
    """What a fit leaves open of its values and of its elements; see docs/statistics.md.

    Parameters
    ----------
    stage : str                 Of the fit.
    seen : dict                 Value that runs share -> what it is.
    ways : tuple of KeptWay     The posterior for each way in which heat of surfaces may be carried; none where elements are not followed.
    misfit : float              Root mean square of the readings over what is allowed of them, one is expected; with what the network,
                                run with the expected departures, misses of their straight lines, see `FittedWay.nonlinearity`. [-]
    why : str                   Why elements are not followed; empty where they are.
    spot : str                  A heated node whose sensor reads as at one end of its part, by 20 to 1; empty where there is none.
    gain : float                By how much ln of the evidence of the readings grows with what departs; not kept in files.
    """

    stage: str
    seen: Mapping[str, SeenValue] = field(default_factory=dict)
    ways: tuple[KeptWay, ...] = ()
    misfit: float = 1.0
    why: str = ""
    gain: float = 0.0
    spot: str = ""

    @classmethod
    def of_fit(cls, fit: Calibration) -> ErrorModel:
        """Return the model of error of a fit.

        Raises
        ------
        IdentificationError   When the calibration does not hold what its fit was asked, or its elements cannot be followed.
        """
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1):  # matrices of some hundred rows, as in a fit
            return cls._of_problem(fit, _problem_of(fit))

    @classmethod
    def _of_problem(cls, fit: Calibration, problem: Problem) -> ErrorModel:
        """Return the model of error of a fit that can be followed."""
        fitted = np.array(list(fit.fitted.values()))
        courses = [course_in_fit(problem, i, e.network, fitted) for i, e in enumerate(problem.experiments)]
        (points, paths), network = points_of(problem, courses), problem.experiments[0].network
        values = network.numbers({p: v.value for p, v in fit.values.assignments.items()}).values
        *departing, still = ways_of(network, points, values, paths)
        fitted_ways, as_built = list[FittedWay](), fitted_way(problem, fitted, still, points)
        for w in departing:
            fitted_ways.append(fitted_way(problem, fitted, w, points, fitted_ways[-1] if fitted_ways else None))
        total = sum(w.way.before for w in fitted_ways)
        logs = np.concatenate([w.members.log_evidence + math.log(w.way.before / total) for w in fitted_ways])
        shares = np.split(weights_of(logs), np.cumsum([len(w.left) for w in fitted_ways])[:-1])
        departs, holds = weights_of([log_sum(logs) + math.log(DEPARTURE_ODDS), log_sum(as_built.members.log_evidence)]).tolist()
        likeliest = max(zip(fitted_ways, shares, strict=True), key=lambda pair: float(pair[1].sum()))[0]
        apart = math.sqrt(sum(share @ w.members.square for w, share in zip(fitted_ways, shares, strict=True)))
        probabilities = [*(departs * share for share in shares), holds * weights_of(as_built.members.log_evidence)]
        all_ways = [*fitted_ways, as_built]
        if others := [(share, w) for share, w in zip(shares, fitted_ways, strict=True) if ANOTHER in w.way.name and share.any()]:
            # a finish that nobody measured may be another one where nothing else departs too, and no log in air tells of it
            share, other = max(others, key=lambda pair: float(pair[0].sum()))
            probabilities[-1:] = [(1.0 - OTHER_FINISH) * probabilities[-1], OTHER_FINISH * holds * share / share.sum()]
            all_ways.append(replace(other, way=replace(other.way, name=AS_BUILT + ANOTHER)))
        pairs = zip(all_ways, probabilities, strict=True)
        ways = normalised([KeptWay.of_fitted(w, share) for w, share in pairs if share.sum() > COUNTED * departs])
        fitted_values = {u.name: SeenValue.of_unknown(u) for u in problem.unknowns if u.name in ways[0].values}
        unmoved = as_built.runs.posteriors(np.zeros(len(as_built.runs.values)), np.zeros((1, len(GROUPS))))  # neither elements nor rooms
        gain, spot = log_sum(logs) - log_sum([left_prior()[r] + m.log_evidence[0] for r, m in unmoved.items()]), ""
        heated = {node for course in courses for node, _ in course.powers.values() if node in course.stores}
        spots = tuple(sorted(heated & {o.seat for e in problem.experiments for o in e.observations}))
        if gain > MIN_LOG_BAYES_FACTOR and spots:
            moved = fitted_way(problem, fitted, replace(likeliest.way, spots=spots), points, likeliest).members
            if log_sum(moved.log_evidence) - log_sum(likeliest.members.log_evidence) > MIN_LOG_BAYES_FACTOR:
                drops = np.abs(weights_of(moved.log_evidence) @ moved.mean)[-len(spots) :]
                spot = spots[int(np.argmax(drops))] if drops.max() > BIOT_LIMIT else ""  # below, a lag or leads of the sensor do as much
        found = cls(fit.stage, fitted_values, ways, math.hypot(apart, likeliest.nonlinearity()), gain=gain, spot=spot)
        # readings say nothing of conditions that no run had: there elements depart as in other ways, by what the runs leave of the variance
        names = {n for v in fitted_values.values() for n, *_ in v.acts}
        visited = departures_of([e.network for e in problem.experiments], courses, points, (), names, around=(0,)).smooth
        sizes = {kind: found.sizes[kind] for kind in (SURFACE, JOINT, LAW)}
        found = replace(
            found,
            ways=tuple(
                replace(w, departures=replace(w.departures, smooth=visited), sizes={**w.sizes, **sizes}) if w.name == AS_BUILT else w
                for w in ways
            ),
        )
        return found if found.contradiction else found.at_means

    @property
    def departing(self) -> ErrorModel:
        """What it says where some element departs from its law."""
        return replace(self, ways=normalised([w for w in self.ways if not w.name.startswith(AS_BUILT)] or self.ways))

    @property
    def carriers(self) -> dict[str, float]:
        """What may carry the heat of surfaces, and with which finish -> its probability by the readings, whatever the deck lacks. [-]"""
        names = [w.name.removesuffix(WITH_PATHS).removesuffix(WITH_ENTRIES) for w in self.departing.ways]
        return {n: sum(w.weight * (other == n) for w, other in zip(self.departing.ways, names, strict=True)) for n in names}

    @property
    def sizes(self) -> dict[str, float]:
        """Size of a departure -> its root mean square by prior and readings."""
        return {g: float(np.sqrt(sum(w.weight * w.sizes[g] ** 2 for w in self.departing.ways))) for g in GROUPS} if self.ways else {}

    @property
    def contradiction(self) -> str:
        """What of the readings no departure of a possible size explains, in words; empty where all is explained."""
        sizes = {**self.sizes, "left": float(np.sqrt(sum(w.weight * w.left_over**2 for w in self.departing.ways)))}
        times, name = max((size / SIZES[n].value, n) for n, size in sizes.items())
        if times > FAR_SIZE:
            asked = f"{sizes[name]:.2g} {SIZES[name].unit} beside {SIZES[name].value:g}".replace(" 1 ", " ")
            return f"the readings ask for {times:.2g} times a usual departure: {SIZES[name].effect} ({asked})"
        if self.spot:
            return (
                f"the thermometer of '{self.spot}' reads as if it sat at one end of its part, where the heat enters or opposite: the "
                "part needs two nodes, or a contact between parts is missing (`thermid criticise` compares them)"
            )
        far = f"with all departures the readings still lie {self.misfit:.2g} times further from the network than is allowed"
        return far if self.misfit > OUTSIDE else ""

    @property
    def exponents(self) -> dict[str, float]:
        """Surface -> exponent of the temperature difference in its coefficient, where free air is the likeliest carrier. [-]"""
        laws = max(self.departing.ways, key=lambda w: w.weight).laws
        return {p: law.exponent for p, law in laws.items() if isinstance(law, SurfaceLaw) and law.exponent > 0.0}

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Values of the fit that its runs share, in the order of `covariance`."""
        return tuple(self.seen)

    @property
    def _means(self) -> Array:
        """Expected values (ways, values) of each way, within their bounds."""
        low, high = np.array([(v.low, v.high) for v in self.seen.values()]).reshape(-1, 2).T
        return np.array([np.clip(np.add([*w.values.values()], w.mean[: low.size]), low, high) for w in self.ways])

    @property
    def at_means(self) -> ErrorModel:
        """The model with its derivatives where values are expected: on a network that explains the readings, curves beat lines there."""
        moved = (
            replace(w, values=dict(zip(w.values, m.tolist(), strict=True)), mean=np.r_[np.zeros(len(m)), w.mean[len(m) :]])
            for w, m in zip(self.ways, self._means, strict=True)
        )
        return replace(self, ways=tuple(moved))

    @property
    def mean(self) -> Array:
        """Expected values (values,) of the fit, in their fitted form."""
        return np.asarray(np.array([w.weight for w in self.ways]) @ self._means)

    @cached_property
    def covariance(self) -> Array:
        """Covariance (values, values) of the fit's values, fitted form: sum w (L L' + d d') over ways, d a way's mean less that of all."""
        size, weights, apart = len(self.seen), np.array([w.weight for w in self.ways]), self._means - self.mean
        within = sum(w.weight * w.root[:size, :size] @ w.root[:size, :size].T for w in self.ways)
        return np.asarray(within + (weights[:, None] * apart).T @ apart)

    @property
    def open_values(self) -> list[str]:
        """Values whose posterior is nearly as wide as what was known before, and wider than elements depart by; the widest first."""
        posterior_sd = np.sqrt(np.diag(self.covariance)).tolist() if self.ways else []
        # a value that is stated better than a joint of known value departs from it is determined, by whoever stated it
        least = {n: SIZES["joint"].value if v.log else 0.0 for n, v in self.seen.items()}
        wide = ((n, v, sd) for (n, v), sd in zip(self.seen.items(), posterior_sd, strict=False) if v.kind == "parameter" and sd > least[n])
        parts = {n: sd / v.sd for n, v, sd in wide}
        return sorted((n for n, part in parts.items() if part > KEPT_OF_PRIOR), key=lambda n: -parts[n])

    def _as_rows(self) -> list[Row]:
        """Return the sizes of departures."""
        return [{"departure": g, "size": size, "unit": SIZES[g].unit} for g, size in self.sizes.items()]

    def _summary(self) -> str:
        """Return how much of what is usual the readings ask for."""
        carriers = ", ".join(f"{name} {100 * p:.0f} %" for name, p in self.carriers.items())
        return f"{self.stage}: {self.why or carriers}; readings at {self.misfit:.2g} times what is allowed of them"

    def without(self, places: Sequence[str]) -> ErrorModel:
        """Return what it says of all but some parts and values; of a value that acts elsewhere too it says the same there."""
        paths_left = {n: outside([p for p, *_ in v.acts], places) if v.kind == "parameter" else (n,) for n, v in self.seen.items()}
        names = {n: acts[0] for n, acts in paths_left.items() if acts}
        acting = {n: tuple((p, 1.0, 0.0) for p in paths_left[n]) if self.seen[n].kind == "parameter" else self.seen[n].acts for n in names}
        ways = tuple(w.only(outside(w.elements, places), names) for w in self.ways)
        return replace(self, seen={name: replace(self.seen[n], acts=acting[n]) for n, name in names.items()}, ways=ways)

    def after(self, before: ErrorModel, places: Sequence[str]) -> ErrorModel:
        """Return what a fit of some parts and values says of these and of its instruments, beside what was known of all others before."""
        rest = before.without(places)
        rest_names = {n: n for n in rest.seen if n not in self.seen}
        kept = [w.only(w.elements, rest_names) for w in rest.ways]
        fresh = [w.only({*w.elements} - {*outside(w.elements, places)}, {n: n for n in self.seen}) for w in self.ways]
        pairs = [(a, b) for a in kept for b in fresh]
        ways = [a.beside(b) for a, b in [(a, b) for a, b in pairs if a.name == b.name] or pairs]
        return replace(self, seen={**{n: rest.seen[n] for n in rest_names}, **self.seen}, ways=normalised(ways))

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts for a file."""
        fitted_values = {n: [v.kind, v.log, [list(a) for a in v.acts], v.mean, v.sd, v.low, v.high] for n, v in self.seen.items()}
        ways = [w.to_dict() for w in self.ways]
        head = {"at": "", "stage": self.stage, "seen": fitted_values, "ways": ways}
        return head | {"misfit": self.misfit, "why": self.why, "spot": self.spot}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ErrorModel:
        """Return what `to_dict` gave.

        Raises
        ------
        IdentificationError   When a file of another version of thermid lacks some of it, or has something else in its place.
        """
        try:
            stage, at = data["stage"], data["at"]
            fitted_values = {
                placed(n, at): SeenValue(kind, log, tuple((placed(a, at), float(f), float(o)) for a, f, o in acts), *map(float, rest))
                for n, (kind, log, acts, *rest) in data["seen"].items()
            }
            ways, spot = tuple(KeptWay.from_dict(w, at) for w in data["ways"]), placed(data.get("spot", ""), at)
            return cls(stage, fitted_values, ways, float(data["misfit"]), data["why"], spot=spot)
        except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
            lacks = f"has no {error}" if isinstance(error, KeyError) else f"cannot be read ({error})"
            raise IdentificationError(
                f"the values file is of another version of thermid: its model of error {lacks}. Run the fit again.",
                str(data.get("stage", "")),
                code=FOLLOWED,
            ) from error


def normalised(ways: Sequence[KeptWay]) -> tuple[KeptWay, ...]:
    """Return ways whose probabilities sum one."""
    whole = sum(w.weight for w in ways)
    return tuple(replace(w, weight=w.weight / whole) for w in ways)


def deviations_of_run(c: UnknownColumn, sizes: Mapping[str, float], beyond: Mapping[str, tuple[str, float]]) -> tuple[float, float]:
    """Return two standard deviations of what a run has for itself: from run to run, and of an element what lies beyond its features.

    Parameters
    ----------
    c : UnknownColumn
    sizes : dict    Group -> size.
    beyond : dict   Conductor -> its class, and what of its variance lies further off than its features reach. [-]
    """
    kind, rest = beyond.get(c.source, ("", 0.0)) if c.group == "run" else ("", 0.0)
    return c.size * (sizes[c.group] if c.group else 1.0), float(np.sqrt(rest)) * sizes[kind] if kind else 0.0


Keeping = Callable[[Callable[[], dict[str, Any]]], dict[str, Any]]
"""Takes what makes a table and returns the table: as it was kept, or made now and kept."""


@dataclass(frozen=True, eq=False)
class ErrorsOfFit:
    """The model of error of a fit as plain numbers, worked out when somebody asks for it: from what is kept of it, where it is.

    Parameters
    ----------
    fit : Calibration
    keeping : callable or None  Keeps `numbers` for the next time.
    """

    fit: Calibration
    keeping: Keeping | None = None

    @cached_property
    def numbers(self) -> Mapping[str, Any]:
        """The table for files (``table``); by what it would move fitted values, their covariance and its gain, with all digits."""
        return self.keeping(self._make) if self.keeping is not None else self._make()

    def _make(self) -> dict[str, Any]:
        """Return them as worked out now: of values and what is left over alone where elements cannot be followed."""
        try:
            errors = ErrorModel.of_fit(self.fit)
        except (ThermidError, np.linalg.LinAlgError) as error:
            errors = errors_of_values(self.fit, getattr(error, "message", "its runs leave the sizes of departures open"))
        moved = {n: float(x - self.fit.fitted[n]) for n, x in zip(errors.unknowns, errors.departing.mean.tolist(), strict=True)}
        return {
            "table": errors.to_dict(),
            "moved": moved,
            "covariance": errors.departing.covariance.tolist(),
            "gain": float(errors.gain),
        }

    def table(self) -> Mapping[str, Any]:
        """Return the table for files."""
        out: Mapping[str, Any] = self.numbers["table"]
        return out


def errors_without(errors: LaterTable, places: Sequence[str]) -> LaterTable:
    """Return the model of error that a fit keeps without what it says of some parts and values, of which others tell.

    It is made when it is asked for. Places are by the paths of the fit's own model.
    """
    return LaterTable(lambda: _whole(errors).without(places).to_dict(), errors.at, (*errors.without, *places))


def errors_after(errors: LaterTable, before: LaterTable, places: Sequence[str]) -> LaterTable:
    """Return the model of error that a fit of some parts and values keeps, with what one before it knew of all others; made when asked for.

    Both are of one model; places are by its paths.
    """
    return LaterTable(lambda: _whole(errors).after(_whole(before), places).to_dict(), errors.at, outside(before.without, places))


def _whole(errors: LaterTable) -> ErrorModel:
    """Return a model of error that a fit keeps, by the paths of the fit's own model."""
    return ErrorModel.from_dict({**errors.original(), "at": ""})


def errors_of_values(fit: Calibration, why: str = "") -> ErrorModel:
    """Return what is known where no element is followed: covariance of the fit's values, and what wanders in its residuals [K].

    What wanders has the RMS of the misfits and a third of the run as its time. `why` is the reason, in words.
    """
    assert fit.problem is not None
    named = {u.name: u for u in fit.problem.unknowns if u.kind != "local" and u.name in fit.values}
    fitted_values = {n: SeenValue.of_unknown(u) for n, u in named.items()}
    covariance = fit.store.covariance(named)
    sizes = [size for size in fit.values.provenance.get("misfit", {}).values() if size]
    rms = float(np.sqrt(np.mean(np.square(sizes)))) if sizes else 0.0
    way = KeptWay(
        "",
        1.0,
        {},
        {n: fit.fitted[n] for n in named},
        Departures({}, ()),
        (),
        np.zeros(len(named)),
        _triangular(covariance),
        dict.fromkeys(GROUPS, 0.0),
        ((1.0, rms, 1.0 / 3.0),),
    )
    return ErrorModel(fit.stage, fitted_values, (way,), 1.0, why)


def placed(name: str, at: str) -> str:
    """Return a name of a part as it is in a model where its paths begin with some text; names of instruments hold a space and stay.

    No name stays none.
    """
    head = next((h for h in ("scale.", "initial.") if name.startswith(h)), "")
    return name if " " in name or not name else f"{head}{at}{name.removeprefix(head)}"


def _triangular(covariance: Array) -> Array:
    """Return a lower triangular root L, L L' = C, of a covariance C (n, n); 1e-10 of each variance is added for rounding."""
    sizes = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    alike = covariance / np.outer(sizes, sizes)
    return np.asarray(sizes[:, None] * np.linalg.cholesky(0.5 * (alike + alike.T) + 1e-10 * np.eye(sizes.size)))


def _short(values: Array) -> Any:
    """Return numbers with as many digits as a file needs."""
    return [_short(row) for row in values] if values.ndim > 1 else [float(f"{x:.{SIGNIFICANT_DIGITS}g}") for x in values]


def _problem_of(fit: Calibration) -> Problem:
    """Return what a fit compared.

    Raises
    ------
    IdentificationError   When it is not there, or its elements cannot be followed.
    """
    problem = fit.problem
    if problem is None or not any(u.kind == "parameter" for u in problem.unknowns):
        raise IdentificationError("this calibration does not hold what its fit was asked. Run the fit again.", fit.stage, code=FOLLOWED)
    if any(identity_of(e.model) != identity_of(fit.given_model) for e in problem.experiments):
        raise IdentificationError("several levels were fitted together, and elements are followed in one.", fit.stage, code=FOLLOWED)
    if fit.given_model.runner is not None:
        raise IdentificationError("the elements of an FMU are not known, so nothing is known of how they depart.", fit.stage, code=FOLLOWED)
    return problem


def with_structural_errors(fit: Calibration, errors: ErrorsOfFit) -> Calibration:
    """Return a fit whose errors count how elements depart from their laws, by its model of error.

    A value stays where its fit found it. Where the covariance by the model of error, and what that would move values by, say more than the
    fit, the difference becomes sources of its errors: they go into files and to the stages above with its values, and no error becomes
    smaller. Where the readings do not tell departures from noise, the errors are those of the mixture of both, with even odds before the
    readings. A fit whose readings contradict its model of error is not adequate. Where elements are not followed a warning says why.
    """
    request = fit.request
    assert request is not None
    table, contradiction = errors.numbers["table"], ErrorModel.from_dict(errors.numbers["table"]).contradiction
    # with a stated `adequate` it is the user's to say what residuals may be
    if contradiction and fit.own.fair and not request.adequate:
        fit = replace(fit, own=Standing("not adequate", contradiction, fit.stage, request.accepted)).judged(fit.rests, fit.verdict)
    if why := table["why"]:
        words = f"the errors do not count what the structure may lack ({why.rstrip('.')}). Look for it with `thermid criticise`."
        return replace(fit, warnings=(*fit.warnings, words))
    moved, covariance = errors.numbers["moved"], np.array(errors.numbers["covariance"])
    if not request.structural_errors and (gain := errors.numbers["gain"]) < MIN_LOG_BAYES_FACTOR:
        probability = float(weights_of([gain, 0.0])[0])
        fit = _with_sources_of_structure(fit, covariance, moved, "", probability)
        doubt = (
            f"residuals are autocorrelated, and elements depart from their laws with a probability of {probability:.2g}, which the total "
            "errors count. A record of another operating point would decide.",
        )
        return replace(fit, warnings=fit.warnings + doubt * (probability > COUNTED))
    fit = _widened(fit, moved, covariance, contradiction)
    exponents = ErrorModel.from_dict(table).exponents if fit.expected and contradicted(fit.values) else {}
    if not exponents:
        return fit
    powers = " to ".join(dict.fromkeys(f"dT^{end:.2f}" for end in (min(exponents.values()), max(exponents.values()))))
    words = (
        f"{FIRST}the readings are explained once the coefficient of free air grows as {powers}; with a constant one, fitted values go far "
        f"from what was stated. Write htc = {{ coefficient = ..., exponent = 0.25 }} for {quoted([*exponents], 3)}, and fit again."
    )
    return replace(fit, warnings=(*fit.warnings, words))


def _widened(fit: Calibration, moved: Mapping[str, float], covariance: Array, unexplained: str) -> Calibration:
    """Return a fit with expected values moved by `moved` [fitted form] and wider errors: `covariance` (values, values) and other sources.

    `unexplained` is the sentence for residuals that no departure explains; nothing is moved then.
    """
    others = _others(fit)
    beside = np.array([np.sum(fit.store.rows([n])[0][others] ** 2) if fit.store[n].known else 0.0 for n in moved])
    fit = _with_sources_of_structure(fit, covariance, moved, unexplained)
    assert fit.problem is not None
    unknowns = {u.name: u for u in fit.problem.unknowns}
    errors = dict(zip(moved, np.sqrt(np.diag(covariance) + beside).tolist(), strict=True))
    at = {n: (u, fit.fitted[n] + moved[n], errors[n]) for n, u in unknowns.items() if n in fit.values and n in moved and not unexplained}
    expected = {n: (u.to_value(x), u.slope(x) * error) for n, (u, x, error) in at.items()}
    is_requested = fit.request is not None and fit.request.structural_errors
    why = "the structure is a proposal" if is_requested else "the residuals are larger than this structure explains"
    quote = (
        "Quote the values and errors that are printed first: they allow its elements to depart from their laws. They are the priors of "
        "stages above. The fitted values, which -v prints beside them, draw the curves, with wider errors."
    )
    if unexplained:
        quote = f"No departure of its elements explains them: {unexplained}. Find the cause first. Errors count what departures would move."
    fit = replace(fit, expected=expected, unexplained=unexplained)
    at_fit, at_estimates = (far_from_sheet(fit.given_model, v) for v in (fit.values, fit.estimates))
    doubted = {w.split(" is ")[0] for w in at_fit} - {w.split(" is ")[0] for w in at_estimates}
    return replace(fit, warnings=(*(w for w in fit.warnings if w.split(" is ")[0] not in doubted), f"{FIRST}{why}. {quote}"))


def _others(fit: Calibration) -> list[bool]:
    """Return which sources of a store are no unknowns of its fit: stated ranges and values of stages below.

    The model of error knows a fit's unknowns alone. A value that has its prior from a stage below counts that prior's sources twice, as the
    store does not tell them from those of fixed values: its error is then up to 1.4 times too large, and never too small.
    """
    assert fit.problem is not None
    assert fit.request is not None
    own, key = {f"accuracy: {u.name}" for u in fit.problem.unknowns}, f"{fit.request.fit_key[:16]}:"
    return [s.name not in own and not s.name.startswith(key) for s in fit.store.sources]


def _with_sources_of_structure(
    fit: Calibration, covariance: Array, moved: Mapping[str, float], unexplained: str, probability: float = 1.0
) -> Calibration:
    """Return a fit whose sources say what the stages above may take as prior, and what its own values err by beyond that.

    Where readings are `unexplained` the fitted values stand, and all that they err by is in the prior of a stage above. So it is where
    elements depart with a `probability` below one: the covariance is then that of the mixture about the fitted values.

    Legend: B own covariance of the fit, C that of the model of error, ``B = L L'``, ``L^-1 C L^-T = W D W'``. Responses become
    ``L W min(D, 1)^1/2 W' L^-1`` times themselves, and sources for the rest make C; what B holds beyond C, within bounds, and the moves
    are sources of the fitted values alone. No error becomes smaller.
    """
    assert fit.problem is not None
    unknowns = {u.name: u for u in fit.problem.unknowns}
    at = [k for k, n in enumerate(moved) if fit.store[n].known]
    paths = [n for n in moved if fit.store[n].known]
    places, own = np.array([[*fit.store.states].index(n) for n in paths], dtype=int), np.flatnonzero(~np.array(_others(fit), dtype=bool))
    responses, moves = fit.store.root[np.ix_(places, own)], np.array([moved[n] for n in paths])
    own_covariance, covariance = responses @ responses.T, covariance[np.ix_(at, at)]
    if probability < 1.0:
        covariance = (1.0 - probability) * own_covariance + probability * (covariance + np.outer(moves, moves))
        moves = np.zeros(len(moves))
    lower = _triangular(own_covariance)
    inverse = np.linalg.inv(lower)
    ratios, ways = np.linalg.eigh(inverse @ covariance @ inverse.T)
    ratios = np.maximum(ratios, 0.0)  # rounding leaves a variance of nothing below it
    directions = lower @ ways
    more, less = (directions * np.sqrt(np.maximum(x, 0.0)) for x in (ratios - 1.0, 1.0 - ratios))
    expected, beyond = np.diag(covariance) + moves**2, np.sum(less**2, axis=1)
    within = [square_between(unknowns[n], fit.fitted[n], x) for n, x in zip(paths, (expected + beyond).tolist(), strict=True)]
    least = np.maximum(np.maximum(within, np.sum(responses**2, axis=1)) - expected, 0.0)
    root = np.zeros((len(fit.store.states), len(fit.store.sources) + 2 * len(at) + 1))
    root[:, : len(fit.store.sources)] = fit.store.root
    root[np.ix_(places, own)] = directions @ (np.sqrt(np.minimum(ratios, 1.0))[:, None] * ways.T) @ inverse @ responses
    root[places, len(fit.store.sources) :] = np.column_stack([more, less * np.sqrt(least / np.maximum(beyond, 1e-300))[:, None], moves])
    key, words = fit.structure_key, f"structure of stage '{fit.stage}'"
    beside, ahead = (": beyond", ": moves") if unexplained or probability < 1.0 else (AS_FITTED, EXPECTED)
    names = (*(f"{key} {k}" for k in at), *(f"{key}{beside} {k}" for k in at), f"{key}{ahead}")
    added = (Source(n, "structural", Normal(), words) for n in names)
    store = replace(fit.store, sources=(*fit.store.sources, *added), root=root).trimmed()
    items = {n: replace(v, error=store.error(n)) for n, v in fit.values.items()}
    covariance = np.where(np.isfinite(fit.values.covariance), store.covariance(items), np.inf)
    # what moves a value moves a start, a room or a clock that the same readings give
    slopes = np.array([[v.slopes.get(n, 0.0) for n in fit.store.states] for v in fit.local]).reshape(len(fit.local), len(root))
    more_of_local = np.sum((slopes @ root) ** 2, axis=1) - np.sum((slopes @ fit.store.root) ** 2, axis=1)
    local = tuple(replace(v, error=math.sqrt(v.error**2 + max(x, 0.0))) for v, x in zip(fit.local, more_of_local.tolist(), strict=True))
    return replace(fit, store=store, values=replace(fit.values, items_=items, covariance=covariance), local=local)
