"""One character in a state that moves on: the only loop over `mj_step`, and its test of divergence.

Plain MuJoCo and NumPy: policies, which run where there is no compiler, step with it too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.simulation.floor import FloorContacts, FloorForces

Array = NDArray[np.float64]

#: A simulation that blows up resets itself, its clock too. Clocks begin late, so that this shows even
#: after the first step.
CLOCK = 1.0  # s
_BAD_CONTROL = int(mujoco.mjtWarning.mjWARN_BADCTRL)


@dataclass(frozen=True)
class Push:
    """A constant force (3,), N, on one part, a joint of `skeleton.JOINTS` by its index, from step `start`
    on for `steps` steps. point: (3,) m, where, in the part's frame; left out, its centre of mass."""

    part: int
    force: tuple[float, ...]
    start: int
    steps: int
    point: tuple[float, ...] | None = None

    @property
    def name(self) -> str:
        """The part that is pushed."""
        return skeleton.JOINTS[self.part]


class Stepper:
    """A model in a state q (57,), v (56,), which control, gravity, the floor and pushes move on.

    What it tells of joints, centre of mass, torque and floor is of the step taken last: torque and forces
    act in it, positions are those of the state before it.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self._bodies = np.array([model.body(name).id for name in skeleton.JOINTS])
        self._posed: mujoco.MjData | None = None
        self._floor = FloorContacts(model)
        self._warnings = self.data.warning.number
        # Live views: asking MuJoCo for them takes longer than reading them.
        self.q, self.v, self._control = self.data.qpos, self.data.qvel, self.data.ctrl
        self.torque, self._sensors = self.data.actuator_force, self.data.sensordata
        self.start(self.q.copy(), self.v.copy())

    def start(self, q: Array, v: Array) -> None:
        """Go on from q (57,), v (56,); pushes that were under way end."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.time = CLOCK
        self.q[:], self.v[:] = q, v
        self._pushes: list[Push] = []
        self.steps, self.diverged = 0, False

    def push(self, push: Push) -> None:
        """Push, too. Pushes add up."""
        self._pushes.append(push)

    def step(self, control: Array) -> None:
        """One step under control (50,); nothing happens any more once it `diverged`."""
        if self.diverged:
            return
        if self._pushes:
            self._apply_pushes()
        self._control[:] = control
        mujoco.mj_step(self.model, self.data)
        self.steps += 1
        # Numbers that are none among the controls are ignored, without a reset.
        self.diverged = self.data.time < CLOCK or bool(self._warnings[_BAD_CONTROL])

    @property
    def joints(self) -> Array:
        """World positions (22, 3), m."""
        return np.asarray(self.data.xpos[self._bodies])

    @property
    def com(self) -> tuple[Array, Array]:
        """Centre of mass (3,), m, and its velocity (3,), m/s."""
        return self._sensors[:3], self._sensors[3:6]

    @property
    def floor(self) -> FloorForces:
        """What the floor does to the body."""
        return self._floor.read(self.data)

    def sense(self) -> None:
        """Bring joints and centre of mass up to the state."""
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_sensorPos(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        mujoco.mj_sensorVel(self.model, self.data)

    def pose(self) -> mujoco.MjData:
        """MuJoCo's kinematics of the state, apart from the simulation's own data."""
        if self._posed is None:
            self._posed = mujoco.MjData(self.model)
        self._posed.qpos[:] = self.q
        mujoco.mj_kinematics(self.model, self._posed)
        return self._posed

    def _apply_pushes(self) -> None:
        """Forces and moments about the centres of mass, for the step to come."""
        applied = self.data.xfrc_applied
        applied[:] = 0.0
        for push in self._pushes:
            if not push.start <= self.steps < push.start + push.steps:
                continue
            body = self._bodies[push.part]
            applied[body, :3] += push.force
            if push.point is not None:
                pose = self.pose()
                at = pose.xpos[body] + pose.xmat[body].reshape(3, 3) @ np.asarray(push.point)
                applied[body, 3:] += np.cross(at - pose.xipos[body], push.force)


#: Shown each step, number and stepper; false ends the simulation.
Observer = Callable[[int, Stepper], bool]


def blown_up(clocks: Array, timestep: float) -> NDArray[np.bool_]:
    """Which of the clocks (..., N), s, after N steps from `CLOCK` on are not what they should be.

    MuJoCo's roll-outs stand still from the step on that blew up, and the clock with them.
    """
    due = CLOCK + timestep * np.arange(1, clocks.shape[-1] + 1)
    return np.asarray(np.abs(clocks - due) > 0.5 * timestep)
