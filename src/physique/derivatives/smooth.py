"""Derivatives of the recursive Newton-Euler algorithm, in closed form.

After Singh, Russo and Wensing, "Efficient Analytical Derivatives of Rigid-Body Dynamics Using
Spatial Vector Algebra" (IEEE RA-L 2022): everything stands in one world-aligned frame, so that the
derivative of the motion axis S_k by an earlier joint is S_j x S_k.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.compiled import compiled
from physique.derivatives.dense import add, add_vector, apply, fill
from physique.derivatives.spatial import (
    dot,
    force_cross,
    force_matrix,
    inertia_matrix,
    motion_cross,
    motion_cross_matrix,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class KinematicTree(NamedTuple):
    """What hangs on what. Coordinates come in depth-first order, the free joint's six first.

    parent (56,): the coordinate before each one, -1 for the first. body (56,): which body each
    moves, counted without the world. last (22,): the last coordinate that moves each body.
    body_parent (22,): -1 for the pelvis.
    """

    parent: Index
    body: Index
    last: Index
    body_parent: Index


def make_tree(model: mujoco.MjModel) -> KinematicTree:
    """The tree of a model whose first body hangs on a free joint and all others on hinges."""
    last = np.empty(model.nbody - 1, dtype=np.int64)
    for b in range(1, model.nbody):
        carrier = b
        while model.body_dofnum[carrier] == 0:
            carrier = int(model.body_parentid[carrier])
        last[b - 1] = model.body_dofadr[carrier] + model.body_dofnum[carrier] - 1
    return KinematicTree(
        parent=model.dof_parentid.astype(np.int64),
        body=model.dof_bodyid.astype(np.int64) - 1,
        last=last,
        body_parent=model.body_parentid[1:].astype(np.int64) - 1,
    )


@compiled
def add_up(after: Array, before: Array, parent: Index, own: Array) -> None:
    """Sums of own (56, 6) along the tree: after each joint, and of what it hangs on.

    The free joint's three translations do not move each other's axes, nor do its three turns,
    whose axes all move with the body.
    """
    for k in range(len(parent)):
        for i in range(6):
            sum_before = after[parent[k], i] if k > 0 else 0.0
            after[k, i] = sum_before + own[k, i]
            if k < 3:
                before[k, i] = 0.0
            elif k < 6:
                before[k, i] = after[2, i]
            else:
                before[k, i] = sum_before


@compiled
def derivatives(
    by_q: Array,
    by_v: Array,
    mass: Array,
    tree: KinematicTree,
    gravity: Array,
    axes: Array,
    inertia: Array,
    v: Array,
    a: Array,
) -> None:
    """Fill by_q, by_v (T, 56, 56): d torque / d q and / d v, row by torque, and mass (T, 56, 56).

    Of T states with the axes (T, 56, 6) and inertias (T, 22, 10) of MuJoCo's `cdof` and `cinert`,
    under gravity (3,), m/s2, at v and a (T, 56). Torques are those of inverse dynamics without
    contact, armature or actuators.
    """
    nv, bodies = v.shape[1], inertia.shape[1]
    own, rate = np.empty((nv, 6)), np.empty((nv, 6))
    velocity, before_v, moving = np.empty((nv, 6)), np.empty((nv, 6)), np.empty((nv, 6))
    acceleration, before_a = np.empty((nv, 6)), np.empty((nv, 6))
    I_c, B_c, F_c = np.empty((bodies, 6, 6)), np.empty((bodies, 6, 6)), np.empty((bodies, 6))
    momentum, force, turn = np.empty(6), np.empty(6), np.empty((6, 6))
    S1, S2, S_rate = np.empty((nv, 6)), np.empty((nv, 6)), np.empty((nv, 6))
    IS, BS, up_q, up_v, some = np.empty(6), np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    for t in range(len(v)):
        axis = axes[t]
        for k in range(nv):
            for i in range(6):
                own[k, i] = axis[k, i] * v[t, k]
        add_up(velocity, before_v, tree.parent, own)
        for k in range(nv):
            # Of the frame that the axis moves with.
            for i in range(6):
                moving[k, i] = velocity[5, i] if 3 <= k < 6 else before_v[k, i]
            motion_cross(rate[k], moving[k], axis[k])
            for i in range(6):
                rate[k, i] = axis[k, i] * a[t, k] + rate[k, i] * v[t, k]
        add_up(acceleration, before_a, tree.parent, rate)
        # As if gravity were an acceleration of the world.
        for k in range(nv):
            for i in range(3):
                acceleration[k, 3 + i] -= gravity[i]
                before_a[k, 3 + i] -= gravity[i]

        # Of each body and all that hangs on it: inertia, Coriolis matrix (twice Singh's B), force.
        for b in range(bodies):
            I, V = I_c[b], velocity[tree.last[b]]  # noqa: E741
            inertia_matrix(I, inertia[t, b])
            apply(momentum, I, V)
            force_matrix(B_c[b], momentum)
            motion_cross_matrix(turn, V)
            for i in range(6):
                for j in range(6):
                    total = 0.0
                    for n in range(6):
                        total += turn[n, i] * I[n, j] + I[i, n] * turn[n, j]
                    B_c[b, i, j] -= total
            apply(F_c[b], I, acceleration[tree.last[b]])
            force_cross(force, V, momentum)
            add_vector(F_c[b], force)
        for b in range(bodies - 1, 0, -1):
            add(I_c[tree.body_parent[b]], I_c[b])
            add(B_c[tree.body_parent[b]], B_c[b])
            add_vector(F_c[tree.body_parent[b]], F_c[b])

        for k in range(nv):
            motion_cross(S1[k], before_v[k], axis[k])
            motion_cross(S2[k], before_a[k], axis[k])
            motion_cross(some, before_v[k], S1[k])
            add_vector(S2[k], some)
            motion_cross(S_rate[k], moving[k], axis[k])
            add_vector(S_rate[k], S1[k])
        fill(by_q[t], 0.0)
        fill(by_v[t], 0.0)
        fill(mass[t], 0.0)
        for k in range(nv):
            b = tree.body[k]
            S, I, B = axis[k], I_c[b], B_c[b]  # noqa: E741
            apply(IS, I, S)
            apply(BS, B.T, S)
            apply(up_q, B, S1[k])
            apply(some, I, S2[k])
            add_vector(up_q, some)
            force_cross(some, S, F_c[b])
            add_vector(up_q, some)
            apply(up_v, B, S)
            apply(some, I, S_rate[k])
            add_vector(up_v, some)
            j = 5 if 3 <= k < 6 else k  # the three turns of the free joint are one joint
            while j >= 0:
                # Row k, column j at or before k: what hangs on k is moved as a whole.
                by_q[t, k, j] = dot(BS, S1[j]) + dot(IS, S2[j])
                by_v[t, k, j] = dot(BS, axis[j]) + dot(IS, S_rate[j])
                mass[t, k, j] = mass[t, j, k] = dot(IS, axis[j])
                # Row j before column k: only what hangs on k moves, and takes its force along.
                if j < k and not (j >= 3 and k < 6):
                    by_q[t, j, k] = dot(axis[j], up_q)
                    by_v[t, j, k] = dot(axis[j], up_v)
                j = tree.parent[j]
