"""The person's own surface in a simulated pose: linear blend skinning."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.body.mesh import BodyMesh
from physique.simulation import reduced

Array = NDArray[np.float64]


def joint_transforms(mesh: BodyMesh, q: Array) -> Array:
    """World transforms (T, 22, 3, 4) of the joints of `mesh` at q (T, 57): rotation, position (m).

    In the T-pose all rotations are the identity.
    """
    transforms = reduced.part_transforms(reduced.to_rotations(q[:, 3:7], q[:, 7:]), mesh.joints)
    transforms[..., 3] += q[:, None, :3]
    return transforms


def skin_vertices(mesh: BodyMesh, q: Array) -> Array:
    """World positions (T, V, 3), m, of the vertices of `mesh` at q (T, 57)."""
    transforms = joint_transforms(mesh, q)
    R, p = transforms[..., :3], transforms[..., 3]
    moved = p - (R @ mesh.joints[:, :, None])[..., 0]  # of the origin, by each joint
    blend = np.concatenate([R, moved[..., None]], axis=-1)  # (T, 22, 3, 4)
    rest = np.concatenate([mesh.vertices, np.ones((len(mesh.vertices), 1))], axis=1)
    out = np.empty((len(q), len(mesh.vertices), 3))
    for t in range(len(q)):
        per_vertex = np.tensordot(mesh.weights, blend[t], axes=1)  # (V, 3, 4)
        out[t] = np.einsum("vij,vj->vi", per_vertex, rest)
    return out
