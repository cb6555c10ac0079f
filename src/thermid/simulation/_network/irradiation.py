"""What falls on outer surfaces, sun, planet, sky and stream, and the loads that they take from it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from thermid.base.errors import DeckError, NameNotFoundError, ScenarioError, errors_at, refuse_first, refuse_unknown
from thermid.base.results import Shown
from thermid.base.units import STEFAN_BOLTZMANN, TEMPERATURE, Array, amount
from thermid.model.tree import Constant, Facing, Flat, FlatLoad, FlatSurface, Mixed, Signal, signal

Given = Mapping[str, Signal]

MAX_IRRADIATION = 5e4
"""Radiation beyond this is a mistake of units: the sun has 1361. [W/m^2]"""
SOLAR = ("direct", "diffuse", "albedo", "total")


@dataclass(frozen=True)
class Irradiation(Shown):
    """What falls on one surface, per area of it; texts with units, tables or signals.

    Parameters
    ----------
    direct, diffuse, albedo : Signal    Solar radiation on its plane from the sun, the sky and by reflection. [W/m^2]
    total : Signal                      All of it, where the parts are not known. [W/m^2]
    infrared : Signal                   Long-wave radiation beside that of the surroundings that it radiates to. [W/m^2]
    sky : Signal                        Temperature of a sky that takes the place of part of those surroundings. [K]
    sky_view : float                    The share that is sky. [-]
    stream : Signal                     Heat that a stream of molecules brings, as it is absorbed. [W/m^2]
    """

    direct: Any = None
    diffuse: Any = None
    albedo: Any = None
    total: Any = None
    infrared: Any = None
    sky: Any = None
    sky_view: Any = None
    stream: Any = None

    def __post_init__(self) -> None:
        """Turn texts into signals, and refuse radiation that does not exist."""
        for name in (*SOLAR, "infrared", "stream", "sky"):
            written = getattr(self, name)
            if written is None:
                continue
            course = signal(written, TEMPERATURE if name == "sky" else "W/m^2", f"irradiation, {name}")
            object.__setattr__(self, name, course)
            low, high = course.bounds
            if name != "infrared" and low < 0.0:
                what = "a temperature below absolute zero" if name == "sky" else f"{name} radiation of {low:.4g} W/m^2"
                raise ScenarioError(f"{what} is not possible.", "irradiation", code="value.outside-range")
            if high > MAX_IRRADIATION:
                raise ScenarioError(
                    f"{name} reaches {high:.4g}; the sun has 1361 W/m^2 above the atmosphere. Check the unit.",
                    "irradiation",
                    code="value.outside-range",
                )
        view = None if self.sky_view is None else amount(self.sky_view, "1", "irradiation, sky_view")
        object.__setattr__(self, "sky_view", view)
        refuse_first(
            "irradiation",
            (
                self.total is not None and (self.direct is not None or self.diffuse is not None),
                "total is the sum of direct and diffuse. Give either the sum or the parts.",
                "value.excludes-another",
            ),
            (
                (self.sky is None) != (view is None),
                "give the temperature of the sky and sky_view, the view factor to it.",
                "value.incomplete",
            ),
            (view is not None and not 0.0 <= view <= 1.0, f"sky_view is {view}. Give 0 to 1.", "value.outside-range"),
            error=ScenarioError,
        )

    def signals(self) -> dict[str, Signal]:
        """Return the signals by the names of their fields, without those that are not given."""
        return {name: course for name in (*SOLAR, "infrared", "sky", "stream") if (course := getattr(self, name)) is not None}

    def mapped(self, law: Callable[[Signal], Signal]) -> Irradiation:
        """Return the radiation with each of its signals replaced by law(signal)."""
        return replace(self, **{name: law(course) for name, course in self.signals().items()})

    def sun(self, facing: Facing | None) -> Signal | None:
        """Return the solar radiation on the surface, the sum of its parts; None without any. `facing` plays no part here. [W/m^2]"""
        parts = [getattr(self, name) for name in SOLAR if getattr(self, name) is not None]
        return added(*parts) if parts else None

    def longwave(self, facing: Facing | None, around: Signal | None) -> Signal | None:
        """Return the long-wave radiation beside that of the surroundings: `infrared`, and what a sky sends more than they would. [W/m^2]

        `around` is the temperature of the surroundings [K], which a sky needs; None where nothing is given.
        """
        parts: list[Signal] = [self.infrared] if self.infrared is not None else []
        if self.sky is not None:
            if around is None:
                raise ScenarioError(
                    "a sky replaces surroundings with a given temperature. Here the surroundings are a node of the "
                    "model; leave the sky out.",
                    code="value.excludes-another",
                )
            parts.append(Mixed(SkyExchange(float(self.sky_view or 0.0)), (self.sky, around)))
        return added(*parts) if parts else None


class Sky(ABC):
    """Sun and sky over a place: falls on every surface outdoors as the surface faces it; `air` is the boundary that is the open air."""

    air: str

    @property
    @abstractmethod
    def radiates(self) -> bool:
        """Whether its long-wave radiation is counted."""

    @abstractmethod
    def signals(self) -> dict[str, Signal]:
        """Return its signals by name."""

    @abstractmethod
    def mapped(self, law: Callable[[Signal], Signal]) -> Sky:
        """Return the sky with each of its signals replaced by law(signal)."""

    @abstractmethod
    def shifted(self, seconds: float) -> Sky:
        """Return the sky of a run that begins later. [s]"""

    @abstractmethod
    def sun(self, facing: Facing | None) -> Signal | None:
        """Return the solar radiation on a surface, or None. [W/m^2]"""

    @abstractmethod
    def longwave(self, facing: Facing | None, around: Signal | None) -> Signal | None:
        """Return the long-wave radiation beside that of the surroundings, or None. [W/m^2]"""


@dataclass(frozen=True)
class SkyExchange:
    """Radiation of a sky less that of the surroundings whose place it takes, for a `share` of the view that is sky [-]."""

    share: float

    def __call__(self, sky: Array, around: Array) -> Array:
        """Return share sigma (T_sky^4 - T_around^4) (times,). [W/m^2]"""
        return self.share * STEFAN_BOLTZMANN * (sky**4 - around**4)


def absorbers(flat: Flat, irradiation: Mapping[str, Irradiation | Sky]) -> tuple[FlatLoad, ...]:
    """Return the loads that surfaces take from what falls on them; `*` stands for every surface outdoors.

    Raises
    ------
    NameNotFoundError   When there is no such surface.
    DeckError           When a surface under the sun has no absorptance, or under a sky no emissivity or facing.
    """
    canonical = flat.names.model.canonical
    sources: dict[str, Irradiation | Sky] = {}
    if "*" in irradiation:
        sky = irradiation["*"]
        if not isinstance(sky, Sky):
            raise ScenarioError(
                "radiation on '*' must be an open sky. For a single plane give the name of its surface instead of '*'.",
                "irradiation",
                code="value.wrong-kind",
            )
        sources = dict.fromkeys(_outdoors(flat, sky), sky)
    for raw, one in irradiation.items():
        if raw != "*":
            path = canonical(raw)
            refuse_unknown([path], flat.faces, "irradiation", f"no surface '{raw}'.", NameNotFoundError)
            sources[path] = one
    return tuple(load for path, one in sources.items() for load in _loads(path, flat.faces[path], one))


def _outdoors(flat: Flat, sky: Sky) -> list[str]:
    """Return the paths of the outdoor surfaces: those with `facing`, and those that exchange heat with the sky's air node."""
    air = flat.names.find(sky.air, "sun")
    out = [path for path, face in flat.faces.items() if face.facing is not None or face.to == air]
    if not out:
        raise ScenarioError(
            f"no surface is outdoors: none has facing, and none exchanges heat with '{sky.air}'. Give facing = {{ tilt = 90 }} to one.",
            "sun",
            code="value.incomplete",
        )
    for path in out:
        if flat.faces[path].facing is None:
            raise DeckError(
                f"'{path}' is outdoors but has no orientation. Give facing = {{ tilt = 90 }}, and azimuth for a plane.",
                flat.faces[path].where,
                code="value.incomplete",
            )
    return out


def _loads(path: str, face: FlatSurface, source: Irradiation | Sky) -> list[FlatLoad]:
    """Return the loads of one surface: solar by absorptance, long-wave by emissivity, a stream as it is."""
    if isinstance(source, Sky):
        outdoors, stream, solar, wave = True, None, True, source.radiates
    else:
        outdoors, stream = False, source.stream
        solar, wave = any(getattr(source, name) is not None for name in SOLAR), source.infrared is not None or source.sky is not None
    if solar and "absorptance" not in face.fields:
        raise DeckError(
            f"'{path}' is in the sun but has no absorptance. Give one, or 0 if no sun can reach it.", face.where, code="value.incomplete"
        )
    out = _sunlit(path, face, partial(_sun, source, face.facing)) if solar else []
    if wave and not (outdoors and face.sees != face.to):
        refuse_first(
            face.where,
            (
                "emissivity" not in face.fields,
                f"'{path}' receives long-wave radiation but has no emissivity. Give an emissivity or a finish, or leave the sky out.",
                "value.incomplete",
            ),
            (
                not face.sees,
                f"'{path}' is a face of an enclosure, which computes its long-wave radiation already. Give a sky to outer surfaces only.",
                "value.contradicts",
            ),
        )
        out.append(_load(path, face, "longwave", "emissivity", partial(_longwave, source, face, path)))
    if stream is not None:
        out.append(_load(path, face, "stream", "", partial(_stream, stream)))
    return out


def _sunlit(path: str, face: FlatSurface, flux: Any) -> list[FlatLoad]:
    """Return what the sun on one surface heats: itself; in an enclosure also those on which falls what is reflected there."""
    load = _load(path, face, "sun", "absorptance", flux)
    if face.enclosed is None:
        return [load]
    fields, out = face.enclosed.fields(), []
    for name, node, share in face.enclosed.targets():
        label = load.path if share.to == share.first else f"{load.path}.{name}"
        out.append(replace(load, path=label, node=node, sensor=node, fields=fields, takes=(), recipe=share))
    return out


def _load(path: str, face: FlatSurface, kind: str, share: str, flux: Any) -> FlatLoad:
    """Return the load ``<path>.<kind>`` of a surface: its area, times the field `share` unless that is empty, times a flux [W/m^2]."""
    fields = {name: face.fields[name] for name in (share, "area") if name}
    by = face.controls if share == "emissivity" else ()
    return FlatLoad(f"{path}.{kind}", face.node, face.node, fields, None, face.where, face.takes, flux, by)


def _sun(source: Irradiation | Sky, facing: Facing | None, boundaries: Given) -> Signal:
    """Return the solar flux on a surface, zero where there is none; boundaries play no part. [W/m^2]"""
    return source.sun(facing) or Constant(0.0)


def _stream(flux: Signal, boundaries: Given) -> Signal:
    """Return the flux of a stream of molecules as it is; boundaries play no part. [W/m^2]"""
    return flux


def _longwave(source: Irradiation | Sky, face: FlatSurface, path: str, boundaries: Given) -> Signal:
    """Return the long-wave flux on a surface, by the temperature of the boundary that it sees; zero where there is none. [W/m^2]"""
    with errors_at(f"irradiation.{path}"):
        return source.longwave(face.facing, boundaries.get(face.sees)) or Constant(0.0)


def added(*terms: Signal) -> Signal:
    """Return the sum of signals: of constants a constant, of constants and one signal that signal raised, else a `Mixed`."""
    number = math.fsum(s.value for s in terms if isinstance(s, Constant))
    rest = [s for s in terms if not isinstance(s, Constant)]
    if not rest:
        return Constant(number)
    whole: Signal = rest[0] if len(rest) == 1 else Mixed(_sum, tuple(rest))
    return whole if number == 0.0 else whole.raised(number)


def _sum(*values: Array) -> Array:
    """Return the sum (times,) of values (times,) of several signals."""
    return np.asarray(np.sum(values, axis=0))
