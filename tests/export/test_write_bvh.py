"""BVH files read back, by pybvh and by a reader of our own, to the positions that were written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pybvh
import pytest
from scipy.spatial.transform import Rotation

from physique.errors import InputError
from physique.export.bvh import write_bvh
from physique.skeleton import INDEX, JOINTS, PARENTS

FRAMES, FPS = 60, 120.0


def _motion() -> dict[str, Any]:
    """A person who walks along +x, tumbles through every angle and ends upside down."""
    rng = np.random.default_rng(1)
    t = np.linspace(0, 1, FRAMES)
    offsets = rng.normal(scale=0.1, size=(22, 3)) + np.array([0.0, 0.0, 0.1])
    wave = rng.normal(scale=1.2, size=(22, 3, 3))
    vectors = sum(np.sin((k + 1) * np.pi * t)[:, None, None] * wave[..., k] for k in range(3))
    vectors[:, 0] = np.outer(t, [0.0, 2.6 * np.pi, 0.0])  # the root turns a whole somersault
    q = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_quat(scalar_first=True)
    root = np.stack([1.5 * t, 0.2 * np.sin(5 * t), 0.9 + 0.1 * np.cos(5 * t)], axis=1)
    return {
        "names": JOINTS,
        "parents": PARENTS,
        "offsets_m": offsets,
        "rotations_wxyz": q.reshape(FRAMES, 22, 4),
        "root_positions_m": root,
        "fps": FPS,
    }


def _positions(motion: dict[str, Any]) -> np.ndarray:
    """World positions (T, 22, 3), m, straight from the definition."""
    q, offsets = motion["rotations_wxyz"], motion["offsets_m"]
    out = np.empty((FRAMES, 22, 3))
    for frame in range(FRAMES):
        world: list[Rotation] = []
        for joint, parent in enumerate(PARENTS):
            own = Rotation.from_quat(q[frame, joint], scalar_first=True)
            if parent < 0:
                world.append(own)
                out[frame, joint] = motion["root_positions_m"][frame]
            else:
                world.append(world[parent] * own)
                out[frame, joint] = out[frame, parent] + world[parent].apply(offsets[joint])
    return out


def _read(path: Path) -> tuple[list[str], np.ndarray, np.ndarray, float]:
    """Names, positions (T, J, 3) in file units, angles (T, J, 3) degrees and the frame time.

    A reader that shares no line with the writer: it walks the text and multiplies matrices.
    """
    words = path.read_text().split()
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[tuple[int, str]] = []
    stack: list[int] = []
    current = -1
    at = 1
    while words[at] != "MOTION":
        word = words[at]
        if word in ("ROOT", "JOINT", "End"):
            current = len(names)
            names.append(words[at + 1])
            parents.append(stack[-1] if stack else -1)
            at += 2
        elif word == "{":
            stack.append(current)
            at += 1
        elif word == "}":
            stack.pop()
            at += 1
        elif word == "OFFSET":
            offsets.append([float(x) for x in words[at + 1 : at + 4]])
            at += 4
        else:
            assert word == "CHANNELS"
            n = int(words[at + 1])
            channels += [(current, name) for name in words[at + 2 : at + 2 + n]]
            at += 2 + n
    assert words[at + 1] == "Frames:"
    frames, time = int(words[at + 2]), float(words[at + 5])
    values = np.array(words[at + 6 :], dtype=float).reshape(frames, len(channels))
    positions = np.zeros((frames, len(names), 3))
    angles = np.zeros((frames, len(names), 3))
    for frame in range(frames):
        local = [np.eye(3) for _ in names]
        place = np.array(offsets)
        for (joint, channel), value in zip(channels, values[frame]):
            axis = "XYZ".index(channel[0])
            if channel.endswith("position"):
                place[joint, axis] = value
            else:
                local[joint] = local[joint] @ Rotation.from_euler(
                    channel[0], [value], degrees=True
                ).as_matrix().reshape(3, 3)
                angles[frame, joint, axis] = value
        world: list[np.ndarray] = []
        for joint, parent in enumerate(parents):
            world.append(local[joint] if parent < 0 else world[parent] @ local[joint])
            positions[frame, joint] = place[joint]
            if parent >= 0:
                positions[frame, joint] = positions[frame, parent] + world[parent] @ place[joint]
    return names, positions, angles, time


def _y_up(world: np.ndarray) -> np.ndarray:
    """x forward, y left, z up -> x left, y up, z forward."""
    return np.stack([world[..., 1], world[..., 2], world[..., 0]], axis=-1)


def test_own_reader_finds_the_same_positions(tmp_path: Path) -> None:
    motion = _motion()
    write_bvh(tmp_path / "a.bvh", **motion)
    names, positions, _, time = _read(tmp_path / "a.bvh")
    found = positions[:, [names.index(name) for name in JOINTS]] * 0.01
    assert np.abs(found - _y_up(_positions(motion))).max() < 1e-5
    assert time == pytest.approx(1 / FPS, rel=1e-8)


def test_pybvh_finds_the_same_positions(tmp_path: Path) -> None:
    motion = _motion()
    write_bvh(tmp_path / "a.bvh", **motion)
    bvh = pybvh.read_bvh_file(tmp_path / "a.bvh")
    found = np.asarray(bvh.joint_positions(centered="world"))
    found = found[:, [bvh.joint_names.index(name) for name in JOINTS]] * 0.01
    assert np.abs(found - _y_up(_positions(motion))).max() < 1e-5


def test_a_person_in_the_rest_pose_stands_and_looks_as_readers_expect(tmp_path: Path) -> None:
    motion = _motion()
    offsets = np.zeros((22, 3))
    offsets[INDEX["spine1"]] = [0.0, 0.0, 0.1]
    offsets[INDEX["left_hip"]] = [0.0, 0.1, 0.0]
    offsets[INDEX["left_foot"]] = [0.12, 0.0, 0.0]
    motion["offsets_m"] = offsets
    motion["rotations_wxyz"] = np.tile([1.0, 0, 0, 0], (FRAMES, 22, 1))
    write_bvh(tmp_path / "a.bvh", **motion)
    text = (tmp_path / "a.bvh").read_text()
    after = {name: text.split(f" {name}\n")[1].split("OFFSET")[1].split("\n")[0] for name in JOINTS}
    assert np.fromstring(after["spine1"], sep=" ") == pytest.approx([0, 10, 0])  # up is +y
    assert np.fromstring(after["left_hip"], sep=" ") == pytest.approx([10, 0, 0])  # left is +x
    assert np.fromstring(after["left_foot"], sep=" ") == pytest.approx([0, 0, 12])  # forward is +z
    assert text.count("End Site") == 5
    assert "ROOT pelvis" in text
    assert "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation" in text


def test_angles_do_not_jump(tmp_path: Path) -> None:
    motion = _motion()
    write_bvh(tmp_path / "a.bvh", **motion)
    names, _, angles, _ = _read(tmp_path / "a.bvh")
    root = angles[:, names.index("pelvis")]
    # The somersault about the left-right axis is 468 degrees about the file's x, through both of
    # the places where the middle angle of the order z, x, y folds back.
    assert np.abs(np.diff(root, axis=0)).max() < 10
    assert np.ptp(root[:, 0]) == pytest.approx(468, abs=0.1)


def test_writing_is_deterministic(tmp_path: Path) -> None:
    motion = _motion()
    write_bvh(tmp_path / "a.bvh", **motion)
    write_bvh(tmp_path / "b.bvh", **motion)
    assert (tmp_path / "a.bvh").read_bytes() == (tmp_path / "b.bvh").read_bytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"names": ("a b", *JOINTS[1:])}, "joint name 'a b'"),
        ({"names": ("head", *JOINTS[1:])}, "a joint name twice"),
        ({"parents": (*PARENTS[:-1], 21)}, "parents"),
        ({"offsets_m": np.zeros((21, 3))}, r"offsets of shape \(21, 3\)"),
        ({"rotations_wxyz": np.full((FRAMES, 22, 4), np.nan)}, "not finite"),
        ({"rotations_wxyz": np.ones((FRAMES, 22, 4))}, "not of length 1"),
        ({"root_positions_m": np.zeros((3, 3))}, "root positions of shape"),
        ({"fps": 0.0}, "frames a second"),
    ],
)
def test_faults_are_named_and_nothing_is_written(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=rf"a\.bvh: found .*{message}"):
        write_bvh(tmp_path / "a.bvh", **(_motion() | change))
    assert list(tmp_path.iterdir()) == []
