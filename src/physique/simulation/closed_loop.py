"""Feedback in plain MuJoCo and NumPy, for programs that have nothing else (and no compiler).

The compiled twin for optimisers is `linear_feedback.Feedback`.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.simulation.stepper import Stepper

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
        self._stepper = Stepper(self.model)

    def center(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Centre of mass (3,), m, and its velocity (3,), m/s, at q (57,), v (56,)."""
        self._stepper.start(q, v)
        self._stepper.sense()
        com, com_velocity = self._stepper.com
        return com.copy(), com_velocity.copy()

    def step(self, q: Array, v: Array, targets: Array) -> tuple[Array, Array]:
        """The state (57,), (56,) that a step from (q, v) under targets (50,) leads to, unpushed."""
        self._stepper.start(q, v)
        self._stepper.step(targets)
        return self._stepper.q.copy(), self._stepper.v.copy()

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
        self._stepper.start(q, v)
        data = self._stepper.data
        data.ctrl[:] = targets
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
