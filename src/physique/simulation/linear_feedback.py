"""The controller u(t, x) = u0 + K (x - x0) of optimisers and connectors, in compiled loops.

Its twin without a compiler is `feedback.law`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character
from physique.character.servo import usable_limit
from physique.compiled import compiled

Array = NDArray[np.float64]


class Feedback:
    """The controller u(t, x) = control + gain (x - x0), kept `within_limits`.

    About states q (T, 57), v (T, 56) of a motion; control (N, 50) rad, gain (N, 50, 112), N < T.
    bound: rad; feedback that would move a target further is scaled down as a whole.
    """

    def __init__(
        self, character: Character, q: Array, v: Array, control: Array, gain: Array, bound: float = np.inf
    ):
        self._bound = bound
        self._about = (q, v, control, np.ascontiguousarray(gain))
        self._lag = character.damping / character.stiffness
        self._reach = usable_limit(character) / character.stiffness

    def __call__(self, t: int, q: Array, v: Array) -> Array:
        """Targets (50,) at step t in the state q (57,), v (56,)."""
        out = np.empty(len(self._lag))
        _targets(out, t, q, v, *self._about, self._lag, self._reach, self._bound)
        return out


@compiled
def _targets(
    out: Array,
    t: int,
    q: Array,
    v: Array,
    about_q: Array,
    about_v: Array,
    control: Array,
    gain: Array,
    lag: Array,
    reach: Array,
    bound: float,
) -> None:
    nv, nu = len(v), control.shape[1]
    away = np.empty(2 * nv)
    for i in range(3):
        away[i] = q[i] - about_q[t, i]
    # The rotation vector of conj(p) q, in the pelvis frame.
    p, r = about_q[t, 3:7], q[3:7]
    w = p[0] * r[0] + p[1] * r[1] + p[2] * r[2] + p[3] * r[3]
    x = p[0] * r[1] - p[1] * r[0] - p[2] * r[3] + p[3] * r[2]
    y = p[0] * r[2] + p[1] * r[3] - p[2] * r[0] - p[3] * r[1]
    z = p[0] * r[3] - p[1] * r[2] + p[2] * r[1] - p[3] * r[0]
    sine = np.sqrt(x * x + y * y + z * z)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    scale = 2.0 * np.arctan2(sine, w) / sine if sine > 1e-12 else 2.0
    away[3], away[4], away[5] = scale * x, scale * y, scale * z
    for i in range(nu):
        away[6 + i] = q[7 + i] - about_q[t, 7 + i]
    for i in range(nv):
        away[nv + i] = v[i] - about_v[t, i]
    wanted = np.dot(gain[t], away)
    most = 0.0
    for i in range(nu):
        most = max(most, abs(wanted[i]))
    if most > bound:
        for i in range(nu):
            wanted[i] *= bound / most
    for i in range(nu):
        center = q[7 + i] + lag[i] * v[6 + i]
        offset = control[t, i] + wanted[i] - center
        out[i] = center + min(max(offset, -reach[i]), reach[i])
