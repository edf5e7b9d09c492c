"""A run that needs no optimiser: a body that stands, with the feedback that balances it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from physique.body.capsule_body import CapsuleBody
from physique.body.mesh import BodyMesh
from physique.character import kinematics
from physique.character.model import make_character
from physique.character.strength import torque_limits
from physique.live.controllers import Replay
from physique.runs.run import Run
from physique.simulation.linear_feedback import Feedback
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.rollout import simulate
from physique.simulation.stepper import Stepper
from physique.tracking.trajectory import Trajectory

Array = NDArray[np.float64]
SECONDS = 2.4


@dataclass(frozen=True)
class Standing:
    """A person who is balanced and sways the trunk: the run, and the gains (50, 112) about it."""

    run: Run
    gain: Array


def make_standing(mesh: BodyMesh, body: CapsuleBody, name: str = "standing") -> Standing:
    character = make_character(body, torque_limits(body.mass, body.height))
    frames = round(SECONDS / 0.01) + 1
    joints = [character.model.joint(i).name for i in range(1, character.model.njnt)]
    q = np.zeros(57)
    q[3] = 1.0
    q[7 + joints.index("left_shoulder_x")] = -1.1
    q[7 + joints.index("right_shoulder_x")] = 1.1
    q[2] = -0.002 - kinematics.poses(character, q[None]).lowest.min()
    with MujocoSimulator(character, 1) as simulator:
        linear = simulator.linearize(q[None], np.zeros((1, 56)), q[None, 7:])
    gain = regulator(*linear.matrices(0))
    still = np.tile(q, (frames, 1))
    control = np.tile(q[7:], (frames - 1, 1))
    control[:, joints.index("spine2_z")] = 0.2 * np.sin(0.03 * np.arange(frames - 1))
    law = Feedback(character, still, np.zeros((frames, 56)), control, every(gain, frames))
    rollout = simulate(Stepper(character.model), q, np.zeros(56), frames - 1, law)[0]
    trajectory = Trajectory(
        0.01 * np.arange(frames),
        rollout.q,
        rollout.v,
        rollout.control,
        rollout.torque,
        rollout.q.copy(),
        np.zeros((frames, 2)),
    )
    windows = [
        {"start": 0.0, "end": SECONDS / 2, "difficulty": 1.5},
        {"start": SECONDS / 2, "end": SECONDS, "difficulty": 4.0},
    ]
    record = {"identity": {"clip": name, "body": body.name}}
    metrics = {"success": True, "seconds": SECONDS, "windows": windows}
    return Standing(Run(record, metrics, trajectory, character.xml, body, mesh), gain)


class Balance:
    """A `Controller`."""

    def __init__(self, balanced: Standing) -> None:
        run = balanced.run
        trajectory = run.trajectory
        self._law = Feedback(
            run.character(),
            trajectory.q,
            trajectory.v,
            trajectory.control,
            every(balanced.gain, trajectory.frames),
        )
        self._replay = Replay(trajectory)
        self._last = len(trajectory.control) - 1

    @property
    def frame(self) -> int:
        return self._replay.frame

    def reset(self, frame: int) -> None:
        self._replay.reset(frame)

    def act(self, q: Array, v: Array) -> Array:
        at = min(self.frame, self._last)
        self._replay.act(q, v)
        return self._law(at, q, v)


def every(gain: Array, frames: int) -> Array:
    """The same gains at each step of so many frames."""
    return np.broadcast_to(gain, (frames - 1, *gain.shape))


def regulator(A: Array, B: Array) -> Array:
    """Gains (50, 112) of the linear-quadratic regulator."""
    Q, R = np.diag(np.repeat([1.0, 0.01], 56)), np.eye(50)
    K = solve_discrete_are(A, B, Q, R)
    return -np.linalg.solve(R + B.T @ K @ B, B.T @ K @ A)
