"""Predictions that a campaign names: a scenario with fitted values and 95 % bands, and margins from the bands to limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.results import Result
from thermid.base.units import ICE_POINT
from thermid.prediction.bands import Prediction

Ends = tuple[float, float]


@dataclass(frozen=True)
class BandMargin:
    """How far the 95 % band of a node stays from its limits, over a whole run.

    Parameters
    ----------
    node : str
    band : (low, high)      Lowest and highest end of the band. [K]
    expected : (low, high)  Lowest and highest expected temperature, the middle of the band. [K]
    limits : (low, high)    Infinite where nobody set one. [K]
    """

    node: str
    band: Ends
    expected: Ends
    limits: Ends = (-np.inf, np.inf)

    @property
    def margin(self) -> float:
        """From the band to the nearer limit, negative beyond it; infinite without limits. [K]"""
        return min(self.limits[1] - self.band[1], self.band[0] - self.limits[0])

    @property
    def is_upper(self) -> bool:
        """Whether the upper limit is the nearer one."""
        return self.limits[1] - self.band[1] <= self.band[0] - self.limits[0]

    @property
    def expected_margin(self) -> float:
        """From the middle of the band to that limit, negative beyond it. [K]"""
        return self.limits[1] - self.expected[1] if self.is_upper else self.expected[0] - self.limits[0]

    @property
    def words(self) -> tuple[str, str, str]:
        """Return band, limits and margin as texts; the latter two are empty without limits."""
        low, high = (end - ICE_POINT for end in self.band)
        cold, hot = (end - ICE_POINT for end in self.limits)
        limits = f"{cold:g} .. {hot:g} degC" if np.isfinite(cold) else f"below {hot:g} degC"
        limits = limits if np.isfinite(hot) else f"above {cold:g} degC" * bool(np.isfinite(cold))
        return f"{low:.2f} .. {high:.2f} degC", limits, f"{self.margin:.2f} K" if limits else ""


@dataclass(frozen=True, eq=False)
class CampaignPrediction(Result):
    """A prediction that a campaign names.

    Parameters
    ----------
    name, stage : str       Its name, and the stage whose values it uses.
    prediction : Prediction Temperatures with bands.
    limits : dict           Node -> lowest and highest temperature allowed. [K]
    """

    name: str
    stage: str
    prediction: Prediction
    limits: Mapping[str, Ends]

    @property
    def margins(self) -> tuple[BandMargin, ...]:
        """Every node with its band and limits, smallest margin first; a temperature that the scenario gives is none of the model's."""
        out = []
        bands = {n: b for n, b in self.prediction.bands.items() if b.error.any() or n in self.limits} or self.prediction.bands
        for node, band in bands.items():
            (lowest, low), (highest, high) = (band.extreme(sign) for sign in (-1.0, 1.0))
            out.append(BandMargin(node, (low, high), (lowest, highest), self.limits.get(node, (-np.inf, np.inf))))
        return tuple(sorted(out, key=lambda m: m.margin))

    @property
    def within(self) -> bool | None:
        """Whether every band stays inside its limits; None without limits."""
        return self.margins[0].margin >= 0.0 if self.limits else None

    @property
    def head(self) -> str:
        """The answer in one sentence."""
        if not self.limits:
            return f"{self.name}: no limits given"
        worst = self.margins[0]
        band, limit = (ends[worst.is_upper] - ICE_POINT for ends in (worst.band, worst.limits))
        reach = f"95 % band {'up' if worst.is_upper else 'down'} to {band:.2f} degC"
        if self.within:
            return f"{self.name}: smallest margin {worst.margin:.2f} K at {worst.node}, {reach}, limit {limit:g} degC"
        exceeds, inside = (
            worst.expected_margin < 0.0,
            f"may exceed its limit of {limit:g} degC, expected {worst.expected_margin:.2f} K inside",
        )
        words = f"is expected to exceed its limit of {limit:g} degC by {-worst.expected_margin:.2f} K" if exceeds else inside
        others = [f"{m.node} by {-m.margin:.2f} K" for m in self.margins[1:] if m.margin < 0.0]
        also = f"; beyond its limit too: {', '.join(others)}" if others else ""
        return f"{self.name}: {worst.node} {words}; {reach}, {-worst.margin:.2f} K beyond{also}"

    def __str__(self) -> str:
        """Return the answer, margins of the bands, and the prediction."""
        lines = [self.head]
        lines += [f"  {m.node:<12} band {m.words[0]}  limits {m.words[1]}  margin {m.words[2]}" for m in self.margins if m.words[1]]
        return self.prediction.standing.over("\n".join([*lines, *str(self.prediction).splitlines()]))

    def to_dict(self) -> dict[str, Any]:
        """Return margins and prediction as plain numbers."""
        margins = {
            m.node: {"low_C": m.band[0] - ICE_POINT, "high_C": m.band[1] - ICE_POINT}
            | ({"margin_K": m.margin, "expected_margin_K": m.expected_margin} if m.words[1] else {})
            for m in self.margins
        }
        return {"stage": self.stage, "within": self.within, "margins": margins, **self.prediction.to_dict()}
