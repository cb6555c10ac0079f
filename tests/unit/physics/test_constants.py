"""Numbers of the correlations, by what was published and by what must join without a step."""

import math

import pytest

from thermid.physics.convection import rectangle_nusselt
from thermid.physics.correlations import gap_nusselt


def test_a_rectangular_duct_has_the_nusselt_numbers_of_shah_and_london() -> None:
    """Laminar Flow Forced Convection in Ducts, 1978, walls at one temperature, by the shorter side over the longer one."""
    table = {1.0: 2.976, 0.5: 3.391, 0.25: 4.439, 0.125: 5.597, 0.0: 7.541}
    assert [rectangle_nusselt(aspect) for aspect in table] == pytest.approx(list(table.values()), rel=1e-3)


@pytest.mark.parametrize("aspect", [5.0, 40.0])
def test_a_gap_that_is_tilted_has_no_step_and_falls_to_rest_behind_upright(aspect: float) -> None:
    """The laws of a lying, an upright and a turned gap meet at 60 and 90 degrees; behind it Arnold's law takes the sine."""
    for tilt in (60.0, 90.0):
        before, at, behind = (gap_nusselt(1e5, tilt + step, aspect) for step in (-1e-4, 0.0, 1e-4))
        assert [before, behind] == pytest.approx([at, at], rel=1e-4)
    upright = gap_nusselt(1e5, 90.0, aspect)
    for tilt in (95.0, 120.0, 170.0):
        assert gap_nusselt(1e5, tilt, aspect) == pytest.approx(1.0 + (upright - 1.0) * math.sin(math.radians(tilt)), rel=1e-12)


@pytest.mark.parametrize(
    ("rayleigh", "tilt", "aspect", "nusselt"),
    [(1e5, 90.0, 1.5, 4.7208), (1e5, 90.0, 5.0, 3.4475), (1e4, 90.0, 20.0, 1.3120), (1e5, 90.0, 100.0, 3.0024), (1e6, 90.0, 12.0, 6.05),
     (1e5, 0.0, 5.0, 3.9944)],
    ids=["Catton, below 2", "Catton", "ElSherbiny, tall", "ElSherbiny, turning", "ElSherbiny, turbulent", "Hollands"],
)  # fmt: skip
def test_a_gap_has_the_published_nusselt_number(rayleigh: float, tilt: float, aspect: float, nusselt: float) -> None:
    """By the printed formulas at a Prandtl number of 0.71: Incropera, 6th ed., Eqs. 9.49 to 9.54, and of ElSherbiny."""
    assert gap_nusselt(rayleigh, tilt, aspect) == pytest.approx(nusselt, abs=1e-4)
