"""The cost of Eqs. 2 to 9: how far a simulated motion is from the reference.

`evaluate` is the paper's cost, vectorised over samples and time, and the only number by which
optimisers are compared. `expand` is its Gauss-Newton model for the optimiser that uses
derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.character.state import difference
from physique.reference.target import TERMS, Target, Weights

Array = NDArray[np.float64]


def evaluate(
    weights: Weights, target: Target, q: Array, v: Array, com: Array, com_velocity: Array, timestep: float
) -> dict[str, Array]:
    """The weighted terms of Eq. 2, each (...,), of motions q (..., T, 57), v (..., T, 56).

    com, com_velocity: (..., T, 3). The first frame is the start state; it belongs to the sums,
    though no control can change it. Eq. 7 is half the angle between the root orientations.
    """
    dq = q[..., 7:] - target.q[:, 7:]
    dv = v[..., 6:] - target.v[:, 6:]
    # |<a, b>| is the cosine of half the angle; arccos of a rounded 1 would lose half the digits.
    turn = rotations.log(rotations.multiply(rotations.conjugate(target.q[:, 3:7]), q[..., 3:7]))
    acceleration = np.diff(v, axis=-2) / timestep
    return {
        "com": weights.com * np.sum((com - target.com) ** 2, axis=(-2, -1)),
        "com_velocity": weights.com_velocity
        * np.sum((com_velocity - target.com_velocity) ** 2, axis=(-2, -1)),
        "pose": weights.pose * np.sum(weights.joints * dq**2, axis=(-2, -1)),
        "velocity": weights.velocity * np.sum(weights.joints * dv**2, axis=(-2, -1)),
        "root": weights.root * np.sum(np.linalg.norm(turn, axis=-1) / 2, axis=-1),
        "acceleration": weights.acceleration * np.sum(acceleration**2, axis=(-2, -1)),
    }


def total(terms: dict[str, Array]) -> Array:
    """E of Eq. 2."""
    return np.sum([terms[name] for name in TERMS], axis=0)


@dataclass(frozen=True)
class Quadratic:
    """Gauss-Newton model of the cost of each frame in the tangent of its state.

    gradient (T, 112); hessian (T, 2, 56, 56), of positions and of velocities.
    """

    gradient: Array
    hessian: Array


def expand(
    weights: Weights,
    target: Target,
    q: Array,
    v: Array,
    com: Array,
    com_velocity: Array,
    com_jacobian: Array,
    kink: float,
) -> Quadratic:
    """The model at q (T, 57), v (T, 56); com_jacobian (T, 3, 56) is d com / d q (tangent).

    kink: rad. Eq. 7 grows linearly with the angle and has a kink at zero; below about this angle
    the model rounds it off (pseudo-Huber). The acceleration term (weight 1e-10) is left out.
    """
    frames, nv = v.shape
    gradient = np.zeros((frames, 2 * nv))
    hessian = np.empty((frames, 2, nv, nv))
    by_q, by_v = hessian[:, 0], hessian[:, 1]
    J = np.swapaxes(com_jacobian, 1, 2)
    gradient[:, :nv] += 2 * weights.com * (J @ (com - target.com)[..., None])[..., 0]
    # d com_velocity / d v is the same Jacobian; its dependence on q is second order here.
    away_v = (com_velocity - target.com_velocity)[..., None]
    gradient[:, nv:] += 2 * weights.com_velocity * (J @ away_v)[..., 0]
    np.matmul(J, com_jacobian, out=by_v)
    np.multiply(by_v, 2 * weights.com, out=by_q)
    by_v *= 2 * weights.com_velocity

    away = difference(target.q, q)
    joint = np.arange(6, nv)
    gradient[:, joint] += 2 * weights.pose * weights.joints * away[:, 6:]
    by_q[:, joint, joint] += 2 * weights.pose * weights.joints
    gradient[:, nv + joint] += 2 * weights.velocity * weights.joints * (v - target.v)[:, 6:]
    by_v[:, joint, joint] += 2 * weights.velocity * weights.joints

    # root * angle / 2, with angle -> sqrt(angle^2 + kink^2); the rotation vector between nearby
    # orientations moves one to one with the pelvis frame's tangent.
    turn = away[:, 3:6]
    scale = weights.root / 2 / np.sqrt(np.sum(turn**2, axis=-1) + kink**2)
    gradient[:, 3:6] += scale[:, None] * turn
    root = np.arange(3, 6)
    by_q[:, root, root] += scale[:, None]
    return Quadratic(gradient, hessian)
