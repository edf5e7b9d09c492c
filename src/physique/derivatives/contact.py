"""Derivatives of contact forces, in closed form.

A contact's force is minus the gradient of a smooth function of the residual y = J a - a_ref,
with a weight and an a_ref that depend on depth and sliding velocity (MuJoCo's manual, "Constraint
model"). Under `integrator="discrete"` the spring-damper of a row is evaluated at the end of the
step: with s = 1 + h b + h^2 k d,

    weight = s d / (1 - d) / A,    a_ref = -(b v + k d (r + h v)) / s,

where d(r) is the impedance. How the contact's point and normal move with the bodies is `touching`'s
business. What is neglected: the change of A.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.compiled import compiled
from physique.derivatives import touching
from physique.derivatives.dense import add, add_vector, apply, fill, multiply
from physique.derivatives.smooth import KinematicTree, add_up
from physique.derivatives.spatial import cross, dot, force_cross, motion_cross, set_skew

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Contacts(NamedTuple):
    """C contacts of T states, state by state.

    ends (T,): where those of each state end. point (C, 3) m, about the state's common point. frame
    (C, 3, 3): rows are the normal, from the first part to the second, and two tangents. bodies
    (C, 2), -1 for the world. moved, turned (C, 2, 3, 6): how point and frame move with each body, see
    `touching.Motions`. force (C, 3) and stiffness (C, 3, 3), -d force / d residual, along the frame's
    rows. log_weight_slope (C,): d ln weight / d depth. pull (C, 3), drag (C, 3): -d a_ref / d depth and
    -d a_ref / d velocity, row by row.
    """

    ends: Index
    point: Array
    frame: Array
    bodies: Index
    moved: Array
    turned: Array
    force: Array
    stiffness: Array
    log_weight_slope: Array
    pull: Array
    drag: Array


#: What is read of each contact and of each constraint row, and how many numbers of each.
_FIELDS = {"pos": 3, "frame": 9, "geom": 2, "dist": 1, "friction": 5, "mu": 1, "efc_address": 1}
_ROWS = {"efc_KBIP": 4, "efc_pos": 1, "efc_margin": 1, "efc_vel": 1, "efc_aref": 1, "efc_D": 1}


def read(model: mujoco.MjModel, data: mujoco.MjData) -> list[Array]:
    """What `join` needs of one state, after `mj_forward` or `mj_inverse`."""
    contact, rows = data.contact, data.nefc
    by_row = np.zeros(rows)
    mujoco.mj_mulJacVec(model, data, by_row, data.qacc)
    return [
        data.subtree_com[1].copy(),
        data.geom_xpos[contact.geom],
        data.geom_xmat[contact.geom],
        *(getattr(contact, name).copy() for name in _FIELDS),
        *(getattr(data, name)[:rows].copy() for name in _ROWS),
        by_row,
    ]


def join(model: mujoco.MjModel, parts: list[list[Array]]) -> Contacts:
    """The contacts of all states as one."""
    origins, centers, turns, *columns = zip(*parts)
    found = [len(efc) for efc in columns[len(_FIELDS) - 1]]
    raw = {
        name: np.concatenate(column).reshape(-1, width)
        for (name, width), column in zip((_FIELDS | _ROWS | {"Ja": 1}).items(), columns)
    }
    # A contact's three rows: the normal, then two tangents.
    use = np.flatnonzero(raw["efc_address"] >= 0)
    of = np.repeat(np.arange(len(parts)), found)[use]
    first_row = np.cumsum([0] + [len(rows) for rows in columns[-1]])[of]
    rows = (raw["efc_address"][use, 0] + first_row)[:, None] + np.arange(3)
    raw = {name: raw[name][use] for name in _FIELDS} | {
        name: raw[name][rows.ravel()] for name in (*_ROWS, "Ja")
    }
    friction, mu, distance = raw["friction"][:, 0], raw["mu"][:, 0], raw["dist"][:, 0]
    position, margin, velocity, a_ref, weight, acceleration = (
        raw[name].reshape(-1, 3) for name in ("efc_pos", "efc_margin", "efc_vel", "efc_aref", "efc_D", "Ja")
    )
    h = model.opt.timestep
    k, b, d, slope = raw["efc_KBIP"].reshape(-1, 3, 4)[:, 0].T
    closing = position[:, 0] - margin[:, 0] + h * velocity[:, 0]
    s = 1 + h * b + h * h * k * d
    s_slope = h * h * k * slope
    pull = np.zeros_like(weight)
    pull[:, 0] = (k * slope * closing + k * d + a_ref[:, 0] * s_slope) / s
    drag = np.repeat((b / (1 + h * b))[:, None], 3, axis=1)
    drag[:, 0] = (b + h * k * d) / s
    force, stiffness = force_and_stiffness(acceleration - a_ref, weight, friction, mu)
    origin, frame = np.array(origins)[of], raw["frame"].reshape(-1, 3, 3)
    bodies = model.geom_bodyid[raw["geom"]].astype(np.int64) - 1
    point = raw["pos"] - origin
    shapes = touching.sides(
        model, raw["geom"], np.concatenate(centers)[use] - origin[:, None], np.concatenate(turns)[use]
    )
    moved, turned = touching.motions(shapes, bodies, point, frame, distance)
    return Contacts(
        ends=np.searchsorted(of, np.arange(len(parts)), side="right"),
        point=point,
        frame=frame,
        bodies=bodies,
        moved=moved,
        turned=turned,
        force=force,
        stiffness=stiffness,
        log_weight_slope=slope / (d * (1 - d)) + s_slope / s,
        pull=pull,
        drag=drag,
    )


def force_and_stiffness(residual: Array, weight: Array, friction: Array, mu: Array) -> tuple[Array, Array]:
    """Forces (C, 3) in contact frames and -d force / d residual (C, 3, 3), positive semidefinite.

    The elliptic cone of MuJoCo's manual: nothing above the dual cone, a quadratic below the
    polar cone, the squared distance from the cone between. residual (C, 3) = J a - a_ref, weight
    (C, 3), friction (C,), and mu (C,) of the regularised cone.
    """
    scale = np.stack([mu, friction, friction], axis=-1)
    u = residual * scale
    normal, slip = u[:, 0], np.linalg.norm(u[:, 1:], axis=1)
    free = normal >= mu * slip
    stick = ~free & (mu * normal + slip <= 0)
    slide = ~free & ~stick
    force = np.where(stick[:, None], -weight * residual, 0.0)
    stiffness = np.zeros((len(mu), 3, 3))
    index = np.arange(3)
    stiffness[:, index, index] = np.where(stick[:, None], weight, 0.0)

    safe = np.where(slide, slip, 1.0)
    direction = u[:, 1:] / safe[:, None]
    gradient = np.concatenate([np.ones((len(mu), 1)), -mu[:, None] * direction], axis=1)
    over = normal - mu * slip
    along = weight[:, 0] / (mu**2 * (1 + mu**2))
    slide_force = -(along * over)[:, None] * gradient * scale
    curve = gradient[:, :, None] * gradient[:, None, :]
    turn = np.eye(2) - direction[:, :, None] * direction[:, None, :]
    curve[:, 1:, 1:] -= (over * mu / safe)[:, None, None] * turn
    slide_stiffness = along[:, None, None] * curve * scale[:, :, None] * scale[:, None, :]
    force[slide] = slide_force[slide]
    stiffness[slide] = slide_stiffness[slide]
    return force, stiffness


@compiled
def subtract_derivatives(
    by_q: Array, by_v: Array, by_a: Array, tree: KinematicTree, axes: Array, v: Array, a: Array, c: Contacts
) -> None:
    """Take d (J^T f) by q, v and a from by_q, by_v, by_a (T, 56, 56), row by torque.

    Of T states with `axes` (T, 56, 6), at v and a (T, 56). A contact sees the coordinates only
    through the motion of the bodies that touch: the change of its force is a 6 x 6 matrix by a
    body's motion, and those are summed before any coordinate enters.
    """
    states, nv = v.shape
    bodies = len(tree.last)
    own_v, own_a = np.empty((nv, 6)), np.empty((nv, 6))
    velocity, before_v = np.empty((nv, 6)), np.empty((nv, 6))
    acceleration, before_a = np.empty((nv, 6)), np.empty((nv, 6))  # J a
    slot, touching = np.empty(bodies, dtype=np.int64), np.empty(bodies, dtype=np.int64)
    load = np.empty((bodies, 6))
    by_z, by_rate_v, by_rate_a = np.empty(6), np.empty(6), np.empty(6)
    rate, away, some = np.empty(6), np.empty(6), np.empty(6)
    end = 0
    for t in range(states):
        begin, end = end, c.ends[t]
        if begin == end:
            continue
        axis = axes[t]
        for k in range(nv):
            for i in range(6):
                own_v[k, i], own_a[k, i] = axis[k, i] * v[t, k], axis[k, i] * a[t, k]
        add_up(velocity, before_v, tree.parent, own_v)
        add_up(acceleration, before_a, tree.parent, own_a)

        # Bodies that touch something, in the order in which they turn up.
        for b in range(bodies):
            slot[b] = -1
        count = 0
        for n in range(begin, end):
            for side in range(2):
                b = c.bodies[n, side]
                if b >= 0 and slot[b] < 0:
                    slot[b], touching[count] = count, b
                    count += 1
        fill(load, 0.0)
        # By where the second body moves, by the change of its velocity, and by that of J a.
        wrench = np.zeros((count, count, 6, 18))
        coupled = np.zeros((count, count), dtype=np.bool_)
        for n in range(begin, end):
            _add_contact(wrench, coupled, load, c, n, slot, tree.last, velocity, acceleration)

        for second in range(count):
            end_j = tree.last[touching[second]]
            for first in range(count):
                if not coupled[first, second]:
                    continue
                W = wrench[first, second]
                j = end_j
                while j >= 0:
                    apply(by_z, W[:, :6], axis[j])
                    apply(by_rate_v, W[:, 6:12], axis[j])
                    apply(by_rate_a, W[:, 12:], axis[j])
                    # How the body's velocity, and with it J a, depends on q.
                    for i in range(6):
                        away[i] = velocity[end_j, i] - before_v[j, i]
                    motion_cross(rate, axis[j], away)
                    apply(some, W[:, 6:12], rate)
                    add_vector(by_z, some)
                    for i in range(6):
                        away[i] = acceleration[end_j, i] - before_a[j, i]
                    motion_cross(rate, axis[j], away)
                    apply(some, W[:, 12:], rate)
                    add_vector(by_z, some)
                    k = tree.last[touching[first]]
                    while k >= 0:
                        by_q[t, k, j] -= dot(axis[k], by_z)
                        by_v[t, k, j] -= dot(axis[k], by_rate_v)
                        by_a[t, k, j] -= dot(axis[k], by_rate_a)
                        k = tree.parent[k]
                    j = tree.parent[j]
        # The axes that the forces work on move too.
        for b in range(bodies - 1, 0, -1):
            add_vector(load[tree.body_parent[b]], load[b])
        for k in range(3, nv):
            force_cross(some, axis[k], load[tree.body[k]])
            j = tree.parent[k] if k >= 6 else 5
            while j >= 0:
                by_q[t, k, j] -= dot(some, axis[j])
                j = tree.parent[j]


@compiled
def _add_contact(
    wrench: Array,
    coupled: NDArray[np.bool_],
    load: Array,
    c: Contacts,
    n: int,
    slot: Index,
    last: Index,
    velocity: Array,
    acceleration: Array,
) -> None:
    """Add contact n: what it does to the bodies, load (22, 6), and the change of that by their
    motion, wrench (U, U, 6, 18), U bodies in the order of `slot`."""
    R, normal, stiffness = c.frame[n], c.frame[n, 0], c.stiffness[n]
    turned, stiff, damped = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    multiply(turned, R.T, stiffness)
    multiply(stiff, turned, R)  # -d force / d (J a), in world axes
    for i in range(3):
        for j in range(3):
            turned[i, j] *= c.drag[n, j]
    multiply(damped, turned, R)  # -d force / d velocity
    force, pushed = np.empty(3), np.empty(3)
    apply(force, R.T, c.force[n])
    apply(pushed, stiffness, c.pull[n])
    for i in range(3):
        pushed[i] = c.force[n, i] * c.log_weight_slope[n] - pushed[i]
    by_depth = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            by_depth[i, j] = (R[0, i] * pushed[0] + R[1, i] * pushed[1] + R[2, i] * pushed[2]) * normal[j]

    # Of each side the point's signed velocity, by the body's motion.
    at = np.zeros((2, 3, 6))
    spin_v, spin_a = np.zeros(3), np.zeros(3)
    relative_v, relative_a = np.zeros(3), np.zeros(3)
    moment = np.empty(3)
    cross(moment, c.point[n], force)
    for side in range(2):
        b = c.bodies[n, side]
        if b < 0:
            continue
        sign = 2.0 * side - 1.0
        for i in range(3):
            load[b, i] += sign * moment[i]
            load[b, 3 + i] += sign * force[i]
            spin_v[i] += sign * velocity[last[b], i]
            spin_a[i] += sign * acceleration[last[b], i]
            at[side, i, 3 + i] = sign
        set_skew(at[side, :, :3], c.point[n], -sign)
        for i in range(3):
            relative_v[i] += dot(at[side, i], velocity[last[b]])
            relative_a[i] += dot(at[side, i], acceleration[last[b]])
    twist, by_moved, some = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    set_skew(twist, spin_v, 1.0)
    multiply(by_moved, damped, twist)
    set_skew(twist, spin_a, 1.0)
    multiply(some, stiff, twist)
    add(by_moved, some)
    by_turned = np.empty((3, 3))
    set_skew(twist, relative_v, 1.0)
    multiply(by_turned, damped, twist)
    set_skew(twist, relative_a, 1.0)
    multiply(some, stiff, twist)
    add(by_turned, some)
    set_skew(twist, force, 1.0)
    add(by_turned, twist)

    world, part, turn, parts = np.empty((3, 18)), np.empty((3, 6)), np.empty((3, 6)), np.empty((6, 18))
    for by in range(2):
        if c.bodies[n, by] < 0:
            continue
        multiply(world[:, :6], by_depth, at[by])
        multiply(world[:, 6:12], damped, at[by])
        multiply(world[:, 12:], stiff, at[by])
        multiply(part, by_moved, c.moved[n, by])
        multiply(turn, by_turned, c.turned[n, by])
        for i in range(3):
            for j in range(6):
                world[i, j] -= part[i, j] + turn[i, j]
            for j in range(6, 18):
                world[i, j] = -world[i, j]
        multiply(part, twist, c.moved[n, by])
        for to in range(2):
            if c.bodies[n, to] < 0:
                continue
            multiply(parts, at[to].T, world)
            # The force keeps its direction while its point moves.
            for i in range(3):
                for j in range(6):
                    parts[i, j] -= (2.0 * to - 1.0) * part[i, j]
            first, second = slot[c.bodies[n, to]], slot[c.bodies[n, by]]
            add(wrench[first, second], parts)
            coupled[first, second] = True
