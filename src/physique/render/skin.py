"""The person's own surface in a simulated pose: linear blend skinning."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from physique.reference import reduced

Array = NDArray[np.float64]


class Skeleton(Protocol):
    """Anything with joints (22, 3), m, in the T-pose: a mesh, a capsule body, a surface."""

    @property
    def joints(self) -> Array: ...  # noqa: D102


class Skinned(Skeleton, Protocol):
    """A skeleton with vertices (V, 3), m, and skin weights (V, 22)."""

    @property
    def vertices(self) -> Array: ...  # noqa: D102

    @property
    def weights(self) -> Array: ...  # noqa: D102


def joint_transforms(body: Skeleton, q: Array) -> Array:
    """World transforms (T, 22, 3, 4) of the joints of `body` at q (T, 57): rotation, position (m).

    In the T-pose all rotations are the identity.
    """
    transforms = reduced.part_transforms(reduced.to_rotations(q[:, 3:7], q[:, 7:]), body.joints)
    transforms[..., 3] += q[:, None, :3]
    return transforms


def skin_vertices(body: Skinned, q: Array) -> Array:
    """World positions (T, V, 3), m, of the vertices of `body` at q (T, 57)."""
    out = np.empty((len(q), len(body.vertices), 3))
    for t, transforms in enumerate(joint_transforms(body, q)):
        out[t] = blend(body, transforms)
    return out


def blend(body: Skinned, transforms: Array) -> Array:
    """World positions (V, 3), m, of the vertices of `body` at one frame of `joint_transforms`."""
    R, p = transforms[..., :3], transforms[..., 3]
    moved = p - (R @ body.joints[:, :, None])[..., 0]  # of the origin, by each joint
    matrices = np.concatenate([R, moved[..., None]], axis=-1).reshape(-1, 12)
    per_vertex = (body.weights @ matrices).reshape(-1, 3, 4)
    out: Array = np.einsum("vij,vj->vi", per_vertex[..., :3], body.vertices)
    return out + per_vertex[..., 3]
