"""Published rules of stability."""

from thermid.base.units import HOUR

STABILITY = (
    ("3 C/h", 3.0 / HOUR, 0.0, "SMC-S-016, 6.3.8.3 and 8.3.8.3", "read"),
    ("0.2 C/h over 5 h", 0.2 / HOUR, 5.0 * HOUR, "SMC-S-016, 8.3.7: less than 1 C over 5 h", "read"),
    ("0.05 C/h over 6 h", 0.05 / HOUR, 6.0 * HOUR, "GEVS, thermal balance", "secondary"),
    ("1 K/h", 1.0 / HOUR, 0.0, "ECSS-E-ST-10-03C", "memory"),
    ("1 K over 4 h", 0.25 / HOUR, 4.0 * HOUR, "ECSS-E-ST-10-03C, thermal balance", "memory"),
    ("2 C/h", 2.0 / HOUR, 0.0, "MIL-STD-810H, part one", "memory"),
    ("stored 2 %", 0.02, 0.0, "GSFC-STD-7000B, thermal balance", "memory", True),
    ("stored 5 %", 0.05, 0.0, "GSFC-STD-7000B, thermal balance", "memory", True),
)
"""Name, rate [K/s], window [s], source and mark of a rule; whether it is of the heat that is stored, rate then a share of the power [-]."""
