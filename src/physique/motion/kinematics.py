"""Forward kinematics: where the joints of a clip or a motion are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot
from physique.motion.clip import Clip, Motion
from physique.skeleton import PARENTS

Array = NDArray[np.float64]


def forward(parents: NDArray[np.int64], rotations: Array, positions: Array) -> tuple[Array, Array]:
    """World rotations (T, J, 4) and positions (T, J, 3) of a chain of joints.

    parents: (J,), parents before children. rotations: (T, J, 4) and positions: (T, J, 3), each
    joint in its parent's frame.
    """
    world_rotations = np.empty_like(rotations)
    world_positions = np.empty_like(positions)
    for j, parent in enumerate(parents):
        if parent < 0:
            world_rotations[:, j] = rotations[:, j]
            world_positions[:, j] = positions[:, j]
            continue
        world_rotations[:, j] = rot.multiply(world_rotations[:, parent], rotations[:, j])
        world_positions[:, j] = world_positions[:, parent] + rot.rotate(
            world_rotations[:, parent], positions[:, j]
        )
    return rot.positive(world_rotations), world_positions


def clip_world(clip: Clip) -> tuple[Array, Array]:
    """World rotations (T, J, 4) and positions (T, J, 3) of a clip's own joints, file units."""
    return forward(clip.parents, clip.rotations, clip.positions)


def motion_world(motion: Motion) -> tuple[Array, Array]:
    """World rotations (T, 22, 4) and joint positions (T, 22, 3), m, of a motion.

    The bones are the performer's own: `motion.rest_joints`.
    """
    parents = np.array(PARENTS)
    offsets = motion.rest_joints - motion.rest_joints[np.maximum(parents, 0)]
    positions = np.tile(offsets, (motion.frames, 1, 1))
    positions[:, 0] = motion.root
    return forward(parents, motion.rotations, positions)


def joint_positions(motion: Motion) -> Array:
    """World positions (T, 22, 3) of the joints, m."""
    return motion_world(motion)[1]
