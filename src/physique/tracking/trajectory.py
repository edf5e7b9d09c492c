"""The finished windows as one motion, beside the reference that each of them followed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.reference.reference import Reference
from physique.simulation.rollout import beginning
from physique.tracking.windows import Window

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """One unbroken simulation of T frames.

    times (T,) s; q (T, 57), v (T, 56) states; control (T - 1, 50) rad, the position targets that
    lead from each frame to the next; torque (T - 1, 50) Nm, what they exert; reference_q (T, 57),
    the reference as it was moved for each window, against which errors are measured; shift (T, 2)
    m, how far, which jumps from window to window.
    """

    times: Array
    q: Array
    v: Array
    control: Array
    torque: Array
    reference_q: Array
    shift: Array

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.q)

    @property
    def source_q(self) -> Array:
        """(T, 57), the source motion on this body where it was recorded: the reference unmoved."""
        q = self.reference_q.copy()
        q[:, :2] -= self.shift
        return q

    def beginning(self, frames: int) -> Trajectory:
        """The first `frames` frames."""
        return beginning(self, frames)


def join(reference: Reference, q0: Array, v0: Array, windows: Sequence[Window]) -> Trajectory:
    """The motion of all `windows`, which start at (q0 (57,), v0 (56,)); only the start if none.

    A frame on the border of two windows belongs to the earlier one; the first to the first.
    """
    frames = windows[-1].stop + 1 if windows else 1
    shift = np.zeros((frames, 2))
    if windows:
        shift[0] = windows[0].shift
    for window in windows:
        shift[window.start + 1 : window.stop + 1] = window.shift
    reference_q = reference.q[:frames].copy()
    reference_q[:, :2] += shift
    nothing = np.zeros((0, 50))
    return Trajectory(
        times=np.arange(frames, dtype=np.float64) * reference.timestep,
        q=np.concatenate([q0[None], *(w.q[1:] for w in windows)]),
        v=np.concatenate([v0[None], *(w.v[1:] for w in windows)]),
        control=np.concatenate([nothing, *(w.control for w in windows)]),
        torque=np.concatenate([nothing, *(w.torque for w in windows)]),
        reference_q=reference_q,
        shift=shift,
    )
