"""BVH files of a motion, as Blender and MotionBuilder read them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from physique import rotations, skeleton
from physique.errors import InputError
from physique.reference import reduced
from physique.runs.run import Run
from physique.store import PathLike, write_atomic

Array = NDArray[np.float64]

#: The world (z up, x forward, y left) as seen in the file's frame (y up, z forward, x left).
R_FILE_FROM_WORLD: Array = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
_ORDER = "zxy"
_UNIT = 0.01  # m
_END = 0.35  # length of an End Site, as a part of its joint's own bone


def write_bvh(
    path: PathLike,
    names: Sequence[str],
    parents: Sequence[int] | NDArray[np.int64],
    offsets_m: ArrayLike,
    rotations_wxyz: ArrayLike,
    root_positions_m: ArrayLike,
    fps: float,
) -> Path:
    """Write a motion in the world of `physique.skeleton` as a BVH file; `path` comes back.

    names: J joints, the root first. parents: (J,), -1 for the root, before their children.
    offsets_m: (J, 3) m, rest position of each joint in its parent's frame; the root's is ignored.
    rotations_wxyz: (T, J, 4) of each joint in its parent's frame, the root's in the world.
    root_positions_m: (T, 3) m, world. fps: frames a second.
    The file is in centimetres, y is up and the person faces +z, as BVH readers expect. The root
    has six channels, the others Zrotation Xrotation Yrotation, in degrees; angles run on through
    half turns instead of jumping. Raises InputError where values do not fit together or the file
    cannot be written.
    """
    parent = np.asarray(parents, dtype=int)
    offsets = np.asarray(offsets_m, dtype=float)
    q = np.asarray(rotations_wxyz, dtype=float)
    root = np.asarray(root_positions_m, dtype=float)
    _check(path, names, parent, offsets, q, root, fps)
    offsets, root = offsets @ R_FILE_FROM_WORLD.T / _UNIT, root @ R_FILE_FROM_WORLD.T / _UNIT
    # The same turn seen from other axes: the axis turns, the angle stays.
    q = np.concatenate([q[..., :1], q[..., 1:] @ R_FILE_FROM_WORLD.T], axis=-1)
    angles = np.degrees(rotations.unwrap_euler(rotations.to_euler(_ORDER, rotations.normalize(q))))
    hierarchy, order = _hierarchy(names, parent, offsets)
    values = np.concatenate([root, angles[:, order].reshape(len(q), -1)], axis=1)
    lines = ["HIERARCHY", *hierarchy]
    lines += ["MOTION", f"Frames: {len(q)}", f"Frame Time: {1.0 / fps:.9g}"]
    # 1e-5 of a degree or of a centimetre is far below what can be seen.
    lines += [" ".join(f"{value:.5f}" for value in row) for row in values + 0.0]
    path = Path(path)
    write_atomic(path, ("\n".join(lines) + "\n").encode())
    return path


def write_run_bvh(path: PathLike, run: Run, *, source: bool = False) -> Path:
    """Write the simulated motion, or with `source` the source motion, on the body's own skeleton."""
    q = run.trajectory.source_q if source else run.trajectory.q
    return write_body_bvh(path, run.body.joints, q, 1.0 / run.timestep)


def write_body_bvh(path: PathLike, joints: Array, q: Array, fps: float) -> Path:
    """Write states q (T, 57) on a body's own skeleton, rest joints (22, 3) m, as a BVH file."""
    offsets = joints - joints[np.maximum(skeleton.PARENTS, 0)]
    turns = reduced.to_rotations(q[:, 3:7], q[:, 7:])
    return write_bvh(path, skeleton.JOINTS, skeleton.PARENTS, offsets, turns, q[:, :3], fps)


def _check(
    path: PathLike,
    names: Sequence[str],
    parent: NDArray[np.int64],
    offsets: Array,
    q: Array,
    root: Array,
    fps: float,
) -> None:
    def require(holds: bool, found: str, expected: str) -> None:
        if not holds:
            raise InputError(str(path), found, expected, "correct the motion to be written")

    count = len(names)
    frames = len(q)
    require(count > 0 and frames > 0, f"{count} joints, {frames} frames", "at least one of each")
    bad = [name for name in names if not name or any(c.isspace() or c in "{}" for c in name)]
    require(not bad, f"the joint name {bad[0]!r}" if bad else "", "names without blanks and braces")
    require(len(set(names)) == count, "a joint name twice", "different names")
    tree = parent.shape == (count,) and parent[0] == -1
    tree = tree and all(0 <= parent[j] < j for j in range(1, count))
    require(tree, f"parents {parent.tolist()}", "-1 for the first, then earlier joints")
    for name, array, shape in (
        ("offsets", offsets, (count, 3)),
        ("rotations", q, (frames, count, 4)),
        ("root positions", root, (frames, 3)),
    ):
        require(array.shape == shape, f"{name} of shape {array.shape}", f"{shape}")
        require(bool(np.isfinite(array).all()), f"{name} that are not finite", "numbers")
    length = np.linalg.norm(q, axis=-1)
    require(bool((np.abs(length - 1) < 1e-3).all()), "quaternions not of length 1", "unit ones")
    require(np.isfinite(fps) and fps > 0, f"{fps} frames a second", "a positive number")


def _hierarchy(
    names: Sequence[str], parent: NDArray[np.int64], offsets: Array
) -> tuple[list[str], list[int]]:
    """The lines of the tree, and the joints in the order in which it, and MOTION, has them."""
    lines: list[str] = []
    order: list[int] = []

    def walk(joint: int, depth: int) -> None:
        order.append(joint)
        pad = "\t" * depth
        offset = np.zeros(3) if joint == 0 else offsets[joint]
        rotation = " ".join(f"{axis.upper()}rotation" for axis in _ORDER)
        channels = f"6 Xposition Yposition Zposition {rotation}" if joint == 0 else f"3 {rotation}"
        lines.extend([f"{pad}{'ROOT' if joint == 0 else 'JOINT'} {names[joint]}", f"{pad}{{"])
        lines.extend([f"{pad}\tOFFSET {_row(offset)}", f"{pad}\tCHANNELS {channels}"])
        children = np.flatnonzero(parent == joint)
        for child in children:
            walk(int(child), depth + 1)
        if len(children) == 0:
            # Readers draw a leaf's bone up to its End Site, so it must have a length.
            end = _row(_END * offset)
            lines.extend([f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET {end}", f"{pad}\t}}"])
        lines.append(f"{pad}}}")

    walk(0, 0)
    return lines, order


def _row(v: Array) -> str:
    return " ".join(f"{x:.6f}" for x in v + 0.0)
