from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damage import fixed, value_or_one_line
from physique.body.bodyfile import load_body, save_body
from physique.body.capsule_body import CapsuleBody
from physique.body.mesh import BodyMesh
from physique.errors import InputError
from physique.store import read_npz, write_npz

Person = Callable[[str], tuple[BodyMesh, CapsuleBody]]


@pytest.fixture
def saved(person: Person, tmp_path: Path) -> Path:
    path = tmp_path / "average.npz"
    save_body(path, *person("average"))
    return path


def test_round_trip_is_exact(person: Person, saved: Path) -> None:
    mesh, body = person("average")
    mesh2, body2 = load_body(saved)
    for a, b in ((mesh, mesh2), (body, body2), *zip(body.parts, body2.parts)):
        for key, value in vars(a).items():
            if key != "parts":
                assert np.array_equal(value, getattr(b, key)), key
    assert [p.name for p in saved.parent.iterdir()] == ["average.npz"]


def test_capsules_without_a_mesh(person: Person, tmp_path: Path) -> None:
    _, body = person("average")
    save_body(tmp_path / "x.npz", None, body)
    mesh2, body2 = load_body(tmp_path / "x.npz")
    assert mesh2 is None
    assert np.array_equal(body2.joints, body.joints)
    assert body2.excluded == body.excluded


def change(path: Path, **arrays: object) -> None:
    with np.load(path) as data:
        kept = {name: data[name] for name in data.files}
    np.savez(path, **{**kept, **arrays})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arrays", "text"),
    [
        ({"format": np.array("other-1")}, "format: found 'other-1'"),
        ({"joints": np.zeros((21, 3))}, "joints: found shape (21, 3); expected shape (22, 3)"),
        ({"weights": np.zeros((5, 22))}, "weights: found shape (5, 22)"),
        ({"part_mass": np.zeros(22)}, "part_mass: found a number that is not positive"),
        ({"part_mass": np.ones(22)}, "part_mass: found a sum of 22 kg; expected 75 kg"),
        ({"part_com": np.full((22, 3), np.nan)}, "part_com: found a number that is not finite"),
        ({"part_shape": np.full(22, 7)}, "part_shape: found numbers 7 to 7; expected 0 to 2"),
        ({"faces": np.array([[0, 1, 10**6]])}, "faces: found numbers 0 to 1000000"),
        ({"faces": np.zeros((2, 3))}, "faces: found type float64; expected type i"),
        ({"part_inertia": np.zeros((22, 3, 3))}, "part_inertia: found moments"),
        ({"part_rotation": np.zeros((22, 3, 3))}, "part_rotation: found a matrix"),
        ({"excluded": np.array([[0, 22]])}, "excluded: found numbers 0 to 22"),
        ({"part_size": np.full((22, 3), -0.1)}, "part_size: found a size that is not positive"),
        ({"part_inertia": np.full((22, 3, 3), 1e200)}, "part_inertia: found a number that is not finite"),
        ({"height": np.array(-1.0)}, "height: found a number that is not positive"),
    ],
)
def test_damaged_files_are_refused(saved: Path, arrays: dict[str, object], text: str) -> None:
    change(saved, **arrays)
    with pytest.raises(InputError) as caught:
        load_body(saved)
    assert text in str(caught.value)
    assert str(saved) in str(caught.value)


@pytest.fixture(scope="module")
def stored(person: Person, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, np.ndarray]]:
    """A path, and the arrays of a good file of capsules."""
    path = tmp_path_factory.mktemp("body") / "capsules.npz"
    save_body(path, None, person("average")[1])
    return path, read_npz(path)


@settings(fixed, max_examples=150)
@given(data=st.data())
def test_a_body_or_one_line(stored: tuple[Path, dict[str, np.ndarray]], data: st.DataObject) -> None:
    """One array missing, of another type or shape, or with an odd number in it."""
    path, arrays = stored[0], dict(stored[1])
    name = data.draw(st.sampled_from(sorted(arrays)))
    odd = [np.nan, np.inf, 1e300, -1e300, -1.0, 0.0, 1e-300, "", "\0", True, 2**63, -1, 10**6]
    value = np.array(data.draw(st.sampled_from(odd)))
    array = arrays.pop(name)
    how = data.draw(st.integers(0, 4))
    if how == 1 and array.size and array.dtype.kind in "fi" and value.dtype.kind in "fi":
        array = array.astype(value.dtype)
        array.flat[data.draw(st.integers(0, array.size - 1))] = value
    elif how == 2:
        array = value
    elif how == 3:
        array = array[..., None]
    elif how == 4:
        array = np.zeros((0, *array.shape))
    write_npz(path, arrays if how == 0 else {**arrays, name: array}, compressed=False)
    made = value_or_one_line(lambda: load_body(path))
    if made is not None:
        assert all(np.isfinite(part.inertia).all() and part.size[0] > 0 for part in made[1].parts)


def test_missing_array(saved: Path) -> None:
    with np.load(saved) as data:
        kept = {name: data[name] for name in data.files if name != "volume"}
    np.savez(saved, **kept)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="found no volume"):
        load_body(saved)


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 torn"])
def test_foreign_files(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match="npz file"):
        load_body(path)
    with pytest.raises(InputError, match=r"none\.npz"):
        load_body(tmp_path / "none.npz")


def test_truncated_file(saved: Path) -> None:
    saved.write_bytes(saved.read_bytes()[:-2000])
    with pytest.raises(InputError, match="npz file"):
        load_body(saved)


def test_pickles_are_never_loaded(saved: Path) -> None:
    with np.load(saved) as data:
        kept = {name: data[name] for name in data.files}
    kept["name"] = np.array({"a": 1}, dtype=object)
    np.savez(saved, allow_pickle=True, **kept)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="npz file"):
        load_body(saved)


def test_nothing_half_written(person: Person, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x\.npz"):
        save_body(tmp_path / "none" / "x.npz", *person("average"))
    assert list(tmp_path.iterdir()) == []
