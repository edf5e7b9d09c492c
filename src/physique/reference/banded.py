"""Least squares over the frames of a clip, where a residual touches one frame or two neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Array = NDArray[np.float64]


class LeastSquares:
    """Minimise the sum of (weight (residual + J x))^2 over corrections x (T, n) of all frames.

    The normal equations are block banded: a frame meets the two after it.
    """

    def __init__(self, frames: int, unknowns: int) -> None:
        self._gradient = np.zeros((frames, unknowns))
        self._same = np.zeros((frames, unknowns, unknowns))
        #: Rows of the next frame, columns of this one; of the one after, only diagonals.
        self._next = np.zeros((frames, unknowns, unknowns))
        self._second = np.zeros((frames, unknowns))

    def add(self, residual: Array, J: Array, weight: Array, columns: NDArray[np.intp]) -> None:
        """residual (T, r), J (T, r, c) by the unknowns `columns` (c,); weight (T, r)."""
        scaled = J * weight[..., None]
        self._gradient[:, columns] += np.einsum("trj,tr->tj", scaled, residual * weight)
        self._same[:, columns[:, None], columns] += np.swapaxes(scaled, 1, 2) @ scaled

    def add_pairs(
        self, residual: Array, J: Array, J_next: Array, weight: Array, columns: NDArray[np.intp]
    ) -> None:
        """residual (T - 1, r) of neighbours: J (T - 1, r, c) by the first frame, J_next by the
        second."""
        first, second = J * weight[..., None], J_next * weight[..., None]
        scaled = residual * weight
        grid = columns[:, None], columns
        self._gradient[:-1, columns] += np.einsum("trj,tr->tj", first, scaled)
        self._gradient[1:, columns] += np.einsum("trj,tr->tj", second, scaled)
        self._same[:-1, *grid] += np.swapaxes(first, 1, 2) @ first
        self._same[1:, *grid] += np.swapaxes(second, 1, 2) @ second
        self._next[:-1, *grid] += np.swapaxes(second, 1, 2) @ first

    def keep_small(self, x: Array, weight: Array) -> None:
        """Draw x (T, n), what the unknowns add to, to zero; weight (n,)."""
        diagonal = np.arange(x.shape[1])
        self._gradient += weight**2 * x
        self._same[:, diagonal, diagonal] += weight**2

    def keep_still(self, x: Array, weight: Array) -> None:
        """Draw the first differences of x (T, n) to zero; weight (n,)."""
        square = weight**2
        diagonal = np.arange(x.shape[1])
        step = square * np.diff(x, axis=0)
        self._gradient[:-1] -= step
        self._gradient[1:] += step
        self._same[:-1, diagonal, diagonal] += square
        self._same[1:, diagonal, diagonal] += square
        self._next[:-1, diagonal, diagonal] -= square

    def keep_smooth(self, x: Array, weight: Array) -> None:
        """Draw the second differences of x (T, n) to zero; weight (n,)."""
        if len(x) < 3:
            return
        square = weight**2
        diagonal = np.arange(x.shape[1])
        bend = square * (x[2:] - 2 * x[1:-1] + x[:-2])
        for k, factor in enumerate((1.0, -2.0, 1.0)):
            frames = slice(k, len(x) - 2 + k)
            self._gradient[frames] += factor * bend
            self._same[frames, diagonal, diagonal] += factor**2 * square
        self._next[: len(x) - 2, diagonal, diagonal] -= 2 * square
        self._next[1 : len(x) - 1, diagonal, diagonal] -= 2 * square
        self._second[: len(x) - 2] += square

    def solve(self) -> Array:
        """The corrections x (T, n)."""
        frames, n = self._gradient.shape
        band = np.zeros((2 * n + 1, frames * n))
        for j in range(n):
            for i in range(n):
                if i >= j:
                    band[i - j, j::n] = self._same[:, i, j]
                band[n + i - j, j::n] = self._next[:, i, j]
            band[2 * n, j::n] = self._second[:, j]
        x = solveh_banded(band, -self._gradient.ravel(), lower=True, overwrite_ab=True)
        return np.asarray(x.reshape(frames, n))
