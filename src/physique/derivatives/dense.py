"""Small dense matrices in compiled code: products and Cholesky factors without allocation. What a
function fills is its first argument.

BLAS is for large products; here calls to it would cost more than the arithmetic. Plain loops in
place of array expressions compile ten times faster.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.compiled import compiled

Array = NDArray[np.float64]


@compiled
def copy(out: Array, a: Array) -> None:
    """out (n, m) = a."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = a[i, j]


@compiled
def fill(out: Array, value: float) -> None:
    """out (n, m) = value."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = value


@compiled
def add(out: Array, a: Array) -> None:
    """out (n, m) += a."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] += a[i, j]


@compiled
def add_vector(out: Array, a: Array) -> None:
    """out (n,) += a."""
    for i in range(len(out)):
        out[i] += a[i]


@compiled
def apply(out: Array, matrix: Array, x: Array) -> None:
    """out (n,) = matrix (n, m) x (m,)."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * x[j]
        out[i] = total


@compiled
def multiply(out: Array, a: Array, b: Array) -> None:
    """out (n, k) = a (n, m) b (m, k), for matrices that are too small for BLAS."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for n in range(a.shape[1]):
                total += a[i, n] * b[n, j]
            out[i, j] = total


@compiled
def add_transposed_product(out: Array, a: Array, b: Array) -> None:
    """out (n, k) += a^T b, of a (m, n) and b (m, k)."""
    for i in range(a.shape[0]):
        for n in range(a.shape[1]):
            factor = a[i, n]
            for k in range(b.shape[1]):
                out[n, k] += factor * b[i, k]


@compiled
def cholesky(a: Array) -> bool:
    """Replace the lower triangle of a (n, n) by its Cholesky factor; False where it has none."""
    for i in range(len(a)):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            if i > j:
                a[i, j] = total / a[j, j]
            elif total > 0.0:
                a[i, i] = np.sqrt(total)
            else:
                return False
    return True


@compiled
def solve(factor: Array, x: Array) -> None:
    """x (n, k) = A^-1 x, in place, of the lower Cholesky factor of A (n, n)."""
    n, width = x.shape
    for i in range(n):
        for j in range(i):
            ratio = factor[i, j]
            for k in range(width):
                x[i, k] -= ratio * x[j, k]
        for k in range(width):
            x[i, k] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            ratio = factor[j, i]
            for k in range(width):
                x[i, k] -= ratio * x[j, k]
        for k in range(width):
            x[i, k] /= factor[i, i]
