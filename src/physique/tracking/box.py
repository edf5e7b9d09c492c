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

from physique.compiled import compiled
from physique.derivatives import dense

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PATIENCE = 3
_CHOICES = 500


@compiled
def hold(
    y: Array,
    which: Index,
    Y: Array,
    system: Array,
    force: Array,
    wish: Array,
    T: Array,
    factor: Array,
    low: Array,
    high: Array,
) -> int:
    """How many of y = T w meet their limits at the optimum; which of them, and how w follows.

    wish (n,): y of the optimum without limits. T (n, n); factor (n, n): the lower Cholesky factor
    of H; low < high (n,).

    Fills y (n,) with that of the optimum and, for the m limits c that hold: which (n,), Y (n, n)
    with H^-1 T_c^T in its first m columns, system (n, n) with the Cholesky factor of T_c Y, and
    force (n, 1) of each limit: w moves by -Y force. Returns m, or -1 where no choice stands.
    """
    n = len(wish)
    at = np.zeros(n, dtype=np.int64)  # +1 at the high limit, -1 at the low one
    wrong = np.zeros(n, dtype=np.int64)
    for i in range(n):
        y[i] = wish[i]
    fewest, patience, m = n + 1, _PATIENCE, 0
    for _ in range(_CHOICES):
        count = 0
        for i in range(n):
            wrong[i] = 0
            if at[i] == 0 and (y[i] > high[i] or y[i] < low[i]):
                wrong[i] = 1 if y[i] > high[i] else -1
                count += 1
        for i in range(m):
            if force[i, 0] * at[which[i]] < 0.0:  # it pulls at its limit
                wrong[which[i]] = 2
                count += 1
        if count == 0:
            return m
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
        m = 0
        for i in range(n):
            if at[i] != 0:
                which[m] = i
                m += 1
        for j in range(n):
            for i in range(m):
                Y[j, i] = T[which[i], j]
        dense.solve(factor, Y[:, :m])
        dense.fill(system, 0.0)
        for i in range(m):
            c = which[i]
            force[i, 0] = wish[c] - (high[c] if at[c] > 0 else low[c])
            for j in range(n):
                for k in range(m):
                    system[i, k] += T[c, j] * Y[j, k]
        if not dense.cholesky(system[:m, :m]):
            return -1
        dense.solve(system[:m, :m], force[:m])
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
    return -1
