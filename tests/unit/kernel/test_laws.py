"""Every row of the table of laws: in one number, with derivatives, in lanes, in a large network and in a run it is the same law."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

from thermid import _kernel as k
from thermid.model.tree import Law
from thermid.simulation._network.rows import same_both_ways
from thermid.simulation._solver import large as large_network
from thermid.simulation.runs import ConductorRow
from unit.kernel.reference import Net

Table = tuple[np.ndarray, np.ndarray, np.ndarray]
LAWS = tuple(k.CONDUCTOR_LAWS)
RNG = np.random.default_rng(8)
HOT = np.array([310.0, 300.0, 342.5, 295.002, 300.0, 287.3, 391.0, 318.4])
COLD = np.array([290.0, 300.0, 287.1, 295.0, 361.2, 287.9, 280.6, 333.3])


def table(x: np.ndarray) -> Table:
    """A table with slopes of its own, of which no piece is straight."""
    return x, 2.0 + np.sin(x / 17.0) + 0.01 * x, np.cos(x / 17.0) / 17.0 + 0.01


def tables_of(form: str) -> list[Table]:
    """What a law looks up, wide enough for the temperatures here, and where it asks for them beyond."""
    over = {"table of difference": (-70.0, 50.0), "natural": (-9.0, 4.0)}
    first = table(np.linspace(*over.get(form, (283.0, 380.0)), 23))
    return [first, table(np.linspace(270.0, 400.0, 31)), table(np.linspace(280.0, 360.0, 17))][: k.CONDUCTOR_LAWS[form][2]]


def coefficients(form: str, member: int = 0) -> tuple[float, float]:
    """A law's two coefficients; a second one where the law has none must not matter."""
    scale = 1.0 + 0.05 * member
    second = {"hinge": 311.0 + member, "hinge of difference": 4.0 - member, "gas": 0.6, "natural": 0.08}
    return (0.5e-9 if form == "radiation" else 0.5) * scale, second.get(form, 0.31) * (scale if not form.startswith("hinge") else 1.0)


def evaluated(form: str, hot: np.ndarray, cold: np.ndarray, c: np.ndarray, by: int = -1) -> np.ndarray:
    return np.asarray(k.conductor_heat(k.CONDUCTOR_LAWS[form][0], hot, cold, np.ascontiguousarray(c), tables_of(form), by))


def row(form: str) -> tuple[np.ndarray, np.ndarray]:
    """Both coefficients of eight members, and their steps for differences."""
    c = np.array([coefficients(form, m) for m in range(8)])
    return c, np.abs(c).max(axis=0) * 1e-5


@pytest.mark.parametrize("form", LAWS)
def test_a_law_is_what_its_formula_says(form: str) -> None:
    net = Net()
    net.tables = tables_of(form)
    c, _ = row(form)
    q = evaluated(form, HOT, COLD, c)[0]
    for m in range(8):
        net.capacity, net.conductors = [0, 0], [(k.CONDUCTOR_LAWS[form][0], 0, 1, [0, 1, -1, -1], 0)]
        expected = net.heat(net.conductors[0], np.array([HOT[m], COLD[m]]), c[m].tolist())
        assert q[m] == pytest.approx(expected, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("form", LAWS)
def test_its_derivatives_are_those_of_its_heat_and_dual_numbers_those_of_all(form: str) -> None:
    c, step = row(form)
    given = [HOT, COLD, c[:, 0], c[:, 1]]
    steps = [np.full(8, 1e-5), np.full(8, 1e-5), np.full(8, step[0]), np.full(8, step[1])]
    first = evaluated(form, HOT, COLD, c)[[1, 2, 3, 4]]
    for place in range(4):
        sides = []
        for sign in (1.0, -1.0):
            moved = [v + sign * s if j == place else v for j, (v, s) in enumerate(zip(given, steps, strict=True))]
            sides.append(evaluated(form, moved[0], moved[1], np.column_stack(moved[2:])))
        difference = (sides[0] - sides[1]) / (2.0 * steps[place])
        size = np.abs(first[place]).max() + 1e-12 * np.abs(first).max()
        # a row counts as a derivative in its second coefficient only where it has one
        if place < 3 or k.CONDUCTOR_LAWS[form][1] > 1:
            np.testing.assert_allclose(first[place], difference[0], rtol=2e-6, atol=2e-7 * size)
        dual = evaluated(form, HOT, COLD, c, by=place)
        scale = np.abs(difference).max(axis=1, keepdims=True) + 1e-300
        np.testing.assert_allclose(dual / scale, difference / scale, rtol=1e-5, atol=3e-6)


@pytest.mark.parametrize("simd", k.instruction_sets())
@pytest.mark.parametrize("form", LAWS)
def test_eight_lanes_are_eight_single_ones(form: str, simd: str) -> None:
    c, _ = row(form)
    q, phi, qa, qb, aa, ab, ba, bb = k.conductor_lanes(k.CONDUCTOR_LAWS[form][0], HOT, COLD, c, tables_of(form), simd)
    one = evaluated(form, HOT, COLD, c)
    for mine, other in ((q, one[0]), (qa, one[1]), (qb, one[2]), (phi, one[3])):
        np.testing.assert_allclose(mine, other, rtol=1e-13, atol=1e-14 * np.abs(other).max())
    for place, (by_a, by_b) in enumerate(((aa, ab), (ba, bb)), start=1):
        for mine, by in ((by_a, 0), (by_b, 1)):
            other = evaluated(form, HOT, COLD, c, by=by)[place]
            np.testing.assert_allclose(mine, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())


def large(form: str, between: bool) -> tuple[np.ndarray, np.ndarray]:
    """Heat out of eight nodes of a large network, to a boundary or into eight others, and its slopes there."""
    c, _ = coefficients(form), None
    n, kind = 16 if between else 8, k.CONDUCTOR_LAWS[form][0]
    ints, none = (lambda v: np.array(v, np.int32)), np.zeros(0)
    problem = k.LargeProblem(
        np.ones(n),
        (np.zeros(n + 1, np.int32), ints([]), none),
        ints([[kind, -1 if between else 0, -1, 0 if tables_of(form) else -1, 0, 8]]),
        np.array([c[1]]),
        ints(range(8)),
        ints(range(8, 16)) if between else np.zeros(8, np.int32),
        np.full(8, c[0]),
        np.zeros((0, 7), np.int32),
        ints([]),
        np.zeros((4, 0)),
        np.zeros((3, 0)),
        0,
        ints([-1]),
        np.array([COLD[2]]),
        tables_of(form),
        [],
        ints([]),
    )
    heat, slope, pair, _, _ = problem.heat(np.concatenate([HOT, COLD]) if between else HOT, 0.0)
    return -heat[:8], pair if between else slope


@pytest.mark.parametrize("form", [f for f in LAWS if f != "flow"])
def test_a_large_network_has_the_same_law(form: str) -> None:
    c = np.tile(coefficients(form), (8, 1))
    for between, cold in ((True, COLD), (False, np.full(8, COLD[2]))):
        heat, slope = large(form, between)
        q, qa, qb, *_ = evaluated(form, HOT, cold, c)
        np.testing.assert_allclose(heat, q, rtol=1e-14)
        np.testing.assert_allclose(slope, 0.5 * (qa - qb) if between else qa, rtol=1e-14)


@pytest.mark.parametrize("form", LAWS)
def test_members_run_in_lanes_as_they_run_alone(form: str) -> None:
    """A law without code for lanes would send its members to the integrator one by one."""
    net = Net()
    net.tables = tables_of(form)
    c = coefficients(form)
    a, b = net.node(300.0, 330.0), net.node(900.0, 305.0)
    air = net.boundary(offset=net.coef(292.0))
    factor = 2.0 if form != "natural" else 1.0
    net.link(k.CONDUCTOR_LAWS[form][0], a, b, net.coef(factor * c[0]), net.coef(c[1]), table=0 if net.tables else -1)
    net.link(k.LINEAR, b, air, net.coef(0.3))
    net.load(k.SIGNAL, a, net.coef(4.0))
    times = np.linspace(0.0, 3000.0, 7)
    coef = np.tile(net.values[:, None], (1, 9)) * np.linspace(1.0, 1.02, 9)
    start = np.tile(np.array(net.start)[:, None], (1, 9))
    run = k.Ensemble(net.problem(), coef, start, 0.0, 3000.0, times, np.array([a, b], np.int32), rtol=0.0, atol=1e-9)
    found = run.advance(times.size)
    assert not np.asarray(run.alone).any()
    for m in (0, 8):
        alone = net.run(times, coef=coef[:, m].copy(), rtol=0.0, atol=1e-9).traces
        np.testing.assert_allclose(found[m // 8, :, :, m % 8], alone, rtol=0, atol=1e-6)


def test_a_law_with_a_direction_is_known_by_its_heat_and_kept_from_the_wrong_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A large network writes a boundary second; a law that is not the same both ways would run backwards there."""
    plain = [form for form in LAWS if not k.CONDUCTOR_LAWS[form][2]]
    assert [form for form in plain if not same_both_ways(form)] == ["hinge of difference"]
    row = ConductorRow("path", ("base", "plate"), Law("power", (1.0, 0.25)))
    places: dict[str, list[object]] = {"conductors": [], "factors": [], "controls": [], "loads": []}
    problem = SimpleNamespace(
        nodes=["plate"], wiring=SimpleNamespace(structure=SimpleNamespace(coefficient_input=[-1, -1], edges=(), **places))
    )
    for first, last in ((0, 1), (1, 0)):  # from node to boundary, and back
        places["conductors"][:] = [(row, first, last, (0, 1))]
        assert large_network.refusal(problem) == ""
    monkeypatch.setattr(large_network, "same_both_ways", lambda form: False)
    assert re.search(r"'path'.*\(power\)", large_network.refusal(problem))
    places["conductors"][:] = [(row, 0, 1, (0, 1))]
    assert large_network.refusal(problem) == ""
