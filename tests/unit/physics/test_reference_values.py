"""Comparison with stored reference values beside the repository; skipped where they are absent."""

from __future__ import annotations

import ast
import csv
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from thermid.physics import air, conduction, plates, radiation
from thermid.physics._number import Number

FOLDER = Path(__file__).resolve().parents[4] / "shared" / "data" / "reference_values"


def rows(name: str) -> list[dict[str, str]]:
    path = FOLDER / name
    if not path.exists():
        pytest.skip(f"{name} is not beside the repository (../shared/data/reference_values)")
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# Largest deviation over 200 to 450 K at 1 atm; the docstrings of `air` print these limits.
AIR_LIMITS: dict[str, tuple[Callable[[float], float], float]] = {
    "mu_Pa_s": (air.air_viscosity, 0.012),
    "k_W_mK": (air.air_conductivity, 0.023),
    "cp_J_kgK": (air.air_specific_heat, 0.003),
    "rho_kg_m3": (air.air_density, 0.003),
    "Pr": (lambda t: air.dry_air(t).prandtl, 0.019),
    "beta_1_K": (lambda t: air.dry_air(t).expansion, 0.009),
}


def sea_level(column: str, lowest: float, highest: float) -> list[tuple[float, float]]:
    table = [(float(r["T_K"]), float(r[column])) for r in rows("dry_air_coolprop.csv") if float(r["p_Pa"]) == 101325.0]
    return [(t, v) for t, v in table if lowest <= t <= highest]


@pytest.mark.parametrize("column", AIR_LIMITS)
def test_dry_air(column: str) -> None:
    function, limit = AIR_LIMITS[column]
    largest = max(abs(function(t) / value - 1) for t, value in sea_level(column, 200.0, 450.0))
    assert largest < limit


@pytest.mark.parametrize(("column", "limit"), [("mu_Pa_s", 0.007), ("k_W_mK", 0.014)])
def test_dry_air_at_ordinary_temperatures(column: str, limit: float) -> None:
    largest = max(abs(AIR_LIMITS[column][0](t) / value - 1) for t, value in sea_level(column, 250.0, 350.0))
    assert largest < limit


def test_kinematic_viscosity_of_dry_air() -> None:
    dynamic, density = sea_level("mu_Pa_s", 200.0, 450.0), dict(sea_level("rho_kg_m3", 200.0, 450.0))
    largest = max(abs(air.dry_air(t).kinematic_viscosity / (mu / density[t]) - 1) for t, mu in dynamic)
    assert largest < 0.012


def plate(prandtl: float, grashof: float, **_: float) -> Number:
    return plates.vertical_plate_nusselt_all(prandtl * grashof, prandtl)


def mcadams(prandtl: float, grashof: float, *, buoyancy: bool, **_: str) -> Number:
    law = plates.horizontal_plate_up_nusselt if buoyancy else plates.horizontal_plate_down_nusselt
    return law(prandtl * grashof)


def radiated(emissivity: float, temperature: float, other: float = 0.0) -> Number:
    coefficient = radiation.radiation_coefficient(emissivity, 1.0)
    return radiation.radiation_conductance(coefficient, temperature, other) * (temperature - other)


# The reference radiates with sigma of CODATA 2014 (5.670367e-8), 1.3e-6 below ours; everything else is the same formula.
OURS: dict[str, tuple[Callable[..., float], float]] = {
    "Nu_vertical_plate_Churchill": (plate, 1e-12),
    "Nu_free_vertical_plate": (plate, 1e-12),
    "Nu_horizontal_plate_McAdams": (mcadams, 1e-12),
    "q_rad": (radiated, 1.4e-6),
    "R_cylinder": (lambda inner, outer, k, length: 1 / conduction.cylinder_conductance(k, length, inner / 2, outer / 2), 1e-12),
    "k_to_R": (lambda k, t: 1 / conduction.slab_conductance(k, 1.0, t), 1e-12),
}


def test_correlations() -> None:
    checked = []
    for row in rows("correlation_test_truths.csv"):
        call = ast.parse(row["call"], mode="eval").body
        assert isinstance(call, ast.Call)
        name = ast.unparse(call.func)
        named = {str(k.arg): k.value.value for k in call.keywords if isinstance(k.value, ast.Constant)}
        if name == "Nu_free_horizontal_plate" and named.get("Method") == "McAdams":
            name = "Nu_horizontal_plate_McAdams"
        if name not in OURS:
            continue
        function, tolerance = OURS[name]
        values = [ast.literal_eval(a) for a in call.args]
        assert function(*values, **named) == pytest.approx(float(row["expected_value"]), rel=tolerance), row["call"]
        checked.append(name)
    assert len(checked) == 12


def test_a_stream_beside_a_wall_is_an_exchanger_without_capacity_ratio() -> None:
    """Effectiveness of one stream beside one temperature: the limit that a chain of `flow` links tends to."""
    ht = pytest.importorskip("ht", reason="the library ht is not installed")
    for units in (0.2, 1.0, 3.0):
        assert ht.effectiveness_from_NTU(NTU=units, Cr=0.0, subtype="boiler") == pytest.approx(-math.expm1(-units), rel=1e-12)
