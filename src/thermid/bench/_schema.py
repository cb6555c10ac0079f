"""The grammars of sensor maps and heater programmes as pydantic models."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from thermid.base.errors import RecordError, ThermidError
from thermid.base.grammar import Amount, StrictTable


class CertificateTable(StrictTable):
    """Certificate of a sensor in a map: offset and uncertainty, at which temperature and when they were found."""

    offset: Amount
    uncertainty: Amount
    at: Amount = None
    date: str = ""


class MappedTable(StrictTable):
    """A sensor of a map: its ROM, its certificate, and where it is glued."""

    rom: str
    note: str = ""
    certificate: CertificateTable | None = None


class SensorMapFile(StrictTable):
    """A sensor map: name of a channel -> its sensor."""

    fault: ClassVar[type[ThermidError]] = RecordError

    sensors: Annotated[dict[str, MappedTable], Field(min_length=1)]


class DutyTable(StrictTable):
    """One step of a programme: duties of the heaters from a time on."""

    at: Amount
    heater1: Amount = None
    heater2: Amount = None


class ProgrammeFile(StrictTable):
    """A heater programme."""

    fault: ClassVar[type[ThermidError]] = RecordError

    title: str = ""
    steps: Annotated[list[DutyTable], Field(min_length=1)]
    end: Amount = None
