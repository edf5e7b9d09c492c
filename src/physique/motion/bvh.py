"""BVH files: a text hierarchy and one row of channel values a frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot
from physique.errors import InputError
from physique.motion.clip import Clip

Array = NDArray[np.float64]

_LARGEST = 1e9  # no unit makes a person so large; squares of such numbers stay finite


@dataclass
class _Node:
    """One joint while the hierarchy is being read; `columns` are its places in a frame's row."""

    name: str
    parent: int
    line: int
    offset: list[float] | None = None
    rotation_axes: str = ""
    rotation_columns: list[int] = field(default_factory=list)
    position_axes: str = ""
    position_columns: list[int] = field(default_factory=list)


def read_bvh(path: Path) -> Clip:
    """The clip in a BVH file.

    Every joint may have position channels and none to three rotation channels, in any order; end
    sites become joints named "<parent> end". Keywords may be in either case.

    Raises InputError, naming the line, for anything that is not a complete BVH file: missing
    sections, unbalanced braces, duplicate joint names, rows of a wrong length, a row count that
    differs from "Frames:", values that are not finite, a frame time that is not positive.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(
            str(path),
            error.strerror or "an unreadable file",
            "a BVH file",
            "check the path and its permissions",
        ) from error
    lines = text.splitlines()
    if not text.strip():
        raise InputError(str(path), "an empty file", "a BVH file", "copy or export the file anew")
    nodes, channels, row = _read_hierarchy(lines, path)
    frame_count, frame_time, row = _read_motion_header(lines, row, path)
    values = _read_rows(lines, row, frame_count, channels, path)
    return _to_clip(nodes, values, 1.0 / frame_time, path)


def _error(path: Path, line: int, found: str, expected: str, remedy: str) -> InputError:
    return InputError(f"{path}, line {line + 1}", found, expected, remedy)


def _floats(parts: list[str], path: Path, line: int, what: str) -> list[float]:
    try:
        values = [float(part) for part in parts]
    except ValueError as error:
        found = f"{' '.join(parts)[:60]!r}"
        raise _error(path, line, found, f"numbers for {what}", "correct the line") from error
    if not np.all(np.abs(values) < _LARGEST):  # nan is not
        raise _error(
            path,
            line,
            f"{what} that is not finite",
            "finite numbers below 1e9",
            "repair the value or export the file anew",
        )
    return values


def _read_hierarchy(lines: list[str], path: Path) -> tuple[list[_Node], int, int]:
    """Joints in file order, the number of channels, and the line after "MOTION"."""
    nodes: list[_Node] = []
    names: set[str] = set()
    open_nodes: list[int] = []
    pending: int | None = None  # the joint whose "{" has not come yet
    channels = 0
    for number, line in enumerate(lines):
        parts = line.replace("{", " { ").replace("}", " } ").split()
        if not parts:
            continue
        keyword = parts[0].lower()
        braces = [part for part in parts if part in "{}"]
        if keyword in ("root", "joint", "end"):
            parent = open_nodes[-1] if open_nodes else -1
            if keyword == "root" and nodes:
                raise _error(
                    path,
                    number,
                    "a second ROOT",
                    "one skeleton a file",
                    "split the file, one skeleton in each",
                )
            if keyword != "root" and parent < 0:
                raise _error(path, number, f"{parts[0]} outside ROOT", "ROOT first", "correct the hierarchy")
            if pending is not None:
                raise _error(
                    path,
                    number,
                    f"{parts[0]} before '{{'",
                    "'{' after a joint's name",
                    "correct the hierarchy",
                )
            name = " ".join(part for part in parts[1:] if part not in "{}")
            if keyword == "end":
                name = f"{nodes[parent].name} end"
                while name in names:  # two end sites under one joint
                    name += "'"
            if not name or name in names:
                raise _error(
                    path,
                    number,
                    f"the joint name {name!r} twice" if name else "no name",
                    "a different name for every joint",
                    "rename the joint",
                )
            names.add(name)
            nodes.append(_Node(name, parent, number))
            pending = len(nodes) - 1
        elif keyword == "offset":
            if not open_nodes or pending is not None:
                raise _error(
                    path, number, "OFFSET outside a joint", "OFFSET after '{'", "correct the hierarchy"
                )
            offset = _floats([p for p in parts[1:] if p not in "{}"], path, number, "OFFSET")
            if len(offset) != 3:
                raise _error(
                    path, number, f"{len(offset)} values", "3 values after OFFSET", "correct the line"
                )
            nodes[open_nodes[-1]].offset = offset
        elif keyword == "channels":
            if not open_nodes:
                raise _error(
                    path, number, "CHANNELS outside a joint", "CHANNELS after '{'", "correct the hierarchy"
                )
            channels += _add_channels(nodes[open_nodes[-1]], parts, channels, path, number)
        elif keyword == "motion":
            if not nodes:
                break
            if open_nodes:
                raise _error(
                    path, number, "MOTION inside an open '{'", "a '}' for every '{'", "correct the hierarchy"
                )
            for node in nodes:
                if node.offset is None:
                    raise _error(
                        path,
                        node.line,
                        f"joint {node.name!r} without OFFSET",
                        "an OFFSET line",
                        "export the file anew",
                    )
            return nodes, channels, number + 1
        elif keyword not in ("hierarchy", "{", "}"):
            raise _error(
                path,
                number,
                f"{line.strip()[:60]!r}",
                "HIERARCHY, ROOT, JOINT, OFFSET, CHANNELS, End Site or MOTION",
                "check that this is a BVH file",
            )
        for brace in braces:
            if brace == "{":
                if pending is None:
                    raise _error(
                        path, number, "'{' without a joint", "JOINT before '{'", "correct the hierarchy"
                    )
                open_nodes.append(pending)
                pending = None
            else:
                if not open_nodes:
                    raise _error(path, number, "'}' too many", "a '{' for every '}'", "correct the hierarchy")
                open_nodes.pop()
    missing = "MOTION section" if nodes else "ROOT joint"
    raise _error(
        path,
        max(len(lines) - 1, 0),
        f"no {missing}",
        "HIERARCHY, then MOTION",
        "check that the file is complete",
    )


def _add_channels(node: _Node, parts: list[str], first: int, path: Path, line: int) -> int:
    """Record a CHANNELS line in the node; how many channels it lists."""
    names = [part for part in parts[2:] if part not in "{}"]
    if len(parts) < 2 or not parts[1].isdigit() or int(parts[1]) != len(names):
        raise _error(
            path, line, f"{' '.join(parts)[:80]!r}", "CHANNELS, a count, that many names", "correct the line"
        )
    for column, name in enumerate(names, start=first):
        axis, kind = name[:1].lower(), name[1:].lower()
        if axis not in ("x", "y", "z") or kind not in ("position", "rotation"):
            raise _error(
                path, line, f"channel {name!r}", "Xposition, ... or Xrotation, ...", "correct the line"
            )
        seen = node.position_axes if kind == "position" else node.rotation_axes
        if axis in seen:
            raise _error(path, line, f"channel {name!r} twice", "each channel once", "correct the line")
        if kind == "position":
            node.position_axes += axis
            node.position_columns.append(column)
        else:
            node.rotation_axes += axis
            node.rotation_columns.append(column)
    return len(names)


def _read_motion_header(lines: list[str], row: int, path: Path) -> tuple[int, float, int]:
    """Frame count, seconds a frame, and the line of the first row."""
    found: dict[str, tuple[str, int]] = {}
    while row < len(lines) and len(found) < 2:
        key, colon, value = lines[row].partition(":")
        key = " ".join(key.lower().split())
        if lines[row].strip():
            if not colon or key not in ("frames", "frame time"):
                break
            found[key] = (value.strip(), row)
        row += 1
    for key in ("frames", "frame time"):
        if key not in found:
            raise _error(
                path,
                min(row, len(lines) - 1),
                f"no '{key.title()}:' line",
                "'Frames:' and 'Frame Time:' after MOTION",
                "check that the file is complete",
            )
    count_text, count_line = found["frames"]
    if not count_text.isdigit() or int(count_text) == 0:
        raise _error(
            path,
            count_line,
            f"Frames: {count_text[:40]}",
            "a count of 1 or more",
            "correct the line or export the file anew",
        )
    time_text, time_line = found["frame time"]
    frame_time = _floats([time_text.replace(",", ".")], path, time_line, "Frame Time")[0]
    if not 1e-4 <= frame_time <= 2.0:
        raise _error(
            path,
            time_line,
            f"Frame Time: {frame_time:g}",
            "0.0001 to 2 seconds",
            "correct the line (120 frames a second: 0.0083333)",
        )
    return int(count_text), frame_time, row


def _read_rows(lines: list[str], row: int, count: int, channels: int, path: Path) -> Array:
    """(count, channels) values; angles in degrees, as in the file."""
    rows: list[Array] = []
    for number in range(row, len(lines)):
        parts = lines[number].split()
        if not parts:
            continue
        if len(parts) != channels:
            raise _error(
                path,
                number,
                f"{len(parts)} values in frame {len(rows)}",
                f"{channels}, as the hierarchy has channels",
                "the file is cut off or damaged: copy or export it anew",
            )
        try:
            values = np.array(parts, dtype=np.float64)
        except ValueError:
            values = np.array(_floats(parts, path, number, f"frame {len(rows)}"))
        if not (np.abs(values) < _LARGEST).all():
            column = int(np.flatnonzero(~(np.abs(values) < _LARGEST))[0])
            raise _error(
                path,
                number,
                f"{parts[column]} in frame {len(rows)}, value {column + 1}",
                "finite numbers below 1e9",
                "repair the value or export the file anew",
            )
        rows.append(values)
    if len(rows) != count:
        raise InputError(
            str(path),
            f"{len(rows)} rows of values",
            f"Frames: {count}",
            f"copy it anew, or write 'Frames: {len(rows)}'",
        )
    return np.stack(rows)


def _to_clip(nodes: list[_Node], values: Array, fps: float, path: Path) -> Clip:
    T, J = len(values), len(nodes)
    offsets = np.array([node.offset for node in nodes], dtype=np.float64)
    rotations = np.tile(rot.IDENTITY, (T, J, 1))
    positions = np.tile(offsets, (T, 1, 1))
    for j, node in enumerate(nodes):
        if node.rotation_columns:
            angles = np.radians(values[:, node.rotation_columns])
            rotations[:, j] = rot.positive(rot.from_euler(node.rotation_axes, angles))
        if node.position_columns:
            axes = ["xyz".index(axis) for axis in node.position_axes]
            moved = values[:, node.position_columns]
            # Exporters differ: most write positions that replace OFFSET, some (iClone) write
            # what is added to it. The values themselves tell, where OFFSET is not zero.
            offset = offsets[j, axes]
            along = float(np.median(moved @ offset))
            added = along < 0.5 * float(offset @ offset)
            positions[:, j, axes] = moved + offset if added else moved
    return Clip(
        name=path.stem,
        source=str(path),
        joints=tuple(node.name for node in nodes),
        parents=np.array([node.parent for node in nodes], dtype=np.int64),
        offsets=offsets,
        rotations=rotations,
        positions=positions,
        fps=_whole_rate(fps),
    )


def _whole_rate(fps: float) -> float:
    """The rate, rounded where the file's few digits meant a whole number: 120.00048 is 120."""
    whole = round(fps)
    return float(whole) if whole and abs(fps - whole) < 2e-4 * fps else fps
