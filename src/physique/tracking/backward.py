"""The backward pass of iterative LQR: the best linear policy about a motion.

A step moves the state through its new velocity alone, and the new velocities w of the joints may be
chosen instead of their targets: those of the root follow from the six equations of motion that hold
no torque, and the targets from the other fifty. So each step costs a few products with six rows,
one solution of a (50, 50) system and one product of the size of the state.

Torque limits are limits of each step's quadratic program (`box`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from physique.character.servo import usable_limit
from physique.character.state import difference
from physique.compiled import compiled
from physique.derivatives import dense
from physique.derivatives.linearize import Linearization
from physique.simulation.rollout import Rollout
from physique.tracking.box import hold
from physique.tracking.costs import Quadratic
from physique.tracking.problem import Problem

Array = NDArray[np.float64]

#: Joints of this strength are damped by just `damping`.
DAMPING_LIMIT = 100.0  # Nm


@dataclass(frozen=True)
class LinearPolicy:
    """u(t, x) = control + step * feedforward + feedback (x - x0); (N, 50), (N, 50), (N, 50, 112).

    gain: the decrease of E that the model predicts for a full step.
    """

    feedforward: Array
    feedback: Array
    gain: float


class _Steps(NamedTuple):
    """N steps as functions of the state x and the joints' new velocities w.

    dv'_root = root_x dx + root_w w, (N, 6, 112), (N, 6, 50); du = target_x dx + target_w w,
    (N, 50, 112), (N, 50, 50). damp_x (N, 50, 112) and damp_w (N, 50, 50): of w, that damp du.
    transport, rotation (N, 3, 3), timestep: of `Linearization`.
    low, high (N, 50): limits of du; lag: the target of a joint that moves by dq, dv moves by
    dq + lag dv where its torque stays.
    """

    root_x: Array
    root_w: Array
    target_x: Array
    target_w: Array
    damp_x: Array
    damp_w: Array
    transport: Array
    rotation: Array
    timestep: float
    low: Array
    high: Array
    lag: Array


def backward(
    problem: Problem, rollout: Rollout, linear: Linearization, cost: Quadratic, damping: float
) -> LinearPolicy | None:
    """The linear-quadratic policy about a roll-out; None where the damping is too small."""
    # Zero, but for a nominal motion that does not obey physics.
    gaps = np.concatenate([difference(rollout.q[1:], linear.q), linear.v - rollout.v[1:]], axis=1)  # (N, 112)
    steps = _eliminate(problem, rollout, linear, damping)
    feedforward = np.empty_like(rollout.control)
    joints = np.empty_like(steps.target_x)
    gain = _sweep(feedforward, joints, steps, cost.gradient, cost.hessian, gaps)
    if not np.isfinite(gain):
        return None
    feedback = steps.target_w @ joints
    feedback += steps.target_x
    return LinearPolicy(feedforward, feedback, gain)


def _eliminate(problem: Problem, rollout: Rollout, linear: Linearization, damping: float) -> _Steps:
    character = problem.character
    mass, h, nv = linear.mass, linear.timestep, linear.v.shape[1]
    drive = h * linear.drive
    drive[:, :, nv:] += mass
    solved = np.linalg.solve(mass[:, :6, :6], np.concatenate([drive[:, :6], -mass[:, :6, 6:]], axis=2))
    root_x, root_w = solved[..., : 2 * nv].copy(), solved[..., 2 * nv :].copy()
    per_target = (h * linear.gain)[..., None]
    target_x = (mass[:, 6:, :6] @ root_x - drive[:, 6:]) / per_target
    target_w = (mass[:, 6:, 6:] + mass[:, 6:, :6] @ root_w) / per_target
    # The same change of target uses more of a weak joint's strength.
    weight = damping * DAMPING_LIMIT / character.torque_limit
    weighted = np.swapaxes(target_w * weight[:, None], 1, 2)
    limit, kp = usable_limit(character), character.stiffness
    return _Steps(
        root_x=root_x,
        root_w=root_w,
        target_x=target_x,
        target_w=target_w,
        damp_x=weighted @ target_x,
        damp_w=weighted @ target_w,
        transport=linear.transport,
        rotation=linear.rotation,
        timestep=h,
        low=(-limit - rollout.torque) / kp,
        high=(limit - rollout.torque) / kp,
        lag=character.damping / kp,
    )


@compiled
def _sweep(
    feedforward: Array, joints: Array, s: _Steps, gradient: Array, hessian: Array, gaps: Array
) -> float:
    """Fill feedforward (N, 50), of the targets, and joints (N, 50, 112), the feedback of w.

    Of a cost with gradient (N + 1, 112) and hessian (N + 1, 2, 56, 56). The predicted decrease of
    the cost, NaN where a step has no minimum.
    """
    steps, nu = feedforward.shape
    nv = gradient.shape[1] // 2
    gain = 0.0
    v_x, v_xx = gradient[steps].copy(), np.zeros((2 * nv, 2 * nv))
    dense.copy(v_xx[:nv, :nv], hessian[steps, 0])
    dense.copy(v_xx[nv:, nv:], hessian[steps, 1])
    vv, vq, qq = np.empty((nv, nv)), np.empty((nv, nv)), np.empty((nv, nv))
    by_v, by_q = np.empty((nv, 1)), np.empty(nv)
    root, cross = np.empty((6, nu)), np.empty((nu, nu))
    q_ww, q_w, q_wx = np.empty((nu, nu)), np.empty((nu, 1)), np.empty((nu, 2 * nv))
    factor, k = np.empty((nu, nu)), np.empty((nu, 1))
    left, right = np.empty((nv, 2 * nv)), np.empty((nv, 2 * nv))
    K, half = left[6:], right[6:]
    wish, along_k, through = np.empty(nu), np.empty(nu), np.empty((2 * nv, 2 * nv))
    for t in range(steps - 1, -1, -1):
        C, G = s.root_x[t], s.root_w[t]
        for i in range(2 * nv):
            for j in range(2 * nv):
                v_x[i] += v_xx[i, j] * gaps[t, j]
        _pull_back(vv, vq, qq, by_v, by_q, v_xx, v_x, s.transport[t], s.rotation[t], s.timestep)
        vr = vv[:6, 6:]
        dense.fill(cross, 0.0)
        dense.add_transposed_product(cross, G, vr)
        dense.copy(root, vr)
        dense.add_transposed_product(root, vv[:6, :6], G)
        for i in range(nu):
            for j in range(nu):
                q_ww[i, j] = vv[6 + i, 6 + j] + cross[j, i]
        dense.add_transposed_product(q_ww, G, root)
        dense.copy(q_w, by_v[6:])
        dense.add_transposed_product(q_w, G, by_v[:6])
        dense.copy(q_wx[:, :nv], vq[6:])
        dense.fill(q_wx[:, nv:], 0.0)
        dense.add_transposed_product(q_wx[:, :nv], G, vq[:6])
        dense.add_transposed_product(q_wx, root, C)

        for i in range(nu):
            for j in range(nu):
                factor[i, j] = q_ww[i, j] + s.damp_w[t, i, j]
        if not dense.cholesky(factor):
            return np.nan
        for i in range(nu):
            k[i, 0] = -q_w[i, 0]
        dense.solve(factor, k)
        inside = True
        dense.apply(wish, s.target_w[t], k[:, 0])
        for i in range(nu):
            inside = inside and s.low[t, i] <= wish[i] <= s.high[t, i]
        for i in range(nu):
            for j in range(2 * nv):
                K[i, j] = -q_wx[i, j] - s.damp_x[t, i, j]
        dense.solve(factor, K)
        if not inside and not _limit(k, K, wish, factor, s, t):
            return np.nan
        dense.copy(joints[t], K)

        # C^T vv C / 2 + C^T [vq 0] + K^T q_ww K / 2 + K^T q_wx, and its transpose.
        np.dot(q_ww, K, half)
        dense.apply(along_k, q_ww, k[:, 0])
        for i in range(nu):
            for j in range(2 * nv):
                half[i, j] = 0.5 * half[i, j] + q_wx[i, j]
            feedforward[t, i] = wish[i]
            along_k[i] += q_w[i, 0]
            gain -= 0.5 * (q_w[i, 0] + along_k[i]) * k[i, 0]
        dense.copy(left[:6], C)
        dense.copy(right[:6, :nv], vq[:6])
        dense.fill(right[:6, nv:], 0.0)
        for i in range(6):
            for j in range(6):
                vv[i, j] *= 0.5
        dense.add_transposed_product(right[:6], vv[:6, :6], C)
        np.dot(left.T, right, through)
        for i in range(2 * nv):
            v_x[i] = gradient[t, i] + (by_q[i] if i < nv else 0.0)
        for i in range(6):
            for j in range(2 * nv):
                v_x[j] += C[i, j] * by_v[i, 0]
        for i in range(nu):
            for j in range(2 * nv):
                v_x[j] += q_wx[i, j] * k[i, 0] + K[i, j] * along_k[i]
        for i in range(2 * nv):
            for j in range(2 * nv):
                v_xx[i, j] = through[i, j] + through[j, i]
        for i in range(nv):
            for j in range(nv):
                v_xx[i, j] += qq[i, j] + hessian[t, 0, i, j]
                v_xx[nv + i, nv + j] += hessian[t, 1, i, j]
    return gain


@compiled
def _limit(k: Array, K: Array, wish: Array, factor: Array, s: _Steps, t: int) -> bool:
    """Bring the step's policy w = k + K dx, (50, 1), (50, 112), and the change `wish` (50,) of the
    targets within the limits; factor (50, 50): Cholesky's, of the second derivative by w."""
    nu, nx = K.shape
    nv, T, free = nx // 2, s.target_w[t], wish.copy()
    which, Y = np.empty(nu, dtype=np.int64), np.empty((nu, nu))
    system, force = np.empty((nu, nu)), np.empty((nu, 1))
    m = hold(wish, which, Y, system, force, free, T, factor, s.low[t], s.high[t])
    if m < 0:
        return False
    rows = np.empty((m, nx))
    for i in range(m):
        c = which[i]
        # A joint at its limit keeps its torque, so its target moves along with the joint.
        for j in range(nx):
            rows[i, j] = s.target_x[t, c, j]
        rows[i, 6 + c] -= 1.0
        rows[i, nv + 6 + c] -= s.lag[c]
        for n in range(nu):
            for j in range(nx):
                rows[i, j] += T[c, n] * K[n, j]
    dense.solve(system[:m, :m], rows)
    for n in range(nu):
        for i in range(m):
            k[n, 0] -= Y[n, i] * force[i, 0]
            for j in range(nx):
                K[n, j] -= Y[n, i] * rows[i, j]
    return True


@compiled
def _pull_back(
    vv: Array,
    vq: Array,
    qq: Array,
    by_v: Array,
    by_q: Array,
    hessian: Array,
    gradient: Array,
    D: Array,
    E: Array,
    h: float,
) -> None:
    """The value of the state after a step, hessian (112, 112) and gradient (112,), as one of the
    new velocity v' and the old position q.

    by_v (56, 1) and by_q (56,) are its gradients, vv, vq and qq (56, 56) its second derivatives.
    dq' = D dq + h E dv', with D and E (3, 3) for the pelvis' turn and the identity elsewhere.
    """
    nv = len(by_q)
    V_qq, V_qv = hessian[:nv, :nv], hessian[:nv, nv:]
    some = np.empty((nv, nv))
    _turn_columns(some, V_qq, E)
    _turn_rows(vv, some, E)
    _turn_rows(some, V_qv, E)
    for i in range(nv):
        for j in range(nv):
            vv[i, j] = h * h * vv[i, j] + h * (some[i, j] + some[j, i]) + hessian[nv + i, nv + j]
    _turn_columns(some, V_qq, D)
    _turn_rows(qq, some, D)
    _turn_rows(vq, some, E)
    _turn_columns(some, V_qv.T, D)
    for i in range(nv):
        by_q[i] = gradient[i]
        by_v[i, 0] = h * gradient[i] + gradient[nv + i]
        for j in range(nv):
            vq[i, j] = h * vq[i, j] + some[i, j]
    for i in range(3):
        total, stay = 0.0, 0.0
        for j in range(3):
            total += E[j, i] * gradient[3 + j]
            stay += D[j, i] * gradient[3 + j]
        by_v[3 + i, 0] = h * total + gradient[nv + 3 + i]
        by_q[3 + i] = stay


@compiled
def _turn_rows(out: Array, matrix: Array, turn: Array) -> None:
    """out = T^T matrix, where T is turn (3, 3) for the pelvis' turn and the identity elsewhere."""
    dense.copy(out, matrix)
    for i in range(3):
        for k in range(matrix.shape[1]):
            out[3 + i, k] = turn[0, i] * matrix[3, k] + turn[1, i] * matrix[4, k] + turn[2, i] * matrix[5, k]


@compiled
def _turn_columns(out: Array, matrix: Array, turn: Array) -> None:
    """out = matrix T."""
    dense.copy(out, matrix)
    for k in range(matrix.shape[0]):
        for i in range(3):
            out[k, 3 + i] = matrix[k, 3] * turn[0, i] + matrix[k, 4] * turn[1, i] + matrix[k, 5] * turn[2, i]
