"""A and B of the step map by implicit differentiation (Eqs. 11 and 12).

A step solves r(q, v, a) = torque(q, v, u) for the acceleration a, where r is MuJoCo's inverse
dynamics with contact. Differentiating that identity,

    da = r_a^-1 ((torque_q - r_q) dq + (torque_v - r_v) dv + torque_u du),

needs finite differences of inverse dynamics only, which runs no constraint solver: about five
times cheaper than differencing whole steps, and free of the solver's noise. The rest of the step,
v' = v + h a and q' = q + h v', is differentiated by hand.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.simulation.character import Character
from physique.simulation.state import integrate

Array = NDArray[np.float64]

#: Evaluations of the dynamics that one linearisation costs: 56 positions, velocities,
#: accelerations each, the state itself by forward and by inverse dynamics.
EVALUATIONS = 3 * 56 + 2
_EPSILON = 1e-6
_AT_LIMIT = 1e-9


@dataclass(frozen=True)
class Linearization:
    """N steps and their derivatives.

    q, v: (N, 57), (N, 56), the states that the steps lead to.
    next_v: (N, 56, 162), of v' with respect to (dq, dv, du).
    transport: (N, 3, 3) and rotation: (N, 3, 3), the pelvis orientation's parts of dq':
        d turn' = transport d turn + h rotation d omega'. Everywhere else dq' = dq + h dv'.
    """

    q: Array
    v: Array
    next_v: Array
    transport: Array
    rotation: Array
    timestep: float

    def matrices(self, t: int) -> tuple[Array, Array]:
        """A (112, 112) and B (112, 50) of step t."""
        h, nv = self.timestep, 56
        E = np.eye(nv)
        E[3:6, 3:6] = self.rotation[t]
        AB = np.zeros((2 * nv, 2 * nv + 50))
        AB[nv:] = self.next_v[t]
        AB[:nv] = h * E @ self.next_v[t]
        D = np.eye(nv)
        D[3:6, 3:6] = self.transport[t]
        AB[:nv, :nv] += D
        return AB[:, : 2 * nv], AB[:, 2 * nv :]


def linearize(
    character: Character,
    datas: list[mujoco.MjData],
    executor: Executor,
    q: Array,
    v: Array,
    control: Array,
) -> Linearization:
    """Differentiate the steps from states q (N, 57), v (N, 56) under control (N, 50).

    datas: scratch space, one per worker of `executor`.
    """
    steps = len(control)
    next_v = np.empty((steps, 56, 162))
    v_next = np.empty((steps, 56))

    def run(worker: int) -> None:
        data = datas[worker]
        for t in range(worker, steps, len(datas)):
            v_next[t] = _step_derivative(character, data, q[t], v[t], control[t], next_v[t])

    for done in [executor.submit(run, worker) for worker in range(len(datas))]:
        done.result()
    h = character.model.opt.timestep
    turn = h * v_next[:, 3:6]
    return Linearization(
        q=integrate(q, h * v_next),
        v=v_next,
        next_v=next_v,
        transport=np.swapaxes(rotations.to_matrix(rotations.exp(turn)), -1, -2),
        rotation=_right_jacobian(turn),
        timestep=h,
    )


def _step_derivative(
    character: Character, data: mujoco.MjData, q: Array, v: Array, u: Array, out: Array
) -> Array:
    model = character.model
    nv, h = model.nv, model.opt.timestep
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
    mujoco.mj_forward(model, data)
    v_next = v + h * data.qacc
    free = np.abs(data.actuator_force) < character.torque_limit - _AT_LIMIT
    kp = np.where(free, model.actuator_gainprm[:, 0], 0.0)
    kd = np.where(free, -model.actuator_biasprm[:, 2], 0.0)
    r_q, r_v, r_a = (np.empty((nv, nv)) for _ in range(3))
    # Rows are the perturbed coordinate.
    mujoco.mjd_inverseFD(model, data, _EPSILON, False, r_q, r_v, r_a, None, None, None, None)
    right = np.zeros((nv, 2 * nv + model.nu))
    right[:, :nv] = -r_q.T
    right[:, nv : 2 * nv] = -r_v.T
    joint = np.arange(6, nv)
    right[joint, joint] -= kp
    right[joint, nv + joint] -= kd
    right[joint, 2 * nv + joint - 6] = kp
    out[:] = h * np.linalg.solve(r_a.T, right)
    out[:, nv : 2 * nv] += np.eye(nv)
    return v_next


def _right_jacobian(w: Array) -> Array:
    """Right Jacobians (..., 3, 3) of the exponential map at small rotation vectors w (..., 3)."""
    x, y, z = np.moveaxis(w, -1, 0)
    zero = np.zeros_like(x)
    S = np.stack(
        [np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], -2
    )
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    safe = np.where(angle > 1e-4, angle, 1.0)
    first = np.where(angle > 1e-4, (1 - np.cos(safe)) / safe**2, 0.5)
    second = np.where(angle > 1e-4, (safe - np.sin(safe)) / safe**3, 1 / 6)
    return np.eye(3) - first * S + second * (S @ S)
