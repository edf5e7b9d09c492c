"""Knots to controls."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from physique.errors import InputError
from physique.tracking.spline import fit_knots, knot_count, knot_matrix


def test_the_papers_two_windows_have_twelve_knots() -> None:
    assert knot_count(0.4) == 6
    assert knot_count(0.8) == 12
    assert knot_count(1.0) == 15
    assert knot_count(0.1) == 4


def test_matrix_is_the_spline() -> None:
    knots = np.random.default_rng(0).normal(size=(12, 50))
    breaks = np.linspace(0, 0.8, 10)  # equal intervals
    spline = BSpline(np.r_[[0.0] * 3, breaks, [0.8] * 3], knots, 3)
    middle = 0.01 * (np.arange(80) + 0.5)
    np.testing.assert_allclose(knot_matrix(12, 80) @ knots, spline(middle), atol=1e-12)


def test_equal_knots_are_a_constant_control() -> None:
    matrix = knot_matrix(12, 80)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=1e-12)
    assert matrix.min() >= 0.0
    assert np.linalg.matrix_rank(matrix) == 12


def test_cubics_are_met_exactly() -> None:
    t = (np.arange(80) + 0.5) / 80
    control = np.stack([1 - t + 3 * t**2 - 2 * t**3, t**2], axis=1)
    matrix = knot_matrix(12, 80)
    np.testing.assert_allclose(matrix @ fit_knots(matrix, control), control, atol=1e-12)


def test_both_windows_are_treated_alike() -> None:
    matrix = knot_matrix(12, 80)
    np.testing.assert_allclose(matrix, matrix[::-1, ::-1], atol=1e-12)


@pytest.mark.parametrize(("knots", "steps", "found"), [(3, 80, "3 knots"), (12, 8, "8 steps")])
def test_impossible_splines_are_refused(knots: int, steps: int, found: str) -> None:
    with pytest.raises(InputError, match=found):
        knot_matrix(knots, steps)
