"""Blocks against closed forms: a slab with one end held, a fin, a bar of two materials."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td

pytestmark = pytest.mark.analytic
MATERIAL = ("20 [W/(m K)]", "8000 [kg/m^3]", "500 [J/(kg K)]")
DIFFUSIVITY = 20.0 / (8000.0 * 500.0)


def slab_error(cells: int, method: str) -> float:
    """Return the largest difference from the series of a slab of 50 mm, a face held 10 K above the start, the other insulated. [K]

    Carslaw and Jaeger, Conduction of Heat in Solids, 2nd ed., section 3.4.
    """
    times = np.array([60.0, 200.0, 600.0])
    slab = td.Block(("50 [mm]", "10 [mm]", "10 [mm]"), (cells, 1, 1), *MATERIAL).held("-x", "base")
    scenario = td.Scenario(boundaries={"base": "310 [K]"}, start="300 [K]", duration=600.0)
    run = td.simulate(slab, scenario, fields=times, options=td.Options(error=4e-5, method=method))
    x = (np.arange(cells) + 0.5) / cells
    odd = 2 * np.arange(200) + 1
    waves = np.sin(np.outer(x, odd) * np.pi / 2) * 4.0 / (np.pi * odd)
    rates = DIFFUSIVITY * (odd * np.pi / 2 / 0.05) ** 2
    exact = 310.0 - 10.0 * np.exp(-np.outer(times, rates)) @ waves.T
    return float(np.abs(run.fields[:, :, 0, 0] - exact).max())


@pytest.mark.parametrize("method", ["RKC2", "TR-BDF2"])
def test_a_slab_with_one_face_held(method: str) -> None:
    coarse, fine = slab_error(20, method), slab_error(40, method)
    assert fine < 2e-3  # 10 K times (step / depth of the front)^2, which is 1.25 mm in 17 mm at 60 s, over 24
    assert 3.3 < coarse / fine < 4.7


def test_a_fin() -> None:
    """T - T_air = (T_base - T_air) cosh m (L - x) / cosh m L with m^2 = h P / (k A) (Incropera, section 3.6)."""
    length, width, cells = 0.1, 0.004, 400
    fin = td.Block((length, width, width), (cells, 1, 1), *MATERIAL)
    fin = fin.held("-x", "base").exchanging("-y +y -z +z", "air", htc="30 [W/(m^2 K)]")
    found = td.steady(fin, td.Scenario(boundaries={"base": "350 [K]", "air": "300 [K]"})).final_field[:, 0, 0]
    m = np.sqrt(30.0 * 4 * width / (20.0 * width**2))
    x = (np.arange(cells) + 0.5) * length / cells
    exact = 300.0 + 50.0 * np.cosh(m * (length - x)) / np.cosh(m * length)
    assert np.abs(found - exact).max() < 50.0 * (m * length / cells) ** 2


def test_a_bar_of_two_materials_carries_one_heat() -> None:
    k = np.full((10, 1, 1), 20.0)
    k[4:] = 5.0
    bar = td.Block(("100 [mm]", "10 [mm]", "10 [mm]"), (10, 1, 1), k, *MATERIAL[1:]).held("-x", "hot").held("+x", "cold")
    found = td.steady(bar, td.Scenario(boundaries={"hot": "320 [K]", "cold": "300 [K]"})).final_field[:, 0, 0]
    flux = 20.0 / (0.04 / 20.0 + 0.06 / 5.0)
    exact = [320.0 - flux * (min(x, 0.04) / 20.0 + max(x - 0.04, 0.0) / 5.0) for x in 0.005 + 0.01 * np.arange(10)]
    np.testing.assert_allclose(found, exact, atol=1e-6)
