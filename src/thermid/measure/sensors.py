"""Sensors, their certificates, and the ice point."""

from thermid.measure._record.sensor import (
    ICE as ICE,
    TEMPERATURES as TEMPERATURES,
    SensorCertificate as SensorCertificate,
    SensorPart as SensorPart,
)
