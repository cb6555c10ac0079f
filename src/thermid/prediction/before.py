"""What is known before a test is made: how the values of a model, and the instruments of its records, respond to sources of unit size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermid.dual import value_of
from thermid.errors import IdentificationError
from thermid.fit.calibration import Calibration
from thermid.fit.problem.gather import prior_of
from thermid.fit.problem.unknowns import Unknown, parameter_unknown
from thermid.knowledge.sources import Normal, Source
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.prediction.budget import Budget, budget_of
from thermid.prediction.known import Known, Rows, instruments_of, rows_of
from thermid.prediction.setting import Setting
from thermid.prediction.structural import CONSTANT, MISFIT
from thermid.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]
WITHOUT_GAS = " without gas"
"""After the name of a value that is another one without gas."""
BESIDE = (CONSTANT, MISFIT)
"""Causes that a test adds no information to: they are said beside."""
OPEN = ": open"
"""After the name of a value, its source where no fit has a finite error of it."""


@dataclass(frozen=True, eq=False)
class Before:
    """What a budget says before a test, and what the budget does not hold: instruments.

    Parameters
    ----------
    budget : Budget         Of what is known, in the scenario of the prediction that is asked for.
    instruments : Rows      Constant errors of sensors and powers; sources that values respond to as well bear one name.
    readings : dict         Instrument -> its value. [SI]
    held : dict             Name -> information that a prior has brought already, in the fitted form.
    spread : float          Readings scatter so many times as much as their noise says. [-]
    untie : bool            Whether instances have values of their own.
    thin : bool             Whether it was learnt with thin gas already.
    split : tuple of str    Emissivities that an effective coefficient was split into.
    """

    budget: Budget
    instruments: Rows = field(default_factory=Rows)
    readings: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    spread: float = 1.0
    untie: bool = False
    thin: bool = False
    split: tuple[str, ...] = ()

    @property
    def model(self) -> Model:
        """The model, effective coefficients split where the prediction needs it."""
        return self.budget.model

    @cached_property
    def place(self) -> dict[str, int]:
        """Source -> its column."""
        own = [s.name for s, cause in zip(self.budget.sources, self.budget.causes, strict=True) if cause not in BESIDE]
        return {name: k for k, name in enumerate(dict.fromkeys([*own, *(s.name for s in self.instruments.sources)]))}

    @property
    def information(self) -> Array:
        """What is known of each source (sources,): one, or nothing of a value without a finite error."""
        return np.array([0.0 if name.endswith(OPEN) else 1.0 for name in self.place])

    @cached_property
    def free(self) -> dict[str, tuple[str, ...]]:
        """Parameter that is not known exactly -> all paths that share its value."""
        return {t.name: (t.name, *t.also) for t in self.budget.targets if t.form in ("add", "log")}

    @cached_property
    def values(self) -> dict[str, float]:
        """Name -> value, of parameters and instruments. [SI]"""
        numbers = compile_network(self.model).numbers().values
        return {p: float(value_of(numbers[p])) for p in self.free} | dict(self.readings)

    @cached_property
    def responses(self) -> dict[str, Array]:
        """Name -> what a standard deviation of each source (sources,) does to the value; without gas by a name of its own. [SI]"""
        out: dict[str, Array] = {}
        for t, row in zip(self.budget.targets, self.budget.gain, strict=True):
            if t.form in ("add", "log", "factor"):
                moved = (1.0 if t.form == "add" else self.values[t.name]) * self.placed(row)
                out[t.name + WITHOUT_GAS if t.form == "factor" else t.name] = moved + (out[t.name] if t.form == "factor" else 0.0)
        for name, log, row in zip(self.instruments.names, self.instruments.log, self.instruments.matrix, strict=True):
            own = np.zeros(len(self.place))
            own[[self.place[s.name] for s in self.instruments.sources]] = row
            out[name] = own * (self.values[name] if log else 1.0)
        return out

    def placed(self, column: Array) -> Array:
        """Return what a standard deviation of each source does (sources,), from what a unit of each source of the budget does."""
        out = np.zeros(len(self.place))
        for s, size, x in zip(self.budget.sources, self.budget.sizes, column, strict=True):
            if s.name in self.place:
                out[self.place[s.name]] = size * x
        return out

    def temperature(self, node: str, at: float) -> tuple[Array, float, dict[str, float]]:
        """Return how a temperature responds (sources,), its value, and cause -> error that no test takes away. [K]"""
        linear = Setting.of(self.budget, times=[at]).linear([node])
        (columns,) = linear.columns.values()
        parts = self.budget.parts(columns[:1])
        beside = {cause: float(np.sqrt(v[0])) for cause, v in parts.items() if cause in BESIDE}
        return self.placed(columns[0]), float(linear.run[node].kelvin[0]), beside


def before_fit(fit: Calibration, scenario: Scenario | None = None) -> Before:
    """Return what a fit knows, at every depth; with a scenario what it knows of that one, as in `predict`.

    Raises
    ------
    IdentificationError   When a coefficient that must be split cannot be.
    """
    known = _opened(Known.of(fit))
    rows = rows_of(known)
    budget = budget_of(known, scenario) if scenario is not None else Budget.of_rows(rows, known.model)
    states = fit.store.states
    instruments = instruments_of(known)
    return Before(
        budget,
        instruments,
        {n: states[n].value for n in instruments.names},
        {n: s.prior[1] ** -2 for n, s in states.items() if s.prior is not None},
        max(1.0, fit.reduced_chi_square) ** 0.5,
        fit.request.untie if fit.request is not None else False,
        any(e.scenario.environment for e in fit.experiments),
        tuple(t.name for t in budget.targets if t.form == "log" and t.name not in rows.names),
    )


def before_model(model: Model, priors: Mapping[str, tuple[str, str]], scenario: Scenario | None = None) -> Before:
    """Return what priors say of a model.

    Raises
    ------
    IdentificationError   When there are none.
    """
    if not priors:
        raise IdentificationError("a model alone says nothing of what it does not know: give priors, or a fit.", model.title)
    parameters = compile_network(model).flat.parameters
    texts = {parameters.freeable(raw, model.canonical): given for raw, given in priors.items()}
    unknowns = [unknown_of(model, p) for p in texts]
    spreads = np.array([prior_of(u, texts[u.name]).sd for u in unknowns])
    sources = tuple(Source(u.name, "stated", Normal(), f"the prior of {u.name}") for u in unknowns)
    rows = Rows(tuple(texts), tuple(u.log for u in unknowns), {}, sources, ("stated",) * len(sources), np.diag(spreads))
    return Before(Budget.of_rows(rows, model, scenario))


def unknown_of(model: Model, path: str) -> Unknown:
    """Return the unknown that a parameter of a model would be."""
    parameters = compile_network(model).flat.parameters
    return parameter_unknown(
        path, parameters.table[path].parameter, parameters.dimension(path), float(parameters.evaluate({})[path]), (), None
    )


def _opened(known: Known) -> Known:
    """Return it with a source of its own for each value that its fit has no finite error of."""
    fit = known.fit
    assert fit is not None
    store = fit.store
    loose = [k for k, s in enumerate(store.states.values()) if not s.known and s.origin.kind == "fit"]
    if not loose:
        return known
    names = [list(store.states)[k] for k in loose]
    sources = tuple(Source(n + OPEN, "data", Normal(), f"nothing is known of {n}") for n in names)
    root = np.hstack([store.root, np.zeros((len(store.states), len(loose)))])
    root[loose, len(store.sources) + np.arange(len(loose))] = 1.0
    states = {n: replace(s, known=True) if n in names else s for n, s in store.states.items()}
    whole = replace(store, states=states, sources=(*store.sources, *sources), root=root)
    values = fit.values.only([n for n in fit.values if n not in names])
    return replace(known, fit=replace(fit, store=whole), values=(values,))
