"""Where the feet touch the floor: the corners of their shapes, followed as points of the body."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.character.hinges import columns
from physique.character.model import Character

Array = NDArray[np.float64]

#: Hinges of each leg (2, 8), from the hip to the toes.
LEGS = np.array(
    [
        [c for joint in ("hip", "knee", "ankle", "foot") for c in range(50)[columns(f"{s}_{joint}")]]
        for s in ("left", "right")
    ]
)
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


@dataclass(frozen=True)
class Feet:
    """The left and the right foot in T poses, and how the eight angles of their legs move them.

    points: (T, 2, 16, 3), m, corners as in `sole_points`; by_angle: (T, 2, 16, 3, 8), m/rad.
    ankles: (T, 2, 3), m; ankles_by_angle: (T, 2, 3, 8).
    R_world_from_foot: (T, 2, 3, 3); turn_by_angle: (T, 2, 3, 8), of its rotation vector (world).
    """

    points: Array
    by_angle: Array
    ankles: Array
    ankles_by_angle: Array
    R_world_from_foot: Array
    turn_by_angle: Array


def sole_points(character: Character, q: Array) -> Array:
    """World positions (T, 2, 16, 3), m, of the corners of the left and the right foot at q (T, 57).

    Eight of the foot and eight of the toes; the shapes are boxes, others give those of the box
    around them.
    """
    return feet(character, q).points


def feet(character: Character, q: Array) -> Feet:
    """The feet at q (T, 57)."""
    model = character.model
    data = mujoco.MjData(model)
    geoms = character.foot_geoms.ravel()
    bodies = model.geom_bodyid[character.foot_geoms[:, 0]]
    box = model.geom_aabb[geoms]  # centre, then half extents, in the geom's own frame
    local = box[:, None, :3] + _SIGNS * box[:, None, 3:]  # (4, 8, 3)
    frames = len(q)
    points = np.empty((frames, 2, 16, 3))
    ankles, turn = np.empty((frames, 2, 3)), np.empty((frames, 2, 3, 3))
    axes, anchors = np.empty((2, frames, 2, 8, 3))
    for t in range(frames):
        data.qpos[:] = q[t]
        mujoco.mj_kinematics(model, data)
        R_world_from_geom = data.geom_xmat[geoms].reshape(-1, 3, 3)
        corners = local @ R_world_from_geom.transpose(0, 2, 1) + data.geom_xpos[geoms, None]
        points[t] = corners.reshape(2, 16, 3)
        ankles[t], turn[t] = data.xpos[bodies], data.xmat[bodies].reshape(2, 3, 3)
        axes[t], anchors[t] = data.xaxis[1 + LEGS], data.xanchor[1 + LEGS]
    lever = points[:, :, :, None] - anchors[:, :, None]  # (T, 2, 16, 8, 3)
    by_angle = np.cross(axes[:, :, None], lever)
    by_angle[:, :, :8, 7] = 0.0  # toes do not move the foot
    to_ankles = np.cross(axes, ankles[:, :, None] - anchors)
    to_ankles[:, :, 7] = 0.0
    axes[:, :, 7] = 0.0
    return Feet(
        points=points,
        by_angle=np.swapaxes(by_angle, -1, -2),
        ankles=ankles,
        ankles_by_angle=np.swapaxes(to_ankles, -1, -2),
        R_world_from_foot=turn,
        turn_by_angle=np.swapaxes(axes, -1, -2),
    )
