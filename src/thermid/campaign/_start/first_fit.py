"""The fit that the campaign of a proposal asks for: what a log does not determine is left out or fixed, and the fit is made once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from thermid.base.errors import IdentificationError, ThermidError
from thermid.campaign._start.roles import SURROUNDINGS
from thermid.fit.calibration import Calibration, Request, fit
from thermid.inference.criticism import FittedStructure
from thermid.model.elements import parameter

SLIGHT = 0.02
"""A way of heat that carries less than this part of what leaves a part, and whose value the log does not tell, is left out. [-]"""
LOOSELY = 1.0
"""Standard error of a logarithm from which a value counts as not told by the log. [-]"""


@dataclass(frozen=True, eq=False)
class FirstFit:
    """The first fit of a campaign.

    Parameters
    ----------
    request : Request
    fixed : tuple of str        Values that the log does not determine; the campaign keeps them fixed.
    left_out : tuple of str     Conductors that were left out because the log does not show them.
    calibration : Calibration   Its result, errors by the structure included; None where no fit could be made.
    """

    request: Request
    fixed: tuple[str, ...]
    left_out: tuple[str, ...]
    calibration: Calibration | None


def first_fit_of(one: FittedStructure, boundary: str = SURROUNDINGS) -> FirstFit:
    """Return the fit that the campaign asks for, what it keeps fixed, and what was left out.

    Ways of heat that carry little and that the log does not tell are left out. Of other values that it does not tell, the least known one
    is fixed where the search found it, until the rest is known to better than a factor of e. What a full fit refuses after that is fixed
    too.
    """
    slight = _slight(one, one.errors(), boundary)
    model = replace(one.request.model, conductors={n: c for n, c in one.request.model.conductors.items() if n not in slight})
    units = {u.name: u.unit for u in one.problem.unknowns}
    texts = {n: parameter(f"{v:.4g} [{units[n]}]", n) for n, v in one.values.items() if n.partition(".")[0] not in slight}
    model = model.with_values(texts, "thermid init")
    free = [n for n in one.request.free if n.partition(".")[0] not in slight]
    fixed: list[str] = []
    calibration = None
    sizes = one.errors(free)
    while free and max(sizes[n] for n in free) > LOOSELY:
        fixed.append(max(free, key=lambda n: sizes[n]))
        free.remove(fixed[-1])
        sizes = one.errors(free)
    priors = {path: prior for path, prior in one.request.priors.items() if path in free}
    request = replace(one.request, model=model, free=tuple(free), priors=priors, name="first fit")
    for name in sorted(free, key=lambda n: -sizes[n]):
        try:
            calibration = fit(replace(request, search="local"))
            break
        except IdentificationError:
            fixed.append(name)
            request = replace(request, free=tuple(n for n in request.free if n != name))
        except ThermidError:
            break
    return FirstFit(request, tuple(fixed), tuple(slight), calibration)


def _slight(one: FittedStructure, sizes: Mapping[str, float], boundary: str) -> list[str]:
    """Return conductors that carry little and are not told by the log."""
    values = one.values
    strength: dict[str, float] = {}
    paths = {n: c.between for n, c in one.request.model.conductors.items() if f"{n}.conductance" in values}
    for name, ends in paths.items():
        for end in ends:
            strength[end] = strength.get(end, 0.0) + values[f"{name}.conductance"]
    return [
        n
        for n, ends in paths.items()
        if sizes[f"{n}.conductance"] > 0.5 and all(values[f"{n}.conductance"] < SLIGHT * strength[e] for e in ends if e != boundary)
    ]
