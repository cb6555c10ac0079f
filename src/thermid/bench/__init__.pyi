"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.measure import SensorCertificate as SensorCertificate
from thermid.measure import SensorPart as SensorPart
from thermid.reporting.pictures.look import Look as Look
from thermid.steadiness.forecast import Forecast as Forecast
from thermid.steadiness.forecast import forecast as forecast
from thermid.steadiness.stabilisation import Stability as Stability
from thermid.steadiness.stabilisation import stability as stability
