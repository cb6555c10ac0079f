"""Laws by their quantiles, moments of cut ones, and what a written spread means."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, ScenarioError, UnitError
from thermid.base.units import TEMPERATURE
from thermid.values._schema import _law
from thermid.values.store import Choice, Cut, Distribution, LogNormal, Normal, Shifted, Uniform, read_spread

SHARES = (np.arange(200_000) + 0.5) / 200_000
LAWS: list[Distribution] = [
    Normal(3.0, 0.4),
    LogNormal(2.0, 0.3),
    Uniform(-1.0, 4.0),
    Choice(5),
    Cut(Normal(1.0, 0.5), 0.8, np.inf),
    Cut(Normal(0.0, 2.0), -1.0, 3.0),
    Cut(LogNormal(1.0, 0.8), 0.0, 1.5),
    Cut(LogNormal(2.0, 0.3), 1.5, 2.2),
    Shifted(LogNormal(2.0, 0.3), -2.0),
]


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_moments_are_those_of_the_quantiles(law: Distribution) -> None:
    values = law.at(SHARES)
    assert law.mean == pytest.approx(values.mean(), abs=2e-4)
    assert law.variance == pytest.approx(values.var(), rel=2e-3)
    assert (np.diff(values) >= 0.0).all()


AIR = 293.15
MEANT = [
    ("0.5 [W]", "W", Normal(5.0, 0.5)),
    ({"sd": "500 [mW]"}, "W", Normal(5.0, 0.5)),
    ("10 [%]", "W", Normal(5.0, 0.5)),
    ({"sd": "10 [%]", "mean": "4 [W]"}, "W", Normal(4.0, 0.4)),
    ({"log_sd": 0.2}, "W", LogNormal(5.0, 0.2)),
    ({"log_sd": 0.2, "mean": "4 [W]"}, "W", LogNormal(4.0, 0.2)),
    ({"low": "4 [W]", "high": "10000 [mW]"}, "W", Uniform(4.0, 10.0)),
    ("2 [K]", TEMPERATURE, Normal(AIR, 2.0)),
    ({"sd": "2 [K]", "mean": "1 [K]"}, TEMPERATURE, Normal(AIR + 1.0, 2.0)),
    ({"sd": "2 [K]", "mean": "25 [degC]"}, TEMPERATURE, Normal(298.15, 2.0)),
    ({"low": "-5 [K]", "high": "5 [K]"}, TEMPERATURE, Uniform(AIR - 5.0, AIR + 5.0)),
    ({"low": "15 [degC]", "high": "77 [degF]"}, TEMPERATURE, Uniform(288.15, 298.15)),
    ({"low": "-5 [K]", "high": "5 [K]"}, "K", Uniform(-5.0, 5.0)),
]


@pytest.mark.parametrize(("given", "slot", "law"), MEANT)
def test_what_a_spread_means(given: Any, slot: str, law: Distribution) -> None:
    found = read_spread(given, slot, {"W": 5.0, TEMPERATURE: AIR, "K": 0.0}[slot], "here")
    assert type(found) is type(law)
    assert found.at(SHARES[::5000]) == pytest.approx(law.at(SHARES[::5000]), abs=1e-9)


def test_bounds_cut_normal_laws_and_range_is_between_them() -> None:
    assert read_spread("range", "W", 5.0, "here", bounds=(4.0, 7.0)) == Uniform(4.0, 7.0)
    cut = read_spread("50 [%]", "W", 5.0, "here", bounds=(4.0, np.inf))
    assert cut == Cut(Normal(5.0, 2.5), 4.0, np.inf)
    assert cut.at(SHARES).min() >= 4.0
    assert read_spread({"low": "4 [W]", "high": "7 [W]"}, "W", 5.0, "here", bounds=(4.0, 7.0)) == Uniform(4.0, 7.0)


@pytest.mark.parametrize(
    ("given", "slot", "error", "code", "match"),
    [
        ({"low": "15 [degC]", "high": "5 [K]"}, TEMPERATURE, ScenarioError, "value.excludes-another", ""),
        ({"low": "288 [K]", "high": "298 [K]"}, TEMPERATURE, ScenarioError, "value.outside-range", "100"),
        ({"sd": "1 [K]", "mean": "293 [K]"}, TEMPERATURE, ScenarioError, "value.outside-range", "100"),
        ("2 [%]", TEMPERATURE, ScenarioError, "value.without-effect", ""),
        ("2 [%]", "K", ScenarioError, "value.without-effect", ""),
        ({"log_sd": 0.1}, TEMPERATURE, ScenarioError, "value.without-effect", "log_sd"),
        ("1 [degC]", TEMPERATURE, UnitError, "unit.scale-for-difference", r"'\[degC\]'.*\[K\]"),
        ({"low": "15 [degC]", "high": "25 [degC]"}, "K", ScenarioError, "value.without-effect", r"\[K\].*\[degC\]"),
        ({"low": "1 [W]", "high": "5 [W]"}, "W", ScenarioError, "value.outside-range", r"1.*\[W\].*5.*\[W\].*2.*9"),
        ({"low": "8 [W]", "high": "3 [W]"}, "W", ScenarioError, "value.outside-range", ""),
        ({"sd": "0.1 [W]", "mean": "20 [W]"}, "W", ScenarioError, "value.outside-range", ""),
        ({"sd": "1 [W]", "log_sd": 0.1}, "W", ScenarioError, "name.unknown", 'log_sd.*"range"'),
        ({"lo": "1 [W]"}, "W", ScenarioError, "name.unknown", "'low'"),
        ({"low": "3 [W]"}, "W", ScenarioError, "name.unknown", 'log_sd.*"range"'),
        (7, "W", ScenarioError, "name.unknown", 'log_sd.*"range"'),
        ("-1 [W]", "W", ScenarioError, "value.outside-range", ""),
        ("1 [kg]", "W", UnitError, "unit.wrong-dimension", r"'\[kg\]'.*\[W\]"),
    ],
)
def test_what_a_spread_cannot_mean(given: Any, slot: str, error: type[Exception], code: str, match: str) -> None:
    bounds = (2.0, 9.0) if slot == "W" else (-np.inf, np.inf)
    with raises_code(code, error, match=match):
        read_spread(given, slot, {"W": 5.0, TEMPERATURE: AIR, "K": 0.0}[slot], "here", bounds=bounds)


def test_a_range_needs_bounds() -> None:
    with raises_code("value.incomplete", ScenarioError, match="'range'"):
        read_spread("range", "W", 5.0, "here", bounds=(0.0, np.inf))


@pytest.mark.parametrize("form", [{"x": 1}, ["normal"], 3, None, ""])
def test_a_law_whose_form_is_no_word_is_refused(form: object) -> None:
    """A table has no hash: a mutant of a values file ended in a TypeError."""
    with raises_code("value.wrong-kind", DeckError):
        _law({"form": form})
