"""Meshes are drawn where they are, smooth, in their colours."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from physique.body.mesh import BodyMesh
from physique.errors import InputError
from physique.render.camera import Camera
from physique.render.mesh_picture import body_picture, render_meshes
from physique.render.picture import render

SIZE = (160, 120)
CAMERA = Camera.look_at([0, 0, 0.5], distance=4, azimuth=0, elevation=12)


def ball(centre: list[float], radius: float, n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """A closed mesh with its faces outwards, on the points of a sunflower's spiral."""
    k = np.arange(n) + 0.5
    polar, turn = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
    v = np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], 1)
    f = ConvexHull(v).simplices
    outward = np.einsum("ij,ij->i", np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]]), v[f[:, 0]])
    f[outward < 0] = f[outward < 0, ::-1]
    return np.array(centre) + radius * v, f


def test_a_fine_ball_looks_like_a_sphere() -> None:
    """The mesh's picture is that of MuJoCo's own sphere, up to the faces' flatness."""
    v, f = ball([0, 0, 0.5], 0.5, 2000)
    rgb = (0.8, 0.3, 0.2)
    mesh = render_meshes([(v, f, rgb)], CAMERA, SIZE).astype(int)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="0 0 1"/><body pos="0 0 .5"><freejoint/>'
        '<geom type="sphere" size=".5" rgba=".8 .3 .2 1"/></body></worldbody></mujoco>'
    )
    sphere = render(model, model.qpos0, CAMERA, SIZE).astype(int)
    column, row = CAMERA.project([0, 0, 0.5], SIZE)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    inside = np.hypot(x - column, y - row) < 20  # of a radius of 24
    assert np.abs(mesh - sphere)[inside].max() <= 3
    shape = (np.ptp(mesh, axis=2) > 60) ^ (np.ptp(sphere, axis=2) > 60)
    assert shape.mean() < 0.01


def test_coarse_meshes_are_smooth() -> None:
    v, f = ball([0, 0, 0.5], 0.5, 120)
    image = render_meshes([(v, f, (0.8, 0.3, 0.2))], CAMERA, SIZE).astype(int)
    row = image[60, 65:95].sum(1)
    # A flat face of this mesh is 9 pixels wide: flat shading would step by tens there.
    assert np.abs(np.diff(row)).max() < 25


def test_each_mesh_has_its_place_and_colour() -> None:
    image = render_meshes(
        [(*ball([0, 0.7, 0.4], 0.4), (0.2, 0.3, 0.9)), (*ball([0, -0.7, 0.4], 0.4), (0.9, 0.3, 0.2))],
        CAMERA,
        SIZE,
    )
    for y, channel in ((0.7, 2), (-0.7, 0)):
        column, row = np.floor(CAMERA.project([0.4, y, 0.4], SIZE)).astype(int)
        colour = image[row, column].astype(int)
        assert np.argmax(colour) == channel
        assert np.ptp(colour) > 60


def test_floor_can_be_left_out() -> None:
    mesh = [(*ball([0, 0, 0.5], 0.5), (0.8, 0.3, 0.2))]
    with_floor = render_meshes(mesh, CAMERA, SIZE).astype(int)
    without = render_meshes(mesh, CAMERA, SIZE, floor=False).astype(int)
    corner = np.s_[-20:, :20]
    assert np.ptp(with_floor[corner][..., 0]) > 10
    assert np.ptp(without[corner][..., 0]) == 0


def test_faults_are_named() -> None:
    v, f = ball([0, 0, 0.5], 0.5)
    with pytest.raises(InputError, match=r"mesh 1: found vertices \(300, 2\)"):
        render_meshes([(v, f, (1, 0, 0)), (v[:, :2], f, (1, 0, 0))], CAMERA)
    with pytest.raises(InputError, match=r"mesh 0: found faces .* indices below 299"):
        render_meshes([(v[:-1], f, (1, 0, 0))], CAMERA)


def test_body_picture_has_surface_and_primitives_at_one_scale() -> None:
    v, f = ball([0, 0, 0.9], 0.9, 500)
    mesh = BodyMesh(
        name="ball",
        vertices=v,
        faces=f.astype(np.int32),
        joints=np.zeros((22, 3)),
        weights=np.zeros((len(v), 22)),
        surface=np.ones(len(v), dtype=bool),
        volume=3.0,
        mass=75.0,
    )
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="0 0 1"/><body pos="0 0 .9"><freejoint/>'
        '<geom type="sphere" size=".9" rgba=".2 .3 .9 1"/></body></worldbody></mujoco>'
    )
    image = body_picture(mesh, model, height=120).astype(int)
    assert image.shape == (120, 120 + 2 + 120 + 2 + 60 + 2 + 60, 3)
    skin = (image[..., 0] - image[..., 2]) / image.max(2) > 0.2
    blue = (image[..., 2] - image[..., 0]) / image.max(2) > 0.4
    starts = (0, 122, 244, 306)
    widths = [
        (kind[60, start : start + width]).sum()
        for start, width, kind in zip(starts, (120, 120, 60, 60), (skin, blue, skin, blue))
    ]
    assert widths[0] == pytest.approx(widths[1], abs=2)
    assert widths[0] > 60
    assert widths[2:] == [60, 60]  # the ball is as large there, and wider than the panel
    assert not skin[:, 122:242].any()
