"""A floor under the feet: the reference's legs bent so that feet stand where they should.

The same joint angles on a body of other proportions leave one foot in the air while the other
stands, and wider hips put the feet so far apart that the body could not balance on either. One
least-squares problem over the whole clip bends the legs and raises or lowers the pelvis: standing
feet touch the floor, keep still and reach for the performer's steps, none sinks into the floor, and
corrections are small and smooth in time. Smoothness decides where a leg is nearly straight: there a
centimetre takes 20 degrees of the knee, and legs that reach in each frame for themselves snap
straight and back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from physique import rotations, skeleton
from physique.character import kinematics
from physique.character.model import Character
from physique.character.soles import LEGS, Feet, feet
from physique.motion.ground import speeds
from physique.reference.banded import LeastSquares

Array = NDArray[np.float64]

#: Ankles nearer than this, m, have the feet in each other; from CLEAR on they pass freely.
COLLIDE, CLEAR = 0.12, 0.20
ANKLES = (skeleton.INDEX["left_ankle"], skeleton.INDEX["right_ankle"])

#: Coordinates of q that may change: the pelvis' height, then the angles of both legs.
_MOVED = np.array([2, *(7 + LEGS.ravel())])
#: Of those, what moves each foot.
_OWN = np.array([[0, *range(1, 9)], [0, *range(9, 17)]])
_ITERATIONS = 5
_ROOM_SMOOTHING = 0.05  # s
_WEIGHT_SMOOTHING = 0.03  # s, of the height that tells whether the body falls
_CARRIED = 6.0  # m/s2: who falls slower than this is carried by something


@dataclass(frozen=True)
class Scatter:
    """Standard deviations: how much each wish counts.

    touch: m, height of the sole of a standing foot, and depth of any sole below the floor.
    round: m, below which height the floor begins to push. softness: m, corners that are so much
    higher than the lowest one count a third of it. step: m, of an ankle from its place. creep: m/s,
    of a sole that stands; still: m/s, one that is much faster in the source does not stand but
    lands or turns. clearance: m, of the sole of a foot that
    swings, and swing: m, its scatter. tilt: rad, of a foot from its orientation in the source.
    angle, height: rad and m, of the corrections; bend, heave: rad/s2 and m/s2, of their
    accelerations.
    stand, lie, cut: m, of the whole body's shift where feet stand, of the lowest part's height
    where none does, and of its depth below the floor.
    """

    touch: float = 0.001
    round: float = 0.002
    softness: float = 0.004
    step: float = 0.01
    creep: float = 0.03
    still: float = 0.15
    clearance: float = 0.02
    swing: float = 0.01
    tilt: float = 0.05
    angle: float = 0.3
    height: float = 0.05
    bend: float = 40.0
    heave: float = 0.7
    stand: float = 0.01
    lie: float = 0.01
    cut: float = 0.003


def stand(
    character: Character, q: Array, contacts: NDArray[np.bool_], ankles: Array, scatter: Scatter = Scatter()
) -> Array:
    """q (T, 57) with ankles above (T, 2, 2), m, feet that are in contact (T, 2) on the floor, and
    nothing below it."""
    timestep = float(character.model.opt.timestep)
    room = _room(ankles, _ROOM_SMOOTHING / timestep)
    source_q, q = q, q.copy()
    source = feet(character, q)
    small = np.concatenate([[scatter.height], np.full(16, scatter.angle)])
    smooth = np.concatenate([[scatter.heave], np.full(16, scatter.bend)])
    for _ in range(_ITERATIONS):
        now = feet(character, q)
        problem = LeastSquares(len(q), len(_MOVED))
        problem.keep_small(q[:, _MOVED] - source_q[:, _MOVED], 1 / small)
        problem.keep_smooth(q[:, _MOVED] - source_q[:, _MOVED], 1 / (smooth * timestep**2))
        for side in range(2):
            _add_foot(problem, side, now, source, contacts[:, side], ankles[:, side], room, timestep, scatter)
        q[:, _MOVED] += problem.solve()
    return _ground(character, q, contacts, scatter)


def _add_foot(
    problem: LeastSquares,
    side: int,
    now: Feet,
    source: Feet,
    contacts: NDArray[np.bool_],
    ankles: Array,
    room: Array,
    timestep: float,
    scatter: Scatter,
) -> None:
    """The wishes of one foot: contacts (T,), ankles (T, 2) m, room (T,)."""
    own = _OWN[side]
    points, J = now.points[:, side], _with_height(now.by_angle[:, side])
    height = points[..., 2]
    share = np.exp((height.min(axis=1, keepdims=True) - height) / scatter.softness)
    share /= share.sum(axis=1, keepdims=True)
    # Of standing soles the lowest corners touch; no corner is below the floor.
    low = np.einsum("tk,tk->t", share, height)
    J_low = np.einsum("tk,tkj->tj", share, J[:, :, 2])
    problem.add(low[:, None], J_low[:, None], contacts[:, None] / scatter.touch, own)
    speed = speeds(source.points[:, side, :, :2], 1.0 / timestep)
    swing = np.clip((speed - scatter.still) / scatter.still, 0.0, 1.0) * ~contacts[:, None]
    for above, weight in ((0.0, 1 / scatter.touch), (scatter.clearance, swing / scatter.swing)):
        cost, slope = _floor(height - above, scatter.round)
        problem.add(cost, slope[..., None] * J[:, :, 2], np.atleast_2d(weight), own)
    # Where they touch, they keep still, if the performer's did.
    before, after = slice(None, -1), slice(1, None)
    was = source.points[:, side, :, :2]
    pace = np.einsum("tk,tki->ti", share[before], was[after] - was[before]) / timestep
    stands = contacts[before] & contacts[after]
    weight = stands * np.exp(-np.sum(pace**2, axis=1) / scatter.still**2) / scatter.creep
    J_before, J_after = (
        np.einsum("tk,tkij->tij", share[before], J[frames, :, :2]) / timestep for frames in (before, after)
    )
    slip = np.einsum("tk,tki->ti", share[before], points[after, :, :2] - points[before, :, :2])
    problem.add_pairs(slip / timestep, -J_before, J_after, weight[:, None], own)
    J_ankle = _with_height(now.ankles_by_angle[:, side, None])[:, 0]
    away = now.ankles[:, side, :2] - ankles
    problem.add(away, J_ankle[:, :2], room[:, None] / scatter.step, own)
    turn = now.R_world_from_foot[:, side] @ np.swapaxes(source.R_world_from_foot[:, side], 1, 2)
    tilt = rotations.log(rotations.from_matrix(turn))
    problem.add(tilt, now.turn_by_angle[:, side], np.array([[1 / scatter.tilt]]), own[1:])


def _with_height(by_angle: Array) -> Array:
    """Derivatives (T, K, 3, 8) of points by a leg's angles, with the pelvis' height before them."""
    up = np.zeros((*by_angle.shape[:-1], 1))
    up[..., 2, 0] = 1.0
    return np.concatenate([up, by_angle], axis=-1)


def _room(ankles: Array, sigma: float) -> Array:
    """How much of the performer's step to take (T,), 0 to 1: none where the feet would collide.

    The performer's feet may be narrower than this body's, or cross.
    """
    apart = np.linalg.norm(ankles[:, 0] - ankles[:, 1], axis=1)
    share = np.clip((apart - COLLIDE) / (CLEAR - COLLIDE), 0.0, 1.0)
    return gaussian_filter1d(share, sigma, mode="nearest")


def _ground(character: Character, q: Array, contacts: NDArray[np.bool_], scatter: Scatter) -> Array:
    """q (T, 57) raised where the floor would cut hands, knees or trunk, and lowered where nothing
    touches it though the body does not fall.

    A crawl or a roll has no standing feet to tell where its floor is.
    """
    timestep = float(character.model.opt.timestep)
    pose = kinematics.poses(character, q)
    lowest = pose.lowest.min(axis=1)[:, None]
    sigma = _WEIGHT_SMOOTHING / timestep
    falling = gaussian_filter1d(pose.com[:, 2], sigma, order=2, mode="nearest") / timestep**2
    carried = falling > -_CARRIED
    stands = np.asarray(contacts.any(axis=1))
    weight = np.where(stands, 1 / scatter.stand, np.where(carried, 1 / scatter.lie, 0.0))
    one, up = np.zeros(1, dtype=np.intp), np.ones((len(q), 1, 1))
    shift = np.zeros((len(q), 1))
    for _ in range(_ITERATIONS):
        problem = LeastSquares(len(q), 1)
        above = lowest + shift
        # Standing feet are where they should be.
        problem.add(np.where(stands[:, None], shift, above), up, weight[:, None], one)
        cost, slope = _floor(above, scatter.round)
        problem.add(cost, slope[..., None] * up, np.array([[1 / scatter.cut]]), one)
        problem.keep_small(shift, np.array([1 / scatter.height]))
        problem.keep_smooth(shift, np.array([1 / (scatter.heave * timestep**2)]))
        shift += problem.solve()
    q = q.copy()
    q[:, 2] += shift[:, 0]
    return q


def _floor(height: Array, edge: float) -> tuple[Array, Array]:
    """How far below the floor, m, and its derivative by height; rounded off over `edge` m, or
    points would flicker between wanted and free from iteration to iteration."""
    length = np.hypot(height, edge)
    return 0.5 * (length - height), 0.5 * (height / length - 1)
