"""Published margins."""

SMC = "SMC-S-016"
COLDER = ((-70, 11), (-87, 10), (-105, 9), (-123, 8), (-141, 7), (-159, 6), (-177, 5), (-195, 4), (-213, 3), (-232, 2))
"""Lowest temperature [degC] down to which a flat margin [K] holds: SMC-S-016, Table 4.4-2."""
UNTESTED_MARGIN = 17.0
"""Margin where no balance test correlated the model: SMC-S-016, 4.4.2.1. [K]"""
HEATER_SHARE = 0.25
"""Power margin of an actively controlled heater: SMC-S-016, 4.4.2.2. [-]"""
