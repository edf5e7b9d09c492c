"""A state that a simulation can start in: out of penetration, standing feet at rest."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.character.held import held_geoms
from physique.character.model import Character
from physique.character.state import integrate

Array = NDArray[np.float64]

#: Parts are pushed this far apart, which is where their contact force has faded out.
CLEARANCE = 0.002  # m
_ITERATIONS = 50
_DAMPING = 1e-4
#: Points of a standing foot lower than this are on the floor.
_NEAR_FLOOR = 0.01  # m


def start_state(character: Character, q: Array, v: Array, standing: NDArray[np.bool_]) -> tuple[Array, Array]:
    """The state nearest to q (57,), v (56,) that a simulation can start in; standing (2,) feet.

    Parts of the body that overlap in the mocap pose are turned apart by the least change of joint
    angles, and so is a held object from the body and the floor; then the body is lifted out of the
    floor. Feet that should stand get no velocity, by the change of velocity that needs least
    kinetic energy.
    """
    q = separate(character, q)
    q[2] += max(0.0, -lowest_contact(character, q))
    return q, rest_feet(character, q, v, standing)


def separate(character: Character, q: Array) -> Array:
    """q (57,) changed in its joint angles so that no two parts overlap and no held object is in the
    floor, as far as that goes."""
    model = character.model
    objects = {held.geom for held in held_geoms(model)}
    data = mujoco.MjData(model)
    q = q.copy()
    for _ in range(_ITERATIONS):
        rows, gaps = [], []
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        for contact in data.contact:
            stands = contact.geom1 == 0 and contact.geom2 not in objects
            if stands or contact.dist >= CLEARANCE:
                continue
            normal = contact.frame[:3]  # from geom1 to geom2
            rows.append(normal @ _point_jacobian_difference(model, data, contact))
            gaps.append(CLEARANCE - contact.dist)
        if not rows or max(gaps) < CLEARANCE:
            break
        J = np.array(rows)
        J[:, :6] = 0.0
        step = J.T @ np.linalg.solve(J @ J.T + _DAMPING * np.eye(len(J)), np.array(gaps))
        q = integrate(q, np.clip(step, -0.2, 0.2))
    return q


def lowest_contact(character: Character, q: Array) -> float:
    """Distance of the deepest point from the floor, m; negative inside, 0 at most."""
    data = mujoco.MjData(character.model)
    data.qpos[:] = q
    mujoco.mj_fwdPosition(character.model, data)
    return min([0.0, *(c.dist for c in data.contact if c.geom1 == 0)])


def rest_feet(character: Character, q: Array, v: Array, standing: NDArray[np.bool_]) -> Array:
    """v (56,) with the points of the feet that stand on the floor at rest; standing (2,) bool."""
    model = character.model
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    geoms = set(character.foot_geoms[standing].ravel().tolist())
    rows = [
        _point_jacobian_difference(model, data, contact)
        for contact in data.contact
        if contact.geom1 == 0 and contact.geom2 in geoms and contact.dist < _NEAR_FLOOR
    ]
    if not rows:
        return v.copy()
    J = np.concatenate(rows)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    lever = np.linalg.solve(M, J.T)
    # The points of one sole move together, so J has not full rank.
    return v - lever @ np.linalg.lstsq(J @ lever, J @ v, rcond=1e-6)[0]


def _point_jacobian_difference(
    model: mujoco.MjModel, data: mujoco.MjData, contact: mujoco.MjContact
) -> Array:
    """(3, 56): velocity of geom2's point against geom1's at the contact."""
    first, second = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, first, None, contact.pos, model.geom_bodyid[contact.geom1])
    mujoco.mj_jac(model, data, second, None, contact.pos, model.geom_bodyid[contact.geom2])
    return second - first
