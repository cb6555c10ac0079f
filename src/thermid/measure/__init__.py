"""Records of measured temperatures: a record and its channels, readers of logs, steadiness of readings. It knows nothing of models.

In: logs in the formats of laboratories, arrays, weather files. Out: a `Record`, a plain table, a `Weather`; how steady readings are, with
the error of that.
May import: `measure.amounts`, `measure.readers`, `measure.record` and the foundation.
"""

from thermid.measure.readers.log_reader import read_record
from thermid.measure.readers.plain import read_plain
from thermid.measure.record.channel import Channel, Origin
from thermid.measure.record.record import Record, Table
from thermid.measure.record.sensor import SensorCertificate, SensorPart
from thermid.measure.weather import Weather, read_weather

__all__ = [
    "Channel",
    "Origin",
    "Record",
    "SensorCertificate",
    "SensorPart",
    "Table",
    "Weather",
    "read_plain",
    "read_record",
    "read_weather",
]
