"""`Fleet`: the population of the units of one design, its texts and what it says of a unit not built yet; and how covariates act."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, quoted, refuse_unknown
from thermid.base.results import PlottedTrace, Result, Row
from thermid.base.units import Array, counted, from_si, unit as unit_of
from thermid.fit.calibration import Unknown
from thermid.inference._fleet.population import PopulationFit, distances
from thermid.model.tree import Model, Standing
from thermid.simulation.runs import Ensemble, Scenario, Workers, ensemble
from thermid.values.store import Draws, FittedValue, FittedValues

Covariates = Mapping[str, Mapping[str, float | str]]
"""Unit -> name -> number, such as its mass, or text, such as its batch."""


@dataclass(frozen=True)
class PopulationValue:
    """One value of a design over its fleet.

    Parameters
    ----------
    path, unit : str
    mean, low, high : float         The mean, of values whose logarithm is fitted the geometric one, and its 95 % interval. [SI]
    freedom : float                 Degrees of freedom of the mean.
    spread, spread_low, spread_high : float     Standard deviation of units: relative where `relative` [-], else [SI].
    spread_freedom : float          Degrees of freedom of the spread.
    relative : bool                 Whether its logarithm is fitted.
    vanished : bool                 Whether the likeliest spread is zero: the logs do not show that units differ.
    one_more_unit, one_more_hour : float    Standard error of the mean then, over that of now. [-]
    best_unit : str                 Whose log the hour is worth most on.
    """

    path: str
    unit: str
    mean: float
    low: float
    high: float
    freedom: float
    spread: float
    spread_low: float
    spread_high: float
    spread_freedom: float
    relative: bool
    vanished: bool
    one_more_unit: float
    one_more_hour: float
    best_unit: str


@dataclass(frozen=True)
class Effect:
    """What a covariate does to a value: its change per unit of a number, or of a text beside the first; relative where `relative`."""

    covariate: str
    path: str
    size: float
    low: float
    high: float
    freedom: float
    relative: bool


@dataclass(frozen=True)
class SharedVariation:
    """Correlation of two values over units, with its 95 % interval."""

    path: str
    other: str
    correlation: float
    low: float
    high: float


@dataclass(frozen=True)
class OddUnit:
    """A unit that is apart in one value.

    Its distance is in standard deviations; one unit of a fleet without odd ones exceeds the threshold in 5 % of fleets.
    """

    unit: str
    path: str
    value: float
    distance: float
    threshold: float


@dataclass(frozen=True, eq=False)
class CovariateDesign:
    """How means depend on covariates: columns about the fleet's mean, so that the first coefficients are the mean of the fleet.

    Parameters
    ----------
    columns : tuple         (covariate, text or "", mean over units) of each column beside the first.
    size : int              Values.
    table : array (units, columns + 1)      Ones, then each covariate less its mean; of a text 1 or 0 less its share.
    """

    columns: tuple[tuple[str, str, float], ...]
    size: int
    table: Array

    @classmethod
    def from_covariates(cls, units: Sequence[str], covariates: Covariates, size: int) -> CovariateDesign:
        """Return the design of covariates for units; `size` is the number of values.

        Raises
        ------
        IdentificationError   When a unit lacks a covariate, there are none of the unit's name, or all units have the same value.
        """
        refuse_unknown(covariates, units, "fleet", "covariates are given for '{}', which is not a unit of this fleet.", IdentificationError)
        for unit, table in covariates.items():
            if not isinstance(table, Mapping):
                text = f"its covariates are a dictionary such as {{'lot': 'A'}}, not {table!r:.60}."
                raise IdentificationError(text, f"fleet, {unit}", code="value.wrong-kind")
        names = list(dict.fromkeys(n for of in covariates.values() for n in of))
        columns, values = list[tuple[str, str, float]](), [np.ones(len(units))]
        for name in names:
            lacking = [u for u in units if name not in covariates.get(u, {})]
            if lacking:
                raise IdentificationError(
                    f"the covariate '{name}' is not given for {quoted(lacking[:3])}. Give it for every unit.",
                    "fleet",
                    code="fleet.covariate",
                )
            entries = [covariates[u][name] for u in units]
            texts = sorted({g for g in entries if isinstance(g, str)})
            if len(set(entries)) < 2:
                raise IdentificationError(
                    f"the covariate '{name}' is the same for all units. Leave it out.", "fleet", code="fleet.covariate"
                )
            if texts and not all(isinstance(g, str) for g in entries):
                raise IdentificationError(
                    f"the covariate '{name}' is a text for some units and a number for others.", "fleet", code="fleet.covariate"
                )
            for text in texts[1:] or [""]:
                column = np.array([float(g == text) if text else float(g) for g in entries])
                columns.append((name, text, float(column.mean())))
                values.append(column - column.mean())
        return cls(tuple(columns), size, np.column_stack(values))

    def row(self, at: Mapping[str, float | str]) -> Array:
        """Return X (values, coefficients) of a unit: 1 and covariates less their fleet means, for each value; the mean where not given."""
        refuse_unknown(at, [n for n, _, _ in self.columns], "fleet", "'{}' is no covariate of this fleet.", IdentificationError)
        about_mean = [
            (float(at[name] == text) if text else float(at[name])) - mean if name in at else 0.0 for name, text, mean in self.columns
        ]
        return np.kron(np.array([1.0, *about_mean]), np.eye(self.size))

    def rows(self) -> Array:
        """Return X of all units (units, values, coefficients)."""
        return np.asarray(np.einsum("nc,ij->nicj", self.table, np.eye(self.size)).reshape(len(self.table), self.size, -1))


@dataclass(frozen=True, eq=False)
class Fleet(Result):
    """The population of a design's units.

    Parameters
    ----------
    title : str
    values : dict           Path -> `PopulationValue`.
    effects : tuple         Of covariates.
    correlations : tuple    Of values over units; empty where they were left out.
    odd : tuple             Units that do not belong to the population, the farthest first.
    units : dict            Unit -> path -> (value, standard error) with the population as prior. [SI]
    remarks : tuple of str  What is assumed or left out.
    population : PopulationFit The likelihood, in the fitted form, about `reference`.
    shared : array (values, values)     Covariance of the means by what all units share: stated ranges of values that were held, and what
                            the structure may lack. In the fitted form.
    standing : Standing     The worst of the fits of its units at their conditional modes.
    """

    title: str
    values: Mapping[str, PopulationValue]
    effects: tuple[Effect, ...]
    correlations: tuple[SharedVariation, ...]
    odd: tuple[OddUnit, ...]
    units: Mapping[str, Mapping[str, tuple[float, float]]]
    remarks: tuple[str, ...]
    population: PopulationFit = field(repr=False)
    reference: Array = field(repr=False)
    unknowns: tuple[Unknown, ...] = field(repr=False)
    covariates: CovariateDesign = field(repr=False)
    model: Model = field(repr=False)
    shared: Array = field(repr=False)
    standing: Standing

    def next_unit(self, covariates: Mapping[str, float | str] | None = None) -> FittedValues:
        """Return the values of a unit not built yet with their errors and covariance, the errors of the means counted.

        In the fitted form its mean is reference + x beta, its covariance Omega + x V x' + that of shared errors, x the unit's design and V
        the covariance of beta.

        Raises
        ------
        IdentificationError   When a covariate is none of the fleet's.
        """
        x = self.covariates.row(covariates or {})
        mean = self.reference + x @ self.population.at.beta
        wide = self.population.omega + x @ self.population.at.spread @ x.T + self.shared
        items = {}
        for u, at, sd in zip(self.unknowns, mean.tolist(), np.sqrt(np.diag(wide)).tolist(), strict=True):
            value, error, bounds = u.to_value(at), u.slope(at) * sd, (u.low, u.high)
            items[u.name] = FittedValue(
                u.name, value, error, error, u.log, u.unit, value, bounds, self.title, also=u.also, standing=self.standing
            )
        return FittedValues("a unit not built yet", items, wide)

    def draws(self, count: int = 1000, *, covariates: Mapping[str, float | str] | None = None, seed: int = 1) -> Draws:
        """Return path -> values (count,) of units not built yet [SI], as `ensemble` takes them.

        Raises
        ------
        IdentificationError   When a covariate is none of the fleet's.
        """
        return self.next_unit(covariates).draws(count, seed)

    def predict(
        self,
        scenario: Scenario,
        count: int = 1000,
        *,
        covariates: Mapping[str, float | str] | None = None,
        seed: int = 1,
        executor: Workers = None,
    ) -> Ensemble:
        """Return the runs of drawn units not built yet; `plot` shows their 95 % bands.

        Raises
        ------
        IdentificationError   When a covariate is none of the fleet's.
        """
        return ensemble(self.model, scenario, self.draws(count, covariates=covariates, seed=seed), executor=executor)

    def priors(self, covariates: Mapping[str, float | str] | None = None) -> str:
        """Return the prior of the next unit as the lines of a campaign's stage; correlations are not in them.

        Raises
        ------
        IdentificationError   When a covariate is none of the fleet's.
        """
        return "\n".join(
            [
                "[stages.priors]",
                *(
                    f'"{p}" = {{ mean = "{v.in_unit:.4g} [{v.unit}]", sd = "{_difference(v.error, v.unit)}" }}'
                    for p, v in self.next_unit(covariates).items()
                ),
            ]
        )

    def __str__(self) -> str:
        """Return the population as tables, what is remarkable first."""
        named = ", ".join(f"{o.unit} ({o.path}, {o.distance:+.1f} standard deviations, limit {o.threshold:.1f})" for o in self.odd)
        lines = [
            f"{self.title}: {counted(len(self.units), 'unit')}, {counted(len(self.values), 'value')} of each. Odd units: {named or 'none'}."
        ]
        lines = [self.standing.over(lines[0])]
        lines += [f"  {r}." for r in self.remarks]
        width = max(map(len, self.values))
        for v in self.values.values():
            mean = f"{_shown(v.mean, v.unit)} ({_shown(v.low, v.unit)} .. {_shown(v.high, v.unit)}) {v.unit}"
            ends = [_spread(s, v) for s in (v.spread, v.spread_low, v.spread_high)]
            size = f"spread {ends[0]} ({ends[1]} .. {ends[2]})" if not v.vanished else f"spread reaches zero (at most {ends[2]})"
            lines.append(
                f"  {v.path:<{width}}  mean {mean}, {v.freedom:.0f} degrees of freedom; {size}, {v.spread_freedom:.0f} degrees of freedom"
            )
        for e in self.effects:
            lines.append(f"  effect of {e.covariate} on {e.path}: {_percent(e.size, e)} ({_percent(e.low, e)} .. {_percent(e.high, e)})")
        lines += [f"  {c.path} and {c.other}: correlation {c.correlation:.2f} ({c.low:.2f} .. {c.high:.2f})" for c in self.correlations]
        lines.append("Factor on the standard error of a mean:")
        lines += [
            f"  {v.path:<{width}}  one more unit {v.one_more_unit:.2f}, one more hour of '{v.best_unit}' {v.one_more_hour:.2f}"
            for v in self.values.values()
        ]
        return "\n".join([*lines, "Prior of the next unit, for a stage of its campaign:", self.priors()])

    def _as_rows(self) -> list[Row]:
        """Return every value with its mean and spread."""
        return [dict(vars(v)) for v in self.values.values()]

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return how far every unit is from its mean in each value."""
        far = distances(self.population)
        x = np.arange(1.0, len(self.units) + 1.0)
        return [PlottedTrace(u.name, x, far[:, k], measured=True) for k, u in enumerate(self.unknowns)]

    @property
    def _axes_titles(self) -> tuple[str, str]:  # type: ignore[override]
        """Titles of the axes."""
        return ("unit [-]", "distance from the mean [standard deviations]")

    _frame_of_rows = True

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it: values in SI units."""
        return {
            "title": self.title,
            "values": {p: dict(vars(v)) for p, v in self.values.items()},
            "effects": [dict(vars(e)) for e in self.effects],
            "correlations": [dict(vars(c)) for c in self.correlations],
            "standing": {"state": self.standing.state, "because": self.standing.because},
            "odd": [dict(vars(o)) for o in self.odd],
            "units": {n: {p: {"value": v, "error": e} for p, (v, e) in of.items()} for n, of in self.units.items()},
            "remarks": list(self.remarks),
            "priors": self.priors(),
        }


def _difference(size: float, text: str) -> str:
    """Return a difference [SI] as text in a unit; in K where that is degC or degF."""
    return f"{size / float(unit_of(text).factor):.3g} [{'K' if text in ('degC', 'degF') else text}]"


def _shown(value: float, text: str) -> str:
    """Return a value [SI] as a number in a unit."""
    return f"{from_si(value, text):.4g}"


def _spread(size: float, v: PopulationValue) -> str:
    """Return a spread in per cent where it is relative, else in the value's unit."""
    return f"{100.0 * size:.3g} %" if v.relative else f"{size / float(unit_of(v.unit).factor):.3g} {v.unit}"


def _percent(size: float, e: Effect) -> str:
    """Return an effect in per cent where it is relative, else in SI units."""
    return f"{100.0 * size:+.3g} %" if e.relative else f"{size:+.3g} [SI]"
