"""Runs whose windows follow a source that was moved by different ways, as drifting bodies have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from physique.runs.run import Run

BORDER = 30  # the frame after which the second window begins
STEP = np.array([0.0, 0.063])  # m


def stepped(run: Run) -> Run:
    """The same run, measured from its second window on against its source moved by `STEP`."""
    motion = run.trajectory
    shift = motion.shift.copy()
    shift[BORDER + 1 :] += STEP
    reference_q = motion.reference_q.copy()
    reference_q[BORDER + 1 :, :2] += STEP
    return replace(run, trajectory=replace(motion, reference_q=reference_q, shift=shift))
