"""The simulator: MuJoCo on the processor's threads."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character
from physique.derivatives import smooth
from physique.derivatives.linearize import Linearization, linearize
from physique.simulation.process import ONE_BLAS_THREAD
from physique.simulation.rollout import Controller, Rollout, simulate
from physique.simulation.simulator import OpenLoop
from physique.simulation.stepper import CLOCK, Observer, Push, Stepper, blown_up

Array = NDArray[np.float64]


class MujocoSimulator:
    """A `Simulator` with memory for `threads` threads. To be closed, or used in a `with`."""

    def __init__(self, character: Character, threads: int = 2) -> None:
        self.character, self.threads = character, threads
        self.steps = 0
        self._tree = smooth.make_tree(character.model)
        self._steppers = [Stepper(character.model) for _ in range(threads)]
        self._datas = [stepper.data for stepper in self._steppers]
        self._open = ExitStack()
        self._executor = self._open.enter_context(ThreadPoolExecutor(threads))
        self._pool = mujoco.rollout.Rollout(nthread=threads if threads > 1 else 0)
        self._open.callback(self._pool.close)
        self._open.enter_context(ONE_BLAS_THREAD)

    def close(self) -> None:
        """Stop the threads; once is enough."""
        self._open.close()

    def __enter__(self) -> MujocoSimulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, q: Array, v: Array, steps: int, controllers: Sequence[Controller]) -> list[Rollout]:
        """As `Simulator.run`, on all threads."""
        self.steps += steps * len(controllers)
        out: list[Rollout | None] = [None] * len(controllers)

        def work(worker: int) -> None:
            for i in range(worker, len(controllers), self.threads):
                out[i], _ = simulate(self._steppers[worker], q, v, steps, controllers[i])

        for done in [self._executor.submit(work, w) for w in range(self.threads)]:
            done.result()
        return [r for r in out if r is not None]

    def run_open_loop(self, q: Array, v: Array, control: Array) -> OpenLoop:
        """As `Simulator.run_open_loop`, on all threads and without Python's lock."""
        batch, steps, _ = control.shape
        self.steps += batch * (steps + 1)
        nq, nv = len(q), len(v)
        # One step more than asked for: a step's sensors describe the state before it.
        padded = np.concatenate([control, control[:, -1:]], axis=1)
        start = np.broadcast_to(np.concatenate([[CLOCK], q, v]), (batch, 1 + nq + nv))
        state, sensor = self._pool.rollout([self.character.model], self._datas, start, padded)
        full = np.concatenate([start[:, None], state[:, :steps]], axis=1)
        return OpenLoop(
            q=full[..., 1 : 1 + nq],
            v=full[..., 1 + nq : 1 + nq + nv],
            com=sensor[..., :3],
            com_velocity=sensor[..., 3:6],
            diverged=np.any(blown_up(state[..., 0], self.character.model.opt.timestep), axis=1),
        )

    def perform(
        self,
        q: Array,
        v: Array,
        steps: int,
        controller: Controller,
        push: Push | None = None,
        observe: Observer | None = None,
    ) -> Rollout:
        """As `Simulator.perform`."""
        made, frames = simulate(self._steppers[0], q, v, steps, controller, push, observe)
        self.steps += frames if frames <= steps else steps
        return made.beginning(frames)

    def linearize(self, q: Array, v: Array, control: Array, v_next: Array | None = None) -> Linearization:
        """As `Simulator.linearize`, on all threads."""
        self.steps += len(control)
        return linearize(self.character, self._tree, self._datas, self._executor, q, v, control, v_next)
