"""Linear algebra of information: against plain inverses where these exist, and what counts as nothing where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from thermid.base.linear_algebra import (
    MAX_PART_WITHOUT_INFORMATION,
    NOTHING,
    RANK_TOLERANCE,
    covariance,
    inverse_square_root,
    null_space,
    pseudo_inverse,
    square_root,
    symmetric_inverse,
    variance,
)
from thermid.fit._error_model.gaussian import back_substitution, forward_substitution
from thermid.fit._minimisation import finite
from thermid.fit._uncertainty.information import rank

ROWS = np.random.default_rng(1).standard_normal((40, 4)) * np.array([1.0, 1e-6, 1e5, 3.0])
"""Derivatives with respect to unknowns in very different units."""


def nearly_bound(ratio: float) -> np.ndarray:
    """Rows over two unknowns of length one, whose difference they see by so much less than their sum."""
    turn = np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2.0)
    return np.asarray(np.diag([1.0, ratio]) @ turn)


def test_a_covariance_is_the_inverse_of_the_information() -> None:
    exact = np.linalg.inv(ROWS.T @ ROWS * 1.0)
    size = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    for found in (covariance(ROWS), pseudo_inverse(ROWS), symmetric_inverse(ROWS.T @ ROWS)):
        np.testing.assert_allclose(found / size, exact / size, atol=1e-9)
    gradient = np.array([1.0, -1e-5, 0.0, 2.0])
    assert variance(ROWS.T @ ROWS, gradient) == pytest.approx(float(gradient @ exact @ gradient), rel=1e-6)


def test_one_tolerance_says_which_directions_hold_nothing() -> None:
    """A constant of decision 161: what lies a tenth above it is known, and a tenth below it is not."""
    assert (RANK_TOLERANCE, MAX_PART_WITHOUT_INFORMATION) == (1e-6, 1e-3)
    for ratio, known in ((1.1e-6, True), (0.9e-6, False)):
        rows = nearly_bound(ratio)
        assert np.isfinite(covariance(rows)).all() == known
        assert rank(rows) == (2 if known else 1)
        assert null_space(rows).shape[0] == (0 if known else 1)
        assert np.isfinite(variance(rows.T @ rows, np.array([1.0, -1.0]))) == known


def test_what_rows_see_weakly_has_an_error_at_the_end_of_a_fit() -> None:
    """Not to be told from another by RANK_TOLERANCE is not the same as without effect."""
    for ratio, seen in ((1.1e-12, True), (0.9e-12, False)):
        found = covariance(nearly_bound(ratio), NOTHING)
        assert np.isfinite(found).all() == seen
        assert np.isinf(np.diag(covariance(nearly_bound(ratio)))).all()
        if seen:
            np.testing.assert_allclose(np.diag(pseudo_inverse(nearly_bound(ratio), NOTHING)), 0.5 / ratio**2, rtol=1e-3)
    np.testing.assert_allclose(np.diag(covariance(nearly_bound(7e-8), NOTHING)), 0.5 / 7e-8**2, rtol=1e-6)


def test_an_unknown_in_a_blind_direction_has_no_error_and_goes_with_no_other() -> None:
    rows = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]])
    found = covariance(rows)
    np.testing.assert_array_equal(np.isinf(np.diag(found)), [True, True, False, True])
    assert found[2, 2] == pytest.approx(0.25)
    np.testing.assert_array_equal(finite(found) - np.diag(np.diag(finite(found))), np.zeros((4, 4)))
    # of the sum, which is known, the pseudo-inverse says so
    assert np.array([1.0, 1.0, 0.0, 0.0]) @ pseudo_inverse(rows) @ np.array([1.0, 1.0, 0.0, 0.0]) == pytest.approx(1.0)
    np.testing.assert_allclose(np.abs(null_space(rows)), [[np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]])
    assert rank(rows[:, :2], rows[:, 2:]) == 1
    assert rank(rows[:, :1], rows[:, 1:2]) == 0
    assert variance(rows.T @ rows, np.array([1.0, -1.0, 0.0, 0.0])) == np.inf


def test_roots_give_their_matrices_back() -> None:
    matrix = np.linalg.inv(ROWS.T @ ROWS)
    size = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    root, back = square_root(matrix), inverse_square_root(matrix)
    np.testing.assert_allclose(root @ root.T / size, matrix / size, atol=1e-9)
    np.testing.assert_allclose(back @ root @ root.T @ back.T, np.eye(4), atol=1e-6)
    flat = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert square_root(flat).shape == (2, 2)
    assert square_root(flat, drop=True).shape == (2, 1)
    assert square_root(np.zeros((0, 0))).shape == (0, 0)


def test_the_covariance_is_what_white_scores_leave() -> None:
    found = covariance(ROWS)
    size = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    np.testing.assert_allclose(found @ ROWS.T @ ROWS @ found / size, found / size, atol=1e-9)


def test_nothing_is_asked_of_nothing() -> None:
    assert covariance(np.zeros((3, 0))).shape == (0, 0)
    assert pseudo_inverse(np.zeros((3, 0))).shape == (0, 0)
    assert null_space(np.zeros((2, 1))).shape == (0, 1)
    assert np.isinf(np.diag(covariance(np.zeros((2, 2))))).all()


def test_forward_substitution_solves_each_triangle() -> None:
    generator = np.random.default_rng(3)
    lower = np.tril(generator.standard_normal((5, 4, 4))) + 4.0 * np.eye(4)
    right = generator.standard_normal((5, 4, 3))
    assert lower @ forward_substitution(lower, right) == pytest.approx(right, abs=1e-12)
    assert np.einsum("mji,mj->mi", lower, back_substitution(lower, right[:, :, 0])) == pytest.approx(right[:, :, 0], abs=1e-12)
