"""The inside of a closed mesh as equal small cubes, for volumes, masses and inertias."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def inside_points(vertices: Array, faces: NDArray[np.int32], edge: float) -> Array:
    """Centres (N, 3), m, of the cubes of this edge, m, whose centres lie inside the mesh.

    The grid is symmetric about y = 0. Where the mesh overlaps itself (thighs, armpits) a point
    counts once: inside means that the winding number is positive.
    """
    # Columns along z: find where each crosses the surface, upwards or downwards.
    low = vertices.min(axis=0)
    nx = int(np.ceil((vertices[:, 0].max() - low[0]) / edge))
    ny = int(np.ceil(np.abs(vertices[:, 1]).max() / edge))
    x = low[0] + (np.arange(nx) + 0.5) * edge
    y = (np.arange(-ny, ny) + 0.5) * edge
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    # Off the grid lines by a part no mesh shares, so no column runs through a vertex or an edge.
    x = x + 1e-7 * np.sqrt(2.0)
    y = y + 1e-7 * np.sign(y) * np.sqrt(3.0)
    ix0 = np.searchsorted(x, np.minimum(np.minimum(a[:, 0], b[:, 0]), c[:, 0]))
    ix1 = np.searchsorted(x, np.maximum(np.maximum(a[:, 0], b[:, 0]), c[:, 0]))
    iy0 = np.searchsorted(y, np.minimum(np.minimum(a[:, 1], b[:, 1]), c[:, 1]))
    iy1 = np.searchsorted(y, np.maximum(np.maximum(a[:, 1], b[:, 1]), c[:, 1]))
    wide, deep = ix1 - ix0, iy1 - iy0
    count = wide * deep
    face = np.repeat(np.arange(len(faces)), count)
    within = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    ix = ix0[face] + within // np.maximum(deep[face], 1)
    iy = iy0[face] + within % np.maximum(deep[face], 1)
    p, q, r = a[face], b[face], c[face]
    px, py = x[ix], y[iy]
    area = (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        u = ((px - p[:, 0]) * (r[:, 1] - p[:, 1]) - (py - p[:, 1]) * (r[:, 0] - p[:, 0])) / area
        v = ((q[:, 0] - p[:, 0]) * (py - p[:, 1]) - (q[:, 1] - p[:, 1]) * (px - p[:, 0])) / area
    hit = (area != 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    z = (p[:, 2] + u * (q[:, 2] - p[:, 2]) + v * (r[:, 2] - p[:, 2]))[hit]
    column = (ix * len(y) + iy)[hit]
    # An upward face (area > 0) is left when going up, a downward one entered.
    step = np.where(area[hit] > 0.0, -1, 1)
    order = np.lexsort((z, column))
    column, z, step = column[order], z[order], step[order]
    winding = np.cumsum(step)
    enter = (winding > 0) & (winding - step <= 0)
    leave = (winding <= 0) & (winding - step > 0)
    bottom, top, column = z[enter], z[leave], column[enter]
    first = np.ceil((bottom - low[2]) / edge - 0.5).astype(int)
    last = np.ceil((top - low[2]) / edge - 0.5).astype(int)
    height = np.maximum(last - first, 0)
    k = np.repeat(first, height) + (np.arange(height.sum()) - np.repeat(np.cumsum(height) - height, height))
    column = np.repeat(column, height)
    return np.column_stack([x[column // len(y)], y[column % len(y)], low[2] + (k + 0.5) * edge])
