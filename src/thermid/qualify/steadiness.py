"""Rules of stability, and forecasts of running tests."""

from thermid.qualify._steadiness.forecast import MIN_FORECAST_READINGS as MIN_FORECAST_READINGS, Forecast as Forecast, forecast as forecast
from thermid.qualify._steadiness.stabilisation import Stability as Stability, stability as stability
