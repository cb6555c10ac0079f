"""The grammars of sensor maps and heater programmes as pydantic models."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from thermid.base.errors import RecordError, ThermidError
from thermid.base.grammar import Amount, StrictTable


class CertificateTable(StrictTable):
    """What a certificate says of a sensor."""

    offset: Amount
    uncertainty: Amount
    at: Amount = None
    date: str = ""


class MappedTable(StrictTable):
    """A sensor by its ROM."""

    rom: str
    note: str = ""
    certificate: CertificateTable | None = None


class SensorMapFile(StrictTable):
    """Which ROM is which channel."""

    fault: ClassVar[type[ThermidError]] = RecordError

    sensors: Annotated[dict[str, MappedTable], Field(min_length=1)]


class DutyTable(StrictTable):
    """Duties from a time on."""

    at: Amount
    heater1: Amount = None
    heater2: Amount = None


class ProgrammeFile(StrictTable):
    """The heaters over time."""

    fault: ClassVar[type[ThermidError]] = RecordError

    title: str = ""
    steps: Annotated[list[DutyTable], Field(min_length=1)]
    end: Amount = None
