"""How the point and the normal of a contact move with the bodies that touch.

Of two surfaces at a signed distance d, normal n from the first to the second: the nearest points are

    p1 = core1 + round1(n),    p2 = core2 + round2(-n),    p2 - p1 = d n,

where a core is a point of the body (an ellipsoid's centre, the corner of a box, the end of a capsule's axis)
or slides along a line of it (the axis, an edge), and `round` is the support function of what is around it,
whose derivative by the normal, G, holds the radii of curvature. Differentiated, that is a linear system for
the change of n and the slides. A face keeps its normal in its body instead: the floor, the side of a box.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.derivatives.spatial import skew

Array = NDArray[np.float64]

_CAPSULE, _BOX, _ELLIPSOID, _PLANE = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in ("CAPSULE", "BOX", "ELLIPSOID", "PLANE")
)
_FLAT = 1e-6
#: Lines that cross at a smaller sine count as parallel: the place where they are nearest is anywhere.
_PARALLEL = 0.05


class Sides(NamedTuple):
    """The shapes of C contacts, first and second: kind (C, 2), of MuJoCo's types, size (C, 2, 3) m, center
    (C, 2, 3) m, about the state's common point, R (C, 2, 3, 3), world from shape."""

    kind: NDArray[np.int32]
    size: Array
    center: Array
    R: Array


class Motions(NamedTuple):
    """Of C contacts, by the motion (turn, then velocity of the common point) of the first and the second
    body:
    moved (C, 2, 3, 6) of the point; turned (C, 2, 3, 6), the rotation vector of the frame."""

    moved: Array
    turned: Array


def sides(model: mujoco.MjModel, geoms: NDArray[np.int32], centers: Array, turns: Array) -> Sides:
    """The shapes geoms (C, 2), at centers (C, 2, 3) m and turns (C, 2, 9)."""
    return Sides(model.geom_type[geoms], model.geom_size[geoms], centers, turns.reshape(-1, 2, 3, 3))


def motions(shapes: Sides, bodies: NDArray[np.int64], point: Array, frame: Array, distance: Array) -> Motions:
    """bodies (C, 2), -1 for the world; point (C, 3) m; frame (C, 3, 3), rows: the normal and two tangents;
    distance (C,) m."""
    normal, tangents = frame[:, 0], frame[:, 1:]
    half = 0.5 * distance[:, None] * normal
    surface = np.stack([point - half, point + half], axis=1)  # (C, 2, 3)
    sign = np.array([1.0, -1.0])
    G, slide, face = _curvature(shapes, surface, sign[:, None] * normal[:, None])
    # By the motion of its own body: of the surface's point as a part of it, of a normal that is fixed in it.
    M, N = np.zeros((2, *surface.shape, 6))
    M[..., :3], M[..., 3:] = -skew(surface), np.eye(3)
    N[..., :3] = -skew(normal)[:, None]
    fixed = bodies < 0
    M[fixed], N[fixed] = 0.0, 0.0
    # By the motions of both, (C, 3, 12).
    nothing = np.zeros_like(M[:, 0])
    m0, m1 = np.concatenate([M[:, 0], nothing], -1), np.concatenate([nothing, M[:, 1]], -1)
    n0, n1 = np.concatenate([N[:, 0], nothing], -1), np.concatenate([nothing, N[:, 1]], -1)
    change, along = _turn_of_normal(G, slide, tangents, distance, (m0, m1), (n0, n1))
    flat, first = (face[:, :1] | face[:, 1:])[..., None], face[:, :1, None]
    change = np.where(flat, np.where(first, n0, n1), change)
    p0 = m0 + G[:, 0] @ (change - n0) + slide[:, 0, :, None] * along[:, :1]
    p1 = m1 - G[:, 1] @ (change - n1) + slide[:, 1, :, None] * along[:, 1:]
    # Beside a face the point follows the other surface, at half the distance.
    gap = normal[:, :, None] * (normal[:, None] @ (m1 - m0)) + distance[:, None, None] * change
    beside = np.where(first, p1 - 0.5 * gap, p0 + 0.5 * gap)
    moved = np.where(flat, beside, 0.5 * (p0 + p1))
    return Motions(_apart(moved), _apart(skew(normal) @ change))


def _curvature(shapes: Sides, surface: Array, outward: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """G (C, 2, 3, 3) m; slide (C, 2, 3), the direction in which the core may slide, zero where it is fixed;
    face (C, 2): the side whose normal is fixed in its body, one at most."""
    kind, size, center, R = shapes
    capsule, box, ellipsoid = (kind == k for k in (_CAPSULE, _BOX, _ELLIPSOID))
    P = np.eye(3) - outward[..., :, None] * outward[..., None, :]
    G = np.where(capsule[..., None, None], size[..., :1, None] * P, 0.0)
    A = (R * np.where(ellipsoid[..., None], size, 1.0)[..., None, :] ** 2) @ np.swapaxes(R, -1, -2)
    support = (A @ outward[..., None])[..., 0]
    reach = np.sqrt(np.sum(outward * support, axis=-1))[..., None, None]
    bent = A / reach - support[..., :, None] * support[..., None, :] / reach**3
    G = np.where(ellipsoid[..., None, None], bent, G)

    axis = R[..., 2]
    core = surface - size[..., :1] * outward - center
    inside = np.abs(np.sum(core * axis, axis=-1)) < size[..., 1] * (1.0 - _FLAT)
    slide = np.where((capsule & inside)[..., None], axis, 0.0)
    along = np.abs(np.swapaxes(R, -1, -2) @ outward[..., None])[..., 0] < _FLAT  # axes of a box in its side
    edge = box & (along.sum(axis=-1) == 1)
    slide = np.where(edge[..., None], (R @ along[..., None].astype(float))[..., 0], slide)
    face = kind == _PLANE
    face |= box & (along.sum(axis=-1) == 2) & ~face[:, ::-1]
    # A line that lies on a face, or along another line, touches it anywhere: it is taken to stay.
    slide[face.any(axis=1)] = 0.0
    crossing = np.linalg.norm(np.cross(slide[:, 0], slide[:, 1]), axis=-1)
    both = slide.any(axis=-1).all(axis=-1)
    slide[both & (crossing < _PARALLEL), 1] = 0.0
    return G, slide, face


def _turn_of_normal(
    G: Array, slide: Array, tangents: Array, distance: Array, m: tuple[Array, Array], n: tuple[Array, Array]
) -> tuple[Array, Array]:
    """The change of the normal (C, 3, 12) and the slides (C, 2, 12) where both sides are rounded."""
    T = np.swapaxes(tangents, -1, -2)  # (C, 3, 2)
    radii = tangents @ (G[:, 0] + G[:, 1]) @ T
    least = np.linalg.eigvalsh(radii)[:, 0]
    # Parts that are deeper in each other than they are curved have no nearest points.
    gap = np.maximum(distance, -0.5 * least) + 1e-9
    system, wanted = np.zeros((len(G), 4, 4)), np.zeros((len(G), 4, 12))
    system[:, :2, :2] = radii + gap[:, None, None] * np.eye(2)
    wanted[:, :2] = tangents @ (m[1] - m[0] + G[:, 0] @ n[0] + G[:, 1] @ n[1])
    for i, sign in enumerate((1.0, -1.0)):
        u = slide[:, i, :, None]
        system[:, :2, 2 + i] = sign * (tangents @ u)[..., 0]
        system[:, 2 + i, :2] = (np.swapaxes(u, -1, -2) @ T)[:, 0]
        system[:, 2 + i, 2 + i] = ~slide[:, i].any(axis=-1)
        wanted[:, 2 + i] = (np.swapaxes(u, -1, -2) @ n[i])[:, 0]
    found = np.asarray(np.linalg.solve(system, wanted), dtype=np.float64)
    return T @ found[:, :2], found[:, 2:]


def _apart(both: Array) -> Array:
    """(C, 3, 12), by the motions of both bodies, as (C, 2, 3, 6)."""
    return np.ascontiguousarray(both.reshape(-1, 3, 2, 6).transpose(0, 2, 1, 3))
