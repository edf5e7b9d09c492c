"""Files are whole or absent, equal for equal content, and damage is told in one line."""

from __future__ import annotations

import dataclasses
import io
import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damage import damaged, fixed, value_or_one_line
from physique.errors import InputError
from physique.store import prepare_folder, read_json, read_npz, write_atomic, write_json, write_npz

ARRAYS = {
    "q": np.random.default_rng(0).normal(size=(50, 57)),
    "names": np.array(["pelvis", "left_hip"]),
    "on": np.array([True, False]),
    "file": np.float64(3.5),
    "empty": np.zeros((0, 3), dtype=np.int32),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for the files that examples write over and over."""
    return tmp_path_factory.mktemp("damage")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_npz_round_trip_is_exact(tmp_path: Path) -> None:
    write_npz(tmp_path / "a.npz", ARRAYS)
    back = read_npz(tmp_path / "a.npz")
    assert set(back) == set(ARRAYS)
    for name, value in ARRAYS.items():
        assert back[name].dtype == np.asarray(value).dtype
        assert back[name].shape == np.asarray(value).shape
        np.testing.assert_array_equal(back[name], value)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as numpys:
        np.testing.assert_array_equal(numpys["q"], ARRAYS["q"])
    assert names(tmp_path) == ["a.npz"]


def test_npz_bytes_depend_on_the_arrays_alone(tmp_path: Path) -> None:
    write_npz(tmp_path / "a.npz", ARRAYS)
    write_npz(tmp_path / "b.npz", dict(reversed(ARRAYS.items())))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_npz_refuses_objects(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="Object arrays"):
        write_npz(tmp_path / "a.npz", {"x": np.array([{}], dtype=object)})
    assert names(tmp_path) == []
    np.savez(tmp_path / "b.npz", x=np.array([{}], dtype=object))
    with pytest.raises(InputError, match=r"b\.npz.*'x\.npy'.*Object arrays"):
        read_npz(tmp_path / "b.npz")


def damage(data: st.DataObject, content: bytes) -> bytes:
    """The bytes cut off anywhere, or with one of them changed."""
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        return content[:at]
    return content[:at] + bytes([content[at] ^ data.draw(st.integers(1, 255))]) + content[at + 1 :]


@settings(fixed, max_examples=150)
@given(data=st.data())
def test_damaged_npz_is_one_line_or_the_same_arrays(folder: Path, data: st.DataObject) -> None:
    path = folder / "a.npz"
    write_npz(path, ARRAYS)
    path.write_bytes(damage(data, path.read_bytes()))
    back = value_or_one_line(lambda: read_npz(path))
    # A byte that nobody reads, a date say, or a name: never other numbers.
    for name in set(back or ()) & set(ARRAYS):
        np.testing.assert_array_equal(back[name], ARRAYS[name])


@settings(fixed, max_examples=300)
@given(data=st.data())
def test_a_damaged_array_in_a_whole_zip_is_one_line_or_an_array(folder: Path, data: st.DataObject) -> None:
    """What no checksum catches: a writer that failed, not a disk."""
    member = io.BytesIO()
    np.save(member, ARRAYS["q"][:2])
    with zipfile.ZipFile(folder / "a.npz", "w") as archive:
        archive.writestr("q.npy", damage(data, member.getvalue()))
    back = value_or_one_line(lambda: read_npz(folder / "a.npz"))
    assert back is None or isinstance(back["q"], np.ndarray)


@settings(fixed, max_examples=300)
@given(text=damaged('{"a": [1, -2.5e3, "x"], "b": {"c": null, "d": true}}'))
def test_damaged_json_is_one_line_or_a_value(folder: Path, text: bytes) -> None:
    (folder / "a.json").write_bytes(text)
    back = value_or_one_line(lambda: read_json(folder / "a.json"))
    json.dumps(back, allow_nan=False)


def test_a_zip_that_claims_too_much_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_npz(path, {"x": np.zeros(3)})
    content = path.read_bytes()
    central = content.index(b"PK\x01\x02")
    claim = (2**32 - 2).to_bytes(4, "little")
    path.write_bytes(content[: central + 24] + claim + content[central + 28 :])
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("y.npy", b"")
        archive.writestr("z.npy", b"12345678")
    with pytest.raises(InputError, match=r"a\.npz: found more than 4 GiB"):
        read_npz(path)


def test_truncated_npz_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_npz(path, ARRAYS)
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(InputError, match=r"a\.npz: found .*not a zip.*expected a whole npz"):
        read_npz(path)


def test_damaged_array_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_npz(path, {"q": ARRAYS["q"]})
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.npz: found array 'q\.npy' damaged"):
        read_npz(path)


def test_json_converts_what_results_hold(tmp_path: Path) -> None:
    @dataclasses.dataclass(frozen=True)
    class Result:
        mass: float
        where: Path

    value = {
        "z": np.float32(0.5),
        "a": np.arange(6, dtype=np.int32).reshape(2, 3),
        "nan": float("nan"),
        "inf": [np.inf, -np.inf, np.float64("nan")],
        "flag": np.bool_(True),
        "result": Result(70.5, Path("out")),
        "tuple": (1, None, "ä"),
        7: 1,
    }
    write_json(tmp_path / "a.json", value)
    text = (tmp_path / "a.json").read_text(encoding="utf-8")
    strict = json.loads(text, parse_constant=lambda constant: pytest.fail(constant))
    assert strict == read_json(tmp_path / "a.json")
    assert strict == {
        "z": 0.5,
        "a": [[0, 1, 2], [3, 4, 5]],
        "nan": None,
        "inf": [None, None, None],
        "flag": True,
        "result": {"mass": 70.5, "where": "out"},
        "tuple": [1, None, "ä"],
        "7": 1,
    }
    assert list(strict) == sorted(strict)
    write_json(tmp_path / "b.json", dict(reversed(value.items())))
    assert (tmp_path / "b.json").read_bytes() == (tmp_path / "a.json").read_bytes()


def test_json_refuses_the_rest(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="set"):
        write_json(tmp_path / "a.json", {"x": {1, 2}})
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b'{"a": 1,\n "b": ', "line 2, column 7"),
        (b"", "line 1, column 1"),
        (b'{"a": NaN}', "NaN"),
        (b'{"a": 1e999}', "1e999"),
        (b'"\xff"', "utf-8"),
        (b"[" * 200_000, "recursion"),
    ],
)
def test_damaged_json(tmp_path: Path, content: bytes, fault: str) -> None:
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(InputError, match=rf"a\.json: found .*{fault}"):
        read_json(tmp_path / "a.json")


def test_missing_files(tmp_path: Path) -> None:
    for read in (read_npz, read_json):
        with pytest.raises(InputError, match="gone: found no such file"):
            read(tmp_path / "gone")
        with pytest.raises(InputError, match="is a directory"):
            read(tmp_path)


def test_write_into_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x\.bin: found no such file or directory"):
        write_atomic(tmp_path / "gone" / "x.bin", b"1")


def test_failed_write_leaves_old_file_and_no_rest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_atomic(tmp_path / "x.bin", b"old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="no space left on device"):
        write_atomic(tmp_path / "x.bin", b"new")
    assert names(tmp_path) == ["x.bin"]
    assert (tmp_path / "x.bin").read_bytes() == b"old"


def test_new_file_has_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "plain").write_bytes(b"")
    write_atomic(tmp_path / "x.bin", b"new")
    assert (tmp_path / "x.bin").stat().st_mode == (tmp_path / "plain").stat().st_mode


# Writes 'new' to argv[1] and is killed at the step named by argv[2].
KILLED = """
import os, signal, sys
from physique.store import write_atomic
step = sys.argv[2]
def die(*arguments, **options):
    os.kill(os.getpid(), signal.SIGKILL)
setattr(os, step, die)
write_atomic(sys.argv[1], b"new" * 1_000_000)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_killed_in_mid_write_leaves_the_old_file_whole(tmp_path: Path, step: str) -> None:
    path = tmp_path / "x.bin"
    write_atomic(path, b"old")
    done = subprocess.run([sys.executable, "-c", KILLED, str(path), step], check=False)
    assert done.returncode == -signal.SIGKILL
    assert path.read_bytes() == b"old"
    write_atomic(path, b"next")  # what the dead writer left behind is in nobody's way
    assert path.read_bytes() == b"next"


ENDLESS = """
import sys
from physique.store import write_npz
import numpy as np
n = 0
while True:
    write_npz(sys.argv[1], {"x": np.full(300_000, n)})
    n += 1
    if n == 2:
        sys.stdout.write("ready"); sys.stdout.flush()
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_killed_at_any_time_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    for pause in (0.0, 0.013, 0.031):
        process = subprocess.Popen([sys.executable, "-c", ENDLESS, str(path)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        assert process.stdout.read(5) == b"ready"
        time.sleep(pause)
        process.kill()
        process.wait()
        process.stdout.close()
        x = read_npz(path)["x"]
        assert len(np.unique(x)) == 1
        assert x.shape == (300_000,)


def test_prepare_folder(tmp_path: Path) -> None:
    made = prepare_folder(tmp_path / "a" / "b")
    assert made.is_dir()
    assert prepare_folder(made) == made
    assert names(made) == []
    (tmp_path / "file").write_text("x")
    for blocked in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match=r"file.*expected a folder that can be written"):
            prepare_folder(blocked)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder that takes no files")
def test_prepare_folder_without_permission() -> None:
    with pytest.raises(InputError, match=r"/proc/run: found .*expected a folder"):
        prepare_folder("/proc/run")
