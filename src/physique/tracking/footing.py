"""A floor under the feet: the reference's legs bent so that feet stand where they should.

The same joint angles on a body of other proportions leave one foot in the air while the other
stands, and wider hips put the feet so far apart that the body could not balance on either. Each
leg reaches for the performer's step: the knee bends, hip and ankle keep the foot's orientation
(two-bone inverse kinematics in closed form). The pelvis is raised or lowered to share what is left
between the feet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from physique import rotations, skeleton
from physique.simulation import kinematics, reduced
from physique.simulation.character import Character
from physique.simulation.hinges import AXES, columns

Array = NDArray[np.float64]

#: Corrections change no faster than this. The pelvis carries the body's mass: raised by 2 cm within
#: 0.06 s it would need half the body's weight more.
PELVIS_SMOOTHING = 0.25  # s
FOOT_SMOOTHING = 0.05  # s
#: Legs are never stretched beyond this share of their length.
REACH = 0.998
#: Ankles nearer than this, m, have the feet in each other; from CLEAR on they pass freely.
COLLIDE, CLEAR = 0.12, 0.20
_SIDES = ("left", "right")
ANKLES = (skeleton.INDEX["left_ankle"], skeleton.INDEX["right_ankle"])


def stand(character: Character, q: Array, contacts: NDArray[np.bool_], ankles: Array) -> Array:
    """q (T, 57) with ankles above (T, 2, 2), m, feet that are in contact (T, 2) on the floor, and
    nothing below it."""
    timestep = character.model.opt.timestep
    sigma, slow = FOOT_SMOOTHING / timestep, PELVIS_SMOOTHING / timestep
    aside = ankles - kinematics.joint_positions(character, q)[:, list(ANKLES), :2]
    aside *= _room(ankles, sigma)[:, None, None]
    q = _reach(character, q, np.concatenate([aside, np.zeros((len(q), 2, 1))], axis=2))
    q[:, 2] += _root_correction(foot_clearance(character, q), contacts, slow)
    # Twice: the ankle's turn moves the toes a little against the foot.
    for _ in range(2):
        up = _foot_correction(foot_clearance(character, q), contacts, sigma)
        q = _reach(character, q, up[..., None] * np.array([0.0, 0.0, 1.0]))
    sunk = np.maximum(-kinematics.poses(character, q).lowest.min(axis=1), 0.0)
    # Hands and knees that the floor would cut: lift the body, ahead of time and smoothly.
    q[:, 2] += gaussian_filter1d(maximum_filter1d(sunk, round(2 * slow) | 1), slow / 2)
    return q


def foot_clearance(character: Character, q: Array) -> Array:
    """Height (T, 2), m, of the lowest point of the left and the right foot."""
    lowest = kinematics.poses(character, q).lowest
    return np.stack([lowest[:, geoms].min(axis=1) for geoms in character.foot_geoms], axis=1)


def _room(ankles: Array, sigma: float) -> Array:
    """How much of the performer's step to take (T,), 0 to 1: none where the feet would collide.

    The performer's feet may be narrower than this body's, or cross.
    """
    apart = np.linalg.norm(ankles[:, 0] - ankles[:, 1], axis=1)
    share = np.clip((apart - COLLIDE) / (CLEAR - COLLIDE), 0.0, 1.0)
    return gaussian_filter1d(share, sigma, mode="nearest")


def _root_correction(clearance: Array, contacts: NDArray[np.bool_], sigma: float) -> Array:
    standing = contacts.any(axis=1)
    if not standing.any():
        return np.full(len(contacts), max(0.0, float(-clearance.min())))
    share = np.where(contacts, clearance, 0.0).sum(axis=1) / np.maximum(contacts.sum(axis=1), 1)
    frames = np.arange(len(contacts))
    known = np.flatnonzero(standing)
    return gaussian_filter1d(np.interp(frames, known, -share[known]), sigma, mode="nearest")


def _foot_correction(clearance: Array, contacts: NDArray[np.bool_], sigma: float) -> Array:
    """How far (T, 2) to move each foot up, m: onto the floor in contact, out of it elsewhere."""
    frames = np.arange(len(contacts))
    out = np.zeros_like(clearance)
    for side in range(2):
        known = np.flatnonzero(contacts[:, side])
        if len(known):
            out[:, side] = np.interp(frames, known, -clearance[known, side])
        out[:, side] = np.maximum(out[:, side], -clearance[:, side])
    smooth = gaussian_filter1d(out, sigma, axis=0, mode="nearest")
    # Smoothing must not leave a standing foot in the floor or over it.
    return np.where(contacts, 0.5 * (smooth + out), smooth)


def _reach(character: Character, q: Array, move: Array) -> Array:
    """q (T, 57) with each ankle moved by move (T, 2, 3), m, and the feet's orientation kept."""
    q = q.copy()
    rest = character.body.joints
    local = reduced.to_rotations(q[:, 3:7], q[:, 7:])
    world = reduced.part_transforms(local, rest)
    for side, name in enumerate(_SIDES):
        hip, knee, ankle = (skeleton.INDEX[f"{name}_{joint}"] for joint in ("hip", "knee", "ankle"))
        thigh, shank = rest[knee] - rest[hip], rest[ankle] - rest[knee]
        bend = q[:, 7 + columns(f"{name}_knee").start]
        old = world[:, ankle, :, 3] - world[:, hip, :, 3]
        new = old + move[:, side]
        bend_new, direction_in_thigh = _two_bone(thigh, shank, np.linalg.norm(new, axis=1), bend)
        # Turn the thigh so that the hip-ankle line, given the new knee, points at the target.
        R_thigh = world[:, hip, :, :3]
        reached = np.einsum("tij,tj->ti", R_thigh, direction_in_thigh)
        R_thigh_new = rotations.to_matrix(_between(reached, new)) @ R_thigh
        R_pelvis = world[:, 0, :, :3]
        R_shank_new = R_thigh_new @ rotations.to_matrix(rotations.about("y", bend_new))
        hip_turn = np.swapaxes(R_pelvis, 1, 2) @ R_thigh_new
        ankle_turn = np.swapaxes(R_shank_new, 1, 2) @ world[:, ankle, :, :3]
        for joint, turn in ((f"{name}_hip", hip_turn), (f"{name}_ankle", ankle_turn)):
            angles = rotations.to_euler(AXES[joint], rotations.from_matrix(turn))
            q[:, 7:][:, columns(joint)] = angles
        q[:, 7 + columns(f"{name}_knee").start] = bend_new
    q[:, 7:] = reduced.unwrap(q[:, 7:])
    return q


def _two_bone(thigh: Array, shank: Array, distance: Array, bend: Array) -> tuple[Array, Array]:
    """Knee angle (T,), rad, that puts the ankle `distance` (T,) from the hip, bent to the same
    side as `bend` (T,), and the hip-ankle vector (T, 3) in the thigh's frame."""
    # |thigh + R_y(k) shank|^2 = constant + a cos k + b sin k
    a = 2 * (thigh[0] * shank[0] + thigh[2] * shank[2])
    b = 2 * (thigh[0] * shank[2] - thigh[2] * shank[0])
    constant = thigh @ thigh + shank @ shank + 2 * thigh[1] * shank[1]
    amplitude, phase = np.hypot(a, b), np.arctan2(b, a)
    longest = np.sqrt(constant + amplitude)
    cosine = (np.minimum(distance, REACH * longest) ** 2 - constant) / amplitude
    spread = np.arccos(np.clip(cosine, -1.0, 1.0))
    # A leg that is stretched further than allowed already stays as it is.
    start = np.abs(bend - phase)
    spread = np.where(distance > REACH * longest, np.minimum(spread, start), spread)
    knee = phase + np.where(bend >= phase, spread, -spread)
    turned = np.einsum("tij,j->ti", rotations.to_matrix(rotations.about("y", knee)), shank)
    return knee, thigh + turned


def _between(a: Array, b: Array) -> Array:
    """Least rotations (T, 4) that turn directions a (T, 3) into directions b (T, 3)."""
    a = a / np.linalg.norm(a, axis=1, keepdims=True)
    b = b / np.linalg.norm(b, axis=1, keepdims=True)
    w = 1 + np.sum(a * b, axis=1, keepdims=True)
    return rotations.normalize(np.concatenate([w, np.cross(a, b)], axis=1))
