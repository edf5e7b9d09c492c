"""Random pushes and how a controller stands them: survival, recovery, price."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.character.joint_error import SUCCESS_LIMIT, joint_errors, mean_joint_error
from physique.feedback.policy import Policy
from physique.simulation.rollout import Rollout
from physique.simulation.simulator import Simulator
from physique.simulation.stepper import Push, Stepper

Array = NDArray[np.float64]

#: It has recovered once it stays this near to the motion, beside its place as it ends, for so long.
RECOVERY_LIMIT = 0.05  # m
RECOVERY_STAY = 0.5  # s


@dataclass(frozen=True)
class Trial:
    """A push and what came of it.

    survived: to the end of the motion. error: m, the greatest mean body position error. lost: s
    from the push's beginning until that was above `SUCCESS_LIMIT`, None where it is survived.
    recovery: s from the push's beginning until the body performs the motion again
    (`recovery_time`); None where it does not before the motion's end.
    decisions: s that each online decision took. motion: what came of it; joints (T, 22, 3) m, of it.
    """

    push: Push
    survived: bool
    error: float
    lost: float | None
    recovery: float | None
    decisions: tuple[float, ...]
    motion: Rollout
    joints: Array


def random_pushes(
    rng: np.random.Generator,
    count: int,
    impulse: float,
    steps: int,
    start: tuple[int, int],
    timestep: float,
    parts: Sequence[int] = range(22),
) -> list[Push]:
    """Pushes of `impulse` Ns over `steps` steps: any of `parts`, any direction, from any step in
    start[0] to start[1] on, all equally likely."""
    out = []
    for _ in range(count):
        part = parts[int(rng.integers(len(parts)))]
        direction = rng.normal(size=3)
        force = impulse / (steps * timestep) * direction / np.linalg.norm(direction)
        out.append(Push(part, tuple(force.tolist()), int(rng.integers(start[0], start[1] + 1)), steps))
    return out


def run_trial(
    simulator: Simulator, policy: Policy, push: Push, joints: Array, *, to_end: bool = False
) -> Trial:
    """Perform the motion from the push's beginning to its end; joints (T, 22, 3), m, of it.

    Given up as soon as the body is too far off, unless `to_end`, for pictures of its fall.
    """
    tree, first = policy.tree, push.start
    policy.reset(first)
    decisions: list[float] = []

    def control(t: int, q: Array, v: Array) -> Array:
        before, clock = policy.decisions, time.perf_counter()
        out = policy.act(q, v)
        if policy.decisions > before:
            decisions.append(time.perf_counter() - clock)
        return out

    def go_on(t: int, now: Stepper) -> bool:
        return to_end or mean_joint_error(now.joints, joints[first + t]) <= SUCCESS_LIMIT

    motion = simulator.perform(
        tree.q[first],
        tree.v[first],
        tree.frames - 1 - first,
        control,
        Push(push.part, push.force, 0, push.steps),
        go_on,
    )
    reached = len(motion.q)
    found = kinematics.joint_positions(simulator.character, motion.q)
    wanted = joints[first : first + reached]
    errors = joint_errors(found, wanted).mean(axis=1)
    whole = first + reached == tree.frames and not motion.diverged
    off = np.flatnonzero(errors > SUCCESS_LIMIT)
    survived = bool(whole and len(off) == 0)
    return Trial(
        push=push,
        survived=survived,
        error=float(errors.max()),
        lost=None if survived else (int(off[0]) if len(off) else reached) * policy.timestep,
        recovery=recovery_time(found, wanted, policy.timestep) if survived else None,
        decisions=tuple(decisions),
        motion=motion,
        joints=found,
    )


def recovery_time(joints: Array, wanted: Array, timestep: float) -> float | None:
    """s until joints (T, 22, 3) are for good within `RECOVERY_LIMIT`, on average, of the wanted
    ones moved to where the body ends; 0 where they always are.

    A body that has stepped aside need not come back, but one that sways, turns or drifts has not
    recovered: None where it is within the limit for less than `RECOVERY_STAY` before the end.
    """
    off = joints - wanted
    aside = off[-1].mean(axis=0) * np.array([1.0, 1.0, 0.0])
    far = np.flatnonzero(np.linalg.norm(off - aside, axis=2).mean(axis=1) > RECOVERY_LIMIT)
    steps = int(far[-1]) + 1 if len(far) else 0
    return steps * timestep if (len(joints) - 1 - steps) * timestep >= RECOVERY_STAY else None


def run_trials(
    simulator: Simulator,
    policy: Policy,
    pushes: Sequence[Push],
    on_trial: Callable[[int, Trial], None] | None = None,
) -> tuple[list[Trial], float]:
    """All trials, and how many s of motion were performed a second of wall time."""
    joints = kinematics.joint_positions(simulator.character, policy.tree.q[: policy.tree.frames])
    trials: list[Trial] = []
    clock, steps = time.perf_counter(), 0
    for push in pushes:
        trials.append(run_trial(simulator, policy, push, joints))
        steps += len(trials[-1].motion.q) - 1
        if on_trial is not None:
            on_trial(len(trials), trials[-1])
    return trials, steps * policy.timestep / (time.perf_counter() - clock)
