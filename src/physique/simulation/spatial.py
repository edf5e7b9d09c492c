"""Spatial vectors (Featherstone): motions and forces of six numbers, angular part first.

All vectors of one state are about one fixed point, MuJoCo's `subtree_com` of the pelvis, along
the world's axes, so that nothing is ever transformed from frame to frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def skew(a: Array) -> Array:
    """Matrices (..., 3, 3) of the cross product with a (..., 3)."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    out = np.zeros((*a.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2] = -z, y
    out[..., 1, 0], out[..., 1, 2] = z, -x
    out[..., 2, 0], out[..., 2, 1] = -y, x
    return out


def cross(a: Array, b: Array) -> Array:
    """a x b of (..., 3); much faster than `np.cross` for many small vectors."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    out[..., 0] = a1 * b2 - a2 * b1
    out[..., 1] = a2 * b0 - a0 * b2
    out[..., 2] = a0 * b1 - a1 * b0
    return out


def motion_cross(v: Array, m: Array) -> Array:
    """v x m of motions (..., 6): the rate of m when it moves with velocity v."""
    w, lin = v[..., :3], v[..., 3:]
    return np.concatenate(
        [cross(w, m[..., :3]), cross(w, m[..., 3:]) + cross(lin, m[..., :3])], axis=-1
    )


def force_cross(v: Array, f: Array) -> Array:
    """v x* f of a motion and a force (..., 6): the rate of f when it moves with velocity v."""
    w, lin = v[..., :3], v[..., 3:]
    return np.concatenate(
        [cross(w, f[..., :3]) + cross(lin, f[..., 3:]), cross(w, f[..., 3:])], axis=-1
    )


def motion_cross_matrix(v: Array) -> Array:
    """Matrices (..., 6, 6) of m -> v x m."""
    out = np.zeros((*v.shape[:-1], 6, 6))
    w = skew(v[..., :3])
    out[..., :3, :3] = out[..., 3:, 3:] = w
    out[..., 3:, :3] = skew(v[..., 3:])
    return out


def force_matrix(f: Array) -> Array:
    """Matrices (..., 6, 6) of v -> v x* f."""
    out = np.zeros((*f.shape[:-1], 6, 6))
    out[..., :3, :3] = -skew(f[..., :3])
    out[..., :3, 3:] = out[..., 3:, :3] = -skew(f[..., 3:])
    return out


def inertia_matrix(packed: Array) -> Array:
    """Inertias (..., 6, 6) of MuJoCo's `cinert` (..., 10): about the common point, kg m2 and kg."""
    out = np.zeros((*packed.shape[:-1], 6, 6))
    xx, yy, zz, xy, xz, yz = np.moveaxis(packed[..., :6], -1, 0)
    for (i, j), value in {(0, 0): xx, (1, 1): yy, (2, 2): zz, (0, 1): xy, (0, 2): xz,
                          (1, 2): yz}.items():  # fmt: skip
        out[..., i, j] = out[..., j, i] = value
    moment = skew(packed[..., 6:9])
    out[..., :3, 3:] = moment
    out[..., 3:, :3] = -moment
    for i in range(3, 6):
        out[..., i, i] = packed[..., 9]
    return out
