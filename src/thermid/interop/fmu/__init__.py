"""Functional mock-up units: a model in a scenario as a file that other simulation tools run; parameters of anybody's fitted to readings.

In: a model and a scenario. Out: an FMU of FMI 2.0 or 3.0, for model exchange and co-simulation, made without a compiler: the library beside the
kernel runs it, and the model is data. May import: as `interop`; FMPy, an optional package, runs FMUs that are calibrated.
"""

from thermid.interop.fmu.export import ExportedFmu, to_fmu

__all__ = ["ExportedFmu", "to_fmu"]
