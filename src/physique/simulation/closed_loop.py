"""Feedback in plain MuJoCo and NumPy, for programs that have nothing else (and no compiler).

The compiled twin for optimisers is `rollout.Feedback`.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import mujoco.rollout
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
                "character model", str(fault).splitlines()[0], "MJCF of a character", "make the policy anew"
            ) from None
        self.timestep = float(self.model.opt.timestep)
        self._kp = self.model.actuator_gainprm[:, 0].copy()
        self._kd = -self.model.actuator_biasprm[:, 2]
        self._limit = self.model.actuator_forcerange[:, 1].copy()
        self._lag = self._kd / self._kp
        self._reach = self._limit * (1.0 - 1e-6) / self._kp
        self._data = mujoco.MjData(self.model)

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
        data = self._data
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, targets
        mujoco.mj_step(self.model, data)
        return data.qpos.copy(), data.qvel.copy()

    def within_limits(self, targets: Array, q: Array, v: Array) -> Array:
        """Position targets (..., 50) moved so that their torque at (q, v) keeps the limits."""
        center = q[..., 7:] + self._lag * v[..., 6:]
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


class Probes:
    """Simulations from one state, rolled out side by side to see where controllers lead.

    q (t + 1, B, 57), v (t + 1, B, 56): their states so far; com, com_velocity (t, B, 3): of all
    but the last. steps (B,): that each took before it fell; fallen (B,).
    """

    def __init__(self, model: mujoco.MjModel, threads: int) -> None:
        self._model, self._timestep = model, float(model.opt.timestep)
        self._pool = mujoco.rollout.Rollout(nthread=threads if threads > 1 else 0)
        self._datas = [mujoco.MjData(model) for _ in range(max(1, threads))]

    def start(self, q: Array, v: Array, count: int) -> None:
        """`count` simulations at (q (57,), v (56,))."""
        self.q, self.v = np.tile(q, (1, count, 1)), np.tile(v, (1, count, 1))
        self.com, self.com_velocity = np.empty((0, count, 3)), np.empty((0, count, 3))
        self.steps, self.fallen = np.zeros(count, dtype=int), np.zeros(count, dtype=bool)

    def keep(self, order: NDArray[np.intp]) -> None:
        """Drop all but these."""
        self.q, self.v = self.q[:, order], self.v[:, order]
        self.com, self.com_velocity = self.com[:, order], self.com_velocity[:, order]
        self.steps, self.fallen = self.steps[order], self.fallen[order]

    def run(self, steps: int, control: Callable[[Array, Array], Array], lowest: float) -> None:
        """Go on for `steps` steps under control(q, v), targets (B, 50).

        A simulation has fallen where it blows up or its centre of mass is below `lowest`, m; what
        comes after that means nothing.
        """
        nq, nv, count = self._model.nq, self._model.nv, len(self.fallen)
        state = np.concatenate([np.zeros((count, 1)), self.q[-1], self.v[-1]], axis=1)
        states, sensors = [], []
        for _ in range(steps):
            standing = np.flatnonzero(~self.fallen)
            if len(standing) == 0:
                break
            targets = control(state[:, 1 : 1 + nq], state[:, 1 + nq :])
            state, sensor = state.copy(), np.zeros((count, self._model.nsensordata))
            state[standing, 0] = 0.0
            n = len(standing)
            after, sensed = np.empty((n, 1, state.shape[1])), np.empty((n, 1, sensor.shape[1]))
            # Checks would take as long as a simulated step.
            self._pool.rollout(
                [self._model] * n,
                self._datas,
                state[standing],
                targets[standing, None],
                nstep=1,
                skip_checks=True,
                state=after,
                sensordata=sensed,
                chunk_size=1,
            )
            state[standing], sensor[standing] = after[:, 0], sensed[:, 0]
            self.steps[standing] += 1
            # One that blows up resets itself, its clock too.
            blown = np.abs(state[standing, 0] - self._timestep) > 0.5 * self._timestep
            self.fallen[standing] = blown | (sensor[standing, 2] < lowest)
            states.append(state)
            sensors.append(sensor)
        if not states:
            return
        path, sensed = np.array(states), np.array(sensors)
        self.q = np.concatenate([self.q, path[..., 1 : 1 + nq]])
        self.v = np.concatenate([self.v, path[..., 1 + nq : 1 + nq + nv]])
        self.com = np.concatenate([self.com, sensed[..., :3]])
        self.com_velocity = np.concatenate([self.com_velocity, sensed[..., 3:6]])
