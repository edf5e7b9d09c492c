"""A body in a file: capsules, masses and mesh in one npz without pickles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique.body.capsule_body import CapsuleBody, Part
from physique.body.mesh import BodyMesh
from physique.errors import InputError
from physique.skeleton import JOINTS
from physique.store import read_npz, write_npz

Array = NDArray[np.generic]

FORMAT = "physique-body-1"
SHAPES = ("capsule", "box", "ellipsoid")
#: Name -> (kind of number, shape); V, F and E are free lengths.
LAYOUT: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "format": ("U", ()),
    "name": ("U", ()),
    "height": ("f", ()),
    "mass": ("f", ()),
    "joints": ("f", (22, 3)),
    "part_shape": ("i", (22,)),
    "part_size": ("f", (22, 3)),
    "part_center": ("f", (22, 3)),
    "part_rotation": ("f", (22, 3, 3)),
    "part_mass": ("f", (22,)),
    "part_com": ("f", (22, 3)),
    "part_inertia": ("f", (22, 3, 3)),
    "excluded": ("i", ("E", 2)),
}
#: These may be missing, all together: capsules that were made without a mesh.
SKIN: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "vertices": ("f", ("V", 3)),
    "faces": ("i", ("F", 3)),
    "weights": ("f", ("V", 22)),
    "surface": ("b", ("V",)),
    "volume": ("f", ()),
}
_LARGEST = 1e9
REMEDY = "write the file with `physique body --out`"


def save_body(path: str | Path, mesh: BodyMesh | None, body: CapsuleBody) -> None:
    """Write a capsule body, and its mesh if there is one, to an npz; whole or not at all."""
    parts = body.parts
    arrays: dict[str, Array] = {
        "format": np.array(FORMAT),
        "name": np.array(body.name),
        "height": np.array(body.height),
        "mass": np.array(body.mass),
        "joints": body.joints,
        "part_shape": np.array([SHAPES.index(p.shape) for p in parts]),
        "part_size": np.array([p.size for p in parts]),
        "part_center": np.array([p.center for p in parts]),
        "part_rotation": np.array([p.R_world_from_part for p in parts]),
        "part_mass": np.array([p.mass for p in parts]),
        "part_com": np.array([p.com for p in parts]),
        "part_inertia": np.array([p.inertia for p in parts]),
        "excluded": np.array(body.excluded, dtype=np.int64).reshape(-1, 2),
    }
    if mesh is not None:
        arrays |= {
            "vertices": mesh.vertices,
            "faces": mesh.faces,
            "weights": mesh.weights,
            "surface": mesh.surface,
            "volume": np.array(mesh.volume),
        }
    write_npz(path, arrays)


def load_body(path: str | Path) -> tuple[BodyMesh | None, CapsuleBody]:
    """Read what `save_body` wrote; no mesh where none was given.

    Raises InputError, naming the file and the array, for a missing, foreign or damaged file.
    """
    source = Path(path)
    data = read_npz(source)
    _check(source, data)
    joints = data["joints"].astype(float)
    name, height, mass = str(data["name"]), float(data["height"]), float(data["mass"])
    mesh = None
    if "vertices" in data:
        mesh = BodyMesh(
            name=name,
            vertices=data["vertices"].astype(float),
            faces=data["faces"].astype(np.int32),
            joints=joints,
            weights=data["weights"].astype(float),
            surface=data["surface"].astype(bool),
            volume=float(data["volume"]),
            mass=mass,
        )
    parts = tuple(
        Part(
            name=joint,
            shape=SHAPES[int(data["part_shape"][i])],  # type: ignore[arg-type]
            size=data["part_size"][i].astype(float),
            center=data["part_center"][i].astype(float),
            R_world_from_part=data["part_rotation"][i].astype(float),
            mass=float(data["part_mass"][i]),
            com=data["part_com"][i].astype(float),
            inertia=data["part_inertia"][i].astype(float),
        )
        for i, joint in enumerate(JOINTS)
    )
    excluded = tuple((int(i), int(j)) for i, j in data["excluded"])
    return mesh, CapsuleBody(name, height, mass, joints, parts, excluded)


def _check(source: Path, data: dict[str, Array]) -> None:
    def fail(array: str, found: str, expected: str) -> None:
        raise InputError(f"{source}, {array}", found, expected, REMEDY)

    layout = LAYOUT | SKIN if any(name in data for name in SKIN) else LAYOUT
    missing = [name for name in layout if name not in data]
    if missing:
        fail("arrays", "no " + ", ".join(missing), "all arrays of a body file")
    free: dict[str, int] = {}
    for name, (kind, shape) in layout.items():
        array = data[name]
        fits = len(array.shape) == len(shape) and all(
            n == (free.setdefault(want, n) if isinstance(want, str) else want)
            for n, want in zip(array.shape, shape)
        )
        if not fits:
            fail(name, f"shape {array.shape}", f"shape {shape}")
        kinds = {"i": "iu", "f": "f"}.get(kind, kind)
        if array.dtype.kind not in kinds:
            fail(name, f"type {array.dtype}", f"type {kind}")
        if kind == "f" and not (np.abs(array) < _LARGEST).all():  # nan is not
            fail(name, "a number that is not finite", "finite numbers below 1e9")
    if str(data["format"]) != FORMAT:
        fail("format", repr(str(data["format"])), repr(FORMAT))
    limits = {"part_shape": len(SHAPES), "excluded": len(JOINTS)}
    if layout is not LAYOUT:
        limits["faces"] = len(data["vertices"])
    for name, high in limits.items():
        index = data[name]
        if index.size and not (index.min() >= 0 and index.max() < high):
            fail(name, f"numbers {index.min()} to {index.max()}", f"0 to {high - 1}")
    for name in ("height", "mass", "volume", "part_mass"):
        if name in layout and not (data[name].astype(float) > 0.0).all():
            fail(name, "a number that is not positive", "positive numbers")
    if abs(float(data["part_mass"].sum()) - float(data["mass"])) > 1e-6 * float(data["mass"]):
        fail("part_mass", f"a sum of {data['part_mass'].sum():g} kg", f"{data['mass']:g} kg")
    moments = np.linalg.eigvalsh(data["part_inertia"].astype(float))
    if not (moments[:, 0] > 0).all() or (moments[:, 0] + moments[:, 1] < moments[:, 2] * (1 - 1e-9)).any():
        expected = "positive, each at most the sum of the others"
        fail("part_inertia", "moments that no rigid body can have", expected)
    turn = data["part_rotation"].astype(float)
    if np.abs(turn @ turn.transpose(0, 2, 1) - np.eye(3)).max() > 1e-6 or (np.linalg.det(turn) < 0).any():
        fail("part_rotation", "a matrix that is no rotation", "rotations")
    size = data["part_size"].astype(float)
    if not (size >= 0).all() or not (size[:, 0] > 0).all():
        fail("part_size", "a size that is not positive", "positive radii and half extents, m")
    if "weights" in layout and np.abs(data["weights"].sum(axis=1) - 1.0).max() > 1e-3:
        fail("weights", "rows that do not sum to 1", "rows that sum to 1")
