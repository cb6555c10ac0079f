"""A model for a bare log: every measured part a mass, joined to all others and the surroundings, then what the readings ask for.

Values that no hardware of the stated size can have are named.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from thermid.base.errors import DeckError, IdentificationError, ThermidError, refuse_unknown
from thermid.base.units import amount, duration_text, value_of
from thermid.campaign._start.roles import ACCURACY, JOIN, SURROUNDINGS, Power, Roles, noise_of, part_name, with_noise
from thermid.fit.calibration import MOST_EVALUATIONS, Calibration, LocalSpec, Request, first_reading, fit
from thermid.inference.criticism import (
    EVALUATIONS,
    SPECIFIC_HEAT,
    EvaluationBudget,
    Fitted,
    FittedStructure,
    MissingElement,
    RangeCheck,
    StructureSearch,
    fitted_structure,
    search_structure,
)
from thermid.measure.records import Record
from thermid.model.tree import Model, Parameter, ParameterSet, literal, model_from_dict
from thermid.physics.materials import Material
from thermid.simulation.runs import Scenario

LEAST_HEAT = 0.5e6
"""Heat capacity by volume of equipment, at least: plastics and metals have 1.5e6 to 4e6, and most of a box is air. [J/(m^3 K)]"""
FLATTEST = 60.0
"""Area over volume^(2/3), at most: 4.8 for a ball, 43 for a sheet a hundred times as wide as thick, more with fins. [-]"""
MOST_FILM = 31.0
"""Coefficient at most: 25 W/(m^2 K) of slow fans and 6 of radiation. [W/(m^2 K)]"""
LEAST_PART = 0.5
"""A part that carries a sensor has at least this: half a gram of aluminium. [J/K]"""
MOST_BEHIND = 10.0
"""Largest mass without a sensor over a part with one, beyond which it may be the part itself. Of 14 simulated boxes three had 22, 36 and
85: there the part was what follows its sensor at once. The others had 1.6 at most; a diode of 38 J/K on a housing has more. [-]"""
MOST_PART = 2e6
"""Two tonnes of metal. [J/K]"""
SLOWEST_SENSOR = 60.0
"""A sensor that is fixed to a part follows it within this: thermocouples in a second, DS18B20 in its case in 10 to 40 s. [s]"""
AT_BOUND = 1.001
"""A value is at a bound that it is nearer to than by this factor. [-]"""
MATERIAL_SD, ANY_SD = 0.1, 0.35
"""Standard deviation of the logarithm of a heat capacity by weight, of a known material and of any one between copper and plastics. [-]"""


@dataclass(frozen=True)
class KnownMass:
    """What a scale says of a part.

    Parameters
    ----------
    mass : float            [kg]
    low, high : float       Specific heats that it can have. [J/(kg K)]
    sd : float              Standard deviation of the logarithm of its heat capacity. [-]
    """

    mass: float
    low: float
    high: float
    sd: float

    @property
    def capacitance(self) -> float:
        """In the middle of what is possible. [J/K]"""
        return float(self.mass * (self.low * self.high) ** 0.5)

    @property
    def bounds(self) -> tuple[float, float]:
        """Of the part with what is fixed to it, to three digits as a deck has them. [J/K]"""
        return float(f"{0.7 * self.low * self.mass:.3g}"), float(f"{1.5 * self.high * self.mass:.3g}")


def known_masses(masses: Mapping[str, str], materials: Mapping[str, str]) -> dict[str, KnownMass]:
    """Return part -> what its weight and its material say.

    Parameters
    ----------
    masses : dict       Part -> mass with its unit.
    materials : dict    Part -> material, or the beginning of the names of several.

    Raises
    ------
    ThermidError        When a material is of a part without a mass, or not in the table.
    """
    lone = [part for part in materials if part not in masses]
    if lone:
        raise ThermidError(f"a material needs the mass of its part: --mass {lone[0]}='1.2 [kg]'.", "--material", code="value.incomplete")
    out = {}
    for part, text in masses.items():
        weight = amount(text, "kg", f"--mass {part}")
        named = materials.get(part, "")
        heats = [m.specific_heat for name, m in Material.table().items() if named and name.lower().startswith(named.lower())]
        if named and not heats:
            families = ", ".join(dict.fromkeys(name.partition(",")[0] for name in Material.table()))
            raise ThermidError(f"no material '{named}'. Known: {families}. Or leave it out.", f"--material {part}", code="name.unknown")
        low, high = (min(heats), max(heats)) if heats else SPECIFIC_HEAT
        out[part] = KnownMass(weight, low, high, MATERIAL_SD if heats else ANY_SD)
    return out


def not_physical(one: FittedStructure, roles: Roles, masses: Mapping[str, KnownMass]) -> tuple[RangeCheck, ...]:
    """Return what a structure has that no part of that mass and size has; every range is of the table of this module."""
    return tuple(c for c in _checks(one, roles, masses) if c.verdict != "possible")


def weights(model: Model, values: Mapping[str, float], roles: Roles, masses: Mapping[str, KnownMass]) -> tuple[RangeCheck, ...]:
    """Return, of every weighed part, its heat capacity with all masses without a sensor that are fixed to it, and what its weight allows.

    Parameters
    ----------
    model : Model       The structure.
    values : dict       Path -> capacitance [J/K] or conductance [W/K] that was fitted; those of one element alone count.
    """
    held = {path.rpartition(".")[0]: value for path, value in values.items() if path.endswith(".capacitance")}
    inside = {part: 0.0 for part in masses if part in held}
    for node, capacity in held.items():
        seat, visited = node, {node}
        while seat not in roles.parts.values():
            ties = {
                n: values.get(f"{c}.conductance", 0.0) for c, law in model.conductors.items() if seat in law.between for n in law.between
            }
            near = {n: tie for n, tie in ties.items() if n not in visited and n in held}
            if not near:
                break
            seat = max(near, key=near.__getitem__)
            visited.add(seat)
        if seat in inside:
            inside[seat] += capacity
    meaning = "A power is missing or wrong, or an instrument has an offset"
    return tuple(
        RangeCheck(
            f"{part}.capacitance",
            total,
            0.0,
            *masses[part].bounds,
            f"{masses[part].mass:.3g} kg with what is fixed to it [J/K]",
            "table of init",
            meaning,
        )
        for part, total in inside.items()
    )


def too_far(column: str, offset: tuple[float, float], accuracy: float) -> RangeCheck:
    """Return whether two thermometers of an accuracy [K] can differ by an offset with its error. [K]"""
    most = 3.0 * 2.0**0.5 * accuracy
    meaning = "A power that the log does not have heats this part, or the thermometers are worse: --accuracy"
    what = f"the difference of two thermometers of {accuracy:g} K [K]"
    return RangeCheck(f"offset of {column}", *offset, -most, most, what, "3 standard deviations", meaning)


def _checks(one: FittedStructure, roles: Roles, masses: Mapping[str, KnownMass]) -> Iterator[RangeCheck]:
    """Yield every value of a structure with the range that it should be in."""
    values, errors = one.values, one.errors()
    network = one.problem.experiments[0].network
    held = {n: float(value_of(c)) for n, c in network.numbers(values).capacitances.items() if c is not None}

    def check(path: str, low: float, high: float, what: str, meaning: str) -> RangeCheck:
        """Return whether a fitted value lies in a range."""
        return RangeCheck(path, values[path], errors[path] * values[path], low, high, what, "table of init", meaning)

    for heavy in weights(one.request.model, values, roles, masses):
        # a fit that wants more than the weight allows ends at its bound
        yield replace(heavy, error=errors[heavy.path] * values[heavy.path], low=AT_BOUND * heavy.low, high=heavy.high / AT_BOUND)
    for node in (n for n in roles.parts.values() if f"{n}.capacitance" in values and n not in masses):
        meaning = "A power is missing or wrong, or an instrument has an offset"
        yield check(f"{node}.capacitance", LEAST_PART, MOST_PART, "a part that carries a sensor [J/K]", meaning)
    for name, c in one.request.model.conductors.items():
        path = f"{name}.conductance"
        if path not in values:
            continue
        tips = [n for n in c.between if n.endswith("_sensor") and n not in roles.parts.values()]
        if tips:
            lag = held[tips[0]] / values[path]
            meaning = "More is heat that arrives through another mass: state what is between power and sensor"
            yield RangeCheck(
                f"lag of {tips[0]}", lag, errors[path] * lag, 0.0, SLOWEST_SENSOR, "a sensor fixed to a part [s]", "table of init", meaning
            )
        elif roles.boundary in c.between:
            node = next(n for n in c.between if n != roles.boundary)
            size = masses[node].capacitance if node in masses else held.get(node, 0.0)
            most = MOST_FILM * FLATTEST * (size / LEAST_HEAT) ** (2.0 / 3.0)
            what = f"the loss of a part of {size:.3g} J/K [W/K]"
            yield check(
                path, 0.0, most, what, "Its heat capacity is too small, or heat leaves by a mount or a fan that is not in the model"
            )


MOST_MASSES = 4
"""Masses that a proposal may have, those of measured parts included; more measured parts than that stay."""
ASSUMED = 100.0
"""Heat capacity of the first part where no power is known in watts, so that only ratios to it can be found. [J/K]"""
COMPLETE = 5
"""Most measured parts that are all joined to one another at the beginning."""
LOOSE_AMBIENT = 5.0
"""Standard deviation of an ambient that no column logs, about the lowest first reading. [K]"""
PACES = (0.03, 0.15, 0.6)
"""Time constants that a fit is begun with, in parts of the log. [-]"""
UNSAID = ("direction", "commands that act", "that settles")
"""Changes that a first project does not have: a coupling with a direction, a delay and a power that settles are left to `improve`."""
MAX_UNEXPLAINED_SHARE, MAX_UNEXPLAINED_NOISES = 0.2, 3.0
"""Residuals above this share of the spread of the readings, and above so many noises, mean that no structure explains a log. [-]"""
MOST_PLACEMENTS = 9
"""Ways to place powers in parts that are tried."""
CONTACTS = (0.3, 10.0)
"""Conductances between parts that a fit is begun with, over those to the surroundings. [-]"""
MOST_STEPS = 20_000
"""Steps of one run after which values are given up: a thinned log takes some 1,000; a part of next to nothing took 1,000,000."""
FIRST_HEAT = 8
"""Evaluations of each descent of all beginnings; the better half goes on with twice as many, until one is left."""


FIXED, FIXED_SD = 0.2, "70 [%]"
"""What is fixed to a weighed part, over its heat capacity: boards in boxes are 5 to 50 %. [-]"""
THREEFOLD = 3.0
"""A value that differs by this factor among structures that the readings cannot separate is not determined. [-]"""
FREE = ("capacitance", "mass", "conductance", "resistance", "htc", "effective_htc", "contact_conductance")
"""Fields of a deck that a first fit looks for, unless their source is a measurement or a data sheet."""
STATED = ("measured", "published", "datasheet")
MIN_REST_READINGS = 10
"""Readings without power from which a log may begin at rest."""
MAX_REST_DRIFT = 1 / 3
"""Change of differences to drifting surroundings, over the accuracy of thermometers, up to which a rest shows offsets. [-]"""


@dataclass(frozen=True, eq=False)
class StatedFacts:
    """What is known beside the log.

    Parameters
    ----------
    accuracy : float        Standard deviation of the constant error of a thermometer. [K]
    masses : dict           Part -> its weight and material.
    paths : tuple           Pairs of measured parts that heat passes between, and no others; all pairs by default.
    deck : Model            The structure to begin with.
    bounded : bool          Whether heat capacities of weighed parts stay within what their weight allows.
    rests : dict            Record -> how it begins without power.
    """

    accuracy: float = ACCURACY
    masses: Mapping[str, KnownMass] = field(default_factory=dict)
    paths: tuple[tuple[str, str], ...] = ()
    deck: Model | None = None
    bounded: bool = False
    rests: Mapping[str, Rest] = field(default_factory=dict)

    @property
    def rest(self) -> Rest:
        """That of the log which shows most of its offsets so."""
        return max(self.rests.values(), key=lambda r: (r.shows, r.seconds), default=Rest())

    @property
    def starts(self) -> dict[str, Mapping[str, LocalSpec]]:
        """Record -> where parts begin that stand at the temperature of the surroundings."""
        return {name: rest.starts for name, rest in self.rests.items() if rest.starts}

    @property
    def priors(self) -> dict[str, tuple[str, str]]:
        """Heat capacities by weight, as priors."""
        return {f"{n}.capacitance": (f"{m.capacitance:.4g} [J/K]", f"{100.0 * m.sd:.3g} [%]") for n, m in self.masses.items()}


@dataclass(frozen=True, eq=False)
class Proposal:
    """A structure for a log.

    Parameters
    ----------
    roles : Roles               What the columns are, each power with the part that it heats.
    search : StructureSearch    Every structure that was tried.
    noise : dict                Column -> noise of one reading, as found. [K]
    assumed : str               What was assumed because the log cannot tell it; empty for nothing.
    known : StatedFacts               What was known beside the log.
    """

    roles: Roles
    search: StructureSearch
    noise: Mapping[str, float]
    assumed: str
    known: StatedFacts = StatedFacts()

    @property
    def chosen(self) -> FittedStructure:
        """The proposed structure."""
        return self.search.proposed

    @property
    def unexplained(self) -> str:
        """That no structure explains the log, and what to log; empty where one does.

        One does where 1.4826 times the median absolute residual, the standard deviation of a normal law, of the worst sensor is at most
        `MAX_UNEXPLAINED_SHARE` of the spread of all readings, or `MAX_UNEXPLAINED_NOISES` times the largest noise. [K]
        """
        one = self.chosen
        readings = [o.measured for e in one.problem.experiments for o in e.observations]
        spread = float(np.sqrt(np.mean([np.var(values) for values in readings])))
        # the usual residual, which single readings that leap do not move
        remaining = 1.4826 * max(float(np.median(np.abs(b.residuals))) for b in one.problem.blocks(one.end.fitted))
        if remaining <= max(MAX_UNEXPLAINED_SHARE * spread, MAX_UNEXPLAINED_NOISES * max(self.noise.values())):
            return ""
        problem_text = (
            f"No structure explains this log: its residuals are {100.0 * remaining / spread:.0f} % of the spread of the readings. "
        )
        if not self.roles.powers:
            return f"{problem_text}It has no power; log every power that heats a part. {JOIN}"
        return f"{problem_text}Log every power that heats a part and the temperature of the surroundings, and check what each column is."

    @property
    def not_physical(self) -> tuple[RangeCheck, ...]:
        """Values of the proposed structure that no part of that mass and size has, and no thermometer of its accuracy."""
        apart = (too_far(c, o, self.known.accuracy) for c, o in self.offsets.items())
        return (*not_physical(self.chosen, self.roles, self.known.masses), *(c for c in apart if c.verdict != "possible"))

    @property
    def depending(self) -> dict[str, tuple[float, float]]:
        """Path -> its lowest and highest value [SI] in structures that the readings cannot separate from the proposed one, where far apart.

        A part that only its own thermometer shows can be a tenth of itself beside a hidden mass that takes its place, so it may have the
        largest hidden one too where that is more than ten times itself and nobody weighed the part.
        """
        one = self.chosen
        parts = [f"{n}.capacitance" for n in self.roles.parts.values()]
        hidden = max((v for p, v in one.values.items() if p.endswith(".capacitance") and p not in parts), default=0.0)
        paths = [p for p in one.values if p in parts or p in self._between]
        loose = [p for p in parts if p.rpartition(".")[0] not in self.known.masses]
        behind = {p: [one.values[p] + hidden] for p in paths if p in loose and hidden > MOST_BEHIND * one.values[p]}
        values = {p: [s.values[p] for s in (one, *self.search.alike) if p in s.values] + behind.get(p, []) for p in paths}
        return {p: (min(v), max(v)) for p, v in values.items() if max(v) > THREEFOLD * min(v)}

    @property
    def _between(self) -> list[str]:
        """Conductances between measured parts."""
        parts = set(self.roles.parts.values())
        return [f"{n}.conductance" for n, c in self.chosen.request.model.conductors.items() if set(c.between) <= parts]

    @property
    def decided(self) -> bool:
        """Whether the log decides on one structure, and that is one that hardware can have."""
        return len(self.search.orders) == 1 and not (self.unexplained or self.not_physical or self.depending)

    @cached_property
    def first_fit(self) -> FirstFit:
        """The fit that the campaign of the proposed structure asks for."""
        return first_fit_of(self.chosen, self.roles.boundary)

    @property
    def offsets(self) -> dict[str, tuple[float, float]]:
        """Column -> its constant error, less that of the surroundings where these are logged, with its standard error. [K]

        They are of the first fit, whose errors allow for what the structure may lack. Where no fit can be made, thermometers of that
        accuracy differ as they did before.
        """
        fit, one, out = self.first_fit.calibration, self.chosen, dict[str, tuple[float, float]]()
        at = dict(zip((u.name for u in one.problem.unknowns), one.end.fitted.tolist(), strict=True)) if fit is None else fit.fitted
        for column in (c for c in self.roles.parts if f"sensor {c}" in at):
            pair = [n for n in (f"sensor {column}", f"{self.roles.surroundings} error") if n in at]
            signs = np.array([1.0, -1.0])[: len(pair)]
            variance = 2.0 * self.known.accuracy**2 if fit is None else float(signs @ fit.store.covariance(pair) @ signs)
            out[column] = float(signs @ [at[n] for n in pair]), variance**0.5
        return out

    @property
    def offsets_text(self) -> str:
        """What is assumed of the thermometers and what the log says of their offsets."""
        offsets = ", ".join(f"{c} {v:+.2f} +- {e:.2f} K" for c, (v, e) in self.offsets.items())
        against = f" against {self.roles.surroundings}" if self.roles.logged else ""
        rest = self.known.rest
        begins = f"The log begins with {duration_text(rest.seconds)} without power"
        if rest.shows:
            near = max((spec.sd for spec in rest.starts.values()), default=0.0)
            begin = f"so its parts are taken to begin at the temperature of {self.roles.surroundings}, +- {near:.2g} K"
            shown = begin if near else "which shows them"
            unread = f". {', '.join(rest.silent)} has no readings there" if rest.silent else ""
            where = f"{begins}, {shown}{unread}."
        elif rest.seconds:
            moves = f"parts change by up to {rest.drift:.2g} K{against} there" if rest.drift < np.inf else "with too few readings"
            where = f"{begins}, but {moves}, so only the fit shows them: wait longer."
        elif not self.roles.powers:
            where = "No power is logged, which would say when the parts were at rest, so only the fit shows them."
        else:
            where = "The log does not begin at rest, so only the fit shows them: begin the next test with some minutes without power."
        return f"Offsets of thermometers, accuracy {self.known.accuracy:g} K assumed{against}: {offsets}. {where}"

    @property
    def instants_text(self) -> str:
        """When powers changed between the samples of the logs; empty where they count from these."""
        count = sum(len(e.instants) for e in self.chosen.problem.experiments)
        if not count:
            return ""
        changes = "1 change of a power lies" if count == 1 else f"{count} changes of powers lie"
        return f"By the temperatures, {changes} between samples. The campaign states prompt = false, so that its fits find the instants."

    @property
    def powers_text(self) -> str:
        """Which part all of a power heats that nobody placed, and how it is shared among several; empty where it is told."""
        loads = self.chosen.request.model.loads
        placed = [(p, loads[p.load].into) for p in self.roles.powers if not p.told and len(self.roles.parts) > 1]
        return " ".join(
            f"All of {p.column} heats '{node}', which explains the log best. If it heats several parts, name them, and their shares are "
            f"fitted: {' '.join(f'--power {p.column}={n}' for n in (node, *(n for n in self.roles.parts.values() if n != node)))}."
            for p, node in placed
        )

    def share(self, power: Power) -> float:
        """Return the part of a power's column that heats its part. [-]"""
        values = self.chosen.values
        return 1.0 - sum(values[n] for n in power.rest) if power.rest else values.get(power.share, 1.0)

    def _share_text(self, power: Power) -> str:
        """Return the share of a power with its standard error, both in per cent: of what other parts leave, 1 - sum s +- (1'C 1)^0.5."""
        fit, names, sizes = self.first_fit.calibration, [*(power.rest or (power.share,))], [self.share(power)]
        if fit is not None and set(names) <= set(fit.values):
            total = sum(fit.expected[n][0] if n in fit.expected else fit[n].value for n in names)
            sizes = [1.0 - total if power.rest else total, float(np.sqrt(np.sum(fit.store.covariance(names))))]
        return " +- ".join(f"{100 * size:.2g}" for size in sizes) + " %"

    @property
    def shares_text(self) -> str:
        """How columns are shared among parts, by the first fit with its errors, else as the search found it; empty for none."""
        shares = [f"{self._share_text(p)} of {p.column} heats '{p.node}'" for p in self.roles.powers if p.share]
        return f"Shares: {', '.join(shares)}; the campaign fits them." if shares else ""

    def __str__(self) -> str:
        """Return the answer first, then what was tried and what the log cannot tell."""
        hidden = self.chosen.masses - len(self.roles.parts)
        answer = f"{self.chosen.masses} masses: {len(self.roles.parts)} measured, {hidden} hidden; RMSE {self.chosen.rmse:.3g} K."
        below = (self.offsets_text, self.instants_text, *self.roles.questions)
        return "\n".join(t for t in (answer, self.powers_text, self.shares_text, *self.findings, *below, str(self.search)) if t)

    @property
    def findings(self) -> list[str]:
        """What to know before its values are used: what is not physical or not explained, what the log leaves open, what is assumed."""
        *first, last = sorted(self.search.orders)
        open_orders = f"This log cannot separate structures of {', '.join(map(str, first))} and {last} masses." if first else ""
        assumed = f"Assumed: {self.assumed}" if self.assumed else ""
        units = {"capacitance": "J/K", "conductance": "W/K"}
        ranges = ", ".join(f"{p} {low:.4g} to {high:.4g} {units[p.rpartition('.')[2]]}" for p, (low, high) in self.depending.items())
        depending = (
            f"Not determined, because structures that fit as well differ: {ranges}. State masses or paths that you know: --mass, --path."
        )
        impossible = (f"Not physical: {c}" for c in self.not_physical)
        return [t for t in (*impossible, self.unexplained, open_orders, depending if ranges else "", assumed) if t]


@dataclass(frozen=True)
class Rest:
    """The beginning of a record without power.

    Parameters
    ----------
    seconds : float     How long it lasts; 0 for no reading without power, and where no power is logged. [s]
    drift : float       Largest change of a part against the surroundings, or of a temperature where these are not logged. [K]
    steady : bool       Whether no temperature changes by more than its noise there.
    shows : bool        Whether parts move with the surroundings or not at all, and by less than an offset is known before.
    silent : tuple      Columns of parts without readings there.
    starts : dict       ``initial.PART`` -> temperature of logged surroundings, and how far the part may be from it; where it shows offsets.
    """

    seconds: float = 0.0
    drift: float = 0.0
    steady: bool = True
    shows: bool = False
    silent: tuple[str, ...] = ()
    starts: Mapping[str, LocalSpec] = field(default_factory=dict)


def beginning_rest(record: Record, roles: Roles, noise: Mapping[str, float], accuracy: float = ACCURACY) -> Rest:
    """Return how a record begins without power: how long, how much parts drift, whether that shows offsets, and starts of parts.

    Without power are samples of 1 % of the largest at most. Changes are those of the mean from the first half to the second; noise
    explains one up to 3 noise / sqrt(readings of a half) + 0.02 K. A part that follows drifting surroundings changes between not at all
    and as they do; one that cools changes otherwise. How far it is behind them at the beginning depends on how they drifted before, which
    no reading shows: as much again, twice the change, is one standard deviation of its start. In simulated rooms, of parts with time
    constants of 10 min to 5 h, 4 % were farther than two of them.

    Parameters
    ----------
    record, roles   The log, and what its columns are.
    noise : dict        Column -> noise of one reading. [K]
    accuracy : float    Of the thermometers, one standard deviation. [K]
    """
    off = np.ones(record.times.size, dtype=bool)
    for p in (p for p in roles.powers if p.column in record.channels):
        watts = np.nan_to_num(record[p.column].values)
        off &= np.abs(watts) <= 0.01 * max(float(np.max(np.abs(watts))), 1e-12)
    size = int(np.argmin(off)) or (off.size if off.all() else 0)
    if not roles.powers or size < MIN_REST_READINGS:
        return Rest(float(record.times[max(size - 1, 0)] - record.times[0]) if roles.powers else 0.0, np.inf)
    changes: dict[str, tuple[float, float, float]] = {}  # of the mean, what noise explains of it, and the mean
    for c in (record[c] for c in (*roles.parts, roles.surroundings) if c in record.channels):
        values = c.values[:size][c.valid[:size]]
        if (half := values.size // 2) >= MIN_REST_READINGS // 2:
            by_noise = 3.0 * (noise.get(c.name) or noise_of(c)) / half**0.5 + 0.02
            changes[c.name] = float(values[half:].mean() - values[:half].mean()), by_noise, float(values.mean())
    around, by_noise_around, mean = changes.get(roles.surroundings, (0.0, 0.0, 0.0))
    parts = {c: changes[c] for c in roles.parts if c in changes}
    follows = all(min(around, 0.0) - limit <= change <= max(around, 0.0) + limit for change, limit, _ in parts.values())
    drift = max((abs(change - around) for change, *_ in parts.values()), default=np.inf)
    steady = abs(around) <= by_noise_around and all(abs(change) <= limit for change, limit, _ in parts.values())
    silent = tuple(c for c in roles.parts if c in record.channels and c not in parts)
    shows = bool(parts) and (steady or (follows and drift <= MAX_REST_DRIFT * accuracy))
    start = LocalSpec(f"{mean - around:.6g} [K]", float(f"{2.0 * abs(around) + by_noise_around:.2g}"))
    starts = {f"initial.{roles.parts[c]}": start for c in parts} if shows and mean else {}
    return Rest(float(record.times[size - 1] - record.times[0]), drift, steady, shows, silent, starts)


def base_deck(roles: Roles, capacity: float, loss: float, contact: float = 0.3, facts: StatedFacts = StatedFacts()) -> dict[str, Any]:
    """Return the deck of measured parts, each joined to all others and to the surroundings.

    Parameters
    ----------
    roles : Roles       With a part for every power.
    capacity : float    Heat capacity that each begins with. [J/K]
    loss : float        Conductance to the surroundings that each begins with. [W/K]
    contact : float     Conductance between two parts that each begins with, over `loss`. [-]
    facts : StatedFacts       Masses and paths.
    """
    parts, out, shares = list(roles.parts.values()), roles.boundary, [p for p in roles.powers if p.share and not p.rest]
    pairs = facts.paths or (itertools.combinations(parts, 2) if len(parts) <= COMPLETE else itertools.pairwise(parts))
    links = {f"{a}_to_{b}": {"kind": "conduction", "between": [a, b], "conductance": f"{contact * loss!r} [W/K]"} for a, b in pairs}
    losses = {f"{p}_loss": {"kind": "conduction", "between": [p, out], "conductance": f"{loss!r} [W/K]"} for p in parts}
    sizes = {p: facts.masses[p].capacitance if p in facts.masses else capacity for p in parts}
    weighed = facts.masses if facts.bounded else {}
    ends = {p: dict(zip(("min", "max"), map("{!r} [J/K]".format, mass.bounds), strict=True)) for p, mass in weighed.items()}
    return {
        "title": "Proposed",
        "needs": [out],
        "parameters": {
            p.share: f"1 - {' - '.join(p.rest)}" if p.rest else {"value": 1 / (1 + len(shares)), "min": 0, "max": 1}
            for p in roles.powers
            if p.share
        },
        "nodes": {p: {"capacitance": {"value": f"{size!r} [J/K]", **ends.get(p, {})}} for p, size in sizes.items()},
        "conductors": {**links, **losses},
        "loads": {p.load: {"into": p.node, "power": "1 [W]" if p.anchored else "0 [W]"} for p in roles.powers},
    }


def request_of(
    roles: Roles, records: Sequence[Record], capacity: float, loss: float, contact: float = 0.3, facts: StatedFacts = StatedFacts()
) -> Request:
    """Return the fit of a proposal: of the deck in `facts` where there is one, else of parts (masses and conductances) made from the roles.

    Free are each mass's capacitance [J/K] and each link's conductance [W/K], powers that were not logged in watts and the shares of
    powers; of a deck the free values that nothing states. Without a power in watts and without a known mass only ratios are seen, so the
    first capacitance is assumed and not fitted. Surroundings that no log and no fact gives are fitted for each record, from the lowest
    first reading.

    Parameters
    ----------
    capacity, loss : float      Starts of a mass [J/K] and of a link to the surroundings. [W/K]
    contact : float             Start of a link between two parts, over `loss`. [-]
    """
    if facts.deck is not None:
        # the values of a deck that a first fit looks for
        values = ParameterSet(facts.deck)
        roots = [values.literal_behind(p) for p in values.table if p.rpartition(".")[2] in FREE]
        model, free = facts.deck, [p for p in dict.fromkeys(roots) if p and values.table[p].parameter.source not in STATED]
    else:
        deck = base_deck(roles, capacity, loss, contact, facts)
        free = [f"{n}.capacitance" for n in deck["nodes"]] + [f"{c}.conductance" for c in deck["conductors"]]
        free += [] if _in_watts(roles) else [f"{p.load}.power" for p in roles.powers]
        free += [p.share for p in roles.powers if p.share and not p.rest]
        if _ratios_only(roles, facts):
            first = next(iter(deck["nodes"]))
            deck["nodes"][first]["capacitance"] = {"value": f"{ASSUMED!r} [J/K]", "source": "assumed", "note": "ratios to it are fitted"}
            free.remove(f"{first}.capacitance")
        model = model_from_dict(deck)
    scenario = Scenario("log", boundaries={roles.boundary: roles.surroundings} if roles.surroundings and not roles.logged else {})
    local = {}
    if not roles.surroundings:
        lowest = min((first_reading(r, c), c) for r in records for c in roles.parts if c in r.channels)
        local = {roles.boundary: LocalSpec(lowest[1], LOOSE_AMBIENT)}
    priors = {path: prior for path, prior in facts.priors.items() if path in free}
    request = Request(model, tuple(records), tuple(free), {"*": scenario}, local, facts.starts, priors=priors, name="proposed")
    return replace(request, options=replace(request.options, max_steps=MOST_STEPS))


def _in_watts(roles: Roles) -> bool:
    """Whether some power is known in watts."""
    return any(not p.anchored for p in roles.powers)


def _ratios_only(roles: Roles, facts: StatedFacts) -> bool:
    """Whether nothing gives a scale of heat: no power in watts, no mass from a scale, no deck."""
    return not _in_watts(roles) and not facts.masses and facts.deck is None


def seated(roles: Roles, deck: Model) -> Roles:
    """Return roles whose parts, powers and surroundings are those of a deck.

    Raises
    ------
    DeckError           When the deck has not one boundary, or no load for a power.
    NameNotFoundError   When a part is not a node of it.
    """
    if len(deck.needs) != 1:
        needed = ", ".join(deck.needs) or "none"
        raise DeckError(
            f"init needs a deck with one boundary, and this one needs {needed}. Bind the others in a deck around it.",
            "--deck",
            code="value.incomplete",
        )
    refuse_unknown(
        roles.parts.values(),
        deck.nodes,
        "--deck",
        "no node '{}' in the deck. Name the part of a column: --temperature COLUMN=PART. Nodes: {known}.",
    )
    powers = []
    for p in roles.powers:
        able = [n for n, load in deck.loads.items() if not p.node or load.into == p.node]
        able = [n for n in able if part_name(p.column) in n or n in part_name(p.column)] or able
        if len(able) != 1:
            raise DeckError(
                f"power '{p.column}' may be any of {', '.join(able) or 'no load'}. Name its part: --power {p.column}=PART.",
                "--deck",
                code="value.incomplete",
            )
        powers.append(replace(p, node=deck.loads[able[0]].into, seat=able[0], told=True))
    return replace(roles, powers=tuple(powers), boundary=deck.needs[0])


def propose(
    roles: Roles,
    records: Sequence[Record],
    evaluations: int = EVALUATIONS,
    facts: StatedFacts = StatedFacts(),
    progress: Callable[[str, float], None] | None = None,
) -> Proposal:
    """Propose a structure for logs.

    Parameters
    ----------
    roles : Roles           What the columns are.
    records : sequence      The logs, read with these roles.
    evaluations : int       Budget of everything that is fitted.
    facts : StatedFacts           Accuracy of thermometers, masses, paths, a deck to begin with.
    progress : callable     As of `EvaluationBudget`.

    Raises
    ------
    IdentificationError     When no part's temperature changes by more than its noise, or a log without a power is not explained.
    """
    sizes, budget = dict[str, float](), EvaluationBudget(evaluations, progress)
    for record in records:
        sizes = {**with_noise(record, sizes)[1], **sizes}
    facts = replace(facts, rests={r.name: beginning_rest(r, roles, sizes, facts.accuracy) for r in records})
    prepared = [with_noise(r, sizes, facts.accuracy, bool(facts.starts))[0] for r in records]
    seen = [(c, record[c]) for record in prepared for c in roles.parts if c in record.channels]
    if not any(float(np.ptp(channel.values[channel.valid])) > 8.0 * sizes[c] for c, channel in seen):
        raise IdentificationError(
            "no temperature of a part changes by more than its noise, so the log does not determine any time constant. Log a test in "
            "which a power or the ambient changes.",
            prepared[0].name,
            code="fit.not-determined",
        )
    roles = replace(roles, powers=tuple(_placed(p, roles, prepared) for p in roles.powers))
    roles, begun = _begun(roles, prepared, facts, budget)
    begun, facts = _bounded_where_it_matters(roles, prepared, facts, begun, budget)
    changes = _within(roles, facts)
    search = search_structure(begun.request, changes=changes, evaluations=budget, begin=begun.fitted)
    budget = EvaluationBudget(max(evaluations - budget.spent, evaluations // 2), progress)
    if (sampled := _between_samples(begun, search.proposed, budget)) is not None:
        search = search_structure(sampled, changes=changes, evaluations=budget, begin=begun.fitted)
    assumed = ""
    if _ratios_only(roles, facts):
        first = next(iter(roles.parts.values()))
        assumed = (
            f"{first}.capacitance = {ASSUMED:g} J/K, because no column gives a power in watts, so the log determines ratios to it "
            f"only. Give --full-scale COLUMN='... [W]', or a mass: --mass {first}='1.2 [kg]'."
        )
    proposal = Proposal(roles, search, sizes, assumed, facts)
    if not roles.powers and proposal.unexplained:
        raise IdentificationError(" ".join([proposal.unexplained, *roles.questions]), prepared[0].name, code="fit.not-determined")
    return proposal


PROVES_INSTANT = 4.0
"""Log-likelihood that each instant has to gain, those that do nothing gain a half. [-]"""


def _between_samples(begun: FittedStructure, proposed: FittedStructure, budget: EvaluationBudget) -> Request | None:
    """Return the request in which powers changed between their samples, where the readings prove that they did; else None.

    A power of 18 W that changes half a minute before its sample gives 540 J that the log does not have, 0.4 K of a box of 1300 J/K. The
    instants are unknowns of a fit. A mass would answer a delay too, and a delay a mass, so instants have to fit better beside what a
    search found with powers as logged, or better than that beside nothing: its cost - theirs > `PROVES_INSTANT` n chi^2 / freedom, of n
    instants, with costs of half a sum of squares and chi^2 per degree of freedom of their fit.

    Parameters
    ----------
    begun : FittedStructure     The structure at the beginning.
    proposed : FittedStructure  That which a search proposes for powers as logged.
    budget : EvaluationBudget   What the evaluations of its fits are taken from.
    """
    records = tuple(_sampled(r) for r in begun.request.records)
    for one in (begun, proposed):
        try:
            moved = fitted_structure(one.changes, replace(one.request, records=records), one.fitted, None, budget)
        except (ThermidError, np.linalg.LinAlgError):
            continue
        count = sum(len(e.instants) for e in moved.problem.experiments)
        reduced = max(moved.end.chi_square / max(moved.problem.freedom, 1.0), 1e-12)
        if count and proposed.end.cost - moved.end.cost > PROVES_INSTANT * reduced * count:
            return replace(begun.request, records=records)
    return None


def _sampled(record: Record) -> Record:
    """Return a record whose powers and commands changed between their samples, where nobody says that they were logged as they changed."""
    driven = (c for c in record.channels.values() if c.role in ("load", "command") and c.held and c.prompt is None)
    return record.with_channels(*(replace(c, prompt=False) for c in driven))


def _within(roles: Roles, facts: StatedFacts) -> Any:
    """Return the changes of a fitted structure that keep it within the masses of a proposal, and weighed parts within their weight.

    Where paths are stated, measured parts stay as they are joined.
    """
    measured = set(roles.parts.values())

    def changes(structure: Fitted) -> list[MissingElement]:
        """Return the changes that may be tried: no more masses than parts ask for, and none at the tip of a sensor."""
        room = max(MOST_MASSES, len(measured) + 1) - len(structure.request.model.nodes)
        lags = [f"a lag of the sensor at '{n}'" for n in structure.request.model.nodes] + ["a lag of every sensor"]
        tips = [f"'{n}'" for n in structure.request.model.nodes if n not in measured and n.endswith("_sensor")]
        barred = [*UNSAID, *tips]  # a sensor touches its part and nothing else
        able = (c for c in structure.changes() if (c.nodes <= room or c.name in lags) and not any(w in c.name for w in barred))
        able = (c for c in able if not facts.paths or _joined(c.request.model, measured) <= _joined(structure.request.model, measured))
        return [_weighed(_fixed_sensors(c, structure) if c.name in lags else c, structure, roles, facts) for c in able]

    return changes


def _joined(model: Model, parts: Set[str]) -> set[frozenset[str]]:
    """Return the pairs of measured parts that heat passes between."""
    return {frozenset(law.between) for law in model.conductors.values() if set(law.between) <= parts}


def _fixed_sensors(lag: MissingElement, structure: Fitted) -> MissingElement:
    """Return a lag that is possible only as long as sensors that are fixed to a part have one."""
    tips = {n: node for n, node in lag.request.model.nodes.items() if n not in structure.request.model.nodes}
    held = {f"{n}_fit.conductance": literal(node.fields["capacitance"].text, "J/K", n) for n, node in tips.items()}

    def judge(values: Any) -> tuple[str, bool]:
        """Return what a lag says of a fit, and whether it is possible: no sensor is that slow."""
        text, possible = lag.judge(values)
        return text, possible and all(c / values[path].value <= SLOWEST_SENSOR for path, c in held.items())

    return replace(lag, judge=judge)


def _weighed(change: MissingElement, structure: Fitted, roles: Roles, facts: StatedFacts) -> MissingElement:
    """Return a change that is possible only as long as it takes no weighed part farther beyond what its weight allows than it was before.

    A part within its weight has to stay there. One that was beyond it comes back by several changes: each alone was refused, and the
    search ended at a structure that its weight rules out.

    A mass without a sensor that it fixes to a weighed part begins with a prior: a delay of the power would be answered by any mass.
    """

    def light(after: Request) -> Request:
        """Return a request in which masses beside a part of known mass have a prior by it."""
        priors = {}
        for n in (n for n in after.model.nodes if f"{n}.capacitance" in after.free and n not in roles.parts.values()):
            near = {m for law in after.model.conductors.values() if n in law.between for m in law.between} - {n, roles.boundary}
            if len(near) == 1 and (part := near.pop()) in facts.masses:
                priors[f"{n}.capacitance"] = (f"{FIXED * facts.masses[part].capacitance:.4g} [J/K]", FIXED_SD)
        return replace(after, priors={**priors, **after.priors})

    def judge(fitted: Any) -> tuple[str, bool]:
        """Return what a change says of a fit, and whether it is possible: no part is heavier or lighter than it can be."""
        text, possible = change.judge(fitted)
        wrong = [
            c
            for c in weights(change.request.model, {p: v.value for p, v in fitted.items()}, roles, facts.masses)
            if not min(c.low, before[c.path]) <= c.value <= max(c.high, before[c.path])
        ]
        return "; ".join([text, *(f"{c.path} is {c.verdict}" for c in wrong)]), possible and not wrong

    if not facts.masses:
        return change
    before = {c.path: c.value for c in weights(structure.request.model, structure.values, roles, facts.masses)}
    return replace(change, request=light(change.request), make=lambda request: light(change.make(request)), judge=judge)


def _placed(power: Power, roles: Roles, records: Sequence[Record]) -> Power:
    """Return a power with the part that it heats: as told, by its name, or the part that answers first to its changes."""
    parts = roles.parts
    if power.node or len(parts) == 1:
        return replace(power, node=power.node or next(iter(parts.values())))
    digits = [c for c in power.column if c.isdigit()]
    named = [n for c, n in parts.items() if (digits and [d for d in c if d.isdigit()] == digits) or n in part_name(power.column)]
    if len(named) == 1:
        return replace(power, node=named[0])
    best = max(parts, key=lambda column: _answer(power.column, column, records))
    return replace(power, node=parts[best], told=False)


def _answer(power: str, column: str, records: Sequence[Record]) -> float:
    """Return how strongly changes of a power are followed at once by the rate of a temperature. [K/s per W, in parts of its range]"""
    size = 0.0
    for r in records:
        if power not in r.channels or column not in r.channels:
            continue
        watts, kelvin = np.nan_to_num(r[power].values), r[column].values
        span = max(r.times.size // 60, 2)
        rate = (kelvin[span:] - kelvin[:-span]) / (r.times[span:] - r.times[:-span])
        moves = watts[:-span] - watts.mean()
        size += abs(float(np.dot(moves, rate - rate.mean()))) / max(float(np.dot(moves, moves)), 1e-12)
    return size


def _begun(roles: Roles, records: Sequence[Record], facts: StatedFacts, budget: EvaluationBudget) -> tuple[Roles, FittedStructure]:
    """Return the parts alone, fitted from several time constants, the best end; and what each power heats there.

    A power whose part nobody told is tried in every part. All beginnings go a little way; the better half of them goes on, until one is
    left, or the budget is.
    """
    rise, span, watts = _scales(roles, records)
    starts = itertools.product(PACES, CONTACTS if len(roles.parts) > 1 else CONTACTS[:1])
    beginnings: list[tuple[Roles, Request, Mapping[str, float]]] = []
    for placed, (pace, contact) in itertools.product(_placements(roles), starts if facts.deck is None else [(PACES[0], CONTACTS[0])]):
        loss = watts / max(rise, 1e-3) / len(roles.parts) if _in_watts(roles) else ASSUMED / (pace * span)
        beginnings.append((placed, request_of(placed, records, max(loss * pace * span, 1e-3), max(loss, 1e-6), contact, facts), {}))
    ends: list[tuple[Roles, FittedStructure]] = []
    refusal: ThermidError | None = None
    rounds = FIRST_HEAT
    while beginnings and not budget.over:
        if budget.progress is not None and len(beginnings) > 1:
            budget.progress(f"where powers go and what parts are like, {len(beginnings)} beginnings", 0.0)
        ended = []
        for placed, request, at in beginnings:
            if budget.over:
                break
            try:
                ended.append((placed, fitted_structure((), request, at, None, budget, rounds if len(beginnings) > 1 else MOST_EVALUATIONS)))
            except ThermidError as error:
                refusal = error
        ends = sorted([*ended, *ends[:1]], key=lambda end: end[1].end.cost)
        better = sorted(ended, key=lambda end: end[1].end.cost)[: len(beginnings) // 2]
        beginnings, rounds = [(placed, one.request, one.fitted) for placed, one in better], 2 * rounds
    if not ends:
        few = f"{budget.allowed:g} evaluations are too few for one structure. Allow more: --evaluations."
        words = few if budget.over else "no structure could be fitted. Check the roles of the columns with `thermid look`."
        raise (None if budget.over else refusal) or IdentificationError(words, records[0].name, code="fit.not-determined")
    return ends[0]


def _bounded_where_it_matters(
    roles: Roles, records: Sequence[Record], facts: StatedFacts, begun: FittedStructure, budget: EvaluationBudget
) -> tuple[FittedStructure, StatedFacts]:
    """Return the beginning with weighed parts within their weight, where they are beyond it and another value then differs threefold.

    A log whose power reaches a part late may make one body of a box and its plate, and of the plate a thermometer that lags.
    """
    if budget.over or all(c.verdict == "possible" for c in weights(begun.request.model, begun.values, roles, facts.masses)):
        return begun, facts
    strict = replace(facts, bounded=True)
    try:
        _, other = _begun(roles, records, strict, budget)
    except IdentificationError:
        if not budget.over:
            raise
    if budget.over:  # what was fitted to its end stands before what was not
        return begun, facts
    ratios = [begun.values[path] / value for path, value in other.values.items() if path in begun.values]
    return (other, strict) if max(ratios) > THREEFOLD or min(ratios) * THREEFOLD < 1.0 else (begun, facts)


def _placements(roles: Roles) -> list[Roles]:
    """Return the roles with each power that nobody placed in every part in turn; as it is where that would be too many."""
    choices = [[p] if p.told else [replace(p, node=n) for n in roles.parts.values()] for p in roles.powers]
    placements = list(itertools.islice(itertools.product(*choices), MOST_PLACEMENTS + 1))
    return [replace(roles, powers=powers) for powers in placements] if len(placements) <= MOST_PLACEMENTS else [roles]


def _scales(roles: Roles, records: Sequence[Record]) -> tuple[float, float, float]:
    """Return a typical rise [K], the length of the longest log [s], and the mean power [W]."""
    rise = max(float(np.ptp(r[c].values[r[c].valid])) for r in records for c in roles.parts if c in r.channels)
    span = max(r.duration for r in records)
    powers = [np.nanmean(np.abs(r[p.column].values)) for r in records for p in roles.powers if p.column in r.channels]
    return rise, span, max(float(np.sum(powers)) / max(len(records), 1), 1e-3)


SLIGHT = 0.02
"""A way of heat that carries less than this part of what leaves a part, and whose value the log does not tell, is left out. [-]"""
LOOSELY = 1.0
"""Standard error of a logarithm from which a value counts as not told by the log. [-]"""


@dataclass(frozen=True, eq=False)
class FirstFit:
    """The first fit of a campaign.

    Parameters
    ----------
    request : Request
    fixed : tuple of str        Values that the log does not determine; the campaign keeps them fixed.
    left_out : tuple of str     Conductors that were left out because the log does not show them.
    calibration : Calibration   Its result, errors by the structure included; None where no fit could be made.
    """

    request: Request
    fixed: tuple[str, ...]
    left_out: tuple[str, ...]
    calibration: Calibration | None


def first_fit_of(one: FittedStructure, boundary: str = SURROUNDINGS) -> FirstFit:
    """Return the fit that the campaign asks for, what it keeps fixed, and what was left out.

    Ways of heat that carry little and that the log does not tell are left out. Of other values that it does not tell, the least known one
    is fixed where the search found it, until the rest is known to better than a factor of e. What a full fit refuses after that is fixed
    too.
    """
    slight = _slight(one, one.errors(), boundary)
    model = replace(one.request.model, conductors={n: c for n, c in one.request.model.conductors.items() if n not in slight})
    units = {u.name: u.unit for u in one.problem.unknowns}
    texts = {n: Parameter.read(f"{v:.4g} [{units[n]}]", n) for n, v in one.values.items() if n.partition(".")[0] not in slight}
    model = model.with_values(texts, "thermid init")
    free = [n for n in one.request.free if n.partition(".")[0] not in slight]
    fixed: list[str] = []
    calibration = None
    sizes = one.errors(free)
    while free and max(sizes[n] for n in free) > LOOSELY:
        fixed.append(max(free, key=lambda n: sizes[n]))
        free.remove(fixed[-1])
        sizes = one.errors(free)
    priors = {path: prior for path, prior in one.request.priors.items() if path in free}
    request = replace(one.request, model=model, free=tuple(free), priors=priors, name="first fit")
    for name in sorted(free, key=lambda n: -sizes[n]):
        try:
            calibration = fit(replace(request, search="local"))
            break
        except IdentificationError:
            fixed.append(name)
            request = replace(request, free=tuple(n for n in request.free if n != name))
        except ThermidError:
            break
    return FirstFit(request, tuple(fixed), tuple(slight), calibration)


def _slight(one: FittedStructure, sizes: Mapping[str, float], boundary: str) -> list[str]:
    """Return conductors that carry little and are not told by the log."""
    values = one.values
    strength: dict[str, float] = {}
    paths = {n: c.between for n, c in one.request.model.conductors.items() if f"{n}.conductance" in values}
    for name, ends in paths.items():
        for end in ends:
            strength[end] = strength.get(end, 0.0) + values[f"{name}.conductance"]
    return [
        n
        for n, ends in paths.items()
        if sizes[f"{n}.conductance"] > 0.5 and all(values[f"{n}.conductance"] < SLIGHT * strength[e] for e in ends if e != boundary)
    ]
