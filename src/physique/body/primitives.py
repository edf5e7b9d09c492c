"""Capsules, boxes and ellipsoids: signed distance, volume, inertia, surface samples, triangles.

`size` (3,) m is that of `capsule_body.Part`: capsule (radius, half length, 0), box half extents,
ellipsoid semi-axes. Everything here is in the primitive's own frame unless a function says world.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from physique.body.capsule_body import Shape

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Primitive:
    """One shape in the world; the geometric half of a `Part`, with the same meaning of fields."""

    name: str
    shape: Shape
    size: Array
    center: Array
    R_world_from_part: Array


class Solid(Protocol):
    """What both `Primitive` and `Part` have."""

    @property
    def shape(self) -> Shape: ...  # noqa: D102
    @property
    def size(self) -> Array: ...  # noqa: D102
    @property
    def center(self) -> Array: ...  # noqa: D102
    @property
    def R_world_from_part(self) -> Array: ...  # noqa: D102


def signed_distance(solid: Solid, points: Array) -> Array:
    """Distance (N,), m, of world points (N, 3) to the surface, negative inside.

    Exact for capsules and boxes; for ellipsoids first order, exact in sign and on the surface.
    """
    p = (points - solid.center) @ solid.R_world_from_part
    size = solid.size
    if solid.shape == "capsule":
        p = p.copy()
        p[:, 2] -= np.clip(p[:, 2], -size[1], size[1])
        return np.sqrt(np.einsum("ni,ni->n", p, p)) - size[0]
    if solid.shape == "box":
        q = np.abs(p) - size
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        return outside + np.minimum(q.max(axis=1), 0.0)
    scaled = np.linalg.norm(p / size, axis=1)
    slope = np.linalg.norm(p / size**2, axis=1)
    deepest = -float(size.min())
    return np.where(slope > 1e-12, scaled * (scaled - 1.0) / np.maximum(slope, 1e-12), deepest)


def volume(solid: Solid) -> float:
    """m3."""
    a, b, c = solid.size
    if solid.shape == "capsule":
        return float(np.pi * a**2 * (2.0 * b + 4.0 / 3.0 * a))
    if solid.shape == "box":
        return float(8.0 * a * b * c)
    return float(4.0 / 3.0 * np.pi * a * b * c)


def inertia(solid: Solid, mass: float) -> Array:
    """Inertia (3, 3), kg m2, about the centre along the world axes, at uniform density."""
    a, b, c = solid.size
    if solid.shape == "capsule":
        whole = 2.0 * b + 4.0 / 3.0 * a
        tube, balls = mass * 2.0 * b / whole, mass * 4.0 / 3.0 * a / whole
        axial = tube * a**2 / 2.0 + balls * 2.0 / 5.0 * a**2
        across = tube * (a**2 / 4.0 + b**2 / 3.0) + balls * (2.0 / 5.0 * a**2 + b**2 + 3.0 / 4.0 * a * b)
        diagonal = np.array([across, across, axial])
    else:
        squares = np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
        diagonal = mass * squares / (3.0 if solid.shape == "box" else 5.0)
    R = solid.R_world_from_part
    return (R * diagonal) @ R.T


def primitive_mesh(solid: Solid, spacing: float = 0.02) -> tuple[Array, NDArray[np.int32]]:
    """Closed triangle mesh of the surface, world: vertices (V, 3) m and outward faces (F, 3).

    spacing: wanted edge length, m.
    """
    if solid.shape == "box":
        local, faces = _box_mesh(solid.size, spacing)
    else:
        local, faces = _round_mesh(solid, spacing)
    return local @ solid.R_world_from_part.T + solid.center, faces


def surface_samples(solid: Solid, spacing: float) -> tuple[Array, Array]:
    """World points (N, 3) m about `spacing` apart on the surface and the area (N,) m2 of each."""
    # Centres of the two halves of squares of this edge lie half an edge apart.
    vertices, faces = primitive_mesh(solid, 1.4 * spacing)
    return vertices[faces].mean(axis=1), triangle_areas(vertices, faces)


def triangle_samples(vertices: Array, faces: NDArray[np.int32], spacing: float) -> tuple[Array, Array]:
    """Points (N, 3) at most about `spacing` apart on triangles, and their areas (N,)."""
    corners = vertices[faces]
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    area = triangle_areas(vertices, faces)
    parts = np.maximum(1, np.ceil(edge / spacing - 1e-9).astype(int))
    points, areas = [], []
    for n in np.unique(parts):
        chosen = np.nonzero(parts == n)[0]
        bary = _cell_centres(int(n))
        points.append(np.einsum("bk,fkc->fbc", bary, corners[chosen]).reshape(-1, 3))
        areas.append(np.repeat(area[chosen] / len(bary), len(bary)))
    return np.concatenate(points), np.concatenate(areas)


def triangle_areas(vertices: Array, faces: NDArray[np.int32]) -> Array:
    """Areas (F,), m2."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def _cell_centres(n: int) -> Array:
    """Barycentric centres (n * n, 3) of the n * n small triangles that fill a triangle."""
    up = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    down = [(i + 2 / 3, j + 2 / 3) for i in range(n - 1) for j in range(n - 1 - i)]
    uv = np.array(up + down) / n
    return np.column_stack([1.0 - uv.sum(axis=1), uv])


def _round_mesh(solid: Solid, spacing: float) -> tuple[Array, NDArray[np.int32]]:
    """Rings of constant latitude; a capsule's are pulled apart at the equator."""
    capsule = solid.shape == "capsule"
    widest = float(solid.size[0] if capsule else solid.size.max())
    rings = max(4, int(np.ceil(np.pi * widest / spacing / 2)) * 2)
    around = max(8, int(np.ceil(2 * np.pi * widest / spacing)))
    latitude = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)[1:-1]
    shift = np.zeros(len(latitude))
    if capsule:
        tube = max(1, int(np.ceil(2 * solid.size[1] / spacing)))
        south, north = latitude[latitude < -1e-9], latitude[latitude > 1e-9]
        latitude = np.concatenate([south, np.zeros(tube + 1), north])
        half = float(solid.size[1])
        shift = np.concatenate(
            [np.full(len(south), -half), np.linspace(-half, half, tube + 1), np.full(len(north), half)]
        )
    longitude = 2 * np.pi * np.arange(around) / around
    scale = np.full(3, widest) if capsule else solid.size
    unit = np.stack(
        [
            np.cos(latitude)[:, None] * np.cos(longitude),
            np.cos(latitude)[:, None] * np.sin(longitude),
            np.repeat(np.sin(latitude)[:, None], around, axis=1),
        ],
        axis=-1,
    )
    body = unit * scale
    body[..., 2] += shift[:, None]
    end = float(scale[2] + (solid.size[1] if capsule else 0.0))
    vertices = np.concatenate([body.reshape(-1, 3), [[0, 0, -end], [0, 0, end]]])
    ring = np.arange(len(latitude) * around).reshape(len(latitude), around)
    a, b = ring[:-1], ring[1:]
    a1, b1 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    bottom, top = len(vertices) - 2, len(vertices) - 1
    first, last = ring[0], ring[-1]
    quads = [np.stack([a, a1, b1], -1).reshape(-1, 3), np.stack([a, b1, b], -1).reshape(-1, 3)]
    caps = [
        np.stack([np.full(around, bottom), np.roll(first, -1), first], -1),
        np.stack([np.full(around, top), last, np.roll(last, -1)], -1),
    ]
    return vertices, np.concatenate(quads + caps).astype(np.int32)


def _box_mesh(size: Array, spacing: float) -> tuple[Array, NDArray[np.int32]]:
    """Six grids that share no vertices; closed all the same, as their borders coincide."""
    vertices, faces = [], []
    count = 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        nu, nv = (max(1, int(np.ceil(2 * size[k] / spacing))) for k in (u, v))
        gu, gv = np.meshgrid(
            np.linspace(-size[u], size[u], nu + 1), np.linspace(-size[v], size[v], nv + 1), indexing="ij"
        )
        ids = np.arange(gu.size).reshape(gu.shape)
        a, b, c, d = ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]
        quad = np.concatenate(
            [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
        )
        for sign in (1.0, -1.0):
            side = np.empty((gu.size, 3))
            side[:, u], side[:, v], side[:, axis] = gu.ravel(), gv.ravel(), sign * size[axis]
            vertices.append(side)
            faces.append((quad if sign > 0 else quad[:, ::-1]) + count)
            count += len(side)
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32)
