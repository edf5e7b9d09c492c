"""Derivatives of the recursive Newton-Euler algorithm, in closed form, for many states at once.

After Singh, Russo and Wensing, "Efficient Analytical Derivatives of Rigid-Body Dynamics Using
Spatial Vector Algebra" (IEEE RA-L 2022): everything stands in one world-aligned frame, so that the
derivative of the motion axis S_k by an earlier joint is S_j x S_k, and all pairs of joints come out
of a few products of (56, 6) matrices.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.simulation import spatial

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tree:
    """What follows from the model alone. Bodies are counted without the world.

    supports (22, 56): 1 where the coordinate moves the body. parents (56, 56): row k is 1 at the
    coordinates before the joint of k. upto (56, 56): row k is 1 at the coordinates up to the joint
    of k, all of that joint's too; the three turns of the free joint are one joint. turned_by
    (56, 56): row k is 1 at the coordinates that turn the axis of k. gravity (3,) m/s2.
    """

    supports: Array
    parents: Array
    upto: Array
    turned_by: Array
    gravity: Array


def make_tree(model: mujoco.MjModel) -> Tree:
    """The tree of a model whose first body hangs on a free joint and all others on hinges."""
    nv = model.nv
    upto = np.eye(nv)
    for k in range(nv):
        j = int(model.dof_parentid[k])
        while j >= 0:
            upto[k, j] = 1.0
            j = int(model.dof_parentid[j])
    parents = upto - np.eye(nv)
    # Translations do not turn each other, turns of the free joint share one frame.
    parents[:3, :3] = 0.0
    parents[3:6, 3:6] = 0.0
    upto[3:6, 3:6] = 1.0
    turned_by = upto - np.eye(nv)
    turned_by[:3, :3] = 0.0
    supports = np.zeros((model.nbody - 1, nv))
    for b in range(1, model.nbody):
        carrier = b
        while model.body_dofnum[carrier] == 0:
            carrier = int(model.body_parentid[carrier])
        last = int(model.body_dofadr[carrier] + model.body_dofnum[carrier] - 1)
        supports[b - 1] = upto[last]
    return Tree(
        supports=supports,
        parents=parents,
        upto=upto,
        turned_by=turned_by,
        gravity=model.opt.gravity.copy(),
    )


@dataclass(frozen=True)
class Motion:
    """Spatial motion of T states.

    axes (T, 56, 6): S. velocity, acceleration (T, 22, 6) of the bodies, the latter as if gravity
    were an acceleration of the world. before_velocity, before_acceleration (T, 56, 6): of what
    each joint hangs on. after_velocity (T, 56, 6): of the frame that each axis moves with.
    """

    axes: Array
    velocity: Array
    acceleration: Array
    before_velocity: Array
    before_acceleration: Array
    after_velocity: Array


def motion(tree: Tree, axes: Array, v: Array, a: Array) -> Motion:
    """The motion of all bodies with axes (T, 56, 6) under v (T, 56) and a (T, 56)."""
    own = axes * v[..., None]
    before = tree.parents @ own
    # Hinges turn about axes that they do not move; the free joint's turns about axes that they do.
    after = before.copy()
    after[:, 3:6] += own[:, 3:6].sum(axis=1, keepdims=True)
    rate = axes * a[..., None] + spatial.motion_cross(after, axes) * v[..., None]
    falling = np.concatenate([np.zeros(3), -tree.gravity])
    return Motion(
        axes=axes,
        velocity=tree.supports @ own,
        acceleration=tree.supports @ rate + falling,
        before_velocity=before,
        before_acceleration=tree.parents @ rate + falling,
        after_velocity=after,
    )


def derivatives(tree: Tree, m: Motion, inertia: Array) -> tuple[Array, Array]:
    """d torque / d q and d torque / d v, both (T, 56, 56), row by torque.

    inertia: (T, 22, 6, 6) of the bodies. Torques are those of inverse dynamics without contact,
    armature or actuators.
    """
    momentum = _apply(inertia, m.velocity)
    v_cross = spatial.motion_cross_matrix(m.velocity)
    coriolis = (  # twice Singh's B
        -np.swapaxes(v_cross, -1, -2) @ inertia - inertia @ v_cross + spatial.force_matrix(momentum)
    )
    force = _apply(inertia, m.acceleration) + spatial.force_cross(m.velocity, momentum)
    # Sums over all that hangs on each coordinate.
    below = tree.supports.T
    frames, bodies = inertia.shape[:2]
    I_c, B_c, F_c = (
        (below @ x.reshape(frames, bodies, -1)).reshape(frames, -1, *x.shape[2:])
        for x in (inertia, coriolis, force)
    )
    S = m.axes
    S1 = spatial.motion_cross(m.before_velocity, S)
    S2 = spatial.motion_cross(m.before_acceleration, S)
    S2 += spatial.motion_cross(m.before_velocity, S1)
    S_rate = spatial.motion_cross(m.after_velocity, S) + S1

    IS = _apply(I_c, S)
    BS = _apply(np.swapaxes(B_c, -1, -2), S)
    # Row k, column j at or before k: what hangs on k is moved as a whole.
    q_low = np.concatenate([BS, IS], -1) @ _columns(S1, S2)
    v_low = np.concatenate([BS, IS], -1) @ _columns(S, S_rate)
    # Row j before column k: only what hangs on k moves, and takes its force along.
    q_up = S @ _columns(_apply(B_c, S1) + _apply(I_c, S2) + spatial.force_cross(S, F_c))
    v_up = S @ _columns(_apply(B_c, S) + _apply(I_c, S_rate))
    low = tree.upto
    up = np.maximum(tree.upto.T - low, 0.0)
    return q_low * low + q_up * up, v_low * low + v_up * up


def _apply(matrices: Array, vectors: Array) -> Array:
    return (matrices @ vectors[..., None])[..., 0]


def _columns(*rows: Array) -> Array:
    return np.swapaxes(np.concatenate(rows, axis=-1), -1, -2)
