"""Records of measured temperatures: a record and its channels, readers of logs, steadiness of readings. It knows nothing of models.

In: logs in the formats of laboratories, arrays. Out: a `Record`, a plain table; how steady readings are, with
the error of that.
May import: `measure.amounts`, `measure.readers`, `measure.record` and the foundation.
"""

from thermid.measure.readers.log_reader import read_plain as read_plain
from thermid.measure.readers.log_reader import read_record as read_record
from thermid.measure.record.channel import Channel as Channel
from thermid.measure.record.channel import Origin as Origin
from thermid.measure.record.channel import SampleTable as SampleTable
from thermid.measure.record.record import Record as Record
from thermid.measure.record.sensor import SensorCertificate as SensorCertificate
from thermid.measure.record.sensor import SensorPart as SensorPart
