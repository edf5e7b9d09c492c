"""The rasteriser draws what the ray caster draws, and hides, shades and veils as it should."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from physique.render.camera import Camera
from physique.render.mesh_picture import render_meshes
from physique.render.palette import of_rgb
from physique.render.raster import draw
from physique.render.skin import skin_vertices
from physique.render.surface import skin_surface
from physique.render.zbuffer import Triangles, triangles
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


def test_a_person_looks_as_the_ray_caster_has_it(run: Run) -> None:
    assert run.mesh is not None
    v = skin_vertices(run.mesh, run.trajectory.q[20:21])[0]
    shown = skin_surface(run.mesh, of_rgb(RED))
    camera = Camera.look_at([*v.mean(axis=0)[:2], 0.9], distance=4.5, azimuth=50, elevation=10)
    found = draw(triangles([(v, shown.faces, shown.colours)]), camera, SIZE).astype(int)
    wanted = render_meshes([(v, shown.faces, RED)], camera, SIZE).astype(int)
    inside, outside = (image[..., 0] - image[..., 2] > 40 for image in (found, wanted))
    assert outside.sum() > 1500
    assert (inside ^ outside).sum() < 0.03 * outside.sum()  # half a pixel of the outline
    apart = np.abs(found - wanted)
    # On the body, shadows on the skin have other rims; on the floor, so has nearness.
    assert np.median(apart[inside & outside]) <= 4
    assert apart[inside & outside].mean() < 8
    far = ~(inside | outside)
    assert np.median(apart[far]) <= 1
    assert (apart[far].max(axis=1) > 12).mean() < 0.06


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
