"""Derivatives of contact forces, in closed form, for the contacts of many states at once.

A contact's force is minus the gradient of a smooth function of the residual y = J a - a_ref,
with a weight and an a_ref that depend on depth and sliding velocity (MuJoCo's manual, "Constraint
model"). Under `integrator="discrete"` the spring-damper of a row is evaluated at the end of the
step: with s = 1 + h b + h^2 k d,

    weight = s d / (1 - d) / A,    a_ref = -(b v + k d (r + h v)) / s,

where d(r) is the impedance. What is neglected: the change of A, and the turn of the contact's
normal where two parts of the body touch.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.simulation import spatial
from physique.simulation.smooth import Motion, Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class Contacts:
    """C contacts of T states; frames (C,) says of which state.

    point (C, 3) m, about the states' common point. frame (C, 3, 3): rows are the normal, from the
    first part to the second, and two tangents. bodies (C, 2), -1 for the world. lever (C, 2) m:
    from the point along the normal to the centre of each part's rounding; the contact's point
    moves with those centres. friction, mu (C,). residual (C, 3) = J a - a_ref. weight (C, 3).
    log_weight_slope (C,): d ln weight / d depth. pull (C, 3), drag (C, 3): -d a_ref / d depth and
    -d a_ref / d velocity, row by row.
    """

    frames: NDArray[np.int64]
    point: Array
    frame: Array
    bodies: NDArray[np.int64]
    lever: Array
    friction: Array
    mu: Array
    residual: Array
    weight: Array
    log_weight_slope: Array
    pull: Array
    drag: Array


#: What is read of each contact and of each constraint row.
_FIELDS = ("pos", "frame", "geom", "dist", "friction", "mu")
_ROWS = ("efc_KBIP", "efc_pos", "efc_margin", "efc_vel", "efc_aref", "efc_D")


def read(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Array] | None:
    """What `join` needs of one state after `mj_forward`; None without contacts."""
    if data.ncon == 0:
        return None
    contact = data.contact
    use = np.flatnonzero(contact.efc_address >= 0)
    rows = contact.efc_address[use]
    acceleration = np.zeros(data.nefc)
    mujoco.mj_mulJacVec(model, data, acceleration, data.qacc)
    out = {name: getattr(contact, name)[use] for name in _FIELDS}
    out["pos"] = out["pos"] - data.subtree_com[1]
    # Three rows a contact: the normal, then two tangents.
    rows = (rows[:, None] + np.arange(3)).ravel()
    for name in _ROWS:
        out[name] = getattr(data, name).reshape(data.nefc, -1)[rows]
    out["acceleration"] = acceleration[rows]
    return out


def join(model: mujoco.MjModel, parts: list[dict[str, Array] | None]) -> Contacts | None:
    """The contacts of T states as one; None if there are none."""
    found = [(t, part) for t, part in enumerate(parts) if part is not None]
    if not found:
        return None
    raw = {name: np.concatenate([p[name] for _, p in found]) for name in found[0][1]}
    position, margin, velocity, a_ref, weight, acceleration = (
        raw[name].reshape(-1, 3)
        for name in ("efc_pos", "efc_margin", "efc_vel", "efc_aref", "efc_D", "acceleration")
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
    return Contacts(
        frames=np.concatenate([np.full(len(p["mu"]), t) for t, p in found]),
        point=raw["pos"],
        frame=raw["frame"].reshape(-1, 3, 3),
        bodies=model.geom_bodyid[raw["geom"]].astype(np.int64) - 1,
        lever=_levers(model, raw["geom"], raw["dist"]),
        friction=raw["friction"][:, 0],
        mu=raw["mu"],
        residual=acceleration - a_ref,
        weight=weight,
        log_weight_slope=slope / (d * (1 - d)) + s_slope / s,
        pull=pull,
        drag=drag,
    )


def _levers(model: mujoco.MjModel, geoms: NDArray[np.int32], distance: Array) -> Array:
    """Signed distance along the normal from the contact point to each geom's rounding centre.

    A capsule's surface point is always one radius from its axis; of boxes it is a corner, the
    floor does not move. The point itself lies midway between the surfaces.
    """
    kind = model.geom_type[geoms]
    radius = np.where(kind == mujoco.mjtGeom.mjGEOM_CAPSULE, model.geom_size[geoms, 0], 0.0)
    return (radius + distance[:, None] / 2) * np.array([-1.0, 1.0])


def force_and_stiffness(c: Contacts) -> tuple[Array, Array]:
    """Forces (C, 3) in contact frames and -d force / d residual (C, 3, 3), positive semidefinite.

    The elliptic cone of MuJoCo's manual: nothing above the dual cone, a quadratic below the
    polar cone, the squared distance from the cone between.
    """
    scale = np.stack([c.mu, c.friction, c.friction], axis=-1)
    u = c.residual * scale
    normal, slip = u[:, 0], np.linalg.norm(u[:, 1:], axis=1)
    free = normal >= c.mu * slip
    stick = ~free & (c.mu * normal + slip <= 0)
    slide = ~free & ~stick
    force = np.where(stick[:, None], -c.weight * c.residual, 0.0)
    stiffness = np.zeros((len(c.mu), 3, 3))
    index = np.arange(3)
    stiffness[:, index, index] = np.where(stick[:, None], c.weight, 0.0)

    safe = np.where(slide, slip, 1.0)
    direction = u[:, 1:] / safe[:, None]
    gradient = np.concatenate([np.ones((len(c.mu), 1)), -c.mu[:, None] * direction], axis=1)
    over = normal - c.mu * slip
    weight = c.weight[:, 0] / (c.mu**2 * (1 + c.mu**2))
    slide_force = -(weight * over)[:, None] * gradient * scale
    curve = gradient[:, :, None] * gradient[:, None, :]
    turn = np.eye(2) - direction[:, :, None] * direction[:, None, :]
    curve[:, 1:, 1:] -= (over * c.mu / safe)[:, None, None] * turn
    slide_stiffness = weight[:, None, None] * curve * scale[:, :, None] * scale[:, None, :]
    force[slide] = slide_force[slide]
    stiffness[slide] = slide_stiffness[slide]
    return force, stiffness


@dataclass
class _Relative:
    """How the second part moves against the first at each of C contacts, in world axes.

    By n coordinates: velocity, turn (angular velocity) and moved (of the contact's point), each
    (C, 3, n). spin (2, C, 3) and rate (2, C, 3, n): relative angular velocity, and the derivative
    by q of the relative velocity of two material points, for the generalised velocities v and a.
    """

    velocity: Array
    turn: Array
    moved: Array
    spin: Array
    rate: Array


def derivatives(
    tree: Tree, m: Motion, c: Contacts, v: Array, a: Array
) -> tuple[Array, Array, Array]:
    """d (J^T f) by q, v and a, each (T, 56, 56), row by torque, at v (T, 56), a (T, 56)."""
    frames, nv = v.shape
    t, R = c.frames, c.frame
    force, stiffness = force_and_stiffness(c)
    world_force = np.einsum("cri,cr->ci", R, force)
    # Mostly the feet touch something: leave out the coordinates that no contact depends on.
    used = np.flatnonzero(tree.supports[np.unique(c.bodies[c.bodies >= 0])].any(axis=0))
    relative = _relative(tree, m, c, (v, a), used)
    for rate, spin in zip(relative.rate, relative.spin):
        rate += spatial.skew(spin) @ relative.moved

    J = R @ relative.velocity
    depth = J[:, :1]
    rate_v, rate_a = relative.rate
    dy = R @ rate_a + c.drag[..., None] * (R @ rate_v) + c.pull[..., None] * depth
    by_q = (force * c.log_weight_slope[:, None])[..., None] * depth - stiffness @ dy
    by_v = -stiffness @ (c.drag[..., None] * J)
    by_a = -stiffness @ J
    by_point = -spatial.skew(world_force) @ relative.moved
    parts = np.concatenate([by_q, by_v, by_a], axis=-1)
    n = len(used)
    total = np.zeros((frames, n, 3 * n))
    ends = np.searchsorted(t, np.arange(frames + 1))
    for frame, (i, j) in enumerate(itertools.pairwise(ends)):
        if i < j:
            total[frame] = J[i:j].reshape(-1, n).T @ parts[i:j].reshape(-1, 3 * n)
            total[frame, :, :n] += relative.turn[i:j].reshape(-1, n).T @ by_point[i:j].reshape(
                -1, n
            )
    out = np.zeros((3, frames, nv, nv))
    block = np.ix_(np.arange(frames), used, used)
    for k in range(3):
        out[k][block] = total[..., k * n : (k + 1) * n]
    # The axes that the forces work on move too.
    load = np.zeros((frames, len(tree.supports), 6))
    wrench = np.concatenate([spatial.cross(c.point, world_force), world_force], axis=1)
    for side, sign in ((0, -1.0), (1, 1.0)):
        on = c.bodies[:, side] >= 0
        np.add.at(load, (t[on], c.bodies[on, side]), sign * wrench[on])
    below = tree.supports.T @ load
    out[0] += spatial.force_cross(m.axes, below) @ np.swapaxes(m.axes, 1, 2) * tree.turned_by
    return out[0], out[1], out[2]


def _relative(
    tree: Tree, m: Motion, c: Contacts, velocities: tuple[Array, Array], used: Index
) -> _Relative:
    count, n = len(c.frames), len(used)
    relative = _Relative(
        velocity=np.zeros((count, 3, n)),
        turn=np.zeros((count, 3, n)),
        moved=np.zeros((count, 3, n)),
        spin=np.zeros((2, count, 3)),
        rate=np.zeros((2, count, 3, n)),
    )
    own = [m.axes * x[..., None] for x in velocities]
    before = [(tree.parents[used] @ x) for x in own]
    bodies = (m.velocity, tree.supports @ own[1])
    normal = c.frame[:, 0]
    for side, sign in ((0, -1.0), (1, 1.0)):
        on = np.flatnonzero(c.bodies[:, side] >= 0)
        b, t = c.bodies[on, side], c.frames[on]
        axes = m.axes[t][:, used] * tree.supports[b][:, used, None]  # (len(on), n, 6)
        point = c.point[on][:, None]
        center = point + c.lever[on, side][:, None, None] * normal[on][:, None]
        relative.velocity[on] += sign * _at(axes, point)
        relative.turn[on] += sign * np.swapaxes(axes[..., :3], 1, 2)
        relative.moved[on] += 0.5 * _at(axes, center)
        for i in range(2):
            body = bodies[i][t, b]
            change = spatial.motion_cross(axes, body[:, None] - before[i][t])
            relative.rate[i][on] += sign * _at(change, point)
            relative.spin[i][on] += sign * body[:, :3]
    # On the floor the point stays midway between the surfaces: it moves sideways with the part.
    floor = np.flatnonzero((c.bodies < 0).any(axis=1))
    n_floor = normal[floor]
    along = np.einsum("ci,cik->ck", n_floor, relative.moved[floor])
    relative.moved[floor] = 2.0 * relative.moved[floor] - n_floor[:, :, None] * along[:, None]
    return relative


def _at(motions: Array, point: Array) -> Array:
    """Velocities (C, 3, n) of points (C, 1, 3) under spatial motions (C, n, 6)."""
    moving = spatial.cross(motions[..., :3], point)
    moving += motions[..., 3:]
    return np.swapaxes(moving, 1, 2)
