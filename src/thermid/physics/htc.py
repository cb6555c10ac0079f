"""The coefficient that a test shows beside the one that correlations give, and what their difference can and cannot mean."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from numbers import Real
from typing import Any

import numpy as np

from thermid.base.errors import CodedText, ThermidError, ThermidWarning, refuse_first, refuse_unknown
from thermid.base.results import Result
from thermid.base.units import TEMPERATURE, amount
from thermid.physics._number import Number
from thermid.physics.air import Gas, dry_air
from thermid.physics.convection import effective_htc, effective_htc_error
from thermid.physics.plates import (
    horizontal_plate_down_htc,
    horizontal_plate_up_htc,
    rayleigh_number,
    vertical_plate_htc,
    vertical_plate_htc_all,
)
from thermid.physics.radiation import linearised_htc

LAMINAR_LIMIT = 1e9
CORRELATION_ERROR = 0.15
"""What a correlation of natural convection can promise, relative, one sigma: Incropera, 6th ed., Section 9.6, speaks of 10 to 20 %. [-]"""
SETTLED = (0.98, 0.99, 0.999)
"""Parts of the rise that people call settled. [-]"""

ERRORS = {"sensor": ("K", 0.5), "power": ("W", 0.0), "area": ("m^2", 0.0), "drift": ("K", 0.0)}
"""What may err in a settled test -> unit and size of its error where none is stated."""
BIOT_LIMIT = 0.1
"""Above it the temperature inside a part is not uniform; Incropera, 6th ed., Section 5.2. [-]"""


@dataclass(frozen=True)
class HtcEstimate:
    """The coefficient of one correlation.

    Parameters
    ----------
    name : str          What it is for.
    htc : float         Coefficient. [W/(m^2 K)]
    rayleigh : float    Rayleigh number; NaN for a mean over faces. [-]
    """

    name: str
    htc: float
    rayleigh: float = math.nan


@dataclass(frozen=True)
class Settling:
    """The time constant that mass and coefficient make beside the one that a settling time means.

    Parameters
    ----------
    from_mass : float               m c / (h A). [s]
    from_data : tuple of 3          Time constant if the time given is that of 98, 99 and 99.9 % of the rise. [s]
    differs : bool                  Whether the first lies outside the others.
    """

    from_mass: float
    from_data: tuple[float, float, float]

    @property
    def differs(self) -> bool:
        """Whether m c / (h A) lies outside all time constants that the usual meanings of settled (98, 99 and 99.9 %) give."""
        return not min(self.from_data) <= self.from_mass <= max(self.from_data)

    @property
    def ratio(self) -> float:
        """Time constant from the data, by 99 % of the rise, over that from the mass: above 1 for a test slower than m c / (h A). [-]"""
        return self.from_data[1] / self.from_mass


@dataclass(frozen=True)
class HtcComparison(Result):
    """The effective and the theoretical coefficient of a part, side by side.

    Parameters
    ----------
    effective : float                   Q / (A dT). [W/(m^2 K)]
    error : float                       Its standard error from sensors, power and area. [W/(m^2 K)]
    error_drift : float                 What a room that drifted adds, as a bound. [W/(m^2 K)]
    correlations : tuple                Coefficients by correlation.
    rise : float                        Surface less ambient. [K]
    remarks : tuple of str              What the difference can and cannot mean, and what lies outside the ranges.
    radiation : float or None           Coefficient of radiation at the emissivity given. [W/(m^2 K)]
    biot : dict                         Part -> Biot number at the effective and at the theoretical coefficient. [-]
    settling : Settling or None         Time constants, where mass and a settling time are given.
    """

    effective: float
    error: float
    error_drift: float
    correlations: tuple[HtcEstimate, ...]
    rise: float
    remarks: tuple[str, ...]
    radiation: float | None = None
    biot: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    settling: Settling | None = None

    @property
    def theoretical(self) -> float:
        """The coefficient of the whole box where its shape is known, of the vertical plate otherwise. [W/(m^2 K)]"""
        return self.correlations[-1].htc

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        settling = self.settling
        return {
            "effective": self.effective,
            "error": self.error,
            "error_drift": self.error_drift,
            "theoretical": self.theoretical,
            "correlations": [asdict(c) for c in self.correlations],
            "radiation": self.radiation,
            "biot": {n: list(b) for n, b in self.biot.items()},
            "settling": None
            if settling is None
            else {"from_mass_s": settling.from_mass, "from_data_s": list(settling.from_data), "differs": settling.differs},
            "remarks": list(self.remarks),
        }

    def __str__(self) -> str:
        """A line for each number, then the remarks."""
        drift = f", and +- {self.error_drift:.2f} from the drift of the ambient" if self.error_drift else ""
        lines = [f"effective    {self.effective:8.3f} W/(m^2 K)   +- {self.error:.2f} from sensors, power and area{drift}"]
        for c in self.correlations:
            ra = "" if math.isnan(c.rayleigh) else f"   Ra {c.rayleigh:.4g}"
            lines.append(f"theoretical  {c.htc:8.3f} W/(m^2 K)   {c.name}{ra}")
        if self.radiation is not None:
            lines.append(f"radiation    {self.radiation:8.3f} W/(m^2 K)   at the emissivity given")
        for part, (one, other) in self.biot.items():
            lines.append(f"Biot number  {one:8.2g} at the effective, {other:.2g} at the theoretical coefficient   {part}")
        if self.settling is not None:
            low, middle, high = (f"{s:.4g}" for s in sorted(self.settling.from_data))
            lines.append(
                f"time constant{self.settling.from_mass:8.1f} s   m c/(h A); "
                f"the settling time corresponds to {middle} s ({low} to {high} s for 99.9 to 98 %)"
            )
        return "\n".join([*lines, *(f"remark: {r}" for r in self.remarks)])


def compare_htc(
    power: str | float,
    area: str | float,
    surface: str | float,
    ambient: str | float,
    height: str | float,
    *,
    box: tuple[str | float, str | float] | None = None,
    air: Gas | tuple[float, float, float] | None = None,
    errors: Mapping[str, str | float] | None = None,
    emissivity: float | None = None,
    parts: Mapping[str, tuple[str | float, str | float]] | None = None,
    capacitance: str | float | None = None,
    settled_after: str | float | None = None,
) -> HtcComparison:
    """Return the effective coefficient of a settled test beside the theoretical one, with what their difference can and cannot mean.

    Numbers may be texts with units, ``"2.168 [W]"``; bare ones are SI, and no temperature is bare.

    Parameters
    ----------
    power, area : str or float          Heat through the surface [W] and its area [m^2].
    surface, ambient : temperature      Settled, ``"35.938 [degC]"`` or ``td.celsius(35.938)``.
    height : str or float               Height of the vertical faces. [m]
    box : tuple of 2                    Length and width of a box of that height; adds horizontal faces and the mean over all. [m]
    air : Gas or tuple of 3             Conductivity [W/(m K)], kinematic viscosity [m^2/s], Prandtl number [-]; by default dry air.
    errors : dict                       Standard errors: ``sensor`` of each of both temperatures (0.5 if not given) [K], ``power`` [W],
                                        ``area`` [m^2]; and ``drift``, the variation of the ambient, reported apart [K].
    emissivity : float                  Of the surface, large surroundings at ambient temperature. [-]
    parts : dict                        Name -> (length of the heat's path inside [m], conductivity [W/(m K)]), for Biot numbers.
    capacitance : str or float          Mass times specific heat. [J/K]
    settled_after : str or float        Time after which the test looked settled; with `capacitance`. [s]

    Warns
    -----
    ThermidWarning   Above Ra = 1e9, where the laminar law ends.

    Raises
    ------
    ThermidError    When area, height or temperature difference make no coefficient.

    References
    ----------
    Churchill and Chu, DOI 10.1016/0017-9310(75)90243-4; McAdams, in Incropera, 6th ed., Section 9.6.2; source document, Eq. 7.
    """
    q, a, hot, cold, tall = _checked_inputs(power, area, surface, ambient, height)
    refuse_unknown(errors or {}, ERRORS, "compare_htc, errors")
    sensor, of_power, of_area, drift = (amount((errors or {}).get(n, size), u, f"errors.{n}") for n, (u, size) in ERRORS.items())
    effective = effective_htc(q, a, rise := hot - cold)
    error = effective_htc_error(q, a, rise, power_error=of_power, area_error=of_area, rise_error=sensor * math.sqrt(2.0))
    faces = tuple(amount(x, "m", "box") for x in box) if box is not None else None
    correlations, remarks = _correlations(hot, cold, tall, faces, _gas(air, (hot + cold) / 2))
    for text in remarks:
        warnings.warn(ThermidWarning(text), stacklevel=3)
    radiation = None if emissivity is None else float(linearised_htc(emissivity, hot, cold))
    remarks += _box_remark(a, tall, *faces) if faces is not None else []
    remarks += _meaning(effective, error, correlations[-1].htc, radiation, q, a, rise)
    biot = _biot(parts or {}, effective, correlations[-1].htc, remarks)
    settling = _settling(capacitance, settled_after, effective * a, remarks)
    return HtcComparison(effective, error, effective * drift / abs(rise), correlations, rise, tuple(remarks), radiation, biot, settling)


def _gas(air: Gas | tuple[float, float, float] | None, temperature: float) -> Gas:
    """Return the air of a comparison: as given, or dry air at a temperature [K]."""
    if isinstance(air, tuple) and (len(air) != 3 or not all(isinstance(x, Real) and x > 0.0 for x in air)):
        raise ThermidError(
            "conductivity, viscosity and Prandtl number of the air must be three numbers above zero.", "air", code="value.outside-range"
        )
    if air is not None and not isinstance(air, tuple | Gas):
        raise ThermidError(f"it takes (conductivity, viscosity, Prandtl number), not {air!r:.60}.", "air", code="value.wrong-kind")
    return Gas(*air) if isinstance(air, tuple) else dry_air(temperature) if air is None else air


def _biot(
    parts: Mapping[str, tuple[str | float, str | float]], effective: float, theoretical: float, remarks: list[str]
) -> dict[str, tuple[float, float]]:
    """Return part -> Biot numbers h L / k at the effective and the theoretical coefficient; add a remark for each part above 0.1."""
    out = {}
    for name, (length, conductivity) in parts.items():
        path = amount(length, "m", name) / amount(conductivity, "W/(m K)", name)
        out[name] = effective * path, theoretical * path
        remarks += [text for text in (biot_warning(max(out[name]), f"'{name}'"),) if text]
    return out


def _checked_inputs(
    power: str | float, area: str | float, surface: str | float, ambient: str | float, height: str | float
) -> tuple[float, float, float, float, float]:
    """Return power [W], area [m^2], surface and ambient temperature [K] and height [m]; refuse those that make no coefficient."""
    q, a, tall = amount(power, "W", "power"), amount(area, "m^2", "area"), amount(height, "m", "height")
    hot, cold = amount(surface, TEMPERATURE, "surface"), amount(ambient, TEMPERATURE, "ambient")
    refuse_first(
        "compare_htc",
        (not (a > 0 and tall > 0), "a coefficient needs an area and a height above zero.", "value.outside-range"),
        (
            not q * (hot - cold) > 0,
            f"{q:g} W and a surface {hot - cold:+.4g} K from its ambient are inconsistent: heat flows to the colder side. Check for "
            "exchanged temperatures, and the sign of the power.",
            "value.contradicts",
        ),
        error=ThermidError,
    )
    return q, a, hot, cold, tall


def _correlations(
    hot: float, cold: float, height: float, box: tuple[float, ...] | None, air: Gas
) -> tuple[tuple[HtcEstimate, ...], list[str]]:
    """Return the coefficients of the faces at surface and ambient temperatures [K], the one to compare with last, and their warnings.

    The vertical plate alone, or with a `box` (length, width) [m] also its horizontal faces and the mean over all six, weighted by area.
    """
    mean = (hot + cold) / 2
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ThermidWarning)
        rayleigh = rayleigh_number(hot - cold, height, mean, air)
        side = HtcEstimate("vertical plate, laminar (Churchill and Chu; Eq. 7)", vertical_plate_htc(hot, cold, height, air), rayleigh)
        out = [side]
        if rayleigh > LAMINAR_LIMIT:
            turbulent = vertical_plate_htc_all(hot, cold, height, air)
            out.append(HtcEstimate("vertical plate, laminar and turbulent (Churchill and Chu)", turbulent, rayleigh))
        if box is not None:
            length, width = box
            across = length * width / (2 * (length + width))
            flat = rayleigh_number(hot - cold, across, mean, air)
            # the upper face of a hot box faces up; of a cold one, it is its lower face that behaves so
            one = HtcEstimate("horizontal plate, free side (McAdams)", horizontal_plate_up_htc(hot, cold, across, air), flat)
            other = HtcEstimate("horizontal plate, capped side (McAdams)", horizontal_plate_down_htc(hot, cold, across, air), flat)
            walls, lid = 2 * (length + width) * height, length * width
            whole = (walls * out[-1].htc + lid * (one.htc + other.htc)) / (walls + 2 * lid)
            out += [one, other, HtcEstimate("whole box, mean over its six faces", whole)]
    return tuple(out), [CodedText(str(w.message), w.message.code) for w in caught if isinstance(w.message, ThermidWarning)]


def _box_remark(area: float, height: float, length: float, width: float) -> list[str]:
    """Return a remark where the area given [m^2] differs by more than 2 % from the outside of the box given [m]; else nothing."""
    outside = 2 * (length * width + height * (length + width))
    if abs(outside - area) <= 0.02 * area:
        return []
    return [
        CodedText(
            f"the box has {outside:.6g} m^2 outside but the given area is {area:.6g} m^2, so they include different faces. Correct one of "
            "them",
            "htc.area-of-other-faces",
        )
    ]


def _meaning(effective: float, error: float, theoretical: float, radiation: float | None, q: float, a: float, rise: float) -> list[str]:
    """Return remarks on effective less expected coefficient: what their difference can mean, judged by two standard errors.

    Expected is theoretical plus radiation; the standard error is sqrt(error^2 + (0.15 theoretical)^2).
    """
    doubt = math.hypot(error, CORRELATION_ERROR * theoretical)
    expected = theoretical + (radiation or 0.0)
    what = "convection and radiation" if radiation is not None else "convection alone"
    if abs(effective - expected) <= 2 * doubt:
        return [
            CodedText(
                f"effective and theoretical coefficient ({what}) differ by {effective - expected:+.2f} W/(m^2 K), within two standard "
                f"errors of {doubt:.2f}, so the test cannot distinguish them",
                "htc.agrees",
            )
        ]
    if effective > expected:
        radiates = "radiation (0.6 to 5.3 W/(m^2 K) at room temperature for emissivities of 0.1 to 0.85), " if radiation is None else ""
        text = (
            f"the effective coefficient lies {effective - expected:.2f} W/(m^2 K) above {what}. Possible causes: {radiates}"
            "heat through mounts and leads, moving air, an area taken too small, a power too large, or a sensor in a cool place"
        )
        return [CodedText(text, "htc.differs")]
    return [
        CodedText(
            f"the effective coefficient lies {expected - effective:.2f} W/(m^2 K) below {what}. Radiation and heat through mounts would "
            "raise it. Resistance between source and surface cannot lower it, because the heat through an outer surface is h A dT. Check "
            "area, power and sensor positions",
            "htc.differs",
        ),
        CodedText(
            f"to agree with the correlation, the area would need to be {100 * effective / expected:.0f} % of {a:.6g} m^2 (check for faces "
            f"counted twice or inside), or the power {abs(expected * a * rise):.3g} W instead of {abs(q):.4g} W, or the mean surface "
            f"about {abs(rise) * (1 - effective / expected):.1f} K nearer to the ambient than the sensor (check for a hot spot)",
            "htc.differs",
        ),
    ]


def _settling(capacitance: str | float | None, after: str | float | None, conductance: float, remarks: list[str]) -> Settling | None:
    """Return the time constants C / (h A) and t / -ln(1 - s) for s = 98, 99 and 99.9 %, None where an input is missing.

    Adds a remark where the first lies outside the others. `conductance` is h A. [W/K]
    """
    if capacitance is None or after is None:
        return None
    heat, time = amount(capacitance, "J/K", "capacitance"), amount(after, "s", "settled_after")
    if not (heat > 0 and time > 0):
        raise ThermidError("a time constant needs a capacitance and a settling time above zero.", "compare_htc", code="value.outside-range")
    first, middle, last = (time / -math.log(1.0 - part) for part in SETTLED)
    settling = Settling(heat / conductance, (first, middle, last))
    if settling.differs:
        word = "slower" if settling.ratio > 1 else "faster"
        slower = "additional mass, a drifting ambient, or a final approach below the sensor resolution"
        text = (
            f"the settling time was {settling.ratio:.2g} times that expected from m c/(h A): {time / 3600:.3g} h against "
            f"{settling.from_mass * -math.log(1.0 - SETTLED[1]) / 3600:.3g} h to 99 %. Possible causes of a {word} test: "
            f"{slower if settling.ratio > 1 else 'less mass than given, or a test that ended before steady state'}"
        )
        remarks.append(CodedText(text, "htc.differs"))
    return settling


def biot_warning(biot: float, name: str = "this part") -> str:
    """Sentence for a Biot number above the limit, or an empty text.

    Parameters
    ----------
    biot : float   Biot number. [-]
    name : str     Part that the sentence names.

    References
    ----------
    Incropera, 6th ed., Section 5.2.

    Examples
    --------
    >>> biot_warning(0.4, "'fog.coil'")
    "The Biot number of 'fog.coil' is 0.4, above 0.1: its inside is not at one temperature. Split it into more nodes."
    >>> biot_warning(0.0019)
    ''
    """
    if not biot > BIOT_LIMIT:
        return ""
    text = f"The Biot number of {name} is {biot:.2g}, above {BIOT_LIMIT:g}: its inside is not at one temperature. Split it into more nodes."
    return CodedText(text, "physics.not-one-temperature")


def biot_number(htc: Number, length: Number, conductivity: Number) -> Number:
    """Biot number h L / k [-].

    Parameters
    ----------
    htc : float or array            Coefficient at the surface. [W/(m^2 K)]
    length : float or array         Path of the heat inside: half a wall, or volume over area. [m]
    conductivity : float or array   Conductivity of the part. [W/(m K)]

    Warns
    -----
    ThermidWarning   Above 0.1.

    References
    ----------
    Incropera, 6th ed., Section 5.2. (The source document prints h L K^-1; the divisor is the conductivity.)

    Examples
    --------
    The aluminium case of the EleGFO box of the source document at its theoretical coefficient:

    >>> round(biot_number(6.798, 0.02492, 130.0), 4)
    0.0013
    """
    biot = htc * length / conductivity
    text = biot_warning(float(np.max(biot)))
    if text:
        warnings.warn(ThermidWarning(text), stacklevel=2)
    return biot
