"""One window to optimise: the same `Problem` for every optimiser, so that E can be compared."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.character.model import Character
from physique.character.servo import pd_torque, within_limits
from physique.reference.target import Target, Weights
from physique.simulation.rollout import Rollout
from physique.tracking import costs

Array = NDArray[np.float64]


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

    def beginning(self, steps: int) -> Problem:
        """The problem of the first `steps` controls alone."""
        t, frames = self.target, slice(steps + 1)
        cut = Target(t.q[frames], t.v[frames], t.com[frames], t.com_velocity[frames])
        return replace(self, target=cut)

    def terms(self, q: Array, v: Array, com: Array, com_velocity: Array) -> dict[str, Array]:
        """Weighted terms of Eq. 2 of motions (..., N + 1, .) that start in (q0, v0)."""
        return costs.evaluate(
            self.weights, self.target, q, v, com, com_velocity, float(self.character.model.opt.timestep)
        )

    def cost(self, rollout: Rollout) -> float:
        """E of Eq. 2; infinite for a simulation that diverged."""
        if rollout.diverged:
            return float("inf")
        return float(costs.total(self.terms(rollout.q, rollout.v, rollout.com, rollout.com_velocity)))


def nominal_motion(problem: Problem, q: Array, v: Array, control: Array) -> Rollout:
    """States q (N + 1, 57), v (N + 1, 56) and controls (N, 50) as if they had been simulated."""
    pose = kinematics.poses(problem.character, q, heights=False)
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


def warm_start(problem: Problem, planned: tuple[Array, Array, Array] | None) -> Rollout:
    """The nominal motion that goes on as planned, and beyond that is the target.

    planned: states q (k, 57), v (k, 56) after the first one, and controls (k, 50).
    """
    target = problem.target
    q, v, control = target.q.copy(), target.v.copy(), target.q[1:, 7:].copy()
    q[0], v[0] = problem.q0, problem.v0
    if planned is not None:
        known = min(len(planned[2]), problem.steps)
        q[1 : known + 1], v[1 : known + 1], control[:known] = (part[:known] for part in planned)
    return nominal_motion(problem, q, v, control)


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
