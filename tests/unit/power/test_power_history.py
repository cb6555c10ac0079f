"""What is refused before a history is looked for."""

from __future__ import annotations

from typing import Any

import pytest

import thermid as td
from thermid.errors import IdentificationError
from unit.fit.bench import HTC, box, log, metered


def test_a_power_that_is_logged_is_not_looked_for() -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=21)
    with pytest.raises(IdentificationError, match=r"already gives this power. Leave it out"):
        td.power_history(box(), metered(data, "heat", 5.0), "heat")


@pytest.mark.parametrize("known", [("0 [h]", "1 [h]", "5 [W]"), [("0 [h]", "5 [W]")]])
def test_a_stretch_has_three_parts(known: Any) -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=21)
    with pytest.raises(IdentificationError, match="is a list of stretches"):
        td.power_history(box(), data, "heat", known=known)
