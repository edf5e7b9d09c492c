"""Mass, centre of mass and inertia of the parts, by the mesh's volume or by the paper's rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from physique.body.mesh import BodyMesh
from physique.body.primitives import Solid, inertia, signed_distance, volume
from physique.body.segments import FLIP, bone_segments, is_symmetric
from physique.body.voxels import inside_points
from physique.errors import InputError
from physique.skeleton import INDEX, JOINTS, MIRROR, PARENTS

Array = NDArray[np.float64]

MassRule = Literal["nearest", "paper"]

#: Small cubes, about, that stand for the body's inside.
CUBES = 120_000
#: Points in each primitive that measure its overlap with its ancestors.
OVERLAP_POINTS = 20_000

#: Share of the body's mass that a capsule buried in its ancestors keeps: none can be without.
LEAST_SHARE = 0.001

#: The segments of de Leva's table and the parts that make them up; limbs are one side.
SEGMENTS: dict[str, tuple[str, ...]] = {
    "head and neck": ("head", "neck"),
    "trunk": ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar"),
    "upper arm": ("left_shoulder",),
    "forearm": ("left_elbow",),
    "hand": ("left_wrist",),
    "thigh": ("left_hip",),
    "shank": ("left_knee",),
    "foot": ("left_ankle", "left_foot"),
}
#: Percent of body mass, men and women: de Leva, J. Biomechanics 29 (1996), table 4.
DE_LEVA: dict[str, dict[str, float]] = {
    "male": dict(zip(SEGMENTS, (6.94, 43.46, 2.71, 1.62, 0.61, 14.16, 4.33, 1.37))),
    "female": dict(zip(SEGMENTS, (6.68, 42.57, 2.55, 1.38, 0.56, 14.78, 4.81, 1.29))),
}


@dataclass(frozen=True)
class PartMass:
    """mass: kg. com: (3,) m. inertia: (3, 3) kg m2 about com along the world axes."""

    mass: float
    com: Array
    inertia: Array


def part_masses(mesh: BodyMesh, solids: Sequence[Solid], rule: MassRule = "nearest") -> tuple[PartMass, ...]:
    """Masses of the 22 parts, in the order of `skeleton.JOINTS`; they add up to `mesh.mass`.

    rule: "nearest" gives each bit of the mesh's volume to its nearest bone; com and inertia are
        those of the bits. "paper" gives each primitive its volume less what it shares with its
        ancestors (section 3.3); com and inertia are the primitive's.
    Raises InputError for another rule, and where a part would have no mass.
    """
    if rule == "nearest":
        parts = _by_nearest_bone(mesh)
    elif rule == "paper":
        parts = _by_primitive(mesh.mass, solids)
    else:
        raise InputError("mass rule", repr(rule), "nearest or paper", "choose one of these")
    for name, part in zip(JOINTS, parts):
        if not part.mass > 0.0:
            raise InputError(
                f"body {mesh.name}, part {name}",
                "no mass",
                "volume round every bone",
                "check that the joints lie inside the mesh",
            )
    parts = _symmetric(parts) if is_symmetric(mesh) else parts
    scale = mesh.mass / sum(p.mass for p in parts)
    return tuple(PartMass(p.mass * scale, p.com, p.inertia * scale) for p in parts)


def segment_percent(masses: Sequence[float]) -> dict[str, float]:
    """Percent of the body's mass in each of de Leva's segments, from 22 part masses."""
    total = sum(masses)
    return {
        segment: 100.0 * sum(masses[INDEX[part]] for part in parts) / total
        for segment, parts in SEGMENTS.items()
    }


def _by_nearest_bone(mesh: BodyMesh) -> list[PartMass]:
    edge = (mesh.volume / CUBES) ** (1.0 / 3.0)
    points = inside_points(mesh.vertices, mesh.faces, edge)
    nearest = np.zeros(len(points), dtype=int)
    least = np.full(len(points), np.inf)
    for part, start, end in bone_segments(mesh):
        along = end - start
        t = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        gap = points - start - t[:, None] * along
        squared = np.einsum("ni,ni->n", gap, gap)
        closer = squared < least
        nearest[closer], least[closer] = part, squared[closer]
    cube = mesh.mass / max(len(points), 1)
    parts = []
    for i in range(len(JOINTS)):
        own = points[nearest == i]
        if len(own) == 0:
            parts.append(PartMass(0.0, np.zeros(3), np.zeros((3, 3))))
            continue
        com = own.mean(axis=0)
        d = own - com
        spread = d.T @ d
        tensor = np.trace(spread) * np.eye(3) - spread + len(own) * edge**2 / 6.0 * np.eye(3)
        parts.append(PartMass(cube * len(own), com, cube * tensor))
    return parts


def _by_primitive(mass: float, solids: Sequence[Solid]) -> list[PartMass]:
    rest = np.array([1.0 - _shared(i, solids) for i in range(len(solids))])
    own = np.array([volume(s) for s in solids]) * rest
    own = np.maximum(own, LEAST_SHARE * own.sum())
    weights = mass * own / own.sum()
    return [PartMass(float(w), s.center, inertia(s, float(w))) for w, s in zip(weights, solids)]


def _shared(part: int, solids: Sequence[Solid]) -> float:
    """Share of a primitive's volume that lies in its ancestors' primitives."""
    points = _points_in(solids[part])
    shared = np.zeros(len(points), dtype=bool)
    ancestor = PARENTS[part]
    while ancestor >= 0:
        shared |= signed_distance(solids[ancestor], points) < 0.0
        ancestor = PARENTS[ancestor]
    return float(shared.mean())


def _points_in(solid: Solid) -> Array:
    """World points (N, 3) spread evenly in a primitive: the R3 low-discrepancy sequence."""
    g = 1.2207440846057596
    unit = np.mod(0.5 + np.arange(1, OVERLAP_POINTS + 1)[:, None] / g ** np.arange(1, 4), 1.0)
    half = solid.size.copy()
    if solid.shape == "capsule":
        r, length = solid.size[0], solid.size[1]
        half = np.array([r, r, length + r])
    points = (2.0 * unit - 1.0) * half @ solid.R_world_from_part.T + solid.center
    return points[signed_distance(solid, points) < 0.0]


def _symmetric(parts: Sequence[PartMass]) -> list[PartMass]:
    """Each part averaged with the mirror image of its partner."""
    mirror = np.diag(FLIP)
    return [
        PartMass(
            0.5 * (a.mass + b.mass),
            0.5 * (a.com + b.com * FLIP),
            0.5 * (a.inertia + mirror @ b.inertia @ mirror),
        )
        for a, b in ((parts[i], parts[j]) for i, j in enumerate(MIRROR))
    ]
