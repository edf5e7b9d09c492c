"""The whole way in: embedded clips, real files, options, errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from squat_bvh import Convention, write_squat

from physique import rotations as rot
from physique.errors import InputError
from physique.motion import ground
from physique.motion.clip import Motion
from physique.motion.kinematics import joint_positions, motion_world
from physique.motion.library import list_clips
from physique.motion.read import read_clip, read_motion
from physique.skeleton import INDEX

NAMES = [info.name for info in list_clips()]


def check(motion: Motion) -> None:
    """What every motion must be, whatever it was read from."""
    assert motion.rotations.shape == (motion.frames, 22, 4)
    assert motion.root.shape == (motion.frames, 3)
    assert motion.contacts.shape == (motion.frames, 2)
    np.testing.assert_allclose(np.linalg.norm(motion.rotations, axis=-1), 1.0, atol=1e-9)
    np.testing.assert_allclose(motion.root[0, :2], 0.0, atol=1e-9)
    left = rot.rotate(motion.rotations[0, 0], np.array([0.0, 1.0, 0.0]))
    assert abs(left[0]) < 1e-6 or np.hypot(left[0], left[1]) < 0.3
    rest = motion.rest_joints
    np.testing.assert_allclose(rest[[INDEX["left_foot"], INDEX["right_foot"]], 2].mean(), 0.025)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = rest[INDEX[f"{side}_wrist"]] - rest[INDEX[f"{side}_shoulder"]]
        leg = rest[INDEX[f"{side}_ankle"]] - rest[INDEX[f"{side}_hip"]]
        np.testing.assert_allclose(arm / np.linalg.norm(arm), [0, sign, 0], atol=1e-9)
        np.testing.assert_allclose(leg / np.linalg.norm(leg), [0, 0, -1], atol=1e-9)
        foot = rest[INDEX[f"{side}_foot"]] - rest[INDEX[f"{side}_ankle"]]
        assert foot[0] > 0.08
        assert abs(foot[1]) < 1e-6
    assert 1.3 < rest[INDEX["head"], 2] < 1.8


def test_the_library_lists_what_it_holds() -> None:
    infos = {info.name: info for info in list_clips()}
    assert {"walk", "run", "punch", "kick", "spinkick", "jump", "dance_a"} <= set(infos)
    assert 3.5 <= infos["walk"].seconds <= 4.5
    assert 2.7 <= infos["run"].seconds <= 3.5
    for info in infos.values():
        assert "zlib" in info.origin
        assert info.seconds == pytest.approx(read_clip(info.name).seconds)


@pytest.mark.parametrize("name", NAMES)
def test_embedded_clips(name: str) -> None:
    motion = read_motion(name)
    check(motion)
    knees = rot.log(motion.rotations[:, [INDEX["left_knee"], INDEX["right_knee"]]])
    assert np.degrees(knees[..., 1].min()) > -10  # knees bend forwards only
    assert np.degrees(np.abs(knees[..., [0, 2]]).max()) < 0.5


@pytest.mark.parametrize(("name", "speed"), [("walk", 0.98), ("run", 3.56)])
def test_cycles_join_smoothly(name: str, speed: float) -> None:
    """No frame is a worse jump than within a cycle, and the way goes straight on."""
    motion = read_motion(name, low_pass=None)
    turn = rot.log(rot.multiply(rot.conjugate(motion.rotations[:-1]), motion.rotations[1:]))
    turn = np.linalg.norm(turn, axis=-1).max(axis=1)
    cycles = {info.name: info.cycles for info in list_clips()}[name]
    length = (motion.frames - 1) // cycles
    seams = [length * i - 1 for i in range(1, cycles)]
    inside = np.delete(turn, [s + d for s in seams for d in (0, 1)])
    assert turn[seams].max() <= inside.max() * 1.05
    travelled = motion.root[-1] - motion.root[0]
    assert np.hypot(travelled[0], travelled[1]) / motion.seconds == pytest.approx(speed, abs=0.05)
    assert abs(travelled[1]) < 0.25 * travelled[0]


def test_walking_forward() -> None:
    walk = read_motion("walk")
    places = joint_positions(walk)
    toes = places[:, INDEX["left_foot"]] - places[:, INDEX["left_ankle"]]
    assert walk.root[-1, 0] > 3.0
    assert np.median(toes[:, 0]) > 0.07
    ahead = places[:, INDEX["left_knee"], 0] - 0.5 * (
        places[:, INDEX["left_hip"], 0] + places[:, INDEX["left_ankle"], 0]
    )
    assert ahead.max() > 0.05


def test_frame_rate_override(tmp_path: Path) -> None:
    path = tmp_path / "squat.bvh"
    write_squat(path, Convention(header_fps=30.0))
    assert read_motion(path).seconds == pytest.approx(2.0)
    slow = read_motion(path, fps=15.0)
    assert (slow.fps, slow.seconds) == (15.0, pytest.approx(4.0))
    for fps in (0.0, -1.0, float("nan"), 1e9):
        with pytest.raises(InputError, match="frames a second"):
            read_motion(path, fps=fps)


def test_trimming_keeps_the_floor_and_faces_forward() -> None:
    whole, part = read_motion("walk"), read_motion("walk", start=1.0, end=2.5)
    check(part)
    assert part.frames == 46
    np.testing.assert_allclose(part.root[:, 2], whole.root[30:76, 2], atol=1e-9)
    np.testing.assert_array_equal(part.contacts, whole.contacts[30:76])
    np.testing.assert_allclose(part.rotations[:, 1:], whole.rotations[30:76, 1:], atol=1e-9)
    for start, end in ((-1.0, None), (2.0, 1.0), (1.0, 1.0), (0.0, 60.0), (float("nan"), None)):
        with pytest.raises(InputError, match=r"0 <= start < end <= 3\.80 s"):
            read_motion("walk", start=start, end=end)
    with pytest.raises(InputError, match=r"two frames, 0\.033 s; move them apart"):
        read_motion("walk", start=1.0, end=1.01)


def test_a_single_frame_is_called_so(tmp_path: Path) -> None:
    path = tmp_path / "squat.bvh"
    write_squat(path, Convention(frames=1))
    with pytest.raises(InputError, match="found a single frame; expected a motion of two frames or more"):
        read_motion(path, end=1.0)


def test_what_is_no_clip(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no such file or embedded clip.*walk"):
        read_motion("wlak")
    with pytest.raises(InputError, match="no such file"):
        read_motion(tmp_path / "missing.bvh")
    other = tmp_path / "clip.fbx"
    other.write_text("")
    with pytest.raises(InputError, match=r"a \.fbx file; expected one of BVH \(\.bvh\), Acclaim"):
        read_motion(other)
    with pytest.raises(InputError, match="no such file or embedded clip"):
        read_motion("x" * 5000)
    with pytest.raises(InputError, match=r"cut-off of 0\.1 Hz"):
        read_motion("walk", low_pass=1e-300)


def test_reading_is_deterministic() -> None:
    first, second = read_motion("dance_a"), read_motion("dance_a")
    np.testing.assert_array_equal(first.rotations, second.rotations)
    np.testing.assert_array_equal(first.root, second.root)


REAL = {
    "cmu/asfamc/02/02_02.amc": None,
    "cmu/asfamc/02/02_03.amc": None,
    "cmu/asfamc/02/02_04.amc": None,
    "cmu/asfamc/07/07_04.amc": None,
    "cmu/asfamc/09/09_06.amc": None,
    "cmu/bvh/131_01_max.bvh": None,
    "cmu/bvh/135_04.bvh": None,
    "cmu/bvh/135_07.bvh": None,
    "cmu/bvh/60_01.bvh": 60.0,
    "cmu/bvh/60_06.bvh": 60.0,
    "cmu/bvh/jumping_jacks_30fps.bvh": None,
    "other/iclone_007_12.bvh": None,
    "other/jumping.bvh": None,
    "other/wave_hello.bvh": None,
    "malformed/lower.bvh": None,
}


@pytest.mark.parametrize("path", REAL)
def test_real_files(mocap: Path, path: str) -> None:
    motion = read_motion(mocap / path, fps=REAL[path])
    check(motion)
    world, places = motion_world(motion)
    assert motion.contacts.any(axis=0).all()
    for side, (ball, ankle) in enumerate((("left_foot", "left_ankle"), ("right_foot", "right_ankle"))):
        stand = motion.contacts[:, side]
        assert abs(np.median(places[stand, INDEX[ball], 2]) - ground.BALL_HEIGHT) < 0.012
        slide = ground.speeds(places[:, INDEX[ball]], motion.fps)[stand]
        assert np.median(slide) < 0.2
        toe_up = rot.rotate(world[stand, INDEX[ankle]], np.array([0.0, 0.0, 1.0]))[:, 2]
        assert np.degrees(np.arccos(np.clip(np.median(toe_up), -1, 1))) < 30
    # Knees bend about y, the axis that a one-axis knee has.
    for side in ("left", "right"):
        knee = rot.log(motion.rotations[:, INDEX[f"{side}_knee"]])
        off = np.degrees(np.linalg.norm(knee[:, [0, 2]], axis=-1))
        assert np.mean(off) < 3.0
        assert np.degrees(np.percentile(knee[:, 1], 1)) > -10
