"""What a pushed body should aim at: the motion beside its place, where it may come to rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.character.model import Character
from physique.character.state import difference, finite_velocity, integrate
from physique.reference.target import Target

Array = NDArray[np.float64]

#: Joint angles and the pelvis' orientation return to the motion's with this time constant.
CALM = 0.15  # s
#: The body's excess velocity fades with this one, about that of a falling pendulum of its height.
SETTLE = 0.3  # s


def recovery_target(
    character: Character, q0: Array, v0: Array, motion: Target, timestep: float
) -> tuple[Target, Array]:
    """The motion (T frames) as it might be performed from (q0 (57,), v0 (56,)), its first frame,
    and how far (2,), m, beside its place it ends.

    In kinematics only: the body comes to rest where its present velocity carries it within
    `SETTLE`, so that nothing pulls it back before it is safe. Where feet must step for that, an
    optimiser that obeys physics makes them step.
    """
    time = timestep * np.arange(len(motion.q))
    pose = kinematics.poses(character, q0[None], heights=False)
    com, com_velocity = pose.com[0], pose.com_jacobian[0] @ v0
    carry = SETTLE * (com_velocity - motion.com_velocity[0])[:2]
    end = (com - motion.com[0])[:2] + carry
    aside = end - carry * np.exp(-time / SETTLE)[:, None]  # (T, 2)
    start = difference(motion.q[0], q0)
    start[:2] = 0.0
    q = integrate(motion.q, np.exp(-time / CALM)[:, None] * start)
    # Turning and bending move the centre of mass; the pelvis makes up for it.
    q[:, :2] += motion.com[:, :2] + aside - kinematics.poses(character, q, heights=False).com[:, :2]
    q[0] = q0
    v = finite_velocity(q, timestep)
    v[0] = v0
    pose = kinematics.poses(character, q, heights=False)
    return Target(q, v, pose.com, kinematics.com_velocity(pose.com_jacobian, v)), end
