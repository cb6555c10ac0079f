"""`run_plan`: a plan worked through - every test predicted and held against limits, every log against its prediction - as one verdict."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from thermid.base.arguments import takes_objects
from thermid.base.dual import value_of
from thermid.base.errors import errors_at, look_up
from thermid.base.linear_algebra import HALF_WIDTH_95
from thermid.base.results import Result
from thermid.base.sourced import VERDICTS, weigh
from thermid.base.units import counted
from thermid.campaign.verdicts import Limits, Margin, margins
from thermid.model.elements import Standing
from thermid.model.tree import parameter_table
from thermid.prediction.bands import IN_TESTS, SILENT, UNFITTED, Foresight, Knowledge, assumed_values, open_ranges, widened
from thermid.qualify._plan import LockStatus, Plan, load_plan, lock_status, note_look
from thermid.qualify._trial import Trial, run_test
from thermid.simulation.runs import prepare


@dataclass(frozen=True)
class Assumption:
    """An assumed value and what it does.

    Parameters
    ----------
    path, text, basis : str     In the model; as written; what the deck says that it rests on.
    spread : float              Standard deviation over the value, by its range or a tenth. [-]
    effect : float              What that does to the point that it moves most, everything else held. [K]
    point, run : str            Where and in which run.
    ranged : bool               Whether the deck gave the range.
    fitted_around : bool        Whether values of the same part were fitted with it; then they take up most of a change.
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


@dataclass(frozen=True, eq=False)
class Qualification(Result):
    """A plan worked through.

    Parameters
    ----------
    plan : Plan
    lock : LockStatus               How the plan stands to its lock.
    trials : tuple of Trial         The tests, in the plan's order.
    margins : tuple of Margin       Of every reference point on both sides, over the service cases.
    assumptions : tuple             Assumed values, those that move a reference point most first.
    accepted : tuple of str         Stages that are accepted as they are, whatever their standing.
    cases : dict                    Test -> margin of every reference point on both sides in it, of which `margins` are the tightest.
    """

    plan: Plan
    lock: LockStatus
    trials: tuple[Trial, ...]
    margins: tuple[Margin, ...]
    assumptions: tuple[Assumption, ...]
    limits: tuple[Limits, ...] = field(repr=False, default=())
    accepted: tuple[str, ...] = ()
    cases: Mapping[str, tuple[Margin, ...]] = field(repr=False, default_factory=dict)

    def __getitem__(self, name: str) -> Trial:
        """Return a test by its name."""
        trials = {t.test.name: t for t in self.trials}
        return look_up(name, trials, "the plan has no test '{}'.", self.plan.title)

    @property
    def service(self) -> tuple[Trial, ...]:
        """The tests that margins are taken over."""
        return tuple(service_of(self.trials))

    @property
    def knowledge(self) -> Knowledge:
        """The model with what is known of its values."""
        return self.plan.knowledge

    @property
    def standing(self) -> Standing:
        """Of the values that every prediction rests on."""
        return self.knowledge.standing.accept(self.accepted)

    @property
    def passed(self) -> bool | None:
        """Whether nothing failed; None where nothing failed but something is not decided, see `open`."""
        return weigh([*(t.passed for t in self.trials), *(m.passed for m in self.margins), *([None] if self.open else [])])

    @property
    def open(self) -> tuple[str, ...]:
        """Why the whole is not decided, as far as it is not; empty where nothing is open."""
        out = [f"{t.test.name}: {why}" for t in self.trials for why in t.open]
        out += [f"margin of {m.point}, {m.side}: {m.undecided}" for m in self.margins if m.undecided]
        if not self.margins:
            out.append("no margin could be computed: no reference point was in a state with limits")
        if any(t.correlation is not None for t in self.trials) and not self.lock.sound:
            out.append(str(self.lock))
        return tuple(out)

    @property
    def waived(self) -> tuple[str, ...]:
        """Tests that were waived: held against their limits alone."""
        return tuple(t.test.name for t in self.trials if t.test.state == "waived")

    @property
    def demonstration(self) -> str:
        """Why this is no qualification of real hardware; empty where nothing speaks against it."""
        parts = []
        if self.assumptions:
            parts.append(f"{len(self.assumptions)} assumed parameters")
        if self.knowledge.synthetic or any(t.synthetic for t in self.trials):
            parts.append("synthetic data")
        return f"demonstration: {', '.join(parts)}" if parts else ""

    @cached_property
    def worst(self) -> tuple[str, str, float, float] | None:
        """Reference point, test, time [s] and room [K] that come nearest to a limit or pass it furthest."""
        rooms = [
            (c.point, t.test.name, c.highest_time if c.limits[1] - c.highest <= c.lowest - c.limits[0] else c.lowest_time, c.room)
            for t in self.trials
            for c in t.checks
            if np.isfinite(c.room)
        ]
        return min(rooms, key=lambda f: f[3], default=None)

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
            "worst": None if worst is None else {"point": worst[0], "test": worst[1], "time_s": worst[2], "room_K": worst[3]},
            "tests": [t.to_dict() for t in self.trials],
            "margins": [_margin(m) for m in self.margins],
            "assumptions": [{"path": a.path, "effect_K": a.effect, "point": a.point, "test": a.run} for a in self.assumptions],
        }

    def _left_out(self) -> dict[str, str]:
        """Return what the uncertainty of margins does not hold -> which margins."""
        margins_by_cause: dict[str, list[str]] = {}
        for m in self.margins:
            for what in m.not_counted:
                margins_by_cause.setdefault(what, []).append(f"{m.point} ({m.side})")
        return {what: "any margin" if len(those) == len(self.margins) else ", ".join(those) for what, those in margins_by_cause.items()}

    def __str__(self) -> str:
        """Return the verdicts as text."""
        words = {True: "PASSED", False: "FAILED", None: "NOT DECIDED"}
        head = f"{self.plan.title}: {words[self.passed]}"
        head += f", {counted(len(self.waived), 'test')} waived: {', '.join(self.waived)}" if self.waived else ""
        lines = [head + (f"  ({self.demonstration})" if self.demonstration else ""), f"  {self.lock}"]
        lines += [f"  values: {remark}" for remark in self.knowledge.remarks]
        for t in self.trials:
            lines += [f"  {line}" for line in str(t).splitlines()]
        if self.worst is not None:
            point, test, time, room = self.worst
            margin = f"{room:.1f} K left" if room >= 0 else f"{-room:.1f} K beyond its limit"
            lines.append(f"  worst: {point} in {test} at {time / 3600:.2f} h, {margin}")
        lines += [f"  margin: {m}" for m in self.margins]
        lines += [f"  not included in {who}: {what}" for what, who in self._left_out().items()]
        lines += [f"  open: {o}" for o in self.open]
        lines += [f"  assumed: {a.path} = {a.text} changes {a.point} by {a.effect:.2g} K ({a.run})" for a in self.assumptions[:5]]
        return self.standing.over("\n".join(lines))

    def _summary(self) -> str:
        """Return the title and the verdict."""
        return f"{self.plan.title}: {VERDICTS[self.passed]}, {counted(len(self.trials), 'test')}"

    def _ipython_key_completions_(self) -> list[str]:
        """Return the tests."""
        return [t.test.name for t in self.trials]


def _margin(m: Margin) -> dict[str, Any]:
    celsius = {"predicted_C": m.predicted - 273.15, "limit_C": m.limit - 273.15}
    sizes = {"uncertainty_K": m.uncertainty, "acceptance_K": m.policy.acceptance.value, "qualification_K": m.policy.qualification.value}
    flat = {"flat_K": m.flat.value, "flat_left_K": m.flat_left, "bought_K": m.bought}
    counted = {"counted": dict(m.shares), "not_counted": list(m.not_counted), "assumed_K": m.assumed}
    where = {"point": m.point, "side": m.side, "test": m.run, "time_s": m.time, "state": m.state}
    return where | celsius | sizes | {"margin_K": m.margin, "mark": m.mark, "passed": m.passed, "undecided": m.undecided} | flat | counted


@takes_objects
def run_plan(
    plan: Plan | str | os.PathLike[str],
    *,
    notice: Callable[[str], None] | None = None,
    accept: Sequence[str] = (),
) -> Qualification:
    """Return a plan worked through: predictions, limits, margins, and the verdict on every log that has come back.

    Parameters
    ----------
    plan : Plan or path     The plan; `load_plan` takes a folder of logs outside the project.
    notice : callable       Called with the name of each test before it is run.
    accept : sequence       Stages that are accepted as they are: their standing stays and is told.

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
    trials = _alike(_informed(trials))
    effects_by_test = {t.test.name: effects(t.known, t.test.name, t.foresight, {x.node: x.point for x in t.limits}) for t in trials}
    every = [a for several in effects_by_test.values() for a in several]
    cases = {t.test.name: _margins_of(loaded, t, every) for t in trials}
    margin = _tightest(loaded, [cases[t.test.name] for t in service_of(trials)])
    return Qualification(loaded, lock_status(loaded), tuple(trials), margin, ranked(every), loaded.limits, tuple(accept), cases)


def _informed(trials: Sequence[Trial]) -> list[Trial]:
    """Return the tests with what the model could not follow in the logs that have come back added to what is expected of all."""
    squares: dict[str, list[float]] = {}
    for t in (t for t in trials if t.correlation is not None):
        assert t.correlation is not None
        ahead = f"{t.known.at}." if t.known.at else ""
        counted = [o for o in t.correlation.overlays if o.sensor not in t.correlation.exclusions.reasons and o.node]
        for o in counted:
            squares.setdefault(o.node.removeprefix(ahead), []).append(float(np.mean(o.residuals**2)))
    sizes = {n: float(np.sqrt(np.mean(means))) for n, means in squares.items()}

    def under(t: Trial) -> dict[str, float]:
        ahead = f"{t.known.at}." if t.known.at else ""
        return {ahead + n: size for n, size in sizes.items()}

    words = "root mean square difference between readings and model in this plan's tests, including the errors of the sensors"
    return [replace(t, after=widened(t.foresight, under(t), IN_TESTS, words)) for t in trials]


def _alike(trials: Sequence[Trial]) -> list[Trial]:
    """Return the tests, with a doubt where two of them came back with the same log."""
    out = []
    for t in trials:
        same = [o.test.name for o in trials if o is not t and t.log_sha256 and o.log_sha256 == t.log_sha256]
        doubt = f"its log is identical to that of {', '.join(same)}"
        out.append(replace(t, not_shown=(*t.not_shown, doubt)) if same else t)
    return out


def service_of(trials: Sequence[Trial]) -> list[Trial]:
    """Return the tests that margins are taken over: those that are marked, or all."""
    return [t for t in trials if t.test.service] or list(trials)


def _margins_of(plan: Plan, t: Trial, every: Sequence[Assumption]) -> tuple[Margin, ...]:
    """Return the margin of every reference point on each side in one test."""
    state = {t.test.name: "operating" if t.test.operating else "non-operating"}
    policy = plan.content.margins
    more = margins({t.test.name: t.expected}, t.limits, policy.policy, tested=policy.balance_tested, states=state)
    mark = "read" if t.course is None or t.course.decides else "memory"
    moved = {x.point: uncounted(every, x.point, t.test.name, _stated(t)) for x in t.limits}
    return tuple(replace(m, course_mark=mark, assumed=moved[m.point], not_counted=_not_counted(t, m, moved[m.point])) for m in more)


def _tightest(plan: Plan, cases: Sequence[Sequence[Margin]]) -> tuple[Margin, ...]:
    """Return the tightest margin of every reference point on each side over the service cases."""
    out: list[Margin] = []
    for one in plan.limits:
        for side in ("cold", "hot"):
            candidates = [m for case in cases for m in case if (m.point, m.side) == (one.point, side)]
            out += sorted(candidates, key=lambda m: m.with_assumed)[:1]
    return tuple(out)


def _stated(t: Trial) -> list[str]:
    """Return the names that a test spreads, as they are in the model."""
    find = t.known.model.canonical
    return [f"scale.{find(n.removeprefix('scale.'))}" if n.startswith("scale.") else find(n) for n in t.test.spread]


def _not_counted(t: Trial, m: Margin, moved: float) -> tuple[str, ...]:
    """Return in words what the uncertainty of a margin does not hold."""
    out = []
    if m.is_start_value and m.error <= 0:
        out.append("the temperature of the start, which is given, not predicted")
    shown = (UNFITTED, SILENT) if IN_TESTS in m.shares else ()
    # assumed values follow with what they do to this point in this run
    out += [x.what for x in t.expected.prediction.left_out if not x.listed and not np.isfinite(x.kelvin) and x.what not in shown]
    if moved >= 0.05:
        out.append(f"assumed values without a stated spread, up to {moved:.1f} K")
    return tuple(out)


def ranked(effects_: Sequence[Assumption]) -> tuple[Assumption, ...]:
    """Return every assumed value once, where it moves a reference point most, the largest effect first."""
    best: dict[str, Assumption] = {}
    for a in effects_:
        if a.path not in best or a.effect > best[a.path].effect:
            best[a.path] = a
    return tuple(sorted(best.values(), key=lambda a: (a.fitted_around, -a.effect)))


def effects(knowledge: Knowledge, name: str, run: Foresight, nodes: Mapping[str, str]) -> list[Assumption]:
    """Every assumed value at every reference point in one run; a value that a fit was made around moves less, for the fitted take up most.

    Emissivities that a finish tells are in the bands themselves.

    Parameters
    ----------
    knowledge : Known   The model.
    name : str          Of the run.
    run : Foresight     What is expected of it.
    nodes : dict        Node -> name of its reference point.
    """
    model = knowledge.model
    ahead = f"{knowledge.at}." if knowledge.at else ""
    fitted = {ahead + p for v in knowledge.values for p in (*v, *(q for w in v.values() for q in w.also))}
    table = parameter_table(model)
    ranged = {p for r in open_ranges(model, run.scenario, fitted) for p in (r.path, *r.also)}
    loose = assumed_values(model, run.scenario, {*fitted, *ranged})
    if not loose:
        return []
    times = run.solution.times[:: max(1, run.solution.times.size // 60)]
    ready = prepare(model, run.scenario, [a.path for a in loose], times=times)
    solution = ready.run(sensitivities=True)
    slopes = {n: np.abs(solution.slopes(n)).max(axis=0) for n in nodes}
    out = []
    numbers = ready.wiring.network.numbers().values
    for k, one in enumerate(loose):
        path, parameter, value = one.path, table[one.path].parameter, abs(float(value_of(numbers[one.path])))
        key, around = path.removeprefix(ahead), bool(fitted) and path.startswith(ahead)
        for node, point in nodes.items():
            effect = float(slopes[node][k]) * one.size
            out.append(Assumption(key, parameter.text, parameter.basis, one.size / value, effect, point, name, one.ranged, around))
    return out


def uncounted(effects_: Sequence[Assumption], point: str, run: str, stated: Sequence[str]) -> float:
    """Return what assumed values that no fit was made around, and that no spread names, may move a point by: 95 %, together. [K]

    Parameters
    ----------
    effects_ : sequence Of `effects`.
    point, run : str    Reference point and run.
    stated : sequence   Names that are spread in that run, as in the model; ``scale.<load>`` stands for the load's power.
    """
    names = {*stated, *(f"{n.removeprefix('scale.')}.power" for n in stated if n.startswith("scale."))}
    sizes = [a.effect for a in effects_ if (a.point, a.run) == (point, run) and not a.fitted_around and a.path not in names]
    return HALF_WIDTH_95 * float(np.sqrt(np.sum(np.square(sizes))))
