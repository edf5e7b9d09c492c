"""SMPL-style joint rotations -> the 50 angles, by closest global transforms (section 3.3).

Knees, toes and elbows have fewer axes than the source's joints, so the angles are those whose
global part transforms (rotation and position, as 3 x 4 matrices in metres) are nearest to the
source's in Frobenius norm: a sum of squares, solved for all frames at once by damped Gauss-Newton
from a joint-by-joint start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique import rotations, skeleton
from physique.character.hinges import AXES, HINGES, columns

Array = NDArray[np.float64]

_ITERATIONS = 30
_TOLERANCE = 1e-12  # squared Frobenius norm


#: Chains of which some joint has fewer than three axes. Every other joint is matched exactly, which
#: makes the chains independent of each other; letting the trunk give way too would lower the sum of
#: squares by at most 0.15 % on extreme twists.
CHAINS = (
    ("left_hip", "left_knee", "left_ankle", "left_foot"),
    ("right_hip", "right_knee", "right_ankle", "right_foot"),
    ("neck", "head"),
    ("left_shoulder", "left_elbow", "left_wrist"),
    ("right_shoulder", "right_elbow", "right_wrist"),
)


def to_angles(local: Array, rest_joints: Array) -> Array:
    """Angles (T, 50), rad, continuous in time, nearest to rotations local (T, 22, 4).

    rest_joints: (22, 3) m, the body whose part transforms are compared. The pelvis is matched
    exactly: its orientation is free in both.
    """
    target = part_transforms(local, rest_joints)
    angles = _joint_by_joint(local)
    for chain in CHAINS:
        _fit_chain(chain, angles, target, rest_joints)
    return unwrap(angles)


def _fit_chain(chain: tuple[str, ...], angles: Array, target: Array, rest_joints: Array) -> None:
    """Improve the angles of a chain's joints in place."""
    parts = [skeleton.INDEX[joint] for joint in chain]
    base = target[:, skeleton.PARENTS[parts[0]]]
    offsets = np.array([rest_joints[p] - rest_joints[skeleton.PARENTS[p]] for p in parts])
    wanted = target[:, parts]
    cols = np.concatenate([np.arange(50)[columns(joint)] for joint in chain])
    active = np.arange(len(angles))
    damping = np.full(len(angles), 1e-6)
    world, jacobian = _chain_forward(chain, base, offsets, angles[:, cols])
    cost = np.sum((world - wanted) ** 2, axis=(1, 2, 3))
    for _ in range(_ITERATIONS):
        residual = (wanted[active] - world).reshape(len(active), -1, 1)
        J = jacobian.reshape(len(active), len(cols), -1)
        normal = J @ np.swapaxes(J, 1, 2)
        normal += damping[active, None, None] * (np.eye(len(cols)) + normal * np.eye(len(cols)))
        step = np.linalg.solve(normal, J @ residual)[..., 0]
        trial = angles[np.ix_(active, cols)] + step
        trial_world, trial_jacobian = _chain_forward(chain, base[active], offsets, trial)
        trial_cost = np.sum((trial_world - wanted[active]) ** 2, axis=(1, 2, 3))
        gain = cost[active] - trial_cost
        better = gain > 0
        angles[np.ix_(active[better], cols)] = trial[better]
        cost[active[better]] = trial_cost[better]
        world[better], jacobian[better] = trial_world[better], trial_jacobian[better]
        damping[active] *= np.where(better, 0.1, 10.0)
        # A step that is rejected though tiny has nothing left to gain.
        going = np.where(better, gain > _TOLERANCE, np.max(np.abs(step), axis=1) > 1e-6)
        active, world, jacobian = active[going], world[going], jacobian[going]
        if len(active) == 0:
            break


def _chain_forward(chain: tuple[str, ...], base: Array, offsets: Array, angles: Array) -> tuple[Array, Array]:
    """Transforms (T, parts, 3, 4) of a chain at angles (T, n) and their derivatives
    (T, n, parts, 3, 4)."""
    frames, count = angles.shape
    world = np.empty((frames, len(chain), 3, 4))
    axes = np.empty((frames, count, 3))
    owner = np.empty(count, dtype=int)
    R, p, i = base[..., :3], base[..., 3], 0
    for j, joint in enumerate(chain):
        p = p + R @ offsets[j]
        for axis in AXES[joint]:
            axes[:, i], owner[i] = R[..., "xyz".index(axis)], j
            R = R @ rotations.to_matrix(rotations.about(axis, angles[:, i]))
            i += 1
        world[:, j, :, :3], world[:, j, :, 3] = R, p
    jacobian = np.zeros((frames, count, len(chain), 3, 4))
    for i in range(count):
        for j in range(owner[i], len(chain)):
            moved = world[:, j].copy()
            moved[..., 3] -= world[:, owner[i], :, 3]
            jacobian[:, i, j] = _cross_matrix(axes[:, i]) @ moved
    return world, jacobian


def _cross_matrix(a: Array) -> Array:
    """(T, 3, 3) of a (T, 3): _cross_matrix(a) @ b is a x b."""
    out = np.zeros((len(a), 3, 3))
    out[:, 0, 1], out[:, 0, 2] = -a[:, 2], a[:, 1]
    out[:, 1, 0], out[:, 1, 2] = a[:, 2], -a[:, 0]
    out[:, 2, 0], out[:, 2, 1] = -a[:, 1], a[:, 0]
    return out


def to_rotations(pelvis: Array, angles: Array) -> Array:
    """Local rotations (T, 22, 4) of the joints at angles (T, 50), with pelvis (T, 4)."""
    local = np.tile(rotations.IDENTITY, (len(angles), len(skeleton.JOINTS), 1))
    local[:, 0] = pelvis
    for joint, axes in AXES.items():
        if axes:
            local[:, skeleton.INDEX[joint]] = rotations.from_euler(axes, angles[:, columns(joint)])
    return local


def part_transforms(local: Array, rest_joints: Array) -> Array:
    """Global transforms (T, 22, 3, 4) of the parts: rotation matrix and joint position from the
    pelvis joint, m."""
    world = np.empty((*local.shape[:2], 3, 4))
    for j, parent in enumerate(skeleton.PARENTS):
        R = rotations.to_matrix(local[:, j])
        if parent < 0:
            world[:, j, :, :3], world[:, j, :, 3] = R, 0.0
            continue
        up = world[:, parent]
        offset = rest_joints[j] - rest_joints[parent]
        world[:, j, :, :3] = up[..., :3] @ R
        world[:, j, :, 3] = up[..., 3] + up[..., :3] @ offset
    return world


def unwrap(angles: Array) -> Array:
    """The same rotations, each frame's angles (T, 50) nearest to the frame before."""
    out = angles.copy()
    for t in range(1, len(out)):
        out[t] += 2 * np.pi * np.round((out[t - 1] - out[t]) / (2 * np.pi))
    balls = [np.arange(len(HINGES))[columns(joint)] for joint, axes in AXES.items() if len(axes) == 3]
    out[:, balls] = rotations.unwrap_euler(angles[:, balls])
    return out


def _joint_by_joint(local: Array) -> Array:
    """Angles of each joint alone; what its axes cannot do is handed on to its children."""
    angles = np.empty((len(local), len(HINGES)))
    wanted: list[Array] = []  # global rotation of each part in the source
    reached: list[Array] = []
    for j, (name, parent) in enumerate(zip(skeleton.JOINTS, skeleton.PARENTS)):
        if parent < 0:
            wanted.append(local[:, j])
            reached.append(local[:, j])
            continue
        wanted.append(rotations.multiply(wanted[parent], local[:, j]))
        axes = AXES[name]
        turn = rotations.multiply(rotations.conjugate(reached[parent]), wanted[j])
        if len(axes) == 3:
            angles[:, columns(name)] = rotations.to_euler(axes, turn)
        elif axes:
            third = next(a for a in "xyz" if a not in axes)
            if len(axes) == 2:
                # The angle about the axis that is missing, in the middle, is dropped.
                euler = rotations.to_euler(axes[0] + third + axes[1], turn)
                angles[:, columns(name)] = euler[:, [0, 2]]
            else:
                angles[:, columns(name)] = _swing_free_angle(turn, axes)[:, None]
        done = rotations.from_euler(axes, angles[:, columns(name)]) if axes else None
        reached.append(reached[parent] if done is None else rotations.multiply(reached[parent], done))
    return angles


def _swing_free_angle(turn: Array, axis: str) -> Array:
    """The angle (T,) about `axis` whose rotation is nearest to turn (T, 4)."""
    return 2 * np.arctan2(turn[:, 1 + "xyz".index(axis)], turn[:, 0])
