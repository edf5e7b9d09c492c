"""One window to optimise: the same `Problem` for every optimiser, so that E can be compared."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from physique.simulation import kinematics
from physique.simulation import linearize as lin
from physique.simulation.character import Character
from physique.simulation.rollout import (
    Rollout,
    pd_torque,
    simulate,
    simulate_many,
    within_limits,
)
from physique.tracking import costs
from physique.tracking.costs import Target, Weights

Array = NDArray[np.float64]


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

    def run(
        self, q: Array, v: Array, steps: int, controllers: list[Callable[[int, Array, Array], Array]]
    ) -> list[Rollout]:
        """One roll-out from (q, v) for each controller (t, q, v) -> targets (50,)."""
        self.steps += steps * len(controllers)
        out: list[Rollout | None] = [None] * len(controllers)

        def work(worker: int) -> None:
            for i in range(worker, len(controllers), self.threads):
                out[i] = simulate(
                    self.character, self._datas[worker], q, v, steps, controllers[i]
                )

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
        return kinematics.poses(self.character, q[None]).com[0]

    def linearize(self, q: Array, v: Array, control: Array) -> lin.Linearization:
        """Derivatives of the steps from q (N, 57), v (N, 56) under control (N, 50)."""
        self.steps += len(control) * lin.EVALUATIONS
        return lin.linearize(self.character, self._datas, self._executor, q, v, control)


@dataclass(frozen=True)
class Problem:
    """Choose controls (N, 50), rad, so that the motion from (q0, v0) is nearest to the target.

    q0 (57,), v0 (56,); target: N + 1 frames, the first beside the start state.
    """

    character: Character
    q0: Array
    v0: Array
    target: Target
    weights: Weights = field(default_factory=Weights)

    @property
    def steps(self) -> int:
        """Number of controls N."""
        return len(self.target.q) - 1

    def terms(self, q: Array, v: Array, com: Array, com_velocity: Array) -> dict[str, Array]:
        """Weighted terms of Eq. 2 of motions (..., N + 1, .) that start in (q0, v0)."""
        return costs.evaluate(
            self.weights, self.target, q, v, com, com_velocity,
            float(self.character.model.opt.timestep),
        )  # fmt: skip

    def cost(self, rollout: Rollout) -> float:
        """E of Eq. 2; infinite for a simulation that diverged."""
        if rollout.diverged:
            return float("inf")
        return float(
            costs.total(self.terms(rollout.q, rollout.v, rollout.com, rollout.com_velocity))
        )


def nominal_motion(problem: Problem, q: Array, v: Array, control: Array) -> Rollout:
    """States q (N + 1, 57), v (N + 1, 56) and controls (N, 50) as if they had been simulated."""
    pose = kinematics.poses(problem.character, q)
    control = within_limits(problem.character, control, q[:-1], v[:-1])
    return Rollout(
        q=q,
        v=v,
        control=control,
        torque=pd_torque(problem.character, control, q[:-1], v[:-1]),
        com=pose.com,
        com_velocity=kinematics.com_velocity(pose.com_jacobian, v),
        diverged=False,
    )


@dataclass(frozen=True)
class Solution:
    """What an optimiser returns: the best motion found, and how it got there.

    history: E after each iteration. steps: simulated steps, finite differences counted.
    status: why it stopped.
    """

    rollout: Rollout
    cost: float
    history: tuple[float, ...]
    steps: int
    status: str
