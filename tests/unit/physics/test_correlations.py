"""Correlations against textbooks, the library they are named after, and the test truths of that library."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from thermid.base.units import ATMOSPHERE
from thermid.physics.correlations import CORRELATIONS, correlation, nusselt_table
from thermid.physics.gas import GASES, knudsen_number, mean_free_path

REFERENCES = Path(__file__).parents[4] / "shared" / "data" / "reference_values"
TRUTHS = REFERENCES / "correlation_test_truths.csv"
SERVE = (
    "Nu_vertical_plate_",
    "Nu_horizontal_plate_McAdams",
    "Nu_horizontal_plate_VDI",
    "Nu_horizontal_plate_Rohsenow",
    "Nu_horizontal_cylinder_",
)


def test_the_fire_screen_of_incropera() -> None:
    """Example 9.2, 6th ed., page 574: Ra 1.813e9, Nu 147."""
    assert CORRELATIONS["Nu_vertical_plate_Churchill"].nusselt(1.813e9, 0.690, True) == pytest.approx(147, abs=0.5)


def test_the_plate_of_cengel() -> None:
    """Problem 9-41, 2nd ed.: Ra 411500, 13.68 on top and 6.838 below."""
    plate = CORRELATIONS["Nu_horizontal_plate_McAdams"].nusselt
    assert plate(411500.0, 0.7268, True) == pytest.approx(13.68, abs=0.005)
    assert plate(411500.0, 0.7268, False) == pytest.approx(6.838, abs=0.0005)


def test_a_sphere_in_gas_at_rest() -> None:
    """Nu_D = 2 exactly, which on the root of its area is 3.545; the law for bodies in general lies 2 % below."""
    assert CORRELATIONS["Nu_body"].nusselt(0.0, 0.71, True) == pytest.approx(2.0 * 3.14159265**0.5, rel=0.025)


@pytest.mark.skipif(not TRUTHS.is_file(), reason="the reference values are not here")
def test_the_truths_of_the_library_by_its_own_names() -> None:
    """Every call for which a deck can name the function: same name, Prandtl and Grashof number, same value."""
    pytest.importorskip("ht")
    found = 0
    with TRUTHS.open(encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            name, _, rest = row["call"].partition("(")
            arguments = [a.strip() for a in rest.rstrip(")").split(",")]
            if not name.startswith(SERVE) or any("=" in a for a in arguments[:2]) or len(arguments) > 3:
                continue
            more = arguments[2] if len(arguments) == 3 else ""
            if more and not more.startswith("buoyancy"):
                continue
            prandtl, grashof = map(float, arguments[:2])
            law = correlation(name, "up" if more else "vertical")
            value = law.nusselt(prandtl * grashof, prandtl, more != "buoyancy=False")
            # the law here goes on with the larger of two branches, where the library changes over at Ra = 1e7
            assert value == pytest.approx(float(row["expected_value"]), rel=1e-6), row["call"]
            found += 1
    assert found >= 10


@pytest.mark.parametrize("name", CORRELATIONS)
def test_a_table_is_the_correlation_above_conduction(name: str) -> None:
    """Both signs, at the points and where conduction no longer counts."""
    law = CORRELATIONS[name]
    orientation = "up" if law.facing else "vertical"
    x, y, least = nusselt_table(name, orientation, 0.71)
    for sign in (1.0, -1.0):
        for k in (200, 250, 300):
            at = 280 + (1 if sign > 0 else -1) * min(k, 280)
            expected = law.nusselt(abs(float(x[at])) ** 4, 0.71, sign > 0)
            assert y[at] + least == pytest.approx(max(expected, least), rel=0.1 if expected < 1.5 * least else 1e-2)
    assert y[280] == 0.0


@pytest.mark.skipif(not REFERENCES.is_dir(), reason="the reference values are not here")
def test_air_against_coolprop() -> None:
    """Conductivity and viscosity within 0.3 % over 200 to 450 K and 1 to 100 kPa; a real gas is denser by up to 0.3 % more at 200 K."""
    air, seen = GASES["air"], 0
    with (REFERENCES / "dry_air_coolprop.csv").open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    names = {key.split("_")[0].lower(): key for key in rows[0]}
    kelvin, k, mu = (next(v for n, v in names.items() if n.startswith(start)) for start in ("t", "k", "mu"))
    for row in rows:
        temperature = float(row[kelvin])
        if 200.0 <= temperature <= 450.0:
            assert air.k(temperature) == pytest.approx(float(row[k]), rel=5e-3)
            assert air.mu(temperature) == pytest.approx(float(row[mu]), rel=5e-3)
            seen += 1
    assert seen > 10


def test_the_mean_free_path_of_air() -> None:
    """Bird, Molecular Gas Dynamics: 0.066 um at one atmosphere and room temperature; Kn goes with 1 / p."""
    assert mean_free_path(GASES["air"], 288.15, ATMOSPHERE) == pytest.approx(6.6e-8, rel=0.05)
    assert knudsen_number(GASES["air"], 300.0, 1.0, 1e-3) == pytest.approx(100.0 * knudsen_number(GASES["air"], 300.0, 100.0, 1e-3))
