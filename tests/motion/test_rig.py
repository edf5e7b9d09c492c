"""Any skeleton's squat is the same squat: names, rest poses, axes, units."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from squat_bvh import MIXAMO, Convention, body_positions, body_rotations, grounded_root, squat, write_squat

from physique import rotations as rot
from physique.errors import InputError
from physique.motion.conventions import known_conventions, plain_name
from physique.motion.kinematics import joint_positions, motion_world
from physique.motion.read import read_motion
from physique.skeleton import INDEX

CONVENTIONS = {
    "mixamo": Convention(prefix="mixamorig:"),
    "mixamo, A-pose": Convention(prefix="mixamorig:", arms_down=np.radians(45)),
    "z up, metres": Convention(up="z", units_per_meter=1.0),
    "z up, millimetres, heading": Convention(up="z", units_per_meter=1000.0, heading=2.0),
    "inches, splayed legs": Convention(units_per_meter=1 / 0.0254, splay=np.radians(20)),
    "hanging arms": Convention(arms_down=np.radians(90), order="YXZ"),
    "T-pose before the motion": Convention(lead_in_tpose=True, heading=-1.0),
    "feet, all at once": Convention(
        up="z", units_per_meter=1 / 0.3048, splay=0.3, arms_down=1.0, heading=0.5
    ),
}


@pytest.mark.parametrize("name", CONVENTIONS)
def test_the_squat_comes_out_the_same(tmp_path: Path, name: str) -> None:
    path = tmp_path / "squat.bvh"
    write_squat(path, CONVENTIONS[name])
    motion = read_motion(path, low_pass=None)
    flex, lift = squat()
    assert motion.frames == len(flex)

    # The knee bends about y alone, by what was written.
    for side in ("left", "right"):
        knee = rot.log(motion.rotations[:, INDEX[f"{side}_knee"]])
        np.testing.assert_allclose(knee[:, 1], flex, atol=1e-5)
        np.testing.assert_allclose(knee[:, [0, 2]], 0.0, atol=1e-5)
    shoulder = rot.log(motion.rotations[:, INDEX["left_shoulder"]])
    np.testing.assert_allclose(shoulder[:, 0], -lift, atol=1e-5)

    # Feet flat and on the floor throughout, facing +x.
    world, places = motion_world(motion)
    for joint in ("pelvis", "spine3", "left_ankle", "right_ankle", "left_foot", "head"):
        turn = np.linalg.norm(rot.log(world[:, INDEX[joint]]), axis=-1)
        assert np.degrees(turn).max() < 0.01, joint
    assert motion.contacts.all()
    assert np.abs(places[:, INDEX["left_foot"], 2] - 0.025).max() < 1e-4
    np.testing.assert_allclose(motion.rest_joints[INDEX["left_ankle"], 2], 0.07, atol=1e-4)

    # Every joint of the file is where it was.
    for t in (0, 20, 30):
        pose = body_rotations(flex[t], lift[t])
        expected = body_positions(pose, grounded_root(pose))
        for joint in ("head", "neck", "left_wrist", "right_elbow", "right_knee", "left_foot"):
            got = places[t, INDEX[joint]] - places[t, INDEX["left_ankle"]]
            want = expected[joint] - expected["left_ankle"]
            np.testing.assert_allclose(got, want, atol=1e-4, err_msg=f"{joint} at {t}")


def test_an_armature_turned_as_a_whole(tmp_path: Path) -> None:
    """Offsets are y up, but the root's rotation lays the motion down so that z is up."""
    path = tmp_path / "squat.bvh"
    write_squat(path, Convention(up="y", order="XYZ"))
    lines = path.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    for i in range(first, len(lines)):
        values = lines[i].split()
        x, y, z = (float(v) for v in values[:3])
        assert [float(v) for v in values[3:6]] == [0, 0, 0]
        values[:6] = [str(x), str(-z), str(y), "90", "0", "0"]
        lines[i] = " ".join(values)
    path.write_text("\n".join(lines))
    motion = read_motion(path, low_pass=None)
    knee = rot.log(motion.rotations[:, INDEX["left_knee"]])
    np.testing.assert_allclose(knee[:, 1], squat()[0], atol=1e-5)
    assert motion.contacts.all()


def test_unknown_skeleton_lists_joints_and_remedy(tmp_path: Path) -> None:
    convention = Convention()
    convention.names = {name: f"Bone{i:02d}" for i, name in enumerate(convention.names)}
    path = tmp_path / "odd.bvh"
    write_squat(path, convention)
    with pytest.raises(InputError) as caught:
        read_motion(path)
    for word in ("Bone00", "Bone17", "--mapping", "docs/motion.md", "motionbuilder"):
        assert word in str(caught.value)

    # A mapping file makes it readable.
    names = convention.names
    lines = ['up = "y"', "unit = 0.01", "[joints]", f'spine = ["{names["spine"]}", "{names["chest"]}"]']
    lines += [f'{k} = "{v}"' for k, v in names.items() if k not in ("spine", "chest")]
    mapping = tmp_path / "odd.toml"
    mapping.write_text("\n".join(lines))
    motion = read_motion(path, mapping=mapping, low_pass=None)
    knee = rot.log(motion.rotations[:, INDEX["left_knee"]])
    np.testing.assert_allclose(knee[:, 1], squat()[0], atol=1e-5)

    good = mapping.read_text()
    for old, new, message in (
        ("unit = 0.01", "unit = 0.1", "a person of 17"),
        ("unit = 0.01", "unit = -1", "the unit -1"),
        ("unit = 0.01", "units_m = 1", "the key 'units_m'"),
        ("unit = 0.01", "unit = nan", "the unit nan"),
        ("unit = 0.01", "tpose = " + "9" * 5000, "text that is not TOML"),
        ("unit = 0.01", "units = " + "[" * 5000, "text that is not TOML"),
        ('up = "y"', 'up = "x"', "up = 'x'"),
        ('up = "y"', "up = y", "text that is not TOML"),
        ("[joints]", "[bones]", "the key 'bones'"),
        ("[joints]", 'tpose = "first"\n[joints]', "tpose = 'first'"),
        ("[joints]", "tpose = 99\n[joints]", "frame 99"),
        ("left_knee", "left_patella", "the body joint 'left_patella'"),
        (f'left_knee = "{names["left_knee"]}"', "", "no line for left_knee"),
        (f'"{names["left_knee"]}"', '"Bone99"', "the joint 'Bone99'"),
        (f'"{names["left_knee"]}"', f'"{names["right_knee"]}"', "limbs that do not hang together"),
        (f'"{names["left_knee"]}"', "[]", "left_knee = "),
    ):
        assert old in good
        mapping.write_text(good.replace(old, new, 1))
        with pytest.raises(InputError, match=message.replace("[", r"\[")):
            read_motion(path, mapping=mapping)


def test_hips_in_one_place_are_refused(tmp_path: Path) -> None:
    names = {**MIXAMO, "left_hip": "Hips", "right_hip": "Hips"}
    mapping = tmp_path / "odd.toml"
    mapping.write_text("[joints]\n" + "".join(f'{k} = "{v}"\n' for k, v in names.items() if k != "chest"))
    path = tmp_path / "squat.bvh"
    write_squat(path, Convention())
    with pytest.raises(InputError, match="hips that are not beside each other"):
        read_motion(path, mapping=mapping)


@pytest.mark.parametrize("length", [0.0, 1e-12])
def test_bones_without_length_are_refused(tmp_path: Path, length: float) -> None:
    path = tmp_path / "squat.bvh"
    write_squat(path, Convention())
    lines = path.read_text().splitlines()
    shin = next(i for i, line in enumerate(lines) if line.split()[-1:] == ["LeftFoot"])
    lines[shin + 2] = f"OFFSET 0 {length} 0"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match="no distance between left knee and left ankle"):
        read_motion(path)


@pytest.mark.parametrize("units_per_meter", [1e-6, 1e-2, 1e4, 1e9])
def test_absurd_units_are_refused(tmp_path: Path, units_per_meter: float) -> None:
    path = tmp_path / "squat.bvh"
    write_squat(path, Convention(units_per_meter=units_per_meter))
    with pytest.raises(InputError, match=r"units high|no distance between"):
        read_motion(path)


def test_an_unusual_unit_is_scaled_and_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "squat.bvh"
    write_squat(path, Convention(units_per_meter=26.0))
    with caplog.at_level(logging.WARNING, logger="physique.motion"):
        motion = read_motion(path)
    assert "no usual unit; taken as 1.70 m" in caplog.text
    assert motion.rest_joints[INDEX["head"], 2] == pytest.approx(1.55, rel=0.05)


def test_swapped_sides_are_refused(tmp_path: Path) -> None:
    convention = Convention()
    convention.names = {
        key: convention.names[key.replace("left", "x").replace("right", "left").replace("x", "right")]
        for key in convention.names
    }
    path = tmp_path / "swapped.bvh"
    write_squat(path, convention)
    with pytest.raises(InputError, match="points backwards"):
        read_motion(path)


def test_names_are_compared_without_prefixes() -> None:
    for name in (
        "mixamorig:LeftArm",
        "mixamorig1_LeftArm",
        "Character1_LeftArm",
        "ns:left_arm",
        "LeftArm",
        "Left Arm",
        "LEFT-ARM",
    ):
        assert plain_name(name) == "leftarm", name
    assert plain_name("Bip01 L Thigh") == plain_name("Bip001 L Thigh") == "lthigh"
    assert plain_name("CC_Base_L_Thigh") == "lthigh"


def test_every_known_convention_maps_both_sides_alike() -> None:
    assert len(known_conventions()) >= 12
    for mapping in known_conventions():
        for key, chain in mapping.joints.items():
            if key.startswith("left_"):
                other = mapping.joints[key.replace("left_", "right_")]
                assert len(other) == len(chain)
                assert set(other).isdisjoint(chain)


@pytest.mark.parametrize(
    ("path", "fps", "tolerance"),
    [
        ("cmu/asfamc/02/02_01.amc", None, 0.001),
        ("cmu/bvh/131_01_max.bvh", None, 0.001),
        ("cmu/bvh/135_04.bvh", None, 0.01),
        ("cmu/bvh/60_01.bvh", 60.0, 0.01),
        ("cmu/bvh/jumping_jacks_30fps.bvh", None, 0.001),
        ("other/iclone_007_12.bvh", None, 0.001),
        ("other/jumping.bvh", None, 0.015),
        ("other/wave_hello.bvh", None, 0.015),
    ],
)
def test_real_skeletons_keep_their_joints_in_place(
    mocap: Path, path: str, fps: float | None, tolerance: float
) -> None:
    """Bones of the result lie as the file's do: joint distances agree, frame by frame."""
    from physique.motion import rig
    from physique.motion.conventions import recognize
    from physique.motion.kinematics import clip_world
    from physique.motion.read import read_clip
    from physique.motion.tpose import find_tpose

    clip = read_clip(mocap / path)
    mapping, joints = recognize(clip)
    tpose = find_tpose(clip, mapping, joints)
    places = joint_positions(rig.to_motion(clip, joints, tpose))
    theirs = clip_world(clip)[1] @ tpose.R_file_from_world * tpose.meters
    compared = [
        j
        for j in joints
        if j.split("_")[-1] in ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist")
    ]
    assert len(compared) >= 12
    for joint in compared:
        error = np.linalg.norm(places[:, INDEX[joint]] - theirs[:, joints[joint][0]], axis=-1)
        assert error.max() < tolerance, joint
