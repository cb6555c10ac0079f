"""An effective coefficient taken apart into radiation and convection, with what is known of each, or the refusal where they do not fit.

Unknown are the logarithms of the emissivities. Known are a prior by finish, and per surface what a correlation says of convection, which
with the radiation makes the coefficient that was fitted; gas at rest conducts a least amount. The fitted parameters are considered, not
changed: their errors and correlations go into those of the emissivities.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError
from thermid.fit.calibration import Calibration
from thermid.fit.discrepancy import discrepancy_kept
from thermid.knowledge.standing import Standing, of_model, worst
from thermid.knowledge.values import FittedValue, FittedValues
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.prediction.split_priors import Part, parts_of
from thermid.prediction.split_surface import Split, SplitSurface
from thermid.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]

CORRELATION_SD = 0.25
"""What a correlation of natural convection promises at equipment, relative, one sigma. [-]"""
ALIKE = 0.5
"""Correlation of the emissivities of two surfaces of one finish: half of what parts differ by is the batch, half the part. [-]"""
CONFLICT = 2.0
"""Standard deviations beyond which a correlation and what is left of the coefficient disagree. [-]"""
POSSIBLE = 0.025
"""Probability below which no emissivity of the finish leaves room for the conduction of gas at rest. [-]"""


@takes_objects
def split(
    of: Model | Calibration,
    paths: str | Sequence[str] = (),
    conditions: Scenario | None = None,
    *,
    priors: Mapping[str, tuple[float, float]] | None = None,
) -> Split:
    """Return effective coefficients taken apart into radiation and convection.

    Parameters
    ----------
    of : Calibration or Model   A fit, whose records say at which temperatures the coefficients hold; or a model with `conditions`.
    paths : str or sequence     Surfaces; every one with an effective coefficient by default.
    conditions : Scenario       What was done when the coefficients were fitted, settled; for a model.
    priors : dict               Path of an emissivity -> (mean, standard deviation), in place of the finish. [-]

    Raises
    ------
    IdentificationError   When a coefficient leaves no room for the radiation of its finish beside the conduction of gas at rest; the
                          message names the suspects. When nothing says what the emissivity may be.

    References
    ----------
    Schmidt's filter for parameters that are considered and not estimated: Jazwinski, Stochastic Processes and Filtering Theory, 1970,
    section 8.4.
    """
    wanted = (paths,) if isinstance(paths, str) else tuple(paths)
    base = of.values.bare() if isinstance(of, Calibration) else FittedValues(of.title, {}, np.zeros((0, 0)))
    model = of.fitted_model if isinstance(of, Calibration) else of
    kept = discrepancy_kept(of.values) if isinstance(of, Calibration) else None
    surfaces = conditions if conditions is not None else kept.surfaces if kept is not None else {}
    return split_values(model, base, wanted, surfaces, priors or {})


def split_values(
    model: Model,
    base: FittedValues,
    wanted: Sequence[str],
    at: Scenario | Mapping[str, tuple[float, float]],
    priors: Mapping[str, tuple[float, float]] | None = None,
) -> Split:
    """Return effective coefficients taken apart, from fitted values and where these were found.

    Parameters
    ----------
    model : Model               With the values laid over it.
    base : FittedValues         The fitted parameters.
    wanted : sequence of str    Surfaces; every one with an effective coefficient where none is named.
    at : Scenario or dict       What was done then, settled; or surface -> its temperature and its gas's. [K]
    priors : dict               As in `split`.
    """
    parts = parts_of(model, base, wanted, at, priors or {})
    joint = _Joint(base, parts)
    done = [joint.take(part) for part in parts]
    values = joint.values(worst([of_model(model), *([base.standing] if base else [])]))
    origin = f"split of '{values.stage}'"
    entries = tuple(joint.entry(p, used, remark) for p, (used, remark) in zip(parts, done, strict=True))
    return Split(entries, values, _laid(model, values, origin), _caution(model, base, parts))


def _caution(model: Model, base: FittedValues, parts: Sequence[Part]) -> str:
    """Say what masses that were fitted beside constant coefficients have taken up."""
    flat = compile_network(model).flat
    roots = dict.fromkeys(flat.parameters.literal_behind(path) for node in flat.nodes for path in node.fields.values())
    masses = [path for path in roots if path in base]
    if not masses or not any(part.fitted in base and part.emissivity not in base for part in parts):
        return ""
    named = ", ".join(f"'{m}'" for m in masses[:4]) + (f" and {len(masses) - 4} more" if len(masses) > 4 else "")
    was = "was" if len(masses) == 1 else "were"
    return (
        f"{named} {was} fitted beside coefficients that are held constant, while those of air grow with the difference; several per cent"
        " of a warm-up go into the masses so, and without gas the way up is off by that share (0.3 K of a rise of 15 K on a painted box,"
        " 2 K on an assembly). What settles is not touched. `predict` allows for it; the errors here and members drawn from `values` do"
        " not. A law of natural convection with the emissivity freed has none of it."
    )


def _laid(model: Model, values: FittedValues, origin: str) -> Model:
    return model.with_values({p: v for p, v in values.assignments.items() if v.origin.startswith("split")}, origin)


def split_needed(model: Model, scenario: Scenario, known: Sequence[str]) -> list[str]:
    """Return the surfaces whose effective coefficient a scenario takes apart, and whose emissivity is not among the known values."""
    network = compile_network(model)
    media = scenario.media()
    roots = network.flat.parameters.literal_behind
    effective = [c for c in network.flat.conductors if c.kind == "effective" and c.emissivity and not media.as_printed]
    return [c.path for c in effective if media.changed(c.gas) and not {roots(c.emissivity), c.emissivity} & {*known}]


class _Joint:
    """Fitted parameters and emissivities as one normal distribution of fitted forms; emissivities by their logarithms."""

    def __init__(self, base: FittedValues, parts: Sequence[Part]) -> None:
        self.base, n = base, len(base)
        self.at = {path: k for k, path in enumerate(base)}
        fresh = {p.emissivity: p for p in parts if p.emissivity not in self.at}
        self.at |= {path: n + k for k, path in enumerate(fresh)}
        self.mean = np.array([0.0] * n + [math.log(p.prior.mean) for p in fresh.values()])
        self.cov = np.zeros((len(self.at), len(self.at)))
        self.cov[:n, :n] = base.covariance
        self.fresh = fresh
        first = list(fresh.values())
        for i, a in enumerate(first):
            for j, b in enumerate(first):
                share = 1.0 if i == j else ALIKE if a.prior.finish and a.prior.finish == b.prior.finish else 0.0
                self.cov[n + i, n + j] = share * a.prior.log_sd * b.prior.log_sd

    def emissivity(self, part: Part) -> float:
        k = self.at[part.emissivity]
        return float(np.exp(self.mean[k])) if part.emissivity in self.fresh else self.base[part.emissivity].value

    def deviation(self, part: Part) -> float:
        """Return the standard deviation of an emissivity. [-]"""
        k = self.at[part.emissivity]
        log = part.emissivity in self.fresh or self.base[part.emissivity].log
        return math.sqrt(max(float(self.cov[k, k]), 0.0)) * (self.emissivity(part) if log else 1.0)

    def _slope(self, part: Part) -> Array:
        """Return the derivative of what is left for convection with respect to the joint forms. [W/(m^2 K)]"""
        out = np.zeros(self.mean.size)
        out[self.at[part.emissivity]] = -part.black * self.emissivity(part)
        if part.fitted in self.at:
            out[self.at[part.fitted]] = part.effective if self.base[part.fitted].log else 1.0
        return out

    def take(self, part: Part) -> tuple[bool, str]:
        """Let a surface have its say: whether the correlation was used, and what a reader must know of it."""
        if part.emissivity not in self.fresh:
            return False, ""  # fitted itself: two pressures, powers or orientations
        left = part.effective - part.black * self.emissivity(part)
        slope = self._slope(part)
        spread = math.sqrt(max(float(slope @ self.cov @ slope), 0.0))
        self._room(part, left, spread)
        doubt = CORRELATION_SD * part.expected
        agrees = abs(left - part.expected) <= CONFLICT * math.hypot(spread, doubt)
        if agrees:
            self._learn(part, doubt)
        self._above_floor(part)
        return agrees, "" if agrees else part.conflict(left, spread)

    def _learn(self, part: Part, doubt: float) -> None:
        """Let the correlation speak: Gauss-Newton to the maximum, since radiation bends with the logarithm, then the covariance there."""
        k, prior = self.at[part.emissivity], self.mean
        for _ in range(30):
            before, slope = self.mean, self._slope(part)
            left = part.effective - part.black * self.emissivity(part) + slope[k] * (prior[k] - before[k])
            self.mean = prior + self._gain(slope, doubt) * (part.expected - left)
            if abs(self.mean[k] - before[k]) < 1e-10:
                break
        gain, slope = self._gain(self._slope(part), doubt), self._slope(part)
        keep = np.eye(self.mean.size) - np.outer(gain, slope)  # Joseph's form, which holds for any gain
        self.cov = keep @ self.cov @ keep.T + doubt**2 * np.outer(gain, gain)

    def _gain(self, slope: Array, doubt: float) -> Array:
        """Return the gain of the emissivities; fitted parameters are considered and stay."""
        gain = self.cov @ slope / float(slope @ self.cov @ slope + doubt**2)
        gain[: len(self.base)] = 0.0
        return np.asarray(gain)

    def _ceiling(self, part: Part) -> tuple[float, float]:
        """Return the largest emissivity that leaves the conduction of gas at rest, as a logarithm, and how well it is known."""
        room = max(part.effective - part.floor, 1e-3 * part.effective)
        return math.log(room / part.black), part.effective_error / room

    def _room(self, part: Part, left: float, spread: float) -> None:
        """Refuse a coefficient without room for its finish."""
        k = self.at[part.emissivity]
        top, loose = self._ceiling(part)
        if _normal((top - self.mean[k]) / max(math.hypot(math.sqrt(self.cov[k, k]), loose), 1e-12)) < POSSIBLE:
            raise IdentificationError(part.suspects(), part.where)

    def _above_floor(self, part: Part) -> None:
        """Cut off emissivities that leave less than the conduction of gas at rest: moments of a normal that is cut softly."""
        k = self.at[part.emissivity]
        top, loose = self._ceiling(part)
        v = float(self.cov[k, k])
        w = math.hypot(math.sqrt(v), loose)
        if v == 0.0:
            return
        z = (top - self.mean[k]) / w
        ratio = math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi) / max(_normal(z), 1e-300)
        column = self.cov[:, k] / v
        column[: len(self.base)] = 0.0
        self.mean = self.mean - column * (v / w * ratio)
        self.cov = self.cov - np.outer(column, column) * (v * v / (w * w) * ratio * (ratio + z))

    def values(self, standing: Standing) -> FittedValues:
        """Return the fitted parameters and the emissivities with their joint covariance; the latter have a standing of what was split."""
        items: dict[str, Any] = dict(self.base.items())
        for path, part in self.fresh.items():
            value, error = self.emissivity(part), self.deviation(part)
            origin = f"split: {part.prior.text}"
            items[path] = FittedValue(path, value, error, error, True, "1", part.prior.mean, (0.0, 1.0), origin, standing=standing)
        return replace(self.base, items_=items, covariance=self.cov)  # one covariance, drawn from priors as well

    def entry(self, part: Part, used: bool, remark: str) -> SplitSurface:
        """Return what was found for a surface."""
        value, error = self.emissivity(part), self.deviation(part)
        radiative = part.black * value
        return SplitSurface(
            part.path,
            part.effective,
            part.effective_error,
            radiative,
            part.effective - radiative,
            part.black * error,
            value,
            error,
            part.prior.text if part.emissivity in self.fresh else "fitted",
            part.expected,
            part.floor,
            part.surface,
            part.gas,
            used,
            remark,
        )


def _normal(z: float) -> float:
    """Return the cumulative normal distribution."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
