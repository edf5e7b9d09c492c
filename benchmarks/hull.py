"""The field's usual rule, for comparison: a capsule along the bone with its part's hull volume.

SMPLSim and its relatives do so: the mesh vertices that a joint moves most form a convex hull, the
capsule lies along the bone, and its radius is chosen so that the volumes agree.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.spatial import ConvexHull

from physique.body.mesh import BodyMesh
from physique.body.primitives import Primitive
from physique.skeleton import JOINTS, PARENTS


def hull_capsules(mesh: BodyMesh) -> tuple[Primitive, ...]:
    """22 primitives, in the order of `skeleton.JOINTS`: boxes for feet and toes, else capsules.

    A bone runs from its joint to the mean of its children; at the ends of the chains (head, hands)
    it is the mean position of the part's vertices, twice as far.
    """
    owner = np.where(mesh.surface, mesh.weights.argmax(axis=1), -1)
    solids = []
    for i, name in enumerate(JOINTS):
        own = mesh.vertices[owner == i]
        hull = ConvexHull(own)
        if name.endswith(("ankle", "_foot")):
            low, high = own.min(axis=0), own.max(axis=0)
            half, middle = 0.5 * (high - low), 0.5 * (high + low)
            half = half * (hull.volume / (8.0 * half.prod())) ** (1.0 / 3.0)
            solids.append(Primitive(name, "box", half, middle, np.eye(3)))
            continue
        children = [j for j, parent in enumerate(PARENTS) if parent == i]
        start = mesh.joints[i]
        if name in ("head", "left_wrist", "right_wrist"):
            end = start + 2.0 * (own.mean(axis=0) - start)
        else:
            end = mesh.joints[children].mean(axis=0)
        solids.append(_capsule_of_volume(name, start, end, float(hull.volume)))
    return tuple(solids)


def _capsule_of_volume(name: str, start: np.ndarray, end: np.ndarray, volume: float) -> Primitive:
    """The capsule with this volume, m3, whose cylinder runs from start to end."""
    length = float(np.linalg.norm(end - start))

    def excess(r: float) -> float:
        return np.pi * r**2 * (length + 4.0 / 3.0 * r) - volume

    radius = brentq(excess, 0.0, 1.0)
    z = (end - start) / length
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [0.0, 0.0, 1.0], z)
    x = x / np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z], axis=1)
    return Primitive(name, "capsule", np.array([radius, 0.5 * length, 0.0]), 0.5 * (start + end), R)
