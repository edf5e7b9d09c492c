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
        self._ahead = mujoco.MjData(self.model)  # its solver starts where the last step ended

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

    def step(self, q: Array, v: Array, targets: Array) -> tuple[Array, Array]:
        """The state (57,), (56,) that a step from (q, v) under targets (50,) leads to, unpushed."""
        data = self._ahead
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, targets
        mujoco.mj_step(self.model, data)
        return data.qpos.copy(), data.qvel.copy()

    def within_limits(self, targets: Array, q: Array, v: Array) -> Array:
        """Position targets (50,) moved so that their torque at (q, v) keeps the limits."""
        center = q[7:] + self._lag * v[6:]
        nearest = np.minimum(np.maximum(targets, center - self._reach), center + self._reach)
        return np.asarray(nearest)

    def torques(self, targets: Array, q: Array, v: Array) -> Array:
        """Motor torques (50,), Nm, that do on `motor_model` nearly what the targets do here.

        For the implicit PD controller that is kp (target - angle - h rate) - kd rate. At its limit
        a joint exerts just that, and the motor has its own inertia to move besides, known from one
        simulated step.
        """
        data = self._data
        mujoco.mj_resetData(self.model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, targets
        mujoco.mj_forward(self.model, data)
        h = self.timestep
        free = self._kp * (targets - q[7:] - h * v[6:]) - self._kd * v[6:]
        inertia = h * self._kd + h * h * self._kp
        full = np.abs(data.actuator_force) >= self._limit * (1.0 - 1e-9)
        return np.where(full, data.actuator_force + inertia * data.qacc[6:], free)


def motor_model(xml: str) -> mujoco.MjModel:
    """The character with motors in place of position servos: data.ctrl is torque, Nm.

    Its joints have the inertia h kd + h^2 kp (0.08 kg m2) of the implicit PD controller as further
    armature: without contact both models are the same equations. With contact they nearly are:
    under `integrator="discrete"` the softness of a contact depends on the actuators' gains.
    """
    model = mujoco.MjModel.from_xml_string(xml)
    h = model.opt.timestep
    kp, kd = model.actuator_gainprm[:, 0].copy(), -model.actuator_biasprm[:, 2]
    model.dof_armature[6:] += h * kd + h * h * kp
    model.actuator_gainprm[:, 0] = 1.0
    model.actuator_biasprm[:] = 0.0
    model.actuator_biastype[:] = mujoco.mjtBias.mjBIAS_NONE
    model.actuator_forcelimited[:] = 0
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
