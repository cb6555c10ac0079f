"""A model meets measurements: comparison, calibration, identifiability, stages, validation."""
