"""Feedback in plain MuJoCo and NumPy, for programs that have nothing else (and no compiler).

The compiled twin for optimisers is `rollout.Feedback`.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError

Array = NDArray[np.float64]


class Servo:
    """The character's actuators: position targets within the torque limits, and their torques."""

    def __init__(self, xml: str) -> None:
        try:
            self.model = mujoco.MjModel.from_xml_string(xml)
        except ValueError as fault:
            raise InputError(
                "character model", str(fault).splitlines()[0], "MJCF of a character",
                "make the policy anew",
            ) from None  # fmt: skip
        self.timestep = float(self.model.opt.timestep)
        self._kp = self.model.actuator_gainprm[:, 0].copy()
        self._kd = -self.model.actuator_biasprm[:, 2]
        self._limit = self.model.actuator_forcerange[:, 1].copy()
        self._lag = self._kd / self._kp
        self._reach = self._limit * (1.0 - 1e-6) / self._kp
        self._away = np.empty(2 * self.model.nv)
        self._data = mujoco.MjData(self.model)

    def difference(self, q_from: Array, v_from: Array, q: Array, v: Array, out: Array) -> None:
        """Fill out (112,) with the tangent that leads from one state to the other."""
        nv = len(v)
        mujoco.mj_differentiatePos(self.model, out[:nv], 1.0, q_from, q)
        np.subtract(v, v_from, out=out[nv:])

    def center(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Centre of mass (3,), m, and its velocity (3,), m/s, at q (57,), v (56,)."""
        data = self._data
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_fwdPosition(self.model, data)
        mujoco.mj_sensorPos(self.model, data)
        mujoco.mj_fwdVelocity(self.model, data)
        mujoco.mj_sensorVel(self.model, data)
        return data.sensordata[:3].copy(), data.sensordata[3:6].copy()

    def within_limits(self, targets: Array, q: Array, v: Array) -> Array:
        """Position targets (50,) moved so that their torque at (q, v) keeps the limits."""
        center = q[7:] + self._lag * v[6:]
        return np.asarray(center + np.clip(targets - center, -self._reach, self._reach))

    def torques(self, targets: Array, q: Array, v: Array) -> Array:
        """Torques (50,), Nm, that held over a step do what the position targets do.

        The implicit PD controller exerts kp (target - angle') - kd rate' of the state that the step
        leads to, found by one simulated step ("stable PD", Tan, Liu and Turk 2011); a joint at its
        limit exerts that.
        """
        data = self._data
        mujoco.mj_resetData(self.model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, targets
        mujoco.mj_step(self.model, data)
        ahead = self._kp * (targets - data.qpos[7:]) - self._kd * data.qvel[6:]
        full = np.abs(data.actuator_force) >= self._limit * (1.0 - 1e-9)
        return np.where(full, data.actuator_force, ahead)


def motor_model(xml: str) -> mujoco.MjModel:
    """The character with motors in place of position servos: data.ctrl is torque, Nm."""
    model = mujoco.MjModel.from_xml_string(xml)
    model.actuator_gainprm[:, 0] = 1.0
    model.actuator_biasprm[:] = 0.0
    model.actuator_biastype[:] = mujoco.mjtBias.mjBIAS_NONE
    return model


class Probe:
    """One simulation that is rolled out a stretch at a time, to see where a controller leads.

    q, v, com, com_velocity: its states so far, (t + 1, .); `fallen` once it blew up or
    was given up.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model, self._data = model, mujoco.MjData(model)

    def start(self, q: Array, v: Array) -> None:
        """Begin anew at (q (57,), v (56,))."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:], self._data.qvel[:] = q, v
        self.steps, self.fallen = 0, False
        self.q, self.v = [q.copy()], [v.copy()]
        self.com: list[Array] = []
        self.com_velocity: list[Array] = []

    def run(self, steps: int, control: Callable[[Array, Array], Array], lowest: float) -> None:
        """Go on for `steps` steps under control(q, v), targets (50,).

        Gives up where the centre of mass falls below `lowest`, m. Centres of mass are known of
        every state but the last.
        """
        data = self._data
        qpos, qvel, ctrl, sensors = data.qpos, data.qvel, data.ctrl, data.sensordata
        for _ in range(steps):
            if self.fallen:
                return
            time = data.time
            ctrl[:] = control(qpos, qvel)
            mujoco.mj_step(self._model, data)
            self.steps += 1
            self.q.append(qpos.copy())
            self.v.append(qvel.copy())
            self.com.append(sensors[:3].copy())
            self.com_velocity.append(sensors[3:6].copy())
            self.fallen = data.time <= time or sensors[2] < lowest
