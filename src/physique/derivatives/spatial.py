"""Spatial vectors (Featherstone): motions and forces of six numbers, angular part first.

All vectors of one state are about one fixed point, MuJoCo's `subtree_com` of the pelvis, along
the world's axes, so that nothing is ever transformed from frame to frame. The functions are small
loops for compiled code; where they fill an argument, it is the first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.compiled import compiled
from physique.derivatives.dense import fill

Array = NDArray[np.float64]


@compiled
def cross(out: Array, a: Array, b: Array) -> None:
    """out (3,) = a x b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def motion_cross(out: Array, v: Array, m: Array) -> None:
    """out (6,) = v x m: the rate of a motion m when it moves with velocity v."""
    out[0] = v[1] * m[2] - v[2] * m[1]
    out[1] = v[2] * m[0] - v[0] * m[2]
    out[2] = v[0] * m[1] - v[1] * m[0]
    out[3] = v[1] * m[5] - v[2] * m[4] + v[4] * m[2] - v[5] * m[1]
    out[4] = v[2] * m[3] - v[0] * m[5] + v[5] * m[0] - v[3] * m[2]
    out[5] = v[0] * m[4] - v[1] * m[3] + v[3] * m[1] - v[4] * m[0]


@compiled
def force_cross(out: Array, v: Array, f: Array) -> None:
    """out (6,) = v x* f: the rate of a force f when it moves with velocity v."""
    out[0] = v[1] * f[2] - v[2] * f[1] + v[4] * f[5] - v[5] * f[4]
    out[1] = v[2] * f[0] - v[0] * f[2] + v[5] * f[3] - v[3] * f[5]
    out[2] = v[0] * f[1] - v[1] * f[0] + v[3] * f[4] - v[4] * f[3]
    out[3] = v[1] * f[5] - v[2] * f[4]
    out[4] = v[2] * f[3] - v[0] * f[5]
    out[5] = v[0] * f[4] - v[1] * f[3]


@compiled
def set_skew(out: Array, a: Array, scale: float) -> None:
    """out (3, 3) = scale [a x]."""
    x, y, z = scale * a[0], scale * a[1], scale * a[2]
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2], out[1, 2] = -z, y, -x
    out[1, 0], out[2, 0], out[2, 1] = z, -y, x


@compiled
def motion_cross_matrix(out: Array, v: Array) -> None:
    """out (6, 6): m -> v x m."""
    fill(out[:3, 3:], 0.0)
    set_skew(out[:3, :3], v[:3], 1.0)
    set_skew(out[3:, 3:], v[:3], 1.0)
    set_skew(out[3:, :3], v[3:], 1.0)


@compiled
def force_matrix(out: Array, f: Array) -> None:
    """out (6, 6): v -> v x* f."""
    fill(out[3:, 3:], 0.0)
    set_skew(out[:3, :3], f[:3], -1.0)
    set_skew(out[:3, 3:], f[3:], -1.0)
    set_skew(out[3:, :3], f[3:], -1.0)


@compiled
def inertia_matrix(out: Array, packed: Array) -> None:
    """out (6, 6): of MuJoCo's `cinert` (10,), about the common point, kg m2 and kg."""
    fill(out, 0.0)
    for i in range(3):
        out[i, i] = packed[i]
        out[3 + i, 3 + i] = packed[9]
    out[0, 1] = out[1, 0] = packed[3]
    out[0, 2] = out[2, 0] = packed[4]
    out[1, 2] = out[2, 1] = packed[5]
    set_skew(out[:3, 3:], packed[6:9], 1.0)
    set_skew(out[3:, :3], packed[6:9], -1.0)


@compiled
def dot(a: Array, b: Array) -> float:
    """a . b of two vectors of six."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


def skew(x: Array) -> Array:
    """(..., 3, 3) of x (..., 3): the matrix of x times, not compiled."""
    out = np.zeros((*x.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., j, i], out[..., i, j] = x[..., k], -x[..., k]
    return out
