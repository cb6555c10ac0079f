"""What is said of a correlation that was written wrongly: its own fields, not those of a power law."""

from __future__ import annotations

import pytest

import thermid as td
from by_code import raises_code


@pytest.mark.parametrize(
    ("htc", "code", "match"),
    [
        (
            {"length": "25 [mm]", "orientation": "upward"},
            "file.wrong-value",
            r"surfaces\.s\.htc\.orientation.*'vertical'.*'up'.*'down'",
        ),
        ({"orientation": "up"}, "file.key-missing", r"surfaces\.s\.htc\.length"),
        ({"length": "25 [mm]", "coefficient": "1 [W/(m^2 K)]"}, "file.unknown-key", r"surfaces\.s\.htc\.coefficient.*'coefficient'"),
        ({"coefficient": "1 [W/(m^2 K)]"}, "file.key-missing", r"surfaces\.s\.htc\.exponent"),
    ],
)
def test_a_fault_names_the_form_that_was_meant(htc: dict[str, str], code: str, match: str) -> None:
    skin = {"of": "a", "to": "air", "area": "1 [cm^2]", "htc": htc}
    deck = {"title": "x", "needs": ["air"], "nodes": {"a": {"capacitance": "3 [J/K]"}}, "surfaces": {"s": skin}}
    with raises_code(code, match=match):
        td.model_from_dict(deck)
