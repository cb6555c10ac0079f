"""The block of benchmark case B3 at 1000 cells, against SciPy's BDF on equations written down again."""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.sparse import coo_array, diags_array

import thermid as td
from thermid.base.units import STEFAN_BOLTZMANN

SOURCE = Path(__file__).parents[3] / "benchmarks" / "block.py"


@pytest.fixture(scope="module")
def case() -> ModuleType:
    spec = importlib.util.spec_from_file_location("benchmark_block", SOURCE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Written:
    """1000 cells of 2 cm: dT/dt = (q - K T - surface) / C."""

    def __init__(self, factors: tuple[np.ndarray[Any, Any], ...]) -> None:
        n, step = 10, 0.02
        cell = np.arange(n**3).reshape(n, n, n)
        first = np.concatenate([np.delete(cell, -1, axis).ravel() for axis in range(3)])
        second = np.concatenate([np.delete(cell, 0, axis).ravel() for axis in range(3)])
        g = 15.0 * step * np.concatenate([f.ravel() for f in factors])
        both = (np.concatenate((first, second)), np.concatenate((second, first)))
        matrix = coo_array((np.concatenate((g, g)), both), shape=(n**3, n**3)).tocsr()
        self.matrix = diags_array(matrix.sum(axis=1)) - matrix
        at_face = sum(np.isin(index, (0, n - 1)).astype(float) for index in np.indices((n, n, n)))
        self.area = at_face.ravel() * step**2
        self.capacity = 3.9e6 * step**3
        heat = np.zeros((n, n, n))
        corners = [(x, y, z) for x in (1, 6) for y in (1, 6) for z in (1, 6)]
        for k, (x, y, z) in enumerate(corners):
            heat[x : x + 2, y : y + 2, z : z + 2] += (5.0 + 2.142857 * k) / 8
        self.heat = heat.ravel()

    def rate(self, t: float, temperature: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        ambient = 290.0 + 5.0 * (1.0 - np.cos(np.pi * t / 3600.0))
        d = temperature - ambient
        lost = 1.5 * d * (d * d + 1e-4) ** 0.125 + 0.8 * STEFAN_BOLTZMANN * (temperature**4 - ambient**4)
        return np.asarray((self.heat - self.matrix @ temperature - self.area * lost) / self.capacity)

    def jacobian(self, t: float, temperature: np.ndarray[Any, Any]) -> Any:
        ambient = 290.0 + 5.0 * (1.0 - np.cos(np.pi * t / 3600.0))
        d = temperature - ambient
        e = d * d + 1e-4
        slope = 1.5 * (e**0.125 + 0.25 * d * d * e**-0.875) + 4.0 * 0.8 * STEFAN_BOLTZMANN * temperature**3
        return (-(self.matrix + diags_array(self.area * slope)) / self.capacity).tocsc()


@pytest.fixture(scope="module")
def exact(case: ModuleType) -> np.ndarray[Any, Any]:
    written = Written(case.build(1_000).link_factors)
    times = [60.0, 600.0, 3600.0]
    run = solve_ivp(written.rate, (0.0, 3600.0), np.full(1000, 290.0), "BDF", times, rtol=1e-9, atol=1e-8, jac=written.jacobian)
    return np.asarray(run.y.T)


@pytest.mark.parametrize("method", ["auto", "RKC2", "TR-BDF2"])
def test_case_b3_is_within_its_target(case: ModuleType, exact: np.ndarray[Any, Any], method: str) -> None:
    run = td.simulate(case.build(1_000), case.scenario(), fields=[60.0, 600.0, 3600.0], options=td.Options(method=method))
    assert np.abs(run.fields.reshape(3, -1) - exact).max() < 5e-3


def test_its_reference_above_ten_thousand_cells_is_tighter(
    exact: np.ndarray[Any, Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A twentieth of what the runs are asked for."""
    monkeypatch.syspath_prepend(str(SOURCE.parent))
    run, _ = importlib.import_module("b3")._contestant("tighter", "transient", 1_000, 0.0, tmp_path)
    fields, _ = run()
    assert np.abs(fields - exact).max() < 5e-4


def test_steps_hardly_depend_on_the_number_of_cells(case: ModuleType) -> None:
    small, larger = (td.simulate(case.build(n), case.scenario()).statistics for n in (1_000, 10_000))
    assert small["method"] == larger["method"] == "RKC2"
    assert larger["steps"] < 1.5 * small["steps"]
    # stages grow with the root of the largest rate, which grows with n^(2/3)
    assert larger["evaluations"] / small["evaluations"] < 10 ** (1 / 3) * 1.5
