"""A person's surface in the T-pose: the mesh, its joints and its skin weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class BodyMesh:
    """A closed triangle mesh of one person in the T-pose (see `physique.skeleton`), soles on z = 0.

    name: what the person is called in listings and file names.
    vertices: (V, 3) m.
    faces: (F, 3) vertex indices, counter-clockwise seen from outside; closed (watertight).
    joints: (22, 3) m, rest positions of `skeleton.JOINTS`.
    weights: (V, 22) skin weights, rows sum to 1.
    surface: (V,) bool, False for inner surfaces (mouth, eye sockets) that nobody sees.
    volume: m3, of the pose in which the model was measured (T-posing by skinning inflates).
    mass: kg.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    joints: NDArray[np.float64]
    weights: NDArray[np.float64]
    surface: NDArray[np.bool_]
    volume: float
    mass: float

    @property
    def height(self) -> float:
        """Stature, m."""
        return float(self.vertices[self.surface, 2].max() - self.vertices[self.surface, 2].min())
