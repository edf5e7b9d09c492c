"""A and B of the step map by implicit differentiation (Eqs. 11 and 12).

A step solves r(q, v, a) = torque(q, v, u) for the acceleration a, where r is MuJoCo's inverse
dynamics with contact. Differentiating that identity,

    da = r_a^-1 ((torque_q - r_q) dq + (torque_v - r_v) dv + torque_u du),

needs derivatives of inverse dynamics only, and those have closed forms (`smooth`, `contact`):
no finite differences, no constraint solver and its noise. Under `integrator="discrete"`, r holds
(M + h D + h^2 K) a + h K v with the gains K, D of the actuators that are not at their limits. The
rest of the step, v' = v + h a and q' = q + h v', is differentiated by hand.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.simulation import contact, smooth, spatial
from physique.simulation.character import Character
from physique.simulation.state import integrate

Array = NDArray[np.float64]

_AT_LIMIT = 1e-9
#: States that one worker differentiates together: enough for array operations to pay, and small
#: enough for the processor's cache.
_CHUNK = 40


class PulledBack(NamedTuple):
    """A quadratic of the next state by the new velocity v' and the old position q.

    by_v (56,) and by_q (56,) are its gradients, vv, vq and qq (56, 56) its second derivatives.
    """

    by_v: Array
    by_q: Array
    vv: Array
    vq: Array
    qq: Array


@dataclass(frozen=True)
class Linearization:
    """N steps and their derivatives.

    q, v: (N, 57), (N, 56), the states that the steps lead to.
    by_state: (N, 56, 112), by_control: (N, 56, 50), of v' with respect to (dq, dv) and du.
    transport: (N, 3, 3) and rotation: (N, 3, 3), the pelvis orientation's parts of dq':
        d turn' = transport d turn + h rotation d omega'. Everywhere else dq' = dq + h dv'.
    """

    q: Array
    v: Array
    by_state: Array
    by_control: Array
    transport: Array
    rotation: Array
    timestep: float

    def matrices(self, t: int) -> tuple[Array, Array]:
        """A (112, 112) and B (112, 50) of step t."""
        h, nv = self.timestep, 56
        E = np.eye(nv)
        E[3:6, 3:6] = self.rotation[t]
        AB = np.zeros((2 * nv, 2 * nv + 50))
        AB[nv:, : 2 * nv], AB[nv:, 2 * nv :] = self.by_state[t], self.by_control[t]
        AB[:nv] = h * E @ AB[nv:]
        D = np.eye(nv)
        D[3:6, 3:6] = self.transport[t]
        AB[:nv, :nv] += D
        return AB[:, : 2 * nv], AB[:, 2 * nv :]

    def pull_back(self, t: int, hessian: Array, gradient: Array) -> PulledBack:
        """A value function of the state after step t, hessian (112, 112) and gradient (112,), as
        one of what the step is made of."""
        nv, h = len(self.v[t]), self.timestep
        V_qq, V_qv, V_vv = hessian[:nv, :nv], hessian[:nv, nv:], hessian[nv:, nv:]
        # dq' = D dq + h E dv', with D and E the identity but for the pelvis' turn.
        turn = slice(3, 6)
        D, E = self.transport[t], self.rotation[t]
        EV = h * V_qq
        EV[turn] = E.T @ EV[turn]
        value = h * EV
        value[:, turn] = value[:, turn] @ E
        EV_qv = h * V_qv
        EV_qv[turn] = E.T @ EV_qv[turn]
        value += EV_qv
        value += EV_qv.T
        value += V_vv
        mixed = EV + V_qv.T
        mixed[:, turn] = mixed[:, turn] @ D
        stay = V_qq.copy()
        stay[turn] = D.T @ stay[turn]
        stay[:, turn] = stay[:, turn] @ D
        through = h * gradient[:nv]
        through[turn] = E.T @ through[turn]
        through += gradient[nv:]
        stay_gradient = gradient[:nv].copy()
        stay_gradient[turn] = D.T @ stay_gradient[turn]
        return PulledBack(through, stay_gradient, value, mixed, stay)


def linearize(
    character: Character,
    tree: smooth.Tree,
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
    by_state, by_control = np.empty((steps, 56, 112)), np.empty((steps, 56, 50))
    v_next = np.empty((steps, 56))
    chunks = [slice(i, min(i + _CHUNK, steps)) for i in range(0, steps, _CHUNK)]

    def run(worker: int) -> None:
        for part in chunks[worker :: len(datas)]:
            v_next[part], by_state[part], by_control[part] = _differentiate(
                character, tree, datas[worker], q[part], v[part], control[part]
            )

    for done in [executor.submit(run, worker) for worker in range(len(datas))]:
        done.result()
    h = character.model.opt.timestep
    turn = h * v_next[:, 3:6]
    return Linearization(
        q=integrate(q, h * v_next),
        v=v_next,
        by_state=by_state,
        by_control=by_control,
        transport=np.swapaxes(rotations.to_matrix(rotations.exp(turn)), -1, -2),
        rotation=_right_jacobian(turn),
        timestep=h,
    )


def _differentiate(
    character: Character, tree: smooth.Tree, data: mujoco.MjData, q: Array, v: Array, u: Array
) -> tuple[Array, Array, Array]:
    """v' (n, 56) of a few steps, its derivatives (n, 56, 112) and (n, 56, 50)."""
    model = character.model
    n, nv, nu, h = len(q), model.nv, model.nu, model.opt.timestep
    a, torque = np.empty((n, nv)), np.empty((n, nu))
    axes, inertia = np.empty((n, nv, 6)), np.empty((n, model.nbody - 1, 10))
    r_a = np.empty((n, nv, nv))
    contacts = []
    for t in range(n):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q[t], v[t], u[t]
        mujoco.mj_forward(model, data)
        a[t], torque[t] = data.qacc, data.actuator_force
        axes[t], inertia[t] = data.cdof, data.cinert[1:]
        mujoco.mj_fullM(model, data, r_a[t])
        contacts.append(contact.read(model, data))
    motion = smooth.motion(tree, axes, v, a)
    r_q, r_v = smooth.derivatives(tree, motion, spatial.inertia_matrix(inertia))
    found = contact.join(model, contacts)
    if found is not None:
        for r, f in zip((r_q, r_v, r_a), contact.derivatives(tree, motion, found, v, a)):
            r -= f
    free = np.abs(torque) < character.torque_limit - _AT_LIMIT
    kp = np.where(free, character.stiffness, 0.0)
    kd = np.where(free, character.damping, 0.0)
    joint = np.arange(6, nv)
    r_a[:, joint, joint] += h * kd + h * h * kp
    by_state = np.concatenate([-r_q, -r_v], axis=-1)
    by_state[:, joint, joint] -= kp
    by_state[:, joint, nv + joint] -= kd + h * kp
    inverse = h * np.linalg.inv(r_a)
    next_v = inverse @ by_state
    index = np.arange(nv)
    next_v[:, index, nv + index] += 1.0
    return v + h * a, next_v, inverse[..., 6:] * kp[:, None]


def _right_jacobian(w: Array) -> Array:
    """Right Jacobians (..., 3, 3) of the exponential map at small rotation vectors w (..., 3)."""
    S = spatial.skew(w)
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    safe = np.where(angle > 1e-4, angle, 1.0)
    first = np.where(angle > 1e-4, (1 - np.cos(safe)) / safe**2, 0.5)
    second = np.where(angle > 1e-4, (safe - np.sin(safe)) / safe**3, 1 / 6)
    return np.eye(3) - first * S + second * (S @ S)
