"""`PowerHistory`: the power of a load over time as a log shows it, how well, how finely, and which law it follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thermid.errors import IdentificationError
from thermid.fit.problem.residuals import SensorTrace
from thermid.model.laws.signal import literal

if TYPE_CHECKING:
    from thermid.model.tree.model import Model
    from thermid.power.laws import PowerLaw
    from thermid.simulation.scenarios.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PowerHistory:
    """The power of a load, recovered from temperatures.

    Parameters
    ----------
    load, node : str                The load, and the node that it heats.
    times : array (knots,)          From the first sample; the power is linear between them. [s]
    power : array (knots,)          Most likely power. [W]
    covariance : array (knots, knots)   Of the power, everything else that was looked for counted. [W^2]
    temperature : array (knots,)    Of the node. [K]
    known : array (knots,)          Where the power was given.
    resolution : float              Width at half height of the kernel through which the log shows the power. [s]
    prior : str                     Random walk, or integrated random walk.
    values : dict                   What was fitted with it -> (value, standard error, unit).
    blocks : tuple of Block         Measured and predicted readings.
    model : Model                   With the fitted values, the load a plain power.
    scenario : Scenario             What was done, with the history as the load's power.
    warnings : tuple of str         What a reader must know.
    """

    load: str
    node: str
    times: Array
    power: Array
    covariance: Array
    temperature: Array
    known: NDArray[np.bool_]
    resolution: float
    prior: str
    values: Mapping[str, tuple[float, float, str]]
    blocks: Sequence[SensorTrace]
    model: Model = field(repr=False)
    scenario: Scenario = field(repr=False)
    warnings: tuple[str, ...] = ()

    @property
    def sd(self) -> Array:
        """Standard deviation of the power (knots,). [W]"""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def weights(self, window: str) -> tuple[Array, Array]:
        """Return the middle of every whole window [s], and the weights (windows, knots) of the knots in its mean power.

        Raises
        ------
        IdentificationError   When a window is narrower than two knots or wider than the log.
        """
        width, steps = literal(window, "s", "window"), np.diff(self.times)
        count = int(self.times[-1] / width + 1e-9)
        if width < 0.99 * float(np.median(steps)) or count < 1:
            raise IdentificationError(
                f"a window of {window} does not fit knots every {np.median(steps):g} s over {self.times[-1]:g} s.", self.load
            )
        edges: Array = width * np.arange(count + 1, dtype=float)
        # the integral of each hat from the beginning to every edge: of its rising side, then of its falling one
        share = np.clip((edges[:, None] - self.times[None, :-1]) / steps[None, :], 0.0, 1.0)
        whole = np.zeros((edges.size, self.times.size))
        whole[:, 1:] = 0.5 * share**2 * steps
        whole[:, :-1] += (share - 0.5 * share**2) * steps
        return np.asarray(edges[:-1] + 0.5 * width), np.asarray(np.diff(whole, axis=0) / width)

    def averaged(self, window: str) -> tuple[Array, Array, Array]:
        """Return the middle of every window [s], its mean power [W] and the standard deviation of that. [W]"""
        middle, weights = self.weights(window)
        return middle, np.asarray(weights @ self.power), np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", weights, self.covariance, weights)))

    @property
    def rmse(self) -> dict[str, float]:
        """Sensor -> RMS of measured less predicted. [K]"""
        return {b.sensor: float(np.sqrt(np.mean(b.residuals**2))) for b in self.blocks}

    def laws(self) -> tuple[PowerLaw, ...]:
        """Return laws of the power over the node's temperature fitted to the history where it was unknown, the likeliest first."""
        from thermid.power.laws import fitted_laws

        return fitted_laws(self)

    def __str__(self) -> str:
        """Return its size, error and resolution, what was fitted with it, and warnings."""
        open_ = ~self.known
        lines = [
            f"power of {self.load}: mean {self.power[open_].mean():.4g} W, from {self.power[open_].min():.4g} to "
            f"{self.power[open_].max():.4g} W where it was unknown ({self.prior})",
            f"  error of a moment {np.median(self.sd[open_]):.2g} W (1 sd); resolution {self.resolution / 60:.3g} min: "
            "faster changes are shown smeared over that time",
        ]
        for name, (value, error, unit) in self.values.items():
            lines.append(f"  {name} {value:.5g} +- {error:.2g} {unit}")
        lines += [f"  {sensor}: RMSE {size:.3g} K" for sensor, size in self.rmse.items()]
        return "\n".join([*lines, *(f"  warning: {w}" for w in self.warnings)])

    def plot(self, axes: Any = None) -> Any:
        """Return the axes of a figure: the history with its 95 % band over hours, known stretches grey."""
        from matplotlib.figure import Figure

        axes = axes if axes is not None else Figure(figsize=(8, 3.6), layout="constrained").subplots()
        hours = self.times / 3600.0
        axes.fill_between(hours, self.power - 1.96 * self.sd, self.power + 1.96 * self.sd, color="#9ecae1", label="95 %", linewidth=0)
        axes.plot(hours, self.power, color="#08519c", label="recovered")
        low, high = axes.get_ylim()
        axes.fill_between(hours, low, high, where=self.known, color="0.85", label="power known", zorder=0, linewidth=0)
        axes.set_ylim(low, high)
        axes.set_xlabel("time [h]")
        axes.set_ylabel(f"{self.load} [W]")
        axes.legend(frameon=False)
        return axes
