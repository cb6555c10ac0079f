"""From a predicted temperature to a limit: model uncertainty, acceptance and qualification margin in one table, beside a fixed margin.

The power margin of controlled heaters too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np

from thermid.base.errors import NameNotFoundError, ScenarioError, look_up, refuse_unknown
from thermid.base.expression import amount
from thermid.base.linear_algebra import HALF_WIDTH_95
from thermid.base.results import Result
from thermid.base.sourced import MARKS, Figure, weakest
from thermid.base.units import ICE_POINT
from thermid.campaign._judge.limits import STATES, Limits, times_in_state
from thermid.model.tree import UNJUDGED, Standing
from thermid.prediction.bands import Foresight

SMC = "SMC-S-016"
COLDER = ((-70, 11), (-87, 10), (-105, 9), (-123, 8), (-141, 7), (-159, 6), (-177, 5), (-195, 4), (-213, 3), (-232, 2))
"""Lowest temperature [degC] down to which a flat margin [K] holds: SMC-S-016, Table 4.4-2."""


HEATER = Figure(0.25, "read", f"{SMC}, 4.4.2.2")


@dataclass(frozen=True)
class Policy:
    """What is added to a predicted temperature.

    Parameters
    ----------
    name : str
    acceptance, qualification : Figure      Margins beyond predicted and uncertainty. [K]
    level : float                           Probability that the model's uncertainty stands for, both sides. [-]
    heater : Figure                         Power margin of an actively controlled heater. [-]
    """

    name: str
    acceptance: Figure
    qualification: Figure
    level: float = 0.95
    heater: Figure = HEATER


POLICIES = {
    p.name: p
    for p in (
        Policy(SMC, Figure(0.0, "read", f"{SMC}, 6.3.8.3"), Figure(10.0, "read", f"{SMC}, 6.3.8.3: qualification 10 C beyond acceptance")),
        Policy(
            f"{SMC}, protoqualification",
            Figure(0.0, "read", f"{SMC}, 6.3.8.3"),
            Figure(5.0, "read", f"{SMC}, 6.3.8.3: protoqualification 5 C"),
        ),
        Policy("ECSS", Figure(5.0, "memory", "ECSS-E-ST-31C"), Figure(5.0, "memory", "ECSS-E-ST-31C")),
    )
}
"""Named rules; a project may give its own."""


def fixed_margin(kelvin: float, tested: bool) -> Figure:
    """Return the fixed thermal uncertainty margin of passive hardware. [K]

    SMC-S-016, 4.4.2.1 and Table 4.4-2: 11 C where a balance test correlated the model, 17 C where none did; less for colder hardware.

    >>> fixed_margin(300.0, True).value, fixed_margin(300.0, False).value, fixed_margin(153.0, True).value
    (11.0, 17.0, 8.0)
    """
    if not tested:
        return Figure(17.0, "read", f"{SMC}, 4.4.2.1")
    celsius = kelvin - ICE_POINT
    kelvins = next((m for low, m in COLDER if celsius >= low), 1)
    return Figure(float(kelvins), "read", f"{SMC}, 4.4.2.1, Table 4.4-2")


@dataclass(frozen=True)
class Margin(Result):
    """One reference point on one side: the run and instant that come nearest to its limit, and what is added up there.

    Parameters
    ----------
    point, side, state, run : str   Side is 'hot' or 'cold'.
    time : float                [s]
    predicted : float           [K]
    error : float               Standard error of the prediction. [K]
    shares : dict               Cause -> share of the variance. [-]
    limit : float               [K]
    limit_mark : str            Mark of the limit.
    policy : Policy
    tested : bool               Whether a balance test correlated the model.
    course_mark : str           Mark of the course: 'memory' where the run goes by numbers that nobody has checked.
    assumed : float             What assumed values that no spread names may move it by, 95 %; in no sum. [K]
    not_counted : tuple of str  What the uncertainty does not hold, in words.
    standing : Standing         Of the values that the prediction rests on.
    """

    point: str
    side: str
    state: str
    run: str
    time: float
    predicted: float
    error: float
    shares: Mapping[str, float]
    limit: float
    limit_mark: str
    policy: Policy
    tested: bool
    course_mark: str = "read"
    assumed: float = 0.0
    not_counted: tuple[str, ...] = field(default=())
    standing: Standing = UNJUDGED

    @property
    def sign(self) -> float:
        """One on the hot side, minus one on the cold side."""
        return 1.0 if self.side == "hot" else -1.0

    @property
    def uncertainty(self) -> float:
        """Half the interval of the prediction at the policy's level. [K]"""
        return NormalDist().inv_cdf(0.5 + 0.5 * self.policy.level) * self.error

    @property
    def printed(self) -> float:
        """The uncertainty as it is printed, to a tenth: what is left between the printed temperature and the printed margin. [K]

        Each rounded by itself, the terms of the sum would miss it by up to two tenths.
        """
        room = self.sign * (self.limit - ICE_POINT - round(self.predicted - ICE_POINT, 1))
        return abs(round(room - self.policy.acceptance.value - self.policy.qualification.value - round(self.margin, 1), 1))

    @property
    def margin(self) -> float:
        """What is left to the limit once uncertainty, acceptance and qualification margin are added. [K]"""
        return self.room - self.uncertainty - self.policy.acceptance.value - self.policy.qualification.value

    @property
    def room(self) -> float:
        """Distance from the predicted temperature to the limit, without uncertainty and margins. [K]"""
        return self.sign * (self.limit - self.predicted)

    @property
    def fixed(self) -> Figure:
        """The fixed margin of the standard in place of the model's uncertainty. [K]"""
        return fixed_margin(self.predicted, self.tested)

    @property
    def left_with_fixed(self) -> float:
        """What is left to the limit with the fixed margin in place of the uncertainty. [K]"""
        return self.room - self.fixed.value - self.policy.acceptance.value - self.policy.qualification.value

    @property
    def exceedance(self) -> float:
        """Probability that the limit itself is passed at that instant, errors being normal. [-]"""
        if self.error <= 0:
            return float(self.room < 0)
        return NormalDist().cdf(-self.room / self.error)

    @property
    def mark(self) -> str:
        """The least sure of the marks that the margin rests on."""
        return weakest((self.limit_mark, self.policy.acceptance.mark, self.policy.qualification.mark, self.course_mark))

    @property
    def with_assumed(self) -> float:
        """Margin left once assumed values that no spread names are counted too. [K]"""
        return self.margin + self.uncertainty - float(np.hypot(self.uncertainty, self.assumed))

    @property
    def undecided(self) -> str:
        """Why it is not decided; empty where it is."""
        if self.mark == "memory":
            return "a number quoted from memory"
        if self.margin < 0:
            return ""
        if self.error <= 0 and not self.is_start_value:
            return "the model's error is not known. Fit the model, or state a spread"
        if self.with_assumed < 0:
            return f"assumed values alone may change it by {self.assumed:.1f} K. Measure them, or state their spread"
        return ""

    @property
    def is_start_value(self) -> bool:
        """Whether the temperature is the given one of a start, which the model says nothing about."""
        return self.time <= 0.0

    @property
    def passed(self) -> bool | None:
        """Whether anything is left; None where that is not decided, see `undecided`."""
        return None if self.undecided else self.margin >= 0

    def __str__(self) -> str:
        """Return the sum as a line."""
        p = self.policy
        mark = weakest((p.acceptance.mark, p.qualification.mark))
        source = "" if mark == "read" else f", {MARKS[mark]}"
        word = f"not decided: {self.undecided}" if self.undecided else "met" if self.passed else "NOT met"
        return (
            f"{self.point}, {self.side} ({self.run}, {self.time / 3600:.2f} h, {self.state}): {self.predicted - ICE_POINT:.1f} degC, "
            f"uncertainty {self.printed:.1f} + acceptance {p.acceptance.value:g} + qualification {p.qualification.value:g} "
            f"({p.name}{source}), limit {self.limit - ICE_POINT:.1f} degC: "
            f"{self.margin:+.1f} K, {word}; with the fixed {self.fixed.value:g} K of {SMC} instead of the uncertainty: "
            f"{self.left_with_fixed:+.1f} K"
        )


def margins(
    runs: Mapping[str, Foresight],
    limits: Sequence[Limits],
    policy: Policy | str = SMC,
    *,
    tested: bool = False,
    states: Mapping[str, str] | None = None,
) -> tuple[Margin, ...]:
    """Return the margin of every reference point on both sides, each at the run, state and instant that come nearest to a limit.

    Parameters
    ----------
    runs : dict             Name -> what is expected of it.
    limits : sequence       Of the reference points.
    policy : Policy, str    What is added up, or the name of one of `POLICIES`.
    tested : bool           Whether a balance test correlated the model: 11 K against 17 K of fixed margin.
    states : dict           Run -> its state, for points whose limits name no loads; operating by default.

    Raises
    ------
    NameNotFoundError   When there is no such policy.
    ScenarioError       Without a run.
    """
    policy = _policy(policy)
    refuse_unknown(filter(None, (states or {}).values()), STATES, "margins", "no state '{}'; there are {known}.", ScenarioError)
    if not runs:
        raise ScenarioError("margins need at least one run.", "margins", code="value.outside-range")
    out = []
    for one in limits:
        for k, side in enumerate(("cold", "hot")):
            candidates = [
                m
                for name, run in runs.items()
                for m in _tightest_instants(name, run, one, k, side, policy, tested, (states or {}).get(name, ""))
            ]
            if candidates:
                out.append(min(candidates, key=lambda m: m.margin))
    return tuple(out)


def _policy(policy: Policy | str) -> Policy:
    """Return a policy, or that of a name.

    Raises
    ------
    NameNotFoundError   When there is none.
    """
    if isinstance(policy, Policy):
        return policy
    return look_up(policy, POLICIES, f"unknown margin policy '{{}}'. Use one of {'; '.join(POLICIES)}.", "margins")


def _tightest_instants(name: str, run: Foresight, one: Limits, k: int, side: str, policy: Policy, tested: bool, state: str) -> list[Margin]:
    """Return, of each state that a point has limits for, the margin at the instant nearest to its limit in one run.

    `k` is 0 for the lower and 1 for the upper limit; nearest counts the 95 % half-width of the prediction. `name` is the run's.
    """
    band = run.prediction[one.node]
    error, sign = band.half_width / NormalDist().inv_cdf(0.975), 1.0 if k else -1.0
    out = []
    for state_name in ("operating", "non-operating", "start-up"):
        ends, inside = one.ends(state_name), times_in_state(run.solution, one, state_name, state or "operating")
        if ends is None or not np.isfinite(ends[k]) or not inside.any():
            continue
        towards = np.where(inside, sign * band.kelvin + HALF_WIDTH_95 * error, -np.inf)
        index = int(towards.argmax())
        shares = {c: float(v[index] / error[index] ** 2) if error[index] > 0 else 0.0 for c, v in band.parts.items()}
        expected, size = float(band.kelvin[index]), float(error[index])
        if band.switches:
            expected, end = band.extreme(sign, during=inside)
            size = sign * (end - expected) / HALF_WIDTH_95
        figures = (float(band.times[index]), expected, size)
        out.append(Margin(one.point, side, state_name, name, *figures, shares, ends[k], one.mark, policy, tested, standing=run.standing))
    return out


@dataclass(frozen=True)
class HeaterDuty:
    """How busy a controlled heater is, and whether its power margin is left.

    Parameters
    ----------
    load, run : str
    duty : float        Mean power over full power in the window. [-]
    full : float        Full power. [W]
    window : (begin, end)   [s]
    rule : Figure       The power margin. [-]
    """

    load: str
    run: str
    duty: float
    full: float
    window: tuple[float, float]
    rule: Figure

    @property
    def max_duty(self) -> float:
        """The largest duty that leaves the margin: 80 % for a margin of 25 %. [-]"""
        return 1.0 / (1.0 + self.rule.value)

    @property
    def margin(self) -> float:
        """Power at full duty over the power needed, less one. [-]"""
        return np.inf if self.duty <= 0 else 1.0 / self.duty - 1.0

    @property
    def passed(self) -> bool | None:
        """Whether the margin is left; None where the rule is from memory."""
        return self.duty <= self.max_duty + 1e-12 if self.rule.decides else None


def heater_duty(
    run: Foresight, load: str, full: float, *, window: tuple[float, float] | None = None, name: str = "", policy: Policy | str = SMC
) -> HeaterDuty:
    """Return the duty of a heater: its mean power over its full power, at the lowest bus voltage of the coldest case.

    Parameters
    ----------
    run : Foresight     The coldest run.
    load : str          The heater.
    full : float        Its power when it is on, at that voltage. [W]
    window : (begin, end)   Over which it is averaged, several of its cycles; the second half of the run by default. [s]
    name : str          Of the run.
    policy : Policy, str    Holds the power margin.

    Raises
    ------
    NameNotFoundError   When there is no such load.
    ScenarioError       When the full power is not above zero, or the window lies outside the run.
    """
    rule = _policy(policy).heater
    powers, times = run.solution.load_powers, run.solution.times
    refuse_unknown([load], powers, run.solution.title, "no load '{}'.", NameNotFoundError)
    if full <= 0:
        raise ScenarioError(f"the full power of heater '{load}' must be above zero.", run.solution.title, code="value.outside-range")
    begin, end = (0.5 * float(times[-1]), float(times[-1])) if window is None else (amount(t, "s", f"window of '{load}'") for t in window)
    inside = (times >= begin) & (times <= end)
    if np.count_nonzero(inside) < 2:
        raise ScenarioError(
            f"the window of heater '{load}', {begin:g} s to {end:g} s, holds fewer than two stored times.",
            run.solution.title,
            code="record.too-short",
        )
    watts = np.broadcast_to(powers[load], times.shape)[inside]
    mean = float(np.trapezoid(watts, times[inside]) / (times[inside][-1] - times[inside][0]))
    return HeaterDuty(load, name or run.scenario.title, mean / full, full, (begin, end), rule)
