"""What a coefficient turned out to be made of, surface by surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermid.knowledge.values import FittedValues
from thermid.model.tree.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SplitSurface:
    """One coefficient taken apart. Errors are one sigma.

    Parameters
    ----------
    path : str                          Of the surface.
    effective, effective_error : float  The coefficient in air. [W/(m^2 K)]
    radiative, convective : float       Its parts at the temperatures of the fit. [W/(m^2 K)]
    error : float                       Of the radiative part; that of the convective one with `effective_error`. [W/(m^2 K)]
    emissivity, emissivity_error : float    [-]
    prior : str                         Where the emissivity was first taken from.
    expected : float                    Convection by the correlation for the body. [W/(m^2 K)]
    floor : float                       Conduction of gas at rest, the least. [W/(m^2 K)]
    surface, gas : float                Temperatures of the fit. [K]
    used : bool                         Whether the correlation had a say.
    remark : str                        What a reader must know.
    """

    path: str
    effective: float
    effective_error: float
    radiative: float
    convective: float
    error: float
    emissivity: float
    emissivity_error: float
    prior: str
    expected: float
    floor: float
    surface: float
    gas: float
    used: bool
    remark: str = ""

    @property
    def convective_error(self) -> float:
        """Standard error of the convective part. [W/(m^2 K)]"""
        return math.hypot(self.error, self.effective_error)

    @property
    def correlation(self) -> float:
        """Correlation of the errors of both parts: what is not radiation is convection. [-]"""
        return -self.error / self.convective_error if self.error else 0.0

    def __str__(self) -> str:
        """The parts in one line, the remark in a second."""
        own = f"{self.effective:.3g} = {self.radiative:.2g} radiation + {self.convective:.2g} convection, +- {self.error:.2g} between them"
        line = f"{self.path}: {own} [W/(m^2 K)]   emissivity {self.emissivity:.3g} +- {self.emissivity_error:.1g} ({self.prior})"
        return f"{line}\n  remark: {self.remark}" if self.remark else line


@dataclass(frozen=True, eq=False)
class Split:
    """Effective coefficients taken apart.

    Parameters
    ----------
    surfaces : tuple        One entry per surface.
    values : FittedValues   The fitted parameters and the emissivities, with their joint covariance: what a prediction without gas rests on.
    model : Model           The model with all of them laid over it.
    caution : str           What no error here covers; empty where there is nothing.
    """

    surfaces: tuple[SplitSurface, ...]
    values: FittedValues
    model: Model
    caution: str = ""

    def __getitem__(self, path: str) -> SplitSurface:
        """Return the entry of a surface."""
        path = self.model.canonical(path)
        return next(s for s in self.surfaces if s.path == path)

    def __str__(self) -> str:
        """One entry per surface, and what no error covers."""
        return "\n".join([*map(str, self.surfaces), *([f"caution: {self.caution}"] if self.caution else [])])
