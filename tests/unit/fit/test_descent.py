"""The damped descent that every fit uses: bounds, the region of trust, turning back, how it ends; beside scipy's on random problems."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares, lsq_linear

from by_code import raises_code
from thermid.base.errors import SolverError
from thermid.fit._minimisation import _bend_after, _step, _within, descend

Array = np.ndarray
FREE = (np.full(2, -np.inf), np.full(2, np.inf))


def of(rows: Callable[[Array], Array], slopes: Callable[[Array], Array], seen: list[Array] | None = None) -> Callable[[Array], tuple]:
    """Return the cost of plain residuals as `descend` asks for it, which keeps where it was asked."""

    def local(x: Array) -> tuple[float, Array, Array]:
        if seen is not None:
            seen.append(x.copy())
        r = rows(x)
        return 0.5 * float(r @ r), r, slopes(x)

    return local


def rosenbrock(seen: list[Array] | None = None) -> Callable[[Array], tuple]:
    """Return the bent valley of Rosenbrock, whose least is at 1, 1 (Computer J. 3 (1960) 175)."""
    return of(lambda x: np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]), lambda x: np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]]), seen)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1.0, 1e160])
def test_a_bend_whose_products_are_no_floats_stays_as_it_was(size: float) -> None:
    """Far from the end of a fit with two columns exchanged it was NaN, and numpy's warnings were on the screen."""
    bend, step = np.diag([1.0, 2.0]), np.array([0.1, 0.2])
    before, after = ((np.full(2, r), np.full((2, 2), size)) for r in (1.0, 2.0))
    assert np.isfinite(_bend_after(bend, step, before, after)).all()
    assert np.array_equal(_bend_after(bend, step, before, after), bend) is (size > 1.0)


def test_a_straight_problem_ends_after_one_step() -> None:
    seen: list[Array] = []
    matrix, right = np.array([[2.0, 1.0], [0.0, 3.0], [1.0, 1.0]]), np.array([1.0, 2.0, 3.0])
    end = descend(of(lambda x: matrix @ x - right, lambda x: matrix, seen), np.array([5.0, -4.0]), FREE, np.ones(2), reach=10.0)
    assert end.x == pytest.approx(np.linalg.lstsq(matrix, right, rcond=None)[0], abs=1e-12)
    assert len(seen) == 2
    assert end.converged
    assert end.ahead < 1e-9


def test_a_bent_valley_is_followed() -> None:
    seen: list[Array] = []
    end = descend(rosenbrock(seen), np.array([-1.2, 1.0]), FREE, np.ones(2), done=1e-9, relative=1e-16)
    assert end.x == pytest.approx([1.0, 1.0], abs=1e-8)
    assert len(seen) < 30  # least squares of MINPACK takes 21 (More, Garbow and Hillstrom, ACM TOMS 7 (1981) 17)


@pytest.mark.parametrize("bend", [-0.7, -1.5, -4.0])
def test_large_residuals_of_strong_curvature_do_not_slow_the_descent(bend: float) -> None:
    """Dennis' and Schnabel's example (Numerical Methods, SIAM 1996, 10.2.4): J'J lacks `bend` times itself."""
    seen: list[Array] = []

    def rows(x: Array) -> Array:
        return np.array([x[0] + 1.0, bend * x[0] ** 2 + x[0] - 1.0, x[1] - x[0]])

    def slopes(x: Array) -> Array:
        return np.array([[1.0, 0.0], [2.0 * bend * x[0] + 1.0, 0.0], [-1.0, 1.0]])

    end = descend(of(rows, slopes, seen), np.array([0.4, 0.0]), FREE, np.ones(2), done=1e-9, relative=1e-16)
    assert end.converged
    assert end.x == pytest.approx([0.0, 0.0], abs=1e-7)
    assert len(seen) < 20  # with J'J alone 30 to 50


@pytest.mark.parametrize("seed", range(12))
def test_within_bounds_it_ends_where_scipy_ends(seed: int) -> None:
    """Sums of exponentials with bounds that some of the unknowns meet."""
    rng = np.random.default_rng(seed)
    t, truth = np.linspace(0.0, 3.0, 40), rng.uniform([0.5, 0.5, 0.3, 2.0], [2.0, 2.0, 1.0, 5.0])
    read = truth[0] * np.exp(-truth[2] * t) + truth[1] * np.exp(-truth[3] * t) + 0.01 * rng.standard_normal(t.size)

    def rows(x: Array) -> Array:
        return (x[0] * np.exp(-x[2] * t) + x[1] * np.exp(-x[3] * t) - read) / 0.01

    def slopes(x: Array) -> Array:
        a, b = np.exp(-x[2] * t), np.exp(-x[3] * t)
        return np.column_stack([a, b, -x[0] * t * a, -x[1] * t * b]) / 0.01

    low, high = truth - rng.uniform(-0.1, 1.0, 4) * truth, truth + rng.uniform(0.05, 1.0, 4) * np.abs(truth) + 0.2
    start = 0.5 * (low + high)
    end = descend(of(rows, slopes), start, (low, high), np.abs(start), done=1e-6)
    scipys = least_squares(rows, start, jac=slopes, bounds=(low, high), xtol=1e-14, ftol=1e-14, gtol=1e-12)
    assert ((low <= end.x) & (end.x <= high)).all()
    assert 0.5 * float(rows(end.x) @ rows(end.x)) <= scipys.cost + 1e-6


def test_what_would_cross_a_bound_stops_there_and_the_others_follow() -> None:
    matrix, right = np.array([[1.0, 0.9], [0.0, 1.0]]), np.array([0.0, 4.0])
    bounds = np.array([-1.0, -np.inf]), np.array([1.0, np.inf])
    seen: list[Array] = []
    end = descend(of(lambda x: matrix @ x - right, lambda x: matrix, seen), np.zeros(2), bounds, np.ones(2), reach=10.0)
    # with x at -1 the least over y of (0.9 y - 1)^2 + (y - 4)^2
    assert end.x == pytest.approx([-1.0, (0.9 + 4.0) / (0.81 + 1.0)])
    assert len(seen) == 2


def test_what_stands_on_a_bound_does_not_cross_it_by_rounding() -> None:
    """An unknown that had met its bound crossed it by 1e-17: the rest of the way was divided by its step, which is zero."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        x, scale = rng.uniform(-0.499, 0.499, 6), rng.uniform(0.1, 1.0, 6)
        slopes, rows = rng.normal(size=(8, 6)) * 10 ** rng.uniform(-1, 1, 6), 30.0 * rng.normal(size=8)
        with np.errstate(divide="raise", over="raise", invalid="raise"):
            there = x + _step(rows, slopes, x, (np.full(6, -0.499), np.full(6, 0.499)), scale, np.inf)
        assert (np.abs(there) < 0.499 + 1e-12).all()


def test_an_unknown_leaves_a_bound_that_holds_it_no_more() -> None:
    matrix = np.eye(2)
    bounds = np.zeros(2), np.full(2, 5.0)
    end = descend(of(lambda x: matrix @ x - np.array([3.0, -1.0]), lambda x: matrix), np.zeros(2), bounds, np.ones(2))
    assert end.x == pytest.approx([3.0, 0.0])


def test_runs_that_break_off_turn_it_back() -> None:
    inner, asked = rosenbrock(), []

    def local(x: Array) -> tuple[float, Array, Array]:
        asked.append(x)
        if x[0] > 0.5 and len(asked) < 8:
            raise SolverError("it breaks off.")
        return inner(x)

    end = descend(local, np.array([-1.2, 1.0]), FREE, np.ones(2), done=1e-9, relative=1e-16)
    assert end.x == pytest.approx([1.0, 1.0], abs=1e-8)


def test_a_start_that_breaks_off_says_so() -> None:
    def broken(x: Array) -> tuple[float, Array, Array]:
        raise SolverError("it breaks off.")

    with pytest.raises(SolverError, match="breaks off"):
        descend(broken, np.zeros(2), FREE, np.ones(2))


def test_derivatives_that_are_not_finite_are_no_end() -> None:
    with raises_code("run.did-not-finish", SolverError, match="fit"):
        descend(of(lambda x: x, lambda x: np.full((2, 2), np.nan)), np.ones(2), FREE, np.ones(2))


@pytest.mark.parametrize("reach", [0.1, 1.0, 3.0])
def test_a_first_step_stays_within_reach(reach: float) -> None:
    seen: list[Array] = []
    scale = np.array([1.0, 10.0])
    descend(of(lambda x: x - 100.0, lambda x: np.eye(2), seen), np.zeros(2), FREE, scale, reach=reach)
    length = float(np.linalg.norm(seen[1] / scale))
    assert 0.95 * reach < length <= 1.0001 * reach
    # a step that gains what it promises doubles it
    assert float(np.linalg.norm((seen[2] - seen[1]) / scale)) == pytest.approx(2.0 * length, rel=0.06)


@pytest.mark.parametrize("reach", [1e-6, 1e-2, 1.0])
def test_the_damped_step_is_the_best_of_its_length(reach: float) -> None:
    """Beside the damping whose step has that length, by bisection: the step gains 98 % of what is possible, and no step is longer."""
    rng = np.random.default_rng(2)
    slopes, rows = rng.standard_normal((9, 5)) * 10.0 ** np.arange(-3.0, 2.0), rng.standard_normal(9)

    def damped(log: float) -> Array:
        return -np.linalg.solve(slopes.T @ slopes + np.exp(log) * np.eye(5), slopes.T @ rows)

    best = damped(brentq(lambda log: np.log(np.linalg.norm(damped(log)) / reach), -40.0, 40.0))
    gains = [0.5 * float(rows @ rows - np.sum((rows + slopes @ s) ** 2)) for s in (_within(slopes, rows, reach), best)]
    assert np.linalg.norm(_within(slopes, rows, reach)) < 1.0001 * reach
    assert 0.98 * gains[1] < gains[0] < 1.0001 * gains[1]


def test_an_end_is_as_good_as_readings_that_exceed_their_noise_can_tell() -> None:
    """Readings ten times as noisy as stated determine a value to ten standard errors of those stated."""
    seen: dict[float, int] = {}
    for samples in (np.inf, 2.0):
        asked: list[Array] = []
        rows = lambda x: np.array([10.0 * (np.exp(x[0]) - 2.0), 10.0, x[1]])  # noqa: E731
        slopes = lambda x: np.array([[10.0 * np.exp(x[0]), 0.0], [0.0, 0.0], [0.0, 1.0]])  # noqa: E731
        descend(of(rows, slopes, asked), np.array([2.0, 0.0]), FREE, np.ones(2), done=0.05, samples=samples, relative=0.0)
        seen[samples] = len(asked)
    assert seen[2.0] < seen[np.inf]


def test_it_gives_up_after_so_many_evaluations() -> None:
    end = descend(rosenbrock(), np.array([-1.2, 1.0]), FREE, np.ones(2), rounds=5)
    assert not end.converged


@pytest.mark.parametrize("seed", range(20))
def test_a_linear_problem_ends_at_its_least_within_bounds(seed: int) -> None:
    """Unknowns that depend on one another: the least over all may lie beyond bounds at which none of them is best."""
    rng = np.random.default_rng(seed)
    slopes = rng.standard_normal((8, 5)) @ np.diag(10.0 ** rng.uniform(-1.0, 2.0, 5)) @ rng.standard_normal((5, 5))
    rows, low = 100.0 * rng.standard_normal(8), -rng.uniform(0.1, 1.0, 5)

    local = of(lambda x: rows + slopes @ x, lambda _: slopes)
    end = descend(local, np.zeros(5), (low, low + 1.2), np.ones(5), done=1e-6)
    least = lsq_linear(slopes, -rows, (low, low + 1.2), method="bvls").cost
    assert local(end.x)[0] == pytest.approx(least, rel=1e-6)
