"""An ascent as a scenario: pressure from a trajectory or a curve, walls of a fairing that goes, a stream of molecules after it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from thermid.base.arguments import guard_methods
from thermid.base.errors import RecordError, ScenarioError, refuse_unknown
from thermid.base.results import Figure, Shown
from thermid.base.units import TEMPERATURE, Array, amount
from thermid.measure.readers import read_plain
from thermid.model.tree import Constant, Signal, TableSignal, joined, signal
from thermid.simulation.runs import MAX_IRRADIATION, Environment, Irradiation, Scenario
from thermid.site._atmosphere import HIGHEST_ALTITUDE, UPPER, Air, standard_atmosphere, upper_atmosphere
from thermid.site._constants import LIMITS_OF_LAUNCHERS, SPACE
from thermid.site.exposure import molecular_heating

TRAJECTORY_INTERVAL = 0.5
"""Interval at which pressure and density are worked out between the points of a trajectory. [s]"""
UNITS = {"altitude": "m", "speed": "m/s", "pressure": "Pa", "density": "kg/m^3"}
FAIRING_OPENING_TIME = 1e-3
"""Time that the stream takes to reach the unit as the fairing parts. [s]"""


@guard_methods
@dataclass(frozen=True, eq=False)
class Trajectory(Shown):
    """Where a vehicle flies.

    Parameters
    ----------
    times : array (samples,)              From lift-off or before. [s]
    altitude : array (samples,)           Above the sea. [m]
    speed : array (samples,) or None      Relative to the air. [m/s]
    pressure, density : array or None     Of the air where the vehicle is, where they are known. [Pa], [kg/m^3]

    Raises
    ------
    ScenarioError   When the columns do not fit, or a value does not exist.
    """

    times: Array
    altitude: Array
    speed: Array | None = None
    pressure: Array | None = None
    density: Array | None = None

    def __post_init__(self) -> None:
        """Refuse columns that are no flight."""
        for name in UNITS:
            column = getattr(self, name)
            if column is None:
                continue
            TableSignal(self.times, column)
            if name != "altitude" and column.min() < 0.0:
                raise ScenarioError(
                    f"a {name} of {column.min():.4g} {UNITS[name]} does not exist.", "trajectory", code="value.outside-range"
                )

    def air(self, times: Array, upper: str = "") -> tuple[Array, Array]:
        """Return pressure [Pa] and density [kg/m^3] (times,) along the flight: the given ones, or those of the standard atmosphere.

        Parameters
        ----------
        times : array (times,)  [s]
        upper : str             ``standard`` allows the mean table of the standard above 86 km.

        Raises
        ------
        ScenarioError   Above 86 km, where neither columns nor `upper` say what the air is.
        """
        if upper not in ("", "standard"):
            raise ScenarioError(f"upper is 'standard' or left out, not '{upper}'.", "trajectory", code="value.wrong-kind")
        if self.pressure is not None and self.density is not None:
            return self.column(times, "pressure"), self.column(times, "density")
        model = upper_atmosphere if upper else standard_atmosphere
        air: Air = model(self.column(times, "altitude"))
        pressure = air.pressure if self.pressure is None else self.column(times, "pressure")
        density = air.density if self.density is None else self.column(times, "density")
        return pressure, density

    def column(self, times: Array, name: str) -> Array:
        """Return altitude, speed, pressure or density (times,) along the flight.

        Raises
        ------
        ScenarioError   Before its first row and after its last.
        """
        return TableSignal(self.times, getattr(self, name)).within(times, f"trajectory, {name}")

    def grid(self, end: float, upper: str = "") -> Array:
        """Return the times (times,) at which the air is calculated: rows and between them steps of at most `TRAJECTORY_INTERVAL`. [s]

        They cover the whole flight where it states pressure and density. Else they end before the first altitude without a standard
        atmosphere, but times up to `end` are always among them.

        Parameters
        ----------
        end : float     Time that is needed; beyond it the air may be unknown. [s]
        upper : str     As in `air`.
        """
        parts = [np.linspace(a, b, int(np.ceil((b - a) / TRAJECTORY_INTERVAL)) + 1) for a, b in pairwise(self.times.tolist())]
        fine = np.unique(np.concatenate([self.times[:1], *parts]))
        if self.pressure is not None and self.density is not None:
            return fine
        high = self.column(fine, "altitude") > (1e3 * UPPER[-1, 0] if upper else HIGHEST_ALTITUDE)
        in_known_air = fine[: int(np.argmax(high))] if high.any() else fine
        return np.union1d(in_known_air, fine[fine <= end])


def read_trajectory(path: str | os.PathLike[str], columns: Mapping[str, str] | None = None, *, time: str | None = None) -> Trajectory:
    """Return the trajectory of a table with a header: ``time``, ``altitude [km]``, ``speed [m/s]``, and pressure and density if known.

    Parameters
    ----------
    path : path      Commas, semicolons or tabs, plain or gzip.
    columns : dict   altitude, speed, pressure or density -> column, where the header has other names.
    time : str       The time column, where its name is not a usual one. [s]

    Raises
    ------
    RecordError     When there is no altitude, or a hole.
    ScenarioError   When a value does not exist.
    """
    table = read_plain(os.fspath(path), time)
    wanted = dict(columns or {n: n for n in UNITS if n in table.names})
    refuse_unknown(wanted, UNITS, table.file, "a trajectory has no '{}'.{near} It has {known}.", RecordError)
    if "altitude" not in wanted:
        raise RecordError(
            f"the column of the altitude is not clear. Give columns = {{altitude = '...'}}, one of {', '.join(table.names)}.",
            table.file,
            code="record.layout-unclear",
        )
    return Trajectory(table.times, **{name: table.whole(column, UNITS[name]) for name, column in wanted.items()})


def ascent_scenario(
    trajectory: Trajectory | None = None,
    *,
    title: str = "ascent",
    pressure: Any = None,
    air: str = "ambient",
    air_temperature: Any = None,
    walls: Mapping[str, Any] | None = None,
    separation: str | float | None = None,
    flow: Mapping[str, float] | None = None,
    accommodation: float = 1.0,
    upper: str = "",
    duration: str | float | None = None,
    **others: Any,
) -> Scenario:
    """Return the scenario of an ascent.

    Parameters
    ----------
    trajectory : Trajectory     Gives the pressure by altitude; ``times`` begin at or before zero, lift-off.
    title : str                 What it is.
    pressure : Signal           A curve in place of the trajectory's: that of a fairing, or of a depressurisation test. [Pa]
    air : str                   The boundary that is the gas around the unit.
    air_temperature : Signal    Its temperature; the air outside at rest says nothing of gas in a fairing. [K]
    walls : dict                Boundary -> temperature of a fairing's wall; at `separation` it gives way to space. [K]
    separation : str, float     When the fairing goes. [s]
    flow : dict                 Surface -> cosine between its normal and the direction of flight, 0 to 1: after separation the stream of
                                molecules heats it.
    accommodation : float       Share of a molecule's energy that stays; 1 is the highest. [-]
    upper : str                 ``standard`` allows the mean table of the standard atmosphere from 86 to 200 km.
    duration : str, float       The trajectory's by default. [s]
    others                      Fields of `Scenario`: start, boundaries, loads, schedule, environment (vented volumes), irradiation.

    Raises
    ------
    ScenarioError   When pressure or temperature of the gas are not said, or a stream is asked for without speed or separation.
    """
    if duration is None and trajectory is None:
        raise ScenarioError("the duration is missing. Give one, such as duration = '10 [min]'.", title, code="value.incomplete")
    length = trajectory.times[-1] if duration is None and trajectory is not None else duration
    seconds = amount(length, "s", f"{title}, duration")
    times = trajectory.grid(seconds, upper) if trajectory is not None else np.zeros(1)
    gone = None if separation is None else _separation(separation, seconds, title)
    if air_temperature is None:
        raise ScenarioError(f"the temperature of the gas '{air}' is missing. Give air_temperature.", title, code="value.incomplete")
    boundaries = {air: signal(air_temperature, TEMPERATURE, f"{title}, air_temperature")}
    hulls = {k: signal(v, TEMPERATURE, f"{title}, walls.{k}") for k, v in (walls or {}).items()}
    boundaries |= {k: hull if gone is None else joined(hull, gone, Constant(SPACE)) for k, hull in hulls.items()}
    gas: Signal = signal(pressure, "Pa", f"{title}, pressure") if pressure is not None else _pressure(trajectory, times, upper, title)
    return Scenario(
        title=title,
        duration=seconds,
        start=others.pop("start", air),
        boundaries={**boundaries, **others.pop("boundaries", {})},
        environment={air: Environment(gas), **others.pop("environment", {})},
        irradiation={**_streams(trajectory, flow or {}, gone, times, accommodation, upper, title), **others.pop("irradiation", {})},
        **others,
    )


def _separation(separation: str | float, seconds: float, title: str) -> float:
    """Return when the fairing goes, within the seconds of the ascent. [s]"""
    gone = amount(separation, "s", f"{title}, separation")
    if not 0.0 <= gone <= seconds:
        raise ScenarioError(
            f"the fairing separates at {gone:g} s, outside the {seconds:g} s of the ascent.",
            f"{title}, separation",
            code="value.outside-range",
        )
    return gone


def _pressure(trajectory: Trajectory | None, times: Array, upper: str, title: str) -> Signal:
    """Return the pressure along a trajectory at times [s], by a model of the upper air. [Pa]"""
    if trajectory is None:
        raise ScenarioError("give a trajectory, or the pressure as a curve.", title, code="value.incomplete")
    return TableSignal(times, trajectory.air(times, upper)[0])


def _streams(
    trajectory: Trajectory | None,
    flow: Mapping[str, float],
    gone: float | None,
    times: Array,
    accommodation: float,
    upper: str,
    title: str,
) -> dict[str, Irradiation]:
    """Return surface -> heating by the stream of molecules after separation at `gone` [s]; nothing falls on it before. [W/m^2]

    Share times rho v^3 / 2 times the accommodation (`molecular_heating`), from `FAIRING_OPENING_TIME` before separation on, or half of the
    way to it, rising linearly to it.

    Parameters
    ----------
    flow : dict             Surface -> cosine between its normal and the flight. [-]
    accommodation : float   Share of the energy that molecules leave. [-]
    upper : str             Which atmosphere holds high up.

    Raises
    ------
    ScenarioError   Without density, speed or separation; accommodation or cosine outside 0 to 1; air too dense for molecules one by one.
    """
    if not flow:
        return {}
    if trajectory is None or trajectory.speed is None or gone is None:
        raise ScenarioError(
            "free molecular heating needs density and speed after separation. Give a trajectory with speed, and separation.",
            title,
            code="value.incomplete",
        )
    if not 0.0 < accommodation <= 1.0:
        raise ScenarioError(f"the accommodation is {accommodation:g}. Give 0 to 1.", title, code="value.outside-range")
    after = np.union1d(times[times > gone], [gone])
    heat = molecular_heating(trajectory.air(after, upper)[1], trajectory.column(after, "speed"), accommodation)
    if heat.max() > MAX_IRRADIATION:
        k = int(heat.argmax())
        height = float(trajectory.column(after[k : k + 1], "altitude")[0]) / 1e3
        raise ScenarioError(
            f"at {after[k]:.4g} s, {height:.4g} km up, the stream would bring {heat[k]:.3g} W/m^2: the air is too dense there for "
            "free molecular flow. Fairings separate where it is some kilowatts at most. Check the time of separation and the speed.",
            title,
            code="physics.not-possible",
        )
    if gone > 0.0:
        # nothing reaches the unit while the fairing stands
        ahead = max(gone - FAIRING_OPENING_TIME, 0.5 * gone)
        after, heat = np.concatenate(([0.0, ahead], after)), np.concatenate(([0.0, 0.0], heat))
    out = {}
    for surface, share in flow.items():
        if not 0.0 <= share <= 1.0:
            raise ScenarioError(
                f"the cosine between '{surface}' and the flight is {share:g}; give 0 to 1.", f"{title}, flow", code="value.outside-range"
            )
        out[surface] = Irradiation(stream=TableSignal(after, share * heat))
    return out


ASCENT_LIMITS: Mapping[str, Figure] = {name: Figure(*row) for name, row in LIMITS_OF_LAUNCHERS.items()}
"""Name -> limit. [Pa/s, Pa/s, s, W/m^2, W/m^2]"""
_UNITS = {"pressure decay": "Pa/s", "brief pressure decay": "Pa/s", "time of brief decay": "s"}


@dataclass(frozen=True)
class AscentCheck(Shown):
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
        word = {True: "met", False: "NOT met", None: "shown for information only"}[self.met]
        unit = _UNITS.get(self.name, "W/m^2")
        figure = f"{self.name} of '{self.what}': {self.value:.4g} {unit} at {self.at:.4g} s"
        return f"{figure}, limit {self.limit.value:g}: {word} ({self.limit.mark}: {self.limit.source})"


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
    refuse_unknown([air], scenario.environment, scenario.title, "it has no gas '{}'; there are {known}.", ScenarioError)
    # that of a vented volume is worked out
    pressure = scenario.media().signals().get(f"pressure {air}")
    if pressure is None or pressure.cycle == 0.0:
        raise ScenarioError(
            f"the pressure of '{air}' is constant, so the scenario is not an ascent.", scenario.title, code="value.without-effect"
        )
    out = _decay(pressure, scenario.seconds, over, air, limits)
    for surface, irradiation in scenario.irradiation.items():
        stream = getattr(irradiation, "stream", None)
        if stream is not None:
            times = stream.knots(0.0, scenario.seconds)
            heat = stream.at(times)
            k = int(np.argmax(np.where((times >= 0.0) & (times <= scenario.seconds), heat, -np.inf)))
            for name in ("molecular heating", "gentle molecular heating"):
                if name in limits:
                    out.append(_check(name, float(heat[k]), limits, float(times[k]), surface))
    return tuple(out)


def _decay(pressure: Signal, seconds: float, over: float, air: str, limits: Mapping[str, Figure]) -> list[AscentCheck]:
    """Return the checks of the fastest decay of pressure; none without a limit on it.

    The decay is (p(t) - p(t + over)) / over [Pa/s], at four times in each `over` [s] from 0 to `seconds` [s]. Above the limit that holds
    at any time, where there are limits for brief periods: it beside the brief one, and the time for which it is above the former. [s]

    Parameters
    ----------
    air : str       The gas of the pressure, named in the checks.
    limits : dict   Name -> figure, as `ASCENT_LIMITS`.
    """
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
    """Return the check of a value against its published limit; a figure that does not decide gives no verdict."""
    limit = limits[name]
    return AscentCheck(name, value, limit, bool(value <= limit.value) if limit.decides else None, at, what)
