"""Quadratic programs with limits against a general solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from physique.tracking.box import hold


def empty(n: int) -> tuple[np.ndarray, ...]:
    """What `hold` fills: y, which, Y, system, force."""
    return np.empty(n), np.empty(n, int), np.empty((n, n)), np.empty((n, n)), np.empty((n, 1))


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
    y, which, Y, system, force = held = empty(n)
    m = hold(*held, T @ w, T, L, low, high)
    which, Y, system, force = which[:m], Y[:, :m], system[:m, :m], force[:m]
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
    wish, held = np.array([-0.5, 0.25]), empty(2)
    assert hold(*held, wish, np.eye(2), np.eye(2), np.full(2, -9.0), np.full(2, 9.0)) == 0
    np.testing.assert_array_equal(held[0], wish)
