"""The small tables: lookups, ranges, sources."""

from __future__ import annotations

import pytest

from by_code import raises_code
from thermid.base.errors import NameNotFoundError
from thermid.physics.materials import MATERIALS, material


def test_aluminium_of_the_document() -> None:
    found = material("aluminium 7075-T6")
    assert (found.density, found.specific_heat, found.conductivity) == (2810.0, 960.0, 130.0)


def test_air_is_that_of_the_correlations() -> None:
    from thermid.physics.air import AIR_300K, air_density, air_specific_heat

    found = material("air")
    assert found.conductivity == AIR_300K.conductivity
    assert found.density == pytest.approx(air_density(300.0), rel=0.02)
    assert found.specific_heat == pytest.approx(air_specific_heat(300.0), rel=1e-3)


def test_every_value_is_positive_and_has_a_source() -> None:
    for entry in MATERIALS.values():
        assert min(entry.density, entry.specific_heat, entry.conductivity) > 0
        assert entry.source.startswith("handbook: ")


def test_tables_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        MATERIALS["copper"] = material("air")  # type: ignore[index]


def test_misspelt_names_offer_the_nearest() -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'aluminum 7075-T6'.*'aluminium 7075-T6'"):
        material("aluminum 7075-T6")
