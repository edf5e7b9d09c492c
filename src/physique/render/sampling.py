"""Times of frames: which are shown at a lower rate, and what runs in one file share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.runs.run import Run

RATE = 25.0  # a second; every fourth frame of a simulation


def frames_at(count: int, fps: float, rate: float) -> NDArray[np.int64]:
    """Which of `count` frames at `fps` a second to show at `rate` a second: the nearest ones.

    Raises InputError for a rate that is not positive.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise InputError("rate", f"{rate:g} a second", "a positive number", "correct the value")
    times = np.arange(0.0, (count - 1) / fps + 1e-9, 1.0 / min(rate, fps))
    return np.minimum(np.rint(times * fps).astype(np.int64), count - 1)


def common_timestep(runs: Sequence[Run]) -> float:
    """Seconds from one frame to the next, one for all runs.

    Raises InputError where they differ.
    """
    steps = sorted({run.timestep for run in runs})
    if len(steps) == 1:
        return steps[0]
    found = "no runs" if not steps else f"time steps from {steps[0]:g} to {steps[-1]:g} s"
    raise InputError("runs", found, "one time step for all", "export them one at a time")
