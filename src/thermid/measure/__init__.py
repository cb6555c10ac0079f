"""Records of measured temperatures: channels, readers of logs, preparation. It knows nothing of models."""

from thermid.measure.channel import Channel, Origin
from thermid.measure.part import SensorCertificate, SensorPart
from thermid.measure.plain import read_plain
from thermid.measure.readers import read_record
from thermid.measure.record import Record, Table

__all__ = [
    "Channel",
    "Origin",
    "Record",
    "SensorCertificate",
    "SensorPart",
    "Table",
    "read_plain",
    "read_record",
]
