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
    found = solve_box(hessian, gradient, low, high)
    assert found is not None
    # min |L^T x + L^-1 g|^2 is the same problem.
    L = np.linalg.cholesky(hessian)
    best = lsq_linear(L.T, -np.linalg.solve(L, gradient), (low - 1e-12, high + 1e-12), tol=1e-12).x
    np.testing.assert_allclose(found.x, best, atol=1e-5)
    assert np.all((found.x >= low) & (found.x <= high))
    assert np.all((found.x > low)[found.free] | (gradient + hessian @ found.x <= 0)[found.free])
    inner = hessian[np.ix_(found.free, found.free)]
    L_free = np.tril(found.factor)
    np.testing.assert_allclose(L_free @ L_free.T, inner, atol=1e-9)


def test_without_limits_in_reach_it_is_newtons_step() -> None:
    hessian, gradient = np.diag([2.0, 4.0]), np.array([1.0, -1.0])
    found = solve_box(hessian, gradient, np.full(2, -9.0), np.full(2, 9.0))
    assert found is not None
    np.testing.assert_allclose(found.x, [-0.5, 0.25])
    assert found.free.all()


def test_a_hessian_that_is_not_positive_definite_is_refused() -> None:
    assert solve_box(np.diag([1.0, -1.0]), np.ones(2), -np.ones(2), np.ones(2)) is None
