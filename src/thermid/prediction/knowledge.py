"""What a fit, or a model with priors, knows before a test is made: values, their covariance, and what of it holds without gas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError
from thermid.identify.calibration import Calibration
from thermid.identify.gather import prior_of
from thermid.identify.split import split_needed, split_values
from thermid.identify.unknowns import Unknown, parameter_unknown
from thermid.model.model import Model
from thermid.network.network import compile_network
from thermid.prediction.known import Known, rows_of
from thermid.prediction.structural import open_contacts
from thermid.simulation.scenario import Scenario

__all__ = ["WITHOUT_GAS", "Knowledge"]

Array = NDArray[np.float64]
WITHOUT_GAS = " without gas"
"""After the name of a value that is another one without gas."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What is known: a model at its values, names of unknowns with their information, and what of it priors of instruments hold.

    Parameters
    ----------
    model : Model
    names : tuple of str            Of the unknowns: parameters, and constant errors of instruments.
    free : dict                     Parameter -> all paths that share its value.
    information : array             Over the names, in the form in which a parameter of the model is fitted.
    fitted : dict                   Name -> value in that form.
    spread : float                  Readings scatter so many times as much as their noise says. [-]
    untie : bool                    Whether instances have values of their own.
    held : dict                     Name -> information that a prior has brought already.
    thin : bool                     Whether it was learnt with thin gas already.
    split : tuple of str            Emissivities that an effective coefficient was split into.
    """

    model: Model
    names: tuple[str, ...]
    free: Mapping[str, tuple[str, ...]]
    information: Array
    fitted: Mapping[str, float]
    spread: float = 1.0
    untie: bool = False
    held: Mapping[str, float] = field(default_factory=dict)
    thin: bool = False
    split: tuple[str, ...] = ()

    @classmethod
    def of_fit(cls, fit: Calibration, scenario: Scenario | None = None) -> Knowledge:
        """Return what a fit knows; with a scenario what it knows of that one, effective coefficients split as in `predict`.

        Given the fitted parameters, what a split says does not depend on the constant errors of instruments.

        Raises
        ------
        IdentificationError   When a coefficient that must be split cannot be.
        """
        values = fit.values
        names, covariance = [*values], np.where(np.isfinite(values.covariance), values.covariance, 0.0)
        model, wide, fresh = fit.fitted_model, values.bare(), []
        known = Known.of(fit)
        surfaces = known.kept[-1].surfaces
        thin = split_needed(model, scenario, known.assigned) if scenario is not None else []
        if thin:
            apart = split_values(model, wide, thin, surfaces)
            model = apart.model
            wide = apart.values.only([p for p, v in apart.values.items() if p in values or v.error > 0])  # the rest is taken as exact
            own = [k for k, name in enumerate(names) if name in values.parameters]
            fresh = [p for p in wide if p not in names]
            covariance = _widened(covariance, own, wide.covariance)
            names += fresh
        fitted = {n: fit.fitted[n] for n in values} | {p: float(np.log(wide[p].value)) for p in fresh}
        form = np.ones(len(names))
        for name, u in _unknowns(model, tuple(wide)).items():
            if wide[name].log and not u.log:  # a fitted value has no bounds, so one without a dimension is no longer taken for positive
                form[names.index(name)] = fitted[name] = wide[name].value
        covariance = covariance * np.outer(form, form)
        if scenario is not None:
            for name, gas in open_contacts(known, rows_of(known), scenario)[0].items():
                k, more = (
                    names.index(name),
                    gas.law.variance * (1.0 if wide[name].log else wide[name].value ** 2) * form[names.index(name)] ** 2,
                )
                covariance = np.block([[covariance, covariance[:, [k]]], [covariance[[k]], covariance[k : k + 1, k : k + 1] + more]])
                names.append(name + WITHOUT_GAS)
        return cls(
            model,
            tuple(names),
            {p: (p, *v.also) for p, v in wide.items()},
            np.linalg.pinv(covariance, hermitian=True),
            fitted,
            max(1.0, fit.reduced_chi_square) ** 0.5,
            fit.request.untie if fit.request is not None else False,
            {n: v.prior[1] ** -2 for n, v in values.items() if v.prior is not None},
            any(e.scenario.environment for e in fit.experiments),
            tuple(fresh),
        )

    @classmethod
    def of_model(cls, model: Model, priors: Mapping[str, tuple[str, str]]) -> Knowledge:
        """Return what priors say of a model.

        Raises
        ------
        IdentificationError   When there are none.
        """
        if not priors:
            raise IdentificationError("a model alone says nothing of what it does not know: give priors, or a fit.", model.title)
        parameters = compile_network(model).flat.parameters
        texts = {parameters.freeable(raw, model.canonical): given for raw, given in priors.items()}
        unknowns = _unknowns(model, tuple(texts))
        spreads = np.array([prior_of(u, texts[path]).sd for path, u in unknowns.items()])
        fitted = {path: u.to_fitted(u.start) for path, u in unknowns.items()}
        return cls(model, tuple(unknowns), {p: (p,) for p in unknowns}, np.diag(spreads**-2), fitted)

    def unknowns(self) -> dict[str, Unknown]:
        """Return path -> unknown of every parameter."""
        return _unknowns(self.model, tuple(self.free))


def _unknowns(model: Model, paths: tuple[str, ...]) -> dict[str, Unknown]:
    parameters = compile_network(model).flat.parameters
    values = parameters.evaluate({})
    return {p: parameter_unknown(p, parameters.table[p].parameter, parameters.dimension(p), float(values[p]), (), None) for p in paths}


def _widened(covariance: Array, own: list[int], wide: Array) -> Array:
    """Return a covariance with the further values of `wide` behind it, whose first ones are those at the positions `own`."""
    n = len(own)
    follows = wide[n:, :n] @ np.linalg.pinv(wide[:n, :n], hermitian=True)
    across = follows @ covariance[own]
    return np.block([[covariance, across.T], [across, wide[n:, n:]]])
