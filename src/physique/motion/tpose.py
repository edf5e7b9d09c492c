"""A skeleton's own T-pose: how its joints lie there, which way is up, and how long a unit is."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot
from physique.errors import InputError
from physique.motion.clip import Clip
from physique.motion.conventions import Mapping
from physique.motion.kinematics import clip_world, forward

Array = NDArray[np.float64]
Joints = dict[str, tuple[int, ...]]

_UNITS = (1.0, 0.01, 0.001, 0.0254, 0.3048)  # m, cm, mm, inch, foot
_STATURE = (1.2, 2.3)  # m
_UNNAMED_UNIT = (5.0, 500.0)  # file units of stature that are taken as an arbitrary scale
_ASSUMED_STATURE = 1.70  # m

_JUMP = (12.0, 1000.0)  # degrees a frame and degrees a second that no one moves from a still pose

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class TPose:
    """The pose that stands for "no rotation" on the file's skeleton.

    rotations: (J, 4) world rotations of the file's joints in the pose.
    positions: (J, 3) their world positions, file units.
    R_file_from_body: (3, 3), columns forward, left, up of the person in the pose.
    R_file_from_world: (3, 3), columns forward, left, up of the world of the motion; up is exact,
        forward is arbitrary.
    meters: metres per file unit.
    lead_in: how many of the clip's first frames are the T-pose and the jump from it into the
        motion, and so no part of the motion.
    """

    rotations: Array
    positions: Array
    R_file_from_body: Array
    R_file_from_world: Array
    meters: float
    lead_in: int


def find_tpose(clip: Clip, mapping: Mapping, joints: Joints) -> TPose:
    """The T-pose of a clip's skeleton: the first frame where that is one, else the offsets.

    Raises InputError where neither is a person's pose, where left and right are swapped, and
    where the size is not a person's.
    """
    world_rotations, world_positions = clip_world(clip)
    frame = mapping.tpose if isinstance(mapping.tpose, int) else None
    if frame is not None and frame >= clip.frames:
        raise InputError(
            f"mapping {mapping.name!r}, tpose",
            f"frame {frame}",
            f"0 to {clip.frames - 1}",
            "correct the frame number",
        )
    lead_in = _lead_in(clip, world_positions, joints)
    if frame is None and mapping.tpose == "auto" and lead_in:
        frame = 0
    if frame is not None:
        rotations, positions = world_rotations[frame], world_positions[frame]
    else:
        identity = np.tile(rot.IDENTITY, (1, len(clip.joints), 1))
        still = forward(clip.parents, identity, _rest_offsets(clip)[None])
        rotations, positions = still[0][0], still[1][0]
    _check_pose(clip, positions, joints)
    up = _up(positions, joints)
    axis = int(np.argmax(np.abs(up)))
    snapped = np.eye(3)[axis] * np.sign(up[axis])
    body_up = snapped if snapped @ up > np.cos(np.radians(25)) else up
    left = _segment(positions, joints, "right_hip", "left_hip")
    if np.linalg.norm(np.cross(left, body_up)) < 1e-9:
        raise InputError(
            clip.source,
            "hips that are not beside each other",
            "the left hip on the person's left",
            "correct the OFFSETs or the mapping",
        )
    R_body = _basis(left, body_up)
    _check_sides(clip, positions, joints, R_body)
    world_up = _world_up(clip, mapping, joints, world_positions, body_up, frame is not None)
    R_world = _basis(np.roll(world_up, 1), world_up)
    stature = _stature(positions, joints, body_up)
    return TPose(rotations, positions, R_body, R_world, _meters(clip, mapping, stature), lead_in)


def _rest_offsets(clip: Clip) -> Array:
    """(J, 3) offsets; a joint whose position channels move it takes their median."""
    offsets = np.median(clip.positions, axis=0)
    offsets[0] = clip.offsets[0]
    return offsets


def _unit(v: Array) -> Array:
    return np.asarray(v / max(float(np.linalg.norm(v)), 1e-12))


def _basis(left: Array, up: Array) -> Array:
    """(3, 3) columns forward, left, up; up is kept exactly."""
    left = _unit(left - (left @ up) * up)
    return np.stack([np.cross(left, up), left, up], axis=1)


def _segment(positions: Array, joints: Joints, a: str, b: str) -> Array:
    """(..., 3) from body joint a to body joint b."""
    return np.asarray(positions[..., joints[b][0], :] - positions[..., joints[a][0], :])


def _up(positions: Array, joints: Joints) -> Array:
    """(3,) unit, from the ankles to the shoulders."""
    top = positions[joints["left_shoulder"][0]] + positions[joints["right_shoulder"][0]]
    bottom = positions[joints["left_ankle"][0]] + positions[joints["right_ankle"][0]]
    return _unit(top - bottom)


def _degrees(a: Array, b: Array) -> float:
    return float(np.degrees(np.arccos(np.clip(_unit(a) @ _unit(b), -1.0, 1.0))))


def _lead_in(clip: Clip, positions: Array, joints: Joints) -> int:
    """How many frames at the start are a T-pose and the jump from it; 0 where there is none.

    Some exporters put a T-pose before the motion, and some smooth the jump over a few frames.
    """
    if clip.frames < 3:
        return 0
    up = _up(positions[0], joints)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        lateral = sign * _segment(positions[0], joints, "right_shoulder", "left_shoulder")
        arm = _segment(positions[0], joints, f"{side}_shoulder", f"{side}_wrist")
        leg = _segment(positions[0], joints, f"{side}_hip", f"{side}_ankle")
        if _degrees(arm, lateral) > 20 or _degrees(leg, -up) > 15:
            return 0
    mapped = [i for chain in joints.values() for i in chain]
    early = clip.rotations[: min(clip.frames, round(0.25 * clip.fps) + 3), mapped]
    turns = rot.log(rot.multiply(rot.conjugate(early[:-1]), early[1:]))
    turn = np.degrees(np.linalg.norm(turns, axis=-1).max(axis=1))
    jump = turn > max(_JUMP[0], _JUMP[1] / clip.fps)
    if not jump[0]:
        return 0
    after = np.flatnonzero(~jump)
    return int(after[0]) if len(after) else 0


def _check_pose(clip: Clip, positions: Array, joints: Joints) -> None:
    remedy = (
        "pass a mapping file with tpose = N, the number of a frame in which the person "
        "stands with the arms out to the sides"
    )
    up = _up(positions, joints)
    for side in ("left", "right"):
        for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")):
            if np.linalg.norm(_segment(positions, joints, f"{side}_{a}", f"{side}_{b}")) < 1e-9:
                raise InputError(
                    clip.source,
                    f"no distance between {side} {a} and {side} {b}",
                    "bones with a length",
                    "correct the OFFSETs or the mapping",
                )
        leg = _segment(positions, joints, f"{side}_hip", f"{side}_ankle")
        thigh = _segment(positions, joints, f"{side}_hip", f"{side}_knee")
        shank = _segment(positions, joints, f"{side}_knee", f"{side}_ankle")
        trunk = _segment(positions, joints, "pelvis", f"{side}_shoulder")
        if _degrees(leg, -up) > 45 or _degrees(thigh, shank) > 45 or trunk @ up <= 0:
            raise InputError(
                clip.source,
                f"a rest pose in which the {side} leg does not hang down",
                "offsets or a first frame that show a T-pose",
                remedy,
            )


def _check_sides(clip: Clip, positions: Array, joints: Joints, R_file_from_body: Array) -> None:
    """Toes point forward, unless left and right are swapped or the axes are left-handed."""
    for side in ("left", "right"):
        if f"{side}_foot" in joints:
            toe = _segment(positions, joints, f"{side}_ankle", f"{side}_foot")
            if _unit(toe) @ R_file_from_body[:, 0] < -0.3:
                raise InputError(
                    clip.source,
                    f"a {side} foot that points backwards",
                    "the left hip on the person's left, right-handed axes",
                    "swap left and right in a mapping file",
                )


def _world_up(
    clip: Clip, mapping: Mapping, joints: Joints, positions: Array, body_up: Array, posed: bool
) -> Array:
    """(3,) the world's up in file axes.

    A pose taken from a frame stands in the world. Offsets may lie otherwise than the motion does
    (an armature that is turned as a whole), and then the motion itself tells.
    """
    named = mapping.up or clip.up
    if named is not None:
        return np.eye(3)["xyz".index(named)]
    axis = int(np.argmax(np.abs(body_up)))
    rest = np.eye(3)[axis] * np.sign(body_up[axis])
    if posed:
        return rest
    trunk = _segment(positions, joints, "pelvis", "left_shoulder") + _segment(
        positions, joints, "pelvis", "right_shoulder"
    )
    mean = np.mean(trunk / np.maximum(np.linalg.norm(trunk, axis=-1, keepdims=True), 1e-12), axis=0)
    axis = int(np.argmax(np.abs(mean)))
    upright = abs(mean[axis]) > 0.8 and abs(mean @ rest) < 0.5 and axis != 0
    return np.asarray(np.eye(3)[axis] * np.sign(mean[axis]) if upright else rest)


def _stature(positions: Array, joints: Joints, up: Array) -> float:
    """Body height, file units: legs and trunk, and shares of them for head and feet."""
    leg = np.mean(
        [
            np.linalg.norm(_segment(positions, joints, f"{side}_hip", f"{side}_knee"))
            + np.linalg.norm(_segment(positions, joints, f"{side}_knee", f"{side}_ankle"))
            for side in ("left", "right")
        ]
    )
    trunk = np.mean(
        [_segment(positions, joints, f"{side}_hip", f"{side}_shoulder") @ up for side in ("left", "right")]
    )
    # Hip to ankle is 0.49 and hip to shoulder 0.29 of stature (Drillis and Contini 1966).
    return float((leg + trunk) / 0.78)


def _meters(clip: Clip, mapping: Mapping, stature: float) -> float:
    low, high = _STATURE
    fixed = mapping.unit or clip.unit
    if fixed is not None:
        if low <= stature * fixed <= high:
            return fixed
        raise InputError(
            clip.source,
            f"a person of {stature * fixed:.3g} m",
            f"a stature of {low} to {high} m",
            "set unit = metres per unit in a mapping file",
        )
    fitting = [m for m in (*mapping.units, *_UNITS) if low <= stature * m <= high]
    if fitting:
        return fitting[0]
    if _UNNAMED_UNIT[0] <= stature <= _UNNAMED_UNIT[1]:
        _log.warning(
            "%s: the person is %.1f units high, which is no usual unit; taken as %.2f m "
            "(a mapping file may set unit = metres per unit)",
            clip.source,
            stature,
            _ASSUMED_STATURE,
        )
        return _ASSUMED_STATURE / stature
    raise InputError(
        clip.source,
        f"a person {stature:.3g} units high",
        f"a stature of {low} to {high} m in metres, centimetres, millimetres, inches or feet",
        "set unit = metres per unit in a mapping file",
    )
