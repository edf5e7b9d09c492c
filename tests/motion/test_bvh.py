"""BVH files: what must be read, and what must be refused in one line."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pybvh
import pytest

from physique.errors import InputError
from physique.motion.bvh import read_bvh
from physique.motion.kinematics import clip_world

SMALL = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    OFFSET 0 -10 0
    CHANNELS 1 Xrotation
    End Site
    {
      OFFSET 0 -8 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0333333
1 2 3 0 0 90 0
1 2 3 0 0 90 90
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "clip.bvh"
    path.write_bytes(text.encode("latin-1" if text.startswith("\xff\xfe") else "utf-8"))
    return path


def test_small_file(tmp_path: Path) -> None:
    clip = read_bvh(write(tmp_path, SMALL))
    assert clip.joints == ("Hips", "Left Leg", "Left Leg end")
    assert clip.parents.tolist() == [-1, 0, 1]
    assert clip.fps == 30.0
    _, places = clip_world(clip)
    np.testing.assert_allclose(places[0], [[1, 2, 3], [1, -8, 3], [1, -16, 3]], atol=1e-12)
    # The knee bends by 90 degrees about x, which the root has turned onto -z.
    np.testing.assert_allclose(places[1, 2], [-7, -8, 3], atol=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: "\ufeff" + text,
        lambda text: text.replace(" ", "\t").replace("Left\tLeg", "Left Leg"),
        lambda text: text.replace("HIERARCHY", "hierarchy").replace("JOINT", "Joint"),
        lambda text: text.replace("ROOT Hips\n{", "ROOT Hips {"),
        lambda text: text.replace("\n1 2", "\n\n1 2") + "\n\n",
        lambda text: text.replace("\n1 2 3 ", "\n1 2 3\n") + "\x1a",
        lambda text: text.replace("\n  {\n    OFFSET", " { OFFSET").replace("\n  }\n}", "}}"),
        lambda text: text.encode("utf-16").decode("latin-1"),
        lambda text: text.replace("0.0333333", "0,0333333"),
    ],
)
def test_spellings_of_the_same_file(tmp_path: Path, change) -> None:
    plain = read_bvh(write(tmp_path, SMALL))
    other = read_bvh(write(tmp_path, change(SMALL)))
    assert other.joints == plain.joints
    assert other.fps == plain.fps
    np.testing.assert_array_equal(other.rotations, plain.rotations)


def test_rotation_first_and_position_channels_on_joints(tmp_path: Path) -> None:
    text = SMALL.replace(
        "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
        "6 Zrotation Xrotation Yrotation Xposition Yposition Zposition",
    ).replace("1 Xrotation", "6 Xposition Yposition Zposition Xrotation Yrotation Zrotation")
    rows = "0 0 90 1 2 3 0 -12 0 0 0 0\n" * 2
    clip = read_bvh(write(tmp_path, text[: text.index("1 2 3")] + rows))
    np.testing.assert_allclose(clip_world(clip)[1][0, 1], [1, -10, 3], atol=1e-12)


def test_positions_that_are_added_to_the_offset(tmp_path: Path) -> None:
    added = SMALL.replace("OFFSET 0 0 0", "OFFSET 0 100 0", 1)
    assert read_bvh(write(tmp_path, added)).positions[0, 0].tolist() == [1, 102, 3]
    replaced = added.replace("\n1 2 3", "\n1 102 3")
    assert read_bvh(write(tmp_path, replaced)).positions[0, 0].tolist() == [1, 102, 3]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("90 90\n", "90 nan\n", "line 20: found nan for frame 1"),
        ("90 90\n", "90 x\n", "line 20: found 'x'; expected numbers for frame 1"),
        ("90 90\n", "90\n", "line 20: found 6 values in frame 1; expected 7"),
        ("90 90\n", "90 1e999\n", "line 20: found 1e999 for frame 1"),
        ("JOINT Left Leg", "JOINT Hips", "the joint name 'Hips' twice"),
        ("Frames: 2", "Frames: 0", "line 17: found Frames: 0"),
        ("Frames: 2", "Frames: 3", "found 2 rows of values; expected Frames: 3"),
        ("Frames: 2", "Frames: -5", "line 17: found '-5'; expected a count"),
        ("0.0333333", "0", "line 18: found Frame Time: 0"),
        ("0.0333333", "nan", "line 18: found nan for Frame Time"),
        ("OFFSET 0 -10 0", "OFFSET 0 inf 0", "line 8: found inf for OFFSET"),
        ("OFFSET 0 -10 0", "OFFSET 0 -10", "line 8: found 2 values"),
        ("    OFFSET 0 -10 0\n", "", "joint 'Left Leg' without OFFSET"),
        ("1 Xrotation", "2 Xrotation", "line 9: found 'CHANNELS 2 Xrotation'"),
        ("1 Xrotation", "1 Wrotation", "line 9: found channel 'Wrotation'"),
        ("1 Xrotation", "2 Xrotation Xrotation", "line 9: found channel 'Xrotation' twice"),
        ("  }\n}\nMOTION", "  }\nMOTION", "line 15: found MOTION inside an open '{'"),
        ("}\nMOTION", "}\n}\nMOTION", "line 16: found '}' too many"),
        ("MOTION\n", "", "line 16: found 'Frames: 2'"),
        ("HIERARCHY\nROOT Hips", "HIERARCHY\nJOINT Hips", "line 2: found JOINT outside ROOT"),
        ("Frames: 2\n", "", "no 'Frames:' line"),
        (
            "OFFSET 0 -10 0",
            "OFFSET 0,5 -10 0",
            "line 8: found '0,5'; expected numbers for OFFSET; write decimal",
        ),
        ("ROOT Hips", "ROOT Hips\0", "found binary data"),
        ("Frames: 2", "Frames: ²", "found '²'"),
        ("Frames: 2", "Frames: " + "9" * 5000, "expected a count"),
    ],
)
def test_refusals_name_the_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in SMALL
    with pytest.raises(InputError) as caught:
        read_bvh(write(tmp_path, SMALL.replace(old, new, 1)))
    text = str(caught.value)
    assert message in text
    assert "clip.bvh" in text
    assert "\n" not in text


@pytest.mark.parametrize("length", range(0, len(SMALL) - 12, 7))
def test_a_file_cut_anywhere_is_refused(tmp_path: Path, length: int) -> None:
    with pytest.raises(InputError):
        read_bvh(write(tmp_path, SMALL[:length]))


@pytest.mark.parametrize("noise", [b"\x00\xff" * 500, b"MOTION\n", b"{" * 50, b"ROOT a\n" * 9])
def test_noise_is_refused(tmp_path: Path, noise: bytes) -> None:
    path = tmp_path / "noise.bvh"
    path.write_bytes(noise)
    with pytest.raises(InputError):
        read_bvh(path)


def test_real_files_agree_with_an_independent_reader(mocap: Path) -> None:
    paths = [*sorted((mocap / "cmu/bvh").glob("1*.bvh")), *sorted((mocap / "other").glob("*.bvh"))]
    assert len(paths) >= 6
    for path in paths:
        clip = read_bvh(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            other = pybvh.read_bvh_file(str(path)).joint_positions()
        own = clip_world(clip)[1]
        own = own[:, [i for i, name in enumerate(clip.joints) if not name.endswith(" end")]]
        # One file adds its root's positions to the OFFSET, the other reader replaces it.
        shift = own[0, 0] - other[0, 0]
        np.testing.assert_allclose(own - shift, other, atol=1e-9, err_msg=str(path))


@pytest.mark.parametrize("name", ["crlf", "lower", "tabsframe"])
def test_odd_but_complete_files_are_read(mocap: Path, name: str) -> None:
    clip = read_bvh(mocap / f"malformed/{name}.bvh")
    assert (clip.frames, len(clip.joints), clip.fps) == (173, 38, 120.0)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("empty", "an empty file"),
        ("nomotion", "no MOTION section"),
        ("trunc_row", "line 360: found 74 values in frame 172; expected 96"),
        ("more_frames", "found 173 rows of values; expected Frames: 100"),
        ("short_frames", "found 173 rows of values; expected Frames: 180"),
    ],
)
def test_damaged_files_are_refused(mocap: Path, name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_bvh(mocap / f"malformed/{name}.bvh")
