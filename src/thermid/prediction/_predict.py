"""`predict`: what is known and a scenario in, a `Prediction` out: temperatures with their bands, and what the bands come from.

`foresee` says the same of a test before it is made.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import NameNotFoundError, SolverError, nearest, quoted
from thermid.base.files import FileKinds
from thermid.base.results import Named, PlottedTrace, Result, Row
from thermid.base.units import ICE_POINT, Array, Bools, duration_text, seconds, short
from thermid.fit.calibration import Calibration
from thermid.fit.error_model import AS_BUILT, LACK_ODDS, BandCause, NormalMixture
from thermid.inference.criticism import ExplainedFit, explained, summary
from thermid.model.tree import UNJUDGED, Model, Standing
from thermid.prediction._budget import (
    AVERAGED,
    DEFECTS,
    GAS_IN_JOINTS,
    STATED_RANGES,
    UNSOUGHT,
    Budget,
    Spread,
    assumed_left_out,
    budget_of,
    first_line,
    in_order,
)
from thermid.prediction._known import Knowledge
from thermid.prediction._setting import PROBE_MEMBERS, Drawn, Linear, Setting, prepared
from thermid.simulation.runs import DutyCycle, KeptTasks, Options, Scenario, Simulator, Solution, Workers, simulate
from thermid.values.store import LeftOut

ROUNDING = 1e-9
"""Scatter of members below which they are one temperature, and rounding. [K]"""
CAUSE_SHARE = 0.005
"""Share of a variance from which a table names its cause. [-]"""
MIN_CARRIER_PROBABILITY, MAJOR_SHARE = 0.1, 0.5
"""Probability from which the other answer to what carries the heat is told, and share of a variance that is most of it. [-]"""
MEANING = {
    BandCause.VALUES: "noise, instruments and priors leave the fitted values this uncertain",
    BandCause.STRUCTURE: "laws hold less well the further the conditions are from those of the fitted tests",
    BandCause.RUN: "coefficients, masses and powers differ from one test to the next",
    BandCause.ROOM: "a room drifts about what is logged of it",
    BandCause.UNEXPLAINED: "residuals that no departure of an element follows",
    AVERAGED: "whether free air or a fan carries the heat of surfaces, and how much of it is radiated",
    STATED_RANGES: "finishes, materials and parts differ from one to the next within the range that their catalogue or data sheet prints",
    GAS_IN_JOINTS: "no log shows how much of a joint is conduction through the gas between its faces",
}
"""Cause -> what it stands for."""
NARROWS = {
    BandCause.VALUES: "a run that determines the values better, or stated spreads",
    BandCause.STRUCTURE: "a test at conditions nearer to those that are asked",
    BandCause.RUN: "further runs, best at the conditions that are asked: they show how much elements differ",
    BandCause.ROOM: "a room that is logged better, or held",
    BandCause.UNEXPLAINED: "an element that explains what the residuals show: criticise looks for it",
    AVERAGED: "a deck that states what carries the heat (carried_by), measured emissivities, or a run at another difference",
    STATED_RANGES: "a measured value instead of one within a range, or a record that determines it",
    GAS_IN_JOINTS: "a record at low pressure, a gap in the deck, or gas = 'none' where a pad or grease fills the joint",
}
"""Cause -> what would narrow a band that comes from it."""
DRAWN_MEMBERS = (500, 2000)
"""Members drawn where derivatives do not do, at least and at most."""
DRAWN_STEPS = 2_000_000
"""Steps of the integrator for them: runs that switch many times are drawn less often; 500 know a half-width to some 4 %."""
MAX_MEAN_MISS, MAX_WIDTH_MISS = 0.1, 0.1
"""What the mean may be off by, in half-widths of the 95 % band, and its half-width, relative, before derivatives do not do."""
NEGLIGIBLE_HALF_WIDTH = 0.05
"""Half-width of the 95 % band below which nobody minds how it was computed. [K]"""
NAMED_SHARE = 0.1
"""Part of that below which a cause of a shift is not named. [-]"""
QUANTILE_DRAWS = 4096
"""Draws of a straight model that give the quantiles of its laws."""
BENT = "nonlinearity of the model"
"""Cause: the mean of a curved answer, or of laws that are not normal, is not the answer at the mean."""
SWITCHING = "switching times"
"""Cause: members switch at other times than the run with the best values, so their mean is no course of one of them."""
Given = Mapping[str, Any] | Spread


@dataclass(frozen=True)
class Estimate:
    """One temperature with its standard error.

    Parameters
    ----------
    celsius : float     [degC]
    error : float       Standard error. [K]
    low, high : float   95 % band. [degC]
    shares : dict       Cause -> its share of the variance. [-]
    """

    celsius: float
    error: float
    low: float
    high: float
    shares: Mapping[str, float]

    def __str__(self) -> str:
        """Return it with its error."""
        return f"{self.celsius:.2f} +- {short(self.error)} degC ({self.low:.2f} .. {self.high:.2f})"


def parted(parts: Mapping[str, Array], variance: Array) -> dict[str, Array]:
    """Return cause -> its part of a variance (times,), in proportion to `parts`; zeros where these are zero. [K^2]"""
    whole = np.sum([np.zeros(variance.size), *parts.values()], axis=0)
    grown = np.divide(variance, whole, out=np.zeros(variance.size), where=whole > 0.0)
    return {c: v * grown for c, v in parts.items()}


@dataclass(frozen=True, eq=False)
class Band(Result):
    """The predicted temperature of a node over time.

    Parameters
    ----------
    path : str                      The node.
    times : array (times,)          [s]
    simulated : array (times,)      What the model says with its best values. [K]
    shift : array (times,)          What it is expected to be wrong by, where coefficients that it holds constant are used further off. [K]
    parts : dict                    Cause -> variance (times,). [K^2]
    members : array or None         Temperatures (times, members) of drawn members, where draws were asked for. [K]
    shifts : dict                   Cause -> its part of `shift` (times,). [K]
    mixture : NormalMixture or None Of the temperature, where the heat of surfaces may be carried in several ways.
    """

    path: str
    times: Array
    simulated: Array
    shift: Array
    parts: Mapping[str, Array]
    members: Array | None = field(default=None, repr=False)
    shifts: Mapping[str, Array] = field(default_factory=dict, repr=False)
    mixture: NormalMixture | None = field(default=None, repr=False)

    def _summary(self) -> str:
        """Return the last temperature of the node and its 95 % band. [degC]"""
        low, high = (end[-1] for end in self.interval())
        return f"{self.path}: {self.celsius[-1]:.2f} degC at {self.times[-1]:g} s, 95 % band {low:.2f} to {high:.2f} degC"

    def _as_rows(self) -> list[Row]:
        """Return the end of the course."""
        low, high = (float(end[-1]) for end in self.interval())
        return [{"node": self.path, "final_C": float(self.celsius[-1]), "low_C": low, "high_C": high}]

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the expected course with its 95 % band."""
        low, high = self.interval()
        return [PlottedTrace(self.path, self.times, self.celsius, low, high)]

    @property
    def moved(self) -> dict[str, Array]:
        """What moves the centre of the band from the run with the best values, cause -> (times,); drawn members have a mean too. [K]"""
        named = {c: v for c, v in self.shifts.items() if v.any()}
        rest = self.kelvin - self.simulated - np.sum([np.zeros(self.times.size), *named.values()], axis=0)
        return named | ({BENT: rest} if float(np.abs(rest).max(initial=0.0)) > ROUNDING else {})

    @cached_property
    def kelvin(self) -> Array:
        """Expected temperatures (times,): the mean of the members where there are some. [K]"""
        return self.simulated + self.shift if self.members is None else np.asarray(self.members.mean(axis=1))

    @property
    def switches(self) -> bool:
        """Whether members switch at different times, so that each has extremes of its own."""
        return self.members is not None and SWITCHING in self.shifts

    @property
    def parted(self) -> Band:
        """The band with the variance of its members parted as that by derivatives."""
        return replace(self, parts=parted(self.parts, self.error**2))

    @property
    def celsius(self) -> Array:
        """Expected temperatures (times,). [degC]"""
        return self.kelvin - ICE_POINT

    @cached_property
    def error(self) -> Array:
        """Standard error (times,). [K]"""
        if self.members is not None:
            variance = np.mean((self.members - self.kelvin[:, None]) ** 2, axis=1)
        else:
            variance = np.sum([np.zeros(self.times.size), *self.parts.values()], axis=0)
        return np.where(variance < ROUNDING**2, 0.0, np.sqrt(variance))

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper ends (times,) of the band that holds the truth with the probability `level`. [degC]

        Quantiles (1 - level)/2 and (1 + level)/2 of the members, else of the mixture of ways; else the centre -+ z s of a normal
        distribution.
        """
        if self.members is not None:
            low, high = np.quantile(self.members, [0.5 - level / 2, 0.5 + level / 2], axis=1)
            return low - ICE_POINT, high - ICE_POINT
        if self.mixture is not None:
            low, high = self.mixture.interval(level)
            return low - ICE_POINT, high - ICE_POINT
        wide = NormalDist().inv_cdf(0.5 + level / 2) * self.error
        return self.celsius - wide, self.celsius + wide

    @property
    def half_width(self) -> Array:
        """Half the width (times,) of the band that holds the truth in 95 of 100 cases. [K]"""
        low, high = self.interval()
        return np.asarray(0.5 * (high - low))

    def extreme(self, sign: float, during: Bools | slice = slice(None), *level: float) -> tuple[float, float]:
        """Return the highest (sign 1) or lowest (-1) expected temperature of the run, and the end of the band that lies furthest. [K]

        Of members each has an extreme of its own, which no quantile at an instant shows where they switch at different times. `during`
        chooses times; the `level` is that of `interval`.
        """
        if self.members is None or not self.switches:
            end = self.interval(*level)[int(sign > 0.0)][during]
            return sign * float((sign * self.kelvin[during]).max()), sign * float((sign * end).max()) + ICE_POINT
        furthest = replace(self, members=sign * (sign * self.members[during]).max(axis=0)[None, :])
        return float(furthest.kelvin[0]), float(furthest.interval(*level)[int(sign > 0.0)][0]) + ICE_POINT

    def at(self, time: float) -> Estimate:
        """Return the temperature at a time within the run, straight lines between stored times. [s]"""
        low, high = (float(np.interp(time, self.times, x)) for x in self.interval())
        parts = {c: float(np.interp(time, self.times, v)) for c, v in self.parts.items()}
        celsius, error = (float(np.interp(time, self.times, x)) for x in (self.celsius, self.error))
        return Estimate(celsius, error, low, high, shares(parts))

    @cached_property
    def final(self) -> Estimate:
        """The last temperature."""
        return self.at(float(self.times[-1]))


def shares(parts: Mapping[str, float]) -> dict[str, float]:
    """Return cause -> share of the sum of variances; zeros where that is zero. [-]"""
    whole = sum(parts.values())
    return {c: v / whole if whole > 0 else 0.0 for c, v in parts.items()}


@dataclass(frozen=True, eq=False)
class Prediction(Named[Band]):
    """What a fitted model says of a scenario, and with what uncertainty.

    Parameters
    ----------
    title, scenario : str       The model's and the scenario's titles.
    times : array (times,)      [s]
    bands : dict                Node -> Band.
    settled : dict              Node -> Estimate with the inputs of the end held for good; empty where nothing settles.
    causes : dict               Cause -> what it stands for, in words.
    warnings : tuple of str     What a reader must know.
    standing : Standing         Of the values that it rests on.
    left_out : tuple of LeftOut What the bands do not count.
    least : float               Standard error beside which that is to be seen. [K]
    explanation : str           Which defect, fitted beside the deck, the prediction counts; empty where it is that of the deck.
    duty_cycles : dict          Thermostat -> DutyCycle of the run with the best values, with those of members where these were drawn.
    """

    title: str
    scenario: str
    times: Array
    bands: Mapping[str, Band]
    settled: Mapping[str, Estimate]
    causes: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    _find: Mapping[str, str] = field(default_factory=dict, repr=False)
    standing: Standing = UNJUDGED
    left_out: tuple[LeftOut, ...] = ()
    least: float = 0.0
    explanation: str = ""
    duty_cycles: Mapping[str, DutyCycle] = field(default_factory=dict)

    @property
    def not_counted(self) -> str:
        """What a reader must know first: what the bands do not count and could matter; empty where nothing is."""
        return first_line(self.left_out, self.least)

    def __getitem__(self, node: str) -> Band:
        """Return the band of a node; aliases are accepted.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        path = self._find.get(node, node) if isinstance(node, str) else ""
        if path not in self.bands:
            raise NameNotFoundError(f"no node '{node}' was predicted.{nearest(node, self.bands)}", self.title)
        return self.bands[path]

    def __contains__(self, node: object) -> bool:
        """Whether a node was predicted; aliases are accepted."""
        return node in self.bands or node in self._find

    def _entries(self) -> Mapping[str, Band]:
        """Return node -> its band."""
        return self.bands

    @property
    def final(self) -> dict[str, Estimate]:
        """Node -> its last temperature."""
        return {n: b.final for n, b in self.bands.items()}

    def to_dict(self, at: list[float] | None = None) -> dict[str, Any]:
        """Return everything but the traces as plain numbers: at the end, settled, and at some times. [s]"""
        times = np.atleast_1d(seconds(() if at is None else at))

        def plain(e: Estimate) -> dict[str, Any]:
            """Return an estimate as JSON holds it."""
            return {"C": e.celsius, "error_K": e.error, "low_C": e.low, "high_C": e.high, "shares": dict(e.shares)}

        nodes = {
            n: {
                "run_C": float(b.simulated[-1]) - ICE_POINT,
                "moved_K": {c: float(v[-1]) for c, v in b.moved.items()},
                "final": plain(b.final),
                "steady": plain(self.settled[n]) if n in self.settled else None,
                "at": [plain(b.at(float(t))) for t in times],
            }
            for n, b in self.bands.items()
        }
        return {
            "title": self.title,
            "scenario": self.scenario,
            "standing": self.standing.to_dict(),
            "nodes": nodes,
            "duty_cycles": {name: duty.to_dict() for name, duty in self.duty_cycles.items()},
            "causes": dict(self.causes),
            "left_out": [{"what": x.what, "kelvin": x.kelvin if np.isfinite(x.kelvin) else None} for x in self.left_out],
            "warnings": list(self.warnings),
            **({"explanation": self.explanation} if self.explanation else {}),
        }

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write times, temperatures and the ends of the 95 % bands, three columns per node."""
        header, columns = ['"time_s"'], [self.times]
        for name, band in self.bands.items():
            low, high = band.interval()
            header += [f"{name} [degC]", f"{name} low [degC]", f"{name} high [degC]"]
            columns += [band.celsius, low, high]
        with FileKinds.TABLE.replacing(path) as half:
            np.savetxt(half, np.column_stack(columns), delimiter=",", header=",".join(header), comments="", fmt="%.9g")

    def __str__(self) -> str:
        """Return the end of the run as a table, and what the variance comes from."""
        width = max([4, *(len(n) for n in self.bands)])
        lines = [f"{self.title}, {self.scenario}: temperature +- one standard error, and the 95 % band"]
        lines = [*(x for x in (self.explanation, self.not_counted) if x), *lines, *(f"  warning: {w}" for w in self.warnings)]
        for name, band in self.bands.items():
            e = band.final
            steady = self.settled.get(name)
            rest = f"   settles at {steady.celsius:8.2f} +- {short(steady.error)} with the inputs of the end" if steady else ""
            lines.append(
                f"  {name:<{width}}  end {e.celsius:8.2f} +- {short(e.error)} degC   95 %: {e.low:.2f} .. {e.high:.2f}{rest}{_why(e)}"
            )
        lines += [f"  {name}: {duty}" for name, duty in self.duty_cycles.items()]
        lines += [f"  {words}" for words in [self.centre] if words]
        lines += [f"  {cause}: {text}" for cause, text in self.causes.items()]
        return self.standing.over("\n".join(lines))

    @property
    def centre(self) -> str:
        """How far the centres of the bands lie from the run with the best values, and why; empty where nobody minds."""
        return centre_words({n: b.moved for n, b in self.bands.items()}, self.times)

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return every node with its 95 % band."""
        return [PlottedTrace(n, b.times, b.celsius, *b.interval()) for n, b in self.bands.items()]

    def _as_rows(self) -> list[Row]:
        """Return every node with its last temperature, error and 95 % band."""
        return [{"node": n, "final_C": e.celsius, "error_K": e.error, "low_C": e.low, "high_C": e.high} for n, e in self.final.items()]


def centre_words(moved: Mapping[str, Mapping[str, Array]], times: Array) -> str:
    """Return how far the centre of a band lies from the run with the best values, where that is most, and why; empty where nobody minds.

    Parameters
    ----------
    moved : dict            Node -> cause -> what it moves the centre by (times,). [K]
    times : array (times,)  [s]
    """
    apart = {n: np.sum([np.zeros(times.size), *parts.values()], axis=0) for n, parts in moved.items()}
    node = max(apart, key=lambda n: float(np.abs(apart[n]).max(initial=0.0)), default="")
    if not node or float(np.abs(apart[node]).max(initial=0.0)) < NEGLIGIBLE_HALF_WIDTH:
        return ""
    k = int(np.abs(apart[node]).argmax())
    named = sorted(((c, float(v[k])) for c, v in moved[node].items()), key=lambda item: -abs(item[1]))
    why = ", ".join(f"{c} ({'+' if v > 0.0 else ''}{short(v)} K)" for c, v in named if abs(v) >= NAMED_SHARE * NEGLIGIBLE_HALF_WIDTH)
    return (
        f"at {duration_text(float(times[k]))} the band of '{node}' is centred {short(abs(float(apart[node][k])))} K "
        f"{'above' if apart[node][k] > 0.0 else 'below'} the run with the fitted values, because of {why}; simulate shows that "
        "run. Report the centre of the band with its ends; other nodes differ less"
    )


def _why(e: Estimate) -> str:
    """Return the causes with their shares of a variance, the largest first; empty where none has 0.5 %."""
    parts = [f"{c} {100 * s:.0f} %" for c, s in sorted(e.shares.items(), key=lambda item: -item[1]) if s >= 0.005]
    return f"   from {', '.join(parts)}" if parts else ""


def predict(
    fit: Calibration | Knowledge,
    scenario: Scenario,
    *,
    model: Model | None = None,
    spread: Given | Sequence[Given] = (),
    times: Any = None,
    nodes: Sequence[str] | None = None,
    without: Sequence[str] = (),
    draws: int = 0,
    seed: int = 0,
    options: Options | None = None,
    as_logged: bool = False,
    executor: Workers = None,
) -> Prediction:
    """Prediction of a scenario: temperatures with standard errors, and the sources of these.

    The band is that of the model of error of the fit (docs/statistics.md), with what is stated and what stages below say beside it.
    Errors are carried by the derivatives of every temperature with respect to every source (Joint Committee for Guides in Metrology, GUM
    2008, 5.2.2). Where members drawn from the same sources would give another band (mean or half-width off by a tenth of the
    half-width), members are drawn, and a remark states this.

    Where a fit leaves residuals larger than the stated noise and a hidden defect (a clock, lags, a mass, a leak) is proved to explain
    them, the prediction is that of the fits with this defect, averaged by their probabilities; its first line states this. Where none is
    proved nothing is narrowed. ``without=("hidden defects",)`` keeps to the deck.

    Where the scenario thins the gas of surfaces whose coefficients are effective, these are separated first (`split`); joints fitted in air
    are then as uncertain as their gas.

    Parameters
    ----------
    fit : Calibration, Knowledge    What is known: a fit, or a model with fitted values.
    scenario : Scenario         What is done to the model; it is taken as exact but for what `spread` says.
    model : Model               Another model that holds the fitted paths, on which the fit's values are laid; the fitted one by default.
    spread : dict, Spread       What else is not known exactly: name -> spread as text, or `Spread`, or several of these.
    times                       When to store, as in `simulate`.
    nodes : sequence of str     Nodes to predict; all by default.
    without : sequence of str   Sources that are not counted: kinds (``structural``, ``misfit``) or causes; the result states this.
    draws : int                 Members drawn from the sources; bands are then quantiles. 0 for derivatives, as long as they do.
    seed : int                  Of the draws.
    options : Options           The integrator's.
    as_logged : bool            Whether rooms and powers of the scenario are what instruments of the fit would read, constant errors and
                                all; else they are what acts.
    executor                    As in `ensemble`: who runs members, if any are drawn; the same bits from all.

    Raises
    ------
    IdentificationError     When a value is spread twice, or has no finite error; when a coefficient that must be separated cannot be.
    """
    knowledge = fit if isinstance(fit, Knowledge) else Knowledge.of_source(fit)
    budget = partial(budget_of, scenario=scenario, stated=spread, without=without, as_logged=as_logged)
    answer = partial(predicted, draws=draws, seed=seed, options=options, executor=executor)
    plain = answer(budget(knowledge.for_model(model) if model is not None else knowledge), nodes, times=times)
    if model is not None and (words := knowledge.replaced_values(model)):
        plain = replace(plain, warnings=(words, *plain.warnings))
    if knowledge.fit is None or model is not None or draws or DEFECTS in without:
        return plain
    others = explained(knowledge.fit)
    explained_predictions = [answer(budget(Knowledge.of_source(e.fit)), list(plain.bands), times=plain.times) for e in others]
    return averaged(plain, others, explained_predictions, knowledge.fit)


def carrier_words(budget: Budget, bands: Mapping[str, Band]) -> list[str]:
    """Return what nobody stated of the surfaces, what readings say of it, and what a statement would change; empty where it matters not."""
    share = max((b.final.shares.get(AVERAGED, 0.0) for b in bands.values()), default=0.0)
    if share < MIN_CARRIER_PROBABILITY:
        return []
    weights: dict[str, float] = {}
    for w in budget.ways:
        weights[w.departing.carrier] = weights.get(w.departing.carrier, 0.0) + w.weight
    weights.pop(AS_BUILT, 0.0)
    carriers = {name: weight / sum(weights.values()) for name, weight in weights.items()}
    finish, *lacks = np.sum([w.weight * np.array(w.departing.beside_deck) for w in budget.ways], axis=0).tolist()
    path, entry = (x * (x > LACK_ODDS / (1.0 + 2.0 * LACK_ODDS)) for x in lacks)  # where readings made it likelier
    named = ", ".join(f"{name} {100 * weight:.0f} %" for name, weight in carriers.items())
    words = {
        f"no deck states what carries the heat of its surfaces; the readings say {named}. State carried_by: the bands narrow": min(
            carriers.values(), default=1.0
        ),
        f"a surface has another finish than its deck states, with a probability of {100 * finish:.0f} %. Measure its emissivity, and give "
        'it source = "measured": the bands narrow': finish,
        f"a path carries heat to a boundary that the deck lacks, with a probability of {100 * path:.0f} %. Write it into the "
        "deck, where there may be one, and fit it": path,
        f"heat enters its node through a part that the deck lacks, with a probability of {100 * entry:.0f} %. Write it into the deck, and "
        "give its power to it": entry,
    }
    return [text for text, weight in words.items() if MIN_CARRIER_PROBABILITY <= weight < 1.0]


def averaged(plain: Prediction, others: Sequence[ExplainedFit], explained: Sequence[Prediction], fit: Calibration) -> Prediction:
    """Return the prediction by fits with hidden defects in place of that by the deck, if there are any: their mixture by mean and variance.

    Parameters
    ----------
    plain : Prediction      By the fit of the deck.
    others, told            Fits with a defect, and what each predicts.
    fit : Calibration       The fit of the deck.
    """
    if not others:
        return replace(plain, warnings=tuple(w for w in plain.warnings if w != UNSOUGHT))
    weights = np.array([e.weight for e in others])
    bands = {n: _mixture([t.bands[n] for t in explained], weights) for n in plain.bands}
    settled = {n: _mixed([t.settled[n] for t in explained], weights) for n in plain.settled if all(n in t.settled for t in explained)}
    causes = {c: w for t in reversed(explained) for c, w in t.causes.items()}
    causes |= {DEFECTS: "which defect the unit has, and where between two samples its powers changed"} if len(explained) > 1 else {}
    words = (
        f"the deck leaves residuals of {short(float(np.sqrt(fit.reduced_chi_square)))} times the stated noise, and these are explained "
        f"by what it does not have: {'; or '.join(summary(tuple(others)))}. The prediction and its band are those of the fit with it. "
        "Correct the deck or the log."
    )
    duty_cycles = {
        name: replace(duty, members=_shared_out([t.duty_cycles[name].members for t in explained], weights))
        for name, duty in explained[0].duty_cycles.items()
    }
    standing = Standing.worst([*(t.standing for t in explained), *fit.rests.values(), *([fit.verdict] if fit.verdict is not None else [])])
    warnings = tuple(dict.fromkeys(w for t in explained for w in t.warnings))
    return replace(
        plain,
        bands=bands,
        settled=settled,
        causes=causes,
        warnings=warnings,
        standing=standing,
        explanation=words,
        duty_cycles=duty_cycles,
        left_out=explained[0].left_out,
        least=explained[0].least,
    )


def _mixture(bands: Sequence[Band], weights: Array) -> Band:
    """Return the band whose mean and variance (times,) [K, K^2] are those of a mixture of bands with `weights` (bands,).

    The variance between the means, sum w (T - mean)^2, is that of `DEFECTS`.
    """
    kelvin = np.array([b.kelvin for b in bands])
    mean = weights @ kelvin
    parts: dict[str, Array] = {}
    shifts: dict[str, Array] = {}
    for b, w in zip(bands, weights, strict=True):
        for several, of_band in ((parts, b.parted.parts), (shifts, b.shifts)):
            for cause, v in of_band.items():
                several[cause] = several.get(cause, np.zeros(b.times.size)) + w * v
    if len(bands) > 1:
        parts[DEFECTS] = weights @ (kelvin - mean) ** 2
    simulated = weights @ np.array([b.simulated for b in bands])
    members = _shared_out([b.members.T for b in bands if b.members is not None], weights).T if all(b.switches for b in bands) else None
    return Band(bands[0].path, bands[0].times, simulated, mean - simulated, parts, members, shifts)


def _shared_out(members: Sequence[Array], weights: Array) -> Array:
    """Return the members of a mixture: of each part as many of its first (members, ...) as its weight says."""
    return np.concatenate([m[: round(w * len(m))] for m, w in zip(members, weights, strict=True)])


def _mixed(several: Sequence[Estimate], weights: Array) -> Estimate:
    """Return a mixture of estimates: mean sum w T, variance sum w (error^2 + (T - mean)^2), and the 95 % of a normal with these.

    Temperatures in degC, errors in K; `weights` (estimates,) sum to one.
    """
    celsius = float(weights @ [e.celsius for e in several])
    variances = {c: float(weights @ [e.shares.get(c, 0.0) * e.error**2 for e in several]) for e in several for c in e.shares}
    if len(several) > 1:
        variances[DEFECTS] = float(weights @ [(e.celsius - celsius) ** 2 for e in several])
    variance = sum(variances.values())
    error = variance**0.5 if variance >= ROUNDING**2 else 0.0
    wide = NormalDist().inv_cdf(0.975) * error
    return Estimate(celsius, error, celsius - wide, celsius + wide, shares(variances))


def predicted(
    budget: Budget,
    nodes: Sequence[str] | None = None,
    *,
    times: Any = None,
    draws: int = 0,
    seed: int = 0,
    options: Options | None = None,
    executor: Workers = None,
) -> Prediction:
    """Return what a budget says of its scenario; arguments as in `predict`."""
    ways = WayAnswer.of_budget(budget, nodes, prepared(budget, times=times, options=options))
    in_all = set.intersection(*(set(w.linear.columns) for w in ways))  # without gas, a path of one way alone reaches a node
    ways = [replace(w, linear=replace(w.linear, columns={n: c for n, c in w.linear.columns.items() if n in in_all})) for w in ways]
    first = max(ways, key=lambda w: w.weight)
    times = first.setting.ready.times
    best = simulate(budget.model, budget.scenario, times=times, options=options) if budget.ways else first.linear.run
    find = {n: best[n].path for n in (nodes if nodes is not None else best.nodes)}
    find |= {alias: path for alias, path in budget.model.every_alias().items() if path in find.values()}
    why = Missed() if draws else missed(first.setting, first.linear)
    affordable = int(np.clip(DRAWN_STEPS // max(best.statistics.get("steps", 1), 1), *DRAWN_MEMBERS))
    count = draws or (affordable if why.words else 0)
    sources = budget.drawn(budget.numbers(seed, 0, count))
    straight = not draws and not why.bent
    members, shares, lost = drawn_members(ways, budget.chosen(sources), sources, straight, executor) if count else ({}, {}, "")
    bands, rest = {}, {}
    for n in first.linear.columns:
        parts, shifts, centre, mixture = mixed_answer(ways, n, best[n].kelvin)
        now, moved = ({c: v[:-1] for c, v in several.items()} for several in (parts, shifts))
        members_of_node, end = members.get(n, (None, None))
        if members_of_node is not None and first.setting.switches:
            moved = {SWITCHING: members_of_node.mean(axis=1) - best[n].kelvin}
        bands[n] = Band(n, times, best[n].kelvin, centre[:-1] - best[n].kelvin, now, members_of_node, moved, taken(mixture, slice(0, -1)))
        if all(n in w.linear.settled for w in ways):
            last = {c: v[-1:] for c, v in parts.items()}
            drawn = end[None, :] if end is not None else None
            rest[n] = Band(n, times[-1:], centre[-1:], np.zeros(1), last, drawn, mixture=taken(mixture, slice(-1, None))).final
    warnings = (
        *best.warnings,
        *budget.remarks,
        *([f"{why.words}, so {count} members were drawn"] if why.words else []),
        *([lost] if lost else []),
        *undetermined_words(first, bands),
        *carrier_words(budget, bands),
    )
    omitted, least = _left_out(budget, bands)
    widest = max((b.final for b in bands.values()), key=lambda e: e.error, default=None)
    words = meaning(widest.shares if widest is not None else {}, budget)
    bands = {n: b.parted for n, b in bands.items()} if first.setting.switches else bands
    standing = Standing.worst([budget.standing, *best.doubts])
    duty_cycles = {name: duty.of_members(shares.get(name, duty.members)) for name, duty in best.duty_cycles.items()}
    titles = (budget.model.title, budget.scenario.title)
    return Prediction(*titles, times, bands, rest, words, warnings, find, standing, omitted, least, duty_cycles=duty_cycles)


def undetermined_words(answer: WayAnswer, bands: Mapping[str, Band]) -> list[str]:
    """Return which values no reading determines, of those that explain most of the end of a band; empty where there is none.

    What a value v explains of a temperature T, both straight in the sources, is ``cov(T, v) / sd(v)``: one that others compensate explains
    nothing.
    """
    budget, out = answer.setting.budget, list[str]()
    for k, t in enumerate(budget.targets):
        shared = budget.sizes * (budget.alike @ (budget.gain[k] * budget.sizes))
        spread = float(budget.gain[k] @ shared)
        if t.name not in budget.loose or not spread > 0.0:
            continue
        explained = {n: abs(float(answer.linear.columns[n][-2] @ shared)) / spread**0.5 for n in bands}
        most = [
            n
            for n, kelvin in explained.items()
            if kelvin**2 > MAJOR_SHARE * sum(float(v[-1]) for v in bands[n].parts.values()) and kelvin > NEGLIGIBLE_HALF_WIDTH
        ]
        if most:
            out.append(
                f"no reading determines '{t.name}': what was known of it before is most of the band of {quoted(most, 3)}. State a narrower "
                "prior of it, or fit a run that determines it: next_test names one"
            )
    return out


@dataclass(frozen=True, eq=False)
class WayAnswer:
    """A budget's answer where the heat is carried in one way, and the probability of that."""

    weight: float
    setting: Setting
    linear: Linear

    @classmethod
    def of_budget(cls, budget: Budget, nodes: Sequence[str] | None, ready: Simulator) -> list[WayAnswer]:
        """Return the answer of each way in the scenario of its budget, or in a variant of it, by what `prepared` gives of it."""
        settings = [(weight, Setting.of_budget(budget_of_way, ready)) for weight, budget_of_way in budget.weighted_ways]
        return [cls(weight, setting, setting.linear(nodes)) for weight, setting in settings]

    def kelvin(self, node: str) -> Array:
        """Return the temperatures (times and the settled state,) of a node where the derivatives were taken. [K]"""
        return np.append(self.linear.run[node].kelvin, self.linear.settled.get(node, np.nan))


def taken(mixture: NormalMixture | None, times: slice) -> NormalMixture | None:
    """Return a mixture at some of its times."""
    return replace(mixture, means=mixture.means[:, times], variances=mixture.variances[:, times]) if mixture is not None else None


def mixed_answer(
    ways: Sequence[WayAnswer], node: str, best: Array
) -> tuple[dict[str, Array], dict[str, Array], Array, NormalMixture | None]:
    """Return cause -> variance, cause -> what moves the centre from the run with the best values, the centre, and the mixture if it is one.

    Each is (times + 1,), at the times and where the run settles [K, K^2]; `best` (times,) is the run with the best values. With the
    weights w of the ways the centre is c = sum w_k c_k, c_k the run of a way with the means of its sources, and the variance sum w_k v_k +
    sum w_k (c_k - c)^2, the last by what the ways were built from.
    """
    parts: dict[str, Array] = {}
    shifts: dict[str, Array] = {}
    centres, variances = [], []
    for way in ways:
        budget, columns = way.setting.budget, way.linear.columns[node]
        centres.append(way.kelvin(node) + columns @ budget.means)
        far = np.array([way.setting.far.get(s.name, 0.0) for s in budget.sources])
        variances_by_cause = budget.parts(columns * np.sqrt(1.0 - far))
        if far.any():  # of what differs from run to run: that an element lies beyond the runs of its fit
            variances_by_cause[BandCause.STRUCTURE] += (columns * budget.sizes) ** 2 @ far
        variances.append(np.sum([np.zeros(len(columns)), *variances_by_cause.values()], axis=0))
        for several, of_way in ((parts, variances_by_cause), (shifts, budget.shifts(columns))):
            for cause, v in of_way.items():
                several[cause] = several.get(cause, 0.0) + way.weight * v
    weights = np.array([w.weight for w in ways])
    centre = weights @ np.array(centres)
    if len(ways) > 1:
        built = [w.setting.budget.ways[0].built for w in ways]
        for cause, variance in between_ways(weights, np.array(centres), built).items():
            parts[cause] = parts.get(cause, 0.0) + variance
    if any(w.setting.budget.ways for w in ways):
        run = weights @ np.array([w.kelvin(node) for w in ways])
        shifts[BandCause.STRUCTURE] = shifts.get(BandCause.STRUCTURE, 0.0) + run - np.append(best, run[-1])
    mixture = NormalMixture(weights, np.array(centres), np.array(variances)) if len(ways) > 1 else None
    return parts, shifts, centre, mixture


def between_ways(weights: Array, centres: Array, built: Sequence[tuple[bool, ...]]) -> dict[str, Array]:
    """Return cause -> its part (times,) of the variance of the centres of ways. [K^2]

    Between ways in which elements of the same fits depart it is what carries the heat; between these and others it is of the laws.

    Parameters
    ----------
    weights : array (ways,)             Probabilities.
    centres : array (ways, times)       [K]
    built : sequence of tuple of bool   Way -> of every model of error whether nothing departs in it.
    """
    groups = [np.array([b == pattern for b in built]) for pattern in dict.fromkeys(built)]
    centres = centres - centres[0]  # what all ways say alike is no difference of rounding
    whole = weights @ (centres - weights @ centres) ** 2
    among = np.zeros_like(whole)
    for group in groups:
        w = weights[group]
        among += w @ (centres[group] - w @ centres[group] / w.sum()) ** 2
    named = {AVERAGED: among} if len(groups) < len(built) else {}
    return named | ({BandCause.STRUCTURE: np.maximum(whole - among, 0.0)} if len(groups) > 1 else {})


def meaning(shares: Mapping[str, float], budget: Budget) -> dict[str, str]:
    """Return cause -> what it stands for; of the largest also what would narrow a band that comes from it.

    Parameters
    ----------
    shares : dict   Cause -> its share of the variance of the widest band. [-]
    """
    largest, out = max(shares, key=shares.__getitem__, default=""), {}
    for cause in (c for c, share in shares.items() if share >= CAUSE_SHARE):
        columns = [k for k, c in enumerate(budget.causes) if c == cause]
        names = [t.name for t, row in zip(budget.targets, budget.gain, strict=True) if row[columns].any()]
        out[cause] = MEANING.get(cause) or f"what is not known of {quoted(names, 3)}"
        if cause == largest and cause in NARROWS:
            out[cause] += f"; narrower by {NARROWS[cause]}"
    return out


Members = tuple[Array, Array]
"""Temperatures of members (times, members), and where these settle (members,). [K]"""


def drawn_members(
    ways: Sequence[WayAnswer], chosen: NDArray[np.int64], sources: Array, straight: bool, executor: Workers
) -> tuple[dict[str, Members], dict[str, Array], str]:
    """Return node -> members that reached the end, thermostat -> their duty cycles as of an `Ensemble`, and a remark on those that failed.

    Members are temperatures (times, members) and where they settle (members,) [K]; where straight lines do, those are the run plus c'z, c
    its derivatives by the sources z.

    Parameters
    ----------
    chosen : array (members,)           Which way each has.
    sources : array (sources, members)  Values of the sources, in their standard deviations.
    straight : bool                     Whether straight lines do.
    executor : see `Workers`            Who runs members otherwise.
    """
    failed: dict[int, str] = {}
    out: dict[str, list[Members]] = {}
    shares: dict[str, list[Array]] = {}
    for k, way in enumerate(ways):
        sources_of_way = sources[:, chosen == k]
        if not sources_of_way.shape[1]:
            continue
        columns = way.linear.columns
        rest = {n: way.kelvin(n)[-1] + c[-1] @ sources_of_way for n, c in columns.items()}
        if straight:
            kelvin = {n: way.linear.run[n].kelvin[:, None] + c[:-1] @ sources_of_way for n, c in columns.items()}
        else:
            drawn = _member_temperatures(way.setting, way.linear, sources_of_way, list(columns), KeptTasks.of_workers(executor).workers)
            rest |= _member_rest(way, sources_of_way, drawn, executor)
            kelvin = dict(drawn.kelvin)
            for name, of_way in drawn.runs.duty_cycles.items() if drawn.runs is not None else ():
                shares.setdefault(name, []).append(of_way)
            failed |= drawn.runs.failed if drawn.runs is not None else {}
        for n, traces in kelvin.items():
            complete = ~np.isnan(traces).any(axis=0)
            out.setdefault(n, []).append((traces[:, complete], rest[n][complete]))
    every = {n: (np.concatenate([a for a, _ in m], axis=1), np.concatenate([b for _, b in m])) for n, m in out.items()}
    why = next(iter(failed.values()), "")
    lost = f"{len(failed)} of {sources.shape[1]} members failed; the bands leave them out. One of them: {why}" if failed else ""
    return {n: m for n, m in every.items() if m[1].size}, {n: np.concatenate(several) for n, several in shares.items()}, lost


def _member_rest(way: WayAnswer, sources: Array, drawn: Drawn, executor: Workers) -> dict[str, Array]:
    """Return node -> where members settle (members,) [K], as `_member_temperatures`; empty where some members settle nowhere.

    Four times `PROBE_MEMBERS` are settled, each at the cost of 20 runs. T = a + b s + c s^2 + d r + e, s the straight line and r the end of
    the run, is fitted to them and gives the others, each with the e of one of them (control variates, as in `missed`).
    """
    setting, linear = way.setting, way.linear
    few = sources[:, : 4 * PROBE_MEMBERS]
    straight = setting.cancelled(linear)[:, None] * few
    try:
        rest = setting.rest(few - straight, list(linear.settled and linear.columns), executor)
    except SolverError:
        return {}
    out = {}
    for n, t in rest.items():
        terms = np.column_stack([np.vander(linear.columns[n][-1] @ sources, 3), np.nan_to_num(drawn.kelvin[n][-1])])
        settled = t + linear.columns[n][-1] @ straight
        curve = terms @ np.linalg.lstsq(terms[: t.size], settled, rcond=None)[0]
        out[n] = curve + np.resize(settled - curve[: t.size], curve.size)
    return out


def _member_temperatures(setting: Setting, linear: Linear, sources: Array, nodes: Sequence[str], executor: Workers = None) -> Drawn:
    """Return temperatures [K] of members at `sources` (sources, members); straight in those that the fit compensates (`cancelled`)."""
    straight = setting.cancelled(linear)[:, None] * sources
    drawn = setting.temperatures(sources - straight, nodes, extremes=False, executor=executor)
    return replace(drawn, kelvin={n: t + linear.columns[n][:-1] @ straight for n, t in drawn.kelvin.items()})


def _left_out(budget: Budget, bands: Mapping[str, Band]) -> tuple[tuple[LeftOut, ...], float]:
    """Return what is left out, and the standard error beside which that is to be seen: of the node where it weighs most. [K]"""
    errors = {n: float(b.error[-1]) for n, b in bands.items()}
    inner = {n: e for n, e in errors.items() if e > 0.0} or errors
    assumptions = assumed_left_out(budget, list(inner))
    weighs = {n: effect / max(inner[n], 1e-12) for _, effects in assumptions for n, effect in effects.items()}
    worst = max(weighs, key=weighs.__getitem__, default="")
    assumed = (replace(x, kelvin=effects.get(worst, x.kelvin)) if effects else x for x, effects in assumptions)
    return in_order((*budget.omitted, *assumed)), inner[worst] if worst else max(errors.values(), default=0.0)


@dataclass(frozen=True)
class Missed:
    """Where a band by derivatives would miss that of members.

    Parameters
    ----------
    words : str     Where and by how much; empty where it does not.
    bent : bool     Whether the model bends; otherwise only the laws of its sources are not normal.
    size : float    By how much, one at the border.
    """

    words: str = ""
    bent: bool = False
    size: float = 1.0


def missed(setting: Setting, linear: Linear) -> Missed:
    """Return where a band by derivatives would miss that of members.

    Members in pairs of opposite numbers u and 1 - u are compared with the straight model c'z at the same numbers, c the derivatives and z
    the draws of the sources. Their differences vary far less than the members themselves, so some tens of them say as much as thousands
    would (control variates; Glasserman, Monte Carlo Methods in Financial Engineering, 2003, 4.1). Looked at are the time of the widest
    band and the end, of nodes with 1.96 s above `NEGLIGIBLE_HALF_WIDTH`.
    """
    budget = setting.budget
    size = {n: 1.96 * np.sqrt(np.sum([*budget.parts(c).values(), np.zeros(len(c))], axis=0)[:-1]) for n, c in linear.columns.items()}
    size = {n: s for n, s in size.items() if s.max(initial=0.0) > NEGLIGIBLE_HALF_WIDTH}
    if not size:
        return Missed()
    if setting.switches:
        return Missed("temperatures switch parts of this run, and no straight line follows that", True)
    shape = budget.drawn(budget.numbers(0, 0, QUANTILE_DRAWS))
    half = budget.numbers(1, 0, PROBE_MEMBERS // 2)
    probe = budget.drawn(np.hstack([half, 1.0 - half]))
    drawn = _member_temperatures(setting, linear, probe, list(size))
    actual, many = drawn.kelvin, drawn.runs
    if many is not None and many.failed:
        return Missed("some members did not reach the end", True)
    worst = Missed()
    for n, wide in size.items():
        for k in dict.fromkeys((int(wide.argmax()), wide.size - 1)):
            if wide[k] > NEGLIGIBLE_HALF_WIDTH:
                column = linear.columns[n][k]
                straight = np.quantile(column @ shape, [0.025, 0.975])
                off = actual[n][k] - linear.run[n].kelvin[k] - column @ probe
                worst = max(worst, _missed_at(n, float(wide[k]), straight, column @ probe, off), key=lambda m: m.size)
    return worst


def _missed_at(node: str, wide: float, ends: Array, straight: Array, off: Array) -> Missed:
    """Return the largest miss of a node's 95 % band at one time, each as a share of its limit; an empty one where none is above zero.

    Shift of the middle |mean(off)| / wide of `MAX_MEAN_MISS`; change of the width by bends, and by laws of inputs that are not normal,
    (ends[1] - ends[0]) / (2 wide) - 1, of `MAX_WIDTH_MISS`.

    Parameters
    ----------
    node : str
    wide : float                Half-width by derivatives. [K]
    ends : array (2,)           2.5 and 97.5 % of the straight model. [K]
    straight : array (members,) Deviations of the straight model. [K]
    off : array (members,)      What the members differ from it by. [K]
    """
    centred = straight - straight.mean()
    slope = float(centred @ off / max(centred @ centred, 1e-30))
    bend = float(np.sqrt((1.0 + slope) ** 2 + np.var(off - slope * centred) * (1.96 / wide) ** 2)) - 1.0
    shape = 0.5 * float(ends[1] - ends[0]) / wide - 1.0
    head = "linear propagation of errors would"

    def width(miss: float) -> str:
        """Return in words by how much a band, so much wider than it should be by the straight model, would be too narrow or too wide."""
        size = f"{short(max(1.0 + miss, 1.0 / (1.0 + miss)), 3)} times too {'narrow' if miss > 0.0 else 'wide'}"
        return f"{head} make the band of '{node}' {size}"

    return max(
        Missed(
            f"{head} shift the middle of the band of '{node}' by {-off.mean():+.2g} K", True, abs(float(off.mean())) / wide / MAX_MEAN_MISS
        ),
        Missed(width(bend), True, abs(bend) / MAX_WIDTH_MISS),
        Missed(f"{width(shape)}, because errors of its inputs are not normal", False, abs(shape) / MAX_WIDTH_MISS),
        Missed(),
        key=lambda m: m.size,
    )


STORED_TURNING_POINTS = 3
"""How many of the highest and of the lowest turning points of every node are stored beside the times that are asked for."""
IN_TESTS = "residuals of tests"
"""Cause: what the model could not follow in the logs of a plan."""


@dataclass(frozen=True, eq=False)
class Foresight(Result):
    """What is expected of one run.

    Parameters
    ----------
    scenario : Scenario
    solution : Solution     The run with the best values.
    prediction : Prediction Expected temperatures with their errors and what these come from, at the same times.
    """

    scenario: Scenario
    solution: Solution
    prediction: Prediction

    @property
    def standing(self) -> Standing:
        """Of the values that it rests on."""
        return self.prediction.standing

    def _summary(self) -> str:
        """Return the first line of the prediction."""
        return self.prediction._summary()

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return those of the prediction."""
        return self.prediction._as_traces()

    def _as_rows(self) -> list[Row]:
        """Return those of the prediction."""
        return self.prediction._as_rows()

    def widen(self, sizes: Mapping[str, float], cause: str, words: str) -> Foresight:
        """Return what is expected with a further standard deviation for what the model could not follow.

        Nodes without a reading of their own get the root mean square of those that have one; boundaries get none. What is counted of this
        already, under another of the two causes, is not added up but the larger one taken.

        Parameters
        ----------
        sizes : dict        Node -> standard deviation; empty for none. [K]
        cause, words : str  What it is called, and what it stands for.
        """
        if not any(sizes.values()):
            return self
        other = float(np.sqrt(np.mean(np.square(list(sizes.values())))))
        boundaries = self.solution._run.network.boundaries
        bands = {
            path: _wider(b, 0.0 if path in boundaries else sizes.get(path, other) ** 2, cause) for path, b in self.prediction.bands.items()
        }
        wider_prediction = replace(self.prediction, bands=bands, causes={**self.prediction.causes, cause: words})
        return replace(self, prediction=wider_prediction)


def foresee(
    knowledge: Knowledge,
    scenario: Scenario,
    *,
    nodes: Sequence[str] = (),
    spread: Given | Sequence[Given] = (),
    times: Any = None,
    without: Sequence[str] = (),
    options: Options | None = None,
) -> Foresight:
    """Pretest prediction of a scenario: `predict`, and the run with the best values.

    Parameters
    ----------
    knowledge : Knowledge   The model and what is known of its values.
    scenario : Scenario     The test.
    nodes : sequence        Nodes to predict; all by default.
    spread : dict           What else is not known exactly, as in `predict`.
    times : array           Times to store; 301 by default. Those of the furthest turning points between them are added. [s]
    without : sequence      Sources that are not counted, as in `predict`.
    options : Options       The integrator's.
    """
    budget = budget_of(knowledge, scenario, spread, without=without)
    solution = simulate(budget.model, scenario, times=times, options=options)
    wanted = list(nodes) or list(solution.nodes)
    solution = solution.refined(wanted, STORED_TURNING_POINTS)
    return Foresight(scenario, solution, predicted(budget, wanted, times=solution.times, options=options))


def _wider(band: Band, variance: float, cause: str) -> Band:
    """Return a band whose variance of unexplained residuals is replaced by `variance` where that is larger. [K^2]"""
    before = band.parts.get(BandCause.UNEXPLAINED, np.zeros(band.times.size))
    if not variance > float(before.max()):
        return replace(band, parts={**band.parts, BandCause.UNEXPLAINED: before})
    members = band.members
    if members is not None:
        # what is added to each member: independent of all others, constant over the run
        more = np.sqrt(variance - before[:, None]) * np.random.default_rng(0).standard_normal(members.shape[1])
        members = members + more
    parts = {c: v for c, v in band.parts.items() if c != BandCause.UNEXPLAINED} | {cause: np.full(band.times.size, variance)}
    mixture = band.mixture
    return replace(
        band, parts=parts, members=members, mixture=mixture and replace(mixture, variances=mixture.variances + variance - before)
    )
