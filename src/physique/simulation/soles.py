"""Where the feet touch the floor: the corners of their shapes, followed as points of the body."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.simulation.character import Character

Array = NDArray[np.float64]

_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def sole_points(character: Character, q: Array) -> Array:
    """World positions (T, 2, 16, 3), m, of the corners of the left and the right foot at q (T, 57).

    Eight of the foot and eight of the toes; the shapes are boxes, others give those of the box
    around them.
    """
    model = character.model
    data = mujoco.MjData(model)
    geoms = character.foot_geoms.ravel()
    box = model.geom_aabb[geoms]  # centre, then half extents, in the geom's own frame
    local = box[:, None, :3] + _SIGNS * box[:, None, 3:]  # (4, 8, 3)
    out = np.empty((len(q), 2, 16, 3))
    for t in range(len(q)):
        data.qpos[:] = q[t]
        mujoco.mj_kinematics(model, data)
        R_world_from_geom = data.geom_xmat[geoms].reshape(-1, 3, 3)
        points = local @ R_world_from_geom.transpose(0, 2, 1) + data.geom_xpos[geoms, None]
        out[t] = points.reshape(2, 16, 3)
    return out
