"""The key of a job: every scenario has one, also one whose inputs are products and sums of signals."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.model.tree import Mixed, Signal, Sine, TableSignal, multiplied
from thermid.simulation._many.kept import digest
from thermid.simulation._network.irradiation import added

DAY, HOUR = Sine(295.0, 4.0, 86400.0), Sine(1.0, 0.1, 3600.0)


def _raised(values: np.ndarray, by: float) -> np.ndarray:
    return values + by


@pytest.mark.parametrize(
    "made",
    [
        lambda: multiplied(DAY, HOUR),
        lambda: added(DAY, HOUR),
        lambda: multiplied(DAY, HOUR).scaled(1.1),
        lambda: Mixed(partial(_raised, by=2.0), (DAY,)),
    ],
)
def test_products_and_sums_of_signals_have_a_key_of_their_own(made: Callable[[], Signal]) -> None:
    """Equal signals have one key, other ones another."""
    keys = [digest(td.Scenario(boundaries={"room": signal}, duration=10.0)) for signal in (made(), made(), DAY, added(DAY, DAY))]
    assert keys[0] == keys[1]
    assert len(set(keys)) == 3


def test_a_time_on_the_pad_has_a_key_of_its_own() -> None:
    """Its sky is worked out from an instant."""
    pytest.importorskip("pvlib")

    def pad(begin: str) -> td.Scenario:
        site = td.site.Site(5.2, -52.8, "0 [m]", -3.0)
        return td.site.pad_scenario(site, begin=begin, duration="1 [h]", air_temperature="30 [degC]", sky=False)

    first, again, later = (digest(pad(begin)) for begin in ("2026-03-21 06:00", "2026-03-21 06:00", "2026-03-21 07:00"))
    assert first == again != later


def test_a_job_runs_with_a_product_as_its_ambient(tmp_path: Path) -> None:
    """What a pad or an ascent gives: an ambient that follows from other signals."""
    deck = {"title": "one", "needs": ["room"], "nodes": {"case": {"capacitance": "10 [J/K]"}}}
    deck["conductors"] = {"out": {"kind": "conduction", "between": ["case", "room"], "conductance": "1 [W/K]"}}
    ambient = multiplied(TableSignal(np.array([0.0, 60.0]), np.array([290.0, 300.0])), Sine(1.0, 0.01, 30.0))
    scenario = td.Scenario(boundaries={"room": ambient}, start="293 [K]", duration=60.0)
    draws = {"out.conductance": np.linspace(0.8, 1.2, 16)}
    whole = td.ensemble(td.model_from_dict(deck), scenario, draws, quantiles=[0.5])
    kept = td.ensemble(td.model_from_dict(deck), scenario, draws, quantiles=[0.5], executor=td.simulation.KeptTasks(tmp_path))
    assert np.array_equal(whole.quantile("case", 0.5), kept.quantile("case", 0.5))
