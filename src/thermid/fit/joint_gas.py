"""Joints that were fitted in air and are asked about without: how much of them may have been gas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from thermid.model.tree.flat import FlatConductor
from thermid.network.medium import Media
from thermid.network.network import Network
from thermid.physics.gas import GASES, REFERENCE

THINNEST: Final = 10e-6
"""Effective distance of machined surfaces that touch, from which the most that gas can carry follows. Yovanovich has 1.53 s (P/H)^-0.097,
3 to 15 micrometres for roughness s of 1 to 5 (Bejan and Kraus, Heat Transfer Handbook, 2003, section 4.16). [m]"""
MOST: Final = float(GASES["air"].k(REFERENCE)) / THINNEST
"""The most that gas between faces can carry. [W/(m^2 K)]"""


def bare_contacts(network: Network) -> list[FlatConductor]:
    """Return the contacts whose deck does not say what of them is gas: touching spots and gas between in one conductance."""
    own = network.flat.conductors
    return [c for c in own if c.kind == "contact" and "contact_conductance" in c.fields and "gap" not in c.fields]


def separated(network: Network, media: Sequence[Media]) -> tuple[str, ...]:
    """Return the contacts of which some record, by the states of its gases, had another gas or pressure than air on the ground."""
    return tuple(c.path for c in bare_contacts(network) if any(m.changed(g) for m in media for g in _gases(network, c)))


def losing_gas(network: Network, media: Media, seen: Sequence[str]) -> list[FlatConductor]:
    """Return the contacts whose gas a scenario changes, less those (`seen`) of which a record had told both parts apart."""
    return [c for c in bare_contacts(network) if c.path not in seen and any(media.changed(g) for g in _gases(network, c))]


def _gases(network: Network, joint: FlatConductor) -> list[str]:
    """Return the gases about the parts that a joint holds together; every gas of the model where these have no surface."""
    skins = [c for c in network.flat.conductors if c.kind in ("convection", "effective")]
    parts = {end for c in network.flat.conductors if c.kind == "contact" and set(c.ends) & set(joint.ends) for end in c.ends}
    near = [c.gas for c in skins if set(c.ends) & parts]
    return list(dict.fromkeys(near or [c.gas for c in skins] or network.boundaries))
