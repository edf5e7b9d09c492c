"""Acclaim files: the .asf beside the .amc, units, axes, damaged files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from physique.errors import InputError
from physique.motion.asfamc import find_asf, read_asfamc
from physique.motion.kinematics import clip_world, joint_positions, motion_world
from physique.motion.read import read_clip, read_motion

ASF = """:version 1.10
:name TEST
:units
  mass 1.0
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name thigh
     direction 0 -1 0
     length 7
     axis 0 0 90 XYZ
     dof rx
  end
  begin
     id 2
     name shank
     direction 0 -1 0
     length 6
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root thigh
    thigh shank
  end
"""
AMC = """#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 90 0
thigh 0
2
root 1 2 3 0 0 0
thigh 90
"""


def write(folder: Path, asf: str = ASF, amc: str = AMC) -> Path:
    (folder / "05.asf").write_text(asf)
    path = folder / "05_01.amc"
    path.write_text(amc)
    return path


def test_small_file(tmp_path: Path) -> None:
    clip = read_asfamc(write(tmp_path))
    assert clip.joints == ("root", "thigh", "shank")
    assert clip.unit == pytest.approx(0.0254 / 0.45)
    assert (clip.up, clip.fps) == ("y", 120.0)
    _, places = clip_world(clip)
    np.testing.assert_allclose(places[0], [[1, 2, 3], [1, 2, 3], [1, -5, 3]], atol=1e-12)
    # The thigh's x axis is turned by 90 degrees about z: it bends about the world's y, and so
    # its own direction, -y, stays.
    np.testing.assert_allclose(places[1, 2], [1, -5, 3], atol=1e-12)


def test_radians(tmp_path: Path) -> None:
    radians = AMC.replace(":DEGREES", ":RADIANS").replace(" 90", f" {np.pi / 2:.12f}")
    first = read_asfamc(write(tmp_path)).rotations
    # The .asf's own angles stay in degrees.
    np.testing.assert_allclose(read_asfamc(write(tmp_path, amc=radians)).rotations, first, atol=1e-9)


def test_the_skeleton_alone_is_no_motion(tmp_path: Path) -> None:
    write(tmp_path)
    with pytest.raises(InputError, match=r"05\.asf: found a skeleton without a motion.*name the \.amc"):
        read_clip(tmp_path / "05.asf")


def test_the_asf_with_the_longest_common_name_is_found(tmp_path: Path) -> None:
    for name in ("a", "a_b", "a_c"):
        (tmp_path / f"{name}.asf").write_text(ASF)
    for name, found in (("a_b_01_120", "a_b"), ("a_d_01", "a"), ("a_b", "a_b")):
        (tmp_path / f"{name}.amc").write_text(AMC)
        assert find_asf(tmp_path / f"{name}.amc").stem == found


def test_the_asf_is_found(tmp_path: Path) -> None:
    amc = write(tmp_path)
    (tmp_path / "06.asf").write_text(ASF)
    assert find_asf(amc).name == "05.asf"
    amc = amc.rename(tmp_path / "07_01.amc")
    with pytest.raises(InputError, match=r"2 \.asf files, none of that name"):
        find_asf(amc)
    (tmp_path / "06.asf").unlink()
    assert find_asf(amc).name == "05.asf"
    (tmp_path / "05.asf").unlink()
    with pytest.raises(InputError, match=r"expected 07\.asf in the same folder"):
        find_asf(amc)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("thigh 90\n", "", "frame 2: found no values for 'thigh'"),
        ("thigh 90", "thigh", "line 9: found 0 values for 'thigh'"),
        ("thigh 90", "thigh nan", "line 9: found nan for 'thigh'"),
        ("thigh 90", "thigh 9o", "line 9: found '9o'"),
        ("thigh 90", "calf 90", "bone 'calf' in frame 2"),
        ("thigh 90", "thigh 90\nthigh 90", "bone 'thigh' in frame 2"),
        ("1\nroot", "root", "a frame number first"),
        (AMC, ":DEGREES", "no frames"),
    ],
)
def test_damaged_motion(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        read_asfamc(write(tmp_path, amc=AMC.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("thigh shank", "thigh calf", "bone 'calf'"),
        ("    thigh shank\n", "", "bones outside the hierarchy: shank"),
        ("name shank", "name thigh", "'thigh' missing or twice"),
        ("length 7", "length seven", "line 17: found 'seven'"),
        ("dof rx", "dof rw", "channel 'rw'"),
        ("length 0.45", "length 0", "length unit 0"),
        ("length 0.45", "length", "line 5: found 0 values for length; expected 1"),
        ("angle deg", "angle", "line 6: found 'angle'; expected deg or rad"),
        ("   axis XYZ", "   axis", "line 9: found 'axis'; expected XYZ"),
        ("   axis XYZ", "   axis ZYX", "line 9: found root axis 'ZYX'"),
        ("position 0 0 0", "position 0 0", "line 10: found 2 values for position"),
        ("name thigh", "name", "line 15: found 'name'; expected the bone's name"),
        ("axis 0 0 90 XYZ", "axis 0 0", "line 18: found 2 values for axis; expected 3"),
        ("axis 0 0 90 XYZ", "axis 0 0 90 XYY", "line 18: found axis order 'xyy'"),
        ("dof rx", "dof rx rx", "line 19: found channel 'rx'"),
        ("  end\n  begin", "  begin", "line 20: found 'begin' inside a bone"),
        ("root thigh", "thigh root", "'root' below a second bone"),
        ("root thigh", "shank thigh", "their own ancestors: thigh, shank"),
        (ASF, ":name a", "no bones"),
    ],
)
def test_damaged_skeleton(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        read_asfamc(write(tmp_path, asf=ASF.replace(old, new, 1)))


def test_a_truncated_real_file_is_refused(mocap: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no \.asf file beside it"):
        read_asfamc(mocap / "malformed/07_12_truncated.amc")
    with pytest.raises(InputError, match=r"(no )?values for"):
        read_asfamc(mocap / "malformed/07_12_truncated.amc", mocap / "cmu/asfamc/07/07.asf")


def test_the_same_trial_as_amc_and_as_bvh(mocap: Path) -> None:
    amc = read_motion(mocap / "cmu/asfamc/01/01_01.amc", end=5.0)
    bvh = read_motion(mocap / "cmu/bvh/01_01_motionbuilder.bvh", end=5.0)
    # The BVH was made from the AMC, with a T-pose before it and with the uppermost spine bone and
    # the distal forearm cut to no length.
    turns = np.abs(np.sum(motion_world(amc)[0] * motion_world(bvh)[0], axis=-1))
    assert np.degrees(2 * np.arccos(np.clip(turns, -1, 1))).max() < 0.1
    legs = [0, 1, 2, 4, 5, 7, 8, 10, 11]
    difference = joint_positions(amc)[:, legs] - joint_positions(bvh)[:, legs]
    assert np.abs(difference).max() < 1e-3
