"""Cleaning and resampling: spikes, measurement noise, frame rates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from physique import rotations as rot
from physique.motion.clip import Motion

Array = NDArray[np.float64]

# A glitch lies at least so far off the course of its neighbours, and takes accelerations to get
# there and back that no body has.
_SPIKE_ANGLE, _SPIKE_TURN = 0.35, 2000.0  # rad, rad/s2
_SPIKE_LENGTH, _SPIKE_PULL = 0.08, 200.0  # m, m/s2
_LONGEST_SPIKE = 3  # frames


def low_pass(motion: Motion, cutoff: float) -> Motion:
    """The motion without what is faster than `cutoff` Hz: zero-phase Butterworth, 4th order.

    Rotations are filtered as sign-continuous quaternions and renormalised: to second order in the
    turn within one filter length this is the filter on the rotation manifold. A cut-off at or
    above 0.45 of the frame rate, and clips of fewer than 5 frames, are returned as they are.
    """
    if cutoff >= 0.45 * motion.fps or motion.frames < 5:
        return motion
    sos = butter(2, cutoff, fs=motion.fps, output="sos")
    pad = min(motion.frames - 1, int(np.ceil(motion.fps / cutoff)))
    smooth = sosfiltfilt(sos, rot.continuous(motion.rotations), axis=0, padlen=pad)
    root = sosfiltfilt(sos, motion.root, axis=0, padlen=pad)
    return replace(motion, rotations=rot.normalize(smooth), root=root)


def repair_spikes(motion: Motion) -> Motion:
    """The motion with glitches of one to three frames replaced by the way between their ends.

    A glitch is a joint that leaves the course of its neighbours in time by 0.35 rad or more (the
    root by 8 cm) and returns to it faster than a body can.
    """
    rotations, root = motion.rotations.copy(), motion.root.copy()
    for length in range(1, _LONGEST_SPIKE + 1):
        span = length + 1
        if motion.frames <= span:
            break
        seconds = span / motion.fps
        least_angle = max(_SPIKE_ANGLE, _SPIKE_TURN * seconds**2 / 8)
        least_length = max(_SPIKE_LENGTH, _SPIKE_PULL * seconds**2 / 8)
        for middle in range(1, span):
            t = np.full(rotations[:-span].shape[:-1], middle / span)
            between = rot.slerp(rotations[:-span], rotations[span:], t)
            inside = slice(middle, middle + len(between))
            off = _angle(between, rotations[inside])
            gap = _angle(rotations[:-span], rotations[span:])
            bad = (off > least_angle) & (gap < 0.5 * off)
            rotations[inside][bad] = between[bad]
            line = root[:-span] + (root[span:] - root[:-span]) * (middle / span)
            distance = np.linalg.norm(root[inside] - line, axis=-1)
            jump = np.linalg.norm(root[span:] - root[:-span], axis=-1)
            bad_root = (distance > least_length) & (jump < 0.5 * distance)
            root[inside][bad_root] = line[bad_root]
    return replace(motion, rotations=rotations, root=root)


def _angle(a: Array, b: Array) -> Array:
    return np.asarray(np.linalg.norm(rot.log(rot.multiply(rot.conjugate(a), b)), axis=-1))


def resample(motion: Motion, fps: float) -> Motion:
    """The motion at another frame rate: slerp for rotations, cubic splines for the root.

    The new frames start at the first old one and end at or before the last.
    """
    if fps == motion.fps:
        return motion
    count = int(np.floor(motion.seconds * fps + 1e-6)) + 1
    times = np.arange(count) * motion.fps / fps  # in old frames
    low = np.clip(np.floor(times).astype(int), 0, max(motion.frames - 2, 0))
    high = np.minimum(low + 1, motion.frames - 1)
    t = np.clip(times - low, 0.0, 1.0)
    steps = np.broadcast_to(t[:, None], (count, motion.rotations.shape[1]))
    rotations = rot.slerp(motion.rotations[low], motion.rotations[high], steps)
    nearest = np.minimum(np.round(times).astype(int), motion.frames - 1)
    if motion.frames >= 4:
        root = CubicSpline(np.arange(motion.frames), motion.root)(times)
    else:
        root = motion.root[low] + t[:, None] * (motion.root[high] - motion.root[low])
    return replace(motion, fps=float(fps), rotations=rotations, root=root, contacts=motion.contacts[nearest])
