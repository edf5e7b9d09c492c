"""Quadratic programs with limits against a general solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from physique.tracking.box import hold


@pytest.mark.parametrize("seed", range(40))
def test_agrees_with_a_general_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 50))
    root = rng.normal(size=(n, n)) + 0.1 * np.eye(n)
    H, g = root @ root.T + 1e-3 * np.eye(n), rng.normal(size=n) * 3
    T = rng.normal(size=(n, n)) + 2 * np.eye(n)
    # Some far, some near, and some that the start already violates.
    low, high = -rng.uniform(-0.1, 0.5, n), rng.uniform(0.2, 0.9, n)
    L = np.linalg.cholesky(H)
    w = -np.linalg.solve(H, g)
    y = np.empty(n)
    which, Y, system, force = hold(y, T @ w, T, L, low, high)
    w -= (Y @ force)[:, 0]
    np.testing.assert_allclose(T @ w, y, atol=1e-9)
    assert np.all((y >= low) & (y <= high))
    assert np.all((y[which] == low[which]) | (y[which] == high[which]))
    # In y: min |L^T T^-1 y + L^-1 g|^2 is the same problem.
    inverse = np.linalg.inv(T)
    best = lsq_linear(L.T @ inverse, -np.linalg.solve(L, g), (low, high), tol=1e-13)
    np.testing.assert_allclose(y, best.x, atol=1e-5 * np.abs(best.x).max())
    factor = np.tril(system)
    np.testing.assert_allclose(factor @ factor.T, T[which] @ Y, atol=1e-9 * np.abs(T @ Y).max())


def test_without_limits_in_reach_nothing_is_held() -> None:
    wish, y = np.array([-0.5, 0.25]), np.empty(2)
    which, _, _, force = hold(y, wish, np.eye(2), np.eye(2), np.full(2, -9.0), np.full(2, 9.0))
    np.testing.assert_array_equal(y, wish)
    assert which.size == force.size == 0
