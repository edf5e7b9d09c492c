"""Stepping the character: one roll-out with feedback, or many at once without."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character
from physique.character.servo import usable_limit
from physique.compiled import compiled

Array = NDArray[np.float64]

#: What MuJoCo warns of where a simulation blows up.
BLOWN_UP = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
    mujoco.mjtWarning.mjWARN_BADCTRL,
)


@dataclass(frozen=True)
class Rollout:
    """States, controls and centres of mass of T frames; `diverged` where the simulation blew up.

    q (T, 57), v (T, 56), control (T - 1, 50) rad, torque (T - 1, 50) Nm, com (T, 3) m,
    com_velocity (T, 3) m/s. With a leading batch axis where many were run.
    """

    q: Array
    v: Array
    control: Array
    torque: Array
    com: Array
    com_velocity: Array
    diverged: bool


class Feedback:
    """The controller u(t, x) = control + gain (x - x0), kept `within_limits`.

    About states q (T, 57), v (T, 56) of a motion; control (N, 50) rad, gain (N, 50, 112), N < T.
    bound: rad; feedback that would move a target further is scaled down as a whole.
    """

    def __init__(
        self, character: Character, q: Array, v: Array, control: Array, gain: Array, bound: float = np.inf
    ):
        self._bound = bound
        self._about = (q, v, control, np.ascontiguousarray(gain))
        self._lag = character.damping / character.stiffness
        self._reach = usable_limit(character) / character.stiffness

    def __call__(self, t: int, q: Array, v: Array) -> Array:
        """Targets (50,) at step t in the state q (57,), v (56,)."""
        out = np.empty(len(self._lag))
        _targets(out, t, q, v, *self._about, self._lag, self._reach, self._bound)
        return out


@compiled
def _targets(
    out: Array,
    t: int,
    q: Array,
    v: Array,
    about_q: Array,
    about_v: Array,
    control: Array,
    gain: Array,
    lag: Array,
    reach: Array,
    bound: float,
) -> None:
    nv, nu = len(v), control.shape[1]
    away = np.empty(2 * nv)
    for i in range(3):
        away[i] = q[i] - about_q[t, i]
    # The rotation vector of conj(p) q, in the pelvis frame.
    p, r = about_q[t, 3:7], q[3:7]
    w = p[0] * r[0] + p[1] * r[1] + p[2] * r[2] + p[3] * r[3]
    x = p[0] * r[1] - p[1] * r[0] - p[2] * r[3] + p[3] * r[2]
    y = p[0] * r[2] + p[1] * r[3] - p[2] * r[0] - p[3] * r[1]
    z = p[0] * r[3] - p[1] * r[2] + p[2] * r[1] - p[3] * r[0]
    sine = np.sqrt(x * x + y * y + z * z)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    scale = 2.0 * np.arctan2(sine, w) / sine if sine > 1e-12 else 2.0
    away[3], away[4], away[5] = scale * x, scale * y, scale * z
    for i in range(nu):
        away[6 + i] = q[7 + i] - about_q[t, 7 + i]
    for i in range(nv):
        away[nv + i] = v[i] - about_v[t, i]
    wanted = np.dot(gain[t], away)
    most = 0.0
    for i in range(nu):
        most = max(most, abs(wanted[i]))
    if most > bound:
        for i in range(nu):
            wanted[i] *= bound / most
    for i in range(nu):
        center = q[7 + i] + lag[i] * v[6 + i]
        offset = control[t, i] + wanted[i] - center
        out[i] = center + min(max(offset, -reach[i]), reach[i])


def simulate(
    character: Character,
    data: mujoco.MjData,
    q: Array,
    v: Array,
    steps: int,
    control_at: Callable[[int, Array, Array], Array],
) -> Rollout:
    """Step from q (57,), v (56,); control_at(t, q, v) gives targets (50,).

    After a divergence the rest of the roll-out is undefined.
    """
    model = character.model
    out = Rollout(
        q=np.empty((steps + 1, model.nq)),
        v=np.empty((steps + 1, model.nv)),
        control=np.empty((steps, model.nu)),
        torque=np.empty((steps, model.nu)),
        com=np.empty((steps + 1, 3)),
        com_velocity=np.empty((steps + 1, 3)),
        diverged=False,
    )
    mujoco.mj_resetData(model, data)
    qpos, qvel, ctrl, force, sensors = (data.qpos, data.qvel, data.ctrl, data.actuator_force, data.sensordata)
    qpos[:], qvel[:] = q, v
    time = 0.0
    for t in range(steps):
        out.q[t], out.v[t] = qpos, qvel
        out.control[t] = control_at(t, qpos, qvel)
        ctrl[:] = out.control[t]
        mujoco.mj_step(model, data)
        # Sensors describe the state before the step.
        out.com[t], out.com_velocity[t] = sensors[:3], sensors[3:6]
        out.torque[t] = force
        # A simulation that blows up resets itself, its clock too.
        if data.time <= time:
            return Rollout(**{**out.__dict__, "diverged": True})
        time = data.time
    out.q[-1], out.v[-1] = qpos, qvel
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_sensorPos(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_sensorVel(model, data)
    out.com[-1], out.com_velocity[-1] = sensors[:3], sensors[3:6]
    if any(data.warning[w].number for w in BLOWN_UP):
        return Rollout(**{**out.__dict__, "diverged": True})
    return out


def simulate_many(
    character: Character,
    pool: mujoco.rollout.Rollout,
    datas: list[mujoco.MjData],
    q: Array,
    v: Array,
    control: Array,
) -> tuple[Array, Array, Array, Array, NDArray[np.bool_]]:
    """Open-loop roll-outs from one state (q, v) under controls (B, N, 50), on all threads.

    Returns q (B, N + 1, 57), v (B, N + 1, 56), com and com velocity (B, N + 1, 3), diverged (B,).
    """
    model = character.model
    batch, steps, _ = control.shape
    nq, nv = model.nq, model.nv
    # One step more than asked for: a step's sensors describe the state before it.
    padded = np.concatenate([control, control[:, -1:]], axis=1)
    start = np.concatenate([[0.0], q, v])
    state, sensor = pool.rollout([model], datas, np.broadcast_to(start, (batch, len(start))), padded)
    full = np.concatenate([np.broadcast_to(start, (batch, 1, len(start))), state[:, :steps]], 1)
    out_q, out_v = full[..., 1 : 1 + nq], full[..., 1 + nq : 1 + nq + nv]
    # A diverged simulation resets itself: its clock jumps back.
    expected = np.arange(1, steps + 2) * model.opt.timestep
    diverged = np.any(np.abs(state[..., 0] - expected) > 0.5 * model.opt.timestep, axis=1)
    diverged |= ~np.all(np.isfinite(out_v), axis=(1, 2))
    return out_q, out_v, sensor[..., :3], sensor[..., 3:6], diverged
