"""The table of materials: lookups, ranges, sources, and the figures that follow from one another."""

from __future__ import annotations

import pytest

from by_code import raises_code
from thermid.base.errors import NameNotFoundError
from thermid.physics.materials import Material

ROWS = list(Material.table().values())


def test_aluminium_of_the_document() -> None:
    found = Material.named("aluminium 7075-T6")
    assert (found.density, found.specific_heat, found.conductivity) == (2810.0, 960.0, 130.0)


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ("Aluminium 6061", "aluminium 6061-T6"),
        ("aluminum 6061-T6", "aluminium 6061-T6"),
        ("AL6061", "aluminium 6061-T6"),
        ("Al 7075 T6", "aluminium 7075-T6"),
        ("EN AW-5052", "aluminium 5052"),
        ("AISI 304", "stainless steel 304"),
        ("SS316", "stainless steel 316"),
        ("Ti-6Al-4V", "titanium Ti-6Al-4V"),
        ("FR4 4 layers", "FR4, 4 layers"),
        ("Copper", "copper"),
    ],
)
def test_the_only_material_with_all_words_is_meant(asked: str, found: str) -> None:
    assert Material.named(asked).name == found


@pytest.mark.parametrize(
    ("asked", "match"),
    [
        ("aluminium", "'aluminium'.*'aluminium, pure'.*'aluminium 2024-T6'"),
        ("6061-T4", "'6061-T4'.*'aluminium 6061-T6'.*'thermid example --materials'"),
        ("steel 316-T6", "'steel 316-T6'.*'steel, plain carbon'.*'steel, AISI 1010'"),
        ("stainless", "'stainless'.*'stainless steel 302'.*'stainless steel 304'"),
        ("", "''.*'thermid example --materials'"),
    ],
)
def test_no_or_several_materials_are_refused_with_names(asked: str, match: str) -> None:
    with raises_code("name.unknown", NameNotFoundError, match=match):
        Material.named(asked)


def test_air_is_that_of_the_correlations() -> None:
    from thermid.physics.air import AIR_300K, air_density, air_specific_heat

    found = Material.named("air")
    assert found.conductivity == AIR_300K.conductivity
    assert found.density == pytest.approx(air_density(300.0), rel=0.02)
    assert found.specific_heat == pytest.approx(air_specific_heat(300.0), rel=1e-3)


def test_every_row_is_whole() -> None:
    """Types, a source in full, a range of both properties, and what was read to check it."""
    assert len(ROWS) >= 60
    for entry in ROWS:
        assert all(isinstance(v, int | float) and v > 0 for v in (entry.density, entry.specific_heat, entry.conductivity)), entry
        assert len(entry.source) > 10, entry
        assert set(entry.range) == {"specific_heat", "conductivity"}, entry
        assert all(0.0 < share <= 0.5 for share in entry.range.values()), entry
        assert entry.basis.startswith(f"catalogue: {entry.name}; "), entry
        assert entry.read, entry


def test_conductivity_is_the_printed_diffusivity_times_density_and_specific_heat() -> None:
    """k = a rho c, to the half digit of the coarsest of the four printed figures: 3.1 and 3.4 e-6 m2/s have two digits."""
    printed = [m for m in ROWS if m.diffusivity]
    assert len(printed) >= 40
    for entry in printed:
        assert entry.conductivity == pytest.approx(entry.diffusivity * entry.density * entry.specific_heat, rel=0.02), entry


def test_rows_are_within_what_solids_have() -> None:
    """Metals to plastics and foams; what is denser than 800 kg/m3 stores between 1 and 4.2 MJ/(m3 K)."""
    for entry in (m for m in ROWS if m.name != "air"):
        assert 100.0 < entry.specific_heat < 2500.0, entry
        assert 0.02 < entry.conductivity < 2500.0, entry
        assert entry.density < 800.0 or 1.0e6 <= entry.density * entry.specific_heat < 4.2e6, entry


def test_points_over_temperature_pass_through_the_figure_at_300_kelvin_and_are_worth_having() -> None:
    """Half of the change from 300 to 400 K is what a constant misses at 350 K."""
    for entry in (m for m in ROWS if m.over):
        at = entry.over["temperature"]
        assert list(at) == sorted(at), entry
        changes = []
        for name, values in ((k, v) for k, v in entry.over.items() if k != "temperature"):
            assert values[at.index(300)] == getattr(entry, name), entry
            changes.append(0.5 * abs(values[at.index(400)] / values[at.index(300)] - 1.0))
        assert max(changes) > 0.05, entry


def test_boards_are_their_layers_side_by_side() -> None:
    """1.6 mm with layers of 35 um: a fifth of each outer face is copper, inner layers are whole; along the board k = sum k t / t."""
    for layers in (1, 2, 4, 6, 8):
        copper, resin, board = Material.named("copper"), Material.named("FR4"), Material.named(f"FR4, {layers} layer{'s' * (layers > 1)}")
        share = 35e-6 * (0.2 * min(layers, 2) + max(layers - 2, 0)) / 1.6e-3
        density = share * copper.density + (1.0 - share) * resin.density
        stored = share * copper.density * copper.specific_heat + (1.0 - share) * resin.density * resin.specific_heat
        assert board.density == pytest.approx(density, rel=1e-3)
        assert board.specific_heat == pytest.approx(stored / density, rel=1e-3)
        assert board.conductivity == pytest.approx(share * copper.conductivity + (1.0 - share) * resin.conductivity, rel=1e-3)


def test_tables_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        Material.table()["copper"] = Material.named("air")  # type: ignore[index]


def test_misspelt_names_offer_the_nearest() -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'aluminum 7075-T7'.*'aluminium 7075-T6'"):
        Material.named("aluminum 7075-T7")
    with raises_code("name.unknown", NameNotFoundError, match="'FR4, 3 layers'.*'FR4, 4 layers'"):
        Material.named("FR4, 3 layers")
