"""Candidate ways on from one state, simulated side by side (section 4.2)."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from physique.simulation.stepper import CLOCK, blown_up

Array = NDArray[np.float64]


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
        state = np.concatenate([np.full((count, 1), CLOCK), self.q[-1], self.v[-1]], axis=1)
        states, sensors = [], []
        for _ in range(steps):
            standing = np.flatnonzero(~self.fallen)
            if len(standing) == 0:
                break
            targets = control(state[:, 1 : 1 + nq], state[:, 1 + nq :])
            state, sensor = state.copy(), np.zeros((count, self._model.nsensordata))
            state[standing, 0] = CLOCK
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
            blown = blown_up(state[standing, :1], self._timestep)[:, 0]
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
