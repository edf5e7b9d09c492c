"""The derivatives of a step by implicit differentiation (A and B of Eqs. 11 and 12).

A step solves r(q, v, a) = torque(q, v, u) for the acceleration a, where r is MuJoCo's inverse
dynamics with contact. Differentiating that identity,

    r_a da = (torque_q - r_q) dq + (torque_v - r_v) dv + torque_u du,

needs derivatives of inverse dynamics only, and those have closed forms (`smooth`, `contact`):
no finite differences, no constraint solver and its noise. Under `integrator="discrete"`, r holds
(M + h D + h^2 K) a + h K v with the gains K, D of the actuators that are not at their limits. The
rest of the step, v' = v + h a and q' = q + h v', is differentiated by hand.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.character.model import Character
from physique.character.servo import pd_torque
from physique.character.state import integrate
from physique.derivatives import contact, smooth
from physique.derivatives.spatial import skew

Array = NDArray[np.float64]

_AT_LIMIT = 1e-9
#: States that one worker differentiates together: enough for array operations to pay, and small
#: enough for the processor's cache.
_CHUNK = 40


@dataclass(frozen=True)
class Linearization:
    """N steps and their derivatives, as equations of motion:

        mass (dv' - dv) = h (drive (dq, dv) + [0, gain du]).

    q, v: (N, 57), (N, 56), the states that the steps lead to.
    mass: (N, 56, 56), with what contacts and the implicit actuators add. drive: (N, 56, 112).
    gain: (N, 50), Nm/rad; 0 where a target no longer moves anything, since its joint is at its
        limit.
    transport: (N, 3, 3) and rotation: (N, 3, 3), the pelvis orientation's parts of dq':
        d turn' = transport d turn + h rotation d omega'. Everywhere else dq' = dq + h dv'.
    """

    q: Array
    v: Array
    mass: Array
    drive: Array
    gain: Array
    transport: Array
    rotation: Array
    timestep: float

    def matrices(self, t: int) -> tuple[Array, Array]:
        """A (112, 112) and B (112, 50) of step t."""
        h, nv = self.timestep, 56
        E = np.eye(nv)
        E[3:6, 3:6] = self.rotation[t]
        force = np.zeros((nv, 2 * nv + 50))
        force[:, : 2 * nv] = self.drive[t]
        force[6:, 2 * nv :] = np.diag(self.gain[t])
        AB = np.zeros((2 * nv, 2 * nv + 50))
        AB[nv:] = h * np.linalg.solve(self.mass[t], force)
        AB[nv:, nv : 2 * nv] += np.eye(nv)
        AB[:nv] = h * E @ AB[nv:]
        D = np.eye(nv)
        D[3:6, 3:6] = self.transport[t]
        AB[:nv, :nv] += D
        return AB[:, : 2 * nv], AB[:, 2 * nv :]


def linearize(
    character: Character,
    tree: smooth.KinematicTree,
    datas: list[mujoco.MjData],
    executor: Executor,
    q: Array,
    v: Array,
    control: Array,
    v_next: Array | None = None,
) -> Linearization:
    """Differentiate the steps from states q (N, 57), v (N, 56) under control (N, 50).

    v_next: (N, 56), the velocities that the steps lead to, where they are known: five times
    cheaper than finding them. datas: scratch space, one per worker of `executor`.
    """
    steps = len(control)
    mass, drive, gain = (np.empty((steps, *shape)) for shape in ((56, 56), (56, 112), (50,)))
    reached = np.empty((steps, 56)) if v_next is None else v_next
    chunks = [slice(i, min(i + _CHUNK, steps)) for i in range(0, steps, _CHUNK)]

    def run(worker: int) -> None:
        data = datas[worker]
        for part in chunks[worker :: len(datas)]:
            state = q[part], v[part], control[part]
            if v_next is None:
                reached[part] = _step(character.model, data, *state)
            mass[part], drive[part], gain[part] = _differentiate(character, tree, data, *state, reached[part])

    for done in [executor.submit(run, worker) for worker in range(len(datas))]:
        done.result()
    h = character.model.opt.timestep
    turn = h * reached[:, 3:6]
    return Linearization(
        q=integrate(q, h * reached),
        v=reached,
        mass=mass,
        drive=drive,
        gain=gain,
        transport=np.swapaxes(rotations.to_matrix(rotations.exp(turn)), -1, -2),
        rotation=_right_jacobian(turn),
        timestep=h,
    )


def _step(model: mujoco.MjModel, data: mujoco.MjData, q: Array, v: Array, u: Array) -> Array:
    """The velocities (n, 56) after one step from each of a few states."""
    out = np.empty_like(v)
    for t in range(len(q)):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q[t], v[t], u[t]
        mujoco.mj_forward(model, data)
        out[t] = v[t] + model.opt.timestep * data.qacc
    return out


def _differentiate(
    character: Character,
    tree: smooth.KinematicTree,
    data: mujoco.MjData,
    q: Array,
    v: Array,
    u: Array,
    v_next: Array,
) -> tuple[Array, Array, Array]:
    """mass, drive and gain of a few steps (`Linearization`)."""
    model = character.model
    n, nv, h = len(q), model.nv, model.opt.timestep
    a = (v_next - v) / h
    axes, inertia = np.empty((n, nv, 6)), np.empty((n, model.nbody - 1, 10))
    contacts = []
    for t in range(n):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[t], v[t], a[t]
        # Contacts and constraint rows without the search for their forces.
        mujoco.mj_inverse(model, data)
        axes[t], inertia[t] = data.cdof, data.cinert[1:]
        contacts.append(contact.read(model, data))
    r_q, r_v, r_a = np.empty((3, n, nv, nv))
    smooth.derivatives(r_q, r_v, r_a, tree, model.opt.gravity, axes, inertia, v, a)
    found = contact.join(model, contacts)
    contact.subtract_derivatives(r_q, r_v, r_a, tree, axes, v, a, found)
    torque = pd_torque(character, u, q, v)
    free = np.abs(torque) < character.torque_limit - _AT_LIMIT
    kp = np.where(free, character.stiffness, 0.0)
    kd = np.where(free, character.damping, 0.0)
    joint = np.arange(6, nv)
    r_a += np.diag(model.dof_armature)
    r_a[:, joint, joint] += h * kd + h * h * kp
    drive = np.concatenate([-r_q, -r_v], axis=-1)
    drive[:, joint, joint] -= kp
    drive[:, joint, nv + joint] -= kd + h * kp
    return r_a, drive, kp


def _right_jacobian(w: Array) -> Array:
    """Right Jacobians (..., 3, 3) of the exponential map at small rotation vectors w (..., 3)."""
    S = skew(w)
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    safe = np.where(angle > 1e-4, angle, 1.0)
    first = np.where(angle > 1e-4, (1 - np.cos(safe)) / safe**2, 0.5)
    second = np.where(angle > 1e-4, (safe - np.sin(safe)) / safe**3, 1 / 6)
    return np.eye(3) - first * S + second * (S @ S)
