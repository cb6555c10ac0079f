"""Published numbers of thermal cycles."""

CYCLES = {"qualification": (27, 105.0, 1.4), "protoqualification": (20, 95.0, 1.4), "acceptance": (14, 85.0, 1.4)}
"""Level -> cycles [-], range from cold to hot [K], exponent [-] of SMC-S-016, 6.3.8.3."""
