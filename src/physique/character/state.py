"""States on their manifold: x = (q, v), differences are 112 numbers (56 of q, then 56 of v).

The free joint's velocity is linear in the world and angular in the pelvis' own frame, so the
tangent of its orientation is a rotation vector in the pelvis frame (as `mj_differentiatePos`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique import rotations

Array = NDArray[np.float64]


def difference(q_from: Array, q_to: Array) -> Array:
    """The tangent (..., 56) that leads from q_from (..., 57) to q_to (..., 57)."""
    turn = rotations.log(rotations.multiply(rotations.conjugate(q_from[..., 3:7]), q_to[..., 3:7]))
    return np.concatenate([q_to[..., :3] - q_from[..., :3], turn, q_to[..., 7:] - q_from[..., 7:]], axis=-1)


def integrate(q: Array, dq: Array) -> Array:
    """q (..., 57) moved along the tangent dq (..., 56)."""
    quat = rotations.normalize(rotations.multiply(q[..., 3:7], rotations.exp(dq[..., 3:6])))
    return np.concatenate([q[..., :3] + dq[..., :3], quat, q[..., 7:] + dq[..., 6:]], axis=-1)


def finite_velocity(q: Array, dt: float) -> Array:
    """Velocities (T, 56) of q (T, 57) by backward differences; the first repeats the second.

    Backward, since the simulator's own step is q[t + 1] = q[t] + dt v[t + 1].
    """
    v = difference(q[:-1], q[1:]) / dt
    return np.concatenate([v[:1], v])
