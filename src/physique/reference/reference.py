"""Motion + character -> what the character should do, on the control grid (sections 3.2, 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from physique import rotations, skeleton
from physique.character import kinematics
from physique.character.balance import move_com
from physique.character.held import held_geoms
from physique.character.hinges import columns
from physique.character.model import Character, empty_handed
from physique.character.state import finite_velocity
from physique.motion.clip import Motion
from physique.motion.filter import resample
from physique.motion.kinematics import joint_positions
from physique.reference import footing, gimbal, reduced
from physique.reference.target import Target, Weights

Array = NDArray[np.float64]

CARRY_SMOOTHING = 0.25  # s
#: Resistance of the pelvis' place, per m2: next to none, for E does not hold it.
_FREE = 0.01
_FIXED = 1e4
_ARM = ("collar", "shoulder", "elbow", "wrist")


@dataclass(frozen=True)
class Reference:
    """T frames at the simulator's step: target states and which feet should be on the floor.

    q (T, 57), v (T, 56), com and com_velocity (T, 3), contacts (T, 2) bool, joints (T, 22, 3) m.
    source_q (T, 57): the recording's angles and path on this body, before a floor was put under
    its feet.
    """

    name: str
    timestep: float
    q: Array
    v: Array
    com: Array
    com_velocity: Array
    contacts: NDArray[np.bool_]
    joints: Array
    source_q: Array

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.q)

    def target(self, start: int, stop: int, shift: Array) -> Target:
        """Frames start to stop (exclusive), moved horizontally by shift (2,) m."""
        move = np.array([shift[0], shift[1], 0.0])
        q = self.q[start:stop].copy()
        q[:, :3] += move
        return Target(q, self.v[start:stop], self.com[start:stop] + move, self.com_velocity[start:stop])


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
    angles = gimbal.calm(reduced.to_angles(motion.rotations, rest), timestep)
    source_q = np.concatenate([root, motion.rotations[:, 0], angles], axis=1)
    ankles = joint_positions(motion)[:, list(footing.ANKLES), :2]
    q = footing.stand(empty_handed(character), source_q, motion.contacts, start + scale * (ankles - start))
    if held_geoms(character.model):
        q = carry(character, q)
    v = finite_velocity(q, timestep)
    pose = kinematics.poses(character, q, heights=False)
    return Reference(
        name=motion.name,
        timestep=timestep,
        q=q,
        v=v,
        com=pose.com,
        com_velocity=kinematics.com_velocity(pose.com_jacobian, v),
        contacts=motion.contacts,
        joints=pose.joints,
        source_q=source_q,
    )


def carry(character: Character, q: Array) -> Array:
    """q (T, 57), as somebody who holds what this character holds would stand.

    The performer's centre of mass is over the feet; with an object in the hand the same pose would
    carry it to that side, for good where one stands. The pose gives way by what E (Eq. 2, with the
    weights of section 3.1) says is best: its pose term resists, and the pelvis' turn with the
    weight of its own term, as if that were a square too; its com term pulls the common
    centre of mass back, horizontally. The arm that holds stays as the performer's: it would gain as
    much by rising as by sinking. Only as fast as a person shifts weight: what an object does within
    a swing of the arm is left to the simulation.
    """
    weights = Weights()
    timestep = float(character.model.opt.timestep)
    full = kinematics.poses(character, q, heights=False).com
    aside = (full - kinematics.poses(empty_handed(character), q, heights=False).com)[:, :2]
    aside = gaussian_filter1d(aside, CARRY_SMOOTHING / timestep, axis=0, mode="nearest")
    resistance = np.concatenate([np.full(3, _FREE), np.full(3, weights.root), weights.pose * weights.joints])
    for held in held_geoms(character.model):
        side = skeleton.JOINTS[held.joint].removesuffix("_wrist")
        for joint in _ARM:
            resistance[6:][columns(f"{side}_{joint}")] *= _FIXED
    return move_com(character, q, full[:, :2] - aside, resistance, weights.com)


def hip_middle(rest_joints: Array) -> Array:
    """From the pelvis joint to the point between the hips (3,), m, of rest_joints (22, 3)."""
    hips = [skeleton.INDEX["left_hip"], skeleton.INDEX["right_hip"]]
    return rest_joints[hips].mean(axis=0) - rest_joints[0]


def leg_length(rest_joints: Array) -> float:
    """Hip to ankle along the bones of the left leg, m, of rest_joints (22, 3)."""
    hip, knee, ankle = (rest_joints[skeleton.INDEX[f"left_{j}"]] for j in ("hip", "knee", "ankle"))
    return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))
