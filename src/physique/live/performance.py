"""A run performed anew, step by step, by a controller; pushes on it, and whether it survives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physique.character.joint_error import SUCCESS_LIMIT, mean_joint_error
from physique.character.model import Character
from physique.live.controllers import Controller
from physique.live.curves import unknown
from physique.runs.run import Run
from physique.simulation.session import Hit, Session

Array = NDArray[np.float64]

#: A push is survived when the body still follows after this time, or at the clip's end.
JUDGED_AFTER = 2.0  # s
#: With less of the clip left a push is not judged: a body takes about as long to fall.
LEAST_LEFT = 1.0  # s


@dataclass(frozen=True)
class Score:
    """Pushes on one body under one controller. `open` ones may still turn out either way."""

    pushes: int = 0
    survived: int = 0
    failed: int = 0
    open: int = 0

    @property
    def not_judged(self) -> int:
        """Pushes that came too late in the clip, or that a restart cut short."""
        return self.pushes - self.survived - self.failed - self.open


class Performance:
    """One body under one controller, from a frame of its run on.

    error: m, mean distance of the joints from the reference's at the controller's frame.
    curves: of what happened so far, by frame.
    """

    def __init__(self, run: Run, character: Character, wanted: Array, controller: Controller) -> None:
        """wanted: (T, 22, 3) m, the joints of the run's reference."""
        self._run, self._wanted = run, wanted
        self.session = Session(character, run.trajectory.q[0], run.trajectory.v[0])
        self.controller = controller
        self.score = Score()
        self.restart(0)

    def restart(self, frame: int) -> None:
        """Begin at this frame, in the state that the run has there."""
        trajectory = self._run.trajectory
        frame = min(max(frame, 0), trajectory.frames - 1)
        self.session.restart(trajectory.q[frame], trajectory.v[frame])
        self.controller.reset(frame)
        self.curves = unknown(trajectory.frames)
        self.over_s = 0.0
        self._deadlines: list[int] = []  # the steps at which open pushes are judged
        self.score = replace(self.score, open=0)
        self._measure()

    def switch(self, controller: Controller, score: Score) -> None:
        """Begin anew under another controller, which has this score."""
        self.controller, self.score = controller, score
        self.restart(0)

    @property
    def frame(self) -> int:
        """Of the trajectory, where the controller is."""
        return self.controller.frame

    @property
    def finished(self) -> bool:
        """Whether the clip's end is reached."""
        return self.frame >= self._run.trajectory.frames - 1

    @property
    def over(self) -> bool:
        """Whether nothing more is to come: the body fell, or the clip is at its end."""
        return self.fallen or self.finished

    def push(self, hit: Hit, impulse: Array) -> None:
        """Push the point that was hit from the next step on: impulse (3,) Ns, world."""
        self.session.push(hit, impulse)
        steps = self._run.trajectory.frames - 1 - self.frame
        self.score = replace(self.score, pushes=self.score.pushes + 1)
        if self.fallen or steps * self.session.timestep < LEAST_LEFT:
            return
        ahead = round(JUDGED_AFTER / self.session.timestep)
        self._deadlines.append(self.session.steps + ahead)
        self.score = replace(self.score, open=self.score.open + 1)

    def advance(self) -> None:
        """One step of 0.01 s. A body that fell is stepped on; at the clip's end it stands still."""
        session, before, over = self.session, self.frame, self.over
        if self.finished:
            self.over_s += session.timestep
            return
        session.step(self.controller.act(session.q, session.v))
        if over:
            self.over_s += session.timestep
            return
        if not session.diverged:
            feet, pressure, _ = session.floor_forces
            self.curves.torque[before] = session.torque
            self.curves.floor[before], self.curves.pressure[before] = feet, pressure
        self._measure()
        self._judge()

    def _measure(self) -> None:
        self.error = mean_joint_error(self.session.poses[:, :3], self._wanted[self.frame])
        self.curves.error[self.frame] = self.error
        self.fallen = self.session.diverged or self.error > SUCCESS_LIMIT

    def _judge(self) -> None:
        """Close the pushes whose time has come."""
        score = self.score
        if self.fallen:
            self.score = replace(score, failed=score.failed + score.open, open=0)
            self._deadlines.clear()
            return
        due = [d for d in self._deadlines if self.finished or self.session.steps >= d]
        if due:
            self._deadlines = [d for d in self._deadlines if d not in due]
            left = len(self._deadlines)
            self.score = replace(score, survived=score.survived + score.open - left, open=left)
