"""B-splines, mostly cubic: a few knots per joint instead of a control for every step (section 3.2).

The map from knots to controls is linear, so it is one matrix. The knots are the coefficients of
a clamped spline on equal intervals: the control starts at the first knot and ends at the last.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from physique.errors import InputError

Array = NDArray[np.float64]

DEGREE = 3


def knot_count(seconds: float, knots_per_window: int = 6, window: float = 0.4) -> int:
    """Knots for a stretch of `seconds`: the paper's 6 for every 0.4 s, at least a cubic's 4."""
    return max(DEGREE + 1, round(knots_per_window * seconds / window))


def knot_matrix(knots: int, steps: int, degree: int = DEGREE) -> Array:
    """The matrix (steps, knots) that takes knots to controls; its rows sum to 1.

    A control is held for one step, so it takes the spline's value in the middle of its step.
    Raises InputError for fewer knots than the degree needs or fewer steps than knots.
    """
    if knots <= degree:
        raise InputError("spline", f"{knots} knots", f"at least {degree + 1}", "ask for more knots")
    if steps < knots:
        raise InputError(
            "spline",
            f"{steps} steps for {knots} knots",
            "at least one step a knot",
            "lengthen the window or ask for fewer knots",
        )
    breaks = np.linspace(0.0, 1.0, knots - degree + 1)
    padded = np.concatenate([np.zeros(degree), breaks, np.ones(degree)])
    middle = (np.arange(steps) + 0.5) / steps
    return np.asarray(BSpline.design_matrix(middle, padded, degree).toarray())


def fit_knots(matrix: Array, control: Array) -> Array:
    """Knots (knots, 50) whose controls are nearest to `control` (steps, 50), by least squares."""
    return np.asarray(np.linalg.lstsq(matrix, control, rcond=None)[0], dtype=np.float64)
