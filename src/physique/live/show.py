"""The show: runs that are played as recorded or performed live. Knows nothing of a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.body.capsule_body import CapsuleBody
from physique.live.controllers import Controller, controllers_of
from physique.live.curves import Curves, difficulty, recorded
from physique.live.performance import Performance, Score
from physique.live.timeline import Timeline
from physique.render.skin import joint_transforms
from physique.runs.run import Run
from physique.simulation.session import Hit

Array = NDArray[np.float64]

#: When all bodies have fallen or finished, the live simulation stays for a moment and begins anew.
LINGER = 1.0  # s
#: A page that falls behind drops time instead of catching up for ever.
MOST_STEPS = 25


@dataclass(frozen=True)
class Act:
    """A run with all that is shown of it.

    poses, source: (T, 22, 7), of the joints as simulated and of the source motion where it was
        recorded: position (m), orientation (wxyz).
    """

    run: Run
    poses: Array
    source: Array
    trial: Performance
    controllers: Mapping[str, Controller]
    recorded: Curves
    difficulty: Array


class Show:
    """The acts side by side on one time line.

    live: whether the bodies are simulated now; otherwise they play what was recorded.
    """

    def __init__(
        self, runs: Sequence[Run], controllers: Sequence[Mapping[str, Controller]] | None = None
    ) -> None:
        """controllers: of each run, in place of what `controllers_of` finds."""
        found = [controllers_of(run) for run in runs] if controllers is None else controllers
        self.acts = [_act(run, mapping) for run, mapping in zip(runs, found)]
        self.chosen = [list(act.controllers)[-1] for act in self.acts]
        self.scores: list[dict[str, Score]] = [{} for _ in self.acts]
        self.live = False
        self.restarts = True
        self.timestep = self.acts[0].trial.session.timestep
        self.timeline = Timeline(max(float(act.run.trajectory.times[-1]) for act in self.acts))
        self._due = 0.0

    def advance(self, seconds: float) -> None:
        """Let this much wall time go by."""
        if not self.live:
            self.timeline.advance(seconds)
            return
        if not self.timeline.playing:
            return
        self._due += seconds * self.timeline.speed / self.timestep
        steps = min(int(self._due), MOST_STEPS)
        self._due = min(self._due - steps, 1.0)
        for _ in range(steps):
            for act in self.acts:
                act.trial.advance()
        self.timeline.seek(self.timestep * max(act.trial.frame for act in self.acts))
        if self.restarts and all(act.trial.over_s > LINGER for act in self.acts):
            self.seek(0.0)

    def seek(self, time: float) -> None:
        """Go to a time; a live simulation begins anew there, in the recorded state."""
        self.timeline.seek(time)
        self._due = 0.0
        if self.live:
            for act in self.acts:
                act.trial.restart(self.frame)

    def go_live(self, live: bool) -> None:
        """Simulate from the current time on, or play from there what was recorded."""
        if live != self.live:
            self.live = live
            self.seek(self.timeline.time)

    def choose(self, index: int, name: str) -> None:
        """Let another controller perform, live; all begin anew, so that they stay comparable."""
        self.go_live(True)
        trial = self.acts[index].trial
        self.scores[index][self.chosen[index]] = trial.score
        self.chosen[index] = name
        score = self.scores[index].get(name, Score())
        trial.switch(self.acts[index].controllers[name], score)
        self.seek(0.0)

    def forget(self) -> None:
        """Set all scores to zero."""
        for act, scores in zip(self.acts, self.scores):
            scores.clear()
            act.trial.score = Score()
        self.seek(self.timeline.time)

    def hit(self, index: int, origin: Array, direction: Array) -> Hit | None:
        """What a ray in the world of a run meets on its body as it is shown now."""
        self.go_live(True)
        return self.acts[index].trial.session.cast(origin, direction)

    def push(self, index: int, hit: Hit, impulse: Array, all_alike: bool) -> list[int]:
        """Push a body, or all in the same place; returns which.

        The show goes on if it paused, and begins anew if the body is at the clip's end.
        """
        self.go_live(True)
        if self.acts[index].trial.finished:
            self.seek(0.0)
        pushed = list(range(len(self.acts))) if all_alike else [index]
        for i in pushed:
            self.acts[i].trial.push(hit, impulse)
        self.timeline.playing = True
        return pushed

    @property
    def frame(self) -> int:
        """Of the time line."""
        return round(self.timeline.time / self.timestep)

    def frame_of(self, act: Act) -> int:
        """The frame that the act's reference is at."""
        if self.live:
            return act.trial.frame
        return min(self.frame, act.run.trajectory.frames - 1)

    def poses(self, act: Act) -> Array:
        """Poses (22, 7) of the joints as they are shown now: position (m), orientation."""
        if self.live:
            return act.trial.session.poses
        return np.asarray(act.poses[self.frame_of(act)])

    def curves(self, act: Act) -> Curves:
        """What the plots are to show of it."""
        return act.trial.curves if self.live else act.recorded

    def score_rows(self) -> list[tuple[int, str, Score]]:
        """(act, controller, score) of all that were pushed, and of those that perform now."""
        rows = []
        for i, act in enumerate(self.acts):
            scores = {**self.scores[i], self.chosen[i]: act.trial.score}
            rows += [(i, name, score) for name, score in scores.items()]
        return rows


def _act(run: Run, controllers: Mapping[str, Controller]) -> Act:
    character = run.character()
    poses = _poses(run.body, run.trajectory.q)
    wanted = joint_transforms(run.body, run.trajectory.reference_q)[..., 3]
    return Act(
        run,
        poses,
        _poses(run.body, run.trajectory.source_q),
        Performance(run, character, wanted, list(controllers.values())[-1]),
        controllers,
        recorded(run, character, poses[..., :3], wanted),
        difficulty(run),
    )


def _poses(body: CapsuleBody, q: Array) -> Array:
    """Poses (T, 22, 7) of the joints at q (T, 57)."""
    transforms = joint_transforms(body, q)
    turns = rotations.from_matrix(transforms[..., :3])
    return np.concatenate([transforms[..., 3], turns], axis=-1)
