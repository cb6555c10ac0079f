"""Published numbers of the room: planets, formats of weather files, the coefficients of an integrator."""

import numpy as np

PLANET_FIGURES = {
    "mercury": (2.4397e6, 2.2032e13, 9083.0),
    "venus": (6.0518e6, 3.24859e14, 2601.0),
    "earth": (6.371e6, 3.986004418e14, 1361.0),
    "moon": (1.7374e6, 4.9048695e12, 1361.0),
    "mars": (3.3895e6, 4.282837e13, 586.0),
    "jupiter": (6.9911e7, 1.26686534e17, 50.3),
    "saturn": (5.8232e7, 3.7931187e16, 14.8),
}
"""Mean radius [m], attraction [m^3/s^2] and solar flux [W/m^2]: NASA planetary fact sheets, from memory; that at the earth also Kopp and
Lean, Geophys. Res. Lett. 38 (2011) L01706: 1360.8 +- 0.5 W/m^2."""
EPW = {
    "temp_air": ("dry_bulb", "degC", 99.9),
    "temp_dew": ("dew_point", "degC", 99.9),
    "relative_humidity": ("humidity", "%", 999.0),
    "atmospheric_pressure": ("pressure", "Pa", 999999.0),
    "wind_speed": ("wind", "m/s", 999.0),
    "wind_direction": ("wind_direction", "1", 999.0),
    "dni": ("direct_normal", "W/m^2", 9999.0),
    "dhi": ("diffuse", "W/m^2", 9999.0),
    "ghi": ("global", "W/m^2", 9999.0),
    "ghi_infrared": ("infrared", "W/m^2", 9999.0),
    "total_sky_cover": ("cloud", "dm/m", 99.0),
    "liquid_precipitation_depth": ("rain", "mm/h", 999.0),
}
"""Column of an EnergyPlus file, as pvlib calls it -> quantity, its unit (clouds in tenths), and what stands where a value is missing."""
TMY3_MISSING = -9900.0
TMY3 = {
    "temp_air": ("dry_bulb", "degC", TMY3_MISSING),
    "temp_dew": ("dew_point", "degC", TMY3_MISSING),
    "relative_humidity": ("humidity", "%", TMY3_MISSING),
    "pressure": ("pressure", "hPa", TMY3_MISSING),
    "wind_speed": ("wind", "m/s", TMY3_MISSING),
    "wind_direction": ("wind_direction", "1", TMY3_MISSING),
    "dni": ("direct_normal", "W/m^2", TMY3_MISSING),
    "dhi": ("diffuse", "W/m^2", TMY3_MISSING),
    "ghi": ("global", "W/m^2", TMY3_MISSING),
    "TotCld (tenths)": ("cloud", "dm/m", TMY3_MISSING),
    "Lprecip depth (mm)": ("rain", "mm/h", TMY3_MISSING),
}
"""The same of TMY3 files."""
_ROOT = 6.0**0.5
RADAU_C = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
RADAU_A = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        [(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9],
    ]
)
"""Nodes and weights of Radau IIA of order 5."""
SPACE = 2.725
"""Of the microwave background: Fixsen, Astrophys. J. 707 (2009) 916. [K]"""
_GUIDE = "SpaceX Rideshare Payload User's Guide, October 2022"
LIMITS_OF_LAUNCHERS = {
    "pressure decay": (2800.0, "read", f"{_GUIDE}, 3.3.8: no faster, but for brief periods"),
    "brief pressure decay": (4500.0, "read", f"{_GUIDE}, 3.3.8: no faster at any time"),
    "time of brief decay": (5.0, "read", f"{_GUIDE}, 3.3.8: no longer in all"),
    "molecular heating": (3500.0, "read", f"{_GUIDE}, 3.3.10: at fairing separation"),
    "gentle molecular heating": (1135.0, "memory", "a common target for fairing release, as launchers' guides are quoted"),
}
"""Name -> limit [Pa/s, Pa/s, s, W/m^2, W/m^2], how it is known, where it stands."""
