"""Small convex quadratic programs with box limits, by projected Newton steps.

After Tassa, Mansard and Todorov, "Control-Limited Differential Dynamic Programming" (ICRA 2014).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotrs

Array = NDArray[np.float64]

_ITERATIONS = 30
_TOLERANCE = 1e-12
_SUFFICIENT = 0.1
_SHORTEST = 1e-4


class BoxSolution(NamedTuple):
    """x (n,), which of it is free of its limits (n,), and the lower Cholesky factor of the free
    rows and columns of the Hessian."""

    x: Array
    free: NDArray[np.bool_]
    factor: Array


def solve_box(hessian: Array, gradient: Array, low: Array, high: Array) -> BoxSolution | None:
    """The x between low and high (n,) that minimises x^T H x / 2 + g^T x; None if H (n, n) is not
    positive definite. low <= 0 <= high is not needed, low <= high is."""
    factor, failed = dpotrf(hessian, lower=1)
    if failed:
        return None
    x = -dpotrs(factor, gradient, lower=1)[0]
    free = np.ones(len(x), dtype=bool)
    if np.all((x >= low) & (x <= high)):
        return BoxSolution(x, free, factor)
    scale = abs(float(gradient @ x))  # twice the gain without limits
    x = np.clip(x, low, high)
    known = free
    value = _value(hessian, gradient, x)
    for _ in range(_ITERATIONS):
        slope = gradient + hessian @ x
        free = ~(((x <= low) & (slope > 0)) | ((x >= high) & (slope < 0)))
        if not free.any():
            return BoxSolution(x, free, np.zeros((0, 0)))
        if not np.array_equal(free, known):
            factor = dpotrf(hessian[np.ix_(free, free)], lower=1)[0]
            known = free
        step = np.zeros_like(x)
        step[free] = -dpotrs(factor, slope[free], lower=1)[0]
        expected = float(slope @ step)
        if -expected <= _TOLERANCE * scale:
            break
        length = 1.0
        while True:
            new = np.clip(x + length * step, low, high)
            new_value = _value(hessian, gradient, new)
            if new_value - value <= _SUFFICIENT * float(slope @ (new - x)):
                break
            length *= 0.5
            if length < _SHORTEST:
                return BoxSolution(x, free, factor)
        x, value = new, new_value
    return BoxSolution(x, known, factor)


def _value(hessian: Array, gradient: Array, x: Array) -> float:
    return float(0.5 * x @ hessian @ x + gradient @ x)
