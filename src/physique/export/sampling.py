"""Which frames of a motion are shown at a lower rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError

RATE = 25.0  # a second; every fourth frame of a simulation


def frames_at(count: int, fps: float, rate: float) -> NDArray[np.int64]:
    """Which of `count` frames at `fps` a second to show at `rate` a second: the nearest ones.

    Raises InputError for a rate that is not positive.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise InputError("rate", f"{rate:g} a second", "a positive number", "correct the value")
    times = np.arange(0.0, (count - 1) / fps + 1e-9, 1.0 / min(rate, fps))
    return np.minimum(np.rint(times * fps).astype(np.int64), count - 1)
