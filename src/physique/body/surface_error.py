"""How well a union of primitives stands for a mesh: distances between the two surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from physique.body.mesh import BodyMesh
from physique.body.primitives import Solid, signed_distance, surface_samples, triangle_areas, triangle_samples

#: m. Distances are to samples this far apart, hence too large (by 0.2 mm at 8 mm), never too small.
FINE = 0.006
#: m. Primitive points at which distances are taken; on the mesh they are the vertices.
COARSE = 0.01


@dataclass(frozen=True)
class SurfaceError:
    """Distances between mesh and primitives, cm, area by area over the visible surfaces.

    mean_cm: the mean of both directions. max_cm: the largest of either (Hausdorff distance).
    mesh_to_primitives_cm and primitives_to_mesh_cm: the two directed means.
    """

    mean_cm: float
    max_cm: float
    mesh_to_primitives_cm: float
    primitives_to_mesh_cm: float


def surface_error(mesh: BodyMesh, solids: Sequence[Solid]) -> SurfaceError:
    """Distances between the outer skin and the outer surface of the union of the primitives."""
    outer = mesh.faces[mesh.surface[mesh.faces].all(axis=1)]
    skin_area = np.zeros(len(mesh.vertices))
    np.add.at(skin_area, outer, triangle_areas(mesh.vertices, outer)[:, None] / 3.0)
    used = np.nonzero(skin_area)[0]
    skin, skin_area = mesh.vertices[used], skin_area[used]
    union, union_area = _outer_surface(solids, COARSE)
    forth, _ = cKDTree(_outer_surface(solids, FINE)[0]).query(skin)
    back, _ = cKDTree(triangle_samples(mesh.vertices, outer, FINE)[0]).query(union)
    a = 100.0 * float(np.average(forth, weights=skin_area))
    b = 100.0 * float(np.average(back, weights=union_area))
    worst = 100.0 * float(max(forth.max(), back.max()))
    return SurfaceError(0.5 * (a + b), worst, a, b)


def _outer_surface(solids: Sequence[Solid], spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Samples (N, 3) m of the union's surface and their areas (N,) m2."""
    points, areas = [], []
    for i, solid in enumerate(solids):
        p, a = surface_samples(solid, spacing)
        hidden = np.zeros(len(p), dtype=bool)
        for j, other in enumerate(solids):
            if j != i and _may_meet(solid, other):
                hidden |= signed_distance(other, p) < 0.0
        points.append(p[~hidden])
        areas.append(a[~hidden])
    return np.concatenate(points), np.concatenate(areas)


def _may_meet(a: Solid, b: Solid) -> bool:
    return bool(np.linalg.norm(a.center - b.center) < _reach(a) + _reach(b))


def _reach(solid: Solid) -> float:
    """Radius, m, of a ball round the centre that holds the primitive."""
    return float(solid.size.sum() if solid.shape == "capsule" else np.linalg.norm(solid.size))
