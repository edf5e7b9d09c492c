"""How far a body is from where it should be: the one measure of success and of survival."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A body that is off by more than this, on average over its joints, no longer performs the motion.
SUCCESS_LIMIT = 0.5  # m


def joint_errors(joints: Array, wanted: Array) -> Array:
    """Distances (..., 22), m, of joints (..., 22, 3) from where they should be."""
    return np.asarray(np.linalg.norm(joints - wanted, axis=-1))


def mean_joint_error(joints: Array, wanted: Array) -> float:
    """Their mean, m."""
    return float(joint_errors(joints, wanted).mean())
