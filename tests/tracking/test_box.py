"""Box-constrained quadratic programs against a general solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from physique.tracking.box import solve_box


@pytest.mark.parametrize("seed", range(20))
def test_agrees_with_a_general_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 30))
    root = rng.normal(size=(n, n)) + 0.1 * np.eye(n)
    hessian, gradient = root @ root.T + 1e-3 * np.eye(n), rng.normal(size=n) * 3
    low, high = -rng.uniform(0, 0.5, n), rng.uniform(0, 0.5, n)
    x, free = np.zeros(n), np.empty(n, dtype=bool)
    assert solve_box(x, free, hessian, gradient, low, high)
    # min |L^T x + L^-1 g|^2 is the same problem.
    L = np.linalg.cholesky(hessian)
    best = lsq_linear(L.T, -np.linalg.solve(L, gradient), (low - 1e-12, high + 1e-12), tol=1e-12).x
    np.testing.assert_allclose(x, best, atol=1e-5)
    assert np.all((x >= low) & (x <= high))
    slope = gradient + hessian @ x
    np.testing.assert_allclose(slope[free], 0.0, atol=1e-6 * np.abs(gradient).max())
    # At a limit the slope points out of the box.
    assert np.all(np.where(x[~free] <= low[~free], slope[~free], -slope[~free]) >= 0)


def test_without_limits_in_reach_it_is_newtons_step() -> None:
    hessian, gradient = np.diag([2.0, 4.0]), np.array([1.0, -1.0])
    x, free = np.zeros(2), np.empty(2, dtype=bool)
    assert solve_box(x, free, hessian, gradient, np.full(2, -9.0), np.full(2, 9.0))
    np.testing.assert_allclose(x, [-0.5, 0.25])
    assert free.all()


def test_a_hessian_that_is_not_positive_definite_is_refused() -> None:
    x, free = np.zeros(2), np.empty(2, dtype=bool)
    assert not solve_box(x, free, np.diag([1.0, -1.0]), np.ones(2), -np.ones(2), np.ones(2))
