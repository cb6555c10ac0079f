"""Section 2.2 of the acceptance sheet and the second published pair: the closed form of Eqs. 4 to 6."""

from __future__ import annotations

import math

import numpy as np
import pytest

from oracles.two_nodes import TwoNodes, star_to_delta
from thermid.base.errors import SolverError
from thermid.physics.contact import series_conductance

R1, R2, R3, RD = 3.593502946672416, 7.223653709599008, 9.328358208955224, 1.3904109589041098
PAIR = TwoNodes.from_resistances((1468.8, 707.52), (4.11, 2.168), (R1, R2), (RD, RD), R3)
STAR = TwoNodes.from_resistances((900.0, 600.0), (6.8, 2.168), (2.0, 3.0), (0.5, 0.8), 10.0)


@pytest.mark.parametrize(
    ("hours", "first", "second"),
    [(0.5, 28.183726, 28.308554), (1, 30.971352, 30.999444), (2, 33.998710, 33.863691), (5, 36.077771, 35.821535)],
)
def test_pair_of_the_document(hours: float, first: float, second: float) -> None:
    assert PAIR.temperatures(3600.0 * hours, 24.0).tolist() == pytest.approx([first, second], abs=1e-6)


def test_steady_pair() -> None:
    steady = PAIR.steady(24.0)
    assert steady == pytest.approx((36.252540, 35.986075), abs=1e-6)
    assert PAIR.junction(*steady, 24.0) == pytest.approx(35.278747, abs=1e-6)
    assert PAIR.temperatures(1e6, 24.0).tolist() == pytest.approx(steady, abs=1e-11)


def test_printed_form_of_eq_6() -> None:
    """Delta, alpha, beta and Lambda as printed give the same steady rises and the same determinant."""
    delta = RD * RD + RD * R3 + RD * R3
    alpha, beta = RD * R2 + R2 * R3, RD * R1 + R1 * R3
    big = delta + alpha + beta + R1 * R2
    assert (delta, alpha, beta, big) == pytest.approx((27.873746, 77.428677, 38.517929, 169.778572), abs=1e-6)
    assert alpha * beta == pytest.approx(R1 * R2 * (delta + R3**2), rel=1e-12)
    first = R1 / big * (4.11 * (delta + alpha) + 2.168 * R2 * R3)
    second = R2 / big * (4.11 * R1 * R3 + 2.168 * (delta + beta))
    assert PAIR.steady(24.0) == pytest.approx((24 + first, 24 + second), rel=1e-14)
    assert float(np.linalg.det(PAIR.matrix())) == pytest.approx(big / (1468.8 * 707.52 * R1 * R2 * delta), rel=1e-12)


def test_eigenvalues_of_the_pair() -> None:
    assert PAIR.eigenvalues() == pytest.approx((-2.3675805e-4, -9.5368836e-4), rel=5e-8)
    assert PAIR.time_constants() == pytest.approx((4223.721, 1048.561), abs=1e-3)
    assert sorted(np.linalg.eigvals(PAIR.matrix())) == pytest.approx(sorted(PAIR.eigenvalues()), rel=1e-12)


def test_pair_in_vacuum() -> None:
    vacuum = PAIR.vacuum()
    assert vacuum.temperatures(18000.0, 24.0).tolist() == pytest.approx([75.809512, 76.162750], abs=1e-6)
    assert vacuum.vacuum_slope() * 3600 == pytest.approx(10.384870, abs=1e-6)
    assert vacuum.vacuum_difference() == pytest.approx(-0.353239, abs=1e-6)
    assert vacuum.vacuum_time_constant() == pytest.approx(1327.859, abs=1e-3)
    assert vacuum.eigenvalues()[0] == 0.0
    assert vacuum.time_constants() == pytest.approx((math.inf, 1327.859), abs=1e-3)
    late = vacuum.temperatures(np.array([40000.0, 43600.0]), 24.0)
    assert late[1, 0] - late[0, 0] == pytest.approx(vacuum.vacuum_slope() * 3600, abs=1e-8)
    assert late[1, 0] - late[1, 1] == pytest.approx(vacuum.vacuum_difference(), abs=1e-9)
    with pytest.raises(SolverError, match="no steady state"):
        vacuum.steady(24.0)


def test_a_very_weak_path_tends_to_vacuum() -> None:
    weak = TwoNodes(PAIR.capacitances, PAIR.powers, (1e-13, 1e-13), PAIR.joints, 0.0)
    difference = weak.temperatures(18000.0, 24.0) - PAIR.vacuum().temperatures(18000.0, 24.0)
    assert np.all(np.abs(difference) < 1e-9)


def test_star_of_the_field() -> None:
    assert STAR.steady(24.0) == pytest.approx((34.21682759, 32.76744828), abs=1e-8)
    assert STAR.eigenvalues() == pytest.approx((-6.20230e-4, -1 / 371.4195), rel=1e-6)
    assert STAR.time_constants() == pytest.approx((1612.305, 371.4195), abs=1e-3)
    expected = [[27.46325592, 26.29256627], [31.05928418, 29.61513161], [33.18436127, 31.73300529]]
    found = STAR.temperatures(np.array([600.0, 1800.0, 3600.0]), 24.0)
    assert found == pytest.approx(np.array(expected), abs=1e-8)


def test_two_masses_of_the_modelica_library() -> None:
    pair = TwoNodes((15.0, 15.0), (0.0, 0.0), (0.0, 0.0), (20.0, 20.0))
    assert pair.temperatures(1.0, 0.0, (100.0, 0.0)).tolist() == pytest.approx([63.17985691, 36.82014309], abs=1e-8)
    assert pair.temperatures(1e4, 0.0, (100.0, 0.0)).tolist() == pytest.approx([50.0, 50.0], abs=1e-10)


def test_omitted_gap_is_the_two_joints_in_series() -> None:
    """Row B9 and E4: an infinite Rcn3 gives finite numbers, q = (T1 - T2)/(Rcd1 + Rcd2)."""
    omitted = TwoNodes.from_resistances((900.0, 600.0), (6.8, 2.168), (2.0, 3.0), (0.5, 0.8))
    assert omitted.gap == 0.0
    assert omitted.links() == pytest.approx((series_conductance(1 / 0.5, 1 / 0.8), 1 / 2, 1 / 3))
    first, second = omitted.steady(24.0)
    assert first - second == pytest.approx((0.5 + 0.8) * (6.8 * 2.0 - 2.168 * 3.0) / (0.5 + 0.8 + 2.0 + 3.0), rel=1e-12)
    nearly = TwoNodes.from_resistances((900.0, 600.0), (6.8, 2.168), (2.0, 3.0), (0.5, 0.8), 1e12)
    assert nearly.temperatures(1800.0, 24.0).tolist() == pytest.approx(omitted.temperatures(1800.0, 24.0).tolist(), abs=1e-9)


def test_shorted_gap_decouples() -> None:
    """E3: Rcn3 to zero ties the massless point to the ambient, q1 = (T1 - Tamb)/Rcd1."""
    shorted = TwoNodes.from_resistances((900.0, 600.0), (6.8, 2.168), (2.0, 3.0), (0.5, 0.8), 1e-12)
    assert shorted.steady(24.0)[0] == pytest.approx(24.0 + 6.8 / (1 / 2 + 1 / 0.5), abs=1e-9)


def test_without_a_joint_both_are_alone() -> None:
    alone = TwoNodes((900.0, 600.0), (6.8, 2.168), (0.5, 0.25), (0.0, 0.0))
    time = 700.0
    expected = [24 + 6.8 / 0.5 * (1 - math.exp(-time * 0.5 / 900)), 24 + 2.168 / 0.25 * (1 - math.exp(-time * 0.25 / 600))]
    assert alone.temperatures(time, 24.0).tolist() == pytest.approx(expected, abs=1e-11)


def test_equal_nodes_without_a_joint_have_one_eigenvalue() -> None:
    equal = TwoNodes((900.0, 900.0), (6.8, 6.8), (0.5, 0.5), (0.0, 0.0))
    assert equal.eigenvalues()[0] == pytest.approx(equal.eigenvalues()[1], rel=1e-14)
    assert equal.temperatures(500.0, 24.0)[0] == pytest.approx(24 + 6.8 / 0.5 * (1 - math.exp(-500 * 0.5 / 900)), abs=1e-11)


def test_nothing_anywhere_is_two_ramps() -> None:
    free = TwoNodes((900.0, 600.0), (6.8, 2.168), (0.0, 0.0), (0.0, 0.0))
    assert free.temperatures(100.0, 24.0).tolist() == pytest.approx([24 + 6.8 / 9, 24 + 2.168 / 6], rel=1e-14)
    assert free.time_constants() == (math.inf, math.inf)


@pytest.mark.parametrize("pair", [PAIR, STAR, PAIR.vacuum()])
def test_start_and_equation(pair: TwoNodes) -> None:
    start = (31.0, 12.0)
    assert pair.temperatures(0.0, 24.0, start).tolist() == pytest.approx(start, abs=1e-12)
    before, here, later = pair.temperatures(np.array([399.0, 400.0, 401.0]), 24.0, start)
    rate = pair.matrix() @ (here - 24.0) + np.array(pair.powers) / np.array(pair.capacitances)
    assert ((later - before) / 2).tolist() == pytest.approx(rate.tolist(), rel=1e-5)


def test_thousand_random_pairs_have_real_negative_eigenvalues() -> None:
    generator = np.random.default_rng(20)
    for values in 10 ** generator.uniform(-2, 3, (1000, 7)):
        pair = TwoNodes(tuple(values[:2]), (1.0, 2.0), tuple(values[2:4]), tuple(values[4:6]), values[6])
        slow, fast = pair.eigenvalues()
        assert fast < slow < 0


def test_star_conserves_series_conductance() -> None:
    between, first, second = star_to_delta(2.0, 3.0, 5.0)
    assert between + series_conductance(first, second) == pytest.approx(series_conductance(2.0, 3.0), rel=1e-14)
