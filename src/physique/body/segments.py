"""Which part of a body each bit of surface belongs to, and how each part lies in space."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from physique.body.mesh import BodyMesh
from physique.body.primitives import triangle_samples
from physique.errors import InputError
from physique.skeleton import INDEX, JOINTS, MIRROR

Array = NDArray[np.float64]

#: m2 of skin for each sampled point, and the fewest points of a part.
POINT_AREA, LEAST_POINTS = 4e-4, 120

FLIP = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class SurfacePoints:
    """Points spread evenly over the outer skin, area by area.

    points: (N, 3) m. area: (N,) m2. part: (N,) index of the joint that moves each most.
    """

    points: Array
    area: Array
    part: NDArray[np.int64]


def surface_points(mesh: BodyMesh) -> SurfacePoints:
    """Points on the outer skin, systematically sampled; InputError if a part has no skin."""
    outer = mesh.faces[mesh.surface[mesh.faces].all(axis=1)]
    face_weight = mesh.weights[outer].sum(axis=1)
    owner = face_weight.argmax(axis=1)
    points, areas, parts = [], [], []
    for part in range(len(JOINTS)):
        faces = outer[owner == part]
        if len(faces) == 0:
            raise InputError(
                f"body {mesh.name}, part {JOINTS[part]}",
                "no surface that moves with it",
                "skin weights that give every part some faces",
                "check the weights of this joint",
            )
        p, a = triangle_samples(mesh.vertices, faces, 0.02)
        total = np.cumsum(a)
        count = max(LEAST_POINTS, int(total[-1] / POINT_AREA))
        chosen = np.searchsorted(total, (np.arange(count) + 0.5) * total[-1] / count)
        points.append(p[chosen])
        areas.append(np.full(count, total[-1] / count))
        parts.append(np.full(count, part))
    return SurfacePoints(np.concatenate(points), np.concatenate(areas), np.concatenate(parts))


def is_symmetric(mesh: BodyMesh, tolerance: float = 1e-4) -> bool:
    """Whether the mesh and its joints are their own mirror images, within `tolerance` m."""
    joints = np.abs(mesh.joints[list(MIRROR)] * FLIP - mesh.joints).max() < tolerance
    distance, _ = cKDTree(mesh.vertices).query(mesh.vertices * FLIP)
    return bool(joints and distance.max() < tolerance)


def principal_axes(points: Array, area: Array) -> Array:
    """Directions (3, 3), one a row, in which surface varies, the most varied first (section 3.3).

    Weighted by area, because vertices crowd in faces and fingers.
    """
    centre = np.average(points, axis=0, weights=area)
    _, vectors = np.linalg.eigh(np.cov(points - centre, rowvar=False, aweights=area))
    axes = vectors.T[::-1]
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1)
    return axes * np.sign(largest)


def bone_segments(mesh: BodyMesh) -> list[tuple[int, Array, Array]]:
    """The bones that claim the volume round them, as (part, start, end), m.

    The pelvis has no bones to the hips: they would claim the upper thighs. The collar's begins half
    way along it: the chest below its inner half moves with the spine. Head, hands, toes and heels
    reach to the skin.
    """
    joints = mesh.joints
    chains: list[tuple[str, ...]] = [("pelvis", "spine1", "spine2", "spine3", "neck", "head")]
    for side in ("left", "right"):
        chains.append(tuple(f"{side}_{p}" for p in ("hip", "knee", "ankle", "foot")))
        chains.append(tuple(f"{side}_{p}" for p in ("shoulder", "elbow", "wrist")))
    bones = [(INDEX[a], joints[INDEX[a]], joints[INDEX[b]]) for chain in chains for a, b in pairwise(chain)]
    owner = np.where(mesh.surface, mesh.weights.argmax(axis=1), -1)
    for name, direction in (
        ("head", [0, 0, 1]),
        ("left_wrist", [0, 1, 0]),
        ("right_wrist", [0, -1, 0]),
        ("left_foot", [1, 0, 0]),
        ("right_foot", [1, 0, 0]),
    ):
        start, along = joints[INDEX[name]], np.array(direction, dtype=float)
        reach = float(((mesh.vertices[owner == INDEX[name]] - start) @ along).max())
        bones.append((INDEX[name], start, start + reach * along))
    for side in ("left", "right"):
        ankle = INDEX[f"{side}_ankle"]
        own = mesh.vertices[owner == ankle]
        heel = own[np.argmin(own[:, 0])]
        bones.append((ankle, joints[ankle], np.array([heel[0], joints[ankle, 1], heel[2]])))
        collar, shoulder = joints[INDEX[f"{side}_collar"]], joints[INDEX[f"{side}_shoulder"]]
        bones.append((INDEX[f"{side}_collar"], 0.5 * (collar + shoulder), shoulder))
    return bones
