"""Records of measured temperatures: channels, readers of logs, preparation. It knows nothing of models."""

from thermid.measure.channel import Channel as Channel
from thermid.measure.channel import Origin as Origin
from thermid.measure.part import SensorCertificate as SensorCertificate
from thermid.measure.part import SensorPart as SensorPart
from thermid.measure.plain import read_plain as read_plain
from thermid.measure.readers import read_record as read_record
from thermid.measure.record import Record as Record
from thermid.measure.record import Table as Table
from thermid.measure.weather import Weather as Weather
from thermid.measure.weather import read_weather as read_weather
