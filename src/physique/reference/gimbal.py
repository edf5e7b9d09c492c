"""Joint angles without the spins of gimbal lock.

Where the middle one of three angles nears +-90 degrees, the outer two turn against each other
faster than any joint can, though the limb itself hardly moves. A body that must follow the angles
flails there. The path is led over the pole instead (or round it, further away), a few degrees
beside the limb's true orientation for a moment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.character.hinges import AXES, columns
from physique.reference.banded import LeastSquares

Array = NDArray[np.float64]

#: Angles of a joint that nowhere turn faster than this, rad/s, stay as they are.
_FAST = 30.0
#: Frames with a smaller cosine of the middle angle do not tell which way the outer ones went.
_POLE = 0.25
_TURN = 0.05  # rad, scatter of the orientation
_RATE = 10  # rad/s, of the angles' rates
_BEND = 900  # rad/s2, of their accelerations
_STEP = 0.3  # rad, of one iteration's correction
_ITERATIONS = 20


def calm(angles: Array, timestep: float) -> Array:
    """angles (T, 50), rad, with those of joints that pass through gimbal lock led past it."""
    out = angles.copy()
    for joint, axes in AXES.items():
        own = columns(joint)
        if len(axes) != 3 or len(angles) < 3:
            continue
        if np.abs(np.diff(angles[:, own], axis=0)).max() > _FAST * timestep:
            out[:, own] = _smooth(axes, _bridge(angles[:, own]), angles[:, own], timestep)
    return out


def _bridge(angles: Array) -> Array:
    """angles (T, 3) with frames near the pole interpolated, and of the two triples that give the
    same rotation the one nearer to the frame before."""
    clear = np.flatnonzero(np.abs(np.cos(angles[:, 1])) >= _POLE)
    if len(clear) < 2:
        return angles
    linked = angles[clear].copy()
    for i in range(1, len(linked)):
        a, b, c = linked[i]
        choices = np.array([[a, b, c], [a + np.pi, np.pi - b, c + np.pi]])
        choices += 2 * np.pi * np.round((linked[i - 1] - choices) / (2 * np.pi))
        linked[i] = choices[np.abs(choices - linked[i - 1]).sum(axis=1).argmin()]
    frames = np.arange(len(angles))
    return np.stack([np.interp(frames, clear, linked[:, k]) for k in range(3)], axis=1)


def _smooth(axes: str, start: Array, wanted: Array, timestep: float) -> Array:
    """The calm path near `start` (T, 3) whose rotations are near those of `wanted` (T, 3)."""
    target = rotations.conjugate(rotations.from_euler(axes, wanted))
    x = start.copy()
    every = np.arange(3)
    one = np.ones(3)
    for _ in range(_ITERATIONS):
        error = rotations.log(rotations.multiply(target, rotations.from_euler(axes, x)))
        problem = LeastSquares(len(x), 3)
        problem.add(error, _turn_by_angle(axes, x), np.array([[1 / _TURN]]), every)
        problem.keep_still(x, one / (_RATE * timestep))
        problem.keep_smooth(x, one / (_BEND * timestep**2))
        problem.keep_small(np.zeros_like(x), one / _STEP)
        x += problem.solve()
    return x


def _turn_by_angle(axes: str, angles: Array) -> Array:
    """Derivatives (T, 3, 3) of the rotation vector, in the limb's own frame, by the angles."""
    R = [rotations.to_matrix(rotations.about(a, angles[:, k])) for k, a in enumerate(axes)]
    unit = [np.eye(3)["xyz".index(a)] for a in axes]
    inner = np.swapaxes(R[2], 1, 2)
    outer = inner @ np.swapaxes(R[1], 1, 2)
    return np.stack([outer @ unit[0], inner @ unit[1], np.broadcast_to(unit[2], (len(angles), 3))], axis=-1)
