"""Functional mock-up units: a model in a scenario as a file that other simulation tools run.

In: a model and a scenario. Out: an FMU of FMI 2.0 or 3.0, for model exchange and co-simulation, made without a compiler: the library beside
the kernel runs it, and the model is data. May import: as `interop`.
"""

from thermid.interop.fmu.description import FmuVariable
from thermid.interop.fmu.export import ExportedFmu, to_fmu

__all__ = ["ExportedFmu", "FmuVariable", "to_fmu"]
