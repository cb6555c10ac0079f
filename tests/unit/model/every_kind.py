"""A case of each kind of conductor. Tests that walk the kinds take it from here: they compile, draw, save and read it."""

from __future__ import annotations

from typing import Any

import numpy as np

from thermid.physics.conduction import spreading_resistance
from thermid.physics.convection import duct_nusselt, rectangle_nusselt
from thermid.physics.gas import MolecularGas


def _in_duct(area: float, diameter: float, length: float, flux: float, developed: float, fins: float = 0.0) -> float:
    """Return h (A + efficiency of fins of 15 x 1 mm and 180 W/(m K) times theirs) of air at 300 K. [W/K]"""
    air = MolecularGas.named("air", "")
    nusselt = duct_nusselt(flux * diameter / air.mu(300.0), air.at(300.0).prandtl, diameter / length, developed)
    htc = float(nusselt * air.k(300.0) / diameter)
    slope = 0.015 * (2.0 * htc / (180.0 * 0.001)) ** 0.5
    return htc * (area + fins * np.tanh(slope) / slope)


CASES: list[tuple[dict[str, Any], float]] = [
    ({"kind": "conduction", "conductivity": "130 [W/(m K)]", "area": "29.2 [cm^2]", "thickness": "5 [mm]"}, 130 * 0.00292 / 0.005),
    ({"kind": "contact", "contact_conductance": "246 [W/(m^2 K)]", "area": "29.2 [cm^2]"}, 246 * 0.00292),
    ({"kind": "convection", "htc": "6 [W/(m^2 K)]", "area": "0.1 [m^2]"}, 0.6),
    ({"kind": "convection", "htc": {"coefficient": "1.4 [W/(m^2 K)]", "exponent": 0.25}, "area": "0.1 [m^2]"}, 0.14),
    ({"kind": "effective", "effective_htc": "6 [W/(m^2 K)]", "area": "0.1 [m^2]"}, 0.6),
    ({"kind": "radiation", "emissivity": 0.3, "area": "0.1 [m^2]"}, 0.3 * 5.670374419e-8 * 0.1),
    ({"kind": "radiation", "exchange_factor": 0.2, "area": "0.1 [m^2]"}, 0.2 * 5.670374419e-8 * 0.1),
    ({"kind": "gas", "area": "0.1 [m^2]", "gap": "1 [mm]"}, 0.026358 * 0.1 / 0.001),
    ({"kind": "flow", "mass_flow": "0.5 [g/s]", "specific_heat": "1006 [J/(kg K)]"}, 0.503),
    ({"kind": "flow", "volume_flow": "30 [l/min]", "density": "1.2 [kg/m^3]", "specific_heat": "1006 [J/(kg K)]"}, 5e-4 * 1.2 * 1006),
    (
        {"kind": "lead", "conductivity": "390 [W/(m K)]", "length": "0.5 [m]", "cross_section": "0.25 [mm^2]", "count": 3},
        3 * 390 * 5e-7,
    ),
    (
        {
            "kind": "heat_pipe",
            "on_conductance": "5 [W/K]",
            "off_conductance": "0.1 [W/K]",
            "start_temperature": "40 [degC]",
            "transition": "4 [K]",
        },
        0.1,
    ),
    (
        {"kind": "duct", "diameter": "4 [mm]", "length": "20 [cm]", "mass_flow": "0.1 [g/s]", "count": 3},
        _in_duct(3 * np.pi * 0.004 * 0.2, 0.004, 0.2, 1e-4 / (3 * np.pi * 0.002**2), 3.66),
    ),
    (
        {"kind": "heat_sink", "width": "2 [mm]", "height": "15 [mm]", "length": "6 [cm]", "count": 12, "mass_flow": "1 [g/s]"}
        | {"fin_thickness": "1 [mm]", "fin_conductivity": "180 [W/(m K)]"},
        _in_duct(12 * 0.002 * 0.06, 0.06 / 17, 0.06, 1e-3 / (12 * 3e-5), rectangle_nusselt(2 / 15), 12 * 2 * 0.015 * 0.06),
    ),
    ({"kind": "bolted", "count": 4, "conductance_each": "0.3 [W/K]"}, 1.2),
    (
        {"kind": "wedge_lock", "count": 2, "length": "10 [cm]", "resistance_length": "0.005 [m K/W]"}
        | {"vacuum_resistance_length": "0.008 [m K/W]"},
        25.0,
    ),
    (
        {"kind": "spreading", "source_area": "1 [cm^2]", "plate_area": "25 [cm^2]", "thickness": "5 [mm]"}
        | {"conductivity": "180 [W/(m K)]", "htc": "1000 [W/(m^2 K)]"},
        1.0 / (spreading_resistance(180.0, 1e-4, 25e-4, 5e-3, 1000.0) + 5e-3 / (180.0 * 25e-4)),
    ),
    ({"kind": "table", "scale": 3, "table": {"points": [["0 [degC]", "1 [W/K]"], ["50 [degC]", "2 [W/K]"]]}}, 3.0),
]
"""Fields of a conductor, and the first coefficient of its law (of most a conductance). [W/K]"""


def firsts() -> dict[str, dict[str, Any]]:
    """Kind -> fields of its first case."""
    return {fields["kind"]: fields for fields, _ in reversed(CASES)}
