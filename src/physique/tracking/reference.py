"""Motion + character -> what the character should do, on the control grid (sections 3.2, 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique import rotations, skeleton
from physique.motion.clip import Motion
from physique.motion.filter import resample
from physique.motion.kinematics import joint_positions
from physique.simulation import kinematics, reduced
from physique.simulation.character import Character, empty_handed
from physique.simulation.state import finite_velocity
from physique.tracking import footing
from physique.tracking.costs import Target

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reference:
    """T frames at the simulator's step: target states and which feet should be on the floor.

    q (T, 57), v (T, 56), com and com_velocity (T, 3), contacts (T, 2) bool, joints (T, 22, 3) m.
    """

    name: str
    timestep: float
    q: Array
    v: Array
    com: Array
    com_velocity: Array
    contacts: NDArray[np.bool_]
    joints: Array

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.q)

    def target(self, start: int, stop: int, shift: Array) -> Target:
        """Frames start to stop (exclusive), moved horizontally by shift (2,) m."""
        move = np.array([shift[0], shift[1], 0.0])
        q = self.q[start:stop].copy()
        q[:, :3] += move
        return Target(q, self.v[start:stop], self.com[start:stop] + move,
                      self.com_velocity[start:stop])  # fmt: skip


def make_reference(motion: Motion, character: Character) -> Reference:
    """The motion as this character should perform it.

    Joint rotations are the performer's, reduced to 50 angles. The pelvis' path is scaled
    horizontally by the ratio of the leg lengths, so that feet that stand still in the source
    stand still here, and shifted vertically by the difference of the standing centres of mass
    (section 3.2); both bodies hold the mass distribution of `character`, so that is the
    difference of the standing hip heights. What remains between soles and floor is taken out
    (`footing`).
    """
    timestep = float(character.model.opt.timestep)
    motion = resample(motion, 1.0 / timestep)
    rest = character.body.joints
    scale = leg_length(rest) / leg_length(motion.rest_joints)
    # Pelvis joints sit at different places in the hip bone; hips are where legs begin.
    hips = motion.root + rotations.rotate(motion.rotations[:, 0], hip_middle(motion.rest_joints))
    start = hips[0, :2].copy()
    hips[:, :2] = start + scale * (hips[:, :2] - start)
    hips[:, 2] += (rest[0] + hip_middle(rest) - motion.rest_joints[0])[2]
    hips[:, 2] -= hip_middle(motion.rest_joints)[2]
    root = hips - rotations.rotate(motion.rotations[:, 0], hip_middle(rest))
    angles = reduced.to_angles(motion.rotations, rest)
    q = np.concatenate([root, motion.rotations[:, 0], angles], axis=1)
    ankles = joint_positions(motion)[:, list(footing.ANKLES), :2]
    bare = empty_handed(character)
    q = footing.stand(bare, q, motion.contacts, start + scale * (ankles - start))
    v = finite_velocity(q, timestep)
    pose = kinematics.poses(bare, q)
    import os
    V = os.environ.get("VARIANT", "A")
    if V == "A":
        pose = kinematics.poses(character, q)
    else:
        full = kinematics.poses(character, q)
        pose.com[:, 2] = full.com[:, 2]
        pose.com_jacobian[:, 2] = full.com_jacobian[:, 2]
    return Reference(
        name=motion.name,
        timestep=timestep,
        q=q,
        v=v,
        com=pose.com,
        com_velocity=kinematics.com_velocity(pose.com_jacobian, v),
        contacts=motion.contacts,
        joints=pose.joints,
    )


def hip_middle(rest_joints: Array) -> Array:
    """From the pelvis joint to the point between the hips (3,), m, of rest_joints (22, 3)."""
    hips = [skeleton.INDEX["left_hip"], skeleton.INDEX["right_hip"]]
    return rest_joints[hips].mean(axis=0) - rest_joints[0]


def leg_length(rest_joints: Array) -> float:
    """Hip to ankle along the bones of the left leg, m, of rest_joints (22, 3)."""
    hip, knee, ankle = (rest_joints[skeleton.INDEX[f"left_{j}"]] for j in ("hip", "knee", "ankle"))
    return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))
