"""A person's mesh in, the simulator's body out: shapes, masses, excluded pairs (section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence

from physique.body.capsule_body import CapsuleBody, Part
from physique.body.capsules import fit_capsules
from physique.body.mass import MassRule, part_masses
from physique.body.mesh import BodyMesh
from physique.body.primitives import Solid, signed_distance, surface_samples
from physique.skeleton import JOINTS, PARENTS


def capsule_body(mesh: BodyMesh, *, mass_rule: MassRule = "nearest") -> CapsuleBody:
    """The capsule body of a mesh: Eq. 10, masses by `mass_rule` ("nearest" or "paper").

    Raises InputError if a part of the mesh has no skin or no volume.
    """
    solids = fit_capsules(mesh)
    masses = part_masses(mesh, solids, mass_rule)
    parts = tuple(
        Part(
            name=s.name,
            shape=s.shape,
            size=s.size,
            center=s.center,
            R_world_from_part=s.R_world_from_part,
            mass=m.mass,
            com=m.com,
            inertia=m.inertia,
        )
        for s, m in zip(solids, masses)
    )
    return CapsuleBody(
        name=mesh.name,
        height=mesh.height,
        mass=mesh.mass,
        joints=mesh.joints,
        parts=parts,
        excluded=excluded_pairs(solids),
    )


def excluded_pairs(solids: Sequence[Solid]) -> tuple[tuple[int, int], ...]:
    """Pairs (i < j) of parts that must not collide: those that overlap at rest, and neighbours."""
    samples = [surface_samples(s, 0.01)[0] for s in solids]
    pairs = {(min(i, p), max(i, p)) for i, p in enumerate(PARENTS) if p >= 0}
    for i in range(len(JOINTS)):
        for j in range(i + 1, len(JOINTS)):
            # Surfaces of overlapping bodies cross, or one body holds the other.
            if (
                signed_distance(solids[i], samples[j]).min() < 0.0
                or signed_distance(solids[j], samples[i]).min() < 0.0
            ):
                pairs.add((i, j))
    return tuple(sorted(pairs))
