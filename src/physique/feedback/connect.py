"""From a perturbed state back to the motion: trajectory optimisation with derivatives.

A receding window, as the motion itself was made: each window aims at the motion beside its place
(`recovery`), a little of it is kept, and the next aims anew from where that led. As soon as the
motion's own LQR takes over from there, the branch ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.character.joint_error import SUCCESS_LIMIT, mean_joint_error
from physique.feedback import lqr
from physique.feedback.law import BOUND
from physique.feedback.recovery import recovery_target
from physique.feedback.tree import GAIN_TYPE, STRIDE, Branch
from physique.reference.target import Target
from physique.simulation.linear_feedback import Feedback
from physique.simulation.simulator import Simulator
from physique.tracking import ddp
from physique.tracking.problem import Problem, warm_start

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ConnectOptions:
    """horizon: steps that a window looks ahead; keep: of these that are kept; iterations: of the
    optimiser in each. longest: steps of a branch. proof: steps that the motion's LQR must stand
    after it. near: m, mean body position error at the proof's end."""

    horizon: int = 60
    keep: int = 15
    iterations: int = 8
    longest: int = 120
    proof: int = 100
    near: float = 0.4


@dataclass(frozen=True)
class Trunk:
    """The motion with its LQR: T frames of q, v, com, com_velocity, joints (T, 22, 3); control
    (T - 1, 50), gains (T - 1, 50, 112) and the cost-to-go (T, 112, 112)."""

    q: Array
    v: Array
    com: Array
    com_velocity: Array
    joints: Array
    control: Array
    gains: Array
    cost_to_go: Array

    @property
    def last(self) -> int:
        """Its last frame."""
        return len(self.q) - 1


def make_trunk(
    simulator: Simulator, q: Array, v: Array, control: Array, weights: lqr.WeightsName = "default"
) -> Trunk:
    """The motion q (T, 57), v (T, 56) under control (T - 1, 50), stabilised."""
    character = simulator.character
    gains = lqr.stabilize(character, simulator, q, v, control, weights)
    pose = kinematics.poses(character, q, heights=False)
    return Trunk(
        q=q,
        v=v,
        com=pose.com,
        com_velocity=kinematics.com_velocity(pose.com_jacobian, v),
        joints=pose.joints,
        control=control,
        gains=gains.target,
        cost_to_go=gains.cost_to_go,
    )


def connect(
    simulator: Simulator,
    trunk: Trunk,
    q: Array,
    v: Array,
    frame: int,
    options: ConnectOptions = ConnectOptions(),
) -> Branch | None:
    """A branch from the state q (57,), v (56,) at `frame` back to the motion; None if it falls."""
    qs, vs, controls = [q[None]], [v[None]], []
    at, tail = frame, None
    while at < min(trunk.last, frame + options.longest):
        end = min(at + options.horizon, trunk.last)
        part = slice(at, end + 1)
        motion = Target(trunk.q[part], trunk.v[part], trunk.com[part], trunk.com_velocity[part])
        target, _ = recovery_target(
            simulator.character, q, v, motion, float(simulator.character.model.opt.timestep)
        )
        problem = Problem(simulator.character, q, v, target)
        found = ddp.solve(
            problem,
            simulator,
            warm_start(problem, tail),
            ddp.DdpOptions(iterations=options.iterations, restarts=()),
        )
        keep = end - at if end == trunk.last else options.keep
        motion_found, at = found.rollout, at + keep
        off = _error(simulator, trunk, motion_found.q[keep], at)
        if not np.isfinite(found.cost) or off > SUCCESS_LIMIT:
            return None
        qs.append(motion_found.q[1 : keep + 1])
        vs.append(motion_found.v[1 : keep + 1])
        controls.append(motion_found.control[:keep])
        tail = motion_found.q[keep + 1 :], motion_found.v[keep + 1 :], motion_found.control[keep:]
        q, v = qs[-1][-1], vs[-1][-1]
        shift = takeover(simulator, trunk, q, v, at, options)
        if shift is not None:
            return make_branch(
                simulator,
                trunk,
                np.concatenate(qs),
                np.concatenate(vs),
                np.concatenate(controls),
                frame,
                shift,
            )
    return None


def takeover(
    simulator: Simulator, trunk: Trunk, q: Array, v: Array, frame: int, options: ConnectOptions
) -> Array | None:
    """How far (2,), m, beside its place the motion's LQR performs it to a good end from here on;
    None where it does not."""
    steps = min(options.proof, trunk.last - frame)
    pose = kinematics.poses(simulator.character, q[None])
    shift = (pose.com[0] - trunk.com[frame])[:2]
    if steps == 0:
        return shift
    part = slice(frame, frame + steps)
    about = trunk.q[part].copy()
    about[:, :2] += shift
    follow = Feedback(
        simulator.character, about, trunk.v[part], trunk.control[part], trunk.gains[part], BOUND
    )
    motion = simulator.run(q, v, steps, [follow])[0]
    if motion.diverged:
        return None
    checks = range(10, steps + 1, 10) if steps >= 10 else [steps]
    worst = max(_error(simulator, trunk, motion.q[t], frame + t) for t in checks)
    end = motion.q[-1].copy()
    end[:2] -= shift
    calm = _error(simulator, trunk, end, frame + steps)
    return shift if worst < options.near and calm < 0.15 else None


def make_branch(
    simulator: Simulator,
    trunk: Trunk,
    q: Array,
    v: Array,
    control: Array,
    frame: int,
    shift: Array,
    parent: int | None = None,
) -> Branch:
    """LQR along q (M + 1, 57), v (M + 1, 56) under control (M, 50), with the motion's cost-to-go
    at its end (lines 20 to 26 of Algorithm 1). parent: left out, the motion's node of that time."""
    joined = min(frame + len(control), trunk.last)
    gains = lqr.stabilize(simulator.character, simulator, q, v, control, end=trunk.cost_to_go[joined])
    pose = kinematics.poses(simulator.character, q[:-1])
    return Branch(
        q=q[:-1],
        v=v[:-1],
        control=control,
        com=pose.com,
        com_velocity=kinematics.com_velocity(pose.com_jacobian, v[:-1]),
        gains=gains.target[::STRIDE].astype(GAIN_TYPE),
        shift=shift,
        parent=joined if parent is None else parent,
        frame=frame,
    )


def _error(simulator: Simulator, trunk: Trunk, q: Array, frame: int) -> float:
    """Mean body position error, m, of q (57,) at a frame."""
    joints = kinematics.joint_positions(simulator.character, q[None])[0]
    return mean_joint_error(joints, trunk.joints[frame])
