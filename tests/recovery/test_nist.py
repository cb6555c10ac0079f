"""Certified regression problems (NIST StRD, nonlinear) through the driver that `calibrate` uses: 6 digits on values, 4 on errors."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thermid.base.errors import SolverError
from thermid.fit.calibration import Compressed, Fit, Sums, Unknown, covariances, minimise

pytestmark = pytest.mark.recovery
TABLES: dict[str, dict[str, Any]] = tomllib.loads((Path(__file__).parent / "nist.toml").read_text(encoding="utf-8"))
SEQUENCES: dict[str, Callable[[int], np.ndarray]] = {
    "twentieths": lambda n: np.arange(n) / 20.0,
    "counted": lambda n: np.arange(1.0, n + 1.0),
    "tens": lambda n: 10.0 * np.arange(n),
    "weeks and temperatures": lambda n: np.repeat([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 48.0, 64.0], n // 8),
}
NAMES = {name: getattr(np, name) for name in ("exp", "cos", "sin", "arctan", "pi")}
STEP = 1e-30


@dataclass(frozen=True)
class Curve:
    """A plain function of its unknowns beside its readings: what `minimise` needs, without a network."""

    model: Any
    x: np.ndarray
    y: np.ndarray
    unknowns: tuple[Unknown, ...]
    noise: float

    @classmethod
    def of(cls, name: str, start: Sequence[float]) -> Curve:
        table = TABLES[name]
        data = TABLES[table.get("data", name)]
        y = np.array(data["y"], dtype=float)
        x = SEQUENCES[data["x"]](y.size) if isinstance(data["x"], str) else np.array(data["x"], dtype=float)
        unknowns = tuple(Unknown(f"b{k + 1}", "parameter", (), float(v)) for k, v in enumerate(start))
        curve = cls(compile(table["model"], name, "eval"), x, np.log(y) if table.get("log") else y, unknowns, 1.0)
        return curve.weighed(np.array(start, dtype=float))

    def weighed(self, b: np.ndarray) -> Curve:
        return replace(self, noise=float(np.sqrt(np.mean((self.y - self.at(b)) ** 2))))

    @property
    def samples(self) -> int:
        return self.y.size

    def at(self, b: np.ndarray) -> np.ndarray:
        temperatures = np.tile(np.repeat([180.0, 225.0, 250.0, 275.0], 4), 8)  # of Nelson's table
        given = {u.name: v for u, v in zip(self.unknowns, b, strict=True)} | {"x": self.x, "z": temperatures}
        return np.asarray(eval(self.model, {"__builtins__": {}}, NAMES | given))

    def compressed(
        self, fitted: np.ndarray, loss: str = "linear", loss_scale: float = 1.0, meshes: Sequence[np.ndarray] = ()
    ) -> Compressed:
        with np.errstate(all="ignore"):
            # a derivative by an imaginary step has no cancellation (Squire and Trapp, SIAM Rev. 40 (1998) 110)
            steps = fitted.astype(complex)[:, None] + 1j * STEP * np.eye(fitted.size)
            slopes = -np.column_stack([self.at(b).imag / STEP for b in steps.T]) / self.noise
            residuals = self.y - self.at(fitted)
        rows = residuals / self.noise
        if not (np.abs(rows).max() < 1e100 and np.isfinite(slopes).all()):
            raise SolverError("the function is not a number there.")
        return Compressed(rows, slopes, float(rows @ rows), (("", "", Sums.of_residuals(residuals)),), ())

    def prior_rows(self, fitted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(0), np.zeros((0, fitted.size))

    def square(self, found: Compressed) -> float:
        return found.chi_square


@cache
def solved(name: str, k: int) -> tuple[Fit, np.ndarray]:
    """Return the fit and its standard errors, weights renewed from the residuals as `calibrate` does where no noise is stated."""
    start = TABLES[name]["starts"][k]
    curve = Curve.of(name, start)
    found = minimise(curve, done=1e-9)
    for _ in range(2):
        curve = curve.weighed(found.fitted)
        found = minimise(curve, start=found.fitted, done=1e-9)
    # the certified errors divide by the degrees of freedom
    curve = replace(curve, noise=curve.noise * float(np.sqrt(curve.samples / (curve.samples - len(start)))))
    found = minimise(curve, start=found.fitted, done=1e-9)
    return found, np.sqrt(np.diag(covariances(found)[0]))


def digits(found: np.ndarray, certified: Sequence[float]) -> float:
    """Return to how many digits the worst of some numbers agrees, 11 at most, as many as are certified (the log relative error)."""
    away = np.abs(found / np.array(certified) - 1.0).max()
    return float(np.clip(-np.log10(max(away, 1e-11)), 0.0, 11.0))


BEYOND = {
    "Bennett5-start1-values": "from the distant start the steps follow a flat, bent valley and 200 evaluations do not reach its end",
    "Bennett5-start1-errors": "the values are not reached, so the errors are not either",
    "Lanczos1-start1-errors": "its residuals, 1e-13, are the rounding of double precision; the certified ones took 500 digits",
    "Lanczos1-start2-errors": "its residuals, 1e-13, are the rounding of double precision; the certified ones took 500 digits",
}
"""What fails, and why. Of the higher level only the second start is asked for; the first is run all the same."""


def cases(what: str) -> list[Any]:
    out = []
    for name in TABLES:
        for k in (0, 1):
            reason = BEYOND.get(f"{name}-start{k + 1}-{what}")
            marks = [pytest.mark.xfail(reason=reason, strict=True)] if reason else []
            out.append(pytest.param(name, k, id=f"{name}-start{k + 1}", marks=marks))
    return out


@pytest.mark.parametrize("name", [n for n in TABLES if n != "Lanczos1"])
def test_the_tables_were_retyped_without_a_slip(name: str) -> None:
    # the certified values of Lanczos1 have too few digits to give its sum of squares, 1.4e-25
    curve = Curve.of(name, TABLES[name]["starts"][0])
    residuals = curve.y - curve.at(np.array(TABLES[name]["certified"]))
    assert residuals @ residuals == pytest.approx(TABLES[name]["squares"], rel=2e-10)


@pytest.mark.parametrize(("name", "start"), cases("values"))
def test_six_certified_digits_on_values(name: str, start: int) -> None:
    found, _ = solved(name, start)
    assert digits(found.fitted, TABLES[name]["certified"]) >= 6.0


@pytest.mark.parametrize(("name", "start"), cases("errors"))
def test_four_certified_digits_on_standard_errors(name: str, start: int) -> None:
    _, errors = solved(name, start)
    assert digits(errors, TABLES[name]["errors"]) >= 4.0
