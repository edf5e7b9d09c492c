"""What is shown of a person: the skin, or the simulator's own shapes, on the same 22 joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.body.capsule_body import CapsuleBody, Part
from physique.body.mesh import BodyMesh
from physique.errors import InputError

Array = NDArray[np.float64]

#: Colours of shapes, 0 to 1: of the middle of the body, of its left, of its right.
SIDES = ((0.79, 0.72, 0.64), (0.33, 0.54, 0.78), (0.86, 0.48, 0.36))
SKIN = (0.79, 0.66, 0.57)
_ROUND, _RINGS = 24, 6  # segments about a shape's axis; rings from its pole to its equator


@dataclass(frozen=True)
class Surface:
    """A triangle mesh in the T-pose that joints carry along.

    vertices: (V, 3) m. faces: (F, 3), counter-clockwise seen from outside.
    joints: (22, 3) m, rest positions of `skeleton.JOINTS`. weights: (V, 22), rows sum to 1.
    colours: (V, 3), 0 to 1.
    """

    vertices: Array
    faces: NDArray[np.int32]
    joints: Array
    weights: Array
    colours: Array


def surface(mesh: BodyMesh | None, body: CapsuleBody, *, capsules: bool = False) -> Surface:
    """The skin `mesh`, or the shapes of `body` where these are asked for.

    Raises InputError where the skin is wanted and there is none.
    """
    if capsules:
        return capsule_surface(body)
    if mesh is None:
        raise InputError(
            f"body {body.name!r}",
            "capsules without a skin",
            "a body with a skin",
            "add --capsules, or retarget onto a body that has a skin",
        )
    return skin_surface(mesh)


def skin_surface(mesh: BodyMesh, colour: tuple[float, float, float] = SKIN) -> Surface:
    """The person's skin, in one colour."""
    colours = np.tile(np.array(colour), (len(mesh.vertices), 1))
    return Surface(mesh.vertices, mesh.faces, mesh.joints, mesh.weights, colours)


def capsule_surface(body: CapsuleBody) -> Surface:
    """The capsules, boxes and ellipsoids of a body; left and right in different colours."""
    vertices, faces, owners, colours = [], [], [], []
    count = 0
    for index, part in enumerate(body.parts):
        v, f = _shape(part)
        vertices.append(part.center + v @ part.R_world_from_part.T)
        faces.append(f + count)
        owners.append(np.full(len(v), index))
        colours.append(np.tile(np.array(SIDES[_side(part.name)]), (len(v), 1)))
        count += len(v)
    return Surface(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        body.joints,
        np.eye(len(skeleton.JOINTS))[np.concatenate(owners)],
        np.concatenate(colours),
    )


def _side(name: str) -> int:
    return 1 if name.startswith("left_") else 2 if name.startswith("right_") else 0


def _shape(part: Part) -> tuple[Array, NDArray[np.int64]]:
    """Vertices and faces of a part's primitive in its own frame."""
    if part.shape == "box":
        return _box(part.size)
    if part.shape == "ellipsoid":
        v, f = _capsule(1.0, 0.0)
        return v * part.size, f
    return _capsule(float(part.size[0]), float(part.size[1]))


def _capsule(radius: float, half: float) -> tuple[Array, NDArray[np.int64]]:
    """A capsule along z: rings of vertices from pole to pole, the equator twice."""
    polar = np.linspace(0.0, 0.5 * np.pi, _RINGS + 1)[1:]
    polar = np.concatenate([polar, np.pi - polar[::-1]])
    rise = np.where(np.arange(len(polar)) < _RINGS, half, -half)
    turn = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    x = radius * np.sin(polar)[:, None] * np.cos(turn)
    y = radius * np.sin(polar)[:, None] * np.sin(turn)
    z = np.broadcast_to((radius * np.cos(polar) + rise)[:, None], x.shape)
    poles = np.array([[0.0, 0.0, half + radius], [0.0, 0.0, -half - radius]])
    v = np.concatenate([np.stack([x, y, z], axis=-1).reshape(-1, 3), poles])
    ring = np.arange(_ROUND)
    nxt = (ring + 1) % _ROUND
    top, bottom, last = len(v) - 2, len(v) - 1, (len(polar) - 1) * _ROUND
    faces = [np.stack([np.full(_ROUND, top), ring, nxt], axis=1)]
    for k in range(len(polar) - 1):
        a, b = k * _ROUND, (k + 1) * _ROUND
        faces.append(np.stack([a + ring, b + ring, b + nxt], axis=1))
        faces.append(np.stack([a + ring, b + nxt, a + nxt], axis=1))
    faces.append(np.stack([np.full(_ROUND, bottom), last + nxt, last + ring], axis=1))
    return v, np.concatenate(faces)


def _box(half: Array) -> tuple[Array, NDArray[np.int64]]:
    """A box with vertices of its own for each side, so that its edges stay sharp."""
    v: list[Array] = []
    f: list[NDArray[np.int64]] = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            corners = np.zeros((4, 3))
            corners[:, axis] = sign
            corners[:, a] = np.array([-1.0, 1.0, 1.0, -1.0]) * sign
            corners[:, b] = [-1.0, -1.0, 1.0, 1.0]
            f.append(np.array([[0, 1, 2], [0, 2, 3]]) + 4 * len(v))
            v.append(corners * half)
    return np.concatenate(v), np.concatenate(f)
