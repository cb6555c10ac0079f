"""`Prediction`: temperatures with their standard errors, and what these come from."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import NameNotFoundError, nearest
from thermid.files import TABLE, replacing
from thermid.knowledge.sources import LeftOut
from thermid.knowledge.standing import UNJUDGED, Standing
from thermid.measure.amounts import short
from thermid.physics.constants import ICE_POINT
from thermid.prediction.omitted import first_line

Array = NDArray[np.float64]
EXACT = 1e-9
"""Scatter of members below which they are one temperature, and rounding. [K]"""


@dataclass(frozen=True)
class Estimate:
    """One temperature with its standard error.

    Parameters
    ----------
    celsius : float     [degC]
    error : float       Standard error. [K]
    low, high : float   95 % band. [degC]
    shares : dict       Cause -> its share of the variance. [-]
    """

    celsius: float
    error: float
    low: float
    high: float
    shares: Mapping[str, float]

    def __str__(self) -> str:
        """Return it with its error."""
        return f"{self.celsius:.2f} +- {short(self.error)} degC ({self.low:.2f} .. {self.high:.2f})"


@dataclass(frozen=True, eq=False)
class Band:
    """The predicted temperature of a node over time.

    Parameters
    ----------
    path : str                      The node.
    times : array (times,)          [s]
    simulated : array (times,)      What the model says with its best values. [K]
    shift : array (times,)          What it is expected to be wrong by, where coefficients that it holds constant are used further off. [K]
    parts : dict                    Cause -> variance (times,). [K^2]
    members : array or None         Temperatures (times, members) of drawn members, where draws were asked for. [K]
    """

    path: str
    times: Array
    simulated: Array
    shift: Array
    parts: Mapping[str, Array]
    members: Array | None = field(default=None, repr=False)

    @property
    def kelvin(self) -> Array:
        """Expected temperatures (times,): the mean of the members where there are some. [K]"""
        return self.simulated + self.shift if self.members is None else np.asarray(self.members.mean(axis=1))

    @property
    def celsius(self) -> Array:
        """Expected temperatures (times,). [degC]"""
        return self.kelvin - ICE_POINT

    @property
    def error(self) -> Array:
        """Standard error (times,). [K]"""
        if self.members is not None:
            size = np.sqrt(np.mean((self.members - self.kelvin[:, None]) ** 2, axis=1))
            return np.where(size < EXACT, 0.0, size)
        return np.asarray(np.sqrt(np.sum([np.zeros(self.times.size), *self.parts.values()], axis=0)))

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper ends (times,) of the band that holds the truth with a probability. [degC]"""
        if self.members is not None:
            low, high = np.quantile(self.members, [0.5 - level / 2, 0.5 + level / 2], axis=1)
            return low - ICE_POINT, high - ICE_POINT
        wide = NormalDist().inv_cdf(0.5 + level / 2) * self.error
        return self.celsius - wide, self.celsius + wide

    @property
    def half_width(self) -> Array:
        """Half the width (times,) of the band that holds the truth in 95 of 100 cases. [K]"""
        low, high = self.interval()
        return np.asarray(0.5 * (high - low))

    def at(self, time: float) -> Estimate:
        """Return the temperature at a time within the run, straight lines between stored times. [s]"""
        low, high = (float(np.interp(time, self.times, x)) for x in self.interval())
        parts = {c: float(np.interp(time, self.times, v)) for c, v in self.parts.items()}
        celsius, error = (float(np.interp(time, self.times, x)) for x in (self.celsius, self.error))
        return Estimate(celsius, error, low, high, _shares(parts))

    @property
    def final(self) -> Estimate:
        """The last temperature."""
        return self.at(float(self.times[-1]))


def _shares(parts: Mapping[str, float]) -> dict[str, float]:
    whole = sum(parts.values())
    return {c: v / whole if whole > 0 else 0.0 for c, v in parts.items()}


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a fitted model says of a scenario, and how surely.

    Parameters
    ----------
    title, scenario : str       The model's and the scenario's titles.
    times : array (times,)      [s]
    bands : dict                Node -> Band.
    settled : dict              Node -> Estimate with the inputs of the end held for good; empty where nothing settles.
    causes : dict               Cause -> what it stands for, in words.
    warnings : tuple of str     What a reader must know.
    standing : Standing         Of the values that it rests on.
    left_out : tuple of LeftOut What the bands do not count.
    least : float               Standard error beside which that is to be seen. [K]
    """

    title: str
    scenario: str
    times: Array
    bands: Mapping[str, Band]
    settled: Mapping[str, Estimate]
    causes: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    _find: Mapping[str, str] = field(default_factory=dict, repr=False)
    standing: Standing = UNJUDGED
    left_out: tuple[LeftOut, ...] = ()
    least: float = 0.0

    @property
    def not_counted(self) -> str:
        """What a reader must know first: what the bands do not count and could matter; empty where nothing is."""
        return first_line(self.left_out, self.least)

    def __getitem__(self, node: str) -> Band:
        """Return the band of a node; aliases are accepted.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        path = self._find.get(node, node)
        if path not in self.bands:
            raise NameNotFoundError(f"no node '{node}' was predicted.{nearest(node, self.bands)}", self.title)
        return self.bands[path]

    @property
    def final(self) -> dict[str, Estimate]:
        """Node -> its last temperature."""
        return {n: b.final for n, b in self.bands.items()}

    def to_dict(self, at: list[float] | None = None) -> dict[str, Any]:
        """Return everything but the traces as plain numbers: at the end, settled, and at some times. [s]"""

        def plain(e: Estimate) -> dict[str, Any]:
            return {"C": e.celsius, "error_K": e.error, "low_C": e.low, "high_C": e.high, "shares": dict(e.shares)}

        nodes = {
            n: {
                "final": plain(b.final),
                "steady": plain(self.settled[n]) if n in self.settled else None,
                "at": [plain(b.at(t)) for t in at or []],
            }
            for n, b in self.bands.items()
        }
        return {
            "title": self.title,
            "scenario": self.scenario,
            "standing": self.standing.to_dict(),
            "nodes": nodes,
            "causes": dict(self.causes),
            "left_out": [{"what": x.what, "kelvin": x.kelvin if np.isfinite(x.kelvin) else None} for x in self.left_out],
            "warnings": list(self.warnings),
        }

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write times, temperatures and the ends of the 95 % bands, three columns per node."""
        header, columns = ['"time_s"'], [self.times]
        for name, band in self.bands.items():
            low, high = band.interval()
            header += [f"{name} [degC]", f"{name} low [degC]", f"{name} high [degC]"]
            columns += [band.celsius, low, high]
        with replacing(path, TABLE) as half:
            np.savetxt(half, np.column_stack(columns), delimiter=",", header=",".join(header), comments="", fmt="%.9g")

    def __str__(self) -> str:
        """Return the end of the run as a table, and what the variance comes from."""
        width = max([4, *(len(n) for n in self.bands)])
        lines = [f"{self.title}, {self.scenario}: temperature +- one standard error, and the band that holds the truth in 95 of 100 cases"]
        lines = [*([self.not_counted] if self.not_counted else []), *lines]
        for name, band in self.bands.items():
            e = band.final
            steady = self.settled.get(name)
            rest = f"   settles at {steady.celsius:8.2f} +- {short(steady.error)}" if steady else ""
            lines.append(
                f"  {name:<{width}}  end {e.celsius:8.2f} +- {short(e.error)} degC   95 %: {e.low:.2f} .. {e.high:.2f}{rest}{_why(e)}"
            )
        lines += [f"  {cause}: {text}" for cause, text in self.causes.items()]
        return self.standing.over("\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)]))


def _why(e: Estimate) -> str:
    """Return the causes of a variance, the largest first."""
    parts = [f"{c} {100 * s:.0f} %" for c, s in sorted(e.shares.items(), key=lambda item: -item[1]) if s >= 0.005]
    return f"   from {', '.join(parts)}" if parts else ""
