"""One-dimensional melting against Neumann's solution (Carslaw and Jaeger, Conduction of Heat in Solids, 2nd ed., section 11.2)."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import erf

import thermid as td

K, DENSITY, HEAT, LATENT = 0.2, 800.0, 2000.0, 200e3
"""A wax: conductivity [W/(m K)], density [kg/m^3], specific heat [J/(kg K)], latent heat [J/kg]."""
MELTS, SUPERHEAT, LENGTH = 300.0, 20.0, 0.02
"""Melting point [K], the wall above it [K], thickness for 1 m^2 [m]."""


def similarity() -> float:
    """The root of lambda exp(lambda^2) erf(lambda) = Ste / sqrt(pi); the front is at 2 lambda sqrt(a t). [-]"""
    stefan = HEAT * SUPERHEAT / LATENT
    return float(brentq(lambda x: x * np.exp(x * x) * erf(x) - stefan / np.sqrt(np.pi), 1e-6, 3.0))


def slab(lumps: int, span: float) -> td.Model:
    """A slab at its melting point against a wall, in lumps that melt over `span` [K]."""
    width = LENGTH / lumps
    node = {"mass": f"{DENSITY * width!r} [kg]", "specific_heat": f"{HEAT} [J/(kg K)]", "latent_heat": f"{LATENT} [J/kg]"}
    node |= {"melts_from": f"{MELTS - 0.5 * span!r} [K]", "melts_to": f"{MELTS + 0.5 * span!r} [K]"}
    g = K / width
    links = {"c": {"kind": "conduction", "between": ["wall", "x0"], "conductance": f"{2.0 * g!r} [W/K]"}}
    links |= {f"c{i}": {"kind": "conduction", "between": [f"x{i}", f"x{i + 1}"], "conductance": f"{g!r} [W/K]"} for i in range(lumps - 1)}
    return td.model_from_dict({"title": "slab", "needs": ["wall"], "nodes": {f"x{i}": node for i in range(lumps)}, "conductors": links})


def melted(lumps: int, span: float, share: float, method: str = "auto") -> tuple[td.Solution, float]:
    """The run until a share of the slab has melted, and that time [s]."""
    end = (share * LENGTH / (2.0 * similarity())) ** 2 / (K / DENSITY / HEAT)
    begin = f"{MELTS - 0.5 * span!r} [K]"
    bath = td.Scenario("bath", boundaries={"wall": f"{MELTS + SUPERHEAT} [K]"}, start=begin, duration=f"{end!r} [s]")
    return td.simulate(slab(lumps, span), bath, every=end, options=td.Options(method=method)), end


@pytest.mark.parametrize("method", ["auto", "RKC2", "TR-BDF2"])
@pytest.mark.parametrize("span", [0.0, 0.05])
def test_fifty_lumps_melt_as_neumann_says(span: float, method: str) -> None:
    """After a quarter has melted: heat within 0.2 %, front within 0.3 %; over 0.25 % of the superheat, and at one temperature."""
    run, end = melted(50, span, 0.26, method)
    diffusivity = K / DENSITY / HEAT
    heat = 2.0 * K * SUPERHEAT * np.sqrt(end / (np.pi * diffusivity)) / erf(similarity())
    balance = run.heat_balance()
    assert balance.stored == pytest.approx(heat, rel=2e-3)
    assert balance.relative < 1e-9
    # what is liquid, by the heat that each lump holds beyond that of the solid
    warm = sum(max(run[f"x{i}"].kelvin[-1] - MELTS, 0.0) for i in range(50)) * HEAT
    front = (balance.stored / (DENSITY * LENGTH / 50) - warm) / LATENT * LENGTH / 50
    assert front == pytest.approx(2.0 * similarity() * np.sqrt(diffusivity * end), rel=3e-3)


def test_two_hundred_lumps_melt_within_two_seconds() -> None:
    start = time.process_time()
    run, _ = melted(200, 0.05, 0.26)
    assert run.heat_balance().relative < 1e-9
    assert time.process_time() - start < 2.0


def test_a_wall_of_a_thousand_lumps_runs_as_a_large_network() -> None:
    """Twenty columns of fifty lumps at different walls: the front stands at another depth in each."""
    node = {"mass": "10 [g]", "specific_heat": "2 [kJ/(kg K)]", "latent_heat": "200 [kJ/kg]", "melts_from": "27 [degC]"}
    ends = {(i, j): f"x{i}_{j}" for i in range(50) for j in range(20)}
    pairs = [(f"w{j}", "wall", ends[0, j], 0.1 + 0.005 * j) for j in range(20)]
    pairs += [(f"d{i}_{j}", ends[i, j], ends[i + 1, j], 0.1) for i in range(49) for j in range(20)]
    pairs += [(f"s{i}_{j}", ends[i, j], ends[i, j + 1], 0.1) for i in range(50) for j in range(19)]
    links = {name: {"kind": "conduction", "between": [a, b], "conductance": f"{g!r} [W/K]"} for name, a, b, g in pairs}
    deck = {"title": "wall", "needs": ["wall"], "nodes": dict.fromkeys(ends.values(), node), "conductors": links}
    bath = td.Scenario("bath", boundaries={"wall": "60 [degC]"}, start="20 [degC]", duration="1 [h]")
    run = td.simulate(td.model_from_dict(deck), bath, every=3600.0)
    assert run.statistics["method"] in ("RKC2", "TR-BDF2 + CG")
    assert run.heat_balance().relative < 1e-9
    liquid = [n for n in ends.values() if run[n].final > 27.0 + 1e-9]
    assert 20 < len(liquid) < 500
