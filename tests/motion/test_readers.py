"""Which reader a file gets: by content first, by suffix second, and every format is listed."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest
from squat_bvh import Convention, write_squat

from physique.errors import InputError
from physique.motion.read import read_clip
from physique.motion.readers import READERS, choose_reader, formats


def test_content_wins_over_the_suffix(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "squat.bvh"
    write_squat(path, Convention())
    plain = read_clip(path)
    assert caplog.text == ""
    for name, warns in (("squat.amc", True), ("squat.txt", False), ("squat", False)):
        other = path.rename(tmp_path / name)
        caplog.clear()
        with caplog.at_level(logging.WARNING, logger="physique.motion"):
            assert read_clip(other).rotations.tolist() == plain.rotations.tolist()
        assert ("the content is BVH" in caplog.text) == warns
        path = other


def test_a_head_that_nobody_knows_goes_to_the_reader_of_its_suffix(tmp_path: Path) -> None:
    path = tmp_path / "odd.BVH"
    path.write_text("# made by hand\nHIERARCHY\n")
    assert choose_reader(path).name == "BVH"
    with pytest.raises(InputError, match="line 1: found '# made by hand'"):
        read_clip(path)


@pytest.mark.parametrize("content", [b"", b"\x7fELF\0\0", b"a text", b"\xff\xfe"])
def test_unknown_files_are_refused_with_the_formats(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "odd.xyz"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_clip(path)
    assert "found a .xyz file" in str(caught.value)
    for reader in READERS:
        assert all(suffix in str(caught.value) for suffix in (reader.name, *reader.suffixes))


def test_readers_have_suffixes_of_their_own() -> None:
    suffixes = [suffix for reader in READERS for suffix in reader.suffixes]
    assert len(set(suffixes)) == len(suffixes)
    assert all(suffix == suffix.lower() and suffix.startswith(".") for suffix in suffixes)
    assert formats() == "BVH (.bvh), Acclaim (.amc)"


def test_a_folder_is_no_clip(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file or embedded clip"):
        read_clip(tmp_path)
