"""Every reader, the rig and the floor on damaged files: a motion or one line, never anything else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from person_asf import amc_text, asf_text, write_person
from squat_bvh import MIXAMO, Convention, write_squat

from damage import damaged, fixed, value_or_one_line
from physique.errors import InputError
from physique.motion.clip import Motion, rest_tracks
from physique.motion.conventions import read_mapping
from physique.motion.read import read_motion


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a good squat.bvh of four frames."""
    folder = tmp_path_factory.mktemp("damage")
    write_squat(folder / "squat.bvh", Convention(frames=4))
    return folder


def check(motion: Motion | None) -> None:
    """What is read in spite of the damage is a motion of numbers."""
    if motion is not None:
        assert motion.frames >= 2
        for array in (motion.root, motion.rest_joints, motion.rotations):
            assert np.isfinite(array).all()
        np.testing.assert_allclose(np.linalg.norm(motion.rotations, axis=-1), 1.0, atol=1e-6)


def test_the_files_to_be_damaged_are_read(folder: Path) -> None:
    check(read_motion(folder / "squat.bvh"))
    check(read_motion(write_person(folder)))


@fixed
@given(data=st.data())
def test_bvh(folder: Path, data: st.DataObject) -> None:
    path = folder / "damaged.bvh"
    path.write_bytes(data.draw(damaged((folder / "squat.bvh").read_text())))
    check(value_or_one_line(lambda: read_motion(path)))


@fixed
@given(asf=damaged(asf_text()))
def test_asf(folder: Path, asf: bytes) -> None:
    path = write_person(folder, asf=asf)
    check(value_or_one_line(lambda: read_motion(path)))


@fixed
@given(amc=damaged(amc_text()))
def test_amc(folder: Path, amc: bytes) -> None:
    path = write_person(folder, amc=amc)
    check(value_or_one_line(lambda: read_motion(path)))


NAMES = {**MIXAMO, "spine": ["Spine", "Spine1"], "left_elbow": ["LeftForeArm"]}
MAPPING = 'unit = 0.01\nunits = [0.01, 1.0]\nup = "y"\ntpose = 0\n[joints]\n' + "".join(
    f"{body} = {names!r}\n".replace("'", '"') for body, names in NAMES.items() if body != "chest"
)


@fixed
@given(toml=damaged(MAPPING))
def test_mapping(folder: Path, toml: bytes) -> None:
    path = folder / "mapping.toml"
    path.write_bytes(toml)
    check(value_or_one_line(lambda: read_motion(folder / "squat.bvh", mapping=path)))


@fixed
@given(noise=st.binary(max_size=300), suffix=st.sampled_from([".bvh", ".amc", ".asf", ".toml", ""]))
def test_noise(folder: Path, noise: bytes, suffix: str) -> None:
    path = folder / f"noise{suffix}"
    path.write_bytes(noise)
    if suffix == ".toml":
        assert value_or_one_line(lambda: read_mapping(path)) is None
    else:
        assert value_or_one_line(lambda: read_motion(path)) is None


def test_more_than_a_computer_holds_is_refused_before_it_is_made() -> None:
    with pytest.raises(InputError, match="1000 joints in 1000000 frames"):
        rest_tracks("clip", np.zeros((1000, 3)), 1_000_000)
