"""What an ascent does to a payload, held against the limits that launchers name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from thermid.arguments import takes_objects
from thermid.errors import ScenarioError
from thermid.linear_algebra import Array
from thermid.model.laws.signal import Signal
from thermid.simulation.scenarios.scenario import Scenario
from thermid.sourced import Figure

_GUIDE = "SpaceX Rideshare Payload User's Guide, October 2022"
ASCENT_LIMITS: Mapping[str, Figure] = {
    "pressure decay": Figure(2800.0, "read", f"{_GUIDE}, 3.3.8: no faster, but for brief periods"),
    "brief pressure decay": Figure(4500.0, "read", f"{_GUIDE}, 3.3.8: no faster at any time"),
    "time of brief decay": Figure(5.0, "read", f"{_GUIDE}, 3.3.8: no longer in all"),
    "molecular heating": Figure(3500.0, "read", f"{_GUIDE}, 3.3.10: at fairing separation"),
    "gentle molecular heating": Figure(1135.0, "memory", "a common target for fairing release, as launchers' guides are quoted"),
}
"""Name -> limit. [Pa/s, Pa/s, s, W/m^2, W/m^2]"""
_UNITS = {"pressure decay": "Pa/s", "brief pressure decay": "Pa/s", "time of brief decay": "s"}


@dataclass(frozen=True)
class AscentCheck:
    """One figure of an ascent beside its limit.

    Parameters
    ----------
    name : str          Of the limit.
    value : float       What the ascent does. [unit of the limit]
    limit : Figure      What is allowed, with its mark.
    met : bool or None  None where the limit decides nothing, being from memory.
    at : float          When. [s]
    what : str          The gas or the surface.
    """

    name: str
    value: float
    limit: Figure
    met: bool | None
    at: float
    what: str

    def __str__(self) -> str:
        """One line."""
        word = {True: "met", False: "NOT met", None: "shown, decides nothing"}[self.met]
        unit = _UNITS.get(self.name, "W/m^2")
        figure = f"{self.name} of '{self.what}': {self.value:.4g} {unit} at {self.at:.4g} s"
        return f"{figure}, limit {self.limit.value:g}: {word} ({self.limit.mark}: {self.limit.source})"


@takes_objects
def ascent_checks(
    scenario: Scenario, air: str = "ambient", *, over: float = 1.0, limits: Mapping[str, Figure] = ASCENT_LIMITS
) -> tuple[AscentCheck, ...]:
    """Return what an ascent does to a payload beside the limits of launchers.

    Parameters
    ----------
    scenario : Scenario     The ascent: its pressure, and the streams on its surfaces.
    air : str               The gas whose pressure falls; a vented volume too.
    over : float            Time over which a decay is taken: sensors and tables scatter over less. [s]
    limits : dict           As `ASCENT_LIMITS`, or the project's own of these names.

    Raises
    ------
    ScenarioError   When the scenario has no such gas, or its pressure is constant.
    """
    if air not in scenario.environment:
        raise ScenarioError(f"it has no gas '{air}'; there are {', '.join(scenario.environment) or 'none'}.", scenario.title)
    # that of a vented volume is worked out
    pressure = scenario.media().signals().get(f"pressure {air}")
    if pressure is None or pressure.cycle == 0.0:
        raise ScenarioError(f"the pressure of '{air}' does not change; that is no ascent.", scenario.title)
    out = _decay(pressure, scenario.seconds, over, air, limits)
    for surface, given in scenario.irradiation.items():
        stream = getattr(given, "stream", None)
        if stream is not None:
            times = stream.knots(0.0, scenario.seconds)
            heat = stream.at(times)
            k = int(np.argmax(np.where((times >= 0.0) & (times <= scenario.seconds), heat, -np.inf)))
            for name in ("molecular heating", "gentle molecular heating"):
                if name in limits:
                    out.append(_check(name, float(heat[k]), limits, float(times[k]), surface))
    return tuple(out)


def _decay(pressure: Signal, seconds: float, over: float, air: str, limits: Mapping[str, Figure]) -> list[AscentCheck]:
    """Return the fastest decay, and how long it is beyond what holds but for brief periods."""
    times = np.linspace(0.0, max(seconds - over, 0.0), max(int(seconds / over * 4), 1) + 1)
    rate: Array = (pressure.at(times) - pressure.at(times + over)) / over
    k = int(np.argmax(rate))
    out = []
    if "pressure decay" in limits:
        usual = limits["pressure decay"]
        beyond = float(np.mean(rate > usual.value) * (times[-1] - times[0])) if times.size > 1 else 0.0
        brief = {"brief pressure decay", "time of brief decay"} <= set(limits)
        if rate[k] <= usual.value or not brief:
            out.append(_check("pressure decay", float(rate[k]), limits, float(times[k]), air))
        else:
            out.append(_check("brief pressure decay", float(rate[k]), limits, float(times[k]), air))
            out.append(_check("time of brief decay", beyond, limits, float(times[int(np.argmax(rate > usual.value))]), air))
    return out


def _check(name: str, value: float, limits: Mapping[str, Figure], at: float, what: str) -> AscentCheck:
    limit = limits[name]
    return AscentCheck(name, value, limit, bool(value <= limit.value) if limit.decides else None, at, what)
