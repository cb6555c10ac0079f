"""Joints that were fitted in air and are asked about without: how much of them may have been gas."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from thermid.identify.calibration import Calibration
from thermid.identify.values import FittedValues
from thermid.model.flat import FlatConductor
from thermid.network.network import Network, compile_network
from thermid.physics.gas import GASES, REFERENCE
from thermid.simulation.scenario import Scenario

__all__ = ["with_gas_in_joints"]

THINNEST: Final = 10e-6
"""Effective distance of machined surfaces that touch, from which the most that gas can carry follows. Yovanovich has 1.53 s (P/H)^-0.097,
3 to 15 micrometres for roughness s of 1 to 5 (Bejan and Kraus, Heat Transfer Handbook, 2003, section 4.16). [m]"""


def with_gas_in_joints(fit: Calibration, values: FittedValues, scenario: Scenario) -> tuple[FittedValues, str]:
    """Return fitted values whose contact conductances are as doubtful as the gas in them is, and a remark; unchanged where none is.

    A contact fitted in air is the sum of touching spots and of gas between. Without gas it is anything from what is fitted less what gas
    can carry to all of it, each as likely: a root mean square of that width over the root of 3 about the fitted value. A joint with a `gap`
    in its deck, or a record at low pressure, tells both apart and is left alone.

    Parameters
    ----------
    fit : Calibration       Whose records say what gas there was.
    values : FittedValues   Its values, or those of a split.
    scenario : Scenario     What is predicted.
    """
    network = compile_network(fit.fitted_model)
    media, seen = scenario.media(), [e.scenario.media() for e in fit.experiments or ()]
    doubtful: dict[str, str] = {}
    for c in network.flat.conductors:
        if c.kind != "contact" or "contact_conductance" not in c.fields or "gap" in c.fields:
            continue
        gases = _gases(network, c)
        entry = values.assignments.get(network.flat.parameters.literal_behind(c.fields["contact_conductance"]))
        if entry is None or not any(media.changed(g) for g in gases) or any(m.changed(g) for m in seen for g in gases):
            continue
        doubtful[entry.path] = c.path
    if not doubtful:
        return values, ""
    most, order, covariance = GASES["air"].k(REFERENCE) / THINNEST, list(values), values.covariance.copy()
    for path in doubtful:
        k, found = order.index(path), values[path]
        width = min(found.value, most) / math.sqrt(3.0)
        covariance[k, k] += (width / found.value if found.log else width) ** 2
    named, was, it = ", ".join(f"'{p}'" for p in doubtful), "was" if len(doubtful) == 1 else "were", "it" if len(doubtful) == 1 else "each"
    remark = (
        f"{named} {was} fitted in air, and how much of that is gas between the faces no record says: without gas {it} carries anything from"
        " what is fitted less that to all of it, which the bands hold. A record at low pressure, or a gap in the deck, would tell"
    )
    return replace(values, covariance=np.asarray(covariance)), remark


def _gases(network: Network, joint: FlatConductor) -> list[str]:
    """Return the gases about the parts that a joint holds together; every gas of the model where these have no surface."""
    skins = [c for c in network.flat.conductors if c.kind in ("convection", "effective")]
    parts = {end for c in network.flat.conductors if c.kind == "contact" and set(c.ends) & set(joint.ends) for end in c.ends}
    near = [c.gas for c in skins if set(c.ends) & parts]
    return list(dict.fromkeys(near or [c.gas for c in skins] or network.boundaries))
