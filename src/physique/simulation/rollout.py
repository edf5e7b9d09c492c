"""Stepping the character: one roll-out with feedback, or many at once without."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from physique.simulation.character import Character

Array = NDArray[np.float64]

_WARNINGS = (
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


def within_limits(character: Character, control: Array, q: Array, v: Array) -> Array:
    """Position targets (..., 50) moved so that the PD torque at (q, v) stays inside the limits.

    A target beyond the limit gives the same torque but no derivative; at the limit it keeps both.
    """
    offset = control - q[..., 7:]
    damping = _gain_kd(character) * v[..., 6:]
    limit = character.torque_limit * (1.0 - 1e-6)
    torque = _gain_kp(character) * offset - damping
    return q[..., 7:] + (np.clip(torque, -limit, limit) + damping) / _gain_kp(character)


def pd_torque(character: Character, control: Array, q: Array, v: Array) -> Array:
    """Eq. 1 within the limits: torques (..., 50), Nm."""
    torque = _gain_kp(character) * (control - q[..., 7:]) - _gain_kd(character) * v[..., 6:]
    return np.clip(torque, -character.torque_limit, character.torque_limit)


def _gain_kp(character: Character) -> Array:
    return character.model.actuator_gainprm[:, 0]


def _gain_kd(character: Character) -> Array:
    return -character.model.actuator_biasprm[:, 2]


def simulate(
    character: Character,
    data: mujoco.MjData,
    q: Array,
    v: Array,
    steps: int,
    control_at: Callable[[int, Array, Array], Array],
) -> Rollout:
    """Step from (q, v), asking `control_at(t, q, v)` for the position targets (50,) of each step.

    data: a scratch MjData of the character's model, one per thread.
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
    data.qpos[:], data.qvel[:] = q, v
    for t in range(steps):
        out.q[t], out.v[t] = data.qpos, data.qvel
        out.control[t] = control_at(t, out.q[t], out.v[t])
        data.ctrl[:] = out.control[t]
        mujoco.mj_step(model, data)
        # Sensors describe the state before the step.
        out.com[t], out.com_velocity[t] = data.sensordata[:3], data.sensordata[3:6]
        out.torque[t] = data.actuator_force
        if any(data.warning[w].number for w in _WARNINGS):
            return Rollout(**{**out.__dict__, "diverged": True})
    out.q[-1], out.v[-1] = data.qpos, data.qvel
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_sensorPos(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_sensorVel(model, data)
    out.com[-1], out.com_velocity[-1] = data.sensordata[:3], data.sensordata[3:6]
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
    state, sensor = pool.rollout(
        [model], datas, np.broadcast_to(start, (batch, len(start))), padded
    )
    full = np.concatenate([np.broadcast_to(start, (batch, 1, len(start))), state[:, :steps]], 1)
    out_q, out_v = full[..., 1 : 1 + nq], full[..., 1 + nq : 1 + nq + nv]
    # A diverged simulation resets itself: its clock jumps back.
    expected = np.arange(1, steps + 2) * model.opt.timestep
    diverged = np.any(np.abs(state[..., 0] - expected) > 0.5 * model.opt.timestep, axis=1)
    diverged |= ~np.all(np.isfinite(out_v), axis=(1, 2))
    return out_q, out_v, sensor[..., :3], sensor[..., 3:6], diverged
