"""Convex quadratic programs with limits, in the variables of their Cholesky factor.

Minimise w^T H w / 2 + g^T w where low <= T w <= high. Each limit that holds is one equation, so a
choice of limits costs one solution by the factor of H and a system as large as there are limits.

The choice is found by block principal pivoting: all that is wrong changes at once, and where this
does not help any more, one at a time, which always ends (Judice and Pires, "A block principal
pivoting algorithm for large-scale strictly monotone linear complementarity problems", 1994).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique import dense
from physique.compiled import compiled

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PATIENCE = 3
_CHOICES = 500


@compiled
def hold(
    y: Array, wish: Array, T: Array, factor: Array, low: Array, high: Array
) -> tuple[Index, Array, Array, Array]:
    """Which of y = T w meet their limits at the optimum, which of them m; and how w follows.

    wish (n,): y of the optimum without limits; y (n,) becomes that of the optimum. T (n, n);
    factor (n, n): the lower Cholesky factor of H; low < high (n,).

    Returns which (m,), Y = H^-1 T_c^T (n, m), the Cholesky factor of T_c Y (m, m), and the force
    (m, 1) of each limit: w moves by -Y force. No choice is returned as a force that is NaN.
    """
    n = len(wish)
    at = np.zeros(n, dtype=np.int64)  # +1 at the high limit, -1 at the low one
    wrong = np.zeros(n, dtype=np.int64)
    for i in range(n):
        y[i] = wish[i]
    fewest, patience = n + 1, _PATIENCE
    which, Y, system = np.flatnonzero(at), np.empty((n, 0)), np.empty((0, 0))
    force = np.empty((0, 1))
    for _ in range(_CHOICES):
        count = 0
        for i in range(n):
            wrong[i] = 0
            if at[i] == 0 and (y[i] > high[i] or y[i] < low[i]):
                wrong[i] = 1 if y[i] > high[i] else -1
                count += 1
        for i in range(len(which)):
            if force[i, 0] * at[which[i]] < 0.0:  # it pulls at its limit
                wrong[which[i]] = 2
                count += 1
        if count == 0:
            return which, Y, system, force
        if count < fewest:
            fewest, patience = count, _PATIENCE
        elif patience > 0:
            patience -= 1
        one = patience == 0 and count >= fewest
        for i in range(n - 1, -1, -1):
            if wrong[i] != 0:
                at[i] = 0 if wrong[i] == 2 else wrong[i]
                if one:
                    break
        which = np.flatnonzero(at)
        m = len(which)
        Y, system, force = np.empty((n, m)), np.zeros((m, m)), np.empty((m, 1))
        for j in range(n):
            for i in range(m):
                Y[j, i] = T[which[i], j]
        dense.solve(factor, Y)
        for i in range(m):
            c = which[i]
            force[i, 0] = wish[c] - (high[c] if at[c] > 0 else low[c])
            for j in range(n):
                for k in range(m):
                    system[i, k] += T[c, j] * Y[j, k]
        if not dense.cholesky(system):
            break
        dense.solve(system, force)
        for i in range(n):
            y[i] = wish[i]
        for j in range(n):
            away = 0.0
            for i in range(m):
                away += Y[j, i] * force[i, 0]
            for i in range(n):
                y[i] -= T[i, j] * away
        for i in range(m):
            y[which[i]] = high[which[i]] if at[which[i]] > 0 else low[which[i]]
    force = np.full((len(which), 1), np.nan)
    return which, Y, system, force
