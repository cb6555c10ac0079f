"""`Estimation`: values with process noise beside those of output error, which of them foresees better, and what a reader must know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, look_up, refuse_unknown
from thermid.base.linear_algebra import symmetric_inverse
from thermid.base.results import Result
from thermid.base.units import HALF_WIDTH_95, Array, duration_text, from_si, seconds, short
from thermid.fit._estimation.filtering import Belief, Whiteness, smoothed, whiteness
from thermid.fit._estimation.likelihood import Likelihood, Maximum
from thermid.fit._estimation.outlook import OpenLoopScore, course, members_about, unread
from thermid.fit._problem.request import Request
from thermid.model.tree import Model
from thermid.simulation.runs import Scenario
from thermid.values.store import FittedValues

PROCESS, OUTPUT = "process noise", "output error"


@dataclass(frozen=True)
class EstimatedNumber:
    """One number that was looked for, and its standard error.

    Parameters
    ----------
    name : str
    value, error : float    [SI]
    unit : str              For people.
    """

    name: str
    value: float
    error: float
    unit: str

    def __str__(self) -> str:
        """In its unit."""
        scale = from_si(1.0, self.unit) - from_si(0.0, self.unit)
        return f"{self.name} {from_si(self.value, self.unit):.5g} +- {abs(self.error * scale):.2g} {self.unit}".rstrip()


@dataclass(frozen=True, eq=False)
class Estimator:
    """What one way to look at the logs says.

    Parameters
    ----------
    name : str                  ``process noise`` or ``output error`` (no noise but that of readings).
    likelihood : Likelihood     Logs, model and noise.
    maximum : Maximum           Where its search ended.
    values : FittedValues       Parameters and constant errors, with their covariance.
    found : dict                Every unknown -> `EstimatedNumber`: sizes of noises, noise of readings and values of single records too.
    left_out : OpenLoopScore        How it foresaw readings that were not fitted, over the horizon.
    whole : float               RMSE of a run from the start of every record, without its later readings; in the fit's own logs. [K]
    white : tuple               Of each sensor of each record.
    widened : float             How much wider than the likelihood's the errors are, because innovations are not white or larger than the
                                stated noise. [-]
    """

    name: str
    likelihood: Likelihood = field(repr=False)
    maximum: Maximum = field(repr=False)
    values: FittedValues
    found: Mapping[str, EstimatedNumber]
    left_out: OpenLoopScore | None
    whole: float
    white: tuple[Whiteness, ...]
    widened: float = 1.0

    @property
    def log_likelihood(self) -> float:
        """Of all readings, one step ahead. [-]"""
        return self.maximum.log_likelihood

    def lines(self) -> list[str]:
        """Return how well it foresees, the numbers that it found, and whether the innovations of each sensor are white, in words."""
        ahead = (
            ""
            if self.left_out is None
            else f"{short(self.left_out.rmse)} K ({100 * self.left_out.inside:.0f} % in the 95 % bands) left out; "
        )
        out = [f"{self.name}: open loop {ahead}{short(self.whole)} K from the start; one-step log-likelihood {self.log_likelihood:.2f}"]
        if self.widened > 1.0:
            out.append(f"  errors {short(self.widened)} times as wide as the likelihood's, by the size and correlation of the innovations")
        out += [f"  {one}" for one in self.found.values()]
        return out + [f"  {w}" for w in self.white]


@dataclass(frozen=True, eq=False)
class States:
    """States of a record by all of its readings, or by those up to each moment.

    Parameters
    ----------
    names : tuple of str            Nodes with heat capacity, and what noises add.
    times : array (times,)          [s]
    mean, sd : array (times, states)    [K; W of what is added to a load]
    units : tuple of str            For people.
    """

    names: tuple[str, ...]
    times: Array
    mean: Array
    sd: Array
    units: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> tuple[Array, Array]:
        """Return mean and standard deviation (times,) of one."""
        k = look_up(name, {n: k for k, n in enumerate(self.names)}, "no state '{}'.")
        return self.mean[:, k], self.sd[:, k]

    def __str__(self) -> str:
        """A line each: where it is the highest, and where it ends, with the 95 % bands."""
        lines = []
        for k, name in enumerate(self.names):
            high = int(self.mean[:, k].argmax())
            peak, end = (f"{self._at(i, k)} after {duration_text(float(self.times[i]))}" for i in (high, -1))
            lines.append(f"  {name}: highest {peak}, at the end {end}")
        return "\n".join(lines)

    def _at(self, i: int, k: int) -> str:
        """Return a state at a time with its 95 % band, in its unit."""
        return f"{from_si(self.mean[i, k], self.units[k]):.2f} +- {short(HALF_WIDTH_95 * self.sd[i, k])} {self.units[k]}"

    def as_object(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {
            "names": list(self.names),
            "units": [u.replace("degC", "K") for u in self.units],
            "times_s": self.times.tolist(),
            "mean": self.mean.tolist(),
            "sd": self.sd.tolist(),
        }


@dataclass(frozen=True, eq=False)
class Estimation(Result):
    """Values by maximum likelihood with process noise, beside output error.

    Parameters
    ----------
    title : str
    given_model : Model         As it was given; `model` has the values of the estimator that was chosen.
    process, output : Estimator With process noise, and without.
    horizon : float             Over which predictions were compared. [s]
    ratio, p_value : float      Likelihood ratio, twice the difference of the logarithms, and the probability of as much were there no
                                process noise. [-]
    moved : tuple of str        Values that move by more than two of their errors as the noise goes to zero.
    warnings : tuple of str     What a reader must know.
    assumed : tuple of str      What nobody stated and was taken.
    request : Request           What was fitted.
    starts : dict               Node, or boundary with a random walk -> standard deviation of its start, where stated. [K]
    """

    title: str
    given_model: Model
    process: Estimator
    output: Estimator
    horizon: float
    ratio: float
    p_value: float
    moved: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    request: Request | None = field(default=None, repr=False)
    starts: Mapping[str, float] = field(default_factory=dict, repr=False)

    @property
    def chosen(self) -> Estimator:
        """The one that foresaw left-out readings better over the horizon, without readings in between."""
        a, b = self.process.left_out, self.output.left_out
        if a is None or b is None:
            return self.process
        return self.process if a.rmse <= b.rmse else self.output

    @property
    def values(self) -> FittedValues:
        """Of the estimator that was chosen."""
        return self.chosen.values

    @property
    def model(self) -> Model:
        """The model with the values of the estimator that was chosen."""
        return self.given_model.with_values(self.values.assignments, f"{self.chosen.name} of '{self.title}'")

    def states(self, record: int = 0, *, smooth: bool = True) -> States:
        """Return the states of a record, by all readings or by those up to each moment, at the values of process noise. [K]

        Their variance is that of the filter, or smoother, plus |D R|^2 of the values: derivatives D of the state by central differences, R
        R' their covariance.

        Raises
        ------
        IdentificationError   When there is no such record.
        """
        count = len(self.process.likelihood.dynamics)
        if not 0 <= record < count:
            raise IdentificationError(f"no record {record}: there are {count}, from 0 on.", self.title, code="name.unknown")
        likelihood, maximum = self.process.likelihood, self.process.maximum
        members, root = members_about(likelihood, maximum.fitted, symmetric_inverse(maximum.information))
        filtered = likelihood.passing(record, members).run(keep=True)
        beliefs: list[Belief] = list(filtered.beliefs)
        if smooth:
            legs = [leg for way in filtered.legs for leg in way]
            ends = np.cumsum([0, *(len(way) for way in filtered.legs)])
            every = smoothed(filtered.last, legs)
            beliefs = [every[k] for k in ends]
        count = len(likelihood.unknowns)
        means = np.array([b.mean for b in beliefs])
        by_values = np.einsum("tus,uc->tsc", means[:, 1 : 1 + count] - means[:, 1 + count :], root)
        variance = np.array([b.variance[0] for b in beliefs]) + np.sum(by_values**2, axis=2)
        d = likelihood.dynamics[record]
        return States(d.states, filtered.times, means[:, 0], np.sqrt(variance), d.units)

    def predict(
        self, scenario: Scenario, times: Sequence[float] | Array | None = None, *, start_sd: Mapping[str, str] | None = None, by: str = ""
    ) -> States:
        """Return what nodes and noises will do in a scenario, without a reading: the noise is carried, as are the errors of the values.

        Parameters
        ----------
        scenario : Scenario     With its start; walks of boundaries begin where the scenario puts the boundary.
        times : array (times,)  From zero on; 201 of the scenario's duration where nothing is given. [s]
        start_sd : dict         Node, or boundary with a random walk -> standard deviation of its start; zero where nothing is given. [K]
        by : str                ``process noise`` or ``output error``; the one that was chosen by default. The bands of output error hold
                                the errors of the values alone.

        Raises
        ------
        ScenarioError   Without a start or a duration, or for times below zero.
        """
        estimators = {e.name: e for e in (self.process, self.output)}
        refuse_unknown([by or self.chosen.name], estimators, self.title, "'{}' is not a way to look at the logs.", IdentificationError)
        e = estimators[by or self.chosen.name]
        grid = np.unique(np.append(np.linspace(0.0, scenario.seconds, 201) if times is None else seconds(times), 0.0))
        assert self.request is not None
        likelihood = unread(self.request, e.likelihood, scenario, grid, start_sd or {})
        place = {u.name: k for k, u in enumerate(e.likelihood.unknowns)}
        at = [place[u.name] for u in likelihood.unknowns]
        mean, variance = course(likelihood, e.maximum.fitted[at], symmetric_inverse(e.maximum.information)[np.ix_(at, at)], grid)
        d = likelihood.dynamics[0]
        return States(d.states, grid, mean, np.sqrt(variance), d.units)

    def as_object(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {
            "title": self.title,
            "chosen": self.chosen.name,
            "horizon_s": self.horizon,
            "likelihood_ratio": self.ratio,
            "p_value": self.p_value,
            "moved": list(self.moved),
            "warnings": list(self.warnings),
            "assumed": list(self.assumed),
            "estimators": {e.name: _as_object(e) for e in (self.process, self.output)},
        }

    def __str__(self) -> str:
        """Which was chosen and why, what a reader must know, and both with all their values."""
        a, b, why = self.process.left_out, self.output.left_out, ""
        if a is not None and b is not None:
            better, worse = sorted((a.rmse, b.rmse))
            why = f": predicts left-out readings over {duration_text(self.horizon)} to {short(better)} K, the other to {short(worse)} K"
        head = [f"{self.title}: {self.chosen.name}{why}"]
        head += [f"  warning: {w}" for w in self.warnings]
        head += [f"  assumed: {a}" for a in self.assumed]
        words = f"= {self.p_value:.2g}" if self.p_value >= 1e-6 else "< 1e-6"  # no log is normal that far out
        head.append(f"  likelihood ratio of process noise {self.ratio:.4g}, p {words}; the choice does not use it")
        return "\n".join([*head, *self.process.lines(), *self.output.lines()])


def _as_object(e: Estimator) -> dict[str, Any]:
    """Return an estimator as JSON holds it."""
    ahead = (
        None
        if e.left_out is None
        else {"rmse_K": e.left_out.rmse, "inside": e.left_out.inside, "readings": e.left_out.readings, "origins": e.left_out.origins}
    )
    return {
        "values": {n: {"value": f.value, "error": f.error, "unit": f.unit} for n, f in e.found.items()},
        "left_out": ahead,
        "open_loop_from_start_K": e.whole,
        "log_likelihood": e.log_likelihood,
        "converged": e.maximum.converged,
        "errors_widened": e.widened,
        "errors_by": "observed information" if e.maximum.observed else "expected information",
        "innovations": {w.sensor: {"white": w.white, "lag_one": w.statistics.lag_one, "size": w.size} for w in e.white},
    }


def whiteness_of(likelihood: Likelihood, fitted: Array) -> tuple[Whiteness, ...]:
    """Return whether the innovations are white, of every sensor of every record with more than ten readings.

    They are those of the filter at the values `fitted` (unknowns,), fitted form, over their standard deviations.
    """
    out = []
    for i, d in enumerate(likelihood.dynamics):
        filter_innovations = likelihood.passing(i, [fitted]).run().innovations
        for k, o in enumerate(d.experiment.observations):
            of_sensor = filter_innovations.standard[filter_innovations.sensors == k, 0]
            if of_sensor.size > 10:
                name = o.sensor if len(likelihood.dynamics) == 1 else f"{o.sensor} in {d.experiment.record.name}"
                out.append(whiteness(name, of_sensor))
    return tuple(out)
