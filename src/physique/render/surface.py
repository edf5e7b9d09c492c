"""What is shown of a person: the skin, or the simulator's own shapes, on the same 22 joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.body.capsule_body import CapsuleBody
from physique.body.mesh import BodyMesh
from physique.body.primitives import Primitive, primitive_mesh
from physique.character.held import HeldGeom
from physique.errors import InputError
from physique.render.palette import BODIES, SIDES, rgb
from physique.runs.run import Run

Array = NDArray[np.float64]
Faces = NDArray[np.int32]

_SPACING = 0.015  # m, between the vertices of a shape


@dataclass(frozen=True)
class Surface:
    """A triangle mesh in the T-pose that joints carry along.

    vertices: (V, 3) m. faces: (F, 3), counter-clockwise seen from outside.
    joints: (22, 3) m, rest positions of `skeleton.JOINTS`. weights: (V, 22), rows sum to 1.
    colours: (V, 3), 0 to 1.
    """

    vertices: Array
    faces: Faces
    joints: Array
    weights: Array
    colours: Array

    def in_colour(self, colour: str) -> Surface:
        """The same, all of it in one colour."""
        return replace(self, colours=np.tile(np.array(rgb(colour)), (len(self.vertices), 1)))


def surface(run: Run, *, capsules: bool = False, colour: str = BODIES[0]) -> Surface:
    """What is shown of a run: its person, and what the hands hold in a colour of its own.

    colour: of the skin. capsules: the simulator's shapes in place of the skin.
    Raises InputError where the skin is wanted and there is none.
    """
    person = capsule_surface(run.body) if capsules else skin_surface(skin_of(run), colour)
    held = [_rigid(held_mesh(geom), geom.joint, geom.rgb, person.joints) for geom in run.held()]
    return _joined([person, *held])


def skin_of(run: Run) -> BodyMesh:
    """The skin of a run's body. Raises InputError where there is none."""
    if run.mesh is None:
        raise InputError(
            f"body {run.body.name!r}",
            "capsules without a skin",
            "a body with a skin",
            "add --capsules, or retarget onto a body that has a skin",
        )
    return run.mesh


def skin_surface(mesh: BodyMesh, colour: str = BODIES[0]) -> Surface:
    """The person's skin, in one colour."""
    colours = np.tile(np.array(rgb(colour)), (len(mesh.vertices), 1))
    return Surface(mesh.vertices, mesh.faces, mesh.joints, mesh.weights, colours)


def capsule_surface(body: CapsuleBody) -> Surface:
    """The capsules, boxes and ellipsoids of a body; left and right in different colours."""
    parts = []
    for index, part in enumerate(body.parts):
        vertices, faces = primitive_mesh(part, _SPACING)
        colour = np.array(rgb(SIDES[_side(part.name)]))
        parts.append(_rigid((vertices - body.joints[index], faces), index, colour, body.joints))
    return _joined(parts)


def held_mesh(geom: HeldGeom, spacing: float = _SPACING) -> tuple[Array, Faces]:
    """What a hand holds, in the frame of its joint: vertices (V, 3) m and outward faces (F, 3).

    spacing: wanted length of edges, m.
    """
    solid = Primitive(geom.name, geom.shape, geom.size, geom.center, geom.R_joint_from_geom)
    return primitive_mesh(solid, spacing)


def vertex_normals(vertices: Array, faces: NDArray[np.integer[Any]]) -> Array:
    """Unit normals (V, 3) of a mesh with vertices (V, 3), the mean of its faces' (F, 3) by area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    of_face = np.cross(b - a, c - a)
    sums = [np.bincount(faces.ravel(), np.repeat(of_face[:, k], 3), len(vertices)) for k in range(3)]
    normals = np.stack(sums, axis=1)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    up = np.array([0.0, 0.0, 1.0])  # a vertex of no face has no normal, but must have one
    return np.where(length > 0, normals / np.maximum(length, 1e-300), up)


def _side(name: str) -> int:
    return 1 if name.startswith("left_") else 2 if name.startswith("right_") else 0


def _rigid(mesh: tuple[Array, Faces], joint: int, colour: Array, joints: Array) -> Surface:
    """A mesh in the frame of a joint, which carries all of it."""
    vertices, faces = mesh
    weights = np.zeros((len(vertices), len(skeleton.JOINTS)))
    weights[:, joint] = 1.0
    colours = np.tile(colour, (len(vertices), 1))
    return Surface(vertices + joints[joint], faces, joints, weights, colours)


def _joined(surfaces: Sequence[Surface]) -> Surface:
    """Surfaces on the same joints as one."""
    starts = np.cumsum([0, *(len(s.vertices) for s in surfaces[:-1])])
    return Surface(
        np.concatenate([s.vertices for s in surfaces]),
        np.concatenate([s.faces + start for s, start in zip(surfaces, starts)]).astype(np.int32),
        surfaces[0].joints,
        np.concatenate([s.weights for s in surfaces]),
        np.concatenate([s.colours for s in surfaces]),
    )
