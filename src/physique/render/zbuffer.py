"""What a camera sees of triangles, and a grid from above or below: z-buffers in compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from physique.compiled import compiled
from physique.render.camera import Camera

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Integers = NDArray[np.int32]

#: The samples of a pixel lie on a grid that is turned, so that steep and flat edges too are smooth.
SLANT = 0.25  # samples
_NEAR = 0.05  # m, before the camera; triangles that reach nearer are left out


@dataclass(frozen=True)
class Triangles:
    """What is drawn: vertices (V, 3) m, world; normals (V, 3), unit; colours (V, 3), 0 to 1;
    faces (F, 3), counter-clockwise seen from outside."""

    vertices: Array
    faces: Integers
    normals: Array
    colours: Array


def triangles(parts: Sequence[tuple[Array, Integers, Array]]) -> Triangles:
    """Meshes, each (vertices (V, 3), faces (F, 3), colours (V, 3)), as one, with smooth normals."""
    if not parts:
        return Triangles(np.zeros((0, 3)), np.zeros((0, 3), np.int32), *np.zeros((2, 0, 3)))
    starts = np.cumsum([0, *(len(v) for v, _, _ in parts[:-1])])
    vertices = np.concatenate([v for v, _, _ in parts])
    faces = np.concatenate([f + start for (_, f, _), start in zip(parts, starts)]).astype(np.int32)
    normals = np.zeros_like(vertices)
    _add_normals(vertices, faces, normals)
    return Triangles(vertices, faces, normals, np.concatenate([c for _, _, c in parts]))


class Layer(NamedTuple):
    """Triangles as the camera sees them."""

    vertices: Array
    faces: Integers
    normals: Array
    colours: Array
    screen: Array  # (V, 3): column and row, in samples, and 1 / depth of each vertex
    depth: Floats  # (2 h, 2 w): 1 / depth of what each sample sees, 0 for nothing; or (0, 0)
    owner: Integers  # (2 h, 2 w): the triangle that it sees, -1 for none


def pixels_of_a_metre(camera: Camera, height: int) -> float:
    """How many pixels wide a metre is at a distance of a metre, in a picture of this height."""
    return float(height / (2.0 * np.tan(np.radians(camera.fov) / 2.0)))


def see(what: Triangles, camera: Camera, size: tuple[int, int]) -> Layer:
    """What the samples of a picture of `size` (w, h), four a pixel, see of the triangles."""
    width, height = size
    right, up, forward = camera.axes() @ (what.vertices - camera.eye).T
    scale = 2.0 * pixels_of_a_metre(camera, height)
    nearness = np.where(forward > _NEAR, 1.0 / np.maximum(forward, _NEAR), np.nan)
    screen = np.stack([width + scale * right * nearness, height - scale * up * nearness, nearness], axis=1)
    # A layer without triangles needs no samples.
    samples = (2 * height, 2 * width) if len(what.faces) else (0, 0)
    depth = np.zeros(samples, dtype=np.float32)
    owner = np.full(samples, -1, dtype=np.int32)
    fill(screen, what.faces, SLANT, depth, owner)
    return Layer(what.vertices, what.faces, what.normals, what.colours, screen, depth, owner)


def grid_view(
    points: Array, faces: Integers, cell: float, most: int, margin: float = 0.05
) -> tuple[Array, Floats]:
    """A view along the third axis: (corner of two, cell, zero of heights), and heights above that
    zero (n, n) of what is seen, 0 where nothing is.

    cell: m, of the square grid, or more where it would have more than `most` a side.
    """
    if len(points) == 0:
        return np.array([0.0, 0.0, 1.0, 0.0]), np.zeros((1, 1), dtype=np.float32)
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    extent = float((high - low)[:2].max())
    cell = max(cell, extent / most)
    cells = int(np.ceil(extent / cell))
    screen = np.empty_like(points)
    screen[:, :2] = (points[:, :2] - low[:2]) / cell
    screen[:, 2] = points[:, 2] - low[2]
    tall = np.zeros((cells, cells), dtype=np.float32)
    fill(screen, faces, 0.0, tall, np.empty((cells, cells), dtype=np.int32))
    return np.array([low[0], low[1], cell, low[2]]), tall


@compiled
def _add_normals(vertices: Array, faces: Integers, normals: Array) -> None:
    """Unit normals of vertices: the mean of the faces around, weighted by area."""
    for f in range(len(faces)):
        a, b, c = faces[f]
        ax, ay, az = vertices[a]
        bx, by, bz = vertices[b]
        cx, cy, cz = vertices[c]
        nx = (by - ay) * (cz - az) - (bz - az) * (cy - ay)
        ny = (bz - az) * (cx - ax) - (bx - ax) * (cz - az)
        nz = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        for i in (a, b, c):
            normals[i, 0] += nx
            normals[i, 1] += ny
            normals[i, 2] += nz
    for i in range(len(normals)):
        length = np.sqrt(normals[i, 0] ** 2 + normals[i, 1] ** 2 + normals[i, 2] ** 2)
        if length > 0.0:
            for k in range(3):
                normals[i, k] /= length


@compiled
def place(row: int, column: int, slant: float) -> tuple[float, float]:
    """Where a sample is (x, y): about the middle of its cell, as far as the slant of the grid."""
    return (
        column + 0.5 + (slant if row % 2 == 0 else -slant),
        row + 0.5 + (slant if column % 2 == 1 else -slant),
    )


@compiled
def fill(screen: Array, faces: Integers, slant: float, depth: Floats, owner: Integers) -> None:
    """Draw triangles whose corners (column, row, nearness) go round clockwise, as rows count
    downwards: into depth the largest nearness at each sample, into owner whose it is.
    """
    rows, columns = depth.shape
    reach = 0.5 + slant
    for f in range(len(faces)):
        ax, ay, az = screen[faces[f, 0]]
        bx, by, bz = screen[faces[f, 1]]
        cx, cy, cz = screen[faces[f, 2]]
        area = (cx - ax) * (by - ay) - (bx - ax) * (cy - ay)
        if not area > 0.0:  # from behind, or not a number
            continue
        left = max(int(np.ceil(min(ax, bx, cx) - reach)), 0)
        right = min(int(np.floor(max(ax, bx, cx) - 1.0 + reach)), columns - 1)
        top = max(int(np.ceil(min(ay, by, cy) - reach)), 0)
        bottom = min(int(np.floor(max(ay, by, cy) - 1.0 + reach)), rows - 1)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                x, y = place(row, column, slant)
                a = (cy - by) * (x - bx) - (cx - bx) * (y - by)
                b = (ay - cy) * (x - cx) - (ax - cx) * (y - cy)
                c = area - a - b
                if a < 0.0 or b < 0.0 or c < 0.0:
                    continue
                z = (a * az + b * bz + c * cz) / area
                if z > depth[row, column]:
                    depth[row, column] = z
                    owner[row, column] = f
