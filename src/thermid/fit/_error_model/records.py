"""A logged run as a fit of other runs predicts it: a straight line in everything unknown, and what its own fitted values follow of that."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.linear_algebra import quadratic_forms, symmetric_inverse
from thermid.base.units import Array, Indices, value_of
from thermid.fit._calibration import Calibration
from thermid.fit._error_model.elements import DepartureHeat, with_laws
from thermid.fit._error_model.gaussian import Wander
from thermid.fit._error_model.kept import KeptWay, deviations_of_run
from thermid.fit._error_model.model import course_in_fit, noise_of, prior_mean, reach, traces_of
from thermid.fit._error_model.runs import SensorRows, UnknownColumn
from thermid.fit._problem.experiment import SCALE, Experiment
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.fit._problem.residuals import Influence, Prior, Problem, Unknown
from thermid.model.tree import Constant
from thermid.values.store import Store


class BandCause:
    """What of a run by itself a band comes from, beside its elements."""

    VALUES, START, INSTRUMENT, ROOM = "values", "start of the run", "instrument", "room"
    STRUCTURE, RUN, UNEXPLAINED = "extrapolation", "differences between tests", "what no element explains"


@dataclass(frozen=True, eq=False)
class BesideRow:
    """How a name that may change in a run follows sources that a fit does not know.

    Parameters
    ----------
    gain : array (sources,)     What it differs by for a unit of each. [SI], or [-]
    relative : bool             Whether that is in parts of its value.
    """

    gain: Array
    relative: bool


def problem_of_record(
    fit: Calibration, request: Request, own_laws: Mapping[str, tuple[float, float]], beside: Mapping[str, BesideRow]
) -> Problem:
    """Return a record with everything that is not known of its run as unknowns.

    Parameters
    ----------
    fit : Calibration
    request : Request   That runs the record at the values of the fit.
    own_laws : dict     Boundary or ``initial.<node>`` -> mean and standard deviation of what it is off by. [K]
    beside : dict       Value -> how it follows sources of unit variance that the fit does not know.
    """
    assert fit.problem is not None
    named = tuple(u.name for u in fit.problem.unknowns if u.kind == "parameter")
    untie = fit.request.untie if fit.request is not None else False
    (record,) = request.records  # a sensor of no stated accuracy is off by what the fit says of it
    held = {s: x for s, x in request.held_bias.items() if s not in record.channels or record.channels[s].accuracy is None}
    bare = replace(request, free=named, priors={}, prior=(), store=Store(), held_bias=held, held_errors=None, untie=untie)
    bare_problem = build_problem(bare)
    fitted = {u.name: u for u in fit.problem.unknowns}
    named_now = ((u, fitted.get(u.name, u)) for u in bare_problem.unknowns)  # numbers of the fit stay in the form that it gave them
    bare_problem = replace(bare_problem, unknowns=tuple(replace(u, log=f.log, low=f.low, high=f.high) for u, f in named_now))
    e = bare_problem.experiments[0]
    starts: dict[str, list[str]] = {}
    shares: dict[str, float] = {}  # of the mean of several sensors
    for node, begun in [*((n, (s,)) for n, s in e.readings.items()), *e.loose.items()]:
        for sensor in begun:
            starts.setdefault(sensor, []).append(f"initial.{node}")
            shares[sensor] = 1.0 / len(begun)
    sensors = {o.sensor: o for o in e.observations}
    taken = {*own_laws, *(f"{t.name}" for u in bare_problem.unknowns if u.kind == "local" for t in u.targets)}
    more = [_shifted(bare_problem, name, [name], *law) for name, law in own_laws.items()]
    for sensor, names in starts.items():
        unset_starts = [n for n in names if n.startswith("initial.") and n not in taken]
        if unset_starts and sensor in sensors:
            more.append(
                _shifted(bare_problem, f"first reading of {sensor}", unset_starts, 0.0, shares[sensor] * noise_of(e, sensors[sensor]))
            )
    return replace(bare_problem, unknowns=(*bare_problem.unknowns, *more, *_beside(bare_problem, beside)))


def _beside(problem: Problem, beside: Mapping[str, BesideRow]) -> list[Unknown]:
    """Return one unknown for each source that the fit does not know, acting on every value that follows it."""
    acting = {t.name for u in problem.unknowns for t in u.targets}
    numbers = problem.experiments[0].network.numbers().values
    out: list[Unknown] = []
    for k in range(max((row.gain.size for row in beside.values()), default=0)):
        targets = []
        for name, row in beside.items():
            if row.gain[k] and name in numbers:
                value = float(value_of(numbers[name]))
                factor = float(row.gain[k]) * (value if row.relative else 1.0)
                targets.append(Influence(0, name, 0.0 if name in acting else value, factor))
                acting.add(name)
        out.append(Unknown(f"{BandCause.VALUES} {k}", "beside", tuple(targets), 0.0, prior=Prior(0.0, 1.0)))
    return out


def shared_with(fit: Calibration, problem: Problem) -> set[str]:
    """Return the unknowns of a record that a fit knows: values, and instruments of the same accuracy; that of a power is relative."""
    assert fit.problem is not None
    fitted_unknowns = {u.name: u for u in fit.problem.unknowns if u.kind != "local"}

    def alike(u: Unknown, of: Unknown) -> bool:
        """Whether two unknowns may share one size: priors of one width, or no constant error of an instrument."""
        if u.prior is None or of.prior is None or u.kind == "parameter" or any(t.name.startswith(SCALE) for t in u.targets):
            return True
        return math.isclose(u.prior.sd, of.prior.sd)

    return {u.name for u in problem.unknowns if u.name in fitted_unknowns and alike(u, fitted_unknowns[u.name])}


def _shifted(problem: Problem, name: str, names: Sequence[str], mean: float, sd: float) -> Unknown:
    """Return what is added to a boundary, or to starts, beside what else acts on them. [K]"""
    e = problem.experiments[0]
    acting = {t.name for u in problem.unknowns for t in u.targets}
    several = [n for n in names for n in (n, *(f"initial.{tip}" for tip, seat in e.tips.items() if n == f"initial.{seat}"))]
    # the temperature in the scenario; nothing of a boundary that changes with time
    nominal = {f"initial.{n}": float(start) for n, start in e.scenario.initial.items() if isinstance(start, float)}
    nominal |= {n: b.value if isinstance(b, Constant) else 0.0 for n, b in e.scenario.boundaries.items()}
    targets = tuple(Influence(0, n, 0.0 if n in acting else nominal[n], 1.0) for n in dict.fromkeys(several))
    return Unknown(f"{name} in this run", "local", targets, 0.0, prior=Prior(mean, sd), unit="K")


@dataclass(frozen=True, eq=False)
class RecordRun:
    """A logged run at the values of a fit, as a straight line in everything unknown; its own fitted values have answered.

    Parameters
    ----------
    traces : tuple of SensorRows    Every reading; unknowns are those of the way, those of the run, and what was fitted to it.
    means : tuple of SensorRows     The same in at most some hundred stretches.
    columns : tuple                 Those of the run.
    far : array (unknowns,)         Mean of each prior less the point where the derivatives were taken.
    known : array (fitted, fitted)  Information of the priors of what was fitted to it.
    shared : int                    How many unknowns are those of the way.
    beyond : dict                   Conductor -> its class, and what of its variance lies further off than its features reach. [-]
    span : float                    Duration. [s]
    """

    traces: tuple[SensorRows, ...]
    means: tuple[SensorRows, ...]
    columns: tuple[UnknownColumn, ...]
    far: Array
    known: Array
    shared: int
    beyond: Mapping[str, tuple[str, float]]
    span: float

    @classmethod
    def of_record(cls, way: KeptWay, problem: Problem, shared_names: Collection[str], local: Mapping[str, float]) -> RecordRun:
        """Return the run of a record, linear about the values of a fit, where the heat is carried in one way.

        Its unknowns in this order: values of the way, its columns, the run's own values, its own departures, what was fitted to it.

        Parameters
        ----------
        problem : Problem   As `problem_of_record` returns it.
        shared_names : collection  Those of its unknowns that the fit knows, see `shared_with`.
        local : dict        What was fitted to the record -> its value.
        """
        size = len(way.places)
        start = {
            u.name: way.values[u.name] if u.name in shared_names else local.get(u.name, u.to_fitted(u.start)) for u in problem.unknowns
        }
        fitted = np.array(list(start.values()))
        plain = problem.experiments[0].network
        laws = way.laws_in(plain)
        network = with_laws(plain, laws)
        course = course_in_fit(problem, 0, network, fitted) if any(way.sizes.values()) else None
        shared = way.departures.shared(network, course, way.way, laws) if course is not None else []
        alone = way.departures.of_run(network, course) if course is not None else []
        heat_of_column = {c.name: h for c, h in shared}
        heats = [*(heat_of_column.get(c.name, DepartureHeat(c.name, ())) for c in way.columns), *(h for _, h in alone)]
        rows = traces_of(problem, 0, network, heats, fitted)
        count = len(problem.unknowns)
        place = {u.name: k for k, u in enumerate(problem.unknowns)}
        answers = [place[n] for n in local]
        mine = [k for n, k in place.items() if n not in shared_names and n not in local]
        zero = count + len(heats)  # a value of the fit that does not act in this run
        order = [*(place[n] if n in shared_names else zero for n in way.values), *range(count, count + len(way.columns)), *mine]
        order += [*range(count + len(way.columns), zero), *answers]
        wide = [replace(t, rows=np.column_stack([t.rows, np.zeros(t.times.size)])).taken(order) for t in rows]
        columns_of_values = tuple(_column(problem.experiments[0], problem.unknowns[k]) for k in mine)
        ends = np.array([prior_mean(problem.unknowns[k], fitted[k]) - fitted[k] for k in [*mine, *answers]])
        far = np.zeros(len(order))
        far[[*range(size, size + len(mine)), *range(len(order) - len(answers), len(order))]] = ends
        sizes = [u.prior.sd if u.prior is not None else np.inf for u in (problem.unknowns[k] for k in answers)]
        inverse = np.diag([1.0 / sd**2 for sd in sizes]).reshape(len(sizes), len(sizes))
        means = tuple(t.averaged() for t in wide)
        return cls(
            tuple(wide),
            means,
            (*columns_of_values, *(c for c, _ in alone)),
            far,
            inverse,
            size,
            way.departures.beyond(network, course) if course is not None else {},
            problem.experiments[0].scenario.seconds,
        )

    @property
    def _gain(self) -> Array:
        """Gain G (fitted, rows) of the run's fitted values to its residuals [K]: (J'WJ + known)^-1 J'W, W = 1 / noise^2."""
        first = self.shared + len(self.columns)
        slopes = np.concatenate([t.rows[:, first:] for t in self.means])
        weighed = slopes.T / np.concatenate([t.noise for t in self.means]) ** 2
        return np.asarray(symmetric_inverse(weighed @ slopes + self.known) @ weighed) if slopes.shape[1] else weighed

    def after_own_fit(self, moved: Array) -> Array:
        """Return what is left of changes (rows, columns) of the readings once the run's fitted values have answered. [K]"""
        first = self.shared + len(self.columns)
        return np.asarray(moved - np.concatenate([t.rows[:, first:] for t in self.means]) @ (self._gain @ moved))

    def _at(self, mean: Array) -> Array:
        """Return where every unknown stands (unknowns,), fitted form, with those of the way at `mean`.

        Those of the run stand at the means of their priors; what was fitted to it stands where least squares with these put it: G (r - R
        x), with the residuals r, rows R and gain G of the run's means.
        """
        at = self.far + np.concatenate([mean, np.zeros(self.far.size - mean.size)])
        off = np.concatenate([t.residuals - t.rows @ at for t in self.means])
        at[self.shared + len(self.columns) :] += self._gain @ off
        return np.asarray(at)

    def centres(self, mean: Array, traces: Sequence[SensorRows]) -> list[Array]:
        """Return what is expected of the readings of each trace less what they are (readings,), at means of the way's unknowns. [K]"""
        at = self._at(mean)
        return [t.rows @ at - t.residuals for t in traces]

    def responses(self) -> tuple[Array, Array]:
        """Return what is left of units of the way's unknowns (rows, unknowns) and of the run's (rows, columns). [K]"""
        first = self.shared + len(self.columns)
        answered = self.after_own_fit(np.concatenate([t.rows[:, :first] for t in self.means]))
        return answered[:, : self.shared], answered[:, self.shared :]

    def parts(self, way: KeptWay) -> tuple[Array, dict[str, Array]]:
        """Return the centre (rows,) of what is expected less what is read [K], and source -> variance (rows,). [K^2]"""
        rows, own_responses = self.responses()
        size = len(way.values)
        parts = {
            BandCause.VALUES: np.sum((rows @ way.root[:, :size]) ** 2, axis=1),
            BandCause.STRUCTURE: np.sum((rows @ way.root[:, size:]) ** 2, axis=1),
        }
        for c, column in zip(self.columns, own_responses.T, strict=True):
            source = {"run": BandCause.RUN, "room": BandCause.ROOM, "unlogged": BandCause.ROOM}.get(c.group, c.source)
            run_part, far_part = deviations_of_run(c, way.sizes, self.beyond)
            parts[source] = parts.get(source, 0.0) + (run_part * column) ** 2
            parts[BandCause.STRUCTURE] += (far_part * column) ** 2
        parts[BandCause.UNEXPLAINED] = sum((share * self.wandering(size, part) for share, size, part in way.left), np.zeros(rows.shape[0]))
        return np.concatenate(self.centres(way.mean, self.means)), parts

    def wandering(self, size: float, part: float) -> Array:
        """Return the variance (rows,) of what no element explains, and the run's fitted values do not follow. [K^2]

        The diagonal of M W M', W the covariance of a departure of standard deviation `size` [K] that is lost over `part` of the run, and M
        what the run's own fit leaves of it.
        """
        rows = sum(t.times.size for t in self.means)
        if size == 0.0:
            return np.zeros(rows)
        if not self.known.size:
            return np.full(rows, size**2)
        whole, begin = np.zeros((rows, rows)), 0
        for t in self.means:
            block = slice(begin, begin + t.times.size)
            whole[block, block] = Wander(size, part * self.span).covariance(t.times)
            begin += t.times.size
        return np.asarray(quadratic_forms(self.after_own_fit(np.eye(rows)), whole))


def _column(e: Experiment, u: Unknown) -> UnknownColumn:
    """Return an unknown of a run as a column about the mean of its prior."""
    boundaries = {*e.scenario.boundaries}
    at = {t.name for t in u.targets}
    source = (
        BandCause.VALUES
        if u.kind == "beside"
        else BandCause.INSTRUMENT
        if u.kind != "local"
        else BandCause.ROOM
        if at & boundaries
        else BandCause.START
    )
    return UnknownColumn(u.name, "", u.prior.sd if u.prior is not None else reach(u), source)


def split(several: Array, traces: Sequence[SensorRows]) -> list[Array]:
    """Return the rows of every sensor, the last axis being rows."""
    ends: Indices = np.cumsum([t.times.size for t in traces])[:-1]
    return np.split(several, ends, axis=-1)
