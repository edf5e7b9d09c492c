"""Poses changed as little as possible so that the centre of mass is where it should be."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique import rotations, skeleton
from physique.character.model import Character
from physique.character.state import integrate

Array = NDArray[np.float64]

_FEET = tuple(skeleton.INDEX[f"{side}_ankle"] for side in ("left", "right"))
_ITERATIONS = 4
_LONGEST = 0.3  # rad or m, of one iteration
#: m2 and rad2; feet give way by micrometres, and a stretched leg makes no singular system.
_FIRM = 1e-6


def move_com(character: Character, q: Array, com: Array, resistance: Array, pull: float) -> Array:
    """q (T, 57) with the centre of mass towards com (T, 2), m, horizontally, and both feet kept.

    Minimises, frame by frame, sum(resistance d^2) + pull |com error|^2 over changes d of the pose;
    resistance (56,) is per m2 and rad2, pull per m2.
    """
    model = character.model
    data = mujoco.MjData(model)
    pelvis = int(character.joint_bodies[0])
    feet = character.joint_bodies[list(_FEET)]
    compliance = 1.0 / resistance
    soft = np.concatenate([[1.0 / pull] * 2, [_FIRM] * 12])
    J = np.zeros((14, model.nv))
    whole = np.zeros((3, model.nv))
    out = np.empty_like(q)
    for t in range(len(q)):
        pose = q[t].copy()
        moved = np.zeros(model.nv)
        for iteration in range(_ITERATIONS):
            data.qpos[:] = pose
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            place, turn = data.xpos[feet].copy(), data.xquat[feet].copy()
            if iteration == 0:
                kept_place, kept_turn = place, turn
            mujoco.mj_jacSubtreeCom(model, data, whole, pelvis)
            J[:2] = whole[:2]
            for side, foot in enumerate(feet):
                rows = slice(2 + 6 * side, 8 + 6 * side)
                mujoco.mj_jacBody(model, data, J[rows][:3], J[rows][3:], foot)
            away = rotations.log(rotations.multiply(kept_turn, rotations.conjugate(turn)))
            wanted = np.concatenate(
                [com[t] - data.subtree_com[pelvis, :2], np.stack([kept_place - place, away], axis=1).ravel()]
            )
            # The whole change is what resists, not this iteration's part of it.
            wanted += J @ moved
            lever = compliance[:, None] * J.T
            total = lever @ np.linalg.solve(J @ lever + np.diag(soft), wanted)
            step = np.clip(total - moved, -_LONGEST, _LONGEST)
            pose = integrate(pose, step)
            moved += step
        out[t] = pose
    return out
