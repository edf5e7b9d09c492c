"""Motion + character -> what the character should do, on the control grid (sections 3.2, 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from physique import skeleton
from physique.motion.clip import Motion
from physique.motion.filter import resample
from physique.simulation import kinematics, reduced
from physique.simulation.character import Character
from physique.simulation.state import finite_velocity
from physique.tracking.costs import Target

Array = NDArray[np.float64]

#: The body's height over the floor is corrected no faster than this.
FLOOR_SMOOTHING = 0.08  # s


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
    difference of the standing pelvis heights. What remains between soles and floor is taken out.
    """
    timestep = float(character.model.opt.timestep)
    motion = resample(motion, 1.0 / timestep)
    rest = character.body.joints
    scale = leg_length(rest) / leg_length(motion.rest_joints)
    root = motion.root.copy()
    root[:, :2] = root[0, :2] + scale * (root[:, :2] - root[0, :2])
    root[:, 2] += rest[0, 2] - motion.rest_joints[0, 2]
    angles = reduced.to_angles(motion.rotations, rest)
    q = np.concatenate([root, motion.rotations[:, 0], angles], axis=1)
    q[:, 2] += floor_correction(character, q, motion.contacts)
    v = finite_velocity(q, timestep)
    pose = kinematics.poses(character, q)
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


def leg_length(rest_joints: Array) -> float:
    """Hip to ankle along the bones of the left leg, m, of rest_joints (22, 3)."""
    hip, knee, ankle = (rest_joints[skeleton.INDEX[f"left_{j}"]] for j in ("hip", "knee", "ankle"))
    return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))


def floor_correction(character: Character, q: Array, contacts: NDArray[np.bool_]) -> Array:
    """What to add to the root's height (T,), m, so that the lowest point touches the floor.

    In contact the lowest point of the standing feet is put on the floor; between contacts the
    correction is interpolated, but never lets any part sink in.
    """
    lowest = kinematics.poses(character, q).lowest
    feet = np.stack([lowest[:, geoms].min(axis=1) for geoms in character.foot_geoms], axis=1)
    clearance = np.where(contacts, feet, np.inf).min(axis=1)  # (T,)
    touching = np.flatnonzero(np.isfinite(clearance))
    anything = -lowest.min(axis=1)  # raises the lowest point of all to the floor
    if len(touching) == 0:
        return np.full(len(q), max(0.0, float(anything.max())))
    frames = np.arange(len(q))
    correction = np.interp(frames, touching, -clearance[touching])
    sigma = FLOOR_SMOOTHING / character.model.opt.timestep
    correction = gaussian_filter1d(np.maximum(correction, anything), sigma, mode="nearest")
    return correction
