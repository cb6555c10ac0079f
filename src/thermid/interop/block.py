"""The block of Fig. 3, a mass that convects and is heated, from the parameters of a script, each found by its unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thermid.errors import DeckError
from thermid.model.parts.parameter import Parameter
from thermid.units import Dimension, unit

ROLES = {
    "mass": "kg",
    "specific_heat": "J/(kg K)",
    "area": "m^2",
    "effective_htc": "W/(m^2 K)",
    "power": "W",
}
"""What the block needs, by unit. A coefficient of a script was tuned in air, so radiation is in it: `effective_htc`."""


def block(parameters: Mapping[str, Parameter], table: Mapping[str, Any], title: str, where: str) -> dict[str, Any]:
    """Return the deck of a block whose values are the parameters of a script.

    Parameters
    ----------
    parameters : dict   Name -> `Parameter`.
    table : dict        The same as the table ``[parameters]`` of a deck.
    title, where : str  The deck's title; the script's name, for messages.

    Raises
    ------
    DeckError   When none, or more than one, of the parameters has the unit of a role.
    """
    dimensions: dict[str, Dimension] = {}
    for name, given in parameters.items():
        dimensions[name] = given.expression.dimension(lambda n: dimensions[n])
    found = {role: _one(role, text, parameters, dimensions, where) for role, text in ROLES.items()}
    return {
        "title": title,
        "needs": ["air"],
        "offers": ["case", "skin"],
        "parameters": dict(table),
        "nodes": {"case": {"mass": found["mass"], "specific_heat": found["specific_heat"]}},
        "surfaces": {"skin": {"of": "case", "to": "air", "area": found["area"], "effective_htc": found["effective_htc"]}},
        "loads": {"heater": {"into": "case", "power": found["power"]}},
    }


def _one(role: str, text: str, parameters: Mapping[str, Parameter], dimensions: Mapping[str, Dimension], where: str) -> str:
    """Return the one name in the unit of a role; a name that another such name is made of gives way to it."""
    named = [n for n, d in dimensions.items() if d == unit(text).dimension]
    used = {n for name in named for n in parameters[name].expression.names}
    left = [n for n in named if n not in used]
    if not left:
        raise DeckError(
            f"nothing in the script is in [{text}], so the block has no {role}. Write the unit into the comment of its line, or import "
            "without the block and write the elements into the deck.",
            where,
        )
    if len(left) > 1:
        raise DeckError(
            f"{' and '.join(repr(n) for n in left)} are both in [{text}], so the block's {role} is open. Import without the block and "
            "write the elements into the deck.",
            where,
        )
    return left[0]
