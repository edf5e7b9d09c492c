"""A clip's skeleton onto the 22 SMPL joints: names, rest poses, spines of any number of joints.

The rotation of each body joint is that of its file joint relative to the file's T-pose; a segment
that lies otherwise in that T-pose than in ours (splayed legs, hanging arms) is turned into place,
so that the segments of the result lie as the performer's do.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot
from physique.motion.clip import Clip, Motion
from physique.motion.kinematics import clip_world
from physique.motion.tpose import Joints, TPose
from physique.skeleton import INDEX, JOINTS, PARENTS

Array = NDArray[np.float64]

_DOWN = np.array([0.0, 0.0, -1.0])
_SPINE = ("spine1", "spine2", "spine3")
_NECK = ("neck", "head")
# SMPL's pelvis joint is this part of a leg's length above the middle of the hip joints.
_PELVIS_OVER_HIPS = 0.11
# The ball of the foot of a skeleton that ends at the ankle, in leg lengths before and below it.
_BALL_FORWARD, _BALL_DOWN = 0.135, 0.05


def to_motion(clip: Clip, joints: Joints, tpose: TPose, name: str | None = None) -> Motion:
    """The clip on the 22 SMPL joints; the floor, the facing and the contacts are still to be set.

    joints: body joints to chains of the clip's joints, of `conventions`. The performer's hips
    stand where the file's do; the pelvis joint is put above their middle as in SMPL.
    """
    body = _Performer(clip, joints, tpose)
    world_rotations, world_positions = clip_world(clip)
    # (T, J, 4): file joints relative to the file's T-pose, in body axes.
    world_from_file = rot.from_matrix(tpose.R_file_from_world.T)
    file_from_body = rot.from_matrix(tpose.R_file_from_body)
    turned = rot.multiply(world_rotations, rot.conjugate(tpose.rotations))
    turned = rot.multiply(rot.multiply(world_from_file, turned), file_from_body)
    positions = world_positions @ tpose.R_file_from_world * tpose.meters

    world = np.empty((clip.frames, len(JOINTS), 4))  # world rotations of the body joints
    for j, joint in enumerate(JOINTS):
        follows = body.follows[joint]
        if follows is None:  # nothing in the file moves it: it keeps its rest pose
            world[:, j] = world[:, PARENTS[j]]
            continue
        low, high, t = follows
        between = turned[:, low] if low == high else _between(turned, low, high, t)
        world[:, j] = rot.multiply(between, body.alignment[joint])
    parents = np.maximum(np.array(PARENTS), 0)
    local = rot.multiply(rot.conjugate(world[:, parents]), world)
    local[:, 0] = world[:, 0]

    hips = 0.5 * (positions[:, joints["left_hip"][0]] + positions[:, joints["right_hip"][0]])
    rest_hips = 0.5 * (body.rest[INDEX["left_hip"]] + body.rest[INDEX["right_hip"]])
    root = hips + rot.rotate(world[:, 0], body.rest[0] - rest_hips)
    return Motion(
        name=name or clip.name,
        source=clip.source,
        fps=clip.fps,
        rotations=rot.normalize(local),
        root=root,
        rest_joints=body.rest,
        contacts=np.zeros((clip.frames, 2), dtype=bool),
    )


def _between(turned: Array, low: int, high: int, t: float) -> Array:
    return rot.slerp(turned[:, low], turned[:, high], np.full(len(turned), t))


def shortest_arc(a: Array, b: Array) -> Array:
    """The quaternion (4,) of the shortest turn that takes direction a (3,) to direction b (3,)."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    cross, dot = np.cross(a, b), float(a @ b)
    if dot < -1 + 1e-9:  # opposite: any axis square to a
        cross = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        return np.concatenate([[0.0], cross / np.linalg.norm(cross)])
    return rot.normalize(np.concatenate([[1 + dot], cross]))


class _Performer:
    """The performer's T-pose: what each body joint follows, its alignment, and where it lies.

    follows: per body joint (file joint, file joint, fraction between them), or None.
    alignment: per body joint (4,): our T-pose turned onto the file's.
    rest: (22, 3) m, the joints in our T-pose; heights from the middle of the hips.
    """

    def __init__(self, clip: Clip, joints: Joints, tpose: TPose) -> None:
        self._joints = joints
        self._clip = clip
        # The file's T-pose in body axes, metres.
        self._file = tpose.positions @ tpose.R_file_from_body * tpose.meters
        self.follows: dict[str, tuple[int, int, float] | None] = dict.fromkeys(JOINTS)
        self.alignment: dict[str, Array] = dict.fromkeys(JOINTS, rot.IDENTITY)
        self.rest = np.zeros((len(JOINTS), 3))
        for joint in JOINTS:
            if joint in joints and joint not in (*_SPINE, *_NECK):
                self.follows[joint] = (joints[joint][-1], joints[joint][-1], 0.0)
        self._torso()
        for side, sign in (("left", 1.0), ("right", -1.0)):
            self._leg(side)
            self._arm(side, np.array([0.0, sign, 0.0]))

    def _at(self, joint: str) -> Array:
        return np.asarray(self._file[self._joints[joint][0]])

    def _leg_length(self) -> float:
        lengths = [
            np.linalg.norm(self._at(f"{side}_{a}") - self._at(f"{side}_{b}"))
            for side in ("left", "right")
            for a, b in (("hip", "knee"), ("knee", "ankle"))
        ]
        return float(np.sum(lengths) / 2)

    def _torso(self) -> None:
        pelvis = 0.5 * (self._at("left_hip") + self._at("right_hip"))
        pelvis = pelvis + np.array([0.0, 0.0, _PELVIS_OVER_HIPS * self._leg_length()])
        self.rest[0] = pelvis
        joints = self._joints
        shoulders = 0.5 * (self._at("left_shoulder") + self._at("right_shoulder"))
        self._distribute(_SPINE, joints["spine"], joints["pelvis"][-1], shoulders)
        neck, head = joints.get("neck", ()), joints.get("head", ())
        top = joints["spine"][-1]
        if neck and head:
            for joint, chain in (("neck", neck), ("head", head)):
                self.follows[joint] = (chain[-1], chain[-1], 0.0)
                self.rest[INDEX[joint]] = self._file[chain[0]]
        elif chain := neck or head:
            # Nothing hangs on the head, so it need not balance the neck: put it where heads are.
            base = self._file[chain[0]]
            self._distribute(_NECK, chain, top, base)
            self.rest[INDEX["neck"]] = base
            self.rest[INDEX["head"]] = base + np.array([0.0, 0.0, 0.12 * self._leg_length()])
        else:
            length = 0.25 * np.linalg.norm(shoulders - pelvis)
            self.rest[INDEX["neck"]] = shoulders + np.array([0.0, 0.0, 0.3 * length])
            self.rest[INDEX["head"]] = shoulders + np.array([0.0, 0.0, length])

    def _distribute(self, targets: tuple[str, ...], chain: tuple[int, ...], base: int, end: Array) -> None:
        """Let the targets share the turns of a chain of file joints evenly.

        Target k follows the chain at the fraction (k + 1) / m of its n joints, and lies at the
        mean of the joints whose turns it takes over, so that what the chain carries at its end
        stays in place to first order.
        """
        n, m = len(chain), len(targets)
        nodes = [base, *chain]
        places = np.array([self._file[i] for i in chain])
        if n == 1:  # round the only joint
            step = 0.3 * (end - places[0]) if m > 1 else np.zeros(3)
            spread = [places[0] + step * (k - (m - 1) / 2) for k in range(m)]
        else:
            edges = np.linspace(0, n, m + 1)
            spread = []
            for a, b in pairwise(edges):
                share = np.clip(np.minimum(np.arange(n) + 1, b) - np.maximum(np.arange(n), a), 0, 1)
                spread.append(share @ places / share.sum())
            if n < m:
                spread = _spread(places, m)
        for k, target in enumerate(targets):
            f = (k + 1) * n / m
            low = min(int(np.floor(f + 1e-9)), n)
            t = f - low if f - low > 1e-9 else 0.0
            self.follows[target] = (nodes[low], nodes[low + 1] if t else nodes[low], t)
            self.rest[INDEX[target]] = spread[k]

    def _align(self, joint: str, parent: str, ours: Array, theirs: Array) -> None:
        """Turn `joint` so that its segment `ours` lies along `theirs`, as part of its parent."""
        carried = self.alignment[parent]
        arc = shortest_arc(rot.rotate(carried, ours), theirs)
        self.alignment[joint] = rot.multiply(arc, carried)

    def _leg(self, side: str) -> None:
        hip, knee, ankle, foot = (f"{side}_{part}" for part in ("hip", "knee", "ankle", "foot"))
        thigh, shank = self._at(knee) - self._at(hip), self._at(ankle) - self._at(knee)
        self._align(hip, "pelvis", _DOWN, thigh)
        self._align(knee, hip, _DOWN, shank)
        self.rest[INDEX[hip]] = self._at(hip)
        self.rest[INDEX[knee]] = self._at(hip) + _DOWN * np.linalg.norm(thigh)
        self.rest[INDEX[ankle]] = self.rest[INDEX[knee]] + _DOWN * np.linalg.norm(shank)
        sole = self._foot_segment(side)
        if sole is None:
            self.alignment[ankle] = rot.IDENTITY
            leg = self._leg_length()
            offset = np.array([_BALL_FORWARD * leg, 0.0, -_BALL_DOWN * leg])
        else:
            # Straight ahead, as deep as the file's foot hangs from its shank.
            drop = float(sole @ shank) / float(np.linalg.norm(shank))
            ahead = np.sqrt(max(float(sole @ sole) - drop**2, 1e-12))
            offset = np.array([ahead, 0.0, -drop])
            self._align(ankle, knee, offset, sole)
        self.rest[INDEX[foot]] = self.rest[INDEX[ankle]] + offset
        self.alignment[foot] = self.alignment[ankle]

    def _foot_segment(self, side: str) -> Array | None:
        """(3,) m from the ankle to the ball of the foot, or None where the file does not say."""
        if f"{side}_foot" in self._joints:
            segment = self._at(f"{side}_foot") - self._at(f"{side}_ankle")
        else:
            ends = self._children(self._joints[f"{side}_ankle"][-1])
            if not ends:
                return None
            segment = self._file[ends[0]] - self._at(f"{side}_ankle")
        return segment if segment[0] > 0.3 * np.linalg.norm(segment) else None

    def _children(self, index: int) -> list[int]:
        """Children that lie apart from their parent."""
        far = [int(i) for i in np.flatnonzero(self._clip.parents == index)]
        return [i for i in far if np.linalg.norm(self._file[i] - self._file[index]) > 5e-3]

    def _arm(self, side: str, out: Array) -> None:
        collar, shoulder, elbow, wrist = (
            f"{side}_{part}" for part in ("collar", "shoulder", "elbow", "wrist")
        )
        upper, fore = self._at(elbow) - self._at(shoulder), self._at(wrist) - self._at(elbow)
        self._align(shoulder, collar, out, upper)
        self._align(elbow, shoulder, out, fore)
        self._align(wrist, elbow, out, self._hand_segment(side, fore))
        self.rest[INDEX[shoulder]] = self._at(shoulder)
        self.rest[INDEX[elbow]] = self._at(shoulder) + out * np.linalg.norm(upper)
        self.rest[INDEX[wrist]] = self.rest[INDEX[elbow]] + out * np.linalg.norm(fore)
        if collar in self._joints and (np.linalg.norm(self._at(collar) - self._at(shoulder)) > 5e-3):
            self.rest[INDEX[collar]] = self._at(collar)
        else:
            neck, end = self.rest[INDEX["neck"]], self._at(shoulder)
            self.rest[INDEX[collar]] = np.array([end[0], 0.35 * end[1], min(neck[2], end[2])])

    def _hand_segment(self, side: str, forearm: Array) -> Array:
        """(3,) from the wrist to the fingers, thumb left out; the forearm's where there is none."""
        start = self._joints[f"{side}_wrist"][-1]
        ends = [i for i in self._children(start) if "thumb" not in self._clip.joints[i].lower()]
        hand = np.mean(self._file[ends], axis=0) - self._file[start] if ends else np.zeros(3)
        return np.asarray(hand) if np.linalg.norm(hand) > 1e-6 else forearm


def _spread(places: Array, m: int) -> list[Array]:
    """m places on the line of n < m joints, of which evenly shared turns balance the joints'.

    The joint i takes its turn from the targets that overlap [i, i + 1) of n; the least-norm change
    from an even spread that keeps each joint's mean place.
    """
    n = len(places)
    edges = np.linspace(0, n, m + 1)
    share = np.zeros((n, m))
    for k in range(m):
        for i in range(n):
            share[i, k] = max(0.0, min(i + 1, edges[k + 1]) - max(i, edges[k]))
    even = np.array([places[0] + (places[-1] - places[0]) * (k / (m - 1)) for k in range(m)])
    correction = np.linalg.pinv(share) @ (places - share @ even)
    return list(even + correction)
