"""From MakeHuman's A-pose, elbows bent, to the T-pose, by linear blend skinning.

Arms lie along +-y, palms down, thumbs forward, elbows flexing forward about z, as in SMPL. Legs go
straight down and feet straight ahead, as in the T-poses that motions are relative to: a body whose
legs stood apart at rest would walk with its feet twice as far apart as the performer. The twist of
the upper arm and of the hand is spread over the limb by the rig's extra bones, so the skin does not
wring at the shoulder and the wrist.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.rotations import conjugate, exp, log, multiply, to_matrix
from physique.rotations import from_matrix as quaternion
from physique.skeleton import INDEX, JOINTS

Array = NDArray[np.float64]

#: The share of the arm's elevation that the shoulder girdle takes, rad per rad.
GIRDLE_SHARE = 0.2
#: Pose bones that are not joints, and the joint they belong to.
FOLDED = {"shoulder_swing": "shoulder", "wrist_twist": "elbow"}


def t_pose(
    vertices: Array, points: dict[str, Array], weights: Array, bones: tuple[str, ...]
) -> tuple[Array, Array]:
    """T-posed vertices (V, 3) and joints (22, 3), m.

    vertices: (V, 3) m, A-pose. points: the joints and, per side, the knuckles `index`, `middle` and
    `little`. weights: (V, B) of `bones`, the 22 joints and the twist bones.
    """
    R = np.tile(np.eye(3), (len(bones), 1, 1))
    offset = np.zeros((len(bones), 3))
    joints = np.array([points[name] for name in JOINTS])
    for side in ("left", "right"):
        limbs = {**_arm(points, side), **_leg(points, side)}
        for part, (rotation, pivot, moved) in limbs.items():
            b = bones.index(f"{side}_{part}")
            R[b], offset[b] = rotation, moved - rotation @ pivot
            if f"{side}_{part}" in INDEX:
                joints[INDEX[f"{side}_{part}"]] = moved
    posed = vertices.copy()
    for b in range(len(bones)):
        if np.array_equal(R[b], np.eye(3)) and not offset[b].any():
            continue
        rows = np.nonzero(weights[:, b])[0]
        step = vertices[rows] @ (R[b] - np.eye(3)).T + offset[b]
        posed[rows] += weights[rows, b, None] * step
    return posed, joints


def skin_weights(weights: Array, bones: tuple[str, ...]) -> Array:
    """Weights (V, B) of the pose bones folded onto the 22 joints, (V, 22)."""
    folded = np.zeros((len(weights), len(JOINTS)))
    for b, bone in enumerate(bones):
        side, _, part = bone.partition("_")
        folded[:, INDEX[f"{side}_{FOLDED[part]}" if part in FOLDED else bone]] += weights[:, b]
    return folded


def _arm(points: dict[str, Array], side: str) -> dict[str, tuple[Array, Array, Array]]:
    """For each bone of one arm: rotation (3, 3), its joint in the A-pose, its joint in the T-pose.

    Built for the left arm; the right one is its mirror image.
    """
    flip = np.array([1.0, 1.0 if side == "left" else -1.0, 1.0])
    collar, shoulder, elbow, wrist, index, middle, little = (
        points[f"{side}_{name}"] * flip
        for name in ("collar", "shoulder", "elbow", "wrist", "index", "middle", "little")
    )
    y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    upper, fore = elbow - shoulder, wrist - elbow
    elevation = np.arctan2(upper[2], upper[1])
    girdle = to_matrix(exp(np.array([-GIRDLE_SHARE * elevation, 0.0, 0.0])))
    # The elbow flexes forward: upper arm (y) x forearm (+x component) points down.
    bend = np.cross(upper, fore)
    shoulder_R = _frame(y, -z) @ _frame(upper, bend).T
    elbow_R = _frame(y, -z) @ _frame(fore, bend).T
    # Palm down: from the little finger to the index finger is forward.
    hand_R = _frame(y, -z) @ _frame(middle - wrist, np.cross(middle - wrist, index - little)).T
    swing_R = _swing(girdle @ upper, y) @ girdle
    new_shoulder = collar + girdle @ (shoulder - collar)
    new_elbow = new_shoulder + shoulder_R @ (elbow - shoulder)
    new_wrist = new_elbow + elbow_R @ (wrist - elbow)
    # The forearm's far half takes half of the hand's turn, about its own length only.
    twist = _twist(_halfway(elbow_R, hand_R) @ elbow_R.T, y)
    bones = {
        "collar": (girdle, collar, collar),
        "shoulder": (shoulder_R, shoulder, new_shoulder),
        "shoulder_swing": (_halfway(swing_R, shoulder_R), shoulder, new_shoulder),
        "elbow": (elbow_R, elbow, new_elbow),
        "wrist_twist": (twist @ elbow_R, elbow, new_elbow),
        "wrist": (hand_R, wrist, new_wrist),
    }
    mirror = np.diag(flip)
    return {
        name: (mirror @ rotation @ mirror, flip * pivot, flip * moved)
        for name, (rotation, pivot, moved) in bones.items()
    }


def leg_extension(points: dict[str, Array]) -> float:
    """How much taller, m, the person is in the T-pose, with straight legs, than in the A-pose."""
    hip, knee, ankle = (points[f"left_{name}"] for name in ("hip", "knee", "ankle"))
    length = np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)
    return float(length - (hip[2] - ankle[2]))


def _leg(points: dict[str, Array], side: str) -> dict[str, tuple[Array, Array, Array]]:
    """As `_arm`, for the bones of one leg; the sole stays level."""
    hip, knee, ankle, foot = (points[f"{side}_{n}"] for n in ("hip", "knee", "ankle", "foot"))
    down = np.array([0.0, 0.0, -1.0])
    thigh, shank = _swing(knee - hip, down), _swing(ankle - knee, down)
    new_knee = hip + thigh @ (knee - hip)
    new_ankle = new_knee + shank @ (ankle - knee)
    toes = foot - ankle
    ahead = to_matrix(exp(np.array([0.0, 0.0, -np.arctan2(toes[1], toes[0])])))
    return {
        "hip": (thigh, hip, hip),
        "knee": (shank, knee, new_knee),
        "ankle": (ahead, ankle, new_ankle),
        "foot": (ahead, foot, new_ankle + ahead @ toes),
    }


def _frame(along: Array, normal: Array) -> Array:
    """Rotation (3, 3) whose first column is `along` and whose third is nearest to `normal`."""
    a = along / np.linalg.norm(along)
    n = normal - a * (a @ normal)
    n = n / np.linalg.norm(n)
    return np.stack([a, np.cross(n, a), n], axis=1)


def _swing(a: Array, b: Array) -> Array:
    """The smallest rotation (3, 3) from direction a to direction b."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    return to_matrix(exp(axis / max(float(sine), 1e-12) * np.arctan2(sine, a @ b)))


def _halfway(a: Array, b: Array) -> Array:
    """The rotation (3, 3) half of the way from a to b."""
    qa, qb = quaternion(a), quaternion(b)
    return to_matrix(multiply(exp(0.5 * log(multiply(qb, conjugate(qa)))), qa))


def _twist(R: Array, axis: Array) -> Array:
    """The part of a rotation (3, 3) that turns about a unit axis."""
    q = quaternion(R)
    turn = 2.0 * np.arctan2(q[1:] @ axis, q[0])
    return to_matrix(exp(turn * axis))
