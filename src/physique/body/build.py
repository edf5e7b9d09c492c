"""A person's mesh in, the simulator's body out: shapes, masses, excluded pairs (section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence

from physique.body.capsule_body import CapsuleBody, Part
from physique.body.capsules import fit_capsules
from physique.body.mass import MassRule, part_masses
from physique.body.mesh import BodyMesh
from physique.body.primitives import Solid, signed_distance, surface_samples
from physique.skeleton import INDEX, JOINTS, PARENTS

_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar", "neck", "head")

#: Parts that soft flesh lets pass into each other: a trunk bends, a hip flexes until the thigh lies
#: against the belly, an arm hangs against the chest. Rigid capsules would stop them far too early
#: (a kick would have the thigh 13 cm inside the trunk).
SOFT: tuple[tuple[str, str], ...] = (
    *((a, b) for i, a in enumerate(_TRUNK) for b in _TRUNK[:i]),
    *(
        (trunk, f"{side}_{limb}")
        for side in ("left", "right")
        for limb in ("hip", "shoulder")
        for trunk in ("pelvis", "spine1", "spine2", "spine3")
    ),
)


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
    """Pairs (i < j) of parts that must not collide: those that overlap at rest, neighbours, and
    those of which one can sink into the other (`SOFT`)."""
    samples = [surface_samples(s, 0.01)[0] for s in solids]
    pairs = {(min(i, p), max(i, p)) for i, p in enumerate(PARENTS) if p >= 0}
    pairs |= {(min(INDEX[a], INDEX[b]), max(INDEX[a], INDEX[b])) for a, b in SOFT}
    for i in range(len(JOINTS)):
        for j in range(i + 1, len(JOINTS)):
            # Surfaces of overlapping bodies cross, or one body holds the other.
            if (
                signed_distance(solids[i], samples[j]).min() < 0.0
                or signed_distance(solids[j], samples[i]).min() < 0.0
            ):
                pairs.add((i, j))
    return tuple(sorted(pairs))
