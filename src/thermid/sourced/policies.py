"""Rules for margins beyond a predicted temperature, each number with its source and mark."""

from __future__ import annotations

from dataclasses import dataclass

from thermid.physics.constants import ICE_POINT
from thermid.sourced.marks import Figure

SMC = "SMC-S-016"
COLDER = ((-70, 11), (-87, 10), (-105, 9), (-123, 8), (-141, 7), (-159, 6), (-177, 5), (-195, 4), (-213, 3), (-232, 2))
"""Lowest temperature [degC] down to which a flat margin [K] holds: SMC-S-016, Table 4.4-2."""


HEATER = Figure(0.25, "read", f"{SMC}, 4.4.2.2")


@dataclass(frozen=True)
class Policy:
    """What is added to a predicted temperature.

    Parameters
    ----------
    name : str
    acceptance, qualification : Figure      Margins beyond predicted and uncertainty. [K]
    level : float                           Probability that the model's uncertainty stands for, both sides. [-]
    heater : Figure                         Power margin of an actively controlled heater. [-]
    """

    name: str
    acceptance: Figure
    qualification: Figure
    level: float = 0.95
    heater: Figure = HEATER


POLICIES = {
    p.name: p
    for p in (
        Policy(SMC, Figure(0.0, "read", f"{SMC}, 6.3.8.3"), Figure(10.0, "read", f"{SMC}, 6.3.8.3: qualification 10 C beyond acceptance")),
        Policy(
            f"{SMC}, protoqualification",
            Figure(0.0, "read", f"{SMC}, 6.3.8.3"),
            Figure(5.0, "read", f"{SMC}, 6.3.8.3: protoqualification 5 C"),
        ),
        Policy("ECSS", Figure(5.0, "memory", "ECSS-E-ST-31C"), Figure(5.0, "memory", "ECSS-E-ST-31C")),
    )
}
"""Named rules; a project may give its own."""


def flat_margin(kelvin: float, tested: bool) -> Figure:
    """Return the flat thermal uncertainty margin of passive hardware. [K]

    SMC-S-016, 4.4.2.1 and Table 4.4-2: 11 C where a balance test correlated the model, 17 C where none did; less for colder hardware.

    >>> flat_margin(300.0, True).value, flat_margin(300.0, False).value, flat_margin(153.0, True).value
    (11.0, 17.0, 8.0)
    """
    if not tested:
        return Figure(17.0, "read", f"{SMC}, 4.4.2.1")
    celsius = kelvin - ICE_POINT
    found = next((m for low, m in COLDER if celsius >= low), 1)
    return Figure(float(found), "read", f"{SMC}, 4.4.2.1, Table 4.4-2")
