"""A sensor as a part: the errors of its scale, its lag and noise, its range, its certificate, and what it adds to the node it sits on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from thermid.base.arguments import takes_objects
from thermid.base.errors import RecordError, errors_at, refuse_unknown
from thermid.base.units import TEMPERATURE, Kelvin, amount, end_of_range, kelvin

ICE: Final = Kelvin(273.15)
"""The ice point, about which a scale is held to turn where nothing else is said. [K]"""
BEAD: Final = 1e-6
"""Heat capacity of a sensor that lags but is said to have none: it takes no heat worth naming. [J/K]"""
LAG_OF_BARE_CAPACITY: Final = 1.0
"""Lag of a sensor that has a heat capacity and is said to have no lag. [s]"""
_NUMBERS: Final = {
    "gain_accuracy": "1",
    "gain_about": TEMPERATURE,
    "correlation_time": "s",
    "lag": "s",
    "lag_accuracy": "s",
    "capacitance": "J/K",
}
TEMPERATURES: Final = ("gain_about", "low", "high")
"""Fields of a sensor that are temperatures."""
KEYS: Final = (*_NUMBERS, "mass", "specific_heat", "lead", "certificate", "range")
"""What the table of a channel may say of its sensor beside noise, accuracy and resolution."""


@dataclass(frozen=True)
class SensorCertificate:
    """Result of a comparison of a sensor at one temperature, such as the ice point.

    Parameters
    ----------
    offset : float        Reading minus temperature. [K]
    uncertainty : float   Standard deviation of the offset. [K]
    at : temperature      Temperature of the comparison: ``td.celsius(0)`` or a text; kept in kelvin.
    date : str            Date of the comparison.
    """

    offset: float
    uncertainty: float
    at: Any = ICE
    date: str = ""

    def __post_init__(self) -> None:
        """Read numbers and texts with a unit, and the temperature."""
        for key in ("offset", "uncertainty"):
            object.__setattr__(self, key, amount(getattr(self, key), "K", f"certificate, {key}"))
        with errors_at("certificate, at"):
            object.__setattr__(self, "at", kelvin(self.at))

    @classmethod
    def read(cls, written: object, where: str) -> SensorCertificate:
        """Return a certificate from a table with offset, uncertainty, at and date; one that is made is returned as it is.

        Raises
        ------
        RecordError   When a key is unknown, offset or uncertainty is missing, or the uncertainty is not above zero.
        """
        if isinstance(written, cls):
            return written
        table = _table(written, ("offset", "uncertainty", "at", "date"), where)
        for key in ("offset", "uncertainty"):
            if key not in table:
                raise RecordError(f"a certificate needs its {key}, such as {key} = '0.1 [K]'.", where, code="value.incomplete")
        certificate = cls(
            amount(table["offset"], "K", f"{where}.offset"),
            amount(table["uncertainty"], "K", f"{where}.uncertainty"),
            Kelvin(amount(table["at"], TEMPERATURE, f"{where}.at") if "at" in table else ICE),
            str(table.get("date", "")),
        )
        if certificate.uncertainty <= 0:
            raise RecordError("its uncertainty must be above zero. Give that of the comparison.", where, code="value.outside-range")
        return certificate

    def combined(self, accuracy: float | None) -> tuple[float, float]:
        """Return mean and standard deviation of the constant error by the certificate (o, u) and the accuracy a of the type. [K]

        Mean w o and standard deviation sqrt(w) u with w = a^2 / (a^2 + u^2); w = 1 where no accuracy is known.
        """
        if accuracy is None:
            return self.offset, self.uncertainty
        share = accuracy**2 / (accuracy**2 + self.uncertainty**2)
        return share * self.offset, math.sqrt(share) * self.uncertainty


@dataclass(frozen=True)
class SensorPart:
    """Properties of a temperature sensor besides noise and constant error; zero or None where it does not have them.

    Parameters
    ----------
    gain_accuracy : float           Standard deviation of the relative error of its scale, or of a power meter's reading. [-]
    gain_about : temperature        Temperature at which that error is zero: ``td.celsius(0)`` or a text; kept in kelvin.
    correlation_time : float        Of its noise, whose correlation falls as ``exp(-t / time)``. [s]
    lag, lag_accuracy : float       Time constant with which it follows its node, and standard deviation of that. [s]
    capacitance : float             Heat capacity, which its node must warm too. [J/K]
    lead_conductance : float        Conductance of its leads. [W/K]
    lead_to : str                   Node or boundary to which they lose heat.
    low, high : temperature         Range, infinite where it is open; a reading at or beyond its ends says nothing. Kept in kelvin.
    """

    gain_accuracy: float = 0.0
    gain_about: Any = ICE
    correlation_time: float = 0.0
    lag: float = 0.0
    lag_accuracy: float = 0.0
    capacitance: float = 0.0
    lead_conductance: float = 0.0
    lead_to: str = ""
    low: Any = -math.inf
    high: Any = math.inf

    def __post_init__(self) -> None:
        """Read numbers and texts with a unit, and the temperatures."""
        for key, slot in {**_NUMBERS, "lead_conductance": "W/K"}.items():
            if key not in TEMPERATURES:
                object.__setattr__(self, key, amount(getattr(self, key), slot, f"sensor, {key}"))
        for key in TEMPERATURES:
            with errors_at(f"sensor, {key}"):
                object.__setattr__(self, key, end_of_range(getattr(self, key)))

    @classmethod
    @takes_objects
    def read(cls, table: Mapping[str, Any], where: str) -> SensorPart | None:
        """Return the sensor of a channel's table, or None where no key describes it.

        Raises
        ------
        RecordError   When a value is negative, or one of two keys is missing: a mass's specific heat, the end of a lead.
        """
        if not any(key in table for key in KEYS):
            return None
        numbers = {key: amount(table[key], slot, f"{where}, {key}") for key, slot in _NUMBERS.items() if key in table}
        if "gain_about" in numbers:
            numbers["gain_about"] = Kelvin(numbers["gain_about"])
        for key, value in numbers.items():
            if value < 0:
                raise RecordError(f"its {key} is {value:g}; it cannot be negative.", where, code="value.outside-range")
        if ("mass" in table) != ("specific_heat" in table):
            raise RecordError("a mass needs specific_heat too. Give both, or capacitance instead.", where, code="value.incomplete")
        if "mass" in table:
            if "capacitance" in table:
                raise RecordError(
                    "its heat capacity is given twice: as capacitance, and as mass and specific_heat.", where, code="value.incomplete"
                )
            mass = amount(table["mass"], "kg", f"{where}, mass")
            numbers["capacitance"] = mass * amount(table["specific_heat"], "J/(kg K)", f"{where}, specific_heat")
        if numbers.get("lag_accuracy") and not numbers.get("lag"):
            raise RecordError("a lag_accuracy needs the lag it refers to. Give lag = '20 [s]' too.", where, code="value.incomplete")
        low, high = _limits(table["range"], f"{where}, range") if "range" in table else (-math.inf, math.inf)
        conductance, to = _lead(table["lead"], f"{where}, lead") if "lead" in table else (0.0, "")
        if "certificate" in table and "gain_about" not in table:
            numbers["gain_about"] = SensorCertificate.read(table["certificate"], f"{where}, certificate").at
        return cls(**numbers, lead_conductance=conductance, lead_to=to, low=low, high=high)

    @property
    def touches(self) -> bool:
        """Whether it changes the temperatures of the model: it lags, stores heat, or leads heat away."""
        return bool(self.lag or self.capacitance or self.lead_conductance)

    @property
    def worth(self) -> dict[str, float]:
        """Its lag [s] and heat capacity [J/K] in a model, with small values for the one that is not given."""
        return {"lag": self.lag or LAG_OF_BARE_CAPACITY, "capacitance": self.capacitance or BEAD}


def _table(written: object, keys: tuple[str, ...], where: str) -> Mapping[str, Any]:
    """Return a table itself if it is one and has no other keys than these.

    Raises
    ------
    RecordError   When it is none, or a key is unknown.
    """
    if not isinstance(written, Mapping):
        raise RecordError(f"{written!r} is not a table. Give a table with {', '.join(keys)}.", where, code="value.wrong-kind")
    refuse_unknown(written, keys, where)
    return written


def _lead(written: object, where: str) -> tuple[float, str]:
    """Return the conductance [W/K] and the other end of the leads.

    Raises
    ------
    RecordError   When one is missing, or the conductance is negative.
    """
    table = _table(written, ("conductance", "to"), where)
    if set(table) != {"conductance", "to"}:
        raise RecordError(
            "a lead needs a conductance and the node to which it loses heat, such as to = 'air'.", where, code="value.incomplete"
        )
    conductance = amount(table["conductance"], "W/K", f"{where}.conductance")
    if conductance < 0:
        raise RecordError(f"its conductance is {conductance:g}; it cannot be negative.", where, code="value.outside-range")
    return conductance, str(table["to"])


def _limits(written: object, where: str) -> tuple[float, float]:
    """Return the lowest and highest reading of a range. [K]

    Raises
    ------
    RecordError   When it is no pair in order.
    """
    if not isinstance(written, list | tuple) or len(written) != 2:
        raise RecordError(
            f"{written!r} is not a range. Write the lowest and the highest reading, ['-55 [degC]', '125 [degC]'].",
            where,
            code="value.wrong-kind",
        )
    low, high = (Kelvin(amount(one, TEMPERATURE, where)) for one in written)
    if low >= high:
        raise RecordError(f"its lowest reading ({written[0]}) is not below its highest ({written[1]}).", where, code="value.outside-range")
    return low, high
