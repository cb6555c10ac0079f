"""B2's calibration: twenty parameters from twelve noisy sensors, by `thermid` and by peers with scipy's `least_squares` on top.

thermid takes every reading (216 012); peers take one a minute (3 612), those with derivatives of their own every reading as well. All
start at the same place with the same priors. Right is a result whose every parameter lies within three standard errors of the truth.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from typing import Any

import calibration
import numpy as np
import peers
from contest import timed
from numpy.typing import NDArray
from plain import FREE, Task
from reference import march, reference

Array = NDArray[Any]
PRIOR = 0.5
TARGET = 0.15
START_SEED = 1


def calibrate(options: Namespace) -> dict[str, Any]:
    """Return the contest of the calibrations."""
    present, missing = peers.present(options.peers)
    task = Task("B2", "sens", True, True, 60.0, 3e-4)
    problem = calibration.problem(START_SEED)
    away = np.random.default_rng(START_SEED).uniform(-calibration.AWAY, calibration.AWAY, FREE)
    readings = np.column_stack([problem.record.channels[f"T {n}"].values for n in calibration.network.NODES])
    rows = [_own(problem, options.rounds)]
    if not options.quick:
        rows.append(_own(calibration.problem(START_SEED, 60.0), options.rounds))
    for every in (60.0,) if options.quick else (60.0, 1.0):
        asked = Task("B2", "sens", True, True, every, 3e-4)
        for module in present:
            for name, setting, evaluate in getattr(module, "fits", lambda _: ())(asked):
                rows.append(_fit(evaluate, readings[:: round(every)], away) | {"name": name, "setting": setting})
    logs = np.array([row.pop("log") for row in rows])
    drift = np.abs(march(logs, task) - reference(task).masses[:, None]).max(axis=(0, 2))
    for row, most in zip(rows, drift, strict=True):
        row |= {"max_error_K": float(most), "ratio": row["cpu_seconds"] / rows[0]["cpu_seconds"]}
        row["columns"] = {"residuals": row["residuals"], "off [se]": f"{row['max_off_se']:.2f}", "off [log]": f"{row['max_off_log']:.3f}"}
    silent = {m.NAME: "has no least squares and no sensitivities; left out" for m in present if not hasattr(m, "fits")}
    return {
        "work": "B2, calibration of 20 parameters, noise 0.05 K (seed 7), start within +/-0.35 in log, prior sd 0.5",
        "results": rows,
        "missing": missing | silent,
        "versions": {m.NAME: m.version() for m in present},
        "remarks": ["error: temperatures of the fitted unit against those of the true one; off: largest, in standard errors and in log"],
    }


def _own(problem: calibration.Calibration, rounds: int) -> dict[str, Any]:
    import thermid as td

    times, found = [], None
    for _ in range(min(rounds, 7)):
        wall, cpu, found = timed(problem.run)
        times.append((wall, cpu))
    assert isinstance(found, td.Calibration)
    log = np.array([np.log(found[p].value / truth) for p, truth in problem.truth.items()])
    residuals = sum(c.values.size for c in problem.record.channels.values() if c.role == "node")
    return {
        "name": "thermid" if residuals > 10_000 else "thermid, thinned",
        "setting": "calibrate, default options",
        "seconds": min(t[0] for t in times),
        "cpu_seconds": min(t[1] for t in times),
        "runs": len(times),
        "target_seconds": TARGET,
        **_judged(log, np.array([found[p].error / found[p].value for p in problem.truth]), residuals),
    }


def _fit(evaluate: Callable[[Array], tuple[Array, Array | None]], readings: Array, start: Array) -> dict[str, Any]:
    from scipy.optimize import least_squares

    model = _Remembered(evaluate, readings, start)
    evaluate(start)  # compiled before the clock runs
    slopes = model.slopes if model.has_slopes else "2-point"
    wall, cpu, found = timed(lambda: least_squares(model.residuals, start, jac=slopes, diff_step=None if model.has_slopes else 1e-3))
    error = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    return {"seconds": wall, "cpu_seconds": cpu, "runs": 1, "evaluations": int(found.nfev), **_judged(found.x, error, readings.size)}


def _judged(log: Array, error: Array, residuals: int) -> dict[str, Any]:
    off = np.abs(log / error)
    return {
        "log": log,
        "residuals": int(residuals),
        "max_off_se": float(off.max()),
        "max_off_log": float(np.abs(log).max()),
        "right": bool((off <= 3).all()),
    }


class _Remembered:
    """Residuals and their derivatives at log-parameters; the last evaluation is kept, for `least_squares` asks for them one by one."""

    def __init__(self, evaluate: Callable[[Array], tuple[Array, Array | None]], readings: Array, start: Array) -> None:
        self.evaluate, self.readings, self.start = evaluate, readings, start
        self.at, self.held = np.full(FREE, np.nan), evaluate(start)
        self.has_slopes = self.held[1] is not None

    def _found(self, log: Array) -> tuple[Array, Array | None]:
        if not np.array_equal(self.at, log):
            self.held, self.at = self.evaluate(log), log.copy()
        return self.held

    def residuals(self, log: Array) -> Array:
        """Weighted residuals, priors last. [-]"""
        masses, _ = self._found(log)
        return np.concatenate((((masses - self.readings) / calibration.NOISE).ravel(), (log - self.start) / PRIOR))

    def slopes(self, log: Array) -> Array:
        """Derivatives of the residuals. [-]"""
        _, slopes = self._found(log)
        assert slopes is not None
        return np.vstack(((slopes / calibration.NOISE).reshape(-1, FREE), np.eye(FREE) / PRIOR))
