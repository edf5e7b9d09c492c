"""The floor under a clip, the feet on it, and the soles of the feet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot
from physique.motion.clip import Motion
from physique.motion.kinematics import joint_positions, motion_world
from physique.skeleton import INDEX

Array = NDArray[np.float64]

_KNEES = (INDEX["left_knee"], INDEX["right_knee"])
_ANKLES = (INDEX["left_ankle"], INDEX["right_ankle"])
_BALLS = (INDEX["left_foot"], INDEX["right_foot"])
BALL_HEIGHT = 0.025  # m, of the ball joint of the foot over the sole

_SLOW = 0.25  # m/s, of a ball of the foot that stands
_SIGMA = 0.012  # m, scatter of the heights of standing feet
_TILT_PRIOR = np.radians(0.7)  # scatter of the tilt of a floor; CMU's trials reach 1 degree
_SIDE_PRIOR = 0.01  # m, scatter of the height of left feet over right ones
_MAX_TILT = np.radians(3.0)


@dataclass(frozen=True)
class Floor:
    """The plane z = level + slope_x x + slope_y y, m, on which the balls of the feet stand."""

    level: float
    slope_x: float
    slope_y: float

    def height(self, points: Array) -> Array:
        """Heights (...) of points (..., 3) over the plane, m."""
        plane = self.level + self.slope_x * points[..., 0] + self.slope_y * points[..., 1]
        return np.asarray(points[..., 2] - plane)


def speeds(points: Array, fps: float) -> Array:
    """Speeds (T, ...), m/s, of points (T, ..., 3), by central differences."""
    if len(points) < 2:
        return np.zeros(points.shape[:-1])
    return np.asarray(np.linalg.norm(np.gradient(points, 1.0 / fps, axis=0), axis=-1))


def fit_floor(motion: Motion) -> Floor:
    """The plane under the balls of the feet, where they stand still and low.

    Each stand counts once, however long. Stands that are not near the lowest ones (a raised foot)
    do not count. The tilt is drawn to zero as far as the stands do not show it, and is at most 3
    degrees. Without any stand (crawling, rolling) the plane is level, at the height of whichever
    joint is the lowest.
    """
    places = joint_positions(motion)
    stands = _stands(places, motion.fps)
    if len(stands) == 0:
        return Floor(float(np.percentile(places[..., 2].min(axis=1), 10)), 0.0, 0.0)
    floor = Floor(float(np.percentile(stands[:, 2], 10)), 0.0, 0.0)
    center = np.median(stands, axis=0)
    tilt_precision, side_precision = (_SIGMA / _TILT_PRIOR) ** 2, (_SIGMA / _SIDE_PRIOR) ** 2
    prior = np.diag([0.0, tilt_precision, tilt_precision, side_precision])
    for band in (0.10, 0.08, 0.06, 0.04, 0.03, 0.03, 0.03):
        near = stands[np.abs(floor.height(stands)) < band]
        if len(near) == 0:
            break
        # A fighter with one foot always in front shows no tilt but the difference of two feet.
        A = np.column_stack([np.ones(len(near)), near[:, :2] - center[:2], near[:, 3]])
        level, sx, sy, _ = np.linalg.solve(A.T @ A + prior, A.T @ near[:, 2])
        tilt = float(np.hypot(sx, sy))
        if tilt > np.tan(_MAX_TILT):
            sx, sy = np.array([sx, sy]) * np.tan(_MAX_TILT) / tilt
        floor = Floor(float(level - sx * center[0] - sy * center[1]), float(sx), float(sy))
    return floor


def _stands(places: Array, fps: float) -> Array:
    """(N, 4) mean places of the balls of the feet while they stand still under the shank, with
    0.5 for the left foot and -0.5 for the right one in the last column."""
    standing = (speeds(places[:, _BALLS], fps) < _SLOW) & _shank_upright(places)
    least = max(1, round(0.05 * fps))
    found = []
    for side, ball in enumerate(_BALLS):
        for start, stop in _runs(standing[:, side]):
            if stop - start >= least:
                found.append([*places[start:stop, ball].mean(axis=0), 0.5 - side])
    return np.array(found).reshape(-1, 4)


def _shank_upright(places: Array) -> NDArray[np.bool_]:
    """(T, 2) whether the knees are over the ankles, as they are not in kneeling or lying."""
    shank = places[:, _KNEES] - places[:, _ANKLES]
    return np.asarray(shank[..., 2] > 0.6 * np.linalg.norm(shank, axis=-1))


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and stop of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def level_floor(motion: Motion, floor: Floor) -> Motion:
    """The motion turned and shifted so that the floor is z = 0 under the soles."""
    normal = np.array([-floor.slope_x, -floor.slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    axis = np.cross(normal, [0.0, 0.0, 1.0])
    angle = np.arctan2(np.linalg.norm(axis), normal[2])
    upright = rot.exp(axis / max(float(np.linalg.norm(axis)), 1e-12) * angle)
    origin = np.array([0.0, 0.0, floor.level])
    root = rot.rotate(upright, motion.root - origin)
    root[:, 2] += BALL_HEIGHT
    rotations = motion.rotations.copy()
    rotations[:, 0] = rot.normalize(rot.multiply(upright, rotations[:, 0]))
    return replace(motion, root=root, rotations=rotations)


def level_soles(motion: Motion) -> Motion:
    """The feet turned so that a foot which stands flat on z = 0 has no pitch and no roll.

    Files differ in what a foot's zero pitch and roll are, and their rest poses do not stand on a
    floor; the frames in which both ankle and ball stand still do tell. The joints stay where they
    are: what the foot's frame turns, its rest segment turns back. A foot that never stands takes
    the mirrored turn of the other; without any, the file's rest pose counts.
    """
    world, places = motion_world(motion)
    turns: list[Array | None] = []
    upright = _shank_upright(places)
    for side, (ankle, ball) in enumerate(zip(_ANKLES, _BALLS, strict=True)):
        flat = upright[:, side] & _flat(places[:, ankle], places[:, ball], motion.fps)
        if flat.sum() < 3:
            turns.append(None)
            continue
        up = rot.rotate(rot.conjugate(world[flat, ankle]), np.array([0.0, 0.0, 1.0]))
        up = np.median(up, axis=0)
        # More than 40 degrees is no flat foot, whatever else it is.
        turns.append(up if up[2] > np.cos(np.radians(40)) * np.linalg.norm(up) else None)
    mirror = np.array([1.0, -1.0, 1.0])
    ups = list(turns)
    for side, other in ((0, turns[1]), (1, turns[0])):
        if ups[side] is None and other is not None:
            ups[side] = np.asarray(other * mirror)
    rotations, rest = motion.rotations.copy(), motion.rest_joints.copy()
    for ankle, ball, upward in zip(_ANKLES, _BALLS, ups, strict=True):
        segment = rest[ball] - rest[ankle]
        if upward is not None:
            axis = np.cross([0.0, 0.0, 1.0], upward)
            angle = np.arctan2(np.linalg.norm(axis), upward[2])
            turn = rot.exp(axis / max(float(np.linalg.norm(axis)), 1e-12) * angle)
            segment = rot.rotate(rot.conjugate(turn), segment)
            # Keep the rest foot straight ahead.
            yaw = rot.about("z", np.arctan2(segment[1], segment[0]))
            segment = rot.rotate(rot.conjugate(yaw), segment)
            turn = rot.multiply(turn, yaw)
            rotations[:, ankle] = rot.multiply(rotations[:, ankle], turn)
            rotations[:, ball] = rot.multiply(rot.conjugate(turn), rot.multiply(rotations[:, ball], turn))
        rest[ball] = rest[ankle] + segment
    rest[:, 2] += BALL_HEIGHT - rest[list(_BALLS), 2].mean()
    return replace(motion, rotations=rot.normalize(rotations), rest_joints=rest)


def _flat(ankle: Array, ball: Array, fps: float) -> NDArray[np.bool_]:
    """(T,) frames in which a foot stands flat: ball low, both still, the heel at its lowest."""
    low = (np.abs(ball[:, 2] - BALL_HEIGHT) < 0.03) & (speeds(ball, fps) < _SLOW)
    still = low & (speeds(ankle, fps) < _SLOW)
    if not still.any():
        return still
    heel = np.percentile(ankle[still, 2], 15)
    return still & (np.abs(ankle[:, 2] - heel) < 0.012)


def find_contacts(motion: Motion) -> NDArray[np.bool_]:
    """(T, 2) left and right foot on the floor z = 0, by the height and speed of ball and heel.

    A contact begins within 3 cm of the height of a standing foot and below 0.4 m/s, and ends
    beyond twice that.
    """
    places = joint_positions(motion)
    contacts = np.zeros((motion.frames, 2), dtype=bool)
    for side in range(2):
        # Legs differ in length, so count each foot from its own sole.
        sole = motion.rest_joints[_BALLS[side], 2] - BALL_HEIGHT
        for joint in (_ANKLES[side], _BALLS[side]):
            height = places[:, joint, 2] - (motion.rest_joints[joint, 2] - sole)
            speed = speeds(places[:, joint], motion.fps)
            enter = (height < 0.03) & (speed < 0.4)
            stay = (height < 0.06) & (speed < 0.8)
            for start, stop in _runs(stay):
                inside = np.flatnonzero(enter[start:stop])
                if len(inside):
                    contacts[start + inside[0] : start + inside[-1] + 1, side] = True
    return contacts


def settle(motion: Motion) -> Motion:
    """The motion on the floor z = 0: plane fitted and levelled, soles and contacts found."""
    motion = level_soles(level_floor(motion, fit_floor(motion)))
    return replace(motion, contacts=find_contacts(motion))
