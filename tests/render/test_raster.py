"""The rasteriser sees what rays meet, and hides, shades and veils as it should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from physique.body.primitives import Primitive, primitive_mesh
from physique.render import daylight
from physique.render.camera import Camera
from physique.render.raster import draw
from physique.render.scene import make_actor, stage
from physique.render.skin import skin_vertices
from physique.render.surface import capsule_surface, skin_surface
from physique.render.zbuffer import SLANT, Triangles, place, see, triangles
from physique.runs.run import Run

SIZE = (240, 180)
RED, BLUE = (0.85, 0.25, 0.2), (0.2, 0.3, 0.85)


def square(corners: list[list[float]], rgb: tuple[float, float, float]) -> Triangles:
    """Two triangles, seen from the side from which the corners go round counter-clockwise."""
    v = np.array(corners, dtype=float)
    return triangles([(v, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.tile(rgb, (4, 1)))])


def wall(x: float, rgb: tuple[float, float, float], half: float = 0.5) -> Triangles:
    """A wall that faces +x, one metre high."""
    return square([[x, -half, 0], [x, half, 0], [x, half, 1], [x, -half, 1]], rgb)


def together(*parts: Triangles) -> Triangles:
    return triangles([(p.vertices, p.faces, p.colours) for p in parts])


def colour_at(image: NDArray[np.uint8], camera: Camera, point: list[float]) -> NDArray[np.int64]:
    column, row = np.floor(camera.project(point, SIZE)).astype(int)
    return image[row, column].astype(int)


def is_red(colour: NDArray[np.int64]) -> bool:
    return bool(colour[0] - colour[2] > 60)


FRONT = Camera.look_at([0, 0, 0.5], distance=4, azimuth=0, elevation=10)


def rays(camera: Camera, pixels: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    """Directions (..., 3), 1 along the view, through pixels (..., 2) of a picture (w, h)."""
    up = np.tan(np.radians(camera.fov) / 2) * (1 - 2 * pixels[..., 1] / size[1])
    right = np.tan(np.radians(camera.fov) / 2) * (2 * pixels[..., 0] - size[0]) / size[1]
    axes = camera.axes()
    return np.asarray(right[..., None] * axes[0] + up[..., None] * axes[1] + axes[2])


def first_hits(
    what: Triangles, eye: NDArray[np.float64], along: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Where rays (n, 3) from the eye first meet a triangle from before: distances, triangles, -1
    for none, and how safely: the least barycentric number, or lead in distance, of any near it."""
    a, b, c = (what.vertices[what.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    facing = along @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = ((a - eye) * normal).sum(axis=1) / facing
    at = eye + t[..., None] * along[:, None]
    area = (normal**2).sum(axis=1)
    parts = [(np.cross(q - p, at - p) * normal).sum(axis=2) / area for p, q in ((a, b), (b, c), (c, a))]
    inside = np.min(parts, axis=0)
    t = np.where((facing < 0) & (t > 0), t, np.inf)
    met = np.where(inside >= 0, t, np.inf)
    order = np.sort(np.concatenate([met, np.full((len(along), 1), 1e3)], axis=1), axis=1)
    nearest = met.argmin(axis=1)
    found = np.isfinite(met.min(axis=1))
    # An edge before what is met could be counted either way.
    before = t <= order[:, :1] + 1e-3
    sure = np.where(before, np.abs(inside), np.inf).min(axis=1)
    lead = np.where(found, order[:, 1] - order[:, 0], np.inf) if order.shape[1] > 1 else np.inf
    return met.min(axis=1), np.where(found, nearest, -1), np.minimum(sure, lead)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_samples_see_the_triangles_that_rays_meet(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = (16, 12)
    v = rng.uniform([-1, -1, -0.3], [1, 1, 1.3], (18, 3))
    what = triangles([(v, np.arange(18, dtype=np.int32).reshape(6, 3), np.ones((18, 3)))])
    camera = Camera.look_at([0, 0, 0.5], distance=4, azimuth=rng.uniform(0, 360), elevation=20)
    layer = see(what, camera, size)
    samples = np.array([[place(i, j, SLANT) for j in range(2 * size[0])] for i in range(2 * size[1])])
    along = rays(camera, 0.5 * samples, size).reshape(-1, 3)
    depth, owner, sure = first_hits(what, np.array(camera.eye), along)
    safe = sure > 1e-4
    assert safe.mean() > 0.9
    assert np.array_equal(layer.owner.ravel()[safe], owner[safe])
    assert np.allclose(layer.depth.ravel()[safe], 1 / depth[safe], atol=1e-6)


def ball(radius: float, height: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A ball over the origin with its middle at a height, m."""
    solid = Primitive("ball", "ellipsoid", np.full(3, radius), np.array([0, 0, height]), np.eye(3))
    return primitive_mesh(solid, 0.02)


def test_a_ball_has_the_outline_and_the_light_of_a_sphere() -> None:
    v, f = ball(0.4, 0.9)
    image = draw(triangles([(v, f, np.tile(RED, (len(v), 1)))]), FRONT, SIZE)
    eye, middle = np.array(FRONT.eye), np.array([0, 0, 0.9])
    pixels = np.stack(np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5), axis=-1)
    along = rays(FRONT, pixels, SIZE)
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    ahead = along @ (middle - eye)
    under = 0.4**2 - ((middle - eye) ** 2).sum() + ahead**2
    inside = under > 0
    is_ball = image[..., 0].astype(int) - image[..., 2] > 60
    assert (is_ball ^ inside).sum() < 0.03 * inside.sum()
    normal = (eye + (ahead - np.sqrt(np.maximum(under, 0)))[..., None] * along - middle) / 0.4
    facing, up = normal @ daylight.sun_of(FRONT), 0.5 + 0.5 * normal[..., 2:]
    sky, ground = daylight.SKY_LIGHT, daylight.GROUND_LIGHT
    fill = -daylight.FILL * (normal * along).sum(axis=2, keepdims=True)
    light = np.array(RED) ** 2 * (
        ground + up * (sky - ground) + fill + np.maximum(facing, 0)[..., None] * daylight.SUN
    )
    # Not at the outline, nor where the sun only grazes and the ball is in its own shadow's rim.
    clear = (under > 0.15 * 0.4**2) & (np.abs(facing) > 0.25)
    assert clear.sum() > 800
    wanted = 255 * np.sqrt(np.clip(light, 0, 1))
    assert np.abs(image - wanted)[clear].max() < 4


def test_the_floor_is_chequered_and_fades_into_the_sky() -> None:
    """Against the mean of many points of the hard pattern in each pixel."""
    size = (80, 60)
    image = draw(triangles([]), FRONT, size).astype(float)
    fine = (np.arange(size[0] * 8) + 0.5) / 8, (np.arange(size[1] * 8) + 0.5) / 8
    along = rays(FRONT, np.stack(np.meshgrid(*fine), axis=-1), size)
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    height = np.clip(along[..., 2:] / daylight.SKY_BAND, 0, 1)
    sky = daylight.SKY_LOW**2 * (1 - height) + daylight.SKY_TOP**2 * height
    distance = np.where(along[..., 2] < 0, -FRONT.eye[2] / np.minimum(along[..., 2], -1e-9), np.inf)
    at = np.array(FRONT.eye) + np.minimum(distance, 1e3)[..., None] * along
    dark = (np.floor(at[..., :2] / daylight.TILE).sum(axis=2) % 2)[..., None]
    colour = daylight.FLOOR[0] ** 2 + dark * (daylight.FLOOR[1] ** 2 - daylight.FLOOR[0] ** 2)
    fill = daylight.FILL * np.abs(along[..., 2:])
    floor = colour * (daylight.SKY_LIGHT + fill + daylight.sun_of(FRONT)[2] * daylight.SUN)
    fog = np.clip((distance - daylight.FOG[0]) / np.ptp(daylight.FOG), 0, 1)[..., None]
    light = sky + (1 - fog * fog * (3 - 2 * fog)) * (floor - sky)
    wanted = 255 * np.sqrt(light.reshape(size[1], 8, size[0], 8, 3).mean(axis=(1, 3)))
    apart = np.abs(image - wanted).max(axis=2)
    assert np.median(apart) <= 1
    assert apart.max() < 16  # where a pixel is a trapezium on the floor, not a rectangle


def test_what_is_nearer_hides_what_is_behind() -> None:
    for order in (1, -1):
        parts = [wall(0.5, RED, 0.2), wall(0.0, BLUE)][::order]
        image = draw(together(*parts), FRONT, SIZE)
        assert is_red(colour_at(image, FRONT, [0.5, 0.0, 0.6]))
        assert not is_red(colour_at(image, FRONT, [0.0, 0.45, 0.6]))


def test_faces_are_seen_from_outside_only() -> None:
    behind = Camera.look_at([0, 0, 0.5], distance=4, azimuth=180, elevation=10)
    assert is_red(colour_at(draw(wall(0, RED), FRONT, SIZE), FRONT, [0, 0, 0.5]))
    assert not is_red(colour_at(draw(wall(0, RED), behind, SIZE), behind, [0, 0, 0.5]))


def test_the_floor_hides_what_is_below_it() -> None:
    low = square([[0, -0.5, -1], [0, 0.5, -1], [0, 0.5, 0.5], [0, -0.5, 0.5]], RED)
    image = draw(low, FRONT, SIZE)
    assert is_red(colour_at(image, FRONT, [0, 0, 0.3]))
    assert not is_red(colour_at(image, FRONT, [0, 0, -0.3]))


def test_a_ghost_is_seen_through_and_casts_no_shadow() -> None:
    empty = draw(triangles([]), FRONT, SIZE).astype(int)
    ghost = draw(triangles([]), FRONT, SIZE, ghost=wall(0, RED), opacity=0.5).astype(int)
    solid = draw(wall(0, RED), FRONT, SIZE).astype(int)
    at = [0, 0.13, 0.7]
    light = [colour_at(image, FRONT, at) ** 2 for image in (empty, ghost, solid)]
    # The sun is on the wall, so that it is as light as its ghost.
    assert np.abs(light[1] - 0.5 * (light[0] + light[2])).max() < 0.02 * 255**2
    outside = solid[..., 0] - solid[..., 2] < 30
    far = outside & ~np.roll(~outside, 2, axis=0) & ~np.roll(~outside, -2, axis=0)
    far &= ~np.roll(~outside, 2, axis=1) & ~np.roll(~outside, -2, axis=1)
    assert np.abs(ghost - empty)[far].max() == 0
    assert np.abs(solid - empty)[far].max() > 30
    # Behind the solid, a ghost is hidden.
    hidden = draw(wall(0.2, RED), FRONT, SIZE, ghost=wall(0, BLUE, 0.2)).astype(int)
    alone = draw(wall(0.2, RED), FRONT, SIZE).astype(int)
    column, row = FRONT.project([0.2, 0, 0.5], SIZE).astype(int)
    near = np.s_[row - 15 : row + 15, column - 20 : column + 20]  # the ghost's own edges too
    assert np.abs(hidden - alone)[near].max() <= 1


def test_the_sun_throws_shadows_away_from_itself() -> None:
    roof = square([[-0.3, -0.3, 1], [0.3, -0.3, 1], [0.3, 0.3, 1], [-0.3, 0.3, 1]], RED)
    above = Camera.look_at([0, 0, 0], distance=6, azimuth=0, elevation=60)
    sun = np.array([0.0, 1.0, 1.0])
    lit, empty = (draw(x, above, SIZE, sun=sun).astype(int) for x in (roof, triangles([])))
    for y, in_shadow in ((-1.0, True), (1.0, False), (-1.5, False)):
        change = colour_at(lit, above, [0, y, 0]) - colour_at(empty, above, [0, y, 0])
        assert (change.max() < -25) == in_shadow


def test_edges_are_smooth() -> None:
    """A nearly upright edge moves on in quarters of a pixel."""
    slanted = square([[0, -0.5, 0], [0, 0.5, 0], [0, 0.3, 1], [0, -0.3, 1]], RED)
    image = draw(slanted, FRONT, SIZE).astype(int)
    top, bottom = (int(FRONT.project([0, 0, z], SIZE)[1]) for z in (0.8, 0.2))
    light = image[top:bottom, :, 1].astype(float) ** 2
    dark, bright = np.median(light[:, 120]), np.median(light[:, 20])
    cover = (light[:, :120] - dark) / (bright - dark)
    partly = cover[(cover > 0.1) & (cover < 0.9)]
    assert len(partly) >= 0.6 * (bottom - top)
    quarters = np.bincount(np.rint(4 * partly).astype(int), minlength=4)
    assert (quarters[1:4] >= 3).all()


def test_small_pictures_are_means_of_large_ones(run: Run) -> None:
    """Which they are not where edges have stairs."""
    shown = capsule_surface(run.body)
    scene = stage([make_actor(shown, run.trajectory.q)], 100.0, (160, 120))
    small = scene.picture(20, caption=False).astype(float)
    large = replace(scene, size=(640, 480)).picture(20, caption=False).astype(float)
    mean = large.reshape(120, 4, 160, 4, 3).mean((1, 3))
    assert np.sqrt(((small - mean) ** 2).mean()) < 4.0
    assert np.quantile(np.abs(small - mean), 0.999) < 60


def test_nearness_darkens_the_floor() -> None:
    def light_before(height: float) -> int:
        v, f = ball(0.3, 0.3 + height)
        image = draw(triangles([(v, f, np.tile(RED, (len(v), 1)))]), above, SIZE, sun=sun)
        return int(colour_at(image, above, [0, 0.2, 0]).sum())

    above = Camera.look_at([0, 0, 0], distance=6, azimuth=0, elevation=40)
    sun = np.array([0.0, 1.0, 0.5])  # the shadow falls to the other side
    light = [light_before(height) for height in (0.01, 1, 3)]
    assert light[0] < light[1] - 15
    assert light[2] - light[1] < 5


def test_what_reaches_the_camera_is_left_out() -> None:
    through = square([[3, -0.5, 0.5], [5, -0.5, 0.5], [5, 0.5, 0.5], [3, 0.5, 0.5]], RED)
    assert np.isfinite(draw(through, FRONT, SIZE)).all()


def test_a_picture_is_the_same_every_time(run: Run) -> None:
    assert run.mesh is not None
    shown = skin_surface(run.mesh)
    v = skin_vertices(run.mesh, run.trajectory.q[:1])[0]
    what = triangles([(v, shown.faces, shown.colours)])
    assert np.array_equal(draw(what, FRONT, SIZE), draw(what, FRONT, SIZE))


def test_normals_of_a_closed_surface_point_outwards(run: Run) -> None:
    assert run.mesh is not None
    made = triangles([(run.mesh.vertices, run.mesh.faces, np.zeros_like(run.mesh.vertices))])
    used = np.unique(run.mesh.faces)
    assert np.abs(np.linalg.norm(made.normals[used], axis=1) - 1).max() < 1e-9
    # By Gauss, the mean flux of the position through the surface is three times the volume.
    a, b, c = (made.vertices[made.faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    flux = np.einsum("ij,ij->i", (a + b + c) / 3, made.normals[made.faces].mean(axis=1))
    assert (flux * area).sum() / 3 == pytest.approx(volume, rel=0.05)
