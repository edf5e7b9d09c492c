"""What a sequence of poses looks like on a character: joints, centre of mass, clearance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Poses:
    """Of T poses: joints (T, 22, 3) m, com (T, 3) m, com_jacobian (T, 3, 56) (tangent of q),
    lowest (T, ngeom) m: the height of each geom's lowest point, infinite for the floor and
    what does not touch it."""

    joints: Array
    com: Array
    com_jacobian: Array
    lowest: Array


def poses(character: Character, q: Array, heights: bool = True) -> Poses:
    """Kinematics of q (T, 57); `lowest`, most of the work, is left infinite without `heights`."""
    model = character.model
    frames = len(q)
    out = Poses(
        joints=np.empty((frames, 22, 3)),
        com=np.empty((frames, 3)),
        com_jacobian=np.empty((frames, 3, model.nv)),
        lowest=np.full((frames, model.ngeom), np.inf),
    )
    pelvis = int(character.joint_bodies[0])
    standing = np.flatnonzero(model.geom_conaffinity & model.geom_contype[0])
    for t, data in _posed(character, q):
        mujoco.mj_jacSubtreeCom(model, data, out.com_jacobian[t], pelvis)
        out.joints[t] = data.xpos[character.joint_bodies]
        out.com[t] = data.subtree_com[pelvis]
        if heights:
            out.lowest[t, standing] = _lowest(model, data, standing)
    return out


def com_jacobian(character: Character, q: Array) -> Array:
    """d com / d q (T, 3, 56), in the tangent of q (T, 57)."""
    pelvis = int(character.joint_bodies[0])
    out = np.empty((len(q), 3, character.model.nv))
    for t, data in _posed(character, q):
        mujoco.mj_jacSubtreeCom(character.model, data, out[t], pelvis)
    return out


def _posed(character: Character, q: Array) -> Iterator[tuple[int, mujoco.MjData]]:
    """Each frame of q (T, 57) with MuJoCo's kinematics of it, in the same memory."""
    data = mujoco.MjData(character.model)
    for t in range(len(q)):
        data.qpos[:] = q[t]
        mujoco.mj_kinematics(character.model, data)
        mujoco.mj_comPos(character.model, data)
        yield t, data


def com_velocity(com_jacobian: Array, v: Array) -> Array:
    """Velocity (T, 3) of the centre of mass at velocities v (T, 56)."""
    return np.einsum("tik,tk->ti", com_jacobian, v)


def joint_positions(character: Character, q: Array) -> Array:
    """World positions (T, 22, 3), m, of the joints at q (T, 57)."""
    return poses(character, q, heights=False).joints


def _lowest(model: mujoco.MjModel, data: mujoco.MjData, geoms: NDArray[np.intp]) -> Array:
    """Height of the lowest point of each of `geoms`."""
    down = data.geom_xmat[geoms, 6:]  # the world's z axis in geom frames
    size = model.geom_size[geoms]
    kind = model.geom_type[geoms]
    reach = np.where(
        kind == mujoco.mjtGeom.mjGEOM_BOX,
        np.sum(np.abs(down) * size, axis=1),
        np.where(
            kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            np.linalg.norm(down * size, axis=1),
            size[:, 0] + np.abs(down[:, 2]) * size[:, 1],  # capsule
        ),
    )
    return data.geom_xpos[geoms, 2] - reach
