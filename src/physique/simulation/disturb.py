"""Stepping a character that external forces push."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.character.model import Character

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Push:
    """A constant force (3,), N, on the centre of mass of one part, a joint of `skeleton.JOINTS` by
    its index, from step `start` on for `steps` steps."""

    part: int
    force: tuple[float, float, float]
    start: int
    steps: int

    @property
    def name(self) -> str:
        """The part that is pushed."""
        return skeleton.JOINTS[self.part]


@dataclass(frozen=True)
class Pushed:
    """What a pushed character did: q (T, 57), v (T, 56), joints (T, 22, 3) m.

    T is less than asked for where the simulation was given up; `diverged` where it blew up.
    """

    q: Array
    v: Array
    joints: Array
    diverged: bool


def simulate_pushed(
    character: Character,
    q: Array,
    v: Array,
    steps: int,
    control_at: Callable[[int, Array, Array], Array],
    push: Push | None,
    go_on: Callable[[int, Array], bool] = lambda t, joints: True,
) -> Pushed:
    """Step from q (57,), v (56,) under control_at(t, q, v), targets (50,), and the push.

    go_on(t, joints (22, 3)): false gives the simulation up after frame t.
    """
    model, parts = character.model, character.joint_bodies
    data = mujoco.MjData(model)
    out_q, out_v = np.empty((steps + 1, model.nq)), np.empty((steps + 1, model.nv))
    joints = np.empty((steps + 1, len(parts), 3))
    qpos, qvel, ctrl, xpos = data.qpos, data.qvel, data.ctrl, data.xpos
    qpos[:], qvel[:] = q, v
    body = 0 if push is None else parts[push.part]
    time = 0.0
    for t in range(steps):
        out_q[t], out_v[t] = qpos, qvel
        if push is not None:
            acts = push.start <= t < push.start + push.steps
            data.xfrc_applied[body, :3] = push.force if acts else 0.0
        ctrl[:] = control_at(t, qpos, qvel)
        mujoco.mj_step(model, data)
        # A simulation that blows up resets itself, its clock too.
        if data.time <= time or not np.all(np.isfinite(qvel)):
            return Pushed(out_q[: t + 1], out_v[: t + 1], joints[:t], True)
        time = data.time
        joints[t] = xpos[parts]  # of the state before the step
        if not go_on(t, joints[t]):
            return Pushed(out_q[: t + 1], out_v[: t + 1], joints[: t + 1], False)
    out_q[-1], out_v[-1] = qpos, qvel
    mujoco.mj_kinematics(model, data)
    joints[-1] = xpos[parts]
    return Pushed(out_q, out_v, joints, False)
