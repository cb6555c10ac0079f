"""`run_plan`: a plan worked through - every test predicted and held against limits, every log against its prediction - as one verdict."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from thermid.base.errors import CodedText, errors_at
from thermid.base.results import VERDICTS, Named, weigh
from thermid.base.units import HALF_WIDTH_95, counted
from thermid.campaign.stages import Limits, Margin, margins
from thermid.model.tree import Standing
from thermid.prediction.bands import IN_TESTS, SILENT, UNFITTED, Foresight, Knowledge, assumed_effects
from thermid.qualify._plan import LockStatus, Plan, load_plan, note_look
from thermid.qualify._trial import Trial, run_test


@dataclass(frozen=True)
class Assumption:
    """An assumed value of the deck, and how far its uncertainty moves a reference point.

    Parameters
    ----------
    path, text, basis : str     Its path; the value as written; what the deck says that it rests on.
    spread : float              Relative standard deviation: by its range, or a tenth. [-]
    effect : float              Change of the reference point by that standard deviation, all else fixed. [K]
    point, run : str            The reference point and the test.
    ranged : bool               Whether the deck gave the range.
    fitted_around : bool        Whether values of the same part were fitted with it; they then take up most of the change.
    """

    path: str
    text: str
    basis: str
    spread: float
    effect: float
    point: str
    run: str
    ranged: bool
    fitted_around: bool


@dataclass(frozen=True)
class SmallestMargin:
    """The smallest margin of a programme.

    Parameters
    ----------
    point, test : str   Reference point, and where.
    time : float        [s]
    left : float        What is left; negative beyond the limit. [K]
    counted : str       What was added up before, in words; empty for the bare distance of the prediction from its limit.
    """

    point: str
    test: str
    time: float
    left: float
    counted: str = ""

    def __str__(self) -> str:
        """Return it as words."""
        words = f"{self.left:.1f} K left" if self.left >= 0 else f"{-self.left:.1f} K {'short' if self.counted else 'beyond its limit'}"
        return f"{self.point} in {self.test} at {self.time / 3600:.2f} h, {words}{self.counted}"


@dataclass(frozen=True, eq=False)
class Qualification(Named[Trial]):
    """A plan with all its tests predicted and judged.

    Parameters
    ----------
    plan : Plan
    lock : LockStatus               Whether the plan is the one that was locked.
    trials : tuple of Trial         The tests, in the plan's order.
    margins : tuple of Margin       The tightest of every reference point on either side, over the service cases.
    assumptions : tuple             Assumed values, those that move a reference point most first.
    limits : tuple of Limits        Of the reference points.
    accepted : tuple of str         Stages that are accepted whatever their standing.
    cases : dict                    Test -> margin of every reference point on either side in it.
    """

    plan: Plan
    lock: LockStatus
    trials: tuple[Trial, ...]
    margins: tuple[Margin, ...]
    assumptions: tuple[Assumption, ...]
    limits: tuple[Limits, ...] = field(repr=False, default=())
    accepted: tuple[str, ...] = ()
    cases: Mapping[str, tuple[Margin, ...]] = field(repr=False, default_factory=dict)

    _refusal = "the plan has no test '{}'."

    def _entries(self) -> Mapping[str, Trial]:
        """Return test -> its trial."""
        return {t.test.name: t for t in self.trials}

    @property
    def service(self) -> tuple[Trial, ...]:
        """The tests that margins are taken over: those marked `service`, or all."""
        return tuple(service_tests(self.trials))

    @property
    def knowledge(self) -> Knowledge:
        """The model with what is known of its values."""
        return self.plan.knowledge

    @property
    def standing(self) -> Standing:
        """Standing of the values that every prediction rests on, with the accepted stages."""
        return self.knowledge.standing.accept(self.accepted)

    @property
    def passed(self) -> bool | None:
        """Whether no test or margin failed; None where none failed but something is open."""
        return weigh([*(t.passed for t in self.trials), *(m.passed for m in self.margins), *([None] if self.open else [])])

    @property
    def open(self) -> tuple[str, ...]:
        """Reasons why the verdict is not decided; empty where it is."""
        out = [f"{t.test.name}: {why}" for t in self.trials for why in t.open]
        out += [f"margin of {m.point}, {m.side}: {m.undecided}" for m in self.margins if m.undecided]
        if not self.margins:
            out.append("no margin could be computed: no reference point was in a state with limits")
        if any(t.correlation is not None for t in self.trials) and self.lock.state != "locked":
            out.append(str(self.lock))
        return tuple(out)

    @property
    def waived(self) -> tuple[str, ...]:
        """Names of the tests that were waived; their limits alone are judged."""
        return tuple(t.test.name for t in self.trials if t.test.state == "waived")

    @property
    def demonstration(self) -> str:
        """Why this does not qualify real hardware: assumed parameters, synthetic data; empty where neither is there."""
        parts = []
        if self.assumptions:
            parts.append(f"{len(self.assumptions)} assumed parameters")
        if self.knowledge.synthetic or any(t.synthetic for t in self.trials):
            parts.append("synthetic data")
        return f"demonstration: {', '.join(parts)}" if parts else ""

    @cached_property
    def worst(self) -> SmallestMargin | None:
        """The smallest of what is asked: of margins with all that they add up, and of the bare distances to limits; None without any."""
        return _smallest(self.trials, self.margins)

    def smallest(self, test: str) -> SmallestMargin | None:
        """Return the same of one test, with the margins of its own run; None without any limit in it."""
        return _smallest([self[test]], self.cases.get(test, ()))

    def to_dict(self) -> dict[str, Any]:
        """Return verdicts, limits, margins and assumptions as plain numbers, temperatures in Celsius where a key ends in ``_C``."""
        worst = self.worst
        return {
            "schema": 1,
            "status": "ok",
            "title": self.plan.title,
            "standing": self.standing.to_dict(),
            "passed": self.passed,
            "open": list(self.open),
            "waived": list(self.waived),
            "demonstration": self.demonstration,
            "remarks": list(self.knowledge.remarks),
            "plan": {"state": self.lock.state, "sha256": self.lock.sha256, "locked": self.lock.date, "changed": list(self.lock.changed)},
            "worst": None if worst is None else {"point": worst.point, "test": worst.test, "time_s": worst.time, "left_K": worst.left},
            "tests": [t.to_dict() for t in self.trials],
            "margins": [_margin_as_dict(m) for m in self.margins],
            "assumptions": [{"path": a.path, "effect_K": a.effect, "point": a.point, "test": a.run} for a in self.assumptions],
        }

    def _left_out(self) -> dict[str, str]:
        """Return what the uncertainty of margins does not include -> which margins, in words."""
        margins_by_cause: dict[str, list[str]] = {}
        for m in self.margins:
            for what in m.not_counted:
                margins_by_cause.setdefault(what, []).append(f"{m.point} ({m.side})")
        return {what: "any margin" if len(those) == len(self.margins) else ", ".join(those) for what, those in margins_by_cause.items()}

    def __str__(self) -> str:
        """The verdict, the tests, margins, open points and the first five assumptions, a line for each."""
        words = {True: "PASSED", False: "FAILED", None: "NOT DECIDED"}
        head = f"{self.plan.title}: {words[self.passed]}"
        head += f", {counted(len(self.waived), 'test')} waived: {', '.join(self.waived)}" if self.waived else ""
        lines = [head + (f"  ({self.demonstration})" if self.demonstration else ""), f"  {self.lock}"]
        lines += [f"  values: {remark}" for remark in self.knowledge.remarks]
        for t in self.trials:
            lines += [f"  {line}" for line in str(t).splitlines()]
        lines += [f"  smallest margin: {self.worst}"] if self.worst is not None else []
        lines += [f"  margin: {m}" for m in self.margins]
        lines += [f"  not included in {who}: {what}" for what, who in self._left_out().items()]
        lines += [f"  open: {o}" for o in self.open]
        lines += [f"  assumed: {a.path} = {a.text} changes {a.point} by {a.effect:.2g} K ({a.run})" for a in self.assumptions[:5]]
        return self.standing.over("\n".join(lines))

    def _summary(self) -> str:
        """Return the title and the verdict."""
        return f"{self.plan.title}: {VERDICTS[self.passed]}, {counted(len(self.trials), 'test')}"


def _smallest(trials: Sequence[Trial], margins: Sequence[Margin]) -> SmallestMargin | None:
    """Return the smallest of margins and of the bare distances to limits in some tests; None without a finite one."""
    every = [
        SmallestMargin(c.point, t.test.name, c.highest_time if c.limits[1] - c.highest <= c.lowest - c.limits[0] else c.lowest_time, c.room)
        for t in trials
        for c in t.checks
    ]
    for m in margins:
        words = f", {m.side}, with ± {m.printed:.1f} K of the model and {m.policy.acceptance.value + m.policy.qualification.value:g} K"
        every.append(SmallestMargin(m.point, m.run, m.time, m.margin, words))
    return min((x for x in every if np.isfinite(x.left)), key=lambda x: x.left, default=None)


def _margin_as_dict(m: Margin) -> dict[str, Any]:
    """Return a margin as a dictionary for JSON: temperatures [degC], margins and uncertainties [K], time [s], as keys say."""
    celsius = {"predicted_C": m.predicted - 273.15, "limit_C": m.limit - 273.15}
    sizes = {"uncertainty_K": m.uncertainty, "acceptance_K": m.policy.acceptance.value, "qualification_K": m.policy.qualification.value}
    fixed = {"fixed_K": m.fixed.value, "left_with_fixed_K": m.left_with_fixed}
    counted = {"counted": dict(m.shares), "not_counted": list(m.not_counted), "assumed_K": m.assumed}
    where = {"point": m.point, "side": m.side, "test": m.run, "time_s": m.time, "state": m.state}
    return where | celsius | sizes | {"margin_K": m.margin, "mark": m.mark, "passed": m.passed, "undecided": m.undecided} | fixed | counted


def run_plan(
    plan: Plan | str | os.PathLike[str],
    *,
    notice: Callable[[str], None] | None = None,
    accept: Sequence[str] = (),
) -> Qualification:
    """Return a plan with every test predicted, its limits and margins checked, and every log that has come back judged.

    Each log that is read is noted in the plan's lock file.

    Parameters
    ----------
    plan : Plan or path     The plan; `load_plan` takes a folder of logs outside the project.
    notice : callable       Called with the name of each test before it is run.
    accept : sequence       Stages that are accepted whatever their standing, which is reported all the same.

    Raises
    ------
    ThermidError   When the plan does not hold together, or a log does not fit its test.
    """
    loaded = plan if isinstance(plan, Plan) else load_plan(plan)
    trials = []
    for test in loaded.tests:
        if notice is not None:
            notice(test.name)
        with errors_at(f"{loaded.path.name}, test '{test.name}'", ", "):
            trial = run_test(loaded, test)
        if trial.log_sha256:
            other = note_look(loaded, test.name, trial.log_sha256)
            why = "see its deviations" if test.deviations else "state in its deviations what was changed, and why"
            remark = f"its log differs from the one that was first read, on {other}: {why}"
            trial = replace(trial, remarks=(*trial.remarks, remark)) if other else trial
        trials.append(trial)
    trials = _with_misfit_of_logs(trials)
    for k, t in enumerate(trials):
        same = [o.test.name for j, o in enumerate(trials) if j != k and t.log_sha256 and o.log_sha256 == t.log_sha256]
        if same:
            trials[k] = replace(
                t, not_shown=(*t.not_shown, CodedText(f"its log is identical to that of {', '.join(same)}", "verdict.log-of-another-test"))
            )
    effects_by_test = {
        t.test.name: assumption_effects(t.knowledge, t.test.name, t.foresight, {x.node: x.point for x in t.limits}) for t in trials
    }
    every = [a for several in effects_by_test.values() for a in several]
    cases = {t.test.name: _margins_of(loaded, t, every) for t in trials}
    margin = _tightest_margins(loaded, [cases[t.test.name] for t in service_tests(trials)])
    best: dict[str, Assumption] = {}  # every assumed value once, where it moves a reference point most
    for a in every:
        if a.path not in best or a.effect > best[a.path].effect:
            best[a.path] = a
    ordered = tuple(sorted(best.values(), key=lambda a: (a.fitted_around, -a.effect)))  # those that a fit was made around last
    return Qualification(loaded, loaded.lock_status(), tuple(trials), margin, ordered, loaded.limits, tuple(accept), cases)


def _with_misfit_of_logs(trials: Sequence[Trial]) -> list[Trial]:
    """Return the tests with their predictions widened by the misfit that the logs of the plan show.

    For each node it is the root mean square over its sensors of the residuals' root mean square. [K]
    """
    prefixes = [f"{t.knowledge.at}." if t.knowledge.at else "" for t in trials]
    squares: dict[str, list[float]] = {}
    for c, ahead in ((t.correlation, ahead) for t, ahead in zip(trials, prefixes, strict=True) if t.correlation is not None):
        for o in (o for o in c.overlays if o.sensor not in c.exclusions.reasons and o.node):
            squares.setdefault(o.node.removeprefix(ahead), []).append(float(np.mean(o.residuals**2)))
    sizes = {n: float(np.sqrt(np.mean(means))) for n, means in squares.items()}
    words = "root mean square difference between readings and model in this plan's tests, including the errors of the sensors"
    return [
        replace(t, after=t.foresight.widen({ahead + n: size for n, size in sizes.items()}, IN_TESTS, words))
        for t, ahead in zip(trials, prefixes, strict=True)
    ]


def service_tests(trials: Sequence[Trial]) -> list[Trial]:
    """Return the tests that margins are taken over: those marked `service`, or all where none is."""
    return [t for t in trials if t.test.service] or list(trials)


def _margins_of(plan: Plan, t: Trial, every: Sequence[Assumption]) -> tuple[Margin, ...]:
    """Return the margins of every reference point on either side in one test."""
    name, policy, find = t.test.name, plan.content.margins, t.knowledge.model.canonical
    spread = [f"scale.{find(n.removeprefix('scale.'))}" if n.startswith("scale.") else find(n) for n in t.test.spread]
    states = {name: t.test.state_without_loads}
    more = margins({name: t.expected}, t.limits, policy.policy, tested=policy.balance_tested, states=states)
    mark = "read" if t.course is None or t.course.profile.decides else "memory"
    moved = {x.point: assumed_half_width(every, x.point, t.test.name, spread) for x in t.limits}
    return tuple(replace(m, course_mark=mark, assumed=moved[m.point], not_counted=_not_counted(t, m, moved[m.point])) for m in more)


def _tightest_margins(plan: Plan, cases: Sequence[Sequence[Margin]]) -> tuple[Margin, ...]:
    """Return the smallest margin, assumed values counted, of every reference point on either side over the service cases."""
    out: list[Margin] = []
    for one in plan.limits:
        for side in ("cold", "hot"):
            candidates = [m for case in cases for m in case if (m.point, m.side) == (one.point, side)]
            out += sorted(candidates, key=lambda m: m.with_assumed)[:1]
    return tuple(out)


def _not_counted(t: Trial, m: Margin, moved: float) -> tuple[str, ...]:
    """Return in words what the uncertainty of a margin does not include; `moved` is the effect of assumed values [K]."""
    out = []
    if m.is_start_value and m.error <= 0:
        out.append("the temperature of the start, which is given, not predicted")
    shown = (UNFITTED, SILENT) if IN_TESTS in m.shares else ()
    # assumed values follow with what they do to this point in this run
    out += [x.what for x in t.expected.prediction.left_out if not x.listed and not np.isfinite(x.kelvin) and x.what not in shown]
    if moved >= 0.05:
        out.append(f"assumed values without a stated spread, up to {moved:.1f} K")
    return tuple(out)


def assumption_effects(knowledge: Knowledge, name: str, run: Foresight, nodes: Mapping[str, str]) -> list[Assumption]:
    """Return the effect of every assumed value on every reference point in one run.

    It is the largest over time of |dT/dp| s, with the sensitivity dT/dp of the run and the standard deviation s of the value. [K] Where
    temperatures switch the run, it is the change of the highest or lowest temperature by s. Values with a stated range, which the bands
    include already, are left out.

    Parameters
    ----------
    knowledge : Knowledge   The model.
    name : str              Name of the run.
    run : Foresight         Its prediction.
    nodes : dict            Node -> name of its reference point.
    """
    model = knowledge.model
    ahead = f"{knowledge.at}." if knowledge.at else ""
    fitted = {ahead + p for v in knowledge.values for p in (*v, *(q for w in v.values() for q in w.also))}
    table = model.parameter_table()
    times = run.solution.times[:: max(1, run.solution.times.size // 60)]
    out = []
    for one, spread, effects in assumed_effects(model, run.scenario, fitted, [*nodes], times):
        path, parameter = one.path, table[one.path].parameter
        key, around = path.removeprefix(ahead), bool(fitted) and path.startswith(ahead)
        for node, point in nodes.items():
            out.append(Assumption(key, parameter.text, parameter.basis, spread, effects[node], point, name, one.ranged, around))
    return out


def assumed_half_width(effects_: Sequence[Assumption], point: str, run: str, stated: Sequence[str]) -> float:
    """Return the 95 % half-width at a point of assumed values: 1.96 times the root of the sum of their squared effects. [K]

    Values that a fit was made around, and those that the test spreads, do not count.

    Parameters
    ----------
    effects_ : sequence Of `assumption_effects`.
    point, run : str    Reference point and run.
    stated : sequence   Names that are spread in that run, as in the model; ``scale.LOAD`` stands for the load's power.
    """
    names = {*stated, *(f"{n.removeprefix('scale.')}.power" for n in stated if n.startswith("scale."))}
    sizes = [a.effect for a in effects_ if (a.point, a.run) == (point, run) and not a.fitted_around and a.path not in names]
    return HALF_WIDTH_95 * float(np.sqrt(np.sum(np.square(sizes))))
