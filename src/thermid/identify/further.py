"""How far a scenario lies from the conditions of a fit, and what that does to a prediction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from thermid.errors import SolverError
from thermid.identify.calibration import Calibration
from thermid.identify.coefficients import (
    Conditions,
    Pattern,
    conditions_of,
    constant_coefficients,
    courses,
    ending_settled,
    patterns_of,
    with_patterns,
)
from thermid.identify.discrepancy import Discrepancy, discrepancy
from thermid.model.model import Model
from thermid.simulation.engine import Engine
from thermid.simulation.simulator import Simulator
from thermid.simulation.solution import Solution
from thermid.simulation.wiring import Wiring

__all__ = ["Further"]

Array = NDArray[np.float64]
CONSTANT, MISFIT = "constant coefficients", "misfit"
GUESSED = 0.25
"""Shift by radiation that nobody has stated, from which it is spoken of. [K]"""
FAR = (1.25, 10.0)
"""Ratio of differences, and kelvin of level, from which a coefficient is said to be used far from where it was found."""


@dataclass(frozen=True, eq=False)
class Further:
    """A prediction made ready with the patterns of its constant coefficients beside it.

    Parameters
    ----------
    ready : Simulator           With a pair of loads for every pattern, free and of size zero; as it was where nothing is counted.
    patterns : tuple            Those of the scenario.
    of_fit : Discrepancy        What the fit leaves open.
    logs : dict                 Fitted parameter -> its value where it was fitted by its logarithm, else 1.
    also : dict                 Fitted parameter -> all paths with its value.
    here : dict                 Path of a conductor -> its conditions in the scenario.
    """

    ready: Simulator
    patterns: tuple[Pattern, ...] = ()
    of_fit: Discrepancy | None = None
    logs: Mapping[str, float] = field(default_factory=dict)
    also: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    here: Mapping[str, Conditions] = field(default_factory=dict)

    @classmethod
    def of(cls, fit: Calibration, model: Model, ready: Simulator) -> Further:
        """Return a scenario made ready for what a fit leaves open."""
        left = discrepancy(fit)
        wiring = ready.wiring
        times, found = courses(wiring, ready.engine, ready.vector({}) if ready.free else None, ready.options)
        network = wiring.network
        try:
            rest, _ = ready.settled()
            acting = {p: c.ends for p, c in constant_coefficients(network).items() if p in found}
            found = {p: ending_settled(found[p], rest[a], rest[b]) for p, (a, b) in acting.items()}
        except SolverError:
            pass  # nothing settles, so nobody asks for it
        every = patterns_of(network, times, found, left.conditions, network.numbers().values)
        patterns = tuple(p for p in every if (p.path, p.kind) in left.sizes)
        network, scenario = with_patterns(network, wiring.scenario, patterns)
        scales = [f"scale.{n}" for p in patterns for n in p.names(network.boundaries)]
        wide = Wiring(network, scenario, (*ready.free, *scales))
        simulator = replace(ready, _wiring=wide, _engine=Engine(wide))
        fitted = fit.values.parameters
        logs = {p: v.value if v.log else 1.0 for p, v in fitted.items()}
        return cls(simulator, patterns, left, logs, {p: (p, *v.also) for p, v in fitted.items()}, conditions_of([found]))

    @property
    def still(self) -> dict[str, float]:
        """Free name -> zero, for the loads that stand for patterns."""
        return {f"scale.{n}": 0.0 for p in self.patterns for n in p.names(self.ready.wiring.network.boundaries)}

    def shift(self, node: str, run: Solution, moves: Mapping[str, Array]) -> Array:
        """Return what a node is expected to differ by from a model of constant coefficients (times and the settled state). [K]"""
        if self.of_fit is None or not self.of_fit.means:
            return np.zeros(self.ready.times.size + 1)
        return np.asarray(self._moved(node, run, moves) @ np.array(list(self.of_fit.means.values())))

    def columns(self, kept: Sequence[str], run: Solution, moves: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
        """Return cause -> node -> what each of its directions does (times and the settled state, directions). [K]"""
        if self.of_fit is None:
            return {}
        out: dict[str, dict[str, Array]] = {}
        if self.of_fit.sizes:
            out[CONSTANT] = {n: self._moved(n, run, moves) @ self.of_fit.root for n in kept}
        misfit = self.of_fit.misfit
        if any(misfit.values()):
            other = float(np.sqrt(np.mean(np.square(list(misfit.values())))))
            boundaries = self.ready.wiring.network.boundaries
            sizes = {n: 0.0 if n in boundaries else misfit.get(n, other) for n in kept}
            out[MISFIT] = {n: np.full((self.ready.times.size + 1, 1), size) for n, size in sizes.items()}
        return out

    def guessed(self, kept: Sequence[str], run: Solution, moves: Mapping[str, Array]) -> list[str]:
        """Return a remark where radiation that nobody has stated shifts a temperature: any emissivity was taken as equally likely."""
        if self.of_fit is None:
            return []
        bare = {p for p, c in constant_coefficients(self.ready.wiring.network).items() if not c.emissivity}
        keys = list(self.of_fit.means)
        own = np.array([self.of_fit.means[k] if k[1] == "level" and k[0] in bare else 0.0 for k in keys])
        if not own.any():
            return []
        shifts = {n: float((self._moved(n, run, moves) @ own)[-2]) for n in kept}
        worst = max(shifts, key=lambda n: abs(shifts[n]))
        if abs(shifts[worst]) < GUESSED:
            return []
        surfaces = sorted({k[0] for k, size in zip(keys, own, strict=True) if size})
        listed = ", ".join(surfaces[:3]) + (f" and {len(surfaces) - 3} more" if len(surfaces) > 3 else "")
        return [
            f"'{worst}' is shifted by {shifts[worst]:+.2g} K, and others less, for radiation that nobody has stated: any emissivity from 0 "
            f"to 0.95 is taken as equally likely. Bare metal radiates less, and the shift then goes too far. Say the finish, or the "
            f"emissivity, of {listed}."
        ]

    def _moved(self, node: str, run: Solution, moves: Mapping[str, Array]) -> Array:
        """Return what a unit of every pattern does to a node, the fit's own response among it (times and settled, patterns). [K]"""
        assert self.of_fit is not None
        place = {name: k for k, name in enumerate(self.ready.free)}
        still = np.full(len(place), np.nan)

        def slope(names: Sequence[str]) -> Array:
            over = np.sum([run.sensitivity(node, n) for n in names], axis=0)
            return np.append(over, float(np.sum([moves.get(node, still)[place[n]] for n in names])))

        keys = list(self.of_fit.sizes)
        out = np.zeros((self.ready.times.size + 1, len(keys)))
        boundaries = self.ready.wiring.network.boundaries
        for p in self.patterns:
            names = [f"scale.{n}" for n in p.names(boundaries)]
            if names:
                out[:, keys.index((p.path, p.kind))] += slope(names)
        rows = {n: k for k, n in enumerate(self.of_fit.names)}
        for path, factor in self.logs.items():
            names = [self.ready.canonical(q) for q in self.also[path]]
            out += np.outer(factor * slope(names), self.of_fit.response[rows[path]])
        return out

    @property
    def words(self) -> dict[str, str]:
        """Cause -> what it stands for."""
        if self.of_fit is None:
            return {}
        out = {}
        if self.of_fit.sizes:
            far = [
                f"{p} (found at {at}, here {self.here[p]})"
                for p, at in self.of_fit.conditions.items()
                if p in self.here and _far(at, self.here[p])
            ]
            listed = "; ".join(far[:3]) + (f"; and {len(far) - 3} more" if len(far) > 3 else "")
            used = f"used further off: {listed}" if far else "used near where they were found"
            out[CONSTANT] = f"convection may grow with the difference (exponent 0 to 1/3), radiation with the level; {used}"
        if any(self.of_fit.misfit.values()):
            out[MISFIT] = "what the model could not follow in the records that it was fitted to"
        return out


def _far(at: Conditions, here: Conditions) -> bool:
    ratio = here.difference / max(at.difference, 1e-9)
    return not 1.0 / FAR[0] <= ratio <= FAR[0] or abs(here.level - at.level) > FAR[1]
