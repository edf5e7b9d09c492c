"""Rotations as unit quaternions wxyz with w >= 0; arrays of any leading shape.

Products read left to right as frames do: `multiply(q_world_from_a, q_a_from_b)`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

IDENTITY: Array = np.array([1.0, 0.0, 0.0, 0.0])


def positive(q: Array) -> Array:
    """The same rotations (..., 4) with w >= 0."""
    return np.where(q[..., :1] < 0, -q, q)


def normalize(q: Array) -> Array:
    """Unit quaternions (..., 4) with w >= 0."""
    return positive(q / np.linalg.norm(q, axis=-1, keepdims=True))


def continuous(q: Array) -> Array:
    """The same rotations (T, ..., 4) over time with signs that follow on, for who blends numbers.

    Interpolation between such quaternions goes the shorter way, in whatever program.
    """
    flips = np.sum(q[1:] * q[:-1], axis=-1, keepdims=True) < 0
    odd = np.cumsum(flips, axis=0) % 2 == 1
    return np.concatenate([q[:1], np.where(odd, -q[1:], q[1:])])


def multiply(a: Array, b: Array) -> Array:
    """Hamilton product (..., 4): first b, then a."""
    a, b = np.asarray(a), np.asarray(b)
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    out = np.empty((*np.broadcast_shapes(aw.shape, bw.shape), 4))
    out[..., 0] = aw * bw - ax * bx - ay * by - az * bz
    out[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    out[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    out[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return out


def conjugate(q: Array) -> Array:
    """Inverse rotations (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: Array, v: Array) -> Array:
    """Vectors v (..., 3) turned by q (..., 4)."""
    u = q[..., 1:]
    t = 2.0 * np.cross(u, v)
    return v + q[..., :1] * t + np.cross(u, t)


def exp(w: Array) -> Array:
    """Quaternions (..., 4) of rotation vectors w (..., 3), rad."""
    angle = np.linalg.norm(w, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * w], axis=-1)


def log(q: Array) -> Array:
    """Rotation vectors (..., 3), rad, of at most pi, of unit quaternions q (..., 4)."""
    q = positive(q)
    s = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(s, q[..., :1])
    # sin(angle / 2) = s; near identity the ratio angle / s tends to 2 / w.
    ratio = np.where(s > 1e-8, angle / np.maximum(s, 1e-8), 2.0)
    return ratio * q[..., 1:]


def to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(np.asarray(q), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(R: Array) -> Array:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3)."""
    m = np.asarray(R)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # Four equivalent formulas; each is well conditioned where its leading component is largest.
    a = np.stack(
        [
            np.stack(
                [
                    1 + xx + yy + zz,
                    m[..., 2, 1] - m[..., 1, 2],
                    m[..., 0, 2] - m[..., 2, 0],
                    m[..., 1, 0] - m[..., 0, 1],
                ],
                -1,
            ),
            np.stack(
                [
                    m[..., 2, 1] - m[..., 1, 2],
                    1 + xx - yy - zz,
                    m[..., 0, 1] + m[..., 1, 0],
                    m[..., 0, 2] + m[..., 2, 0],
                ],
                -1,
            ),
            np.stack(
                [
                    m[..., 0, 2] - m[..., 2, 0],
                    m[..., 0, 1] + m[..., 1, 0],
                    1 - xx + yy - zz,
                    m[..., 1, 2] + m[..., 2, 1],
                ],
                -1,
            ),
            np.stack(
                [
                    m[..., 1, 0] - m[..., 0, 1],
                    m[..., 0, 2] + m[..., 2, 0],
                    m[..., 1, 2] + m[..., 2, 1],
                    1 - xx - yy + zz,
                ],
                -1,
            ),
        ],
        axis=-2,
    )
    best = np.argmax(np.stack([a[..., i, i] for i in range(4)], -1), axis=-1)
    return normalize(np.take_along_axis(a, best[..., None, None], axis=-2)[..., 0, :])


def about(axis: str, angle: Array) -> Array:
    """Quaternions (..., 4) of turns by angle (...), rad, about "x", "y" or "z"."""
    angle = np.asarray(angle, dtype=float)
    q = np.zeros((*angle.shape, 4))
    q[..., 0] = np.cos(angle / 2)
    q[..., 1 + "xyz".index(axis.lower())] = np.sin(angle / 2)
    return q


def from_euler(order: str, angles: Array) -> Array:
    """Quaternions (..., 4) of intrinsic rotations about the axes named by `order`, e.g. "zxy".

    angles: (..., len(order)) rad, in that order; the first axis is the outermost.
    """
    q = about(order[0], angles[..., 0])
    for i, axis in enumerate(order[1:], start=1):
        q = multiply(q, about(axis, angles[..., i]))
    return q


def to_euler(order: str, q: Array) -> Array:
    """Intrinsic Tait-Bryan angles (..., 3), rad, of rotations q (..., 4); the middle in +-pi/2."""
    i, j, k = ("xyz".index(a) for a in order.lower())
    if len({i, j, k}) != 3:
        raise ValueError(f"order {order!r} must name three different axes")
    s = 1.0 if (j - i) % 3 == 1 else -1.0
    R = to_matrix(q)
    middle = np.arcsin(np.clip(s * R[..., i, k], -1.0, 1.0))
    first = np.arctan2(-s * R[..., j, k], R[..., k, k])
    last = np.arctan2(-s * R[..., i, j], R[..., i, i])
    return np.stack([first, middle, last], axis=-1)


def unwrap_euler(angles: Array) -> Array:
    """Tait-Bryan angles (T, ..., 3), rad, of the same rotations, each nearest to the frame before.

    A rotation has two triples, (a, b, c) and (a + pi, pi - b, c + pi), each up to whole turns:
    taking principal values jumps between them.
    """
    out = angles.copy()
    mirror = np.array([1.0, -1.0, 1.0])
    for t in range(1, len(out)):
        choices = np.stack([out[t], mirror * out[t] + np.pi])
        choices += 2 * np.pi * np.rint((out[t - 1] - choices) / (2 * np.pi))
        best = np.abs(choices - out[t - 1]).sum(-1).argmin(0)
        out[t] = np.take_along_axis(choices, best[None, ..., None], axis=0)[0]
    return out


def slerp(a: Array, b: Array, t: Array) -> Array:
    """Rotations (..., 4) a fraction t (...) of the shortest way from a to b."""
    return normalize(multiply(a, exp(np.asarray(t)[..., None] * log(multiply(conjugate(a), b)))))
