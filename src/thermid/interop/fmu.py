"""Functional mock-up units: written, read as models, fitted."""

from thermid.interop._fmu.as_model import fmu_model as fmu_model
from thermid.interop._fmu.export import to_fmu as to_fmu
