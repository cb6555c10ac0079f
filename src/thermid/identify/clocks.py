"""Two logs on two clocks, aligned by a model: the offset and the rate with which the temperatures follow the power."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError, RecordError, SolverError
from thermid.identify.gather import problem_for
from thermid.identify.request import LocalSpec, Request
from thermid.identify.residuals import FAILED
from thermid.measure import Record
from thermid.model.model import Model
from thermid.simulation.scenario import Scenario

__all__ = ["Alignment", "align"]

Array = NDArray[np.float64]
COARSE = 25


@dataclass(frozen=True, eq=False)
class Alignment:
    """How a second clock runs beside the first one: a time t on it is ``offset + rate t``.

    Parameters
    ----------
    offset, rate : float            [s, -]
    offset_error, rate_error : float    Standard errors, at the model's values. [s, -]
    record : Record                 Both logs on the first clock.
    rmse : dict                     Sensor -> RMS of measured less predicted. [K]
    largest : dict                  Sensor -> (largest of it by size [K], when [s]).
    """

    offset: float
    rate: float
    offset_error: float
    rate_error: float
    record: Record
    rmse: Mapping[str, float]
    largest: Mapping[str, tuple[float, float]]

    def __str__(self) -> str:
        """Return offset and rate with their errors."""
        left = ", ".join(
            f"{s} RMSE {v:.3g} K, largest {w:+.3g} K at {t:.0f} s" for s, v in self.rmse.items() for w, t in (self.largest[s],)
        )
        return (
            f"{self.record.name}: offset {self.offset:.2f} +- {self.offset_error:.2g} s, "
            f"rate {self.rate:.4f} +- {self.rate_error:.2g}; left: {left}"
        )


def align(
    model: Model,
    first: Record,
    second: Record,
    *,
    offset: tuple[float, float],
    rate: tuple[float, float] = (1.0, 1.0),
    scenario: Scenario | None = None,
    local: Mapping[str, Any] | None = None,
) -> Alignment:
    """Return offset and rate of a second record's clock at which a model follows both logs best.

    Its values stay as they are; fitting them and aligning take turns (`examples/motor`). Every offset of a coarse grid is looked at first,
    since powers that switch make many valleys.

    Parameters
    ----------
    model : Model           What the hardware is.
    first, second : Record  Temperatures on one clock; powers or commands on the other.
    offset : (low, high)    Where the offset is looked for. [s]
    rate : (low, high)      Where the rate is looked for; equal values hold it. [-]
    scenario, local         As in `calibrate`.

    Raises
    ------
    IdentificationError     When no offset lets the model run over both logs.
    """
    from scipy.optimize import least_squares

    def misses(at: Array) -> Array:
        """Return the residuals of the first record's readings in units of their noise."""
        try:
            return _residuals(model, first.joined(second, float(at[0]), float(at[1])), scenario, local)
        except (RecordError, SolverError):
            return np.full(sum(int(c.valid.sum()) for c in first.channels.values()), FAILED)

    starts = [np.array([o, 0.5 * sum(rate)]) for o in np.linspace(*offset, COARSE)]
    costs = [float(np.sum(misses(s)[:] ** 2)) for s in starts]
    if min(costs) >= FAILED**2:
        raise IdentificationError(
            "no offset lets the model run over both logs. Widen the range of offsets.", f"{first.name}, {second.name}"
        )
    start = starts[int(np.argmin(costs))]
    held = rate[0] == rate[1]

    def some(z: Array) -> Array:
        return misses(np.array([z[0], rate[0] if held else z[1]]))

    low, high = zip(offset, *([] if held else [rate]), strict=True)
    # a shift below the sampling of the powers moves nothing, so differences are taken over more
    step = [0.3 * float(np.median(np.diff(second.times))) + 0.1, 1e-3][: len(low)]
    scale = np.array([1.0, 0.01])[: len(low)]
    found = least_squares(
        some,
        np.clip(start[: len(low)], low, high),
        bounds=(low, high),
        x_scale=scale,
        diff_step=[s / max(abs(v), 1e-9) for s, v in zip(step, start, strict=False)],
    )
    level = 2.0 * found.cost / max(found.fun.size - found.x.size, 1)
    errors = np.sqrt(np.diag(np.linalg.pinv(np.asarray(found.jac).T @ np.asarray(found.jac))) * level)
    at, speed = float(found.x[0]), float(found.x[1]) if not held else rate[0]
    record = first.joined(second, at, speed)
    blocks = problem_for(_request(model, record, scenario, local)).blocks(_start(model, record, scenario, local))
    rmse = {b.sensor: math.sqrt(float(np.mean(b.residuals**2))) for b in blocks}
    worst = {b.sensor: int(np.argmax(np.abs(b.residuals))) for b in blocks}
    largest = {b.sensor: (float(b.residuals[worst[b.sensor]]), float(b.times[worst[b.sensor]])) for b in blocks}
    return Alignment(at, speed, float(errors[0]), float(errors[1]) if not held else 0.0, record, rmse, largest)


def _request(model: Model, record: Record, scenario: Scenario | None, local: Mapping[str, Any] | None) -> Request:
    specs = {k: LocalSpec.read(v, f"local.{k}") for k, v in (local or {}).items()}
    return Request(model, (record,), (), {"*": scenario} if scenario else {}, specs, fit_start=False)


def _start(model: Model, record: Record, scenario: Scenario | None, local: Mapping[str, Any] | None) -> Array:
    problem = problem_for(_request(model, record, scenario, local))
    return np.array([u.to_fitted(u.start) for u in problem.unknowns])


def _residuals(model: Model, record: Record, scenario: Scenario | None, local: Mapping[str, Any] | None) -> Array:
    """Return measured less predicted in units of the noise."""
    problem = problem_for(_request(model, record, scenario, local))
    return problem.residuals(np.array([u.to_fitted(u.start) for u in problem.unknowns]))
