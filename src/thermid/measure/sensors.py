"""Sensors, their certificates, and the ice point."""

from thermid.measure._record.sensor import ICE as ICE, SensorCertificate as SensorCertificate, SensorPart as SensorPart
