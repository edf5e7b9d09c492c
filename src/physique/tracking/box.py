"""Small convex quadratic programs with box limits, by projected Newton steps.

After Tassa, Mansard and Todorov, "Control-Limited Differential Dynamic Programming" (ICRA 2014).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique import dense
from physique.compiled import compiled

Array = NDArray[np.float64]

_ITERATIONS = 30
_TOLERANCE = 1e-12
_SUFFICIENT = 0.1
_SHORTEST = 1e-4


@compiled
def solve_box(
    x: Array, free: NDArray[np.bool_], hessian: Array, gradient: Array, low: Array, high: Array
) -> bool:
    """Fill x (n,) with what minimises x^T H x / 2 + g^T x between low and high (n,), and `free`
    (n,) with which of it stays clear of its limits. False if H (n, n) is not positive definite.

    low <= 0 <= high is not needed, low <= high is. What x holds before is where the search begins.
    """
    n = len(x)
    for i in range(n):
        x[i] = min(max(x[i], low[i]), high[i])
        free[i] = True
    slope, factor = np.empty(n), np.empty((n, n))
    step, new = np.empty((n, 1)), np.empty(n)
    which = np.empty(n, dtype=np.int64)
    value = _slope(slope, hessian, gradient, x)
    scale = -1.0
    count = -1
    for _ in range(_ITERATIONS):
        changed = count < 0
        count = 0
        for i in range(n):
            held = (x[i] <= low[i] and slope[i] > 0.0) or (x[i] >= high[i] and slope[i] < 0.0)
            changed = changed or held == free[i]
            free[i] = not held
            if not held:
                which[count] = i
                count += 1
        if count == 0:
            return True
        if changed:
            for i in range(count):
                for j in range(i + 1):
                    factor[i, j] = hessian[which[i], which[j]]
            if not dense.cholesky(factor[:count, :count]):
                return False
        for i in range(count):
            step[i, 0] = -slope[which[i]]
        dense.solve(factor[:count, :count], step[:count])
        expected = 0.0
        for i in range(count):
            expected += slope[which[i]] * step[i, 0]
        if scale < 0.0:
            scale = -expected
        if -expected <= _TOLERANCE * scale:
            return True
        length = 1.0
        while True:
            for i in range(n):
                new[i] = x[i]
            for i in range(count):
                k = which[i]
                new[k] = min(max(x[k] + length * step[i, 0], low[k]), high[k])
            gained = 0.0
            for i in range(n):
                gained += slope[i] * (new[i] - x[i])
            new_value = _value(hessian, gradient, new)
            if new_value - value <= _SUFFICIENT * gained:
                break
            length *= 0.5
            if length < _SHORTEST:
                return True
        for i in range(n):
            x[i] = new[i]
        value = _slope(slope, hessian, gradient, x)
    return True


@compiled
def _value(hessian: Array, gradient: Array, x: Array) -> float:
    total = 0.0
    for i in range(len(x)):
        row = gradient[i]
        for j in range(len(x)):
            row += 0.5 * hessian[i, j] * x[j]
        total += row * x[i]
    return total


@compiled
def _slope(out: Array, hessian: Array, gradient: Array, x: Array) -> float:
    """Fill out (n,) with H x + g; the value at x."""
    total = 0.0
    for i in range(len(x)):
        row = 0.0
        for j in range(len(x)):
            row += hessian[i, j] * x[j]
        out[i] = row + gradient[i]
        total += (0.5 * row + gradient[i]) * x[i]
    return total
