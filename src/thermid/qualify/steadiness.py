"""Rules of stability, and forecasts of running tests."""

from thermid.qualify._steadiness.forecast import FEWEST as FEWEST, Forecast as Forecast, forecast as forecast
from thermid.qualify._steadiness.stabilisation import Stability as Stability, stability as stability
