"""Pictures show what stands where: geoms, shadows, sides, times; and always the same."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image as PillowImage

from physique.errors import InputError
from physique.render.camera import Camera
from physique.render.picture import animation, frame_camera, render, strip

XML = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 .05"/>
    <body name="pelvis" pos="0 0 .92">
      <freejoint name="root"/>
      <geom name="pelvis" type="capsule" fromto="0 -.07 0 0 .07 0" size=".11"/>
      <body name="chest" pos="0 0 .32">
        <geom name="chest" type="ellipsoid" size=".12 .17 .24"/>
        <geom name="head" type="sphere" pos="0 0 .38" size=".11"/>
        <body name="left_arm" pos="0 .2 .18">
          <joint name="left_arm" axis="1 0 0"/>
          <geom type="capsule" fromto="0 .03 0 0 .55 0" size=".045"/>
        </body>
        <body name="right_arm" pos="0 -.2 .18">
          <joint name="right_arm" axis="1 0 0"/>
          <geom type="capsule" fromto="0 -.03 0 0 -.55 0" size=".045"/>
        </body>
      </body>
      <body name="left_leg" pos="0 .09 -.05">
        <joint name="left_leg" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.78" size=".065"/>
        <geom type="box" pos=".06 0 -.835" size=".13 .045 .035"/>
      </body>
      <body name="right_leg" pos="0 -.09 -.05">
        <joint name="right_leg" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.78" size=".065"/>
        <geom type="box" pos=".06 0 -.835" size=".13 .045 .035"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
SIZE = (160, 120)
SUN = np.array([0.0, 1.0, 1.2])  # from the person's left


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML)


def front(distance: float = 4.0) -> Camera:
    return Camera.look_at([0, 0, 0.9], distance=distance, azimuth=0, elevation=15)


def pixel(image: np.ndarray, camera: Camera, point: list[float]) -> np.ndarray:
    """The colour (3,) of the pixel in which a world point is seen, in 0 to 1."""
    height, width = image.shape[:2]
    column, row = np.floor(camera.project(point, (width, height))).astype(int)
    return image[row, column] / 255.0


def hue(colour: np.ndarray) -> str:
    """Which side of the body has this colour (3,): "blue" left, "red" right, "" neither."""
    warm = (colour[0] - colour[2]) / colour.max()
    return "red" if warm > 0.35 else "blue" if warm < -0.35 else ""


def test_camera_projects_along_its_rays() -> None:
    camera = Camera.look_at([0.3, -0.2, 1.0], distance=3.0, azimuth=130, elevation=25, fov=40)
    pixels = np.random.default_rng(0).uniform(0, 100, (50, 2))
    rays = camera.rays(pixels, SIZE)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1, atol=1e-12)
    far = camera.eye + rays * np.linspace(0.5, 9, 50)[:, None]
    np.testing.assert_allclose(camera.project(far, SIZE), pixels, atol=1e-9)
    np.testing.assert_allclose(camera.project(camera.target, SIZE), [80, 60], atol=1e-9)


def test_camera_stands_where_its_angles_say() -> None:
    # From the front, the person's left is on the right of the picture and up is up.
    camera = front()
    assert np.allclose(camera.eye, [4 * np.cos(np.pi / 12), 0, 0.9 + 4 * np.sin(np.pi / 12)])
    middle = camera.project([0, 0, 1], SIZE)
    assert camera.project([0, 0.5, 1], SIZE)[0] > middle[0]
    assert camera.project([0, 0, 1.5], SIZE)[1] < middle[1]
    moved = camera.follow([2.0, 1.0, 5.0])
    np.testing.assert_allclose(np.subtract(moved.eye, camera.eye), [2, 1, 0])
    np.testing.assert_allclose(moved.target, [2, 1, 0.9])


def test_every_part_is_where_it_should_be(model: mujoco.MjModel) -> None:
    camera = front()
    image = render(model, model.qpos0, camera, SIZE)
    assert image.shape == (120, 160, 3)
    assert image.dtype == np.uint8
    assert hue(pixel(image, camera, [0, 0.5, 1.42])) == "blue"  # left arm
    assert hue(pixel(image, camera, [0, -0.5, 1.42])) == "red"  # right arm
    assert hue(pixel(image, camera, [0.06, 0.09, 0.5])) == "blue"  # left leg
    assert hue(pixel(image, camera, [0.06, -0.09, 0.5])) == "red"
    head = pixel(image, camera, [0.1, 0, 1.62])
    sky = image[0, 0] / 255
    assert np.abs(head - sky).max() > 0.1
    assert pixel(image, camera, [0, 0.5, 1.6]) == pytest.approx(sky, abs=0.12)  # above the arm
    raised = model.qpos0.copy()
    raised[model.jnt_qposadr[model.joint("left_arm").id]] = np.pi / 2
    image = render(model, raised, camera, SIZE)
    assert hue(pixel(image, camera, [0, 0.2, 1.8])) == "blue"
    assert hue(pixel(image, camera, [0, 0.5, 1.42])) == ""


def test_silhouette_matches_single_rays(model: mujoco.MjModel) -> None:
    """Each whole pixel of a part has the hue of the part that MuJoCo's own single ray meets."""
    camera = front(3.5)
    image = render(model, model.qpos0, camera, SIZE) / 255.0
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(1)
    seen = {"red": 0, "blue": 0}
    for column, row in rng.integers([40, 20], [120, 110], (400, 2)):
        hues = set()
        for corner in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
            ray = camera.rays(np.array([[column + corner[0], row + corner[1]]]), SIZE)[0]
            geom = np.zeros(1, np.int32)
            mujoco.mj_ray(model, data, np.array(camera.eye), ray, None, 1, -1, geom, None)
            name = model.body(model.geom_bodyid[geom[0]]).name if geom[0] >= 0 else ""
            hues.add("blue" if "left" in name else "red" if "right" in name else "")
        if len(hues) == 1:
            (expected,) = hues
            assert hue(image[row, column]) == expected
            if expected:
                seen[expected] += 1
    assert min(seen.values()) > 10


def test_the_shadow_falls_away_from_the_light(model: mujoco.MjModel) -> None:
    camera = Camera.look_at([0, 0, 0.3], distance=5, azimuth=0, elevation=30)
    with_body = render(model, model.qpos0, camera, SIZE, sun=SUN)
    away = model.qpos0.copy()
    away[0] = -150.0
    without = render(model, away, camera, SIZE, sun=SUN)

    def darkening(y: float) -> float:
        # The chest's centre is 1.24 m up; its shadow lies 1.24 m * 1 / 1.2 to the side.
        point = [0.0, y, 0.0]
        return float((pixel(without, camera, point) - pixel(with_body, camera, point)).mean())

    assert darkening(-1.24 / 1.2) > 0.1
    assert abs(darkening(+1.24 / 1.2)) < 0.02
    mirrored = render(model, model.qpos0, camera, SIZE, sun=SUN * [1, -1, 1])
    left, right = np.s_[:, 80:], np.s_[:, :80]
    changed = np.abs(with_body.astype(int) - mirrored).mean(2) > 15
    assert changed[left].sum() > 100
    assert changed[right].sum() > 100


def test_the_body_darkens_the_floor_that_it_touches(model: mujoco.MjModel) -> None:
    camera = Camera.look_at([0.25, 0.1, 0.0], distance=3, azimuth=0, elevation=35)
    lifted = model.qpos0.copy()
    lifted[2] += 30.0
    point = [0.22, 0.09, 0.0]  # a hand's breadth before the left toes, on the sunny side
    sun = np.array([1.0, 0.3, 0.8])
    near = pixel(render(model, model.qpos0, camera, SIZE, sun=sun), camera, point).mean()
    free = pixel(render(model, lifted, camera, SIZE, sun=sun), camera, point).mean()
    assert 0.01 < free - near < 0.4


def test_edges_are_smooth(model: mujoco.MjModel) -> None:
    # Of a large picture, averaged down, the small picture is a good copy only without stairs.
    camera = front()
    small = render(model, model.qpos0, camera, SIZE).astype(float)
    large = render(model, model.qpos0, camera, (SIZE[0] * 4, SIZE[1] * 4)).astype(float)
    mean = large.reshape(SIZE[1], 4, SIZE[0], 4, 3).mean((1, 3))
    assert np.sqrt(((small - mean) ** 2).mean()) < 4.0
    assert np.quantile(np.abs(small - mean), 0.999) < 60


def test_colours_of_the_model_are_kept_where_they_tell_the_sides() -> None:
    xml = XML.replace(
        '<geom type="capsule" fromto="0 .03 0 0 .55 0" size=".045"/>',
        '<geom type="capsule" fromto="0 .03 0 0 .55 0" size=".045" rgba=".2 .7 .2 1"/>',
    )
    model = mujoco.MjModel.from_xml_string(xml)
    image = render(model, model.qpos0, front(), SIZE)
    colour = pixel(image, front(), [0, 0.5, 1.42])
    assert colour[1] > colour[0] + 0.2
    assert colour[1] > colour[2] + 0.2


def test_two_figures_hide_each_other_by_distance(model: mujoco.MjModel) -> None:
    camera = front(5.0)
    other = model.qpos0.copy()
    chest = [0.12, 0.0, 1.24]
    for x, grey in ((-1.0, False), (1.0, True)):
        other[0] = x
        image = render(model, model.qpos0, camera, SIZE, reference_qpos=other)
        colour = pixel(image, camera, chest)
        assert (np.ptp(colour) < 0.06) == grey


def test_pictures_are_deterministic(model: mujoco.MjModel) -> None:
    one = render(model, model.qpos0, front(), SIZE)
    np.testing.assert_array_equal(one, render(model, model.qpos0, front(), SIZE))


def walk(model: mujoco.MjModel, frames: int = 40) -> np.ndarray:
    q = np.tile(model.qpos0, (frames, 1))
    q[:, 0] = np.linspace(0, 2.0, frames)
    for side, sign in (("left", 1), ("right", -1)):
        leg = model.jnt_qposadr[model.joint(f"{side}_leg").id]
        q[:, leg] = sign * 0.4 * np.sin(np.linspace(0, 6, frames))
    return q


def test_framing_holds_all_poses(model: mujoco.MjModel) -> None:
    q = walk(model)
    q[:, 2] += np.linspace(0, 0.5, len(q))  # it rises, too
    size = (160, 240)
    camera = frame_camera(model, q, size)
    data = mujoco.MjData(model)
    extreme = []
    for row in q:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        extreme.append(camera.follow(row).project(data.geom_xpos[1:], size) / size)
    assert np.min(extreme) > 0.02
    assert np.max(extreme) < 0.98
    assert np.ptp(np.concatenate(extreme), axis=0).max() > 0.6  # and no smaller than need be


def test_strip(model: mujoco.MjModel) -> None:
    q = walk(model)
    image = strip(model, q, 3, fps=20.0, reference_q=q, panel=(80, 110))
    assert image.shape == (22 + 110 + 2 + 110, 3 * 80 + 2 * 2, 3)
    top, bottom = image[22:132].astype(int), image[134:].astype(int)
    # Colour below, grey above, in every panel.
    for column in range(3):
        part = np.s_[:, column * 82 : column * 82 + 80]
        assert (np.ptp(bottom[part], axis=2) > 60).sum() > 100
        assert (np.ptp(top[part], axis=2) > 60).sum() == 0
        assert (image[:22][part] < 120).any()  # a label
    # The legs move from panel to panel: the panels are different pictures.
    assert np.abs(bottom[:, :80] - bottom[:, 82:162]).mean() > 2
    single = strip(model, q[:1], 5, panel=(40, 60))
    assert single.shape == (22 + 60, 40, 3)


def test_faults_are_named(model: mujoco.MjModel, tmp_path: Path) -> None:
    q = walk(model, 4)
    with pytest.raises(InputError, match=r"q: found shape \(4, 10\); expected \(frames, 11\)"):
        strip(model, q[:, :-1])
    with pytest.raises(InputError, match="reference_q: found 3 frames; expected 4"):
        strip(model, q, reference_q=q[:3])
    with pytest.raises(InputError, match=r"x\.mp4: found suffix '\.mp4'"):
        animation(model, q, 20.0, tmp_path / "x.mp4")
    with pytest.raises(InputError, match=r"no such file or directory"):
        animation(model, q, 20.0, tmp_path / "gone" / "x.gif", size=(40, 30))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("suffix", "rate"), [("gif", 10.0), ("webp", 12.5)])
def test_animation(model: mujoco.MjModel, tmp_path: Path, suffix: str, rate: float) -> None:
    q, fps = walk(model, 41), 20.0  # 2 s
    path = animation(
        model, q, fps, tmp_path / f"x.{suffix}", reference_q=q, size=(100, 80), rate=rate, threads=1
    )
    with PillowImage.open(path) as film:
        assert film.size == (100, 80)
        assert film.info["loop"] == 0
        total = 0
        frames = []
        for index in range(film.n_frames):
            film.seek(index)
            film.load()
            total += film.info["duration"]
            frames.append(np.asarray(film.convert("RGB")).astype(int))
        # True speed: each frame lasts until the next, the last one too.
        assert total == pytest.approx(2000 + 1000 / rate, abs=1)
    # The coloured figure stands left of the middle, the grey one right of it, in every frame.
    for frame in frames:
        colour = np.argwhere(np.ptp(frame, axis=2) > 50)
        dark = np.argwhere((frame.max(2) < 150) & (np.ptp(frame, axis=2) < 30))
        assert len(colour) > 50
        assert colour[:, 1].mean() < 47
        assert dark[:, 1].mean() > 53
    again = animation(
        model, q, fps, tmp_path / f"y.{suffix}", reference_q=q, size=(100, 80), rate=rate, threads=2
    )
    assert again.read_bytes() == path.read_bytes()
