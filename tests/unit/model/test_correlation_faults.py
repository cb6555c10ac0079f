"""What is said of a correlation that was written wrongly: its own fields, not those of a power law."""

from __future__ import annotations

import pytest

import thermid as td


@pytest.mark.parametrize(
    ("htc", "message"),
    [
        (
            {"length": "25 [mm]", "orientation": "upward"},
            r"^x, surfaces\.s\.htc\.orientation: input should be 'vertical', 'up' or 'down'",
        ),
        ({"orientation": "up"}, r"^x, surfaces\.s\.htc\.length: is missing\.$"),
        ({"length": "25 [mm]", "coefficient": "1 [W/(m^2 K)]"}, r"^x, surfaces\.s\.htc\.coefficient: 'coefficient' is not a field here\.$"),
        ({"coefficient": "1 [W/(m^2 K)]"}, r"^x, surfaces\.s\.htc\.exponent: is missing\.$"),
    ],
)
def test_a_fault_names_the_form_that_was_meant(htc: dict[str, str], message: str) -> None:
    skin = {"of": "a", "to": "air", "area": "1 [cm^2]", "htc": htc}
    deck = {"title": "x", "needs": ["air"], "nodes": {"a": {"capacitance": "3 [J/K]"}}, "surfaces": {"s": skin}}
    with pytest.raises(td.ThermidError, match=message):
        td.model_from_dict(deck)
