"""A character with memory and threads to step it: every simulated step is counted here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from physique.character import kinematics
from physique.character.model import Character
from physique.derivatives import linearize as lin
from physique.derivatives import smooth
from physique.simulation.rollout import Rollout, simulate, simulate_many

Array = NDArray[np.float64]

Controller = Callable[[int, Array, Array], Array]


class Simulator:
    """A character with scratch memory and threads to step it; counts every step it takes.

    Results do not depend on the number of threads.
    """

    def __init__(self, character: Character, threads: int = 2) -> None:
        self.character = character
        self.threads = threads
        self.steps = 0
        # BLAS threads under our own make small products many times slower.
        self._blas = threadpool_limits(1)
        self._tree = smooth.make_tree(character.model)
        self._datas = [mujoco.MjData(character.model) for _ in range(threads)]
        self._executor = ThreadPoolExecutor(threads)
        self._pool = mujoco.rollout.Rollout(nthread=threads if threads > 1 else 0)

    def close(self) -> None:
        """Stop the threads."""
        self._executor.shutdown()
        self._pool.close()
        self._blas.restore_original_limits()

    def __enter__(self) -> Simulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, q: Array, v: Array, steps: int, controllers: Sequence[Controller]) -> list[Rollout]:
        """One roll-out from (q, v) for each controller (t, q, v) -> targets (50,)."""
        self.steps += steps * len(controllers)
        out: list[Rollout | None] = [None] * len(controllers)

        def work(worker: int) -> None:
            for i in range(worker, len(controllers), self.threads):
                out[i] = simulate(self.character, self._datas[worker], q, v, steps, controllers[i])

        for done in [self._executor.submit(work, w) for w in range(self.threads)]:
            done.result()
        return [r for r in out if r is not None]

    def run_open_loop(
        self, q: Array, v: Array, control: Array
    ) -> tuple[Array, Array, Array, Array, NDArray[np.bool_]]:
        """`simulate_many` from (q, v) under control (B, N, 50)."""
        self.steps += control.shape[0] * (control.shape[1] + 1)
        return simulate_many(self.character, self._pool, self._datas, q, v, control)

    def com(self, q: Array) -> Array:
        """Centre of mass (3,), m, at q (57,)."""
        return kinematics.poses(self.character, q[None], heights=False).com[0]

    def linearize(self, q: Array, v: Array, control: Array, v_next: Array | None = None) -> lin.Linearization:
        """Derivatives of the steps from q (N, 57), v (N, 56) under control (N, 50); v_next (N, 56):
        what they lead to, where it is known."""
        self.steps += len(control)
        return lin.linearize(self.character, self._tree, self._datas, self._executor, q, v, control, v_next)
