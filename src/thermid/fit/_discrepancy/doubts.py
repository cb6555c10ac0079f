"""What a structure may lack, counted in the errors of values: powers that settle or grow with temperature, laws of surfaces.

In: a `Calibration` whose residuals refute its structure, or one of a structure that a search proposed. Out: the same with errors that
hold what these would have moved each value by, and the words of what was counted.

Each effect is a heat that follows from the run at the end of the fit, of a size that nobody knows: normal about nothing, as wide as
hardware allows. The sizes are unknowns beside those of the fit, in one step of generalised least squares from its end (`weighed`). So an
effect that the readings rule out costs nothing, one that they ask for moves the values, and one that they cannot tell from a value opens
its interval: what averaging over the structures gives, without a fit of each of them (Hoeting and others, Statistical Science 14 (1999)
382; Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425). A value stays where its fit found it. Its error is the root of the sum of
variance and square of the move.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.linear_algebra import Array, symmetric_inverse
from thermid.fit._calibration import FIRST, Calibration
from thermid.fit._discrepancy.discrepancy import FREE_AIR, FlowHistory, conditions_of, growth
from thermid.fit._problem.experiment import Experiment
from thermid.fit._problem.residuals import Influence, Problem, Unknown
from thermid.fit._uncertainty.noise import Binned, binned, evidence, weighed
from thermid.measure.amounts import short
from thermid.model.elements import CARRIED_BY
from thermid.model.identity import identity_of
from thermid.model.laws import TableSignal
from thermid.model.parameters import Standing
from thermid.model.tree import FlatConductor, FlatLoad
from thermid.simulation.runs import Solution, simulate

SURE = 3.0
"""Square of a move in its standard deviations, from which the readings ask for it. [-]"""
GROWTH = 0.004
"""Standard deviation of the growth of a power with temperature, as a share per kelvin: that of copper. [1/K]"""
SETTLING = 0.05
"""Standard deviation of what a power has more or less when it comes on, as a share of its step. [-]"""
SETTLING_PACES = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Time constants of a power that settles, in lengths of the record, each as likely. [-]"""
EXPONENT, RADIATIVE = 0.15, 0.3
"""Standard deviations of what the exponent of a coefficient with the difference of temperature, and its radiative share, may be off:
halves of what is possible, 0 to 1/3 and nothing to all. [-]"""
FARTHEST = 0.25
"""Move of the logarithm of a value beyond which a wider interval does not do: the structure is then not adequate. [-]"""
LARGE = 10.0
"""Factor on a value from which a move along one straight step is no size any more. [-]"""
INSTANTS = 601
"""Instants of a run, beside those of its readings, at which heats are taken."""
STRONG = 3.0
"""Logarithm of the Bayes factor from which residuals ask for what a structure may lack, and not for noise that wanders (20 to 1: Kass and
Raftery, J. Am. Stat. Assoc. 90 (1995) 773)."""
MANY = 6
"""Loads or surfaces beyond which they share one size for each effect."""
ALIKE_KINDS = ("convection", "effective")


@dataclass(frozen=True)
class DoubtedHeat:
    """Heat that a structure may lack, for a size of one.

    Parameters
    ----------
    name : str          What it is, and of what.
    sd : float          Standard deviation of its size about nothing. [-], or [1/K] of a growth
    watts : dict        Node -> heat into it (times,). [W]
    """

    name: str
    sd: float
    watts: Mapping[str, Array]


def with_doubts(fit: Calibration) -> Calibration:
    """Return a fit whose errors count what its structure may lack, where its request asks for that or the residuals refute it.

    Where that cannot be counted, the errors stay as they are and a warning says why.
    """
    asked = fit.request is not None and fit.request.doubts
    problem = fit.problem
    if problem is None or fit.stopped or not problem.unknowns:
        return fit
    why = _obstacle(fit, problem)
    if not why:
        try:
            found = _widened_by(fit, asked)
        except ThermidError as error:
            why = error.message
        except np.linalg.LinAlgError:
            why = "the readings and the bounds together leave the sizes of the missing heats open"
        else:
            return _taken(fit, *found, asked) if found is not None else fit
    words = f"the errors do not count what the structure may lack ({why.rstrip('.')}). Look for it with `thermid criticise`."
    return replace(fit, warnings=(*fit.warnings, words))


def _obstacle(fit: Calibration, problem: Problem) -> str:
    """Return why no heat can be laid beside the model of a fit; empty where one can."""
    if fit.model.runner is not None:
        return "the equations of the FMU are not known"
    if problem.clocked:
        return "a clock is fitted with it"
    same = all(identity_of(e.model) == identity_of(fit.model) for e in problem.experiments)
    return "" if same else "its records have different models"


def _widened_by(fit: Calibration, asked: bool) -> tuple[Array, Array] | None:
    """Return what doubts move the unknowns of a fit by (unknowns,), and their variances with them; None where there is nothing to doubt.

    What wanders may be noise. Unless the doubts are asked for, they count where the readings are likelier with them.
    """
    problem, size = fit.problem, len(fit.fitted)
    assert problem is not None
    at = np.array(list(fit.fitted.values()))
    wide, sds = _beside(problem, [_heats(fit, i) for i in range(len(problem.experiments))])
    if not sds:
        return None
    pieces = binned(wide, np.concatenate([at, np.zeros(len(sds))]), fit.loss, fit.request.loss_scale if fit.request is not None else 1.0)
    count = size + len(sds)
    priors, pulls = np.zeros((count, count)), np.zeros(count)
    priors[range(size, count), range(size, count)] = np.array(list(sds.values())) ** -2.0
    own, slopes = problem.prior_rows(at)
    priors[:size, :size] += slopes.T @ slopes
    pulls[:size] -= slopes.T @ own
    for k, u in enumerate(problem.unknowns):
        low, high = u.fitted_bounds()
        if u.kind == "parameter" and np.isfinite(high - low):  # evenly between its bounds
            priors[k, k] += 12.0 / (high - low) ** 2
            pulls[k] += 12.0 / (high - low) ** 2 * (0.5 * (low + high) - at[k])
    if not asked and _gain(list(pieces.values()), priors, size) < STRONG:
        return None
    data = weighed(list(pieces.values()), priors, pulls, max(1.0, fit.reduced_chi_square))
    moves, spreads = [], []
    for information, scores in zip(data.information, data.scores, strict=True):
        covariance = symmetric_inverse(information + priors)
        moves.append((covariance @ (scores + pulls))[:size])
        spreads.append(np.diag(covariance)[:size])
    mean = data.weights @ np.array(moves)
    apart = data.weights @ (np.array(moves) - mean) ** 2
    return mean, data.weights @ np.array(spreads) + apart


def _gain(pieces: Sequence[Binned], priors: Array, size: int) -> float:
    """Return by how much the log-likelihood of the readings grows with what stands behind the first unknowns."""
    alone = [replace(b, slopes=b.slopes[:, :size]) for b in pieces]
    return evidence(pieces, priors) - evidence(alone, priors[:size, :size])


def _taken(fit: Calibration, moved: Array, variances: Array, asked: bool) -> Calibration:
    """Return a fit with the errors that its doubts give; none becomes smaller."""
    place = {name: k for k, name in enumerate(fit.fitted)}
    errors = np.sqrt(np.maximum(variances, 0.0) + moved**2)
    unknowns = fit.problem.unknowns if fit.problem is not None else ()
    items = dict(fit.values.items())
    for path, v in items.items():
        k = place[path]
        wider = float(errors[k] * unknowns[k].slope(fit.fitted[path]))
        items[path] = replace(v, error=max(v.error, wider))
    local = tuple(replace(i, error=max(i.error, float(errors[place[f"{i.record}: {i.name}"]]))) for i in fit.local)
    moves = {p: (float(moved[place[p]]), float(variances[place[p]])) for p in fit.values.parameters if unknowns[place[p]].log}
    far = {p: move for p, (move, variance) in moves.items() if abs(move) > FARTHEST and move**2 > SURE * max(variance, 0.0)}
    stated = fit.request is not None and fit.request.adequate > 0.0  # what residuals may be is then the user's to say
    if far and not (asked or stated) and fit.own.fair:
        fit = _inadequate(fit, max(far, key=lambda p: abs(far[p])), far)
        items = {p: replace(v, standing=fit.values[p].standing) for p, v in items.items()}
    grown = {p: v.error / fit.values[p].error for p, v in items.items() if v.kind == "parameter" and fit.values[p].error > 0.0}
    return replace(fit, values=replace(fit.values, items_=items), local=local, doubted=True, warnings=(*fit.warnings, _words(grown, asked)))


def _inadequate(fit: Calibration, worst: str, far: Mapping[str, float]) -> Calibration:
    """Return a fit whose values the readings ask to move so far that one step does not tell where to."""
    size = far[worst]
    by = f"{short(100.0 * math.expm1(size), 2)} %" if abs(size) < math.log(LARGE) else f"more than a factor of {LARGE:g}"
    because = f"what the structure may lack would move '{worst}' by {by}, and the residuals ask for it"
    accepted = fit.request is not None and fit.request.accepted
    return replace(fit, own=Standing("not adequate", because, fit.stage, accepted)).judged(fit.rests, fit.verdict)


def _words(grown: Mapping[str, float], asked: bool) -> str:
    """Return what a reader must know; `grown` is by what factor the error of each value grew."""
    most = max(grown, key=grown.__getitem__, default="")
    times = f", most of '{most}': {short(grown[most], 2)} times the error of the fit itself" if most else ""
    why = "the structure is a proposal" if asked else "the residuals refute the structure"
    return (
        f"{FIRST}{why}, so the errors of the values count what it may lack: powers that settle or grow with temperature, and other laws "
        f"of surfaces{times}."
    )


# ---- heats


def _heats(fit: Calibration, i: int) -> list[DoubtedHeat]:
    """Return the heats that a record's run may lack, with what many parts share as one."""
    assert fit.problem is not None
    e = fit.problem.experiments[i]
    unknowns = zip(fit.problem.unknowns, fit.fitted.values(), strict=True)
    found = {t.name: u.to_value(x) for u, x in unknowns for t in u.targets if t.experiment == i}
    model, scenario = e.as_fitted(fit.fitted_model, found, sensors=False)
    times = _instants(e)
    run = simulate(model, scenario, times=times)
    out = []
    for effects in ([*_of_loads(e, run)], [*_of_surfaces(e, run)]):
        places = dict.fromkeys(h.name.split(" of ", 1)[1] for h in effects)
        out += effects if len(places) <= MANY else _shared(effects)
    return out


def _instants(e: Experiment) -> Array:
    return np.unique(np.concatenate([np.linspace(0.0, e.scenario.seconds, INSTANTS), e.times]))


def _of_loads(e: Experiment, run: Solution) -> Iterator[DoubtedHeat]:
    """Yield what each power may do: grow with the temperature of its node, from what it has at the start, and settle after its steps."""
    times, powers = run.times, run.load_powers
    for row in e.network.flat.loads:
        watts = np.broadcast_to(np.asarray(powers.get(row.path, 0.0), dtype=float), times.shape)
        if not np.abs(watts).max() > 0.0:
            continue
        kelvin = run[row.node].kelvin
        yield DoubtedHeat(f"growth of {row.path}", GROWTH, {row.node: watts * (kelvin - kelvin[0])})
        for pace in SETTLING_PACES:
            course = settling(times, watts, pace * float(times[-1]))
            yield DoubtedHeat(f"settling over {pace:g} of {row.path}", SETTLING / len(SETTLING_PACES) ** 0.5, {row.node: course})


def settling(times: Array, watts: Array, pace: float) -> Array:
    """Return what a power (times,) [W] has yet to settle after its steps, with a time constant [s]: the power less its lag from rest."""
    late = np.zeros(times.size)
    for k, held in enumerate(np.exp(-np.diff(times) / pace)):
        late[k + 1] = watts[k] + (late[k] - watts[k]) * held
    return np.asarray(watts - late)


def _of_surfaces(e: Experiment, run: Solution) -> Iterator[DoubtedHeat]:
    """Yield what each coefficient may do: grow with the difference of temperature, and with its level as radiation does."""
    for c in e.network.flat.conductors:
        if c.kind in ALIKE_KINDS and c.path in run.heat_flows and c.words.get(CARRIED_BY, FREE_AIR) == FREE_AIR:
            yield from _of_surface(c, run)


def _of_surface(c: FlatConductor, run: Solution) -> Iterator[DoubtedHeat]:
    a, b = (run[n].kelvin for n in c.ends[:2])
    course = FlowHistory(a, b, np.asarray(run.heat_flows[c.path], dtype=float))
    found = conditions_of([{c.path: course}])
    if not found:
        return
    ratio, warmer = growth(course, found[c.path])
    ways = (("exponent", EXPONENT, course.heat * np.log(ratio)), ("radiative share", RADIATIVE, course.heat * warmer))
    for name, sd, more in ways:
        yield DoubtedHeat(f"{name} of {c.path}", sd, {c.ends[0]: -more, c.ends[1]: more})


def _shared(heats: Sequence[DoubtedHeat]) -> list[DoubtedHeat]:
    """Return heats of one effect as one heat, of one size at all places."""
    out: dict[str, DoubtedHeat] = {}
    for h in heats:
        name = h.name.split(" of ", 1)[0] + " of all"
        before = out[name].watts if name in out else {}
        out[name] = DoubtedHeat(name, h.sd, {**before, **{n: before.get(n, 0.0) + w for n, w in h.watts.items()}})
    return list(out.values())


def _beside(problem: Problem, heats: Sequence[Sequence[DoubtedHeat]]) -> tuple[Problem, dict[str, float]]:
    """Return a problem with the size of every heat as a further unknown, and the standard deviation of each."""
    targets: dict[str, list[Influence]] = {}
    sds: dict[str, float] = {}
    experiments = []
    for i, (e, several) in enumerate(zip(problem.experiments, heats, strict=True)):
        loads: list[FlatLoad] = []
        powers: dict[str, Any] = {}
        for h in several:
            for node, watts in h.watts.items():
                if node not in e.network.boundaries:
                    name = f"doubted {h.name} at {node}"
                    loads.append(FlatLoad(name, node, node, {}))
                    powers[name] = TableSignal(_instants(e), watts, False)
                    targets.setdefault(h.name, []).append(Influence(i, f"scale.{name}"))
                    sds[h.name] = h.sd
        flat = replace(e.network.flat, loads=(*e.network.flat.loads, *loads))
        experiments.append(replace(e, network=replace(e.network, flat=flat), scenario=e.scenario.with_(loads=powers)))
    more = tuple(Unknown(n, "pattern", tuple(t), 0.0) for n, t in targets.items())
    return replace(problem, experiments=tuple(experiments), unknowns=(*problem.unknowns, *more), coupled=()), sds
