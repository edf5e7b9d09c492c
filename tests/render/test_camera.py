"""A camera stands where its angles say and sees what it should."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from physique.render.camera import Camera

SIZE = (160, 120)


def test_points_are_seen_along_straight_lines() -> None:
    camera = Camera.look_at([0.3, -0.2, 1.0], distance=3.0, azimuth=130, elevation=25, fov=40)
    np.testing.assert_allclose(camera.project(camera.target, SIZE), [80, 60], atol=1e-9)
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3)) + camera.target
    further = camera.eye + 2.5 * (points - camera.eye)
    np.testing.assert_allclose(camera.project(further, SIZE), camera.project(points, SIZE), atol=1e-9)
    # Half the angle of view above the target is the upper edge of the picture.
    edge = np.array(camera.target) + 3.0 * np.tan(np.radians(20)) * camera.axes()[1]
    np.testing.assert_allclose(camera.project(edge, SIZE), [80, 0], atol=1e-9)


def test_it_stands_where_its_angles_say() -> None:
    # From the front, the person's left is on the right of the picture and up is up.
    camera = Camera.look_at([0, 0, 0.9], distance=4, azimuth=0, elevation=15)
    assert np.allclose(camera.eye, [4 * np.cos(np.pi / 12), 0, 0.9 + 4 * np.sin(np.pi / 12)])
    middle = camera.project([0, 0, 1], SIZE)
    assert camera.project([0, 0.5, 1], SIZE)[0] > middle[0]
    assert camera.project([0, 0, 1.5], SIZE)[1] < middle[1]
    moved = camera.follow([2.0, 1.0, 5.0])
    np.testing.assert_allclose(np.subtract(moved.eye, camera.eye), [2, 1, 0])
    np.testing.assert_allclose(moved.target, [2, 1, 0.9])


@given(st.integers(0, 2**32 - 1), st.floats(-180, 180), st.floats(-10, 60), st.floats(3, 60))
def test_it_holds_all_points_and_is_no_further_than_need_be(
    seed: int, azimuth: float, elevation: float, fov: float
) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (30, 3)) * rng.uniform(0.2, 2, 3)
    probe = Camera.look_at([0, 0, 0], azimuth=azimuth, elevation=elevation, fov=fov)
    seen = probe.holding(points, SIZE, margin=1.0).project(points, SIZE) / SIZE
    assert seen.min() > -1e-9
    assert seen.max() < 1 + 1e-9
    assert min(seen.min(), 1 - seen.max()) < 1e-9
