"""The energy of Eq. 10 as residuals with derivatives: mesh to capsules and capsules to mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from physique.body.mesh import BodyMesh
from physique.body.primitives import Primitive, signed_distance, surface_samples, triangle_samples
from physique.body.segments import SurfacePoints
from physique.skeleton import JOINTS

Array = NDArray[np.float64]

BOXES = ("left_ankle", "right_ankle", "left_foot", "right_foot")
ELLIPSOIDS = ("left_wrist", "right_wrist")
CAPSULES = tuple(i for i, n in enumerate(JOINTS) if n not in BOXES + ELLIPSOIDS)
#: Numbers a capsule: radius, half length, centre (3) in its own frame.
SIZES = 5
#: Weight of the distances from the primitives back to the mesh (Eq. 10).
LAMBDA = 0.5
#: m. Below it a distance counts squared, above it linearly, as in Eq. 10.
SOFT = 0.005
#: m. Points on the primitives are about this far apart.
SPACING = 0.04


def changed(capsule: Primitive, x: Array) -> Primitive:
    """The capsule with radius and half length x[:2] and, if given, its centre moved by x[2:]."""
    center = capsule.center
    if len(x) > 2:
        center = center + capsule.R_world_from_part @ x[2:]
    return replace(capsule, size=np.array([x[0], x[1], 0.0]), center=center)


class Energy:
    """Residuals of Eq. 10 and their derivatives, for the numbers x (K SIZES,) of K capsules.

    A residual is a distance times the root of the area it stands for. The same points of the
    primitives serve at every x: sampled once, then stretched with the capsule.
    """

    def __init__(self, start: list[Primitive], mesh: BodyMesh, surface: SurfacePoints) -> None:
        self.start, self.surface = start, surface
        outer = mesh.faces[mesh.surface[mesh.faces].all(axis=1)]
        self.skin = triangle_samples(mesh.vertices, outer, 0.01)[0]
        self.tree = cKDTree(self.skin)
        self.weight = np.sqrt(surface.area)
        #: What counts as large, for the residual of a typical point.
        self.soft = SOFT * float(self.weight.mean())
        self.column = {i: SIZES * k for k, i in enumerate(CAPSULES)}
        samples = [surface_samples(s, SPACING) for s in start]
        self.local = [(p - s.center) @ s.R_world_from_part for (p, _), s in zip(samples, start)]
        self.part = np.concatenate([np.full(len(p), i) for i, p in enumerate(self.local)])
        self.back_weight = np.sqrt(LAMBDA * np.concatenate([a for _, a in samples]))
        self._last: tuple[Array, Array, Array] | None = None

    def solids(self, x: Array) -> list[Primitive]:
        """All primitives, the capsules changed by x."""
        bodies = list(self.start)
        for i, k in self.column.items():
            bodies[i] = changed(self.start[i], x[k : k + SIZES])
        return bodies

    def at(self, x: Array) -> tuple[Array, Array]:
        """Residuals (M,) and Jacobian (M, K SIZES)."""
        if self._last is None or not np.array_equal(self._last[0], x):
            bodies = self.solids(x)
            forth, d_forth = self._forth(bodies, len(x))
            back, d_back = self._back(bodies, len(x))
            self._last = x.copy(), np.concatenate([forth, back]), np.concatenate([d_forth, d_back])
        return self._last[1], self._last[2]

    def _forth(self, bodies: list[Primitive], count: int) -> tuple[Array, Array]:
        """From the mesh to the union: the first sum."""
        points = self.surface.points
        distances = np.array([signed_distance(s, points) for s in bodies])
        nearest = distances.argmin(axis=0)
        J = np.zeros((len(points), count))
        for i, k in self.column.items():
            mine = np.nonzero(nearest == i)[0]
            s = bodies[i]
            p = (points[mine] - s.center) @ s.R_world_from_part
            beyond = p[:, 2] - np.clip(p[:, 2], -s.size[1], s.size[1])
            p[:, 2] = beyond
            out = p / np.maximum(np.linalg.norm(p, axis=1), 1e-9)[:, None]
            J[mine, k], J[mine, k + 1] = -1.0, -np.abs(out[:, 2])
            J[mine, k + 2 : k + 5] = -out
        least = distances[nearest, np.arange(len(points))]
        return self.weight * least, self.weight[:, None] * J

    def _back(self, bodies: list[Primitive], count: int) -> tuple[Array, Array]:
        """From the union to the mesh: the second sum."""
        world, moves = [], []
        for i, (s, q) in enumerate(zip(bodies, self.local)):
            R = s.R_world_from_part
            radial, along = q, np.zeros(len(q))
            if i in self.column:
                (r0, half0), (r, half) = self.start[i].size[:2], s.size[:2]
                along = np.clip(q[:, 2] / half0, -1.0, 1.0)
                radial = (q - (along * half0)[:, None] * [0, 0, 1]) / r0
                q = radial * r + (along * half)[:, None] * [0, 0, 1]
            world.append(q @ R.T + s.center)
            moves.append(np.stack([radial @ R.T, along[:, None] * R[:, 2]]))
        points, move = np.concatenate(world), np.concatenate(moves, axis=1)
        depth = np.full(len(points), np.inf)
        for i, s in enumerate(bodies):
            others = np.nonzero(self.part != i)[0]
            close = others[np.linalg.norm(points[others] - s.center, axis=1) < s.size.sum() + 0.02]
            depth[close] = np.minimum(depth[close], signed_distance(s, points[close]))
        # Only the outer surface of the union counts; a fade over 1 cm keeps the energy smooth.
        shown = np.clip(depth / 0.01 + 1.0, 0.0, 1.0)
        distance, away = np.zeros(len(points)), np.zeros((len(points), 3))
        seen = np.nonzero(shown)[0]
        distance[seen], near = self.tree.query(points[seen])
        away[seen] = (points[seen] - self.skin[near]) / np.maximum(distance[seen], 1e-9)[:, None]
        weight = self.back_weight * shown
        J = np.zeros((len(points), count))
        for i, k in self.column.items():
            mine = np.nonzero(self.part == i)[0]
            J[mine, k : k + 2] = np.einsum("kni,ni->nk", move[:, mine], away[mine])
            J[mine, k + 2 : k + 5] = away[mine] @ bodies[i].R_world_from_part
        return weight * distance, weight[:, None] * J
