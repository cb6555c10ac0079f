"""Where a run takes surfaces below the dew point of a gas whose humidity is stated, although no run has the heat that water gives there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from thermid.base.errors import quoted
from thermid.base.units import Array
from thermid.model.tree import Flat, FlatConductor, Standing
from thermid.physics.air import (
    dew_point,
    latent_heat,
    mass_transfer_coefficient,
    saturation_pressure,
    vapour_density,
    vapour_pressure,
)
from thermid.simulation._network.medium import VACUUM_LIMIT
from thermid.simulation._solver.wiring import Wiring

SMALLEST_EXCESS: Final = 0.1
"""What the gas would have to be warmer by to heat a surface as settling water does, from which that heat is missed. [K]"""


def surfaces_in_gas(flat: Flat) -> list[FlatConductor]:
    """Return the surfaces that exchange heat with a gas."""
    return [c for c in flat.conductors if c.kind in ("convection", "effective") and c.path in flat.surfaces]


def condensation(wiring: Wiring, kelvin: Callable[[str], Array], times: Array) -> Iterator[Standing]:
    """Yield that a run is not credible, where water settles on surfaces whose heat it leaves out; else nothing.

    The heat of what settles over that of convection is L (h_m / h) (c - c_s), with the analogy of heat and mass transfer
    (`thermid.physics.air.mass_transfer_coefficient`): the gas would have to be so much warmer.

    Parameters
    ----------
    wiring : Wiring         Network and scenario; humidities are those of its environment.
    kelvin : callable       Node -> its temperatures (times,). [K]
    times : array (times,)  [s]
    """
    network, environment = wiring.network, wiring.scenario.environment
    humidity = {network.find(gas): e.humidity for gas, e in environment.items() if gas != "*"}
    every = environment["*"].humidity if "*" in environment else None
    found: dict[str, tuple[float, float, str]] = {}
    for c in surfaces_in_gas(network.flat) if every is not None or any(h is not None for h in humidity.values()) else ():
        share = humidity.get(c.gas, every if c.gas in network.boundaries else None)
        if share is None:
            continue
        air, skin, pressure = kelvin(c.gas), kelvin(c.ends[0]), network.media.pressure(c.gas).at(times)
        vapour = np.minimum(vapour_pressure(air, share), pressure)
        lack = vapour_density(vapour, skin) - vapour_density(saturation_pressure(skin, "surface"), skin)
        speed = mass_transfer_coefficient(1.0, 0.5 * (air + skin), np.maximum(pressure, VACUUM_LIMIT))
        warmer = np.where(pressure > VACUUM_LIMIT, latent_heat(skin) * speed * lack, 0.0)
        if warmer[k := int(warmer.argmax())] >= SMALLEST_EXCESS:
            found[c.path] = float(warmer[k]), float(dew_point(vapour)[k] - skin[k]), c.gas
    if found:
        worst, (warmer_by, below, gas) = max(found.items(), key=lambda item: item[1][0])
        yield Standing(
            "not credible",
            f"water condenses on {quoted(sorted(found), 3)}, and this run leaves out its heat. '{worst}' is up to {below:.3g} K below the "
            f"dew point of '{gas}', where its heat equals that of a gas {warmer_by:.2g} K warmer. `thermid moisture` gives the "
            "temperatures with it",
        )
