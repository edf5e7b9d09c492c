"""A body in a few numbers."""

from __future__ import annotations

from dataclasses import dataclass

from physique.body.capsule_body import CapsuleBody
from physique.body.mesh import BodyMesh
from physique.body.surface_error import surface_error


@dataclass(frozen=True)
class BodyFacts:
    """height_m, mass_kg, volume_m3 of the person; segment_mass: part -> kg.

    capsule_error_cm and capsule_error_max_cm: mean and largest distance between the skin and the
    surface of the shapes that stand for it. fit_seconds: what fitting them took.
    """

    height_m: float
    mass_kg: float
    volume_m3: float
    capsule_error_cm: float
    capsule_error_max_cm: float
    segment_mass: dict[str, float]
    fit_seconds: float


def describe_body(mesh: BodyMesh, body: CapsuleBody, fit_seconds: float) -> BodyFacts:
    """The facts of a mesh and the capsule body that was fitted to it."""
    error = surface_error(mesh, body.parts)
    return BodyFacts(
        height_m=mesh.height,
        mass_kg=body.mass,
        volume_m3=mesh.volume,
        capsule_error_cm=error.mean_cm,
        capsule_error_max_cm=error.max_cm,
        segment_mass={part.name: part.mass for part in body.parts},
        fit_seconds=fit_seconds,
    )
