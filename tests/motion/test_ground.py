"""The floor: found, levelled, at the soles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physique import rotations as rot
from physique.motion import ground
from physique.motion.clip import Motion
from physique.motion.kinematics import joint_positions, motion_world
from physique.motion.read import read_motion
from physique.skeleton import INDEX

BALLS = [INDEX["left_foot"], INDEX["right_foot"]]
ANKLES = [INDEX["left_ankle"], INDEX["right_ankle"]]


def tilted(motion: Motion, degrees: float, axis: str, lift: float) -> Motion:
    turn = rot.about(axis, np.radians(degrees))
    rotations = motion.rotations.copy()
    rotations[:, 0] = rot.normalize(rot.multiply(turn, rotations[:, 0]))
    root = rot.rotate(turn, motion.root) + np.array([0.3, -2.0, lift])
    return replace(motion, rotations=rotations, root=root)


@pytest.mark.parametrize(("degrees", "lift"), [(0.0, 0.4), (1.5, 0.4), (-1.2, -0.7)])
def test_a_tilt_along_the_way_is_undone(degrees: float, lift: float) -> None:
    walk = read_motion("walk")
    settled = ground.settle(tilted(walk, degrees, "y", lift))
    before, after = joint_positions(walk)[:, BALLS, 2], joint_positions(settled)[:, BALLS, 2]
    np.testing.assert_allclose(after, before, atol=0.01)  # of 10 cm along the way
    assert (settled.contacts == walk.contacts).mean() > 0.97


def test_a_tilt_that_nothing_shows_is_left_alone() -> None:
    """Standing feet 20 cm apart show no tilt: what they differ by is the feet's."""
    punch = read_motion("punch")
    still = replace(
        punch,
        rotations=np.tile(rot.IDENTITY, (60, 22, 1)),
        root=np.tile(punch.rest_joints[0], (60, 1)),
        contacts=np.zeros((60, 2), dtype=bool),
    )
    floor = ground.fit_floor(tilted(still, 2.0, "x", 0.0))
    assert np.degrees(np.hypot(floor.slope_x, floor.slope_y)) < 0.6


def test_the_tilt_is_bounded() -> None:
    floor = ground.fit_floor(tilted(read_motion("walk"), 6.0, "y", 0.0))
    assert np.degrees(np.arctan(np.hypot(floor.slope_x, floor.slope_y))) <= 3.0 + 1e-9


@pytest.mark.parametrize("name", ["walk", "run", "jump", "kick", "punch", "spinkick", "cartwheel"])
def test_embedded_clips_stand_on_the_floor(name: str) -> None:
    motion = read_motion(name)
    places = joint_positions(motion)
    assert motion.contacts.any(axis=0).all()
    for side in range(2):
        heights = places[motion.contacts[:, side], BALLS[side], 2]
        assert abs(np.median(heights) - ground.BALL_HEIGHT) < 0.015
    assert places[:, BALLS, 2].min() > -0.03
    assert 0.02 < motion.rest_joints[ANKLES, 2].mean() < 0.10


def test_walking_feet_alternate_and_are_flat_in_stance() -> None:
    walk = read_motion("walk")
    world, places = motion_world(walk)
    assert 0.4 < walk.contacts.mean() < 0.75
    assert walk.contacts.any(axis=1).mean() > 0.9
    for side in range(2):
        still = walk.contacts[:, side] & (ground.speeds(places[:, ANKLES[side]], walk.fps) < 0.1)
        up = rot.rotate(world[still, ANKLES[side]], np.array([0.0, 0.0, 1.0]))
        assert np.degrees(np.arccos(np.median(up[:, 2]))) < 5.0
        slide = ground.speeds(places[:, BALLS[side]], walk.fps)[still]
        assert np.median(slide) < 0.1


def test_a_jump_leaves_the_floor() -> None:
    jump = read_motion("jump")
    flight = ~jump.contacts.any(axis=1)
    lowest = joint_positions(jump)[:, BALLS, 2].min(axis=1)
    assert 0.1 < flight.mean() < 0.6
    assert lowest[flight].max() > 0.15
    assert lowest[~flight].max() < 0.12


def test_crawling_lies_on_the_floor() -> None:
    places = joint_positions(read_motion("crawl"))
    assert abs(np.percentile(places[..., 2].min(axis=1), 50)) < 0.05


@pytest.mark.parametrize(
    ("path", "slope"), [("07/07_01.amc", 0.95), ("07/07_05.amc", 0.95), ("02/02_01.amc", 0.85)]
)
def test_the_known_tilt_of_real_floors_is_found(mocap: Path, path: str, slope: float) -> None:
    """The lab's floor rises by about a degree along one axis: the file axis Z."""
    from physique.motion import rig
    from physique.motion.conventions import recognize
    from physique.motion.read import read_clip
    from physique.motion.tpose import find_tpose

    clip = read_clip(mocap / "cmu/asfamc" / path)
    mapping, joints = recognize(clip)
    tpose = find_tpose(clip, mapping, joints)
    floor = ground.fit_floor(rig.to_motion(clip, joints, tpose))
    rise = tpose.R_file_from_world @ [floor.slope_x, floor.slope_y, 0.0]
    assert abs(np.degrees(rise[2])) == pytest.approx(slope, abs=0.2)
    assert abs(np.degrees(rise[0])) < 0.2
