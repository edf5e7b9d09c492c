"""From a mesh to 22 primitives: capsules, boxes for the feet, ellipsoids for the hands (Eq. 10)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from physique.body.capsule_energy import BOXES, CAPSULES, ELLIPSOIDS, SIZES, SOFT, Energy, changed
from physique.body.mesh import BodyMesh
from physique.body.primitives import Primitive, signed_distance
from physique.body.segments import FLIP, SurfacePoints, is_symmetric, principal_axes, surface_points
from physique.skeleton import INDEX, JOINTS, MIRROR, PARENTS

Array = NDArray[np.float64]

#: How far a capsule's centre may move off its part's middle, in radii of the part's own capsule.
DRIFT = 0.5
TRUNK = ("pelvis", "spine1", "spine2", "spine3")
#: rad. A limb's principal direction may be off its bone by this much.
ASTRAY = np.radians(15.0)
#: Part of its own best capsule that a capsule keeps where Eq. 10, blind inside a neighbour, says
#: nothing: weight of the distance to it against that of the surface.
TETHER = 0.1


def fit_capsules(mesh: BodyMesh) -> tuple[Primitive, ...]:
    """One primitive a part, in the order of `skeleton.JOINTS` (section 3.3, Eq. 10).

    A capsule lies along its part's principal direction, half way along the part; radius and length
    minimise Eq. 10 over all parts together, started from each part's own best capsule. A symmetric
    mesh gives a symmetric result.
    """
    # Many small matrices: threads of the linear algebra library only get in each other's way.
    with threadpool_limits(limits=1, user_api="blas"):
        return _fit(mesh)


def _fit(mesh: BodyMesh) -> tuple[Primitive, ...]:
    surface = surface_points(mesh)
    own = [_part(surface, i) for i in range(len(JOINTS))]
    start = [
        _box(mesh, name, own)
        if name in BOXES
        else _ellipsoid(name, own[i])
        if name in ELLIPSOIDS
        else _capsule(mesh, name, own[i])
        for i, name in enumerate(JOINTS)
    ]
    symmetric = is_symmetric(mesh)
    if symmetric:
        start = _symmetric(start)
    fitted = _fit_together(start, mesh, surface, own)
    return tuple(_symmetric(fitted) if symmetric else fitted)


@dataclass(frozen=True)
class _Own:
    """A part's own surface points (N, 3) m and areas (N,) m2."""

    points: Array
    area: Array


def _part(surface: SurfacePoints, part: int) -> _Own:
    chosen = surface.part == part
    return _Own(surface.points[chosen], surface.area[chosen])


def _frame(axis: Array) -> Array:
    """Rotation (3, 3) whose third column is the axis."""
    x = np.cross([0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [0.0, 0.0, 1.0], axis)
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def _capsule(mesh: BodyMesh, name: str, own: _Own) -> Primitive:
    """The capsule that fits a part alone, along the principal direction that fits best.

    Short thick parts have no clear first direction, so more than one is tried. The trunk's is the
    one from side to side; a limb's must lie near its bone, or is the bone's; the collar's skin is
    an open saddle without any, so its capsule follows the bone.
    """
    axes = principal_axes(own.points, own.area)
    if name in TRUNK:
        across = mesh.joints[INDEX["left_hip"]] - mesh.joints[INDEX["right_hip"]]
        axes = axes[[np.abs(axes @ across).argmax()]]
    elif name.startswith(("left_", "right_")):
        bone = mesh.joints[PARENTS.index(INDEX[name])] - mesh.joints[INDEX[name]]
        bone = bone / np.linalg.norm(bone)
        near = np.abs(axes @ bone) > np.cos(ASTRAY)
        axes = np.array([bone, *([] if name.endswith("collar") else axes[near])])
    fits = [_capsule_along(name, own, axis) for axis in axes]
    return min(fits, key=lambda fit: fit[1])[0]


def _capsule_along(name: str, own: _Own, axis: Array) -> tuple[Primitive, float]:
    """The best capsule along an axis, through the middle of the part, and its cost."""
    R = _frame(axis)
    local = own.points @ R
    center = np.average(local, axis=0, weights=own.area)
    low, high = local[:, 2].min(), local[:, 2].max()
    center[2] = 0.5 * (low + high)
    across = np.linalg.norm(local[:, :2] - center[:2], axis=1)
    radius, extent = float(np.average(across, weights=own.area)), 0.5 * (high - low)
    first = Primitive(name, "capsule", np.array([radius, extent, 0.0]), R @ center, R)
    root_area = np.sqrt(own.area)

    def residual(x: Array) -> Array:
        return root_area * signed_distance(changed(first, x), own.points)

    x0 = np.array([radius, max(extent - radius, 0.01)])
    lower, upper = np.array([0.5 * radius, 1e-3]), np.array([across.max(), extent])
    x0 = np.clip(x0, lower, 0.99 * upper)
    fit = least_squares(residual, x0, bounds=(lower, upper), method="dogbox", xtol=1e-4)
    return changed(first, fit.x), float(fit.cost)


def _ellipsoid(name: str, own: _Own) -> Primitive:
    """The ellipsoid along a part's principal directions, near the one with the skin's variances."""
    centre = np.average(own.points, axis=0, weights=own.area)
    R = principal_axes(own.points, own.area)[::-1].T
    R = R * np.sign(np.linalg.det(R))
    # On a sphere of radius r each coordinate has variance r^2 / 3.
    local = (own.points - centre) @ R
    axes = np.sqrt(3.0 * np.average(local**2, axis=0, weights=own.area))

    def solid(x: Array) -> Primitive:
        return Primitive(name, "ellipsoid", axes * x, centre, R)

    def residual(x: Array) -> Array:
        return signed_distance(solid(x), own.points)

    fit = least_squares(
        residual, np.ones(3), bounds=(0.7, 1.2), method="dogbox", loss="soft_l1", f_scale=SOFT
    )
    return solid(fit.x)


def _box(mesh: BodyMesh, name: str, own: list[_Own]) -> Primitive:
    """A level box on the floor along the foot: heel to ball, or ball to toe tips.

    Its footprint is that of the sole; its top is the mean height of the part's upper side.
    """
    side = name.split("_")[0]
    foot = np.concatenate([own[INDEX[f"{side}_{p}"]].points for p in ("ankle", "foot")])
    area = np.concatenate([own[INDEX[f"{side}_{p}"]].area for p in ("ankle", "foot")])
    flat = foot * [1, 1, 0]
    forward = principal_axes(flat, area)[0]
    forward = forward * np.sign(forward[0])
    R = np.stack([forward, [-forward[1], forward[0], 0.0], [0.0, 0.0, 1.0]], axis=1)
    ball = float(mesh.joints[INDEX[f"{side}_foot"]] @ R[:, 0])
    local = foot @ R
    sole = local[local[:, 2] < 0.035]
    toes = name.endswith("_foot")
    x = (ball, float(sole[:, 0].max())) if toes else (float(sole[:, 0].min()), ball)
    strip = sole[(sole[:, 0] >= x[0]) & (sole[:, 0] <= x[1])]
    y = np.quantile(strip[:, 1], [0.02, 0.98])
    mine = own[INDEX[name]]
    here = mine.points @ R

    def box(top: float) -> Primitive:
        size = 0.5 * np.array([x[1] - x[0], y[1] - y[0], top])
        center = np.array([0.5 * sum(x), 0.5 * y.sum(), 0.5 * top])
        return Primitive(name, "box", size, R @ center, R)

    def residual(top: Array) -> Array:
        return np.sqrt(mine.area) * signed_distance(box(float(top[0])), mine.points)

    highest = float(here[:, 2].max())
    fit = least_squares(
        residual,
        [0.6 * highest],
        bounds=(0.2 * highest, highest),
        loss="soft_l1",
        f_scale=SOFT * np.sqrt(mine.area.mean()),
    )
    return box(float(fit.x[0]))


def _fit_together(
    start: list[Primitive], mesh: BodyMesh, surface: SurfacePoints, own: list[_Own]
) -> list[Primitive]:
    """Radii, half lengths and centres of all capsules that minimise Eq. 10 for the union."""
    energy = Energy(start, mesh, surface)
    x_start, low, high, tether = [], [], [], []
    for i in CAPSULES:
        r, half = start[i].size[:2]
        local = (own[i].points - start[i].center) @ start[i].R_world_from_part
        extent = np.abs(local[:, 2]).max()
        widest = np.linalg.norm(local[:, :2], axis=1).max()
        drift = np.full(3, DRIFT * r)
        x_start.append([r, half, 0.0, 0.0, 0.0])
        low.append([0.5 * r, 1e-4, *-drift])
        high.append([max(widest, 1.1 * r), max(extent, 1.1 * half), *drift])
        tether.append(np.full(SIZES, TETHER * np.sqrt(own[i].area.sum())))
    x0, lower, upper, pull = (np.concatenate(a) for a in (x_start, low, high, tether))

    def residual(x: Array) -> Array:
        return np.concatenate([energy.at(x)[0], pull * (x - x0)])

    def jacobian(x: Array) -> Array:
        return np.concatenate([energy.at(x)[1], np.diag(pull)])

    fit = least_squares(
        residual,
        x0,
        jacobian,
        bounds=(lower, upper),
        method="dogbox",
        loss="soft_l1",
        f_scale=energy.soft,
        max_nfev=20,
        ftol=1e-3,
        xtol=1e-4,
    )
    return energy.solids(fit.x)


def _symmetric(solids: list[Primitive]) -> list[Primitive]:
    """Each primitive averaged with the mirror image of its partner."""
    result = list(solids)
    mirror = np.diag(FLIP)
    for i, j in enumerate(MIRROR):
        a, b = solids[i], solids[j]
        size, center = 0.5 * (a.size + b.size), 0.5 * (a.center + b.center * FLIP)
        if i < j:
            # A reflected frame is left-handed; turning one axis round makes it a rotation again.
            turned = mirror @ a.R_world_from_part @ np.diag([1.0, -1.0, 1.0])
            result[i] = replace(a, size=size, center=center)
            result[j] = replace(b, size=size, center=center * FLIP, R_world_from_part=turned)
        elif i == j:
            axis = a.R_world_from_part[:, 2]
            axis = np.array([0.0, 1.0, 0.0]) if abs(axis[1]) > 0.7 else axis * [1, 0, 1]
            R = _frame(axis / np.linalg.norm(axis))
            result[i] = replace(a, center=center, R_world_from_part=R)
    return result
