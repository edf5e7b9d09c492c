"""Time-varying LQR along a trajectory (section 4.1, Eqs. 11 to 20).

The control of the linear-quadratic problem is the torque, as in the paper. Its gains are then
turned into gains of position targets: the actuators' implicit PD controller is one more invertible
linear map between torques and targets, so both forms have the same closed loop to first order, and
far from the trajectory the PD controller calms what the linear law does not know.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.character.hinges import HINGES
from physique.character.model import Character
from physique.derivatives.linearize import Linearization
from physique.reference.target import joint_weights
from physique.simulation.simulator import Simulator

Array = NDArray[np.float64]

WeightsName = Literal["default", "paper"]


@dataclass(frozen=True)
class LqrWeights:
    """Q and R of Eqs. 13 and 14, as the terms of a cost.

    com, com_velocity: of the centre of mass, 1/m^2 and s^2/m^2. orientation, spin: of the pelvis.
    pose, rate: of the joints, times the joint weights of Eq. 5. torque: of torques as a share of
        the joint's strength. Chosen by measured survival (docs/feedback.md).
    """

    com: float = 30.0
    com_velocity: float = 4.0
    orientation: float = 4.0
    spin: float = 1.0
    pose: float = 6.0
    rate: float = 0.1
    torque: float = 10.0


@dataclass(frozen=True)
class Gains:
    """Feedback along N steps.

    target (N, 50, 112): gains of position targets, rad by the state's tangent. cost_to_go
    (N + 1, 112, 112): K of Eqs. 18 to 20.
    """

    target: Array
    cost_to_go: Array


def stabilize(
    character: Character,
    simulator: Simulator,
    q: Array,
    v: Array,
    control: Array,
    weights: WeightsName | LqrWeights = "default",
    end: Array | None = None,
) -> Gains:
    """LQR about a simulated motion q (N + 1, 57), v (N + 1, 56) under control (N, 50).

    end (112, 112): the cost-to-go of the last state, where the motion goes on; else Q.
    """
    linear = simulator.linearize(q[:-1], v[:-1], control, v[1:])
    A, B = torque_system(character, linear)
    Q, R = cost_matrices(character, q, LqrWeights() if weights == "default" else weights)
    L, K = riccati(A, B, Q, R, end)
    return Gains(target_gains(character, A, B, L), K)


def cost_matrices(
    character: Character, q: Array, weights: Literal["paper"] | LqrWeights
) -> tuple[Array, Array]:
    """Q (N + 1, 112, 112) and R (N, 50, 50), about the states q (N + 1, 57).

    The paper's are the identity, and 15 in R for the joints of the torso.
    """
    frames, nv = len(q), 56
    if weights == "paper":
        torso = np.array([15.0 if "spine" in h.joint else 1.0 for h in HINGES])
        return np.tile(np.eye(2 * nv), (frames, 1, 1)), np.tile(np.diag(torso), (frames - 1, 1, 1))
    Q = np.zeros((frames, 2 * nv, 2 * nv))
    jacobian = kinematics.com_jacobian(character, q)
    by_com = np.swapaxes(jacobian, 1, 2) @ jacobian
    # Like E's own model, the velocity's dependence on the position is left out.
    Q[:, :nv, :nv] = weights.com * by_com
    Q[:, nv:, nv:] = weights.com_velocity * by_com
    turn, joint = np.arange(3, 6), np.arange(6, nv)
    Q[:, turn, turn] += weights.orientation
    Q[:, nv + turn, nv + turn] += weights.spin
    Q[:, joint, joint] += weights.pose * joint_weights()
    Q[:, nv + joint, nv + joint] += weights.rate * joint_weights()
    R = np.diag(weights.torque / character.torque_limit**2)
    return Q, np.tile(R, (frames - 1, 1, 1))


def riccati(A: Array, B: Array, Q: Array, R: Array, Q_end: Array | None = None) -> tuple[Array, Array]:
    """L (N, m, n) of Eq. 17 and K (N + 1, n, n) of Eqs. 18 to 20.

    A (N, n, n), B (N, n, m), Q (N + 1, n, n), R (N, m, m); Q_end (n, n) is used in place of the
    last Q. The second K_{t+1} B_t of Eq. 19 as printed must not be transposed.
    """
    steps, n, m = B.shape
    L, K = np.empty((steps, m, n)), np.empty((steps + 1, n, n))
    K[-1] = Q[-1] if Q_end is None else Q_end
    for t in range(steps - 1, -1, -1):
        KA, KB = K[t + 1] @ A[t], K[t + 1] @ B[t]
        L[t] = -np.linalg.solve(B[t].T @ KB + R[t], KB.T @ A[t])  # (17)
        K[t] = A[t].T @ (KA + KB @ L[t]) + Q[t]  # (19), (20)
        K[t] = 0.5 * (K[t] + K[t].T)
    return L, K


def torque_system(character: Character, linear: Linearization) -> tuple[Array, Array]:
    """A (N, 112, 112) and B (N, 112, 50) of Eq. 12 by torques that are held over a step.

    Without the actuators' implicit stiffness and damping, which act where a joint is not at its
    limit.
    """
    h, steps, nv = linear.timestep, len(linear.mass), linear.v.shape[1]
    kp = linear.gain
    kd = np.where(kp > 0.0, character.damping, 0.0)
    joint = np.arange(6, nv)
    mass, drive = linear.mass.copy(), h * linear.drive
    mass[:, joint, joint] -= h * kd + h * h * kp
    drive[:, joint, joint] += h * kp
    drive[:, joint, nv + joint] += h * (kd + h * kp)
    force = np.zeros((steps, nv, 2 * nv + 50))
    force[:, :, : 2 * nv] = drive
    force[:, joint, 2 * nv + joint - 6] = h
    E, D = np.tile(np.eye(nv), (2, steps, 1, 1))
    E[:, 3:6, 3:6], D[:, 3:6, 3:6] = linear.rotation, linear.transport
    AB = np.zeros((steps, 2 * nv, 2 * nv + 50))
    AB[:, nv:] = np.linalg.solve(mass, force)
    AB[:, nv:, nv : 2 * nv] += np.eye(nv)
    AB[:, :nv] = h * E @ AB[:, nv:]
    AB[:, :nv, :nv] += D
    return AB[..., : 2 * nv], AB[..., 2 * nv :]


def target_gains(character: Character, A: Array, B: Array, L: Array) -> Array:
    """Gains (N, 50, 112) of position targets that exert the torques L dx, to first order.

    Over a step the implicit PD controller exerts kp (target - angle') - kd rate', of the angle and
    the rate that the step leads to.
    """
    nv = A.shape[1] // 2
    ahead = A + B @ L
    lag = (character.damping / character.stiffness)[:, None]
    return np.asarray(ahead[:, 6:nv] + L / character.stiffness[:, None] + lag * ahead[:, nv + 6 :])
