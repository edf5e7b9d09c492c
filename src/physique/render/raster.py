"""Pictures of triangles, fast: z-buffers in compiled loops.

Every pixel has four samples. Where all four lie on the same smooth piece of surface one
is shaded for all, at edges each is. The sun's shadow is a second z-buffer, seen from the sun; how
dark the floor is under a body comes from a third, seen from below.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter

from physique.compiled import compiled
from physique.render import daylight
from physique.render.camera import Camera
from physique.render.zbuffer import (
    SLANT,
    Array,
    Floats,
    Integers,
    Layer,
    Triangles,
    grid_view,
    pixels_of_a_metre,
    place,
    see,
    triangles,
)

Image = NDArray[np.uint8]

_SHADOW_CELL, _UNDER_CELL = 0.005, 0.015  # m, of the views from the sun and from below
_MOST_CELLS = 1024  # a side
_SHADOW_BLUR = 0.012  # m, of the shadow's rim on the floor
_UNDER_BLUR, _UNDER_FADE = 0.05, 0.15  # m: how far nearness darkens the floor, along it and above
_UNDER_DARK = 0.6  # part of the sky that a touching body hides
_BIAS = 0.012  # m, by which a surface stays out of its own shadow
_RIM = 0.012  # m, of a shadow on a body
_SMOOTH = 0.01  # m, depth within a pixel up to which one sample stands for all
#: Where a shadow on a body is tested: a sunflower's spiral covers a disc evenly.
_DISC: Array = np.array(
    [[np.sqrt((k + 0.5) / 9) * f(k * np.pi * (3.0 - 5.0**0.5)) for f in (np.cos, np.sin)] for k in range(9)]
)


class _View(NamedTuple):
    """The camera: eye (3,) m, axes (3, 3), and the pixels of a metre at a metre's distance."""

    eye: Array
    axes: Array
    scale: float


class _Lights(NamedTuple):
    """What the light of a point depends on, but for its surface.

    sun: (3,) unit. frame: (3, 3), axes of the sun's view, whose `grid_view` are grid and tall.
    shade: (n, n), the part of the sun that is hidden from the floor, on the sun's grid.
    below, hidden: the grid of the floor, and the part (n, n) of the sky that is hidden there.
    palette: see `_PALETTE`.
    """

    sun: Array
    frame: Array
    grid: Array
    tall: Floats
    shade: Floats
    below: Array
    hidden: Floats
    palette: Array


def draw(
    solid: Triangles,
    camera: Camera,
    size: tuple[int, int],
    *,
    ghost: Triangles | None = None,
    opacity: float = 0.4,
    sun: ArrayLike | None = None,
) -> Image:
    """Picture (h, w, 3) of triangles over the floor z = 0, `size` (w, h) pixels.

    ghost: triangles that are seen through, `opacity` of them, and cast no shadow.
    sun: (3,) direction towards the light; left out, it shines from the camera's upper left.
    """
    width, height = size
    towards = daylight.sun_of(camera) if sun is None else np.asarray(sun, dtype=float)
    towards = towards / np.linalg.norm(towards)
    body = see(solid, camera, size)
    veil = see(triangles([]) if ghost is None else ghost, camera, size)
    lights = _Lights(
        towards,
        *_shadow(solid.vertices, solid.faces, towards),
        *_under(solid.vertices, solid.faces),
        _PALETTE,
    )
    view = _View(np.array(camera.eye), camera.axes(), pixels_of_a_metre(camera, height))
    light = np.zeros((height, width, 3), dtype=np.float32)
    _shade(light, body, veil, opacity, view, lights)
    return (255.0 * np.sqrt(np.minimum(light, 1.0)) + 0.5).astype(np.uint8)


#: Rows of light: sky above and below, floor's two, sun, light of sky and of ground.
_PALETTE: Array = np.stack(
    [
        daylight.SKY_TOP**2,
        daylight.SKY_LOW**2,
        *daylight.FLOOR**2,
        daylight.SUN,
        daylight.SKY_LIGHT,
        daylight.GROUND_LIGHT,
    ]
)
_TILE, _FOG_NEAR, _FOG_FAR = daylight.TILE, *daylight.FOG
_SKY_BAND, _FILL = daylight.SKY_BAND, daylight.FILL


def _shadow(vertices: Array, faces: Integers, sun: Array) -> tuple[Array, Array, Floats, Floats]:
    """How the sun sees the solid: `frame`, `grid`, `tall` and `shade` of `_Lights`."""
    side = np.cross(sun, [1.0, 0.0, 0.0] if abs(sun[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    # A mirrored frame: faces that look at the sun go round in it as they do on a screen.
    frame = np.stack([side, np.cross(side, sun), sun])
    grid, tall = grid_view(vertices @ frame.T, faces, _SHADOW_CELL, _MOST_CELLS)
    covered = (tall > 0).astype(np.float32)
    return frame, grid, tall, gaussian_filter(covered, _SHADOW_BLUR / grid[2], truncate=2.5)


def _under(vertices: Array, faces: Integers) -> tuple[Array, Floats]:
    """How dark the solid's nearness makes the floor: `below` and `hidden` of `_Lights`."""
    points = vertices * [1.0, 1.0, -1.0]
    grid, tall = grid_view(points, faces, _UNDER_CELL, _MOST_CELLS, margin=3.0 * _UNDER_BLUR)
    height = np.maximum(-(tall.astype(float) + grid[3]), 0.0)
    near = np.where(tall > 0, np.exp(-height / _UNDER_FADE), 0.0).astype(np.float32)
    return grid, _UNDER_DARK * gaussian_filter(near, _UNDER_BLUR / grid[2], truncate=2.5)


@compiled
def _shade(light: Floats, solid: Layer, ghost: Layer, opacity: float, view: _View, lights: _Lights) -> None:
    """The light (h, w, 3) of each pixel, from its four samples."""
    base, over, total = np.zeros(3), np.zeros(3), np.zeros(3)
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            kind = _uniform(solid, 2 * row, 2 * column)
            veil = _uniform(ghost, 2 * row, 2 * column)
            if kind == 0 and veil == 0:  # sky or floor alone: its pattern is filtered already
                _background(total, column + 0.5, row + 0.5, light.shape, view, lights)
                for d in range(3):
                    light[row, column, d] = total[d]
                continue
            count = 1 if kind >= 0 and veil >= 0 else 4
            total[:] = 0.0
            for k in range(count):
                i, j = 2 * row + k // 2, 2 * column + k % 2
                shown = kind != 0 and solid.owner[i, j] >= 0
                shown = shown and _body(base, i, j, solid, view, lights, True)
                if not shown:
                    x, y = place(i, j, SLANT)
                    if count == 1:
                        x, y = 2.0 * column + 1.0, 2.0 * row + 1.0
                    _background(base, 0.5 * x, 0.5 * y, light.shape, view, lights)
                nearest = solid.depth[i, j] if kind != 0 else 0.0
                veiled = veil != 0 and ghost.depth[i, j] > nearest
                if veiled and _body(over, i, j, ghost, view, lights, False):
                    for d in range(3):
                        base[d] += opacity * (over[d] - base[d])
                for d in range(3):
                    total[d] += base[d]
            for d in range(3):
                light[row, column, d] = total[d] / count


@compiled
def _uniform(layer: Layer, row: int, column: int) -> int:
    """Of a pixel's four samples: 0 where they see nothing, 1 one smooth surface, -1 more."""
    if len(layer.depth) == 0:
        return 0
    least, most = np.inf, 0.0
    for i in range(row, row + 2):
        for j in range(column, column + 2):
            least, most = min(least, layer.depth[i, j]), max(most, layer.depth[i, j])
    if most == 0.0:
        return 0
    return 1 if least > 0.0 and 1.0 / least - 1.0 / most < _SMOOTH else -1


@compiled
def _body(
    out: Array, row: int, column: int, layer: Layer, view: _View, lights: _Lights, shaded: bool
) -> bool:
    """The light of the triangle that a sample sees; False where the floor hides it."""
    x, y = place(row, column, SLANT)
    i, j, k = layer.faces[layer.owner[row, column]]
    ax, ay, az = layer.screen[i]
    bx, by, bz = layer.screen[j]
    cx, cy, cz = layer.screen[k]
    # Linear on the screen, and in space once each corner counts by its nearness.
    a = az * ((cy - by) * (x - bx) - (cx - bx) * (y - by))
    b = bz * ((ay - cy) * (x - cx) - (ax - cx) * (y - cy))
    c = cz * ((by - ay) * (x - ax) - (bx - ax) * (y - ay))
    norm = 1.0 / (a + b + c)
    a, b, c = a * norm, b * norm, c * norm
    v, n = layer.vertices, layer.normals
    z = a * v[i, 2] + b * v[j, 2] + c * v[k, 2]
    if z < 0.0:
        return False
    x, y = a * v[i, 0] + b * v[j, 0] + c * v[k, 0], a * v[i, 1] + b * v[j, 1] + c * v[k, 1]
    nx, ny = a * n[i, 0] + b * n[j, 0] + c * n[k, 0], a * n[i, 1] + b * n[j, 1] + c * n[k, 1]
    nz = a * n[i, 2] + b * n[j, 2] + c * n[k, 2]
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / length, ny / length, nz / length
    facing = max(nx * lights.sun[0] + ny * lights.sun[1] + nz * lights.sun[2], 0.0)
    if shaded and facing > 0.0:
        facing *= 1.0 - _shadowed(x + _BIAS * nx, y + _BIAS * ny, z + _BIAS * nz, lights)
    ex, ey, ez = view.eye[0] - x, view.eye[1] - y, view.eye[2] - z
    away = (nx * ex + ny * ey + nz * ez) / np.sqrt(ex * ex + ey * ey + ez * ez)
    up, fill = 0.5 + 0.5 * nz, _FILL * max(away, 0.0)
    for d in range(3):
        colour = a * layer.colours[i, d] + b * layer.colours[j, d] + c * layer.colours[k, d]
        sun, sky, ground = lights.palette[4, d], lights.palette[5, d], lights.palette[6, d]
        out[d] = colour**2 * (ground + up * (sky - ground) + fill + facing * sun)
    return True


@compiled
def _shadowed(x: float, y: float, z: float, lights: _Lights) -> float:
    """The part of the sun that the solid hides from a point just off it."""
    across, along, height = _turned(lights.frame, x, y, z)
    cell = lights.grid[2]
    height += _BIAS - lights.grid[3]
    rows, columns = lights.tall.shape
    hidden = 0
    for k in range(len(_DISC)):
        column = int((across - lights.grid[0] + _RIM * _DISC[k, 0]) / cell)
        row = int((along - lights.grid[1] + _RIM * _DISC[k, 1]) / cell)
        if 0 <= row < rows and 0 <= column < columns and lights.tall[row, column] > height:
            hidden += 1
    return hidden / len(_DISC)


@compiled
def _background(
    out: Array, x: float, y: float, shape: tuple[int, int, int], view: _View, lights: _Lights
) -> None:
    """The light of floor and sky behind the point (x, y) of the picture, a pixel wide."""
    right, up = (x - 0.5 * shape[1]) / view.scale, (0.5 * shape[0] - y) / view.scale
    length = np.sqrt(right * right + up * up + 1.0)
    ray_x, ray_y, ray_z = (
        (right * view.axes[0, 0] + up * view.axes[1, 0] + view.axes[2, 0]) / length,
        (right * view.axes[0, 1] + up * view.axes[1, 1] + view.axes[2, 1]) / length,
        (right * view.axes[0, 2] + up * view.axes[1, 2] + view.axes[2, 2]) / length,
    )
    high = min(max(ray_z / _SKY_BAND, 0.0), 1.0)
    for d in range(3):
        out[d] = lights.palette[1, d] + high * (lights.palette[0, d] - lights.palette[1, d])
    if ray_z * view.eye[2] >= 0.0:
        return
    distance = -view.eye[2] / ray_z
    fog = min(max((distance - _FOG_NEAR) / (_FOG_FAR - _FOG_NEAR), 0.0), 1.0)
    clear = 1.0 - fog * fog * (3.0 - 2.0 * fog)
    if clear <= 0.0:
        return
    at_x, at_y = view.eye[0] + distance * ray_x, view.eye[1] + distance * ray_y
    across, along, _ = _turned(lights.frame, at_x, at_y, 0.0)
    sunlit = 1.0 - _lookup(lights.shade, lights.grid, across, along)
    open_sky = 1.0 - _lookup(lights.hidden, lights.below, at_x, at_y)
    slope, flat = 1.0 / max(abs(ray_z), 1e-3), 1.0 / np.sqrt(max(1.0 - ray_z * ray_z, 1e-12))
    width = distance / view.scale
    dark = 0.5 - 0.5 * (
        _stripes(at_x, width * (1.0 + abs(ray_x) * flat * (slope - 1.0)))
        * _stripes(at_y, width * (1.0 + abs(ray_y) * flat * (slope - 1.0)))
    )
    fill = _FILL * abs(ray_z)
    for d in range(3):
        colour = lights.palette[2, d] + dark * (lights.palette[3, d] - lights.palette[2, d])
        sky = lights.palette[5, d] * open_sky
        surface = colour * (sky + fill + sunlit * lights.sun[2] * lights.palette[4, d])
        out[d] += clear * (surface - out[d])


@compiled
def _turned(frame: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A point of the world in a frame (3, 3). Plain sums: products of matrices so small cost more
    in calls than in numbers."""
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


@compiled
def _lookup(values: Floats, grid: Array, x: float, y: float) -> float:
    """A grid's values between its cells' middles, 0 outside of it."""
    column, row = (x - grid[0]) / grid[2] - 0.5, (y - grid[1]) / grid[2] - 0.5
    j, i = int(np.floor(column)), int(np.floor(row))
    if i < 0 or j < 0 or i + 1 >= values.shape[0] or j + 1 >= values.shape[1]:
        return 0.0
    u, v = column - j, row - i
    upper = (1.0 - u) * values[i, j] + u * values[i, j + 1]
    lower = (1.0 - u) * values[i + 1, j] + u * values[i + 1, j + 1]
    return (1.0 - v) * upper + v * lower


@compiled
def _stripes(at: float, width: float) -> float:
    """Mean over `width` m of a pattern that is 1 in one tile and -1 in the next: a box filter, so
    that far squares melt into grey and do not flicker."""
    w, p = 0.5 * width / _TILE, 0.5 * at / _TILE
    return (_triangle(p - 0.5 * w) - _triangle(p + 0.5 * w)) / w


@compiled
def _triangle(x: float) -> float:
    return abs(x - np.floor(x) - 0.5)
