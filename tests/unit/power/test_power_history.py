"""What is refused before a history is looked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.errors import IdentificationError
from thermid.model.laws.signal import TableSignal
from unit.fit.bench import HTC, MASS, box, log, metered


def test_a_power_that_is_logged_is_not_looked_for() -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=21)
    with pytest.raises(IdentificationError, match=r"already gives this power. Leave it out"):
        td.inference.power_history(box(), metered(data, "heat", 5.0), "heat")


@pytest.mark.parametrize("known", [("0 [h]", "1 [h]", "5 [W]"), [("0 [h]", "5 [W]")]])
def test_a_stretch_has_three_parts(known: Any) -> None:
    data = log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=21)
    with pytest.raises(IdentificationError, match="give 'known' as a list of"):
        td.inference.power_history(box(), data, "heat", known=known)


def rising(every: str = "") -> td.inference.PowerHistory:
    """A power that rises within minutes, from a box whose deck is right."""
    times = np.linspace(0.0, 18000.0, 301)
    power = 2.0 + 3.0 / (1.0 + np.exp(-(times - 6000.0) / 300.0))
    data = log(box(), {}, {"T": "case"}, loads={"heat": TableSignal(times, power)}, noise=0.03, seed=4)
    return td.inference.power_history(box(), data, "heat", every=every)


def test_knots_too_far_apart_for_a_power_are_replaced_with_a_warning() -> None:
    found, fine = rising("30 [min]"), rising()
    assert "knots every 30 min left autocorrelated residuals," in found.warnings[0]
    assert found.times.size == fine.times.size
    assert found.power == pytest.approx(fine.power, abs=0.2)
    assert fine.warnings == ()


def test_wide_knots_that_do_are_kept() -> None:
    data = log(box(), {}, {"T": "case"}, noise=0.05, seed=4)
    found = td.inference.power_history(box(), data, "heat", every="30 [min]")
    assert found.times.size == 11
    assert found.warnings == ()


def test_unknowns_that_nothing_determines_are_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    data = log(box(), {}, {"T": "case"}, noise=0.05, seed=4)

    def singular(*_: Any, **__: Any) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("thermid.power.history.solved", singular)
    with pytest.raises(IdentificationError, match=r"do not determine .case\.mass.\. Give priors"):
        td.inference.power_history(box(), data, "heat", free=[MASS], known=[("0 [s]", "1 [h]", "4 [W]")])
