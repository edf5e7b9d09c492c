"""Pictures of MuJoCo models by ray casting: no OpenGL, no display, no GPU.

`mj_multiRay` finds what each pixel sees; the rest is a little light: a sun with soft shadows, a
sky, and the darkness where things come close. Colours are squares of what is stored (a gamma of
2) while light is added up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from physique.render.camera import Camera
from physique.render.daylight import (
    FILL,
    FLOOR,
    FOG,
    GROUND_LIGHT,
    SKY_BAND,
    SKY_LIGHT,
    SKY_LOW,
    SKY_TOP,
    SUN,
    TILE,
    sun_of,
)

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

FAR = 200.0  # m
_SUN_DISTANCE, _SUN_RADIUS = 40.0, 1.2  # m
_PENUMBRA = 0.1  # m, half the width of the soft rim of a shadow, at most
_PIECE = 4096  # rays
_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
_ROUNDED = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE),
    int(mujoco.mjtGeom.mjGEOM_CAPSULE),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER),
    int(mujoco.mjtGeom.mjGEOM_BOX),
}


@dataclass(frozen=True)
class Layer:
    """A model in one pose.

    data: with kinematics computed. colours: (ngeom, 3) in 0 to 1; planes have the floor's.
    smooth: from points (n, 3), their geoms (n,) and the surface's normals (n, 3) there, the
        normals to shade with.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    colours: Array
    smooth: Callable[[Array, NDArray[np.int32], Array], Array] | None = None


@dataclass(frozen=True)
class _Hits:
    """What n rays meet first."""

    layer: NDArray[np.int32]  # (n,)
    geom: NDArray[np.int32]  # (n,), -1 for nothing
    distance: Array  # (n,) m, `FAR` for nothing
    normal: Array  # (n, 3)


@dataclass(frozen=True)
class _Scene:
    """What pixels share.

    sun: (3,) unit, towards the sun. across: (2, 3), two directions at right angles to it.
    spheres: (k, 4) centre and radius, stand-ins for all bodies; owners: (k,) identity of each.
    low, high: (3,) of a box outside of which bodies and their nearness make no difference.
    shade: (n, n) bool over the plane `across`, in cells of side `cell` from `corner` (2,): where
        the bodies lie as the sun sees them. Outside of it nothing is in shadow.
    """

    layers: tuple[Layer, ...]
    sun: Array
    across: Array
    spheres: NDArray[np.float32]
    owners: NDArray[np.int64]
    low: Array
    high: Array
    shade: NDArray[np.bool_]
    corner: Array
    cell: float


def cast(layers: Sequence[Layer], camera: Camera, size: tuple[int, int], sun: Array | None = None) -> Image:
    """Picture (h, w, 3) of the layers together, `size` (w, h) pixels.

    sun: (3,) direction towards the light; left out, it shines from the upper left of the camera.
    """
    width, height = size
    scene = _make_scene(tuple(layers), sun_of(camera) if sun is None else np.asarray(sun, float))
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    pixels = np.stack([column.ravel(), row.ravel()], axis=1)
    light, identity, lit = _see_all(scene, camera, pixels, size, 1.0)
    edges = _edges(identity.reshape(height, width), lit.reshape(height, width))
    # Only where neighbours differ are more rays needed: four, on a rotated grid, and the first.
    offsets = np.array([[-0.125, -0.375], [0.375, -0.125], [0.125, 0.375], [-0.375, 0.125]])
    many = (pixels[edges][None] + offsets[:, None]).reshape(-1, 2)
    more, _, _ = _see_all(scene, camera, many, size, 0.5)
    light[edges] = 0.2 * light[edges] + 0.8 * more.reshape(len(offsets), -1, 3).mean(0)
    stored = np.sqrt(np.clip(light, 0.0, 1.0))
    return np.rint(stored * 255.0).astype(np.uint8).reshape(height, width, 3)


def _make_scene(layers: tuple[Layer, ...], sun: Array) -> _Scene:
    sun = sun / np.linalg.norm(sun)
    side = np.cross(sun, [1.0, 0.0, 0.0] if abs(sun[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    across = np.stack([side, np.cross(sun, side)])
    spheres: list[list[float]] = []
    owners: list[int] = []
    covers: list[list[float]] = []  # spheres that hold all of every geom
    for index, layer in enumerate(layers):
        model, data = layer.model, layer.data
        for geom in np.flatnonzero(model.geom_type != _PLANE):
            R = data.geom_xmat[geom].reshape(3, 3)
            half = model.geom_aabb[geom, 3:]
            middle = data.geom_xpos[geom] + R @ model.geom_aabb[geom, :3]
            if model.geom_type[geom] not in _ROUNDED:
                covers.append([*middle, float(np.linalg.norm(half))])
                continue
            long = int(np.argmax(half))
            thick = np.delete(half, long)
            radius = float(thick.mean())
            count = int(np.clip(np.rint(half[long] / radius), 2, 5))
            reach = max(float(half[long]) - radius, 0.0)
            cover = float(np.hypot(np.linalg.norm(thick), max(radius, reach / (count - 1))))
            for along in np.linspace(-reach, reach, count if reach > 0.1 * radius else 1):
                at = middle + along * R[:, long]
                spheres.append([*at, radius])
                covers.append([*at, cover])
                owners.append(int(_identity(geom, index)))
    cover_all = np.array(covers).reshape(-1, 4)
    at, r = cover_all[:, :3], cover_all[:, 3:]
    shade, corner, cell = _shade(at @ across.T, r[:, 0] + _PENUMBRA)
    return _Scene(
        layers,
        sun,
        across,
        np.array(spheres, dtype=np.float32).reshape(-1, 4),
        np.array(owners, dtype=np.int64),
        (at - r).min(0, initial=np.inf) - 0.5,
        (at + r).max(0, initial=-np.inf) + 0.5,
        shade,
        corner,
        cell,
    )


def _shade(at: Array, radius: Array) -> tuple[NDArray[np.bool_], Array, float]:
    """Discs (k, 2), (k,) drawn, with a little to spare, on a grid: `_Scene.shade`, corner, cell."""
    if len(at) == 0:
        return np.zeros((1, 1), dtype=bool), np.zeros(2), 1.0
    corner = (at - radius[:, None]).min(0)
    cell = float(((at + radius[:, None]).max(0) - corner).max()) / 80.0
    x = corner[0] + (np.arange(81) + 0.5) * cell
    y = corner[1] + (np.arange(81) + 0.5) * cell
    distance = np.hypot(at[:, 0, None, None] - x[:, None], at[:, 1, None, None] - y)
    return (distance < (radius + cell)[:, None, None]).any(0), corner, cell


def _identity(geom: ArrayLike, layer: ArrayLike) -> NDArray[np.int64]:
    """One number for a geom of a layer."""
    return np.asarray(geom, dtype=np.int64) * 64 + np.asarray(layer, dtype=np.int64)


def _trace(layers: Sequence[Layer], origin: Array, directions: Array, *, normals: bool = True) -> _Hits:
    """First hits of rays from one point along unit directions (n, 3)."""
    n = len(directions)
    vectors = np.ascontiguousarray(directions).ravel()
    best: _Hits | None = None
    for index, layer in enumerate(layers):
        geom, distance = np.empty(n, np.int32), np.empty(n)
        normal = np.zeros((n, 3))
        mujoco.mj_multiRay(
            layer.model,
            layer.data,
            origin,
            vectors,
            None,
            True,
            -1,
            geom,
            distance,
            normal.ravel() if normals else None,
            n,
            FAR,
        )
        distance[geom < 0] = FAR
        if best is None:
            best = _Hits(np.zeros(n, np.int32), geom, distance, normal)
            continue
        nearer = distance < best.distance
        best.layer[nearer], best.geom[nearer] = index, geom[nearer]
        best.distance[nearer], best.normal[nearer] = distance[nearer], normal[nearer]
    assert best is not None
    return best


def _see_all(
    scene: _Scene, camera: Camera, pixels: Array, size: tuple[int, int], footprint: float
) -> tuple[Array, NDArray[np.int64], Array]:
    """`_see` in pieces so small that arrays reuse memory: twice as fast as one large piece."""
    pieces = [
        _see(scene, camera, pixels[start : start + _PIECE], size, footprint)
        for start in range(0, max(len(pixels), 1), _PIECE)
    ]
    light, identity, lit = (np.concatenate(parts) for parts in zip(*pieces))
    return light, identity, lit


def _see(
    scene: _Scene, camera: Camera, pixels: Array, size: tuple[int, int], footprint: float
) -> tuple[Array, NDArray[np.int64], Array]:
    """What arrives at pixels (n, 2), each `footprint` pixels wide.

    Returns the light (n, 3), the identity (n,) of what is seen, and the part (n,) of the sun that
    shines on it.
    """
    rays = camera.rays(pixels, size)
    eye = np.array(camera.eye)
    hits = _trace(scene.layers, eye, rays)
    light = _sky(rays)
    lit_all = np.ones(len(rays))
    seen = np.flatnonzero(hits.geom >= 0)
    rays, distance, normal = rays[seen], hits.distance[seen], hits.normal[seen]
    identity = _identity(hits.geom[seen], hits.layer[seen])
    points = eye + distance[:, None] * rays
    _smooth(scene.layers, hits.layer[seen], hits.geom[seen], points, normal)
    pixel = footprint * 2.0 * np.tan(np.radians(camera.fov) / 2.0) / size[1]
    colour, is_floor = _colours(
        scene.layers, hits.layer[seen], hits.geom[seen], points, rays, pixel * distance
    )

    near = np.flatnonzero(np.all((points >= scene.low) & (points <= scene.high), axis=1))
    openness = np.ones(len(seen))
    openness[near] = _openness(scene, points[near], normal[near], identity[near])
    facing = np.maximum(normal @ scene.sun, 0.0)
    lit = np.ones(len(seen))
    cell = np.floor((points @ scene.across.T - scene.corner) / scene.cell).astype(np.int64)
    cell = np.clip(cell, 0, len(scene.shade) - 1)  # the outermost cells are empty
    dim = np.flatnonzero(scene.shade[cell[:, 0], cell[:, 1]] & (facing > 0))
    lit[dim] = _sunlit(scene, points[dim] + 1e-3 * normal[dim])

    up = 0.5 + 0.5 * normal[:, 2:]
    ambient = (GROUND_LIGHT + up * (SKY_LIGHT - GROUND_LIGHT)) * openness[:, None]
    fill = FILL * np.maximum(-np.einsum("ij,ij->i", normal, rays), 0.0)
    surface = colour * (ambient + fill[:, None] + (lit * facing)[:, None] * SUN)
    fog = np.clip((distance - FOG[0]) / (FOG[1] - FOG[0]), 0.0, 1.0) * is_floor
    light[seen] += (1.0 - fog * fog * (3.0 - 2.0 * fog))[:, None] * (surface - light[seen])
    lit_all[seen] = lit
    # Where the floor has faded into the sky there is no edge between them.
    identity_all = np.full(len(light), -1)
    identity_all[seen] = np.where(is_floor, -1 - (distance < FOG[1]), identity)
    return light, identity_all, lit_all


def _sky(rays: Array) -> Array:
    height = np.clip(rays[:, 2:] / SKY_BAND, 0.0, 1.0)
    return SKY_LOW**2 * (1.0 - height) + SKY_TOP**2 * height


def _smooth(
    layers: Sequence[Layer], layer: NDArray[np.int32], geom: NDArray[np.int32], points: Array, normal: Array
) -> None:
    """Put in place of the normals (n, 3) those that layers have of their own."""
    for index, one in enumerate(layers):
        if one.smooth is not None:
            mine = np.flatnonzero(layer == index)
            normal[mine] = one.smooth(points[mine], geom[mine], normal[mine])


def _colours(
    layers: Sequence[Layer],
    layer: NDArray[np.int32],
    geom: NDArray[np.int32],
    points: Array,
    rays: Array,
    width: Array,
) -> tuple[Array, NDArray[np.bool_]]:
    """Reflectance (n, 3) at points (n, 3) that rays (n, 3) see, and which of them are floor."""
    colour = np.empty((len(points), 3))
    is_floor = np.zeros(len(points), dtype=bool)
    for index, one in enumerate(layers):
        mine = layer == index
        colour[mine] = one.colours[geom[mine]] ** 2
        for plane in np.flatnonzero(one.model.geom_type == _PLANE):
            on = np.flatnonzero(mine & (geom == plane))
            R = one.data.geom_xmat[plane].reshape(3, 3)
            local = (points[on] - one.data.geom_xpos[plane]) @ R
            share = _checker(local[:, :2], rays[on] @ R, width[on])
            colour[on] = FLOOR[0] ** 2 + share[:, None] * (FLOOR[1] ** 2 - FLOOR[0] ** 2)
            is_floor[on] = True
    return colour, is_floor


def _checker(at: Array, rays: Array, width: Array) -> Array:
    """Share (n,) of dark squares in a pixel of `width` (n,) m round points (n, 2) of the floor.

    A box filter as wide as the pixel's footprint, which is stretched along the view: the
    integral of the pattern is known, so far squares melt into grey and do not flicker.
    """
    slope = 1.0 / np.maximum(np.abs(rays[:, 2]), 1e-3)
    flat = 1.0 / np.sqrt(np.maximum(rays[:, 0] ** 2 + rays[:, 1] ** 2, 1e-12))
    share = np.full(len(at), -0.5)
    for axis in (0, 1):
        stretch = 1.0 + np.abs(rays[:, axis]) * flat * (slope - 1.0)
        w = 0.5 * width * stretch / TILE  # in periods of the pattern, which are two tiles
        p = at[:, axis] * (0.5 / TILE)
        share *= (_triangle(p - 0.5 * w) - _triangle(p + 0.5 * w)) / w
    return 0.5 + share


def _triangle(x: Array) -> Array:
    return np.abs(x - np.floor(x) - 0.5)


def _sunlit(scene: _Scene, points: Array) -> Array:
    """Part (n,) of the sun's disc that points (n, 3) see."""
    seen = sum((_visible(scene, points, k) for k in (1, 3, 5)), start=np.zeros(len(points)))
    # Where three spots on the disc agree, the others would too: only the rims want more.
    rim = np.flatnonzero((seen > 0) & (seen < 3))
    more = sum((_visible(scene, points[rim], k) for k in (0, 2, 4)), start=seen[rim])
    seen = seen / 3.0
    seen[rim] = more / 6.0
    return seen


def _visible(scene: _Scene, points: Array, spot: int) -> Array:
    """1 where points (n, 3) see one of the sun's six spots, 0 where not."""
    # A sunflower's spiral covers a disc evenly.
    radius, turn = _SUN_RADIUS * np.sqrt((spot + 0.5) / 6.0), spot * np.pi * (3.0 - 5.0**0.5)
    offset = radius * (np.cos(turn) * scene.across[0] + np.sin(turn) * scene.across[1])
    source = 0.5 * (scene.low + scene.high) + _SUN_DISTANCE * scene.sun + offset
    rays = points - source
    distance = np.sqrt(np.einsum("ij,ij->i", rays, rays))
    hits = _trace(scene.layers, source, rays / distance[:, None], normals=False)
    return (hits.distance > distance - 2e-3).astype(float)


def _openness(scene: _Scene, points: Array, normals: Array, identity: NDArray[np.int64]) -> Array:
    """Part (n,) of the sky that points see past the bodies' stand-in spheres.

    A sphere of radius r at distance d, seen at an angle t from the normal, hides cos(t) r^2 / d^2.
    """
    open_sky = np.ones(len(points))
    if len(scene.spheres) == 0:
        return open_sky
    middle = 0.5 * (scene.low + scene.high)
    c = scene.spheres[:, :3] - middle.astype(np.float32)
    r2 = scene.spheres[:, 3] ** 2
    step = max(24_000 // len(c), 1)  # again: arrays small enough to reuse memory
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        p, n = (points[part] - middle).astype(np.float32), normals[part].astype(np.float32)
        d2 = np.maximum((p * p).sum(1)[:, None] + (c * c).sum(1) - 2.0 * (p @ c.T), r2)
        hidden = (n @ c.T - (n * p).sum(1)[:, None]) * (r2 / (d2 * np.sqrt(d2)))
        hidden[identity[part, None] == scene.owners] = 0.0
        open_sky[part] = np.prod(1.0 - 0.75 * np.clip(hidden, 0.0, 1.0), axis=1)
    return open_sky


def _edges(identity: NDArray[np.int64], lit: Array) -> NDArray[np.int64]:
    """Pixels of a picture (h, w) that differ from a neighbour in what they see or in shadow."""
    edge = np.zeros(identity.shape, dtype=bool)
    for axis in (0, 1):
        step = (np.diff(identity, axis=axis) != 0) | (np.abs(np.diff(lit, axis=axis)) > 0.1)
        first = (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        second = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        edge[first] |= step
        edge[second] |= step
    return np.flatnonzero(edge)
