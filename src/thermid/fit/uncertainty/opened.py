"""Fixed values of a fit opened at its end: the same residuals, with derivatives with respect to what the fit did not look for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermid.fit.least_squares.solve import ended
from thermid.fit.problem.gather import problem_for, problem_of
from thermid.fit.problem.residuals import Problem

if TYPE_CHECKING:
    from thermid.fit.problem.request import Request
    from thermid.model.tree.resolve import ParameterSet

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Opened:
    """The residuals of a fit with some of its fixed values among the unknowns.

    Parameters
    ----------
    problem : Problem           Its unknowns are those of the fit, in their order, and then the opened ones.
    fitted : array (unknowns,)  Where the fit ended, in the fitted form; what it took as fixed stands where it stood.
    own : int                   How many unknowns the fit itself had.
    """

    problem: Problem
    fitted: Array
    own: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the opened values, in the order of their columns."""
        return tuple(u.name for u in self.problem.unknowns[self.own :])


def opened_at(
    request: Request,
    problem: Problem,
    fitted: Array,
    groups: Sequence[Sequence[str]],
    *,
    instruments: bool = False,
    known: Mapping[str, float] | None = None,
) -> Opened:
    """Return the residuals of a fit with some of its fixed values opened, at the values at which it ended.

    Parameters
    ----------
    request : Request       What the fit was asked.
    problem : Problem       Its residuals, with the noise that was used.
    fitted : array          Where it ended, in the fitted form.
    groups : sequence       The fixed values, each as the paths where it acts; the first one names it. What is an unknown of the fit, or is
                            derived from others in its model, is left out: see `Opened.names`. A path with another value does not act.
    instruments : bool      Whether constant errors of instruments that the fit took as fixed are opened too.
    known : dict            Name -> value [SI] of what is opened, where it is not the one in the model.
    """
    experiments = problem.experiments
    if instruments:
        request = replace(request, held_bias={}, held_errors=None)
        experiments = problem_for(request).experiments
    own = {u.name: k for k, u in enumerate(problem.unknowns)}
    acting = {p for u in problem.unknowns if u.kind == "parameter" for p in (u.name, *u.also)}
    parameters = experiments[0].network.flat.parameters
    free = [[p for p in group if p not in acting] for group in groups]
    chosen = [_alike(parameters, rest) for rest, group in zip(free, groups, strict=True) if rest[:1] == list(group[:1])]
    wider = problem_of(request, experiments, [group for group in chosen if group])
    of = {u.name: u for u in wider.unknowns}
    unknowns = [*(of[name] for name in own), *(u for u in wider.unknowns if u.name not in own)]
    more = [u.to_fitted((known or {}).get(u.name, u.start)) for u in unknowns[len(own) :]]
    made = Problem(wider.experiments, tuple(unknowns), problem.noise, problem.options, wider.fixed_bias, problem.coupled)
    return Opened(made, np.concatenate([fitted, more]), len(own))


def _alike(parameters: ParameterSet, group: Sequence[str]) -> tuple[str, ...]:
    """Return the paths of a group that hold its value here; none where its first one is derived from others, or is not there."""
    table = parameters.table
    here = [p for p in group if p in table and table[p].parameter.is_literal]
    if here[:1] != list(group[:1]):
        return ()
    values = parameters.evaluate({}, here)
    return tuple(p for p in here if math.isclose(values[p], values[here[0]], rel_tol=1e-9))


def opened_jacobian(at: Opened, loss: str = "linear", knee: float = 1.0) -> tuple[Array, Array]:
    """Return the derivatives of the weighted residuals with respect to the fit's own unknowns and to the opened values.

    Both have the same rows, in as few as hold the same information (`Fit.jacobian`); the weights of a robust loss are in them. With A and B
    the two, an error dq of the opened values moves the fit by ``-C A'B dq``, C the covariance that its weights stand for.
    """
    jacobian = ended(at.problem, at.fitted, loss, knee).jacobian
    return jacobian[:, : at.own], jacobian[:, at.own :]
