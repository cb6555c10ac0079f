"""Moisture along a solution: dew points of gases, condensation margins of surfaces, the film that settles and dries, and its heat."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from thermid.base.errors import ScenarioError, SolverError, refuse_unknown
from thermid.base.linear_algebra import anderson_step
from thermid.base.results import Named, PlottedTrace
from thermid.base.units import ICE_POINT, Array
from thermid.model.tree import Constant, FlatConductor, HeatLoad, Model, Parameter, Signal, TableSignal, check_span, signal
from thermid.simulation.runs import Scenario, Solution, compile_network, simulate, surfaces_in_gas
from thermid.site.vapour import Followed, Volume, WaterBalance, follow

MAX_CHANGE_BETWEEN_PASSES: Final = 1e-3
"""Change of every temperature between passes below which the latent heat is in balance with them. [K]"""
PASSES: Final = 60
MAX_MIXED_PASSES: Final = 12
"""Passes whose latent heats are combined to the next one. [-]"""


@dataclass(frozen=True, eq=False)
class SurfaceMoisture:
    """One surface along a run.

    Parameters
    ----------
    surface : str           Path.
    gas : str               The gas node that it exchanges with.
    times : array (times,)  [s]
    margin : array (times,) Temperature less the dew point of the gas; negative where vapour settles. [K]
    film : array (times,)   Water on it. [kg/m^2]
    latent : array (times,) Heat that settling gives, drying takes. [W]
    """

    surface: str
    gas: str
    times: Array
    margin: Array
    film: Array
    latent: Array

    @property
    def condensing(self) -> float:
        """How long it stays below the dew point. [s]"""
        return _time_below(self.times, self.margin)

    @property
    def heat(self) -> float:
        """What settling water gave, less what drying took. [J]"""
        return float(np.trapezoid(self.latent, self.times))

    @property
    def wet(self) -> float:
        """How long there is water on it, from the instant at which it begins to condense. [s]"""
        return _time_below(self.times, np.where((self.film > 0.0) | (self.margin < 0.0), -1.0, 1.0))


@dataclass(frozen=True, eq=False)
class Moisture(Named[SurfaceMoisture]):
    """What humidity does along a solution.

    Parameters
    ----------
    solution : Solution     The run, with the heat of settling and drying water in it.
    dew_points : dict       Gas node -> dew point (times,), frost point below 0 degC. [K]
    surfaces : dict         Surface -> `SurfaceMoisture`.
    water : WaterBalance    Where the water went.
    warnings : tuple        What is assumed or left out, the balance of water where it does not close.
    """

    solution: Solution
    dew_points: Mapping[str, Array]
    surfaces: Mapping[str, SurfaceMoisture]
    water: WaterBalance
    warnings: tuple[str, ...] = ()

    @classmethod
    def of_run(cls, solution: Solution, parts: Sequence[FlatConductor], followed: Followed) -> Moisture:
        """Return what humidity does along a solution whose vapour was followed."""
        rows = zip(parts, followed.margin, followed.film, followed.latent, strict=True)
        surfaces = {c.path: SurfaceMoisture(c.path, c.gas, solution.times, *traces) for c, *traces in rows}
        water = followed.water
        open_ = (
            ()
            if water.closes
            else (f"water does not close: {water.residual:+.3g} kg of {water.handled:.3g} kg are missing. Give a shorter `every`",)
        )
        return cls(solution, followed.dew_points, surfaces, water, (*open_, *followed.remarks))

    _refusal = "no surface '{}' exchanges with a gas of known humidity."

    def _entries(self) -> Mapping[str, SurfaceMoisture]:
        """Return surface -> its moisture."""
        return self.surfaces

    def __str__(self) -> str:
        """Return the surfaces with their smallest margins, the closest first."""
        width = max((len(n) for n in self.surfaces), default=0)
        lines = []
        for s in sorted(self.surfaces.values(), key=lambda s: float(s.margin.min())):
            k = int(s.margin.argmin())
            if self.dew_points[s.gas][k] <= 0.0:
                lines.append(f"  {s.surface:<{width}}  no vapour, so no condensation")
                continue
            lines.append(
                f"  {s.surface:<{width}}  margin {s.margin[k]:+7.2f} K at {s.times[k] / 60:.4g} min over a dew point of "
                f"{self.dew_points[s.gas][k] - ICE_POINT:.2f} degC; condenses for {s.condensing / 60:.1f} min, "
                f"wet for {s.wet / 60:.1f} min, up to {1e3 * s.film.max():.3g} g/m^2"
            )
        traces = [self.solution[n] for n in self.solution.nodes]
        width = max(len(t.path) for t in traces)
        lines += [
            f"  {self.water}",
            "  temperatures with the heat of settling and drying water, at the values of the model; they have no bands",
        ]
        lines += [f"  {t.path:<{width}}  end {t.final:7.2f} degC   lowest {t.lowest:.2f}   highest {t.highest:.2f}" for t in traces]
        return "\n".join(["moisture", *(f"  warning: {w}" for w in (*self.warnings, *self.solution.warnings)), *lines])

    _axes_titles = ("time [s]", "margin to the dew point [K]")

    def _summary(self) -> str:
        """Return the surface with the least margin."""
        s = min(self.surfaces.values(), key=lambda s: float(s.margin.min()), default=None)
        return "no surfaces" if s is None else f"least margin to the dew point {s.margin.min():.2f} K at {s.surface}"

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the margin of every surface."""
        return [PlottedTrace(n, s.times, s.margin) for n, s in self.surfaces.items()]


def moisture(
    model: Model,
    scenario: Scenario,
    humidity: Mapping[str, Any] | None = None,
    volumes: Mapping[str, Volume] | None = None,
    *,
    every: str | float = 60.0,
    progress: Callable[[int, float], None] | None = None,
) -> Moisture:
    """Return a run with dew points, condensation margins, films and their latent heat.

    Vapour reaches a surface by the analogy of heat and mass transfer, from its coefficient of convection; of an effective one radiation is
    taken off where the surface's emissivity is known, else it is used whole and the film is an upper bound. The run is repeated with the
    heat that settling gives and drying takes until temperatures change no more.

    Parameters
    ----------
    model, scenario : Model, Scenario   What is run.
    humidity : dict                     Boundary that is a gas -> its relative humidity over liquid water, a number or a signal, where that
                                        is not what the scenario's environment states. [-]
    volumes : dict                      Gas node with vapour of its own -> `Volume`.
    every : str or float                Time between outputs, on which latent heat is a polygon. [s]
    progress : callable                 Told after each pass its number and how far temperatures still moved [K]; what it raises ends it.

    Raises
    ------
    ScenarioError   When a name is no gas of the model, a humidity does not exist, or latent heat and temperatures find no balance.
    """
    stated = {gas: e.humidity for gas, e in scenario.environment.items() if gas != "*" and e.humidity is not None}
    humidity = stated if humidity is None else {**stated, **humidity} if isinstance(humidity, Mapping) else {}
    if not (humidity or volumes):
        raise ScenarioError(
            "give the humidity by gas: gas -> relative humidity, such as {'air': 0.6}.", scenario.title, code="value.incomplete"
        )
    flat = compile_network(model, media=scenario.media()).flat
    gases = list(dict.fromkeys(c.gas for c in surfaces_in_gas(flat)))
    volumes_by_path = {flat.names.find(k): v for k, v in (volumes or {}).items()}
    open_air = {flat.names.find(k): signal(v, "1", f"humidity of {k}") for k, v in humidity.items()}
    for name, given_humidity in open_air.items():
        check_span(given_humidity, scenario.seconds, f"{scenario.title}, humidity of {name}")
    for name, volume in volumes_by_path.items():
        if volume.to and flat.names.find(volume.to) not in (*open_air, *volumes_by_path):
            raise ScenarioError(
                f"'{name}' exchanges gas with '{volume.to}', whose humidity is not given.", scenario.title, code="run.input-missing"
            )
    others = {flat.names.find(v.to) for v in volumes_by_path.values() if v.to}
    no_surface = "no surface exchanges heat with '{}' by convection."
    refuse_unknown((*volumes_by_path, *open_air), {*gases, *others}, scenario.title, no_surface, ScenarioError)
    parts = [c for c in surfaces_in_gas(flat) if c.gas in (*open_air, *volumes_by_path)]
    return _balanced(model, scenario, parts, open_air, volumes_by_path, every, progress)


def _balanced(
    model: Model,
    scenario: Scenario,
    parts: Sequence[FlatConductor],
    open_air: Mapping[str, Signal],
    volumes: Mapping[str, Volume],
    every: str | float,
    progress: Callable[[int, float], None] | None,
) -> Moisture:
    """Return the run in which the latent heat of `parts` and the temperatures agree; `open_air` and `volumes` are by canonical path.

    Raises
    ------
    ScenarioError   When they do not after `PASSES`.
    """
    wet, names = _with_latent(model, [c.path for c in parts])
    scenario = replace(scenario, environment={gas: replace(e, humidity=None) for gas, e in scenario.environment.items()})
    heats: dict[str, Signal] = {name: Constant(0.0) for name in names.values()}
    before: Array | None = None
    dry_heats: list[Array] = []
    changes: list[Array] = []
    for count in range(1, PASSES + 1):
        solution = simulate(wet, scenario.with_(loads=heats), every=every)
        followed = follow(solution, parts, open_air, volumes)
        dry_heats = [*dry_heats, np.array([heats[names[c.path]].at(solution.times) for c in parts])][-MAX_MIXED_PASSES:]
        changes = [*changes, followed.latent - dry_heats[-1]][-MAX_MIXED_PASSES:]
        moved = np.inf if before is None else float(np.abs(solution.temperatures - before).max())
        if progress is not None:
            progress(count, moved)
        remaining = 0.0  # how far temperatures would still move with the latent heat left, as they moved with its last change [K]
        if changes[-1].any():
            change = float(np.abs(dry_heats[-1] - dry_heats[-2]).max()) if len(dry_heats) > 1 else 0.0
            remaining = moved * float(np.abs(changes[-1]).max()) / change if change > 0.0 else np.inf
        if max(moved, remaining) < MAX_CHANGE_BETWEEN_PASSES:
            return Moisture.of_run(solution, parts, followed)
        before = solution.temperatures
        # where vapour gives a surface more heat than air does, whole steps overshoot
        mixed = anderson_step(dry_heats, changes, 1e-10)
        heats = {names[c.path]: TableSignal(solution.times, heat, after="hold") for c, heat in zip(parts, mixed, strict=True)}
    raise ScenarioError(
        f"latent heat and temperatures did not converge in {PASSES} passes. Give a shorter `every`.",
        scenario.title,
        code="run.did-not-finish",
    )


def _with_latent(model: Model, surfaces: list[str]) -> tuple[Model, dict[str, str]]:
    """Return the model with a load for the latent heat of every surface, and surface -> path of its load."""
    names = {}
    for path in surfaces:
        *parts, surface = path.split(".")
        model = _with_film_load(model, parts, surface)
        names[path] = f"{path}_latent"
    return model, names


def _with_film_load(model: Model, parts: list[str], surface: str) -> Model:
    """Return a model with a load of nothing into the node of a surface, at any depth."""
    if parts:
        inner = model.submodels[parts[0]]
        changed = replace(inner, model=_with_film_load(inner.model, parts[1:], surface))
        return replace(model, submodels={**model.submodels, parts[0]: changed})
    load = HeatLoad(model.surfaces[surface].of, {"power": Parameter.read("0 [W]")})
    return replace(model, loads={**model.loads, f"{surface}_latent": load})


def _time_below(times: Array, margin: Array) -> float:
    """Return how long a margin is below zero, straight between samples. [s]"""
    a, b, dt = margin[:-1], margin[1:], np.diff(times)
    low, high = np.minimum(a, b), np.maximum(a, b)
    part = np.where(high <= 0.0, low < 0.0, np.where(low >= 0.0, 0.0, -low / np.where(high > low, high - low, 1.0)))
    return float(part @ dt)


LEFT_OUT = (
    "the latent heat did not converge with the temperatures and was left out. During condensation the margins are then too small and "
    "the films too thick, and they dry too early. Give a shorter `every`"
)


def humid(
    model: Model,
    scenario: Scenario,
    humidity: Signal,
    gases: tuple[str, ...],
    solution: Solution,
    every: float,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Moisture, str]:
    """Return what humidity does along a run, and a remark where its latent heat was left out.

    Parameters
    ----------
    model, scenario : Model, Scenario   The whole run.
    humidity : Signal                   Relative humidity of the chamber. [-]
    gases : tuple of str                Boundaries that are the chamber.
    solution : Solution                 The same run without moisture.
    every : float                       Time between outputs. [s]
    progress : callable                 Told after each pass of the balance, as in `moisture`.

    Raises
    ------
    ScenarioError   When no surface exchanges heat with the chamber as with a gas.
    """
    parts = [c for c in surfaces_in_gas(compile_network(model, media=scenario.media()).flat) if c.gas in gases]
    if not parts:
        raise ScenarioError(
            f"no surface exchanges heat with {' or '.join(gases)} by convection, so no surface can condense water. Give the deck "
            "surfaces, or run the profile without humidity.",
            scenario.title,
            code="value.incomplete",
        )
    air = {c.gas: humidity for c in parts}
    try:
        return moisture(model, scenario, air, every=every, progress=progress), ""
    except (ScenarioError, SolverError):
        return Moisture.of_run(solution, parts, follow(solution, parts, air, {})), LEFT_OUT
