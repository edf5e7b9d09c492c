"""What moves the body in the live simulation: one small protocol, the plain replay,
and the policy that a run may have."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from physique.runs.run import Run
from physique.tracking.trajectory import Trajectory

Array = NDArray[np.float64]


class Controller(Protocol):
    """Answers each state of a run's character with position targets, step after step."""

    @property
    def frame(self) -> int:
        """The frame of the trajectory that the next step starts from; its last at the end."""

    def reset(self, frame: int) -> None:
        """Start at this frame of the trajectory."""

    def act(self, q: Array, v: Array) -> Array:
        """Targets (50,), rad, in the state q (57,), v (56,); and go on by a step."""


class Replay:
    """The control of the run as it was found, blind to the state; the last targets go on."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._control = trajectory.control
        self._frame = 0

    @property
    def frame(self) -> int:
        """The frame of the trajectory that the next step starts from; its last at the end."""
        return self._frame

    def reset(self, frame: int) -> None:
        """Start at this frame of the trajectory."""
        self._frame = min(frame, len(self._control))

    def act(self, q: Array, v: Array) -> Array:
        """Targets (50,), rad, whatever the state is; and go on by a step."""
        del q, v
        row = min(self._frame, len(self._control) - 1)
        self._frame = min(self._frame + 1, len(self._control))
        return self._control[row]


def controllers_of(run: Run) -> dict[str, Controller]:
    """What can control the run's body, by name; the best comes last.

    Raises InputError for a policy that is damaged, or of another motion.
    """
    found: dict[str, Controller] = {"replay": Replay(run.trajectory)}
    stored = run.policy_file()
    if stored is not None:
        found["lqr"] = run.policy("lqr")
        if stored.tree.branches:
            found["tree"] = run.policy("tree")
    return found
