"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.measure.looks import Look as Look
from thermid.measure.records import SensorCertificate as SensorCertificate, SensorPart as SensorPart
from thermid.qualify.steadiness import Forecast as Forecast, Stability as Stability, forecast as forecast, stability as stability
