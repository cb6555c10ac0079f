"""Posterior becomes prior: what a stage learnt, with its covariance, as knowledge of the stage above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.identify.unknowns import Unknown
from thermid.identify.values import FittedValues

if TYPE_CHECKING:
    from thermid.identify.calibration import Calibration
    from thermid.measure import Record

__all__ = ["counted_twice", "handed_on"]

Array = NDArray[np.float64]
NEGLIGIBLE = 1e-12


def handed_on(values: FittedValues, unknowns: Sequence[Unknown]) -> tuple[NDArray[np.int64], Array, Array]:
    """Return positions among the unknowns, mean and root of the information of what the data of a stage below said.

    The covariance of the stage holds the accuracies of its instruments too. They hold for the stage above as well, so they are taken out
    here, or they would count twice: information = inverse covariance - that of the accuracies. A prior that the stage below was given for
    a parameter is part of what it hands on. Where residuals wandered, what the data said is N with the weights of the fit and worth
    ``N S^-1 N``, S what the scores of the data scattered by (see `covariances`). The residual of the joint prior is
    ``root @ (fitted - mean)``.
    """
    order = {u.name: k for k, u in enumerate(unknowns)}
    names = list(values)
    members = [p for p in names if p in order]
    rows = [names.index(p) for p in members]
    mean = np.array([unknowns[order[p]].to_fitted(values[p].value) for p in members])
    total = values.covariance[np.ix_(rows, rows)]
    weights = total if values.weights is None else values.weights[np.ix_(rows, rows)]
    whole = np.linalg.inv(weights)
    information, vector = whole.copy(), whole @ mean
    for k, p in enumerate(members):
        prior = values[p].prior
        if prior is not None and values[p].kind != "parameter":
            information[k, k] -= prior[1] ** -2
            vector[k] -= prior[0] * prior[1] ** -2
    scale = np.sqrt(np.maximum(np.diag(weights), 1e-300))
    s, v = np.linalg.eigh(information * np.outer(scale, scale))
    kept = s > NEGLIGIBLE * s.max(initial=0.0)
    s, v = s[kept], v[:, kept]
    centre = scale * (v / s @ (v.T @ (scale * vector)))
    # in the basis where the data's information by weights is the unit matrix, wandering adds this to the covariance of their scores
    basis = (v / np.sqrt(s)).T * scale
    sizes, turned = np.linalg.eigh(basis @ whole @ (total - weights) @ whole @ basis.T)
    root = ((turned / np.sqrt(1.0 + np.maximum(sizes, 0.0))).T * np.sqrt(s)) @ v.T / scale
    return np.array([order[p] for p in members], dtype=np.int64), centre, root


def counted_twice(below: Mapping[str, Calibration], records: Sequence[Record]) -> list[str]:
    """Return a remark for every record whose readings reach a stage as samples and, through a stage below, as prior too.

    Parameters
    ----------
    below : dict        Stage -> Calibration, of those whose result is a prior here.
    records : tuple     The stage's own.
    """
    return [
        f"record '{r.name}' was fitted by stage '{name}' too, whose result is a prior here: its readings count twice, and the errors are "
        "too small. Hand the values on as fixed, or use another record."
        for r in records
        for name, calibration in below.items()
        if r.origin.sha256 in calibration.records.values()
    ]
